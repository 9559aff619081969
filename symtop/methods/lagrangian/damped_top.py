"""The damped top: forced discrete Euler-Lagrange equations with a viscous torque on precession and on spin.

    F_phi = -c_phi phi',    F_psi = -c_psi psi'        (two bearings of a gimbal; power -c_phi phi'^2 - c_psi psi'^2)

With the discrete Lagrangian of `unreduced` and the forces F_d^- = h sum w (1-a) F, F_d^+ = h sum w a F by virtual work,
a symmetric rule gives, with the mean rates (w, v, u) = (dtheta, dphi, dpsi)/h and the sums l, m over its nodes,

    p_phi0 = -D1 L_d - F_d^- = sum w l + (h/2) c_phi v,    p_phi1 = D2 L_d + F_d^+ = sum w l - (h/2) c_phi v

and psi likewise, so that the momenta are not conserved but balanced, p_phi1 - p_phi0 = -c_phi (phi1 - phi0) exactly:
the motion itself has the same invariants p_phi + c_phi phi and p_psi + c_psi psi, and the discrete one keeps them to
rounding. Order 2. The kernel is that of `unreduced`. Not in the registry, whose methods step the free top.

The motion has no closed form; its reference is computed by DOP853 at tolerance 1e-13, from the four equations that
remain when both momenta are eliminated by their balance.
Source: Marsden and West, Acta Numerica 10 (2001) 357, part three.
"""

import itertools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

from symtop.core.errors import SymtopError
from symtop.methods.framework.lanes import Ints
from symtop.methods.framework.loop import March
from symtop.methods.lagrangian.discrete_lagrangian import RULES, quadrature
from symtop.methods.lagrangian.unreduced import march, with_momenta
from symtop.methods.library.scipy_ivp import integrated
from symtop.model.charts import Array
from symtop.model.scenes import Scene

NEAR_POLE = 0.01  # rad from a pole, nearer to which the friction of precession, rate c_phi/(I1 sin^2 theta), is stiff
Rates = Callable[[float, Any], tuple[float, ...]]


class Friction(NamedTuple):
    """Viscous coefficients of the two bearings, torque per rate."""

    precession: float
    spin: float


def damped_run(scene: Scene, friction: Friction, rule: str, h: float, marks: Ints) -> March:
    """States (theta, phi, psi, p_theta, p_phi, p_psi) after the numbers of steps in `marks`, shape (samples, 6).

    `rule` is a name of `discrete_lagrangian.RULES`. SymtopError for a start at a pole.
    """
    top, state = with_momenta(scene.top, scene.start)
    damped = top._replace(c_phi=friction.precession, c_psi=friction.spin)
    return march(damped, quadrature(*RULES[rule][:2])[0], state, h, marks)


def four_equations(scene: Scene, friction: Friction) -> tuple[Rates, tuple[float, ...]]:
    """y' for y = (theta, phi, psi, p_theta), the momenta p = p0 - c (angle - angle0) eliminated, and y at the start."""
    top, start = scene.top, scene.start
    momenta = top.momenta(start)

    def rates(_: float, y: Any) -> tuple[float, ...]:
        theta, phi, psi, p_theta = y
        p_phi = momenta.p_phi - friction.precession * (phi - start.phi)
        p_psi = momenta.p_psi - friction.spin * (psi - start.psi)
        s, c = math.sin(theta), math.cos(theta)
        turn = (p_phi - p_psi * c) / (top.I1 * s * s)
        return p_theta / top.I1, turn, p_psi / top.I3 - turn * c, s * (turn * (top.I1 * turn * c - p_psi) + top.mgl)

    return rates, (start.theta, start.phi, start.psi, top.I1 * start.theta_dot)


def _near_pole(_: float, y: Any) -> float:
    """An event function for `solve_ivp`: becomes negative where the axis comes within `NEAR_POLE` of a pole."""
    return math.sin(y[0]) - math.sin(NEAR_POLE)


_near_pole.terminal, _near_pole.direction = True, -1.0  # type: ignore[attr-defined]


def theta_before_pole(scene: Scene, friction: Friction, times: Array, limit: int) -> Array:
    """Theta (rad), to 1e-13, until the axis is within `NEAR_POLE` of a pole; SymtopError beyond `limit` evaluations."""
    (rates, start), count = four_equations(scene, friction), itertools.count(1)

    def limited_rates(t: float, y: Any) -> tuple[float, ...]:
        if next(count) > limit:
            raise SymtopError(f"the damped top takes more than {limit} evaluations: DOP853 is at t = {t:.3g} s")
        return rates(t, y)

    return integrated(limited_rates, start, times, "DOP853", 1e-13, _near_pole)[0]  # type: ignore[no-any-return]
