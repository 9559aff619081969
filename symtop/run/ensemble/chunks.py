"""A chunk of an ensemble: plans, runs and observables of some members, computed together.

A member has the same bits as in `simulate`: the same steps, samples and observables. All steps are made in one compiled
call (`FixedStep.many`, or the closed form's) where the method has one, or in one per member (`Adaptive.many`); any
other method, such as a plug-in, runs its members one after another by `calling.solve`.
"""

import contextlib
import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from xarray.backends import BackendArray
from xarray.core import indexing

from symtop.core.errors import SymtopError, foreign_code
from symtop.core.jit import to_fixed_tuple
from symtop.core.parallel import check_interrupt, cores, in_threads
from symtop.methods.framework.adaptive import Adaptive
from symtop.methods.framework.calling import solve
from symtop.methods.framework.lanes import Ints, W, column, divided, members_of, of_bodies, put, turns
from symtop.methods.framework.loop import FixedStep
from symtop.methods.framework.plan import LEFT_CHART, NOT_FINITE, NOT_NORMALISED, OK, OUTCOMES, Plan, ending, off_length
from symtop.methods.framework.preparation import unpack_top
from symtop.methods.framework.registry import Integrator, integrator as find_integrator
from symtop.methods.library import exact
from symtop.methods.simd import wide_vectors
from symtop.model import charts
from symtop.model.charts import BODY, DIMENSIONS, Array, View
from symtop.model.exact.closed_form import ClosedForms
from symtop.model.lazy_kernel import LazyKernel
from symtop.model.scenes import exact_periods, nutation_period
from symtop.model.top import BISECTIONS, NUMBERS, SymmetricTop, bisected, is_loose, nutation_cubic, period_between
from symtop.run.simulation import WIDEST_GAP, places, unseen
from symtop.run.trajectory import LABELS

CHUNK = 65_536  # values of one column in a chunk: half a megabyte, which stays in a core's cache
CHUNK_STEPS = 5_000_000  # most steps in a chunk: 0.01 s in lanes, to 1 s
LEAST_CHUNKS, LEAST_STEPS = 16, 200_000  # of an ensemble, unless they had fewer steps (1 ms) than the second
SLOWER = 25  # how much fewer steps a chunk has of a method that is called from Python: 200 runs of rk45 take 12 s
HARMLESS_SIZE = 1e100  # states and momenta below it have a finite energy: no inertia is below 1e-40
UNKNOWN_STEPS = 1000  # the steps assumed of a member of an adaptive method or of a closed form
READ_TOGETHER = 4096  # members whose angles a thread makes continuous at a time
RAISED = "raised"  # outcome of a member on which a solver raised an exception
_WIDTH = len(NUMBERS)
_NONE = (0.0,) * _WIDTH
ENDS = (*OUTCOMES, RAISED)
IN_LANES = "lanes"
IN_TURN = "compiled, one after another"
IN_PYTHON = "one call of Python for each"

SHOWN = {  # the variables of each chart
    "angles": ("theta", "phi", "psi", "axis", "energy", "p_theta", "p_phi", "p_psi"),
    "axis": ("theta", "phi", "axis", "energy", "p_theta", "p_phi", "p_psi"),
    "attitude": ("theta", "phi", "psi", "axis", "quaternion", "energy", "p_theta", "p_phi", "p_psi"),
    BODY: ("theta", "axis", "quaternion", "energy", "p_phi", "momentum"),
}


class Schedule(NamedTuple):
    """Sample times of n runs. A run of fewer steps than samples is sampled at every step; its row is padded."""

    step_size: Array  # (n,), NaN for adaptive methods
    marks: Ints  # (n, samples) whole steps; the last one repeated beyond `counts`; zeros for adaptive methods
    times: Array  # (n, samples), NaN beyond `counts`
    counts: Ints  # (n,) samples of each
    dithered: NDArray[np.bool_]  # (n,)


def schedule(period: Array, horizon: Array, samples: int, steps: Ints | None) -> Schedule:
    """The samples of `simulation.sample_times` for n runs of `steps` (n,) steps (None: adaptive), to the same bits."""
    n = len(horizon)
    h = np.full(n, np.nan) if steps is None else horizon / steps
    marks, times = np.zeros((n, samples), np.int64), np.empty((n, samples))
    plan = Schedule(h, marks, times, np.full(n, samples), np.zeros(n, dtype=bool))

    def lay_out(rows: Ints, *, dithered: bool) -> None:
        positions = places(samples, dithered=dithered)
        plan.dithered[rows] = dithered
        if steps is None:
            times[rows] = horizon[rows, None] * positions
            return
        row_marks = np.rint(steps[rows, None] * positions).astype(np.int64)
        new = np.diff(row_marks, axis=1, prepend=-1) > 0
        plan.counts[rows] = new.sum(axis=1)
        short = plan.counts[rows] < samples  # remove repeated marks, and fill the row with the last
        row_marks[short] = np.sort(np.where(new[short], row_marks[short], row_marks[short, -1:]), axis=1)
        marks[rows], times[rows] = row_marks, row_marks * h[rows, None]

    lay_out(np.arange(n), dithered=False)
    long_enough = np.isfinite(period) & (horizon > 2.0 * period)
    rows = np.flatnonzero(long_enough if steps is None else long_enough & (steps >= samples))  # others have every step
    lay_out(rows[unseen(times[rows], period[rows, None]) >= WIDEST_GAP], dithered=True)
    times[np.arange(samples) >= plan.counts[:, None]] = np.nan
    return plan


def nutation_periods(numbers: Array) -> Array:
    """`Scene.nutation_period` of tops and starts (n, 9), to the bit, or of bodies (n, 14); infinite on a separatrix."""
    if of_bodies(numbers):
        return np.array([body.nutation_period(start) for body, start in members_of(numbers)])
    if not _periods.ready(PERIOD_SECONDS * len(numbers)):
        return np.array([nutation_period(*top) for top in members_of(numbers)])
    periods = np.empty(len(numbers))
    _periods.compiled(np.ascontiguousarray(numbers), periods)
    if (loose := np.signbit(periods)).any():
        periods[loose] = exact_periods(numbers[loose], -periods[loose])
    return periods


def all_periods(numbers: Array, periods: Array) -> None:
    """`nutation_periods` of tops as a kernel with bisections in lanes: a third of the time; negative if `is_loose`."""
    wide_vectors()
    n, lanes = len(numbers), np.empty(len(_NONE) * W)
    for first in range(0, n, W):
        for j in range(W):
            top, start = unpack_top(to_fixed_tuple(numbers[min(first + j, n - 1)], _WIDTH))
            cosine = math.cos(start.theta)
            put(lanes, 0, j, (*nutation_cubic(top, start), cosine, -1.0, cosine, 1.0, cosine))
        for _ in range(BISECTIONS):
            for j in range(W):
                lane = column(lanes, 0, j, _NONE)
                put(lanes, 5, j, bisected(lane[:4], lane[4], *lane[5:]))
        for j in range(min(W, n - first)):
            top, start = unpack_top(to_fixed_tuple(numbers[first + j], _WIDTH))
            low, below, high, above = column(lanes, 5, j, _NONE[:4])
            low, high = 0.5 * (low + below), 0.5 * (high + above)
            period = period_between(top, start, low, high)
            periods[first + j] = -period if is_loose(top, start, low, high) else period


PERIOD_SECONDS = 5e-5  # seconds of one top, interpreted
# less patience than compiling takes, so that thousands of tops are fast from their second call on
_periods = LazyKernel(all_periods, "(float64[:, ::1], float64[::1])", patience=0.1)


class _Runs(NamedTuple):
    """The runs of a chunk."""

    states: Array  # (n, samples, dimension)
    momenta: Array  # (n, samples, 2)
    steps: Any  # (n,), as the following arrays
    force_evaluations: Any
    newton_iterations: Any
    outcome: Any
    reached: Array
    raised: str = ""  # the message of the first exception of a solver


@dataclass(frozen=True)
class Job:
    """The checked arguments of an ensemble; arrays are over members."""

    method: Integrator
    chart: str
    numbers: Array
    horizon: Array
    steps: Any  # (n,) whole steps, or None
    tolerance: Array | None
    samples: int
    budget: float | None
    observables: tuple[str, ...]  # of `SHOWN`
    period: Array | None = None  # of nutation, if it has been computed
    names: Any = None  # labels of the members (n,), or None
    continuous: bool = True  # make angles continuous; else they are left modulo 2 pi where that needs `Turns`
    compiling: bool = False  # kernels in lanes even for a chunk of few steps
    first: int = 0  # number of the first member

    def __getstate__(self) -> dict[str, Any]:
        """Pickle a registered integrator by its name, because worker processes have it; any other as an object."""
        with contextlib.suppress(SymtopError):
            if find_integrator(self.method.name) == self.method:
                return vars(self) | {"method": self.method.name}
        return vars(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, method=find_integrator(state["method"]))

    @property
    def execution(self) -> str:
        """How the members are run, in words."""
        solver = self.method.solvers[self.chart]
        if isinstance(solver, FixedStep) and not solver.in_python:
            return IN_LANES if solver.in_lanes else IN_TURN
        return IN_TURN if solver is exact.solve or isinstance(solver, Adaptive) else IN_PYTHON

    def chunks(self) -> Iterator[slice]:
        """Slices of the members with at most `CHUNK` values per column and about `CHUNK_STEPS` steps, fewer in Python.

        They do not depend on the number of workers; one of more than 4 W members has whole blocks of W lanes.
        """
        n, begin, size = len(self.numbers), 0, max(1, CHUNK // self.samples)
        ends = np.cumsum(np.full(n, UNKNOWN_STEPS) if self.steps is None else self.steps)
        limit = min(CHUNK_STEPS, max(LEAST_STEPS, ends[-1] // LEAST_CHUNKS))
        limit //= SLOWER if self.execution == IN_PYTHON else 1
        while begin < n:
            previous = ends[begin - 1] if begin else 0
            length = min(int(np.searchsorted(ends, previous + limit, "right")) - begin, size)
            length = length // W * W if length > 4 * W else max(length, 1)
            end = min(begin + length, n)
            yield slice(begin, end)
            begin = end

    def of(self, members: Any) -> "Job":
        """The job of some members; for a slice the numbers of members in messages stay right."""
        arrays = ("numbers", "horizon", "steps", "tolerance", "period", "names")
        cut = {name: values[members] for name in arrays if (values := getattr(self, name)) is not None}
        return replace(self, **cut, first=self.first + (members.start if isinstance(members, slice) else 0))

    def order(self) -> Any:
        """The order of members, longest first, in which neighbouring lanes end together; None if any order will do."""
        solver = self.method.solvers[self.chart]
        if self.execution != IN_LANES or not (solver.implicit or np.ptp(self.steps)):  # type: ignore[attr-defined]
            return None
        step_turns = turns(self.numbers, self.horizon / self.steps)
        return np.concatenate(divided(np.arange(len(step_turns)), self.steps, step_turns))[::-1]

    def columns(self) -> dict[str, Any]:
        """Make the runs: columns of observables, settings and outcomes, and the message of the first exception."""
        period = nutation_periods(self.numbers) if self.period is None else self.period
        plan = schedule(period, self.horizon, self.samples, self.steps)
        with np.errstate(all="ignore"):  # a run may blow up, and that is a result
            runs = _end_off_length(self._runs(plan), plan, self.chart)
            view = View(self.chart, together(self.numbers), runs.states, runs.momenta[..., 0], runs.momenta[..., 1])
            runs, columns = _end_at_non_finite(runs, view, plan), self._observables(view, plan.times)
        columns |= {
            "time": plan.times, "outcome": np.array(ENDS)[runs.outcome], "steps": runs.steps,
            "force_evaluations": runs.force_evaluations, "newton_iterations": runs.newton_iterations,
            "reached_time": runs.reached, "step_size": plan.step_size, "horizon": self.horizon,
            "dithered": plan.dithered, **({RAISED: runs.raised} if runs.raised else {}),
        }  # fmt: skip
        return columns

    def _runs(self, plan: Schedule) -> _Runs:
        """The runs of the members, by the fastest way that the method has."""
        solver = self.method.solvers[self.chart]
        if isinstance(solver, FixedStep) and not solver.in_python:  # it takes marks that repeat at the end of a row
            with foreign_code(f"integrator {self.method.name}"):  # its kernel may not compile
                batch = solver.many(self.numbers, plan.step_size, plan.marks, compiling=self.compiling)
            padding = np.isnan(plan.times)
            batch.states[padding], batch.momenta[padding] = np.nan, np.nan
            reached, raised = batch.steps * plan.step_size, ""
            if (unknown := (batch.outcome < 0) | (batch.outcome >= len(OUTCOMES))).any():
                try:
                    ending(batch.outcome[unknown][0])
                except SymtopError as error:
                    raised = f"integrator {self.method.name}: {error}"
                batch.outcome[unknown] = ENDS.index(RAISED)
            counts = batch.steps, *solver.counts(*batch[2:4])
            return _Runs(batch.states, batch.momenta, *counts, batch.outcome, reached, raised)
        if isinstance(solver, Adaptive) and self.tolerance is not None:
            batch, reached = solver.many(self.numbers, self.tolerance, plan.times, plan.counts, self.budget)
            return _Runs(batch.states, batch.momenta, batch.steps, batch.work, 0 * batch.work, batch.outcome, reached)
        if solver is exact.solve:
            states, momenta = ClosedForms(self.numbers).run(np.nan_to_num(plan.times))
            zeros = np.zeros(len(self.numbers), dtype=np.int64)
            return _Runs(states, momenta, zeros, plan.counts, zeros, zeros, self.horizon)
        return self._one_by_one(plan)

    def _one_by_one(self, plan: Schedule) -> _Runs:
        """The runs of the members by one call of the solver each; an exception ends only that member."""
        n = len(plan.counts)
        states = np.full((n, self.samples, DIMENSIONS[self.chart]), np.nan)
        momenta, (steps, work, iterations, outcome) = np.full((n, self.samples, 2), np.nan), np.zeros((4, n), int)
        runs = _Runs(states, momenta, steps, work, iterations, outcome, np.zeros(n))
        for i, (top, start) in enumerate(members_of(self.numbers)):
            check_interrupt()
            if self.chart == "angles" and not 0.0 < start.theta < np.pi:
                runs.outcome[i] = LEFT_CHART
                continue
            member_plan = self._plan(i, plan)
            try:
                name = self.first + i if self.names is None else self.names[i]
                run = solve(self.method, self.chart, top, start, member_plan, f" on member {name}")
            except SymtopError as error:
                arithmetic = isinstance(error.__cause__, (ArithmeticError, np.linalg.LinAlgError))
                runs.outcome[i] = NOT_FINITE if arithmetic else ENDS.index(RAISED)
                if not (arithmetic or runs.raised):
                    runs = runs._replace(raised=str(error))
                continue
            runs.states[i, : member_plan.times.size] = run.states
            runs.momenta[i, : member_plan.times.size] = np.stack([run.p_phi, run.p_psi], axis=-1)
            runs.steps[i], runs.force_evaluations[i], runs.newton_iterations[i] = run[3:6]
            runs.outcome[i], runs.reached[i] = OUTCOMES.index(run.outcome), run.reached
        return runs

    def _plan(self, i: int, plan: Schedule) -> Plan:
        """The plan of member i, as `simulate` would make it."""
        count, horizon = plan.counts[i], float(self.horizon[i])
        if self.steps is not None:
            return Plan.steps(float(plan.step_size[i]), plan.marks[i, :count], horizon, self.budget)
        tolerance = np.nan if self.tolerance is None else float(self.tolerance[i])
        return Plan.until(plan.times[i, :count], tolerance, self.budget)

    def _observables(self, view: View, times: Array) -> dict[str, Any]:
        """The columns of `observables` of all members, as a `Trajectory` has them for one run."""
        columns = {name: getattr(view, name) for name in self.observables}
        angles = self.turned if self.continuous else ()
        return columns | Turns(self.numbers, times, {name: columns[name] for name in angles}).of(slice(None))

    @property
    def turned(self) -> tuple[str, ...]:
        """The observables among phi and psi that the chart determines modulo 2 pi only."""
        return tuple(name for name in ("phi", "psi") if name in self.observables and self.chart in ("axis", "attitude"))


@dataclass(frozen=True, eq=False)
class Turns:
    """phi and psi of members, (n, samples), modulo 2 pi, which are made continuous by closed forms on request."""

    numbers: Array
    times: Array
    angles: dict[str, Array]

    def of(self, members: Any) -> dict[str, Array]:
        """Continuous angles of some members."""
        if not self.angles:
            return {}
        guides = ClosedForms(self.numbers[members]).turns(np.nan_to_num(self.times[members]))
        guide = dict(zip(("phi", "psi"), guides, strict=True))
        return {name: charts.unwrapped(values[members], guide[name]) for name, values in self.angles.items()}

    @functools.cached_property
    def all(self) -> dict[str, Array]:
        """Continuous angles of all members, computed on all cores and cached."""
        firsts = range(0, len(self.numbers), READ_TOGETHER)
        blocks = list(in_threads(self.of, [slice(first, first + READ_TOGETHER) for first in firsts], cores()))
        return {name: np.concatenate([block[name] for block in blocks]) for name in self.angles}


class LazyAngle(BackendArray):
    """One of the angles of `Turns` as a lazy array: the constants of a closed form take 4 us a member."""

    def __init__(self, turns: Turns, name: str) -> None:
        self.turns, self.name = turns, name
        self.shape, self.dtype = turns.angles[name].shape, np.dtype(float)

    def __getitem__(self, key: Any) -> Any:
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.OUTER, self._read)

    def _read(self, key: tuple[Any, ...]) -> Any:
        members = np.arange(len(self.turns.numbers))[key[0]]
        partial = 2 * members.size < len(self.turns.numbers)
        values = self.turns.of(np.atleast_1d(members))[self.name] if partial else self.turns.all[self.name][members]
        return values.reshape(*members.shape, -1)[..., key[1]]

    def variable(self) -> xr.Variable:
        """An xarray variable that computes its values when first read and keeps them."""
        layers: Any = indexing  # its type annotations allow NumPy arrays only
        data = layers.MemoryCachedArray(layers.CopyOnWriteArray(layers.LazilyIndexedArray(self)))
        return xr.Variable(("member", "time"), data)


def together(numbers: Array) -> Any:
    """An object with the attributes of one top, or body, that holds those of all, for a `View` of all."""
    if of_bodies(numbers):
        torque = (numbers[:, 3:4] * numbers[:, 4:7]).T[..., None]
        return SimpleNamespace(moments=numbers[:, None, :3], torque=torque)
    top: Any = SimpleNamespace(**{name: numbers[:, k : k + 1] for k, name in enumerate(NUMBERS[:3])})
    top.reduced_energy = functools.partial(SymmetricTop.reduced_energy, top)
    return top


def _end_at_non_finite(runs: _Runs, view: View, plan: Schedule) -> _Runs:
    """End runs with outcome "ok" before the first sample with a state or energy that is not finite, as `simulate`."""
    if all(values.min() > -HARMLESS_SIZE and values.max() < HARMLESS_SIZE for values in runs[:2]):  # takes a tenth
        return runs
    finite = np.isfinite(runs.states).all(axis=2) & np.isfinite(view.energy + view.p_phi) | np.isnan(plan.times)
    return _end_runs(runs, plan, ~finite & (runs.outcome == OK)[:, None], NOT_FINITE)


def _end_off_length(runs: _Runs, plan: Schedule, chart: str) -> _Runs:
    """End runs where |q| is too far from one, as in `simulate`."""
    invalid = off_length(chart, runs.states)
    if not invalid.any():
        return runs
    states, momenta = (np.where(invalid[..., None], np.nan, values) for values in (runs.states, runs.momenta))
    return _end_runs(runs._replace(states=states, momenta=momenta), plan, invalid, NOT_NORMALISED)


def _end_runs(runs: _Runs, plan: Schedule, invalid: NDArray[np.bool_], outcome: int) -> _Runs:
    """End runs with `outcome` before their first sample that is `invalid`, (n, samples)."""
    ends = invalid.any(axis=1)
    reached = plan.times[np.arange(len(invalid)), np.maximum(invalid.argmax(axis=1) - 1, 0)]
    return runs._replace(outcome=np.where(ends, outcome, runs.outcome), reached=np.where(ends, reached, runs.reached))


def same_times(times: Any, row: Any) -> bool:
    """Are the times (n, samples) of all members equal to `row`? NaN, the padding of short runs, equals NaN."""
    equal = bool((times == row).all())  # most often, and without the copies of `array_equal` that tell NaN
    return equal or np.array_equal(times, np.broadcast_to(row, times.shape), equal_nan=True)


def as_dataset(
    columns: dict[str, Any], labels: dict[str, Any], *, shared: bool | None = None, of: Job | None = None
) -> xr.Dataset:
    """Columns (n, ...) and labels (n,) as a dataset; if all members have the same times, these are one row.

    `shared` says whether they do, if the columns are not those of all members. Angles of the job `of` are modulo 2 pi
    and are made continuous when they are read.
    """
    columns, vectors = columns | labels, {"axis": "component", "momentum": "component", "quaternion": "part"}
    times = columns.pop("time")
    shared = same_times(times, times[0]) if shared is None else shared
    variables: dict[str, Any] = {
        name: (("member", "time", vectors.get(name, ""))[: values.ndim], values) for name, values in columns.items()
    }
    if of is not None:
        turns = Turns(of.numbers, times, {name: columns[name] for name in of.turned})
        variables |= {name: LazyAngle(turns, name).variable() for name in of.turned}
    coordinates = {dim: list(LABELS[dim]) for dim in LABELS if any(vectors.get(name) == dim for name in columns)}
    clock = ("time", times[0]) if shared else (("member", "time"), times)
    return xr.Dataset(variables, {"time": clock, **coordinates})
