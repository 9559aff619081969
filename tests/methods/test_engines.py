"""The maps of physics engines: formulas, reference values, what they follow and where rounding stops them."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import symtop
from symtop.measure.settings import compared, smallest_charts
from symtop.methods.framework import registry
from symtop.methods.framework.calling import solve
from symtop.model import charts
from symtop.model.top import flat
from tests.conftest import defer, random_scenes
from tests.methods import engine_formulas
from tests.methods.test_lanes import assert_runs_alone

GOLDSTEIN = symtop.scene("goldstein")
AXIS_ERROR = {  # rad, the largest at a hundred samples of 10 s with h = 0.025
    "no-gyro": 1.5673, "no-gyro-linear": 1.5716, "mujoco-euler": 0.61079, "mujoco-implicit": 0.38563,
    "bullet": 0.20959, "jolt": 0.57414, "physx": 0.29945, "rapier": 0.049537, "ode": 2.0531, "lammps-rigid": 3.7530e-3,
    "no-squish": 8.6827e-4, "yade": 0.14976, "fincham": 3.6370e-3, "spiral": 2.2302e-3, "mujoco3-rk4": 4.4663e-3,
    "rkmk4": 8.1624e-6, "jsbsim-buss2": 0.045686, "jsbsim-default": 0.97945,
}  # fmt: skip
ENERGY = {  # relative to |E| + mgl, after 1000 s with h = 0.025
    "mujoco-implicit": -0.22, "bullet": -0.073, "jolt": 2.1, "physx": -0.49, "rapier": -0.40, "ode": -0.15,
    "lammps-rigid": 0.0104, "yade": 2.8, "spiral": -2.3e-4, "rkmk4": -8.8e-6, "jsbsim-buss2": 0.046,
}  # fmt: skip
ROUNDED = tuple(name.removesuffix("-float32") for name in registry.engines() if name.endswith("-float32"))


def axis_error(row, steps, scene=GOLDSTEIN, horizon=10.0, against=None):
    """The largest angle (rad) between a run's axis and the true one, or that of another closed form."""
    run = symtop.simulate(scene, row, step_size=horizon / steps, horizon=horizon, samples=101, guard=False,
                          observe="axis" if row.endswith("[axis]") else "attitude")  # fmt: skip
    if against is None:
        return float(symtop.errors(run)["axis"].max())
    return float(charts.axis_distance(run["axis"].values, against.axis(run["time"].values)).max())


def one_step(name, scene, h, chart="attitude"):
    """The state of a chart after one step."""
    return solve(symtop.integrator(name), chart, scene.top, scene.start, symtop.Plan.steps(h, [1])).states[-1]


@pytest.mark.quick
@pytest.mark.parametrize(("name", "value"), AXIS_ERROR.items())
def test_the_reference_values(name, value):
    """Five digits tell an exponential from a linear rotation: the latter has 1.5716 without a gyroscopic term."""
    for chart in symtop.integrator(name).charts():
        assert axis_error(f"{name}[{chart}]", 400) == pytest.approx(value, rel=6e-5)


@pytest.mark.parametrize(("name", "value"), ENERGY.items())
def test_the_energy_after_a_thousand_seconds(name, value):
    run = symtop.simulate(GOLDSTEIN, name, step_size=0.025, horizon=1000.0, samples=40001, guard=False)
    energy = run["energy"].values
    assert (energy[-200:].mean() - energy[0]) / (abs(energy[0]) + GOLDSTEIN.top.mgl) == pytest.approx(value, rel=0.03)


@pytest.mark.parametrize(("name", "time"), [("mujoco-euler", 91.5), ("jsbsim-default", 84.7)])
def test_explicit_maps_fly_apart(name, time):
    run = symtop.simulate(GOLDSTEIN, name, step_size=0.025, horizon=120.0, samples=4801, guard=False)
    energy = np.nan_to_num(run["energy"].values, nan=np.inf)
    assert run["time"].values[np.argmax(np.abs(energy) > 1e6)] == pytest.approx(time, abs=0.2)


def test_without_the_gyroscopic_term_an_engine_follows_the_spherical_top_and_conservation_does_not_show_it():
    """Agreement of order h with the closed form of the top with I3 := I1, none with its own."""
    top = GOLDSTEIN.top
    spherical = symtop.ClosedForm(symtop.SymmetricTop(top.I1, top.I1, top.mgl), GOLDSTEIN.start)
    counts = (400, 800, 1600, 3200, 6400)
    errors = [axis_error("no-gyro[axis]", steps, against=spherical) for steps in counts]
    assert axis_error("no-gyro[axis]", 4000, against=spherical) == pytest.approx(3.6e-4, rel=0.02)
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 1.0, atol=0.05)
    assert min(axis_error("no-gyro[axis]", steps) for steps in counts) > 1.5
    assert min(axis_error("mujoco-euler[axis]", steps, against=spherical) for steps in counts) > 1.0
    run = symtop.simulate(GOLDSTEIN, "no-gyro", step_size=0.0025, horizon=100.0, samples=2001, guard=False)
    scale = abs(float(run["energy"][0])) + GOLDSTEIN.top.mgl
    assert float(abs(run["energy"] - run["energy"][0]).max()) < 1e-4 * scale
    assert float(abs(run["p_psi"] - run["p_psi"][0]).max()) < 1e-12
    assert float(symtop.errors(run)["axis"].max()) > 1.5
    wobble = float(abs(run["p_phi"] - run["p_phi"][0]).max()) / 5.0
    assert wobble == pytest.approx(0.10, abs=0.01)  # L_z alone shows it, and nobody looks


@pytest.mark.parametrize("name", [*ROUNDED, *defer(*(name for name in registry.engines() if name not in ROUNDED))])
def test_a_top_that_starts_at_rest_falls_and_a_free_one_stays(name):
    """Jolt, PhysX and rapier rescale a momentum to its length, and each asks first whether it has one."""
    for mgl in (1.0, 0.0):
        scene = symtop.Scene("rest", symtop.SymmetricTop(1.0, 0.5, mgl), symtop.Angles(1.0), 2.0)
        for chart in symtop.integrator(name).charts():
            observe = "axis" if chart == "axis" else "attitude"
            run = symtop.simulate(scene, f"{name}[{chart}]", step_size=0.005, observe=observe, samples=11, guard=False)
            assert run.attrs["outcome"] == "ok"
            assert float(symtop.errors(run)["axis"].max()) < (0.02 if mgl else 1e-6)


@pytest.mark.quick
@pytest.mark.parametrize("name", AXIS_ERROR)
def test_a_step_is_the_engines_formula_in_body_axes_and_a_turn_about_the_axis_changes_no_map_on_it(name):
    """Kernels on the axis, with equations solved by hand, against matrices in body axes: the same to rounding."""
    formula = getattr(engine_formulas, name.replace("-", "_"))
    for scene in (GOLDSTEIN, *random_scenes(6, seed=3)):
        top, h = scene.top, 0.013
        state = charts.space_state("attitude", top, scene.start)
        attitude, inertia = Rotation.from_quat(np.roll(state[:4], -1)), np.diag([top.I1, top.I1, top.I3])
        w = attitude.apply(np.linalg.solve(inertia, attitude.inv().apply(state[4:])))

        def tau(attitude, mgl=top.mgl):
            return mgl * np.cross([0.0, 0.0, 1.0], attitude.as_matrix()[:, 2])

        after, w = formula(attitude, w, h, inertia, tau)
        L, result = after.apply(inertia @ after.inv().apply(w)), one_step(name, scene, h)
        assert charts.attitude_distance(result[:4], np.roll(after.as_quat(), 1)) < 1e-13
        np.testing.assert_allclose(result[4:], L, rtol=0.0, atol=2e-14 * np.linalg.norm(L) + 1e-14)
        if "axis" in symtop.integrator(name).charts():
            np.testing.assert_allclose(one_step(name, scene, h, "axis"), [*after.as_matrix()[:, 2], *L],
                                       atol=2e-14 * (1.0 + np.linalg.norm(L)))  # fmt: skip
    quaternion = np.array([0.8, 0.4, -0.3, 0.2]) / math.sqrt(0.93)
    start, h = symtop.Attitude(tuple(quaternion), (0.7, -1.1, 2.0)), 0.013
    for moments in ((0.5, 0.9, 1.3), (1.3, 0.5, 0.9)):
        body = symtop.RigidBody(*moments, 1.7, (0.3, -0.2, 1.0))
        attitude, inertia = Rotation.from_quat(np.roll(quaternion, -1)), np.diag(body.moments)
        pull = lambda attitude, c=body.torque: np.cross([0.0, 0.0, 1.0], attitude.apply(c))
        after, w = formula(attitude, attitude.apply(start.omega_body), h, inertia, pull)
        result = solve(symtop.integrator(name), "body", body, start, symtop.Plan.steps(h, [1])).states[-1]
        assert charts.attitude_distance(result[:4], np.roll(after.as_quat(), 1)) < 1e-14
        np.testing.assert_allclose(result[4:], inertia @ after.inv().apply(w), rtol=0.0, atol=2e-14)
    # No-squish depends on where the transverse axes are put.
    spun = [dataclasses.replace(GOLDSTEIN, start=dataclasses.replace(GOLDSTEIN.start, psi=psi)) for psi in (0.0, 0.7)]
    axes = [charts.axis_from_quaternion(one_step(name, scene, 0.02)[:4]) for scene in spun]
    gap = np.abs(axes[0] - axes[1]).max()
    assert gap > 1e-8 if name == "no-squish" else gap < 1e-15
    assert ("axis" in symtop.integrator(name).charts()) is (name != "no-squish")


@pytest.mark.parametrize("name", ["jolt", "physx", "ode"])
def test_a_fast_top_ends_flat_where_the_length_of_L_is_all_that_is_kept(name):
    """922 steps a second at 100 rad/s, 8 s: more than half of the spin is gone."""
    fast = symtop.scene("fast")
    h = fast.nutation_period / 116

    def spin_left(method):
        run = symtop.simulate(fast, method, step_size=h, horizon=64 * 116 * h, samples=65, guard=False)
        return float(run["p_psi"][-1] / run["p_psi"][0])

    assert abs(spin_left(name)) < 0.5
    assert spin_left("strang") == pytest.approx(1.0, abs=1e-12)
    assert spin_left("bullet") == pytest.approx(1.0, abs=1e-12)  # it damps the wobble instead


@pytest.mark.parametrize("name", [
    "jsbsim-buss2[axis]", "jolt-float32[attitude]", "rapier[axis]", "no-squish[attitude]"])  # fmt: skip
def test_a_member_of_an_ensemble_has_the_bits_of_the_run_alone(name):
    numbers = np.array([flat(scene.top, scene.start) for scene in (GOLDSTEIN, *random_scenes(4, seed=5))])
    h, marks = np.linspace(0.01, 0.02, len(numbers)), np.tile([0, 30, 77], (len(numbers), 1))
    (solver,) = symtop.integrator(name).solvers.values()
    assert_runs_alone(solver, numbers, h, marks, solver.many(numbers, h, marks))


@pytest.mark.parametrize("name", ROUNDED)
def test_in_single_precision_a_step_is_the_same_but_for_rounding(name):
    exact, rounded = (one_step(key, GOLDSTEIN, 0.01) for key in (name, name + "-float32"))
    assert 1e-9 < np.abs(rounded - exact).max() / np.abs(exact).max() < 2e-6  # rapier rounds four times
    assert (rounded[:4] == rounded[:4].astype(np.float32)).all()
    assert (exact[:4] != exact[:4].astype(np.float32)).any()


@pytest.mark.parametrize(("name", "best", "error"), [
    ("jolt", 25_600, 5.4e-3), ("rapier", 6_400, 7.6e-3), ("physx", 204_800, 3.7e-4), ("bullet", 51_200, 2.0e-3),
])  # fmt: skip
def test_in_single_precision_there_is_a_best_step(name, best, error):
    """Error and step of the engines' own runs: the map meets the error within a factor of 2.5, and then gets worse."""
    counts = [best // 8, best, 32 * best if name != "bullet" else 64 * best]
    coarse, fine, finest = (axis_error(f"{name}{'-float32'}[attitude]", steps) for steps in counts)
    assert error / 2.5 < fine < min(2.5 * error, coarse)
    assert finest > 1.5 * fine
    if name == "rapier":  # the control: in double it goes on
        assert axis_error(f"{name}[attitude]", counts[2]) < 0.2 * finest


def test_comparisons_and_recommendations_leave_engines_out():
    engines = registry.engines()
    assert len(engines) == len(AXIS_ERROR) + len(ROUNDED)
    assert {entry.family for entry in engines.values()} == {"engine"}
    assert not set(engines) & set(registry.methods())
    assert set(engines) | set(registry.methods()) == set(symtop.integrators())
    for rows in (registry.variants(), compared("axis"), compared("attitude"), smallest_charts("nutation")):
        assert not {row.method for row in rows} & set(engines)
