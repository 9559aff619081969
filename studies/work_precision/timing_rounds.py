"""Times of many methods on one scene; most of the timing goes to those that may be the fastest.

A run is timed if, of its method's runs that meet some target over some horizon, it has the fewest force evaluations;
of the methods whose energy errors are compared at equal run time, every run over the last horizon is timed. No other
run has a time.

All of them take part in a few rounds of short batches: in each round every run once, in random order. The contenders
for a target, those within `WITHIN` of the fastest compiled or plain Python one, then take part in further rounds of
longer batches. A contender whose two times differ by more than a quarter (`NOISY`) takes part in as many rounds again.

`seconds` is the smallest sample. Everything runs on one thread; compilation and first use are in `first_call`.
"""

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.measure.timing import NOISY, Timing, bare_run, timings
from symtop.measure.work import TARGETS, least_work
from symtop.methods.registry import integrator
from symtop.model.scenes import Scene

WITHIN = 1.6  # of the fastest
MOST_NEAR = 4  # contenders for one target


class TimedRun(NamedTuple):
    """One run to be timed: of which method, over which horizon, and its place in the table of settings."""

    name: str
    far: int  # index of the horizon
    place: int  # index of the setting
    setting: float
    targets: tuple[int, ...]  # which targets it is the cheapest run for


class Effort(NamedTuple):
    """How long to time a run: so many batches of at least so many seconds."""

    rounds: int
    batch: float


def timed_runs(data: xr.Dataset, compared: Collection[str] = ()) -> list[TimedRun]:
    """The runs of one scene to be timed; of the methods in `compared`, all that ended well over the last horizon.

    `data` has dimensions integrator, horizon and setting.
    """
    runs = []
    for name in map(str, data["integrator"].values):
        for far in range(data.sizes["horizon"]):
            cell = data.sel(integrator=name).isel(horizon=far)
            serves: dict[int, list[int]] = {}
            if name in compared and far == data.sizes["horizon"] - 1:
                serves = {int(k): [] for k in np.flatnonzero(cell["outcome"].values == "ok")}
            for number, target in enumerate(TARGETS):
                if (least := int(least_work(cell, target))) >= 0:
                    serves.setdefault(least, []).append(number)
            setting = cell["setting_value"].values
            runs += [TimedRun(name, far, k, float(setting[k]), tuple(served)) for k, served in serves.items()]
    return runs


def contenders(runs: Sequence[TimedRun], cost: Mapping[TimedRun, float], kind: Mapping[str, str]) -> list[TimedRun]:
    """The runs near the fastest, compiled or plain Python, for some horizon and target; that one is among them."""
    rivals: dict[tuple[str, int, int], list[TimedRun]] = {}
    for run in sorted(runs, key=lambda run: cost[run]):
        for number in run.targets:
            rivals.setdefault((kind[run.name], run.far, number), []).append(run)
    near = [[run for run in group[:MOST_NEAR] if cost[run] <= WITHIN * cost[group[0]]] for group in rivals.values()]
    return list(dict.fromkeys(run for group in near if len(group) > 1 for run in group))


def timing_rounds(
    scene: Scene, horizons: Sequence[float], runs: Sequence[TimedRun], first: Effort, further: Effort
) -> xr.Dataset:
    """Seconds of the runs of a scene: dimensions integrator, horizon, setting, batch.

    Variables: ``seconds``; ``seconds_samples``, one column a round, NaN for the rounds that a run has no part in;
    ``spread`` of the samples; and for each integrator ``first_call``.
    """
    methods = {run.name: integrator(run.name) for run in runs}

    def measured(chosen: Sequence[TimedRun], effort: Effort, seed: int) -> dict[TimedRun, Timing]:
        calls = [
            bare_run(scene, methods[run.name], methods[run.name].chart_for("axis"), run.setting, horizons[run.far])
            for run in chosen
        ]
        return dict(zip(chosen, timings(calls, *effort, seed), strict=True))

    once = measured(runs, first, 0)
    kind = {name: method.implementation for name, method in methods.items()}
    twice = measured(contenders(runs, {run: timing.best for run, timing in once.items()}, kind), further, 1)
    pairs = {run: sorted((once[run].best, timing.best)) for run, timing in twice.items()}
    differing = [run for run, (less, more) in pairs.items() if more > (1.0 + NOISY) * less]
    again = measured(differing, further, 2)

    row = {name: k for k, name in enumerate(methods)}
    size = 1 + max(run.place for run in runs)
    samples = np.full((len(row), len(horizons), size, first.rounds + 2 * further.rounds), np.nan)
    for stage, column in ((once, 0), (twice, first.rounds), (again, first.rounds + further.rounds)):
        for run, timing in stage.items():
            samples[row[run.name], run.far, run.place, column : column + len(timing.samples)] = timing.samples
    firsts = {run.name: once[run].first_call for run in reversed(runs)}
    dims = ("integrator", "horizon", "setting")
    table = xr.Dataset({"seconds_samples": ((*dims, "batch"), samples)}, coords={"integrator": list(row)})
    best = table["seconds_samples"].min("batch")
    return table.assign(
        seconds=best,
        spread=table["seconds_samples"].median("batch") / best - 1.0,
        first_call=("integrator", [firsts[name] for name in row]),
    )
