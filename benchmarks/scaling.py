"""Speed-up by a second process: a study's accuracy grid with one worker and with two, kernels compiled before.

    python -m benchmarks.scaling [STUDY]

Timed is the computing of all cases, the start of the workers included; combining and drawing, which one process does in
either case, are not. Needs a machine with two cores that does nothing else. Exit code 1 below `ENOUGH`.
"""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

from symtop.runner import run as runner, scripts
from symtop.runner.cases import StudyCases
from symtop.runner.pool import Pool

ENOUGH = 1.7  # times faster


def seconds(name: str, jobs: int, *, quick: bool = False) -> float:
    """Wall time of computing a study's grid."""
    study = runner.load(name)
    with tempfile.TemporaryDirectory() as results:
        cases = StudyCases(study, Path(results).resolve())
        missing = cases.add(study.grid(quick=quick))
        start = time.perf_counter()
        with Pool(jobs) as pool:
            cases.compute(missing, pool, study.limit, fresh=True, quiet=True)
        return time.perf_counter() - start


def main() -> int:
    """Warm the caches, then measure."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scaling", description=str(__doc__).partition("\n")[0])
    parser.add_argument("study", nargs="?", default="convergence", choices=scripts.names())
    name = parser.parse_args().study
    seconds(name, 2, quick=True)
    one, two = (seconds(name, jobs) for jobs in (1, 2))
    print(f"{name}: {one:.1f} s with one worker, {two:.1f} s with two, {one / two:.2f} times faster")
    print(f"load average of the last minute (2 would be this alone): {os.getloadavg()[0]:.1f}")
    return 0 if one / two >= ENOUGH else 1


if __name__ == "__main__":
    sys.exit(main())
