"""A Python function ``step(f, t, y, h) -> y`` on batches of torch tensors or JAX arrays.

y has the shape (batch, 6), a row (e, L) on the axis, or (batch, 7), (q, L) on the attitude; f(t, y) has the same. What
is torch is called as it stands, without gradients; what is JAX is compiled by `jax.jit`. The batch has two rows, the
state that is judged and another. A row must not depend on the other one: that is tried once, before all else.
"""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symtop.core.errors import SymtopError
from symtop.judging.adapters.adapter import March, label_of
from symtop.judging.adapters.python_step import LOOK, state_like
from symtop.judging.adapters.tensors import double_precision, field_of, library, on_these_charts
from symtop.judging.heartbeat import pulse
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.plan import Array
from symtop.methods.framework.registry import Solver
from symtop.model.top import SymmetricTop

COMPILING = 60.0  # seconds that the first call may take besides
OTHER = 0.7  # momentum of the other row, of the first
SAME = 1e-12  # relative: a row alone and in a batch


class BatchStep:
    """A stepper around the function; `form` is torch or jax."""

    implementation = "python"
    adaptive: Solver | None = None
    own_loop = False

    def __init__(self, function: Callable[..., Any], chart: str, form: str, name: str = "") -> None:
        self.library, self.jax = library(form, form), form == "jax"
        self.function, self.chart = function, on_these_charts(form, chart)
        self.form = FORMULATIONS[chart]
        self.name = label_of(name or getattr(function, "__name__", type(function).__name__))
        self._step = self._compiled() if self.jax else self._called
        self._tried = False

    def march(self, _top: SymmetricTop, par: Any, y: Array, h: float, marks: NDArray[np.int64]) -> March:
        """The state at the marks: the first row of the batch."""
        with double_precision(self.library) if self.jax else self.library.no_grad():
            step = functools.partial(self._step, par)
            batch = self._array(np.stack([y, np.concatenate([y[:-3], OTHER * y[-3:]])]))
            if not self._tried:
                self._try(step, y, batch, h)
            return March(self._rows(step, batch, h, marks, y.size), 0)

    def _rows(self, step: Callable[..., Any], batch: Any, h: float, marks: NDArray[np.int64], size: int) -> Array:
        states, done = np.full((marks.size, size), np.nan), 0
        for place, mark in enumerate(marks):
            for k in range(done, int(mark)):
                if k % LOOK == 0 and not np.isfinite(np.asarray(batch[0])).all():
                    return states
                batch = self._once(step, k * h, batch, h)
            done, states[place] = int(mark), np.asarray(batch[0])
        return states

    def _array(self, values: Array) -> Any:
        return self.library.numpy.asarray(values) if self.jax else self.library.tensor(values)

    def _called(self, par: Any, t: float, y: Any, h: float) -> Any:
        stack, last = (self.library.numpy.stack, "axis") if self.jax else (self.library.stack, "dim")
        return self.function(field_of(self.chart, par, lambda rows: stack(rows, **{last: -1})), t, y, h)

    def _compiled(self) -> Callable[..., Any]:
        compiled: Callable[..., Any] = self.library.jit(self._called)
        return compiled

    def _once(self, step: Callable[..., Any], t: float, batch: Any, h: float, seconds: float = 0.0) -> Any:
        pulse.begin(h, seconds)
        try:
            after = step(t, batch, h)
        except Exception as error:  # (somebody else's code)
            words = " ".join(str(error).split())
            raise SymtopError(f"a step of h = {h:.3g} raises {type(error).__name__}: {words}") from error
        pulse.end()
        if tuple(getattr(after, "shape", ())) != tuple(batch.shape):
            shape = getattr(after, "shape", None)
            given = type(after).__name__ if shape is None else f"shape {tuple(shape)}"
            raise SymtopError(f"step must return a batch of states, shape {tuple(batch.shape)}, not {given}")
        return after

    def _try(self, step: Callable[..., Any], y: Array, batch: Any, h: float) -> None:
        """A step of the first row alone, and in the batch."""
        alone = self._array(y[None])
        one = state_like(y, np.asarray(self._once(step, 0.0, alone, h, COMPILING)[0]), "step")
        two = state_like(y, np.asarray(self._once(step, 0.0, batch + 0.0, h, COMPILING)[0]), "step")
        apart = float(np.max(np.abs(one - two))) / max(float(np.max(np.abs(one))), 1e-300)
        if apart > SAME:
            raise SymtopError(
                f"a row of a batch must be stepped by itself: the same state with another row beside it comes out "
                f"different by {apart:.1e}"
            )
        self._tried = True
