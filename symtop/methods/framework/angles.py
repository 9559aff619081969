"""The two charts in angles for kernels. Both are singular at theta = 0 and pi.

*Reduced*: state (theta, p_theta, phi, psi). p_phi and p_psi enter as parameters, so every kernel of this chart must
recompute them from the increments that it produced (`observe` in `loop`).

*Unreduced*: state (theta, phi, psi, theta', phi', psi'), nothing eliminated; the Euler-Lagrange equations, solved for
the accelerations:

    theta'' = sin(theta) [phi' (I1 phi' cos(theta) - I3 w3) + mgl] / I1,     w3 = psi' + phi' cos(theta)
    phi''   = theta' (I3 w3 - 2 I1 phi' cos(theta)) / (I1 sin(theta))
    psi''   = theta' phi' sin(theta) - phi'' cos(theta)

Energy, p_phi and p_psi are functions of this state, so that a drift shows. Source: Goldstein, Classical Mechanics, 5.7.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from symtop.core.errors import SymtopError
from symtop.core.jit import register_jitable
from symtop.core.sines import sincos
from symtop.methods.framework.plan import LEFT_CHART, NOT_FINITE, OK
from symtop.methods.framework.preparation import BareTop, Preparation, Presentation, conserved


class ReducedTop(NamedTuple):
    """The top and its conserved momenta."""

    I1: float
    I3: float
    mgl: float
    p_psi: float
    north: float  # p_phi - p_psi
    south: float  # p_phi + p_psi


@register_jitable
def chart_outcome(theta: float) -> int:
    """OK if theta lies inside (0, pi), otherwise LEFT_CHART or NOT_FINITE."""
    if 0.0 < theta < np.pi:
        return OK
    if np.isfinite(theta):
        return LEFT_CHART
    return NOT_FINITE


def in_chart(theta: Any) -> Any:
    """Does theta, a number or an array, lie inside (0, pi)? At the poles only phi + psi or phi - psi is defined."""
    return (theta > 0.0) & (theta < np.pi)


def require_chart(at: Any) -> None:
    """Refuse a start on a pole: raises SymtopError."""
    if not in_chart(at.theta):
        words = f"in the angles chart, not {at.theta!r}; one in the axis chart, NAME[axis], may start at a pole"
        raise SymtopError(f"theta must lie inside (0, pi) for an integrator {words}")


@register_jitable
def momenta_of_turns(par: Any, a: Any, d: Any, h: float, dstate: Any) -> Any:
    """p_phi and p_psi of the increments of phi and psi in a step, which are linear in them.

    With x = theta/2 where the force is evaluated, for a time b h each, a = sum b h/(4 I1 sin^2 x),
    d = sum b h/(4 I1 cos^2 x) and k = h (1/I3 - 1/I1)/2:
    dphi + dpsi = (k + 2d) south - k north,  dphi - dpsi = (k + 2a) north - k south.
    """
    k = 0.5 * h * (1.0 / par.I3 - 1.0 / par.I1)
    plus, minus = dstate[2] + dstate[3], dstate[2] - dstate[3]
    determinant = 2.0 * k * (a + d) + 4.0 * a * d
    north = ((k + 2.0 * d) * minus + k * plus) / determinant
    south = ((k + 2.0 * a) * plus + k * minus) / determinant
    return 0.5 * (north + south), 0.5 * (south - north)


def _prepare_angles(top: Any, at: Any) -> Any:
    """The discrete Legendre transform starts from p_theta = dL/dtheta'."""
    momenta = conserved(top, at)
    par = ReducedTop(top.I1, top.I3, top.mgl, momenta.p_psi, momenta.north, momenta.south)
    return par, (at.theta, top.I1 * at.theta_dot, at.phi, at.psi)


on_angles = Preparation(_prepare_angles, 4, require_chart)
LEAST_TOLERANCE = 2.3e-14  # of an adaptive method: 100 eps, SciPy's limit


@register_jitable
def accelerations(I1: Any, I3: Any, mgl: Any, theta: Any, theta_dot: Any, phi_dot: Any, psi_dot: Any) -> Any:
    """theta'', phi'' and psi'' of floats; NaN exactly at a pole. Runs in Python and compiles unchanged."""
    s, c = sincos(theta)
    if s == 0.0:  # the interpreter would raise at the division and end the run
        s = math.nan
    spin = I3 * (psi_dot + phi_dot * c)
    theta_ddot = s * (phi_dot * (I1 * phi_dot * c - spin) + mgl) / I1
    phi_ddot = theta_dot * (spin - 2.0 * I1 * phi_dot * c) / (I1 * s)
    return theta_ddot, phi_ddot, theta_dot * phi_dot * s - phi_ddot * c


@register_jitable
def field_angles(par: Any, y: Any) -> Any:
    """Time derivative of the state."""
    theta_ddot, phi_ddot, psi_ddot = accelerations(par.I1, par.I3, par.mgl, y[0], y[3], y[4], y[5])
    return y[3], y[4], y[5], theta_ddot, phi_ddot, psi_ddot


def _prepare_rates(top: Any, at: Any) -> Any:
    state = (at.theta, at.phi, at.psi, at.theta_dot, at.phi_dot, at.psi_dot)
    return BareTop(top.I1, top.I3, top.mgl), state


with_rates = Preparation(_prepare_rates, 6, require_chart)


@register_jitable
def momenta(par: Any, theta: Any, phi_dot: Any, psi_dot: Any) -> Any:
    """p_phi and p_psi of angles and rates, floats or arrays."""
    s, c = sincos(theta)
    p_psi = par.I3 * (psi_dot + phi_dot * c)
    return par.I1 * phi_dot * s * s + p_psi * c, p_psi


def observe_angles(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """p_phi and p_psi of the state after the step."""
    return momenta(par, before[0] + dstate[0], before[4] + dstate[4], before[5] + dstate[5])


@register_jitable
def ended_angles(y: Any) -> int:
    """OK if the state is finite and theta inside (0, pi), otherwise NOT_FINITE or LEFT_CHART."""
    # zero, or NaN where one of them is not finite: added to theta, one test covers all six without a branch
    zero = 0.0 * (y[1] + y[2] + y[3] + y[4] + y[5])
    return chart_outcome(y[0] + zero)


# an unreduced state as (theta, p_theta, phi, psi), the angles chart of `simulate`
to_angles = Presentation(lambda par, _t, y: (y[0], par.I1 * y[3], y[1], y[2]), 4)
