"""Own solvers that choose their steps, of many members: the bits of runs alone, budgets, and members that fail."""

from dataclasses import replace

import numpy as np
import pytest

import symtop
from symtop.methods.framework.adaptive import Adaptive
from symtop.methods.framework.lanes import members_of
from symtop.methods.framework.plan import OUTCOMES, Plan
from symtop.methods.framework.registry import variants
from symtop.methods.runge_kutta import pairs
from symtop.run.ensemble.chunks import nutation_periods
from symtop.run.ensemble.inputs import read_members

SOLVERS = {
    row.name: row.solvers[row.charts()[0]] for row in variants() if isinstance(row.solvers[row.charts()[0]], Adaptive)
}
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


@pytest.mark.parametrize(
    ("name", "budget"), [*((name, None) for name in SOLVERS), *((name, BUDGET) for name in ONE_CHART.values())]
)
def test_members_have_the_bits_of_runs_alone(name, budget):
    numbers, tolerance, times, counts = members()
    if "angles" in name:
        numbers[5, 3] = 0.0  # on a pole
    done, reached = SOLVERS[name].many(numbers, tolerance, times, counts, budget)
    for i, (top, start) in enumerate(members_of(numbers)):
        if "angles" in name and i == 5:
            assert (OUTCOMES[done.outcome[i]], done.steps[i], reached[i]) == ("left_chart", 0, 0.0)
            assert np.isnan(done.states[i]).all()
            continue
        run = SOLVERS[name](top, start, Plan.until(times[i, : counts[i]], tolerance[i], budget))
        np.testing.assert_array_equal(done.states[i, : counts[i]], run.states)
        np.testing.assert_array_equal(done.momenta[i, : counts[i]].T, (run.p_phi, run.p_psi))
        assert np.isnan(done.states[i, counts[i] :]).all()
        assert (done.steps[i], done.work[i], OUTCOMES[done.outcome[i]], reached[i]) == (*run[3:5], *run[6:])
    outcomes = {OUTCOMES[k] for k in done.outcome}
    assert ("out_of_budget" in outcomes) == (budget is not None)
    assert "ok" in outcomes


@pytest.mark.parametrize("row", [row for row in variants() if row.control == "tolerance"], ids=lambda row: row.name)
def test_an_infinite_budget_ends_no_run(row):
    """Of a Taylor method it was no number of steps: an OverflowError."""
    scene, times = symtop.scene("goldstein"), np.linspace(0.0, 0.5, 3)
    free, bound = (row.solvers[row.charts()[0]](scene.top, scene.start, Plan.until(times, 1e-6, budget))
                   for budget in (None, np.inf))  # fmt: skip
    assert free.outcome == bound.outcome == "ok"
    np.testing.assert_array_equal(free.states, bound.states)


@pytest.mark.parametrize("name", SOLVERS)
def test_a_budget_is_passed_by_less_than_a_step(name):
    numbers, tolerance, times, _ = members(20)
    done, reached = SOLVERS[name].many(numbers, tolerance, times, np.full(20, COUNTS), BUDGET)
    ended = done.outcome == OUTCOMES.index("out_of_budget")
    assert ended.any()
    assert (done.work[ended] < BUDGET + LARGEST.get(name.split("[")[0], 48.0)).all()
    assert (reached[ended] < times[ended, -1]).all()


def test_a_run_in_pieces_has_the_bits_of_a_run_in_one():
    assert (len(OWN), len(SOLVERS)) == (9, 23)  # none is left out
    numbers, tolerance, times, counts = members(12)
    for solver in SOLVERS.values():
        whole, parts = (one.many(numbers, tolerance, times, counts)[0] for one in (solver, replace(solver, block=9)))
        np.testing.assert_array_equal(whole.states, parts.states)
        np.testing.assert_array_equal(whole.work, parts.work)


@pytest.mark.parametrize("name", ["rk45", *OWN])
def test_a_pole_ends_a_run_in_angles_alone(name):
    """Falling through the pole exactly: without rotation theta' only changes sign in the angles chart."""
    top, start = symtop.SymmetricTop(1.0, 1.0, 1.0), symtop.Angles(1.0, theta_dot=-2.0)
    pole = symtop.Scene("pole", top, start, 5.0, observes="axis")
    ends = ("left_chart",) if name in ("rk45", *PAIRS) else ("left_chart", "step_too_small")
    for chart in symtop.integrator(name).charts():
        tolerance = 1e-3 if chart == "angles" else 1e-8
        run = symtop.simulate(pole, f"{name}[{chart}]", tolerance=tolerance, guard=False)
        assert run.attrs["outcome"] in (ends if chart == "angles" else ("ok",))
        assert chart == "angles" or float(symtop.errors(run)["axis"].max()) < 1e-5


@pytest.mark.parametrize("name", OWN)
def test_samples_inside_steps_are_as_good_as_their_ends_and_change_no_step(name):
    """They cost evaluations in the pairs of order 8 and 9 alone (`test_pairs` counts them)."""
    row = f"{name}[axis]" if "axis" in symtop.integrator(name).charts() else name
    few, many = (symtop.simulate("spheroid", row, tolerance=1e-9, samples=n, guard=False) for n in (2, 801))
    assert few.attrs["steps"] == many.attrs["steps"]
    if name not in ("dop853-compiled", "vern9"):
        assert few.attrs["force_evaluations"] == many.attrs["force_evaluations"]
    np.testing.assert_array_equal(few["axis"][-1], many["axis"][-1])
    error = symtop.errors(many)["axis"].values
    assert error.max() < (10.0 if name in PAIRS else 3.0) * error[-1] < 1e-6
