"""The three charts of the top, maps between them, quantities of their states, and distances that no chart distorts.

    angles    theta, p_theta, phi, psi; p_phi and p_psi are parameters    singular at theta = 0, pi
    axis      e (3), L (3), space frame                                   singular nowhere
    attitude  q (4), L (3), space frame                                   singular nowhere

and `body`, q (4) and M (3) in body axes, of a body without symmetry (`symtop.model.body`).

``q = (w, x, y, z)`` turns body vectors into space vectors, ``q = exp(phi k/2) exp(theta i/2) exp(psi k/2)``:

    q = (cos x cos s, sin x cos d, sin x sin d, cos x sin s),   x = theta/2, s = (phi+psi)/2, d = (phi-psi)/2

and ``e = q k q*``. In the space frame, with n = (cos phi, sin phi, 0) the line of nodes,
``L = I1 theta' n + I1 phi' sin theta (e x n) + I3 w3 e``; then ``p_psi = L.e``, ``p_phi = L_z``,
``p_theta = L.n``, and the energy is ``L^2/2 I1 + p_psi^2 (1/I3 - 1/I1)/2 + mgl e_z``; in angles it is
``p_theta^2/2 I1 + p_psi^2/2 I3 + V(theta)``. `View` reads all of them off states of any chart.
Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, chapter 15.

Distances are the angles of the smallest rotation, accurate for small angles: ``atan2(|a x b|, a.b)`` for
axes, twice that of the quaternions with the nearer sign for attitudes (2 acos has a floor of 1e-8).

`readings`, `axes` and `continuous` are compiled passes over a few hundred states. They do the operations of `View` and
`unwrapped` in their order, to the same bits; until their kernels are loaded they call those.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symtop.model.body import RigidBody, rotated, vertical
from symtop.model.lazy_kernel import LazyKernel
from symtop.model.top import Angles, Momenta, SymmetricTop

Array = NDArray[np.float64]

BODY = "body"  # the chart of a body without symmetry
DIMENSIONS = {"angles": 4, "axis": 6, "attitude": 7, BODY: 7}  # of a state
CHARTS = ("angles", "axis", "attitude")  # of the top


def axis_from_angles(theta: Any, phi: Any) -> Array:
    """Unit vector along the top's axis, shape (..., 3)."""
    return _stacked(axis_parts(np, theta, phi))


def quaternion_from_angles(theta: Any, phi: Any, psi: Any) -> Array:
    """Unit quaternion (w, x, y, z) from body to space, shape (..., 4)."""
    return _stacked(quaternion_parts(np, theta, phi, psi))


def space_state(chart: str, top: SymmetricTop, at: Angles) -> Array:
    """State (e, L) or (q, L) of a start in one of the space-frame charts."""
    place = axis_parts(math, at.theta, at.phi) if chart == "axis" else quaternion_parts(math, at.theta, at.phi, at.psi)
    momentum = momentum_parts(math, top, at.theta, at.phi, at.theta_dot, at.phi_dot, at.psi_dot)
    return np.array((*place, *momentum))


# the formulas themselves, on the functions of NumPy, of `math` for a single state (four times as fast) or of mpmath


def axis_parts(lib: Any, theta: Any, phi: Any) -> tuple[Any, ...]:
    """The axis, by the sine and cosine of a module."""
    sine = lib.sin(theta)
    return sine * lib.sin(phi), -sine * lib.cos(phi), lib.cos(theta)


def quaternion_parts(lib: Any, theta: Any, phi: Any, psi: Any) -> tuple[Any, ...]:
    """The quaternion, by the sine and cosine of a module."""
    half, total, difference = 0.5 * theta, 0.5 * (phi + psi), 0.5 * (phi - psi)
    cosine, sine = lib.cos(half), lib.sin(half)
    return cosine * lib.cos(total), sine * lib.cos(difference), sine * lib.sin(difference), cosine * lib.sin(total)


def momentum_parts(
    lib: Any, top: SymmetricTop, theta: Any, phi: Any, theta_dot: Any, phi_dot: Any, psi_dot: Any
) -> tuple[Any, ...]:
    """The angular momentum, its three terms along n, e x n and e, by the sine and cosine of a module."""
    s, c, sin_phi, cos_phi = lib.sin(theta), lib.cos(theta), lib.sin(phi), lib.cos(phi)
    nod, swing, spin = top.I1 * theta_dot, top.I1 * phi_dot * s, top.I3 * (psi_dot + phi_dot * c)
    across = spin * s - swing * c
    return nod * cos_phi + across * sin_phi, nod * sin_phi - across * cos_phi, swing * s + spin * c


def _stacked(components: tuple[Any, ...]) -> Array:
    return np.stack(np.broadcast_arrays(*components), axis=-1)


def _parts(quaternions: Array) -> tuple[Array, Array, Array, Array]:
    return quaternions[..., 0], quaternions[..., 1], quaternions[..., 2], quaternions[..., 3]


def axis_from_quaternion(quaternion: Array) -> Array:
    """The third column of the rotation matrix, shape (..., 3)."""
    w, x, y, z = _parts(quaternion)
    right, back = x * z + w * y, y * z - w * x  # doubled by addition: quadruple precision has no 2.0
    axis = np.empty((*np.shape(x), 3), np.result_type(x))  # faster than np.stack
    axis[..., 0], axis[..., 1], axis[..., 2] = right + right, back + back, w * w - x * x - y * y + z * z
    return axis


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
    the *error* has to change by less than half a turn from sample to sample.
    """
    lag = angle - guide
    step = lag[..., 1:] - lag[..., :-1]
    jumps = np.nonzero(~(np.abs(step) < np.pi))  # NaN is one, too
    if jumps[0].size:  # the arithmetic of `np.unwrap`, for the few steps that jump: a third of the time
        jump = step[jumps]
        remainder = np.mod(jump + np.pi, 2.0 * np.pi) - np.pi
        remainder[(remainder == -np.pi) & (jump > 0.0)] = np.pi
        step[...] = 0.0
        step[jumps] = remainder - jump
        lag[..., 1:] += step.cumsum(axis=-1)
    return guide + (lag - 2.0 * np.pi * np.rint(lag[..., :1] / (2.0 * np.pi)))


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
    (a, b, c), (x, y, z), (u, v, w) = ((part[..., 0], part[..., 1], part[..., 2]) for part in (first, second, gap))
    # by components, several times as fast as `np.cross` and sums of three for the few hundred axes of a guard
    cross = v * z - w * y, w * x - u * z, u * y - v * x
    sine = np.sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2])
    return np.arctan2(sine, a * x + b * y + c * z)


def attitude_distance(first: Array, second: Array, low: Array | float = 0.0) -> Array:
    """Angle of the rotation between two orientations in radians, shape (...), to 1e-16 however small.

    `second` is of length one and may have a low half; `first` may be of any length, which does not change the angle.
    """
    cosine = np.sum(first * second, axis=-1, keepdims=True)  # of half the angle, times the length of `first`
    sign = np.where(cosine < 0.0, -1.0, 1.0)
    gap = (first - sign * second) - sign * low
    across = gap - np.sum(gap * second, axis=-1, keepdims=True) * second
    return np.asarray(2.0 * np.arctan2(np.sqrt(np.sum(across * across, axis=-1)), np.abs(cosine[..., 0])))


def space_energy(top: SymmetricTop, axis: Any, momentum: Any, p_psi: Any) -> Any:
    """Energy of space-frame states: |L|^2/2 I1 + p_psi^2 (1/I3 - 1/I1)/2 + mgl e_z; axis and momentum (..., 3)."""
    x, y, z = momentum[..., 0], momentum[..., 1], momentum[..., 2]
    turning = (x * x + y * y + z * z) / (2.0 * top.I1)
    return turning + 0.5 * p_psi**2 * (1.0 / top.I3 - 1.0 / top.I1) + top.mgl * axis[..., 2]


def body_energy(body: RigidBody, states: Any) -> Any:
    """Energy M.omega/2 + c.Gamma of states (..., 7) of the chart `body`."""
    kinetic = 0.5 * (states[..., 4:] ** 2 / np.array(body.moments)).sum(axis=-1)
    return kinetic + sum(c * g for c, g in zip(body.torque, vertical(*_parts(states)), strict=True))


def axis_of(chart: str, states: Any) -> Any:
    """Unit vectors (..., 3) along the top's axis, of states (..., dimension) in any precision."""
    if chart == "angles":
        return axis_from_angles(states[..., 0], states[..., 2])
    return states[..., :3] if chart == "axis" else axis_from_quaternion(states[..., :4])


def lifted(states: Any) -> Any:
    """L in the space frame, (..., 3), of states (..., 7) of the chart `body`."""
    return rotated(states[..., :4], states[..., 4:])


def space_momenta(chart: str, states: Any) -> tuple[Any, Any]:
    """p_phi = L_z and p_psi = L.e, read off states (..., 6 or 7) of a space-frame chart in their own precision."""
    momentum = states[..., -3:]
    return momentum[..., 2].copy(), (momentum * axis_of(chart, states)).sum(axis=-1)


@dataclass(frozen=True, eq=False)
class View:
    """States of one chart, shape (..., dimension), with the momenta p_phi and p_psi that the run returned, shape (...).

    The momenta enter the energy only. Angles are unbounded in `angles`, and modulo a turn elsewhere (`unwrapped`).
    All quantities have the shape (...), or (..., 3) and (..., 4) for vectors and quaternions.
    """

    chart: str
    top: Any  # SymmetricTop; of the chart body a RigidBody
    states: Any
    p_phi: Any = None
    p_psi: Any = None

    @cached_property
    def axis(self) -> Any:
        """Unit vector along the top's axis."""
        return axis_of(self.chart, self.states)

    @cached_property
    def quaternion(self) -> Any:
        """Unit quaternion from body to space; None on the axis, which does not show the spin angle."""
        if self.chart == "angles":
            return quaternion_from_angles(self.theta, self.phi, self.psi)
        return self.states[..., :4] if self.chart in ("attitude", BODY) else None

    @cached_property
    def momentum(self) -> Any:
        """Angular momentum in the space frame; not for the chart `angles`, whose states do not hold it."""
        return lifted(self.states) if self.chart == BODY else self.states[..., -3:]

    @cached_property
    def _angles(self) -> tuple[Any, Any, Any]:
        return angles_from_quaternion(self.quaternion)

    @cached_property
    def theta(self) -> Any:
        """Inclination, rad."""
        if self.chart == "angles":
            return self.states[..., 0]
        return theta_from_axis(self.axis) if self.chart == "axis" else self._angles[0]

    @cached_property
    def phi(self) -> Any:
        """Precession angle, rad."""
        if self.chart == "angles":
            return self.states[..., 2]
        return phi_from_axis(self.axis) if self.chart == "axis" else self._angles[1]

    @property
    def psi(self) -> Any:
        """Spin angle, rad; None on the axis."""
        if self.chart == "angles":
            return self.states[..., 3]
        return None if self.chart == "axis" else self._angles[2]

    @cached_property
    def p_theta(self) -> Any:
        """Momentum of the nutation, I1 theta'."""
        if self.chart == "angles":
            return self.states[..., 1]
        return self.momentum[..., 0] * np.cos(self.phi) + self.momentum[..., 1] * np.sin(self.phi)

    @cached_property
    def energy(self) -> Any:
        """Total energy, with the momenta that the run returned."""
        if self.chart == "angles":
            return self.top.reduced_energy(self.theta, self.p_theta, self.p_phi, self.p_psi)
        if self.chart == BODY:
            return body_energy(self.top, self.states)
        return space_energy(self.top, self.axis, self.momentum, self.p_psi)

    def nutation_energy(self, momenta: Momenta) -> Any:
        """The energy less the parts that the constant momenta fix; `momenta` are those of the start.

        Next to a pole it keeps the digits that `energy` loses in p_phi - p_psi.
        """
        if self.chart == "angles":
            return self.p_theta * self.p_theta / (2.0 * self.top.I1) + self.top.potential(self.theta, momenta)
        return space_energy(self.top, self.axis, self.momentum, 0.0)


READING_SECONDS = 2e-5  # by which NumPy takes longer than the compiled function
_NONE, _NO_ROOM = np.empty(0), np.empty((2, 0))


def _read(
    states: Any, p_psi: Any, cosine: Any, sine: Any, twice_I1: float, excess: float, mgl: float, axis: Any, out: Any
) -> None:
    """Fill in axes (n, 3), and energies and p_theta in the two rows of `out` unless empty; states (n, 6 or 7)."""
    width = states.shape[1]
    for i in range(len(states)):
        if width == 7:
            w, x, y, z = states[i, 0], states[i, 1], states[i, 2], states[i, 3]
            right, back = x * z + w * y, y * z - w * x
            axis[i, 0], axis[i, 1], axis[i, 2] = right + right, back + back, w * w - x * x - y * y + z * z
        else:
            axis[i, 0], axis[i, 1], axis[i, 2] = states[i, 0], states[i, 1], states[i, 2]
        if out.shape[1] == 0:
            continue
        a, b, c = states[i, width - 3], states[i, width - 2], states[i, width - 1]
        out[0, i] = (a * a + b * b + c * c) / twice_I1 + 0.5 * (p_psi[i] * p_psi[i]) * excess + mgl * axis[i, 2]
        out[1, i] = a * cosine[i] + b * sine[i]


_reader = LazyKernel(
    _read,
    "(float64[:, ::1], float64[::1], float64[::1], float64[::1], float64, float64, float64, float64[:, ::1], "
    "float64[:, ::1])",
    patience=1.5,
)


def _compilable(*arrays: Array) -> bool:
    """Are these what a compiled function takes: doubles in a row, which may be written to?"""
    return all(array.dtype == np.float64 and array.flags.carray for array in arrays)


def axes(chart: str, states: Array) -> Array:
    """Unit vectors (n, 3) along the top's axis, of states (n, dimension)."""
    if chart != "attitude" or not _compilable(states) or not _reader.ready(READING_SECONDS / 3.0):
        return np.asarray(axis_of(chart, states))
    axis = np.empty((len(states), 3))
    _reader.compiled(states, _NONE, _NONE, _NONE, 1.0, 0.0, 0.0, axis, _NO_ROOM)
    return axis


def readings(view: View) -> tuple[Array, Array, Array]:
    """Axis (n, 3), energy (n,) and p_theta (n,) of a view of states (n, dimension) in doubles."""
    if view.chart == "angles" or not _compilable(view.states) or not _reader.ready(READING_SECONDS):
        return view.axis, view.energy, view.p_theta
    top, count = view.top, len(view.states)
    axis, out = np.empty((count, 3)), np.empty((2, count))
    excess = 1.0 / top.I3 - 1.0 / top.I1
    _reader.compiled(
        view.states, np.array(view.p_psi), np.cos(view.phi), np.sin(view.phi), 2.0 * top.I1, excess, top.mgl, axis, out
    )
    return axis, out[0], out[1]


HALF, TURN = math.pi, 2.0 * math.pi
UNWRAP_SECONDS = 1e-5  # by which NumPy takes longer than the compiled function, for a row


def _unwrap(angles: Any, guides: Any, out: Any) -> None:
    for j in range(len(angles)):
        first = angles[j, 0] - guides[j, 0]
        turns = TURN * np.rint(first / TURN)
        out[j, 0] = guides[j, 0] + (first - turns)
        before, shift = first, 0.0
        for i in range(1, angles.shape[1]):
            lag = angles[j, i] - guides[j, i]
            step = lag - before
            if not abs(step) < HALF:  # NaN is one, too
                remainder = (step + HALF) % TURN - HALF
                if remainder == -HALF and step > 0.0:
                    remainder = HALF
                shift += remainder - step
            before = lag
            out[j, i] = guides[j, i] + ((lag + shift) - turns)


_unwrapper = LazyKernel(_unwrap, "(float64[:, ::1], float64[:, ::1], float64[:, ::1])", patience=1.0)


def continuous(angles: Array, guides: Array) -> Array:
    """Continuous angles (rows, n), n > 0, from samples of them modulo a turn, beside guides of their shape; rad."""
    if angles.dtype != np.float64 or not _unwrapper.ready(UNWRAP_SECONDS * len(angles)):
        return unwrapped(angles, guides)
    out = np.empty(angles.shape)
    _unwrapper.compiled(angles, guides, out)
    return out
