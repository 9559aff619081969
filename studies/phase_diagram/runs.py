"""One variant on some tops: its errors at all horizons with each setting, measured within a budget, then foretold.

A horizon H ends a stretch of the run in which `SAMPLES` whole steps are looked at, golden fractions apart, so that no
two fall on the same phase of the nutation. The error up to H is the largest so far:

    axis     angle between the axes at the same time, rad
    energy   |E - E0| / (E0 - p_psi^2/2 I3 - min V)
    shape    distance of (u, u'/omega), u = cos(theta), from the true orbit u'^2 = f(u), to first order in it:
             |u'^2 - f(u)| / |grad|,  grad = (f'(u), 2 omega u'),  f = (1 - u^2)(alpha - beta u) - (b - a u)^2

The last has no time in it: neither a phase nor a turn about the vertical changes it (`symtop.measure.phase` measures
the same by a search for the nearest time). Steps are cut to 24 bits, so that step number times step is exact.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from symtop.core.numbers import EPSILON, GOLDEN
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import Integrator
from symtop.model import charts
from symtop.model.charts import Array, axis_of, space_energy
from symtop.model.scenes import scene
from symtop.model.top import effective_potential, flat

from ..population.ladder import in_turn, stepped, stored
from ..population.tops import Body, Tops, numbers_of
from . import laws

QUANTITIES = ("axis", "energy", "shape")
MOST = {"axis": 2.0, "energy": 1.0, "shape": 1.0}  # the largest power of the horizon (see `laws`)
POPULATION = "population"
PER_DECADE = 4  # stretches; every other end is a column of the picture
FIRST, LAST = 1.0, 9.0  # decades of the horizon, in nutations
SAMPLES = 12  # of a stretch
COARSEST = 2.185  # steps a nutation; halved from setting to setting
LOOSEST = 1e-2  # tolerance; divided by ten
LEAST_STEPS = 4.0  # a nutation, of what energy and shape are asked: longer steps may keep them and miss the motion
DONE = 3e-13  # an error at ten nutations that no finer setting is asked to improve
BITS = 24  # of a step


def drifts_of(variant: Integrator) -> bool:
    """Is it known that the energy of a variant drifts: neither symplectic nor kept by construction?"""
    return not variant.symplectic and "energy" not in (variant.conserves or ())


class Shown(NamedTuple):
    """What runs have shown, (n, samples), and their force evaluations (n,)."""

    states: Array
    momenta: Array
    evaluations: Array
    ended: Array  # (n,) well


def horizons() -> Array:
    """Ends of all stretches, in nutations."""
    return np.logspace(FIRST, LAST, round((LAST - FIRST) * PER_DECADE) + 1)


def tops_of(name: str, members: int, seed: int) -> Tops:
    """The first members of the population with a nutation, or the one top of a scene."""
    if name != POPULATION:
        one = scene(name)
        return Tops(np.array([flat(one.top, one.start)]), 10.0)
    drawn = Tops(numbers_of(2 * members, seed), 10.0)
    return Tops(drawn.numbers[drawn.known][:members], 10.0)


def steps_of(tops: Tops, per_nutation: float) -> Array:
    """Steps (n,), cut to `BITS` bits."""
    size, power = np.frexp(tops.period / per_nutation)
    return np.asarray(np.ldexp(np.rint(np.ldexp(size, BITS)), power - BITS))


def places(ends: Array) -> Array:
    """Where samples lie, (horizons, samples), in nutations: golden fractions of the last fifth before each end."""
    fractions = np.sort(np.mod(GOLDEN * np.arange(1, SAMPLES), 1.0))
    return np.asarray(ends[:, np.newaxis] * np.append(0.8 + 0.2 * fractions, 1.0))


def setting_of(variant: Integrator, level: int) -> float:
    """Steps a nutation, or the tolerance; NaN below the least that the variant has."""
    if variant.fixed_step:
        return COARSEST * 2.0**level
    tolerance = LOOSEST * 10.0**-level
    return tolerance if tolerance >= variant.least_tolerance else math.nan


class Asked(NamedTuple):
    """Runs of all tops with one setting: steps a nutation or a tolerance, and the ends of the stretches to look at."""

    setting: float
    ends: Array
    budget: float  # force evaluations


def run(variant: Integrator, tops: Tops, wanted: Sequence[Asked]) -> list[tuple[Shown, Array]]:
    """The runs of all tops with each setting, and the times (n, samples) of what they show.

    Those of a fixed step go side by side, the settings too, in one call.
    """
    if variant.fixed_step:
        return together(variant, tops, wanted)
    made = []
    for setting, ends, budget in wanted:
        times = places(ends).ravel() * tops.period[:, np.newaxis]
        done = in_turn(variant, tops.numbers, [Plan.until(one, setting, budget) for one in times])
        made.append((Shown(done.states, done.momenta, done.work, done.outcome == 0), times))
    return made


def together(variant: Integrator, tops: Tops, wanted: Sequence[Asked]) -> list[tuple[Shown, Array]]:
    """The runs of a fixed step. A call wants as many samples of all; those that nobody asked for are dropped."""
    marks = []
    for setting, ends, _ in wanted:
        whole = np.maximum(np.rint(places(ends).ravel() * setting), 1).astype(np.int64)
        marks.append(np.maximum.accumulate(whole))
    each, n = [np.unique(one) for one in marks], len(tops.period)
    most = max((one.size for one in each), default=0)
    if any(one[-1] < most for one in each):  # a run with fewer steps than another has samples
        return [made for asked in wanted for made in together(variant, tops, [asked])]
    if not wanted:
        return []
    shown = np.stack([filled(one, most) for one in each])
    h = np.stack([steps_of(tops, asked.setting) for asked in wanted])
    done = stepped(variant, np.tile(tops.numbers, (len(wanted), 1)), h.ravel(), np.repeat(shown, n, axis=0))
    made = []
    for k, (one, seen) in enumerate(zip(marks, shown, strict=True)):
        rows, columns = slice(k * n, (k + 1) * n), np.searchsorted(seen, one)
        parts = Shown(done.states[rows, columns], done.momenta[rows, columns], done.work[rows], done.outcome[rows] == 0)
        made.append((parts, one * h[k][:, np.newaxis]))
    return made


def filled(marks: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Marks, and the first steps that are none, `count` in all; the last of them stays the last."""
    free = np.setdiff1d(np.arange(1, count + 1), marks)[: count - marks.size]
    return np.union1d(marks, free)


def errors(chart: str, tops: Tops, shown: Shown, times: Array) -> dict[str, Array]:
    """Each quantity at each sample, (n, samples); inf where a run has failed."""
    states, body = shown.states, Body(*tops.body)
    p_phi, p_psi = shown.momenta[..., 0], shown.momenta[..., 1]
    with np.errstate(all="ignore"):
        axis = axis_of(chart, states)
        if chart == "angles":
            place = effective_potential(states[..., 0], p_phi - p_psi, p_phi + p_psi, body.I1, body.mgl)
            energy = states[..., 1] ** 2 / (2.0 * body.I1) + p_psi**2 / (2.0 * body.I3) + place
            rate = -np.sin(states[..., 0]) * states[..., 1] / body.I1
        else:
            momentum = states[..., -3:]
            energy = space_energy(body, axis, momentum, p_psi)  # type: ignore[arg-type]
            rate = (momentum[..., 0] * axis[..., 1] - momentum[..., 1] * axis[..., 0]) / body.I1
        each = {
            "axis": charts.axis_distance(axis, tops.forms.axis(times)),
            "energy": np.abs(energy - tops.energy[:, np.newaxis]) / tops.energy_scale[:, np.newaxis],
            "shape": shape(tops, axis[..., 2], rate),
        }
    return {name: np.where(np.isfinite(values), values, np.inf) for name, values in each.items()}


def shape(tops: Tops, u: Array, rate: Array) -> Array:
    """Distance of heights and their rates (n, samples) from the true orbits, in units of the axis's length."""
    I1, I3, mgl = tops.body
    p_phi, p_psi = (part[:, np.newaxis] for part in tops.momenta[:2])
    a, b, beta = p_psi / I1, p_phi / I1, 2.0 * mgl / I1
    alpha = (2.0 * tops.energy[:, np.newaxis] - p_psi**2 / I3) / I1
    omega = 2.0 * math.pi / tops.period[:, np.newaxis]
    off = rate**2 - (1.0 - u * u) * (alpha - beta * u) + (b - a * u) ** 2
    slope = 2.0 * a * (b - a * u) - 2.0 * u * (alpha - beta * u) - beta * (1.0 - u * u)
    return np.asarray(np.abs(off) / np.hypot(slope, 2.0 * omega * rate))


def measured(variant: Integrator, tops: Tops, wanted: Sequence[Asked]) -> list[tuple[Array, Array]]:
    """For each setting, the largest errors (quantities, horizons, n) of the stretches, inf after a failure, and
    evaluations a nutation.
    """
    (chart,), made = variant.charts(), []
    for (setting, ends, _), (shown, times) in zip(wanted, run(variant, tops, wanted), strict=True):
        each = errors(chart, tops, shown, times)
        largest = np.stack([each[name].reshape(len(times), len(ends), SAMPLES).max(axis=2).T for name in QUANTITIES])
        if variant.fixed_step and setting < LEAST_STEPS:
            largest[1:] = np.inf
        made.append((largest, np.where(shown.ended, shown.evaluations / ends[-1], np.nan)))
    return made


def ladder(variant: Integrator, tops: Tops, levels: int, steps: float, budget: float) -> xr.Dataset:
    """All settings of a variant, measured as far as `steps` and `budget` (evaluations of a run) go, then foretold.

    Over `quantity`, `setting`, `horizon`, `member`: ``error``, the largest up to the horizon, and of its law the
    leading ``power`` and the free exponent ``slope`` with its ``interval``. ``setting_value`` is the steps a nutation
    or the tolerance; ``reach`` the last horizon that was measured; ``work`` the force evaluations a nutation; ``walk``
    the w of `laws`.
    """
    far, n = horizons(), len(tops.period)
    seen, work = np.full((len(QUANTITIES), levels, far.size, n), np.nan), np.full((levels, n), np.nan)
    reach, values = np.full(levels, np.nan), np.full(levels, np.nan)
    wanted: dict[int, Asked] = {}
    for level in range(levels):
        setting = setting_of(variant, level)
        if math.isnan(setting):
            break
        ((tried, first),) = measured(
            variant, tops, [Asked(setting, far[:1], math.inf if variant.fixed_step else budget)]
        )
        taken = float(np.nanmedian(first)) if np.isfinite(first).any() else math.nan
        if math.isnan(taken):
            values[level], reach[level], seen[:, level, 0] = setting, far[0], np.inf
            continue
        longest = min(budget / taken, steps / setting if variant.fixed_step else math.inf, 1.0001e6)
        if longest < far[laws.FEWEST]:
            break
        wanted[level] = Asked(setting, far[far <= longest], 10.0 * budget)
        if np.median(tried[:, 0], axis=1).max() < DONE:
            break
    for (level, asked), shown in zip(wanted.items(), measured(variant, tops, list(wanted.values())), strict=True):
        values[level], reach[level] = asked.setting, asked.ends[-1]
        seen[:, level, : asked.ends.size], work[level] = shown
    grain = EPSILON * np.maximum((np.abs(tops.energy) + np.abs(tops.numbers[:, 2])) / tops.energy_scale, 1.0)
    return foretold(seen, work, far, grain, drifts=drifts_of(variant)).assign(
        setting_value=("setting", values), reach=("setting", reach), chart=((), variant.charts()[0]),
        conserves_energy=((), float("energy" in (variant.conserves or ()))),
    )  # fmt: skip


def foretold(seen: Array, work: Array, far: Array, grain: Array, *, drifts: bool) -> xr.Dataset:
    """Errors at all horizons from the largest in the measured stretches (quantities, settings, horizons, n).

    `grain` (n,) is the rounding of the energy in one evaluation: no walk has longer steps.
    """
    w = np.minimum(laws.walk(seen[1], work[:, np.newaxis] * far[:, np.newaxis]), grain)
    evaluations = np.swapaxes(work[:, np.newaxis] * far[:, np.newaxis], 1, 2)  # settings, n, horizons
    error, columns = np.empty_like(seen), {name: np.full(seen.shape[:2] + seen.shape[3:], np.nan) for name in LAW}
    for s in range(seen.shape[1]):
        for q, name in enumerate(QUANTITIES):
            runs = seen[q, s].T
            law = laws.fit(far, runs, MOST[name], drifts=drifts)
            noise = laws.rounding(name, w[:, np.newaxis], far, evaluations[s])
            beyond = np.hypot(law.at(far), noise)
            beyond = np.where(np.isinf(runs).any(axis=1, keepdims=True), np.inf, beyond)
            error[q, s] = np.maximum.accumulate(np.where(np.isnan(runs), beyond, runs), axis=1).T
            for key, value in zip(LAW, (law.leading, law.slope, law.interval), strict=True):
                columns[key][q, s] = value
    data: dict[str, Any] = {
        "error": (("quantity", "setting", "horizon", "member"), stored(error[:, :, ::2])),
        **{key: (("quantity", "setting", "member"), stored(value)) for key, value in columns.items()},
        "work": (("setting", "member"), work),
        "walk": ("member", w),
    }
    return xr.Dataset(data, coords={"quantity": list(QUANTITIES), "horizon": far[::2]})


LAW = ("power", "slope", "interval")
