"""Forced discrete Euler-Lagrange equations: orders, decay rates, the notebook's update, and Noether with friction."""

import itertools
import math

import mpmath
import numpy as np
import pytest
import xarray as xr
from symtop_studies.oscillators import facts, figures, study
from symtop_studies.oscillators.damping import damped_truth, discrete_exponents
from symtop_studies.oscillators.measures import convergence, damped_top_table, decay, notebook_history, order
from symtop_studies.oscillators.quartic_measures import ERROR, QUARTICS, STEP, quartic_order

import symtop
from symtop.measure import datasets
from symtop.measure.order import power_law
from symtop.methods.lagrangian import damped_oscillator
from symtop.methods.lagrangian.damped_oscillator import ONE_SIDED, Oscillator, discrete_path, rule_sums
from symtop.methods.lagrangian.damped_top import Friction, damped_run, four_equations
from symtop.methods.library.scipy_ivp import integrated
from symtop.runner.study import Case
from tests.templates import checked_page


def step_matrix(oscillator, rule, h):
    """The linear map (q, p) -> (q, p) of one step, from the two paths of one step that span it; shape (2, 2)."""
    ends = [discrete_path(oscillator, rule, *start, h, 1) for start in ((1.0, 0.0), (0.0, 1.0 / oscillator.mass))]
    return np.array([[position[-1], momentum[-1]] for _, position, momentum in ends]).T


DAMPINGS = (0.0, 0.1, 1.0, 2.0, 3.0, 4.0)
STEPS = [10.0 ** (-k / 4.0) for k in range(4, 13)]
RULES = {name: rule_sums(name) for name in ("midpoint", "trapezoidal", "simpson-linear")}


@pytest.mark.parametrize("damping", [0.0, 0.3, 2.0 - 1e-9, 2.0, 2.0 + 1e-9, 3.7, 60.0])
def test_the_exact_motion_is_the_matrix_exponential(damping):
    oscillator = Oscillator(1.0, damping, 1.0)
    with mpmath.workdps(40):
        for t in (0.3, 5.0, 40.0):
            flow = mpmath.expm(mpmath.matrix([[0, 1], [-1, -mpmath.mpf(damping)]]) * t)
            true = [*map(float, flow * mpmath.matrix([mpmath.mpf(0.7), mpmath.mpf(-0.4)]))]
            rounding = 1e-14 * max(1.0, t) * math.exp(oscillator.exponents()[0].real * t)
            assert oscillator.exact(t, 0.7, -0.4) == pytest.approx(true, rel=0.0, abs=rounding)


@pytest.mark.parametrize("damping", DAMPINGS)
@pytest.mark.parametrize(("method", "steps", "order", "band"), [
    ("midpoint", STEPS, 2.0, 0.02), ("trapezoidal", STEPS, 2.0, 0.02), (ONE_SIDED, STEPS[4:], 1.0, 0.05)])  # fmt: skip
def test_rules_have_order_two_and_the_whole_force_at_one_end_costs_one(damping, method, steps, order, band):
    table = convergence(Oscillator(damping=damping), method, steps, 25.0)
    expected = order if damping else 2.0  # without friction there is no force
    assert power_law(table["step_size"], table["position_error"]).slope == pytest.approx(expected, abs=band)


@pytest.mark.parametrize("rule", [
    *RULES.values(), rule_sums(ONE_SIDED), RULES["simpson-linear"]._replace(push=0.3, pull=0.7)])  # fmt: skip
def test_the_exponents_are_those_of_the_step_matrix(rule):
    for damping, h in itertools.product((0.0, 0.1, 1.0, 2.0001, 4.0, 7.0), (0.01, 0.3, 1.0)):
        oscillator = Oscillator(1.3, damping, 0.8)
        eigenvalues = np.exp(h * np.array(discrete_exponents(oscillator, rule, h)))
        matrix = step_matrix(oscillator, rule, h)
        assert eigenvalues.sum() == pytest.approx(np.trace(matrix), abs=1e-13)
        assert eigenvalues.prod() == pytest.approx(np.linalg.det(matrix), abs=1e-13)
    four = Oscillator(damping=4.0)  # whose slow motion is exp(-0.268 t)
    slow = math.log(max(np.linalg.eigvals(step_matrix(four, RULES["midpoint"], 0.1)))) / 0.1
    unit, table = Oscillator(damping=1.0), convergence(four, "midpoint", [0.1], 25.0)
    assert float(table["exponent_error"][0]) == pytest.approx(slow / (math.sqrt(3.0) - 2.0) - 1.0, rel=1e-6)
    times, position, _ = discrete_path(unit, RULES["trapezoidal"], 1.0, 0.0, 25.0, 250)
    gap, data = position - unit.exact(times, 1.0, 0.0)[0], convergence(unit, "trapezoidal", [0.1], 25.0)
    assert 1.01 * gap.max() < float(data["position_error"][0]) == pytest.approx(-gap.min())


def test_undamped_steps_are_symplectic_and_only_midpoint_leaves_critical_damping_in_place():
    critical = Oscillator(damping=2.0)
    for h in (0.1, 0.01):
        slow, fast = discrete_exponents(critical, RULES["midpoint"], h)
        assert slow == fast
        slow, fast = discrete_exponents(critical, RULES["trapezoidal"], h)
        assert slow.real - fast.real == pytest.approx(h, rel=0.02)  # sqrt(b^2 - 4 + h^2) = h
        slow, fast = discrete_exponents(Oscillator(damping=math.sqrt(4.0 - h * h)), RULES["trapezoidal"], h)
        assert abs(slow - fast) < 1e-6
    for rule in RULES.values():
        assert np.linalg.det(step_matrix(Oscillator(), rule, 0.4)) == pytest.approx(1.0, abs=1e-14)
        assert np.linalg.det(step_matrix(Oscillator(damping=0.3), rule, 0.4)) < math.exp(-0.3 * 0.4) * 1.01


def test_the_notebooks_update_is_the_midpoint_rule_its_guess_is_not_and_a_wrong_coefficient_shows():
    for damping, h in itertools.product(DAMPINGS, (1.0, 0.1, 0.01)):
        data = notebook_history(Oscillator(damping=damping), h, 25.0)
        assert float(data["update_gap"].max()) < 5e-16 * (25.0 / h) ** 1.5
        gap = float(np.abs(data["seed_guess"] - data["seed_update"]).max())
        assert gap < 1e-12 if damping == 0.0 else gap > 0.5 * damping
    tail = notebook_history(Oscillator(damping=1.0), 0.1, 25.0)["seed_guess"].values[-70:]
    assert tail.mean() == pytest.approx(1.0, abs=0.1)  # about x = b
    assert np.ptp(tail) > 0.9  # and no smaller than at the start
    _, position, _ = discrete_path(Oscillator(damping=0.5), RULES["midpoint"], 1.0, 0.0, 25.0, 250, 251)
    exact, control = (damped_oscillator.notebook_positions(b, 0.1, *position[:2], 250)[0] for b in (0.5, 0.5 + 1e-6))
    assert np.max(np.abs(exact - position)) < 1e-12
    assert np.max(np.abs(control - position)) > 1e-8


def test_the_midpoint_rule_conserves_the_undamped_energy_the_trapezoidal_bounds_it_and_rk45_drifts():
    free = Oscillator()
    drift, error = (np.abs(decay(free, rule, 0.1, 1e4)["energy_error"]) for rule in ("midpoint", "trapezoidal"))
    assert drift.max() < 1e-11  # a quadratic invariant is kept
    assert 1e-3 < error.max() < 3e-3  # bounded by h^2/4
    assert error[error.size // 2 :].max() < 1.01 * error[: error.size // 2].max()
    rk45 = decay(free, "rk45", 0.05, 250.0)
    assert 4250.0 < float(rk45["evaluations"]) <= 5000.0  # at no more cost
    loss = np.abs(rk45["energy_error"].values)
    assert loss[-1] > 5.0 * loss[loss.size // 10]  # a drift


# the damped top

FRICTION = Friction(0.05, 0.1)


def _run(name, friction, rule, steps, horizon):
    scene, marks = symtop.scene(name), np.arange(steps + 1, dtype=np.int64)
    result = damped_run(scene, friction, rule, horizon / steps, marks)
    assert result.outcome == 0
    return scene, result.states


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("name", ["goldstein", "spheroid"])
def test_each_step_changes_the_momenta_by_exactly_the_discrete_forces(name, rule):
    for step in (2000, 200):  # an identity of the method, whatever the step
        _, states = _run(name, FRICTION, rule, step, 8.0)
        change, angles = np.diff(states[:, 4:], axis=0), np.diff(states[:, 1:3], axis=0)
        assert np.max(np.abs(change + np.array(FRICTION) * angles)) < 1e-13
        assert np.max(np.abs(change)) > 1e-4  # and the forces are not nothing
        total = states[:, 4:] - states[0, 4:] + np.array(FRICTION) * (states[:, 1:3] - states[0, 1:3])
        assert np.max(np.abs(total)) < 2e-12


@pytest.mark.parametrize("method", ["midpoint", "trapezoidal"])
def test_the_damped_top_has_order_two_and_both_integrations_of_its_truth_agree(method):
    table = damped_top_table(symtop.scene("goldstein"), method, [500, 1000, 2000, 4000], 20.0)
    assert power_law(table["top_step_size"], table["theta_error"]).slope == pytest.approx(2.0, abs=0.02)
    assert float(table["top_bound"]) < 1e-10
    assert np.abs(table["theta"] - table["true_theta"]).max() == pytest.approx(float(table["theta_error"][-1]))


def test_the_power_of_the_friction_is_what_the_energy_loses_and_without_it_the_kernel_is_unreduced():
    scene, times = symtop.scene("goldstein"), np.linspace(0.0, 10.0, 4001)
    truth, bound = damped_truth(scene, FRICTION, times)
    four = integrated(*four_equations(scene, FRICTION), times, "DOP853", 1e-13)
    assert bound == np.abs(truth[:3] - four[:3]).max()  # of all three angles
    rates = np.gradient(truth[1], times, edge_order=2), np.gradient(truth[2], times, edge_order=2)
    power = FRICTION.precession * rates[0] ** 2 + FRICTION.spin * rates[1] ** 2
    spent = np.sum(0.5 * (power[1:] + power[:-1])) * times[1]
    first, last = (scene.top.energy(symtop.Angles(*truth[:, k])) for k in (0, -1))
    assert first - last == pytest.approx(spent, rel=1e-4)
    scene, states = _run("spheroid", Friction(0.0, 0.0), "midpoint", 800, 8.0)
    run = symtop.simulate(scene, "midpoint-unreduced", step_size=0.01, samples=801, guard=False)
    for column, angle in enumerate(("theta", "phi", "psi")):
        assert np.max(np.abs(states[:, column] - run[angle].values)) < 1e-11
    assert float(np.abs(damped_top_table(symtop.scene("goldstein"), "rk45", [500], 20.0)["balance_phi"]).max()) > 1e-8


@pytest.fixture(scope="module")
def data():
    """The quick grid with fewer steps."""
    grid = {"steps": [10.0 ** (-k / 2.0) for k in range(2, 6)], "counts": [4000, 8000, 16000], "long_step": 0.25}
    cases = [Case(case.scene, case.integrator, case.settings | ({"periods": 3.0} if case.scene in QUARTICS else grid))
             for case in study.cases(True)]  # fmt: skip
    return datasets.combine([(case, study.measure(case)) for case in cases])


def test_the_page_says_what_friction_does_and_what_is_exact(data, tmp_path):
    checked_page("oscillators", data, tmp_path)
    answers = facts.facts(data)
    assert None not in answers.values()
    assert (answers["order_least"], answers["order_most"]) == pytest.approx((2.0, 2.0), abs=0.05)
    assert (answers["one_sided_least"], answers["one_sided_most"]) == pytest.approx((1.0, 1.0), abs=0.1)
    assert (answers["rate_midpoint"], answers["rate_trapezoidal"]) == pytest.approx((2.0, 1.0), abs=0.1)
    assert answers["rate_force_at_one_end"] == pytest.approx(0.5, abs=0.1)
    assert answers["balance"] < 1e-11
    assert answers["undamped_midpoint"] < 1e-11
    assert answers["damped_midpoint"] > 1e-3
    assert max(answers["exact"], answers["update_gap"]) < 1e-11
    assert (answers["top_order_least"], answers["map_order_least"]) == pytest.approx((2.0, 2.0), abs=0.05)
    variant = data.assign(energy_error=-data["energy_error"], balance_psi=data["balance_psi"] + 1e-3)
    variant["quartic_error"].loc[{"scene": QUARTICS[1]}] += 1e-3
    after = facts.facts(variant)
    assert (after["damped_midpoint"], after["undamped_rk45"]) == (answers["damped_midpoint"], answers["undamped_rk45"])
    assert (after["balance"], after["exact"]) == pytest.approx((1e-3, 1e-3), rel=1e-6)
    step = 0.1 / 2.0 ** np.arange(8.0)  # errors at rounding have no part in an order
    columns = {"step_size": step, "position_error": np.maximum(1e-4 * step**2, 5e-10), STEP: step,
               ERROR: np.maximum(1e-8 * step**2, 5e-14)}  # fmt: skip
    table = xr.Dataset({name: (("scene", "variant", "k"), row[None, None]) for name, row in columns.items()})
    table = table.assign_coords(scene=["a"], variant=["b"])
    fits = order(table, "a", "b", "position_error"), quartic_order(table, "a", "b")
    assert [fit.slope for fit in fits] == pytest.approx([2.0, 2.0])


@pytest.mark.parametrize(("name", "count"), [("midpoint", 2), ("rk45", 0), ("exact-discrete", 1)])
def test_one_method_alone_has_the_facts_and_figures_that_are_its_own(data, name, count):
    assert facts.facts(data.sel(variant=[name])).keys() == facts.facts(data).keys()
    assert len(figures.pictures(data.sel(variant=[name]))) == count
