"""What integrators cost: the forces of an attempt at a step, and memory that does not grow with the steps."""

import dataclasses
import math
import tracemalloc

import numpy as np
import pytest

import symtop
from symtop.judging.adapters.adapter import integrator
from symtop.judging.adapters.python_step import PythonStep
from symtop.judging.claims.constants import long_run
from symtop.judging.claims.subject import seconds_a_step
from symtop.methods.framework.registry import Integrator

SPHEROID = symtop.scene("spheroid")
STEP = SPHEROID.nutation_period / 118.02


def bytes_a_step(method: Integrator) -> float:
    """Bytes that a run keeps for each further step, by Python's own count of what NumPy and Python allocate."""
    few = 4000 if method.implementation == "compiled" else 200
    control = {"step_size": STEP} if method.control == "step_size" else {}
    if method.control == "tolerance" and method.default_tolerance is None:
        control = {"tolerance": 1e-6}
    peaks, steps = [], []
    for count in (few, few, 6 * few):  # whatever is made once is made in the first run
        tracemalloc.start()
        try:
            plan = {"horizon": count * STEP, "samples": 11, "observe": "axis", "guard": False}
            run = symtop.simulate(SPHEROID, method, **plan, **control)
            peaks.append(tracemalloc.get_traced_memory()[1])
            steps.append(int(run.attrs["steps"]))
        finally:
            tracemalloc.stop()
    return (peaks[2] - peaks[1]) / max(steps[2] - steps[1], 1)


# one of each loop: reduced chart, Newton, space frame, stages, two adaptive ones, SciPy's
@pytest.mark.parametrize("name", ["stormer-verlet", "midpoint", "strang", "gauss-4", "rk45-compiled", "taylor", "rk45"])
def test_the_memory_of_a_run_does_not_grow_with_its_steps(name):
    assert bytes_a_step(symtop.integrator(name)) < 8.0  # less than one number a step


def test_memory_that_grows_with_the_steps_is_seen():
    good, store = symtop.integrator("stormer-verlet"), []

    def hoard(top, start, plan):
        store.clear()
        store.append(np.zeros(4 * round(plan.horizon / plan.step_size)))
        return good.solvers["angles"](top, start, plan)

    assert 16.0 < bytes_a_step(dataclasses.replace(good, solvers={"angles": hoard})) < 48.0


def test_a_step_that_blows_up_has_the_time_of_its_finite_steps():
    """A run that stops at infinity is over at once, however many steps it was asked for."""

    def grows(f, t, y, h):
        return 2.0 * y + h * f(t, y)

    def euler(f, t, y, h):
        return y + h * f(t, y)

    seconds = [seconds_a_step(PythonStep(step, "axis"), SPHEROID) for step in (grows, euler)]
    assert 0.1 < seconds[0] / seconds[1] < 10.0


@pytest.mark.parametrize("quick", [True, False])
def test_finer_runs_after_one_that_fails_late_share_its_steps(quick):
    steps = []

    def fails(f, t, y, h):
        steps.append(h)
        return y * (math.nan if t > 20.0 * SPHEROID.nutation_period and h > 0.005 * SPHEROID.nutation_period else 1.0)

    method = integrator(PythonStep(fails, "axis"))
    run = long_run(method, SPHEROID, "axis", quick=quick, most=4000)
    assert run.outcome == "ok"
    assert (len(steps) < 6000) is quick
