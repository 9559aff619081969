"""The sums of the data that the closed form hangs on, in double-double or in quad-double.

Upright picture: a hanging top (mgl < 0) is the standing one with its poles exchanged and a -> -a. With `up` and `down`
= 1 -+ u at the start, l = (I1 - I3) phi', kinetic = theta'^2 + phi'^2 up down, lead = 2 abs(mgl)/I1,

    theta<1.5:  S = I3 (psi' + phi') + l up    N = I1 phi' - I3 psi' + l cos  p_psi = I3 (psi' + phi') - I3 phi' up
    otherwise:  N = l down - I3 (psi' - phi')  S = I1 phi' + I3 psi' - l cos  p_psi = I3 (psi' - phi') + I3 phi' down
    twist_up = b - a = up N/I1,     twist_down = b + a = down S/I1        (of a standing top)
    k1 = 2 (a twist_up - D),        k2 = 2 lead - D - a^2,      D = kinetic - lead up,
    u'^2 = -twist_up^2 + k1 t + k2 t^2 + lead t^3,     t = u - 1,
    d(u'^2)/du at the start = 2 [up down (I3 phi' psi' - mgl - l phi' cos)/I1 - cos theta'^2].

Only N, S, p_psi, D, k1, k2 and the slope can cancel. Each is formed without a division before its sum, times I1 or
I1^2, and carries the bound `grain` times the sum of its terms' sizes, plus one rounding to double-double. Products of
two of the data are exact, as are I1 - I3 and psi' +- phi'. Near a pole the first form of S (or N) does not cancel.
"""

from typing import NamedTuple

from symtop.core.jit_functions import shared, two_product
from symtop.model.exact import quad_double as qd
from symtop.model.exact.double_double import DoubleDouble, div, neg, scaled, two_sum
from symtop.model.exact.elementary import sincos
from symtop.model.exact.quad_double import doubled, like, minus, narrowed, plus, times

GRAIN = 1e-31  # relative error of a few operations in double-double
GRAIN4 = 1e-61  # in quad-double, with three digits to spare


class Data(NamedTuple):
    """What a top and its start are, without phi and psi."""

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
def _sums(data: Data, sine: qd.Number, cosine: qd.Number, grain: float) -> Sums:
    """The sums in the arithmetic of `sine` and `cosine`, those of theta/2."""
    I1, I3, mgl, theta, theta_dot, phi_dot, psi_dot = data
    upright = mgl >= 0.0
    mass, mass2, weight = (I1, 0.0), two_product(I1, I1), abs(mgl)
    above, below = doubled(times(sine, sine)), doubled(times(cosine, cosine))  # 1 - cos theta, 1 + cos theta
    along = minus(times(cosine, cosine), times(sine, sine))
    lever, turned = two_sum(I1, -I3), two_sum(psi_dot, phi_dot if theta < 1.5 else -phi_dot)
    push, spun = like(sine, two_product(I1, phi_dot)), like(sine, two_product(I3, psi_dot))
    swung = like(sine, two_product(I3, phi_dot))
    lean = plus(like(sine, two_product(lever[0], phi_dot)), like(sine, two_product(lever[1], phi_dot)))
    spin = plus(like(sine, two_product(turned[0], I3)), like(sine, two_product(turned[1], I3)))
    level = times(lean, along)
    far_terms = grain * (abs(push[0]) + abs(spun[0]) + abs(level[0]))
    if theta < 1.5:
        small = times(lean, above)
        south, north = plus(spin, small), plus(minus(push, spun), level)
        p_psi = minus(spin, times(swung, above))
        south_error, north_error = grain * (abs(spin[0]) + abs(small[0])), far_terms
        nearest = above[0]
    else:
        small = times(lean, below)
        north, south = minus(small, spin), minus(plus(push, spun), level)
        p_psi = plus(spin, times(swung, below))
        north_error, south_error = grain * (abs(spin[0]) + abs(small[0])), far_terms
        nearest = below[0]
    up, down, over, under = (above, below, north, south) if upright else (below, above, south, north)
    over_error, under_error = (north_error, south_error) if upright else (south_error, north_error)

    nod, turn = like(sine, two_product(I1, theta_dot)), like(sine, two_product(I1, phi_dot))
    nod, turn = times(nod, nod), times(turn, turn)
    heavy = like(sine, two_product(2.0 * weight, I1))  # lead I1^2
    swing = minus(times(turn, down), heavy)
    excess = plus(nod, times(up, swing))  # D I1^2
    bound = times(up, times(p_psi, over))
    if not upright:
        bound = minus(like(sine, (0.0, 0.0)), bound)
    k1 = minus(minus(bound, times(up, swing)), nod)
    k2 = minus(minus(doubled(heavy), excess), times(p_psi, p_psi))
    torque = plus(times(swung, like(sine, (psi_dot, 0.0))), like(sine, (-mgl, 0.0)))
    leaning = times(level, like(sine, (phi_dot, 0.0)))
    speed2 = times(like(sine, two_product(theta_dot, theta_dot)), like(sine, mass))
    fall = times(along, speed2)
    slope = minus(times(times(up, down), minus(torque, leaning)), fall)

    twist_up, twist_down = div(narrowed(times(up, over)), mass), div(narrowed(times(down, under)), mass)
    a = div(narrowed(p_psi), mass)
    kinetic = div(narrowed(plus(nod, times(times(up, down), turn))), mass2)
    lead = div((2.0 * weight, 0.0), mass)
    first, second = scaled(div(narrowed(k1), mass2), 2.0), div(narrowed(k2), mass2)
    third = scaled(div(narrowed(slope), mass), 2.0)
    twist_error = up[0] * over_error / I1
    p_error = grain * (abs(spin[0]) + abs(swung[0]) * nearest)
    energies = kinetic[0] + lead[0] * up[0]
    k1_terms, k2_terms = energies + abs(a[0] * twist_up[0]), 2.0 * lead[0] + energies + a[0] * a[0]
    pushes = up[0] * down[0] * (abs(swung[0] * psi_dot) + weight + abs(leaning[0])) + abs(fall[0])
    return Sums(
        narrowed(up),
        narrowed(down),
        twist_up,
        twist_down,
        a if upright else neg(a),
        narrowed(p_psi),
        kinetic,
        lead,
        first,
        second,
        third if upright else neg(third),
        twist_error + GRAIN * abs(twist_up[0]),
        down[0] * under_error / I1 + GRAIN * abs(twist_down[0]),
        p_error + GRAIN * abs(p_psi[0]),
        2.0 * (grain * k1_terms + abs(a[0]) * twist_error + abs(twist_up[0]) * p_error / I1) + GRAIN * abs(first[0]),
        grain * k2_terms + 2.0 * abs(a[0]) * p_error / I1 + GRAIN * abs(second[0]),
        2.0 * grain * pushes / I1 + GRAIN * abs(third[0]),
    )


@shared
def short_sums(data: Data) -> Sums:
    """The sums in double-double."""
    sine, cosine = sincos(0.5 * data.theta)
    return _sums(data, sine, cosine, GRAIN)


@shared
def long_sums(data: Data) -> Sums:
    """The sums in quad-double, rounded to double-double."""
    sine, cosine = qd.sincos(0.5 * data.theta)
    return _sums(data, sine, cosine, GRAIN4)


# --------------------------------------------------------------------------------------------- what vanishes exactly


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
    """What is known to vanish: cos theta is transcendental unless theta = 0, a root of no rational polynomial.

    For the same reason the only separatrix that doubles can name exactly starts at theta = 0 in a hanging top without
    twist: theta'^2 I1 = 4 abs(mgl), and theta = 4 atan tanh(g t/2) from then on, g = sqrt(abs(mgl)/I1).
    """
    I1, I3, mgl, theta, theta_dot, phi_dot, psi_dot = data
    push, spun = two_product(I1, phi_dot), two_product(I3, psi_dot)
    level = I1 == I3 or phi_dot == 0.0  # no multiple of cos theta in N and S
    north = theta == 0.0 or (level and push[0] == spun[0] and push[1] == spun[1])
    south = (level and push[0] == -spun[0] and push[1] == -spun[1]) or (theta == 0.0 and psi_dot == -phi_dot)
    rests = theta_dot == 0.0 and (theta == 0.0 or (level and _is_zero(I3, phi_dot, psi_dot, mgl)))
    top = theta == 0.0 and psi_dot == -phi_dot and mgl < 0.0 and _is_zero(theta_dot, theta_dot, I1, -4.0 * mgl)
    return Exact(north if mgl >= 0.0 else south, south if mgl >= 0.0 else north, rests, top)
