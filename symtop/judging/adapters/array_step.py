"""Steps on arrays of other libraries: batches of torch or JAX, and solvers of diffrax, all in double precision.

*torch*, *jax*: a function ``step(f, t, y, h) -> y``; y has the shape (batch, 6), a row (e, L) on the axis, or
(batch, 7), (q, L) on the attitude, and f(t, y) has the same. What is torch is called as it stands, without gradients;
what is JAX is compiled by `jax.jit`. The batch has two rows, the state that is judged and another, on which it must not
depend: that is tried once, before all else.

*diffrax*: a solver such as ``diffrax.Tsit5()``, its formula with fixed steps, asked for one step after another in a
compiled loop, as by `diffrax.diffeqsolve` with a constant step; its own memory (a last slope, a second state) goes with
it through a run. An implicit solver needs a root finder with tolerances of its own: there is no step control.

The equations of the axis and of the attitude are arithmetic alone, so that they are on arrays what they are on floats.
A library is imported when something of it is judged.
"""

import contextlib
import functools
import importlib
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging.adapters.adapter import March, Marks, Stepper, heartbeat, label_of, repeat
from symtop.judging.adapters.python_step import state_like
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.plan import Array
from symtop.model.top import SymmetricTop

COMPILING = 60.0  # seconds that the first call may take besides
OTHER = 0.7  # momentum of the other row, of the first
SAME = 1e-12  # relative: a row alone and in a batch
MOST = 20_000  # steps of one call of a solver
CHARTS = ("axis", "attitude")  # the angles have sines, which each library has for itself


class BatchStep(Stepper):
    """A stepper around the function; `form` is torch or jax."""

    def __init__(self, function: Callable[..., Any], chart: str, form: str, name: str = "") -> None:
        self.library, self.jax = library(form, form, chart), form == "jax"
        self.function, self.chart, self.form = function, chart, FORMULATIONS[chart]
        self.name = label_of(name or function)
        self._step = self.library.jit(self._called) if self.jax else self._called
        self._tried = False

    def march(self, _top: SymmetricTop, par: Any, y: Array, h: float, marks: Marks) -> March:
        """The state at the marks: the first row of the batch."""
        with double_precision(self.library) if self.jax else self.library.no_grad():
            step = functools.partial(self._step, par)
            batch = self._array(np.stack([y, np.concatenate([y[:-3], OTHER * y[-3:]])]))
            if not self._tried:
                self._try(step, y, batch, h)
            states = repeat(lambda k, rows: _once(step, k * h, rows, h), batch, marks, lambda rows: np.asarray(rows[0]))
            return March(states, 0)

    def _array(self, values: Array) -> Any:
        return self.library.numpy.asarray(values) if self.jax else self.library.tensor(values)

    def _called(self, par: Any, t: float, y: Any, h: float) -> Any:
        stack, last = (self.library.numpy.stack, "axis") if self.jax else (self.library.stack, "dim")
        return self.function(field_of(self.chart, par, lambda rows: stack(rows, **{last: -1})), t, y, h)

    def _try(self, step: Callable[..., Any], y: Array, batch: Any, h: float) -> None:
        """A step of the first row alone, and in the batch."""
        pair = (_once(step, 0.0, rows, h, COMPILING)[0] for rows in (self._array(y[None]), batch + 0.0))
        one, two = (state_like(y, np.asarray(row)) for row in pair)
        apart = float(np.max(np.abs(one - two))) / max(float(np.max(np.abs(one))), 1e-300)
        if apart > SAME:
            raise SymtopError(
                "a row of a batch must be stepped by itself: the same state with another row beside it comes out "
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


def library(form: str, name: str, chart: str) -> Any:
    """The package `name`; SymtopError if it is not there, or for a chart whose equations are not arithmetic alone."""
    try:
        package = importlib.import_module(name)
    except ImportError:
        raise SymtopError(f"form {form} needs the package {name}, which is not installed") from None
    if chart not in CHARTS:
        raise SymtopError(f"chart must be axis or attitude for the form {form}, not {chart!r}", "chart")
    return package


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


def is_solver(thing: Any) -> bool:
    """Is it an instance of a solver of diffrax, or of a class derived from one?"""
    bases = [one.__module__.partition(".")[0] for one in type(thing).__mro__]
    return "diffrax" in bases and hasattr(thing, "term_structure")


class DiffraxSolver(Stepper):
    """A stepper around the solver."""

    implementation = "compiled"
    own_loop = True

    def __init__(self, solver: Any, chart: str, name: str = "") -> None:
        self.jax, self.diffrax = (library("diffrax", name, chart) for name in ("jax", "diffrax"))
        if not is_solver(solver):
            raise SymtopError(f"form diffrax needs an instance of a solver, such as diffrax.Tsit5(), not {solver!r}")
        if isinstance(solver.term_structure, tuple):
            raise SymtopError(
                f"{type(solver).__name__} steps a system in two parts; form diffrax has one, y' = f(y): "
                "judge it as a function, with form separable"
            )
        self.solver, self.chart, self.form = solver, chart, FORMULATIONS[chart]
        self.name = label_of(name or solver)
        finder = getattr(solver, "root_finder", None)
        if finder is not None and not isinstance(getattr(finder, "rtol", 0.0), (int, float)):
            raise SymtopError(
                f"{type(solver).__name__} must have a root finder with tolerances of its own, such as "
                "root_finder=diffrax.VeryChord(rtol=1e-12, atol=1e-12): a fixed step has none"
            )
        self._begin, self._run = self._compiled()
        self._fresh = True  # nothing is compiled yet

    def march(self, _top: SymmetricTop, par: Any, y: Array, h: float, marks: Marks) -> March:
        """The state at the marks; NaN where the solver says that a step failed."""
        states, done = np.full((marks.size, y.size), np.nan), 0
        with double_precision(self.jax):
            more = COMPILING if self._fresh else 0.0
            with heartbeat.call(h, more):
                at = self.jax.numpy.asarray(y)
                memory = self._begin(par, at, h)
            for place, mark in enumerate(marks):
                while done < mark:
                    some = min(MOST, int(mark) - done)
                    with heartbeat.call(h, more):
                        at, memory = self._run(par, at, memory, done * h, h, some)
                        self.jax.block_until_ready(at)
                    self._fresh, more, done = False, 0.0, done + some
                states[place] = np.asarray(at)
                if not np.isfinite(states[place]).all():
                    break
        return March(states, 0)

    def _compiled(self) -> tuple[Any, Any]:
        """The start of a run, and so many steps of it; the numbers of the top are `args`, so that both compile once."""
        jax, diffrax, solver, stack = self.jax, self.diffrax, self.solver, self.jax.numpy.stack
        term = diffrax.ODETerm(lambda t, y, par: field_of(self.chart, par, lambda rows: stack(rows, axis=-1))(t, y))

        def begin(par: Any, y: Any, h: Any) -> Any:
            return solver.init(term, 0.0 * h, h, y, par)

        def run(par: Any, y: Any, memory: Any, t: Any, h: Any, count: Any) -> Any:
            def once(k: Any, at: Any) -> Any:
                now, memory = at
                start = t + k * h
                after, _, _, memory, result = solver.step(term, start, start + h, now, par, memory, False)
                failed = result != diffrax.RESULTS.successful
                return jax.numpy.where(failed, jax.numpy.nan, after), memory

            return jax.lax.fori_loop(0, count, once, (y, memory))

        return jax.jit(begin), jax.jit(run)
