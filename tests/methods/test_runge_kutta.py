"""Explicit Runge-Kutta methods, the compiled Dormand-Prince pair, SciPy's and heyoka's solvers."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

import symtop
from symtop.methods.framework.angles import field_angles, with_rates
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.plan import Plan
from symtop.methods.library.scipy_ivp import RightHandSide
from symtop.methods.runge_kutta import pairs
from symtop.methods.runge_kutta.explicit import LOOPS, runge_kutta
from symtop.methods.runge_kutta.pair_tables import DORMAND_PRINCE
from symtop.model.scenes import closed_form
from symtop.run.simulation import make_plan
from tests.conftest import random_scenes
from tests.judging.blind.right import CLASSICAL, explicit, rk4
from tests.measure.test_order import series

KUTTA_A, KUTTA_B, _ = CLASSICAL


@pytest.mark.parametrize(("a", "b", "order"), [
    (KUTTA_A, KUTTA_B, 4), (((),), (1.0,), 1), (((0.0, 0.0), (0.5, 0.0)), (0.0, 1.0), 2),
    (((), (1 / 3,), (0.0, 2 / 3)), (1 / 4, 0.0, 3 / 4), 3),
])  # fmt: skip
def test_a_step_of_a_users_tableau_is_the_definition_and_has_its_order(a, b, order):
    scene, method, h = symtop.scene("spheroid"), runge_kutta("mine", a, b), 0.01
    par, state = with_rates(scene.top, scene.start)
    expected = explicit(a, b, list(map(sum, a)))(lambda t, y: np.array(field_angles(par, y)), 0.0, np.array(state), h)
    result = LOOPS["angles"](par, method.solvers["angles"].rule, state, h, np.array([1])).states[0]
    np.testing.assert_allclose(result, expected, rtol=2e-15)
    assert series(method, "axis").order == order


@pytest.mark.parametrize(("a", "b", "c", "words"), [
    (KUTTA_A, (1 / 6, 1 / 3, 1 / 3, 1 / 3), None, "b must sum to 1"),
    (KUTTA_A, KUTTA_B, (0.0, 0.5, 0.5, 0.9), "c must be the row sums"),
    (KUTTA_A[:3], KUTTA_B, None, "a must have one row for each"), (((0.5,),), (1.0,), None, "row 1 of a"),
    (((), (0.5, 0.1, 0.0), (0.0, 0.5, 0.5)), (0.2, 0.3, 0.5), None, "row 2 of a"),
    (np.zeros((2, 3)), np.array([0.5, 0.5]), None, "row 1 of a must have 0 entries"),
    (np.array([[0.0, 1.0], [1.0, 0.0]]), (0.5, 0.5), None, "row 1 of a must have 0 entries"),
    (np.zeros((3, 3)), (0.5, 0.5), None, "a must have one row for each of the 2"),
    (np.zeros((2, 2, 2)), (0.5, 0.5), None, "an entry of a must be a finite number"),
])  # fmt: skip
def test_bad_tableaux_are_refused(a, b, c, words):
    with pytest.raises(symtop.SymtopError, match=words):
        runge_kutta("bad", a, b, c)


ADAPTIVE = ("rk45", "rk45-compiled", "dop853", "lsoda", "radau")


@pytest.mark.parametrize("chart", list(FORMULATIONS))
@pytest.mark.parametrize("name", ["spheroid", "goldstein", "bruls-cardona-arnold"])
def test_the_right_hand_side_is_the_derivative_of_the_true_motion(name, chart):
    """Central differences of the closed form, extrapolated to order 4, at a moment when nothing vanishes."""
    scene, form = symtop.scene(name), FORMULATIONS[chart]
    par, _ = form.prepare(scene.top, scene.start)
    moment, h = 0.37 * scene.nutation_period, 3e-4 * scene.nutation_period
    motion = np.array(closed_form(scene)(moment + h * np.array([-2.0, -1.0, 0.0, 1.0, 2.0]))).T  # angles and rates
    states = [form.prepare(scene.top, symtop.Angles(*map(float, values)))[1] for values in motion]
    back2, back, middle, ahead, ahead2 = np.array(states)
    slope = (8.0 * (ahead - back) - (ahead2 - back2)) / (12.0 * h)
    np.testing.assert_allclose(form.field(par, tuple(middle)), slope, atol=1e-7 * np.max(np.abs(slope)))
    state = symtop.field(chart, scene.top).state(symtop.Angles(*map(float, motion[2])))
    theirs = [symtop.field(chart, scene.top, compiled=compiled)(0.0, state) for compiled in (False, True)]
    np.testing.assert_allclose(theirs, [slope] * 2, atol=1e-7 * np.max(np.abs(slope)))


@pytest.mark.parametrize("chart", list(FORMULATIONS))
@pytest.mark.parametrize("name", ADAPTIVE)
def test_adaptive_methods_follow_their_tolerance_in_every_chart(name, chart):
    scene, errors = symtop.scene("spheroid"), []
    for tolerance in (1e-5, 1e-8):
        run = symtop.simulate(scene, f"{name}[{chart}]", tolerance=tolerance, horizon=3.0, samples=61, guard=False)
        assert [run.attrs[key] for key in ("outcome", "chart", "newton_iterations")] == ["ok", chart, 0]
        errors.append(float(symtop.errors(run)["axis"].max()))
    assert errors[1] < min(3e-6, errors[0] / 30.0)


@pytest.mark.parametrize("name", ["rk4", *ADAPTIVE])
def test_p_phi_stays_where_it_is_linear_in_the_state_and_is_lost_in_angles(name):
    scene = symtop.scene("spheroid")
    control, change = symtop.integrator(name).given(0.02 if name == "rk4" else 1e-5), {}
    for chart in FORMULATIONS:
        run = symtop.simulate(scene, f"{name}[{chart}]", **control, horizon=8.0, samples=81, guard=False)
        change[chart] = {p: float(np.ptp(run[p].values)) / scene.momentum_scale for p in ("p_phi", "p_psi")}
    assert change["axis"]["p_phi"] <= 2e-16
    assert change["attitude"]["p_phi"] <= 2e-16
    assert 1e-8 < change["angles"]["p_phi"] < 1e-3  # the negative control
    spins = [row["p_psi"] for row in change.values()]
    assert 1e-9 < min(spins) <= max(spins) < 1e-3  # L.e is not linear, and nothing is copied


@pytest.mark.parametrize("chart", list(FORMULATIONS))
def test_a_run_is_the_loop_that_anybody_writes_around_the_field(chart):
    scene, h, steps = symtop.scene("goldstein"), 0.03, 40
    f = symtop.field(chart, scene)
    y = f.state(scene.start)
    for _ in range(steps):
        y = rk4(f, 0.0, y, h)
    ours = symtop.integrator("rk4").solvers[chart](scene.top, scene.start, Plan.steps(h, [steps])).states[-1]
    ours, y = (ours[[0, 2, 3]], y[:3]) if chart == "angles" else (ours, y)  # angles are shown with p_theta
    np.testing.assert_allclose(ours, y, rtol=0.0, atol=2e-13)


@pytest.mark.parametrize("chart", list(FORMULATIONS))
def test_numpy_and_compiled_are_one_function(chart):
    for scene in random_scenes(5, seed=3):
        plain, fast = (symtop.field(chart, scene.top, compiled=compiled) for compiled in (False, True))
        y = plain.state(scene.start)
        np.testing.assert_allclose(plain(0.0, y), fast(1.0, y), rtol=1e-14, atol=1e-14)
        np.testing.assert_array_equal(fast.kernel(*fast.parameters, y), fast(0.0, y))
        assert y.shape == ((7,) if chart == "attitude" else (6,))


def test_the_attitude_takes_its_spin_from_the_state_and_a_pole_is_nan_in_angles_alone():
    """A field of one top serves every start."""
    scene = symtop.scene("spheroid")
    f = symtop.field("attitude", scene)
    assert f.top == symtop.field("attitude", "spheroid").top == scene.top
    for spin in (0.0, 3.0, 80.0):
        start = symtop.Angles(theta=0.7, psi_dot=spin)
        y, h = f.state(start), 1e-6
        assert np.abs(symtop.ClosedForm(scene.top, start).quaternion([h])[0] - (y[:4] + h * f(0.0, y)[:4])).max() < 1e-8
    top, start = symtop.SymmetricTop(2.0, 1.0, 1.0), symtop.Angles(theta=0.0, theta_dot=1.0, psi_dot=2.0)
    for f in (symtop.field("axis", top), symtop.field("attitude", top)):
        assert np.isfinite(f(0.0, f.state(start))).all()
    assert math.isnan(symtop.field("angles", top)(0.0, np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]))[4])


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("chart", list(FORMULATIONS))
def test_a_state_of_another_shape_is_refused(chart, compiled):
    """Compiled code does not look where an array ends."""
    size, f = 6 + (chart == "attitude"), symtop.field(chart, symtop.SymmetricTop(1.0, 0.5, 1.0), compiled=compiled)
    for shape in ((3,), (13 - size,), (size, 3), (size, 1), (0,), ()):
        with pytest.raises(symtop.SymtopError) as info:
            f(0.0, np.ones(shape))
        assert str(info.value) == f"y must have the shape ({size},) in the chart {chart}, not {shape}"
    for value in ("abcdef", np.array([*"abcdef"]), None, [1.0, 2.0], [[1.0], [2.0, 3.0]]):
        with pytest.raises(symtop.SymtopError, match="y must"):
            f(0.0, value)
    y = f.state(symtop.Angles(1.0, psi_dot=2.0))
    for state in (list(y), np.repeat(y, 2)[::2], y.astype(np.longdouble), y.astype(">f8")):
        np.testing.assert_array_equal(pickle.loads(pickle.dumps(f))(0.0, state), f(0.0, y))


def _walk(scene, tolerance, pair=pairs.RK45, **limits):
    plan, _ = make_plan(scene, symtop.integrator("rk45-compiled"), None, tolerance, horizon=8.0, samples=301)
    return plan, replace(pairs.solver(FORMULATIONS["angles"], pair, pair.rows), **limits)(scene.top, scene.start, plan)


@pytest.mark.parametrize("name", ["rk45", "dop853", "lsoda", "radau"])
def test_scipys_solvers_are_solve_ivp(name):
    from scipy.integrate import solve_ivp

    scene = symtop.scene("spheroid")
    run = symtop.simulate(scene, name, tolerance=1e-6, horizon=2.0, samples=41)
    par, start = with_rates(scene.top, scene.start)
    rhs, method = RightHandSide(field_angles, par), symtop.integrator(name).summary.split()[1]
    solution = solve_ivp(rhs, (0.0, 2.0), start, method, run["time"].values, rtol=1e-6, atol=1e-6)
    for angle, values in zip(("theta", "phi", "psi"), solution.y, strict=False):
        np.testing.assert_array_equal(run[angle], values)
    assert run.attrs["force_evaluations"] == rhs.calls  # more than nfev where a Jacobian is made of differences
    assert rhs.calls >= solution.nfev
    if name in ("rk45", "dop853"):
        assert rhs.calls == solution.nfev


def test_a_tableau_may_be_made_of_arrays_and_taylor_runs_in_three_precisions():
    heun = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([0.5, 0.5]), np.array([0.0, 1.0])
    rules = [runge_kutta("heun", *tableau).solvers["axis"].rule for tableau in (heun, [part.tolist() for part in heun])]
    assert rules[0] == rules[1]
    assert runge_kutta("heun", [np.array([]), np.array([1.0])], heun[1]).solvers["axis"].rule == rules[0]
    pytest.importorskip("heyoka")
    names, result = ("taylor", "taylor-longdouble", "taylor-quad"), {}
    for name, tolerance in (*((name, None) for name in names), (names[2], 1e-8)):
        run = symtop.simulate("spheroid", name, tolerance=tolerance, horizon=4.0)
        assert (run.attrs["outcome"], run.attrs["chart"], run["quaternion"].dtype) == ("ok", "attitude", np.float64)
        result[name, tolerance] = float(symtop.errors(run)["attitude"].max())
    double, *beyond, loose = result.values()
    assert double < 5e-14  # beyond double what is left is the rounding of the samples and of the closed form
    assert max(beyond) < 5e-15
    assert loose > 1e-12  # the tolerance reaches heyoka


def test_extended_precision_is_not_lost_on_the_way():
    hy = pytest.importorskip("heyoka")
    from symtop.methods.taylor.heyoka import propagate
    from symtop.model.charts import space_momenta

    scene = symtop.scene("spheroid")
    flight = propagate("axis", "quad", 1e-35, scene.top, scene.start, np.array([0.0, 4.0]))
    assert flight.states.dtype == np.dtype(hy.real128)
    p_phi, p_psi = space_momenta("axis", flight.states)
    for constant in (p_phi, p_psi, np.sum(flight.states[:, :3] * flight.states[:, :3], axis=-1)):
        assert abs(float(constant[1] - constant[0])) < 1e-30


def test_adaptive_outcomes_and_tolerances_that_stop_at_the_arithmetic():
    scene, pair = symtop.scene("spheroid"), pairs.RK45
    for error in (math.inf, math.nan):
        hopeless = _walk(scene, 1e-6, pair._replace(table=DORMAND_PRINCE._replace(error=(error,) * 7)))[1]
        assert (hopeless.outcome, hopeless.steps) == ("step_too_small", 0)
    plan, run = _walk(scene, 1e-9, block=500, most=1000)
    assert run.outcome == "out_of_budget"
    assert 0.0 < run.reached < 8.0
    assert np.array_equal(np.isfinite(run.states[:, 0]), plan.times <= run.reached)
    pytest.importorskip("heyoka")
    symtop.integrator("taylor-quad").check_tolerance(1e-36)
    for name, tolerance in (("taylor", 1e-20), ("taylor-quad", 1e-40), ("rk45-compiled", 1e-15), ("radau", 1e-15)):
        with pytest.raises(symtop.SymtopError, match="tolerance"):
            symtop.integrator(name).check_tolerance(tolerance)
