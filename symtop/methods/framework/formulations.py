"""The top's equations as a library for differential equations wants them: one right-hand side y' = f(y) a chart.

    angles      (theta, phi, psi, theta', phi', psi')     the Euler-Lagrange equations        `euler_lagrange`
    axis        (e, L)                                    e' = L x e/I1,  L' = mgl k x e      `space`
    attitude    (q, L)                                    q' = (L q/I1 + twist q k)/2, L' the same with e = q k q*

In each of the three, energy and momenta are functions of the state, so that whatever a method does to them shows. Every
Runge-Kutta method, compiled or a library's, takes f from here, so that method and chart can be varied one at a time.
A Runge-Kutta method keeps what is linear in its state, and no explicit one keeps more: p_phi = L_z in the space frame,
nothing in angles.

    chart      variables   multiplications and divisions   sines and cosines   poles
    angles             6                              16                   2   theta = 0 and pi
    axis               6                              12                   0   none
    attitude           7                              29                   0   none
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from symtop.methods.framework import euler_lagrange, space
from symtop.methods.framework.outcomes import OUTCOMES
from symtop.methods.framework.plan import Array, Run
from symtop.model.charts import space_momenta
from symtop.model.top import Angles, SymmetricTop


class Formulation(NamedTuple):
    """The equations in one chart. `field`, `ended` and `observe` are plain Python on tuples and compile as they are."""

    field: Callable[[Any, Any], Any]  # (par, state) -> time derivative
    ended: Callable[[Any], int]  # outcome of a state: OK, or how the chart was left
    observe: Callable[..., Any]  # (par, rule, before, dstate, h) -> p_phi and p_psi after a step
    prepare: Callable[[SymmetricTop, Angles], tuple[Any, tuple[float, ...]]]  # parameters and state of a start
    present: (
        Callable[[Any, Array, Array], Array] | None
    )  # (par, times, states) -> states of the chart that `simulate` shows, where they differ
    momenta: Callable[[Any, Array], tuple[Array, Array]]  # (par, states) -> p_phi and p_psi of samples


def _axis_momenta(par: Any, states: Array) -> tuple[Array, Array]:
    return space_momenta("axis", states)


def _attitude_momenta(par: Any, states: Array) -> tuple[Array, Array]:
    return space_momenta("attitude", states)


FORMULATIONS = {
    "angles": Formulation(
        euler_lagrange.field_angles,
        euler_lagrange.ended_angles,
        euler_lagrange.observe_angles,
        euler_lagrange.with_rates,
        euler_lagrange.to_angles,
        euler_lagrange.sampled_momenta,
    ),
    "axis": Formulation(space.field_axis, space.ended_space, space.observe_axis, space.on_axis, None, _axis_momenta),
    "attitude": Formulation(
        space.field_attitude, space.ended_space, space.observe_attitude, space.on_attitude, None, _attitude_momenta
    ),
}


def as_run(
    form: Formulation, par: Any, times: Array, states: Array, steps: int, evaluations: int, outcome: int, reached: float
) -> Run:
    """Samples of the state that was integrated, shape (samples, dimension), with both momenta recomputed from it."""
    p_phi, p_psi = form.momenta(par, states)
    shown = states if form.present is None else form.present(par, times, states)
    return Run(shown, p_phi, p_psi, steps, evaluations, 0, OUTCOMES[outcome], reached)
