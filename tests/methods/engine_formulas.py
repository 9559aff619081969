"""The maps of engines once more, as their sources write them: matrices in body axes and general linear solves.

Nothing here knows of a symmetric body or of the axis. ``step(attitude, w, h, inertia, tau) -> (attitude, w)`` with
SciPy's `Rotation` from body to space, w in space, the matrix of inertia in body axes and tau(attitude) in space.
"""

from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation


def hat(v):
    """The matrix of v x."""
    return np.cross(np.eye(3), v)


def _moved(attitude, w, h):
    """q + h (0, w) q/2, normalised."""
    return Rotation.from_quat(np.append(0.5 * h * w, 1.0)) * attitude


def _exp(attitude, w, h):
    return Rotation.from_rotvec(h * w) * attitude


def _inverse(attitude, inertia, v):
    return attitude.apply(np.linalg.solve(inertia, attitude.inv().apply(v)))


def _momentum(attitude, inertia, w):
    return attitude.apply(inertia @ attitude.inv().apply(w))


def _rates(attitude, b, inertia, tau):
    return np.linalg.solve(inertia, attitude.inv().apply(tau(attitude)) - np.cross(b, inertia @ b))


def _jacobian(b, inertia, h):
    return inertia + h * (hat(b) @ inertia - hat(inertia @ b))


def _rescaled(attitude, w, h, inertia):
    b = attitude.inv().apply(w)
    L = inertia @ b
    N = L - h * np.cross(b, L)
    return attitude.apply(np.linalg.solve(inertia, N * np.linalg.norm(L) / np.linalg.norm(N)))


def _without(attitude, w, h, inertia, tau, turned):
    w = w + h * _inverse(attitude, inertia, tau(attitude))
    return turned(attitude, w, h), w


no_gyro, no_gyro_linear = (partial(_without, turned=update) for update in (_exp, _moved))


def mujoco_euler(attitude, w, h, inertia, tau):
    b = attitude.inv().apply(w)
    w = attitude.apply(b + h * _rates(attitude, b, inertia, tau))
    return _exp(attitude, w, h), w


def mujoco_implicit(attitude, w, h, inertia, tau):
    b = attitude.inv().apply(w)
    w = attitude.apply(b + h * np.linalg.solve(_jacobian(b, inertia, h), inertia @ _rates(attitude, b, inertia, tau)))
    return _exp(attitude, w, h), w


def bullet(attitude, w, h, inertia, tau):
    b = attitude.inv().apply(w)
    b = b - np.linalg.solve(_jacobian(b, inertia, h), h * np.cross(b, inertia @ b))
    w = attitude.apply(b) + h * _inverse(attitude, inertia, tau(attitude))
    return _exp(attitude, w, h), w


def jolt(attitude, w, h, inertia, tau):
    w = _rescaled(attitude, w, h, inertia) + h * _inverse(attitude, inertia, tau(attitude))
    return _exp(attitude, w, h), w


def physx(attitude, w, h, inertia, tau):
    w = _rescaled(attitude, w + h * _inverse(attitude, inertia, tau(attitude)), h, inertia)
    return _exp(attitude, w, h), w


def rapier(attitude, w, h, inertia, tau):
    pull = 0.25 * h * _inverse(attitude, inertia, tau(attitude))
    for _ in range(4):
        w = _rescaled(attitude, w + pull, 0.25 * h, inertia)
        attitude = _moved(attitude, w, 0.25 * h)
    return attitude, w


def ode(attitude, w, h, inertia, tau):
    R = attitude.as_matrix()
    tensor = R @ inertia @ R.T
    L = tensor @ w
    w = np.linalg.solve(tensor - h * hat(L), L) + h * _inverse(attitude, inertia, tau(attitude))
    return _moved(attitude, w, h), w


def lammps_rigid(attitude, w, h, inertia, tau):
    L = _momentum(attitude, inertia, w) + 0.5 * h * tau(attitude)
    w = _inverse(attitude, inertia, L)
    full, half = _moved(attitude, w, h), _moved(attitude, w, 0.5 * h)
    half = _moved(half, _inverse(half, inertia, L), 0.5 * h)
    q_full, q_half = full.as_quat(), half.as_quat()
    q_half = q_half if q_full @ q_half > 0.0 else -q_half
    attitude = Rotation.from_quat(2.0 * q_half - q_full)
    return attitude, _inverse(attitude, inertia, L + 0.5 * h * tau(attitude))


def no_squish(attitude, w, h, inertia, tau):
    L = inertia @ attitude.inv().apply(w) + 0.5 * h * attitude.inv().apply(tau(attitude))
    moments = np.diag(inertia)
    outer = 2 if moments[2] == moments.max() else int(np.argmax(moments))
    inner = 2 if outer != 2 and moments[2] == moments.min() else int(np.argmin(moments))
    middle = 3 - outer - inner
    for axis, share in zip((outer, middle, inner, middle, outer), (0.5, 0.5, 1.0, 0.5, 0.5), strict=True):
        turn = Rotation.from_rotvec(share * h * L[axis] / inertia[axis, axis] * np.eye(3)[axis])
        attitude, L = attitude * turn, turn.inv().apply(L)
    return attitude, attitude.apply(np.linalg.solve(inertia, L + 0.5 * h * attitude.inv().apply(tau(attitude))))


def _times(a, b):
    """The product of two quaternions (x, y, z, w)."""
    return np.append(a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3]), a[3] * b[3] - a[:3] @ b[:3])


def _leapfrog(attitude, w, h, inertia, tau, published):
    q = attitude.as_quat()
    half = q + 0.25 * h * _times(q, np.append(attitude.inv().apply(w), 0.0))
    L = _momentum(attitude, inertia, w) + 0.5 * h * tau(attitude)
    b = np.linalg.solve(inertia, (Rotation.from_quat(half) if published else attitude).inv().apply(L))
    attitude = Rotation.from_quat(q + 0.5 * h * _times(half, np.append(b, 0.0)))
    return attitude, _inverse(attitude, inertia, L + 0.5 * h * tau(attitude))


yade, fincham = (partial(_leapfrog, published=flag) for flag in (False, True))


def _three_stages(attitude, b, h, inertia, tau):
    k1 = h * _rates(attitude, b, inertia, tau)
    k2 = h * _rates(attitude, b + k1, inertia, tau)
    return b + (k1 + k2 + 4.0 * (h * _rates(attitude, b + (k1 + k2) / 4.0, inertia, tau))) / 6.0


def spiral(attitude, w, h, inertia, tau):
    b = _three_stages(attitude, attitude.inv().apply(w), h / 2.0, inertia, tau)
    attitude = attitude * Rotation.from_rotvec(h * b)
    return attitude, attitude.apply(_three_stages(attitude, b, h / 2.0, inertia, tau))


def _kutta(attitude, w, h, inertia, tau, corrected):
    b = attitude.inv().apply(w)
    rates, turns = [], []
    for ahead in ((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)):
        turn = h * sum((a * k for a, k in zip(ahead, turns, strict=True)), np.zeros(3))
        stage = b + h * sum((a * k for a, k in zip(ahead, rates, strict=True)), np.zeros(3))
        rates.append(_rates(attitude * Rotation.from_rotvec(turn), stage, inertia, tau))
        turns.append(corrected(turn, stage))
    weights = np.array([1.0, 2.0, 2.0, 1.0]) / 6.0
    attitude = attitude * Rotation.from_rotvec(h * weights @ turns)
    return attitude, attitude.apply(b + h * weights @ rates)


def _bernoulli(turn, b):
    """dexp^-1 by its series, Bernoulli numbers over factorials: for turns far below one radian."""
    total, term = b.copy(), b
    for number in (0.5, 1 / 12, 0.0, -1 / 720, 0.0, 1 / 30240, 0.0, -1 / 1209600):
        term = np.cross(turn, term)
        total = total + number * term
    return total


mujoco3_rk4, rkmk4 = (partial(_kutta, corrected=correction) for correction in (lambda turn, b: b, _bernoulli))


def jsbsim_default(attitude, w, h, inertia, tau):
    b, new = attitude.inv().apply(w), _moved(attitude, w, h)
    return new, new.apply(b + h * _rates(attitude, b, inertia, tau))


def jsbsim_buss2(attitude, w, h, inertia, tau):
    """The first step: the acceleration before the start is that of the start."""
    b = attitude.inv().apply(w)
    a = _rates(attitude, b, inertia, tau)
    new = attitude * Rotation.from_rotvec(h * (b + 0.5 * h * a + h * h / 12.0 * np.cross(a, b)))
    return new, new.apply(b + h * a)
