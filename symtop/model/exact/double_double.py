"""Double-double and quad-double arithmetic: numbers of 106 and 212 bits as sums of two and four doubles.

A double-double (high, low) with abs(low) <= ulp(high)/2 stands for the exact sum. Everything rests on two exact
transformations, the sum (Knuth) and the product (Dekker) of two doubles as a rounded result and its error:

    a + b = s + e,    s = fl(a + b),    e = (a - (s - v)) + (b - v),    v = s - a;    a b = p + e,    e = fma(a, b, -p).

Only elementary functions of a *double* are series; those of a double-double take one Newton step from the C library's
value, whose residual alone is in double-double:

    sin x, cos x    x less quarter turns (pi/2 in three doubles), less the node k/64, Taylor series to r^13
    exp x           x less k ln 2 (in three doubles), less the node j/64, Taylor series to r^12
    log x           a + c - c^2/2,  a = log(high),  c = x exp(-a) - 1
    atan2(y, x)     a + (y cos a - x sin a)/(x cos a + y sin a),  a = atan2 of the high parts

Relative errors, measured over 1e6 random pairs: sum 1.9e-32 (also if the terms cancel), product 3e-32, quotient 4e-32,
square root 3e-32, sin and cos 3e-32, atan2 6e-32, exp 2e-32, log 6e-32 (absolute near 1); the unit is 2^-106, 1.2e-32.
Not for large arguments: `sincos` takes abs(x) <= 2 pi, `exp` abs(x) <= 700. Not to be confused with long double (64
bits) or with quadruple precision (113 bits, but a wider exponent).

A quad-double (x0, x1, x2, x3) is for sums whose terms nearly cancel. The sum of two is VecSum, one error-free pass over
the eight parts that moves everything towards the first, five times over: absolute error 2^-205 of the *terms*, however
much cancels. The product drops what lies below 2^-210. Relative errors, measured: product 3e-64, sine 3e-65. `plus`,
`times` and their companions take either kind, so that one formula serves for both.

Sources: Dekker, Numerische Mathematik 18 (1971) 224; Joldes, Muller and Popescu, ACM TOMS 44 (2017) 15res, algorithms
6, 9, 17; Hida, Li and Bailey, Quad-double arithmetic, 2000; Ogita, Rump and Oishi, SIAM J. Sci. Comput. 26 (2005) 1955.
"""

import math
from typing import TypeVar

import numpy as np

from symtop.core.jit_functions import inlined, shared, two_product
from symtop.model.charts import Array

DoubleDouble = tuple[float, float]

ZERO, ONE = (0.0, 0.0), (1.0, 0.0)
PI = (3.141592653589793, 1.2246467991473532e-16)
HALF_PI = (1.5707963267948966, 6.123233995736766e-17)
PER_PI = (0.3183098861837907, -1.9678676675182486e-17)  # 1/pi
PER_TURN = (0.15915494309189535, -9.839338337591243e-18)  # 1/(2 pi)
TO_WHOLE = 6755399441055744.0  # 1.5 * 2^52: adding and subtracting it rounds a double below 2^51 to an integer


@inlined
def two_sum(a: float, b: float) -> DoubleDouble:
    """The sum of two doubles and its rounding error, exactly."""
    total = a + b
    virtual = total - a
    return total, (a - (total - virtual)) + (b - virtual)


@inlined
def ordered_sum(a: float, b: float) -> DoubleDouble:
    """`two_sum` with half the operations, for abs(a) >= abs(b) or a = 0."""
    total = a + b
    return total, b - (total - a)


@inlined
def whole_part(x: float) -> float:
    """The nearest integer, ties to even, as a double."""
    if abs(x) < 2251799813685248.0:
        return (x + TO_WHOLE) - TO_WHOLE
    far = math.copysign(4503599627370496.0, x)  # doubles from 2^51 to 2^52 have halves
    return (x + far) - far if abs(x) < 4503599627370496.0 else x


@inlined
def add(a: DoubleDouble, b: DoubleDouble) -> DoubleDouble:
    """a + b."""
    high, error = two_sum(a[0], b[0])
    low, low_error = two_sum(a[1], b[1])
    high, error = ordered_sum(high, error + low)
    return ordered_sum(high, error + low_error)


@inlined
def add_double(a: DoubleDouble, b: float) -> DoubleDouble:
    """a + b for a double b."""
    high, error = two_sum(a[0], b)
    return ordered_sum(high, error + a[1])


@inlined
def sub(a: DoubleDouble, b: DoubleDouble) -> DoubleDouble:
    """a - b."""
    return add(a, (-b[0], -b[1]))


@inlined
def neg(a: DoubleDouble) -> DoubleDouble:
    """-a."""
    return -a[0], -a[1]


@inlined
def scaled(a: DoubleDouble, power: float) -> DoubleDouble:
    """a times a power of two, exactly."""
    return a[0] * power, a[1] * power


@inlined
def mul(a: DoubleDouble, b: DoubleDouble) -> DoubleDouble:
    """a b."""
    high, error = two_product(a[0], b[0])
    return ordered_sum(high, error + (a[0] * b[1] + a[1] * b[0]))


@inlined
def mul_double(a: DoubleDouble, b: float) -> DoubleDouble:
    """a b for a double b."""
    high, error = two_product(a[0], b)
    return ordered_sum(high, error + a[1] * b)


@inlined
def square(a: DoubleDouble) -> DoubleDouble:
    """a^2."""
    high, error = two_product(a[0], a[0])
    return ordered_sum(high, error + 2.0 * a[0] * a[1])


@inlined
def div(a: DoubleDouble, b: DoubleDouble) -> DoubleDouble:
    """a/b."""
    quotient = a[0] / b[0]
    product, error = two_product(quotient, b[0])
    remainder = ((a[0] - product) - error) + (a[1] - quotient * b[1])  # the first difference is exact
    return ordered_sum(quotient, remainder / b[0])


@inlined
def root(a: DoubleDouble) -> DoubleDouble:
    """Square root; 0 of anything not above 0."""
    if not a[0] > 0.0:
        return 0.0, 0.0
    high = math.sqrt(a[0])
    product, error = two_product(high, high)
    remainder = ((a[0] - product) - error) + a[1]
    return ordered_sum(high, remainder / (2.0 * high))


@inlined
def rounded(a: DoubleDouble) -> float:
    """The nearest double."""
    return a[0] + a[1]


NODES = 64.0  # nodes of the tables per radian, and per unit of an exponent
BITS = 400  # fractional bits of the integers in fixed point
LAST_EXPONENT = 23  # the nodes of exp run from -23/64 to 23/64: half of ln 2 and more
LN2 = (0.6931471805599453, 2.3190468138462996e-17, 5.7077084384162121e-34)
HALF_PI_REST = 1.4973849048591698e-33  # pi/2 less its first two doubles, with the sign that subtracting them has


def _doubles(number: int, count: int) -> list[float]:
    """A number in fixed point as a sum of doubles."""
    parts = []
    for _ in range(count):
        parts.append(number / (1 << BITS))  # correctly rounded
        top, bottom = parts[-1].as_integer_ratio()
        number -= top * ((1 << BITS) // bottom) if bottom <= 1 << BITS else 0
    return parts


def _tables() -> tuple[Array, Array, Array]:
    """sin and cos of k/64, exp of k/64, and 1/k!, each in several doubles."""
    one = 1 << BITS
    sine = cosine = power = 0
    term, n = one, 0
    while term:  # of exp(1/64)
        power += term
        cosine += (term, 0, -term, 0)[n % 4]
        sine += (0, term, 0, -term)[n % 4]
        n += 1
        term = (term >> 6) // n
    s, c, arcs = 0, one, []
    for _ in range(102):  # beyond pi/2
        arcs.append(_doubles(s, 4) + _doubles(c, 4))
        s, c = (s * cosine + c * sine) >> BITS, (c * cosine - s * sine) >> BITS
    powers = [one]
    for _ in range(LAST_EXPONENT):
        powers.append(powers[-1] * power >> BITS)
    powers = [one * one // value for value in powers[:0:-1]] + powers
    factorials = [_doubles(one // math.factorial(n), 4) for n in range(26)]
    return np.array(arcs), np.array([_doubles(value, 2) for value in powers]), np.array(factorials)


ARCS, POWERS, FACTORIALS = _tables()
PER = tuple(float(value) for value in FACTORIALS[:, 0])  # 1/k! in one double, and in two
PER2 = tuple((float(high), float(low)) for high, low in FACTORIALS[:, :2])


@shared
def _sincos_near_zero(r: float) -> tuple[DoubleDouble, DoubleDouble]:
    """sin r and cos r - 1 of a double, abs(r) <= 1/128."""
    x = two_product(r, r)
    y = x[0]
    sine = mul_double(x, -PER[7] + y * (PER[9] - y * (PER[11] - y * PER[13])))
    sine = mul(x, add(PER2[5], sine))
    sine = mul(x, sub(sine, PER2[3]))
    cosine = mul_double(x, PER[8] - y * (PER[10] - y * PER[12]))
    cosine = mul(x, sub(cosine, PER2[6]))
    cosine = mul(x, add(PER2[4], cosine))
    cosine = mul(x, add_double(cosine, -0.5))
    return add_double(mul_double(sine, r), r), cosine


@shared
def _sincos_by_node(high: float, low: float) -> tuple[DoubleDouble, DoubleDouble]:
    """sin and cos of high + low, 0 <= high < 0.8."""
    k = int(high * NODES + 0.5) if high < 1.5 else 0  # NaN needs a node, too
    s, c = _sincos_near_zero(high - k / NODES)
    node_s, node_c = (float(ARCS[k, 0]), float(ARCS[k, 1])), (float(ARCS[k, 4]), float(ARCS[k, 5]))
    sine = add(add(mul(node_s, c), mul(node_c, s)), node_s)
    cosine = add(sub(mul(node_c, c), mul(node_s, s)), node_c)
    return add(sine, mul_double(cosine, low)), sub(cosine, mul_double(sine, low))


@shared
def sincos(x: float) -> tuple[DoubleDouble, DoubleDouble]:
    """sin and cos of a double, abs(x) <= 2 pi, each relatively accurate; not a number beyond 7."""
    size = abs(x)
    if not size <= 7.0:
        return (math.nan, math.nan), (math.nan, math.nan)
    quarters = math.floor(size * 0.6366197723675814 + 0.5)  # size 2/pi, rounded
    high, low = size, 0.0
    if quarters > 0:
        first, error = two_product(float(quarters), HALF_PI[0])
        high, e = two_sum(size - first, -error)  # the difference is exact
        second, low_error = two_product(float(quarters), HALF_PI[1])
        high, low = two_sum(high, -second)
        high, low = ordered_sum(high, low + (e + (quarters * HALF_PI_REST - low_error)))
    below = high < 0.0
    sine, cosine = _sincos_by_node(-high, -low) if below else _sincos_by_node(high, low)
    if below:
        sine = neg(sine)
    turn = quarters % 4
    if turn == 1:
        sine, cosine = cosine, neg(sine)
    elif turn == 2:
        sine, cosine = neg(sine), neg(cosine)
    elif turn == 3:
        sine, cosine = neg(cosine), sine
    return (neg(sine) if x < 0.0 else sine), cosine


@shared
def arctan2(y: DoubleDouble, x: DoubleDouble) -> DoubleDouble:
    """The angle of the vector (x, y), in [-pi, pi]."""
    angle = math.atan2(y[0], x[0])
    s, c = sincos(angle)
    across = sub(mul(y, c), mul(x, s))
    along = x[0] * c[0] + y[0] * s[0]
    return ordered_sum(angle, across[0] / along) if along > 0.0 else (angle, 0.0)


@shared
def exp(x: float) -> DoubleDouble:
    """exp of a double; not a number beyond 700."""
    if not abs(x) <= 700.0:
        return math.nan, math.nan
    k = math.floor(x / LN2[0] + 0.5)
    high, low = two_product(-float(k), LN2[0])
    high, error = two_sum(high, x)
    remainder = add(add((high, error), (low, 0.0)), two_product(-float(k), LN2[1]))
    remainder = add_double(remainder, -k * LN2[2])
    j = math.floor(remainder[0] * NODES + 0.5)
    r = add_double(remainder, -j / NODES)
    y = r[0]
    tail = PER[7] + y * (PER[8] + y * (PER[9] + y * (PER[10] + y * (PER[11] + y * PER[12]))))
    total = add(PER2[6], mul_double(r, tail))
    total = add(PER2[5], mul(r, total))
    total = add(PER2[4], mul(r, total))
    total = add(PER2[3], mul(r, total))
    total = add_double(mul(r, total), 0.5)
    total = add_double(mul(r, total), 1.0)
    total = mul(r, total)
    node = (float(POWERS[j + LAST_EXPONENT, 0]), float(POWERS[j + LAST_EXPONENT, 1]))
    total = add(node, mul(node, total))
    power = math.ldexp(1.0, k)
    return total[0] * power, total[1] * power


@shared
def log(x: DoubleDouble) -> DoubleDouble:
    """Natural logarithm of a positive number."""
    first = math.log(x[0])
    gap = add_double(mul(x, exp(-first)), -1.0)
    return add_double((first, 0.0), gap[0] - 0.5 * gap[0] * gap[0])


QuadDouble = tuple[float, float, float, float]
Number = TypeVar("Number", DoubleDouble, QuadDouble)

HALF_PI_TAIL = (6.123233995736766e-17, -1.4973849048591698e-33, 5.562271104316826e-50, 2.836115989820158e-66)


@inlined
def _renormalise(c0: float, c1: float, c2: float, c3: float, c4: float) -> QuadDouble:
    """Five overlapping doubles of falling size as four."""
    carry, c4 = ordered_sum(c3, c4)
    carry, c3 = ordered_sum(c2, carry)
    carry, c2 = ordered_sum(c1, carry)
    c0, c1 = ordered_sum(c0, carry)
    c1, c2 = ordered_sum(c1, c2)
    c2, c3 = ordered_sum(c2, c3)
    return c0, c1, c2, c3 + c4


@inlined
def _three_sum(a: float, b: float, c: float) -> tuple[float, float, float]:
    first, error = two_sum(a, b)
    first, carry = two_sum(c, first)
    second, third = two_sum(error, carry)
    return first, second, third


@shared
def quad_mul(a: QuadDouble, b: QuadDouble) -> QuadDouble:
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
    return _renormalise(p0, p1, s0, s1, t0)


@shared
def quad_add(a: QuadDouble, b: QuadDouble) -> QuadDouble:
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
    return _renormalise(t0, t1, t2, t3, t4 + (t5 + (t6 + t7)))


@inlined
def quad_neg(a: QuadDouble) -> QuadDouble:
    """-a."""
    return -a[0], -a[1], -a[2], -a[3]


@inlined
def widened(a: DoubleDouble) -> QuadDouble:
    """The number `a` as a quad-double."""
    return a[0], a[1], 0.0, 0.0


@inlined
def _per_factorial(n: int) -> QuadDouble:
    parts = FACTORIALS[n]
    return float(parts[0]), float(parts[1]), float(parts[2]), float(parts[3])


@shared
def quad_sincos(x: float) -> tuple[QuadDouble, QuadDouble]:
    """sin and cos of a double in [0, pi/2]: the node k/64, and a series to r^24 whose tail is in double-double."""
    upper = x > 0.7853981633974483
    if upper:
        x = HALF_PI[0] - x  # exact
    k = int(x * NODES + 0.5)
    r = x - k / NODES
    square = two_product(r, r)
    y = square[0]
    tail = add(PER2[17], mul_double(square, -PER[19] + y * (PER[21] - y * PER[23])))
    tail = sub(mul(square, tail), PER2[15])
    tail = add(PER2[13], mul(square, tail))
    even = sub(mul_double(square, PER[20] - y * (PER[22] - y * PER[24])), PER2[18])
    even = add(PER2[16], mul(square, even))
    even = sub(mul(square, even), PER2[14])
    x2, r4 = widened(square), (r, 0.0, 0.0, 0.0)
    s, c = widened(tail), widened(even)
    for n in (11, 9, 7, 5, 3):
        s = quad_add(_per_factorial(n) if n % 4 == 1 else quad_neg(_per_factorial(n)), quad_mul(x2, s))
    s = quad_add(r4, quad_mul(r4, quad_mul(x2, s)))
    for n in (12, 10, 8, 6, 4, 2):
        c = quad_add(_per_factorial(n) if n % 4 == 0 else quad_neg(_per_factorial(n)), quad_mul(x2, c))
    c = quad_mul(x2, c)
    s0 = (float(ARCS[k, 0]), float(ARCS[k, 1]), float(ARCS[k, 2]), float(ARCS[k, 3]))
    c0 = (float(ARCS[k, 4]), float(ARCS[k, 5]), float(ARCS[k, 6]), float(ARCS[k, 7]))
    sine = quad_add(s0, quad_add(quad_mul(s0, c), quad_mul(c0, s)))
    cosine = quad_add(c0, quad_add(quad_mul(c0, c), quad_neg(quad_mul(s0, s))))
    if not upper:
        return sine, cosine
    half = quad_mul(HALF_PI_TAIL, HALF_PI_TAIL)  # pi/2 less its first double, by 1 - l^2/2 and l - l^3/6
    down = (-0.5 * half[0], -0.5 * half[1], -0.5 * half[2], -0.5 * half[3])
    along = quad_add(HALF_PI_TAIL, (down[0] * HALF_PI_TAIL[0] / 3.0, 0.0, 0.0, 0.0))
    turned = quad_add(quad_add(sine, quad_mul(sine, down)), quad_mul(cosine, along))
    return quad_add(quad_add(cosine, quad_mul(cosine, down)), quad_neg(quad_mul(sine, along))), turned


@inlined
def plus(a: Number, b: Number) -> Number:
    """a + b."""
    return add(a, b) if len(a) == 2 else quad_add(a, b)


@inlined
def times(a: Number, b: Number) -> Number:
    """a b."""
    return mul(a, b) if len(a) == 2 else quad_mul(a, b)


@inlined
def minus(a: Number, b: Number) -> Number:
    """a - b."""
    return sub(a, b) if len(a) == 2 else quad_add(a, quad_neg(b))


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
