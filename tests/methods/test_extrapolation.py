"""Extrapolation: the order of each line of its table, variable order, samples, blocks, and failures."""

from dataclasses import replace

import numpy as np
import pytest

import symtop
from symtop.core.jit import compile_kernel
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import integrator
from symtop.methods.runge_kutta import extrapolation
from symtop.model.scenes import closed_form

SPHEROID = symtop.scene("spheroid")


def one_step(h, lines):
    """A step of h with so many lines, as a sample at the fraction h of a step of one."""
    form = FORMULATIONS["axis"]
    par, state = form.prepare(SPHEROID.top, SPHEROID.start)
    method = extrapolation.method(form.field)
    memory = np.zeros((extrapolation.LAST + 1, 6))
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


@pytest.mark.parametrize("chart", list(FORMULATIONS))
def test_errors_follow_the_tolerance_and_orders_rise_with_it(chart):
    runs = [
        symtop.simulate(SPHEROID, f"extrapolation[{chart}]", tolerance=tolerance, samples=161, guard=False)
        for tolerance in (1e-4, 1e-8, 1e-12)
    ]
    errors = [float(symtop.errors(run)["axis"].max()) for run in runs]
    assert [run.attrs["outcome"] for run in runs] == ["ok"] * 3
    assert errors[2] < 1e-8 < errors[1] < 1e-4
    assert errors[1] < errors[0] / 100.0
    evaluations = [run.attrs["force_evaluations"] / run.attrs["steps"] for run in runs]
    assert evaluations[0] < evaluations[1] < evaluations[2]  # a step
    assert runs[2].attrs["steps"] < 2.5 * runs[0].attrs["steps"]  # of one order: hundreds of times as many


def test_runs_in_pieces_have_the_same_bits_and_budgets_end_them():
    solver = integrator("extrapolation").solvers["axis"]
    plan = Plan.until(np.linspace(0.0, 8.0, 33), 1e-9)
    whole, pieces = (chosen(SPHEROID.top, SPHEROID.start, plan) for chosen in (solver, replace(solver, block=1)))
    np.testing.assert_array_equal(whole.states, pieces.states)
    assert whole[3:] == pieces[3:]
    short = solver(SPHEROID.top, SPHEROID.start, plan._replace(budget=500))
    assert short.outcome == "out_of_budget"
    assert 0.0 < short.reached < 8.0


def test_samples_take_no_part_in_the_steps():
    few, many = (
        symtop.simulate(SPHEROID, "extrapolation[axis]", tolerance=1e-9, samples=n, guard=False) for n in (2, 501)
    )
    for count in ("steps", "force_evaluations"):
        assert few.attrs[count] == many.attrs[count]
    np.testing.assert_array_equal(few["axis"][-1], many["axis"][-1])
    error = symtop.errors(many)["axis"].values
    assert error.max() < 3.0 * error[-1]
