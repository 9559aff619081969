"""Methods that are what they claim, as people write them, some of them odd; `CLAIMS` has what is true and options.

A name that is not defined here is a class of `scipy.integrate`.
"""

import math
import time

import numpy as np
from scipy.integrate import RK45, OdeSolver


def explicit(a, b, c):
    """A Runge-Kutta step from its tableau."""

    def step(f, t, y, h):
        k = []
        for row, node in zip(a, c, strict=True):
            k.append(f(t + node * h, y + h * sum((x * v for x, v in zip(row, k, strict=False)), 0.0 * y)))
        return y + h * sum(w * v for w, v in zip(b, k, strict=True))

    return step


euler = lambda f, t, y, h: y + h * f(t, y)
midpoint = explicit(((), (0.5,)), (0.0, 1.0), (0.0, 0.5))
heun = explicit(((), (1.0,)), (0.5, 0.5), (0.0, 1.0))
ralston = explicit(((), (2 / 3,)), (1 / 4, 3 / 4), (0.0, 2 / 3))
kutta_3 = explicit(((), (0.5,), (-1.0, 2.0)), (1 / 6, 2 / 3, 1 / 6), (0.0, 0.5, 1.0))
ssp_3 = explicit(((), (1.0,), (0.25, 0.25)), (1 / 6, 1 / 6, 2 / 3), (0.0, 1.0, 0.5))
CLASSICAL = ((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)), (1 / 6, 1 / 3, 1 / 3, 1 / 6), (0.0, 0.5, 0.5, 1.0)
rk4 = explicit(*CLASSICAL)
three_eighths = explicit(((), (1 / 3,), (-1 / 3, 1.0), (1.0, -1.0, 1.0)), (1 / 8, 3 / 8, 3 / 8, 1 / 8),
                         (0.0, 1 / 3, 2 / 3, 1.0))  # fmt: skip
dormand_prince = explicit(
    ((), (1 / 5,), (3 / 40, 9 / 40), (44 / 45, -56 / 15, 32 / 9),
     (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
     (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656)),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84), (0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0),
)  # fmt: skip


def solved(function, guess, tolerance=4e-16):
    """The fixed point, iterated until it stands still."""
    for _ in range(200):
        after = function(guess)
        if np.max(np.abs(after - guess)) <= tolerance * np.max(np.abs(after)):
            return after
        guess = after
    return guess


def implicit_midpoint(f, t, y, h, tolerance=4e-16):
    return y + h * solved(lambda k: f(t + h / 2, y + h / 2 * k), f(t, y), tolerance)


def trapezoidal(f, t, y, h):
    k = f(t, y)
    return y + h / 2 * (k + solved(lambda late: f(t + h, y + h / 2 * (k + late)), k))


implicit_euler = lambda f, t, y, h: y + h * solved(lambda k: f(t + h, y + h * k), f(t, y))
ROOT = 3**0.5 / 6


def gauss_4(f, t, y, h, root=ROOT, tolerance=4e-16):
    def slopes(k):
        first = f(t + (0.5 - root) * h, y + h * (k[0] / 4 + (1 / 4 - root) * k[1]))
        return np.array([first, f(t + (0.5 + root) * h, y + h * ((1 / 4 + root) * k[0] + k[1] / 4))])

    k = solved(slopes, np.array([f(t, y)] * 2), tolerance)
    return y + h / 2 * (k[0] + k[1])


def triple_jump(f, t, y, h, outer=1 / (2 - 2 ** (1 / 3))):
    for share in (outer, 1 - 2 * outer, outer):
        y, t = implicit_midpoint(f, t, y, share * h), t + share * h
    return y


def extrapolated(f, t, y, h, base=heun):
    """Two half steps and one whole of a second-order method, h^2 eliminated: order 3."""
    return (4 * base(f, t + h / 2, base(f, t, y, h / 2), h / 2) - base(f, t, y, h)) / 3


def in_place(f, t, y, h):
    """Heun's method, which works on the array that it was given."""
    k = f(t, y)
    y += h / 2 * (k + f(t + h, y + h * k))
    return y


class HeunSolver(OdeSolver):
    """Heun's method with fixed steps, as SciPy's documentation tells one to write a solver."""

    def __init__(self, fun, t0, y0, t_bound, max_step=np.inf, vectorized=False, **_):
        super().__init__(fun, t0, y0, t_bound, vectorized)
        self.max_step = max_step

    def _step_impl(self):
        h = self.direction * min(self.max_step, abs(self.t_bound - self.t))
        self.y, self.t = self.moved(self.t, self.y, h), self.t + h
        return True, None

    def moved(self, t, y, h):
        return heun(self.fun, t, y, h)


class AdamsBashforth(HeunSolver):
    """The two-step method of order 2, started with Heun's: it remembers the last slope within a run."""

    weights, slope = (1.5, -0.5), None

    def moved(self, t, y, h):
        before, self.slope = self.slope, self.fun(t, y)
        return heun(self.fun, t, y, h) if before is None else y + h * (np.array(self.weights) @ [self.slope, before])


class Leaping(HeunSolver):
    """The leapfrog of two steps, y_(n+1) = y_(n-1) + 2 h f(y_n), started by the midpoint rule."""

    before = None

    def moved(self, t, y, h):
        last, self.before = self.before, y
        return midpoint(self.fun, t, y, h) if last is None else last + 2 * h * self.fun(t, y)


def radau_iia(f, t, y, h):
    """Of order 3, two stages; its equations are iterated until they stand still."""
    slopes = lambda k: np.array([f(t + h / 3, y + h * (5 * k[0] - k[1]) / 12), f(t + h, y + h * (3 * k[0] + k[1]) / 4)])
    k = solved(slopes, np.array([f(t, y)] * 2))
    return y + h * (3 * k[0] + k[1]) / 4


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
    return y + h * (1.5 * k1 + 0.5 * matrix @ (f(t + h, y + h * k1) - 2 * k1))


NODES = [0.5 + 0.5 * x for x in (-(0.6**0.5), 0.0, 0.6**0.5)]


def averaged_field(f, t, y, h):
    """The mean of f along the chord, by Gauss's three points: symmetric, and no symplectic method."""

    def end(after):
        return y + h * sum(w * f(t + x * h, y + x * (after - y)) for w, x in zip((5, 8, 5), NODES, strict=True)) / 18

    return solved(end, y + h * f(t, y))


_guess = {}


def warm(f, t, y, h):
    """The implicit midpoint rule, whose iteration starts from what the last step ended with."""
    k = _guess.get("slope", f(t, y))
    _guess["slope"] = solved(lambda k: f(t + h / 2, y + h / 2 * k), k if np.isfinite(k).all() else f(t, y))
    return y + h * _guess["slope"]


def long_double(f, t, y, h):
    """Heun's method, its sums in long double."""
    y = y.astype(np.longdouble)
    k = np.asarray(f(t, y), dtype=np.longdouble)
    return y + h / 2 * (k + f(t + h, y + h * k))


def slow(f, t, y, h):
    """The explicit midpoint rule, at two thousandths of a second a step."""
    time.sleep(0.002)
    return midpoint(f, t, y, h)


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
AtTolerance = RK45  # to be judged at a tolerance


def tr_bdf2(f, t, y, h):
    """Trapezoidal rule to t + g h, then BDF2; g = 2 - sqrt 2. Bank and others, IEEE Trans. CAD 4 (1985) 436."""
    g, first = 2.0 - math.sqrt(2.0), f(t, y)
    base = y + g * h / 2 * first
    middle = solved(lambda state: base + g * h / 2 * f(t + g * h, state), y + g * h * first)
    rest = middle / (g * (2.0 - g)) - y * (1.0 - g) ** 2 / (g * (2.0 - g))
    return solved(lambda state: rest + (1.0 - g) / (2.0 - g) * h * f(t + h, state), middle)


def newmark(f, t, y, h):
    """beta = 1/4, gamma = 1/2, in angles: q'' = a(q, q'). Newmark, J. Eng. Mech. 85 (1959) 67."""
    q, v, before = y[:3], y[3:], f(t, y)[3:]
    end = lambda after: np.concatenate([q + h * v + h * h / 4 * (before + after), v + h / 2 * (before + after)])
    return end(solved(lambda after: f(t + h, end(after))[3:], before))


def own_drift(f, t, y, h):
    """Kick at t and t + h, and a free rotation of its own: of e about L, at the rate that f shows at the start."""
    e, L = y[:3], y[3:] + h / 2 * f(t, y)[3:]
    size = np.linalg.norm(L)
    angle, n = h * size / TOP.I1, L / size
    e = e * math.cos(angle) + np.cross(n, e) * math.sin(angle) + n * (n @ e) * (1.0 - math.cos(angle))
    return np.concatenate([e, L + h / 2 * f(t + h, np.concatenate([e, L]))[3:]])


TOP = None  # of the scene, set by who imports this


def own_energy(f, t, y, h):
    """rk4, then L of a length with which the energy is that of y, by a formula of its own."""
    twice = lambda y: y[3:] @ y[3:] / TOP.I1 + (1 / TOP.I3 - 1 / TOP.I1) * (y[:3] @ y[3:]) ** 2  # without a weight
    after = rk4(f, t, y, h)
    after[3:] *= math.sqrt((twice(y) + 2 * TOP.mgl * (y[2] - after[2])) / twice(after))
    return after


def product(a, b):
    """Of two quaternions (w, x, y, z)."""
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))])


def turn(v):
    """The quaternion of a rotation by the vector v."""
    half = 0.5 * np.sqrt(v @ v)
    return np.array([np.cos(half), *(0.5 * np.sinc(half / np.pi) * v)])


def rates(q, w, inertia, torque):
    """Of the angular velocity, by Euler's equations."""
    return (np.cross(inertia * w, w) + torque(q)) / inertia


def rotation_rk4(q, w, h, inertia, torque):
    def slope(_, y):
        return np.concatenate([0.5 * product(y[:4], np.array([0.0, *y[4:]])), rates(y[:4], y[4:], inertia, torque)])

    y = rk4(slope, 0.0, np.concatenate([q, w]), h)
    return y[:4], y[4:]


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


def rotation_lie_midpoint(q, w, h, inertia, torque, half=0.5, whole=1.0):
    """The explicit midpoint rule, with the exponential map for the attitude, which turns it by these shares."""
    middle = w + h / 2 * rates(q, w, inertia, torque)
    return product(q, turn(whole * h * middle)), w + h * rates(product(q, turn(half * h * w)), middle, inertia, torque)


def rotation_negated(q, w, h, inertia, torque):
    """The same, and -q for q, which is the same attitude."""
    q, w = rotation_lie_midpoint(q, w, h, inertia, torque)
    return -q, w


def rotation_guarded(q, w, h, inertia, torque):
    """Of order 1, as engines write it: an angle that is not positive turns nothing, so that a step of -h is another."""
    w = w + h * rates(q, w, inertia, torque)
    return product(q, turn(h * w)) if h * np.sqrt(w @ w) > 0.0 else q, w


def verlet(state, h, dT, dV):
    theta, p = state
    p = p - h / 2 * dV(theta)
    theta = theta + h * dT(p)
    return theta, p - h / 2 * dV(theta)


def separable_forest_ruth(state, h, dT, dV):
    """Of order 4, drift first."""
    theta, p = state
    x = 1 / (2 - 2 ** (1 / 3))
    for a, b in ((x / 2, x), ((1 - x) / 2, 1 - 2 * x), ((1 - x) / 2, x), (x / 2, 0)):
        theta = theta + a * h * dT(p)
        if b:
            p = p - b * h * dV(theta)
    return theta, p


def in_the_plane(step):
    """A step of y' = f(t, y) on theta and p."""
    return lambda state, h, dT, dV: step(lambda _, y: np.array([dT(y[1]), -dV(y[0])]), 0.0, np.array(state), h)


separable_implicit_midpoint = in_the_plane(implicit_midpoint)  # symplectic, and no splitting
separable_heun = in_the_plane(heun)

ALL = ("energy", "p_phi", "p_psi", "axis_length")
ROTATION, SEPARABLE = {"form": "rotation"}, {"form": "separable"}
_TABLE = {  # names: claims, and options of judge
    "euler": ({"order": 1, "explicit": True}, {}), "heun": ({"order": 2, "conserves": ["p_phi"]}, {}),
    "midpoint slow": ({"order": 2, "symplectic": False, "symmetric": False}, {}), "dormand_prince": ({"order": 5}, {}),
    "ralston in_place HeunSolver AdamsBashforth": ({"order": 2}, {}), "kutta_3 extrapolated RK23": ({"order": 3}, {}),
    "ssp_3 as_a_list": ({"order": 3, "explicit": True}, {}), "implicit_euler": ({"order": 1, "symmetric": False}, {}),
    "rk4": ({"order": 4, "symplectic": False, "conserves": ["p_phi"]}, {}), "three_eighths": ({"order": 4}, {}),
    "implicit_midpoint warm": ({"order": 2, "symmetric": True, "conserves": ALL}, {}),
    "trapezoidal": ({"order": 2, "symmetric": True, "energy": "bounded"}, {}),
    "gauss_4 triple_jump": ({"order": 4, "symmetric": True, "conserves": ALL}, {}),
    "Leaping": ({"order": 2, "explicit": True}, {}), "RK45": ({"order": 5, "symplectic": False}, {}),
    "DOP853": ({"order": 8, "explicit": True}, {}), "BDF LSODA": ({}, {"adaptive": True}),
    "AtTolerance": ({"symplectic": False, "symmetric": False}, {"adaptive": True}),
    "radau_iia": ({"order": 3, "symplectic": False, "symmetric": False}, {}),
    "linearised": ({"order": 2, "symplectic": False}, {}), "newmark": ({"order": 2}, {"chart": "angles"}),
    "averaged_field": ({"order": 2, "symmetric": True, "symplectic": False, "conserves": ["p_phi"]}, {}),
    "long_double": ({"order": 2, "symplectic": False}, {"chart": "attitude"}),
    "wrapped": ({"order": 2, "symplectic": False, "symmetric": False}, {"chart": "angles"}),
    "halves": ({"order": 2, "conserves": ["p_phi"]}, {"chart": "attitude"}),
    "tr_bdf2": ({"order": 2, "symplectic": False, "explicit": False}, {}),
    "own_drift": ({"order": 2, "symplectic": True, "symmetric": True, "conserves": ["p_phi", "p_psi"]}, {}),
    "own_energy": ({"order": 4, "symplectic": False, "symmetric": False, "conserves": ["energy"]}, {}),
    "rotation_rk4": ({"order": 4, "symplectic": False}, ROTATION),
    "rotation_strang": ({"order": 2, "symplectic": True, "symmetric": True, "conserves": ["p_phi", "p_psi"]}, ROTATION),
    "rotation_lie_midpoint rotation_negated":
        ({"order": 2, "symplectic": False, "conserves": ["axis_length"]}, ROTATION),
    "rotation_guarded": ({"order": 1, "symmetric": False}, ROTATION),
    "separable_forest_ruth": ({"order": 4, "symplectic": True, "symmetric": True, "explicit": True}, SEPARABLE),
    "separable_implicit_midpoint":
        ({"order": 2, "symplectic": True, "symmetric": True, "energy": "bounded"}, SEPARABLE),
    "separable_heun": ({"order": 2, "symplectic": False, "symmetric": False}, SEPARABLE),
}  # fmt: skip
CLAIMS = {name: entry for names, entry in _TABLE.items() for name in names.split()}
