"""The order of a method: what its interval covers, what is left out, and the one rule that confirms it."""

import dataclasses
import math
from unittest.mock import Mock

import numpy as np
import pytest

import symtop
from symtop.judging.claims import order_conditions as oc
from symtop.judging.claims.step_series import compared, step_series
from symtop.measure.order import CONFIRMED_BEYOND, REFUTED_BEYOND, Fit, order, order_verdict, power_law
from symtop.measure.step_map import generic_start, one_step
from symtop.methods.runge_kutta.pair_tables import DORMAND_PRINCE
from tests.judging.blind.right import CLASSICAL

CURVES = 500


def sampled_maximum(rng, scatter, size):
    """The largest of samples of |cos| at random phases: at most 1, and lower by about `scatter`."""
    count = max(3, round(1.3 / math.sqrt(scatter)))
    return np.abs(np.cos(np.pi * ((np.arange(count) + rng.random((size, 1))) / count))).max(axis=1)


def synthetic_curves(kind, powers=(2, 4, 6), q=2, seed=1):
    """Error curves C h^p (1 + a h^q) with multiplicative scatter: (p, steps, errors)."""
    rng = np.random.default_rng(seed)
    for _ in range(CURVES):
        power, count = int(rng.choice(powers)), int(rng.integers(9, 18))
        steps, scatter = 0.2 * np.geomspace(1.0, 0.1, count), 10.0 ** rng.uniform(-3.0, -1.7)
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
    (2, fit(2.001, 0.002), [], "confirmed"), (12, fit(11.966, 0.055), [], "confirmed"),
    (5, fit(4.604, 0.092), [], "undecided"),  # neither 5 nor clearly another order
    (4, fit(3.0, 0.1), [], "refuted"), (2, fit(1.0, 0.001), [], "refuted"),
    (4, fit(4.0, 0.01), [fit(3.0, 0.1)], "refuted"),  # theta shows less than is declared
    (4, fit(4.0, 0.01), [fit(5.0, 0.1), fit(-1.1, 0.1)], "confirmed"),  # more by chance; rounding, where steps are fine
    (4, fit(4.0, 0.01), [fit(3.5, 0.2)], "confirmed"),  # or less, within its doubt
    (4, fit(math.nan, math.nan), [], "undecided"), (None, fit(2.0, 0.01), [], "measured"),
])  # fmt: skip
def test_one_rule_says_what_a_slope_says_of_a_declared_order(claim, main, others, word):
    assert order_verdict(claim, main, others) == word


def test_no_slope_confirms_two_orders_and_a_step_taken_twice_is_one_point():
    for slope in np.linspace(1.0, 3.0, 201):
        assert [order_verdict(claim, fit(slope, 0.2)) for claim in (1, 2, 3)].count("confirmed") <= 1
    assert 0.2 + CONFIRMED_BEYOND < 0.5 <= 0.1 + REFUTED_BEYOND
    # Two points of the same step say nothing of the scatter: counted twice they made 8.9 +- 0.1 of order 10.
    rng, steps = np.random.default_rng(3), np.geomspace(0.6, 0.8, 6)
    errors = 1e-11 * steps**10.0 * (1.0 + 0.3 * steps**2) * np.exp(0.01 * rng.standard_normal(6))
    once = order(steps, errors, 1e-16, 1.0, 10, symmetric=True)
    thrice = order(np.tile(steps, 3), np.tile(errors, 3), 1e-16, 1.0, 10, symmetric=True)
    finite = math.isfinite(once.slope) or math.isfinite(thrice.slope)
    assert (once.slope, once.interval) == (thrice.slope, thrice.interval) or not finite
    dense = np.geomspace(0.02, 0.4, 20)
    fits = [order(np.repeat(dense, n), np.repeat(dense**2.0, n), 1e-16, 1.0, 2, symmetric=True) for n in (1, 2)]
    assert fits[0].slope == fits[1].slope == pytest.approx(2.0, abs=1e-3)
    assert fits[0].used.sum() == fits[1].used.sum()


SPHEROID = symtop.scene("spheroid")


def series(method, chart, scene=SPHEROID):
    return step_series(one_step(method, chart, scene, 0.01), generic_start(scene), scene.time_scale())


@pytest.mark.parametrize("shift", [3e-8, 1e-9])
def test_a_coefficient_that_is_slightly_off_shows_in_the_term_that_it_spoils(shift):
    outer = 1.3512071919596577 + shift
    inner = 1.0 - 2.0 * outer
    kick = (outer / 2, (outer + inner) / 2, (outer + inner) / 2, outer / 2)
    result = series(symtop.composition("off", (outer, inner, outer), kick, chart="space", order=4), "axis")
    assert result.order == 2
    assert 0.05 * shift < result.defect[3] < 20.0 * shift
    assert result.noise[3] < 0.01 * shift


def test_the_terms_of_known_functions_are_found():
    motion = lambda h: np.array([np.exp(h), np.cos(h)])
    result = compared(lambda h: motion(h) + np.array([1e-6 * h**2, 0.25 * h**5]), motion, 4.0)
    assert result.order == 1
    assert result.defect[2] == pytest.approx(2e-6, rel=1e-3)  # beside 1/2
    assert result.defect[5] == pytest.approx(30.0, rel=1e-3)  # beside 1/120
    assert np.all(result.defect[[0, 1, 3, 4]] < 10.0 * result.noise[[0, 1, 3, 4]])
    assert compared(motion, motion, 4.0).order == compared(motion, motion, 4.0).resolved >= 6


def test_a_solver_without_steps_backwards_is_seen_forwards_and_one_without_any_is_refused():
    rk4 = symtop.integrator("rk4")

    def solve(top, start, plan):
        if plan.step_size < 0.0:
            raise symtop.SymtopError("forward only")
        return rk4.solvers["axis"](top, start, plan)

    result = series(dataclasses.replace(rk4, name="forward", solvers={"axis": solve}), "axis")
    assert (result.order, result.backward) == (4, False)
    assert result.resolved >= 4
    step = Mock(side_effect=symtop.SymtopError("no luck"))
    with pytest.raises(symtop.SymtopError, match="no luck"):
        compared(step, np.cos, 1.0)


def square(rows):
    return oc.triangle([x for row in rows for x in row], len(rows))


def test_there_are_as_many_trees_as_there_are_and_known_tables_have_their_orders():
    assert [len(oc.trees(n)) for n in range(1, 8)] == [1, 1, 2, 4, 9, 20, 48]
    assert all(oc.size(tree) == 6 for tree in oc.trees(6))
    assert sorted(oc.density(tree) for tree in oc.trees(4)) == [4, 8, 12, 24]  # tall tree: n!; bush: n
    assert oc.conditions(square(CLASSICAL[0]), CLASSICAL[1]).order == 4
    assert oc.conditions(square(((), *DORMAND_PRINCE.a)), DORMAND_PRINCE.b).order == 5
    r = 3**0.5 / 6
    assert oc.conditions([[0.25, 0.25 - r], [0.25 + r, 0.25]], [0.5, 0.5]).order == 4
    assert (oc.conditions([[0.5]], [1.0]).order, oc.conditions([[0.0]], [1.0]).order) == (2, 1)
    assert oc.conditions([[0.0]], [0.9]).order == 0


@pytest.mark.parametrize(("shift", "order"), [(1e-9, 2), (1e-13, 4)])
def test_a_coefficient_that_is_off_shows_beyond_rounding(shift, order):
    # the same nodes; b4 off c3 = off/12 in the tall tree of order 3
    table = oc.conditions(square(((), (0.5,), (0.0, 0.5), (shift, 0.0, 1.0 - shift))), CLASSICAL[1])
    assert (table.order, table.defect[2]) == (order, pytest.approx(shift / 12, rel=0.01, abs=1e-16))


FREE = [2, 1, 2, 3, 6, 9, 18, 30, 56, 99]  # dimensions of the free Lie algebra of two letters: Witt's formula


@pytest.mark.parametrize("longest", [9, pytest.param(10, marks=pytest.mark.slow)])
def test_there_are_as_many_conditions_as_there_are(longest):
    """McLachlan and Quispel, Acta Numerica 11 (2002) 341, of Runge-Kutta-Nystrom methods."""
    count = [dimension - oc.vanishing(length).shape[1] for length, dimension in enumerate(FREE[:longest], start=1)]
    assert count == [2, 1, 2, 2, 4, 5, 10, 14, 25, 39][:longest]


def test_log_undoes_exp_and_begins_as_baker_campbell_and_hausdorff_say():
    t, v = oc.element(t=1.0), oc.element(v=1.0)
    words = oc.logarithm(oc.product(oc.exponential(t), oc.exponential(v)))
    np.testing.assert_allclose(words[1], [1.0, 1.0])
    np.testing.assert_allclose(words[2], 0.5 * oc.commutator(t, v)[2])
    inner = oc.commutator(t, v)
    third = [a - b for a, b in zip(oc.commutator(t, inner), oc.commutator(v, inner), strict=True)]
    np.testing.assert_allclose(words[3], third[3] / 12.0, atol=1e-16)
    for row in oc.logarithm(oc.exponential(t))[2:]:
        np.testing.assert_allclose(row, 0.0, atol=1e-15)


def test_known_splittings_have_their_orders_gradients_and_processors_counted():
    assert oc.splitting_conditions((1.0,), (1.0, 0.0)).order == 1
    assert oc.splitting_conditions((1.0,), (0.5, 0.5)).order == 2
    assert oc.splitting_conditions((1.0,), (0.5, 0.4)).order == 0
    a, b = (1.0, -2 / 3, 2 / 3), (-1 / 24, 3 / 4, 7 / 24)
    assert oc.splitting_conditions(a, (0.0, *b)).order == 3  # Ruth 1983
    assert oc.splitting_conditions(a, (0.0, *reversed(b))).order < 3
    assert oc.splitting_conditions((0.5, 0.5), (1 / 6, 2 / 3, 1 / 6), (0.0, -1 / 72, 0.0)).order == 4
    assert oc.splitting_conditions((0.5, 0.5), (1 / 6, 2 / 3, 1 / 6), (0.0, 1 / 72, 0.0)).order == 2
    assert oc.splitting_conditions((1.0,), (0.5, 0.5), (-1 / 48, -1 / 48), 1 / 12).order == 4
    assert oc.splitting_conditions((1.0,), (0.5, 0.5), (-1 / 48, -1 / 48)).order == 2
