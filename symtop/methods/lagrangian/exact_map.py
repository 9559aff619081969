"""The numbers of the exact step of `exact_discrete`, from a top, a start and a step.

    (A - 1) D, D, r, 1/r, delta of both oscillators        r = sqrt(D), of the sign of the step; delta in turns

At a step beyond half a nutation they are those of the rest after whole nutations, and delta counts these. Where
P - e2 is a small difference of large numbers, next to a separatrix, the step is made of equal parts. Compiled, in
double: A^2 - 1 is put together without the difference of two numbers near 1, and the roots come in differences only.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from symtop.core.jit import register_jitable
from symtop.methods.framework.preparation import Scaled
from symtop.methods.lagrangian.oscillators import oscillator_numbers
from symtop.model.exact.elliptic import differences, half_period, r_j, roots
from symtop.model.top import Angles, SymmetricTop

SHORTEST = 1e-100  # of a step, and of what is left of one that is a whole number of nutations
STEEPEST = 16.0  # (P - e3)/(P - e2): what rounding of the constants is amplified by
MOST_PARTS = 1000
NEXT_TO_ROOT = 1e-4
TINY = 1e-300  # in the place of a root that is a zero of chi: J is zero, too


class Map(NamedTuple):
    """The numbers of the step of one start, of both oscillators."""

    aD1: float = 0.0  # (A - 1) D
    D1: float = 1.0
    r1: float = 1.0
    q1: float = 1.0  # 1/r
    turn1: float = 0.0  # delta in turns
    aD2: float = 0.0
    D2: float = 1.0
    r2: float = 1.0
    q2: float = 1.0
    turn2: float = 0.0
    kappa: float = 0.0
    half_turns: float = 0.0  # of a step, beside delta: 1 where it leaves out an odd number of nutations
    parts: float = 1.0  # steps of the map in a step


@register_jitable
def one_oscillator(above: Any, g2: float, g3: float, sigma: float, b: float, J: float) -> Any:
    """(A - 1) D, D and delta of any planar quartic oscillator at 0 < h <= T/2; `above` is P - e_i, and P their mean."""
    P = (above[0] + above[1] + above[2]) / 3.0
    D = P - b
    y = 1.0 / D
    q = 1.0 + b * y  # P/D
    # A^2 - 1 without the difference of two numbers near 1
    gap = 0.25 * y * (12.0 * b * q * q + y * ((4.0 * b * b * b - g3) * y - (g2 + 12.0 * b * b) * q))
    x1, x2, x3 = above[0] * y, above[1] * y, above[2] * y
    delta = sigma * J * y * math.sqrt(y) * r_j(x1, x2, x3, 1.0) / 3.0
    return gap / (1.0 + math.sqrt(x1 * x2 * x3)) * D, D, delta


@register_jitable
def _whole_turn(e: Any, sigma: float, b: float, J: float) -> float:
    """delta of one nutation; where b is next to the root e1 that bounds it, J and the integral are 0 times infinity."""
    rest = max(e.e1 - b, TINY)
    turn = sigma * J
    if rest < NEXT_TO_ROOT * (e.e1 - e.e3):
        turn = math.copysign(math.sqrt(rest * abs(b - e.e2) * abs(b - e.e3)), turn)
    return 2.0 * turn * r_j(0.0, e.e1 - e.e2, e.e1 - e.e3, rest) / 3.0


@register_jitable
def _turned(e: Any, above: Any, par: Any, sigma: float, b: float, J: float, sign: float, nutations: float) -> Any:
    """(A - 1) D, D, r, 1/r and delta in turns of one oscillator, for a step of so many nutations and a rest."""
    aD, D, delta = one_oscillator(above, par.g2, par.g3, sigma, b, J)
    delta *= sign
    if nutations != 0.0:
        delta += nutations * _whole_turn(e, sigma, b, J)
    r = sign * math.sqrt(D)
    return aD, D, r, 1.0 / r, delta / (2.0 * math.pi)


def _mapped(rule: Any, top: Any, at: Any, h: float) -> Any:
    """The numbers of the step h from a start; `rule` says nothing but their type."""
    par, s = oscillator_numbers(top, at)
    e = roots(par.g2, par.g3)
    half = half_period(e)
    nutations = np.rint(0.5 * h / half)
    rest = h - 2.0 * nutations * half if nutations != 0.0 else h
    parts = 1
    above = differences(e, max(abs(rest), SHORTEST))
    while above[2] > STEEPEST * above[1] and parts < MOST_PARTS:
        parts += 1
        nutations = np.rint(0.5 * h / parts / half)
        rest = h / parts - 2.0 * nutations * half if nutations != 0.0 else h / parts
        above = differences(e, max(abs(rest), SHORTEST))
    sign = 1.0 if rest >= 0.0 else -1.0
    J1, J2 = s[0] * s[5] - s[1] * s[4], s[2] * s[7] - s[3] * s[6]
    aD1, D1, r1, q1, turn1 = _turned(e, above, par, par.kappa, par.b1, J1, sign, nutations)
    aD2, D2, r2, q2, turn2 = _turned(e, above, par, -par.kappa, par.b2, J2, sign, nutations)
    odd = nutations - 2.0 * np.floor(0.5 * nutations)
    return Map(aD1, D1, r1, q1, turn1, aD2, D2, r2, q2, turn2, par.kappa, odd, float(parts))


numbers = Scaled(Map(), _mapped)


def exact_map(top: SymmetricTop, start: Angles, h: float) -> Map:
    """The numbers of the exact step h from a start: 2 us."""
    made: Map = numbers(top, start, h)
    return made
