"""The measures themselves, on data whose answer is known: orders, trends, scales, counts, ladders."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
import xarray as xr

import symtop
from symtop.measure import datasets
from symtop.measure.accuracy import error_table
from symtop.measure.conservation import behaviour, from_increments, growth, momenta_of, residuals, trend
from symtop.measure.order import order
from symtop.measure.published import OTHER_BODY, START, TRAJECTORY, published_values
from symtop.measure.settings import ladder
from symtop.measure.timing import Timing, agree, timings
from symtop.methods.lagrangian import discrete_lagrangian, galerkin
from symtop.model.scenes import closed_form
from symtop.run.simulation import integrate
from tests.conftest import random_scenes

STEPS = 0.1 / 1.5 ** np.arange(16)


def test_an_exact_power_is_found_and_stray_points_are_left_out():
    fit = order(STEPS, 3.0 * STEPS**2, 1e-16, 1.0)
    assert (fit.slope, fit.constant) == (pytest.approx(2.0, abs=1e-12), pytest.approx(3.0, rel=1e-12))
    floor = 1e-7
    noisy = 3.0 * STEPS**2 + floor * np.array([0.9, -0.9] * 8)  # an error of the reference's own size
    masked = order(STEPS, noisy, floor, 1.0)
    assert masked.slope == pytest.approx(2.0, abs=0.03)
    assert np.all(noisy[masked.used] > 10.0 * floor)
    assert not masked.used[-1]
    error = 0.1 * STEPS**2
    error[5] *= 0.2
    fit = order(STEPS, error, 1e-16, 1.0)
    assert fit.slope == pytest.approx(2.0, abs=0.1)
    assert fit.used[6:].all()


@pytest.mark.parametrize(("error", "reason"), [
    (np.full(16, 3e-3), "does not fall"), (np.full(16, 0.5), "does not fall"), (1e-4 + STEPS**2, "does not fall"),
    (np.full(16, np.nan), "every run failed"), (np.full(16, 3e-15), "fewer than five points"),
])  # fmt: skip
def test_what_is_not_a_power_of_the_step_is_not_judged_and_says_why(error, reason):
    fit = order(STEPS, error, 1e-15, 1.0)
    assert (math.isnan(fit.slope), reason in fit.reason) == (True, True)
    assert not fit.used[np.isnan(error)].any()


def test_false_alarms_of_the_trend_are_as_rare_as_it_says():
    rng, t = np.random.default_rng(3), np.linspace(0.0, 1000.0, 2001)
    rises = lambda values: abs((fit := trend(t, values)).slope) > fit.interval
    assert np.mean([rises(rng.normal(size=t.size)) for _ in range(200)]) < 0.09
    walks = [np.cumsum(rng.normal(size=t.size)) for _ in range(200)]
    assert np.mean([rises(walk) for walk in walks]) < 0.45
    words = [behaviour(1e-11, *growth(t, walk)[:2], rounding=1e-12) for walk in walks]
    assert (words.count("random walk") > 150, words.count("drift") < 35) == (True, True)  # of 200
    assert np.mean([rises(np.sin(0.0314 * k * t)) for k in range(1, 60)]) < 0.05
    assert rises(rng.normal(size=t.size) + 0.005 * t)
    drifting = np.sin(5.3 * t) + 1e-3 * t  # by less than it oscillates
    assert (rises(drifting), trend(t, drifting).rise) == (True, pytest.approx(1.0, rel=0.3))


def test_a_table_stops_after_too_much_work_and_ladders_end():
    scene, rk45 = symtop.scene("spheroid"), symtop.integrator("rk45")
    table = error_table(scene, rk45, [1e-3, 1e-12, 1e-13, 1e-4], 12.0)
    assert list(table["outcome"].values) == ["ok", "ok", "not_run", "not_run"]
    for name in ("midpoint", "kahan-li-8", "gauss-12"):
        steps = ladder(symtop.integrator(name), scene, 8.0, 6, most=1e4)
        assert len(steps) == 6
        assert all(np.diff(steps) < 0.0)
        assert 8.0 / steps[-1] <= 1.001e4
    assert ladder(rk45, scene, 8.0, 6)[-1] >= rk45.least_tolerance


def test_combining_refuses_cases_with_different_coordinates():
    case = lambda name, horizons: (symtop.Case("spheroid", name), xr.Dataset(
        {"error": ("horizon", np.zeros(len(horizons)))}, coords={"horizon": horizons}))  # fmt: skip
    joined = datasets.combine([case("a", [8.0, 100.0]), case("b", [8.0, 100.0, 1000.0])])
    assert np.isnan(joined["error"].sel(variant="a", horizon=1000.0))
    for these, those in (([8.0, 100.0], [8.0, 1000.0]), (["x", "y"], ["y", "x"]), ([10, 20], [20, 30])):
        with pytest.raises(symtop.SymtopError, match="coordinate horizon of b on spheroid differs"):
            datasets.combine([case("a", these), case("b", those)])


def test_combined_values_are_those_of_each_case_whatever_its_type_and_another_order_of_dimensions_is_refused():
    case = lambda name, dims, values: (symtop.Case("spheroid", name), xr.Dataset({"value": (dims, values)}))
    pairs = [(np.array([3, 4], np.uint8), np.array([300.0, -1.5])), (np.float32([1.0, 2.0]), np.array([1e300, 0.1])),
             (np.array([3, 4], np.uint8), np.array([300, 7], np.uint16))]  # fmt: skip
    for pair in pairs:
        data = datasets.combine([case(name, ("n",), values) for name, values in zip("ab", pair, strict=True)])["value"]
        np.testing.assert_array_equal(data.sel(scene="spheroid"), [*pair])
    with pytest.raises(symtop.SymtopError, match=r"value of b on spheroid must be over \('n', 'm'\)"):
        datasets.combine([case("a", ("n", "m"), np.eye(2)), case("b", ("m", "n"), np.eye(2))])


def taking(clock, seconds):
    """A function whose calls take these seconds."""
    times = iter(seconds)

    def call():
        clock[0] += next(times)

    return call


def test_a_function_is_asked_no_more_once_it_took_long_or_its_least_samples_agree(monkeypatch):
    clock = [0.0]  # the time that `timings` reads; a function that is timed adds to it
    monkeypatch.setattr("symtop.measure.timing.time.perf_counter", lambda: clock[0])
    timings([taking(clock, [0.03, *(1000 * [1e-4])])], 3, 5e-3, warm=True, exact=False)  # a pause before the first call
    assert clock[0] > 0.03 + 3 * 5e-3
    for patience, least, counts in ((math.inf, 2, [4, 4, 4]), (0.05, 2, [4, 3, 2]), (0.05, 1, [4, 3, 1])):
        naps = [taking(clock, itertools.repeat(seconds)) for seconds in (1e-3, 0.02, 0.06)]
        results = timings(naps, 4, 5e-3, warm=True, patience=patience, least=least, exact=False)
        assert [len(timing.samples) for timing in results] == counts
    for close, count in ((0.5, 6), (0.0, 8)):
        calls = taking(clock, (0.01, 0.011, 0.03, 0.03, 0.03, 0.012, 0.03, 0.03))
        (timing,) = timings([calls], 8, 2e-3, warm=True, close=close, exact=False)
        assert len(timing.samples) == count
    samples = [[1.0, 3.0, 1.005, 3.0, last] for last in (1.009, 1.02)]
    assert [agree(times, 0.01) for times in (*samples, 4 * [1.0])] == [True, False, False]

    # The machine is half as fast in its first second: one by one, the first look so; beside an uneven one, none does.
    def work():
        clock[0] += 0.02 if clock[0] < 1.0 else 0.01

    uneven, clock[0] = taking(clock, (6e-3 * 1.02**k for k in itertools.count())), 0.0
    together = [timing.best for timing in timings([*[work] * 10, uneven], 10, 5e-3, warm=True, close=0.01, exact=False)]
    clock[0] = 0.0
    separate = [timings([work], 10, 5e-3, warm=True, exact=False)[0].best for _ in range(10)]
    assert (together[:-1], separate) == (pytest.approx([0.01] * 10), pytest.approx([0.02] * 5 + [0.01] * 5))


def test_timings_know_when_they_are_noisy_and_errors_are_relative_to_their_scales():
    run = symtop.simulate(symtop.scene("goldstein"), "exact", samples=5)
    errors = symtop.errors(run.assign(p_phi=run["p_phi"] + 0.5, energy=run["energy"] + 0.16))
    assert errors["p_phi"].values == pytest.approx(0.5 / 5.0, rel=1e-12)  # the larger momentum is p_psi = 5
    assert errors["energy"].values == pytest.approx(0.16 / 0.24705927, rel=1e-6)  # E0 - p_psi^2/2 I3 - min V
    assert Timing((1.0, 1.01, 1.02), 1.0).reliable
    assert Timing((1.0, 1.0, 4.0), 1.0).spread == 0.0  # one disturbance is no spread
    assert not Timing((1.0, 1.9, 2.0), 1.0).reliable
    quick, slow = timings([lambda: sum(range(100)), lambda: sum(range(20_000))], batches=3, batch=0.002)
    assert (slow.best > 20.0 * quick.best, len(quick.samples)) == (True, 3)


def test_every_published_value_is_reproduced_and_one_off_by_its_last_digit_is_not():
    values = published_values()
    assert [(value.source, value.quantity) for value in values if not value.reproduced] == []
    kinds = [value.tests for value in values if value.kind == "printed"]
    assert [kinds.count(kind) for kind in (TRAJECTORY, START, OTHER_BODY)] == [3, 1, 3]
    assert len(values) - len(kinds) == 6
    for value in values:
        assert not value._replace(ours=value.published + 0.52 * value.unit).reproduced


SPHEROID = symtop.scene("spheroid")
DISCRETE = {"midpoint": 1e-11, "trapezoidal": 1e-11, "stormer-verlet": 1e-11, "galerkin-simpson": 1e-13}  # of momenta


@pytest.mark.parametrize("name", DISCRETE)
def test_a_million_steps_keep_recomputed_momenta_and_bound_the_energy_without_a_trend(name):
    run = integrate(SPHEROID, name, step_size=0.01, horizon=10_000.0, samples=4001, observe="nutation")
    assert run.steps == 1_000_000
    changes = residuals(SPHEROID, run)
    trends = [trend(run.time, changes[quantity]) for quantity in ("p_phi", "p_psi", "energy")]
    assert not any(abs(fit.slope) > fit.interval for fit in trends)
    assert max(np.max(np.abs(changes[quantity])) for quantity in ("p_phi", "p_psi")) < DISCRETE[name]
    assert abs(growth(run.time, changes["energy"]).slope) < 0.05
    # of second order in the step: bounded, not small; or of fourth
    assert (1e-11 if name == "galerkin-simpson" else 1e-6) < np.max(np.abs(changes["energy"])) < 1e-3


@pytest.mark.parametrize(("family", "rule"), [
    (discrete_lagrangian, discrete_lagrangian.Quadrature((0.5,), (1.0,))), (galerkin, galerkin.Iteration()),
], ids=["midpoint", "galerkin"])  # fmt: skip
def test_momenta_are_recomputed_and_not_copied(family, rule):
    """A phi that moves 1e-10 too far shows in p_phi."""
    par, state = symtop.on_angles(SPHEROID.top, SPHEROID.start)
    step, *_ = family.march.increment(par, rule, state, family.begin(par, rule, state, 0.01), 0.01)
    expected = family.observe(par, rule, state, step, 0.01)
    assert expected == pytest.approx(SPHEROID.top.momenta(SPHEROID.start)[:2], rel=1e-14)
    next_state = (step[0], step[1], step[2] + 1e-10, step[3])
    assert abs(family.observe(par, rule, state, next_state, 0.01)[0] - expected[0]) > 1e-9


PLAN = symtop.Plan.steps(SPHEROID.nutation_period / 118.02, [0, 40_000])


@pytest.mark.parametrize("scene", random_scenes(3, seed=77), ids=lambda s: s.name)
def test_nine_states_of_the_motion_have_its_momenta(scene):
    h = scene.time_scale() / 118.0
    motion = closed_form(scene)(np.arange(9) * h)
    states = np.stack([motion.theta, scene.top.I1 * motion.theta_dot, motion.phi, motion.psi], axis=-1)
    momenta, true = np.ravel(momenta_of(scene.top, states[None], h)), scene.top.momenta(scene.start)[:2]
    assert momenta == pytest.approx(true, rel=0.0, abs=1e-7 * scene.momentum_scale)


@pytest.mark.parametrize("name", ["midpoint", "stormer-verlet", "rk4", "trapezoidal"])
def test_an_honest_run_reports_the_momenta_of_its_increments(name):
    assert from_increments(symtop.integrator(name), SPHEROID, PLAN).size == 0.0


def test_a_run_that_hides_its_drift_is_seen_and_one_of_few_steps_says_nothing():
    rk4 = symtop.integrator("rk4")

    def solve(top, start, plan):
        run, momenta = rk4.solvers["angles"](top, start, plan), top.momenta(start)
        ones = np.ones(plan.times.size)
        return run._replace(p_phi=momenta.p_phi * ones, p_psi=momenta.p_psi * ones)

    difference = from_increments(dataclasses.replace(rk4, name="copied", solvers={"angles": solve}), SPHEROID, PLAN)
    assert difference.size > 100.0 * difference.floor
    assert from_increments(symtop.integrator("rk4"), SPHEROID, symtop.Plan.steps(0.01, [0, 500])) is None
