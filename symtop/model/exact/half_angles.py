"""The half-angle functions about the turning points: polynomials, and how fast their arguments grow.

A pole at the height y (a zero of 1 + u or 1 - u at an imaginary time) belongs to a function that is, up to a factor,

    m <= 1/2    near it     cos z P + i sin z P,      far from it   cos z P + i sin z P,           P in cos 2z
    m >  1/2    near it     cosh s P + i sinh s P,    far from it   P + i sinh s cosh s P,         P in cosh 2s

where P are cubics: theta series of four terms, with w_n = q^(n(n+1)) and the functions of y as weights. The argument
near the pole grows by exactly the angle `growth` in a quarter period; what the *mean rate* exceeds the rate at the far
turning point by is `turning`, in units of (quarter periods a time) pi for m <= 1/2 and 2 for m > 1/2,

    m <= 1/2    sum w_n ((n+1) e^-(2n+1)y - n e^(2n+1)y) / sum w_n cosh (2n+1)y
    m >  1/2    pi/2 - y - bow T,     T = d arg theta_4(y + i s)/ds at s = 0,     bow = pi K/2K',

both positive, so that the sum of the two has no cancellation. Source: Whittaker and Watson, sections 21.1 and 21.5.
"""

from typing import NamedTuple

from symtop.core.jit_functions import inlined, shared
from symtop.model.exact.double_double import (
    HALF_PI,
    ONE,
    ZERO,
    DoubleDouble,
    add,
    add_double,
    div,
    mul,
    mul_double,
    neg,
    scaled,
    square,
    sub,
)
from symtop.model.exact.theta_functions import Nome

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
    grown = add(sinh, cosh)  # exp(y)
    shrunk, excess, last = div(ONE, grown), ZERO, 0.0
    if sinh[0] < 1e100:  # beyond it q^2 exp(3y) is nothing
        grown2, shrunk2 = square(grown), square(shrunk)
        grown3, shrunk3 = mul(grown, grown2), mul(shrunk, shrunk2)
        excess = mul(nome.q2, sub(scaled(shrunk3, 2.0), grown3))
        if nome.q[0] > 1e-17:
            s2, d2 = sub(mul(c, s1), sinh), sub(mul(c, d1), cosh)
            s3, d3 = sub(mul(c, s2), s1), sub(mul(c, d2), d1)
            a2, b2, a3, b3 = mul(nome.q6, s2), mul(nome.q6, d2), mul(nome.q12, s3), mul(nome.q12, d3)
            last = nome.q20 * (c[0] * d3[0] - d2[0])
            grown5, shrunk5 = mul(grown3, grown2), mul(shrunk3, shrunk2)
            grown7, shrunk7 = mul(grown5, grown2), mul(shrunk5, shrunk2)
            excess = add(excess, mul(nome.q6, sub(mul_double(shrunk5, 3.0), scaled(grown5, 2.0))))
            excess = add(excess, mul(nome.q12, sub(scaled(shrunk7, 4.0), mul_double(grown7, 3.0))))
            ninth = 5.0 * shrunk7[0] * shrunk2[0] - 4.0 * grown7[0] * grown2[0]
            excess = add_double(excess, nome.q20 * ninth)
    far = _odd_cosines(cosh, b1, b2, b3)
    return Half(
        _odd_cosines(sinh, neg(a1), a2, neg(a3)),
        odd_sines(cosh, neg(b1), b2, neg(b3)),
        far,
        odd_sines(sinh, a1, a2, a3),
        div(add(shrunk, excess), add_double(total(far), last)),
        HALF_PI,
    )


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
    return Half(
        _odd_cosines(s, neg(mul(nome.q2, s1)), mul(nome.q6, s2), neg(mul(nome.q12, s3))),
        odd_sines(c, neg(mul(nome.q2, d1)), mul(nome.q6, d2), neg(mul(nome.q12, d3))),
        far,
        far_imag,
        sub(sub(HALF_PI, y), mul(bow, div(tilt, lift))),
        sub(HALF_PI, y),
    )
