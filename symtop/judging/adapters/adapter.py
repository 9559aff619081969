"""The base of all adapters: a `Stepper`, which steps a state of one formulation, and its record for the battery.

The momenta of the runs of a `Stepper` are computed from its states, so that it cannot report false ones. Each call of
foreign code is in the context of `heartbeat`, which the waiting process can read.
"""

import ctypes
import math
import mmap
import re
import time
from collections.abc import Callable, Sequence
from ctypes import c_bool, c_double, c_long
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from symtop.core.errors import SymtopError, words_of
from symtop.measure.step_map import reversed_rates
from symtop.methods.framework.equations import Formulation, as_run
from symtop.methods.framework.plan import NOT_FINITE, OK, Array, Plan, Run
from symtop.methods.framework.registry import Integrator, Solver, integrators
from symtop.model.top import Angles, SymmetricTop

Marks = NDArray[np.int64]
A_STEP: Marks = np.array([1])
CHECKED_STEPS = 64  # steps between two checks whether the state is finite
PATIENCE, QUICK_PATIENCE = 10.0, 3.0  # seconds for one call


class Stepper:
    """A foreign step as a solver that can also continue from any of its states."""

    name: str
    chart: str  # of its states; "nutation" for (theta, p_theta), which no registered solver has
    form: Formulation
    implementation = "python"  # or compiled; it determines the length of runs
    adaptive: Solver | None = None  # a solver at a tolerance, if it chooses its steps
    own_loop = False  # is the loop over steps foreign code, too?
    takes_field = False  # is it called with a right-hand side (`along`)?
    since = 0.0  # the time at which runs begin
    wrote = False  # has it changed its input?
    evaluations = 0  # of the force, in the last march; 0 if unknown
    clock: Callable[[], float] = staticmethod(time.perf_counter)  # seconds, to time its steps

    def renew(self) -> None:
        """Remove data that the step may keep between calls, if possible."""

    def close(self) -> None:
        """End what it has started."""

    def march(self, top: SymmetricTop, par: Any, y: Array, h: float, marks: Marks) -> Array:
        """The state after marks[0], marks[1], ... steps of h from y, (marks, dimension), NaN after a failure."""
        raise NotImplementedError  # each kind of foreign code has its own

    def from_start(self, top: SymmetricTop, start: Angles, h: float) -> tuple[Array, Callable[..., Array]]:
        """The state of a start, and a function (state, *marks) -> the states after these numbers of steps of h."""
        par, state = self.form.prepare(top, start)

        def run(y: Array, *marks: int) -> Array:
            return self.march(top, par, y.copy(), h, np.array(marks))

        return np.array(state, dtype=float), run

    def __call__(self, top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        """A run from start to horizon, with the interface of a registered solver."""
        par, state = self.form.prepare(top, start)
        states = self.march(top, par, np.array(state, dtype=float), plan.step_size, plan.marks)
        outcome, reached, steps = OK, plan.horizon, int(plan.marks[-1])
        for k, row in enumerate(states):
            outcome = self.form.ended(row.tolist()) if np.isfinite(row).all() else NOT_FINITE
            if outcome != OK:
                states[k:] = np.nan
                reached, steps = float(plan.times[max(k - 1, 0)]), int(plan.marks[max(k - 1, 0)])
                break
        return as_run(self.form, par, plan.times, states, steps, self.evaluations, outcome, reached)

    def onward(self, top: SymmetricTop, start: Angles, steps: Sequence[float]) -> Run:
        """The end of a sequence of steps of these lengths, each a separate run from the end of the one before."""
        par, state = self.form.prepare(top, start)
        y = np.array(state, dtype=float)
        for h in steps:
            y = self.march(top, par, y.copy(), h, A_STEP)[0]
        return as_run(self.form, par, np.zeros(1), y[None], 1, 0, OK, 0.0)

    def there_and_back(self, top: SymmetricTop, start: Angles, h: float) -> Run:
        """The end of a step of h and one from there with all rates reversed, for methods without steps of -h."""
        par, state = self.form.prepare(top, start)
        signs = np.ones(len(state))
        signs[-3 if signs.size > 2 else -1 :] = -1.0  # L, w, the rates or p_theta
        y = signs * self.march(top, par, np.array(state, dtype=float), h, A_STEP)[0]
        y = signs * self.march(top, self.form.prepare(top, reversed_rates(start))[0], y, h, A_STEP)[0]
        return as_run(self.form, par, np.zeros(1), y[None], 1, 0, OK, 0.0)


def in_runs(
    run: Callable[[int, int, Any], Any], y: Any, marks: Marks, limit: int, show: Callable[[Any], Array] = np.asarray
) -> Array:
    """The arrays show(y) at the marks, with y = run(first, steps, y) for at most `limit` steps; NaN after a failure."""
    states, first = np.full((marks.size, show(y).size), np.nan), 0
    for row, mark in enumerate(map(int, marks)):
        while first < mark:
            if not np.isfinite(show(y)).all():
                return states
            steps = min(limit, mark - first)
            first, y = first + steps, run(first, steps, y)
        states[row] = show(y)
    return states


def repeat(step: Callable[[int, Any], Any], y: Any, marks: Marks, show: Callable[[Any], Array] = np.asarray) -> Array:
    """`in_runs` for a function of single steps, y = step(k, y)."""

    def run(first: int, steps: int, y: Any) -> Any:
        for k in range(first, first + steps):
            y = step(k, y)
        return y

    return in_runs(run, y, marks, CHECKED_STEPS, show)


def relative_gap(first: Any, second: Any) -> float:
    """The largest difference of two arrays, relative to the largest number of the first; infinite if not finite."""
    gap = float(np.max(np.abs(first - second))) / max(float(np.max(np.abs(first))), 1e-300)
    return gap if np.isfinite(gap) else math.inf


def label_of(target: Any) -> str:
    """A valid name of an integrator from any text, or from the name of a function or of an object's class."""
    text = target if isinstance(target, str) else getattr(target, "__name__", type(target).__name__)
    return re.sub(r"[^A-Za-z0-9._+-]+", "-", text).strip("-._+")[:64] or "step"


def integrator(stepper: Stepper, **claims: Any) -> Integrator:
    """The record of a stepper with its claims; the name gets a prefix, ``own-rk4``, if a registered method has it."""
    chart = "angles" if stepper.chart == "nutation" else stepper.chart
    name = f"own-{stepper.name}"[:64] if stepper.name in integrators() else stepper.name
    solvers = {chart: stepper.adaptive or stepper}
    claims |= {"control": "tolerance" if stepper.adaptive else "step_size", "implementation": stepper.implementation}
    return Integrator(name, "other", "given through an adapter", solvers, **claims)


class Heartbeat(ctypes.Structure):
    """Counts calls of a step, in memory shared with a forked process: ``with heartbeat.call(h): step(...)``.

    `calls` is the number of calls begun; `step` is the h of the last one, which is running if `inside` and may take
    `allowed` seconds. Exceptions become SymtopError. `forward_only`: refuse steps backwards, for one did not return.
    """

    _fields_ = (("calls", c_long), ("step", c_double), ("inside", c_bool), ("allowed", c_double))
    forward_only, patience = False, PATIENCE

    def reset(self, *, quick: bool) -> None:
        """Reset for another step to judge, with the limit of seconds for `quick` or not."""
        self.forward_only, self.patience = False, QUICK_PATIENCE if quick else PATIENCE

    def call(self, h: float, seconds: float = 0.0) -> Self:
        """The context of a call that steps by h, which may take `seconds` more than usual."""
        if self.forward_only and h < 0.0:
            raise SymtopError("it makes no step backwards: a step of -h did not return")
        self.step, self.allowed = h, self.patience + seconds
        return self

    def __enter__(self) -> None:
        self.inside = True
        self.calls += 1

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        self.inside = False
        if isinstance(error, Exception | SystemExit) and not isinstance(error, SymtopError):
            raise SymtopError(f"a step of h = {self.step:.3g} raises {words_of(error)}") from error


heartbeat = Heartbeat.from_buffer(mmap.mmap(-1, ctypes.sizeof(Heartbeat)))  # of the one step that is judged at a time
