"""The Weierstrass function of a nutation at a step h, and the elliptic integrals that go with it.

    wp'^2 = 4 wp^3 - g2 wp - g3 = 4 (wp - e1)(wp - e2)(wp - e3),   e1 >= e2 >= e3,   e1 + e2 + e3 = 0

Along the motion of a top wp swings between e3 and e2 with the period T of the nutation; at a real time h it lies above
e1. What the exact step needs of it are the three differences wp(h) - e_i, and with those alone

    h = R_F(wp - e1, wp - e2, wp - e3),     int_0^h dt/(wp(t) - b) = R_J(wp - e1, wp - e2, wp - e3, wp - b)/3

for 0 < h <= T/2 and b < e1: Carlson's symmetric integrals of the first and the third kind. The differences come from
Jacobi's functions of w h, w^2 = e1 - e3, by Gauss's arithmetic-geometric mean:

    wp - e1 = (w cn/sn)^2,    wp - e2 = (w dn/sn)^2,    wp - e3 = (w/sn)^2,    T = 2 K/w

wp(h) depends on g2 and g3 smoothly, so that a double root costs no digits although e1 - e2 or e2 - e3 is then known to
half of them only. Relative errors, measured on random cubics: wp 1e-15, R_J 6e-16.
Source: Carlson, Numer. Algorithms 10 (1995) 13 (R_J by duplication); Whittaker and Watson, chapters 20 and 22.
"""

import math
from typing import NamedTuple

from symtop.core.jit_functions import shared

SMALL = 1e-9  # an argument w h below which sn, cn and dn are w h, 1 and 1
CONVERGED = 1e-9  # of the mean: its error is the square of this
MOST_MEANS = 12
NEAR = 0.003  # R_J is a polynomial of order 5 where its arguments differ by less, to 1e-16
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
        if abs(a - b) <= CONVERGED * a:
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
    while abs(c) > CONVERGED * a and count < 8:
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
    if x < SMALL:
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
    widest = max(abs(mean - x), abs(mean - y), abs(mean - z), abs(mean - p)) / NEAR
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
