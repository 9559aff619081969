"""A Python function ``step(f, t, y, h) -> y`` on batches of torch tensors or JAX arrays.

y has the shape (batch, 6), a row (e, L) on the axis, or (batch, 7), (q, L) on the attitude; f(t, y) has the same. What
is torch is called as it stands, without gradients; what is JAX is compiled by `jax.jit`. The batch has two rows, the
state that is judged and another. A row must not depend on the other one: that is tried once, before all else.

The equations of the axis and of the attitude are arithmetic alone, so that they are on arrays what they are on floats.
A library is imported when something of it is judged, and computes in double precision.
"""

import contextlib
import functools
import importlib
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging.adapters.adapter import March, Marks, Stepper, function_name, label_of, repeat
from symtop.judging.adapters.python_step import state_like
from symtop.judging.heartbeat import heartbeat
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.plan import Array
from symtop.model.top import SymmetricTop

COMPILING = 60.0  # seconds that the first call may take besides
OTHER = 0.7  # momentum of the other row, of the first
SAME = 1e-12  # relative: a row alone and in a batch
CHARTS = ("axis", "attitude")  # the angles have sines, which each library has for itself


class BatchStep(Stepper):
    """A stepper around the function; `form` is torch or jax."""

    def __init__(self, function: Callable[..., Any], chart: str, form: str, name: str = "") -> None:
        self.library, self.jax = library(form, form), form == "jax"
        self.function, self.chart = function, on_these_charts(form, chart)
        self.form = FORMULATIONS[chart]
        self.name = label_of(name or function_name(function))
        self._step = self.library.jit(self._called) if self.jax else self._called
        self._tried = False

    def march(self, _top: SymmetricTop, par: Any, y: Array, h: float, marks: Marks) -> March:
        """The state at the marks: the first row of the batch."""
        with double_precision(self.library) if self.jax else self.library.no_grad():
            step = functools.partial(self._step, par)
            batch = self._array(np.stack([y, np.concatenate([y[:-3], OTHER * y[-3:]])]))
            if not self._tried:
                self._try(step, y, batch, h)
            states = repeat(
                lambda k, batch: _once(step, k * h, batch, h), batch, marks, lambda batch: np.asarray(batch[0])
            )
            return March(states, 0)

    def _array(self, values: Array) -> Any:
        return self.library.numpy.asarray(values) if self.jax else self.library.tensor(values)

    def _called(self, par: Any, t: float, y: Any, h: float) -> Any:
        stack, last = (self.library.numpy.stack, "axis") if self.jax else (self.library.stack, "dim")
        return self.function(field_of(self.chart, par, lambda rows: stack(rows, **{last: -1})), t, y, h)

    def _try(self, step: Callable[..., Any], y: Array, batch: Any, h: float) -> None:
        """A step of the first row alone, and in the batch."""
        alone = self._array(y[None])
        one = state_like(y, np.asarray(_once(step, 0.0, alone, h, COMPILING)[0]), "step")
        two = state_like(y, np.asarray(_once(step, 0.0, batch + 0.0, h, COMPILING)[0]), "step")
        apart = float(np.max(np.abs(one - two))) / max(float(np.max(np.abs(one))), 1e-300)
        if apart > SAME:
            raise SymtopError(
                f"a row of a batch must be stepped by itself: the same state with another row beside it comes out "
                f"different by {apart:.1e}"
            )
        self._tried = True


def _once(step: Callable[..., Any], t: float, batch: Any, h: float, seconds: float = 0.0) -> Any:
    with heartbeat.call(h, seconds):
        after = step(t, batch, h)
    if tuple(getattr(after, "shape", ())) != tuple(batch.shape):
        shape = getattr(after, "shape", None)
        given = type(after).__name__ if shape is None else f"shape {tuple(shape)}"
        raise SymtopError(f"step must return a batch of states, shape {tuple(batch.shape)}, not {given}")
    return after


def library(form: str, name: str) -> Any:
    """The package `name`; SymtopError if it is not there."""
    try:
        return importlib.import_module(name)
    except ImportError:
        raise SymtopError(f"form {form} needs the package {name}, which is not installed") from None


def on_these_charts(form: str, chart: str) -> str:
    """The chart; SymtopError for one whose equations are not arithmetic alone."""
    if chart not in CHARTS:
        raise SymtopError(f"chart must be axis or attitude for the form {form}, not {chart!r}", "chart")
    return chart


def field_of(chart: str, par: Any, stack: Any) -> Any:
    """f(t, y) on arrays; `stack(columns)` joins arrays of shape (...) along a new last axis."""
    field = FORMULATIONS[chart].field

    def f(_t: Any, y: Any) -> Any:
        """The time derivative of y, of the shape of y."""
        columns = tuple(y[..., k] for k in range(y.shape[-1]))
        nothing = 0.0 * columns[0]  # a derivative that is zero is a number
        return stack([value + nothing if isinstance(value, float) else value for value in field(par, columns)])

    return f


@contextlib.contextmanager
def double_precision(jax: Any) -> Iterator[None]:
    """JAX computes in double precision within, and as before after."""
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    try:
        yield
    finally:
        jax.config.update("jax_enable_x64", before)
