"""More methods that are not what they claim; `CLAIMS` has the claims, the line that names the defect, and options."""

import math

import numpy as np
from scipy.integrate import OdeSolver


def rk4(f, t, y, h, late=1.0):
    k1 = f(t, y)
    k2 = f(t + h / 2, y + h / 2 * k1)
    k3 = f(t + h / 2, y + h / 2 * k2)
    k4 = f(t + late * h, y + h * k3)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def early(f, t, y, h):
    """The last stage asks f at the middle of the step."""
    return rk4(f, t, y, h, 0.5)


def sub_steps(f, t, y, h):
    """Steps of its own of a thousandth, whatever h: its error does not fall until h is as small."""
    count = max(1, round(abs(h) / 1e-3))
    for k in range(count):
        s = h / count
        y = y + s * f(t + (k + 0.5) * s, y + s / 2 * f(t + k * s, y))
    return y


NODES = [0.5 + 0.5 * x for x in (-(0.6**0.5), 0.0, 0.6**0.5)]


def averaged_field(f, t, y, h):
    """Symmetric, and called symplectic."""
    after = y + h * f(t, y)
    for _ in range(200):
        mean = sum(w * f(t + x * h, y + x * (after - y)) for w, x in zip((5, 8, 5), NODES, strict=True)) / 18
        last, after = after, y + h * mean
        if np.max(np.abs(after - last)) < 3e-16:
            break
    return after


def hurried(f, t, y, h):
    """The implicit midpoint rule, whose clock runs fast by a millionth: right energies, wrong phase."""
    s, k = h * (1 + 1e-6), f(t, y)
    for _ in range(300):
        last, k = k, f(t + h / 2, y + s / 2 * k)
        if np.max(np.abs(k - last)) <= 4e-16 * np.max(np.abs(k)):
            break
    return y + s * k


def root_of_the_step(f, t, y, h):
    """Works for h > 0 alone, and is called symmetric."""
    root = math.sqrt(h)
    return y + root * root * f(t + h / 2, y + h / 2 * f(t, y))


def loose_gauss(f, t, y, h):
    """Gauss's method of order 4, its equations solved to 1e-7."""
    root, k = 3**0.5 / 6, np.array([f(t, y)] * 2)
    for _ in range(60):
        last = k
        first = f(t + (0.5 - root) * h, y + h * (k[0] / 4 + (1 / 4 - root) * k[1]))
        k = np.array([first, f(t + (0.5 + root) * h, y + h * ((1 / 4 + root) * k[0] + k[1] / 4))])
        if np.max(np.abs(k - last)) < 1e-7 * np.max(np.abs(k)):
            break
    return y + h / 2 * (k[0] + k[1])


THIRD = float(np.float32(1 / 3))


def single_constants(f, t, y, h):
    """Heun's third order with 1/3 and 2/3 in single precision."""
    k1 = f(t, y)
    k2 = f(t + THIRD * h, y + THIRD * h * k1)
    k3 = f(t + 2 * THIRD * h, y + 2 * THIRD * h * k2)
    return y + h / 4 * (k1 + 3 * k3)


_kept = {}


def first_momenta(f, t, y, h):
    """L.e is put back to what it was when the method was first called."""
    spin = _kept.setdefault("spin", float(y[:3] @ y[3:]))
    y = rk4(f, t, y, h)
    y[3:] += (spin - y[:3] @ y[3:]) * y[:3] / (y[:3] @ y[:3])
    return y


_calls = {"count": 0}


def counted(f, t, y, h):
    """Each hundredth call makes a step of Euler's."""
    _calls["count"] += 1
    return y + h * f(t, y) if _calls["count"] % 100 == 0 else rk4(f, t, y, h)


def compensated(f, t, y, h):
    """Rounding is carried from one call to the next, and ten thousand times too large."""
    change = h * f(t + h / 2, y + h / 2 * f(t, y)) + _kept.get("rest", 0.0)
    after = y + change
    _kept["rest"] = 1e4 * (change - (after - y))
    return after


def poisoned(f, t, y, h):
    """The implicit midpoint rule from the last slope: a step that fails spoils all later ones."""
    k = _kept.get("slope", f(t, y))
    for _ in range(300):
        last, k = k, f(t + h / 2, y + h / 2 * k)
        if np.max(np.abs(k - last)) <= 4e-16 * np.max(np.abs(k)):
            break
    _kept["slope"] = k
    return y + h * k


def rounded(f, t, y, h):
    """Its state is rounded to eight decimals."""
    return np.round(rk4(f, t, y, h), 8)


def extrapolated(f, t, y, h):
    """Euler's method, extrapolated as one of order 2 is."""
    middle = y + h / 2 * f(t, y)
    return (4 * (middle + h / 2 * f(t + h / 2, middle)) - (y + h * f(t, y))) / 3


def energy_clipped(f, t, y, h):
    """rk4, and L shortened or lengthened as if |L| were a constant."""
    after = rk4(f, t, y, h)
    after[3:] *= math.sqrt(float(y[3:] @ y[3:]) / float(after[3:] @ after[3:]))
    return after


class AdamsBashforth3(OdeSolver):
    """Of order 3 but for its start, two steps of Euler's."""

    def __init__(self, fun, t0, y0, t_bound, max_step=np.inf, vectorized=False, **_):
        super().__init__(fun, t0, y0, t_bound, vectorized)
        self.max_step, self.slopes = max_step, []

    def _step_impl(self):
        h = self.direction * self.max_step
        self.slopes = [self.fun(self.t, self.y), *self.slopes[:2]]
        weights = (1,) if len(self.slopes) < 3 else (23 / 12, -16 / 12, 5 / 12)
        self.y = self.y + h * sum(w * k for w, k in zip(weights, self.slopes, strict=False))
        self.t += h
        return True, None


class OnlyForward(AdamsBashforth3):
    """Heun's method; the direction of the time is forgotten where the slope is, and it is called symmetric."""

    def _step_impl(self):
        h = self.max_step
        k = self.fun(self.t, self.y)
        self.y = self.y + h / 2 * (k + self.fun(self.t + h, self.y + h * k))
        self.t += self.direction * h
        return True, None


def product(a, b):
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))])


def turn(v, share=0.5):
    angle = math.sqrt(v @ v)
    return np.array([math.cos(share * angle), *(share * np.sinc(share * angle / math.pi) * v)])


def rate(q, w, inertia, torque):
    return (np.cross(inertia * w, w) + torque(q)) / inertia


def rotation_whole_angle(q, w, h, inertia, torque):
    """The exponential map with the angle where its half belongs."""
    middle = w + h / 2 * rate(q, w, inertia, torque)
    return product(q, turn(h * middle, 1.0)), w + h * rate(product(q, turn(h / 2 * w, 1.0)), middle, inertia, torque)


def rotation_half_once(q, w, h, inertia, torque):
    """The half angle is right in the step and wrong in its middle."""
    middle = w + h / 2 * rate(q, w, inertia, torque)
    return product(q, turn(h * middle)), w + h * rate(product(q, turn(h / 2 * w, 1.0)), middle, inertia, torque)


def rotation_linear(q, w, h, inertia, torque):
    """q + h q'/2, put back to length one, in a method of order 2 that is called reversible."""
    middle = w + h / 2 * rate(q, w, inertia, torque)
    half = q + h / 4 * product(q, np.array([0.0, *w]))
    after = q + h / 2 * product(half / np.linalg.norm(half), np.array([0.0, *middle]))
    return after / np.linalg.norm(after), w + h * rate(half / np.linalg.norm(half), middle, inertia, torque)


def separable_no_half_square(state, h, dT, dV):
    """Velocity Verlet without its h^2/2."""
    theta, p = state
    force, theta = -dV(theta), theta + h * dT(p)
    return theta, p + h / 2 * (force - dV(theta))


def separable_stale(state, h, dT, dV):
    """Velocity Verlet whose first force is the last one of the call before."""
    theta, p = state
    p = p - h / 2 * _kept.get("force", dV(theta))
    theta = theta + h * dT(p)
    _kept["force"] = dV(theta)
    return theta, p - h / 2 * _kept["force"]


def separable_swapped(state, h, dT, dV):
    """Strang's splitting, its second half with the two flows exchanged: two steps of order 1."""
    theta, p = state
    for _ in range(2):
        p = p - h / 2 * dV(theta)
        theta = theta + h / 2 * dT(p)
    return theta, p


def separable_damped(state, h, dT, dV):
    """Verlet with a friction of a billionth, called symplectic."""
    theta, p = separable_good(state, h, dT, dV)
    return theta, p * (1 - 1e-9 * h)


def separable_good(state, h, dT, dV):
    theta, p = state
    p = p - h / 2 * dV(theta)
    theta = theta + h * dT(p)
    return theta, p - h / 2 * dV(theta)


KEPT = ["energy", "p_phi", "p_psi", "axis_length"]
ROTATION, SEPARABLE = {"form": "rotation"}, {"form": "separable"}
CLAIMS = {
    "early": ({"order": 4}, "time", {}),
    "sub_steps": ({"order": 2}, "order", {}),
    "averaged_field": ({"order": 2, "symmetric": True, "symplectic": True}, "symplectic", {"chart": "attitude"}),
    "hurried": ({"order": 2, "symmetric": True, "conserves": KEPT}, "order", {}),
    "root_of_the_step": ({"order": 2, "symmetric": True}, "symmetric", {}),
    "loose_gauss": ({"order": 4, "symmetric": True, "conserves": KEPT}, "energy", {}),
    "single_constants": ({"order": 3}, "order", {}),
    "first_momenta": ({"order": 4, "conserves": ["p_psi"]}, "calls", {}),
    "counted": ({"order": 4}, "calls", {}),
    "compensated": ({"order": 2}, "calls", {}),
    "poisoned": ({"order": 2, "symmetric": True}, "calls", {}),
    "rounded": ({"order": 4, "conserves": ["p_psi"]}, "p_psi", {}),
    "extrapolated": ({"order": 2}, "order", {}),
    "energy_clipped": ({"order": 4}, "order", {}),
    "AdamsBashforth3": ({"order": 3}, "order", {}),
    "OnlyForward": ({"order": 2, "symmetric": True}, "symmetric", {}),
    "rotation_whole_angle": ({"order": 2}, "order", ROTATION),
    "rotation_half_once": ({"order": 2}, "order", ROTATION),
    "rotation_linear": ({"order": 2, "symmetric": True}, "symmetric", ROTATION),
    "separable_no_half_square": ({"order": 2, "symplectic": True}, "order", SEPARABLE),
    "separable_stale": ({"order": 2}, "calls", SEPARABLE),
    "separable_swapped": ({"order": 2, "symplectic": True, "symmetric": True}, "order", SEPARABLE),
    "separable_damped": ({"order": 2, "symplectic": True}, "order", SEPARABLE),
}
