"""What a second process is worth: the convergence study with one process and with two, kernels compiled before.

    python benchmarks/scaling.py [STUDY ...]

Each run has a results folder of its own; the seconds are those of the whole command, start-up, combining and drawing
included. Needs a machine with two cores that does nothing else. Exit code 1 below `ENOUGH`.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ENOUGH = 1.7  # times faster


def seconds(studies: list[str], jobs: int, *options: str) -> float:
    """Wall time of one command that computes everything."""
    with tempfile.TemporaryDirectory() as results:
        start = time.perf_counter()
        words = ["study", *studies, "--jobs", str(jobs), "--results", str(Path(results)), *options]
        subprocess.run([sys.executable, "-m", "symtop.cli", *words], check=True, stdout=subprocess.DEVNULL)
        return time.perf_counter() - start


def main() -> int:
    """Warm the caches, then measure."""
    studies = sys.argv[1:] or ["convergence"]
    seconds(studies, 2, "--quick")
    one, two = (seconds(studies, jobs) for jobs in (1, 2))
    print(f"{' '.join(studies)}: {one:.1f} s with one process, {two:.1f} s with two, {one / two:.2f} times faster")
    print(f"load average of the last minute (2 would be this alone): {os.getloadavg()[0]:.1f}")
    return 0 if one / two >= ENOUGH else 1


if __name__ == "__main__":
    sys.exit(main())
