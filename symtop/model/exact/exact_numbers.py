"""Numbers for the closed form: inputs read without rounding, and the real roots of its cubic.

A float is the exact binary fraction it stores, a string the exact decimal it shows. Roots come from the trigonometric
formula in whatever precision the given mpmath context works.
"""

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from symtop.core.errors import SymtopError
from symtop.model.top import Angles, SymmetricTop

_NAMES = ("I1", "I3", "mgl", "theta", "phi", "psi", "theta_dot", "phi_dot", "psi_dot")


def rationals(top: SymmetricTop | Sequence[Any], start: Angles | Sequence[Any]) -> list[list[Fraction]]:
    """Parameters and start as exact fractions, checked against the model."""
    body = [top.I1, top.I3, top.mgl] if isinstance(top, SymmetricTop) else list(top)
    state = [getattr(start, name) for name in _NAMES[3:]] if isinstance(start, Angles) else list(start)
    if len(body) != 3 or len(state) != 6:
        raise SymtopError(
            f"the closed form takes (I1, I3, mgl) and six angles and rates, not {len(body)} and {len(state)} numbers"
        )
    values = [rational(name, value) for name, value in zip(_NAMES, [*body, *state], strict=True)]
    SymmetricTop(*map(float, values[:3]))
    Angles(*map(float, values[3:]))
    return [values[:3], values[3:]]


def rational(name: str, value: Any) -> Fraction:
    """The exact value of a float, integer, fraction, decimal string or mpf."""
    from mpmath.libmp import to_rational

    try:
        if hasattr(value, "_mpf_"):
            return Fraction(*map(int, to_rational(value._mpf_)))
        return Fraction(value if isinstance(value, str | int | Fraction) else float(value))
    except (TypeError, ValueError, OverflowError, ZeroDivisionError):
        raise SymtopError(f"{name} must be a finite number or a decimal string, not {value!r}") from None


def real_roots(ctx: Any, c0: Any, c1: Any, c2: Any, c3: Any) -> tuple[Any, ...]:
    """Roots of c0 + c1 x + c2 x^2 + c3 x^3, all real, x1 <= 0 <= x2 <= x3; c0, c3 >= 0. Infinite x3 if c3 = 0.

    A double root at 0 is returned as x1 = x2 = 0 wherever the third lies.
    """
    if c0 == 0 and c1 == 0:
        return ctx.zero, ctx.zero, -c2 / c3 if c3 else ctx.inf
    if c3 == 0:
        return *quadratic_roots(ctx, c0, c1, c2), ctx.inf
    if c0 == 0:
        return tuple(sorted([ctx.zero, *quadratic_roots(ctx, c1, c2, c3)]))
    shift = c2 / (3 * c3)
    p, q = c1 / c3 - 3 * shift**2, 2 * shift**3 - shift * c1 / c3 + c0 / c3
    radius = ctx.sqrt(max(-p / 3, 0))
    angle = ctx.acos(min(max(1.5 * q / (p * radius), -1), 1)) / 3 if radius else ctx.zero
    roots = [2 * radius * ctx.cos(angle - 2 * ctx.pi * k / 3) - shift for k in range(3)]
    for _ in range(5):  # Newton: near a double or triple root the cosines keep only a half or a quarter of the digits
        slopes = [c1 + x * (2 * c2 + 3 * x * c3) for x in roots]
        values = [c0 + x * (c1 + x * (c2 + x * c3)) for x in roots]
        roots = [x - v / s if s else x for x, v, s in zip(roots, values, slopes, strict=True)]
    return tuple(sorted(roots))


def quadratic_roots(ctx: Any, c0: Any, c1: Any, c2: Any) -> list[Any]:
    """Real roots of c0 + c1 x + c2 x^2 in order, without cancellation."""
    root = ctx.sqrt(max(c1 * c1 - 4 * c0 * c2, 0))
    q = -(c1 + (root if c1 > 0 else -root)) / 2
    return sorted([q / c2, c0 / q])
