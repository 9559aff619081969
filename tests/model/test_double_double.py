"""Double-double and quad-double against 100 digits, with double as the control."""

import math
import random
from fractions import Fraction

import mpmath as mp
import pytest

from symtop.core.jit_functions import two_product
from symtop.model.exact import double_double as dd

UNIT = 2.0**-106


@pytest.fixture(autouse=True)
def _digits():
    with mp.workdps(100):
        yield


def _exact(number):
    return sum((mp.mpf(part) for part in number), mp.mpf(0))


def _error(number, true):
    return float(abs((_exact(number) - true) / true))


def _pair(draw):
    high = draw.choice([-1.0, 1.0]) * 10.0 ** draw.uniform(-20.0, 20.0)
    return dd.ordered_sum(high, draw.uniform(-0.5, 0.5) * math.ulp(high))


def _four(draw):
    parts = [draw.choice([-1.0, 1.0]) * 10.0 ** draw.uniform(-10.0, 10.0)]
    for _ in range(3):
        parts.append(draw.uniform(-0.5, 0.5) * math.ulp(parts[-1]))
    return tuple(parts)


@pytest.mark.parametrize(("ours", "true", "units"), [
    (dd.add, lambda a, b: a + b, 3), (dd.sub, lambda a, b: a - b, 3), (dd.mul, lambda a, b: a * b, 6),
    (dd.div, lambda a, b: a / b, 10),
], ids=["add", "sub", "mul", "div"])  # fmt: skip
def test_double_double_is_right_to_a_few_units(ours, true, units):
    draw = random.Random(2)
    for number in range(2000):
        a, b = _pair(draw), _pair(draw)
        if number % 2:  # so close that most digits cancel
            b = dd.ordered_sum(-a[0], draw.uniform(-0.5, 0.5) * math.ulp(a[0]))
        exact = true(_exact(a), _exact(b))
        if exact:
            assert _error(ours(a, b), exact) <= units * UNIT
    assert _error((0.1 / 3.0,), mp.mpf(0.1) / 3) > 1e6 * UNIT


def test_sums_products_square_roots_and_rounding():
    draw = random.Random(1)
    for _ in range(2000):
        a, b = (draw.uniform(-1.0, 1.0) * 10.0 ** draw.uniform(-30.0, 30.0) for _ in range(2))
        assert sum(map(Fraction, dd.two_sum(a, b))) == Fraction(a) + Fraction(b)
        assert sum(map(Fraction, two_product(a, b))) == Fraction(a) * Fraction(b)
    assert Fraction(0.1 * 0.1) != Fraction(0.1) ** 2  # the control: a rounded product is not
    draw = random.Random(3)
    for _ in range(1000):
        a = tuple(map(abs, _pair(draw)))
        assert _error(dd.root(a), mp.sqrt(_exact(a))) <= 4 * UNIT
        assert dd.square(a) == dd.mul(a, a)
    assert dd.root((-1.0, 0.0)) == (0.0, 0.0)
    half, edge = 2.0**51, 2.0**52
    for x in (0.5, 1.5, 2.5, -0.5, -2.5, 3.49, 3e17, -7.0, half + 0.5, half + 1.5, -half - 1.5, edge - 0.5, edge + 1.0):
        assert dd.whole_part(x) == round(x)


def test_elementary_functions_of_double_doubles():
    draw = random.Random(4)
    for _ in range(500):
        x = draw.choice([-1.0, 1.0]) * min(10.0 ** draw.uniform(-12.0, 0.798), 6.28)
        for ours, true in zip(dd.sincos(x), (mp.sin(x), mp.cos(x)), strict=True):
            assert _error(ours, true) <= 8 * UNIT
        a, b = _pair(draw), _pair(draw)
        assert _error(dd.arctan2(a, b), mp.atan2(_exact(a), _exact(b))) <= 12 * UNIT
        power = draw.uniform(-300.0, 300.0)
        assert _error(dd.exp(power), mp.exp(power)) <= 4 * UNIT
        size = dd.scaled(a, math.copysign(1.0, a[0]))
        assert abs(_exact(dd.log(size)) - mp.log(_exact(size))) <= 8 * UNIT * max(1.0, abs(math.log(size[0])))
    for k, angle in enumerate((math.pi, 1.5 * math.pi)):  # all digits but those of the third double of pi/2 cancel
        assert _error(dd.sincos(angle)[k], (mp.sin, mp.cos)[k](angle)) <= 8 * UNIT
    assert math.isnan(dd.sincos(math.nan)[0][0])
    assert math.isnan(dd.sincos(7.5)[1][0])
    assert math.isnan(dd.exp(800.0)[0])


def test_quad_double_is_right_to_sixty_digits():
    draw = random.Random(5)
    for number in range(500):
        a, b = _four(draw), _four(draw)
        if number % 2:
            b = (-a[0], *b[1:])
            b = (b[0], *(draw.uniform(-0.5, 0.5) * math.ulp(a[0]) * 2.0 ** (-53 * k) for k in range(3)))
        terms = abs(_exact(a)) + abs(_exact(b))
        assert float(abs(_exact(dd.quad_add(a, b)) - _exact(a) - _exact(b)) / terms) <= 2.0**-204
        assert _error(dd.quad_mul(a, b), _exact(a) * _exact(b)) <= 2.0**-203
        x = draw.uniform(0.0, 1.57)
        for ours, true in zip(dd.quad_sincos(x), (mp.sin(x), mp.cos(x)), strict=True):
            assert _error(ours, true) <= 1e-62
            assert _error(dd.narrowed(ours), true) <= UNIT
    assert _error(dd.mul((0.1, 0.0), (0.3, 1e-18)), mp.mpf(0.1) * (mp.mpf(0.3) + mp.mpf(1e-18))) > 1e-40  # the control
