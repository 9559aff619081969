"""Momenta that the increments of a run in angles have: those of the motion, and a drift that a run hides."""

import dataclasses

import numpy as np
import pytest

import symtop
from symtop.measure.conservation import from_increments, momenta_of
from symtop.methods.framework.plan import Plan
from symtop.model.scenes import closed_form
from tests.conftest import random_scenes

SPHEROID = symtop.scene("spheroid")
PLAN = Plan.steps(SPHEROID.nutation_period / 118.02, [0, 40_000])


@pytest.mark.parametrize("where", random_scenes(3, seed=77), ids=lambda s: s.name)
def test_nine_states_of_the_motion_have_its_momenta(where):
    h = where.time_scale() / 118.0
    motion = closed_form(where)(np.arange(9) * h)
    states = np.stack([motion.theta, where.top.I1 * motion.theta_dot, motion.phi, motion.psi], axis=-1)
    momenta = where.top.momenta(where.start)
    p_phi, p_psi = momenta_of(where.top, states[None], h)
    assert abs(p_phi[0] - momenta.p_phi) < 1e-7 * where.momentum_scale
    assert abs(p_psi[0] - momenta.p_psi) < 1e-7 * where.momentum_scale


@pytest.mark.parametrize("name", ["midpoint", "stormer-verlet", "rk4", "trapezoidal"])
def test_an_honest_run_reports_the_momenta_of_its_increments(name):
    assert from_increments(symtop.integrator(name), SPHEROID, PLAN).size == 0.0


def test_a_run_that_hides_its_drift_is_seen():
    rk4 = symtop.integrator("rk4")

    def solve(top, start, plan):
        run = rk4.solvers["angles"](top, start, plan)
        kept = top.momenta(start)
        same = np.ones(plan.times.size)
        return run._replace(p_phi=kept.p_phi * same, p_psi=kept.p_psi * same)

    found = from_increments(dataclasses.replace(rk4, name="copied", solvers={"angles": solve}), SPHEROID, PLAN)
    assert found.size > 100.0 * found.floor


def test_a_run_of_few_steps_says_nothing():
    assert from_increments(symtop.integrator("rk4"), SPHEROID, Plan.steps(0.01, [0, 500])) is None
