"""The Galerkin integrator of order 4 against an independent solution of its own discrete Lagrangian."""

import numpy as np
import pytest
from scipy.optimize import root

import symtop
from symtop.measure.step_map import StepMap, angles_at, one_step, return_miss, symplectic_defect
from symtop.methods.framework.angles import on_angles
from symtop.methods.lagrangian import galerkin as kernel
from tests.conftest import random_scenes

SCENES = ("spheroid", "goldstein")
NAME = "galerkin-simpson"
SIMPSON = (1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0)


def derivatives(top, theta, rate):
    """dL/dq' and dL/dq of the Lagrangian in three angles."""
    s, c = np.sin(theta), np.cos(theta)
    spin = top.I3 * (rate[2] + rate[1] * c)
    momentum = np.array([top.I1 * rate[0], top.I1 * rate[1] * s * s + spin * c, spin])
    force = np.array([s * (top.I1 * rate[1] ** 2 * c - spin * rate[1] + top.mgl), 0.0, 0.0])
    return momentum, force


def independent_step(top, point, h, weights=SIMPSON):
    """One step from the stationary parabola itself: six equations in (qm, q1), nothing eliminated, SciPy's solver."""
    q0, p0 = point[:3], point[3:]
    # rates at the nodes are linear in q0, qm, q1: these are their coefficients, times h
    shape = np.array([[-3.0, 4.0, -1.0], [-1.0, 0.0, 1.0], [1.0, -4.0, 3.0]])

    def slopes(unknown):
        q = np.stack([q0, unknown[:3], unknown[3:]])
        parts = [derivatives(top, q[i, 0], shape[i] @ q / h) for i in range(3)]
        return [
            h * weights[j] * parts[j][1] + sum(weights[i] * shape[i, j] * parts[i][0] for i in range(3))
            for j in range(3)
        ]

    def equations(unknown):
        first, middle, _ = slopes(unknown)
        return np.concatenate([p0 + first, middle])

    at = angles_at(top, point)
    rate = np.array([at.theta_dot, at.phi_dot, at.psi_dot])
    solution = root(equations, np.concatenate([q0 + 0.5 * h * rate, q0 + h * rate]), tol=1e-14)
    assert np.max(np.abs(solution.fun)) < 1e-12
    return np.concatenate([solution.x[3:], slopes(solution.x)[2]])


@pytest.mark.parametrize("scene", random_scenes(8, seed=21), ids=lambda s: s.name)
def test_one_step_is_the_stationary_parabola(scene):
    """The reduction to two unknowns, and all six results of a step, against six equations solved as they stand."""
    for h in (0.1, 0.02):
        step = StepMap(symtop.integrator(NAME), "angles", scene.top, 1.0, h)
        point = step.point(scene.start)
        assert np.max(np.abs(step.image(point) - independent_step(scene.top, point, h))) < 2e-12


def test_other_weights_are_another_method():
    scene = random_scenes(1, seed=21)[0]
    step = StepMap(symtop.integrator(NAME), "angles", scene.top, 1.0, 0.1)
    point = step.point(scene.start)
    wrong = independent_step(scene.top, point, 0.1, weights=(0.17, 0.66, 0.17))
    assert not np.max(np.abs(step.image(point) - wrong)) < 2e-12


def test_a_step_without_its_last_force_is_neither_symplectic_nor_symmetric():
    """The negative control of both: p_theta moved by the forces of the first two nodes only."""
    good = symtop.integrator(NAME)

    def solve(top, start, plan):
        run = good.solvers["angles"](top, start, plan)
        states = run.states.copy()
        states[:, 1] += plan.step_size / 6.0 * top.potential_slope(states[:, 0], top.momenta(start))
        return run._replace(states=states)

    wrong = symtop.Integrator(name="wrong", family="other", summary="", solvers={"angles": solve})
    scene = random_scenes(1, seed=22)[0]
    assert symplectic_defect(one_step(wrong, "angles", scene, 0.02), scene.start).size > 1e-5
    assert return_miss(one_step(wrong, "angles", scene, 0.02), scene.start) > 1e-5


@pytest.mark.parametrize("scene", random_scenes(4, seed=25), ids=lambda s: s.name)
def test_every_derivative_of_a_trial_is_right(scene):
    """The analytic Jacobian against central differences; one that is off by a thousandth is seen."""
    par, (theta, *_) = on_angles(scene.top, scene.start)
    start, m, d, e = kernel._node(par, theta), 0.03, 0.07, 1e-5

    def trial(shift_m, shift_1):
        return kernel._evaluate(par, start, theta + m + shift_m, theta + d + shift_1)

    def agree(factor):
        here = trial(0.0, 0.0)
        by_m = [(a.value - b.value) / (2 * e) for a, b in zip(trial(e, 0.0), trial(-e, 0.0), strict=True)]
        by_1 = [(a.value - b.value) / (2 * e) for a, b in zip(trial(0.0, e), trial(0.0, -e), strict=True)]
        pairs = [(jet.by_m, value) for jet, value in zip(here, by_m, strict=True)]
        pairs += [(jet.by_1, value) for jet, value in zip(here, by_1, strict=True)]
        scale = max(abs(value) for _, value in pairs)
        return max(abs(factor * exact - value) for exact, value in pairs) < 1e-6 * scale

    assert agree(1.0)
    assert not agree(1.001)


@pytest.mark.parametrize("scene_name", SCENES)
def test_the_iteration_ends_soon(scene_name):
    """At 200 steps a nutation the cubic predictor leaves two iterations; at 2000, one."""
    scene = symtop.scene(scene_name)
    for resolution, most in ((200.0, 2.1), (2000.0, 1.3)):
        run = symtop.simulate(scene, NAME, step_size=scene.nutation_period / resolution)
        assert run.attrs["newton_iterations"] / run.attrs["steps"] < most


def test_near_a_pole_nothing_cancels():
    """theta swings through 1e-4 of the pole: the momenta of every step are still those of the start."""
    top = symtop.SymmetricTop(1.0, 1.0, 1.0)
    point = (1e-4, 0.0, 0.0, 1e-4, 1.0 + 1e-8, 1.0)
    scene = symtop.Scene("grazing", top, angles_at(top, point), 1.0)
    run = symtop.simulate(scene, NAME, step_size=0.01, samples=101)
    assert run.attrs["outcome"] == "ok"
    momenta = top.momenta(scene.start)
    drift = np.abs((run["p_phi"] - run["p_psi"]).values - momenta.north)
    assert np.max(drift) < 4e-16
