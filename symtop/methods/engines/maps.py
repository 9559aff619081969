"""The maps of physics engines.

*Kicks.* The angular velocity changes first, then the body turns by it: the semi-implicit family. They differ in what
becomes of the gyroscopic term w x I_s w, which is why two engines disagree on a top and agree on a ball. All take tau
at the start of the step, and one evaluation of it. With L = I_s w and [v] x = v x x:

    none        w += h I_s^-1 tau
    explicit    w += h I_s^-1 (tau - w x L)
    implicit    w += h J^-1 (tau - w x L),    J = I + h ([w] I - [I w]) in body axes: one Newton step for the velocity
    rescaled    N = L - h w x L,  w = I_s^-1 N |L|/|N|                        turns L but keeps its length
    projected   (I_s - h [L]) w' = L                                          implicit in w, explicit in L

In body axes the third row of J is (0, 0, I3), so that the spin is kept and two equations are left,
I1 x + h (I1 - I3) w3 e x x = r; the projected form is solved below in closed form too. All are of order 1, but for the
first, which leaves out a term of the equations: it follows the spherical top with I3 := I1, started with the same w, at
any step. What `rescaled` keeps is |L|, not L: in a fast top the axis wanders away from L by (1 - I3/I1)^2 w3^2 h/2 a
second, relatively, until the body lies flat. Where N = 0, in a body at rest, it stays zero, as in the engines.

*Half kicks*, as in molecular dynamics, where L is what is carried: L += h tau/2 before and after a rotation of order 2,
not the exact one of a free body (`strang` takes that). With w(q, L) = R(q) I^-1 R(q)^T L and n(q) = q/|q|:

    richardson   q1 = n(q + h w q/2);  q2 = n(q + h w q/4), q2 = n(q2 + h w(q2, L) q2/4);  q <- n(2 q2 - q1)
    leapfrog     q_h = q + h w q/4, not normalised;  q <- n(q + h w' q_h/2),  w' = R(q_h) I^-1 A^T (L + h tau/2)
    no squish    exact turns q <- q exp(t (L_k/I_k) b_k) about s1 s2 s3 s2 s1 by h/2, h/2, h, h/2, h/2

The leapfrog is of order 2 with A = R(q_h), as Fincham published it; with A = R(q), as one code has it, of order 1. Each
turn of the last is the flow of one term of the kinetic energy, so that the step is symplectic on (q, L), symmetric and
of order 2; L.e is the momentum of one of the three turns only and wobbles. s3 is the axis of the smallest moment, as
LAMMPS sorts them: the result hangs on where the transverse axes of a symmetric body are put, here psi.

*Stages* of a Runge-Kutta method in the axes of the start of the step, q_i = q exp(Theta_i) and rates b_i:

    b_i = b + h sum_j a_ij b'_j,      Theta_i = h sum_j a_ij k_j,      k_i = dexp^-1(Theta_i) b_i   (Munthe-Kaas)

k_i = b_i, without dexp^-1, is of order 2 at most on a body that turns about more than one axis, whatever the tableau.
Sources: each engine's own file (`Integrator.reference`); Munthe-Kaas, Appl. Numer. Math. 29 (1999) 115; Fincham, Mol.
Simul. 8 (1992) 165; Miller, Eleftheriou, Pattnaik, Ndirango, Newns, Martyna, J. Chem. Phys. 116 (2002) 8649.
"""

from typing import Any

import numpy as np

from symtop.core.jit import register_jitable
from symtop.methods.engines.loop import (
    acceleration,
    axis,
    exponential,
    linear,
    momentum,
    normalised,
    rotated,
    torque,
    turned,
    velocity,
)
from symtop.methods.framework.loop import kernel_loop, no_carry
from symtop.methods.framework.space import finite_outcome, observe_attitude
from symtop.methods.vectors import cross, dot, plus, product, scaled


@register_jitable
def _pulled(par: Any, e: Any, w: Any, h: Any) -> Any:
    """w + h I_s^-1 tau."""
    return plus(w, h, velocity(par, e, torque(par, e)))


@register_jitable
def _gyroscopic(par: Any, e: Any, w: Any) -> Any:
    """w x I_s w."""
    return cross(w, momentum(par, e, w))


@register_jitable
def _implicit(par: Any, e: Any, w: Any, r: Any, h: Any) -> Any:
    """J^-1 r of a right side across the axis."""
    k = h * (par.I1 - par.I3) * dot(e, w)
    return scaled(par.one / (par.I1 * par.I1 + k * k), plus(scaled(par.I1, r), -k, cross(e, r)))


@register_jitable
def _rescaled(par: Any, e: Any, w: Any, h: Any) -> Any:
    """The gyroscopic term in an explicit step, at the length that L had."""
    L = momentum(par, e, w)
    N = plus(L, -h, cross(w, L))
    square = dot(N, N)
    stretch = np.sqrt(dot(L, L) / square) if square > 0 else par.zero  # a body at rest stays so, as in the engines
    return velocity(par, e, scaled(stretch, N))


def no_gyro(par: Any, rule: Any, e: Any, w: Any, carry: Any, h: Any) -> Any:
    """Torque alone, and the exponential."""
    w = _pulled(par, e, w, h)
    return exponential(par, w, h), w, carry


def no_gyro_linear(par: Any, rule: Any, e: Any, w: Any, carry: Any, h: Any) -> Any:
    """Torque alone, and a linear rotation."""
    w = _pulled(par, e, w, h)
    return linear(par, w, h), w, carry


def explicit(par: Any, rule: Any, e: Any, w: Any, carry: Any, h: Any) -> Any:
    """Torque and gyroscopic term at the start of the step."""
    rest = plus(torque(par, e), -par.one, _gyroscopic(par, e, w))
    w = plus(w, h, velocity(par, e, rest))
    return exponential(par, w, h), w, carry


def implicit(par: Any, rule: Any, e: Any, w: Any, carry: Any, h: Any) -> Any:
    """Both with the derivative of the gyroscopic term."""
    rest = plus(torque(par, e), -par.one, _gyroscopic(par, e, w))
    w = plus(w, h, _implicit(par, e, w, rest, h))
    return exponential(par, w, h), w, carry


def implicit_then_torque(par: Any, rule: Any, e: Any, w: Any, carry: Any, h: Any) -> Any:
    """The gyroscopic term implicit, the torque apart."""
    w = plus(w, -h, _implicit(par, e, w, _gyroscopic(par, e, w), h))
    w = _pulled(par, e, w, h)
    return exponential(par, w, h), w, carry


def rescaled_then_torque(par: Any, rule: Any, e: Any, w: Any, carry: Any, h: Any) -> Any:
    """The gyroscopic term at constant |L|, then the torque."""
    w = _pulled(par, e, _rescaled(par, e, w, h), h)
    return exponential(par, w, h), w, carry


def torque_then_rescaled(par: Any, rule: Any, e: Any, w: Any, carry: Any, h: Any) -> Any:
    """The torque, then the gyroscopic term at constant |L|, added as a change of w.

    In single precision that matters: what replaces w by I_s^-1 (I_s w) rounds it the same way in every step.
    """
    w = _pulled(par, e, w, h)
    L = momentum(par, e, w)
    N = plus(L, -h, cross(w, L))
    length = np.sqrt(dot(N, N))
    stretch = np.sqrt(dot(L, L)) / length if length > 0 else par.zero
    w = plus(w, par.one, velocity(par, e, plus(scaled(stretch, N), -par.one, L)))
    return exponential(par, w, h), w, carry


def substepped(par: Any, rule: Any, e: Any, w: Any, carry: Any, h: Any) -> Any:
    """Equal parts of the step, the torque's share of each taken once at the start; linear rotations."""
    part = rule.share * h
    pull = scaled(part, velocity(par, e, torque(par, e)))
    p = par.one, par.zero, par.zero, par.zero
    for _ in range(rule.parts):
        w = _rescaled(par, e, plus(w, par.one, pull), part)
        turn = linear(par, w, part)
        e, p = rotated(par, turn, e), product(turn, p)
    return p, w, carry


def projected_then_torque(par: Any, rule: Any, e: Any, w: Any, carry: Any, h: Any) -> Any:
    """(I_s - h [L]) w' = L, then the torque; a linear rotation.

    With L = a + l e and a across the axis: w3' = l (D + h^2 a.a)/(I3 D + h^2 I1 a.a) where D = I1^2 + h^2 l^2, and
    D w_a' = (I1 + h^2 l w3') a + h (l - I1 w3') e x a.
    """
    L = momentum(par, e, w)
    spin = dot(e, L)
    across = plus(L, -spin, e)
    D, stretch = par.I1 * par.I1 + h * h * spin * spin, h * h * dot(across, across)
    w3 = spin * (D + stretch) / (par.I3 * D + par.I1 * stretch)
    turn = plus(scaled(par.I1 + h * h * spin * w3, across), h * (spin - par.I1 * w3), cross(e, across))
    w = _pulled(par, e, plus(scaled(par.one / D, turn), w3, e), h)
    return linear(par, w, h), w, carry


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


@register_jitable
def _first_turn(par: Any, q: Any, L: Any, h: float) -> Any:
    """The turn about the body's first axis, with L in body axes."""
    x = 0.5 * h * L[0] / par.I1
    c, s = np.cos(x), np.sin(x)
    C, S = c * c - s * s, 2.0 * s * c
    q = q[0] * c - q[1] * s, q[1] * c + q[0] * s, q[2] * c + q[3] * s, q[3] * c - q[2] * s
    return q, (L[0], C * L[1] + S * L[2], C * L[2] - S * L[1])


@register_jitable
def _second_turn(par: Any, q: Any, L: Any, h: float) -> Any:
    """The turn about the body's second axis."""
    y = 0.5 * h * L[1] / par.I1
    c, s = np.cos(y), np.sin(y)
    C, S = c * c - s * s, 2.0 * s * c
    q = q[0] * c - q[2] * s, q[1] * c - q[3] * s, q[2] * c + q[0] * s, q[3] * c + q[1] * s
    return q, (C * L[0] - S * L[2], L[1], C * L[2] + S * L[0])


@register_jitable
def _third_turn(par: Any, q: Any, L: Any, h: float) -> Any:
    """The turn about the axis of symmetry."""
    z = 0.5 * h * L[2] / par.I3
    c, s = np.cos(z), np.sin(z)
    C, S = c * c - s * s, 2.0 * s * c
    q = q[0] * c - q[3] * s, q[1] * c + q[2] * s, q[2] * c - q[1] * s, q[3] * c + q[0] * s
    return q, (C * L[0] + S * L[1], C * L[1] - S * L[0], L[2])


def increment_no_squish(par: Any, rule: Any, state: Any, carry: Any, h: float) -> Any:
    """One step on (q, L); the free rotation leaves L in space as it is."""
    q, half = (state[0], state[1], state[2], state[3]), 0.5 * h
    kick = scaled(half, torque(par, axis(q)))
    kicked = state[4] + kick[0], state[5] + kick[1], state[6] + kick[2]
    L = plus(kicked, 1.0, turned((q[0], -q[1], -q[2], -q[3]), kicked))
    if par.I3 < par.I1:
        q, L = _first_turn(par, q, L, half)
        q, L = _second_turn(par, q, L, half)
        q, L = _third_turn(par, q, L, h)
        q, L = _second_turn(par, q, L, half)
        q, L = _first_turn(par, q, L, half)
    else:
        q, L = _third_turn(par, q, L, half)
        q, L = _second_turn(par, q, L, half)
        q, L = _first_turn(par, q, L, h)
        q, L = _second_turn(par, q, L, half)
        q, L = _third_turn(par, q, L, half)
    q = normalised(par, q)
    kick = plus(kick, half, torque(par, axis(q)))
    dstate = (
        q[0] - state[0], q[1] - state[1], q[2] - state[2], q[3] - state[3],
        *kick,
    )  # fmt: skip
    total = dstate[0] + dstate[1] + dstate[2] + dstate[3] + dstate[4] + dstate[5]
    return dstate, carry, 1, finite_outcome(total)


march_no_squish = kernel_loop(no_carry, increment_no_squish, observe_attitude)
