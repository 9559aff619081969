"""Runs of up to a million nutations: errors at all horizons, measured within a budget and predicted beyond it.

Before each horizon H the run is sampled after `SAMPLES` whole steps, golden fractions apart, so that no two fall on the
same phase of the nutation. The error up to H is the largest so far:

    axis     angle between the axes at the same time, rad
    energy   |E - E0| / (E0 - p_psi^2/2 I3 - min V)
    shape    distance of (u, u'/omega), u = cos(theta), from the true orbit u'^2 = f(u), to first order in it:
             |u'^2 - f(u)| / |grad|,  grad = (f'(u), 2 omega u'),  f = (1 - u^2)(alpha - beta u) - (b - a u)^2

The last is independent of time: neither a phase nor a turn about the vertical changes it (`symtop.measure.phase`
measures the same by a search for the nearest time). Steps are cut to 24 bits, so that step number times step is exact.

The phase diagram is computed from these runs, by the study's model of cost and its interpolation between settings: for
a target and a horizon the variant with the least median cost over the tops. A cell is predicted if for most tops one of
the two settings of the winner was not run as far as the horizon. Predictions are checked on the same kind of tops:
cells at the horizons of `CHECKED_AT` are run in full by the winner and the next variant at the settings on both sides.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray
from symtop_studies.memoize import of_one_dataset

from symtop.core.numbers import EPSILON, GOLDEN
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import Integrator, integrator, variants
from symtop.model import charts
from symtop.model.charts import Array, View
from symtop.run.ensemble import chunks

from . import laws
from .ladder import in_turn, stepped, stored
from .prices import prices
from .ranking import cost_to_reach
from .tops import FIRST as FEWEST_STEPS, Tops, natural

QUANTITIES = ("axis", "energy", "shape")
MOST = {"axis": 2.0, "energy": 1.0, "shape": 1.0}  # the largest power of the horizon (see `laws`)
PER_DECADE = 4  # horizons a decade; every other one is a column of the picture
FIRST, LAST = 1.0, 6.0  # log10 of the first and the last horizon, in nutations
SAMPLES = 12  # before each horizon
CANDIDATES = (  # what can win on any body: the cheapest variants of each family over ten and a thousand nutations.
    # Adams' method is not among them: an evaluation with its history costs six times that of vern9.
    "midpoint[angles]", "strang-drift-first[axis]", "chin-4a[axis]", "srkn-6-4[axis]", "aba-10-4[axis]",
    "srkn-14-6[axis]", "srkn-19-8[axis]", "kahan-li-8[axis]", "sofroniou-spaletta-10[axis]", "gauss-4[axis]",
    "gauss-8[axis]", "gauss-12[axis]", "rk4[axis]", "tsit5-fixed[axis]", "dop853-compiled[axis]",
    "dop853-compiled-fixed[axis]", "vern9-fixed[axis]", "extrapolation[axis]",
    "series-general-adaptive[axis]", "taylor[axis]",
)  # fmt: skip
TARGETS = tuple(float(target) for target in np.logspace(-2, -12, 11))
TIE = 1.25  # medians with a ratio below this count as equal
CHECKED_TARGETS, CHECKED_AT = (1e-3, 1e-6, 1e-9), (1e5, 3.16e5, 1e6)
COARSEST = 2.0 * FEWEST_STEPS  # steps a nutation; halved from setting to setting
LOOSEST = 1e-2  # tolerance; divided by ten
LEAST_STEPS = 4.0  # a nutation, for energy and shape to count: with longer steps they may be kept by a wrong motion
DONE = 3e-13  # error at ten nutations below which no finer setting is run
BITS = 24  # of a step size
CHECKED_TOPS = 4


def drifts_of(variant: Integrator) -> bool:
    """Is it known that the energy of a variant drifts: neither symplectic nor kept by construction?"""
    return not variant.symplectic and "energy" not in (variant.conserves or ())


class Samples(NamedTuple):
    """Samples of n runs, (n, samples, ...), and their force evaluations (n,)."""

    states: Array
    momenta: Array
    evaluations: Array
    ended: Array  # (n,) well


def horizons() -> Array:
    """All horizons, in nutations."""
    return np.logspace(FIRST, LAST, round((LAST - FIRST) * PER_DECADE) + 1)


def tops_of(members: int, seed: int) -> Tops:
    """The first members of the natural population."""
    return Tops(natural(members, seed), 10.0)


def candidates() -> list[str]:
    """The variants of `CANDIDATES` that this machine has: heyoka's Taylor series may be missing."""
    names = {variant.name for variant in variants()}
    return [name for name in CANDIDATES if name in names]


def steps_of(tops: Tops, per_nutation: float) -> Array:
    """Steps (n,), cut to `BITS` bits."""
    size, power = np.frexp(tops.period / per_nutation)
    return np.asarray(np.ldexp(np.rint(np.ldexp(size, BITS)), power - BITS))


def places(ends: Array) -> Array:
    """Times of samples (horizons, samples), in nutations: golden fractions of the last fifth before each horizon."""
    fractions = np.sort(np.mod(GOLDEN * np.arange(1, SAMPLES), 1.0))
    return np.asarray(ends[:, np.newaxis] * np.append(0.8 + 0.2 * fractions, 1.0))


def setting_of(variant: Integrator, level: int) -> float:
    """Steps a nutation, or the tolerance; NaN below the least that the variant has."""
    if variant.fixed_step:
        return COARSEST * 2.0**level
    tolerance = LOOSEST * 10.0**-level
    return tolerance if tolerance >= variant.least_tolerance else math.nan


class Request(NamedTuple):
    """A request for runs of all tops with one setting: steps a nutation or a tolerance, and the horizons."""

    setting: float
    ends: Array
    budget: float  # force evaluations


def run(variant: Integrator, tops: Tops, requests: Sequence[Request]) -> list[tuple[Samples, Array]]:
    """The runs of all tops with each setting, and the times (n, samples) of their samples.

    Those of a fixed step go side by side, the settings too, in one call.
    """
    if variant.fixed_step:
        return together(variant, tops, requests)
    samples = []
    for setting, ends, budget in requests:
        times = places(ends).ravel() * tops.period[:, np.newaxis]
        runs = in_turn(variant, tops.numbers, [Plan.until(row, setting, budget) for row in times])
        samples.append((Samples(runs.states, runs.momenta, runs.work, runs.outcome == 0), times))
    return samples


def together(variant: Integrator, tops: Tops, requests: Sequence[Request]) -> list[tuple[Samples, Array]]:
    """The runs of a fixed step, in one call, which needs equally many samples of all; extra samples are dropped."""
    marks = []
    for setting, ends, _ in requests:
        whole = np.maximum(np.rint(places(ends).ravel() * setting), 1).astype(np.int64)
        marks.append(np.maximum.accumulate(whole))
    unique, n = [np.unique(part) for part in marks], len(tops.period)
    longest = max((part.size for part in unique), default=0)
    if any(part[-1] < longest for part in unique):  # a run with fewer steps than `longest` samples
        return [samples for request in requests for samples in together(variant, tops, [request])]
    if not requests:
        return []
    table = np.stack([filled(part, longest) for part in unique])
    h = np.stack([steps_of(tops, request.setting) for request in requests])
    runs = stepped(variant, np.tile(tops.numbers, (len(requests), 1)), h.ravel(), np.repeat(table, n, axis=0))
    samples = []
    for k, (part, row) in enumerate(zip(marks, table, strict=True)):
        rows, columns = slice(k * n, (k + 1) * n), np.searchsorted(row, part)
        states, momenta = runs.states[rows, columns], runs.momenta[rows, columns]
        parts = Samples(states, momenta, runs.work[rows], runs.outcome[rows] == 0)
        samples.append((parts, part * h[k][:, np.newaxis]))
    return samples


def filled(marks: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """The marks with the first other steps added, `count` in all; the last mark stays the last."""
    free = np.setdiff1d(np.arange(1, count + 1), marks)[: count - marks.size]
    return np.union1d(marks, free)


def errors(chart: str, tops: Tops, samples: Samples, times: Array) -> dict[str, Array]:
    """Each quantity at each sample, (n, samples); inf where a run has failed."""
    view = View(chart, chunks.together(tops.numbers), samples.states, samples.momenta[..., 0], samples.momenta[..., 1])
    with np.errstate(all="ignore"):
        axis, I1 = view.axis, view.top.I1
        if chart == "angles":
            rate = -np.sin(view.theta) * view.p_theta / I1
        else:
            rate = (view.momentum[..., 0] * axis[..., 1] - view.momentum[..., 1] * axis[..., 0]) / I1
        quantities = {
            "axis": charts.axis_distance(axis, tops.forms.axis(times)),
            "energy": np.abs(view.energy - tops.energy[:, np.newaxis]) / tops.energy_scale[:, np.newaxis],
            "shape": shape(tops, axis[..., 2], rate),
        }
    return {name: np.where(np.isfinite(values), values, np.inf) for name, values in quantities.items()}


def shape(tops: Tops, u: Array, rate: Array) -> Array:
    """Distance of heights and their rates (n, samples) from the true orbits, in units of the axis's length."""
    I1, I3, mgl = (tops.numbers[:, k, np.newaxis] for k in range(3))
    p_phi, p_psi = (part[:, np.newaxis] for part in tops.momenta[:2])
    a, b, beta = p_psi / I1, p_phi / I1, 2.0 * mgl / I1
    alpha = (2.0 * tops.energy[:, np.newaxis] - p_psi**2 / I3) / I1
    omega = 2.0 * math.pi / tops.period[:, np.newaxis]
    gap = rate**2 - (1.0 - u * u) * (alpha - beta * u) + (b - a * u) ** 2
    slope = 2.0 * a * (b - a * u) - 2.0 * u * (alpha - beta * u) - beta * (1.0 - u * u)
    return np.asarray(np.abs(gap) / np.hypot(slope, 2.0 * omega * rate))


def measured(variant: Integrator, tops: Tops, requests: Sequence[Request]) -> list[tuple[Array, Array]]:
    """For each setting, the largest errors (quantities, horizons, n) of the stretches, inf after a failure, and
    evaluations a nutation.
    """
    (chart,), results = variant.charts(), []
    for (setting, ends, _), (samples, times) in zip(requests, run(variant, tops, requests), strict=True):
        by_name = errors(chart, tops, samples, times)
        largest = np.stack([by_name[name].reshape(len(times), len(ends), SAMPLES).max(axis=2).T for name in QUANTITIES])
        if variant.fixed_step and setting < LEAST_STEPS:
            largest[1:] = np.inf
        results.append((largest, np.where(samples.ended, samples.evaluations / ends[-1], np.nan)))
    return results


def ladder(variant: Integrator, tops: Tops, levels: int, steps: float, budget: float) -> xr.Dataset:
    """All settings of a variant, measured as far as `steps` and `budget` (evaluations of a run) allow, then predicted.

    Over `quantity`, `setting`, `horizon`, `member`: ``error``, the largest up to the horizon, and of its law the
    leading ``power`` and the free exponent ``slope`` with its ``interval``. ``setting_value`` is the steps a nutation
    or the tolerance; ``reach`` the last horizon that was measured; ``work`` the force evaluations a nutation; ``walk``
    the w of `laws`.
    """
    far, n = horizons(), len(tops.period)
    seen, work = np.full((len(QUANTITIES), levels, far.size, n), np.nan), np.full((levels, n), np.nan)
    reach, values = np.full(levels, np.nan), np.full(levels, np.nan)
    requests: dict[int, Request] = {}
    for level in range(levels):
        setting = setting_of(variant, level)
        if math.isnan(setting):
            break
        ((first_errors, first),) = measured(
            variant, tops, [Request(setting, far[:1], math.inf if variant.fixed_step else budget)]
        )
        typical = float(np.nanmedian(first)) if np.isfinite(first).any() else math.nan
        if math.isnan(typical):
            values[level], reach[level], seen[:, level, 0] = setting, far[0], np.inf
            continue
        longest = min(budget / typical, steps / setting if variant.fixed_step else math.inf, 1.0001e6)
        if longest < far[laws.FEWEST]:
            break
        requests[level] = Request(setting, far[far <= longest], 10.0 * budget)
        if np.median(first_errors[:, 0], axis=1).max() < DONE:
            break
    for (level, request), pair in zip(requests.items(), measured(variant, tops, list(requests.values())), strict=True):
        values[level], reach[level] = request.setting, request.ends[-1]
        seen[:, level, : request.ends.size], work[level] = pair
    grain = grain_of(tops)
    return predicted(seen, work, far, grain, drifts=drifts_of(variant)).assign(
        setting_value=("setting", values), reach=("setting", reach), chart=((), variant.charts()[0]),
        conserves_energy=((), float("energy" in (variant.conserves or ()))),
    )  # fmt: skip


def grain_of(tops: Tops) -> Array:
    """The rounding of the energy in one evaluation, over its scale, (n,)."""
    size = (np.abs(tops.energy) + np.abs(tops.numbers[:, 2])) / tops.energy_scale
    return np.asarray(EPSILON * np.maximum(size, 1.0))


def predicted(seen: Array, work: Array, far: Array, grain: Array, *, drifts: bool) -> xr.Dataset:
    """Errors at all horizons, from the largest at the measured ones (quantities, settings, horizons, n).

    `grain` (n,) is the rounding of the energy in one evaluation, the longest step of a random walk.
    """
    w = np.minimum(laws.walk(seen[1], work[:, np.newaxis] * far[:, np.newaxis]), grain)
    evaluations = np.swapaxes(work[:, np.newaxis] * far[:, np.newaxis], 1, 2)  # settings, n, horizons
    error, columns = np.empty_like(seen), {name: np.full(seen.shape[:2] + seen.shape[3:], np.nan) for name in LAW}
    for s in range(seen.shape[1]):
        for q, name in enumerate(QUANTITIES):
            runs = seen[q, s].T
            law = laws.fit(far, runs, MOST[name], drifts=drifts)
            noise = laws.rounding(name, w[:, np.newaxis], far, evaluations[s])
            noise *= laws.least(runs, law.at(far), noise)[:, np.newaxis]
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


# ---- the phase diagram -----------------------------------------------------------------------------------------------


class Diagram(NamedTuple):
    """One panel: arrays over targets and horizons, `costs` over variants before them."""

    names: list[str]
    horizons: Array
    costs: Array  # seconds a nutation, inf where not reached
    winner: NDArray[np.int64]  # index of a variant, -1 where none reaches the target
    second: NDArray[np.int64]
    ratio: Array  # cost of the second over that of the winner
    predicted: NDArray[np.bool_]
    levels: list[Array]  # by variant: the finer of the two settings of a cell (targets, horizons, n)

    def place(self, target: float, horizon: float) -> tuple[int, int]:
        """Indices of a cell."""
        row = int(np.argmin(np.abs(np.log(np.array(TARGETS) / target))))
        return row, int(np.argmin(np.abs(np.log(self.horizons / horizon))))


def runs_of(data: xr.DataTree, name: str) -> xr.Dataset:
    """The runs of a variant: without padding; errors are infinite for runs that failed or have no growth law."""
    runs = data["far"].to_dataset().isel(scene=0).sel(variant=name)
    runs = runs.isel(setting=np.flatnonzero(np.isfinite(runs["setting_value"].values)))
    dead = np.isnan(runs["work"]).all("member")  # all failed: there is no more to measure
    work = "setting", "member"
    filled_in = work_of(runs["work"].transpose(*work).values, runs["setting_value"].values, integrator(name).fixed_step)
    return runs.assign(
        error=runs["error"].fillna(np.inf), reach=runs["reach"].where(~dead, np.inf), work=(work, filled_in)
    )


def work_of(work: Array, settings: Array, fixed: bool) -> Array:
    """Evaluations a nutation (settings, n), coarse to fine, NaN only of members whose runs all failed.

    `work` is NaN of a run that failed before its end. It may have kept an error until then, and costs as much as the
    next finer run of that top: in evaluations a step, or, at a tolerance, over those of the median top.
    """
    typical = settings if fixed else pd.DataFrame(work).median(axis=1).bfill().ffill().to_numpy()
    return pd.DataFrame(work / typical[:, np.newaxis]).bfill().ffill().to_numpy() * typical[:, np.newaxis]


def variants_of(data: xr.DataTree, quantity: str) -> list[str]:
    """Variants of a panel; energy and shape leave out those that conserve the energy by construction at any step."""
    group = data["far"].to_dataset().isel(scene=0)
    return [
        str(name) for name in group["variant"].values
        if quantity == "axis" or float(group["conserves_energy"].sel(variant=name)) != 1.0
    ]  # fmt: skip


def price_of(data: xr.DataTree, name: str, settings: Array) -> Array:
    """Seconds of a force evaluation at each setting; the cost of the call is negligible in runs of many nutations."""
    return prices(data).at(name, np.where(integrator(name).fixed_step, np.nan, settings))[0]


@of_one_dataset
def diagram(data: xr.DataTree, quantity: str) -> Diagram:
    """The panel of a quantity."""
    names, costs, unseen, levels = variants_of(data, quantity), [], [], []
    for name in names:
        runs = runs_of(data, name)
        errors = runs["error"].sel(quantity=quantity).transpose("setting", "horizon", "member").values.astype(float)
        work = runs["work"].values * price_of(data, name, runs["setting_value"].values)[:, np.newaxis]
        seconds = np.stack([cost_to_reach(work, errors[:, k], TARGETS) for k in range(errors.shape[1])], axis=1)
        places = np.arange(len(work))[:, np.newaxis, np.newaxis]
        level = np.stack([np.where(errors <= target, -1, places).max(axis=0) for target in TARGETS]) + 1
        costs.append(np.median(seconds, axis=2))
        levels.append(level)
        reach, far = runs["reach"].values, runs["horizon"].values
        fine = np.minimum(level, len(reach) - 1)
        shorter = np.minimum(reach[fine], reach[np.maximum(level - 1, 0)])
        unseen.append((shorter < 0.999 * far[:, np.newaxis]).mean(axis=2) > 0.5)
    table = np.array(costs)
    order = np.argsort(table, axis=0, kind="stable")
    best = np.take_along_axis(table, order, axis=0)
    second = best[1] if len(best) > 1 else np.full_like(best[0], np.inf)
    with np.errstate(invalid="ignore"):
        ratio = second / best[0]
    predicted = np.take_along_axis(np.array(unseen), order[:1], axis=0)[0] & np.isfinite(best[0])
    far = data["far"].to_dataset()["horizon"].values
    return Diagram(
        names, far, table, np.where(np.isfinite(best[0]), order[0], -1), order[1 % len(order)], ratio, predicted, levels
    )


def chosen(data: xr.DataTree, limit: float) -> list[dict[str, Any]]:
    """Settings of the checks: predicted cells at some targets and horizons, runs of at most `limit` evaluations."""
    cases: list[dict[str, Any]] = []
    for quantity in QUANTITIES[:2]:
        panel = diagram(data, quantity)
        for target in CHECKED_TARGETS:
            for horizon in CHECKED_AT:
                cell = panel.place(target, horizon)
                if not panel.predicted[cell] or not np.isfinite(panel.ratio[cell]):
                    continue
                pair, settings, dearest = (int(panel.winner[cell]), int(panel.second[cell])), [], 0.0
                for row in pair:
                    table = runs_of(data, panel.names[row])
                    fine = min(int(np.median(panel.levels[row][cell])), table.sizes["setting"] - 1)
                    settings.append(table["setting_value"].values[[max(fine - 1, 0), fine]].tolist())
                    dearest = max(dearest, float(np.nanmax(table["work"].values[fine])) * horizon)
                runs = [[panel.names[row] for row in pair], settings]
                if dearest <= limit and all([case["integrators"], case["settings"]] != runs for case in cases):
                    cases.append({
                        "integrators": [panel.names[row] for row in pair], "quantity": quantity, "target": target,
                        "horizon": horizon, "settings": settings, "seed": data["far"].attrs.get("seed", 1),
                    })  # fmt: skip
    return cases


def check(case: Any) -> xr.Dataset:
    """Largest ``errors`` of the first `CHECKED_TOPS` natural tops in the runs that decide a cell, over ``rank`` (the
    winner and the next variant), ``side`` (the coarser and the finer setting) and ``member``.
    """
    tops, far = tops_of(CHECKED_TOPS, case["seed"]), horizons()
    ends = far[far <= 1.0001 * case["horizon"]]
    place = QUANTITIES.index(case["quantity"])
    errors = np.full((2, 2, CHECKED_TOPS), np.nan)
    for rank, (name, pair) in enumerate(zip(case["integrators"], case["settings"], strict=True)):
        runs = measured(integrator(name), tops, [Request(setting, ends, np.inf) for setting in pair])
        errors[rank] = [error[place].max(axis=0) for error, _ in runs]
    return xr.Dataset(
        {
            "errors": (("rank", "side", "member"), errors),
            "setting_value": (("rank", "side"), np.array(case["settings"])),
            "contender": ("rank", list(case["integrators"])),
            "quantity": ((), case["quantity"]),
            "target": ((), case["target"]),
            "checked_horizon": ((), case["horizon"]),
        }
    )


def checks(data: xr.DataTree) -> pd.DataFrame:
    """The predicted cells that were run in full, one row for each run and top.

    ``told``: does the run meet or miss the target as predicted? ``ratio`` is the error over the predicted one, of
    errors below 1 alone.
    """
    names, rows = ["quantity", "target", "horizon", "winner", "next", "told", "ratio"], []
    group = data["checks"].to_dataset().isel(scene=0) if "checks" in data.children else None
    for name in () if group is None else group["variant"].values:
        row = group.sel(variant=name)
        quantity, target, horizon = str(row["quantity"].values), float(row["target"]), float(row["checked_horizon"])
        pair, errors = list(map(str, row["contender"].values)), row["errors"].transpose("rank", "side", "member").values
        cell = [quantity, target, horizon, *pair]
        for rank, side in np.ndindex(2, 2):
            runs, setting = runs_of(data, pair[rank]), float(row["setting_value"][rank, side])
            level = int(np.argmin(np.abs(np.log(runs["setting_value"].values / setting))))
            foreseen = runs["error"].sel(quantity=quantity).isel(setting=level).sel(horizon=horizon, method="nearest")
            for error, prediction in zip(errors[rank, side].tolist(), foreseen.values.tolist(), strict=False):
                ratio = error / prediction if max(error, prediction) < 1.0 else math.nan
                rows.append([*cell, (error <= target) == (prediction <= target), ratio])
    return pd.DataFrame(rows, columns=names).astype({"told": bool, "ratio": float})
