"""Methods that are not what they claim; `CLAIMS` has the claims, and the line that is to name the defect."""

import numpy as np
from scipy.integrate import RK45, OdeSolver


def rk4(f, t, y, h, weights=(1, 2, 2, 1)):
    k1 = f(t, y)
    k2 = f(t + h / 2, y + h / 2 * k1)
    k3 = f(t + h / 2, y + h / 2 * k2)
    k4 = f(t + h, y + h * k3)
    return y + h / 6 * sum(w * k for w, k in zip(weights, (k1, k2, k3, k4), strict=True))


def swapped_weights(f, t, y, h):
    """The last two weights are exchanged."""
    return rk4(f, t, y, h, (1, 2, 1, 2))


def stale_stage(f, t, y, h):
    """The third stage starts from the first slope."""
    k1 = f(t, y)
    k2 = f(t + h / 2, y + h / 2 * k1)
    k3 = f(t + h / 2, y + h / 2 * k1)
    k4 = f(t + h, y + h * k3)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def wrong_nodes(f, t, y, h):
    """Right for f(y), and f is asked at t + h where t + h/2 is meant."""
    k1 = f(t, y)
    k2 = f(t + h, y + h / 2 * k1)
    k3 = f(t + h, y + h / 2 * k2)
    k4 = f(t + h, y + h * k3)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


_last = {}


def averaged_with_the_past(f, t, y, h):
    """h/2 (f_n + f_(n-1)), as a flight simulator had it, called trapezoidal."""
    now = f(t, y)
    before = _last.get("slope", now)
    _last["slope"] = now
    return y + h / 2 * (now + before)


def stale_force(f, t, y, h):
    """The force of the step before in a midpoint rule."""
    force = _last.get("force")
    _last["force"] = f(t + h / 2, y + h / 2 * f(t, y))
    return y + h * (_last["force"] if force is None else force)


def symplectic_euler(f, t, y, h):
    """Euler's explicit method under another's name."""
    return y + h * f(t, y)


def sweeps(f, t, y, h, count):
    k = f(t, y)
    for _ in range(count):
        k = f(t + h / 2, y + h / 2 * k)
    return y + h * k


def one_sweep(f, t, y, h):
    """The implicit midpoint rule, its equation iterated once."""
    return sweeps(f, t, y, h, 1)


def four_sweeps(f, t, y, h):
    return sweeps(f, t, y, h, 4)


def loose(f, t, y, h):
    """The implicit midpoint rule to a tolerance of 1e-5."""
    k = f(t, y)
    for _ in range(100):
        after = f(t + h / 2, y + h / 2 * k)
        done = np.max(np.abs(after - k)) < 1e-5 * np.max(np.abs(k))
        k = after
        if done:
            break
    return y + h * k


def composed(f, t, y, h, outer, inner):
    for share in (outer, inner, outer):
        y, t = sweeps(f, t, y, share * h, 60), t + share * h
    return y


def rounded_triple(f, t, y, h):
    outer = 1 / (2 - 2 ** (1 / 3)) + 3e-8
    return composed(f, t, y, h, outer, 1 - 2 * outer)


def square_root_triple(f, t, y, h):
    outer = 1 / (2 - 2**0.5)
    return composed(f, t, y, h, outer, 1 - 2 * outer)


def six_digits(f, t, y, h):
    """Gauss's method of order 4 with the root of 3 over 6 to six digits."""
    root, k = 0.288675, np.array([f(t, y)] * 2)
    for _ in range(60):
        first = f(t + (0.5 - root) * h, y + h * (k[0] / 4 + (1 / 4 - root) * k[1]))
        k = np.array([first, f(t + (0.5 + root) * h, y + h * ((1 / 4 + root) * k[0] + k[1] / 4))])
    return y + h / 2 * (k[0] + k[1])


def long_step(f, t, y, h):
    return rk4(f, t, y, h * (1 + 1e-9))


def weak_gravity(f, t, y, h):
    """A constant of gravity of its own: 9.80665 for 9.81."""
    return rk4(lambda s, z: f(s, z) * np.array([1, 1, 1, *[9.80665 / 9.81] * 3]), t, y, h)


def single(f, t, y, h):
    """Its state is kept in single precision."""
    return rk4(f, t, y, h).astype(np.float32).astype(float)


def leaking(f, t, y, h):
    """A millionth of a millionth of the momentum is lost in each step."""
    return rk4(f, t, y, h) * np.array([1, 1, 1, *[1 - 1e-12] * 3])


_noise = np.random.default_rng()


def noisy(f, t, y, h):
    return rk4(f, t, y, h) * (1 + 1e-11 * _noise.standard_normal(6))


def damped(f, t, y, h):
    """The implicit Euler method, claimed to bound the energy."""
    k = f(t, y)
    for _ in range(60):
        k = f(t + h, y + h * k)
    return y + h * k


def projected(f, t, y, h):
    """rk4, its axis put back to length one in each step, called symplectic."""
    y = rk4(f, t, y, h)
    y[:3] /= np.sqrt(y[:3] @ y[:3])
    return y


def only_forward(f, t, y, h):
    """The size of the step is taken, whatever its sign, and the method called symmetric."""
    return sweeps(f, t, y, abs(h), 60)


def third_for_fourth(f, t, y, h):
    k1 = f(t, y)
    k2 = f(t + h, y + h * k1)
    k3 = f(t + h / 2, y + h / 4 * (k1 + k2))
    return y + h / 6 * (k1 + k2 + 4 * k3)


def product(a, b):
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))])


def turn(v):
    half = 0.5 * np.sqrt(v @ v)
    return np.array([np.cos(half), *(0.5 * np.sinc(half / np.pi) * v)])


def rates(w, inertia, torque, q):
    return (np.cross(inertia * w, w) + torque(q)) / inertia


def rotation_frames(q, w, h, inertia, torque):
    """The angular velocity of the body frame turns the body about space axes."""
    middle = w + h / 2 * rates(w, inertia, torque, q)
    half = product(turn(h / 2 * w), q)
    return product(turn(h * middle), q), w + h * rates(middle, inertia, torque, half)


def rotation_unnormalised(q, w, h, inertia, torque):
    """Explicit Euler for the quaternion, which nothing brings back to length one."""
    middle = w + h / 2 * rates(w, inertia, torque, q)
    half = q + h / 4 * product(q, np.array([0.0, *w]))
    return q + h / 2 * product(half, np.array([0.0, *middle])), w + h * rates(middle, inertia, torque, half)


def rotation_no_gyroscope(q, w, h, inertia, torque):
    """The gyroscopic term is left out, as engines do for stability."""
    middle = w + h / 2 * torque(q) / inertia
    half = product(q, turn(h / 2 * w))
    return product(q, turn(h * middle)), w + h * torque(half) / inertia


def rotation_semi_implicit(q, w, h, inertia, torque):
    """What engines do: first the velocity, then the attitude; claimed to be of order 2."""
    w = w + h * rates(w, inertia, torque, q)
    return product(q, turn(h * w)), w


class WrongTableau(RK45):
    """Dormand and Prince's tableau with two digits exchanged, 19327 for 19372, its row sum mended."""

    A = RK45.A.copy()
    A[4, 0] = 19327 / 6561
    A[4, 1] += 45 / 6561


class WrongAdams(OdeSolver):
    """The two-step method of Adams and Bashforth with weights 2 and -1 for 3/2 and -1/2."""

    slope = None

    def __init__(self, fun, t0, y0, t_bound, max_step=np.inf, vectorized=False, **_):
        super().__init__(fun, t0, y0, t_bound, vectorized)
        self.max_step = max_step

    def _step_impl(self):
        h = self.direction * min(self.max_step, abs(self.t_bound - self.t))
        now = self.fun(self.t, self.y)
        if self.slope is None:
            self.y = self.y + h * self.fun(self.t + h / 2, self.y + h / 2 * now)
        else:
            self.y = self.y + h * (2 * now - self.slope)
        self.slope = now
        self.t += h
        return True, None


KEPT = ["energy", "p_phi", "p_psi", "axis_length"]
CLAIMS = {
    "swapped_weights": ({"order": 4}, "order"),
    "stale_stage": ({"order": 4}, "order"),
    "wrong_nodes": ({"order": 4}, "time"),
    "averaged_with_the_past": ({"order": 2}, "calls"),
    "stale_force": ({"order": 2}, "calls"),
    "symplectic_euler": ({"order": 1, "symplectic": True}, "symplectic"),
    "one_sweep": ({"order": 2, "symmetric": True}, "symmetric"),
    "four_sweeps": ({"order": 2, "conserves": KEPT}, "energy"),
    "loose": ({"order": 2, "conserves": KEPT}, "energy"),
    "rounded_triple": ({"order": 4}, "order"),
    "square_root_triple": ({"order": 4}, "order"),
    "six_digits": ({"order": 4}, "order"),
    "long_step": ({"order": 4}, "order"),
    "weak_gravity": ({"order": 4}, "order"),
    "single": ({"order": 4, "conserves": ["p_phi"]}, "p_phi"),
    "leaking": ({"order": 4, "conserves": ["p_phi"]}, "p_phi"),
    "noisy": ({"order": 4}, "calls"),
    "damped": ({"order": 1, "energy": "bounded"}, "energy"),
    "projected": ({"order": 4, "symplectic": True}, "symplectic"),
    "only_forward": ({"order": 2, "symmetric": True}, "symmetric"),
    "third_for_fourth": ({"order": 4}, "order"),
    "rotation_frames": ({"order": 2}, "order"),
    "rotation_unnormalised": ({"order": 2, "conserves": ["axis_length"]}, "axis_length"),
    "rotation_no_gyroscope": ({"order": 2}, "order"),
    "rotation_semi_implicit": ({"order": 2}, "order"),
    "WrongTableau": ({"order": 5}, "order"),
    "WrongAdams": ({"order": 2}, "order"),
}
