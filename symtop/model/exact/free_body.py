"""The exact motion of a free rigid body with any three moments of inertia: attitude and angular momentum.

    M' = M x omega,    omega_i = a_i M_i,    a_i = 1/I_i,    q' = q omega/2        (q takes body to space, scalar first)

*Momentum.* Axis 3 is the one about which M circulates, that of the largest moment (s = 1) or of the smallest (s = -1),
axis 2 that of the middle one, and M3 > 0: a rotation by quarter and half turns. With alpha = |a1 - a2|, beta =
|a2 - a3|, gamma = alpha + beta, a = alpha/gamma, b = beta/gamma,

    A1^2 = M1^2 + b M2^2,    A3^2 = M3^2 + a M2^2,    G^2 = M^2 = A1^2 + A3^2,    k^2 = a A1^2/(b A3^2)
    M = (A1 cn u, s A1 sn u/sqrt(b), A3 dn u),    u' = sqrt(beta gamma) A3,
    k'^2 = gap/(I1 I2 I3 gamma b A3^2),    gap = |(I3 - I2) I1 M3^2 - (I2 - I1) I3 M1^2|

gap is the distance to the separatrix and the only difference of nearly equal numbers: it is the sum of all its terms
without their rounding (`_gap`).

*Attitude.* With n = M/G, r(n) = (1 + n3, n2, -n1, 0)/sqrt(2 (1 + n3)) the shortest turn of n to axis 3, c constant,

    q = c exp(k psi/2) r(n),    psi' = a3 G + s gamma A1^2/(G + A3 dn u),

which is singular nowhere, because n3 > 0, and loses no digits where M1 and M2 are tiny. The last term has the periods
2K and 4iK' of dn, hence everything below has the nome Q = exp(-2 pi K'/K) of Landen's modulus k1 = (1 - k')/(1 + k'),
or where k1^2 > 1/2 the complementary P = exp(-pi K/2K'), after Jacobi's imaginary transformation:

    dn + i k sn = (F/|F|)^2,    cn = const theta_2 theta_3/|F|^2,    F = theta_4(v) + i theta_1(v),    v = pi u/2K
    exp(i psi) = exp(i Omega t) T^(-2s)/|T|^(-2s),    T = theta_4(v + iy),    theta_1(iy)/i theta_4(iy) = A1/(G + A3)
    Omega = psi'(u = 0) + 2 s v' d arg T/dv (v = 0)

    k1^2 > 1/2:    dn = 2 F B/(F^2 + B^2),  k sn = (F^2 - B^2)/(F^2 + B^2),  F, B = theta_2(iw) +- theta_1(iw)/i,
                   T = theta_2(x - iw) up to a factor and a linear angle, 2x/log(1/P) for each unit of w = pi u/4K'

with x in the place of y. Both nomes are at most exp(-pi), so that cubics suffice. Both terms of Omega - a3 G have one
sign, and exp(i psi/2) is the quotient of theta functions: no integral of the third kind with a characteristic near 1,
no arctangent, no count of turns. On the separatrix P = 0, and w is not reduced by a period.

Rates and the phase are double-double, a sample is double.
Source: Whittaker, A Treatise on the Analytical Dynamics, section 69; Whittaker and Watson, Modern Analysis, 21.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from symtop.core.errors import SymtopError
from symtop.core.jit_functions import inlined, shared, two_product
from symtop.core.numbers import real_numbers
from symtop.model.body import product
from symtop.model.charts import Array
from symtop.model.exact.double_double import (
    ONE,
    PER_TURN,
    ZERO,
    DoubleDouble,
    add,
    add_double,
    div,
    log,
    mul,
    mul_double,
    neg,
    root,
    scaled,
    square,
    sub,
    two_sum,
    whole_part,
)
from symtop.model.exact.elliptic import Nome, arsinh, imaginary_argument, nome_of, real_argument
from symtop.model.exact.samples import LONGEST_TIME, TURN, cubic, line
from symtop.model.lazy_kernel import LazyKernel

STEADY, TRIGONOMETRIC, HYPERBOLIC, SEPARATRIX = 0.0, 1.0, 2.0, 3.0  # kinds of motion
KIND, SIGN, FLIP, A1, A2, A3, G, NOME, PER_PHASE, LEAN, RATE_ERROR = range(11)
PHASE, HALF = 11, 15  # lines: turns of u in 4K (w on the separatrix), and of psi/2
SINE, COSINE, THETA_3, THETA_4, REAL, IMAG = 19, 23, 27, 31, 35, 39  # cubics; the last two of T
FRAME, START, TIME_UNIT, UNIT = 43, 52, 56, 57  # canonical to body axes, c above, powers of two
SIZE = 58
GIVEN = 13  # numbers of a body: moments, quaternion, momentum and its low half
LEAST, LEAST_MOMENT = 1e-100, 1e-30  # least nonzero component of the momentum, least moment, relative to the largest
FAR_ALONG = 300.0  # limit on w: sech 2w is negligible beyond
ROUNDING, RATE = 32.0 * 2.0**-53, 2.0**-97  # rad of a sample, twice the largest error; relative, of the rates
PASSES = 6  # of the error-free summation in `_gap`

Constants = Any  # an array, or a list when interpreted
Vector = tuple[float, float, float]
Momentum = tuple[DoubleDouble, DoubleDouble, DoubleDouble]
Quaternion = tuple[float, float, float, float]


@shared
def _terms(lever: DoubleDouble, moment: float, m: DoubleDouble, out: Any, n: int) -> int:
    """Exact terms of lever moment m^2 into `out` from n on; how many there are then."""
    squares = (*two_product(m[0], m[0]), *two_product(2.0 * m[0], m[1]), *two_product(m[1], m[1]))
    for part in (*two_product(lever[0], moment), *two_product(lever[1], moment)):
        for value in squares:
            if part * value != 0.0:
                out[n], out[n + 1] = two_product(part, value)
                n += 2
    return n


@shared
def _gap(inertia: Vector, first: DoubleDouble, last: DoubleDouble) -> DoubleDouble:
    """(I3 - I2) I1 last^2 - (I2 - I1) I3 first^2 to 1e-31, whatever cancels, for ascending moments."""
    low, middle, high = inertia
    out = np.empty(96)
    n = _terms(two_sum(high, -middle), low, last, out, 0)
    n = _terms(two_sum(low, -middle), high, first, out, n)
    total = ZERO
    for _ in range(PASSES):
        for i in range(1, n):
            out[i], out[i - 1] = two_sum(out[i], out[i - 1])
    for i in range(n - 1, -1, -1):
        total = add_double(total, out[i])
    return total


@inlined
def _put_odd(c: Constants, place: int, sign: float, w0: float, w1: float, w2: float, w3: float) -> None:
    """Sum of w_n sin((2n+1)x)/sin x in powers of cos 2x, or with sign -1 of cos((2n+1)x)/cos x."""
    c[place], c[place + 1] = (w0 - w2) + sign * (w1 - w3), 2.0 * (w1 + sign * w2) - 4.0 * w3
    c[place + 2], c[place + 3] = 4.0 * (w2 + sign * w3), 8.0 * w3


@inlined
def _put_even(c: Constants, place: int, w0: float, w1: float, w2: float, w3: float) -> None:
    """Sum of w_n cos 2nx in powers of cos 2x."""
    c[place], c[place + 1], c[place + 2], c[place + 3] = w0 - w2, w1 - 3.0 * w3, 2.0 * w2, 4.0 * w3


@shared
def _trigonometric(c: Constants, nome: Nome, sn: DoubleDouble, cn: DoubleDouble) -> DoubleDouble:
    """Cubics for k1^2 <= 1/2 and a pole sn : cn; d arg T/dv at v = 0."""
    q, w1, w2, w3 = nome.q[0], nome.q2[0], nome.q6[0], nome.q12[0]
    e1, e2, e3 = 2.0 * q, 2.0 * nome.q4[0], 2.0 * nome.q9[0]
    c[NOME] = 2.0 * math.sqrt(math.sqrt(q))
    _put_odd(c, SINE, 1.0, 1.0, -w1, w2, -w3)
    _put_odd(c, COSINE, -1.0, 1.0, w1, w2, w3)
    _put_even(c, THETA_3, 1.0, e1, e2, e3)
    _put_even(c, THETA_4, 1.0, -e1, e2, -e3)
    start, quarter = cubic(c, THETA_4, 1.0), cubic(c, THETA_4, -1.0)
    sine = cubic(c, SINE, -1.0)
    c[A1] *= start * start / (cubic(c, COSINE, 1.0) * cubic(c, THETA_3, 1.0))
    c[A2] *= (quarter * quarter + (c[NOME] * sine) * (c[NOME] * sine)) / (quarter * sine)

    sinh, cosh = imaginary_argument(sn, cn, nome) if cn[0] > 0.0 else (ZERO, ONE)  # symmetric: Q cosh 2y is nothing
    c1, s1 = add_double(scaled(square(sinh), 2.0), 1.0), scaled(mul(sinh, cosh), 2.0)  # of 2y, and so on
    twice = scaled(c1, 2.0)
    c2, s2 = add_double(mul(twice, c1), -1.0), mul(twice, s1)
    c3, s3 = sub(mul(twice, c2), c1), sub(mul(twice, s2), s1)
    c4, s4 = twice[0] * c3[0] - c2[0], twice[0] * s3[0] - s2[0]
    c5, s5 = twice[0] * c4 - c3[0], twice[0] * s4 - s3[0]
    even = sub(mul(nome.q4, c2), add(mul(nome.q, c1), mul(nome.q9, c3)))
    even = add_double(even, nome.q16 * (c4 - nome.q9[0] * c5))
    odd = sub(add(mul(nome.q, s1), mul_double(mul(nome.q9, s3), 3.0)), scaled(mul(nome.q4, s2), 2.0))
    odd = add_double(odd, nome.q16 * (5.0 * nome.q9[0] * s5 - 4.0 * s4))
    _put_even(c, REAL, 1.0, -e1 * c1[0], e2 * c2[0], -e3 * c3[0])
    f1, f2, f3 = e1 * s1[0], -e2 * s2[0], e3 * s3[0]  # sin 2nx/(sin x cos x)
    c[IMAG], c[IMAG + 1], c[IMAG + 2] = 2.0 * (f1 - f3), 4.0 * f2, 8.0 * f3
    return div(scaled(odd, 4.0), add_double(scaled(even, 2.0), 1.0))


@shared
def _hyperbolic(c: Constants, nome: Nome, sn: DoubleDouble, cn: DoubleDouble, span: DoubleDouble) -> DoubleDouble:
    """Cubics for k1^2 > 1/2, span = log(1/P), 0 on the separatrix; d arg T/dw at w = 0."""
    x, s0, c0 = real_argument(sn, cn, nome)
    twice = add_double(scaled(square(s0), -4.0), 2.0)  # 2 cos 2x
    s1, c1 = mul(s0, add_double(twice, 1.0)), mul(c0, add_double(twice, -1.0))  # of 3x, and so on
    s2, c2 = sub(mul(twice, s1), s0), sub(mul(twice, c1), c0)
    s3, c3 = sub(mul(twice, s2), s1), sub(mul(twice, c2), c1)
    s4, c4 = twice[0] * s3[0] - s2[0], twice[0] * c3[0] - c2[0]
    w1, w2, w3 = nome.q2[0], nome.q6[0], nome.q12[0]
    _put_odd(c, REAL, -1.0, c0[0], w1 * c1[0], w2 * c2[0], w3 * c3[0])
    _put_odd(c, IMAG, 1.0, s0[0], w1 * s1[0], w2 * s2[0], w3 * s3[0])
    even = add(add(c0, mul(nome.q2, c1)), add(mul(nome.q6, c2), mul(nome.q12, c3)))
    odd = add(s0, add(mul_double(mul(nome.q2, s1), 3.0), mul_double(mul(nome.q6, s2), 5.0)))
    odd = add_double(add(odd, mul_double(mul(nome.q12, s3), 7.0)), 9.0 * nome.q20 * s4)
    lean = div(scaled(x, 2.0), span) if span[0] > 0.0 else ZERO
    c[NOME], c[LEAN], c[PER_PHASE] = nome.q[0], lean[0], 2.0 * span[0] if span[0] > 0.0 else 1.0
    q2 = nome.q2[0]
    start = 1.0 + q2 + nome.q6[0] + nome.q12[0]
    c[A1] *= 2.0 * start * start / (1.0 - 2.0 * q2 + 2.0 * nome.q4[0] * nome.q4[0])
    return sub(div(odd, add_double(even, nome.q20 * c4)), lean)


@inlined
def _to_body_axes(c: Constants, x: float, y: float, z: float) -> Vector:
    """A vector in the body's axes from the canonical ones: exact."""
    return (
        c[FRAME] * x + c[FRAME + 1] * y + c[FRAME + 2] * z,
        c[FRAME + 3] * x + c[FRAME + 4] * y + c[FRAME + 5] * z,
        c[FRAME + 6] * x + c[FRAME + 7] * y + c[FRAME + 8] * z,
    )


@inlined
def _rotation(c: Constants, m: Vector, angle: float, real: float, imag: float) -> Quaternion:
    """exp(k psi/2) r(n) in the body's axes: psi/2 = angle less s times the argument of T."""
    cosine, sine, imag = math.cos(angle), math.sin(angle), c[SIGN] * imag
    x, y = cosine * real + sine * imag, sine * real - cosine * imag
    size = math.sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2])
    high = size + m[2]
    per = 1.0 / math.sqrt(2.0 * size * high * (real * real + imag * imag))
    x, y = per * x, per * y
    return (x * high, *_to_body_axes(c, x * m[1] + y * m[0], y * m[1] - x * m[0], y * high))


@shared
def _orbit(c: Constants, phase: float) -> tuple[Vector, float, float, float]:
    """Momentum in canonical axes, T up to a factor, and the linear angle of psi/2; within half a turn of u = 0."""
    if c[KIND] == TRIGONOMETRIC:
        v = TURN * phase
        sine, cosine = math.sin(v), math.cos(v)
        x = (cosine - sine) * (cosine + sine)
        odd, even = sine * cubic(c, SINE, x), cubic(c, THETA_4, x)
        real, imag = even * even, (c[NOME] * odd) * (c[NOME] * odd)
        per = 1.0 / (real + imag)
        m1 = c[A1] * (cosine * cubic(c, COSINE, x)) * cubic(c, THETA_3, x) * per
        m = (m1, c[A2] * odd * even * per, c[A3] * (real - imag) * per)
        return m, cubic(c, REAL, x), sine * cosine * cubic(c, IMAG, x), 0.0
    w = c[PER_PHASE] * phase
    back, w = math.copysign(1.0, w), min(abs(w), FAR_ALONG)
    exp_plus = math.exp(w)
    exp_minus = 1.0 / exp_plus
    p, exp_plus2, exp_minus2 = c[NOME], exp_plus * exp_plus, exp_minus * exp_minus
    p2, r = p * p, p * exp_plus2  # r is at most 1
    p4, r2 = p2 * p2, r * r
    r4, q4 = r2 * r2, p2 * exp_minus2 * exp_minus2
    forward = exp_plus * (1.0 + q4 + p4 * r2)
    backward = exp_minus * (1.0 + r2 + p4 * (q4 + p4 * r4))
    f2, b2 = forward * forward, backward * backward
    per = 1.0 / (f2 + b2)
    m1 = c[A1] * ((1.0 - r2) - q4 + p4 * (r4 + q4 * q4)) * per
    m = (m1, back * c[A2] * (f2 - b2) * per, 2.0 * c[A3] * forward * backward * per)
    x = 0.5 * (exp_plus2 + exp_minus2)
    real, imag = (1.0 + exp_minus2) * cubic(c, REAL, x), back * (1.0 - exp_minus2) * cubic(c, IMAG, x)
    return m, real, imag, c[SIGN] * c[LEAN] * back * w


@inlined
def _mod_half(c: Constants, place: int, t: float) -> tuple[float, float]:
    """A line at t less the nearest multiple of 1/2, its low half added last, and -1 if that multiple is odd."""
    high, low = line(c, place, t)
    part = high - 2.0 * whole_part(0.5 * high)  # doubles from 2^51 to 2^52 have halves
    halves = whole_part(2.0 * part)
    remainder = (part - 0.5 * halves) + low
    extra = whole_part(2.0 * remainder)
    halves += extra
    return remainder - 0.5 * extra, 1.0 if halves == 2.0 * whole_part(0.5 * halves) else -1.0


@inlined
def _moment_order(row: Any) -> tuple[int, int, int]:
    """Places of the smallest, the middle and the largest moment."""
    low, middle, high = 0, 1, 2
    if row[low] > row[middle]:
        low, middle = middle, low
    if row[middle] > row[high]:
        middle, high = high, middle
    return (middle, low, high) if row[low] > row[middle] else (low, middle, high)


@inlined
def _abs(a: DoubleDouble) -> DoubleDouble:
    return a if a[0] >= 0.0 else neg(a)


@shared
def _moving(c: Constants, gap: DoubleDouble, inertia: Vector, m: Momentum, attitude: Quaternion) -> None:
    """Constants of a motion in canonical axes that is no steady rotation."""
    s, (j1, j2, j3), (m1, m2, m3) = c[SIGN], inertia, m
    alpha = div(two_sum(s * j2, -s * j1), two_product(j1, j2))
    beta = div(two_sum(s * j3, -s * j2), two_product(j2, j3))
    gamma = div(two_sum(s * j3, -s * j1), two_product(j1, j3))
    a, b = div(alpha, gamma), div(beta, gamma)
    across2, along2 = add(square(m1), mul(b, square(m2))), add(square(m3), mul(a, square(m2)))  # A1^2, A3^2
    across, along, side, size = root(across2), root(along2), root(b), root(add(across2, along2))
    bulk = mul(b, along2)
    kc = root(div(gap, mul(mul(mul_double(two_product(j1, j2), j3), gamma), bulk)))
    top = add_double(kc, 1.0)  # 1 + k'
    cn, dn, sn = div(m1, across), div(m3, along), scaled(div(mul(m2, side), across), s)
    # by Landen's transformation: the parameter and its complement, sn : cn of the start and of the pole
    parameter = square(div(div(mul(a, across2), bulk), square(top)))
    complement = div(scaled(kc, 4.0), square(top))
    start_sn = mul(_abs(sn), root(div(mul(top, add(kc, dn)), scaled(add_double(dn, 1.0), 2.0))))
    pole_sn, pole_cn = mul(side, mul(along, top)), mul(root(a), add(size, along))

    circular = parameter[0] <= 0.5
    nome = nome_of(parameter, complement) if circular else nome_of(complement, parameter)
    rate = div(mul(mul(root(mul(beta, gamma)), along), top), scaled(nome.period, 2.0))  # v' or w'
    c[A1], c[A2], c[A3] = across[0], s * across[0] / side[0], along[0]
    if circular:
        c[KIND], per_phase = TRIGONOMETRIC, PER_TURN
        bend = _trigonometric(c, nome, pole_sn, pole_cn)
        begin, _, _ = real_argument(start_sn, _abs(cn), nome)
    else:
        c[KIND], per_phase, span = SEPARATRIX, ONE, ZERO
        if nome.q[0] > 0.0:
            c[KIND], span = HYPERBOLIC, log(div(ONE, nome.q))
            per_phase = div((0.5, 0.0), span)
        c[A2] = s * along[0] / math.sqrt(a[0])  # A1 sn/sqrt(b) = A3 k sn/sqrt(a)
        bend = _hyperbolic(c, nome, pole_sn, pole_cn, span)
        sinh, cosh = imaginary_argument(start_sn, _abs(cn), nome)
        begin = arsinh(sinh, cosh)
    begin, phase = mul(begin, per_phase), mul(rate, per_phase)
    if cn[0] < 0.0:  # half a period on, which the separatrix has not
        begin = neg(begin) if c[KIND] == SEPARATRIX else sub((0.5, 0.0), begin)
        c[FLIP] = -1.0 if c[KIND] == SEPARATRIX else 1.0
    begin = begin if sn[0] >= 0.0 else neg(begin)
    c[PHASE], c[PHASE + 1], c[PHASE + 2], c[PHASE + 3] = phase[0], phase[1], begin[0], begin[1]

    fixed, swing = div(size, (j3, 0.0)), div(mul(gamma, across2), add(size, along))
    swing = add(swing, scaled(mul(rate, bend), 2.0))
    c[HALF], c[HALF + 1] = mul(add(fixed, scaled(swing, s)), scaled(PER_TURN, 0.5))
    c[RATE_ERROR] = RATE * (fixed[0] + swing[0] + 2.0 * math.pi * rate[0])
    _, real, imag, lag = _orbit(c, begin[0] if c[KIND] == SEPARATRIX else _mod_half(c, PHASE, 0.0)[0])
    w, x, y, z = _rotation(c, (m1[0], m2[0], m3[0]), lag, real, imag)
    c[START], c[START + 1], c[START + 2], c[START + 3] = product(attitude, (w, -x, -y, -z))


@shared
def body_constants(row: Any, c: Constants) -> bool:
    """Constants of a motion from the numbers of a body; False if they leave the range."""
    low, middle, high = _moment_order(row)
    strongest = max(abs(row[7]), abs(row[8]), abs(row[9]))
    weakest = min([abs(row[i]) for i in range(7, 10) if row[i] != 0.0] + [strongest])
    if row[low] < LEAST_MOMENT * row[high] or weakest < LEAST * strongest:
        return False
    for i in range(SIZE):
        c[i] = 0.0
    inertia_power, power = math.frexp(row[high])[1], math.frexp(strongest)[1]
    c[TIME_UNIT], c[UNIT] = math.ldexp(1.0, power - inertia_power), math.ldexp(1.0, power)
    per_inertia, per = math.ldexp(1.0, -inertia_power), math.ldexp(1.0, -power)
    i1, i2, i3 = per_inertia * row[low], per_inertia * row[middle], per_inertia * row[high]
    gap = _gap((i1, i2, i3), (per * row[7 + low], per * row[10 + low]), (per * row[7 + high], per * row[10 + high]))

    s, first, last = (1.0, low, high) if gap[0] >= 0.0 else (-1.0, high, low)
    j1, j2, j3 = (i1, i2, i3) if gap[0] >= 0.0 else (i3, i2, i1)
    sign3 = math.copysign(per, row[7 + last])
    sign2 = sign3 if (middle - first) % 3 == 1 else -sign3
    m1 = (per * row[7 + first], per * row[10 + first])
    m2, m3 = (sign2 * row[7 + middle], sign2 * row[10 + middle]), (sign3 * row[7 + last], sign3 * row[10 + last])
    c[FRAME + 3 * first], c[FRAME + 3 * middle + 1], c[FRAME + 3 * last + 2] = 1.0, sign2 / per, sign3 / per
    c[SIGN], c[FLIP] = s, 1.0
    mixed = (j1 != j2 and m1[0] * m2[0] != 0.0) or (j2 != j3 and m2[0] * m3[0] != 0.0)
    if mixed or (j1 != j3 and m1[0] * m3[0] != 0.0):
        _moving(c, scaled(gap, s), (j1, j2, j3), (m1, m2, m3), (row[3], row[4], row[5], row[6]))
        return True
    size = root(add(add(square(m1), square(m2)), square(m3)))
    rate = div(size, (j1 if m1[0] != 0.0 else j2 if m2[0] != 0.0 else j3, 0.0))
    c[KIND], c[A1], c[A2], c[A3], c[G] = STEADY, m1[0], m2[0], m3[0], size[0]
    c[HALF], c[HALF + 1] = mul(rate, scaled(PER_TURN, 0.5))
    c[RATE_ERROR] = RATE * rate[0]
    for i in range(4):
        c[START + i] = row[3 + i]
    return True


@shared
def body_samples(c: Constants, times: Sequence[float], out: Any) -> None:
    """Quaternion, and momentum in the body's axes, (n, 7) at a row of times."""
    unit, w, x, y, z = c[UNIT], c[START], c[START + 1], c[START + 2], c[START + 3]
    for i in range(len(times)):
        t = c[TIME_UNIT] * times[i]
        turns, sign = _mod_half(c, HALF, t)
        if c[KIND] == STEADY:
            m = _to_body_axes(c, c[A1], c[A2], c[A3])
            sine = math.sin(TURN * turns) / c[G] if c[G] > 0.0 else 0.0
            q = (math.cos(TURN * turns), sine * m[0], sine * m[1], sine * m[2])
        else:
            phase, flip = c[PHASE] * t + c[PHASE + 2], c[FLIP]
            if c[KIND] != SEPARATRIX:
                phase, flip = _mod_half(c, PHASE, t)
            (m1, m2, m3), real, imag, lag = _orbit(c, phase)
            m1, m2 = flip * m1, flip * m2
            q = _rotation(c, (m1, m2, m3), TURN * turns + lag, real, imag)
            m = _to_body_axes(c, m1, m2, m3)
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = product((sign * w, sign * x, sign * y, sign * z), q)
        out[i, 4], out[i, 5], out[i, 6] = unit * m[0], unit * m[1], unit * m[2]


# seconds: interpreted, constants 1e-3 and a sample 2e-5; compiling 8 s and 2 s
_build = LazyKernel(body_constants, "(float64[::1], float64[::1])", patience=8.0)
_fill = LazyKernel(body_samples, "(float64[::1], float64[::1], float64[:, ::1])", patience=2.0)
FORM_SECONDS, SAMPLE_SECONDS = 1e-3, 2e-5


class BodyMotion(NamedTuple):
    """Samples of a body's motion; the rows of `quaternion` and `quaternion_lo` add up."""

    quaternion: Array  # (n, 4), body to space, scalar first; continuous in time
    quaternion_lo: Array  # (n, 4), the low halves of pairs of doubles
    momentum: Array  # (n, 3), in the body's axes
    bound: Array  # (n,) of the error of the attitude, rad
    known: float = 0.0  # of a heavy body: a time up to which the values are known, whatever the samples
    too_long: bool = False  # lost because it takes too many steps?


class FreeBody:
    """Exact motion of a free body with principal moments (3,), from an attitude (4,) and a momentum in body axes (3,).

    The numbers are read as exact doubles; `momentum_lo` (3,) is added to the momentum, as a product of a moment and a
    rate is no double. The quaternion may have any length but 0. Raises `SymtopError` for numbers that are not finite,
    moments that are not positive or below 1e-30 of the largest, and components of the momentum that are neither 0 nor
    at least 1e-100 of the largest, because a rotation about the middle axis depends on them.

    Errors, measured against 50 digits: 1.8e-15 rad and of the momentum 7e-16 of its length, at times up to 1e6 periods.
    """

    def __init__(
        self, inertia: ArrayLike, quaternion: ArrayLike, momentum_body: ArrayLike,
        momentum_lo: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:  # fmt: skip
        row = checked_body(inertia, quaternion, momentum_body, momentum_lo)
        row[3:7] /= math.hypot(*row[3:7])
        self._constants = np.zeros(SIZE)
        if _build.ready(FORM_SECONDS):
            success = _build.compiled(row, self._constants)
        else:
            values = [0.0] * SIZE
            success = body_constants(row.tolist(), values)
            self._constants[:] = values
        if not success:
            words = f"moments {row[:3].tolist()} and momentum {row[7:10].tolist()} must have no moment below 1e-30"
            raise SymtopError(f"{words} and no component but 0 below 1e-100 of the largest")

    def samples(self, times: ArrayLike) -> BodyMotion:
        """The motion at a row of times (n,), before 0 as well; `quaternion_lo` is 0.

        The bound is twice the largest error measured in some 5,000 samples, plus |t| times the error of the rates,
        estimated and not proved: 1e-29 of the angle turned. Raises `SymtopError` for times beyond 1e100 or not finite.
        """
        row = checked_times(times)
        out = np.empty((row.size, 7))
        if _fill.ready(SAMPLE_SECONDS * row.size):
            _fill.compiled(self._constants, row, out)
        else:
            body_samples(self._constants.tolist(), row.tolist(), out)
        rate = self._constants[RATE_ERROR] * self._constants[TIME_UNIT]
        bound = np.minimum(ROUNDING + rate * np.abs(row), math.pi)
        return BodyMotion(out[:, :4], np.zeros((row.size, 4)), out[:, 4:], bound)


def checked_body(inertia: ArrayLike, quaternion: ArrayLike, momentum_body: ArrayLike, momentum_lo: ArrayLike) -> Array:
    """The numbers of a body in a row (13,)."""
    row = []
    parts = {"inertia": inertia, "quaternion": quaternion, "momentum_body": momentum_body, "momentum_lo": momentum_lo}
    for name, values in parts.items():
        size = 4 if name == "quaternion" else 3
        numbers = real_numbers(name, values)
        if numbers.shape != (size,) or not np.isfinite(numbers).all():
            raise SymtopError(f"{name} must be {size} finite numbers, not {values!r}")
        row.append(numbers)
    if not (row[0] > 0.0).all():
        raise SymtopError(f"inertia must be three positive moments, not {row[0].tolist()}")
    if not math.hypot(*row[1]) > 0.0:
        raise SymtopError(f"quaternion must not be {row[1].tolist()}, which names no attitude")
    return np.concatenate(row)


def checked_times(times: ArrayLike) -> Array:
    """A row of times that compiled code takes."""
    row = real_numbers("times", times)
    if row.ndim != 1 or not (np.abs(row) <= LONGEST_TIME).all():
        raise SymtopError(f"times must be a row of finite numbers of at most {LONGEST_TIME:g} in size")
    return row if row.flags.writeable else row.copy()
