"""Methods that are what they claim, as people write them: each a step and, in `CLAIMS`, what is true of it."""

import numpy as np
from scipy.integrate import DOP853, RK23, RK45, OdeSolver


def explicit(a, b, c):
    """A Runge-Kutta step from its tableau."""

    def step(f, t, y, h):
        k = []
        for row, node in zip(a, c, strict=True):
            k.append(f(t + node * h, y + h * sum((x * v for x, v in zip(row, k, strict=False)), 0.0 * y)))
        return y + h * sum(w * v for w, v in zip(b, k, strict=True))

    return step


def euler(f, t, y, h):
    return y + h * f(t, y)


def midpoint(f, t, y, h):
    return y + h * f(t + h / 2, y + h / 2 * f(t, y))


def heun(f, t, y, h):
    k = f(t, y)
    return y + h / 2 * (k + f(t + h, y + h * k))


kutta_3 = explicit(((), (0.5,), (-1.0, 2.0)), (1 / 6, 2 / 3, 1 / 6), (0.0, 0.5, 1.0))
ssp_3 = explicit(((), (1.0,), (0.25, 0.25)), (1 / 6, 1 / 6, 2 / 3), (0.0, 1.0, 0.5))


def rk4(f, t, y, h):
    k1 = f(t, y)
    k2 = f(t + h / 2, y + h / 2 * k1)
    k3 = f(t + h / 2, y + h / 2 * k2)
    k4 = f(t + h, y + h * k3)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


three_eighths = explicit(
    ((), (1 / 3,), (-1 / 3, 1.0), (1.0, -1.0, 1.0)), (1 / 8, 3 / 8, 3 / 8, 1 / 8), (0.0, 1 / 3, 2 / 3, 1.0)
)
dormand_prince = explicit(
    (
        (), (1 / 5,), (3 / 40, 9 / 40), (44 / 45, -56 / 15, 32 / 9),
        (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
        (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    ),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
    (0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0),
)  # fmt: skip
ralston = explicit(((), (2 / 3,)), (1 / 4, 3 / 4), (0.0, 2 / 3))


def solved(function, guess):
    """The fixed point, iterated until it stands still."""
    for _ in range(200):
        after = function(guess)
        if np.max(np.abs(after - guess)) <= 4e-16 * np.max(np.abs(after)):
            return after
        guess = after
    return guess


def implicit_midpoint(f, t, y, h):
    return y + h * solved(lambda k: f(t + h / 2, y + h / 2 * k), f(t, y))


def trapezoidal(f, t, y, h):
    k = f(t, y)
    return y + h / 2 * (k + solved(lambda late: f(t + h, y + h / 2 * (k + late)), k))


def implicit_euler(f, t, y, h):
    return y + h * solved(lambda k: f(t + h, y + h * k), f(t, y))


ROOT = 3**0.5 / 6


def gauss_4(f, t, y, h):
    def slopes(k):
        first = f(t + (0.5 - ROOT) * h, y + h * (k[0] / 4 + (1 / 4 - ROOT) * k[1]))
        return np.array([first, f(t + (0.5 + ROOT) * h, y + h * ((1 / 4 + ROOT) * k[0] + k[1] / 4))])

    k = solved(slopes, np.array([f(t, y)] * 2))
    return y + h / 2 * (k[0] + k[1])


def triple_jump(f, t, y, h):
    outer = 1 / (2 - 2 ** (1 / 3))
    for share in (outer, 1 - 2 * outer, outer):
        y, t = implicit_midpoint(f, t, y, share * h), t + share * h
    return y


def extrapolated(f, t, y, h):
    """Two half steps and one whole of Heun's second-order method, h^2 eliminated: order 3."""
    halves = heun(f, t + h / 2, heun(f, t, y, h / 2), h / 2)
    return (4 * halves - heun(f, t, y, h)) / 3


def in_place(f, t, y, h):
    """Heun's method, which works on the array that it was given."""
    k = f(t, y)
    late = f(t + h, y + h * k)
    y += h / 2 * (k + late)
    return y


class HeunSolver(OdeSolver):
    """Heun's method with fixed steps, as SciPy's documentation tells one to write a solver."""

    def __init__(self, fun, t0, y0, t_bound, max_step=np.inf, vectorized=False, **_):
        super().__init__(fun, t0, y0, t_bound, vectorized)
        self.max_step = max_step

    def _step_impl(self):
        h = self.direction * min(self.max_step, abs(self.t_bound - self.t))
        self.y = heun(self.fun, self.t, self.y, h)
        self.t += h
        return True, None


class AdamsBashforth(HeunSolver):
    """The two-step method of order 2, started with Heun's: it remembers the last slope within a run."""

    slope = None

    def _step_impl(self):
        h = self.direction * min(self.max_step, abs(self.t_bound - self.t))
        now = self.fun(self.t, self.y)
        if self.slope is None:
            self.y = heun(self.fun, self.t, self.y, h)
        else:
            self.y = self.y + h / 2 * (3 * now - self.slope)
        self.slope = now
        self.t += h
        return True, None


class Third(RK23):
    """SciPy's own."""


class Fifth(RK45):
    """SciPy's own."""


class Eighth(DOP853):
    """SciPy's own."""


def product(a, b):
    """Of two quaternions (w, x, y, z)."""
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))])


def turn(v):
    """The quaternion of a rotation by the vector v."""
    half = 0.5 * np.sqrt(v @ v)
    return np.array([np.cos(half), *(0.5 * np.sinc(half / np.pi) * v)])


def rotation_rk4(q, w, h, inertia, torque):
    def rates(q, w):
        return 0.5 * product(q, np.array([0.0, *w])), (np.cross(inertia * w, w) + torque(q)) / inertia

    a1, b1 = rates(q, w)
    a2, b2 = rates(q + h / 2 * a1, w + h / 2 * b1)
    a3, b3 = rates(q + h / 2 * a2, w + h / 2 * b2)
    a4, b4 = rates(q + h * a3, w + h * b3)
    return q + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4), w + h / 6 * (b1 + 2 * b2 + 2 * b3 + b4)


def free_top(q, w, h, inertia):
    """The exact motion of a free symmetric body: L stands still in space, the body turns about its axis besides."""
    spin = (1.0 / inertia[2] - 1.0 / inertia[0]) * inertia[2] * w[2]
    q = product(q, turn(h * inertia * w / inertia[0]))
    angle = -h * spin  # of L as the body sees it, about the axis
    x, y = inertia[0] * w[0], inertia[0] * w[1]
    q = product(q, turn(np.array([0.0, 0.0, -angle])))
    c, s = np.cos(angle), np.sin(angle)
    return q, np.array([(c * x - s * y) / inertia[0], (s * x + c * y) / inertia[0], w[2]])


def rotation_strang(q, w, h, inertia, torque):
    w = w + h / 2 * torque(q) / inertia
    q, w = free_top(q, w, h, inertia)
    return q, w + h / 2 * torque(q) / inertia


ALL = ("energy", "p_phi", "p_psi", "axis_length")
CLAIMS = {
    "euler": {"order": 1, "explicit": True},
    "midpoint": {"order": 2, "symplectic": False, "symmetric": False},
    "heun": {"order": 2, "conserves": ["p_phi"]},
    "ralston": {"order": 2},
    "kutta_3": {"order": 3},
    "ssp_3": {"order": 3, "explicit": True},
    "rk4": {"order": 4, "symplectic": False, "conserves": ["p_phi"]},
    "three_eighths": {"order": 4},
    "dormand_prince": {"order": 5},
    "extrapolated": {"order": 3},
    "in_place": {"order": 2},
    "implicit_midpoint": {"order": 2, "symmetric": True, "conserves": ALL},
    "trapezoidal": {"order": 2, "symmetric": True, "energy": "bounded"},
    "implicit_euler": {"order": 1, "symmetric": False},
    "gauss_4": {"order": 4, "symmetric": True, "conserves": ALL},
    "triple_jump": {"order": 4, "symmetric": True, "conserves": ALL},
    "HeunSolver": {"order": 2},
    "AdamsBashforth": {"order": 2},
    "Third": {"order": 3},
    "Fifth": {"order": 5, "symplectic": False},
    "Eighth": {"order": 8, "explicit": True},
    "rotation_rk4": {"order": 4, "symplectic": False},
    "rotation_strang": {"order": 2, "symplectic": True, "symmetric": True, "conserves": ["p_phi", "p_psi"]},
}
