"""How an error grows: the exponent of error ~ t^alpha with its interval, where it changes, when a tolerance is lost.

    alpha   0         1/2                       1                        3/2                        2
    means   bounded   random walk (rounding     steady drift (phase of   phase under a random       phase under a steady
                      at its best)              a symplectic method)     walk of the energy         drift of the energy

A single exponent is the least-squares slope of the logarithm of the largest error in logarithmic windows. That of a
random walk needs an ensemble: one walk may return to zero and its largest value says little, but the root mean square
over members grows as n^1/2, and drawing members with replacement (bootstrap) gives the interval. Source of the laws of
rounding: Brouwer, Astron. J. 46 (1937) 149; of the interval: Efron, Ann. Statist. 7 (1979) 1.

When a tolerance is lost is foretold by the parabola error = a + b t + c t^2 through a short run: b is a wrong frequency
and c the drift of the frequency that comes with a drift of energy. A c or an a that is not significant is left out.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from symtop.core.numbers import TINY
from symtop.measure.order import Fit, power_law
from symtop.measure.statistics import columns_fitted

LAWS = {0.0: "bounded", 0.5: "random walk", 1.0: "linear", 1.5: "t^3/2", 2.0: "quadratic"}
DRAWS, SEED = 2000, 1937  # of the bootstrap
BLOCKS = 50
RUN_ROUNDING = 3e-13  # relative: the largest change that a million steps of rounding explain where sums are compensated
WALK = 100.0  # times what rounding explains: a larger growth as t^1/2 is no walk of rounding


def growth(time: ArrayLike, residual: ArrayLike, decades: float = 2.0) -> Fit:
    """The exponent of |residual| ~ t^exponent, from the largest values in logarithmic windows of the last `decades`.

    What happens within the first nutations is an oscillation that switches on, not growth.
    """
    return power_law(*tops(time, residual, decades))


def tops(
    time: ArrayLike, residual: ArrayLike, decades: float = 2.0, count: int = 12
) -> tuple[list[float], list[float]]:
    """Middles of `count` logarithmic windows that fill the last `decades`, and the largest |residual| in each."""
    t, r = np.asarray(time, float), np.abs(np.asarray(residual, float))
    edges = np.geomspace(t[-1] / 10.0**decades, t[-1], count + 1)
    middles, largest = [], []
    for low, high in pairwise(edges):
        inside = (t > low) & (t <= high) & np.isfinite(r)
        if inside.any():
            middles.append(math.sqrt(low * high))
            largest.append(float(r[inside].max()))
    return middles, largest


def law(fit: Fit, slack: float = 0.1) -> str:
    """The name of the exponent that a fit agrees with, within its interval or `slack`; otherwise the exponent.

    "undecided" if another law lies within the interval as well.
    """
    if not math.isfinite(fit.slope):
        return "not judged"
    nearest = min(LAWS, key=lambda exponent: abs(exponent - fit.slope))
    if any(abs(exponent - fit.slope) <= fit.interval for exponent in LAWS if exponent != nearest):
        return "undecided"
    agrees = abs(nearest - fit.slope) <= max(fit.interval, slack)
    return LAWS[nearest] if agrees else f"t^{fit.slope:.2f}"


def behaviour(size: float, slope: float, interval: float, grain: float = 1.0, rounding: float = 0.0) -> str:
    """What became of a constant whose largest change is `size` and grows as t^slope (95 %: +- interval).

    The one rule of every study. `grain` is the rounding of the constant in units of the machine's, 1 or more (see
    `Scene.energy_grain`); `rounding` is what rounding explains beyond ``RUN_ROUNDING * grain``, where sums are plain.

        kept          size <= RUN_ROUNDING grain, whatever the exponent; or size <= rounding, and not bounded
        bounded       the exponent is nearest to 0, and its interval excludes 1/2: an error of the step, however small
        random walk   nearest to 1/2, the interval excludes 0 and 1, and size <= `WALK` times rounding
        drift         nearest to 1 or larger, and the interval excludes 1/2
        growing       anything else: the interval does not tell two laws apart, a growth as t^1/2 that is too large for
                      rounding, or no exponent (NaN)
    """
    if size <= RUN_ROUNDING * grain:
        return "kept"
    low, high = slope - interval, slope + interval
    if slope < 0.25 and high < 0.5:
        return "bounded"
    rounding = max(rounding, RUN_ROUNDING * grain)
    if size <= rounding:
        return "kept"
    if slope >= 0.75 and low > 0.5:
        return "drift"
    walks = 0.25 <= slope < 0.75 and low > 0.0 and high < 1.0
    return "random walk" if walks and size <= WALK * rounding else "growing"


class Ensemble(NamedTuple):
    """Root mean square of drifts over the members of an ensemble, and its growth."""

    rms: np.ndarray  # (windows,)
    fit: Fit  # interval: half-width of the bootstrap's 95 %


def ensemble_growth(steps: ArrayLike, drifts: ArrayLike, least: float) -> Ensemble:
    """The exponent of the root mean square of `drifts` (members, windows) from `least` steps on."""
    n, values = np.asarray(steps, float), np.asarray(drifts, float)
    rms = np.sqrt(np.mean(values**2, axis=0))
    used = n >= least
    fit = power_law(n, rms, used)
    if not math.isfinite(fit.slope):
        return Ensemble(rms, fit)
    members = np.random.default_rng(SEED).integers(len(values), size=(DRAWS, len(values)))
    again = 0.5 * np.log(np.mean(values[members][..., fit.used] ** 2, axis=1))
    x = np.log(n[fit.used]) - np.log(n[fit.used]).mean()
    low, high = np.quantile(again @ x / (x @ x), (0.025, 0.975))
    return Ensemble(rms, fit._replace(interval=float(max(high - fit.slope, fit.slope - low))))


class Change(NamedTuple):
    """Where a growth law gives way to another."""

    time: float
    before: float  # exponents
    after: float


def change_point(time: ArrayLike, size: ArrayLike, least: int = 5) -> Change | None:
    """The best break of a log-log curve into two lines, if it halves what one line leaves and earns its two parameters.

    Judged by Schwarz's criterion; each line has at least `least` points, and the two exponents differ by at least 1/4.
    """
    t, y = np.asarray(time, float), np.asarray(size, float)
    good = np.isfinite(t) & np.isfinite(y) & (t > 0.0) & (y > 0.0)
    u, v = np.log(t[good]), np.log(y[good])
    n = u.size
    if n < 2 * least:
        return None

    def broken(place: float) -> tuple[float, np.ndarray]:
        columns = np.stack([np.ones(n), u, np.maximum(u - place, 0.0)], axis=1)
        coefficients = np.linalg.lstsq(columns, v, rcond=None)[0]
        return float(np.sum((v - columns @ coefficients) ** 2)), coefficients

    straight = float(np.polyfit(u, v, 1, full=True)[1][0]) if n > 2 else 0.0
    places = u[least - 1 : n - least + 1]
    rest, place, coefficients = min((*broken(place)[:1], place, broken(place)[1]) for place in map(float, places))
    gain = n * math.log(max(straight, TINY) / max(rest, TINY)) - 2.0 * math.log(n)
    if gain <= 0.0 or rest > 0.5 * straight or abs(coefficients[2]) < 0.25:
        return None
    return Change(math.exp(place), float(coefficients[1]), float(coefficients[1] + coefficients[2]))


class Horizon(NamedTuple):
    """When an error reaches a tolerance: foretold, with the parabola it comes from."""

    time: float  # inf if it never does
    constant: float
    rate: float
    bend: float


def horizon(time: ArrayLike, error: ArrayLike, tolerance: float) -> Horizon:
    """When |error| will reach `tolerance`, from the parabola through a short run of signed errors."""
    t, e = _means(time, error)
    reach = t[-1]
    powers = [0, 1, 2]
    while True:
        columns = np.stack([(t / reach) ** k for k in powers], axis=1)
        fitted, deviations = columns_fitted(columns, e)
        terms = zip(powers, fitted, deviations, strict=True)
        weak = [k for k, value, deviation in terms if k != 1 and abs(value) <= 4.0 * deviation]
        if not weak:
            break
        powers.remove(max(weak))
    a, b, c = (float(fitted[powers.index(k)]) / reach**k if k in powers else 0.0 for k in range(3))
    times = [
        float(root.real)
        for level in (tolerance, -tolerance)
        for root in np.roots([c, b, a - level])
        if abs(root.imag) < 1e-12 * abs(root) and root.real > 0.0
    ]
    return Horizon(min(times, default=math.inf), a, b, c)


def lost_at(time: ArrayLike, error: ArrayLike, tolerance: float) -> float:
    """When |error| first reached `tolerance`, between means over short stretches; NaN if it never did, or at once."""
    t, e = _means(time, error)
    over = np.abs(e) >= tolerance
    if not over.any() or over[0]:
        return math.nan
    k = int(np.argmax(over))
    share = (tolerance - abs(e[k - 1])) / (abs(e[k]) - abs(e[k - 1]))
    return float(t[k - 1] + share * (t[k] - t[k - 1]))


def _means(time: ArrayLike, error: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Means over `BLOCKS` equal stretches: the oscillation within a nutation averages out."""
    t, e = np.asarray(time, float), np.asarray(error, float)
    good = np.isfinite(e)
    parts = np.array_split(np.flatnonzero(good), BLOCKS)
    return tuple(np.array([values[part].mean() for part in parts]) for values in (t, e))  # type: ignore[return-value]
