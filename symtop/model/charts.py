"""The three charts of the top, the maps between them, and distances that no chart can distort.

    angles    theta, p_theta, phi, psi; p_phi and p_psi are parameters    singular at theta = 0, pi
    axis      e (3), L (3), space frame                                   singular nowhere
    attitude  q (4), L (3), space frame                                   singular nowhere

``q = (w, x, y, z)`` turns body vectors into space vectors, ``q = exp(phi k/2) exp(theta i/2) exp(psi k/2)``:

    q = (cos x cos s, sin x cos d, sin x sin d, cos x sin s),   x = theta/2, s = (phi+psi)/2, d = (phi-psi)/2

and ``e = q k q*``. In the space frame, with n = (cos phi, sin phi, 0) the line of nodes,
``L = I1 theta' n + I1 phi' sin theta (e x n) + I3 w3 e``; then ``p_psi = L.e``, ``p_phi = L_z``,
``p_theta = L.n``. Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, chapter 15.

Distances are the angles of the smallest rotation, accurate for small angles: ``atan2(|a x b|, a.b)`` for
axes, ``4 asin(|q - q'|/2)`` with the nearer sign for attitudes (2 acos has a floor of 1e-8).
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symtop.model.top import Angles, SymmetricTop

Array = NDArray[np.float64]

DIMENSIONS = {"angles": 4, "axis": 6, "attitude": 7}  # of a state
CHARTS = tuple(DIMENSIONS)


def axis_from_angles(theta: Any, phi: Any) -> Array:
    """Unit vector along the top's axis, shape (..., 3)."""
    return _stacked(axis_parts(np, theta, phi))


def quaternion_from_angles(theta: Any, phi: Any, psi: Any) -> Array:
    """Unit quaternion (w, x, y, z) from body to space, shape (..., 4)."""
    return _stacked(quaternion_parts(np, theta, phi, psi))


def space_state(chart: str, top: SymmetricTop, at: Angles) -> Array:
    """State (e, L) or (q, L) of a start in one of the space-frame charts."""
    return np.array(space_numbers(chart, top, at))


def space_numbers(chart: str, top: SymmetricTop, at: Angles) -> tuple[float, ...]:
    """The same as plain numbers, for a kernel."""
    place = axis_parts(math, at.theta, at.phi) if chart == "axis" else quaternion_parts(math, at.theta, at.phi, at.psi)
    return *place, *momentum_parts(math, top, at.theta, at.phi, at.theta_dot, at.phi_dot, at.psi_dot)


# the formulas themselves, on the functions of `math` for a single state (2 us, and 9 us on those of NumPy) or of mpmath


def axis_parts(of: Any, theta: Any, phi: Any) -> tuple[Any, ...]:
    """The axis, by the sine and cosine of a module."""
    sine = of.sin(theta)
    return sine * of.sin(phi), -sine * of.cos(phi), of.cos(theta)


def quaternion_parts(of: Any, theta: Any, phi: Any, psi: Any) -> tuple[Any, ...]:
    """The quaternion, by the sine and cosine of a module."""
    half, total, difference = 0.5 * theta, 0.5 * (phi + psi), 0.5 * (phi - psi)
    cosine, sine = of.cos(half), of.sin(half)
    return cosine * of.cos(total), sine * of.cos(difference), sine * of.sin(difference), cosine * of.sin(total)


def momentum_parts(
    of: Any, top: SymmetricTop, theta: Any, phi: Any, theta_dot: Any, phi_dot: Any, psi_dot: Any
) -> tuple[Any, ...]:
    """The angular momentum, its three terms along n, e x n and e, by the sine and cosine of a module."""
    s, c, sin_phi, cos_phi = of.sin(theta), of.cos(theta), of.sin(phi), of.cos(phi)
    nod, swing, spin = top.I1 * theta_dot, top.I1 * phi_dot * s, top.I3 * (psi_dot + phi_dot * c)
    across = spin * s - swing * c
    return nod * cos_phi + across * sin_phi, nod * sin_phi - across * cos_phi, swing * s + spin * c


def _stacked(components: tuple[Any, ...]) -> Array:
    return np.stack(np.broadcast_arrays(*components), axis=-1)


def _components(vectors: Array) -> tuple[Array, Array, Array]:
    """x, y and z of vectors (..., 3); `np.moveaxis` takes 3 us for the same."""
    return vectors[..., 0], vectors[..., 1], vectors[..., 2]


def _parts(quaternions: Array) -> tuple[Array, Array, Array, Array]:
    """w, x, y and z of quaternions (..., 4)."""
    return quaternions[..., 0], quaternions[..., 1], quaternions[..., 2], quaternions[..., 3]


def _vectors(x: Array, y: Array, z: Array) -> Array:
    """Vectors (..., 3) of their components; `np.stack` takes 4 us more."""
    vectors: Array = np.empty((*np.shape(x), 3), np.result_type(x))
    vectors[..., 0], vectors[..., 1], vectors[..., 2] = x, y, z
    return vectors


def axis_from_quaternion(quaternion: Array) -> Array:
    """The third column of the rotation matrix, shape (..., 3)."""
    w, x, y, z = _parts(quaternion)
    right, back = x * z + w * y, y * z - w * x  # doubled by addition: quadruple precision has no 2.0
    return _vectors(right + right, back + back, w * w - x * x - y * y + z * z)


def transverse_from_quaternion(quaternion: Array) -> Array:
    """The first column of the rotation matrix, a body-fixed axis across the top's, shape (..., 3)."""
    w, x, y, z = _parts(quaternion)
    return _vectors(w * w + x * x - y * y - z * z, 2.0 * (x * y + w * z), 2.0 * (x * z - w * y))


def theta_from_axis(axis: Array) -> Array:
    """Inclination in [0, pi], accurate at both poles and for axes that are not quite of length one."""
    return np.arctan2(np.sqrt(axis[..., 0] ** 2 + axis[..., 1] ** 2), axis[..., 2])


def phi_from_axis(axis: Array) -> Array:
    """Precession angle in (-pi, pi]; undefined (zero) at a pole."""
    return np.arctan2(axis[..., 0], -axis[..., 1])


def angles_from_quaternion(quaternion: Array) -> tuple[Array, Array, Array]:
    """theta in [0, pi], phi and psi modulo 2 pi. At a pole only phi + psi (or phi - psi) has meaning."""
    w, x, y, z = _parts(quaternion)
    half = np.arctan2(np.sqrt(x * x + y * y), np.sqrt(w * w + z * z))
    total, difference = np.arctan2(z, w), np.arctan2(y, x)
    return half + half, total + difference, total - difference


def unwrapped(angle: Array, guide: Array) -> Array:
    """Continuous angles from samples of them modulo 2 pi; both have the shape (..., n), a run along the last dimension.

    Between neighbouring samples the angle may turn many times: `guide`, the true motion, says how often, so that only
    the *error* has to change by less than half a turn from sample to sample. It may grow to any size over the run.
    """
    lag = angle - guide
    step = lag[..., 1:] - lag[..., :-1]
    jumps = np.nonzero(~(np.abs(step) < np.pi))  # NaN is one, too
    if jumps[0].size:  # the arithmetic of `np.unwrap`, for the few steps that jump: half the time
        jump = step[jumps]
        rest = np.mod(jump + np.pi, 2.0 * np.pi) - np.pi
        rest[(rest == -np.pi) & (jump > 0.0)] = np.pi
        step[...] = 0.0
        step[jumps] = rest - jump
        lag[..., 1:] += step.cumsum(axis=-1)
    whole: Array = guide + (lag - 2.0 * np.pi * np.rint(lag[..., :1] / (2.0 * np.pi)))
    return whole


def rates_from_momentum(top: SymmetricTop, axis: Array, phi: Any, momentum: Array) -> tuple[Any, Any, Any]:
    """theta', phi', psi' of states given by axis, precession angle and space-frame L; not at a pole."""
    node = np.stack([np.cos(phi), np.sin(phi), 0.0 * np.asarray(phi)], axis=-1)
    sine_squared = axis[..., 0] ** 2 + axis[..., 1] ** 2
    p_psi = np.sum(momentum * axis, axis=-1)
    theta_dot = np.sum(momentum * node, axis=-1) / top.I1
    # L_z - p_psi e_z = L_h.(horizontal part) - needs no difference of large numbers near a pole
    horizontal = momentum[..., 0] * axis[..., 0] + momentum[..., 1] * axis[..., 1]
    phi_dot = (momentum[..., 2] - axis[..., 2] * horizontal / sine_squared) / top.I1
    return theta_dot, phi_dot, p_psi / top.I3 - phi_dot * axis[..., 2]


def angles_from_attitude(top: SymmetricTop, state: Array) -> Angles:
    """Angles and rates of an attitude state; phi and psi modulo 2 pi, not at a pole."""
    quaternion, momentum = state[:4], state[4:]
    theta, phi, psi = angles_from_quaternion(quaternion)
    rates = rates_from_momentum(top, axis_from_quaternion(quaternion), phi, momentum)
    return Angles(*(float(value) for value in (theta, phi, psi, *rates)))


def axis_distance(first: Array, second: Array, low: Array | float = 0.0) -> Array:
    """Angle between two axes in radians, shape (...), to 1e-16 however small; `second` may have a low half."""
    gap = (first - second) - low  # exact before the low half where the two are close; a x b = (a - b) x b
    (a, b, c), (x, y, z), (u, v, w) = (_components(part) for part in (first, second, gap))
    # by components: `np.cross` and sums of three take 25 us more for 300 axes, and the guard compares so many
    cross = v * z - w * y, w * x - u * z, u * y - v * x
    sine = np.sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2])
    angle: Array = np.arctan2(sine, a * x + b * y + c * z)
    return angle


def attitude_distance(first: Array, second: Array, low: Array | float = 0.0) -> Array:
    """Angle of the rotation between two orientations in radians, shape (...); `second` may have a low half."""
    sign = np.where(np.sum(first * second, axis=-1, keepdims=True) < 0.0, -1.0, 1.0)
    gap = np.sqrt(np.sum(((first - sign * second) - sign * low) ** 2, axis=-1))
    angle: Array = 4.0 * np.arcsin(np.minimum(1.0, 0.5 * gap))
    return angle
