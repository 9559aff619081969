"""Timing many methods against each other on one scene, most of it where it decides something.

There are too many settings to time them all, and most cannot win. So:

    1  every method is timed at its coarsest setting over the short horizon and at the finest that met a target there;
       with W force evaluations a run takes  o + c W  seconds, and these two runs give the overhead o and the slope c
    2  the cost of every other setting is foreseen with that line: `seconds_foreseen`
    3  for every horizon and target the methods foreseen within `WITHIN` of the fastest, at most `FIELD` of them, and
       of compiled methods the next one behind them, are timed again in rounds, each method once a round in random
       order, so that samples of a round are pairs; if one that was not among them now seems to lead somewhere, it is
       timed with its rivals, until every leader was
    4  the machine may be faster or slower by then, so one run of step 1 of every method in a race is timed in it again:
       the ratio is the method's `seconds_pace`, by which its forecasts are scaled; those of a method that was in no
       race are scaled by the median of the others

`seconds` is the smallest sample of step 3 where there is one (`seconds_timed` 1) and foreseen elsewhere (0). The shape
of the line was fixed before step 3, so the runs of step 3 are a test of it that it has not seen: `foreseen_miss`.
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
from symtop.run.simulation import choose_chart

FIELD = 3
MOST_RACES = 4
CELLS = ("seconds", "seconds_timed", "seconds_foreseen", "seconds_race", "spread", "reliable")
LARGEST = {"compiled": 1e5, "python": 1e4}  # force evaluations of the longer run of step 1
SMALLEST_GAP = 1.5  # between the work of the two runs of step 1


class Entry(NamedTuple):
    """One run to be timed: whose, over which horizon, and its place in the table of settings."""

    name: str
    far: int  # index of the horizon
    place: int  # index of the setting
    setting: float
    work: float  # force evaluations
    targets: tuple[int, ...]  # which targets it is the cheapest run for


def entries(data: xr.Dataset, targets: Sequence[float] = TARGETS) -> list[Entry]:
    """All runs of one scene that ended well; `data` has dimensions integrator, horizon and setting."""
    found = []
    for name in data["integrator"].values:
        for far in range(data.sizes["horizon"]):
            cell = data.sel(integrator=name).isel(horizon=far)
            work = np.where(cell["outcome"].values == "ok", cell["force_evaluations"].values, np.nan)
            serves: dict[int, list[int]] = {}
            for number, target in enumerate(targets):
                if (least := int(least_work(cell, target))) >= 0:
                    serves.setdefault(least, []).append(number)
            found += [
                Entry(
                    str(name),
                    far,
                    int(k),
                    float(cell["setting_value"].values[k]),
                    float(work[k]),
                    tuple(serves.get(int(k), ())),
                )
                for k in np.flatnonzero(np.isfinite(work))
            ]
    return found


def anchors(own: Sequence[Entry], tier: str) -> list[Entry]:
    """The two runs over its shortest horizon that a method's line of cost is drawn through."""
    shortest = min(entry.far for entry in own)
    near = sorted((entry for entry in own if entry.far == shortest), key=lambda entry: entry.work)
    useful = [entry for entry in near if entry.targets] or near
    fits = [entry for entry in useful if entry.work <= LARGEST[tier]] or useful[:1]
    first, last = near[0], fits[-1]
    if last.work < SMALLEST_GAP * first.work:
        wider = [entry for entry in near if SMALLEST_GAP * first.work <= entry.work <= LARGEST[tier]]
        last = wider[-1] if wider else first
    return [first] if last is first else [first, last]


class Line(NamedTuple):
    """Seconds of a run as overhead + slope * work."""

    overhead: float
    slope: float

    def __call__(self, work: float) -> float:
        """Seconds of a run of so much work."""
        return self.overhead + self.slope * work


def line(points: Sequence[tuple[float, float]]) -> Line:
    """Through (work, seconds) of one run, proportional, or of two, with an overhead that is not negative."""
    (work, seconds), (more, longer) = points[0], points[-1]
    if more <= work or longer <= seconds:
        return Line(0.0, longer / max(more, 1.0))
    slope = (longer - seconds) / (more - work)
    return Line(seconds - slope * work, slope) if seconds > slope * work else Line(0.0, longer / more)


def field(runs: Sequence[Entry], cost: Mapping[Entry, float], tier: Mapping[str, str]) -> list[list[Entry]]:
    """Who takes part in step 3: for each tier, horizon and target those that are near the front, cheapest first.

    Of compiled methods also the next one behind those, so that a lead is over a method that was timed. Methods in plain
    Python are too slow for that.
    """
    heats: dict[tuple[str, int, int], list[Entry]] = {}
    for entry in sorted(runs, key=lambda run: cost[run]):
        for number in entry.targets:
            heats.setdefault((tier[entry.name], entry.far, number), []).append(entry)
    taking_part = []
    for (kind, *_), heat in heats.items():
        near = sum(cost[entry] <= WITHIN * cost[heat[0]] for entry in heat[:FIELD])
        taking_part.append(heat[: near + (kind == "compiled")])
    return taking_part


def clock(own: Sequence[Entry], taken: Mapping[Entry, Timing], batch: float) -> Entry:
    """Which of a method's runs of step 1 shows its pace later: the longest that a batch can hold."""
    return max((entry for entry in own if taken[entry].best <= batch), key=lambda entry: entry.work, default=own[0])


def race(
    scene: Scene, horizons: Sequence[float], runs: Sequence[Entry], rounds: int = 6, batch: float = BATCH,
    size: int | None = None,
) -> xr.Dataset:  # fmt: skip
    """Seconds of all runs of a scene: dimensions integrator, horizon, setting, batch (see the module).

    `runs` come from `entries`; `size` is the length of ``setting``. Variables: ``seconds``, ``seconds_timed``,
    ``seconds_foreseen``, ``seconds_samples`` (all batches; NaN beyond those made), ``seconds_race`` (which race of
    step 3 they are from, 0 for none: samples pair up within one race), ``spread`` and ``reliable`` of the samples, and
    for each integrator ``first_call``, ``seconds_overhead``, ``seconds_per_evaluation``, ``foreseen_miss`` (largest
    relative miss of a forecast in step 3) and ``seconds_pace`` (see step 4).
    """
    names = list(dict.fromkeys(entry.name for entry in runs))
    methods = {name: integrator(name) for name in names}
    tier = {name: method.tier for name, method in methods.items()}
    first = {name: anchors([entry for entry in runs if entry.name == name], tier[name]) for name in names}
    opening = [entry for name in names for entry in first[name]]
    calls = [_call(scene, methods, entry, horizons) for entry in opening]
    found = timings(calls, 2, 0.5 * batch)  # the line only: no time that is shown
    taken: dict[Entry, Timing] = dict(zip(opening, found, strict=True))
    lines = {name: line([(entry.work, taken[entry].best) for entry in first[name]]) for name in names}
    first_calls = [taken[first[name][0]].first_call for name in names]
    clocks = {name: clock(first[name], taken, batch) for name in names}
    before = {name: taken[clocks[name]].best for name in names}
    pace: dict[str, float] = {}
    expected = foreseen = {entry: lines[entry.name](entry.work) for entry in runs}
    heat: dict[Entry, int] = {}
    for number in range(1, MOST_RACES + 1):
        last = [entry for group in field(runs, expected, tier) if not set(group) <= set(heat) for entry in group]
        last = list(dict.fromkeys(last))
        if not last:
            break
        paced = list(dict.fromkeys([*last, *(clocks[entry.name] for entry in last)]))
        found = timings([_call(scene, methods, entry, horizons) for entry in paced], rounds, batch, seed=number)
        again = dict(zip(paced, found, strict=True))
        taken |= {entry: again[entry] for entry in last}
        heat |= dict.fromkeys(last, number)
        pace |= {entry.name: again[clocks[entry.name]].best / before[entry.name] for entry in last}
        usual = float(np.median(list(pace.values())))
        foreseen = {entry: lines[entry.name](entry.work) * pace.get(entry.name, usual) for entry in runs}
        expected = foreseen | {entry: taken[entry].best for entry in heat}

    place = {name: k for k, name in enumerate(names)}
    shape = (len(names), len(horizons), size or 1 + max(entry.place for entry in runs))
    table = {key: np.full(shape, np.nan) for key in CELLS}
    samples = np.full((*shape, rounds), np.nan)
    for entry in runs:
        cell = place[entry.name], entry.far, entry.place
        table["seconds_foreseen"][cell] = foreseen[entry]
        table["seconds"][cell] = expected[entry]
        table["seconds_timed"][cell] = float(entry in heat)
        table["seconds_race"][cell] = heat.get(entry, 0)
        if entry in heat:
            timing = taken[entry]
            samples[cell][: len(timing.samples)] = timing.samples
            table["spread"][cell], table["reliable"][cell] = timing.spread, float(timing.reliable)
    misses = dict.fromkeys(names, math.nan)
    for entry in heat:
        if entry not in opening:
            miss = abs(foreseen[entry] / taken[entry].best - 1.0)
            misses[entry.name] = miss if math.isnan(misses[entry.name]) else max(misses[entry.name], miss)
    single = {
        "first_call": first_calls,
        "seconds_pace": [pace.get(name, math.nan) for name in names],
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


def _call(scene: Scene, methods: Mapping[str, Integrator], entry: Entry, horizons: Sequence[float]) -> Any:
    method = methods[entry.name]
    return bare_run(scene, method, choose_chart(method, "axis"), entry.setting, horizons[entry.far])
