"""What a user waits for before the first number: import, first use, and what `simulate` adds to a kernel."""

import os
import subprocess
import sys
import tempfile
import time

import symtop
from symtop.measure.timing import timings
from symtop.methods.plan import Plan

STEP = 0.01
FIRST = f"import symtop; symtop.simulate('spheroid', 'midpoint', step_size={STEP})"


def _process(code: str, cache: str | None = None) -> float:
    """Seconds of a new Python process."""
    environment = os.environ | ({"SYMTOP_CACHE": cache} if cache else {})
    begun = time.perf_counter()
    subprocess.run([sys.executable, "-c", code], check=True, env=environment, stdout=subprocess.DEVNULL)
    return time.perf_counter() - begun


def measure(repeats: int = 3) -> dict[str, float]:
    """Seconds of each; the smallest of `repeats`, but for the cold start, which happens once."""
    with tempfile.TemporaryDirectory() as cache:
        cold = _process(FIRST, cache)
        warm = min(_process(FIRST, cache) for _ in range(repeats))
    bare = min(_process("pass") for _ in range(repeats))
    scene = symtop.scene("spheroid")
    steps = round(scene.horizon / STEP)
    plan = Plan.steps(scene.horizon / steps, [steps], scene.horizon)
    solve = symtop.integrator("midpoint").solvers["angles"]
    whole, kernel = timings(
        [lambda: symtop.simulate(scene, "midpoint", step_size=STEP), lambda: solve(scene.top, scene.start, plan)],
        batches=15,
    )
    return {
        "python": bare,
        "import symtop": min(_process("import symtop") for _ in range(repeats)) - bare,
        "symtop --help": min(_process("from symtop.cli.main import main; main(['--help'])") for _ in range(repeats)),
        "first simulate, nothing cached": cold,
        "first simulate, kernels cached": warm,
        "simulate adds to its kernel": whole.best - kernel.best,
    }


def lines(found: dict[str, float]) -> list[str]:
    """The table."""
    return [f"{name:<42}{seconds * 1e3:>12.2f} ms" for name, seconds in found.items()]
