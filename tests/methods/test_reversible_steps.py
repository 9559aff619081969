"""Verlet steps that can be retraced: order, the way back, energy over long runs, passages of a pole, bad input."""

import math

import numpy as np
import pytest

import symtop
from symtop.core.jit import compile_kernel
from symtop.measure.accuracy import error_table
from symtop.measure.conservation import trend
from symtop.measure.order import power_law
from symtop.methods.splitting import reversible
from symtop.methods.splitting.reversible import Reversible
from symtop.model import charts
from symtop.model.scenes import closed_form, grazing
from symtop.model.top import effective_force, effective_potential

METHOD = symtop.integrator("stormer-verlet-reversible")
SOLVER = METHOD.solvers["angles"]


def run(scene, h, marks, solver=SOLVER):
    return solver(scene.top, scene.start, symtop.Plan.steps(h, np.asarray(marks)))


def energies(scene, states):
    """p^2/2 I1 + V of states in angles."""
    par, _ = symtop.on_angles(scene.top, scene.start)
    return 0.5 * states[:, 1] ** 2 / par.I1 + effective_potential(states[:, 0], par.north, par.south, par.I1, par.mgl)


@pytest.mark.parametrize("name", ["spheroid", "goldstein"])
@pytest.mark.parametrize("quantity", ["attitude", "energy"])
def test_the_error_falls_with_the_square_of_the_step(name, quantity):
    scene = symtop.scene(name)
    steps = list(scene.nutation_period / np.geomspace(300, 5000, 7))
    table = error_table(scene, METHOD, steps, 8.0, observe="attitude")
    error, bound = table[quantity].values, table[f"{quantity}_bound"].values
    fit = power_law(table["step_size"].values, error, error > 10.0 * bound)
    assert fit.used.sum() >= 5
    assert fit.slope == pytest.approx(2.0, abs=0.02)


def by_hand(scene, eps, steps, k):
    """Grid points (t, theta, p_theta) of the scheme as it stands in the papers, in plain Python."""
    par, (theta, p, *_) = symtop.on_angles(scene.top, scene.start)
    pull = lambda: -k * math.cos(theta) / math.sin(theta) * p / par.I1
    t, rho, points = 0.0, math.sin(theta) ** -k + 0.5 * eps * pull(), []
    for _ in range(steps):
        h = eps / rho
        p -= 0.5 * h * effective_force(theta, par.north, par.south, par.I1, par.mgl)[0]
        theta += h * p / par.I1
        p -= 0.5 * h * effective_force(theta, par.north, par.south, par.I1, par.mgl)[0]
        t, rho = t + h, rho + eps * pull()
        points.append((t, theta, p))
    return np.array(points)


@pytest.mark.parametrize("k", [1.0, 2.0])
def test_the_grid_is_that_of_the_formulas(k):
    scene, eps = grazing(0.1), 0.02
    points = by_hand(scene, eps, 400, k)
    plan = symtop.Plan.steps(eps, [1])._replace(times=points[:, 0])
    result = Reversible(k)(scene.top, scene.start, plan)
    assert points[:, 1].min() < 0.15
    assert result.states[:, :2] == pytest.approx(points[:, 1:], rel=1e-10)
    assert np.abs(Reversible(3.0 - k)(scene.top, scene.start, plan).states[:, :2] - points[:, 1:]).max() > 1e-6


def test_samples_and_blocks_move_no_step(monkeypatch):
    scene, h = symtop.scene("goldstein"), 0.05
    sparse, dense = run(scene, h, [400, 800]), run(scene, h, np.arange(801))
    assert np.array_equal(sparse.states, dense.states[[400, 800]])
    assert dense.states[0] == pytest.approx(symtop.on_angles(scene.top, scene.start)[1], abs=0.0)
    for result in (sparse, dense):
        assert (result.force_evaluations, result.newton_iterations) == (result.steps, 0)
    assert dense.steps == sparse.steps + 798  # the start costs nothing
    scene = symtop.scene("grazing")
    expected = run(scene, 0.02, [50, 200])
    monkeypatch.setattr(reversible, "BLOCK", 7)
    parts = run(scene, 0.02, [50, 200])
    assert np.array_equal(expected.states, parts.states)
    assert expected.steps == parts.steps > 200


def read_off(scene, eps, marks):
    """The same steps with h = eps sin(theta_n), which nothing retraces: states, and those of the way back.

    States (theta, p_theta) after `marks` steps, and where as many steps with p_theta turned round end.
    """
    par, (theta, p, *_) = symtop.on_angles(scene.top, scene.start)
    states, last = _read_off(tuple(par), theta, p, eps, np.asarray(marks))
    back, _ = _read_off(tuple(par), *last * (1.0, -1.0), eps, np.asarray(marks[-1:]))
    return states, back[-1] * (1.0, -1.0)


@compile_kernel
def _read_off(par, theta, p, eps, marks):
    I1, _, mgl, _, north, south = par
    states, count = np.empty((len(marks), 2)), 0
    for j in range(len(marks)):
        while count < marks[j]:
            h = eps * np.sin(theta)
            p -= 0.5 * h * effective_force(theta, north, south, I1, mgl)[0]
            theta += h * p / I1
            p -= 0.5 * h * effective_force(theta, north, south, I1, mgl)[0]
            count += 1
        states[j] = theta, p
    return states, states[-1]


@pytest.mark.parametrize("scene", [symtop.scene("goldstein"), grazing(0.01)], ids=lambda s: s.name)
def test_the_way_back_has_the_same_steps(scene):
    _, state = symtop.on_angles(scene.top, scene.start)
    round_trip = SOLVER.onward(scene.top, scene.start, (0.01,) * 500 + (-0.01,) * 500)
    outward = SOLVER.onward(scene.top, scene.start, (0.01,) * 500)
    assert np.abs(outward.states[0] - state).max() > 0.1
    assert round_trip.states[0] == pytest.approx(state, abs=1e-11)
    assert round_trip.steps > outward.steps + 500
    assert np.abs(read_off(scene, 0.01, [500])[1] - state[:2]).max() > 1e-6


def test_momenta_stay_and_the_energy_is_bounded_where_that_of_steps_read_off_drifts():
    for name in ("spheroid", "goldstein", "grazing"):
        scene = symtop.scene(name)
        result, momenta = run(scene, 0.003, np.arange(0, 100_001, 500)), scene.top.momenta(scene.start)
        for values, first in ((result.p_phi, momenta.p_phi), (result.p_psi, momenta.p_psi)):
            assert np.abs(values / first - 1.0).max() < 1e-12
    scene, eps = grazing(0.1), 0.05
    marks = np.arange(0, 400_001, 200)
    result = run(scene, eps, marks)
    assert result.outcome == "ok"
    errors = energies(scene, result.states) - energies(scene, result.states)[0]
    drift = energies(scene, read_off(scene, eps, marks)[0])
    drift -= drift[0]
    assert np.abs(errors).max() < 1.1 * np.abs(errors[:200]).max()
    assert abs(trend(marks, errors).rise) < 0.01 * np.abs(errors).max()
    assert trend(marks, drift).rise > 100.0 * np.abs(errors).max()


def forces_for(scene, method, error):
    """The least force evaluations from which on finer steps keep the axis within that error, over one nutation."""
    form, forces = closed_form(scene), 0
    for h in scene.nutation_period * np.geomspace(0.05, 1e-7, 300):
        data = symtop.simulate(scene, method, step_size=h, horizon=scene.nutation_period, samples=101, observe="axis",
                               guard=False)  # fmt: skip
        gap = charts.axis_distance(data["axis"].values, form.axis(data["time"].values)).max()
        if not gap < error:
            forces = 0
        elif not forces:
            forces = data.attrs["force_evaluations"]
        elif gap < error / 4.0:
            return forces
    raise AssertionError(method)


def test_close_to_a_pole_it_needs_fewer_forces_than_equal_steps_and_more_than_a_chart_without_pole():
    rows, by_gap = ("stormer-verlet", "stormer-verlet-reversible", "strang[axis]"), {}
    for gap in (1e-2, 1e-3):
        by_gap[gap] = plain, reversible, strang = [forces_for(grazing(gap), name, 1e-3) for name in rows]
        assert strang < reversible < plain / 3.0
    assert by_gap[1e-3][0] > 7.0 * by_gap[1e-2][0]
    assert by_gap[1e-3][1] < 2.0 * by_gap[1e-2][1]


def test_runs_that_fail_say_how(monkeypatch):
    onto_the_pole = run(grazing(0.0), 0.1, [0, 40])
    assert onto_the_pole.outcome == "left_chart"
    too_large = run(grazing(1e-3), 1.0, [0, 4])
    assert (too_large.outcome, run(grazing(1e-3), 0.1, [0, 40]).outcome) == ("not_finite", "ok")
    monkeypatch.setattr(reversible, "STEPS", 50)
    too_long = run(grazing(1e-6), 1.0 / 3.0, [0, 1, 6])
    assert (too_long.outcome, too_long.steps) == ("out_of_budget", 50)
    for result in (onto_the_pole, too_large, too_long):
        assert 0.0 < result.reached < 4.0
        assert np.isfinite(result.states[0]).all()
        assert np.isnan([*result.states[-1], result.p_phi[-1]]).all()
    assert np.isfinite(too_long.states[1]).all()


def test_a_budget_ends_a_run_whose_steps_become_too_many_alone_and_as_a_member():
    scene, setting = grazing(1e-4), {"step_size": 0.05, "horizon": 4.0, "samples": 5}
    needed = symtop.simulate(scene, METHOD, **setting, guard=False).attrs["steps"]
    for budget, outcome, steps in ((needed, "ok", needed), (300.5, "out_of_budget", 301), (100, "out_of_budget", 100)):
        attrs = symtop.simulate(scene, METHOD, **setting, guard=False, budget=budget).attrs
        member = symtop.ensemble([scene], METHOD, **setting, budget=budget, quiet=True).isel(member=0)
        assert (attrs["outcome"], attrs["steps"]) == (str(member.outcome.values), int(member.steps)) == (outcome, steps)
    symtop.simulate(scene, METHOD, **setting, guard=(sentences := []).append, budget=100)
    assert "expect the run to be stopped at t = " in sentences[0]
