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

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from symtop.core.jit import register_jitable
from symtop.methods.framework.loop import Loop, no_carry
from symtop.methods.lagrangian.discrete_lagrangian import RULES, quadrature
from symtop.model.charts import Array

ONE_SIDED = "force-at-one-end"  # the midpoint rule with the whole force in F_d^-, a negative control of order 1


class Oscillator(NamedTuple):
    """A mass on a spring with a viscous damper; all three are floats, of which the damping may be zero."""

    mass: float = 1.0
    damping: float = 0.0
    stiffness: float = 1.0

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
    push: float  # share of the force that F_d^- has: sum w (1-a) by virtual work
    pull: float  # and F_d^+: sum w a


def rule_sums(method: str) -> Sums:
    """The sums of a rule of `discrete_lagrangian` by its name, or of `ONE_SIDED`."""
    rule = quadrature(*RULES["midpoint" if method == ONE_SIDED else method][:2])[0]
    a, w = np.array(rule.nodes), np.array(rule.weights)
    left, right = float(np.sum(w * (1.0 - a))), float(np.sum(w * a))
    push, pull = (1.0, 0.0) if method == ONE_SIDED else (left, right)
    return Sums(left, right, float(np.sum(w * a * (1.0 - a))), float(np.sum(w * a * a)), push, pull)


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


def legendre(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """Both discrete Legendre transforms of the step: -D1 L_d - F_d^- and D2 L_d + F_d^+."""
    first, last = _stiffnesses(par, rule, h)
    push = h * par.stiffness * before[0]
    return first * dstate[0] + rule.left * push, last * dstate[0] - rule.right * push


_march = Loop(no_carry, _increment, legendre)


def discrete_path(
    oscillator: Oscillator, rule: Sums, position: float, velocity: float, horizon: float, steps: int,
    samples: int = 2001,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Times, positions and momenta from p0 = m x'(0) on, at `samples` of the steps (all of them if there are fewer)."""
    marks = np.unique(np.rint(np.linspace(0.0, steps, min(samples, steps + 1))).astype(np.int64))
    h, start = horizon / steps, (position, oscillator.mass * velocity)
    states = _march(oscillator, rule, start, h, marks).states
    return marks.astype(np.float64) * h, states[:, 0], states[:, 1]


def notebook_positions(damping: float, h: float, first: float, second: float, steps: int) -> tuple[Array, Array]:
    """The notebook's update and its guess at the forces, for m = k = 1: positions of both, shape (steps + 1,).

    update    x[k+2] = ((-4 + 2 b h - h^2) x[k] + 2 (4 - h^2) x[k+1]) / (4 + 2 b h + h^2), the midpoint rule above
    guess     (x[k+2] - 2 x[k+1] + x[k])/h^2 = -(V'(x[k+1/2]) + V'(x[k+3/2]) + 2 dF/dx')/2 with dF/dx' = -b

    The guess has dF/dx' where F belongs, and with the sign of V': a constant push and no damping at all.
    """
    update, guess = [first, second], [first, second]
    old, new, divisor = -4.0 + 2.0 * damping * h - h * h, 2.0 * (4.0 - h * h), 4.0 + 2.0 * damping * h + h * h
    for _ in range(steps - 1):
        update.append((old * update[-2] + new * update[-1]) / divisor)
        guess.append((new * guess[-1] - (4.0 + h * h) * guess[-2] + 4.0 * h * h * damping) / (4.0 + h * h))
    return np.array(update), np.array(guess)
