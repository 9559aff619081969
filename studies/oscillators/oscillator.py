"""The damped oscillator by forced discrete Euler-Lagrange equations, and its exact solution.

    m x'' + b x' + k x = 0,      L = m x'^2/2 - k x^2/2,      F = -b x'

A rule with nodes a_i and weights w_i on the straight line from q0 to q1 = q0 + d gives the discrete Lagrangian and,
from the virtual work of F on the same line, the two discrete forces

    L_d = h sum w_i L(q0 + a_i d, d/h),     F_d^- = h sum w_i (1-a_i) F(d/h),     F_d^+ = h sum w_i a_i F(d/h)

and the forced discrete Euler-Lagrange equations  D1 L_d(q1, q2) + D2 L_d(q0, q1) + F_d^-(q1, q2) + F_d^+(q0, q1) = 0,
here in position-momentum form (one step, and the momentum that it hands on):

    p0 = -D1 L_d - F_d^- = m d/h + h k sum w_i (1-a_i) (q0 + a_i d) + b d sum w_i (1-a_i)
    p1 =  D2 L_d + F_d^+ = m d/h - h k sum w_i a_i     (q0 + a_i d) - b d sum w_i a_i

Order 2 for a symmetric rule, 1 if all of the force is put at one end. For the midpoint rule the step is the Cayley
transform of the exact generator: critical damping stays where it is, and without damping the energy is
conserved. The trapezoidal rule moves critical damping from b^2 = 4 m k to 4 m k - (k h)^2.
Source: Marsden and West, Discrete mechanics and variational integrators, Acta Numerica 10 (2001) 357, part three.
"""

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symtop.base.validate import SymtopError, finite, positive, whole
from symtop.methods.compiled import register_jitable
from symtop.methods.loop import driver
from symtop.methods.quadrature import RULES, Quadrature, quadrature

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Oscillator:
    """A mass on a spring with a viscous damper."""

    mass: float = 1.0
    damping: float = 0.0
    stiffness: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "mass", positive("mass", self.mass))
        object.__setattr__(self, "stiffness", positive("stiffness", self.stiffness))
        if finite("damping", self.damping) < 0.0:
            raise SymtopError(f"damping must be at least zero, not {self.damping!r}")
        object.__setattr__(self, "damping", float(self.damping))

    @property
    def discriminant(self) -> float:
        """b^2 - 4 m k: negative if underdamped, zero if critically damped."""
        return self.damping**2 - 4.0 * self.mass * self.stiffness

    @property
    def regime(self) -> str:
        """Undamped, underdamped, critically damped or overdamped."""
        if self.damping == 0.0:
            return "undamped"
        if self.discriminant == 0.0:
            return "critically damped"
        return "underdamped" if self.discriminant < 0.0 else "overdamped"

    def exponents(self) -> tuple[complex, complex]:
        """The two exponents of exp(lambda t), the slower decay first; no cancellation."""
        half = self.damping / (2.0 * self.mass)
        if self.discriminant < 0.0:
            omega = math.sqrt(-self.discriminant) / (2.0 * self.mass)
            return complex(-half, omega), complex(-half, -omega)
        fast = -half - math.sqrt(self.discriminant) / (2.0 * self.mass)
        return complex(self.stiffness / (self.mass * fast)), complex(fast)

    def exact(self, times: ArrayLike, position: float, velocity: float) -> tuple[Array, Array]:
        """Position and velocity at the given times; accurate in every regime, critical damping included."""
        t = np.asarray(times, float)
        slow, fast = self.exponents()
        if self.discriminant < 0.0:
            omega, decay = slow.imag, np.exp(slow.real * t)
            even, odd = decay * np.cos(omega * t), decay * np.sin(omega * t) / omega
        else:
            spread = slow.real - fast.real
            decay = np.exp(slow.real * t)
            odd = decay * (t if spread == 0.0 else -np.expm1(-spread * t) / spread)  # decay sinh(s t/2)/(s/2)
            even = decay - 0.5 * spread * odd
        half, square = self.damping / (2.0 * self.mass), self.stiffness / self.mass
        return (
            position * even + (velocity + half * position) * odd,
            velocity * even - (half * velocity + square * position) * odd,
        )

    def energy(self, position: Any, momentum: Any) -> Any:
        """Kinetic and potential energy."""
        return 0.5 * momentum**2 / self.mass + 0.5 * self.stiffness * position**2


class Sums(NamedTuple):
    """The four sums over nodes a and weights w, and the two shares of the force, that a linear step needs of a rule."""

    left: float  # sum w (1-a)
    right: float  # sum w a
    cross: float  # sum w a (1-a)
    square: float  # sum w a^2
    push: float  # share of the force that F_d^- has
    pull: float  # and F_d^+


def rule_sums(rule: "str | Quadrature", left_force: float | None = None) -> Sums:
    """The sums of a rule; `left_force` overrides the share of the force that acts at the start of a step.

    By virtual work the shares follow from the rule (1/2 and 1/2 for a symmetric one); all of it at the left end is the
    simplest choice in the literature, and of order 1.
    """
    numbers = quadrature(*RULES[rule][:2])[0] if isinstance(rule, str) else rule
    a, w = np.array(numbers.nodes), np.array(numbers.weights)
    left, right = float(np.sum(w * (1.0 - a))), float(np.sum(w * a))
    push = left if left_force is None else finite("left_force", left_force)
    pull = right if left_force is None else 1.0 - push
    return Sums(left, right, float(np.sum(w * a * (1.0 - a))), float(np.sum(w * a * a)), push, pull)


class _Numbers(NamedTuple):
    mass: float
    damping: float
    stiffness: float


def _begin(par: Any, rule: Any, state: Any, h: float) -> Any:
    return (0.0,)


@register_jitable
def _stiffnesses(par: Any, rule: Any, h: float) -> Any:
    """Coefficients of d in p0 and in p1."""
    free, spring = par.mass / h, h * par.stiffness
    return free + spring * rule.cross + par.damping * rule.push, free - spring * rule.square - par.damping * rule.pull


def _increment(par: Any, rule: Any, state: Any, carry: Any, h: float) -> Any:
    """One step on (q, p): d from p0, then p1."""
    before, after = _stiffnesses(par, rule, h)
    d = (state[1] - h * par.stiffness * rule.left * state[0]) / before
    # p1 - p0 without the large m d/h, so that a small step loses nothing
    kick = -h * par.stiffness * (rule.left + rule.right) * state[0] - (before - after) * d
    return (d, kick), carry, 1, 0 if np.isfinite(d) else 3


def _observe(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """Both discrete Legendre transforms of the step: -D1 L_d - F_d^- and D2 L_d + F_d^+."""
    first, last = _stiffnesses(par, rule, h)
    push = h * par.stiffness * before[0]
    return first * dstate[0] + rule.left * push, last * dstate[0] - rule.right * push


_march = driver(_begin, _increment, _observe)


def start_momentum(oscillator: Oscillator, rule: Sums, first: float, second: float, h: float) -> float:
    """p0 = -D1 L_d - F_d^- of the step from one position to the next: the start of a two-step method in this form."""
    par = _Numbers(oscillator.mass, oscillator.damping, oscillator.stiffness)
    return float(_observe(par, rule, (first, 0.0), (second - first, 0.0), h)[0])


class Path(NamedTuple):
    """A discrete motion at some of its steps."""

    times: Array
    position: Array
    momentum: Array
    step_size: float


def discrete_path(
    oscillator: Oscillator, rule: "str | Sums", position: float, velocity: float, horizon: float, steps: int,
    samples: int = 2001,
) -> Path:  # fmt: skip
    """The discrete motion from p0 = m x'(0), at `samples` of its steps (all of them if there are fewer)."""
    count = whole("steps", steps, 1)
    marks = np.unique(np.rint(np.linspace(0.0, count, min(samples, count + 1))).astype(np.int64))
    h = positive("horizon", horizon) / count
    sums = rule_sums(rule) if isinstance(rule, str) else rule
    par = _Numbers(oscillator.mass, oscillator.damping, oscillator.stiffness)
    start = (finite("position", position), oscillator.mass * finite("velocity", velocity))
    states = _march(par, sums, start, h, marks).states
    return Path(marks.astype(np.float64) * h, states[:, 0], states[:, 1], h)


def discrete_exponents(oscillator: Oscillator, rule: "str | Sums", h: float) -> tuple[complex, complex]:
    """log(z)/h of the two eigenvalues z of the step map, the slower decay first: the exponents of the discrete motion.

    In positions alone the step reads A q2 - B q1 + C q0 = 0 with A - C = b, whatever the rule, and the discriminant
    B^2 - 4 A C = (b + h k (r-l))^2 - 4 m k + 4 (h k)^2 (s - r^2) + 4 b h k (f - r), free of cancellation
    (l, r, s, f: the sums `left`, `right`, `square`, `pull`).
    """
    sums = rule_sums(rule) if isinstance(rule, str) else rule
    par = _Numbers(oscillator.mass, oscillator.damping, oscillator.stiffness)
    first, last = _stiffnesses(par, sums, h)
    b, spring = oscillator.damping, h * oscillator.stiffness
    middle = first + last - spring * sums.left
    discriminant = (b + spring * (sums.right - sums.left)) ** 2 - 4.0 * oscillator.mass * oscillator.stiffness
    discriminant += 4.0 * spring * (spring * (sums.square - sums.right**2) + b * (sums.pull - sums.right))
    root = cmath.sqrt(discriminant)
    if b < 0.5 * first and abs(root) < 0.5 * middle:  # z near 1: its logarithm without cancellation
        mean, half = complex(math.log1p(-b / first) / (2.0 * h)), cmath.atanh(root / middle) / h
        exponents = [mean + half, mean - half]
    else:
        eigenvalues = ((middle + root) / (2.0 * first), (middle - root) / (2.0 * first))
        exponents = [cmath.log(z) / h if z != 0.0 else complex(-math.inf) for z in eigenvalues]
    slow, fast = sorted(exponents, key=lambda exponent: (-exponent.real, -exponent.imag))
    return slow, fast


def notebook_update(damping: float, h: float, first: float, second: float, steps: int) -> Array:
    """The notebook's own recurrence for m = k = 1, positions only, shape (steps + 1,).

    x[k+2] = ((-4 + 2 b h - h^2) x[k] + 2 (4 - h^2) x[k+1]) / (4 + 2 b h + h^2): the midpoint rule above.
    """
    x = [first, second]
    before, now, ahead = -4.0 + 2.0 * damping * h - h * h, 2.0 * (4.0 - h * h), 4.0 + 2.0 * damping * h + h * h
    for _ in range(steps - 1):
        x.append((before * x[-2] + now * x[-1]) / ahead)
    return np.array(x)


def notebook_guess(damping: float, h: float, first: float, second: float, steps: int) -> Array:
    """The notebook's guess for the forces, for m = k = 1: dF/dx' where F belongs, and with the sign of V'.

    (x[k+1] - 2 x[k] + x[k-1])/h^2 = -(V'(x[k-1/2]) + V'(x[k+1/2]) + 2 dF/dx')/2 with dF/dx' = -b: a constant push
    and no damping at all, an oscillation about x = b.
    """
    x = [first, second]
    for _ in range(steps - 1):
        x.append((2.0 * (4.0 - h * h) * x[-1] - (4.0 + h * h) * x[-2] + 4.0 * h * h * damping) / (4.0 + h * h))
    return np.array(x)


def relative_energy_error(oscillator: Oscillator, path: Path, position: float, velocity: float) -> Array:
    """E_h(t)/E(t) - 1 along a discrete motion."""
    x, v = oscillator.exact(path.times, position, velocity)
    true = oscillator.energy(x, oscillator.mass * v)
    error: Array = oscillator.energy(path.position, path.momentum) / true - 1.0
    return error


def step_counts(horizon: float, steps: Sequence[float]) -> list[int]:
    """Whole numbers of steps over the horizon, nearest to the given step sizes."""
    return [max(1, round(horizon / h)) for h in steps]
