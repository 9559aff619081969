"""One variant on all tops: runs from coarse to fine settings, their costs, and their silent failures.

Steps are halved from setting to setting, tolerances divided by ten. A member leaves the ladder

    when every quantity has reached the finest target that is asked of it,
    before a run that is predicted to take more force evaluations than the budget,
    when no target that is left can be reached within the budget: the error is predicted to fall with the declared order
    or, if that is faster, as from the last setting to this, and may exceed the target by `FORGIVEN`,
    when two settings below `NEAR_ROUNDING` have the same error: rounding; three tolerances, since the error of a method
    whose order depends on the tolerance falls by steps.

The energy is asked from `LEAST_STEPS` a nutation on, because with longer steps it may be kept by a wrong motion. A run
is *wrong* if its axis error is above `WRONG`; it is a *silent failure* if, besides, it ended `ok` and kept the energy
and both momenta to `KEPT`. A member that left with an accurate run counts as right at all finer settings.

Variables over `quantity`, `target`, `member`, `level`, `kind` (of tops), `guarded`, `named` (scenes):

    cost(quantity, target, member)   force evaluations, inf if it was not reached, NaN if it was not asked
    met_at(quantity, target, member) steps a nutation or the tolerance that reaches it, interpolated as the cost is
    setting(level)                   steps a nutation, or the tolerance
    work(level, kind)                force evaluations of the median top of a kind
    runs, wrong, ended, silent (level, kind)       numbers of members: judged, wrong, ended `ok`, silent failures
    drawn(kind)                                    members with a nutation; at a level the rest of `runs` was dropped
    foretold, measured (level, guarded)            axis error, rad: of the guard's forecast, and of the run
    watched(level, guarded)                        the larger error of energy and momenta, infinite if it ended badly
    whole(level, guarded)                          1 if the guard's trial was the whole run, so that it had no forecast
    scene_error, scene_work (level, named)         axis error and force evaluations on the named scenes
    made, evaluated                                runs of the ladder, and their force evaluations
"""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from symtop.measure.settings import FLAT_GAIN, LEAST_STEPS, NEAR_ROUNDING, TARGETS
from symtop.methods.framework.adaptive import Adaptive
from symtop.methods.framework.calling import solve
from symtop.methods.framework.lanes import members_of
from symtop.methods.framework.loop import inside
from symtop.methods.framework.plan import NOT_NORMALISED, OUTCOMES, Plan, off_length
from symtop.methods.framework.registry import Integrator
from symtop.model.charts import DIMENSIONS, Array
from symtop.model.scenes import Scene
from symtop.model.top import Angles, SymmetricTop
from symtop.run.guard import forecast

from .ranking import cost_to_reach
from .tops import ASKED, FIRST, KINDS, MOMENTA, NATURAL, SCENE, Tops

LEVELS = 15  # largest number of settings
WRONG = 0.1  # rad, axis error above which a run is wrong
KEPT = 0.01  # limit on a kept change, relative to the energy of the nutation and to the larger momentum
ASYMPTOTIC = 1e-2  # rad; an error below this falls with the order of the method
FORGIVEN = 10.0  # a predicted error up to this many times a target still counts as reaching it
BLOCK = 256  # members of an adaptive variant that climb together: as many starts as heyoka's conversion remembers
DIGITS = 10  # bits of a cost that are stored, 0.1 %
Members = NDArray[np.int64]  # places of members

GUARDED_LEVELS = 10  # settings at which the guard is tested: up to 559 steps a nutation


class Level(NamedTuple):
    """The runs of some members with one setting."""

    states: Array
    momenta: Array
    work: Array  # force evaluations
    outcome: NDArray[np.int64]


class Climb(NamedTuple):
    """Work (LEVELS, n), errors (LEVELS, n) by quantity, NaN where a member was not run; and how runs ended."""

    work: Array
    errors: dict[str, Array]
    ended: NDArray[np.bool_]
    settled: NDArray[np.bool_]  # (n,): left with an accurate run


def quantities_of(variant: Integrator, twin: bool) -> tuple[str, ...]:
    """The quantities a variant is judged by: the attitude alone if the axis chart has the same axis (`twin`).

    The energy is not asked of a variant that claims to conserve it: any step would do.
    """
    (chart,) = variant.solvers
    left = {"energy"} if "energy" in (variant.conserves or ()) else set()
    left |= {"attitude"} if chart == "axis" else {"axis", "energy"} if twin else set()
    return tuple(name for name in ASKED if name not in left)


def setting_of(variant: Integrator, level: int) -> float:
    """Steps a nutation, or the tolerance; NaN below the least that the variant has."""
    if variant.fixed_step:
        return FIRST * 2.0**level
    tolerance = 10.0 ** (-2 - level)
    return tolerance if tolerance >= variant.least_tolerance else math.nan


def run_level(variant: Integrator, tops: Tops, chosen: Members, level: int, budget: float) -> Level:
    """Run the chosen members with one setting."""
    if variant.fixed_step:
        h = tops.period[chosen] / FIRST * 0.5**level
        marks = np.broadcast_to(tops.marks << level, (len(chosen), tops.marks.size))
        return stepped(variant, tops.numbers[chosen], h, marks)
    return at_tolerance(variant, tops, chosen, setting_of(variant, level), budget)


def at_tolerance(variant: Integrator, tops: Tops, chosen: Members, tolerance: float, budget: float) -> Level:
    """Run the chosen members with one tolerance."""
    times, solver = tops.times[chosen], next(iter(variant.solvers.values()))
    if isinstance(solver, Adaptive):
        n, samples = times.shape
        runs, _ = solver.many(tops.numbers[chosen], np.full(n, tolerance), times, np.full(n, samples), budget)
        return of_length_one(variant, Level(runs.states, runs.momenta, runs.work.astype(float), runs.outcome))
    plans = [Plan.until(row_times, tolerance, budget) for row_times in times]
    return one_by_one(variant, tops.members(chosen), plans)


def stepped(variant: Integrator, numbers: Array, h: Array, marks: NDArray[np.int64]) -> Level:
    """Runs of steps `h` (n,), sampled at `marks` (n, samples): in one call where the variant has a loop to share."""
    solver = inside(next(iter(variant.solvers.values())))
    if solver is None or solver.in_python:
        return in_turn(variant, numbers, [Plan.steps(float(step), ends) for step, ends in zip(h, marks, strict=True)])
    many = solver.many(numbers, h, marks)
    work = np.asarray(solver.counts(many.steps, many.work)[0], dtype=float)
    return of_length_one(variant, Level(many.states, many.momenta, work, many.outcome))


def of_length_one(variant: Integrator, runs: Level) -> Level:
    """Runs end where their quaternion has left length one, as they do one by one."""
    lost = off_length(next(iter(variant.solvers)), runs.states)
    outcome = np.where(lost.any(axis=1), NOT_NORMALISED, runs.outcome)
    return runs._replace(states=np.where(lost[..., np.newaxis], np.nan, runs.states), outcome=outcome)


def in_turn(variant: Integrator, numbers: Array, plans: Sequence[Plan]) -> Level:
    """Runs of tops in rows of nine numbers one after another, with equally many samples each."""
    return one_by_one(variant, members_of(numbers), plans)


def one_by_one(variant: Integrator, members: Iterable[tuple[SymmetricTop, Angles]], plans: Sequence[Plan]) -> Level:
    """Runs of tops and starts one after another, with equally many samples each."""
    (chart,), shape = variant.solvers, (len(plans), plans[0].times.size)
    states, momenta = np.full((*shape, DIMENSIONS[chart]), np.nan), np.full((*shape, 2), np.nan)
    work, outcome = np.empty(len(plans)), np.empty(len(plans), dtype=np.int64)
    for k, ((top, start), plan) in enumerate(zip(members, plans, strict=True)):
        run = solve(variant, chart, top, start, plan)
        states[k], momenta[k, :, 0], momenta[k, :, 1] = run.states, run.p_phi, run.p_psi
        work[k], outcome[k] = run.force_evaluations, OUTCOMES.index(run.outcome)
    return Level(states, momenta, work, outcome)


def climb(
    variant: Integrator, tops: Any, asked: dict[str, NDArray[np.bool_]], budget: float,
    run: Callable[..., Level] = run_level,
) -> Climb:  # fmt: skip
    """All runs of a variant on `tops`, or on another object with these properties; `asked` (targets, n) by quantity."""
    n, (chart,) = len(tops.period), variant.solvers
    names = (*asked, *(name for name in ("axis", "energy", MOMENTA) if name not in asked))
    blank = np.full((LEVELS, n), np.nan)
    record = Climb(blank.copy(), {name: blank.copy() for name in names}, np.zeros((LEVELS, n), bool), np.zeros(n, bool))
    everyone = np.flatnonzero(tops.known)
    for block in [everyone] if variant.fixed_step else np.array_split(everyone, -(-everyone.size // BLOCK) or 1):
        live = block
        for level in range(LEVELS):
            if not live.size or math.isnan(setting_of(variant, level)):
                break
            runs = run(variant, tops, live, level, budget)
            errors = tops.errors(chart, runs, live)
            good = (runs.outcome == 0) & np.isfinite(errors["axis"])
            record.work[level, live], record.ended[level, live] = runs.work, good
            for name, values in record.errors.items():
                values[level, live] = np.where(good, errors[name], np.inf)
            stay, settled = _next_members(variant, record, asked, live, level, budget)
            record.settled[live] = settled
            live = live[stay]
    return record


def _next_members(
    variant: Integrator, record: Climb, asked: dict[str, NDArray[np.bool_]], live: Members, level: int, budget: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:  # fmt: skip
    """Which of the live members go on to the next setting, and which have an accurate run."""
    work, good = record.work[level, live], record.ended[level, live]
    typical = float(np.max(work[good], initial=1.0))  # a run that failed early has not shown what the next one costs
    work = np.where(good, work, typical)
    ratio, falls = growth_of_work(variant), 2.0 ** float(variant.order or 1) if variant.fixed_step else 10.0
    left = np.floor(np.log(budget / np.maximum(work, 1.0)) / math.log(ratio))
    settled = record.errors["axis"][level, live] <= ASYMPTOTIC
    worth = ~settled
    for name, targets in asked.items():
        error = np.maximum(record.errors[name][level, live], 1e-300)
        before = record.errors[name][level - 1, live] if level else np.full(live.size, np.inf)
        open_targets = targets[:, live] & (error > np.asarray(TARGETS)[:, np.newaxis])
        following = np.max(np.where(open_targets, np.asarray(TARGETS)[:, np.newaxis], 0.0), axis=0)
        with np.errstate(all="ignore"):
            gain = np.clip(before / error, falls, 1e4)
            gain = np.where(np.isfinite(before), gain, 1e4)
            foreseen = error * gain**-left / FORGIVEN
        earlier = before if variant.fixed_step or level < 2 else record.errors[name][level - 2, live]
        stuck = (error < NEAR_ROUNDING) & (error > earlier / FLAT_GAIN)
        worth |= (following > 0.0) & ~stuck & ((foreseen <= following) | (error > ASYMPTOTIC))
    return worth & (left >= 1.0), settled


def stored(values: Array) -> Array:
    """Positive numbers with `DIGITS` bits, in single precision, which a file holds in a tenth of the space."""
    size, power = np.frexp(values)
    with np.errstate(over="ignore"):  # an error above 1e38 is infinite
        return np.ldexp(np.rint(np.ldexp(size, DIGITS)), power - DIGITS).astype(np.float32)


def table(variant: Integrator, tops: Tops, budget: float, *, twin: bool, guarded: int) -> xr.Dataset:
    """The dataset of one variant over one horizon."""
    asked = {name: mask for name, mask in tops.asked(TARGETS).items() if name in quantities_of(variant, twin)}
    record = climb(variant, tops, asked, budget)
    scenes = tops.kinds == KINDS.index(SCENE)
    energy_from = round(math.log2(LEAST_STEPS / FIRST)) if variant.fixed_step else 0
    data: dict[str, Any] = {
        **costs_of(variant, record, asked, ASKED, {"energy": energy_from}),
        "work": (("level", "kind"), typical_work(variant, record, tops)),
        **{name: (("level", "kind"), values) for name, values in _outcome_counts(record, tops).items()},
        "drawn": ("kind", [float((tops.known & (tops.kinds == kind)).sum()) for kind in range(len(KINDS))]),
        "scene_error": (("level", "named"), stored(record.errors["axis"][:, scenes])),
        "scene_work": (("level", "named"), record.work[:, scenes]),
        "chart": ((), variant.charts()[0]),
        "control": ((), variant.control or ""),
        "needs": ((), variant.needs or ""),
        "general": ((), float(variant.general or False)),
        "budget": ((), budget),
        "made": ((), float(np.isfinite(record.work).sum())),
        "evaluated": ((), float(np.nansum(record.work))),
    }
    if guarded:
        data |= {
            name: (("level", "guarded"), stored(values))
            for name, values in guarded_runs(variant, tops, record, guarded, budget).items()
        }
    return xr.Dataset(data, coords={"quantity": list(ASKED), "target": list(TARGETS), "kind": list(KINDS)})


def costs_of(
    variant: Integrator, record: Climb, asked: dict[str, NDArray[np.bool_]], names: Sequence[str],
    firsts: dict[str, int] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """The variables ``cost``, ``met_at`` and ``setting``; `firsts` gives the first level that counts for a quantity."""
    settings = np.array([setting_of(variant, level) for level in range(LEVELS)])
    set_to = np.where(np.isfinite(record.work), settings[:, np.newaxis], np.nan)
    costs, met_at = (np.full((len(names), len(TARGETS), record.work.shape[1]), np.nan, np.float32) for _ in range(2))
    for place, name in enumerate(names):
        if name in asked:
            first = (firsts or {}).get(name, 0)
            for array, values in ((costs, record.work), (met_at, set_to)):
                reached = cost_to_reach(values[first:], record.errors[name][first:], TARGETS)
                array[place] = np.where(asked[name], stored(reached), np.nan)
    over = "quantity", "target", "member"
    return {"cost": (over, costs), "met_at": (over, met_at), "setting": ("level", settings)}


def typical_work(variant: Integrator, record: Climb, tops: Any) -> Array:
    """Force evaluations of the median top of each kind, (LEVELS, kinds); NaN below the least tolerance of a variant.

    The work of a top that left the ladder is extrapolated by the growth of the work of those that stayed.
    """
    work = record.work.copy()
    for level in range(1, LEVELS):
        left = np.isnan(work[level])
        with np.errstate(all="ignore"):
            both = ~left & np.isfinite(work[level - 1])
            ratio = np.median(work[level, both] / work[level - 1, both]) if both.any() else growth_of_work(variant)
        work[level, left] = ratio * work[level - 1, left]
    limit = [np.isfinite(setting_of(variant, level)) for level in range(LEVELS)]
    kinds = [tops.known & (tops.kinds == kind) for kind in range(len(KINDS))]
    medians = [np.median(work[:, chosen], axis=1) if chosen.any() else np.full(LEVELS, np.nan) for chosen in kinds]
    return np.where(np.array(limit)[:, np.newaxis], np.stack(medians, axis=1), np.nan)


def growth_of_work(variant: Integrator) -> float:
    """By how much the work grows from one level to the next, if nothing is measured."""
    return 2.0 if variant.fixed_step else 10.0 ** (1.0 / (variant.order or 20))


def _outcome_counts(record: Climb, tops: Tops) -> dict[str, Array]:
    """Numbers of members judged, wrong, ended `ok` and silent failures, (LEVELS, kinds)."""
    ran, error = np.isfinite(record.work), record.errors["axis"]
    right_later = record.settled & ~ran & tops.known  # left before with an accurate run
    wrong = ran & ~(error <= WRONG)
    silent = wrong & record.ended & (record.errors["energy"] <= KEPT) & (record.errors[MOMENTA] <= KEPT)
    masks = {"runs": ran | right_later, "wrong": wrong, "ended": record.ended | right_later, "silent": silent}
    return {
        name: np.stack([mask[:, tops.kinds == kind].sum(axis=1) for kind in range(len(KINDS))], axis=1).astype(float)
        for name, mask in masks.items()
    }


def guarded_runs(variant: Integrator, tops: Tops, record: Climb, guarded: int, budget: float) -> dict[str, Array]:
    """Axis errors by the guard's forecast and of the runs, and errors of constants, of the first members.

    Arrays (LEVELS, guarded). The error of a run that ends early is infinite, in the forecast and in the run.
    """
    (chart,) = variant.charts()
    data = {name: np.full((LEVELS, guarded), np.nan) for name in ("foretold", "watched", "measured", "whole")}
    halves = [
        np.flatnonzero(tops.known & part)
        for part in (tops.kinds < KINDS.index(NATURAL), tops.kinds == KINDS.index(NATURAL))
    ]
    chosen = np.concatenate([halves[0][: guarded // 2], halves[1][: guarded // 2]])
    for place, (top, start) in enumerate(tops.members(chosen)):
        member = chosen[place]
        scene = Scene(f"member-{member}", top, start, horizon=float(tops.times[member, -1]))
        for level in range(GUARDED_LEVELS):
            if math.isfinite(record.work[level, member]):
                if variant.fixed_step:
                    plan = Plan.steps(float(tops.period[member]) / FIRST * 0.5**level, tops.marks << level)
                else:
                    plan = Plan.until(tops.times[member], setting_of(variant, level), budget)
                expected = forecast(scene, variant, chart, plan)
                data["foretold"][level, place] = expected.axis_error if expected.outcome == "ok" else math.inf
                data["whole"][level, place] = expected.whole
                data["watched"][level, place] = max(record.errors[name][level, member] for name in ("energy", MOMENTA))
                data["measured"][level, place] = record.errors["axis"][level, member]
    return data
