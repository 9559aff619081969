"""Constants of a moving axis: the elliptic functions of its nutation and the lags of its angles.

From the turning points: nome, heights of the poles and phase of the start (`theta_functions`), half-angle functions
(`half_angles`), mean rates, and the frames of both turning points, rounded once to doubles. With growth =
d(phi +- psi)/dt less its drift,

    growth of a pole = twist/(distance at the far turning point) + what the passage at the near one adds,
    (phi + psi)' = drift + growth of the lower pole,      (phi - psi)' = -drift + growth of the upper pole,

both terms of a growth having the same sign. Lags are what the angles are ahead of their means at the start.
"""

from typing import Any, NamedTuple

from symtop.core.jit_functions import shared
from symtop.model.exact import motion_layout as at
from symtop.model.exact.double_double import (
    HALF_PI,
    ONE,
    PER_PI,
    PER_TURN,
    ZERO,
    DoubleDouble,
    add,
    add_double,
    div,
    mul,
    neg,
    root,
    rounded,
    scaled,
    square,
    sub,
    whole_part,
)
from symtop.model.exact.elementary import arctan2, log
from symtop.model.exact.half_angles import Cubic, Half, hyperbolic_half, odd_sines, total, trigonometric_half, value
from symtop.model.exact.motion_sums import Data, Exact, Sums
from symtop.model.exact.theta_functions import Nome, arsinh, imaginary_argument, nome_of, real_argument
from symtop.model.exact.turning_points import TurningPoints

LEAST_GAP, LEAST_SWING = 1e-280, 1e-130  # of distances from a pole, of u2 - u1
DONE, OUT_OF_RANGE, UNRESOLVED, UNMET = range(4)  # what became of the constants


@shared
def _put(out: Any, place: int, poly: Cubic, unit: DoubleDouble) -> None:
    for i in range(4):
        out[place + i] = rounded(mul(poly[i], unit))


class Mean(NamedTuple):
    """What the angles do on average: the nutation period, growth at both poles, lags of both halves at the start."""

    period: DoubleDouble
    growth_down: DoubleDouble
    growth_up: DoubleDouble
    lag_down: DoubleDouble
    lag_up: DoubleDouble


@shared
def put_line(out: Any, place: int, rate: DoubleDouble, start: DoubleDouble) -> None:
    """A rate and a start."""
    out[place], out[place + 1], out[place + 2], out[place + 3] = rate[0], rate[1], start[0], start[1]


@shared
def put_turns(out: Any, place: int, rate: DoubleDouble, start: DoubleDouble) -> None:
    """A line of angles in turns, its start to within whole turns."""
    begun = mul(start, PER_TURN)
    put_line(out, place, mul(rate, PER_TURN), add_double(begun, -whole_part(begun[0])))


@shared
def _frame(
    out: Any,
    place: int,
    near: Half,
    far: Half,
    distances: tuple[DoubleDouble, DoubleDouble],  # from the pole near the turning point, and from the other
    depth: DoubleDouble,  # abs(u - u at the turning point) = depth angle^2
) -> None:
    """The half-angle functions about a turning point, scaled to the moduli that they have there."""
    least, most = distances
    if least[0] == 0.0:
        near_unit = div(root(scaled(depth, 0.5)), total(near.near_imag))
    else:
        near_unit = div(root(scaled(least, 0.5)), total(near.near_real))
    far_unit = div(root(scaled(most, 0.5)), total(far.far_real))
    _put(out, place + at.NEAR_REAL, near.near_real, near_unit)
    _put(out, place + at.NEAR_IMAG, near.near_imag, near_unit)
    _put(out, place + at.FAR_REAL, far.far_real, far_unit)
    _put(out, place + at.FAR_IMAG, far.far_imag, far_unit)
    out[place + at.NEAR_GROWTH], out[place + at.FAR_GROWTH] = rounded(near.growth), rounded(far.growth)
    out[place + at.THROUGH] = 1.0 if least[0] == 0.0 else 0.0


@shared
def _begun(
    half: Half, near: bool, hyperbolic: bool, sine: DoubleDouble, cosine: DoubleDouble, twice: DoubleDouble
) -> DoubleDouble:
    """The argument of a half-angle function at the start."""
    if near:
        real, imag = mul(cosine, value(half.near_real, twice)), mul(sine, value(half.near_imag, twice))
    elif hyperbolic:
        real, imag = value(half.far_real, twice), mul(mul(sine, cosine), value(half.far_imag, twice))
    else:
        real, imag = mul(cosine, value(half.far_real, twice)), mul(sine, value(half.far_imag, twice))
    return arctan2(imag, real)


@shared
def _theta(down: DoubleDouble, up: DoubleDouble, upright: bool) -> float:
    """theta of a turning point from its distances 1 + u and 1 - u."""
    x, y = root(down), root(up)
    return 2.0 * rounded(arctan2(y, x) if upright else arctan2(x, y))


@shared
def _poles(points: TurningPoints, nome: Nome, hyperbolic: bool, bow: DoubleDouble) -> tuple[Half, Half]:
    """The half-angle functions of the lower and the upper pole."""
    low, low_far = root(points.d1), root(points.swing)
    high, high_far = root(mul(points.e2, points.stiffness)), root(mul(points.bend, points.swing))
    if hyperbolic:
        y, s, c = real_argument(low, low_far, nome)
        first = hyperbolic_half(y, s, c, nome, bow)
        y, s, c = real_argument(high, high_far, nome)
        return first, hyperbolic_half(y, s, c, nome, bow)
    s, c = imaginary_argument(low, low_far, nome)
    first = trigonometric_half(s, c, nome)
    s, c = imaginary_argument(high, high_far, nome)
    return first, trigonometric_half(s, c, nome)


@shared
def _sign(x: DoubleDouble, vanishes: bool) -> float:
    return 0.0 if vanishes else (1.0 if x[0] > 0.0 else -1.0)


@shared
def move(data: Data, sums: Sums, exact: Exact, points: TurningPoints, out: Any) -> tuple[int, Mean]:
    """Constants of a moving axis."""
    swing, stiffness, upright = points.swing, points.stiffness, data.mgl >= 0.0
    clear = (
        (exact.through_down or points.d1[0] > LEAST_GAP)
        and (points.passes_up or points.e2[0] > LEAST_GAP)
        and points.gap[0] > LEAST_GAP * stiffness[0]
    )
    if not (clear and swing[0] > LEAST_SWING and swing[0] > LEAST_SWING * max(points.d2[0], points.e1[0])):
        return OUT_OF_RANGE, Mean(ZERO, ZERO, ZERO, ZERO, ZERO)
    omega = scaled(root(stiffness), 0.5)
    m, m1 = div(mul(sums.lead, swing), stiffness), div(points.gap, stiffness)
    hyperbolic = m[0] > 0.5
    nome = nome_of(m1, m) if hyperbolic else nome_of(m, m1)
    quarter = mul(HALF_PI, nome.period)  # K, or K' for m > 1/2
    bow = HALF_PI  # of the angle z or s to a quarter period
    if hyperbolic:
        bow = scaled(log(nome.q), -0.5)
        quarter = mul(mul(quarter, bow), scaled(PER_PI, 2.0))
    per_time = div(omega, quarter)

    # the start, from the nearer turning point: sn, cn up to a common factor
    sn2, cn2 = div(neg(points.x1), swing), div(points.x2, swing)
    late = sn2[0] * (m1[0] + m[0] * cn2[0]) > cn2[0]
    sn, cn = (root(cn2), root(mul(m1, sn2))) if late else (root(sn2), root(cn2))
    lower, upper = _poles(points, nome, hyperbolic, bow)
    if hyperbolic:
        sine, cosine = imaginary_argument(sn, cn, nome)
        place = div(arsinh(sine, cosine), bow)
        twice = add_double(scaled(square(sine), 2.0), 1.0)
    else:
        angle, sine, cosine = real_argument(sn, cn, nome)
        place = mul(angle, scaled(PER_PI, 2.0))
        twice = add_double(scaled(square(sine), -2.0), 1.0)
    rising = -1.0 if (data.theta_dot if upright else -data.theta_dot) > 0.0 else 1.0  # the sign of u'
    begun = scaled(sub(ONE, place), rising) if late else scaled(place, rising)
    put_line(out, at.QUARTERS, per_time, begun)
    at_floor = sn2[0] == 0.0
    out[at.FLOOR_SIGN] = 1.0 if (rising > 0.0 and sn2[0] > 0.0) or (at_floor and data.theta_dot >= 0.0) else -1.0

    sign_down, sign_up = _sign(sums.twist_down, exact.through_down), _sign(sums.twist_up, exact.through_up)
    turn = per_time if hyperbolic else mul(per_time, HALF_PI)
    side = -rising if late else rising
    growth_down = growth_up = lag_down = lag_up = ZERO
    if sign_down != 0.0:
        growth_down = add(div(sums.twist_down, points.d2), scaled(mul(turn, lower.turning), 2.0 * sign_down))
        argument = _begun(lower, not late, hyperbolic, sine, cosine, twice)
        lag_down = scaled(sub(argument, mul(lower.growth, place)), side * sign_down)
    if sign_up != 0.0:
        growth_up = add(div(sums.twist_up, points.e1), scaled(mul(turn, upper.turning), 2.0 * sign_up))
        argument = _begun(upper, late, hyperbolic, sine, cosine, twice)
        lag_up = scaled(sub(argument, mul(upper.growth, place)), side * sign_up)

    out[at.SIGN_DOWN], out[at.SIGN_UP], out[at.MAY_STOP] = sign_down, sign_up, 1.0 if sign_down * sign_up < 0.0 else 0.0
    out[at.TWIST_DOWN] = 0.5 * root(scaled(sums.twist_down, sign_down))[0]
    out[at.TWIST_UP] = 0.5 * root(scaled(sums.twist_up, sign_up))[0]
    out[at.HYPERBOLIC], out[at.SCALE] = 1.0 if hyperbolic else 0.0, bow[0]
    warp = odd_sines(ONE, neg(nome.q2), nome.q6, neg(nome.q12))
    bend, stretch = total(warp), div(quarter, bow)
    _put(out, at.BEND, warp, ONE)
    low_depth = mul(swing, square(stretch))
    high_depth = mul(low_depth, m1)
    _frame(out, at.FLOOR, lower, upper, (points.d1, points.e1), low_depth)
    _frame(out, at.CROWN, upper, lower, (points.e2, points.d2), high_depth)
    quick = div(omega, mul(stretch, bend))
    twist_down = ZERO if exact.through_down else sums.twist_down
    twist_up = ZERO if exact.through_up else sums.twist_up
    out[at.FLOOR + at.STEEPNESS], out[at.CROWN + at.STEEPNESS] = -mul(quick, low_depth)[0], mul(quick, high_depth)[0]
    out[at.FLOOR + at.LEAN] = 0.5 * add(mul(twist_down, points.e1), mul(twist_up, points.d1))[0]
    out[at.CROWN + at.LEAN] = 0.5 * add(mul(twist_down, points.e2), mul(twist_up, points.d2))[0]
    squared = square(bend)
    out[at.FLOOR + at.LEANING] = -div(mul(sums.a, low_depth), squared)[0]
    out[at.CROWN + at.LEANING] = div(mul(sums.a, high_depth), squared)[0]

    low, high = _theta(points.d2, points.e2, upright), _theta(points.d1, points.e1, upright)
    if data.theta_dot == 0.0:  # the start is a turning point
        low, high = (low, data.theta) if points.x1[0] == 0.0 else (data.theta, high)
    out[at.THETA_LOW], out[at.THETA_HIGH] = (low, high) if upright else (high, low)
    return DONE, Mean(div(scaled(quarter, 2.0), omega), growth_down, growth_up, lag_down, lag_up)
