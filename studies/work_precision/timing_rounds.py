"""Times of many variants on one scene; most of the timing goes to those that may be the fastest.

A run is timed if, of its variant's runs that meet some target over some horizon, it has the fewest force evaluations;
of the variants whose energy errors are compared at equal run time, every run over the last horizon is timed. No other
run has a time, and no time is computed from others.

All of them take part in a few rounds of short batches: in each round every run once, in random order. What serves the
comparison of energies alone, over decades of time, has one round less, and a run of more than half of `PATIENCE` has
two. The contenders for a target, those within `WITHIN` of the fastest compiled or plain Python one, then take part in
further rounds of longer batches. Then each time is compared with what the variant's other times foretell
(`forecasts`); one that misses that by a quarter (`MISSED`), has no forecast, or whose smallest sample no other
comes near (`AGAIN`), is taken again. A time that still misses is kept with its forecast beside it, and a lead must
then hold for both.

`seconds` is the smallest sample. Everything runs on one thread; compilation and first use are in `first_call`.
"""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from symtop.measure.settings import TARGETS
from symtop.measure.timing import Timing, bare_run, first_call, timings
from symtop.methods.framework.registry import Integrator, integrator
from symtop.model.charts import Array
from symtop.model.scenes import Scene

from .leads import MISSED, met_again
from .walk import least_work

WITHIN = 1.6  # of the fastest
AGAIN_ROUNDS = 4
PATIENCE = 0.02  # seconds of samples of one run, in the first rounds, that are enough if there are two
MANY = 1002  # samples that show what one of a closed form costs


class TimedRun(NamedTuple):
    """One run to be timed: of which variant, over which horizon, and its place in the table of settings."""

    name: str
    far: int  # index of the horizon
    place: int  # index of the setting
    setting: float
    evaluations: float
    steps: float
    targets: tuple[int, ...]  # which targets it is the cheapest run for


class Effort(NamedTuple):
    """How long to time a run: so many batches of at least so many seconds."""

    rounds: int
    batch: float


def timed_runs(data: xr.Dataset, compared: Collection[str] = ()) -> list[TimedRun]:
    """The runs of one scene to be timed; of the variants in `compared`, all that ended well over the last horizon.

    `data` has dimensions integrator, horizon and setting.
    """
    runs = []
    for name in map(str, data["variant"].values):
        for far in range(data.sizes["horizon"]):
            cell = data.sel(variant=name).isel(horizon=far)
            serves: dict[int, list[int]] = {}
            if name in compared and far == data.sizes["horizon"] - 1:
                serves = {int(k): [] for k in np.flatnonzero(cell["outcome"].values == "ok")}
            for number, target in enumerate(TARGETS):
                if (least := int(least_work(cell, target))) >= 0:
                    serves.setdefault(least, []).append(number)
            setting, work, steps = (
                cell[key].values.astype(float) for key in ("setting_value", "force_evaluations", "steps")
            )
            runs += [
                TimedRun(name, far, k, float(setting[k]), float(work[k]), float(steps[k]), tuple(served))
                for k, served in serves.items()
            ]
    return runs


def contenders(runs: Sequence[TimedRun], cost: Mapping[TimedRun, float], kind: Mapping[str, str]) -> list[TimedRun]:
    """The runs near the fastest of their kind for some horizon and target; the fastest is among them."""
    rivals: dict[tuple[str, int, int], list[TimedRun]] = {}
    for run in sorted(runs, key=lambda run: cost[run]):
        for number in run.targets:
            rivals.setdefault((kind[run.name], run.far, number), []).append(run)
    near = [[run for run in group if cost[run] <= WITHIN * cost[group[0]]] for group in rivals.values()]
    return list(dict.fromkeys(run for group in near if len(group) > 1 for run in group))


def forecasts(seconds: ArrayLike, evaluations: ArrayLike, steps: ArrayLike, *, fixed_step: bool) -> Array:
    """The time of each run of a method as its other runs foretell it: (n,), NaN with fewer than two others.

    A run costs a call, its force evaluations and its steps, and, of an adaptive method, as much for every evaluation in
    proportion to the evaluations of a step: a Taylor derivative is the dearer the higher it is. The costs are those of
    the least relative squares over the other runs. Nothing is shown that comes from here: a time that misses its
    forecast is taken again. On a quiet machine 1 in 90 misses it by a quarter, and half by 1 %.
    """
    times, work, count = (np.asarray(values, dtype=float) for values in (seconds, evaluations, steps))
    costs = [work, np.ones_like(work), count]
    columns = np.stack(costs if fixed_step else [*costs, work**2 / np.maximum(count, 1.0)], axis=1)
    expected = np.full(times.size, np.nan)
    for k in range(times.size):
        others = np.arange(times.size) != k
        size = min(columns.shape[1], int(others.sum()) - 1)
        if size > 0:
            relative = columns[others, :size] / times[others, None]
            unit = np.linalg.norm(relative, axis=0)
            cost, *_ = np.linalg.lstsq(relative / unit, np.ones(len(relative)), rcond=1e-6)
            expected[k] = columns[k, :size] @ (cost / unit)
    return expected


def foretold(cost: Mapping[TimedRun, float], methods: Mapping[str, Integrator]) -> dict[TimedRun, float]:
    """What the other times of its variant foretell for every run; NaN where there are too few of them."""
    expected: dict[TimedRun, float] = {}
    for name, method in methods.items():
        own = [run for run in cost if run.name == name]
        values = forecasts(
            [cost[run] for run in own], [run.evaluations for run in own], [run.steps for run in own],
            fixed_step=method.fixed_step,
        )  # fmt: skip
        expected |= dict(zip(own, map(float, values), strict=True))
    return expected


def timing_rounds(
    scene: Scene, horizons: Sequence[float], runs: Sequence[TimedRun], first: Effort, further: Effort
) -> xr.Dataset:
    """Seconds of the runs of a scene: dimensions integrator, horizon, setting, batch.

    Variables: ``seconds``; ``seconds_samples``, one column a round, NaN for the rounds that a run has no part in;
    ``spread`` of the samples; ``seconds_forecast``, from the variant's other runs; for each variant ``first_call``;
    and for a variant that takes no steps ``set_up_seconds``, before the first sample, and ``sample_seconds``, for each
    of them.
    """
    methods = {run.name: integrator(run.name) for run in runs}

    def call(run: TimedRun) -> Callable[[], object]:
        method = methods[run.name]
        return bare_run(scene, method, method.chart_for("axis"), run.setting, horizons[run.far])

    def measured(
        chosen: Sequence[TimedRun], effort: Effort, seed: int, patience: float = math.inf
    ) -> dict[TimedRun, Timing]:
        taken = timings([call(run) for run in chosen], *effort, seed, warm=True, patience=patience)
        return dict(zip(chosen, taken, strict=True))

    least = {run.name: run for run in sorted(runs, key=lambda run: -run.evaluations)}
    firsts = {name: first_call(call(least[name])) for name in methods}
    energies = [run for run in runs if not run.targets]
    once = measured([run for run in runs if run.targets], first, 0, PATIENCE)
    once |= measured(energies, first._replace(rounds=first.rounds - 1), 0)
    kind = {name: method.implementation if method.control else "closed form" for name, method in methods.items()}
    twice = measured(contenders(runs, {run: timing.best for run, timing in once.items()}, kind), further, 1)
    so_far = {run: [*timing.samples, *(twice[run].samples if run in twice else ())] for run, timing in once.items()}
    cost = {run: min(samples) for run, samples in so_far.items()}
    expected = foretold(cost, methods)
    missed = [
        run for run in runs if not (abs(cost[run] / expected[run] - 1.0) <= MISSED and met_again(so_far[run]))
    ]  # fmt: skip
    again = measured(missed, first._replace(rounds=AGAIN_ROUNDS), 2)

    row = {name: k for k, name in enumerate(methods)}
    size = 1 + max(run.place for run in runs)
    samples = np.full((len(row), len(horizons), size, first.rounds + further.rounds + AGAIN_ROUNDS), np.nan)
    for stage, column in ((once, 0), (twice, first.rounds), (again, first.rounds + further.rounds)):
        for run, timing in stage.items():
            samples[row[run.name], run.far, run.place, column : column + len(timing.samples)] = timing.samples
    cost = {run: min(price, again[run].best if run in again else np.inf) for run, price in cost.items()}
    forecast = np.full(samples.shape[:-1], np.nan)
    for run, seconds in foretold(cost, methods).items():
        forecast[row[run.name], run.far, run.place] = seconds
    beside = [_closed_form(scene, method, horizons[-1], further) for method in methods.values()]
    dims = ("variant", "horizon", "setting")
    table = xr.Dataset({"seconds_samples": ((*dims, "batch"), samples)}, coords={"variant": list(row)})
    best = table["seconds_samples"].min("batch")
    return table.assign(
        seconds=best,
        spread=table["seconds_samples"].median("batch") / best - 1.0,
        seconds_forecast=(dims, forecast),
        first_call=("variant", [firsts[name] for name in row]),
        set_up_seconds=("variant", [before for before, _ in beside]),
        sample_seconds=("variant", [each for _, each in beside]),
    )


def _closed_form(scene: Scene, method: Integrator, horizon: float, effort: Effort) -> tuple[float, float]:
    """Seconds before the first sample and for each sample of a method without steps; NaN of one that steps."""
    if method.control is not None:
        return np.nan, np.nan
    chart = method.chart_for("axis")
    calls = [bare_run(scene, method, chart, np.nan, horizon, count) for count in (2, MANY)]
    few, many = (timing.best for timing in timings(calls, *effort))
    each = (many - few) / (MANY - 2)
    return few - 2.0 * each, each
