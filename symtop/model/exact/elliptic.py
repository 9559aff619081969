"""Elliptic functions, all real: theta series and their inversion, the half-angle functions, and Weierstrass's function.

*Nome*, in double-double. For m <= 1/2, with k' = sqrt(1 - m), s = sqrt(k') and eps = m/(2 (1 + k')(1 + s)^2) <= 0.043,

    q = eps + 2 eps^5 + 15 eps^9 + 150 eps^13 + ...,      theta_3 = 1 + 2 q + 2 q^4 + ...,      K = (pi/2) theta_3^2.

For m > 1/2 everything is done with 1 - m in place of m, and the real and the imaginary argument change places (Jacobi);
the nome is at most exp(-pi) either way. A number given as sn : cn, up to a common factor, is found by Newton in double
and one step whose residual is in double-double, from

    sn s theta_2(z) = cn theta_1(z)                                   z = pi tau/2K,     `real_argument`
    sn theta_4(i y) = cn kappa (sinh y - q^2 sinh 3y + ...)           unknown sinh y,    `imaginary_argument`

with sn, cn in the second line those of the complementary modulus and kappa = theta_3/(1 + q^2 + q^6 + ...). The
residual is sn cn' - cn sn', the sine of a difference of amplitudes: the root keeps all its digits for y -> 0, for
y -> pi K'/2K (cn -> 0) and for m -> 0.

*Half-angle functions* about the turning points. A pole at the height y (a zero of 1 + u or 1 - u at an imaginary time)
belongs to a function that is, up to a factor,

    m <= 1/2    near it     cos z P + i sin z P,      far from it   cos z P + i sin z P,           P in cos 2z
    m >  1/2    near it     cosh s P + i sinh s P,    far from it   P + i sinh s cosh s P,         P in cosh 2s

where P are cubics: theta series of four terms, with w_n = q^(n(n+1)) and the functions of y as weights. The argument
near the pole grows by `growth` in a quarter period; the mean rate less that at the far turning point is `turning`, in
units of (quarter periods a time) pi for m <= 1/2 and 2 for m > 1/2,

    m <= 1/2    sum w_n ((n+1) e^-(2n+1)y - n e^(2n+1)y) / sum w_n cosh (2n+1)y
    m >  1/2    pi/2 - y - bow T,     T = d arg theta_4(y + i s)/ds at s = 0,     bow = pi K/2K',

both positive, without cancellation.

*Weierstrass's function* of a nutation at a step h, in double, and the integrals that go with it:

    wp'^2 = 4 wp^3 - g2 wp - g3 = 4 (wp - e1)(wp - e2)(wp - e3),   e1 >= e2 >= e3,   e1 + e2 + e3 = 0

Along the motion of a top wp swings between e3 and e2 with the period T of the nutation; at a real time h it lies above
e1. For 0 < h <= T/2 and b < e1, with Carlson's symmetric integrals of the first and the third kind,

    h = R_F(wp - e1, wp - e2, wp - e3),     int_0^h dt/(wp(t) - b) = R_J(wp - e1, wp - e2, wp - e3, wp - b)/3.

The differences come from Jacobi's functions of w h, w^2 = e1 - e3, by Gauss's arithmetic-geometric mean:

    wp - e1 = (w cn/sn)^2,    wp - e2 = (w dn/sn)^2,    wp - e3 = (w/sn)^2,    T = 2 K/w

wp(h) depends on g2 and g3 smoothly, so that a double root costs no digits. Relative errors, measured on random cubics:
wp 1e-15, R_J 6e-16.
Sources: Whittaker and Watson, A Course of Modern Analysis, chapters 20 to 22; Carlson, Numer. Algorithms 10 (1995) 13.
"""

import math
from typing import NamedTuple

from symtop.core.jit_functions import inlined, shared, two_product
from symtop.model.exact.double_double import (
    HALF_PI,
    ONE,
    ZERO,
    DoubleDouble,
    add,
    add_double,
    div,
    log,
    mul,
    mul_double,
    neg,
    ordered_sum,
    root,
    scaled,
    sincos,
    square,
    sub,
)


class Nome(NamedTuple):
    """The nome q of a parameter of at most 1/2, its powers, and theta constants."""

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
        term = 16.0 * nome.q4[0] * c[0] - 12.0 * nome.q9[0] * (4.0 * c[0] * c[0] - 1.0)
        even_rate += 2.0 * h * cosh[0] * term
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


Cubic = tuple[DoubleDouble, DoubleDouble, DoubleDouble, DoubleDouble]


class Half(NamedTuple):
    """One half-angle function about both turning points."""

    near_real: Cubic
    near_imag: Cubic
    far_real: Cubic
    far_imag: Cubic
    turning: DoubleDouble
    growth: DoubleDouble


@inlined
def odd_sines(w0: DoubleDouble, w1: DoubleDouble, w2: DoubleDouble, w3: DoubleDouble) -> Cubic:
    """Sum of w_n sin((2n+1)x)/sin x in powers of cos 2x."""
    first, second = sub(add(add(w0, w1), neg(w2)), w3), sub(scaled(add(w1, w2), 2.0), scaled(w3, 4.0))
    return first, second, scaled(add(w2, w3), 4.0), scaled(w3, 8.0)


@inlined
def _odd_cosines(w0: DoubleDouble, w1: DoubleDouble, w2: DoubleDouble, w3: DoubleDouble) -> Cubic:
    """Sum of w_n cos((2n+1)x)/cos x."""
    first, second = add(sub(sub(w0, w1), w2), w3), sub(scaled(sub(w1, w2), 2.0), scaled(w3, 4.0))
    return first, second, scaled(sub(w2, w3), 4.0), scaled(w3, 8.0)


@inlined
def _even_cosines(w0: DoubleDouble, w1: DoubleDouble, w2: DoubleDouble, w3: DoubleDouble) -> Cubic:
    """Sum of w_n cos 2nx."""
    return sub(w0, w2), sub(w1, mul_double(w3, 3.0)), scaled(w2, 2.0), scaled(w3, 4.0)


@inlined
def _even_sines(w1: DoubleDouble, w2: DoubleDouble, w3: DoubleDouble) -> Cubic:
    """Sum of w_n sin 2nx/(sin x cos x)."""
    return scaled(sub(w1, w3), 2.0), scaled(w2, 4.0), scaled(w3, 8.0), ZERO


@inlined
def value(p: Cubic, x: DoubleDouble) -> DoubleDouble:
    """A cubic at x."""
    return add(p[0], mul(x, add(p[1], mul(x, add(p[2], mul(x, p[3]))))))


@inlined
def total(p: Cubic) -> DoubleDouble:
    """A cubic at 1, a turning point."""
    return add(add(p[0], p[1]), add(p[2], p[3]))


@shared
def trigonometric_half(sinh: DoubleDouble, cosh: DoubleDouble, nome: Nome) -> Half:
    """The half of a pole at the height y, for m <= 1/2, from sinh y and cosh y."""
    c = scaled(add_double(scaled(square(sinh), 2.0), 1.0), 2.0)  # 2 cosh 2y
    s1, d1 = mul(sinh, add_double(c, 1.0)), mul(cosh, add_double(c, -1.0))  # sinh 3y, cosh 3y, and so on
    a1, b1 = mul(nome.q2, s1), mul(nome.q2, d1)
    a2 = b2 = a3 = b3 = ZERO
    exp_plus = add(sinh, cosh)  # exp(y)
    exp_minus, excess, last = div(ONE, exp_plus), ZERO, 0.0
    if sinh[0] < 1e100:  # beyond it q^2 exp(3y) is nothing
        exp_plus2, exp_minus2 = square(exp_plus), square(exp_minus)
        exp_plus3, exp_minus3 = mul(exp_plus, exp_plus2), mul(exp_minus, exp_minus2)
        excess = mul(nome.q2, sub(scaled(exp_minus3, 2.0), exp_plus3))
        if nome.q[0] > 1e-17:
            s2, d2 = sub(mul(c, s1), sinh), sub(mul(c, d1), cosh)
            s3, d3 = sub(mul(c, s2), s1), sub(mul(c, d2), d1)
            a2, b2, a3, b3 = mul(nome.q6, s2), mul(nome.q6, d2), mul(nome.q12, s3), mul(nome.q12, d3)
            last = nome.q20 * (c[0] * d3[0] - d2[0])
            exp_plus5, exp_minus5 = mul(exp_plus3, exp_plus2), mul(exp_minus3, exp_minus2)
            exp_plus7, exp_minus7 = mul(exp_plus5, exp_plus2), mul(exp_minus5, exp_minus2)
            excess = add(excess, mul(nome.q6, sub(mul_double(exp_minus5, 3.0), scaled(exp_plus5, 2.0))))
            excess = add(excess, mul(nome.q12, sub(scaled(exp_minus7, 4.0), mul_double(exp_plus7, 3.0))))
            ninth = 5.0 * exp_minus7[0] * exp_minus2[0] - 4.0 * exp_plus7[0] * exp_plus2[0]
            excess = add_double(excess, nome.q20 * ninth)
    near, near_imag = _odd_cosines(sinh, neg(a1), a2, neg(a3)), odd_sines(cosh, neg(b1), b2, neg(b3))
    far, far_imag = _odd_cosines(cosh, b1, b2, b3), odd_sines(sinh, a1, a2, a3)
    return Half(near, near_imag, far, far_imag, div(add(exp_minus, excess), add_double(total(far), last)), HALF_PI)


@shared
def hyperbolic_half(y: DoubleDouble, s: DoubleDouble, c: DoubleDouble, nome: Nome, bow: DoubleDouble) -> Half:
    """The half of a pole for m > 1/2, where y is an angle with sine s and cosine c."""
    twice = add_double(scaled(square(s), -4.0), 2.0)  # 2 cos 2y
    s1, d1 = mul(s, add_double(twice, 1.0)), mul(c, add_double(twice, -1.0))  # sin 3y, cos 3y, and so on
    s2, d2 = sub(mul(twice, s1), s), sub(mul(twice, d1), c)
    s3, d3 = sub(mul(twice, s2), s1), sub(mul(twice, d2), d1)
    sin2, cos2 = scaled(mul(s, c), 2.0), scaled(twice, 0.5)
    sin4, cos4 = mul(twice, sin2), add_double(mul(twice, cos2), -1.0)
    sin6, cos6 = sub(mul(twice, sin4), sin2), sub(mul(twice, cos4), cos2)
    sin8, cos8 = twice[0] * sin6[0] - sin4[0], twice[0] * cos6[0] - cos4[0]
    e1, e2, e3 = scaled(nome.q, 2.0), scaled(nome.q4, 2.0), scaled(nome.q9, 2.0)
    far = _even_cosines(ONE, neg(mul(e1, cos2)), mul(e2, cos4), neg(mul(e3, cos6)))
    far_imag = _even_sines(mul(e1, sin2), neg(mul(e2, sin4)), mul(e3, sin6))
    lift = add_double(total(far), 2.0 * nome.q16 * cos8)
    tilt = add_double(total(far_imag), -16.0 * nome.q16 * sin8)
    near = _odd_cosines(s, neg(mul(nome.q2, s1)), mul(nome.q6, s2), neg(mul(nome.q12, s3)))
    near_imag = odd_sines(c, neg(mul(nome.q2, d1)), mul(nome.q6, d2), neg(mul(nome.q12, d3)))
    growth = sub(HALF_PI, y)
    return Half(near, near_imag, far, far_imag, sub(growth, mul(bow, div(tilt, lift))), growth)


SMALL_ARGUMENT = 1e-9  # an argument w h below which sn, cn and dn are w h, 1 and 1
CONVERGED_GAP = 1e-9  # relative gap at which the arithmetic-geometric mean ends; its error is the square of this
MOST_MEANS = 12
NEAR_EQUAL = 0.003  # R_J is a polynomial of order 5 where its arguments differ by less, to 1e-16
MOST_HALVINGS = 60


class Roots(NamedTuple):
    """e1 >= e2 >= e3."""

    e1: float
    e2: float
    e3: float


@shared
def roots(g2: float, g3: float) -> Roots:
    """The real roots of 4 x^3 - g2 x - g3, by the cosine of a third of an angle."""
    r = math.sqrt(max(g2, 0.0) / 12.0)
    cosine = g3 / (8.0 * r * r * r) if r > 0.0 else 0.0
    third = math.acos(min(1.0, max(-1.0, cosine))) / 3.0
    turn = 2.0 * math.pi / 3.0
    return Roots(2.0 * r * math.cos(third), 2.0 * r * math.cos(third - turn), 2.0 * r * math.cos(third + turn))


@shared
def half_period(e: Roots) -> float:
    """T/2 = K(m)/w; infinite where e1 = e2, the separatrix, and where all three are zero."""
    a, b = math.sqrt(e.e1 - e.e3), math.sqrt(e.e1 - e.e2)
    if b <= 0.0:
        return math.inf
    for _ in range(MOST_MEANS):
        if abs(a - b) <= CONVERGED_GAP * a:
            break
        a, b = 0.5 * (a + b), math.sqrt(a * b)
    return math.pi / (a + b)


@shared
def _jacobi(x: float, m: float, m1: float) -> tuple[float, float, float]:
    """sn, cn, dn of x for a parameter m = 1 - m1, by descending Landen transformations."""
    if m1 <= 0.0:
        cosine = 1.0 / math.cosh(min(x, 700.0))
        return math.tanh(x), cosine, cosine
    a, b, c, count = 1.0, math.sqrt(m1), math.sqrt(m), 0
    r1 = r2 = r3 = r4 = r5 = r6 = r7 = r8 = 0.0
    while abs(c) > CONVERGED_GAP * a and count < 8:
        a, b, c = 0.5 * (a + b), math.sqrt(a * b), 0.5 * (a - b)
        r1, r2, r3, r4, r5, r6, r7, r8 = c / a, r1, r2, r3, r4, r5, r6, r7
        count += 1
    phase = math.ldexp(a * x, count)
    for _ in range(count):
        phase = 0.5 * (phase + math.asin(r1 * math.sin(phase)))
        r1, r2, r3, r4, r5, r6, r7, r8 = r2, r3, r4, r5, r6, r7, r8, 0.0
    sn, cn = math.sin(phase), math.cos(phase)
    return sn, cn, math.sqrt(m1 + m * cn * cn)


@shared
def differences(e: Roots, h: float) -> tuple[float, float, float]:
    """wp(h) - e1, wp(h) - e2, wp(h) - e3 at 0 < h <= T/2."""
    square = e.e1 - e.e3
    x = math.sqrt(square) * h
    if x < SMALL_ARGUMENT:
        pole = 1.0 / (h * h)
        return pole, pole, pole
    sn, cn, dn = _jacobi(x, (e.e2 - e.e3) / square, (e.e1 - e.e2) / square)
    pole = square / (sn * sn)
    return pole * cn * cn, pole * dn * dn, pole


@shared
def _r_c(x: float) -> float:
    """R_C(1, 1 + x), x > -1."""
    if abs(x) < 1e-3:
        return 1.0 - x * (1.0 / 3.0 - x * (0.2 - x * (1.0 / 7.0 - x * (1.0 / 9.0 - x / 11.0))))
    if x > 0.0:
        return math.atan(math.sqrt(x)) / math.sqrt(x)
    return math.atanh(math.sqrt(-x)) / math.sqrt(-x)


@shared
def r_j(x: float, y: float, z: float, p: float) -> float:
    """Carlson's R_J(x, y, z, p) = 3/2 int_0^inf dt / ((t + p) sqrt((t + x)(t + y)(t + z))); x, y, z >= 0, p > 0."""
    mean = start = 0.2 * (x + y + z + 2.0 * p)
    widest = max(abs(mean - x), abs(mean - y), abs(mean - z), abs(mean - p)) / NEAR_EQUAL
    gap = (p - x) * (p - y) * (p - z)
    u, v, w, q, scale, total = x, y, z, p, 1.0, 0.0
    for _ in range(MOST_HALVINGS):
        if scale * widest < abs(mean):
            break
        root_u, root_v, root_w, root_q = math.sqrt(u), math.sqrt(v), math.sqrt(w), math.sqrt(q)
        shift = root_u * root_v + root_u * root_w + root_v * root_w
        factor = (root_q + root_u) * (root_q + root_v) * (root_q + root_w)
        total += scale / factor * _r_c(gap * scale * scale * scale / (factor * factor))
        u, v, w, q = 0.25 * (u + shift), 0.25 * (v + shift), 0.25 * (w + shift), 0.25 * (q + shift)
        mean, scale = 0.25 * (mean + shift), 0.25 * scale
    a, b, c = (start - x) * scale / mean, (start - y) * scale / mean, (start - z) * scale / mean
    d = -0.5 * (a + b + c)
    second, product = a * b + a * c + b * c - 3.0 * d * d, a * b * c
    third = product + 2.0 * second * d + 4.0 * d * d * d
    fourth = (2.0 * product + second * d + 3.0 * d * d * d) * d
    series = 1.0 - 3.0 * second / 14.0 + third / 6.0 + 9.0 * second * second / 88.0
    series += -3.0 * fourth / 22.0 - 9.0 * second * third / 52.0 + 3.0 * product * d * d / 26.0
    return scale * series / (mean * math.sqrt(mean)) + 6.0 * total
