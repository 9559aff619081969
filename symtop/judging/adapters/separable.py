"""A Python function ``step(state, h, dT, dV) -> state`` for the nutation alone, whose Hamiltonian separates.

    H = T(p_theta) + V(theta),     T = p_theta^2/2 I1,     V the effective potential at the p_phi and p_psi of the start

    def step(state, h, dT, dV):
        theta, p = state
        p = p - h * dV(theta)
        return theta + h * dT(p), p

state is (theta, p_theta), a NumPy array of shape (2,), in radians and the units of the scene's top; dT is p_theta/I1
and dV the slope of V, both of one number. The chart ends at theta = 0 and pi. h may be negative.
"""

from typing import Any

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging.adapters.adapter import March, Marks
from symtop.judging.adapters.python_step import FunctionStep
from symtop.methods.framework.angles import chart_outcome, on_angles
from symtop.methods.framework.equations import Formulation
from symtop.methods.framework.plan import Array
from symtop.model.top import Angles, SymmetricTop, effective_force


def _no_field(*_: Any) -> Any:
    raise SymtopError("a map of (theta, p_theta) has no equations of six variables")


def _begin(top: SymmetricTop, at: Angles) -> tuple[Any, tuple[float, ...]]:
    """The top with its momenta, and (theta, p_theta) of a start."""
    par, state = on_angles(top, at)
    return par, state[:2]


def _momenta(par: Any, states: Array) -> tuple[Array, Array]:
    """p_phi and p_psi, which are parameters of the reduced motion."""
    p_phi = 0.5 * (par.north + par.south)
    return np.full(len(states), p_phi), np.full(len(states), par.p_psi)


REDUCED = Formulation(_no_field, lambda y: chart_outcome(y[0]), _no_field, _begin, None, _momenta)


class SeparableStep(FunctionStep):
    """A stepper around the function; a call of dV is a force evaluation."""

    chart, form = "nutation", REDUCED

    def march(self, _top: SymmetricTop, par: Any, y: Array, h: float, marks: Marks) -> March:
        """The state at the marks."""
        calls = 0

        def dT(p_theta: Any) -> Any:
            return p_theta / par.I1

        def dV(theta: Any) -> Any:
            nonlocal calls
            calls += 1
            try:
                return effective_force(theta, par.north, par.south, par.I1, par.mgl)[0]
            except (OverflowError, ZeroDivisionError, ValueError):  # at a pole, or at infinity
                return np.nan

        states = self.steps(lambda _, state: self.function(state, h, dT, dV), 0.0, y, h, marks)
        return March(states, calls)
