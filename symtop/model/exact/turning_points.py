"""Turning points of the axis and their distances from both poles, without a difference of nearly equal numbers.

Upright, with u = cos theta, roots u1 <= u2 <= 1 <= u3 of u'^2 = lead (u - u1)(u - u2)(u - u3), x = u - u(0), up and
down = 1 -+ u(0), the wanted distances are d1, d2 = 1 + u1, 1 + u2; e1, e2 = 1 - u1, 1 - u2; g3 = u3 - 1.

    g3         the positive root of -w + k1 t + k2 t^2 + lead t^3, w = twist_up^2. By Descartes there is one, and its
               relative condition number is at most 2 wherever the other roots lie. Newton from above.
    L          = lead (up + g3), for a free top kinetic + a^2; then from the product and the sum of the roots
    x1 x2      = -c0/L,  c0 = up down theta'^2,      x1 + x2 = -(slope + lead c0/L)/L
    swing      = u2 - u1 = sqrt((x1 + x2)^2 + 4 c0/L): a sum, because the start lies between the roots
    e1, d2     = up - x1, down + x2: sums
    d1         = down + x1, or twist_down^2/(lead d3 d2), lead d3 = lead down + L, if x1 takes half of `down` away
    e2         = up - x2, or likewise twist_up^2/(lead g3 e1), or k1/(lead e1) without a twist and with g3 = 0
    stiffness  = lead (u3 - u1) = L - lead x1 = 4 Omega^2,      gap = lead (u3 - u2) = lead (g3 + e2)
    m          = lead swing/stiffness,      1 - m = gap/stiffness

In products with `lead` all of it stays finite for a free top. Bounds of the relative errors are carried along from
those of the sums: `rate_error` of what a phase grows with, `value_error` of what is only used as a double. They are
bounds to first order, infinite where a distance is not told from zero.
"""

import math
from typing import NamedTuple

from symtop.core.jit_functions import inlined, shared, two_product
from symtop.model.exact.double_double import (
    ZERO,
    DoubleDouble,
    add,
    add_double,
    div,
    mul,
    neg,
    root,
    scaled,
    square,
    sub,
)
from symtop.model.exact.motion_sums import GRAIN, Exact, Sums

LEAST_SQUARE = 1e-150  # of u2 - u1, whose square must be a double
LEAST_TERM = 1e-270  # of the largest term of the cubic: its rounding errors must be doubles, too


class TurningPoints(NamedTuple):
    """What the module's docstring names; x1, x2 relative to the start, bend = lead g3."""

    d1: DoubleDouble
    d2: DoubleDouble
    e1: DoubleDouble
    e2: DoubleDouble
    swing: DoubleDouble
    stiffness: DoubleDouble
    bend: DoubleDouble
    gap: DoubleDouble
    x1: DoubleDouble
    x2: DoubleDouble
    passes_up: bool  # the axis passes through the upper pole: e2 = 0
    rate_error: float
    value_error: float


@inlined
def unknown_points() -> TurningPoints:
    """The answer where the arithmetic does not tell a distance from zero."""
    return TurningPoints(ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, False, math.inf, math.inf)


@shared
def _beyond_the_pole(w: DoubleDouble, k1: DoubleDouble, k2: DoubleDouble, lead: DoubleDouble) -> DoubleDouble:
    """The positive root of -w + k1 t + k2 t^2 + lead t^3, w and lead positive; not a number if Newton fails."""
    w0, a, b, c = w[0], k1[0], k2[0], lead[0]
    t = 2.0 * max(-b / c if b < 0.0 else 0.0, math.sqrt(-a / c) if a < 0.0 else 0.0, (w0 / c) ** (1.0 / 3.0))
    if b > 0.0:  # dropping a positive term leaves a bound
        s = math.sqrt(a * a + 4.0 * b * w0)
        t = min(t, 2.0 * w0 / (a + s) if a > 0.0 else (s - a) / (2.0 * b))
    for _ in range(60):
        rise = a + t * (2.0 * b + 3.0 * c * t)
        if not rise > 0.0:
            return math.nan, 0.0
        step = (t * (a + t * (b + t * c)) - w0) / rise
        t -= step
        if not step > 1e-7 * t:
            break
    precise, step = (t, 0.0), 0.0
    for _ in range(2):
        value = sub(mul(precise, add(k1, mul(precise, add(k2, mul(lead, precise))))), w)
        rise = a + precise[0] * (2.0 * b + 3.0 * c * precise[0])
        if not rise > 0.0:
            return math.nan, 0.0
        step = value[0] / rise
        precise = add_double(precise, -step)
    largest = max(w0, abs(a) * t + abs(b) * t * t)
    return precise if abs(step) < 1e-24 * t and largest > LEAST_TERM else (math.nan, 0.0)


@inlined
def _third_root(sums: Sums, passes_up: bool, through_up: bool) -> DoubleDouble:
    """g3 = u3 - 1 of a top with weight."""
    if not through_up:
        return _beyond_the_pole(square(sums.twist_up), sums.k1, sums.k2, sums.lead)
    if not passes_up:
        return ZERO
    s = root(sub(square(sums.k2), scaled(mul(sums.lead, sums.k1), 4.0)))  # k1 < 0
    if sums.k2[0] > 0.0:
        return div(scaled(sums.k1, -2.0), add(sums.k2, s))
    return div(sub(s, sums.k2), scaled(sums.lead, 2.0))


class _Roots(NamedTuple):
    """The roots: third = g3, full = L, bend = lead g3, total = -(x1 + x2), product = -x1 x2."""

    third: DoubleDouble
    full: DoubleDouble
    bend: DoubleDouble
    product: DoubleDouble
    total: DoubleDouble
    swing: DoubleDouble
    x1: DoubleDouble
    x2: DoubleDouble
    passes_up: bool


@shared
def _roots(sums: Sums, exact: Exact, theta_dot: float) -> tuple[bool, _Roots]:
    """The roots, and whether they are there."""
    lead, passes_up = sums.lead, exact.through_up and not (sums.lead[0] > 0.0 and sums.k1[0] >= 0.0)
    third, full = ZERO, add(sums.kinetic, square(sums.a))
    bend = full
    if lead[0] > 0.0:
        third = _third_root(sums, passes_up, exact.through_up)
        full, bend = mul(lead, add(sums.up, third)), mul(lead, third)
    if not (full[0] > 0.0 and (bend[0] > 0.0 or exact.through_up)):
        return False, _Roots(third, full, bend, ZERO, ZERO, ZERO, ZERO, ZERO, passes_up)
    product = div(mul(mul(sums.up, sums.down), two_product(theta_dot, theta_dot)), full)
    total = neg(div(add(sums.slope, mul(lead, product)), full))
    swing = root(add(square(total), scaled(product, 4.0)))
    if not swing[0] > LEAST_SQUARE:
        return False, _Roots(third, full, bend, product, total, swing, ZERO, ZERO, passes_up)
    if total[0] > 0.0:
        x1 = scaled(add(total, swing), -0.5)
        x2 = neg(div(product, x1))
    else:
        x2 = scaled(sub(swing, total), 0.5)
        x1 = neg(div(product, x2))
    if exact.through_down:
        x1 = neg(sums.down)
    return True, _Roots(third, full, bend, product, total, swing, x1, x2, passes_up)


@inlined
def _lower(sums: Sums, exact: Exact, roots: _Roots, d2: DoubleDouble) -> DoubleDouble:
    """d1 = 1 + u1."""
    if exact.through_down:
        return ZERO
    if -roots.x1[0] > 0.5 * sums.down[0]:
        return div(square(sums.twist_down), mul(add(mul(sums.lead, sums.down), roots.full), d2))
    return add(sums.down, roots.x1)


@inlined
def _upper(sums: Sums, exact: Exact, roots: _Roots, e1: DoubleDouble) -> DoubleDouble:
    """e2 = 1 - u2."""
    if roots.passes_up:
        return ZERO
    if not roots.x2[0] > 0.5 * sums.up[0]:
        return sub(sums.up, roots.x2)
    if exact.through_up:  # g3 = 0
        return div(sums.k1, mul(sums.lead, e1))
    return div(square(sums.twist_up), mul(roots.bend, e1))


@shared
def turning_points(sums: Sums, exact: Exact, theta_dot: float) -> TurningPoints:
    """The curve of a moving axis, and how well it is known."""
    twisted = (exact.through_up or sums.twist_up[0] != 0.0) and (exact.through_down or sums.twist_down[0] != 0.0)
    there, roots = _roots(sums, exact, theta_dot)
    e1, d2 = sub(sums.up, roots.x1), add(sums.down, roots.x2)
    stiffness = sub(roots.full, mul(sums.lead, roots.x1))
    if not (there and twisted and d2[0] > 0.0 and e1[0] > 0.0 and stiffness[0] > 0.0):
        return unknown_points()
    d1, e2 = _lower(sums, exact, roots, d2), _upper(sums, exact, roots, e1)
    gap = add(roots.bend, mul(sums.lead, e2))
    if not (gap[0] > 0.0 and (d1[0] > 0.0 or exact.through_down) and (e2[0] > 0.0 or roots.passes_up)):
        return unknown_points()
    distances = _Distances(d1[0], d2[0], e1[0], e2[0], stiffness[0], gap[0])
    rate, value = _bounds(sums, exact, roots, distances)
    swing, bend, passes_up = roots.swing, roots.bend, roots.passes_up
    return TurningPoints(d1, d2, e1, e2, swing, stiffness, bend, gap, roots.x1, roots.x2, passes_up, rate, value)


class _Distances(NamedTuple):
    """High parts of the distances from the poles, of the stiffness and of the gap."""

    d1: float
    d2: float
    e1: float
    e2: float
    stiffness: float
    gap: float


@shared
def _bounds(sums: Sums, exact: Exact, roots: _Roots, at: _Distances) -> tuple[float, float]:
    """Bounds of the relative errors of rates and of values; r_ is a relative error, error_ an absolute one."""
    lead, third, total, swing = sums.lead[0], roots.third[0], roots.total[0], roots.swing[0]
    r_up = 0.0 if exact.through_up else sums.twist_up_error / abs(sums.twist_up[0])
    r_down = 0.0 if exact.through_down else sums.twist_down_error / abs(sums.twist_down[0])
    r_third, r_full = 0.0, GRAIN
    if third > 0.0:
        w_error = 2.0 * r_up * sums.twist_up[0] * sums.twist_up[0] / third
        r_third = GRAIN + (sums.k1_error + sums.k2_error * third + w_error) / (at.gap * (third + at.e1))
        r_full += r_third * third / (sums.up[0] + third)
    r_product = GRAIN + r_full
    error_total = (sums.slope_error + lead * roots.product[0] * r_product) / roots.full[0] + abs(total) * r_product
    r_swing = abs(total) * error_total / (swing * swing) + r_product
    error_long = 0.5 * error_total + swing * r_swing  # of the longer of x1, x2; the other is relatively as good
    r_long = error_long / max(-roots.x1[0], roots.x2[0]) + r_product
    error_x1, error_x2 = -r_long * roots.x1[0], error_long
    if total > 0.0:
        error_x1, error_x2 = error_long, r_long * roots.x2[0]
    r_d2, r_e1 = GRAIN + error_x2 / at.d2, GRAIN + error_x1 / at.e1
    r_d1 = r_e2 = 0.0
    if not exact.through_down:
        by_twist = -roots.x1[0] > 0.5 * sums.down[0]
        r_d1 = 2.0 * r_down + r_d2 + r_full if by_twist else GRAIN + error_x1 / at.d1
    if not roots.passes_up:
        r_e2 = GRAIN + error_x2 / at.e2
        if roots.x2[0] > 0.5 * sums.up[0]:
            r_e2 = sums.k1_error / abs(sums.k1[0]) + r_e1 if exact.through_up else 2.0 * r_up + r_e1 + r_third
    r_gap = (r_third * roots.bend[0] + r_e2 * lead * at.e2) / at.gap if lead > 0.0 else GRAIN
    r_stiffness = r_full + lead * error_x1 / at.stiffness
    r_p = sums.p_psi_error / abs(sums.p_psi[0]) if sums.p_psi[0] != 0.0 else 0.0
    return max(r_gap, r_d2, r_e1, r_stiffness), max(r_swing, r_d1, r_e2, r_up, r_down, r_p)
