"""Engines with kicks by half a step, with several stages, or with the accelerations of the step before.

Half kicks, as in molecular dynamics, where L is what is carried: L += h tau/2 before and after the rotation, which is
not the exact one of a free body (`strang` takes that) but an approximation of order 2. With w(q, L) = R(q) I^-1 R(q)^T
L and n(q) = q/|q|:

    richardson   q1 = n(q + h w q/2);  q2 = n(q + h w q/4), q2 = n(q2 + h w(q2, L) q2/4);  q <- n(2 q2 - q1)
    leapfrog     q_h = q + h w q/4, not normalised;  q <- n(q + h w' q_h/2),  w' = R(q_h) I^-1 A^T (L + h tau/2)

The leapfrog is of order 2 with A = R(q_h), as Fincham published it; with A = R(q), as one code has it, of order 1.

Stages of a Runge-Kutta method are taken in the axes of the start of the step, q_i = q exp(Theta_i) and rates b_i:

    b_i = b + h sum_j a_ij b'_j,      Theta_i = h sum_j a_ij k_j,      k_i = dexp^-1(Theta_i) b_i   (Munthe-Kaas)

k_i = b_i, without dexp^-1, is of order 2 at most on a body that turns about more than one axis, whatever the tableau.
Source: Munthe-Kaas, Appl. Numer. Math. 29 (1999) 115; Fincham, Mol. Simul. 8 (1992) 165.
"""

from typing import Any

import numpy as np

from symtop.core.jit import register_jitable
from symtop.methods.engines.engine_parts import (
    acceleration,
    exponential,
    linear,
    momentum,
    normalised,
    rotated,
    torque,
    velocity,
)
from symtop.methods.vectors import cross, dot, plus, product, scaled

SMALL = 1e-4  # angle below which 1/12 is the coefficient of dexp^-1 to rounding (the next term is a^2/720)


@register_jitable
def _advanced(q: Any, w: Any, over: Any, h: Any) -> Any:
    """q + h (0, w) over/2."""
    rate = product((0.0, w[0], w[1], w[2]), over)
    half = 0.5 * h
    return q[0] + half * rate[0], q[1] + half * rate[1], q[2] + half * rate[2], q[3] + half * rate[3]


def richardson(par: Any, rule: Any, e: Any, L: Any, carry: Any, h: Any) -> Any:
    """Half kick, a rotation extrapolated from one and two linear ones, half kick."""
    L = plus(L, 0.5 * h, torque(par, e))
    w = velocity(par, e, L)
    full, half = linear(par, w, h), linear(par, w, 0.5 * h)
    half = product(linear(par, velocity(par, rotated(par, half, e), L), 0.5 * h), half)
    p = normalised(
        par, (2.0 * half[0] - full[0], 2.0 * half[1] - full[1], 2.0 * half[2] - full[2], 2.0 * half[3] - full[3])
    )
    return p, plus(L, 0.5 * h, torque(par, rotated(par, p, e))), carry


@register_jitable
def _leapfrog(par: Any, e: Any, L: Any, h: Any, published: bool) -> Any:
    one = 1.0, 0.0, 0.0, 0.0
    middle = _advanced(one, velocity(par, e, L), one, 0.5 * h)
    L = plus(L, 0.5 * h, torque(par, e))
    turn = normalised(par, middle)
    w = velocity(par, rotated(par, turn, e), L) if published else rotated(par, turn, velocity(par, e, L))
    p = normalised(par, _advanced(one, w, middle, h))
    return p, plus(L, 0.5 * h, torque(par, rotated(par, p, e)))


def fincham(par: Any, rule: Any, e: Any, L: Any, carry: Any, h: Any) -> Any:
    """The rotational leapfrog as published: the momentum in the body axes of the half step."""
    p, L = _leapfrog(par, e, L, h, True)
    return p, L, carry


def fincham_at_start(par: Any, rule: Any, e: Any, L: Any, carry: Any, h: Any) -> Any:
    """The same with the body axes of the start of the step."""
    p, L = _leapfrog(par, e, L, h, False)
    return p, L, carry


@register_jitable
def _slope(par: Any, e: Any, p: Any, b: Any) -> Any:
    """b' of rates in the axes of the start, where the body stands p further."""
    up = rotated(par, (p[0], -p[1], -p[2], -p[3]), (0.0, 0.0, 1.0))
    rest = plus(scaled(par.mgl, cross(up, e)), -1.0, cross(b, momentum(par, e, b)))
    return velocity(par, e, rest)


@register_jitable
def _straightened(turn: Any, b: Any) -> Any:
    """dexp^-1(turn) b = b + turn x b/2 + c turn x (turn x b), c = (1 - (a/2) cot(a/2))/a^2, a = |turn|."""
    square = dot(turn, turn)
    a = np.sqrt(square)
    c = (1.0 - 0.5 * a / np.tan(0.5 * a)) / square if a > SMALL else 1.0 / 12.0
    bent = cross(turn, b)
    return plus(plus(b, 0.5, bent), c, cross(turn, bent))


@register_jitable
def _kutta(par: Any, e: Any, b: Any, h: Any, exact: bool) -> Any:
    """Kutta's classical tableau; `exact` says whether the stages' turns are those of Munthe-Kaas."""
    turns = total = scaled(0.0, b)
    rates, slopes, gain = b, total, total
    for i in range(4):
        ahead = 0.0 if i == 0 else h if i == 3 else 0.5 * h
        weight = h / 3.0 if 0 < i < 3 else h / 6.0
        turn = scaled(ahead, turns)
        rates = plus(b, ahead, slopes)
        slopes = _slope(par, e, exponential(par, turn, 1.0), rates)
        turns = _straightened(turn, rates) if exact else rates
        total, gain = plus(total, weight, turns), plus(gain, weight, slopes)
    p = exponential(par, total, 1.0)
    return p, rotated(par, p, plus(b, 1.0, gain))


def runge_kutta_munthe_kaas(par: Any, rule: Any, e: Any, w: Any, carry: Any, h: Any) -> Any:
    """The classical tableau on the rotations' algebra: order 4."""
    p, w = _kutta(par, e, w, h, True)
    return p, w, carry


def runge_kutta_on_rates(par: Any, rule: Any, e: Any, w: Any, carry: Any, h: Any) -> Any:
    """The classical tableau with the stages' rates for their turns: order 2."""
    p, w = _kutta(par, e, w, h, False)
    return p, w, carry


def explicit_euler(par: Any, rule: Any, e: Any, w: Any, carry: Any, h: Any) -> Any:
    """Attitude and body rates both from the start of the step; a linear rotation."""
    p = linear(par, w, h)
    return p, rotated(par, p, plus(w, h, acceleration(par, e, w))), carry


def adams_bashforth(par: Any, rule: Any, e: Any, w: Any, carry: Any, h: Any) -> Any:
    """Body rates by two steps of Adams and Bashforth, the attitude by a series of Magnus to third order.

    `carry` is the acceleration of the body rates at the start of the step before, turned with the body.
    """
    now = acceleration(par, e, w)
    p = exponential(par, plus(plus(w, 0.5 * h, now), h * h / 12.0, cross(now, w)), h)
    w = plus(plus(w, 1.5 * h, now), -0.5 * h, carry)
    return p, rotated(par, p, w), rotated(par, p, now)
