"""Starts from what other programs hold: a quaternion with an angular velocity, or the axis with an angular momentum.

Of the angular velocity w in the body frame, whose third axis is the axis of the top,

    w1 = theta' cos psi + phi' sin theta sin psi          theta'           = w1 cos psi - w2 sin psi
    w2 = phi' sin theta cos psi - theta' sin psi          phi' sin theta   = w1 sin psi + w2 cos psi
    w3 = psi' + phi' cos theta                            psi'             = w3 - phi' cos theta

At a pole phi and psi are not told apart, and the sum or the difference that has a meaning leaves one of them free: psi
is then chosen such that w1 sin psi + w2 cos psi vanishes, so that phi' is zero and the rates hold all of w.
Source: Goldstein, Classical Mechanics, sections 4.4 and 4.9.
"""

import math
from collections.abc import Sequence

from symtop.core.errors import SymtopError, row

Rates = tuple[float, float, float, float, float, float]  # theta, phi, psi and their rates
UNIT = 1e-6  # a quaternion or an axis may differ from unit length by this


def vector(name: str, value: object, size: int) -> list[float]:
    """A row of so many finite numbers."""
    numbers = row(name, value)
    if len(numbers) != size:
        raise SymtopError(f"{name} must be {size} numbers, not {len(numbers)}")
    return numbers


def unit(name: str, value: object, size: int) -> list[float]:
    """A row of numbers of unit length, brought to it exactly."""
    numbers = vector(name, value, size)
    length = math.sqrt(math.fsum(number * number for number in numbers))
    if abs(length - 1.0) > UNIT:
        raise SymtopError(f"{name} must have unit length, not {length:.9g}")
    return [number / length for number in numbers]


def body_frame(quaternion: Sequence[float], space: Sequence[float]) -> list[float]:
    """A vector of the space frame in the body frame: q* v q."""
    w, x, y, z = quaternion
    a, b, c = space
    # v + 2 r x (r x v - w v), r the vector part
    p, q, s = y * c - z * b - w * a, z * a - x * c - w * b, x * b - y * a - w * c
    return [a + 2.0 * (y * s - z * q), b + 2.0 * (z * p - x * s), c + 2.0 * (x * q - y * p)]


def from_body_rates(quaternion: Sequence[float], rates: Sequence[float]) -> Rates:
    """Euler angles and their rates of a unit quaternion (w, x, y, z) and an angular velocity in the body frame."""
    w, x, y, z = quaternion
    theta = 2.0 * math.atan2(math.hypot(x, y), math.hypot(w, z))
    total, difference = 2.0 * math.atan2(z, w), 2.0 * math.atan2(y, x)  # phi + psi and phi - psi
    return _angles(min(theta, math.pi), total, difference, rates)


def from_axis_and_momentum(axis: Sequence[float], momentum: Sequence[float], I1: float, I3: float) -> Rates:
    """Euler angles and their rates of a unit axis and an angular momentum in the space frame, with psi = 0.

    Two axes of the body are e1 = (cos phi, sin phi, 0) and e2 = e x e1 where psi = 0.
    """
    ex, ey, ez = axis
    theta, phi = math.atan2(math.hypot(ex, ey), ez), math.atan2(ex, -ey) if ex or ey else 0.0
    c, s = math.cos(phi), math.sin(phi)
    across = momentum[0] * c + momentum[1] * s
    up = (ex * s - ey * c) * momentum[2] - ez * (momentum[0] * s - momentum[1] * c)  # L . (e x e1)
    along = math.fsum(e * part for e, part in zip(axis, momentum, strict=True))
    return _angles(theta, phi, phi, (across / I1, up / I1, along / I3))


def _angles(theta: float, total: float, difference: float, rates: Sequence[float]) -> Rates:
    """Angles and rates from theta, phi + psi, phi - psi and the body's angular velocity."""
    w1, w2, w3 = rates
    sine = math.sin(theta)
    if theta in (0.0, math.pi) or sine == 0.0:
        psi = -math.atan2(w2, w1)
        phi = total - psi if theta == 0.0 else difference + psi
        return theta, phi, psi, math.hypot(w1, w2), 0.0, w3
    phi, psi = 0.5 * (total + difference), 0.5 * (total - difference)
    c, s = math.cos(psi), math.sin(psi)
    phi_dot = (w1 * s + w2 * c) / sine
    return theta, phi, psi, w1 * c - w2 * s, phi_dot, w3 - phi_dot * math.cos(theta)
