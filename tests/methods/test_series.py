"""The own Taylor series, of this top and of any equations: coefficients, orders, the closed form, tolerance."""

import math

import numpy as np
import pytest
from numba import njit

import symtop
from symtop.core.jit import compile_kernel
from symtop.methods.framework.equations import FORMS
from symtop.methods.simd import Components
from symtop.methods.taylor import series_general
from symtop.methods.taylor.series import ORDERS, attitude_sum, axis_sum, order_for, series
from symtop.model import charts
from symtop.model.scenes import closed_form
from tests.slopes import assert_order

CHARTS = ("axis", "attitude")
ADAPTIVE = [(chart, symtop.integrator("series-adaptive")) for chart in CHARTS]


def gaps(chart, states, form, times):
    """Errors of states against the closed form, rad."""
    truth = form.quaternion(times)
    if chart == "axis":
        return charts.axis_distance(states[:, :3], charts.axis_from_quaternion(truth))
    return charts.attitude_distance(states[:, :4], truth)


def worst_gap(chart, method, scene, per_nutation, nutations=10.0):
    """Largest error of a run with a fixed step at eleven samples."""
    h = scene.nutation_period / per_nutation
    plan = symtop.Plan.steps(h, np.linspace(0, round(nutations * per_nutation), 11).astype(int))
    result = method.solvers[chart](scene.top, scene.start, plan)
    assert result.outcome == "ok"
    return gaps(chart, result.states, closed_form(scene), plan.times).max()


def called(function, *arguments):
    """What an intrinsic returns, which only compiled code can call."""
    return njit(lambda args: function(*args))(arguments)


@pytest.mark.parametrize(("of_order", "size"), [(axis_sum, 6), (attitude_sum, 7)])
def test_components_compute_what_vectors_compute(of_order, size):
    """To the last bit, as lanes need it; another order is another sum."""
    state = tuple(np.random.default_rng(2).normal(size=size).tolist())
    result = called(of_order(16, Components), state, 0.1, 0.2)
    assert result == called(of_order(16), state, 0.1, 0.2)
    assert result != called(of_order(12), state, 0.1, 0.2)


@pytest.mark.parametrize("order", ORDERS)
def test_the_sums_are_those_of_the_first_terms_of_the_equations_and_agree_on_the_axis(order):
    """The coefficients by the plain recurrence of e' = L x e/I1, L' = mgl z x e, in NumPy."""
    scene = symtop.scene("spheroid")
    h, (I1, mgl) = 0.2, (scene.top.I1, scene.top.mgl)
    state = charts.space_state("axis", scene.top, scene.start)
    e, L = [state[:3]], [state[3:]]
    for n in range(order + 1):
        term = sum(np.cross(L[k], e[n - k]) for k in range(n + 1))
        L.append(h * mgl * np.array([-e[n][1], e[n][0], 0.0]) / (n + 1))
        e.append(h / I1 * term / (n + 1))
    result = called(axis_sum(order), tuple(state.tolist()), h / I1, h * mgl)
    assert result[:3] == pytest.approx(sum(e[1 : order + 1]), rel=1e-11)
    assert result[3:5] == pytest.approx(sum(L[1 : order + 1])[:2], rel=1e-11)
    for n, square in ((order, result[5]), (order - 1, result[6])):
        assert math.sqrt(square) == pytest.approx(np.linalg.norm([*e[n - 1][:2], e[n][2]]), rel=1e-9)
    assert result[:3] != pytest.approx(sum(e[1:order]), rel=1e-10)
    scene = symtop.scene("hairer-lubich-wanner")
    h, (I1, mgl) = 0.02, (scene.top.I1, scene.top.mgl)
    state = charts.space_state("attitude", scene.top, scene.start)
    result = called(attitude_sum(order), tuple(state.tolist()), h / I1, h * mgl)
    axis = charts.space_state("axis", scene.top, scene.start)
    theirs = called(axis_sum(order), tuple(axis.tolist()), h / I1, h * mgl)
    quaternion = state[:4] + np.array(result[:4])
    assert charts.axis_from_quaternion(quaternion) == pytest.approx(axis[:3] + np.array(theirs[:3]), abs=1e-13)
    assert result[4:6] == pytest.approx(theirs[3:5], rel=1e-12)
    assert np.linalg.norm(quaternion) == pytest.approx(1.0, abs=1e-13)


@pytest.mark.parametrize("chart", CHARTS)
@pytest.mark.parametrize(("order", "window"), [(8, (14, 60)), (12, (9, 25)), (16, (7, 12)), (20, (6, 8))])
def test_the_error_of_a_step_falls_with_one_power_more_than_the_order(chart, order, window):
    scene, method = symtop.scene("spheroid"), series("trial", order)
    steps = scene.nutation_period / np.geomspace(*window, 9)
    runs = [method.solvers[chart](scene.top, scene.start, symtop.Plan.steps(h, [1])).states for h in steps]
    errors = [gaps(chart, state, closed_form(scene), np.array([h]))[0] for h, state in zip(steps, runs, strict=True)]
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(order + 1, abs=0.7)
    assert method.order == order


@pytest.mark.parametrize("chart", CHARTS)
@pytest.mark.parametrize("name", ["spheroid", "goldstein", "fast", "grazing", "sleeping-unstable"])
def test_long_runs_are_right_to_rounding_where_the_truncation_is_below_it(chart, name):
    scene = symtop.scene(name)
    per_nutation = 400.0 if name == "sleeping-unstable" else 25.0
    bound = 3e-9 if name == "sleeping-unstable" else 3e-12
    assert worst_gap(chart, series("trial", 20), scene, per_nutation, 100.0 if bound < 1e-10 else 10.0) < bound
    assert worst_gap(chart, series("trial", 8), scene, per_nutation / 4.0) > 1e-9


@pytest.mark.parametrize(("chart", "method"), ADAPTIVE)
@pytest.mark.parametrize("name", ["spheroid", "fast", "grazing", "sleeping", "separatrix", "steady"])
def test_the_error_follows_the_tolerance(chart, method, name):
    scene = symtop.scene(name)
    times, form = np.linspace(0.0, min(scene.horizon, 10.0 * scene.time_scale()), 41), closed_form(scene)
    for tolerance in (1e-5, 1e-8, 1e-11):
        result = method.solvers[chart](scene.top, scene.start, symtop.Plan.until(times, tolerance))
        assert result.outcome == "ok"
        growth = 1e4 if name in ("separatrix", "sleeping") else 1e2
        assert gaps(chart, result.states, form, times).max() < growth * tolerance
    finest = method.solvers[chart](scene.top, scene.start, symtop.Plan.until(times, 1e-17))
    assert finest.steps > method.solvers[chart](scene.top, scene.start, symtop.Plan.until(times, 1e-5)).steps
    assert finest.p_psi == pytest.approx(np.full(41, scene.top.momenta(scene.start).p_psi), rel=1e-11)


def test_a_free_top_and_one_at_rest_and_bad_input():
    assert [order_for(tolerance) for tolerance in (1e-3, 1e-6, 1e-9, 1e-12, 1e-16)] == [8, 12, 16, 20, 20]
    with pytest.raises(symtop.SymtopError, match="order must be one of 8, 12, 16, 20, not 4"):
        series("trial", 4)
    for chart, method in ADAPTIVE:
        top, start = symtop.SymmetricTop(2.0, 1.0, 0.0), symtop.Angles(0.7, 0.2, 0.1, 0.3, -0.8, 1.1)
        times = np.linspace(0.0, 30.0, 11)
        result = method.solvers[chart](top, start, symtop.Plan.until(times, 1e-12))
        assert result.outcome == "ok"
        assert gaps(chart, result.states, symtop.ClosedForm(top, start), times).max() < 1e-10
        idle = method.solvers[chart](top, symtop.Angles(0.7, 0.2, 0.1, 0.0, 0.0, 0.0), symtop.Plan.until(times, 1e-12))
        assert idle.outcome == "ok"
        with pytest.raises(symtop.SymtopError, match="tolerance"):
            symtop.simulate("spheroid", method, tolerance=1e-25, observe="axis")
        with pytest.raises(symtop.SymtopError, match="step_size"):
            symtop.simulate("spheroid", method, step_size=0.1, observe="axis")


def test_a_hyphen_before_a_chart_names_a_row_too():
    for chart in CHARTS:
        assert symtop.integrator(f"series-{chart}").name == f"series[{chart}]"
        assert symtop.integrators()[f"series-{chart}"].charts() == (chart,)
    for name in ("series-angles", "series-", "axis", "-axis"):
        with pytest.raises(symtop.SymtopError):
            symtop.integrator(name)
    with pytest.raises(KeyError):
        symtop.integrators()["serious-axis"]


GENERAL = series_general.CHARTS
OF_TOPS = [chart for chart in GENERAL if chart != "body"]
LARGE = symtop.Scene("large", symtop.SymmetricTop(1e30, 1e30, 1e26), symtop.Angles(1.0, phi_dot=0.7, psi_dot=0.3), 9.0)


def coefficients(chart, order, shift=0.0):
    """c_0 .. c_order of a start, with the number of the top that the chart needs changed: p_psi, or one over I1."""
    par, state = series_general.FORMS[chart].prepare(*problem(chart))
    name = "a1" if chart == "body" else "twist"
    par, fill = par._replace(**{name: getattr(par, name) + shift}), GENERAL[chart].series()

    def kernel(par, state, c):
        fill(par, state, c, order)

    c = np.zeros((order + 2, len(state)))
    compile_kernel(kernel)(par, state, c)
    return state, c[1:]


def problem(chart):
    scene = symtop.scene("heavy-brick" if chart == "body" else "goldstein", bodies=True)
    return scene.top, scene.start


@pytest.mark.parametrize("chart", GENERAL)
def test_coefficients_solve_the_equations_that_every_other_method_takes(chart):
    """y'(t) of the polynomial is f(y(t)) to the order of the first neglected term, and not with another twist."""
    field, (par, _), (_, c) = FORMS[chart].field, FORMS[chart].prepare(*problem(chart)), coefficients(chart, 12)
    residuals = []
    for t in (0.2, 0.1):
        state = tuple(np.polyval(c[::-1, m], t) for m in range(c.shape[1]))
        slope = [np.polyval(np.polyder(c[::-1, m]), t) for m in range(c.shape[1])]
        residuals.append(np.abs(np.subtract(slope, field(par, state))).max())
    assert math.log2(residuals[0] / residuals[1]) == pytest.approx(12.0, abs=1.0)
    if chart != "axis":
        _, control = coefficients(chart, 12, shift=0.01)
        assert np.abs(control[1] - c[1]).max() > 1e-3


@pytest.mark.parametrize("chart", OF_TOPS)
@pytest.mark.parametrize("tolerance", [1e-4, 1e-8, 1e-12, 1e-17])
@pytest.mark.parametrize("scene", ["spheroid", "goldstein", LARGE])
def test_it_takes_the_steps_of_heyoka(scene, tolerance, chart):
    pytest.importorskip("heyoka")
    mine, theirs = (symtop.simulate(scene, f"{name}[{chart}]", tolerance=tolerance, samples=33, guard=False)
                    for name in ("series-general-adaptive", "taylor"))  # fmt: skip
    assert (mine.steps, mine.force_evaluations) == (theirs.steps, theirs.force_evaluations + 2)  # f of the start, twice
    np.testing.assert_allclose(mine["axis"], theirs["axis"], rtol=0.0, atol=1e-11)
    assert symtop.errors(mine)[["axis", "p_phi"]].max().to_array().max() < 100.0 * tolerance + 1e-12


@pytest.mark.parametrize("chart", OF_TOPS)
def test_fixed_steps_have_order_sixteen(chart):
    """With more than 18 steps a nutation errors are rounding, with fewer than 12 higher terms count."""
    quantity = "axis" if chart == "axis" else "attitude"
    assert_order("spheroid", symtop.integrator(f"series-general[{chart}]"), 16, 1.0, (12, 18), quantity)


def test_a_motion_without_end_of_steps_is_one_step_and_constants_stay_at_rounding():
    scene, method = symtop.scene("spheroid"), symtop.integrator("series")
    h = scene.nutation_period / 30.1
    result = method.solvers["axis"](scene.top, scene.start, symtop.Plan.steps(h, np.arange(0, 1_000_001, 10_000)))
    e, L = result.states[:, :3], result.states[:, 3:]
    energy = 0.5 * (L * L).sum(axis=1) / scene.top.I1 + scene.top.mgl * e[:, 2]
    assert np.abs(energy / energy[0] - 1.0).max() < 3e-12
    assert np.ptp(result.p_phi) == 0.0
    assert np.abs(result.p_psi / result.p_psi[0] - 1.0).max() < 3e-12
    # At rest on its axis every coefficient but the first is zero.
    scene = symtop.Scene("rest", symtop.SymmetricTop(1.0, 1.0, 0.0), symtop.Angles(1.0), 5.0, observes="axis")
    run = symtop.simulate(scene, "series-general-adaptive[axis]", tolerance=1e-9, guard=False)
    assert (run.attrs["outcome"], run.attrs["steps"]) == ("ok", 1)
