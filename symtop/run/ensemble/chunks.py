"""A chunk of an ensemble: plans, runs and observables of some members, each step made for all of them at once.

A member has the bits of `simulate` alone: the same steps, samples and observables. Steps are made in one compiled call
(`FixedStep.many`, or the closed form's) where the method has one, or in one for each member (`Adaptive.many`); any
other method runs its members one after another by `calling.solve`, as anybody's solver is called.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from symtop.core.errors import SymtopError
from symtop.core.parallel import heed
from symtop.methods.framework.adaptive import Adaptive
from symtop.methods.framework.calling import solve
from symtop.methods.framework.fixed_step import FixedStep
from symtop.methods.framework.lanes import W
from symtop.methods.framework.many import Many, members_of
from symtop.methods.framework.plan import LEFT_CHART, NOT_FINITE, OK, OUTCOMES, Plan
from symtop.methods.framework.registry import Integrator, integrator as find_integrator
from symtop.methods.library import exact
from symtop.model import charts
from symtop.model.charts import View
from symtop.model.exact.closed_form import ClosedForms
from symtop.model.top import SymmetricTop
from symtop.run.sampling import Schedule, nutation_periods, schedule
from symtop.run.trajectory import LABELS

Array = NDArray[np.float64]

CHUNK = 65_536  # values of one column in a chunk: half a megabyte, which stays in a core's cache
CHUNK_STEPS = 5_000_000  # in a chunk: a hundredth of a second in lanes, to a second
SHARES, LEAST_STEPS = 16, 200_000  # threads share even a small ensemble, in chunks of a millisecond or more
UNKNOWN_STEPS = 1000  # what a member counts for that chooses its steps, or makes none
RAISED = "raised"  # outcome of a member on which a solver raised an exception
ENDS = (*OUTCOMES, RAISED)
IN_LANES = "lanes"
IN_TURN = "compiled, one after another"
IN_PYTHON = "one call of Python for each"

SHOWN = {  # by each chart, in this order
    chart: ("theta", "phi", *psi, "axis", *quaternion, "energy", "p_theta", "p_phi", "p_psi")
    for chart, psi, quaternion in (
        ("angles", ("psi",), ()), ("axis", (), ()), ("attitude", ("psi",), ("quaternion",)),
    )
}  # fmt: skip
TOLD = (  # of each member, beside what it shows
    "outcome", "steps", "force_evaluations", "newton_iterations", "reached_time", "step_size", "horizon", "dithered",
)  # fmt: skip


class _Top(NamedTuple):
    """The tops of a chunk with the names of `SymmetricTop`, each (n, 1)."""

    I1: Array
    I3: Array
    mgl: Array

    def reduced_energy(self, *state: Array) -> Any:
        """`SymmetricTop.reduced_energy` of rows of states."""
        return SymmetricTop.reduced_energy(self, *state)  # type: ignore[arg-type]


class _Runs(NamedTuple):
    """The runs of a chunk."""

    states: Array  # (n, samples, dimension)
    momenta: Array  # (n, samples, 2)
    steps: Any  # (n,), as all that follow
    force_evaluations: Any
    newton_iterations: Any
    outcome: Any
    reached: Array
    raised: str = ""  # what the first solver said that raised an exception


@dataclass(frozen=True)
class Job:
    """What is asked of an integrator, checked; arrays over members."""

    method: Integrator
    chart: str
    numbers: Array
    horizon: Array
    steps: Any  # (n,) whole steps, or None
    tolerance: Array | None
    samples: int
    budget: float | None
    shown: tuple[str, ...]  # of `SHOWN`
    period: Array | None = None  # of nutation, where it is known
    names: Any = None  # what members are called (n,), where they have labels
    first: int = 0  # number of the first member

    def __reduce__(self) -> tuple[Any, ...]:
        """For workers elsewhere, which know integrators by their names; one that they do not know goes as it is."""
        words = {part.name: getattr(self, part.name) for part in fields(self)}
        try:
            known = find_integrator(self.method.name) == self.method
        except SymtopError:
            known = False
        return _sent, (words | {"method": self.method.name if known else self.method},)

    @property
    def execution(self) -> str:
        """How the members are run, in words."""
        solver = self.method.solvers[self.chart]
        if solver is exact.solve:
            return IN_TURN
        if isinstance(solver, Adaptive):
            return IN_TURN
        if not isinstance(solver, FixedStep) or solver.in_python:
            return IN_PYTHON
        return IN_LANES if solver.in_lanes else IN_TURN

    def chunks(self) -> Iterator[slice]:
        """Members in stretches that neither hold more than `CHUNK` values a column nor make too many steps.

        They do not depend on who computes them, and have whole blocks of lanes where they are longer than some.
        """
        n, begin, size = len(self.numbers), 0, max(1, CHUNK // self.samples)
        ends = np.cumsum(np.full(n, UNKNOWN_STEPS) if self.steps is None else self.steps)
        most = min(CHUNK_STEPS, max(LEAST_STEPS, ends[-1] // SHARES))
        while begin < n:
            done = ends[begin - 1] if begin else 0
            length = min(int(np.searchsorted(ends, done + most)) - begin, size)
            length = length // W * W if length > 4 * W else max(length, 1)
            end = min(begin + length, n)
            yield slice(begin, end)
            begin = end

    def part(self, members: slice) -> "Job":
        """The same for some members."""
        arrays = ("numbers", "horizon", "steps", "tolerance", "period", "names")
        cut = {name: values[members] for name in arrays if (values := getattr(self, name)) is not None}
        return replace(self, first=self.first + members.start, **cut)

    def columns(self) -> dict[str, Any]:
        """The runs: ``time``, what they show, what is `TOLD` of each member, and what the first said that `RAISED`."""
        period = nutation_periods(self.numbers) if self.period is None else self.period
        plan = schedule(period, self.horizon, self.samples, self.steps)
        with np.errstate(all="ignore"):  # a run may blow up, and that is a result
            runs = _whole(self._runs(plan), plan)
            columns = self._observables(runs, plan.times)
        told = dict(zip(TOLD, (
            np.array(ENDS)[runs.outcome], runs.steps, runs.force_evaluations, runs.newton_iterations, runs.reached,
            plan.step_size, self.horizon, plan.dithered,
        ), strict=True))  # fmt: skip
        return {"time": plan.times, **columns, **told} | ({RAISED: runs.raised} if runs.raised else {})

    def _runs(self, plan: Schedule) -> _Runs:
        """The states of the members, by the quickest way there is."""
        solver = self.method.solvers[self.chart]
        if isinstance(solver, FixedStep):
            done = sampled(solver, self.numbers, plan)
            reached = done.steps * plan.step_size
            return _Runs(done.states, done.momenta, done.steps, *solver.counts(*done[2:4]), done.outcome, reached)
        if isinstance(solver, Adaptive) and self.tolerance is not None:
            done, ended = solver.many(self.numbers, self.tolerance, plan.times, plan.counts, self.budget)
            return _Runs(done.states, done.momenta, done.steps, done.work, 0 * done.work, done.outcome, ended)
        if solver is exact.solve:
            states, momenta = exact.solve_many(self.numbers, np.nan_to_num(plan.times))
            none = np.zeros(len(self.numbers), dtype=np.int64)
            return _Runs(states, momenta, none, plan.counts, none, none, self.horizon)
        return self._in_turn(plan)

    def _in_turn(self, plan: Schedule) -> _Runs:
        """The same by one call of a solver for each member.

        A member fails alone if it starts on a pole, where the angles chart ends, if its numbers leave the range of the
        arithmetic that a solver in Python does (`ArithmeticError`), and if the solver raises anything else.
        """
        n = len(plan.counts)
        states = np.full((n, self.samples, charts.DIMENSIONS[self.chart]), np.nan)
        momenta, (steps, evaluations, iterations, outcome) = (
            np.full((n, self.samples, 2), np.nan),
            np.zeros((4, n), int),
        )
        runs = _Runs(states, momenta, steps, evaluations, iterations, outcome, np.zeros(n))
        for i, (top, start) in enumerate(members_of(self.numbers)):
            heed()
            if self.chart == "angles" and not 0.0 < start.theta < np.pi:
                runs.outcome[i] = LEFT_CHART
                continue
            one = self._plan(i, plan)
            try:
                name = self.first + i if self.names is None else self.names[i]
                run = solve(self.method, self.chart, top, start, one, f" on member {name}")
            except SymtopError as error:
                arithmetic = isinstance(error.__cause__, (ArithmeticError, np.linalg.LinAlgError))
                runs.outcome[i] = NOT_FINITE if arithmetic else ENDS.index(RAISED)
                if not (arithmetic or runs.raised):
                    runs = runs._replace(raised=str(error))
                continue
            runs.states[i, : one.times.size] = run.states
            runs.momenta[i, : one.times.size] = np.stack([run.p_phi, run.p_psi], axis=-1)
            runs.steps[i], runs.force_evaluations[i], runs.newton_iterations[i] = run[3:6]
            runs.outcome[i], runs.reached[i] = OUTCOMES.index(run.outcome), run.reached
        return runs

    def _plan(self, i: int, plan: Schedule) -> Plan:
        """What `simulate` would ask a solver for."""
        count, horizon = plan.counts[i], float(self.horizon[i])
        if self.steps is not None:
            return Plan.steps(float(plan.step_size[i]), plan.marks[i, :count], horizon)
        tolerance = np.nan if self.tolerance is None else float(self.tolerance[i])
        return Plan.until(plan.times[i, :count], tolerance, self.budget)

    def _observables(self, runs: _Runs, times: Array) -> dict[str, Array]:
        """Of what a `Trajectory` shows of one run, what is asked for, of all."""
        top: Any = _Top(*(self.numbers[:, k : k + 1] for k in range(3)))
        seen = View(self.chart, top, runs.states, runs.momenta[..., 0], runs.momenta[..., 1])
        turned = [name for name in ("phi", "psi") if name in self.shown and self.chart != "angles"]
        truth = ClosedForms(self.numbers)(np.nan_to_num(times)) if turned else None
        return {
            name: charts.unwrapped(getattr(seen, name), getattr(truth, name)) if name in turned else getattr(seen, name)
            for name in self.shown
        }


def _sent(words: dict[str, Any]) -> Job:
    """A job as it was before it was sent."""
    return Job(**words | {"method": find_integrator(words["method"])})


def sampled(solver: FixedStep, numbers: Array, plan: Schedule) -> Many:
    """The runs of a plan, those with equally many samples in one call."""
    counts = np.unique(plan.counts)
    if counts.tolist() == [plan.marks.shape[1]]:
        return solver.many(numbers, plan.step_size, plan.marks)
    groups = [np.flatnonzero(plan.counts == count) for count in counts]
    parts = [
        solver.many(numbers[rows], plan.step_size[rows], plan.marks[rows, :count])
        for rows, count in zip(groups, counts, strict=True)
    ]
    done = Many.begun(len(numbers), plan.marks.shape[1], parts[0].states.shape[2])
    for rows, count, part in zip(groups, counts, parts, strict=True):
        done.states[rows, :count], done.momenta[rows, :count] = part.states, part.momenta
        done.steps[rows], done.work[rows], done.outcome[rows] = part[2:]
    return done


def _whole(runs: _Runs, plan: Schedule) -> _Runs:
    """A run that shows a state that is not finite and says nothing of it ends there, as in `simulation`."""
    if np.isfinite(runs.states.sum()):  # a tenth of the time
        return runs
    finite = np.isfinite(runs.states).all(axis=2) | np.isnan(plan.times)
    bad = np.flatnonzero((runs.outcome == OK) & ~finite.all(axis=1))
    if not bad.size:
        return runs
    outcome, reached = runs.outcome.copy(), runs.reached.copy()
    first = finite[bad].argmin(axis=1)
    outcome[bad], reached[bad] = NOT_FINITE, np.where(first > 0, plan.times[bad, first - 1], 0.0)
    return runs._replace(outcome=outcome, reached=reached)


def same_times(times: Any, row: Any) -> bool:
    """Are these times of members (n, samples) all that row? NaN is what both have beyond runs of few steps."""
    if (times == row).all():
        return True
    return bool(np.isnan(row).any() and np.array_equal(times, np.broadcast_to(row, times.shape), equal_nan=True))


def as_dataset(columns: dict[str, Any], labels: dict[str, Any], *, shared: bool | None = None) -> xr.Dataset:
    """Columns (n, ...) and labels (n,) as a dataset; times that all members share are one row.

    `shared` says so where the columns are not those of all members.
    """
    times = columns["time"]
    if shared is None:
        shared = same_times(times, times[0])
    parts = [name for name, held in (("component", "axis"), ("part", "quaternion")) if held in columns]
    ends = {"axis": "component", "quaternion": "part"}
    variables = {
        name: (("member", "time", *([ends[name]] if name in ends else []))[: values.ndim], values)
        for name, values in columns.items()
        if name != "time"
    }
    return xr.Dataset(
        {**variables, **{name: ("member", values) for name, values in labels.items()}},
        {
            "time": ("time", times[0]) if shared else (("member", "time"), times),
            **{name: list(LABELS[name]) for name in parts},
        },
    )
