"""A Python function ``step(f, t, y, h) -> y`` for y' = f(t, y).

    def step(f, t, y, h):
        k1 = f(t, y)
        return y + h * f(t + h / 2, y + h / 2 * k1)

y and what f returns are NumPy arrays of shape (6,): (e, L) on the axis, (theta, phi, psi and their rates) in angles; or
(7,): (q, L) on the attitude. h may be negative. A step that changes its input in place, and returns it, works.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging.adapters.adapter import March, Marks, Stepper, function_name, label_of, repeat
from symtop.judging.heartbeat import heartbeat
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.plan import Array
from symtop.model.top import SymmetricTop

Field = Callable[[float, Array], Array]


class Equations:
    """y' = f(t, y) of a chart on arrays, and how often it was called."""

    def __init__(self, chart: str, par: Any) -> None:
        self.field, self.par, self.calls = FORMULATIONS[chart].field, par, 0

    def __call__(self, _: float, y: Any) -> Array:
        """y' at any time."""
        self.calls += 1
        try:
            return np.array(self.field(self.par, np.asarray(y).tolist()))
        except (OverflowError, ZeroDivisionError, ValueError):  # the sine of infinity
            if np.isfinite(y).all():
                raise
            return np.full(np.shape(y), np.nan)


class FunctionStep(Stepper):
    """A stepper around somebody's function, whose results are checked as they come."""

    def __init__(self, function: Callable[..., Any], name: str = "") -> None:
        self.function = function
        self.name = label_of(name or function_name(function))

    def steps(self, once: Callable[[float, Array], Any], t: float, y: Array, h: float, marks: Marks) -> Array:
        """The states at the marks, from a time t on; `once(t, y)` asks the function for one step of h."""

        def checked(k: int, y: Array) -> Array:
            before = y.copy() if k == 0 else y
            try:
                with heartbeat.call(h):
                    after = once(t + k * h, y)
            except SymtopError:
                if np.isfinite(y).all():
                    raise
                after = np.full(y.shape, np.nan)
            self.wrote = self.wrote or (k == 0 and not np.array_equal(before, y))
            return state_like(before, after, "step")

        return repeat(checked, y, marks)


class PythonStep(FunctionStep):
    """A stepper around the function."""

    def __init__(self, function: Callable[..., Any], chart: str, name: str = "") -> None:
        super().__init__(function, name)
        self.chart, self.form = chart, FORMULATIONS[chart]

    def march(self, _top: SymmetricTop, par: Any, y: Array, h: float, marks: Marks) -> March:
        """The state at the marks."""
        f = Equations(self.chart, par)
        states = self.along(f, 0.0, y, h, marks)
        return March(states, f.calls)

    def along(self, f: Field, t: float, y: Array, h: float, marks: Marks) -> Array:
        """The states at the marks for any right-hand side, from a time t on."""
        return self.steps(lambda at, state: self.function(f, at, state, h), t, y, h, marks)


def state_like(before: Array, after: Any, what: str) -> Array:
    """What a step returned as an array of floats; SymtopError if it is no state."""
    if type(after) is np.ndarray and after.shape == before.shape and after.dtype == np.float64:
        return after
    shown = np.asarray(after) if after is not None else None
    if shown is None or shown.shape != before.shape or shown.dtype.kind not in "fiu":
        given = "None" if shown is None else f"{type(after).__name__} of shape {shown.shape} and type {shown.dtype}"
        raise SymtopError(f"{what} must return the new state, {before.size} real numbers, not {given}")
    return shown.astype(float)
