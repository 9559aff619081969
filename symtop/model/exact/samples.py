"""Evaluation of the closed form at one time, from an array of constants.

The halves A and B of `symtop.model.exact.closed_form` are moduli times unit vectors times exp(i (line of angles - mean
growth)). With x = the quarter periods from the nearest turning point, abs(x) <= 1/2, and the frame of that point,

    near, far = moduli and unit vectors of the two half-angle functions (cubics in cos 2z or cosh 2s),
    theta' = steepness theta_1(2z)/theta_4(z)^4 / (near far),     phi' = sign (twist/near)^2 + sign (twist/far)^2,

the last as (b - a u)/sin^2 theta where the two fractions cancel more than b and a u do. The phase is start + rate t
with numbers of two doubles: its error does not grow with time. On the separatrix the halves are tanh(g t), sech(g t).
"""

import math
from collections.abc import Sequence
from typing import Any

from symtop.core.jit_functions import inlined, shared, two_product
from symtop.model.exact import layout as at
from symtop.model.exact.double_double import two_sum, whole_part

MOTION, QUATERNION, AXIS, MOMENTUM, STATE, TURNS, RUN = range(7)  # views: what `samples` fills in
WIDTHS = (6, 4, 3, 3, 7, 2, 9)  # numbers in a view; `RUN`: a state, and p_phi and p_psi computed from it
ROWS = (MOTION, TURNS)  # views that are stored as (width, n), the others as (n, width)
LONGEST_TIME = 1e100
TURN = 2.0 * math.pi

Constants = Any  # an array, or a list when interpreted
Wave = tuple[float, float, float, float, float, float, float, float, float, float]


@inlined
def line(c: Constants, place: int, t: float) -> tuple[float, float]:
    """start + rate t as two doubles."""
    product, error = two_product(t, c[place])
    total, rounding = two_sum(product, c[place + 2])
    return total, error + (rounding + (t * c[place + 1] + c[place + 3]))


@inlined
def cubic(c: Constants, place: int, x: float) -> float:
    """The cubic at a place of the constants, at x."""
    value: float = c[place] + x * (c[place + 1] + x * (c[place + 2] + x * c[place + 3]))
    return value


@inlined
def _sinh_cosh(x: float) -> tuple[float, float]:
    exp_plus = math.exp(abs(x))
    exp_minus = 1.0 / exp_plus
    y = x * x
    if y > 0.1:
        odd = math.copysign(0.5 * (exp_plus - exp_minus), x)
    else:
        tail = 1.0 / 5040.0 + y * (1.0 / 362880.0 + y * (1.0 / 39916800.0 + y / 6227020800.0))
        odd = x + x * y * (1.0 / 6.0 + y * (1.0 / 120.0 + y * tail))
    return odd, 0.5 * (exp_plus + exp_minus)


@inlined
def _separatrix_wave(c: Constants, t: float) -> Wave:
    """Elementary motion on the separatrix, from the lower pole at time 0."""
    x, sign = c[at.SCALE] * t, c[at.FLOOR_SIGN]
    exp_minus = math.exp(-abs(x))
    sech = 2.0 * exp_minus / (1.0 + exp_minus * exp_minus)
    return sign * math.tanh(x), 1.0, 0.0, 0.0, sech, 1.0, 0.0, 0.0, -2.0 * c[at.SCALE] * sign * sech, 0.0


@inlined
def _phase(c: Constants, t: float) -> tuple[float, float]:
    """The nearest turning point, 0 to 3 in turn, and the quarter periods from it."""
    high, low = line(c, at.QUARTERS, t)
    nearest = whole_part(high)
    offset = (high - nearest) + low
    if abs(high) > 1e15:  # the low half may hold whole quarters, too
        extra = whole_part(offset)
        offset, nearest = offset - extra, nearest % 4.0 + extra % 4.0
    return nearest - 4.0 * whole_part(0.25 * nearest - 0.375), offset


@inlined
def _precession(c: Constants, down: float, up: float, lean: float, size: float) -> float:
    """phi' as the sum of its two fractions, or as lean/sin^2 theta where these cancel more than the terms of lean."""
    rate = fractions = 0.0
    if c[at.SIGN_DOWN] != 0.0:
        fraction = (c[at.TWIST_DOWN] / down) * (c[at.TWIST_DOWN] / down)
        rate, fractions = rate + c[at.SIGN_DOWN] * fraction, fractions + fraction
    if c[at.SIGN_UP] != 0.0:
        fraction = (c[at.TWIST_UP] / up) * (c[at.TWIST_UP] / up)
        rate, fractions = rate + c[at.SIGN_UP] * fraction, fractions + fraction
    if c[at.MAY_STOP] > 0.0:
        sine2 = (2.0 * down * up) * (2.0 * down * up)
        if size < fractions * sine2:
            return lean / sine2
    return rate


@inlined
def wave(c: Constants, t: float) -> Wave:
    """The motion without the angles that are linear in time, in the upright picture.

    For the halves down = sqrt((1 + u)/2) and up = sqrt((1 - u)/2), signed through a pole: modulus, cosine and sine of
    the argument, its mean growth since the turning point. Then theta' and phi'.
    """
    if c[at.KIND] == at.RESTS:
        return c[at.REST_DOWN], 1.0, 0.0, 0.0, c[at.REST_UP], 1.0, 0.0, 0.0, 0.0, c[at.REST_RATE]
    if c[at.KIND] == at.CLIMBS:
        return _separatrix_wave(c, t)
    quarter, offset = _phase(c, t)
    near_crown = quarter % 2.0 == 1.0
    frame = at.CROWN if near_crown else at.FLOOR
    angle = c[at.SCALE] * offset
    if c[at.HYPERBOLIC] > 0.0:
        odd, even = _sinh_cosh(angle)
        twice = 1.0 + 2.0 * odd * odd
        far_real, far_imag = cubic(c, frame + at.FAR_REAL, twice), odd * even * cubic(c, frame + at.FAR_IMAG, twice)
    else:
        odd, even = math.sin(angle), math.cos(angle)
        twice = 1.0 - 2.0 * odd * odd
        far_real, far_imag = even * cubic(c, frame + at.FAR_REAL, twice), odd * cubic(c, frame + at.FAR_IMAG, twice)
    near_odd = cubic(c, frame + at.NEAR_IMAG, twice)
    near_real, near_imag = even * cubic(c, frame + at.NEAR_REAL, twice), odd * near_odd
    far_size = math.sqrt(far_real * far_real + far_imag * far_imag)
    through = c[frame + at.THROUGH] > 0.0
    near_size = near_imag if through else math.sqrt(near_real * near_real + near_imag * near_imag)
    per_near = 1.0 / near_odd if through else odd / near_size
    square = near_size * near_size + far_size * far_size  # theta_4(z)^2
    nod = c[frame + at.STEEPNESS] * even * per_near * cubic(c, at.BEND, 2.0 * twice * twice - 1.0) / (far_size * square)
    bend = cubic(c, at.BEND, twice) * odd
    leaning = c[frame + at.LEANING] * (bend * bend) / square
    lean, size = c[frame + at.LEAN] + leaning, abs(c[frame + at.LEAN]) + abs(leaning)  # b - a u and its terms

    sign_near, sign_far = (c[at.SIGN_UP], c[at.SIGN_DOWN]) if near_crown else (c[at.SIGN_DOWN], c[at.SIGN_UP])
    near_lag, far_lag = sign_near * c[frame + at.NEAR_GROWTH] * offset, sign_far * c[frame + at.FAR_GROWTH] * offset
    near_x, near_y, far_x, far_y = 1.0, 0.0, 1.0, 0.0
    if sign_near != 0.0:
        near_x, near_y = near_real / near_size, sign_near * near_imag / near_size
    if sign_far != 0.0:
        far_x, far_y = far_real / far_size, sign_far * far_imag / far_size
    norm = math.sqrt(square)
    near, far = near_size / norm, far_size / norm
    down, up = (far, near) if near_crown else (near, far)

    rate = _precession(c, down, up, lean, size)
    if c[at.FLOOR + at.THROUGH] > 0.0:  # the sign of sn
        sign = c[at.FLOOR_SIGN] if quarter < 2.0 else -c[at.FLOOR_SIGN]
        down, nod = down * sign, nod * sign
    if c[at.CROWN + at.THROUGH] > 0.0:  # the sign of cn
        sign = 1.0 if abs(quarter - 1.5) > 1.0 else -1.0  # 0 or 3
        up, nod = up * sign, nod * sign
    if near_crown:
        return down, far_x, far_y, far_lag, up, near_x, near_y, near_lag, nod, rate
    return down, near_x, near_y, near_lag, up, far_x, far_y, far_lag, nod, rate


@inlined
def _unit(c: Constants, place: int, t: float, x: float, y: float, lag: float) -> tuple[float, float]:
    """The unit vector (x, y) turned by a line of angles, in turns, less a lag in radians."""
    high, low = line(c, place, t)
    angle = TURN * ((high - whole_part(high)) + low) - lag
    cosine, sine = math.cos(angle), math.sin(angle)
    return cosine * x - sine * y, cosine * y + sine * x


@shared
def halves(c: Constants, t: float) -> tuple[float, float, float, float, float, float, float, float]:
    """cos(theta/2) with its unit vector, sin(theta/2) with its own, theta' and phi', for the given top."""
    down, dx, dy, down_lag, up, ux, uy, up_lag, nod, rate = wave(c, t)
    dx, dy = _unit(c, at.DOWN_TURNS, t, dx, dy, down_lag)
    ux, uy = _unit(c, at.UP_TURNS, t, ux, uy, up_lag)
    if c[at.UPRIGHT] > 0.0:
        return down, dx, dy, up, ux, uy, nod, rate
    return up, ux, uy, down, dx, dy, -nod, rate


@inlined
def _turns(c: Constants, t: float, values: Wave) -> tuple[float, float]:
    """phi and psi, continuous but for the passage of a pole."""
    down, dx, dy, down_lag, up, ux, uy, up_lag, _, _ = values
    sum_lag, difference_lag = math.atan2(dy, dx) - down_lag, math.atan2(uy, ux) - up_lag
    upright = c[at.UPRIGHT] > 0.0
    high, low = line(c, at.PHI_LINE, t)
    phi = high + (low + (sum_lag + difference_lag))
    high, low = line(c, at.PSI_LINE, t)
    psi = high + (low + (sum_lag - difference_lag if upright else difference_lag - sum_lag))
    if (down < 0.0) != (up < 0.0):
        phi, beneath = phi + math.pi, (down if upright else up) < 0.0
        psi = psi + math.pi if beneath else psi - math.pi
    return phi, psi


@inlined
def _motion(c: Constants, t: float) -> tuple[float, float, float, float, float, float]:
    values = wave(c, t)
    phi, psi = _turns(c, t, values)
    upright = c[at.UPRIGHT] > 0.0
    cosine, sine = (values[0], values[4]) if upright else (values[4], values[0])
    theta_dot, rate = values[8], values[9]
    if ((cosine < 0.0) != (sine < 0.0)) == upright:
        theta_dot = -theta_dot
    theta = 2.0 * math.atan2(abs(sine), abs(cosine))
    return theta, phi, psi, theta_dot, rate, c[at.W3] - (cosine - sine) * (cosine + sine) * rate


@inlined
def _axis(c: Constants, t: float) -> tuple[float, float, float]:
    down, dx, dy, down_lag, up, ux, uy, up_lag, _, _ = wave(c, t)
    x, y = _unit(c, at.PHI_TURNS, t, dx * ux - dy * uy, dx * uy + dy * ux, down_lag + up_lag)
    cosine, sine = (down, up) if c[at.UPRIGHT] > 0.0 else (up, down)
    across = 2.0 * cosine * sine
    return across * y, -across * x, (cosine - sine) * (cosine + sine)


@inlined
def _axial_momentum(state: Any) -> float:
    """L.e of a state (q, L)."""
    w, x, y, z = state[0], state[1], state[2], state[3]
    right, back, up = 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w - x * x - y * y + z * z
    along: float = state[4] * right + state[5] * back + state[6] * up
    return along


@shared
def samples(c: Constants, times: Sequence[float], view: int, out: Any) -> int:
    """Fill in one view, (n, width), or (width, n) of `ROWS`; the place of the first time beyond the range, or -1."""
    for i in range(len(times)):
        if not abs(times[i]) <= LONGEST_TIME:
            return i
    for i in range(len(times)):
        t = times[i]
        if view == MOTION:
            out[0, i], out[1, i], out[2, i], out[3, i], out[4, i], out[5, i] = _motion(c, t)
        elif view == TURNS:
            out[0, i], out[1, i] = _turns(c, t, wave(c, t))
        elif view == AXIS:
            out[i, 0], out[i, 1], out[i, 2] = _axis(c, t)
        else:
            cosine, ax, ay, sine, bx, by, nod, rate = halves(c, t)
            if view != MOMENTUM:
                out[i, 0], out[i, 1], out[i, 2], out[i, 3] = cosine * ax, sine * bx, sine * by, cosine * ay
            if view != QUATERNION:
                x, y = ax * bx - ay * by, ax * by + ay * bx  # the line of nodes
                across, along = 2.0 * cosine * sine, (cosine - sine) * (cosine + sine)
                turning, spin, nutation = c[at.I1] * rate * across, c[at.P_PSI], c[at.I1] * nod
                flat, first = spin * across - turning * along, 0 if view == MOMENTUM else 4
                out[i, first], out[i, first + 1] = nutation * x + flat * y, nutation * y - flat * x
                out[i, first + 2] = turning * across + spin * along
            if view == RUN:
                out[i, 7], out[i, 8] = out[i, 6], _axial_momentum(out[i])
    return -1


def all_samples(constants: Any, times: Any, view: int, out: Any) -> int:
    """`samples` of many tops, with one row of times for all of them or a row for each; the place counts all times."""
    for i in range(len(constants)):
        row = min(i, len(times) - 1)
        index = samples(constants[i], times[row], view, out[i])
        if index >= 0:
            return row * len(times[row]) + index
    return -1


def all_gaps(constants: Any, times: Any, axes: Any, out: Any) -> int:
    """Angles between axes (n, samples, 3) and those of n tops, as `charts.axis_distance` takes them, in one pass.

    On processors with AVX-512 NumPy's arc tangent has another last bit for some angles above 0.01 rad, 6 % near 1 rad.
    Returns the place of the first time beyond the range, or -1, as `all_samples` does.
    """
    for i in range(len(constants)):
        place = min(i, len(times) - 1)
        c, row = constants[i], times[place]
        for j in range(len(row)):
            if not abs(row[j]) <= LONGEST_TIME:
                return place * len(row) + j
            x, y, z = _axis(c, row[j])
            a, b, d = float(axes[i, j, 0]), float(axes[i, j, 1]), float(axes[i, j, 2])
            u, v, w = a - x, b - y, d - z
            left, back, lift = v * z - w * y, w * x - u * z, u * y - v * x
            out[i, j] = math.atan2(math.sqrt(left * left + back * back + lift * lift), a * x + b * y + d * z)
    return -1
