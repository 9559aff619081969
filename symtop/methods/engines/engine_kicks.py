"""Engines that change the angular velocity first and then turn the body by it: the semi-implicit family.

They differ in what becomes of the gyroscopic term w x I_s w, which is why two engines disagree on a top and agree on a
ball. All take tau at the start of the step, and one evaluation of it. With L = I_s w:

    none        w += h I_s^-1 tau
    explicit    w += h I_s^-1 (tau - w x L)
    implicit    w += h J^-1 (tau - w x L),    J = I + h ([w] I - [I w]) in body axes: one Newton step for the velocity
    rescaled    N = L - h w x L,  w = I_s^-1 N |L|/|N|                        turns L but keeps its length
    projected   (I_s - h [L]) w' = L                                          implicit in w, explicit in L

where [v] x = v x x. In body axes the third row of J is (0, 0, I3), so that the spin is kept and two equations are left,
I1 x + h (I1 - I3) w3 e x x = r; the projected form is solved below in closed form too. All are of order 1, but for the
first, which leaves out a term of the equations: it follows the spherical top with I3 := I1, started with the same w, at
any step. What `rescaled` keeps is |L|, not L: in a fast top the axis wanders away from L by (1 - I3/I1)^2 w3^2 h/2 a
second, relatively, until the body lies flat. Where N = 0, in a body at rest, it stays zero, as in the engines.
Sources: each engine's own file, `Integrator.reference`.
"""

from typing import Any

import numpy as np

from symtop.core.jit import register_jitable
from symtop.methods.engines.engine_parts import exponential, linear, momentum, rotated, torque, velocity
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
