"""What the integrators of physics engines are made of: a rigid body in space axes, and rotations as quaternions.

An engine steps an orientation and the angular velocity w in space, some the angular momentum L. With I_s = I1 + (I3 -
I1) e e^T, the inertia in space,

    I_s w = I1 w + (I3 - I1) (e.w) e,      I_s^-1 L = L/I1 + (1/I3 - 1/I1) (e.L) e,      tau = mgl k x e,

the right sides of Euler's equations need the axis e alone. So every map whose step commutes with a turn of the body
about its axis is one function, on the axis and on the attitude, that returns the rotation of the step as a quaternion p
in space beside the new v, which is w or L:

    step(par, rule, e, v, carry, h) -> (p, v, carry),      e <- p e p*,  q <- p q/|p q|.

Two rotations are in use. With u = h w/2,

    exponential   p = (cos |u|, u sin |u|/|u|)                    the body turns at the rate w for a time h
    linear        p = (1, u)/sqrt(1 + u.u)                        q + h (0, w) q/2, normalised: the Cayley rotation

Every function works in the precision of its arguments: 0, 1/2 and 1 are fields of `EngineTop`, because a literal of
Python would turn an expression in single precision into one in double.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from symtop.core.jit import register_jitable
from symtop.methods.framework.preparation import Body, Preparation
from symtop.methods.framework.space import axis_parts, momentum_parts, quaternion_parts
from symtop.methods.vectors import cross, dot, plus, scaled


class EngineTop(NamedTuple):
    """The numbers of the top in the precision of a map."""

    I1: float
    I3: float
    mgl: float
    zero: float = 0.0
    half: float = 0.5
    one: float = 1.0


@register_jitable
def _numbers(top: Any) -> Any:
    return EngineTop(top.I1, top.I3, top.mgl, 0.0, 0.5, 1.0)


@register_jitable
def _velocity(at: Any) -> Any:
    """The angular velocity in space: the angular momentum of a body whose moments are one."""
    return momentum_parts(math, Body(1.0, 1.0, 0.0), at.theta, at.phi, at.theta_dot, at.phi_dot, at.psi_dot)


def _rates_on_axis(top: Any, at: Any) -> Any:
    """Kernel parameters and state (e, w) of a start."""
    return _numbers(top), (*axis_parts(math, at.theta, at.phi), *_velocity(at))


def _rates_on_attitude(top: Any, at: Any) -> Any:
    """Kernel parameters and state (q, w) of a start."""
    return _numbers(top), (*quaternion_parts(math, at.theta, at.phi, at.psi), *_velocity(at))


@register_jitable
def _momentum(top: Any, at: Any) -> Any:
    return momentum_parts(math, top, at.theta, at.phi, at.theta_dot, at.phi_dot, at.psi_dot)


def _momentum_on_axis(top: Any, at: Any) -> Any:
    """Kernel parameters and state (e, L) of a start."""
    return _numbers(top), (*axis_parts(math, at.theta, at.phi), *_momentum(top, at))


def _momentum_on_attitude(top: Any, at: Any) -> Any:
    """Kernel parameters and state (q, L) of a start."""
    return _numbers(top), (*quaternion_parts(math, at.theta, at.phi, at.psi), *_momentum(top, at))


RATES = {"axis": Preparation(_rates_on_axis, 6), "attitude": Preparation(_rates_on_attitude, 7)}
MOMENTUM = {"axis": Preparation(_momentum_on_axis, 6), "attitude": Preparation(_momentum_on_attitude, 7)}


@register_jitable
def momentum(par: Any, e: Any, w: Any) -> Any:
    """I_s w."""
    return plus(scaled(par.I1, w), (par.I3 - par.I1) * dot(e, w), e)


@register_jitable
def velocity(par: Any, e: Any, L: Any) -> Any:
    """I_s^-1 L."""
    return plus(scaled(par.one / par.I1, L), (par.one / par.I3 - par.one / par.I1) * dot(e, L), e)


@register_jitable
def torque(par: Any, e: Any) -> Any:
    """Gravity about the fixed point."""
    return -par.mgl * e[1], par.mgl * e[0], par.zero


@register_jitable
def acceleration(par: Any, e: Any, w: Any) -> Any:
    """Euler's equations: I_s^-1 (tau - w x I_s w)."""
    return velocity(par, e, plus(torque(par, e), -par.one, cross(w, momentum(par, e, w))))


@register_jitable
def exponential(par: Any, w: Any, h: Any) -> Any:
    """The rotation by h |w| about w."""
    rate = np.sqrt(dot(w, w))
    x = par.half * h * rate
    s = np.sin(x) / rate if rate > 0 else par.half * h
    return np.cos(x), s * w[0], s * w[1], s * w[2]


@register_jitable
def linear(par: Any, w: Any, h: Any) -> Any:
    """The rotation of q + h (0, w) q/2, normalised."""
    u = scaled(par.half * h, w)
    s = par.one / np.sqrt(par.one + dot(u, u))
    return s, s * u[0], s * u[1], s * u[2]


@register_jitable
def normalised(par: Any, q: Any) -> Any:
    """q/|q|."""
    s = par.one / np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return s * q[0], s * q[1], s * q[2], s * q[3]


@register_jitable
def turned(p: Any, v: Any) -> Any:
    """How far the rotation p moves a vector: p v p* - v."""
    u = p[1], p[2], p[3]
    c = cross(u, v)
    d = plus(cross(u, c), p[0], c)
    return d[0] + d[0], d[1] + d[1], d[2] + d[2]  # doubled by addition, in any precision


@register_jitable
def rotated(par: Any, p: Any, v: Any) -> Any:
    """p v p*."""
    return plus(v, par.one, turned(p, v))


@register_jitable
def axis(q: Any) -> Any:
    """The axis of an attitude, the third column of its matrix."""
    x, y = q[1] * q[3] + q[0] * q[2], q[2] * q[3] - q[0] * q[1]
    return x + x, y + y, q[0] * q[0] - q[1] * q[1] - q[2] * q[2] + q[3] * q[3]
