"""Newton for the stages of a Gauss step: the solution that NumPy finds, where sweeps find none; and its limits."""

import math

import numpy as np
import pytest

import symtop
from symtop.methods.framework.space import field_axis, frame_to_attitude, on_axis, on_frame
from symtop.methods.runge_kutta.gauss import STAGES, gauss_rule, march_axis, march_frame
from symtop.model import charts

ONE = np.array([1])


def jacobian(par, y):
    """Of the field of (e, L), by central differences, which are exact for a quadratic field but for rounding."""
    columns = []
    for m in range(6):
        unit = np.eye(6)[m]
        columns.append(np.subtract(field_axis(par, y + unit), field_axis(par, y - unit)) / 2.0)
    return np.array(columns).T


def newton_step(par, stages, y, h):
    """One step by Newton on all 6 s increments, from zero increments, and the size of the last correction."""
    mu, b = gauss_rule(stages)[:2]
    parts, change = np.zeros((stages, 6)), math.inf
    for _ in range(30):
        places = y + mu @ parts
        defect = np.array([h * b[i] * np.array(field_axis(par, places[i])) - parts[i] for i in range(stages)])
        system = np.eye(6 * stages)
        for i in range(stages):
            system[6 * i : 6 * i + 6] -= h * b[i] * np.kron(mu[i], jacobian(par, places[i]))
        fix = np.linalg.solve(system, defect.ravel()).reshape(stages, 6)
        parts, change = parts + fix, np.abs(fix).max()
        if change < 1e-13:
            break
    return y + parts.sum(axis=0), change


def sweep_step(par, stages, y, h, sweeps=100):
    """One step by sweeps from h b_i f(y), and the size of the last correction."""
    mu, b = gauss_rule(stages)[:2]
    parts = np.outer(h * b, field_axis(par, y))
    change = math.inf
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(sweeps):
            last = parts.copy()
            for i in range(stages):
                parts[i] = h * b[i] * np.array(field_axis(par, y + mu[i] @ parts))
            change = np.abs(parts - last).max()
    return y + parts.sum(axis=0), change


def started(scene, phase):
    """Numbers of the top, state and the step at so many h omega."""
    scene = symtop.scene(scene)
    par, state = on_axis(scene.top, scene.start)
    return par, np.array(state), phase * scene.nutation_period / (2.0 * math.pi)


@pytest.mark.parametrize("scene", ["goldstein", "cusp"])
@pytest.mark.parametrize("stages", STAGES)
def test_a_step_is_what_newton_finds_and_sweeps_do_not(stages, scene):
    par, y, h = started(scene, 0.3)
    after = march_axis(par, gauss_rule(stages), tuple(y), h, ONE).states[0]
    for solve in (newton_step, sweep_step):  # at a small step both, and they agree
        solved, change = solve(par, stages, y, h)
        assert change < 1e-13
        np.testing.assert_allclose(after, solved, rtol=0, atol=1e-13)
    for phase in (5.0, 8.0):
        par, y, h = started(scene, phase)
        done = march_axis(par, gauss_rule(stages), tuple(y), h, ONE)
        solved, change = newton_step(par, stages, y, h)
        assert done.outcome == 0
        assert change < 1e-13
        np.testing.assert_allclose(done.states[0], solved, rtol=0, atol=1e-12 * np.abs(solved).max())
    par, y, h = started(scene, 10.0)
    assert not sweep_step(par, stages, y, h)[1] < 1e3  # diverges


def test_a_sweep_ends_at_its_own_limit_and_the_step_goes_on():
    """In `steady-fast` sweeps of one stage contract up to h omega = 1.9; the step there and beyond is one function."""
    scene = symtop.scene("steady-fast")
    omega = scene.top.nutation_frequency(scene.top.momenta(scene.start))
    par, state = on_axis(scene.top, scene.start)
    y = np.array(state) + 1e-3
    assert sweep_step(par, 1, y, 1.6 / omega, 400)[1] < 1e-12
    assert not sweep_step(par, 1, y, 2.2 / omega, 400)[1] < 1e-2
    for phase in np.linspace(1.2, 2.4, 49):
        done = march_axis(par, gauss_rule(1), tuple(y), phase / omega, ONE)
        np.testing.assert_allclose(done.states[0], newton_step(par, 1, y, phase / omega)[0], rtol=0, atol=1e-13)


def test_a_step_beyond_newtons_reach_is_found_by_growing_it():
    par, y, h = started("spheroid", 10.0)

    def constants(z):
        return z[:3] @ z[:3], z[:3] @ z[3:], z[5], z[3:] @ z[3:] + 2.0 * par.I1 * par.mgl * z[2]

    for stages in STAGES:
        done = march_axis(par, gauss_rule(stages), tuple(y), h, ONE)
        assert done.outcome == 0
        assert done.work > 20
        assert constants(done.states[0]) == pytest.approx(constants(y), rel=1e-13)


@pytest.mark.parametrize("stages", STAGES)
def test_the_frame_stays_orthonormal_and_follows_its_axis(stages):
    """At large steps a' = L x a / I1 is solved too: the frame's axis is that of the run on (e, L)."""
    scene = symtop.scene("goldstein")
    par, state = on_frame(scene.top, scene.start)
    marks = np.arange(0, 201, 20)
    for phase in (2.0, 5.0, 10.0):
        h = phase * scene.nutation_period / (2.0 * math.pi)
        done = march_frame(par, gauss_rule(stages), state, h, marks)
        e, across = done.states[:, :3], done.states[:, 6:]
        assert done.outcome == 0
        assert np.abs(np.sum(e * across, axis=1)).max() < 1e-13
        assert np.abs(np.sum(across * across, axis=1) - 1.0).max() < 1e-13
        alone = march_axis(*on_axis(scene.top, scene.start)[:1], gauss_rule(stages), state[:6], h, marks[:2])
        np.testing.assert_allclose(done.states[1, :6], alone.states[1], rtol=0, atol=1e-9)
        quaternion = frame_to_attitude(par, h * marks, done.states)[:, :4]
        assert charts.axis_distance(charts.axis_from_quaternion(quaternion), e).max() < 1e-13


def test_iterations_are_counted_and_each_is_an_evaluation_a_stage():
    for order in (2, 4, 12):
        h = 5.0 * symtop.scene("cusp").nutation_period / (2.0 * math.pi)
        run = symtop.simulate("cusp", f"gauss-{order}", step_size=h, horizon=100 * h, observe="axis", guard=False)
        assert run.attrs["force_evaluations"] == run.attrs["newton_iterations"] * order // 2
        assert run.attrs["newton_iterations"] < 105 * run.attrs["steps"]
