"""Quad-double arithmetic: numbers of 212 bits as sums of four doubles, for sums whose terms nearly cancel.

A number (x0, x1, x2, x3) stands for the exact sum of doubles of falling size. The sum of two numbers is VecSum, one
error-free pass over the eight parts that moves everything towards the first, five times over: absolute error 2^-205
of the *terms*, however much cancels. The product drops what lies below 2^-210. Relative errors, measured: product and
sine 3e-65. Sources: Hida, Li and Bailey, Quad-double arithmetic (2000); Ogita, Rump and Oishi, SIAM J. Sci. Comput. 26
(2005) 1955.

`plus`, `times` and their companions take double-doubles or quad-doubles, so that one formula serves for both.
"""

from typing import TypeVar

from symtop.core.jit_functions import inlined, shared, two_product
from symtop.model.exact import double_double as dd
from symtop.model.exact.double_double import (
    ARCS,
    FACTORIALS,
    HALF_PI,
    NODES,
    PER,
    PER2,
    DoubleDouble,
    ordered_sum,
    two_sum,
)

QuadDouble = tuple[float, float, float, float]
Number = TypeVar("Number", DoubleDouble, QuadDouble)

HALF_PI_TAIL = (6.123233995736766e-17, -1.4973849048591698e-33, 5.562271104316826e-50, 2.836115989820158e-66)


@inlined
def _renormed(c0: float, c1: float, c2: float, c3: float, c4: float) -> QuadDouble:
    """Five overlapping doubles of falling size as four."""
    rest, c4 = ordered_sum(c3, c4)
    rest, c3 = ordered_sum(c2, rest)
    rest, c2 = ordered_sum(c1, rest)
    c0, c1 = ordered_sum(c0, rest)
    c1, c2 = ordered_sum(c1, c2)
    c2, c3 = ordered_sum(c2, c3)
    return c0, c1, c2, c3 + c4


@inlined
def _three_sum(a: float, b: float, c: float) -> tuple[float, float, float]:
    first, error = two_sum(a, b)
    first, rest = two_sum(c, first)
    second, third = two_sum(error, rest)
    return first, second, third


@shared
def mul(a: QuadDouble, b: QuadDouble) -> QuadDouble:
    """a b."""
    p0, q0 = two_product(a[0], b[0])
    p1, q1 = two_product(a[0], b[1])
    p2, q2 = two_product(a[1], b[0])
    p3, q3 = two_product(a[0], b[2])
    p4, q4 = two_product(a[1], b[1])
    p5, q5 = two_product(a[2], b[0])
    p1, p2, q0 = _three_sum(p1, p2, q0)
    p2, q1, q2 = _three_sum(p2, q1, q2)
    p3, p4, p5 = _three_sum(p3, p4, p5)
    s0, t0 = two_sum(p2, p3)
    s1, t1 = two_sum(q1, p4)
    s2 = q2 + p5
    s1, t0 = two_sum(s1, t0)
    s2 = s2 + (t0 + t1)
    s1 = s1 + (a[0] * b[3] + a[1] * b[2] + a[2] * b[1] + a[3] * b[0] + q0 + q3 + q4 + q5)
    s1, t0 = two_sum(s1, s2)
    return _renormed(p0, p1, s0, s1, t0)


@shared
def add(a: QuadDouble, b: QuadDouble) -> QuadDouble:
    """a + b."""
    t0, t1, t2, t3, t4, t5, t6, t7 = a[0], b[0], a[1], b[1], a[2], b[2], a[3], b[3]
    for _ in range(5):
        t6, t7 = two_sum(t6, t7)
        t5, t6 = two_sum(t5, t6)
        t4, t5 = two_sum(t4, t5)
        t3, t4 = two_sum(t3, t4)
        t2, t3 = two_sum(t2, t3)
        t1, t2 = two_sum(t1, t2)
        t0, t1 = two_sum(t0, t1)
    return _renormed(t0, t1, t2, t3, t4 + (t5 + (t6 + t7)))


@inlined
def neg(a: QuadDouble) -> QuadDouble:
    """-a."""
    return -a[0], -a[1], -a[2], -a[3]


@inlined
def widened(a: DoubleDouble) -> QuadDouble:
    """The same number."""
    return a[0], a[1], 0.0, 0.0


@inlined
def _per_factorial(n: int) -> QuadDouble:
    """1/n!."""
    parts = FACTORIALS[n]
    return float(parts[0]), float(parts[1]), float(parts[2]), float(parts[3])


@shared
def sincos(x: float) -> tuple[QuadDouble, QuadDouble]:
    """sin and cos of a double in [0, pi/2]: the node k/64, and a series to r^24 whose tail is in double-double."""
    over = x > 0.7853981633974483
    if over:
        x = HALF_PI[0] - x  # exact
    k = int(x * NODES + 0.5)
    r = x - k / NODES
    square = two_product(r, r)
    y = square[0]
    tail = dd.add(PER2[17], dd.mul_double(square, -PER[19] + y * (PER[21] - y * PER[23])))
    tail = dd.sub(dd.mul(square, tail), PER2[15])
    tail = dd.add(PER2[13], dd.mul(square, tail))
    even = dd.sub(dd.mul_double(square, PER[20] - y * (PER[22] - y * PER[24])), PER2[18])
    even = dd.add(PER2[16], dd.mul(square, even))
    even = dd.sub(dd.mul(square, even), PER2[14])
    x2, wide = widened(square), (r, 0.0, 0.0, 0.0)
    s, c = widened(tail), widened(even)
    for n in (11, 9, 7, 5, 3):
        s = add(_per_factorial(n) if n % 4 == 1 else neg(_per_factorial(n)), mul(x2, s))
    s = add(wide, mul(wide, mul(x2, s)))
    for n in (12, 10, 8, 6, 4, 2):
        c = add(_per_factorial(n) if n % 4 == 0 else neg(_per_factorial(n)), mul(x2, c))
    c = mul(x2, c)
    s0 = (float(ARCS[k, 0]), float(ARCS[k, 1]), float(ARCS[k, 2]), float(ARCS[k, 3]))
    c0 = (float(ARCS[k, 4]), float(ARCS[k, 5]), float(ARCS[k, 6]), float(ARCS[k, 7]))
    sine = add(s0, add(mul(s0, c), mul(c0, s)))
    cosine = add(c0, add(mul(c0, c), neg(mul(s0, s))))
    if not over:
        return sine, cosine
    half = mul(HALF_PI_TAIL, HALF_PI_TAIL)  # pi/2 less its first double, by 1 - l^2/2 and l - l^3/6
    down = (-0.5 * half[0], -0.5 * half[1], -0.5 * half[2], -0.5 * half[3])
    along = add(HALF_PI_TAIL, (down[0] * HALF_PI_TAIL[0] / 3.0, 0.0, 0.0, 0.0))
    turned = add(add(sine, mul(sine, down)), mul(cosine, along))
    return add(add(cosine, mul(cosine, down)), neg(mul(sine, along))), turned


# ------------------------------------------------------------------------------- either kind, told by its length


@inlined
def plus(a: Number, b: Number) -> Number:
    """a + b."""
    return dd.add(a, b) if len(a) == 2 else add(a, b)


@inlined
def times(a: Number, b: Number) -> Number:
    """a b."""
    return dd.mul(a, b) if len(a) == 2 else mul(a, b)


@inlined
def minus(a: Number, b: Number) -> Number:
    """a - b."""
    return dd.sub(a, b) if len(a) == 2 else add(a, neg(b))


@inlined
def doubled(a: Number) -> Number:
    """2 a."""
    return (2.0 * a[0], 2.0 * a[1]) if len(a) == 2 else (2.0 * a[0], 2.0 * a[1], 2.0 * a[2], 2.0 * a[3])


@inlined
def like(kind: Number, a: DoubleDouble) -> Number:
    """The double-double `a` as a number of the same kind as `kind`."""
    return a if len(kind) == 2 else widened(a)


@inlined
def narrowed(a: Number) -> DoubleDouble:
    """The nearest double-double."""
    if len(a) == 2:
        return a
    high, low = ordered_sum(a[0], a[1])
    return ordered_sum(high, low + a[2])
