"""rk4 and Strang's splitting as a user writes them: NumPy arrays in a Python loop.

    rk4       y+ = y + h (k1 + 2 k2 + 2 k3 + k4)/6          f(y) is the formula that every other implementation has
    strang    L += h/2 mgl k x e;   e turns about L by h |L|/I1 (Rodrigues);   L += h/2 mgl k x e

They do the arithmetic of the compiled loops but for the compensated sum of the increments, so that both give the same
trajectory to rounding at the same step. Momenta are recomputed from the states.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from symtop.methods.framework.equations import FORMULATIONS, as_run
from symtop.methods.framework.plan import NOT_FINITE, OK, Array, Plan, Run
from symtop.methods.framework.registry import Integrator, Solver
from symtop.model.top import Angles, SymmetricTop

Step = Callable[[Callable[[Array], Array], Any, Array, float], Array]


def rk4_step(f: Callable[[Array], Array], par: Any, y: Array, h: float) -> Array:
    """One step of the classical Runge-Kutta method."""
    k1 = f(y)
    k2 = f(y + 0.5 * h * k1)
    k3 = f(y + 0.5 * h * k2)
    k4 = f(y + h * k3)
    return y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def strang_step(f: Callable[[Array], Array], par: Any, y: Array, h: float) -> Array:
    """Half a kick, the free top, half a kick, on (e, L)."""
    e, L = y[:3], y[3:] + 0.5 * h * par.mgl * np.array([-y[1], y[0], 0.0])
    length = math.sqrt(L @ L)
    n, angle = L / length, h * length / par.I1
    c, s = math.cos(angle), math.sin(angle)
    across = np.array([n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2], n[0] * e[1] - n[1] * e[0]])
    e = c * e + s * across + (1.0 - c) * (n @ e) * n
    return np.concatenate([e, L + 0.5 * h * par.mgl * np.array([-e[1], e[0], 0.0])])


def solver(chart: str, step: Step) -> Solver:
    """A solver of the registry: a plain loop over `step`, sampled at the marks of the plan."""
    form = FORMULATIONS[chart]

    def solve(top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        par, numbers = form.prepare(top, start)
        y, evaluations = np.array(numbers), 0

        def f(place: Array) -> Array:
            nonlocal evaluations
            evaluations += 1
            return np.array(form.field(par, place))

        states, steps, outcome = np.full((plan.marks.size, y.size), np.nan), 0, OK
        for sample, mark in enumerate(plan.marks):
            while steps < mark:
                y = step(f, par, y, plan.step_size)
                steps += 1
            if not np.isfinite(y).all():
                outcome = NOT_FINITE
                break
            states[sample] = y
        work = evaluations if step is rk4_step else steps
        return as_run(form, par, plan.times, states, steps, work, outcome, steps * plan.step_size)

    return solve


def in_numpy(name: str, charts: tuple[str, ...], step: Step, order: int, summary: str) -> Integrator:
    """The `Integrator` of a plain loop; it is not in the registry."""
    solvers = {chart: solver(chart, step) for chart in charts}
    return Integrator(
        name=name, family="other", summary=summary, solvers=solvers, implementation="python", order=order, explicit=True
    )


RK4 = in_numpy("rk4-numpy", tuple(FORMULATIONS), rk4_step, 4, "the classical Runge-Kutta method in NumPy")
STRANG = in_numpy("strang-numpy", ("axis",), strang_step, 2, "free top and gravity kicks in NumPy")
