"""Settings of equal accuracy, their times, and the comparisons that change one factor.

Dimensions: variant (such as ``rk45-numba[axis]``, see `cells`), horizon (nutation periods), target (of the axis
error, rad), call, process. A time is the median over processes that are started for it, one after another, of the least
sample of each: where memory and code lie differs from process to process and stays the same within one.
"""

import functools
import json
import math
import pickle
import subprocess
import sys
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from symtop.measure import settings
from symtop.measure.timing import first_call, timings
from symtop.methods.framework.registry import SMALLEST_FIRST
from symtop.model.charts import Array
from symtop.model.scenes import Scene

from .cells import (
    CALLS,
    COMPILED,
    DORMAND_PRINCE,
    KERNEL,
    NUMPY,
    SCIPY_NUMBA,
    SCIPY_PYTHON,
    SIMULATE,
    SOLVE_IVP,
    Cell,
    caller,
    cells,
)  # fmt: skip

LEAST = 0.7  # of the target: the search ends with an error from here to the target, if nine runs suffice
PATIENCE = {COMPILED: 2e6, SCIPY_NUMBA: 4e4, SCIPY_PYTHON: 4e4, NUMPY: 4e4}  # force evaluations of one run
FINER = 1e-3  # of the target: the tolerance that a second search begins with
ENOUGH = 0.2  # seconds of a function's samples in one process; those that are longer have two
NOISY, NOISY_SHARE = 0.25, 0.02  # spread of a noisy time, and the share of such times beyond which none is worth having
START = "from symtop.runner import scripts; scripts.install(); from symtop_studies.factors import tables; tables.{}()"
TIE = 0.1  # times that differ by less are level
FACTORS = ("method", "chart", "language", "call")


class Column:
    """Variables of the dataset."""

    SETTING, AXIS, AXIS_BOUND, FORCES = "setting", "axis", "axis_bound", "force_evaluations"  # of one run
    REASON = "reason"  # why a variant has no setting; empty if it has
    SECONDS, SPREAD, SAMPLES = "seconds", "spread", "seconds_samples"  # median, distance of quartiles over it, all


class Goal(NamedTuple):
    """An accuracy over a horizon, and what takes part."""

    nutations: float
    target: float
    languages: tuple[str, ...]
    calls: tuple[str, ...]


# ---- measuring -------------------------------------------------------------------------------------------------------


def settle(scene: Scene, grid: Sequence[Cell], goal: Goal) -> dict[Cell, settings.Met | str]:
    """A setting of every cell that meets the goal, or the reason why there is none.

    One search for each scheme and chart, in its first language; the others take the same setting, and their error is
    measured again.
    """
    horizon = goal.nutations * scene.nutation_period
    leaders: dict[tuple[str, str], settings.Met | str] = {}
    settled: dict[Cell, settings.Met | str] = {}
    for cell in grid:
        pair, patience = (cell.scheme, cell.chart), PATIENCE[cell.language]
        leader = leaders.get(pair)
        if leader is None:
            plan = {"patience": patience, "least": LEAST}
            met = settings.search(scene, cell.method, goal.target, "axis", horizon, **plan)
            if met == settings.STOPPED:  # the error of an adaptive method need not fall with every finer tolerance
                met = settings.search(scene, cell.method, goal.target, "axis", horizon, FINER * goal.target, **plan)
            settled[cell] = leaders[pair] = met
        elif isinstance(leader, str):
            settled[cell] = leader
        elif leader.evaluations > patience:
            settled[cell] = settings.BUDGET
        else:
            settled[cell] = settings.attempt(scene, cell.method, leader.setting, horizon, "axis")
    return settled


class Runs(NamedTuple):
    """What a fresh process times on a scene: (variant, call, setting, horizon) of each run, in so many rounds."""

    scene: Scene
    runs: list[tuple[str, str, float, float]]
    rounds: int
    batch: float  # seconds


def answer() -> None:
    """What a fresh process does: `Runs` pickled on standard input, the least time of each as JSON on the other."""
    asked: Runs = pickle.load(sys.stdin.buffer)  # noqa: S301  (of the process that started this one)
    known = {cell.name: cell for cell in cells()}
    functions: Any = [caller(asked.scene, known[name], *run) for name, *run in asked.runs]
    for function in functions:
        first_call(function)
    taken = timings(functions, asked.rounds, asked.batch, warm=True, patience=ENOUGH)
    print(json.dumps([timing.best for timing in taken]))  # noqa: T201


def timed(asked: Runs, processes: int) -> Array:
    """The least time of every run in each of some fresh processes, (runs, processes)."""
    command = [sys.executable, "-c", START.format(answer.__name__)]  # named, so that a case depends on its code
    answers = []
    for _ in range(processes):
        done = subprocess.run(command, input=pickle.dumps(asked), stdout=subprocess.PIPE, check=True)  # noqa: S603
        answers.append(json.loads(done.stdout.splitlines()[-1]))
    return np.array(answers).T


def factorial(
    scene: Scene, schemes: Sequence[str] | None, goals: Sequence[Goal], rounds: int, batch: float, processes: int
) -> Any:
    """The factorial of one scene: settings, errors and times of all cells for all goals."""
    grid = cells(schemes)
    horizons, targets = sorted({goal.nutations for goal in goals}), sorted({goal.target for goal in goals})[::-1]
    shape = len(grid), len(horizons), len(targets)
    names = Column.SETTING, Column.AXIS, Column.AXIS_BOUND, Column.FORCES
    numbers = {name: np.full(shape, math.nan) for name in names}
    reasons = np.full(shape, "", dtype=object)
    samples = np.full((*shape, len(CALLS), processes), math.nan)
    places, runs = [], []
    for goal in goals:
        part = [cell for cell in grid if cell.language in goal.languages]
        settled = settle(scene, part, goal)
        at = horizons.index(goal.nutations), targets.index(goal.target)
        for cell, met in settled.items():
            if isinstance(met, str):
                reasons[(grid.index(cell), *at)] = met
                continue
            for name, value in zip(names, (met.setting, met.error, met.bound, met.evaluations), strict=True):
                numbers[name][(grid.index(cell), *at)] = value
            for call in goal.calls:
                if caller(scene, cell, call, met.setting, met.horizon) is not None:
                    places.append((grid.index(cell), *at, CALLS.index(call)))
                    runs.append((cell.name, call, met.setting, met.horizon))
    for place, taken in zip(places, timed(Runs(scene, runs, rounds, batch), processes), strict=True):
        samples[place] = taken
    dims = ("variant", "horizon", "target")
    table = xr.Dataset(
        {name: (dims, values) for name, values in numbers.items()}
        | {Column.REASON: (dims, reasons.astype(str)), Column.SAMPLES: ((*dims, "call", "process"), samples)},
        coords={
            "variant": [cell.name for cell in grid], "horizon": horizons, "target": targets, "call": list(CALLS),
        },
    )  # fmt: skip
    low, middle, high = table[Column.SAMPLES].quantile((0.25, 0.5, 0.75), "process", skipna=False).values
    dims = (*dims, "call")
    return table.assign({Column.SECONDS: (dims, middle), Column.SPREAD: (dims, (high - low) / middle)})


# ---- reading ---------------------------------------------------------------------------------------------------------


class Timed(NamedTuple):
    """One measured time and the levels of its four factors."""

    method: str
    chart: str
    language: str
    call: str
    name: str
    seconds: float
    spread: float
    error: float
    forces: float

    @property
    def levels(self) -> tuple[str, str, str, str]:
        """Method, chart, language and call."""
        return self[:4]


@functools.cache
def _by_name() -> dict[str, Cell]:
    return {cell.name: cell for cell in cells()}


def times(data: xr.Dataset) -> list[Timed]:
    """Every time of one scene, horizon and target (a dataset over integrator and call)."""
    names, known = [str(name) for name in data["variant"].values], _by_name()
    errors, forces = (data[name].values.tolist() for name in (Column.AXIS, Column.FORCES))
    taken = data[[Column.SECONDS, Column.SPREAD]].transpose("variant", "call")
    taken = taken.sel(call=list(CALLS))  # once: to select a number of a Dataset takes a millisecond
    seconds, spreads = (taken[name].values.tolist() for name in (Column.SECONDS, Column.SPREAD))
    return [
        Timed(*known[name].key, call, name, seconds[i][k], spreads[i][k], errors[i], forces[i])
        for i, name in enumerate(names)
        for k, call in enumerate(CALLS)
        if np.isfinite(seconds[i][k])
    ]


def goals_of(data: xr.Dataset) -> Iterator[tuple[str, float, float, xr.Dataset]]:
    """Scene, horizon, target and data of every goal that was timed."""
    for scene in map(str, data["scene"].values):
        for horizon in map(float, data["horizon"].values):
            for target in map(float, data["target"].values):
                part = data.sel(scene=scene, horizon=horizon, target=target)
                if np.isfinite(part[Column.SECONDS]).any():
                    yield scene, horizon, target, part


def fastest(rows: Sequence[Timed], call: str = KERNEL, language: str | None = None) -> Timed:
    """The least time of a call, in any language or in one; of those that are level with it, one in the smallest chart.

    So that a tie does not decide which charts the waterfall shows: the axis is all that the targets ask for.
    """
    taken = [one for one in rows if one.call == call and language in (None, one.language)]
    least = min(one.seconds for one in taken)
    level = [one for one in taken if one.seconds <= (1.0 + TIE) * least]
    return min(level, key=lambda one: (SMALLEST_FIRST["axis"].index(one.chart), one.seconds))


USUAL = (DORMAND_PRINCE, "angles", SCIPY_PYTHON, SOLVE_IVP)


def noisy(data: xr.Dataset) -> tuple[int, int]:
    """How many times differ too much from process to process, and how many there are."""
    spread = data[Column.SPREAD].values
    return int(np.sum(spread > NOISY)), int(np.isfinite(spread).sum())


def busy(data: xr.Dataset) -> bool:
    """Was the machine too busy for times to be compared?"""
    loud, every = noisy(data)
    return loud > NOISY_SHARE * every


class Bar(NamedTuple):
    """A step of the waterfall: what was changed, and how many times faster it made the run."""

    factor: str  # empty for the first bar
    change: str
    ratio: float
    time: Timed


def waterfall(rows: Sequence[Timed], *, call_first: bool = False) -> list[Bar]:
    """From SciPy's RK45 in angles, called by `solve_ivp`, to the fastest kernel; each bar changes one factor.

    The call is changed to `simulate` first and to the bare kernel last, or to the bare kernel at once. Empty if the way
    was not timed.
    """
    known = {one.levels: one for one in rows}
    if USUAL not in known:
        return []
    end = fastest(rows)
    path = [
        ("call", KERNEL if call_first else SIMULATE),
        ("chart", end.chart),
        ("language", SCIPY_NUMBA),
        ("language", COMPILED),
        ("method", end.method),
        ("call", KERNEL),
    ]
    bars, levels = [Bar("", "", math.nan, known[USUAL])], list(USUAL)
    for factor, level in path:
        place = FACTORS.index(factor)
        before, levels[place] = levels[place], level
        if before == level:
            continue
        if tuple(levels) not in known:
            return []
        now = known[tuple(levels)]
        bars.append(Bar(factor, f"{before} to {level}", bars[-1].time.seconds / now.seconds, now))
    return bars


class Change(NamedTuple):
    """All pairs of measured times that differ in one factor, from one level of it to another."""

    factor: str
    before: str
    after: str
    ratios: tuple[float, ...]  # seconds before / seconds after


def changes(rows: Sequence[Timed]) -> list[Change]:
    """What changing one factor does, wherever the other three can be held: every pair that the factorial has."""
    pairs: dict[tuple[str, str, str], list[float]] = {}
    known = {one.levels: one for one in rows}
    for levels, one in known.items():
        for factor, before, after in STEPS:
            place = FACTORS.index(factor)
            other = known.get((*levels[:place], after, *levels[place + 1 :])) if levels[place] == before else None
            if other is not None:
                pairs.setdefault((factor, before, after), []).append(one.seconds / other.seconds)
    return [Change(*step, tuple(pairs[step])) for step in STEPS if step in pairs]


STEPS = (
    ("chart", "angles", "axis"),
    ("chart", "axis", "attitude"),
    ("language", SCIPY_PYTHON, SCIPY_NUMBA),
    ("language", SCIPY_NUMBA, COMPILED),
    ("language", NUMPY, COMPILED),
    ("call", SOLVE_IVP, SIMULATE),
    ("call", SIMULATE, KERNEL),
    ("method", DORMAND_PRINCE, "DOP853"),
    ("method", DORMAND_PRINCE, "rk4"),
    ("method", DORMAND_PRINCE, "Takahashi-Imada"),
    ("method", DORMAND_PRINCE, "Taylor"),
)


def chart_ratio(rows: Sequence[Timed], scheme: str, chart: str) -> float:
    """Kernel time of a compiled scheme in a chart over that on the axis; NaN if one of them was not timed."""
    kernels = [one for one in rows if (one.method, one.language, one.call) == (scheme, COMPILED, KERNEL)]
    seconds = {one.chart: one.seconds for one in kernels}
    return seconds.get(chart, math.nan) / seconds.get("axis", math.nan)


def least_share(data: xr.Dataset) -> float:
    """The least error of a timed run as a share of its target."""
    return float((data[Column.AXIS] / data["target"]).where(np.isfinite(data[Column.SECONDS]).any("call")).min())
