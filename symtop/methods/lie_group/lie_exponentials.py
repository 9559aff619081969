"""Exponentials of se(3) as they act on the axis and the momentum, for one top and for many in lanes.

With a = |w|, the action of exp(w, f) is

    e <- R e,   L <- R L + b x R e,      R = exp(w),   b = (1 + B w x + C w x w x) f,
    B = (1 - cos a)/a^2 = 2 s^2,   C = (a - sin a)/a^3,      the quaternion of R = (1 + m, s w),

where s, m and C are functions of the square of half the angle alone: series where that is less than 1, sine and cosine
beyond. Lanes take the series (`near`) and say whether they were right to.
"""

import math
from typing import Any

from symtop.core.jit import register_jitable
from symtop.methods.lie_group.lie_loop import moved
from symtop.methods.splitting.rotor import COSINE, SINE, series
from symtop.methods.vectors import cross, dot, plus, scaled

CUBIC = tuple(1.0 / math.factorial(2 * k + 3) for k in range(9))  # C in powers of -a^2
NOUGHT = (0.0, 0.0, 0.0)


@register_jitable
def half_square(w: Any) -> float:
    """The square of half the angle of exp(w, f)."""
    square: float = 0.25 * dot(w, w)
    return square


@register_jitable
def near(square: float) -> Any:
    """s, m and C of an exponential that turns by less than two radians, of the square of half the angle."""
    s, m = 0.5 * series(square, SINE), -square * series(square, COSINE)
    return s, m, series(4.0 * square, CUBIC)


@register_jitable
def any_angle(square: float) -> Any:
    """The same of any angle."""
    if square < 1.0:
        return near(square)
    x = math.sqrt(square)
    half = math.sin(0.5 * x)
    s, m = 0.5 * math.sin(x) / x, -2.0 * half * half
    return s, m, (1.0 - 2.0 * s * (1.0 + m)) / (4.0 * square)


@register_jitable
def acted(so_far: Any, L: Any, w: Any, f: Any, turned: Any) -> Any:
    """A product of exponentials with one more, exp(w, f) of s, m and C: its rotation, the axis and the change of L."""
    (total, v, x, dL), (s, m, cubic) = so_far, turned
    u, bent = scaled(s, w), cross(w, f)
    b = plus(plus(f, 2.0 * s * s, bent), cubic, cross(w, bent))
    x = plus(x, 1.0, moved(m, u, x))
    dL = plus(plus(dL, 1.0, moved(m, u, plus(L, 1.0, dL))), 1.0, cross(b, x))
    mixed = total + m + total * m - dot(u, v)
    return mixed, plus(plus(scaled(1.0 + m, v), 1.0 + total, u), 1.0, cross(u, v)), x, dL


@register_jitable
def _bracket(w: Any, f: Any, x: Any, g: Any) -> Any:
    """[(w, f), (x, g)] = (w x x, w x g + f x x)."""
    return cross(w, x), plus(cross(w, g), 1.0, cross(f, x))


@register_jitable
def bent_back(w: Any, f: Any, slope: Any, g: Any) -> Any:
    """dexp^-1 of (w, f), two brackets of it, on an element of the algebra."""
    once, once_f = _bracket(w, f, slope, g)
    twice, twice_f = _bracket(w, f, once, once_f)
    return plus(plus(slope, -0.5, once), 1.0 / 12.0, twice), plus(plus(g, -0.5, once_f), 1.0 / 12.0, twice_f)
