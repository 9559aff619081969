"""More methods that are what they claim: odd in how they are written, and right."""

import math
import time

import numpy as np
from scipy.integrate import RK45, OdeSolver


def radau_iia(f, t, y, h):
    """Of order 3, two stages; its equations are iterated until they stand still."""
    k1 = k2 = f(t, y)
    for _ in range(200):
        before = k1, k2
        k1 = f(t + h / 3, y + h * (5 * k1 - k2) / 12)
        k2 = f(t + h, y + h * (3 * k1 + k2) / 4)
        if np.array_equal(before[0], k1) and np.array_equal(before[1], k2):
            break
    return y + h * (3 * k1 + k2) / 4


def as_a_list(f, t, y, h):
    """Ralston's third order, number by number, returned as a list."""
    k1 = f(t, y)
    k2 = f(t + h / 2, [a + h / 2 * b for a, b in zip(y, k1, strict=True)])
    k3 = f(t + 3 * h / 4, [a + 3 * h / 4 * b for a, b in zip(y, k2, strict=True)])
    return [a + h / 9 * (2 * p + 3 * q + 4 * r) for a, p, q, r in zip(y, k1, k2, k3, strict=True)]


def linearised(f, t, y, h):
    """A Rosenbrock method of order 2 for any matrix, here the Jacobian by differences of 1e-6."""
    gamma, n, zero = 1 - 1 / 2**0.5, y.size, f(t, y)
    slopes = np.stack([(f(t, y + 1e-6 * np.eye(n)[k]) - zero) / 1e-6 for k in range(n)], axis=1)
    matrix = np.linalg.inv(np.eye(n) - h * gamma * slopes)
    k1 = matrix @ zero
    k2 = matrix @ (f(t + h, y + h * k1) - 2 * k1)
    return y + h * (1.5 * k1 + 0.5 * k2)


NODES = [0.5 + 0.5 * x for x in (-(0.6**0.5), 0.0, 0.6**0.5)]


def averaged_field(f, t, y, h):
    """The mean of f along the chord, by Gauss's three points: symmetric, and no symplectic method."""
    after = y + h * f(t, y)
    for _ in range(200):
        mean = sum(w * f(t + x * h, y + x * (after - y)) for w, x in zip((5, 8, 5), NODES, strict=True)) / 18
        last, after = after, y + h * mean
        if np.max(np.abs(after - last)) < 3e-16:
            break
    return after


_guess = {}


def warm(f, t, y, h):
    """The implicit midpoint rule, whose iteration starts from what the last step ended with."""
    k = _guess.get("slope", f(t, y))
    k = k if np.isfinite(k).all() else f(t, y)
    for _ in range(300):
        last, k = k, f(t + h / 2, y + h / 2 * k)
        if np.max(np.abs(k - last)) <= 4e-16 * np.max(np.abs(k)):
            break
    _guess["slope"] = k
    return y + h * k


def long_double(f, t, y, h):
    """Heun's method, its sums in long double."""
    y = y.astype(np.longdouble)
    k = np.asarray(f(t, y), dtype=np.longdouble)
    return y + h / 2 * (k + f(t + h, y + h * k))


def slow(f, t, y, h):
    """The explicit midpoint rule, at two thousandths of a second a step."""
    time.sleep(0.002)
    return y + h * f(t + h / 2, y + h / 2 * f(t, y))


def wrapped(f, t, y, h):
    """Ralston's second order on the angles, phi and psi brought back to a turn."""
    k = f(t, y)
    y = y + h / 4 * k + 3 * h / 4 * f(t + 2 * h / 3, y + 2 * h / 3 * k)
    y[1:3] = np.remainder(y[1:3], 2 * math.pi)
    return y


class Midpoints:
    """An object that is called, with the number of its halvings as an attribute."""

    parts = 2

    def __call__(self, f, t, y, h):
        """Two explicit midpoint steps of h/2."""
        for k in range(self.parts):
            s = h / self.parts
            y = y + s * f(t + (k + 0.5) * s, y + s / 2 * f(t + k * s, y))
        return y


halves = Midpoints()


class Leaping(OdeSolver):
    """The leapfrog of two steps, y_(n+1) = y_(n-1) + 2 h f(y_n), started by the midpoint rule."""

    before = None

    def __init__(self, fun, t0, y0, t_bound, max_step=np.inf, vectorized=False, **_):
        super().__init__(fun, t0, y0, t_bound, vectorized)
        self.max_step = max_step

    def _step_impl(self):
        h = self.direction * self.max_step
        if self.before is None:
            after = self.y + h * self.fun(self.t + h / 2, self.y + h / 2 * self.fun(self.t, self.y))
        else:
            after = self.before + 2 * h * self.fun(self.t, self.y)
        self.before, self.y, self.t = self.y, after, self.t + h
        return True, None


class AtTolerance(RK45):
    """SciPy's own, to be judged at a tolerance."""


def product(a, b):
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))])


def turn(v):
    angle = math.sqrt(v @ v)
    return np.array([math.cos(angle / 2), *(0.5 * np.sinc(angle / (2 * math.pi)) * v)])


def rotation_lie_midpoint(q, w, h, inertia, torque):
    """The explicit midpoint rule, with the exponential map for the attitude."""

    def rate(q, w):
        return (np.cross(inertia * w, w) + torque(q)) / inertia

    middle = w + h / 2 * rate(q, w)
    half = product(q, turn(h / 2 * w))
    return product(q, turn(h * middle)), w + h * rate(half, middle)


def rotation_negated(q, w, h, inertia, torque):
    """The same, and -q for q, which is the same attitude."""
    q, w = rotation_lie_midpoint(q, w, h, inertia, torque)
    return -q, w


def separable_forest_ruth(state, h, dT, dV):
    """Of order 4, drift first."""
    theta, p = state
    x = 1 / (2 - 2 ** (1 / 3))
    for a, b in ((x / 2, x), ((1 - x) / 2, 1 - 2 * x), ((1 - x) / 2, x), (x / 2, 0)):
        theta = theta + a * h * dT(p)
        if b:
            p = p - b * h * dV(theta)
    return theta, p


def separable_implicit_midpoint(state, h, dT, dV):
    """Iterated until it stands still: symplectic, and no splitting."""
    theta, p = state
    x, y = theta + h * dT(p), p - h * dV(theta)
    for _ in range(300):
        last = x, y
        x, y = theta + h * dT((p + y) / 2), p - h * dV((theta + x) / 2)
        if abs(x - last[0]) + abs(y - last[1]) < 4e-16:
            break
    return x, y


def separable_heun(state, h, dT, dV):
    """Heun's method on both."""
    theta, p = state
    a, b = dT(p), -dV(theta)
    return theta + h / 2 * (a + dT(p + h * b)), p + h / 2 * (b - dV(theta + h * a))


CLAIMS = {  # name: claims, and options of judge
    "radau_iia": ({"order": 3, "symplectic": False, "symmetric": False}, {}),
    "as_a_list": ({"order": 3, "explicit": True}, {}),
    "linearised": ({"order": 2, "symplectic": False}, {}),
    "averaged_field": ({"order": 2, "symmetric": True, "symplectic": False, "conserves": ["p_phi"]}, {}),
    "warm": ({"order": 2, "symmetric": True, "conserves": ["energy", "p_phi", "p_psi", "axis_length"]}, {}),
    "long_double": ({"order": 2, "symplectic": False}, {"chart": "attitude"}),
    "slow": ({"order": 2, "symplectic": False, "symmetric": False}, {}),
    "wrapped": ({"order": 2, "symplectic": False, "symmetric": False}, {"chart": "angles"}),
    "halves": ({"order": 2, "conserves": ["p_phi"]}, {"chart": "attitude"}),
    "Leaping": ({"order": 2, "explicit": True}, {}),
    "AtTolerance": ({"symplectic": False, "symmetric": False}, {"adaptive": True}),
    "rotation_lie_midpoint": ({"order": 2, "symplectic": False, "conserves": ["axis_length"]}, {"form": "rotation"}),
    "rotation_negated": ({"order": 2, "symplectic": False, "conserves": ["axis_length"]}, {"form": "rotation"}),
    "separable_forest_ruth": (
        {"order": 4, "symplectic": True, "symmetric": True, "explicit": True}, {"form": "separable"}
    ),
    "separable_implicit_midpoint": (
        {"order": 2, "symplectic": True, "symmetric": True, "energy": "bounded"}, {"form": "separable"}
    ),
    "separable_heun": ({"order": 2, "symplectic": False, "symmetric": False}, {"form": "separable"}),
}  # fmt: skip
