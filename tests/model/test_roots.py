"""Newton's method within a bracket, against roots that are known and against SciPy's bracketing method."""

import math

import pytest
from scipy.optimize import brentq

from symtop.model.top import newton_between

LN2 = 0.6931471805599453
FUNCTIONS = {
    "convex": (lambda x: math.exp(x) - 2.0, math.exp, -5.0, 8.0, LN2),
    "a pole at the left": (lambda x: 1.0 - 1e-24 / x**3, lambda x: 3e-24 / x**4, 1e-9, 3.0, 1e-8),
    "flat, where Newton's steps leave": (math.atan, lambda x: 1.0 / (1.0 + x * x), -1.0, 1e6, 0.0),
    "a slope that turns": (lambda x: x**3 - 2.0 * x - 5.0, lambda x: 3.0 * x * x - 2.0, -1.0, 6.0, 2.0945514815423265),
    "a jump": (lambda x: math.copysign(1.0, x - 0.3), lambda x: 0.0, 0.0, 1.0, 0.3),
    "no finite slope": (lambda x: x - 0.3, lambda x: math.nan, 0.0, 1.0, 0.3),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_root_is_found_to_its_last_places(name):
    value, slope, below, above, root = FUNCTIONS[name]
    assert newton_between(value, slope, below, above) == pytest.approx(root, rel=1e-15, abs=1e-200)
    if root:
        assert brentq(value, below, above, xtol=1e-30, rtol=1e-15) == pytest.approx(root, rel=1e-14)


def test_a_slope_that_is_wrong_costs_steps_and_no_digits():
    calls = []

    def value(x):
        calls.append(x)
        return math.exp(x) - 2.0

    assert newton_between(value, math.exp, -5.0, 8.0) == pytest.approx(LN2, rel=1e-15)
    good = len(calls)
    assert newton_between(value, lambda x: 3.7 * math.exp(x), -5.0, 8.0) == pytest.approx(LN2, rel=1e-15)
    assert good < 15 < len(calls) - good < 200
