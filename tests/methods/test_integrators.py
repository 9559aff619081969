"""Discrete Lagrangians: exact values, orders, structure, failures; a wrong twin beside each right one."""

import math

import numpy as np
import pytest

import symtop
from symtop.measure.accuracy import error_table
from symtop.measure.order import order
from symtop.measure.step_map import one_step, return_miss
from symtop.methods.framework.angles import on_angles
from symtop.methods.framework.loop import FixedStep
from symtop.methods.framework.registry import Integrator
from symtop.methods.lagrangian.discrete_lagrangian import Quadrature, forces, march, node_sums, opening
from symtop.methods.lagrangian.unreduced import unreduced
from tests.conftest import random_scenes


def fitted(scene_name, method, coarsest, column):
    """The fitted order over ten steps, from so many a nutation to 160 times as many."""
    scene = symtop.scene(scene_name)
    steps = [scene.nutation_period / (coarsest * 10 ** (2.2 * k / 9)) for k in range(10)]
    table = error_table(scene, method, steps, 8.0, observe="attitude")
    return order(table["step_size"], table[column], table["attitude_bound"], 2 * math.pi / scene.nutation_period)


@pytest.mark.parametrize(("name", "constant"), [("stormer-verlet", 35.3), ("midpoint", 137.3), ("trapezoidal", 127.9)])
def test_error_constants_are_the_known_ones(name, constant):
    """Attitude error C h^2 at t = 8 on spheroid, to 3 %."""
    fit = fitted("spheroid", symtop.integrator(name), 60.37, "attitude_end")
    assert fit.constant == pytest.approx(constant, rel=0.03)


def test_starting_from_q0_plus_h_v0_costs_an_order():
    """The negative control of every order test: the start that a public package uses."""

    def begun_wrongly(top, start):
        par, state = on_angles(top, start)
        rule = Quadrature((0.5,), (1.0,))
        h = begun_wrongly.h
        # p1 = D2 Ld(q0, q0 + h v0) moved back by a step is the momentum that this start amounts to
        d = h * start.theta_dot
        sums = node_sums(rule, start.theta, d, opening(None, rule, start.theta))
        force = forces(par, sums)
        return par, (state[0], par.I1 * d / h + h * force.W0, *state[2:])

    def solve(top, start, plan):
        begun_wrongly.h = plan.step_size
        return FixedStep(march, Quadrature((0.5,), (1.0,)), begun_wrongly, 1, implicit=True)(top, start, plan)

    wrong = Integrator(name="badly-started-midpoint", family="other", summary="", solvers={"angles": solve})
    fit = fitted("goldstein", wrong, 200.37, "attitude")
    assert fit.slope == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize("form", [lambda reduced: reduced, unreduced], ids=["reduced", "unreduced"])
def test_a_rule_that_is_not_symmetric_misses_the_start(form):
    lopsided = form(symtop.discrete_lagrangian("left", (0.0, 2.0 / 3.0), (0.25, 0.75)))
    assert lopsided.symmetric is False
    scene = random_scenes(1, seed=5)[0]
    assert return_miss(one_step(lopsided, "angles", scene, 0.02), scene.start) > 5e-9  # of the largest coordinate


def test_midpoint_is_the_implicit_midpoint_rule_of_the_reduced_hamiltonian_to_rounding():
    """theta1 - theta0 = h p_mid/I1, p1 - p0 = -h V'(theta_mid); a loose stop rule shows as an error."""
    scene = symtop.scene("spheroid")
    par, state = on_angles(scene.top, scene.start)
    h, marks = 0.02, np.arange(0, 40)

    def residual(tolerance):
        done = march(par, Quadrature((0.5,), (1.0,), tolerance), state, h, marks)
        theta, p = done.states[:, 0], done.states[:, 1]
        middle, momenta = 0.5 * (theta[1:] + theta[:-1]), scene.top.momenta(scene.start)
        assert np.diff(theta) == pytest.approx(h * 0.5 * (p[1:] + p[:-1]) / scene.top.I1, abs=5e-16)
        return np.max(np.abs(np.diff(p) + h * scene.top.potential_slope(middle, momenta)))

    assert residual(1e-8) < 5e-14
    assert residual(1e3) > 1e-9
