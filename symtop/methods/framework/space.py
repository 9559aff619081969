"""The space-frame charts for kernels: state (e, L) on the axis, (q, L) on the attitude. Nothing is singular.

    e' = L x e / I1,    q' = (L q / I1 + twist q k) / 2,    L' = mgl k x e,    twist = p_psi (1/I3 - 1/I1)

The right-hand side f(q, L) takes p_psi = L.e from the state, with the axis of q/|q| (`on_state`): otherwise an error in
|q| would change the spin. Methods that keep p_psi exactly or to rounding (splittings, maps on the group, Taylor series)
may take the twist of the start for the whole run (`on_attitude`). The attitude has a third form, the frame (e, L, a).
A unit vector a normal to the axis is carried by a' = L x a / I1; the body turns relative to it about e at the
constant rate `twist`, which is applied exactly when a sample is taken. Every equation and every constant of this form
is linear or quadratic, whereas p_psi = L.e(q) is cubic in (q, L), and no Runge-Kutta method keeps it; and the vectors
that are integrated turn as slowly as the axis, not with the spin.

p_phi = L_z and p_psi = L.e are computed from the state, so that a kernel's errors in them are visible.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from symtop.core.jit import register_jitable
from symtop.methods.framework.plan import NOT_FINITE, OK
from symtop.methods.framework.preparation import Preparation, Presentation
from symtop.methods.vectors import cross
from symtop.model import charts

_axis_parts, _quaternion_parts = register_jitable(charts.axis_parts), register_jitable(charts.quaternion_parts)
_momentum_parts = register_jitable(charts.momentum_parts)


class SpaceTop(NamedTuple):
    """The numbers of the top that the space-frame equations need."""

    I1: float
    mgl: float
    twist: float


class AttitudeTop(NamedTuple):
    """The numbers of the top that f of (q, L) needs; `lean` is 1/I3 - 1/I1."""

    I1: float
    mgl: float
    lean: float


@register_jitable
def e_at(at: Any) -> Any:
    """e of a start."""
    return _axis_parts(math, at.theta, at.phi)


@register_jitable
def q_at(at: Any) -> Any:
    """q of a start."""
    return _quaternion_parts(math, at.theta, at.phi, at.psi)


@register_jitable
def L_at(top: Any, at: Any) -> Any:
    """L of a start."""
    return _momentum_parts(math, top, at.theta, at.phi, at.theta_dot, at.phi_dot, at.psi_dot)


@register_jitable
def _parameters(top: Any, at: Any) -> Any:
    spin = top.I3 * (at.psi_dot + at.phi_dot * math.cos(at.theta))
    return SpaceTop(top.I1, top.mgl, spin * (1.0 / top.I3 - 1.0 / top.I1))


@register_jitable
def _prepare_axis(top: Any, at: Any) -> Any:
    return _parameters(top, at), (*e_at(at), *L_at(top, at))


def _prepare_attitude(top: Any, at: Any) -> Any:
    return _parameters(top, at), (*q_at(at), *L_at(top, at))


def _prepare_state(top: Any, at: Any) -> Any:
    return AttitudeTop(top.I1, top.mgl, 1.0 / top.I3 - 1.0 / top.I1), (*q_at(at), *L_at(top, at))


def _prepare_frame(top: Any, at: Any) -> Any:
    """a is the body's first axis."""
    w, x, y, z = q_at(at)
    par, state = _prepare_axis(top, at)
    return par, (*state, w * w + x * x - y * y - z * z, 2.0 * (x * y + w * z), 2.0 * (x * z - w * y))


on_axis, on_attitude = Preparation(_prepare_axis, 6), Preparation(_prepare_attitude, 7)
on_state, on_frame = Preparation(_prepare_state, 7), Preparation(_prepare_frame, 9)


@register_jitable
def _quaternion_rows(e: Any, a: Any, b: Any) -> Any:
    """The rows of 4 q q^T, from the columns of the rotation matrix (Shepperd 1978)."""
    return (
        (1.0 + a[0] + b[1] + e[2], b[2] - e[1], e[0] - a[2], a[1] - b[0]),
        (b[2] - e[1], 1.0 + a[0] - b[1] - e[2], a[1] + b[0], a[2] + e[0]),
        (e[0] - a[2], a[1] + b[0], 1.0 - a[0] + b[1] - e[2], b[2] + e[1]),
        (a[1] - b[0], a[2] + e[0], b[2] + e[1], 1.0 - a[0] - b[1] + e[2]),
    )


def _frame_to_attitude(par: Any, t: float, y: Any) -> Any:
    """A frame state as an attitude state (q, L); the sign of q is arbitrary."""
    e, a = (y[0], y[1], y[2]), (y[6], y[7], y[8])
    rows = _quaternion_rows(e, a, cross(e, a))
    row, diagonal = rows[0], rows[0][0]  # the row with the largest diagonal loses no digits
    for i in range(1, 4):
        if rows[i][i] > diagonal:
            row, diagonal = rows[i], rows[i][i]
    length = math.sqrt(row[0] * row[0] + row[1] * row[1] + row[2] * row[2] + row[3] * row[3])
    q = row[0] / length, row[1] / length, row[2] / length, row[3] / length
    return with_spin(par, (*q, y[3], y[4], y[5]), t)


frame_to_attitude = Presentation(_frame_to_attitude, 7)


@register_jitable
def field_axis(par: Any, y: Any) -> Any:
    """Time derivative of (e, L)."""
    inverse = 1.0 / par.I1  # the compiler moves it out of the loop, unlike three divisions
    wx, wy, wz = inverse * y[3], inverse * y[4], inverse * y[5]
    turn = wy * y[2] - wz * y[1], wz * y[0] - wx * y[2], wx * y[1] - wy * y[0]
    return (*turn, -par.mgl * y[1], par.mgl * y[0], 0.0)


@register_jitable
def field_frame(par: Any, y: Any) -> Any:
    """Time derivative of (e, L, a)."""
    inverse = 1.0 / par.I1
    wx, wy, wz = inverse * y[3], inverse * y[4], inverse * y[5]
    return (*field_axis(par, y), wy * y[8] - wz * y[7], wz * y[6] - wx * y[8], wx * y[7] - wy * y[6])


@register_jitable
def _attitude_rates(par: Any, twist: float, right: float, back: float, y: Any) -> Any:
    half, turn = 0.5 / par.I1, 0.5 * twist
    w, x, y1, z = y[0], y[1], y[2], y[3]
    px, py, pz = half * y[4], half * y[5], half * y[6]
    return (
        -(px * x + py * y1 + pz * z) - turn * z,
        px * w + py * z - pz * y1 + turn * y1,
        py * w + pz * x - px * z - turn * x,
        pz * w + px * y1 - py * x + turn * w,
        -par.mgl * back,
        par.mgl * right,
        0.0,
    )


@register_jitable
def field_attitude(par: Any, y: Any) -> Any:
    """Time derivative of (q, L); |q| stays one only as far as a method keeps it, and nothing else depends on it."""
    w, x, y1, z = y[0], y[1], y[2], y[3]
    inverse = 1.0 / (w * w + x * x + y1 * y1 + z * z)
    right, back, up = axis_of(w, x, y1, z)
    right, back, up = inverse * right, inverse * back, inverse * up
    return _attitude_rates(par, par.lean * (right * y[4] + back * y[5] + up * y[6]), right, back, y)


@register_jitable
def field_twisted(par: Any, y: Any) -> Any:
    """Time derivative of (q, L) for unit quaternions, with the twist of the start."""
    right, back, _ = axis_of(y[0], y[1], y[2], y[3])
    return _attitude_rates(par, par.twist, right, back, y)


@register_jitable
def ended_space(y: Any) -> int:
    """Is the state finite? There is no pole to leave the chart at."""
    total = 0.0
    for value in y:
        total += value
    return finite_outcome(total)


@register_jitable
def finite_outcome(value: float) -> int:
    """Is a number that every component feeds into still finite?"""
    return OK if np.isfinite(value) else NOT_FINITE


def observe_axis(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """p_phi = L_z and p_psi = L.e after the step."""
    p_psi = 0.0
    for i in range(3):
        p_psi += (before[i] + dstate[i]) * (before[3 + i] + dstate[3 + i])
    return before[5] + dstate[5], p_psi


@register_jitable
def axis_of(w: float, x: float, y: float, z: float) -> Any:
    """The axis of a quaternion."""
    right, back = x * z + w * y, y * z - w * x  # doubled by addition, in any precision
    return right + right, back + back, w * w - x * x - y * y + z * z


@register_jitable
def with_spin(par: Any, state: Any, t: float) -> Any:
    """An attitude state (q, L) that was stepped without the turn about the axis at rate `twist`, turned by twist t."""
    w, x, y, z, Lx, Ly, Lz = state
    half = 0.5 * par.twist * t
    c, s = np.cos(half), np.sin(half)
    return w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s, Lx, Ly, Lz


def observe_attitude(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """p_phi = L_z and p_psi = L.e(q) after the step."""
    axis = axis_of(before[0] + dstate[0], before[1] + dstate[1], before[2] + dstate[2], before[3] + dstate[3])
    p_psi = 0.0
    for i in range(3):
        p_psi += axis[i] * (before[4 + i] + dstate[4 + i])
    return before[6] + dstate[6], p_psi
