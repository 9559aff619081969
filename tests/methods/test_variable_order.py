"""Methods that choose order or steps: Adams on any nodes, extrapolation, many members, budgets and failures."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate

import symtop
from symtop.core.jit import compile_kernel
from symtop.methods.framework.adaptive import Adaptive
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.lanes import members_of
from symtop.methods.framework.plan import OUTCOMES, Plan
from symtop.methods.framework.registry import variants
from symtop.methods.runge_kutta import adams, extrapolation, pairs
from symtop.methods.runge_kutta.adams import ALPHA, BETA, GAMMA, HIGHEST, LAST, NUMBERS, ORDER, PSI, SETTLED, SIGMA, G
from symtop.model.scenes import closed_form
from symtop.run.ensemble.chunks import nutation_periods
from symtop.run.ensemble.inputs import read_members
from tests.conftest import defer


def prepared(steps, h, k):
    """The memory with the psi of past steps, the newest first, and the coefficients of a step h of order k."""
    memory = np.zeros((LAST + 1, 6))
    memory[NUMBERS : NUMBERS + len(steps), PSI] = np.cumsum(steps)
    adams.coefficients(memory, k, h)
    return memory[NUMBERS : NUMBERS + k + 1]


def test_coefficients_of_equal_steps_are_those_of_adams_and_bashforth():
    rows = prepared(np.full(13, 0.25), 0.25, 12)
    np.testing.assert_allclose(rows[:7, G], [1, 1 / 2, 5 / 12, 3 / 8, 251 / 720, 95 / 288, 19087 / 60480], rtol=1e-13)
    np.testing.assert_array_equal(rows[:12, BETA], 1.0)
    np.testing.assert_allclose(rows[:, SIGMA], 1.0, rtol=1e-14)
    np.testing.assert_allclose(rows[:12, ALPHA], 1.0 / np.arange(1, 13), rtol=1e-15)
    np.testing.assert_allclose(GAMMA[:6], [1, 1 / 2, 1 / 12, 1 / 24, 19 / 720, 3 / 160], rtol=1e-13)
    np.testing.assert_allclose(np.diff(rows[:7, G]), -np.array(GAMMA[1:7]), rtol=1e-12)  # gamma*_j


@pytest.mark.parametrize("k", range(1, HIGHEST + 1))
def test_a_predictor_integrates_polynomials_below_its_order_on_any_nodes_and_no_higher_one(k):
    past, h = np.random.default_rng(k).uniform(0.5, 2.0, 13), 0.8
    nodes, rows = -np.concatenate([[0.0], np.cumsum(past)])[:k], prepared(past, h, k)
    for degree in range(k + 1):
        f = nodes**degree if degree else np.ones(k)
        differences = []  # psi_1 .. psi_i f[t_n, .., t_{n-i}], of the nodes behind
        table, factor = f.astype(float), 1.0
        for i in range(k):
            differences.append(factor * table[0])
            if i + 1 < k:
                table = (table[:-1] - table[1:]) / (nodes[: -i - 1] - nodes[i + 1 :])
                factor *= nodes[0] - nodes[i + 1]
        terms, exact = h * rows[:k, G] * rows[:k, BETA] * differences, h ** (degree + 1) / (degree + 1)
        gap = abs(np.sum(terms) - exact) / max(np.abs(terms).sum(), exact)
        assert gap < 1e-11 if degree < k else gap > 1e-2, (degree, gap)


def test_once_its_start_is_over_adams_raises_its_order_in_every_second_step_at_most():
    """As STEP, which counts no more steps of one length than one above the order."""
    form, memory, orders, t, h = FORMULATIONS["axis"], np.zeros((LAST + 1, 6)), [], 0.0, 1e-3
    par, state = form.prepare(SPHEROID.top, SPHEROID.start)
    advance = compile_kernel(adams.method(form.field).advance)
    memory[0] = form.field(par, state)
    while t < 10.0:
        state, t, h, *_ = advance(par, state, memory, 1e-10, t, h, 10.0)
        orders += [memory[LAST, ORDER]] if memory[LAST, SETTLED] else []
    rises = np.diff(orders) > 0
    assert rises.sum() > 5
    assert not (rises[1:] & rises[:-1]).any()


@pytest.mark.parametrize("name", ["spheroid", "goldstein"])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-10])
def test_it_needs_no_more_evaluations_than_scipys_adams_codes_and_errs_no_more(name, tolerance):
    scene = symtop.scene(name)
    field, times = symtop.field("axis", scene.top), np.linspace(0.0, scene.horizon, 33)
    truth = symtop.reference(scene, times)["axis"].values
    run = symtop.simulate(scene, "adams[axis]", tolerance=tolerance, samples=33, guard=False)
    error, start = float(symtop.errors(run)["axis"].max()), field.state(scene.start)
    lsoda = integrate.solve_ivp(field, (0.0, scene.horizon), start, method="LSODA", rtol=tolerance, atol=tolerance,
                                t_eval=times)  # fmt: skip
    count = [0]

    def counted(t, y):
        count[0] += 1
        return field(t, y)

    vode = integrate.ode(counted).set_integrator("vode", method="adams", rtol=tolerance, atol=tolerance, nsteps=10**6)
    vode.set_initial_value(start, 0.0)
    states = np.array([vode.integrate(t)[:3] for t in times[1:]])
    for evaluations, axis in ((lsoda.nfev, lsoda.y[:3].T), (count[0], np.vstack([truth[:1], states]))):
        assert run.attrs["force_evaluations"] < 1.02 * evaluations
        assert error < 1.1 * np.linalg.norm(axis - truth, axis=1).max()


@pytest.mark.parametrize("chart", ["angles", "axis", *defer("attitude")])
@pytest.mark.parametrize(("name", "tolerances"), [
    ("adams", (1e-5, 1e-8, 1e-12)),  # at 1e-4 a quaternion is longer than one by more than 0.1 %, an outcome
    ("extrapolation", (1e-4, 1e-8, 1e-12)),
])  # fmt: skip
def test_errors_follow_the_tolerance_and_orders_rise_with_it(name, tolerances, chart):
    runs = [symtop.simulate("spheroid", f"{name}[{chart}]", tolerance=tolerance, samples=161, guard=False)
            for tolerance in tolerances]  # fmt: skip
    assert [run.attrs["outcome"] for run in runs] == ["ok"] * 3
    axes = [symtop.errors(run)["axis"].values for run in runs]
    assert max(axis[0] for axis in axes) < 1e-15  # the start itself
    assert all(50.0 * fine.max() < coarse.max() for coarse, fine in itertools.pairwise(axes))
    assert axes[-1].max() < 1e-9
    counts, steps = ([run.attrs[key] for run in runs] for key in ("force_evaluations", "steps"))
    if name == "adams":
        assert counts[-1] < 5.6 * counts[0]  # of one order k it would be 1000^(2/k) times: k = 8 and more
        assert all(2 * n <= count for n, count in zip(steps, counts, strict=True))
    else:
        assert counts[0] / steps[0] < counts[1] / steps[1] < counts[2] / steps[2]
        assert steps[2] < 2.5 * steps[0]  # of one order: hundreds of times as many


SPHEROID = symtop.scene("spheroid")


def one_step(h, lines):
    """A step of h with so many lines, as a sample at the fraction h of a step of one."""
    form = FORMULATIONS["axis"]
    par, state = form.prepare(SPHEROID.top, SPHEROID.start)
    method, memory = extrapolation.method(form.field), np.zeros((extrapolation.LAST + 1, 6))
    memory[0] = form.field(par, state)
    memory[extrapolation.ORDERS, 1] = lines
    sample = method.sample

    def kernel(par, state, memory, x):
        return sample(par, state, state, memory, 1.0, x)

    return np.array(compile_kernel(kernel)(par, state, memory, h))


@pytest.mark.parametrize("lines", [1, 2, 3, 4])
def test_a_line_more_gives_two_orders_more(lines):
    steps = np.array([0.16, 0.08]) if lines > 2 else np.array([0.04, 0.02])
    exact = closed_form(SPHEROID).axis(steps)
    errors = [np.linalg.norm(one_step(float(h), lines)[:3] - e) for h, e in zip(steps, exact, strict=True)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * lines + 1, abs=0.7)  # of one step


def test_huge_times_begin_and_a_step_rounded_to_what_it_was_halved_from_ends_the_run():
    """Its first step is far below the spacing of numbers at its end, on whose grid steps lie: it stood still."""
    top = symtop.SymmetricTop(5.8e10, 5.6e10, -7.2e-12)
    scene = symtop.Scene("slow", top, symtop.Angles(1.7, 1.6, 2.8, 4.7e-12, -2.4e-11, -4.6e-11), 1.1e13)
    run = symtop.simulate(scene, "adams", tolerance=1e-9, samples=11, budget=1e5)
    assert run.attrs["outcome"] == "ok"
    assert float(symtop.errors(run)["axis"].max()) < 1e-3
    # The energy has blown up by then, and steps are as long as what times are rounded by; it ran for ever.
    top = symtop.SymmetricTop(0.3138360947869337, 0.4179762569907529, 4.007653015081924)
    rate = 0.4277222539612995
    scene = symtop.Scene("drawn", top, symtop.Angles(3.0, theta_dot=rate, psi_dot=rate), 46.7593159223593)
    run = symtop.simulate(scene, "adams[attitude]", tolerance=0.08613785662111073, budget=2000, guard=False)
    assert run.attrs["outcome"] != "ok"
    assert run.attrs["reached_time"] < 4.0


EACH = {row.name: row.solvers[row.charts()[0]] for row in variants()}
SOLVERS = {name: solver for name, solver in EACH.items() if isinstance(solver, Adaptive)}
ONE_CHART = {name.split("[")[0]: name for name in SOLVERS}
OWN = sorted(ONE_CHART)
PAIRS = [pair.name for pair in (pairs.RK45, *pairs.PAIRS)]
COUNTS = 7
BUDGET = 400.0  # evaluations: Adams methods end the longest run after 808, others the shortest one after 162
LARGEST = {  # evaluations of a step with its samples; of all others 48, three tries of vern9
    "series-adaptive": 20.0 * (1 + COUNTS),  # a series a sample
    "extrapolation": 2.0 * (1 + 10**2),  # ten lines have so many; tried twice
}


def members(count=60):
    """Tops of every stratum, each with a tolerance, times and a number of samples of its own."""
    numbers = read_members(symtop.population(count, seed=7)).numbers
    period = nutation_periods(numbers)
    times = np.outer(np.where(np.isfinite(period), period, 1.0), np.linspace(0.3, 4.0, COUNTS))
    return numbers, 10.0 ** -(2.0 + np.arange(count) % 9), times, 1 + np.arange(count) % COUNTS


@pytest.mark.quick
@pytest.mark.parametrize(("name", "budget"), [
    *((name, None) for name in SOLVERS), *((name, BUDGET) for name in ONE_CHART.values())])  # fmt: skip
def test_members_have_the_bits_of_runs_alone(name, budget):
    numbers, tolerance, times, counts = members()
    if "angles" in name:
        numbers[5, 3] = 0.0  # on a pole
    results, end_times = SOLVERS[name].many(numbers, tolerance, times, counts, budget)
    for i, (top, start) in enumerate(members_of(numbers)):
        if "angles" in name and i == 5:
            assert (OUTCOMES[results.outcome[i]], results.steps[i], end_times[i]) == ("left_chart", 0, 0.0)
            assert np.isnan(results.states[i]).all()
            continue
        run = SOLVERS[name](top, start, Plan.until(times[i, : counts[i]], tolerance[i], budget))
        np.testing.assert_array_equal(results.states[i, : counts[i]], run.states)
        np.testing.assert_array_equal(results.momenta[i, : counts[i]].T, (run.p_phi, run.p_psi))
        assert np.isnan(results.states[i, counts[i] :]).all()
        assert (results.steps[i], results.work[i], OUTCOMES[results.outcome[i]], end_times[i]) == (*run[3:5], *run[6:])
    outcomes = {OUTCOMES[k] for k in results.outcome}
    assert ("ok" in outcomes, "out_of_budget" in outcomes) == (True, budget is not None)


@pytest.mark.quick
@pytest.mark.parametrize("row", [row for row in variants() if row.control == "tolerance"], ids=lambda row: row.name)
def test_an_infinite_budget_ends_no_run(row):
    """Of a Taylor method it was no number of steps: an OverflowError."""
    scene, times = symtop.scene("goldstein"), np.linspace(0.0, 0.5, 3)
    free, bound = (row.solvers[row.charts()[0]](scene.top, scene.start, Plan.until(times, 1e-6, budget))
                   for budget in (None, np.inf))  # fmt: skip
    assert free.outcome == bound.outcome == "ok"
    np.testing.assert_array_equal(free.states, bound.states)


@pytest.mark.quick
@pytest.mark.parametrize("name", SOLVERS)
def test_a_budget_is_passed_by_less_than_a_step(name):
    numbers, tolerance, times, _ = members(20)
    results, end_times = SOLVERS[name].many(numbers, tolerance, times, np.full(20, COUNTS), BUDGET)
    mask = results.outcome == OUTCOMES.index("out_of_budget")
    assert mask.any()
    assert (results.work[mask] < BUDGET + LARGEST.get(name.split("[")[0], 48.0)).all()
    assert (end_times[mask] < times[mask, -1]).all()


@pytest.mark.quick
def test_a_run_in_pieces_has_the_bits_of_a_run_in_one():
    assert (len(OWN), len(SOLVERS)) == (9, 23)  # none is left out
    numbers, tolerance, times, counts = members(12)
    for solver in SOLVERS.values():
        whole, parts = (each.many(numbers, tolerance, times, counts)[0] for each in (solver, replace(solver, block=9)))
        np.testing.assert_array_equal(whole.states, parts.states)
        np.testing.assert_array_equal(whole.work, parts.work)


@pytest.mark.parametrize("name", ["rk45", *OWN[:-2], *defer(*OWN[-2:])])  # tsit5, vern9
def test_a_pole_ends_a_run_in_angles_alone(name):
    """Falling through the pole exactly: without rotation theta' only changes sign in the angles chart."""
    top, start = symtop.SymmetricTop(1.0, 1.0, 1.0), symtop.Angles(1.0, theta_dot=-2.0)
    pole = symtop.Scene("pole", top, start, 5.0, observes="axis")
    ends = ("left_chart",) if name in ("rk45", *PAIRS) else ("left_chart", "step_too_small")
    for chart in symtop.integrator(name).charts():
        run = symtop.simulate(pole, f"{name}[{chart}]", tolerance=1e-3 if chart == "angles" else 1e-8, guard=False)
        assert run.attrs["outcome"] in (ends if chart == "angles" else ("ok",))
        assert chart == "angles" or float(symtop.errors(run)["axis"].max()) < 1e-5


@pytest.mark.parametrize("name", OWN)
def test_samples_inside_steps_are_as_good_as_their_ends_and_change_no_step(name):
    """They cost evaluations in the pairs of order 8 and 9 alone (`test_pairs` counts them)."""
    row = f"{name}[axis]" if "axis" in symtop.integrator(name).charts() else name
    sparse, dense = (symtop.simulate("spheroid", row, tolerance=1e-9, samples=n, guard=False) for n in (2, 801))
    assert sparse.attrs["steps"] == dense.attrs["steps"]
    if name not in ("dop853-compiled", "vern9"):
        assert sparse.attrs["force_evaluations"] == dense.attrs["force_evaluations"]
    np.testing.assert_array_equal(sparse["axis"][-1], dense["axis"][-1])
    error = symtop.errors(dense)["axis"].values
    assert error.max() < (10.0 if name in PAIRS else 3.0) * error[-1] < 1e-6
