"""Errors of the closed form in double for 10,000 tops of 26 families against 50 digits, and the arithmetic they needed.

    python -m benchmarks.accuracy [TOPS OF EACH FAMILY] [PROCESSES]

Every constant is compared with the one from 50 digits, and theta, phi, psi and the axis at 1, 1e3 and 1e6 nutations (or
times, where there is no nutation) with the motion in 50 digits. An error beyond its allowance breaks the claim and is
printed with its top. Time: 60 ms a top and process, nearly all of it mpmath.
"""

import argparse
import math
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import numpy as np

from benchmarks.families import REGIMES, tops
from symtop.core.numbers import EPSILON, context
from symtop.model.charts import Array
from symtop.model.exact import closed_form, constants, layout as at
from symtop.model.exact.closed_form import ClosedForm
from symtop.model.exact.digits import PreciseForm, precise_constants
from symtop.model.top import Angles, SymmetricTop, flat

DIGITS, SEED, EACH, PIECE = 50, 25, 385, 11
NUTATIONS = (1.0371, 1000.37, 1000000.37)
QUANTITIES = ("theta", "phi", "psi", "axis")  # rad; phi and psi: the part that exceeds their last digit
CONSTANTS = (
    "rate of the phase (relative)",
    "phase at the start (quarter periods)",
    "mean rates (over the largest)",
    "angles at the start (rad)",
    "every other constant (units in the last place)",
)
LIMITS = (constants.RATE, 2e-18, 1e-28, 1e-18, 1.0)  # digits enough for 1e12 radians
LINES = (at.PHI_LINE, at.PSI_LINE, at.PHI_TURNS, at.DOWN_TURNS, at.UP_TURNS)
MARKS = (at.ARITHMETIC, at.RATE_ERROR, at.VALUE_ERROR)


class ErrorSummary(NamedTuple):
    """Largest errors of many tops, and the arithmetic that they needed."""

    motion: Array  # (nutations, quantities), largest errors
    constants: Array  # (5,), largest errors
    arithmetic: Counter[str]
    broken: list[str]  # tops that exceed an allowance

    @property
    def tops(self) -> int:
        """Number of tops."""
        return self.arithmetic.total()

    def share(self, arithmetic: str) -> float:
        """Fraction of the tops whose constants needed this arithmetic."""
        return self.arithmetic[arithmetic] / self.tops

    def largest(self, quantity: str) -> float:
        """Largest error of a quantity over all times."""
        return float(self.motion[:, QUANTITIES.index(quantity)].max())


def short(top: SymmetricTop, start: Angles) -> tuple[Array, int]:
    """The constants by the interpreted `motion_constants`, whatever their status, and that status."""
    out = [0.0] * at.SIZE
    status = constants.motion_constants(flat(top, start), out)
    return np.array(out), status


def deviation(ours: Array, true: Array) -> Array:
    """Errors of constants, in the order of `CONSTANTS`."""

    def gap(place: int) -> float:
        return float(abs((ours[place] - true[place]) + (ours[place + 1] - true[place + 1])))

    largest = max(abs(true[place]) for place in LINES) or 1.0
    rate = gap(at.QUARTERS) / (abs(true[at.QUARTERS]) or 1.0)
    means = max(gap(place) for place in LINES) / largest
    starts = max(gap(place + 2) / max(1.0, abs(true[place + 2])) for place in LINES)
    pairs = {place + k for place in (*LINES, at.QUARTERS) for k in range(4)} | set(MARKS)
    units = 0.0
    for place in set(range(at.SIZE)) - pairs:
        x, y = ours[place], true[place]
        if x != y and not (math.isnan(x) and math.isnan(y)):
            noise = 1e-29 * max(1.0, largest)  # allowed for numbers that vanish exactly, such as b - a u at a cusp
            units = max(units, max(abs(x - y) - noise, 0.0) / math.ulp(y))
    return np.array([rate, gap(at.QUARTERS + 2), means, starts, units])


def motion_errors(form: ClosedForm, precise: PreciseForm) -> tuple[Array, Array]:
    """Errors (nutations, quantities) of one form, and the largest allowed ones."""
    period = form.nutation_period if math.isfinite(form.nutation_period) else 1.0
    times = period * np.array(NUTATIONS)
    motion, axis, ctx = form(times), form.axis(times), context(DIGITS)
    errors, allowed = np.zeros((3, 4)), np.full((3, 4), 1e-15)
    for i, time in enumerate(times):
        true = precise(float(time))
        theta, phi, psi = map(ctx.convert, true[:3])
        place = ctx.sin(theta) * ctx.sin(phi), -ctx.sin(theta) * ctx.cos(phi), ctx.cos(theta)
        last = EPSILON * np.abs([float(phi), float(psi)])
        turns = abs(ctx.mpf(motion.phi[i]) - phi) - last[0], abs(ctx.mpf(motion.psi[i]) - psi) - last[1]
        tilt = max(abs(ctx.mpf(x) - y) for x, y in zip(axis[i], place, strict=True))
        errors[i] = [max(float(error), 0.0) for error in (abs(ctx.mpf(motion.theta[i]) - theta), *turns, tilt)]
        allowed[i, 0] = 1e-15 if theta < 2.0 else 2.0 * math.ulp(math.pi)
    return errors, allowed


def examine(kind: str, count: int, first: int) -> ErrorSummary:
    """Examine some tops of one family."""
    motion, constants, arithmetic, broken = np.zeros((3, 4)), np.zeros(5), Counter[str](), []
    for top, start in tops(count, SEED, [kind], first):
        form, precise = ClosedForm(top, start), PreciseForm(top, start, digits=DIGITS)
        errors, allowed = motion_errors(form, precise)
        ours, _ = short(top, start)
        gaps = deviation(ours, precise_constants(top, start, precise))
        if not ((errors <= allowed).all() and (gaps <= LIMITS).all() and gaps[0] <= ours[at.RATE_ERROR]):
            broken.append(f"{kind}: {top} {start} {errors.tolist()} {gaps.tolist()}")
        motion, constants = np.maximum(motion, errors), np.maximum(constants, gaps)
        arithmetic[form.provenance.arithmetic] += 1
    return ErrorSummary(motion, constants, arithmetic, broken)


def _pieces(count: int) -> Iterator[tuple[str, int, int]]:
    """Pieces of work of about a second: family, count, number of the first top."""
    for first in range(0, count, PIECE):
        for kind in REGIMES:
            yield kind, min(PIECE, count - first), first


def measure(count: int = EACH, jobs: int = 2, *, verbose: bool = False) -> ErrorSummary:
    """Examine this many tops of each family in this many processes."""
    closed_form.compile_now()
    total, pieces = ErrorSummary(np.zeros((3, 4)), np.zeros(5), Counter(), []), list(_pieces(count))
    with ProcessPoolExecutor(jobs) as pool:
        work = zip(*pieces, strict=True)
        for number, part in enumerate(map(examine, *work) if jobs == 1 else pool.map(examine, *work), 1):
            total = ErrorSummary(
                np.maximum(total.motion, part.motion), np.maximum(total.constants, part.constants),
                total.arithmetic + part.arithmetic, total.broken + part.broken,
            )  # fmt: skip
            if verbose:
                print(f"\r{number} of {len(pieces)} pieces", end="", file=sys.stderr, flush=True)
    if verbose:
        print(file=sys.stderr)
    return total


def lines(total: ErrorSummary) -> list[str]:
    """The tables."""
    head = f"{'largest error of ' + str(total.tops) + ' tops':<48}" + "".join(f"{name:>12}" for name in QUANTITIES)
    rows = [
        f"{f'at {nutations:g} nutations (rad; phi, psi beyond 1 ulp)':<48}" + "".join(f"{x:>12.2g}" for x in row)
        for nutations, row in zip(NUTATIONS, total.motion, strict=True)
    ]
    constants = [f"{name:<48}{x:>12.2g}" for name, x in zip(CONSTANTS, total.constants, strict=True)]
    shares = [f"{f'constants in {name}':<48}{count:>12}{total.share(name):>12.2%}"
              for name, count in total.arithmetic.most_common()]  # fmt: skip
    return [head, *rows, "", *constants, "", *shares, f"{'beyond its allowance':<48}{len(total.broken):>12}"]


def main() -> int:
    """Measure and print; exit code 1 if a top exceeds its allowance."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.accuracy", description=str(__doc__).partition("\n")[0])
    parser.add_argument("tops", type=int, nargs="?", default=EACH, help="of each family")
    parser.add_argument("processes", type=int, nargs="?", default=2)
    options = parser.parse_args()
    total = measure(options.tops, options.processes, verbose=True)
    print("\n".join([*lines(total), *total.broken]))
    return 1 if total.broken else 0


if __name__ == "__main__":
    sys.exit(main())
