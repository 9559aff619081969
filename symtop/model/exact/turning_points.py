"""Turning points of the axis and their distances from both poles, without a difference of nearly equal numbers.

Upright picture: a hanging top (mgl < 0) is the standing one with its poles exchanged and a -> -a. With `up` and `down`
= 1 -+ u at the start, u = cos theta, l = (I1 - I3) phi', kinetic = theta'^2 + phi'^2 up down, lead = 2 abs(mgl)/I1,

    theta<1.5:  S = I3 (psi' + phi') + l up    N = I1 phi' - I3 psi' + l cos  p_psi = I3 (psi' + phi') - I3 phi' up
    otherwise:  N = l down - I3 (psi' - phi')  S = I1 phi' + I3 psi' - l cos  p_psi = I3 (psi' - phi') + I3 phi' down
    twist_up = b - a = up N/I1,     twist_down = b + a = down S/I1        (of a standing top)
    k1 = 2 (a twist_up - D),        k2 = 2 lead - D - a^2,      D = kinetic - lead up,
    u'^2 = -twist_up^2 + k1 t + k2 t^2 + lead t^3,     t = u - 1,
    d(u'^2)/du at the start = 2 [up down (I3 phi' psi' - mgl - l phi' cos)/I1 - cos theta'^2].

Only N, S, p_psi, D, k1, k2 and the slope can cancel, but near a pole the first form of S (or N) does not. Each is
formed without a division before its sum, times I1 or I1^2, and carries the bound `grain` times the sum of its terms'
sizes, plus one rounding to double-double. Products of two of the data are exact, as are I1 - I3 and psi' +- phi'.

With the roots u1 <= u2 <= 1 <= u3 of u'^2 = lead (u - u1)(u - u2)(u - u3) and x = u - u(0), the distances are
d1, d2 = 1 + u1, 1 + u2; e1, e2 = 1 - u1, 1 - u2; g3 = u3 - 1:

    g3         the positive root of -w + k1 t + k2 t^2 + lead t^3, w = twist_up^2. By Descartes there is one, and its
               relative condition number is at most 2 wherever the other roots lie. Newton from above.
    L          = lead (up + g3), for a free top kinetic + a^2; then from the product and the sum of the roots
    x1 x2      = -c0/L,  c0 = up down theta'^2,      x1 + x2 = (slope + lead c0/L)/L
    swing      = u2 - u1 = sqrt((x1 + x2)^2 + 4 c0/L): a sum, because the start lies between the roots
    e1, d2     = up - x1, down + x2: sums
    d1         = down + x1, or twist_down^2/(lead d3 d2), lead d3 = lead down + L, if x1 takes half of `down` away
    e2         = up - x2, or likewise twist_up^2/(lead g3 e1), or k1/(lead e1) without a twist and with g3 = 0
    stiffness  = lead (u3 - u1) = L - lead x1 = 4 Omega^2,      gap = lead (u3 - u2) = lead (g3 + e2)
    m          = lead swing/stiffness,      1 - m = gap/stiffness

In products with `lead` all of it stays finite for a free top. Bounds of the relative errors follow from those of the
sums, to first order: `rate_error` of what a phase grows with, `value_error` of what is only used as a double. They are
infinite where a distance is not told from zero.
"""

import math
from typing import NamedTuple

from symtop.core.jit_functions import inlined, shared, two_product
from symtop.model.exact import layout as at
from symtop.model.exact.double_double import (
    ZERO,
    DoubleDouble,
    Number,
    add,
    add_double,
    div,
    doubled,
    like,
    minus,
    mul,
    narrowed,
    neg,
    plus,
    quad_sincos,
    root,
    scaled,
    sincos,
    square,
    sub,
    times,
    two_sum,
)

GRAIN = 1e-31  # relative error of a few operations in double-double
GRAIN4 = 1e-61  # in quad-double, with three digits to spare
RATE, VALUE = 1e-28, 1e-18  # relative errors above which a longer arithmetic is used


class Data(NamedTuple):
    """A top and its start, without phi and psi."""

    I1: float
    I3: float
    mgl: float
    theta: float
    theta_dot: float
    phi_dot: float
    psi_dot: float


class Sums(NamedTuple):
    """The sums in the upright picture, and bounds of the absolute errors of those that can cancel."""

    up: DoubleDouble
    down: DoubleDouble
    twist_up: DoubleDouble
    twist_down: DoubleDouble
    a: DoubleDouble
    p_psi: DoubleDouble
    kinetic: DoubleDouble
    lead: DoubleDouble
    k1: DoubleDouble
    k2: DoubleDouble
    slope: DoubleDouble
    twist_up_error: float
    twist_down_error: float
    p_psi_error: float
    k1_error: float
    k2_error: float
    slope_error: float


@shared
def _sums(data: Data, sine: Number, cosine: Number, grain: float) -> Sums:
    """The sums in the arithmetic of `sine` and `cosine`, those of theta/2."""
    I1, I3, mgl, theta, theta_dot, phi_dot, psi_dot = data
    upright = mgl >= 0.0
    mass, mass2, weight = (I1, 0.0), two_product(I1, I1), abs(mgl)
    above, below = doubled(times(sine, sine)), doubled(times(cosine, cosine))  # 1 - cos theta, 1 + cos theta
    along = minus(times(cosine, cosine), times(sine, sine))
    lever, rate = two_sum(I1, -I3), two_sum(psi_dot, phi_dot if theta < 1.5 else -phi_dot)
    I1_phi, I3_psi = like(sine, two_product(I1, phi_dot)), like(sine, two_product(I3, psi_dot))
    I3_phi = like(sine, two_product(I3, phi_dot))
    lean = plus(like(sine, two_product(lever[0], phi_dot)), like(sine, two_product(lever[1], phi_dot)))
    spin = plus(like(sine, two_product(rate[0], I3)), like(sine, two_product(rate[1], I3)))
    level = times(lean, along)
    far_terms = grain * (abs(I1_phi[0]) + abs(I3_psi[0]) + abs(level[0]))
    if theta < 1.5:
        small = times(lean, above)
        south, north = plus(spin, small), plus(minus(I1_phi, I3_psi), level)
        p_psi = minus(spin, times(I3_phi, above))
        south_error, north_error = grain * (abs(spin[0]) + abs(small[0])), far_terms
        nearest = above[0]
    else:
        small = times(lean, below)
        north, south = minus(small, spin), minus(plus(I1_phi, I3_psi), level)
        p_psi = plus(spin, times(I3_phi, below))
        north_error, south_error = grain * (abs(spin[0]) + abs(small[0])), far_terms
        nearest = below[0]
    up, down, over, under = (above, below, north, south) if upright else (below, above, south, north)
    over_error, under_error = (north_error, south_error) if upright else (south_error, north_error)

    nod, turn = like(sine, two_product(I1, theta_dot)), like(sine, two_product(I1, phi_dot))
    nod, turn = times(nod, nod), times(turn, turn)
    lead_I1 = like(sine, two_product(2.0 * weight, I1))  # lead I1^2
    swing = minus(times(turn, down), lead_I1)
    excess = plus(nod, times(up, swing))  # D I1^2
    bound = times(up, times(p_psi, over))
    if not upright:
        bound = minus(like(sine, (0.0, 0.0)), bound)
    k1 = minus(minus(bound, times(up, swing)), nod)
    k2 = minus(minus(doubled(lead_I1), excess), times(p_psi, p_psi))
    torque = plus(times(I3_phi, like(sine, (psi_dot, 0.0))), like(sine, (-mgl, 0.0)))
    lean_rate = times(level, like(sine, (phi_dot, 0.0)))
    speed2 = times(like(sine, two_product(theta_dot, theta_dot)), like(sine, mass))
    fall = times(along, speed2)
    slope = minus(times(times(up, down), minus(torque, lean_rate)), fall)

    twist_up, twist_down = div(narrowed(times(up, over)), mass), div(narrowed(times(down, under)), mass)
    a = div(narrowed(p_psi), mass)
    kinetic = div(narrowed(plus(nod, times(times(up, down), turn))), mass2)
    lead = div((2.0 * weight, 0.0), mass)
    first, second = scaled(div(narrowed(k1), mass2), 2.0), div(narrowed(k2), mass2)
    third = scaled(div(narrowed(slope), mass), 2.0)
    twist_error = up[0] * over_error / I1
    p_error = grain * (abs(spin[0]) + abs(I3_phi[0]) * nearest)
    energies = kinetic[0] + lead[0] * up[0]
    k1_terms, k2_terms = energies + abs(a[0] * twist_up[0]), 2.0 * lead[0] + energies + a[0] * a[0]
    slope_terms = up[0] * down[0] * (abs(I3_phi[0] * psi_dot) + weight + abs(lean_rate[0])) + abs(fall[0])
    up_error = twist_error + GRAIN * abs(twist_up[0])
    down_error = down[0] * under_error / I1 + GRAIN * abs(twist_down[0])
    k1_terms = grain * k1_terms + abs(a[0]) * twist_error + abs(twist_up[0]) * p_error / I1
    k1_error = 2.0 * k1_terms + GRAIN * abs(first[0])
    k2_error = grain * k2_terms + 2.0 * abs(a[0]) * p_error / I1 + GRAIN * abs(second[0])
    slope_error, p_error = 2.0 * grain * slope_terms / I1 + GRAIN * abs(third[0]), p_error + GRAIN * abs(p_psi[0])
    a, third = (a, third) if upright else (neg(a), neg(third))
    near, far, momentum = narrowed(up), narrowed(down), narrowed(p_psi)
    return Sums(
        near, far, twist_up, twist_down, a, momentum, kinetic, lead, first, second, third,
        up_error, down_error, p_error, k1_error, k2_error, slope_error,
    )  # fmt: skip


@shared
def short_sums(data: Data) -> Sums:
    """The sums in double-double."""
    sine, cosine = sincos(0.5 * data.theta)
    return _sums(data, sine, cosine, GRAIN)


@shared
def long_sums(data: Data) -> Sums:
    """The sums in quad-double, rounded to double-double."""
    sine, cosine = quad_sincos(0.5 * data.theta)
    return _sums(data, sine, cosine, GRAIN4)


class Exact(NamedTuple):
    """Does the axis pass through the upper and the lower pole (upright), stand still, climb to the upper one?"""

    through_up: bool
    through_down: bool
    rests: bool
    separatrix: bool


@shared
def _is_zero(a: float, b: float, c: float, d: float) -> bool:
    """Is a b c - d zero? The sum of five doubles, error-free."""
    p, e = two_product(a, b)
    t0, t1 = two_product(p, c)
    t2, t3 = two_product(e, c)
    t4 = -d
    for _ in range(8):
        t3, t4 = two_sum(t3, t4)
        t2, t3 = two_sum(t2, t3)
        t1, t2 = two_sum(t1, t2)
        t0, t1 = two_sum(t0, t1)
    return t0 == 0.0 and t1 == 0.0 and t2 == 0.0 and t3 == 0.0 and t4 == 0.0


@shared
def exact_zeros(data: Data) -> Exact:
    """Which quantities vanish exactly: cos theta is transcendental unless theta = 0, a root of no rational polynomial.

    The only separatrix is that of `symtop.model.exact.digits`.
    """
    I1, I3, mgl, theta, theta_dot, phi_dot, psi_dot = data
    I1_phi, I3_psi = two_product(I1, phi_dot), two_product(I3, psi_dot)
    level = I1 == I3 or phi_dot == 0.0  # no multiple of cos theta in N and S
    north = theta == 0.0 or (level and I1_phi[0] == I3_psi[0] and I1_phi[1] == I3_psi[1])
    south = (level and I1_phi[0] == -I3_psi[0] and I1_phi[1] == -I3_psi[1]) or (theta == 0.0 and psi_dot == -phi_dot)
    rests = theta_dot == 0.0 and (theta == 0.0 or (level and _is_zero(I3, phi_dot, psi_dot, mgl)))
    top = theta == 0.0 and psi_dot == -phi_dot and mgl < 0.0 and _is_zero(theta_dot, theta_dot, I1, -4.0 * mgl)
    return Exact(north if mgl >= 0.0 else south, south if mgl >= 0.0 else north, rests, top)


LEAST_SQUARE = 1e-150  # lower limit on u2 - u1, whose square must not underflow
LEAST_TERM = 1e-270  # lower limit on the largest term of the cubic, whose rounding errors must not underflow


class TurningPoints(NamedTuple):
    """The quantities of the module's docstring; x1, x2 relative to the start, bend = lead g3."""

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
    """The result where the arithmetic does not tell a distance from zero."""
    return TurningPoints(ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, False, math.inf, math.inf)


@shared
def _root_beyond_pole(w: DoubleDouble, k1: DoubleDouble, k2: DoubleDouble, lead: DoubleDouble) -> DoubleDouble:
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
        return _root_beyond_pole(square(sums.twist_up), sums.k1, sums.k2, sums.lead)
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
    """Whether the roots could be computed, and the roots."""
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
def _lower_gap(sums: Sums, exact: Exact, roots: _Roots, d2: DoubleDouble) -> DoubleDouble:
    """d1 = 1 + u1."""
    if exact.through_down:
        return ZERO
    if -roots.x1[0] > 0.5 * sums.down[0]:
        return div(square(sums.twist_down), mul(add(mul(sums.lead, sums.down), roots.full), d2))
    return add(sums.down, roots.x1)


@inlined
def _upper_gap(sums: Sums, exact: Exact, roots: _Roots, e1: DoubleDouble) -> DoubleDouble:
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
    """The turning points of a moving axis, with bounds of their errors."""
    twisted = (exact.through_up or sums.twist_up[0] != 0.0) and (exact.through_down or sums.twist_down[0] != 0.0)
    success, roots = _roots(sums, exact, theta_dot)
    e1, d2 = sub(sums.up, roots.x1), add(sums.down, roots.x2)
    stiffness = sub(roots.full, mul(sums.lead, roots.x1))
    if not (success and twisted and d2[0] > 0.0 and e1[0] > 0.0 and stiffness[0] > 0.0):
        return unknown_points()
    d1, e2 = _lower_gap(sums, exact, roots, d2), _upper_gap(sums, exact, roots, e1)
    gap = add(roots.bend, mul(sums.lead, e2))
    if not (gap[0] > 0.0 and (d1[0] > 0.0 or exact.through_down) and (e2[0] > 0.0 or roots.passes_up)):
        return unknown_points()
    distances = d1[0], d2[0], e1[0], e2[0], stiffness[0], gap[0]
    rate, value = _bounds(sums, exact, roots, distances)
    swing, bend, passes_up = roots.swing, roots.bend, roots.passes_up
    return TurningPoints(d1, d2, e1, e2, swing, stiffness, bend, gap, roots.x1, roots.x2, passes_up, rate, value)


@shared
def _bounds(sums: Sums, exact: Exact, roots: _Roots, distances: tuple[float, ...]) -> tuple[float, float]:
    """Bounds of the relative errors of rates and of values; r_ is a relative error, error_ an absolute one."""
    d1, d2, e1, e2, stiffness, gap = distances  # high parts
    lead, third, total, swing = sums.lead[0], roots.third[0], roots.total[0], roots.swing[0]
    r_up = 0.0 if exact.through_up else sums.twist_up_error / abs(sums.twist_up[0])
    r_down = 0.0 if exact.through_down else sums.twist_down_error / abs(sums.twist_down[0])
    r_third, r_full = 0.0, GRAIN
    if third > 0.0:
        w_error = 2.0 * r_up * sums.twist_up[0] * sums.twist_up[0] / third
        r_third = GRAIN + (sums.k1_error + sums.k2_error * third + w_error) / (gap * (third + e1))
        r_full += r_third * third / (sums.up[0] + third)
    r_product = GRAIN + r_full
    error_total = (sums.slope_error + lead * roots.product[0] * r_product) / roots.full[0] + abs(total) * r_product
    r_swing = abs(total) * error_total / (swing * swing) + r_product
    error_long = 0.5 * error_total + swing * r_swing  # of the longer of x1, x2; the other is relatively as good
    r_long = error_long / max(-roots.x1[0], roots.x2[0]) + r_product
    error_x1, error_x2 = -r_long * roots.x1[0], error_long
    if total > 0.0:
        error_x1, error_x2 = error_long, r_long * roots.x2[0]
    r_d2, r_e1 = GRAIN + error_x2 / d2, GRAIN + error_x1 / e1
    r_d1 = r_e2 = 0.0
    if not exact.through_down:
        by_twist = -roots.x1[0] > 0.5 * sums.down[0]
        r_d1 = 2.0 * r_down + r_d2 + r_full if by_twist else GRAIN + error_x1 / d1
    if not roots.passes_up:
        r_e2 = GRAIN + error_x2 / e2
        if roots.x2[0] > 0.5 * sums.up[0]:
            r_e2 = sums.k1_error / abs(sums.k1[0]) + r_e1 if exact.through_up else 2.0 * r_up + r_e1 + r_third
    r_gap = (r_third * roots.bend[0] + r_e2 * lead * e2) / gap if lead > 0.0 else GRAIN
    r_stiffness = r_full + lead * error_x1 / stiffness
    r_p = sums.p_psi_error / abs(sums.p_psi[0]) if sums.p_psi[0] != 0.0 else 0.0
    return max(r_gap, r_d2, r_e1, r_stiffness), max(r_swing, r_d1, r_e2, r_up, r_down, r_p)


@shared
def choose(data: Data, exact: Exact) -> tuple[float, Sums, TurningPoints]:
    """The arithmetic that the data need, the sums in it and the turning points."""
    sums = short_sums(data)
    if exact.separatrix:
        return at.EXACTLY, sums, unknown_points()
    if exact.rests:
        size = 2.0 * sums.lead[0] + sums.a[0] * sums.a[0]
        if data.theta == 0.0 and not abs(sums.k2[0]) > 1e-12 * size:  # next to the threshold of sleep
            return at.QUAD_DOUBLE, long_sums(data), unknown_points()
        return at.DOUBLE_DOUBLE, sums, unknown_points()
    points = turning_points(sums, exact, data.theta_dot)
    if points.rate_error < RATE and points.value_error < VALUE:
        return at.DOUBLE_DOUBLE, sums, points
    sums = long_sums(data)
    return at.QUAD_DOUBLE, sums, turning_points(sums, exact, data.theta_dot)
