"""Sine and cosine of the kernels: as exact as they say, at both ends and far away, and without a call."""

import math

import mpmath
import numpy as np
import pytest
from numba import njit

from symtop.core import sines
from symtop.core.jit import compile_kernel, register_jitable
from symtop.core.numbers import EPSILON


@compile_kernel
def sine_and_cosine(x, out):  # a loop over many, as in lanes
    for i in range(x.size):
        out[0, i], out[1, i] = sines.sincos(x[i])


def compiled(x):
    x = np.atleast_1d(np.asarray(x, dtype=float))
    out = np.empty((2, x.size))
    sine_and_cosine(x, out)
    return out


def errors(x, values, relative=True):
    """Largest errors of sines and cosines, in units of 2.2e-16."""
    worst = []
    with mpmath.workdps(40):
        for function, computed in zip((mpmath.sin, mpmath.cos), values, strict=True):
            true = [function(mpmath.mpf(float(angle))) for angle in x]
            scales = [abs(value) if relative else 1 for value in true]
            gaps = [abs(mpmath.mpf(float(y)) - value) / s for y, value, s in zip(computed, true, scales, strict=True)]
            worst.append(float(max(gaps)) / EPSILON)
    return worst


def quarter(n, seed=1):
    """Angles between 0 and pi/2: evenly, close to either end, and the last doubles of both."""
    draw = np.random.default_rng(seed)
    offsets = 10.0 ** draw.uniform(-16.0, -1.0, n)
    last = [5e-324, 1e-160, np.nextafter(0.25 * math.pi, 0.0), 0.25 * math.pi, 0.5 * math.pi]
    return np.concatenate([draw.uniform(0.0, 0.5 * math.pi, 2 * n), offsets, 0.5 * math.pi - offsets, last])


@pytest.mark.parametrize(("n", "seed"), [(3000, 1), pytest.param(100_000, 2, marks=pytest.mark.slow)])
def test_errors_between_the_poles_are_those_of_the_docstring(n, seed):
    x = quarter(n, seed)
    sine, cosine = errors(x, compiled(x))
    assert sine < 0.56
    assert cosine < 0.63


def test_the_second_part_of_a_quarter_turn_keeps_the_digits_at_the_pole(monkeypatch):
    x = 0.5 * math.pi - np.array([0.0, 1e-15, 1e-9, 1e-3])
    assert max(errors(x, np.transpose([sines.polynomials(angle) for angle in x]))) < 1.0
    monkeypatch.setattr(sines, "QUARTER_LOW", 0.0)
    assert errors(x, np.transpose([sines.polynomials(angle) for angle in x]))[1] > 1e10


@pytest.mark.parametrize(("coefficients", "remainder", "largest"), [
    (sines.SINE, lambda r, z, p: (r + r * z * p) / mpmath.sin(r) - 1, 3.9e-18),
    (sines.COSINE, lambda r, z, p: (1 - z / 2 + z * z * p) / mpmath.cos(r) - 1, 9.0e-20),
])  # fmt: skip
def test_no_polynomial_of_the_degree_is_much_better(coefficients, remainder, largest):
    """Seven errors of alternating signs: the best polynomial has at least the least of them (de la Vallee Poussin)."""

    def error(x, c):
        r = mpmath.mpf(float(x))
        return float(remainder(r, r * r, sum(mpmath.mpf(value) * r ** (2 * k) for k, value in enumerate(c))))

    x = np.linspace(0.01, 0.25 * math.pi, 400)
    with mpmath.workdps(40):
        remainders = np.array([error(angle, coefficients) for angle in x])
        worse = max(abs(error(angle, [*coefficients[:-1], coefficients[-1] * (1.0 + 1e-5)])) for angle in x)
    arcs = np.split(remainders, np.flatnonzero(np.diff(np.sign(remainders))) + 1)
    assert np.max(np.abs(remainders)) == pytest.approx(largest, rel=0.01)
    assert len(arcs) == 7
    assert worse > 1.3 * largest


@pytest.mark.parametrize("size", [3.0, 100.0, 1e6, 1e12])
def test_any_angle_has_its_quadrant(size):
    draw = np.random.default_rng(3)
    turns = np.round(draw.uniform(-size, size, 300)) * 0.5 * math.pi  # where one of them is nearly zero
    x = np.concatenate([draw.uniform(-size, size, 300), turns, np.nextafter(turns, 0.0)])
    assert max(errors(x, compiled(x), relative=False)) < 0.5


def test_compiled_code_calls_no_library():
    """A call would keep LLVM from vectorising a loop over many."""

    def kernel(sincos):
        @njit(error_model="numpy")
        def loop(x, out):
            for i in range(x.size):
                out[0, i], out[1, i] = sincos(x[i])

        loop(np.ones(4), np.empty((2, 4)))
        words = {word.strip("$,*").partition("@")[0] for code in loop.inspect_asm().values() for word in code.split()}
        return words & {"sin", "cos", "sincos"}

    assert kernel(register_jitable(lambda x: (np.sin(x), np.cos(x))))
    assert not kernel(sines.sincos)


def test_outside_of_compiled_code_it_is_the_library_and_nan_stays_nan():
    assert np.all(np.isnan(compiled([math.nan, math.inf, -math.inf])))
    assert np.all(np.isfinite(compiled([1e15, 1e16, -1e17, 1e40, -1e200, 1e308])))
    assert np.max(np.abs(compiled([*np.geomspace(1e15, 1e308, 3000)]))) <= 1.01
    x = quarter(500, seed=4)
    together = compiled(x)
    assert np.array_equal(together, np.hstack([compiled(angle) for angle in x]))
    interpreted = np.transpose([sines.polynomials(angle) for angle in x])
    assert max(errors(x, interpreted)) < 1.0
    assert np.max(np.abs(interpreted / together - 1.0)) < 1.5 * EPSILON
    assert sines.sincos(0.3) == (math.sin(0.3), math.cos(0.3))
    angles = np.array([0.3, 0.4])
    assert np.array_equal(sines.sincos(angles), [np.sin(angles), np.cos(angles)])
    wide = np.longdouble("0.1") * 3
    assert sines.sincos(wide) == (np.sin(wide), np.cos(wide))
