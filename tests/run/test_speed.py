"""Speed as ratios within one run: what a step of each basic kernel costs in steps of Stormer-Verlet."""

import numpy as np
import pytest

import symtop
from symtop.measure.timing import timings
from symtop.methods.plan import Plan

STEPS = 20_000


@pytest.mark.slow
def test_implicit_kernels_cost_at_most_three_verlet_steps():
    where = symtop.scene("spheroid")
    h = where.nutation_period / 400.37
    plan = Plan(np.array([STEPS * h]), STEPS * h, h, np.array([STEPS]), np.nan)
    names = ("stormer-verlet", "midpoint", "trapezoidal")
    solvers = [symtop.integrator(name).solvers["angles"] for name in names]
    calls = [lambda solve=solve: solve(where.top, where.start, plan) for solve in solvers]
    found = timings(calls, batches=60, batch=1e-3)
    verlet, *others = (timing.best for timing in found)
    for other in others:
        assert other / verlet < 3.0


@pytest.mark.slow
def test_simulate_adds_less_than_two_milliseconds():
    where = symtop.scene("spheroid")
    plan = Plan(np.array([8.0]), 8.0, 0.01, np.array([800]), np.nan)
    solve = symtop.integrator("midpoint").solvers["angles"]
    whole, kernel = timings(
        [lambda: symtop.simulate(where, "midpoint", step_size=0.01), lambda: solve(where.top, where.start, plan)]
    )
    assert whole.best - kernel.best < 2e-3


def test_memory_and_results_do_not_depend_on_how_the_steps_are_batched(monkeypatch):
    """A run that returns to Python every few steps gives the same bits as one that does not."""
    from symtop.methods import loop as drive

    where = symtop.scene("spheroid")
    whole = symtop.simulate(where, "midpoint", step_size=0.01, samples=11)
    monkeypatch.setattr(drive, "BLOCK", 7)
    assert symtop.simulate(where, "midpoint", step_size=0.01, samples=11).equals(whole)
