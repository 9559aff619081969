"""The angles chart ends at its poles: a step beyond them ends a run, however its sines are computed."""

import math
import random

import numpy as np
import pytest

import symtop
from symtop.methods.framework.angles import chart_outcome, on_angles
from symtop.methods.framework.loop import inside
from symtop.methods.framework.plan import LEFT_CHART, NOT_FINITE, OK
from symtop.methods.lagrangian import discrete_lagrangian, galerkin
from symtop.model.top import Angles, SymmetricTop

IN_ANGLES = [
    (name, method) for name, method in symtop.integrators().items() if inside(method.solvers.get("angles")) is not None
]


def violent(count, seed):
    """Random tops with steps that turn theta by up to a hundred radians, or by 1e20."""
    draw = random.Random(seed)
    for k in range(count):
        top = SymmetricTop(1.0, draw.uniform(0.05, 1.95), draw.uniform(-3.0, 3.0))
        theta = draw.choice([draw.uniform(0.0, math.pi), 10.0 ** draw.uniform(-6.0, -1.0)])
        at = Angles(theta, theta_dot=draw.gauss(0.0, 2.0), phi_dot=draw.gauss(0.0, 3.0), psi_dot=draw.gauss(0.0, 30.0))
        yield top, at, 10.0 ** (draw.uniform(-3.0, 1.5) if k % 8 else draw.uniform(10.0, 20.0))


@pytest.mark.parametrize("theta", [0.0, -1e-300, math.pi, 4.0, 1e300])
def test_the_chart_ends_at_its_poles(theta):
    assert chart_outcome(theta) == LEFT_CHART
    assert chart_outcome(1.0) == chart_outcome(5e-324) == chart_outcome(math.nextafter(math.pi, 0.0)) == OK
    assert chart_outcome(math.nan) == chart_outcome(math.inf) == chart_outcome(-math.inf) == NOT_FINITE


@pytest.mark.parametrize("family", [discrete_lagrangian, galerkin], ids=lambda family: family.__name__)
def test_an_iteration_that_wanders_off_ends_as_with_the_sines_of_the_library(family):
    """One step in Python, whose sines are the library's, and compiled; where roots compete, a rounding may decide."""
    name = {discrete_lagrangian: "trapezoidal", galerkin: "galerkin-simpson"}[family]
    loop, rule = family.march, inside(symtop.integrator(name).solvers["angles"]).rule
    ends = []
    for top, at, h in violent(400, seed=3):
        par, state = on_angles(top, at)
        interpreted = family.increment(par, rule, state, family.begin(par, rule, state, h), h)[3]
        ends.append((interpreted, loop(par, rule, state, h, np.array([1])).outcome))
    assert {OK, LEFT_CHART} < {outcome for outcome, _ in ends}  # and not converged
    assert sum(one != other for one, other in ends) <= 4


@pytest.mark.parametrize("name", [name for name, _ in IN_ANGLES])
def test_a_nan_stays_one(name):
    solver = inside(symtop.integrator(name).solvers["angles"])
    scene = symtop.scene("spheroid")
    par, rule, state = solver.setup(scene.top, scene.start, 0.01)
    assert solver.loop(par, rule, state, 0.01, np.array([3])).outcome == OK
    broken = solver.loop(par, rule, (math.nan, *state[1:]), 0.01, np.array([3]))
    assert broken.outcome != OK
    assert broken.steps == 0
