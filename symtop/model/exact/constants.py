"""The constants of the closed form: in double-double, and in quad-double where a bound asks for it.

    data -> sums -> turning points (`turning_points`) -> half-angle functions (`elliptic`) -> frames, rates and lags

The turning points carry bounds of relative errors. If a rate may be wrong by more than `RATE` or a value by more than
`VALUE`, the sums are formed again in quad-double; if that is not enough, or if squares leave the range of doubles, the
answer is a status and the caller takes 40 digits. A rate good to 1e-28 has the phase right to 1e-16 after 1e12 radians.
At the end the form is evaluated at time 0 and compared with the start: a wrong constant shows there.

Of a moving axis, with growth = d(phi +- psi)/dt less its drift,

    growth of a pole = twist/(distance at the far turning point) + what the passage at the near one adds,
    (phi + psi)' = drift + growth of the lower pole,      (phi - psi)' = -drift + growth of the upper pole,

both terms of a growth having the same sign. Lags are what the angles are ahead of their means at the start. An axis at
a constant angle (a steady precession, a top that sleeps or stands on a pole) has the rates of its two natural angles
and the period of small nutations, 4 Omega^2 = 3 lead up - k2. On the separatrix there are no constants but g.
"""

import math
from typing import Any, NamedTuple

from symtop.core.jit_functions import shared
from symtop.model.exact import layout as at
from symtop.model.exact.double_double import (
    HALF_PI,
    ONE,
    PER_PI,
    PER_TURN,
    PI,
    ZERO,
    DoubleDouble,
    add,
    add_double,
    arctan2,
    div,
    log,
    mul,
    neg,
    root,
    rounded,
    scaled,
    square,
    sub,
    two_sum,
    whole_part,
)
from symtop.model.exact.elliptic import (
    Cubic,
    Half,
    Nome,
    arsinh,
    hyperbolic_half,
    imaginary_argument,
    nome_of,
    odd_sines,
    real_argument,
    total,
    trigonometric_half,
    value,
)
from symtop.model.exact.samples import halves
from symtop.model.exact.turning_points import GRAIN, RATE, VALUE, Data, Exact, Sums, TurningPoints, choose, exact_zeros

LEAST_GAP, LEAST_SWING = 1e-280, 1e-130  # limits on distances from a pole, and on u2 - u1
DONE, OUT_OF_RANGE, UNRESOLVED, UNMET = range(4)  # statuses of the constants


@shared
def _put(out: Any, place: int, poly: Cubic, unit: DoubleDouble) -> None:
    for i in range(4):
        out[place + i] = rounded(mul(poly[i], unit))


class Mean(NamedTuple):
    """Mean motion of the angles: the nutation period, growth at both poles, lags of both halves at the start."""

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
    turns = mul(start, PER_TURN)
    put_line(out, place, mul(rate, PER_TURN), add_double(turns, -whole_part(turns[0])))


@shared
def _frame(
    out: Any, place: int, near: Half, far: Half, near_gap: DoubleDouble, far_gap: DoubleDouble, depth: DoubleDouble
) -> None:
    """The half-angle functions about a turning point, scaled to the moduli that they have there.

    It is at `near_gap` from the pole that it is near and at `far_gap` from the other; abs(u - u there) = depth angle^2.
    """
    if near_gap[0] == 0.0:
        near_unit = div(root(scaled(depth, 0.5)), total(near.near_imag))
    else:
        near_unit = div(root(scaled(near_gap, 0.5)), total(near.near_real))
    far_unit = div(root(scaled(far_gap, 0.5)), total(far.far_real))
    _put(out, place + at.NEAR_REAL, near.near_real, near_unit)
    _put(out, place + at.NEAR_IMAG, near.near_imag, near_unit)
    _put(out, place + at.FAR_REAL, far.far_real, far_unit)
    _put(out, place + at.FAR_IMAG, far.far_imag, far_unit)
    out[place + at.NEAR_GROWTH], out[place + at.FAR_GROWTH] = rounded(near.growth), rounded(far.growth)
    out[place + at.THROUGH] = 1.0 if near_gap[0] == 0.0 else 0.0


@shared
def _argument_at_start(
    half: Half, near: bool, hyperbolic: bool, sine: DoubleDouble, cosine: DoubleDouble, cosine2: DoubleDouble
) -> DoubleDouble:
    if near:
        real, imag = mul(cosine, value(half.near_real, cosine2)), mul(sine, value(half.near_imag, cosine2))
    elif hyperbolic:
        real, imag = value(half.far_real, cosine2), mul(mul(sine, cosine), value(half.far_imag, cosine2))
    else:
        real, imag = mul(cosine, value(half.far_real, cosine2)), mul(sine, value(half.far_imag, cosine2))
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
    near_crown = sn2[0] * (m1[0] + m[0] * cn2[0]) > cn2[0]
    sn, cn = (root(cn2), root(mul(m1, sn2))) if near_crown else (root(sn2), root(cn2))
    lower, upper = _poles(points, nome, hyperbolic, bow)
    if hyperbolic:
        sine, cosine = imaginary_argument(sn, cn, nome)
        place = div(arsinh(sine, cosine), bow)
        cosine2 = add_double(scaled(square(sine), 2.0), 1.0)
    else:
        angle, sine, cosine = real_argument(sn, cn, nome)
        place = mul(angle, scaled(PER_PI, 2.0))
        cosine2 = add_double(scaled(square(sine), -2.0), 1.0)
    direction = -1.0 if (data.theta_dot if upright else -data.theta_dot) > 0.0 else 1.0  # the sign of u'
    elapsed = scaled(sub(ONE, place), direction) if near_crown else scaled(place, direction)
    put_line(out, at.QUARTERS, per_time, elapsed)
    at_floor = sn2[0] == 0.0
    out[at.FLOOR_SIGN] = 1.0 if (direction > 0.0 and sn2[0] > 0.0) or (at_floor and data.theta_dot >= 0.0) else -1.0

    sign_down, sign_up = _sign(sums.twist_down, exact.through_down), _sign(sums.twist_up, exact.through_up)
    turn = per_time if hyperbolic else mul(per_time, HALF_PI)
    side = -direction if near_crown else direction
    growth_down = growth_up = lag_down = lag_up = ZERO
    if sign_down != 0.0:
        growth_down = add(div(sums.twist_down, points.d2), scaled(mul(turn, lower.turning), 2.0 * sign_down))
        argument = _argument_at_start(lower, not near_crown, hyperbolic, sine, cosine, cosine2)
        lag_down = scaled(sub(argument, mul(lower.growth, place)), side * sign_down)
    if sign_up != 0.0:
        growth_up = add(div(sums.twist_up, points.e1), scaled(mul(turn, upper.turning), 2.0 * sign_up))
        argument = _argument_at_start(upper, near_crown, hyperbolic, sine, cosine, cosine2)
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
    _frame(out, at.FLOOR, lower, upper, points.d1, points.e1, low_depth)
    _frame(out, at.CROWN, upper, lower, points.e2, points.d2, high_depth)
    speed = div(omega, mul(stretch, bend))
    twist_down = ZERO if exact.through_down else sums.twist_down
    twist_up = ZERO if exact.through_up else sums.twist_up
    out[at.FLOOR + at.STEEPNESS], out[at.CROWN + at.STEEPNESS] = -mul(speed, low_depth)[0], mul(speed, high_depth)[0]
    out[at.FLOOR + at.LEAN] = 0.5 * add(mul(twist_down, points.e1), mul(twist_up, points.d1))[0]
    out[at.CROWN + at.LEAN] = 0.5 * add(mul(twist_down, points.e2), mul(twist_up, points.d2))[0]
    bend2 = square(bend)
    out[at.FLOOR + at.LEANING] = -div(mul(sums.a, low_depth), bend2)[0]
    out[at.CROWN + at.LEANING] = div(mul(sums.a, high_depth), bend2)[0]

    low, high = _theta(points.d2, points.e2, upright), _theta(points.d1, points.e1, upright)
    if data.theta_dot == 0.0:  # the start is a turning point
        low, high = (low, data.theta) if points.x1[0] == 0.0 else (data.theta, high)
    out[at.THETA_LOW], out[at.THETA_HIGH] = (low, high) if upright else (high, low)
    return DONE, Mean(div(scaled(quarter, 2.0), omega), growth_down, growth_up, lag_down, lag_up)


SERIES = 1e-30  # what nome, period and mean rates add to the relative error of a rate (measured 3e-31)
SMALLEST, LARGEST = 1e-60, 1e40  # range of the data that are not zero
LEAST_ANGLE, LARGEST_ANGLE = 1e-142, 1e12  # rad: the least theta that is not zero, the largest phi and psi


@shared
def _in_range(data: Data, phi: float, psi: float) -> bool:
    """Do squares of squares of the data, and their rounding errors, stay within the range of doubles?"""
    I1, I3, mgl, theta, theta_dot, phi_dot, psi_dot = data
    for number in (mgl, theta_dot, phi_dot, psi_dot, I1, I3):
        if number != 0.0 and not SMALLEST < abs(number) <= LARGEST:
            return False
    return (theta == 0.0 or theta > LEAST_ANGLE) and abs(phi) < LARGEST_ANGLE and abs(psi) < LARGEST_ANGLE


@shared
def _steady(data: Data, sums: Sums, exact: Exact, out: Any) -> tuple[int, Mean]:
    """Constants of an axis at a constant angle; the period is that of small nutations."""
    growth_down = div(sums.twist_down, sums.down) if not exact.through_down else ZERO
    growth_up = div(sums.twist_up, sums.up) if not exact.through_up else ZERO
    terms = sums.lead[0] + sums.kinetic[0] + sums.a[0] * sums.a[0]
    stiffness = sub(scaled(mul(sums.lead, sums.up), 3.0), sums.k2)
    error = GRAIN * terms
    if data.theta == 0.0:
        error = sums.k2_error + (GRAIN * sums.lead[0] if sums.up[0] > 0.0 else 0.0)
    if terms > 0.0 and not error < VALUE * abs(stiffness[0]):
        return UNRESOLVED, Mean(ZERO, ZERO, ZERO, ZERO, ZERO)
    out[at.THETA_LOW] = out[at.THETA_HIGH] = data.theta
    out[at.REST_DOWN], out[at.REST_UP] = root(scaled(sums.down, 0.5))[0], root(scaled(sums.up, 0.5))[0]
    out[at.REST_RATE] = 0.5 * add(growth_down, growth_up)[0]
    period = div(scaled(PI, 2.0), root(stiffness)) if stiffness[0] > 0.0 else (math.inf, 0.0)
    return DONE, Mean(period, growth_down, growth_up, ZERO, ZERO)


@shared
def _per_period(rate: DoubleDouble, period: DoubleDouble) -> float:
    if rate[0] == 0.0:
        return 0.0
    return mul(rate, period)[0] if period[0] < math.inf else math.copysign(math.inf, rate[0])


@shared
def _conserved(data: Data, sums: Sums) -> tuple[float, float]:
    """Energy and p_phi: I1 (theta'^2 + phi'^2 sin^2)/2 + p_psi^2/2 I3 + mgl cos theta, and I1 (b - a) + p_psi."""
    kinetic = scaled(mul(sums.kinetic, (data.I1, 0.0)), 0.5)
    spin = div(scaled(mul(sums.p_psi, sums.p_psi), 0.5), (data.I3, 0.0))
    potential = mul(sub((1.0, 0.0), sums.up), (abs(data.mgl), 0.0))
    momentum = mul(sums.twist_up, (data.I1, 0.0))
    p_phi = add(momentum, sums.p_psi) if data.mgl >= 0.0 else sub(momentum, sums.p_psi)
    return add(add(kinetic, spin), potential)[0], p_phi[0]


@shared
def _agrees(data: Data, phi: float, psi: float, speed: float, c: Any) -> bool:
    """Does the form at time 0 agree with the start to rounding, in attitude, theta' and phi' sin theta?"""
    cosine, ax, ay, sine, bx, by, nod, rate = halves(c, 0.0)
    plus, minus, x, y = 0.5 * (phi + psi), 0.5 * (phi - psi), math.cos(0.5 * data.theta), math.sin(0.5 * data.theta)
    sum_gap = max(abs(cosine * ax - x * math.cos(plus)), abs(cosine * ay - x * math.sin(plus)))
    gap = max(sum_gap, abs(sine * bx - y * math.cos(minus)), abs(sine * by - y * math.sin(minus)))
    if sine < 0.0 and cosine >= 0.0:
        nod = -nod
    across = 2.0 * x * y
    error = 0.0
    if data.theta > 0.0:
        error = max(abs(nod - data.theta_dot), abs((rate - data.phi_dot) * across))
    scale = abs(data.theta_dot) + abs(data.phi_dot * across) + abs(c[at.P_PSI] / data.I1) + 0.1 * speed
    return gap <= 4e-15 + 4e-16 * (abs(plus) + abs(minus)) and error <= 1e-13 * scale


@shared
def _lines(data: Data, phi: float, psi: float, a: DoubleDouble, mean: Mean, out: Any) -> None:
    """Lines of the angles: mean rates and starts."""
    upright = data.mgl >= 0.0
    drift, psi_up = mul(a, div(two_sum(data.I1, -data.I3), (data.I3, 0.0))), psi if upright else -psi
    down_start = sub(scaled(two_sum(phi, psi_up), 0.5), mean.lag_down)
    up_start = sub(scaled(two_sum(phi, -psi_up), 0.5), mean.lag_up)
    down_rate, up_rate = scaled(add(drift, mean.growth_down), 0.5), scaled(sub(mean.growth_up, drift), 0.5)
    phi_rate, phi_start = scaled(add(mean.growth_down, mean.growth_up), 0.5), add(down_start, up_start)
    psi_rate = add(drift, scaled(sub(mean.growth_down, mean.growth_up), 0.5))
    psi_start = sub(down_start, up_start)
    if not upright:
        psi_rate, psi_start = neg(psi_rate), neg(psi_start)
    out[at.PERIOD] = mean.period[0]
    out[at.PHI_PER_PERIOD] = _per_period(phi_rate, mean.period)
    out[at.PSI_PER_PERIOD] = _per_period(psi_rate, mean.period)
    put_line(out, at.PHI_LINE, phi_rate, phi_start)
    put_line(out, at.PSI_LINE, psi_rate, psi_start)
    put_turns(out, at.PHI_TURNS, phi_rate, phi_start)
    put_turns(out, at.DOWN_TURNS, down_rate, down_start)
    put_turns(out, at.UP_TURNS, up_rate, up_start)


@shared
def motion_constants(numbers: Any, out: Any) -> int:
    """Fill in the constants of a row of `symtop.model.top.NUMBERS`; returns a status, `DONE` if they are accurate."""
    data = Data(numbers[0], numbers[1], numbers[2], numbers[3], numbers[6], numbers[7], numbers[8])
    phi, psi = numbers[4], numbers[5]
    if not _in_range(data, phi, psi):
        return OUT_OF_RANGE
    exact = exact_zeros(data)
    arithmetic, sums, points = choose(data, exact)
    for place in range(at.SIZE):
        out[place] = 0.0
    out[at.ARITHMETIC], out[at.UPRIGHT], out[at.I1] = arithmetic, 1.0 if data.mgl >= 0.0 else 0.0, data.I1
    out[at.P_PSI], out[at.W3] = sums.p_psi[0], div(sums.p_psi, (data.I3, 0.0))[0]
    out[at.ENERGY], out[at.P_PHI] = _conserved(data, sums)
    status, mean = DONE, Mean((math.inf, 0.0), ZERO, ZERO, ZERO, ZERO)
    if exact.separatrix:  # theta = 4 atan tanh(g t/2) from the lower pole, g = sqrt(abs(mgl)/I1)
        out[at.KIND], out[at.SCALE] = at.CLIMBS, root(div((-data.mgl, 0.0), (data.I1, 0.0)))[0]
        out[at.FLOOR_SIGN] = 1.0 if data.theta_dot > 0.0 else -1.0
        out[at.THETA_LOW], out[at.THETA_HIGH] = 0.0, math.pi
    elif exact.rests:
        status, mean = _steady(data, sums, exact, out)
    elif points.rate_error < RATE and points.value_error < VALUE:
        out[at.KIND], out[at.RATE_ERROR], out[at.VALUE_ERROR] = at.MOVES, points.rate_error + SERIES, points.value_error
        status, mean = move(data, sums, exact, points, out)
    else:
        status = UNRESOLVED
    if status != DONE:
        return status
    _lines(data, phi, psi, sums.a, mean, out)
    speed = math.sqrt(sums.lead[0]) + math.sqrt(sums.kinetic[0])
    return DONE if _agrees(data, phi, psi, speed, out) else UNMET


def all_constants(rows: Any, out: Any) -> int:
    """Fill in the constants of n tops from rows (n, 9), with statuses; returns how many are not `DONE`."""
    failed = 0
    for i in range(len(rows)):
        out[i][at.STATUS] = motion_constants(rows[i], out[i])
        failed += 1 if out[i][at.STATUS] != DONE else 0
    return failed
