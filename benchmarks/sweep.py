"""Time of a sweep of a thousand starts with the truth and errors of each run, and the cost of a certificate for each.

    python -m benchmarks.sweep [STARTS] [CERTIFIED]

The starts are a grid of inclinations and spins of one top, run with one method for a few nutations, all in one process.
A certificate compares the closed form of one start with 40 digits and an integration
(`symtop.run.reference.truth`), as every reference once did; some of the starts are certified, and their time is
what all would take.
"""

import argparse
import os
import tempfile
import time
from typing import NamedTuple

import numpy as np

import symtop
from symtop.model.exact import closed_form

METHOD, STEP, HORIZON = "strang[axis]", 0.02, 8.0
STARTS, CERTIFIED = 1000, 20


class SweepTimes(NamedTuple):
    """Seconds of a sweep and the errors of its runs."""

    starts: int
    seconds: float
    median: float  # rad, of the largest axis error of a run
    bound: float  # rad, the largest bound of the truth
    certified: float  # seconds that certificates of as many starts would take


def scenes(count: int) -> list[symtop.Scene]:
    """A grid of starts: let go at 0.2 to 2.9 rad with a spin of 2 to 12."""
    side = max(1, round(count**0.5))
    grid = [
        (theta, spin) for theta in np.linspace(0.2, 2.9, -(-count // side)) for spin in np.linspace(2.0, 12.0, side)
    ]
    top = symtop.SymmetricTop(2.0, 1.0, 2.0)
    return [
        symtop.Scene(f"start-{k}", top, symtop.Angles(float(theta), psi_dot=float(spin)), HORIZON)
        for k, (theta, spin) in enumerate(grid[:count])
    ]


def measure(count: int = STARTS, certified: int = CERTIFIED) -> SweepTimes:
    """Run the sweep once, kernels compiled, and certify a few of its starts."""
    closed_form.compile_now()
    for scene in scenes(2):
        symtop.errors(symtop.simulate(scene, METHOD, step_size=STEP))
    starts = scenes(count)
    start = time.perf_counter()
    tables = [symtop.errors(symtop.simulate(scene, METHOD, step_size=STEP)) for scene in starts]
    seconds = time.perf_counter() - start
    errors = [float(data["axis"].max()) for data in tables]
    bound = max(float(data["axis_bound"].max()) for data in tables)
    with tempfile.TemporaryDirectory() as cache:
        os.environ["SYMTOP_CACHE"] = cache
        sample = starts[:: max(1, count // certified)]
        start = time.perf_counter()
        for scene in sample:
            symtop.reference(scene, [HORIZON], certify="integration")
        certificate = (time.perf_counter() - start) / len(sample)
    return SweepTimes(len(starts), seconds, float(np.median(errors)), bound, certificate * len(starts))


def lines(swept: SweepTimes) -> list[str]:
    """The numbers."""
    return [
        f"{swept.starts} starts of {HORIZON / STEP:.0f} steps of {METHOD} with truth and errors: {swept.seconds:.2f} s",
        f"median of the largest axis errors {swept.median:.1e} rad, largest bound of the truth {swept.bound:.1e} rad",
        f"certificates of as many starts would take {swept.certified:.0f} s",
    ]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.sweep", description=str(__doc__).partition("\n")[0])
    parser.add_argument("starts", type=int, nargs="?", default=STARTS)
    parser.add_argument("certified", type=int, nargs="?", default=CERTIFIED, help="starts, of these")
    options = parser.parse_args()
    print("\n".join(lines(measure(options.starts, options.certified))))


if __name__ == "__main__":
    main()
