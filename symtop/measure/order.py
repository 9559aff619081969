"""The order of a method: the slope of log error on log step, where a line can be fitted.

A point counts if its error is above ten times the reference's own bound, below 1e-2, still above the run's round-off,
and h omega < 0.3 for a method of order 2 (in proportion more for higher orders, whose steps have more stages). Then the
line must be straight: the coarsest points are dropped while the log-log curve bends significantly or scatters. The
slope is the least-squares line through what is left, with Student's 95 % interval. Fewer than `LEAST` points, or an
interval beyond `WIDEST`, give no verdict: such an error meets rounding before it is a power of the step.
"""

import math
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symtop.measure.statistics import columns_fitted, line, student

LEAST = 5
LARGEST_ERROR = 1e-2
FLOOR = 1e3  # times the reference's bound: a finest error beyond it has not met rounding
LARGEST_PHASE = 0.3  # h omega
WIDEST = 0.2  # 95 % interval of a slope that still says something
STRAIGHT = 0.03  # change of slope over the window that does not matter


class Fit(NamedTuple):
    """A fitted power law, error = constant * h^slope."""

    slope: float  # NaN if it cannot be judged
    interval: float  # half-width of the 95 % confidence interval
    constant: float
    used: NDArray[np.bool_]
    reason: str = ""  # why it cannot be judged

    def __str__(self) -> str:
        return f"{self.slope:.3f} +- {self.interval:.3f}" if math.isfinite(self.slope) else "not judged"


def power_law(x: ArrayLike, y: ArrayLike, used: ArrayLike | None = None) -> Fit:
    """Least squares of log y on log x over the used points; NaN with fewer than three."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    mask = np.isfinite(x) & np.isfinite(y) & (x > 0.0) & (y > 0.0)
    if used is not None:
        mask &= np.asarray(used, bool)
    n = int(mask.sum())
    if n < 3:
        return Fit(math.nan, math.nan, math.nan, mask)
    fitted = line(np.log(x[mask]), np.log(y[mask]))
    u_mean, v_mean = fitted.middle
    constant = math.exp(float(v_mean - fitted.slope * u_mean))
    return Fit(fitted.slope, student(n - 2) * fitted.error, constant, mask)


def order(step_size: ArrayLike, error: ArrayLike, bound: ArrayLike, omega: float, claim: int | None = None) -> Fit:
    """The order of a method from errors at several steps; `bound` is the least error that can be judged.

    `claim` is the declared order and only widens the range of steps. From the finest step upwards, points are cut until
    an error exceeds its finer neighbour's by at least the root of the ratio of their steps: they have met round-off.
    A fit that cannot be judged says why.
    """
    h, e, b = (np.asarray(values, float) for values in np.broadcast_arrays(step_size, error, bound))
    phase = LARGEST_PHASE * max(claim or 2, 2) / 2.0
    rank = np.argsort(h)
    finest = e[rank][np.isfinite(e[rank])][:2]
    if finest.size == 0:
        return _unjudged(e, "every run failed")
    used = np.isfinite(e) & (e > 10.0 * b) & (e < LARGEST_ERROR) & (h * omega < phase)
    for place, (finer, coarser) in enumerate(pairwise(rank), start=1):
        if used[coarser] and used[finer]:
            if e[coarser] > e[finer] * math.sqrt(h[coarser] / h[finer]):
                break
            used[rank[:place]] = False
    fit = power_law(h, e, used)
    while int(used.sum()) > LEAST and (not fit.interval <= WIDEST or _bends(h[used], e[used])):
        used[rank[np.flatnonzero(used[rank])[-1]]] = False
        fit = power_law(h, e, used)
    if int(used.sum()) >= LEAST and fit.interval <= WIDEST and not _bends(h[used], e[used]):
        return fit
    if np.min(finest) > FLOOR * np.max(b):
        return _unjudged(used, "the error does not fall to rounding as a power of the step")
    return _unjudged(used, "fewer than five points lie on a straight line before rounding")


def _unjudged(used: NDArray[Any], reason: str) -> Fit:
    return Fit(math.nan, math.nan, math.nan, used.astype(bool), reason)


def _bends(h: NDArray[np.float64], e: NDArray[np.float64]) -> bool:
    """Does the slope change by more than `STRAIGHT` over these points, and significantly so?"""
    u, v = np.log(h) - np.log(h).mean(), np.log(e)
    matrix = np.stack([np.ones_like(u), u, u * u], axis=1)
    coefficients, deviations = columns_fitted(matrix, v)
    change = 2.0 * abs(float(coefficients[2])) * (u.max() - u.min())
    return bool(change > STRAIGHT and abs(coefficients[2]) > student(u.size - 3) * deviations[2])
