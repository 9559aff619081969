"""The order of a method: the slope of log error on log step, extrapolated to h = 0.

The error of a method of order p is

    error = C h^p (1 + a h^q + b h^2q + ...),      q = 2 for a symmetric method (its error has even powers only), else 1,

so that a slope measured at finite h differs from p by q a h^q. A straight line through many points has a small
standard error and a wrong slope. Here log error is fitted by

    log C + p log h + a h^q + b h^2q,

by least squares. A point counts if its error is above ten times the reference's own bound, below 1e-2, above
the run's round-off, and h omega < 0.45 for a method of order 2 (in proportion more for higher orders, whose steps have
more stages). Points within a thousand times the bound weigh less, as the bound is to the error. The coarsest points are
dropped while the correction a h^q + b h^2q exceeds `CORRECTION` there or the interval exceeds `WIDEST`.

The interval is the larger of Student's 95 % interval and `TRUNCATED` times the change of p that one more term of the
series makes, and never less than `RESOLVED`. It covers p in 93 to 97 % of synthetic curves with an h^2 correction and
the scatter of sampled maxima; that of a straight line covers it in less than 4 %.

One rule, `order_verdict`, says for every study whether a measured slope confirms a declared order.
Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, theorem II.3.2 (even powers of a symmetric method).
"""

import math
from collections.abc import Iterable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symtop.measure.statistics import columns_fitted, line, student

LEAST = 5
LARGEST_ERROR = 1e-2
FLOOR = 1e3  # times the reference's bound: a finest error beyond it has not met rounding
LARGEST_PHASE = 0.45  # h omega
WIDEST = 0.2  # 95 % interval of a slope that still says something
CORRECTION = 0.5  # of log error at the coarsest step, by which it differs from a straight line
TRUNCATED = 1.8  # times the effect of one more term: what the terms that are left out may do
RESOLVED = 1e-3  # half-width of an interval: rounding shifts slopes by less than this
TWO_TERMS = 7  # points from which on h^2q is fitted beside h^q
EXACT = 1e-3  # of an error: the reference's bound, beyond which a point weighs less
MISSES = 5.0  # standard deviations: a finest point further off the curve of the others has met round-off
VISIBLE = 0.01  # of an error, likewise
BESIDE = 0.05  # a slope this near to the declared order, beyond its interval, still is that order
CLEARLY = 0.4  # a slope further off than this, beyond its interval, is another order: orders are whole numbers

Array = NDArray[np.float64]


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
    """Least squares of log y on log x over the used points, a straight line; NaN with fewer than three."""
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


def order(
    step_size: ArrayLike,
    error: ArrayLike,
    bound: ArrayLike,
    omega: float,
    claim: int | None = None,
    *,
    symmetric: bool | None = None,
) -> Fit:
    """The order of a method as h -> 0, from errors at several steps; `bound` is the least error that can be judged.

    `claim` is the declared order and only widens the range of steps. For a `symmetric` method the series goes on in h^2.
    From the finest step upwards, points are cut until an error exceeds its finer neighbour's by at least the root of
    the ratio of their steps: they have met round-off. A fit that cannot be judged says why.
    """
    h, e, b = (np.asarray(values, float) for values in np.broadcast_arrays(step_size, error, bound))
    rank = np.argsort(h)
    finest = e[rank][np.isfinite(e[rank])][:2]
    if finest.size == 0:
        return _unjudged(e, "every run failed")
    used = np.isfinite(e) & (e > 10.0 * b) & (e < LARGEST_ERROR)
    used &= h * omega < LARGEST_PHASE * max(claim or 2, 2) / 2.0
    for place, (finer, coarser) in enumerate(pairwise(rank), start=1):
        if used[coarser] and used[finer]:
            if e[coarser] > e[finer] * math.sqrt(h[coarser] / h[finer]):
                break
            used[rank[:place]] = False
    places = rank[used[rank]]
    series = _series(h[places], e[places], b[places], 2 if symmetric else 1)
    if series is None:
        if np.min(finest) > FLOOR * np.max(b):
            return _unjudged(used, "the error does not fall to rounding as a power of the step")
        return _unjudged(used, "fewer than five points follow a power of the step before rounding")
    used = np.zeros(h.shape, dtype=bool)
    used[places[series.window]] = True
    return Fit(series.slope, series.interval, series.constant, used)


def order_verdict(claim: int | None, main: Fit, others: Iterable[Fit] = ()) -> str:
    """The one rule of every study: what a measured slope says of a declared order.

        confirmed   the interval, widened by `BESIDE`, holds the declared order
        refuted     the slope is off by more than `CLEARLY` beyond its interval, or one of the `others` (the same
                    method's slopes in other quantities, whose errors may fall faster by chance) is as much lower
        undecided   the slope lies between, or could not be measured
        measured    nothing is declared
    """
    if not math.isfinite(main.slope):
        return "undecided"
    if claim is None:
        return "measured"
    off = abs(main.slope - claim) - main.interval
    lower = any(fit.slope + fit.interval < claim - CLEARLY for fit in others)
    if off > CLEARLY or lower:
        return "refuted"
    return "confirmed" if off <= BESIDE else "undecided"


class _Series(NamedTuple):
    """The fitted series over points from fine to coarse."""

    slope: float
    interval: float
    constant: float
    window: slice


def _series(h: Array, e: Array, b: Array, power: int) -> _Series | None:
    """The fit to points from fine to coarse, over the widest window that the series describes; None if there is none."""
    first, last = 0, h.size
    weights = 1.0 / (1.0 + (b / (EXACT * e)) ** 2)
    u, v = np.log(h), np.log(e)
    while last - first >= LEAST:
        window = slice(first, last)
        terms = 2 if last - first >= TWO_TERMS else 1
        columns = _columns(u[window], h[window], power, terms)
        values, w = v[window], weights[window]
        fitted, deviations = columns_fitted(columns, values, w)
        correction = columns[:, 2:] * fitted[2:]
        if max(np.max(np.abs(correction.sum(axis=1))), 0.5 * np.sum(np.abs(correction[-1]))) > CORRECTION:
            last -= 1
            continue
        if last - first > LEAST + 1 and _missed(columns, values, w):
            first += 1
            continue
        interval = student(values.size - columns.shape[1]) * float(deviations[1])
        if values.size > columns.shape[1] + 1:
            further, _ = columns_fitted(_columns(u[window], h[window], power, terms + 1), values, w)
            interval = max(interval, TRUNCATED * abs(float(further[1] - fitted[1])))
        if interval > WIDEST:
            last -= 1
            continue
        return _Series(float(fitted[1]), max(interval, RESOLVED), math.exp(float(fitted[0])), window)
    return None


def _columns(u: Array, h: Array, power: int, terms: int) -> Array:
    """1, log h and the terms h^q, h^2q, ..., which are 1 at the coarsest step."""
    relative = (h / h[-1]) ** power
    return np.stack([np.ones_like(u), u, *(relative**k for k in range(1, terms + 1))], axis=1)


def _missed(columns: Array, values: Array, weights: Array) -> bool:
    """Does the finest point lie off the curve through the others, beyond their scatter?"""
    if values.size <= columns.shape[1] + 1:
        return False
    fitted, _ = columns_fitted(columns[1:], values[1:], weights[1:])
    rest = values[1:] - columns[1:] @ fitted
    scatter = float(weights[1:] @ rest**2) / (rest.size - columns.shape[1])
    inverse = np.linalg.pinv((columns[1:].T * weights[1:]) @ columns[1:])
    spread = math.sqrt(max(scatter * (1.0 / weights[0] + columns[0] @ inverse @ columns[0]), 0.0))
    return bool(abs(values[0] - columns[0] @ fitted) > max(VISIBLE, MISSES * spread))


def _unjudged(used: NDArray[Any], reason: str) -> Fit:
    return Fit(math.nan, math.nan, math.nan, used.astype(bool), reason)
