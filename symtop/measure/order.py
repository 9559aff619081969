"""The order of a method: the slope of log error on log step, where it is honest to fit one.

A point counts if its error is above ten times the reference's own bound, below 1e-2 (asymptotic), still
above the run's round-off, and h omega < 0.3. The slope is the least-squares line through the points that
count, with Student's 95 % interval. Fewer than `LEAST` points give no verdict.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

LEAST = 5
LARGEST_ERROR = 1e-2
LARGEST_PHASE = 0.3  # h omega


class Fit(NamedTuple):
    """A fitted power law, error = constant * h^slope."""

    slope: float
    interval: float  # half-width of the 95 % confidence interval
    constant: float
    used: NDArray[np.bool_]

    def __str__(self) -> str:
        return f"{self.slope:.3f} +- {self.interval:.3f}" if math.isfinite(self.slope) else "not judged"


def power_law(x: ArrayLike, y: ArrayLike, used: ArrayLike | None = None) -> Fit:
    """Least squares of log y on log x over the used points; NaN with fewer than three."""
    from scipy.stats import t as student  # noqa: PLC0415  (0.5 s to import)

    x, y = np.asarray(x, float), np.asarray(y, float)
    mask = np.isfinite(x) & np.isfinite(y) & (x > 0.0) & (y > 0.0)
    if used is not None:
        mask &= np.asarray(used, bool)
    n = int(mask.sum())
    if n < 3:
        return Fit(math.nan, math.nan, math.nan, mask)
    u, v = np.log(x[mask]), np.log(y[mask])
    du, dv = u - u.mean(), v - v.mean()
    spread = float(du @ du)
    slope = float(du @ dv) / spread
    residual = dv - slope * du
    error = math.sqrt(float(residual @ residual) / (n - 2) / spread)
    constant = math.exp(float(v.mean() - slope * u.mean()))
    return Fit(slope, float(student.ppf(0.975, n - 2)) * error, constant, mask)


def order(step_size: ArrayLike, error: ArrayLike, bound: ArrayLike, omega: float) -> Fit:
    """The order of a method from errors at several steps; `bound` is the least error that can be judged.

    Points that stopped falling with the step (round-off) are cut: from the finest step upwards, a point
    whose error does not exceed its finer neighbour's by half the expected factor is not asymptotic.
    """
    h, e, b = (np.asarray(values, float) for values in np.broadcast_arrays(step_size, error, bound))
    used = np.isfinite(e) & (e > 10.0 * b) & (e < LARGEST_ERROR) & (h * omega < LARGEST_PHASE)
    falling = np.argsort(h)
    for finer, coarser in pairwise(falling):
        if used[coarser] and used[finer] and e[coarser] <= e[finer] * math.sqrt(h[coarser] / h[finer]):
            used[falling[: int(np.flatnonzero(falling == coarser)[0])]] = False
    fit = power_law(h, e, used)
    return fit if int(fit.used.sum()) >= LEAST else Fit(math.nan, math.nan, math.nan, used)
