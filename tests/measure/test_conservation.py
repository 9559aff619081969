"""A million steps: what the discrete methods keep; and momenta that the increments of a run in angles have."""

import dataclasses

import numpy as np
import pytest

import symtop
from symtop.measure.conservation import from_increments, growth, momenta_of, residuals, trend
from symtop.methods.framework.angles import on_angles
from symtop.methods.framework.plan import Plan
from symtop.methods.lagrangian import discrete_lagrangian, galerkin
from symtop.model.scenes import closed_form
from symtop.run.simulation import integrate
from tests.conftest import random_scenes

SPHEROID = symtop.scene("spheroid")
DISCRETE = {"midpoint": 1e-11, "trapezoidal": 1e-11, "stormer-verlet": 1e-11, "galerkin-simpson": 1e-13}  # of momenta


@pytest.mark.parametrize("name", DISCRETE)
def test_a_million_steps_keep_recomputed_momenta_and_bound_the_energy_without_a_trend(name):
    run = integrate(SPHEROID, name, step_size=0.01, horizon=10_000.0, samples=4001, observe="nutation")
    assert run.steps == 1_000_000
    changes = residuals(SPHEROID, run)
    assert not any(trend(run.time, changes[quantity]).significant for quantity in ("p_phi", "p_psi", "energy"))
    assert max(np.max(np.abs(changes[quantity])) for quantity in ("p_phi", "p_psi")) < DISCRETE[name]
    assert abs(growth(run.time, changes["energy"]).slope) < 0.05
    # of second order in the step: bounded, not small; or of fourth
    assert (1e-11 if name == "galerkin-simpson" else 1e-6) < np.max(np.abs(changes["energy"])) < 1e-3


@pytest.mark.parametrize(
    ("family", "rule"),
    [(discrete_lagrangian, discrete_lagrangian.Quadrature((0.5,), (1.0,))), (galerkin, galerkin.Iteration())],
    ids=["midpoint", "galerkin"],
)
def test_momenta_are_recomputed_and_not_copied(family, rule):
    """A phi that moves 1e-10 too far shows in p_phi."""
    par, state = on_angles(SPHEROID.top, SPHEROID.start)
    step, *_ = family.increment(par, rule, state, family.begin(par, rule, state, 0.01), 0.01)
    right = family.observe(par, rule, state, step, 0.01)
    assert right == pytest.approx(SPHEROID.top.momenta(SPHEROID.start)[:2], rel=1e-14)
    moved = (step[0], step[1], step[2] + 1e-10, step[3])
    assert abs(family.observe(par, rule, state, moved, 0.01)[0] - right[0]) > 1e-9


PLAN = Plan.steps(SPHEROID.nutation_period / 118.02, [0, 40_000])


@pytest.mark.parametrize("scene", random_scenes(3, seed=77), ids=lambda s: s.name)
def test_nine_states_of_the_motion_have_its_momenta(scene):
    h = scene.time_scale() / 118.0
    motion = closed_form(scene)(np.arange(9) * h)
    states = np.stack([motion.theta, scene.top.I1 * motion.theta_dot, motion.phi, motion.psi], axis=-1)
    momenta = scene.top.momenta(scene.start)
    p_phi, p_psi = momenta_of(scene.top, states[None], h)
    assert abs(p_phi[0] - momenta.p_phi) < 1e-7 * scene.momentum_scale
    assert abs(p_psi[0] - momenta.p_psi) < 1e-7 * scene.momentum_scale


@pytest.mark.parametrize("name", ["midpoint", "stormer-verlet", "rk4", "trapezoidal"])
def test_an_honest_run_reports_the_momenta_of_its_increments(name):
    assert from_increments(symtop.integrator(name), SPHEROID, PLAN).size == 0.0


def test_a_run_that_hides_its_drift_is_seen_and_one_of_few_steps_says_nothing():
    rk4 = symtop.integrator("rk4")

    def solve(top, start, plan):
        run = rk4.solvers["angles"](top, start, plan)
        momenta = top.momenta(start)
        same = np.ones(plan.times.size)
        return run._replace(p_phi=momenta.p_phi * same, p_psi=momenta.p_psi * same)

    difference = from_increments(dataclasses.replace(rk4, name="copied", solvers={"angles": solve}), SPHEROID, PLAN)
    assert difference.size > 100.0 * difference.floor
    assert from_increments(symtop.integrator("rk4"), SPHEROID, Plan.steps(0.01, [0, 500])) is None
