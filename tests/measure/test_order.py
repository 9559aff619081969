"""The order of a method: what its interval covers, what is left out, and the one rule that confirms it."""

import math

import numpy as np
import pytest

from symtop.measure.order import BESIDE, CLEARLY, Fit, order, order_verdict, power_law

CURVES = 500


def sampled_maximum(rng, scatter, size):
    """The largest of samples of |cos| at random phases: at most 1, and lower by about `scatter`."""
    count = max(3, round(1.3 / math.sqrt(scatter)))
    phases = (np.arange(count) + rng.random((size, 1))) / count
    return np.abs(np.cos(np.pi * phases)).max(axis=1)


def synthetic_curves(kind, powers=(2, 4, 6), q=2, seed=1):
    """Error curves C h^p (1 + a h^q) with multiplicative scatter: (p, steps, errors)."""
    rng = np.random.default_rng(seed)
    for _ in range(CURVES):
        power, count = int(rng.choice(powers)), int(rng.integers(9, 18))
        steps = 0.2 * np.geomspace(1.0, 0.1, count)
        scatter = 10.0 ** rng.uniform(-3.0, -1.7)
        noise = np.exp(scatter * rng.standard_normal(count)) if kind == "normal" else sampled_maximum(
            rng, scatter, count)  # fmt: skip
        correction = 1.0 + rng.uniform(-0.5, 0.8) * (steps / 0.2) ** q
        yield power, steps, 10.0 ** rng.uniform(-3.0, -1.0) * (steps / 0.2) ** power * correction * noise


def coverage(kind, fit_one, judged=0.97, **curves):
    inside = [abs(fit.slope - power) <= fit.interval for power, fit in
              ((power, fit_one(steps, errors, power)) for power, steps, errors in synthetic_curves(kind, **curves))
              if math.isfinite(fit.slope)]  # fmt: skip
    assert len(inside) > judged * CURVES
    return float(np.mean(inside))


@pytest.mark.parametrize("kind", [pytest.param("normal", marks=pytest.mark.slow), "sampled maxima"])
def test_the_interval_of_the_extrapolated_order_covers_what_it_says(kind):
    assert 0.93 <= coverage(kind, lambda h, e, p: order(h, e, 1e-30, 1.0, p, symmetric=True)) <= 0.97


@pytest.mark.parametrize("kind", ["normal", "sampled maxima"])
def test_the_interval_of_a_straight_line_does_not(kind):
    assert coverage(kind, lambda h, e, p: power_law(h, e)) < 0.1


def test_a_correction_in_h_is_extrapolated_too():
    """Over one decade h and h^2 are nearly one column: where the scatter is large, no order is judged."""
    assert 0.93 <= coverage("normal", lambda h, e, p: order(h, e, 1e-30, 1.0, p), 0.7, q=1, seed=2) <= 0.98


def fit(slope, interval):
    return Fit(slope, interval, 1.0, np.ones(8, dtype=bool))


@pytest.mark.parametrize(("claim", "main", "others", "word"), [
    (2, fit(2.001, 0.002), [], "confirmed"),
    (12, fit(11.966, 0.055), [], "confirmed"),
    (5, fit(4.604, 0.092), [], "undecided"),  # neither 5 nor clearly another order
    (4, fit(3.0, 0.1), [], "refuted"),
    (2, fit(1.0, 0.001), [], "refuted"),
    (4, fit(4.0, 0.01), [fit(3.0, 0.1)], "refuted"),  # theta shows less than is declared
    (4, fit(4.0, 0.01), [fit(5.0, 0.1)], "confirmed"),  # and more by chance
    (4, fit(math.nan, math.nan), [], "undecided"),
    (None, fit(2.0, 0.01), [], "measured"),
])  # fmt: skip
def test_one_rule_says_what_a_slope_says_of_a_declared_order(claim, main, others, word):
    assert order_verdict(claim, main, others) == word


def test_no_slope_confirms_two_orders():
    for slope in np.linspace(1.0, 3.0, 201):
        words = [order_verdict(claim, fit(slope, 0.2)) for claim in (1, 2, 3)]
        assert words.count("confirmed") <= 1
    assert 0.2 + BESIDE < 0.5 <= 0.1 + CLEARLY


def test_a_step_that_was_taken_twice_is_one_point():
    """Two points of the same step say nothing of the scatter: counted twice they made 8.9 +- 0.1 of order 10."""
    rng = np.random.default_rng(3)
    steps = np.geomspace(0.6, 0.8, 6)
    errors = 1e-11 * steps**10.0 * (1.0 + 0.3 * steps**2) * np.exp(0.01 * rng.standard_normal(6))
    once = order(steps, errors, 1e-16, 1.0, 10, symmetric=True)
    thrice = order(np.tile(steps, 3), np.tile(errors, 3), 1e-16, 1.0, 10, symmetric=True)
    assert (once.slope, once.interval) == (thrice.slope, thrice.interval) or not (
        math.isfinite(once.slope) or math.isfinite(thrice.slope)
    )
    dense = np.geomspace(0.02, 0.4, 20)
    fits = [order(np.repeat(dense, n), np.repeat(dense**2.0, n), 1e-16, 1.0, 2, symmetric=True) for n in (1, 2)]
    assert fits[0].slope == fits[1].slope == pytest.approx(2.0, abs=1e-3)
    assert fits[0].used.sum() == fits[1].used.sum()
