"""The constants of the closed form in microseconds: double-double, and quad-double where a bound asks for it.

    data -> sums (`motion_sums`) -> turning points (`turning_points`) -> frames, rates and lags (`moving_axis`)

Choice of arithmetic. The turning points carry bounds of relative errors. If a rate may be wrong by more than `RATE` or
a value by more than `VALUE`, the sums are formed again in quad-double; if that does not do either, or if the data lie
where squares leave the range of doubles, the answer is a status and the caller takes 40 digits. A rate good to 1e-28
has the phase right to 1e-16 after 1e12 radians. At the end the form is evaluated at time 0 and compared with the start:
a wrong constant, whatever its cause, shows there.

An axis at a constant angle (a steady precession, a top that sleeps or stands on a pole) has the rates of its two
natural angles and the period of small nutations, 4 Omega^2 = 3 lead up - k2. On the separatrix there are no constants
but g. Cost, compiled: 3 us (5 us with quad-double); interpreted, to the same bits, 0.5 ms.
"""

import math
from typing import Any

from symtop.core.jit_functions import shared
from symtop.model.exact import motion_layout as at
from symtop.model.exact.double_double import PI, ZERO, DoubleDouble, add, div, mul, neg, root, scaled, sub, two_sum
from symtop.model.exact.motion_samples import halves
from symtop.model.exact.motion_sums import GRAIN, Data, Exact, Sums, exact_zeros, long_sums, short_sums
from symtop.model.exact.moving_axis import DONE, OUT_OF_RANGE, UNMET, UNRESOLVED, Mean, move, put_line, put_turns
from symtop.model.exact.turning_points import TurningPoints, turning_points, unknown_points

RATE, VALUE, SERIES = 1e-28, 1e-18, 1e-30  # the last: what nome, period and mean rates add (measured 3e-31)
SMALLEST, LARGEST = 1e-60, 1e40  # of any number given that is not zero
LEAST_ANGLE, LARGEST_ANGLE = 1e-142, 1e12  # of theta, and of phi and psi


@shared
def _in_range(data: Data, phi: float, psi: float) -> bool:
    """Do squares of squares of the data, and their rounding errors, stay within the range of doubles?"""
    I1, I3, mgl, theta, theta_dot, phi_dot, psi_dot = data
    for number in (mgl, theta_dot, phi_dot, psi_dot, I1, I3):
        if number != 0.0 and not SMALLEST < abs(number) <= LARGEST:
            return False
    return (theta == 0.0 or theta > LEAST_ANGLE) and abs(phi) < LARGEST_ANGLE and abs(psi) < LARGEST_ANGLE


@shared
def _stand(data: Data, sums: Sums, exact: Exact, out: Any) -> tuple[int, Mean]:
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
    moving = scaled(mul(sums.kinetic, (data.I1, 0.0)), 0.5)
    spinning = div(scaled(mul(sums.p_psi, sums.p_psi), 0.5), (data.I3, 0.0))
    lifted = mul(sub((1.0, 0.0), sums.up), (abs(data.mgl), 0.0))
    leaning = mul(sums.twist_up, (data.I1, 0.0))
    p_phi = add(leaning, sums.p_psi) if data.mgl >= 0.0 else sub(leaning, sums.p_psi)
    return add(add(moving, spinning), lifted)[0], p_phi[0]


@shared
def _climb(data: Data, out: Any) -> None:
    """Constants of the separatrix: theta = 4 atan tanh(g t/2) from the lower pole, g = sqrt(abs(mgl)/I1)."""
    out[at.SCALE] = root(div((-data.mgl, 0.0), (data.I1, 0.0)))[0]
    out[at.FLOOR_SIGN] = 1.0 if data.theta_dot > 0.0 else -1.0
    out[at.THETA_LOW], out[at.THETA_HIGH] = 0.0, math.pi


@shared
def _meets(data: Data, phi: float, psi: float, speed: float, c: Any) -> bool:
    """Does the form begin where it should, to rounding, in attitude, theta' and phi' sin theta?"""
    cosine, ax, ay, sine, bx, by, nod, rate = halves(c, 0.0)
    ahead, behind, x, y = 0.5 * (phi + psi), 0.5 * (phi - psi), math.cos(0.5 * data.theta), math.sin(0.5 * data.theta)
    gap = max(
        abs(cosine * ax - x * math.cos(ahead)),
        abs(cosine * ay - x * math.sin(ahead)),
        abs(sine * bx - y * math.cos(behind)),
        abs(sine * by - y * math.sin(behind)),
    )
    if sine < 0.0 and cosine >= 0.0:
        nod = -nod
    across = 2.0 * x * y
    off = 0.0
    if data.theta > 0.0:
        off = max(abs(nod - data.theta_dot), abs((rate - data.phi_dot) * across))
    spread = abs(data.theta_dot) + abs(data.phi_dot * across) + abs(c[at.P_PSI] / data.I1) + 0.1 * speed
    return gap <= 4e-15 + 4e-16 * (abs(ahead) + abs(behind)) and off <= 1e-13 * spread


@shared
def _chosen(data: Data, exact: Exact) -> tuple[float, Sums, TurningPoints]:
    """The arithmetic that the data ask for, the sums in it and the turning points."""
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


@shared
def _lines(data: Data, phi: float, psi: float, a: DoubleDouble, mean: Mean, out: Any) -> None:
    """Lines of the angles: mean rates and starts."""
    upright = data.mgl >= 0.0
    drift, turned = mul(a, div(two_sum(data.I1, -data.I3), (data.I3, 0.0))), psi if upright else -psi
    down_start = sub(scaled(two_sum(phi, turned), 0.5), mean.lag_down)
    up_start = sub(scaled(two_sum(phi, -turned), 0.5), mean.lag_up)
    down_rate, up_rate = scaled(add(drift, mean.growth_down), 0.5), scaled(sub(mean.growth_up, drift), 0.5)
    phi_rate, phi_start = scaled(add(mean.growth_down, mean.growth_up), 0.5), add(down_start, up_start)
    psi_rate = add(drift, scaled(sub(mean.growth_down, mean.growth_up), 0.5))
    psi_start = sub(down_start, up_start)
    if not upright:
        psi_rate, psi_start = neg(psi_rate), neg(psi_start)
    out[at.PERIOD] = mean.period[0]
    out[at.PHI_PER_PERIOD], out[at.PSI_PER_PERIOD] = (
        _per_period(phi_rate, mean.period),
        _per_period(psi_rate, mean.period),
    )
    put_line(out, at.PHI_LINE, phi_rate, phi_start)
    put_line(out, at.PSI_LINE, psi_rate, psi_start)
    put_turns(out, at.PHI_TURNS, phi_rate, phi_start)
    put_turns(out, at.DOWN_TURNS, down_rate, down_start)
    put_turns(out, at.UP_TURNS, up_rate, up_start)


@shared
def motion_constants(
    I1: float,
    I3: float,
    mgl: float,
    theta: float,
    phi: float,
    psi: float,
    theta_dot: float,
    phi_dot: float,
    psi_dot: float,
    out: Any,
) -> int:
    """Fill in the constants; a status, `DONE` if they can be relied on."""
    data = Data(I1, I3, mgl, theta, theta_dot, phi_dot, psi_dot)
    if not _in_range(data, phi, psi):
        return OUT_OF_RANGE
    exact = exact_zeros(data)
    arithmetic, sums, points = _chosen(data, exact)
    for place in range(at.SIZE):
        out[place] = 0.0
    out[at.ARITHMETIC], out[at.UPRIGHT], out[at.I1] = arithmetic, 1.0 if mgl >= 0.0 else 0.0, I1
    out[at.P_PSI], out[at.W3] = sums.p_psi[0], div(sums.p_psi, (I3, 0.0))[0]
    out[at.ENERGY], out[at.P_PHI] = _conserved(data, sums)
    status, mean = DONE, Mean((math.inf, 0.0), ZERO, ZERO, ZERO, ZERO)
    if exact.separatrix:
        out[at.KIND] = at.CLIMBS
        _climb(data, out)
    elif exact.rests:
        status, mean = _stand(data, sums, exact, out)
    elif points.rate_error < RATE and points.value_error < VALUE:
        out[at.KIND], out[at.RATE_ERROR], out[at.VALUE_ERROR] = at.MOVES, points.rate_error + SERIES, points.value_error
        status, mean = move(data, sums, exact, points, out)
    else:
        status = UNRESOLVED
    if status != DONE:
        return status
    _lines(data, phi, psi, sums.a, mean, out)
    speed = math.sqrt(sums.lead[0]) + math.sqrt(sums.kinetic[0])
    return DONE if _meets(data, phi, psi, speed, out) else UNMET


def all_constants(rows: Any, out: Any) -> int:
    """The constants of n tops, of rows (n, 9) of their numbers, with statuses; how many are not to be relied on."""
    failed = 0
    for i in range(len(rows)):
        one, c = rows[i], out[i]
        c[at.STATUS] = motion_constants(one[0], one[1], one[2], one[3], one[4], one[5], one[6], one[7], one[8], c)
        failed += 1 if c[at.STATUS] != DONE else 0
    return failed
