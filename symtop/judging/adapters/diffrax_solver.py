"""A solver of diffrax, such as ``diffrax.Tsit5()``: its formula with fixed steps, compiled as diffrax compiles it.

The solver is asked for one step after another, in a loop of JAX's own, as `diffrax.diffeqsolve` with a constant step
asks for them; its own memory (a last slope, a second state) goes with it through a run. An implicit solver needs a root
finder with tolerances of its own, for there is no step control to take them from.
"""

from typing import Any

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging.adapters.adapter import March, Marks, Stepper, label_of
from symtop.judging.adapters.batch_step import COMPILING, double_precision, field_of, library, on_these_charts
from symtop.judging.heartbeat import heartbeat
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.plan import Array
from symtop.model.top import SymmetricTop

MOST = 20_000  # steps of one call


def is_solver(thing: Any) -> bool:
    """Is it an instance of a solver of diffrax, or of a class derived from one?"""
    bases = [one.__module__.partition(".")[0] for one in type(thing).__mro__]
    return "diffrax" in bases and hasattr(thing, "term_structure")


class DiffraxSolver(Stepper):
    """A stepper around the solver."""

    implementation = "compiled"
    own_loop = True

    def __init__(self, solver: Any, chart: str, name: str = "") -> None:
        self.jax, self.diffrax = library("diffrax", "jax"), library("diffrax", "diffrax")
        if not is_solver(solver):
            raise SymtopError(f"form diffrax needs an instance of a solver, such as diffrax.Tsit5(), not {solver!r}")
        if isinstance(solver.term_structure, tuple):
            raise SymtopError(
                f"{type(solver).__name__} steps a system in two parts; form diffrax has one, y' = f(y): "
                "judge it as a function, with form separable"
            )
        self.solver, self.chart = solver, on_these_charts("diffrax", chart)
        self.form = FORMULATIONS[chart]
        self.name = label_of(name or type(solver).__name__)
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
        jax, diffrax, solver = self.jax, self.diffrax, self.solver
        stack = jax.numpy.stack
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
