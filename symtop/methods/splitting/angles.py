"""Splitting in the angles chart, where the reduced Hamiltonian separates.

    H = p_theta^2/2 I1 + V(theta; p_phi, p_psi) + p_psi^2/2 I3
    kick(b h):   p_theta -= b h V',  phi += b h phi'(theta),  psi += b h psi'(theta)     (flow of V, theta fixed)
    drift(a h):  theta += a h p_theta / I1                                               (flow of p_theta^2/2 I1)

phi and psi move in the kick because V depends on p_phi and p_psi. Explicit, symplectic, keeps both momenta exactly,
one sine and one cosine a force. Kick-drift-kick with (1/2, 1, 1/2) is Stormer-Verlet: order 2, stable for h omega < 2.
It is not the trapezoidal discrete Lagrangian, which is implicit, and not the splitting on the attitude, whose drift is
the exact free top (`splitting.space`): here the centrifugal potential is in the kick, and it is singular at both poles.
Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, sections I.1.4 and II.5.
"""

from typing import Any

import numpy as np

from symtop.core.jit import register_jitable
from symtop.core.sines import sincos
from symtop.methods.framework.angles import ReducedTop, chart_outcome, momenta_of_turns
from symtop.methods.framework.loop import Loop
from symtop.methods.framework.plan import Array
from symtop.methods.splitting.loop import compose, composed, stages
from symtop.model.charts import View
from symtop.model.top import Momenta, half_angle_force


@register_jitable
def force_angles(par: Any, state: Any, step: Any) -> Any:
    """V', phi' and phi' cos(theta) at the present theta."""
    sin_x, cos_x = sincos(0.5 * (state[0] + step[0]))
    slope, precession, cosine = half_angle_force(sin_x, cos_x, par.north, par.south, par.I1, par.mgl)
    return slope, precession, precession * cosine


@register_jitable
def kick_angles(par: Any, force: Any, step: Any, tau: float, bend: float) -> Any:
    """Flow of the potential for a time tau."""
    slope, precession, turn = force
    return (step[0], step[1] - tau * slope, step[2] + tau * precession, step[3] + tau * (par.p_psi / par.I3 - turn))


@register_jitable
def drift_angles(par: Any, rule: Any, state: Any, step: Any, tau: float) -> Any:
    """Free flight for a time I1 tau."""
    return (step[0] + tau * (state[1] + step[1]), step[1], step[2], step[3])


def scale(rule: Any, top: Any, at: Any, h: float) -> Any:
    """Kicks in time, drifts in time over I1."""
    return stages(rule, h / top.I1, h, 0.0, 0.0)


def _begin(par: Any, rule: Any, state: Any, h: float) -> Any:
    return force_angles(par, state, (0.0, 0.0, 0.0, 0.0))


def _increment(par: Any, rule: Any, state: Any, carry: Any, h: float) -> Any:
    """The work counted is the number of force evaluations."""
    step, force = compose(force_angles, kick_angles, drift_angles, par, rule, state, carry)
    return step, force, rule.forces, chart_outcome(state[0] + step[0])


def observe(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """p_phi and p_psi from the increments of phi and psi in the kicks."""
    step = (0.0, 0.0, 0.0, 0.0)
    a = d = 0.0
    n = len(rule.drift)
    for i in range(n + 1):
        theta = before[0] + step[0]
        sin_x, cos_x = sincos(0.5 * theta)
        a += rule.kick[i] / (4.0 * par.I1 * sin_x * sin_x)
        d += rule.kick[i] / (4.0 * par.I1 * cos_x * cos_x)
        if i < n:
            step = kick_angles(par, force_angles(par, before, step), step, rule.kick[i], 0.0)
            step = drift_angles(par, rule, before, step, rule.drift[i])
    return momenta_of_turns(par, a, d, h, dstate)


_LANES = composed(
    force_angles, kick_angles, lambda par, state, step, tau: (drift_angles(par, None, state, step, tau), True),
    lambda state, step: chart_outcome(state[0] + step[0]), top=ReducedTop, dimension=4, carry=3,
)  # fmt: skip
march = Loop(_begin, _increment, observe, lanes=lambda _: _LANES)


def verlet_energy(view: View, momenta: Momenta, h: float) -> Array:
    """Verlet's energy to O(h^4), less E: h^2 (p^2 V''/12 I1^2 - V'^2/24 I1) (Hairer, Lubich, Wanner, IX.3)."""
    top, p = view.top, view.p_theta
    slope = top.potential_slope(view.theta, momenta)
    bend = (p / top.I1) ** 2 * top.potential_curvature(view.theta, momenta)
    return np.asarray(h * h * (bend / 12 - slope**2 / (24 * top.I1)))
