"""Settings of equal accuracy, and their times.

Dimensions: variant (such as ``rk45-numba[axis]``, see `cells`), horizon (nutation periods), target (of the axis
error, rad), call, process. A time is the median over processes that are started for it, one after another, of the least
sample of each: where memory and code lie differs from process to process and stays the same within one. Where the
quartiles of the processes are far apart more are started, and the least of all count, since a busy machine only adds.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from symtop_studies import fresh_process
from symtop_studies.cost.prices import quartile_spread

from symtop.measure import settings
from symtop.measure.timing import first_call, timings
from symtop.model.charts import Array
from symtop.model.scenes import Scene

from .cells import CALLS, COMPILED, NUMPY, SCIPY_NUMBA, SCIPY_PYTHON, Cell, caller, cells  # fmt: skip

LEAST = 0.7  # of the target: the search ends at an error between this and the target, or after nine runs
PATIENCE = {COMPILED: 2e6, SCIPY_NUMBA: 4e4, SCIPY_PYTHON: 4e4, NUMPY: 4e4}  # force evaluations of one run
FINER = 1e-3  # of the target: the tolerance with which a second search begins
NOISY, TRIES = 0.25, 4  # a time with (upper - lower quartile)/median above this is measured again, so often in all
ENOUGH = 0.03  # seconds of samples of a function in one process; a longer function gets one sample
WARM = 0.01  # of the horizon: length of a run that loads and compiles the code of the timed one


class Goal(NamedTuple):
    """An accuracy over a horizon, and the languages and calls that are compared there."""

    nutations: float
    target: float
    languages: tuple[str, ...]
    calls: tuple[str, ...]


def settle(scene: Scene, grid: Sequence[Cell], goal: Goal) -> dict[Cell, settings.Attempt]:
    """A setting of every cell that meets the goal; its `why` is the reason if there is none.

    One search for each scheme and chart, in its first language; the others take the same setting, and their error is
    measured again.
    """
    horizon = goal.nutations * scene.nutation_period
    leaders: dict[tuple[str, str], settings.Attempt] = {}
    settled: dict[Cell, settings.Attempt] = {}
    for cell in grid:
        pair, patience = (cell.scheme, cell.chart), PATIENCE[cell.language]
        leader = leaders.get(pair)
        if leader is None:
            plan = {"patience": patience, "least": LEAST}
            trial = settings.search(scene, cell.method, goal.target, "axis", horizon, **plan)
            if trial.why == settings.STOPPED:  # an adaptive method's error need not fall with every finer tolerance
                trial = settings.search(scene, cell.method, goal.target, "axis", horizon, FINER * goal.target, **plan)
            settled[cell] = leaders[pair] = trial
        elif leader.why:
            settled[cell] = leader
        elif leader.evaluations > patience:
            settled[cell] = settings.unmet(cell.method, horizon, settings.BUDGET)
        else:
            settled[cell] = settings.attempt(scene, cell.method, leader.setting, horizon, "axis")
    return settled


class Runs(NamedTuple):
    """The runs that a new process times on a scene, (variant, call, setting, horizon) of each, in `rounds` rounds."""

    scene: Scene
    runs: list[tuple[str, str, float, float]]
    rounds: int
    batch: float  # seconds


def least_times(plan: Runs) -> list[float]:
    """In this process: the least time of each run, in seconds."""
    known = {cell.name: cell for cell in cells()}
    functions: Any = [caller(plan.scene, known[name], *run) for name, *run in plan.runs]
    for name, call, setting, horizon in plan.runs:
        brief: Any = caller(plan.scene, known[name], call, min(setting, WARM * horizon), WARM * horizon)
        first_call(brief)
    times = timings(functions, plan.rounds, plan.batch, warm=True, patience=ENOUGH, least=1)
    return [timing.best for timing in times]


def timed(plan: Runs, processes: int) -> Array:
    """The least time of every run in each of some fresh processes, (runs, processes)."""
    return np.array([fresh_process.call(least_times, plan) for _ in range(processes)]).T


def settled_times(plan: Runs, processes: int) -> tuple[Array, Array]:
    """As `timed`, and how often each time was measured.

    Noisy times are measured again by as many processes; of all, the least are kept, as many as before.
    """
    times, tries = timed(plan, processes), np.ones(len(plan.runs))
    for _ in range(TRIES - 1):
        loud = np.flatnonzero(quartile_spread(times) > NOISY)
        if not loud.size:
            break
        repeat = timed(plan._replace(runs=[plan.runs[i] for i in loud]), processes)
        times[loud] = np.sort(np.hstack([times[loud], repeat]))[:, :processes]
        tries[loud] += 1
    return times, tries


def factorial(
    scene: Scene, schemes: Sequence[str] | None, goals: Sequence[Goal], rounds: int, batch: float, processes: int
) -> Any:
    """The factorial of one scene: settings, errors and times of all cells for all goals."""
    grid = cells(schemes)
    horizons, targets = sorted({goal.nutations for goal in goals}), sorted({goal.target for goal in goals})[::-1]
    shape = len(grid), len(horizons), len(targets)
    names = "setting", "axis", "axis_bound", "force_evaluations"
    numbers = {name: np.full(shape, math.nan) for name in names}
    reasons = np.full(shape, "", dtype=object)
    samples = np.full((*shape, len(CALLS), processes), math.nan)
    spread, tries = (np.full((*shape, len(CALLS)), math.nan) for _ in range(2))
    places, runs = [], []
    for goal in goals:
        part = [cell for cell in grid if cell.language in goal.languages]
        settled = settle(scene, part, goal)
        index = horizons.index(goal.nutations), targets.index(goal.target)
        for cell, trial in settled.items():
            if trial.why:
                reasons[(grid.index(cell), *index)] = trial.why
                continue
            for name, value in zip(names, (trial.setting, trial.error, trial.bound, trial.evaluations), strict=True):
                numbers[name][(grid.index(cell), *index)] = value
            for call in goal.calls:
                if caller(scene, cell, call, trial.setting, trial.horizon) is not None:
                    places.append((grid.index(cell), *index, CALLS.index(call)))
                    runs.append((cell.name, call, trial.setting, trial.horizon))
    times, counts = settled_times(Runs(scene, runs, rounds, batch), processes)
    for place, sample, width, count in zip(places, times, quartile_spread(times), counts, strict=True):
        samples[place], spread[place], tries[place] = sample, width, count
    dims = ("variant", "horizon", "target")
    table = xr.Dataset(
        {name: (dims, values) for name, values in numbers.items()}
        | {"reason": (dims, reasons.astype(str)), "seconds_samples": ((*dims, "call", "process"), samples)},
        coords={
            "variant": [cell.name for cell in grid], "horizon": horizons, "target": targets, "call": list(CALLS),
        },
    )  # fmt: skip
    dims = (*dims, "call")
    return table.assign(
        {"seconds": (dims, np.median(samples, -1)), "spread": (dims, spread), "seconds_tries": (dims, tries)}
    )
