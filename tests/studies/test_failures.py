"""Ways to fail, each reproduced with its measured number and beside a control that does not fail.

Where a linear analysis gives a limit, a plain long run on both sides of it is the second method.
"""

import math

import numpy as np
import pytest
from symtop_studies.stability import failures, linear_limits as linear, study
from symtop_studies.stability.failures import separatrix_horizon, surviving_displacements
from symtop_studies.stability.linear_limits import linear_limits, sign_changes, sleep_margin, sleeping_threshold
from symtop_studies.stability.measures import narrow_window
from symtop_studies.stability.solver_tolerance import solver_sweep, textbook_midpoint

import symtop
from symtop.measure.settings import smallest_charts
from symtop.methods.framework.calling import solve
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import integrator, methods
from symtop.methods.lagrangian.discrete_lagrangian import rule_of
from symtop.model import charts, scenes
from symtop.model.charts import View, axis_of
from symtop.model.scenes import Scene, closed_form, grazing, sleeping
from symtop.model.top import Angles, SymmetricTop
from symtop.run.linear_stability import Trace, trace, with_momenta

STEADY = scenes.scene("steady-fast")  # I1, I3, mgl, theta, w3 = 2, 1, 2, 60 degrees, 20
OMEGA = STEADY.top.nutation_frequency(STEADY.top.momenta(STEADY.start))


def run(name, scene, h, steps, marks=None, start=None):
    """A run of so many steps, sampled at every step unless marks are given: the chart it took and the run."""
    method = integrator(name)
    chart, marks = method.chart_for("axis"), np.arange(steps + 1) if marks is None else marks
    return chart, solve(method, chart, scene.top, start or scene.start, Plan.steps(h, marks, steps * h))


def axis_errors(name, scene, h, steps, marks=None):
    """Axis error at the samples, and the outcome."""
    marks = np.arange(steps + 1) if marks is None else np.unique(np.asarray(marks, dtype=np.int64))
    chart, result = run(name, scene, h, steps, marks)
    return charts.axis_distance(axis_of(chart, result.states), closed_form(scene).axis(marks * h)), result.outcome


def trapezoidal_limit(top, precession, theta):
    """The step beyond which `trapezoidal` is unstable at a steady precession; infinite for I3 >= I1."""
    if top.I3 >= top.I1:
        return math.inf
    return 2.0 / (abs(precession) * math.sin(theta) * math.sqrt(1.0 - top.I3 / top.I1))


@pytest.mark.parametrize("theta", [1e-6, 1e-4, 0.7, math.pi - 1e-4])
def test_a_start_next_to_a_pole_has_the_momenta_that_were_asked_for(theta):
    top, rate = SymmetricTop(2.0, 1.0, 1.0), 0.37
    momenta = top.momenta(Angles(theta, phi_dot=rate, psi_dot=3.0))
    assert with_momenta(top, theta, momenta).phi_dot == pytest.approx(rate, rel=1e-13)
    naive = (momenta.p_phi - momenta.p_psi * math.cos(theta)) / (top.I1 * math.sin(theta) ** 2)
    assert theta == 0.7 or abs(naive / rate - 1.0) > 1e-10  # the control


def test_a_method_that_damps_has_a_growth_below_one():
    """That the trace is the one of the discrete nutation is in `tests.run.test_guard`, of any motion."""
    damped = trace(integrator("rk4"), STEADY, 1.0 / OMEGA)
    assert damped.growth == pytest.approx(math.sqrt(damped.determinant), rel=1e-9)
    assert damped.growth < 1.0


def swings(name, phase, steps, nudge, centre=STEADY.start.theta):
    """The swing of theta over the first 20 nutations, the last 20 and all, a start displaced by so many radians."""
    start = with_momenta(STEADY.top, centre + nudge, STEADY.top.momenta(STEADY.start))
    chart, result = run(name, STEADY, phase / OMEGA, steps, start=start)
    theta, width = np.asarray(View(chart, STEADY.top, result.states).theta), math.ceil(40.0 * math.pi / phase)
    return float(np.ptp(theta[:width])), float(np.ptp(theta[-width:])), float(np.ptp(theta))


@pytest.mark.parametrize(("name", "phase", "drifts"), [
    ("rkmk-se3-2", 0.03, 1e-4), ("commutator-free-4", 0.17, 1e-4), ("rkmk-se3-4", 0.8, 1e-2)])  # fmt: skip
def test_a_drift_of_the_inclination_is_no_growth(name, phase, drifts):
    """The trace of a method that drifts takes that for growth; its nutations, followed, do not grow."""
    method = integrator(name)
    assert trace(method, STEADY, phase / OMEGA).growth > 1.0 + drifts
    limit, third = linear_limits(method, STEADY, np.linspace(0.01, 1.0, 60) / OMEGA)
    assert math.isnan(limit)
    assert math.isnan(third)
    if phase < 0.5:  # with longer steps the run drifts to another inclination in 200 nutations
        first, last, _ = swings(name, phase, round(400.0 * math.pi / phase), 1e-3)
        assert first == pytest.approx(2e-3, rel=0.01)
        assert last == pytest.approx(first, rel=0.01)
        assert math.exp(1e-4 * 400.0 * math.pi / phase) > 2.0  # growth at the limit would have been seen


@pytest.mark.parametrize("name", ["rk4[angles]", "rk4[axis]"])
def test_a_method_that_damps_has_a_limit_where_its_nutations_begin_to_grow(name):
    """rk4 damps the oscillator up to h omega = 2 sqrt 2, where |R| = 1; nutations in angles are one."""
    limit, _ = linear_limits(integrator(name), STEADY, np.linspace(0.02, 4.0, 80) / OMEGA)
    assert limit * OMEGA == pytest.approx(math.sqrt(8.0), rel=1e-4 if name == "rk4[angles]" else 1e-2)
    for place, grows in ((0.99, False), (1.01, True)):
        first, last, _ = swings(name, place * limit * OMEGA, 90, 1e-6)
        assert (last > 10.0 * first) is grows
        assert (last < 0.1 * first) is not grows


def test_limits_are_those_of_linear_theory_but_for_methods_that_cannot_be_followed():
    limit, _ = linear_limits(integrator("stormer-verlet"), STEADY, np.linspace(0.05, 4.0, 80) / OMEGA)
    assert limit * OMEGA == pytest.approx(2.0, abs=1e-8)
    for phase, stays in ((1.9995, True), (2.0005, False)):
        start = with_momenta(STEADY.top, STEADY.start.theta + 1e-9, STEADY.top.momenta(STEADY.start))
        _, result = run("stormer-verlet", STEADY, phase / OMEGA, 400, start=start)
        assert bool(np.max(np.abs(result.states[:, 0] - STEADY.start.theta)) < 1e-7) is stays
    # Yoshida's three Verlet steps leave |t| <= 2 upwards, at the known h omega = 1.573, long before t = -2.
    method = integrator("stormer-verlet-yoshida-4")
    limit, _ = linear_limits(method, STEADY, np.linspace(0.05, 3.0, 60) / OMEGA)
    assert limit * OMEGA == pytest.approx(1.573, abs=2e-3)
    assert trace(method, STEADY, 1.02 * limit).trace > 2.0
    # Its precession drifts so far in a step that its nutations change as much: no growth is told from that.
    grid = np.linspace(0.02, 10.0, 300) / OMEGA
    for name in ("crouch-grossman-3", "rkmk-se3-2", "commutator-free-4", "generalised-alpha"):
        assert math.isnan(linear_limits(integrator(name), STEADY, grid)[0])


@pytest.mark.parametrize(("name", "phase", "unstable"), [
    ("kahan-li-8", 6.283, True), ("kahan-li-8", 9.4235, True), ("srkn-11-6", 6.283, True),
    ("sofroniou-spaletta-10", 6.283, True), ("aba-8-6-4", 6.283, True), ("strang", 3.1414, True),
    ("gauss-8", 6.283, False), ("exact-discrete", 6.283, False), ("cayley", 3.1414, False)])  # fmt: skip
def test_a_window_between_two_steps_of_the_grid_is_seen(name, phase, unstable):
    method, phases = integrator(name), np.linspace(0.02, 10.0, 300)
    grid = phases[np.abs(phases - phase) < 0.3] / OMEGA
    assert math.isnan(linear_limits(method, STEADY, grid)[0])
    window = narrow_window(method, STEADY, grid)
    assert math.isfinite(window.start) is unstable
    outside = phase - 0.05
    assert swings(name, outside, 20_000, 1e-6, trace(method, STEADY, outside / OMEGA).theta)[-1] < 1e-5
    if unstable:
        assert window.start * OMEGA < phase < window.end * OMEGA
        assert max(linear.surpasses(end, end.doubt) for end in [trace(method, STEADY, h) for h in window]) <= 0.0
        assert (window.end - window.start) * OMEGA < 0.011
        theta = trace(method, STEADY, phase / OMEGA).theta  # the precession itself is lost beside 2 pi
        assert swings(name, phase, 20_000, 1e-6, theta if math.isfinite(theta) else STEADY.start.theta)[-1] > 1e-4
    elif phase > 6.0:  # a whole nutation a step, and nothing is driven away
        assert swings(name, phase, 20_000, 1e-6)[-1] < 1e-5


def test_angles_fail_where_a_step_passes_the_pole_and_splitting_does_not_notice():
    """The axis misses the pole by 1.1 delta at 1.2 rad/s: the angles lose it once 1.1 delta is about 1.2 h."""
    h, steps = 4.22 / 4220, 4220
    gaps = np.array([0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 1e-4, 1e-5, 1e-6])
    strang, verlet, outcomes = [], [], []
    for gap in gaps:
        scene = grazing(float(gap))
        assert closed_form(scene).theta_range[0] == pytest.approx(1.1 * gap, rel=0.35)
        error, outcome = axis_errors("strang", scene, h, steps)
        assert outcome == "ok"
        strang.append(error.max())
        error, outcome = axis_errors("stormer-verlet", scene, h, steps)
        verlet.append(np.nanmax(error))
        outcomes.append(outcome)
    assert max(strang) < min(2e-6, 3.0 * min(strang))
    assert verlet[0] < 1e-5
    assert verlet[5] > 1e-3
    assert all(np.diff(verlet[:5]) > 0.0)
    assert outcomes[:4] == ["ok"] * 4
    assert all(outcome == "left_chart" for outcome in outcomes[6:])


def test_the_benchmark_of_bruls_cardona_arnold_is_no_place_for_angles():
    """It passes the lower pole at 4.15e-5 degrees."""
    scene = scenes.scene("bruls-cardona-arnold")
    assert math.degrees(math.pi - closed_form(scene).theta_range[1]) == pytest.approx(4.15e-5, rel=0.01)
    for name in ("midpoint", "stormer-verlet"):
        error, outcome = axis_errors(name, scene, 1e-6, 2_000_000, marks=np.linspace(0, 2_000_000, 2001))
        assert outcome != "ok" or np.nanmax(error) > 0.1
    ladder = [axis_errors("strang", scene, 2.0 / n, n, marks=np.linspace(0, n, 201))[0].max() for n in (8000, 16000)]
    assert math.log2(ladder[0] / ladder[1]) == pytest.approx(2.0, abs=0.05)
    assert ladder[1] < 1e-3


@pytest.mark.parametrize("name", [
    "strang", "cayley", "midpoint", "stormer-verlet", "trapezoidal", "gauss-2", "gauss-6"])  # fmt: skip
def test_the_sleeping_threshold_shifts_as_theory_says_or_stays(name):
    for h in (0.1, 0.5, 1.0):
        expected = pytest.approx(2.0, abs=1e-6)
        if name in ("strang", "cayley"):
            expected = pytest.approx(integrator(name).sleeps_from(h), abs=1e-8)
        assert sleeping_threshold(integrator(name), h) == expected


def test_the_trapezoidal_rule_has_its_own_limit_and_long_runs_fall_on_one_side_of_it():
    trapezoidal, midpoint = integrator("trapezoidal"), integrator("midpoint")
    limit = trapezoidal_limit(STEADY.top, STEADY.start.phi_dot, STEADY.start.theta)
    assert linear_limits(trapezoidal, STEADY, np.linspace(0.02, 1.2, 60) * limit)[0] == pytest.approx(limit, rel=1e-6)
    assert math.isnan(linear_limits(midpoint, STEADY, np.linspace(0.02, 1.2, 60) * limit)[0])
    for place in (0.5, 0.99, 1.01, 2.0):
        assert (abs(trace(trapezoidal, STEADY, place * limit).trace) < 2.0) is (place < 1.0)
        assert abs(trace(midpoint, STEADY, place * limit).trace) < 2.0
    assert trapezoidal_limit(SymmetricTop(1.0, 1.5, 2.0), 1.0, 1.0) == math.inf
    h = 0.5
    for name in ("strang", "cayley"):
        edge = integrator(name).sleeps_from(h)
        for spin, sleeps in ((edge + 0.01, True), (edge - 0.01, False)):
            chart, result = run(name, sleeping(spin, 1e-4), h, 600)
            assert bool(charts.theta_from_axis(axis_of(chart, result.states)).max() < 0.01) is sleeps


def test_the_splitting_window():
    """Between h = 2 pi/a and where a tan(a h/4 - pi/2) = h; to first order in mgl up to 1 + 4 mgl I1/(I3 w3)^2."""
    unit, strang = 2.0 * math.pi / 6.0, integrator("strang")
    edges = [h / unit for h in sign_changes(lambda h: sleep_margin(strang, 6.0, h), np.linspace(0.5, 1.5, 201) * unit)]
    assert len(edges) == 2
    assert edges[0] == pytest.approx(1.0, abs=1e-6)
    upper = sign_changes(lambda x: 6.0 * math.tan(1.5 * x * unit - 0.5 * math.pi) - x * unit, np.array([1.0, 1.4]))
    assert edges[1] == pytest.approx(upper[0], abs=1e-6)
    assert upper[0] == pytest.approx(1.1232416, abs=1e-6)
    for place, stays in ((0.99, True), (1.02, False), (1.11, False), (1.12, False), (1.13, True)):
        chart, result = run("strang", sleeping(6.0, 1e-5), place * unit, 3000)
        assert bool(charts.theta_from_axis(axis_of(chart, result.states)).max() < 1e-3) is stays
    assert not sign_changes(lambda h: sleep_margin(integrator("cayley"), 6.0, h), np.linspace(0.5, 1.5, 201) * unit)


def test_the_separatrix_costs_half_of_g_and_a_run_that_leaves_its_chart_is_told_apart():
    """Negative control: elsewhere they do not grow like that."""
    scene, h = scenes.scene("separatrix"), 0.0125
    g, times = math.sqrt(scene.top.mgl / scene.top.I1), np.arange(1201) * h
    window = (times > 7.0) & (times < 13.0)
    slopes = [np.polyfit(times[window], np.log(axis_errors("strang", case, step, 1200)[0][window]), 1)[0]
              for case, step in ((scene, h / g), (scenes.scene("goldstein"), h))]  # fmt: skip
    assert slopes[0] == pytest.approx(failures.growth_rate(scene) / g, abs=0.01)
    assert failures.growth_rate(scene) == pytest.approx(0.5 * g)
    for spin in (0.5, 1.5):  # another momentum, another rate
        x, y, _ = closed_form(sleeping(spin, 1e-9)).axis(np.array([6.0, 9.0])).T
        rate = np.diff(np.log(np.hypot(x, y)))[0] / 3.0
        assert failures.growth_rate(sleeping(spin)) == pytest.approx(rate, rel=1e-3)
    assert abs(slopes[1]) < 0.25
    horizons = [separatrix_horizon(integrator("strang"), scene, step) for step in (0.1, 0.05, 0.025, 0.0125)]
    for entry in horizons:
        assert entry.reached == pytest.approx(entry.predicted, abs=0.3 / g)
    gains = np.diff([entry.reached for entry in horizons])
    assert gains == pytest.approx(2.0 * math.log(4.0) / g, abs=0.2)  # (2/g) ln 4: a quarter of the error
    best = separatrix_horizon(integrator("gauss-12"), scene, 0.1)
    assert best.reached == pytest.approx(2.0 / g * math.log(1e16), abs=5.0)
    broken = separatrix_horizon(integrator("galerkin-simpson"), scene, 0.1)
    assert broken.broken == 1.0
    assert math.isnan(broken.reached)
    assert broken.predicted < 80.0
    assert separatrix_horizon(integrator("strang"), scene, 0.1).broken == 0.0


def test_solvers_of_one_iteration_drift_and_tight_ones_leave_the_method():
    scene = scenes.scene("goldstein")
    single, double = ([textbook_midpoint(scene, 0.1, steps, 0.0, limit) for steps in (10_000, 100_000, 1_000_000)]
                      for limit in (1, 2))  # fmt: skip
    assert single[1] == pytest.approx(3.1e-2, rel=0.05)
    assert single[0] == pytest.approx(0.1 * single[1], rel=0.2)
    assert single[2] > 1.0
    assert double == pytest.approx([3.434e-4] * 3, rel=1e-2)
    assert textbook_midpoint(scene, 0.1, 100_000, 1e-1) == pytest.approx(3.1e-2, rel=0.05)  # a loose one
    for tolerance in (1e-6, 1e-10):
        assert textbook_midpoint(scene, 0.1, 100_000, tolerance) == pytest.approx(3.434e-4, rel=1e-2)
    midpoint = rule_of(integrator("midpoint"))
    sweeps = [solver_sweep(midpoint, scene, 0.1, 20_000, tolerance) for tolerance in (math.inf, 1e-4, 1e-8)]
    for steps in (1, 7):  # both solvers make these steps, and no other
        energy = solver_sweep(midpoint, scene, 0.1, steps, 1e-15).energy
        assert textbook_midpoint(scene, 0.1, steps, 1e-15) == pytest.approx(energy, rel=1e-6)
        assert energy > 1e-7
    assert sweeps[0].iterations == 1.0
    assert sweeps[0].momentum > 1e-9 > sweeps[1].momentum > sweeps[2].momentum
    assert sweeps[2].momentum < 1e-14
    y0 = scene.start
    mirrored = Scene("mirrored", scene.top, Angles(y0.theta, phi_dot=-y0.phi_dot, psi_dot=-y0.psi_dot), scene.horizon)
    assert solver_sweep(midpoint, mirrored, 0.1, 20_000, math.inf).momentum == sweeps[0].momentum
    coarse = solver_sweep(midpoint, scene, 0.3, 100_000, math.inf).energy
    assert coarse > 0.05 > 10.0 * solver_sweep(midpoint, scene, 0.3, 100_000, 1e-8).energy


@pytest.mark.parametrize(("name", "place"), [("stormer-verlet", math.sqrt(3.0)), ("midpoint", math.sqrt(12.0))])
def test_nothing_survives_a_third_of_a_turn_a_step(name, place):
    method = integrator(name)
    _, third = linear_limits(method, STEADY, np.linspace(0.05, 1.1, 60) * place / OMEGA)
    assert third * OMEGA == pytest.approx(place, abs=1e-5)
    steps = [x * place / OMEGA for x in (1.0, 0.93, 1.06)]
    at_resonance, before, past = surviving_displacements(method, STEADY, steps, 3000)
    assert at_resonance < 5e-3
    assert min(before, past) > 10.0 * at_resonance
    assert abs(trace(method, STEADY, third).trace) < 1.01  # a linear analysis sees nothing


@pytest.mark.parametrize("name", ["gauss-2", "gauss-4", "gauss-12", "cayley"])
def test_gauss_methods_and_the_integrable_map_have_no_limit_and_no_resonance(name):
    """They keep an energy and both momenta, so that a displaced top stays on its level line at every step."""
    method = integrator(name)
    limit, third = linear_limits(method, STEADY, np.linspace(0.02, 10.0, 300) / OMEGA)
    assert math.isnan(limit)
    for h in (third, *(phase / OMEGA for phase in (2.0, 5.0, 10.0))):
        assert surviving_displacements(method, STEADY, [h], 1000)[0] == pytest.approx(0.3)


def test_what_is_measured_is_the_first_displacement_that_is_lost_and_larger_ones_may_stay():
    method = integrator("galerkin-simpson")
    h = linear_limits(method, STEADY, np.linspace(0.05, 2.5, 60) / OMEGA)[1]
    assert h * OMEGA == pytest.approx(2.1409, abs=1e-4)
    assert 0.0 < surviving_displacements(method, STEADY, [h], 3000)[0] < 0.01
    assert failures.survives(method, STEADY, trace(method, STEADY, h).theta, [0.03, 0.1, 0.2], h, 3000).all()
    verlet, resonance = integrator("stormer-verlet"), math.sqrt(3.0) / OMEGA
    assert not failures.survives(verlet, STEADY, STEADY.start.theta, [0.03, 0.1, 0.2], resonance, 3000).any()


def test_rk45_loses_constants_linearly_and_errors_sampled_once_a_nutation_read_some_1e_9():
    rk45 = symtop.simulate("spheroid", "rk45", tolerance=1e-6, horizon=200.0, samples=401, guard=False)
    changes = {name: rk45[name].values - rk45[name].values[0] for name in ("energy", "p_phi", "p_psi")}
    assert -6e-3 < changes["energy"][-1] < -5e-3
    for name in ("p_phi", "p_psi"):
        assert 3e-5 < abs(changes[name][-1]) < 7e-4
    for values in changes.values():
        assert values[200] / values[-1] == pytest.approx(0.5, abs=0.1)
    (once, every), (seen, drift) = (failures.sampled_energy_error(integrator(name), scenes.scene("goldstein"), 100, 3)
                                    for name in ("stormer-verlet", "rk4"))  # fmt: skip
    assert every == pytest.approx(2.5e-4, rel=0.03)
    assert 1e-9 < once < 1e-8
    assert seen > 0.3 * drift  # a drift is seen all the same


NOT_ONE_MAP = {  # of theta and p_theta, so that its samples are no iterates
    "generalised-alpha",  # accelerations are a second state of it
    "stormer-verlet-reversible",  # a sample is a step aside, of another length each time
    "five-rotations",
    "euler",  # p_psi is not kept: the map is one of more variables
}


def test_every_fixed_step_method_shows_its_trace_and_is_scanned_but_those_left_out():
    exceptions = {name for names in study.NOT_SLEEPING.values() for name in names}
    names = {row.name for row in smallest_charts("axis") if row.fixed_step}
    assert exceptions < names  # a name that no variant has would leave nothing out
    for quick in (True, False):
        assert {case.integrator for case in study.cases(quick) if case.scene == "sleeping"} == names - exceptions
    # Consistency: at small steps each turns by h omega, in whatever chart it works.
    turn = 0.03  # more, and the error of rkmk-se3-2 shows, which grows with the spin; less, and that of the differences
    for name, method in methods().items():
        if method.control == "step_size" and name not in NOT_ONE_MAP:
            record = trace(method, STEADY, turn / OMEGA)
            angle = math.acos(record.trace / (2.0 * math.sqrt(record.determinant)))
            assert angle == pytest.approx(turn, rel=2e-3), name


def test_sign_changes_are_found_and_a_precession_next_to_a_pole_has_no_trace():
    assert sign_changes(math.cos, np.linspace(0.0, 6.0, 13)) == pytest.approx([math.pi / 2, 3 * math.pi / 2])
    holed = lambda x: math.nan if 1.0 < x < 2.0 else math.cos(x)
    assert sign_changes(holed, np.linspace(0.0, 6.0, 13)) == pytest.approx([3 * math.pi / 2])
    assert sign_changes(lambda x: 1.0 + x * x, np.linspace(-1.0, 1.0, 5)) == []
    flags = [(linear.surpasses(Trace(t, 1.0, 1.0)) > 0.0, linear.surpasses(Trace(t, 1.0, 1.0), 1e-6) > 0.0)
             for t in (2.0 + 5e-8, 2.0 + 2e-7, 2.0 + 2e-6, -2.0 - 2e-7, -2.0 - 2e-6, -2.0 + 5e-7)]  # fmt: skip
    assert flags == [(False, False), (True, False), (True, True), (True, False), (True, True), (False, False)]
    tall = Scene("tall", SymmetricTop(1.0, 1.0, 1.0), symtop.Angles(theta=1e-4, psi_dot=3.0), 1.0)
    assert math.isnan(trace(integrator("stormer-verlet"), tall, 0.1).trace)
