"""Parts of an error: shape, and lags of the nutation and the precession."""

import math

import numpy as np
import pytest

import symtop
from symtop.measure.phase import phase, split
from symtop.model import charts
from symtop.model.scenes import closed_form
from symtop.run.reference.truth import reference
from symtop.run.simulation import integrate
from symtop.run.trajectory import Trajectory


def shift(name, periods=20.0, early=0.0, faster=0.0, turned=0.0, turning=0.0, lifted=0.0, samples=301):
    """The true motion, early, too fast, turned about the vertical, turning, or lifted: a run whose errors are known."""
    scene = symtop.scene(name)
    times = np.linspace(0.0, periods * scene.nutation_period, samples)
    motion = closed_form(scene)(times * (1.0 + faster) + early)
    columns = {"theta": motion.theta + lifted,
               "phi": motion.phi + turned + turning * times,
               "p_theta": scene.top.I1 * motion.theta_dot}  # fmt: skip
    return scene, Trajectory(times, **columns), reference(scene, times, precision="closed-form")


def largest_turn(run, parts):
    """The largest precession lag, rad."""
    return np.abs(np.sin(run.theta) * parts.turn).max()


@pytest.mark.parametrize("name", ["spheroid", "cusp", "hairer-lubich-wanner", "bruls-cardona-arnold"])
def test_a_motion_that_is_early_and_turned_has_the_right_shape(name):
    scene, run, truth = shift(name, early=0.013, turned=-0.2)
    parts, rates = split(scene, run), phase(scene, run, truth)
    assert parts.shape.max() < 1e-13
    assert np.abs(parts.lag).max() == pytest.approx(0.013, rel=1e-9)
    assert largest_turn(run, parts) == pytest.approx(0.2 * np.sin(run.theta).max(), rel=1e-9)
    assert rates["nutation_period"] < 1e-12
    assert rates["precession_rate"] < 1e-10


def test_lags_of_more_than_a_turn_and_wrong_frequencies_are_found():
    scene, run, _ = shift("goldstein", early=0.3, faster=0.1, turned=9.0)
    parts = split(scene, run)
    assert np.max(np.abs(parts.lag - (0.3 + 0.1 * run.time))) < 1e-11
    assert np.max(np.abs(parts.turn - 9.0)) < 1e-10
    assert parts.shape.max() < 1e-12
    parts = phase(*shift("spheroid", faster=1e-5))
    assert parts["nutation_period"] == pytest.approx(1e-5, rel=1e-4)
    assert parts["precession_rate"] == pytest.approx(1e-5, rel=1e-4)  # it turns faster by as much
    parts = phase(*shift("spheroid", faster=0.01))
    assert parts["nutation_period"] == pytest.approx(1.0 - 1.0 / 1.01, rel=1e-6)  # of the period
    form = closed_form(symtop.scene("spheroid"))
    turning = -1e-5 * form.phi_per_period / form.nutation_period
    assert phase(*shift("spheroid", faster=1e-5, turning=turning))["precession_rate"] < 1e-8  # turned back by as much
    parts = phase(*shift("spheroid", turning=1e-5))
    assert parts["nutation_period"] < 1e-14
    assert parts["precession_rate"] == pytest.approx(1e-5 * form.nutation_period / form.phi_per_period, rel=1e-9)


def test_another_shape_a_pole_passed_otherwise_and_a_steady_precession_are_not_late():
    scene, run, truth = shift("spheroid", lifted=1e-4)
    parts = split(scene, run)
    lag = np.abs(parts.lag).max()
    assert 3e-5 < parts.shape.max() < 2e-4
    assert lag * 2.0 * math.pi / scene.nutation_period < 1e-3
    assert phase(scene, run, truth)["nutation_period"] < 3.0 * lag / run.time[-1]  # a bounded lag
    scene = symtop.scene("bruls-cardona-arnold")
    period = scene.nutation_period
    run = integrate(scene, "strang", step_size=period / 40.37, horizon=400.0 * period, samples=331, observe="axis")
    truth = reference(scene, run.time, precision="closed-form")
    assert largest_turn(run, split(scene, run)) < 2.0 * charts.axis_distance(run.axis, truth["axis"].values).max()
    scene, run, truth = shift("steady", turned=1e-6)
    parts = split(scene, run)
    assert np.isnan(parts.lag).all()
    assert math.isnan(phase(scene, run, truth)["nutation_period"])
    assert parts.shape.max() < 1e-14
    assert largest_turn(run, parts) == pytest.approx(1e-6 * math.sin(scene.start.theta), rel=1e-8)


@pytest.mark.parametrize("name", ["spheroid", "fast"])
def test_frequencies_of_the_exact_motion_are_wrong_by_no_more_than_their_bounds(name):
    scene = symtop.scene(name)
    run = integrate(scene, "exact", horizon=10.0 * scene.nutation_period, samples=331, observe="axis")
    parts = phase(scene, run, reference(scene, run.time, precision="closed-form"))
    assert parts["nutation_period"] <= parts["nutation_period_bound"]
    assert parts["precession_rate"] <= parts["precession_rate_bound"]
    assert max(parts["nutation_period_bound"], parts["precession_rate_bound"]) < 1e-9
    failed = phase(scene, run._replace(outcome="left_chart"), reference(scene, run.time, precision="closed-form"))
    assert all(math.isnan(value) for value in failed.values())
