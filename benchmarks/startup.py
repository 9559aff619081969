"""Times until a user sees the first number: import and first use."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping

from benchmarks.pages import Table

STEP = 0.01
FIRST = f"import symtop; symtop.simulate('spheroid', 'midpoint', step_size={STEP})"


def _process(code: str, cache: str | None = None) -> float:
    """Seconds of a new Python process."""
    environment = os.environ | ({"SYMTOP_CACHE": cache} if cache else {})
    start = time.perf_counter()
    subprocess.run([sys.executable, "-W", "ignore", "-c", code], check=True, env=environment, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


def measure(repeats: int = 3) -> dict[str, float]:
    """Seconds of each, the smallest of `repeats`; the cold start is timed once."""
    with tempfile.TemporaryDirectory() as cache:
        cold = _process(FIRST, cache)
        warm = min(_process(FIRST, cache) for _ in range(repeats))
    bare = min(_process("pass") for _ in range(repeats))
    return {
        "python": bare,
        "import symtop": min(_process("import symtop") for _ in range(repeats)) - bare,
        "symtop --help": min(_process("from symtop.cli.main import main; main(['--help'])") for _ in range(repeats)),
        "first simulate, nothing cached": cold,
        "first simulate, kernels cached": warm,
    }


def table(seconds: Mapping[str, float]) -> Table:
    """The times as a table."""
    return Table("Starting", ["what", "ms"], [[name, f"{value * 1e3:.2f}"] for name, value in seconds.items()])
