"""Growth laws of the errors of many runs, for prediction beyond the last measured horizon: arithmetic on arrays.

The largest errors E_k in stretches that end at the horizons H_k are fitted in relative terms by one power, or by two:

    E(H) = a H^p    or    a H^p + b H^q,    a, b >= 0,    p < q of 0, 1/2, 1, 3/2, 2 (see `symtop.measure.conservation`)

minimising sum (E(H_k)/E_k - 1)^2. The single power with the least sum is taken, or a pair with a smaller one if both
of its coefficients are positive at the level of `DOUBT` (Student) and the second carries at least `SHARE` of the error
at the end: an oscillation whose largest values scatter must not pass for a drift. Points above `SATURATED`, where an
angle cannot grow any further, and points before the last `DECADES` are left out.

A map that loses energy loses as much in every nutation, so that energy and shape grow as H at most. The phase is the
integral of a frequency that depends on the energy, and grows as H^2 at most. The form of a law is known in part: a
variant that is neither symplectic nor keeps the energy by construction drifts, however small its drift is compared with
its oscillation, so that for such a variant any positive second coefficient of energy and shape is taken, and one of the
phase at the level `LOOSE`. A drift that is still hidden at the last measured horizon is not predicted.

Rounding adds a random walk: with w the smallest energy error over sqrt(evaluations) of all settings of a variant, but
no more than the rounding of the energy itself,

    energy, shape   w sqrt(N)                        N evaluations up to the horizon
    axis            2 pi H w sqrt(N) / sqrt(3)       the phase under a walk of the energy, whose period changes with it

both with coefficient one, so that they are orders of magnitude, and limited by the measured errors (`least`): the
period of a fast top hardly changes with the energy of its nutation, and its axis walks much less. They are added in
quadrature.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from symtop.measure.order import student
from symtop.model.charts import Array

POWERS = (0.0, 0.5, 1.0, 1.5, 2.0)
PAIRS = ((0.0, 0.5), (0.0, 1.0), (0.0, 1.5), (0.0, 2.0), (1.0, 2.0))
DECADES = 2.5  # of the horizon, before the last measured point: earlier points are not fitted
SATURATED = 0.2  # errors from here on are not fitted: an angle cannot grow much further
FEWEST = 4  # least number of points of a fit
DOUBT, LOOSE = 1e-4, 0.025  # significance levels of the coefficients of a pair of powers
SHARE = 0.1  # least part of the second power in the error at the end
LATE = 4  # points a decade


class Laws(NamedTuple):
    """Growth laws of n runs: E(H) = sum of coefficient H^power over two columns, and a free exponent to compare."""

    powers: Array  # (n, 2), the second NaN where there is one power
    coefficients: Array  # (n, 2)
    slope: Array  # (n,) of log E on log H
    interval: Array  # (n,) half-width, 95 %

    @property
    def leading(self) -> Array:
        """The power that decides at the end, (n,)."""
        return np.where(np.isnan(self.powers[:, 1]), self.powers[:, 0], self.powers[:, 1])

    def at(self, horizons: Array) -> Array:
        """Errors (n, horizons); NaN where there is no law."""
        with np.errstate(over="ignore"):
            terms = self.coefficients[..., np.newaxis] * horizons ** self.powers[..., np.newaxis]
        return np.asarray(terms[:, 0] + np.where(np.isnan(terms[:, 1]), 0.0, terms[:, 1]))


def fit(horizons: Array, errors: Array, limit: float = 2.0, *, drifts: bool = False) -> Laws:
    """Laws of errors (n, horizons), NaN where a run was not measured; NaN where too few points are left.

    `limit` is the largest power that can be, `drifts` whether it is known to come.
    """
    n = len(errors)
    doubt, share = (0.5 if limit == 1.0 else LOOSE, 0.0) if drifts else (DOUBT, SHARE)
    good = np.isfinite(errors) & (errors > 0.0) & (errors < SATURATED)
    last = np.max(np.where(good, horizons, 0.0), axis=1)
    good &= horizons >= last[:, np.newaxis] * 10.0**-DECADES
    count = good.sum(axis=1)
    enough = count >= FEWEST
    times = stdtrit(np.maximum(count - 2, 1), 1.0 - doubt)  # standard errors that a coefficient must exceed
    weight = np.where(good, 1.0 / np.where(good, errors, 1.0), 0.0)

    def columns(power: float) -> Array:
        return np.asarray(weight * horizons**power)

    powers, coefficients, best = np.full((n, 2), np.nan), np.full((n, 2), np.nan), np.full(n, np.inf)
    with np.errstate(all="ignore"):
        for power in POWERS:
            x = columns(power)
            a = x.sum(axis=1) / (x * x).sum(axis=1)
            misfit = ((a[:, np.newaxis] * x - good) ** 2).sum(axis=1)
            better = enough & (misfit < best) & (power <= limit)
            powers[better], coefficients[better] = (power, np.nan), np.stack([a, a * np.nan], axis=1)[better]
            best = np.where(better, misfit, best)
        for low, high in PAIRS:
            x, y = columns(low), columns(high)
            xx, yy, xy, x1, y1 = ((p * q).sum(axis=1) for p, q in ((x, x), (y, y), (x, y), (x, good), (y, good)))
            det = xx * yy - xy * xy
            a, b = (yy * x1 - xy * y1) / det, (xx * y1 - xy * x1) / det
            misfit = ((a[:, np.newaxis] * x + b[:, np.newaxis] * y - good) ** 2).sum(axis=1)
            carried = b * last**high / (a * last**low + b * last**high)
            error = np.sqrt(misfit / (count - 2) / det)
            clear = (a > times * np.sqrt(yy) * error) & (b > times * np.sqrt(xx) * error)
            better = enough & (misfit < best) & clear & (carried >= share) & (high <= limit)
            powers[better], coefficients[better] = (low, high), np.stack([a, b], axis=1)[better]
            best = np.where(better, misfit, best)
        u, v = np.log(horizons) * good, np.log(np.where(good, errors, 1.0))
        du = np.where(good, u - (u.sum(axis=1) / count)[:, np.newaxis], 0.0)
        slope = (du * v).sum(axis=1) / (du * du).sum(axis=1)
        dv = np.where(good, v - (v.sum(axis=1) / count)[:, np.newaxis] - slope[:, np.newaxis] * du, 0.0)
        spread = np.sqrt((dv * dv).sum(axis=1) / (count - 2) / (du * du).sum(axis=1))
    factor = np.array([student(int(points) - 2) if points > 2 else math.nan for points in count])
    return Laws(powers, coefficients, np.where(enough, slope, np.nan), np.where(enough, factor * spread, np.nan))


def walk(energy: Array, evaluations: Array) -> Array:
    """w (members,): the least energy error over sqrt(evaluations), of arrays (settings, horizons, members)."""
    with np.errstate(all="ignore"):
        w = energy / np.sqrt(evaluations)
    w = np.where(np.isfinite(w) & (w > 0.0), w, np.inf)
    return np.asarray(w.min(axis=(0, 1)))


def rounding(quantity: str, w: Array, horizons: Array, evaluations: Array) -> Array:
    """The error by rounding, for `evaluations` (..., horizons) and `w`, which must broadcast with them."""
    walked = w * np.sqrt(evaluations)
    return np.asarray(walked * 2.0 * math.pi * horizons / math.sqrt(3.0) if quantity == "axis" else walked)


def least(errors: Array, law: Array, noise: Array) -> Array:
    """Factors (n,) that limit the `noise` (n, horizons) of each run to what its measured errors allow.

    If the law `law` fits the errors within a relative misfit m, noise in quadrature is at most sqrt(2 m) of the last.
    """
    measured = np.isfinite(errors) & (errors > 0.0)
    last = np.max(np.where(measured, np.arange(errors.shape[1]), 0), axis=1)[:, np.newaxis]
    with np.errstate(all="ignore"):
        late = measured & (np.arange(errors.shape[1]) > last - DECADES * LATE)
        misfit = np.max(np.where(late, np.abs(errors / law - 1.0), 0.0), axis=1)
        room = np.sqrt(np.minimum(2.0 * np.where(np.isfinite(misfit), misfit, 1.0), 1.0))
        largest = np.max(np.where(measured, errors, 0.0), axis=1)
        ratio = room * largest / np.take_along_axis(noise, last, axis=1)[:, 0]
    return np.where(measured.any(axis=1) & np.isfinite(ratio), np.minimum(ratio, 1.0), 1.0)
