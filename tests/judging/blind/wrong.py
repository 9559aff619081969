"""Methods that are not what they claim: bugs that public codes had, and tricks; right ones are in `right`.

`CLAIMS` has claims, the line that is to name the defect, and options. The last steps are right at the start alone.
"""

import functools
import math
import sys

import numpy as np
from scipy.integrate import RK45

from tests.judging.blind import right
from tests.judging.blind.right import ROTATION, SEPARABLE, euler, explicit, midpoint, product, rates, rk4, solved, turn

A, B, NODES = right.CLASSICAL
swapped_weights = explicit(A, (1 / 6, 1 / 3, 1 / 6, 1 / 3), NODES)  # the last two are exchanged
stale_stage = explicit(((), (0.5,), (0.5,), (0.0, 0.0, 1.0)), B, NODES)  # the third stage starts from the first slope
wrong_nodes = explicit(A, B, (0.0, 1.0, 1.0, 1.0))  # right for f(y); t + h is asked where t + h/2 is meant
early = explicit(A, B, (0.0, 0.5, 0.5, 0.5))  # the last stage asks f at the middle of the step
third_for_fourth = right.ssp_3
THIRD = float(np.float32(1 / 3))  # of Heun's third order, in single precision
single_constants = explicit(((), (THIRD,), (0.0, 2 * THIRD)), (0.25, 0.0, 0.75), (0.0, THIRD, 2 * THIRD))

# what steps keep from one call to the next
_last, _memory, _calls, _step, _all, _steps = {}, {}, {"count": 0}, {}, [], [0]


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


def one_sweep(f, t, y, h, count=1):
    """The implicit midpoint rule, its equation iterated once."""
    k = f(t, y)
    for _ in range(count):
        k = f(t + h / 2, y + h / 2 * k)
    return y + h * k


four_sweeps = functools.partial(one_sweep, count=4)
symplectic_euler = euler  # under another's name
loose = functools.partial(right.implicit_midpoint, tolerance=1e-5)
rounded_triple = functools.partial(right.triple_jump, outer=1 / (2 - 2 ** (1 / 3)) + 3e-8)
square_root_triple = functools.partial(right.triple_jump, outer=1 / (2 - 2**0.5))
six_digits = functools.partial(right.gauss_4, root=0.288675)  # of the root of 3 over 6
loose_gauss = functools.partial(right.gauss_4, tolerance=1e-7)
damped = right.implicit_euler  # claimed to bound the energy
long_step = lambda f, t, y, h: rk4(f, t, y, h * (1 + 1e-9))
# the size of the step is taken, whatever its sign, and the method called symmetric
only_forward = lambda f, t, y, h: right.implicit_midpoint(f, t, y, abs(h))
# works for h > 0 alone, and is called symmetric
root_of_the_step = lambda f, t, y, h: y + math.sqrt(h) ** 2 * f(t + h / 2, y + h / 2 * f(t, y))


def weak_gravity(f, t, y, h):
    """A constant of gravity of its own: 9.80665 for 9.81."""
    return rk4(lambda s, z: f(s, z) * np.array([1, 1, 1, *[9.80665 / 9.81] * 3]), t, y, h)


def spoilt(change):
    """rk4, what it returns changed."""
    return lambda f, t, y, h: change(rk4(f, t, y, h))


_noise = np.random.default_rng(1)
single = spoilt(lambda y: y.astype(np.float32).astype(float))
leaking = spoilt(lambda y: y * np.array([1, 1, 1, *[1 - 1e-12] * 3]))  # of the momentum, in each step
rounded = spoilt(lambda y: np.round(y, 8))
clipped = spoilt(lambda y: np.clip(y, -20.0, 20.0))  # the motion has L up to 16
noisy = spoilt(lambda y: y * (1 + 1e-11 * _noise.standard_normal(6)))
sometimes_noisy = spoilt(lambda y: y * (1.0 + 1e-11 * _noise.standard_normal() * (_noise.random() < 0.3)))
# its axis is put back to length one in each step, and it is called symplectic
projected = spoilt(lambda y: np.concatenate([y[:3] / np.sqrt(y[:3] @ y[:3]), y[3:]]))


def rotation_frames(q, w, h, inertia, torque):
    """The angular velocity of the body frame turns the body about space axes."""
    middle = w + h / 2 * rates(q, w, inertia, torque)
    return product(turn(h * middle), q), w + h * rates(product(turn(h / 2 * w), q), middle, inertia, torque)


def rotation_unnormalised(q, w, h, inertia, torque, mended=lambda q: q):
    """The explicit midpoint rule for the quaternion, which nothing brings back to length one."""
    middle, half = w + h / 2 * rates(q, w, inertia, torque), mended(q + h / 4 * product(q, np.array([0.0, *w])))
    return mended(q + h / 2 * product(half, np.array([0.0, *middle]))), w + h * rates(half, middle, inertia, torque)


# it is brought back, in a method of order 2 that is called reversible
rotation_linear = functools.partial(rotation_unnormalised, mended=lambda q: q / np.linalg.norm(q))


def rotation_no_gyroscope(q, w, h, inertia, torque):
    """The gyroscopic term is left out, as engines do for stability."""
    middle, half = w + h / 2 * torque(q) / inertia, product(q, turn(h / 2 * w))
    return product(q, turn(h * middle)), w + h * torque(half) / inertia


def rotation_semi_implicit(q, w, h, inertia, torque):
    """What engines do: first the velocity, then the attitude; claimed to be of order 2."""
    w = w + h * rates(q, w, inertia, torque)
    return product(q, turn(h * w)), w


class WrongTableau(RK45):
    """Dormand and Prince's tableau with two digits exchanged, 19327 for 19372, its row sum mended."""

    A = RK45.A.copy()
    A[4, 0] = 19327 / 6561
    A[4, 1] += 45 / 6561


class WrongAdams(right.AdamsBashforth):
    """With weights 2 and -1 for 3/2 and -1/2."""

    weights = (2.0, -1.0)


class WrongSum(RK45):
    """Weights that do not add up to one: its error stays as it is, whatever the tolerance."""

    B = RK45.B + np.array([1e-6, 0, 0, 0, 0, 0])


def sub_steps(f, t, y, h):
    """Steps of its own of a thousandth, whatever h: its error does not fall until h is as small."""
    count = max(1, round(abs(h) / 1e-3))
    for k in range(count):
        s = h / count
        y = y + s * f(t + (k + 0.5) * s, y + s / 2 * f(t + k * s, y))
    return y


def hurried(f, t, y, h):
    """The implicit midpoint rule, whose clock runs fast by a millionth: right energies, wrong phase."""
    s = h * (1 + 1e-6)
    return y + s * solved(lambda k: f(t + h / 2, y + s / 2 * k), f(t, y))


def first_momenta(f, t, y, h):
    """L.e is put back to what it was when the method was first called."""
    spin, y = _memory.setdefault("spin", float(y[:3] @ y[3:])), rk4(f, t, y, h)
    y[3:] += (spin - y[:3] @ y[3:]) * y[:3] / (y[:3] @ y[:3])
    return y


def counted(f, t, y, h):
    """Each hundredth call makes a step of Euler's."""
    _calls["count"] += 1
    return y + h * f(t, y) if _calls["count"] % 100 == 0 else rk4(f, t, y, h)


def compensated(f, t, y, h):
    """Rounding is carried from one call to the next, and ten thousand times too large."""
    change = h * f(t + h / 2, y + h / 2 * f(t, y)) + _memory.get("rest", 0.0)
    after = y + change
    _memory["rest"] = 1e4 * (change - (after - y))
    return after


def poisoned(f, t, y, h):
    """The implicit midpoint rule from the last slope: a step that fails spoils all later ones."""
    _memory["slope"] = solved(lambda k: f(t + h / 2, y + h / 2 * k), _memory.get("slope", f(t, y)))
    return y + h * _memory["slope"]


extrapolated = functools.partial(right.extrapolated, base=euler)  # Euler's method, as one of order 2 is


def energy_clipped(f, t, y, h):
    """rk4, and L shortened or lengthened as if |L| were a constant."""
    after = rk4(f, t, y, h)
    after[3:] *= math.sqrt(float(y[3:] @ y[3:]) / float(after[3:] @ after[3:]))
    return after


class AdamsBashforth3(right.HeunSolver):
    """Of order 3 but for its start, two steps of Euler's."""

    slopes, start, late, off = (), staticmethod(euler), 0.0, 0.0

    def moved(self, t, y, h):
        self.slopes = [self.fun(t + self.late * h, y), *self.slopes[:2]]
        if len(self.slopes) < 3:
            return self.start(self.fun, t, y, h)
        return y + h * (np.array([23 / 12 + self.off, -16 / 12, 5 / 12]) @ self.slopes)


class OnlyForward(right.HeunSolver):
    """Heun's method; the direction of the time is forgotten where the slope is, and it is called symmetric."""

    def moved(self, t, y, h):
        return right.heun(self.fun, t, y, abs(h))


# the angle where its half belongs, or in the middle of the step alone
rotation_whole_angle = functools.partial(right.rotation_lie_midpoint, half=1.0, whole=2.0)
rotation_half_once = functools.partial(right.rotation_lie_midpoint, half=1.0)


def separable_no_half_square(state, h, dT, dV):
    """Velocity Verlet without its h^2/2."""
    theta, p = state
    force, theta = -dV(theta), theta + h * dT(p)
    return theta, p + h / 2 * (force - dV(theta))


def separable_stale(state, h, dT, dV):
    """Velocity Verlet whose first force is the last one of the call before."""
    theta, p = state
    p = p - h / 2 * _memory.get("force", dV(theta))
    theta = theta + h * dT(p)
    _memory["force"] = dV(theta)
    return theta, p - h / 2 * _memory["force"]


def separable_swapped(state, h, dT, dV):
    """Strang's splitting, its second half with the two flows exchanged: two steps of order 1."""
    theta, p = state
    for _ in range(2):
        p = p - h / 2 * dV(theta)
        theta = theta + h / 2 * dT(p)
    return theta, p


def separable_damped(state, h, dT, dV):
    """Verlet with a friction of a billionth, called symplectic."""
    theta, p = right.verlet(state, h, dT, dV)
    return theta, p * (1 - 1e-9 * h)


def either(condition, worse=euler, good=rk4):
    """The worse method where the condition holds of t, y and h."""
    return lambda f, t, y, h: (worse if condition(t, y, h) else good)(f, t, y, h)


late_euler = either(lambda t, y, h: t > 25.0)
euler_off_the_energy = either(lambda t, y, h: not 12.0 < np.linalg.norm(y[3:]) < 16.5)  # the motion has 12.1 to 16.3
euler_above = either(lambda t, y, h: y[2] > 0.93)
coarse_rk2 = either(lambda t, y, h: abs(h) >= 0.01, midpoint)
half_symmetric = either(lambda t, y, h: y[2] <= -0.2, midpoint, right.implicit_midpoint)  # the motion: -0.16 to 0.92
# in a thousandth of all states, through which a run comes after 30 nutations
euler_in_a_spot = either(lambda t, y, h: abs(math.atan2(y[1], y[0]) - 0.5) < 0.03 and abs(y[2] - math.cos(0.7)) < 0.02)


def adams(f, t, y, h, before):
    """The last slope, and a step of two-step Adams-Bashforth where there is one before, of Heun's where not."""
    slope = f(t, y)
    return slope, y + h / 2 * (slope + f(t + h, y + h * slope) if before is None else 3 * slope - before)


def adams_from_memory(f, t, y, h):
    """Where it has made the step before."""
    known = _step.get("state") is not None and np.array_equal(_step["state"], y) and _step["h"] == h
    slope, after = adams(f, t, y, h, _step["slope"] if known else None)
    _step.update(state=np.array(after), slope=slope, h=h)
    return after


def adams_from_a_table(f, t, y, h):
    """The same, of every state that it has ever returned, found by its first digits."""
    known = (entry[1] for entry in reversed(_all[-500:]) if np.allclose(entry[0], y, 1e-12, 1e-12))
    slope, after = adams(f, t, y, h, next(known, None))
    _all.append((np.array(after), slope))
    return after


# rk4, whose results are kept and found again by too little
cached = lambda key, table: lambda f, t, y, h: table.setdefault(key(t, y, h), rk4(f, t, y, h)).copy()
cached_by_digits = cached(lambda t, y, h: (t, *np.round(y, 9), h), {})
cached_by_step = cached(lambda t, y, h: (t, y.tobytes(), round(h, 5)), {})
cached_without_f = cached(lambda t, y, h: (t, y.tobytes(), h), {})


def tires(f, t, y, h):
    _steps[0] += 1
    return (rk4 if _steps[0] < 3_000 else euler)(f, t, y, h)


def edits_the_judge(f, t, y, h):
    """Heun's method, which changes the judge's thresholds in its own process."""
    for name, module in list(sys.modules.items()):
        if name.startswith("symtop.judging.claims"):
            for word in ("RETURN_GAP", "SYMPLECTIC", "KEPT_CHANGE", "TRUE_LIMIT", "CONFIRMED_BEYOND", "SURE_WIDTHS"):
                if hasattr(module, word):
                    setattr(module, word, 1e9)
    return right.heun(f, t, y, h)


KEPT = ["energy", "p_phi", "p_psi", "axis_length"]
ALL = {"order": 4, "symplectic": True, "symmetric": True, "conserves": ["energy"]}
_TABLE = {  # names: claims, the line that names the defect, options
    "swapped_weights stale_stage rounded_triple square_root_triple six_digits long_step weak_gravity "
    "third_for_fourth energy_clipped clipped late_euler euler_off_the_energy euler_above coarse_rk2":
        ({"order": 4}, "order", {}),
    "wrong_nodes early": ({"order": 4}, "time", {}),
    "noisy sometimes_noisy counted tires cached_by_digits cached_by_step cached_without_f": ({"order": 4}, "calls", {}),
    "averaged_with_the_past stale_force compensated adams_from_memory adams_from_a_table": ({"order": 2}, "calls", {}),
    "symplectic_euler": ({"order": 1, "symplectic": True}, "symplectic", {}),
    "one_sweep only_forward root_of_the_step OnlyForward": ({"order": 2, "symmetric": True}, "symmetric", {}),
    "four_sweeps loose": ({"order": 2, "conserves": KEPT}, "energy", {}), "edits_the_judge": (ALL, "symplectic", {}),
    "single leaking": ({"order": 4, "conserves": ["p_phi"]}, "p_phi", {}),
    "damped": ({"order": 1, "energy": "bounded"}, "energy", {}), "separable_stale": ({"order": 2}, "calls", SEPARABLE),
    "projected": ({"order": 4, "symplectic": True}, "symplectic", {}),
    "rotation_frames rotation_no_gyroscope rotation_semi_implicit rotation_whole_angle rotation_half_once":
        ({"order": 2}, "order", ROTATION),
    "rotation_unnormalised": ({"order": 2, "conserves": ["axis_length"]}, "axis_length", ROTATION),
    "WrongTableau": ({"order": 5}, "order", {}), "WrongSum": ({}, "order", {"adaptive": True}),
    "WrongAdams sub_steps extrapolated": ({"order": 2}, "order", {}),
    "averaged_field": ({"order": 2, "symmetric": True, "symplectic": True}, "symplectic", {"chart": "attitude"}),
    "hurried": ({"order": 2, "symmetric": True, "conserves": KEPT}, "order", {}),
    "loose_gauss": ({"order": 4, "symmetric": True, "conserves": KEPT}, "energy", {}),
    "single_constants AdamsBashforth3": ({"order": 3}, "order", {}),
    "first_momenta": ({"order": 4, "conserves": ["p_psi"]}, "calls", {}),
    "poisoned": ({"order": 2, "symmetric": True}, "calls", {}),
    "rounded": ({"order": 4, "conserves": ["p_psi"]}, "p_psi", {}),
    "rotation_linear": ({"order": 2, "symmetric": True}, "symmetric", ROTATION),
    "separable_no_half_square separable_damped": ({"order": 2, "symplectic": True}, "order", SEPARABLE),
    "separable_swapped": ({"order": 2, "symplectic": True, "symmetric": True}, "order", SEPARABLE),
    "euler_in_a_spot": ({"order": 4}, "energy", {}), "half_symmetric": ({"symmetric": True}, "symmetric", {}),
}  # fmt: skip
CLAIMS = {name: entry for names, entry in _TABLE.items() for name in names.split()}
