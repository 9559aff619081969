"""Simo and Wong's algorithm: a midpoint rule on the rotation group that keeps the energy and p_phi exactly.

    L_1 = L_0 + h tau(e'),   R_1 = R_0 cay(h (W_0 + W_1)/2),   e' = (e_0 + e_1)/2,   W = J^-1 R^T L in body axes.

*Energy.* cay fixes its axis, W_0 + W_1, so that without torque (W_0 + W_1).J(W_1 - W_0) = 0. With it, the gain of
kinetic energy is 2 u.tau(e'), u the Cayley vector of the step, and e_1 - e_0 = 2 u x e' makes the gain of potential
energy its negative. That takes Cayley's rotation, not an exponential, and gravity at the mean of both axes. L_z is not
touched. L.e is kept without gravity and changes by -h (tau.u)(u.e') in a step with it; the map is symmetric, and the
wobble does not grow. No bracket is preserved. The spin's angle is wrong by (h psi')^3/12 a step.

With W_1 eliminated, the Cayley vector u (in space, J the inertia at the start of the step) solves

    J u + u x J u = (h/2) L_0 + (h^2/4) (1 - u x) tau(e'),      e' = (e_0 + u x e_0 + u (u.e_0))/(1 + u^2),

three equations, by Newton's method with all derivatives. The left side is that of a discrete rigid body without its
denominator: Moser and Veselov's keeps a bracket in its place (`lie_variational`).

*Discrete gradients* on (e, L) are no methods of their own. The energy is quadratic in L and linear in e, for which
Gonzalez's midpoint gradient, the mean gradient and that of Itoh and Abe are all (mgl k, (L_0 + L_1)/2 I1); with the
structure matrix at the midpoint each is the implicit midpoint rule, `gauss-2`.
Sources: Simo, Wong, Int. J. Numer. Methods Eng. 31 (1991) 19; Gonzalez, J. Nonlinear Sci. 6 (1996) 449.
"""

from typing import Any, NamedTuple

from symtop.core.jit import register_jitable
from symtop.methods.framework.registry import Integrator
from symtop.methods.lie_group.loop import SPUN, cayley, gravity, in_charts, inertia, iterated_loop
from symtop.methods.vectors import cross, dot, plus, scaled, solve3

MOST_SWEEPS = 30  # limit on the iterations of a step; 3 or 4 are usual
CONVERGED_CORRECTION = 1e-9  # a correction of u whose square is below rounding, relative to 1 + |u|


class Midpoint(NamedTuple):
    """The parts that a step is composed of."""

    shares: tuple[float, ...] = (1.0,)


@register_jitable
def _column(par: Any, e: Any, u: Any, Ju: Any, mean: Any, pull: Any, quarter: float, d: Any) -> Any:
    """Derivative of the equations along d."""
    Jd, part = inertia(par, e, d), 1.0 / (1.0 + dot(u, u))
    changed = plus(plus(plus(cross(d, e), dot(u, e), d), dot(d, e), u), -2.0 * dot(u, d), mean)
    torque = gravity(par, scaled(part, changed))
    force = plus(plus(torque, -1.0, cross(u, torque)), -1.0, cross(d, pull))
    return plus(plus(plus(Jd, 1.0, cross(d, Ju)), 1.0, cross(u, Jd)), -quarter, force)


@register_jitable
def _mean(e: Any, u: Any) -> Any:
    """The mean of the axis before and after the rotation cay(2 u)."""
    part = 1.0 / (1.0 + dot(u, u))
    return scaled(part, plus(plus(e, 1.0, cross(u, e)), dot(u, e), u))


def _start(par: Any, rule: Any, e: Any, L: Any, carry: Any, h: float) -> Any:
    a = scaled(0.5 * h, L)
    momentum = plus(a, 0.25 * h * h, gravity(par, e))
    along = dot(momentum, e)
    return (*e, *a), plus(scaled(1.0 / par.I1, momentum), along / par.I3 - along / par.I1, e)


def _iterate(par: Any, rule: Any, carry: Any, h: float, fixed: Any, u: Any) -> Any:
    """Newton's next u."""
    e, a, quarter = fixed[:3], fixed[3:], 0.25 * h * h
    mean = _mean(e, u)
    pull, Ju = gravity(par, mean), inertia(par, e, u)
    residual = plus(plus(a, -1.0, Ju), -1.0, cross(u, Ju))
    residual = plus(residual, quarter, plus(pull, -1.0, cross(u, pull)))
    first = _column(par, e, u, Ju, mean, pull, quarter, (1.0, 0.0, 0.0))
    second = _column(par, e, u, Ju, mean, pull, quarter, (0.0, 1.0, 0.0))
    third = _column(par, e, u, Ju, mean, pull, quarter, (0.0, 0.0, 1.0))
    change = solve3(first, second, third, residual)
    u = plus(u, 1.0, change)
    size = abs(change[0]) + abs(change[1]) + abs(change[2])
    return u, size <= CONVERGED_CORRECTION * (1.0 + abs(u[0]) + abs(u[1]) + abs(u[2])), False


def _close(par: Any, rule: Any, carry: Any, h: float, fixed: Any, u: Any) -> Any:
    """The rotation of u, and the change of L."""
    m, v = cayley(u)
    return m, v, scaled(h, gravity(par, _mean(fixed[:3], u))), carry


march = iterated_loop((_start, _iterate, _close), MOST_SWEEPS, opened=6, unknowns=3)


def built_in() -> list[Integrator]:
    """`simo-wong`."""
    return [
        Integrator(
            name="simo-wong", family="lie-group", order=2, explicit=False, symplectic=False, symmetric=True,
            summary="Simo and Wong's midpoint rule on the rotation group: the energy and p_phi exactly",
            conserves=frozenset({"energy", "p_phi", "axis_length"}),
            solvers=in_charts(march, Midpoint(), SPUN, 1, implicit=True),
            reference="simo-wong-1991 gonzalez-1996", needs="group", general=True,
        )
    ]  # fmt: skip
