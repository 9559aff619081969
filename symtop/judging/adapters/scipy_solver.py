"""A class derived from ``scipy.integrate.OdeSolver``.

Fixed steps are asked for by max_step = first_step = h with tolerances that accept any error, so that the formula is
judged and not its step control; the end of the interval lies beyond the last step, which is never cut short. With a
tolerance, rtol = atol, the class chooses its steps, as it does for ``solve_ivp``.
"""

from typing import Any

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging.adapters.adapter import March, Marks, Stepper, label_of
from symtop.judging.adapters.python_step import Equations, Field, state_like
from symtop.judging.heartbeat import heartbeat
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.plan import Array
from symtop.methods.library.scipy_ivp import solver as solver_of
from symtop.model.top import SymmetricTop

ANY = 1e300  # a tolerance that every step meets; infinity times a component of zero would be no number
SAME = 1e-9  # of a step: one that is this near to h has its length


class ScipySolver(Stepper):
    """A stepper around the class; with `adaptive`, it chooses its steps by a tolerance."""

    def __init__(self, kind: type, chart: str, *, adaptive: bool = False) -> None:
        if not callable(getattr(kind, "step", None)):
            raise SymtopError(f"a class must be derived from scipy.integrate.OdeSolver, not {kind.__name__}")
        self.kind, self.chart, self.form = kind, chart, FORMULATIONS[chart]
        self.name = label_of(kind.__name__)
        self.adaptive = solver_of(kind, chart) if adaptive else None

    def march(self, _top: SymmetricTop, par: Any, y: Array, h: float, marks: Marks) -> March:
        """The state at the marks."""
        f = Equations(self.chart, par)
        states = self.along(f, 0.0, y, h, marks)
        return March(states, f.calls)

    def along(self, f: Field, t: float, y: Array, h: float, marks: Marks) -> Array:
        """The states at the marks for any right-hand side, from a time t on; SymtopError for steps that are not h."""
        last = int(marks[-1])
        states = np.full((marks.size, y.size), np.nan)
        with heartbeat.call(h):
            made: Any = self.kind(f, t, y, t + (last + 2) * h, max_step=abs(h), first_step=abs(h), rtol=ANY, atol=ANY)
        place = 0
        for k in range(last + 1):
            while place < marks.size and marks[place] == k:
                states[place] = state_like(y, made.y, "a solver")
                place += 1
            if k == last or made.status != "running" or not np.isfinite(made.y).all():
                break
            with heartbeat.call(h):
                made.step()
            if abs(made.t - (t + (k + 1) * h)) > SAME * abs(h) * (k + 1):
                raise SymtopError(
                    f"{self.name} must make steps of max_step = first_step = {abs(h):.3g} where the tolerance accepts "
                    f"any error, and made one of {made.t - t - k * h:.3g}"
                )
        return states
