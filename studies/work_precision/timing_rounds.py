"""Times of many methods on one scene; most of the timing goes to those that may be the fastest.

There are too many settings to time them all, and most cannot be the fastest. So:

    1  every method is timed at its coarsest setting over the short horizon and at the finest that met a target there;
       with W force evaluations a run takes  o + c W  seconds, and these two runs give the overhead o and the slope c
    2  the time of every other setting is predicted with that line: `seconds_foreseen`
    3  for every horizon and target the contenders are the methods predicted within `WITHIN` of the fastest, at most
       `MOST_NEAR` of them, and of compiled methods the next one behind them. They are timed again in rounds, each
       method once a round in random order, so that samples of a round are pairs. If a method that was not among them
       now seems the fastest somewhere, it is timed with its own contenders, until every leader was
    4  the machine may be faster or slower by then, so one run of step 1 of every contender is timed in the rounds
       again. The ratio of the two times is the method's speed ratio, `seconds_pace`, by which its predictions are
       scaled; those of a method that was no contender are scaled by the median of the others

`seconds` is the smallest sample of step 3 where there is one (`seconds_timed` 1) and predicted elsewhere (0). The line
was fixed before step 3, so that step 3 tests it on runs that it has not seen: `foreseen_miss`.
Everything runs on one thread; compilation and first use are in `first_call`.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from symtop.measure.ranking import WITHIN
from symtop.measure.timing import BATCH, Timing, bare_run, timings
from symtop.measure.work import TARGETS, least_work
from symtop.methods.registry import Integrator, integrator
from symtop.model.scenes import Scene

MOST_NEAR = 3  # contenders for one target, besides the next one behind them
MOST_REPEATS = 4  # of step 3
CELLS = ("seconds", "seconds_timed", "seconds_foreseen", "seconds_race", "spread", "reliable")
LARGEST = {"compiled": 1e5, "python": 1e4}  # force evaluations of the longer run of step 1
SMALLEST_GAP = 1.5  # between the work of the two runs of step 1


class TimedRun(NamedTuple):
    """One run to be timed: of which method, over which horizon, and its place in the table of settings."""

    name: str
    far: int  # index of the horizon
    place: int  # index of the setting
    setting: float
    work: float  # force evaluations
    targets: tuple[int, ...]  # which targets it is the cheapest run for


def timed_runs(data: xr.Dataset, targets: Sequence[float] = TARGETS) -> list[TimedRun]:
    """All runs of one scene that ended well; `data` has dimensions integrator, horizon and setting."""
    runs = []
    for name in data["integrator"].values:
        for far in range(data.sizes["horizon"]):
            cell = data.sel(integrator=name).isel(horizon=far)
            work = np.where(cell["outcome"].values == "ok", cell["force_evaluations"].values, np.nan)
            setting = cell["setting_value"].values
            serves: dict[int, list[int]] = {}
            for number, target in enumerate(targets):
                if (least := int(least_work(cell, target))) >= 0:
                    serves.setdefault(least, []).append(number)
            runs += [
                TimedRun(str(name), far, int(k), float(setting[k]), float(work[k]), tuple(serves.get(int(k), ())))
                for k in np.flatnonzero(np.isfinite(work))
            ]
    return runs


def calibration_runs(runs: Sequence[TimedRun], tier: str) -> list[TimedRun]:
    """The runs of one method, over its shortest horizon, that its line of cost is drawn through: two, or one."""
    shortest = min(run.far for run in runs)
    near = sorted((run for run in runs if run.far == shortest), key=lambda run: run.work)
    useful = [run for run in near if run.targets] or near
    fits = [run for run in useful if run.work <= LARGEST[tier]] or useful[:1]
    first, last = near[0], fits[-1]
    if last.work < SMALLEST_GAP * first.work:
        wider = [run for run in near if SMALLEST_GAP * first.work <= run.work <= LARGEST[tier]]
        last = wider[-1] if wider else first
    return [first] if last is first else [first, last]


class CostLine(NamedTuple):
    """Seconds of a run as overhead + slope * work."""

    overhead: float
    slope: float

    def __call__(self, work: float) -> float:
        """Seconds of a run of so much work."""
        return self.overhead + self.slope * work


def cost_line(points: Sequence[tuple[float, float]]) -> CostLine:
    """Through (work, seconds) of one run, proportional, or of two, with an overhead that is not negative."""
    (work, seconds), (more, longer) = points[0], points[-1]
    if more <= work or longer <= seconds:
        return CostLine(0.0, longer / max(more, 1.0))
    slope = (longer - seconds) / (more - work)
    return CostLine(seconds - slope * work, slope) if seconds > slope * work else CostLine(0.0, longer / more)


def contenders(
    runs: Sequence[TimedRun], cost: Mapping[TimedRun, float], tier: Mapping[str, str]
) -> list[list[TimedRun]]:
    """The runs of step 3: for each tier, horizon and target those that are near the fastest, cheapest first.

    Of compiled methods also the next one behind those, so that a lead is over a method that was timed. Methods in plain
    Python are too slow for that.
    """
    rivals: dict[tuple[str, int, int], list[TimedRun]] = {}
    for run in sorted(runs, key=lambda run: cost[run]):
        for number in run.targets:
            rivals.setdefault((tier[run.name], run.far, number), []).append(run)
    groups = []
    for (kind, *_), group in rivals.items():
        near = sum(cost[run] <= WITHIN * cost[group[0]] for run in group[:MOST_NEAR])
        groups.append(group[: near + (kind == "compiled")])
    return groups


def speed_probe(runs: Sequence[TimedRun], taken: Mapping[TimedRun, Timing], batch: float) -> TimedRun:
    """The run of step 1 that is timed again in step 4 to measure how the machine's speed has changed.

    It is the longest that a batch can hold, or else the first.
    """
    return max((run for run in runs if taken[run].best <= batch), key=lambda run: run.work, default=runs[0])


def timing_rounds(
    scene: Scene, horizons: Sequence[float], runs: Sequence[TimedRun], rounds: int = 6, batch: float = BATCH,
    size: int | None = None,
) -> xr.Dataset:  # fmt: skip
    """Seconds of all runs of a scene: dimensions integrator, horizon, setting, batch (see the module).

    `runs` come from `timed_runs`; `size` is the length of ``setting``. Variables: ``seconds``, ``seconds_timed``,
    ``seconds_foreseen``, ``seconds_samples`` (all batches; NaN beyond those made), ``seconds_race`` (which repeat of
    step 3 they are from, 0 for none: samples pair up within one), ``spread`` and ``reliable`` of the samples, and
    for each integrator ``first_call``, ``seconds_overhead``, ``seconds_per_evaluation``, ``foreseen_miss`` (largest
    relative miss of a prediction in step 3) and ``seconds_pace`` (the speed ratio of step 4).
    """
    names = list(dict.fromkeys(run.name for run in runs))
    methods = {name: integrator(name) for name in names}
    tier = {name: method.tier for name, method in methods.items()}
    first = {name: calibration_runs([run for run in runs if run.name == name], tier[name]) for name in names}
    calibration = [run for name in names for run in first[name]]
    calls = [_call(scene, methods, run, horizons) for run in calibration]
    measured = timings(calls, 2, 0.5 * batch)  # the line only: no time that is shown
    taken: dict[TimedRun, Timing] = dict(zip(calibration, measured, strict=True))
    lines = {name: cost_line([(run.work, taken[run].best) for run in first[name]]) for name in names}
    first_calls = [taken[first[name][0]].first_call for name in names]
    probes = {name: speed_probe(first[name], taken, batch) for name in names}
    before = {name: taken[probes[name]].best for name in names}
    speed_ratio: dict[str, float] = {}
    expected = predicted = {run: lines[run.name](run.work) for run in runs}
    repeat_of: dict[TimedRun, int] = {}
    for number in range(1, MOST_REPEATS + 1):
        groups = contenders(runs, expected, tier)
        new = list(dict.fromkeys(run for group in groups if not set(group) <= set(repeat_of) for run in group))
        if not new:
            break
        together = list(dict.fromkeys([*new, *(probes[run.name] for run in new)]))
        measured = timings([_call(scene, methods, run, horizons) for run in together], rounds, batch, seed=number)
        again = dict(zip(together, measured, strict=True))
        taken |= {run: again[run] for run in new}
        repeat_of |= dict.fromkeys(new, number)
        speed_ratio |= {run.name: again[probes[run.name]].best / before[run.name] for run in new}
        usual = float(np.median(list(speed_ratio.values())))
        predicted = {run: lines[run.name](run.work) * speed_ratio.get(run.name, usual) for run in runs}
        expected = predicted | {run: taken[run].best for run in repeat_of}

    row = {name: k for k, name in enumerate(names)}
    shape = (len(names), len(horizons), size or 1 + max(run.place for run in runs))
    table = {key: np.full(shape, np.nan) for key in CELLS}
    samples = np.full((*shape, rounds), np.nan)
    for run in runs:
        cell = row[run.name], run.far, run.place
        table["seconds_foreseen"][cell] = predicted[run]
        table["seconds"][cell] = expected[run]
        table["seconds_timed"][cell] = float(run in repeat_of)
        table["seconds_race"][cell] = repeat_of.get(run, 0)
        if run in repeat_of:
            timing = taken[run]
            samples[cell][: len(timing.samples)] = timing.samples
            table["spread"][cell], table["reliable"][cell] = timing.spread, float(timing.reliable)
    misses = dict.fromkeys(names, math.nan)
    for run in repeat_of:
        if run not in calibration:
            miss = abs(predicted[run] / taken[run].best - 1.0)
            misses[run.name] = miss if math.isnan(misses[run.name]) else max(misses[run.name], miss)
    single = {
        "first_call": first_calls,
        "seconds_pace": [speed_ratio.get(name, math.nan) for name in names],
        "seconds_overhead": [lines[name].overhead for name in names],
        "seconds_per_evaluation": [lines[name].slope for name in names],
        "foreseen_miss": [misses[name] for name in names],
    }
    dims = ("integrator", "horizon", "setting")
    return xr.Dataset(
        {key: (dims, values) for key, values in table.items()}
        | {"seconds_samples": ((*dims, "batch"), samples)}
        | {key: ("integrator", values) for key, values in single.items()},
        coords={"integrator": names},
    )


def _call(scene: Scene, methods: Mapping[str, Integrator], run: TimedRun, horizons: Sequence[float]) -> Any:
    method = methods[run.name]
    return bare_run(scene, method, method.chart_for("axis"), run.setting, horizons[run.far])
