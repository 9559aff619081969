"""Double-double arithmetic: numbers of 106 bits as sums of two doubles, for constants that must outlast a long time.

A number is a pair (high, low) with abs(low) <= ulp(high)/2 that stands for the exact sum. Everything rests on two exact
transformations, the sum (Knuth) and the product (Dekker) of two doubles as a rounded result and its error:

    a + b = s + e,    s = fl(a + b),    e = (a - (s - v)) + (b - v),    v = s - a;    a b = p + e,    e = fma(a, b, -p).

Relative errors, measured over 1e6 random pairs: sum 1.9e-32 (also if the terms cancel), product 3e-32, quotient 4e-32,
square root 3e-32; the unit is 2^-106 = 1.2e-32. Cost, compiled: 5 to 11 ns. The functions are compiled by whoever
calls them in a kernel and run as they stand otherwise, to the same bits (`symtop.core.jit_functions`).

Not to be confused with long double (64 bits) or with quadruple precision (113 bits, but a wider exponent). Sources:
Dekker, Numerische Mathematik 18 (1971) 224; Joldes, Muller and Popescu, ACM TOMS 44 (2017) 15res, algorithms 6, 9, 17.
"""

import math

from symtop.core.jit_functions import inlined, two_product

DoubleDouble = tuple[float, float]

ZERO, ONE = (0.0, 0.0), (1.0, 0.0)
PI = (3.141592653589793, 1.2246467991473532e-16)
HALF_PI = (1.5707963267948966, 6.123233995736766e-17)
PER_PI = (0.3183098861837907, -1.9678676675182486e-17)  # 1/pi
PER_TURN = (0.15915494309189535, -9.839338337591243e-18)  # 1/(2 pi)
TO_WHOLE = 6755399441055744.0  # 1.5 * 2^52: a double of less than 2^51 that is added to it and taken off is whole


@inlined
def two_sum(a: float, b: float) -> DoubleDouble:
    """The sum of two doubles and its rounding error, exactly."""
    total = a + b
    added = total - a
    return total, (a - (total - added)) + (b - added)


@inlined
def ordered_sum(a: float, b: float) -> DoubleDouble:
    """The same with half the operations if abs(a) >= abs(b), or a = 0."""
    total = a + b
    return total, b - (total - a)


@inlined
def whole_part(x: float) -> float:
    """The nearest integer, ties to even, as a double."""
    return (x + TO_WHOLE) - TO_WHOLE if abs(x) < 2251799813685248.0 else x


@inlined
def add(a: DoubleDouble, b: DoubleDouble) -> DoubleDouble:
    """a + b."""
    high, error = two_sum(a[0], b[0])
    low, rest = two_sum(a[1], b[1])
    high, error = ordered_sum(high, error + low)
    return ordered_sum(high, error + rest)


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
    rest = ((a[0] - product) - error) + (a[1] - quotient * b[1])  # the first difference is exact
    return ordered_sum(quotient, rest / b[0])


@inlined
def root(a: DoubleDouble) -> DoubleDouble:
    """Square root; 0 of anything not above 0."""
    if not a[0] > 0.0:
        return 0.0, 0.0
    high = math.sqrt(a[0])
    product, error = two_product(high, high)
    rest = ((a[0] - product) - error) + a[1]
    return ordered_sum(high, rest / (2.0 * high))


@inlined
def rounded(a: DoubleDouble) -> float:
    """The nearest double."""
    return a[0] + a[1]
