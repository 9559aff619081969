"""The guard before a run: it is silent when all is well, names causes and remedies, and never changes the run.

That it misses no wrong answer is what `tests.hostile.test_random_runs` draws thousands of runs for.
"""

import math
import random
import re
import warnings
from dataclasses import replace

import numpy as np
import pytest

import symtop
from symtop.methods.framework.registry import methods
from symtop.model import charts
from symtop.model.charts import axes
from symtop.model.scenes import closed_form, grazing, steady
from symtop.run import guard
from symtop.run.ensemble.bodies import body_population, scenes_of
from symtop.run.guard import EXPECTED, Probe, grown
from symtop.run.linear_stability import nutation_growth, trace
from symtop.run.motion import ExactMotion, IntegratedMotion, _distance, landmarks
from symtop.run.simulation import make_plan

WOBBLY = ("jolt", 0.227), ("rk4", 0.227), ("mujoco-euler", 2.0)  # the first doubles a wobble in a turn
REMEDIED = ("spheroid", "goldstein", "cusp", "loop", "fast", "hairer-lubich-wanner", "grazing")


def caution(scene, name, **controls):
    """What the guard says of a run."""
    sentences = []
    symtop.simulate(scene, name, guard=sentences.append, samples=11, **controls)
    return sentences[0] if sentences else ""


@pytest.mark.parametrize(("name", "control"), [
    ("stormer-verlet", {"step_size": 2e-3}), ("midpoint", {"step_size": 2e-3}), ("strang", {"step_size": 2e-3}),
    ("gauss-4", {"step_size": 1e-2}), ("rk45-compiled", {"tolerance": 1e-8}), ("taylor", {}), ("exact", {}),
    ("rk4", {"step_size": 1e-6, "horizon": 0.5}),  # so fine that rounding hides growth
])  # fmt: skip
def test_a_good_run_is_met_with_silence_and_any_run_with_the_same_bits(name, control):
    assert caution("spheroid", name, **control) == ""
    quiet, watched = (symtop.simulate("spheroid", name, samples=41, guard=guard, **control) for guard in (False, True))
    assert (quiet.attrs.pop("guard"), watched.attrs.pop("guard")) == ("off", "")
    assert watched.identical(quiet)


def test_a_bad_run_is_the_same_run_with_a_warning():
    controls = {"step_size": 0.1, "samples": 41}
    with pytest.warns(symtop.SymtopWarning, match="expect an axis error") as record:
        watched = symtop.simulate("spheroid", "midpoint", **controls)
    assert len(record) == 1
    assert "\n" not in str(record[0].message)
    assert record[0].filename == __file__  # the line that the user wrote
    assert watched.attrs.pop("guard") == str(record[0].message)
    with warnings.catch_warnings(action="error"):
        quiet = symtop.simulate("spheroid", "midpoint", guard=False, **controls)
    del quiet.attrs["guard"]
    assert watched.identical(quiet)


@pytest.mark.parametrize(("law", "straight"), [(lambda t: 3e-6 * t, True), (lambda t: 1e-6 * t + 4e-7 * t * t, False)])
def test_errors_are_grown_by_their_law(law, straight):
    times = np.linspace(0.0, 10.0, 401)[1:]
    probe = Probe(times, law(times), "ok", 10.0, 0)
    assert grown(probe, 1000.0, straight=straight) == pytest.approx(law(1000.0), rel=0.03)
    assert grown(probe, 10.0, straight=straight) == law(10.0)
    bounded = probe._replace(error=np.full(times.size, 1e-6))
    assert 1e-6 < grown(bounded, 1000.0, straight=True) < 1e-5  # of an error that does not grow the guard is not sure
    if not straight:  # the wrong law would be silent
        assert grown(probe, 1000.0, straight=True) < 0.1 * law(1000.0)


def nutating():
    """A motion that nutates about a steady precession."""
    return symtop.Scene("nutating", steady(20.0).top, symtop.Angles(1.0, theta_dot=1.0, psi_dot=20.0), 60.0)


@pytest.mark.parametrize(("name", "chart", "turn", "angle"), [
    *(("stormer-verlet", "angles", turn, 2.0 * math.asin(0.5 * turn)) for turn in (0.3, 1.0, 1.7, 1.99)),
    *(("midpoint", "angles", turn, 2.0 * math.atan(0.5 * turn)) for turn in (0.3, 1.0, 1.7, 1.99)),
    *((name, "axis", 0.1, 0.1) for name in ("strang", "gauss-4", "rk4")),  # as any small step
])  # fmt: skip
def test_the_trace_of_any_motion_is_what_linear_theory_says(name, chart, turn, angle):
    scene = nutating()
    traced = trace(symtop.integrator(name), scene, turn / landmarks(scene).frequency, chart)
    assert traced.turn == pytest.approx(angle, abs=1e-6)
    if chart == "angles":  # those in space have a fixed point of their own
        assert traced.theta == pytest.approx(scene.top.steady_theta(scene.top.momenta(scene.start)), abs=1e-9)


def test_the_limits_of_verlet_and_rk4_are_found():
    """F1: Verlet loses small nutations at h omega = 2, rk4 at 2 sqrt 2, the midpoint rule and Gauss methods never."""
    frequency, settings = landmarks(scene := steady(20.0)).frequency, {"observe": "nutation", "horizon": 2000.0}
    for name, limit in (("stormer-verlet", 2.0), ("rk4", 2.0 * math.sqrt(2.0))):
        warned = caution(scene, name, step_size=1.02 * limit / frequency, **settings)
        assert float(re.search(r"h omega = ([\d.]+)\)", warned).group(1)) == pytest.approx(limit, abs=3e-3)
        assert "grow" in warned
        assert "grow" not in caution(scene, name, step_size=0.98 * limit / frequency, **settings)
    assert caution(scene, "midpoint", step_size=3.0 / frequency) == ""
    for name, phase in ((name, phase) for name in ("gauss-2", "gauss-4", "gauss-12") for phase in (2.0, 5.0, 10.0)):
        assert "grow" not in caution(scene, name, step_size=phase / frequency, observe="nutation")


def test_each_cause_is_named():
    frequency = landmarks(steady(20.0)).frequency
    assert "the upper pole" in caution(grazing(1e-3), "stormer-verlet", step_size=0.02)
    assert caution(grazing(1e-3), "strang", step_size=2e-3) == ""  # no pole in its chart
    assert "separatrix" in caution("separatrix", "gauss-8", step_size=0.01, horizon=150.0)
    assert caution("separatrix", "gauss-8", step_size=0.01, horizon=15.0) == ""
    assert "jumps over half a nutation" in caution("goldstein", "gauss-4", step_size=2.0)
    assert "1/3 of a turn, a resonance" in caution(nutating(), "stormer-verlet", step_size=math.sqrt(3.0) / frequency)
    assert "errors add up over" in caution("goldstein", "midpoint", step_size=0.1, horizon=1000.0)
    assert all("it has no order" in caution("goldstein", name, step_size=0.01) for name in ("no-gyro", "jolt-float32"))
    method = replace(symtop.integrator("no-gyro"), name="own", order=2)
    assert all("`symtop claims own`" in caution("goldstein", method, step_size=h, horizon=2.0) for h in (0.01, 5e-4))
    assert "take a step of about" in caution("goldstein", "mujoco-euler", step_size=0.01)
    assert "tolerance" in caution("goldstein", "rk45-compiled", tolerance=1e-5, horizon=1000.0)
    assert "not solved; take a step of about 0.063" in caution("sleeping", "trapezoidal", step_size=2.0, horizon=4000.0)
    assert "a step is 1/2.36 of a nutation" in caution("spheroid", "gauss-2", step_size=0.5, observe="axis")  # goes on


@pytest.mark.parametrize(("scene", "name", "control", "horizon"), [
    ("spheroid", "midpoint", {"step_size": 0.05}, 40.0), ("spheroid", "rk45-compiled", {"tolerance": 1e-4}, 100.0),
    ("cusp", "gauss-4", {"step_size": 0.3}, 300.0),
])  # fmt: skip
def test_a_remedy_is_a_remedy(scene, name, control, horizon):
    """What the sentence advises silences the guard and makes the run right, and is not ten times too careful."""
    advice = float(re.search(r"(?:about|tolerance) ([\d.e-]+)$", caution(scene, name, horizon=horizon, **control))[1])
    run = symtop.simulate(scene, name, horizon=horizon, **dict.fromkeys(control, advice))
    assert 1e-5 < float(symtop.errors(run)["axis"].max()) < EXPECTED


def advice_errors(draw, methods):
    """A random run of a scene that the guard warns of, with a step: axis errors of the run and of the one advised."""
    scene, row = symtop.scene(draw.choice(REMEDIED)), symtop.integrator(draw.choice(methods))
    chart, period = row.charts()[0], scene.nutation_period
    step, horizon = period * math.exp(draw.uniform(math.log(0.004), math.log(0.7))), period * draw.uniform(2.0, 40.0)
    plan, _ = make_plan(scene, row, step, horizon=horizon, samples=201)
    advice = re.search(r"take a step of about ([\d.e-]+)", guard.warning(scene, row, chart, plan))
    if advice is None:
        return None
    errors = []
    for setting in (step, float(advice[1])):
        plan, _ = make_plan(scene, row, setting, horizon=horizon, samples=201)
        run = row.solvers[chart](scene.top, scene.start, plan)
        with np.errstate(all="ignore"):  # a run may have blown up
            error = charts.axis_distance(axes(chart, run.states), closed_form(scene).axis(plan.times))
        errors.append(float(error.max()) if run.outcome == "ok" else math.inf)
    return errors


def test_the_step_that_is_advised_works_whatever_the_cause():
    """Poles, resonances, steps beyond the stability limit and errors that add up; 2 of 600 were wrong, by 0.0125."""
    draw = random.Random(5)
    names = ("midpoint", "stormer-verlet", "strang", "rk4[axis]", "gauss-4", "generalised-alpha")
    pairs = [pair for _ in range(120) if (pair := advice_errors(draw, names)) is not None]
    assert len(pairs) > 55
    before, after = np.array(pairs).T
    assert np.mean(after > EXPECTED) <= 0.02
    assert after.max() < 2.0 * EXPECTED
    assert np.mean(before > EXPECTED) > 0.9  # the warnings were right, too


def test_landmarks_are_those_of_the_closed_form_and_no_step_is_advised_that_a_run_may_not_have():
    marks, lower = landmarks(grazing(1e-4)), landmarks(symtop.scene("bruls-cardona-arnold"))
    assert ((marks.pole, lower.pole), marks.gap) == (("upper", "lower"), pytest.approx(1.105e-4, rel=1e-2))
    motion = closed_form(grazing(1e-4))(np.linspace(0.0, 4.23, 2_000_001))
    assert marks.rate == pytest.approx(np.abs(motion.phi_dot).max(), rel=1e-3)
    assert math.degrees(lower.gap) == pytest.approx(4.15e-5, rel=1e-2)
    # Past a pole at 1e-12 rad a step that follows the axis is 1e-13: more steps than `simulate` takes.
    for gap, steps in ((1e-4, True), (1e-12, False)):
        sentence = caution(grazing(gap), "stormer-verlet", step_size=0.02)
        assert ("take a step of about" in sentence) is steps
        assert "an integrator whose chart has no poles, such as strang" in sentence
    assert "more than 2e+10 steps would be needed" in sentence


def test_every_method_can_be_probed_and_is_told_what_it_can_do(monkeypatch):
    """One forecast a method that comparisons choose from: finite, and silent at a fine setting."""
    scene = symtop.scene("goldstein")
    for method in methods().values():
        control = {"step_size": 1e-4 if method.order == 1 else 0.01} if method.control == "step_size" else {}
        if method.control == "tolerance" and method.default_tolerance is None:
            control = {"tolerance": 1e-6 if method.implementation == "compiled" else 1e-5}
        plan, _ = make_plan(scene, method, **control, horizon=3.0, samples=11)
        expected = guard.forecast(scene, method, method.charts()[0], plan)
        assert (expected.outcome, expected.axis_error < 1e-2) == ("ok", True)
    method = symtop.integrator("stormer-verlet-reversible")  # a fixed step says nothing of how many it makes at a pole
    plan, _ = make_plan(scene, method, step_size=0.01, horizon=3.0, samples=11)
    monkeypatch.setitem(guard.MOST_WORK, "compiled", 50.0)
    assert guard.forecast(scene, method, "angles", plan).outcome == "out_of_budget"


@pytest.mark.parametrize(("step", "grows"), [(1.6908950574495778e-3, True), (1e-4, False)])
def test_nutations_that_grow_out_of_single_precision_are_announced(step, grows):
    """They begin as 3e-7 rad, below the rounding of a state, and grow by 0.9 % a step: 316 periods of them."""
    top = symtop.SymmetricTop(4.112429602183333, 3.7094398007298763, 0.5522711835332078)
    start = symtop.Angles(0.6475464513889042, 0.9948511184094544, -0.5379337072832797, psi_dot=803.5159571744858)
    scene = symtop.Scene("fast", top, start, 2.7371364869033403)
    run = symtop.simulate(scene, "jolt-float32", step_size=step, guard=False)
    assert (float(symtop.errors(run)["axis"].max()) > EXPECTED) is grows
    assert ("small nutations" in caution(scene, "jolt-float32", step_size=step)) is grows


def test_an_end_at_a_pole_after_many_passages_is_announced(monkeypatch):
    """The axis passes the pole at 2e-16 rad, and Adams' method ends there after 13 nutations, vern9 at none of 96."""
    top = symtop.SymmetricTop(0.34197641538075246, 0.3742372339233947, 0.037042027632846225)
    rates = {"theta_dot": 0.0, "phi_dot": 0.458319572783573, "psi_dot": 0.40513789028252667}
    start = symtop.Angles(1.2174251215796315, 2.418827152562061, 0.7304406217729724, **rates)
    scene = symtop.Scene("through-upright", top, start, 1365.0500094145345)
    controls = {"tolerance": 2.8942661247167517e-08, "observe": "attitude"}
    assert "stopped at t = 192.981" in caution(scene, "adams", **controls)
    assert caution(scene, "vern9", **controls) == ""
    monkeypatch.setattr(guard, "POLE_FACTOR", 1.0)
    assert caution(scene, "adams", **controls) == ""  # the control: of the first nutations it sees nothing
    top = symtop.SymmetricTop(0.21139120105289147, 0.17433412715295638, -0.10207649271382181)
    rates = -1.3442613475029312, 2.15157297712127, 2.483867050263369
    start = symtop.Angles(1.8477525261144405, -2.366700800344101, -0.25147517216375936, *rates)
    for horizon, ends in ((2.8551485700365795, True), (1.3, False)):  # there it is right to 0.0095 rad and ends
        scene = symtop.Scene("aimed", top, start, horizon)
        run = symtop.simulate(scene, "extrapolation[angles]", tolerance=0.0012096342552818213, guard=False)
        assert (run.attrs["outcome"] == "left_chart") is ends
        assert bool(caution(scene, "extrapolation[angles]", tolerance=0.0012096342552818213)) is ends


@pytest.mark.slow
def test_the_end_of_a_run_at_the_limit_of_its_work_is_announced():
    """Steps that shrink towards a pole: 2e8 of them end at t = 2361.6; half the horizon is within the limit."""
    top = symtop.SymmetricTop(0.8710803565723452, 0.49843955501086307, 0.13722107388085694)
    start = symtop.Angles(3.1410985154196807, -0.08304298101407426, -2.291165214843636, psi_dot=1.1036538264419726)
    method = symtop.integrator("stormer-verlet-reversible")
    for horizon, ends in ((3821.2117810193176, True), (1900.0, False)):
        scene = symtop.Scene("hanging", top, start, horizon)
        plan, _ = make_plan(scene, method, step_size=0.029862566198022588, horizon=horizon, samples=11)
        warned = guard.warning(scene, method, "angles", plan)
        if ends:
            assert float(re.search(r"stopped at t = ([\d.]+) of", warned)[1]) == pytest.approx(2361.6, rel=0.01)
        else:
            assert warned == ""


def beside(moments, rates, periods):
    """A free body that turns over now and then."""
    body, start = symtop.RigidBody(*moments), symtop.Attitude(omega_body=rates)
    return symtop.Scene("beside", body, start, periods * body.nutation_period(start))


@pytest.mark.parametrize(("scene", "name", "setting", "alarm"), [
    ("heavy-brick", "rk4", 0.05, False), ("heavy-brick", "strang", 0.3, True), ("heavy-brick", "gauss-4", 0.1, False),
    ("tennis-racket", "strang", 0.3, True), ("tennis-racket", "kahan-li-8", 0.05, False),
    (beside((0.6, 0.73, 0.87), (2e-4, 1.7, -1e-4), 20.0), "crouch-grossman-3", 0.046, True),  # by 3 rad, at the second
    (beside((0.3, 0.35, 0.6), (-3e-9, 3.0, 1e-9), 104.0), "kahan-li-6", 0.087, True),
    (beside((0.36, 0.8, 0.86), (5e-9, 2.2, -1e-9), 53.0), "rk45-compiled", 2e-11, True),
    (beside((0.95, 0.72, 0.91), (-1.3e-9, -6e-10, 1.0), 130.0), "strang", 0.0138, True),  # by rounding, in the flips
    (beside((0.5, 0.8, 1.0), (math.sqrt(4 / 3) * (1 + 1e-9), 0.3, 1.0), 30.0), "rk4", 0.07, False),
    (beside((0.5, 0.8, 1.0), (math.sqrt(4 / 3) * (1 + 1e-10), 0.3, 1.0), 40.0), "gauss-4", 0.07, False),
    (beside((8.0101e37, 8.0103e37, 8.0365e37), (7e-11, 0.0, 7.292e-5), 20.0), "gauss-4", 600.0, False),  # Earth, in SI
])  # fmt: skip
def test_a_run_of_a_body_is_warned_of_where_its_attitude_is_lost(scene, name, setting, alarm):
    sentences = []
    run = symtop.simulate(scene, name, guard=sentences.append, **{symtop.integrator(name).control: setting})
    assert run.attrs["outcome"] != "ok" or bool(symtop.errors(run)["attitude"].max() > EXPECTED) is alarm
    assert bool(sentences) is alarm
    assert not alarm or re.search("expect an attitude error|expect the run|rounding alone", sentences[0])


@pytest.mark.parametrize("name", ["rk4", "strang", "gauss-4", "midpoint"])
@pytest.mark.parametrize("scene", ["spheroid", "goldstein", "loop"])
def test_a_top_that_is_integrated_is_forecast_as_by_its_closed_form(scene, name):
    scene, method = symtop.scene(scene), symtop.integrator(name)
    chart, period = method.chart_for("axis"), scene.nutation_period
    plan, _ = make_plan(scene, method, step_size=period / 40.0, horizon=50.0 * period, samples=101)
    motions = ExactMotion(scene), IntegratedMotion(scene)
    exact, series = (guard.forecast(scene, method, chart, plan, motion).axis_error for motion in motions)
    assert 0.25 < series / exact < 4.0


def test_the_guard_without_the_truth_is_asked_for_by_its_name():
    controls = {"step_size": 0.1, "samples": 11, "guard": "series"}
    with pytest.warns(symtop.SymtopWarning, match="expect an axis error.* 1/8.86 of a natural period"):
        symtop.simulate("spheroid", "midpoint", **controls)
    with warnings.catch_warnings(action="error"):
        symtop.simulate("spheroid", "gauss-4", **controls | {"step_size": 0.01})
    with pytest.raises(symtop.SymtopError, match="guard 'closed' is unknown; known: exact, series"):
        symtop.simulate("spheroid", "midpoint", **controls | {"guard": "closed"})
    with pytest.raises(symtop.SymtopError, match="guard must be series on heavy-brick, a body without symmetry"):
        symtop.simulate("heavy-brick", "rk4", **controls | {"guard": "exact"})


def test_a_run_far_longer_than_is_watched_is_warned_of_and_a_free_top_judged_like_any():
    for spin in (0.0, 0.5):
        scene = symtop.Scene("free", symtop.SymmetricTop(2, 1, 0), symtop.Angles(1, 0, 0, 1, 0, spin), 20.0)
        assert "expect an axis error" in caution(scene, "rk4[axis]", step_size=1.5)
        assert caution(scene, "rk4[axis]", step_size=1e-3) == ""
    disc = symtop.Scene("disc", symtop.RigidBody(1.0, 0.3, 0.7), symtop.Attitude(omega_body=(1.0, 0.0, 1e-9)), 343.0)
    doubling, right, infinite = (caution(disc, name, step_size=h) for name, h in WOBBLY)
    assert ("3 rad by t = 343" in doubling, right, "stopped at t =" in infinite) == (True, "", True)
    body = symtop.Scene("far", symtop.RigidBody(1.0, 2.0, 3.0), symtop.Attitude(omega_body=(1e-6, 1.0, 1e-6)), 1e22)
    assert "rounding alone decides" in caution(body, "rk4", step_size=1e15)


def test_changes_tell_chaos_from_order_and_unstable_motions_are_warned_of_beyond_their_piece():
    """What a method commits later than its piece may exceed it; a stable motion has no such margin."""
    for name, margin in (("heavy-chaotic", 30.0), ("heavy-brick", 1.0)):
        growth = (motion := IntegratedMotion(symtop.scene(name, bodies=True))).amplification(50.0, 50.0)
        expected = 1e-12 * margin * growth / motion.amplification(5.0, 50.0)
        assert motion.amplified(1e-12, 5.0, 50.0) == pytest.approx(expected)
        assert growth > 1e4 if margin > 1.0 else growth < 1e3


def fastest(scene, periods=40.0):
    """The largest angular velocity of a body over some natural periods, by the series."""
    motion = IntegratedMotion(symtop.Scene("body", scene.top, scene.start, periods * scene.nutation_period))
    states = motion.states(np.linspace(0.0, motion.scene.horizon, 2001)[1:], 1e-12)
    return float(np.linalg.norm(states[:, 4:] / np.array(scene.top.moments), axis=1).max())


def test_a_body_at_rest_that_falls_into_chaos_is_watched_with_steps_short_enough(monkeypatch):
    """It turns five times as fast as its natural period, and a change grows 2e14 times: the run is off by 2.9 rad."""
    centre = -0.16832199744994217, 0.1246126810504462, 0.977823800536621
    top = symtop.RigidBody(64.71510826337011, 65.93699830228155, 2.8344512930461883, 441.5149085593378, centre)
    quaternion = -0.47393681068836624, -0.09460717548517857, 0.2768361448418805, 0.8305390603278943
    scene = symtop.Scene("falling", top, symtop.Attitude(quaternion, (0.0, 0.0, 0.0)), 75.80899162607354)
    method, step = symtop.integrator("series-general"), 0.014985196599444847
    fine = IntegratedMotion(scene).states(np.array([scene.horizon]), 1e-15)
    coarse = symtop.simulate(scene, method, step_size=step, guard=False, samples=2)
    assert charts.attitude_distance(coarse.quaternion.values[-1:], fine[:, :4])[0] > 10.0 * EXPECTED
    assert "rounding alone decides" in caution(scene, method, step_size=step)
    assert caution(scene, method, step_size=step, horizon=48.0) == ""  # right to 1e-5
    monkeypatch.setattr("symtop.run.motion.PAIR_STEPS", 4)
    assert IntegratedMotion(scene).amplification(scene.horizon, scene.horizon) < 1e11  # the control


def test_passages_of_a_pole_add_up_and_what_was_lost_is_not_compared():
    """At 206 steps a nutation the errors of 20 passages nearly cancel, and the run is lost.

    A needle, whose tip passes its lower pole at 0.05 rad and precesses there by 178 rad per unit of time.
    """
    top = symtop.SymmetricTop(0.849078125775395, 9.310032999140425e-10, 12.174462255412678)
    start = symtop.Angles(0.23767446382442953, 1.8454010471293447, -0.6343726115524877, -4.183433893022597,
                          7.857719085937337, 22.33007075682596)  # fmt: skip
    scene, name = symtop.Scene("needle", top, start, 706.2087736496838), "stormer-verlet-blanes-moan-6"
    for step, is_lost in ((0.004708058490997893, True), (0.0015, False)):
        run = symtop.simulate(scene, name, step_size=step, guard=False)
        assert (float(symtop.errors(run)["axis"].max()) > EXPECTED) is is_lost
        assert bool(caution(scene, name, step_size=step)) is is_lost
    state, units = (1.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0), (1.0, 1.0)
    for broken_state in ((math.nan, *state[1:]), (1.002, *state[1:]), (*state[:6], math.inf)):
        assert all(math.isnan(_distance(*pair, units)) for pair in ((state, broken_state), (broken_state, state)))
    assert _distance(state, (*state[:6], 3.5), units) == 0.5
    assert _distance(state[1:], (1.002, *state[2:]), units) == 1.002  # an axis


def test_beside_a_pole_no_growth_is_seen_where_there_is_none_and_a_length_that_drifts_away_is():
    top = symtop.SymmetricTop(1.0, 1.6394085537167262, -1.0)
    start = symtop.Angles(2.2919252442665026, 0.0, 0.0, -0.31389947196684775, 3.9060646246484256, 3.388443612658759)
    scene = symtop.Scene("beside", top, start, 50.0 * (period := top.nutation_period(start)))
    assert caution(scene, "vern9-fixed[axis]", step_size=period / 100.0) == ""
    fine, coarse = (nutation_growth(symtop.integrator(name), scene, period / parts, "axis", math.tau / period).factor
                    for name, parts in (("vern9-fixed", 100.0), ("rkmk-se3-2", 3.0)))  # fmt: skip
    assert abs(fine - 1.0) < 1e-7
    assert coarse - 1.0 > 5e-3
    top = symtop.SymmetricTop(0.4577082721218755, 0.11243869742655017, 116.05806957319277)
    start = symtop.Angles(1.4123814e-3, -2.63782662, -1.424354898914134, 5.8594e-3, 18.072692920427624, 143.08986495395)
    scene = symtop.Scene("long", top, start, 56.3)
    assert "the quaternion's length left one" in caution(scene, "rk4[attitude]", step_size=1.948e-3)
    assert caution(scene, "rk4[attitude]", step_size=1.3e-3) == ""


def test_a_projection_onto_the_energy_lets_no_nutation_grow_and_a_run_of_two_to_three_nutations_is_tried_to_its_end():
    top = symtop.SymmetricTop(0.303997475828333, 0.303997475828333, -12.697265039041513)
    start = symtop.Angles(2.5666994720995975, phi_dot=280.2789550362906, psi_dot=192.3371013577066)
    scene, method = symtop.Scene("fast", top, start, 1.325), symtop.integrator("dop853-projected")
    assert caution(scene, "dop853-projected[axis]", step_size=1.7e-4) == ""  # right to 1e-13
    assert caution("spheroid", "vern9-projected", step_size=0.0884, horizon=1e5) == ""  # 6e-5 rad: the error grows as t
    for variant, noise in ((method, True), (replace(method, conserves=frozenset()), False)):
        growth = nutation_growth(variant, scene, 1.7e-4, "axis", guard.ExactMotion(scene).landmarks.frequency)
        assert (growth.factor - 1.0 < growth.doubt) is noise
    top, start = symtop.SymmetricTop(8.93085313694772, 17.86170627389544, 0.0), symtop.Angles(2.66, psi_dot=0.0401)
    scene = symtop.Scene("free", top, start, 190.0)
    assert symtop.simulate(scene, "dop853-compiled[attitude]", tolerance=2e-3, guard=False).outcome == "not_normalised"
    assert "left one" in caution(scene, "dop853-compiled[attitude]", tolerance=2e-3)


@pytest.mark.parametrize("x", [0.02, 0.6])
def test_a_step_of_eulers_method_multiplies_small_nutations_by_its_stability_function(x):
    frequency = landmarks(scene := symtop.scene("spheroid")).frequency
    growth = nutation_growth(symtop.runge_kutta("euler", ((),), (1.0,)), scene, x / frequency, "angles", frequency)
    assert abs(growth.factor - math.hypot(1.0, x)) < growth.doubt < 1e-7


def test_no_body_turns_much_faster_than_the_watch_takes_it_to():
    """By what the start says alone, the natural period and its own rate, some turn a fifth faster or more."""
    cases = [case for case in scenes_of(body_population(48, seed=29)) if math.isfinite(case.nutation_period)]
    np.testing.assert_allclose([case.horizon / case.nutation_period for case in cases], 10.0, rtol=1e-12)
    rates, bounds = np.array([(fastest(case), IntegratedMotion(case).fast) for case in cases]).T
    starts = [math.hypot(2.0 * math.pi / case.nutation_period, *case.start.omega_body) for case in cases]
    assert (rates / bounds).max() < 1.1
    assert np.median(rates / bounds) > 0.8
    assert (rates / np.array(starts)).max() > 1.2  # the control
