"""The rotation that a drift in the space frame is, from the square of half its angle.

The free top turns about L by the angle 2 x, x = tau |L| with tau = a h/2 I1. Its quaternion is (w, s L),

    exact      s = sin(x)/|L|,                      w = cos(x)
    cayley     s = tau/sqrt(1 + tau^2 |L|^2),       w = 1/sqrt(1 + tau^2 |L|^2)

and increments are computed from m = w - 1. Both rotations are functions of x^2 and tau alone. The exact one has a
branch: a series where x < 1, sine and cosine beyond. Lanes take the series and return whether x < 1.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from symtop.core.jit import register_jitable

# sin(x)/x and (1 - cos(x))/x^2 in powers of -x^2; nine terms leave 1e-17 for |x| < 1
SINE = tuple(1.0 / math.factorial(2 * k + 1) for k in range(9))
COSINE = tuple(1.0 / math.factorial(2 * k + 2) for k in range(9))

EXACT, CAYLEY, TUNED = range(3)
ROTATIONS = ("exact", "cayley", "cayley-tuned")


@register_jitable
def series(x: float, c: Any) -> Any:
    """c_0 - c_1 x + c_2 x^2 - ..., nine terms by pairs: half the latency of Horner's rule."""
    y = x * x
    z = y * y
    low = (c[0] - c[1] * x) + y * (c[2] - c[3] * x)
    high = (c[4] - c[5] * x) + y * (c[6] - c[7] * x)
    return low + z * (high + z * c[8])


@register_jitable
def half_square(state: Any, step: Any, half: float) -> Any:
    """The square of half the angle that a drift turns by, |half L|^2."""
    Lx, Ly, Lz = state[-3] + step[-3], state[-2] + step[-2], state[-1] + step[-1]
    return half * half * (Lx * Lx + Ly * Ly + Lz * Lz)


@register_jitable
def cayley(square: float, half: float) -> Any:
    """s and m of a Cayley drift."""
    root = np.sqrt(1.0 + square)
    return half / root, -square / (root * (1.0 + root))


@register_jitable
def near(square: float, half: float) -> Any:
    """s and m for an angle below 2: no root, no division, no pole at L = 0."""
    return half * series(square, SINE), -square * series(square, COSINE)


@register_jitable
def rotor(rule: Any, square: float, half: float) -> Any:
    """s and m: the rotation about L by the angle 2 half |L| has the quaternion (1 + m, s L)."""
    return cayley(square, half) if rule.turn != EXACT else exact(square, half)


@register_jitable
def exact(square: float, half: float) -> Any:
    """s and m of an exact drift, for any angle."""
    if square < 1.0:
        return near(square, half)
    x = np.sqrt(square)
    sin, cos = np.sin(0.5 * x), np.cos(0.5 * x)
    return half * (2.0 * sin * cos / x), -2.0 * sin * sin


def without_branch(rotate: Callable[..., Any]) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """An exact and a Cayley drift for lanes, as `loop.composed` takes them, with a flag: is the result accurate?"""

    def exact(par, state, step, half):  # type: ignore[no-untyped-def]
        square = half_square(state, step, half)
        s, m = near(square, half)
        return rotate(state, step, s, m), square < 1.0

    def by_cayley(par, state, step, half):  # type: ignore[no-untyped-def]
        s, m = cayley(half_square(state, step, half), half)
        return rotate(state, step, s, m), True

    return exact, by_cayley
