"""Nome, quarter periods and the inversion of elliptic functions by theta functions, in double-double and all real.

For m <= 1/2, with k' = sqrt(1 - m), s = sqrt(k') and eps = m/(2 (1 + k')(1 + s)^2) <= 0.043,

    q = eps + 2 eps^5 + 15 eps^9 + 150 eps^13 + ...,      theta_3 = 1 + 2 q + 2 q^4 + ...,      K = (pi/2) theta_3^2.

For m > 1/2 everything is done with 1 - m in place of m, and the roles of the real and the imaginary argument are
exchanged (Jacobi); the nome is at most exp(-pi) either way. A number given as sn : cn, up to a common factor, is found
by Newton in double and one step whose residual is in double-double, from

    sn s theta_2(z) = cn theta_1(z)                                   z = pi tau/2K,     `real_argument`
    sn theta_4(i y) = cn kappa (sinh y - q^2 sinh 3y + ...)           unknown sinh y,    `imaginary_argument`

with sn, cn in the second line those of the complementary modulus and kappa = theta_3/(1 + q^2 + q^6 + ...). The
residual is sn cn' - cn sn', the sine of a difference of amplitudes: the root keeps all its digits for y -> 0, for
y -> pi K'/2K (cn -> 0) and for m -> 0. No arithmetic-geometric mean, no integrals of Carlson. Cost, compiled: 0.15 to
0.3 us an inversion. Source: Whittaker and Watson, A Course of Modern Analysis, sections 21.1 to 21.8 and 22.
"""

import math
from typing import NamedTuple

from symtop.core.jit_functions import shared, two_product
from symtop.model.exact.double_double import (
    ONE,
    ZERO,
    DoubleDouble,
    add,
    add_double,
    div,
    mul,
    mul_double,
    neg,
    ordered_sum,
    root,
    scaled,
    square,
    sub,
)
from symtop.model.exact.elementary import log, sincos


class Nome(NamedTuple):
    """The nome q of a parameter of at most 1/2, and what comes with it."""

    q: DoubleDouble
    q2: DoubleDouble  # q^2, and so on
    q4: DoubleDouble
    q6: DoubleDouble
    q9: DoubleDouble
    q12: DoubleDouble
    q16: float
    q20: float
    period: DoubleDouble  # theta_3^2 = 2K/pi
    side: DoubleDouble  # sqrt(k')
    kappa: DoubleDouble


@shared
def nome_of(m: DoubleDouble, m1: DoubleDouble) -> Nome:
    """The nome of a parameter 0 <= m <= 1/2; m1 = 1 - m."""
    modulus = root(m1)
    side = root(modulus)
    eps = scaled(div(m, mul(add_double(modulus, 1.0), square(add_double(side, 1.0)))), 0.5)
    y = square(square(eps))
    x = y[0]
    tail = 1707.0 + x * (20910.0 + x * (268616.0 + x * (3567400.0 + x * 48555069.0)))
    q = mul(y, add_double(mul_double(y, tail), 150.0))
    q = mul(y, add_double(q, 15.0))
    q = mul(y, add_double(q, 2.0))
    q = mul(eps, add_double(q, 1.0))
    q2 = square(q)
    q4 = square(q2)
    q6, q8 = mul(q4, q2), square(q4)
    q9, q12, q16 = mul(q8, q), mul(q8, q4), q8[0] * q8[0]
    q20 = q12[0] * q8[0]
    theta3 = add_double(scaled(add(q, add_double(add(q9, q4), q16)), 2.0), 1.0)
    theta2 = add_double(add_double(add(add(q2, q6), q12), q20), 1.0)
    return Nome(q, q2, q4, q6, q9, q12, q16, q20, square(theta3), side, div(theta3, theta2))


@shared
def real_argument(sn: DoubleDouble, cn: DoubleDouble, nome: Nome) -> tuple[DoubleDouble, DoubleDouble, DoubleDouble]:
    """z = pi tau/2K in [0, pi/2], its sine and its cosine, from sn : cn of tau, both >= 0."""
    across, along = mul(sn, nome.side), cn
    w1, w2, w3 = nome.q2[0], nome.q6[0], nome.q12[0]
    z = math.atan2(across[0], along[0])
    for _ in range(2):
        s, c = math.sin(z), math.cos(z)
        twice = 2.0 - 4.0 * s * s  # 2 cos 2z
        s1, c1 = 1.0 + twice, twice - 1.0
        s2, c2 = twice * s1 - 1.0, twice * c1 - 1.0
        s3, c3 = twice * s2 - s1, twice * c2 - c1
        t1, t2 = s * (1.0 - w1 * s1 + w2 * s2 - w3 * s3), c * (1.0 + w1 * c1 + w2 * c2 + w3 * c3)
        d1, d2 = c * (1.0 - 3.0 * w1 * c1 + 5.0 * w2 * c2), -s * (1.0 + 3.0 * w1 * s1 + 5.0 * w2 * s2)
        z -= (across[0] * t2 - along[0] * t1) / (across[0] * d2 - along[0] * d1)
    sine, cosine = sincos(z)
    cos2 = add_double(scaled(square(sine), -4.0), 2.0)  # 2 cos 2z
    s1d, c1d = add_double(cos2, 1.0), add_double(cos2, -1.0)  # sin 3z/sin z, cos 3z/cos z, and so on
    s2d, c2d = add_double(mul(cos2, s1d), -1.0), add_double(mul(cos2, c1d), -1.0)
    s3, c3 = cos2[0] * s2d[0] - s1d[0], cos2[0] * c2d[0] - c1d[0]
    s4, c4 = cos2[0] * s3 - s2d[0], cos2[0] * c3 - c2d[0]
    odd = add(mul(nome.q2, s1d), add_double(neg(mul(nome.q6, s2d)), w3 * s3 - nome.q20 * s4))
    even = add(mul(nome.q2, c1d), add_double(mul(nome.q6, c2d), w3 * c3 + nome.q20 * c4))
    theta1, theta2 = sub(sine, mul(sine, odd)), add(cosine, mul(cosine, even))
    d1 = cosine[0] * (1.0 - 3.0 * w1 * c1d[0] + 5.0 * w2 * c2d[0])
    d2 = -sine[0] * (1.0 + 3.0 * w1 * s1d[0] + 5.0 * w2 * s2d[0])
    residual = sub(mul(across, theta2), mul(along, theta1))
    step = -residual[0] / (across[0] * d2 - along[0] * d1)
    half = 0.5 * step * step
    turned_sine = add_double(add(sine, mul_double(cosine, step)), -half * sine[0])
    turned_cosine = add_double(sub(cosine, mul_double(sine, step)), -half * cosine[0])
    return ordered_sum(z, step), turned_sine, turned_cosine


@shared
def _first_height(across: float, along: float, nome: Nome) -> float:
    """sinh y in double."""
    q, w1, w2, w3, q4, q9 = nome.q[0], nome.q2[0], nome.q6[0], nome.q12[0], nome.q4[0], nome.q9[0]
    full = 1.0 - 2.0 * q
    h = 2.0 * across * full / (along + math.sqrt(along * along + 16.0 * q * across * across * full))  # to O(q^2)
    for _ in range(8):
        square_h = h * h
        cosh = math.sqrt(1.0 + square_h)
        c = 1.0 + 2.0 * square_h  # cosh 2y
        s1, d1 = 1.0 + 2.0 * c, 2.0 * c - 1.0  # sinh 3y/sinh y, cosh 3y/cosh y
        odd, odd_rate, even, even_rate = 1.0 - w1 * s1, 1.0 - 3.0 * w1 * d1, 1.0 - 2.0 * q * c, -8.0 * q * h * cosh
        if q > 1e-17:
            c2 = 2.0 * c * c - 1.0
            c3 = c * (2.0 * c2 - 1.0)
            s2, d2 = 2.0 * c * s1 - 1.0, 2.0 * c * d1 - 1.0
            odd += w2 * s2 - w3 * (2.0 * c * s2 - s1)
            odd_rate += 5.0 * w2 * d2
            even += 2.0 * (q4 * c2 - q9 * c3)
            even_rate += 2.0 * h * cosh * (16.0 * q4 * c - 12.0 * q9 * (4.0 * c * c - 1.0))
        step = (across * even - along * h * odd) / (along * cosh * odd_rate - across * even_rate)
        h += step * (cosh + 0.5 * step * h)
        if not abs(step) * cosh > 1e-8 * h:
            break
    return h


@shared
def imaginary_argument(sn: DoubleDouble, cn: DoubleDouble, nome: Nome) -> tuple[DoubleDouble, DoubleDouble]:
    """sinh y and cosh y of y = pi v/2K from sn : cn of v to the complementary modulus, both >= 0."""
    if sn[0] == 0.0:
        return ZERO, ONE
    along = mul(cn, nome.kappa)
    h = _first_height(sn[0], along[0], nome)
    square_h = two_product(h, h)
    cosh = root(add_double(square_h, 1.0))
    c = add_double(scaled(square_h, 2.0), 1.0)
    twice = scaled(c, 2.0)
    s1, d1 = add_double(twice, 1.0), twice[0] - 1.0
    odd, even = mul(nome.q2, s1), mul(nome.q, c)
    odd_rate, even_rate = 1.0 - 3.0 * nome.q2[0] * d1, -8.0 * nome.q[0] * h * cosh[0]
    if nome.q[0] > 1e-17:
        c2 = add_double(mul(twice, c), -1.0)
        c3 = sub(mul(twice, c2), c)
        c4 = twice[0] * c3[0] - c2[0]
        s2, d2 = add_double(mul(twice, s1), -1.0), twice[0] * d1 - 1.0
        s3 = sub(mul(twice, s2), s1)
        odd = sub(odd, sub(mul(nome.q6, s2), mul(nome.q12, s3)))
        odd = add_double(odd, -nome.q20 * (twice[0] * s3[0] - s2[0]))
        even = sub(even, sub(mul(nome.q4, c2), mul(nome.q9, c3)))
        even = add_double(even, nome.q16 * (nome.q9[0] * (twice[0] * c4 - c3[0]) - c4))  # q^25 cosh 10y is up to q^20
        odd_rate += 5.0 * nome.q6[0] * d2 - 7.0 * nome.q12[0] * (twice[0] * d2 - d1)
        grown = 16.0 * nome.q4[0] * c[0] - 12.0 * nome.q9[0] * (4.0 * c[0] * c[0] - 1.0)
        even_rate += 2.0 * h * cosh[0] * grown
    theta1, theta4 = mul_double(sub(ONE, odd), h), add_double(scaled(even, -2.0), 1.0)
    residual = sub(mul(sn, theta4), mul(along, theta1))
    step = residual[0] / (along[0] * cosh[0] * odd_rate - sn[0] * even_rate)
    half = 0.5 * step * step
    sinh = add_double(add_double(mul_double(cosh, step), half * h), h)
    return sinh, add_double(add_double(cosh, step * h), half * cosh[0])


@shared
def arsinh(h: DoubleDouble, c: DoubleDouble) -> DoubleDouble:
    """y from sinh y >= 0 and cosh y: a logarithm, or a series below 1e-3."""
    if h[0] > 1e-3:
        return log(add(h, c))
    x = square(h)
    tail = -15.0 / 336.0 + x[0] * (35.0 / 1152.0 - x[0] * (63.0 / 2816.0))
    series = add((0.075, 2.7755575615628914e-18), mul_double(x, tail))  # 3/40
    series = add((-0.16666666666666666, -9.25185853854297e-18), mul(x, series))
    return add(h, mul(h, mul(x, series)))
