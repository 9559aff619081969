"""The guard on random runs and on motions that amplify their start: no wrong answer in silence, few false alarms."""

import dataclasses
import itertools
import math
import time
from fractions import Fraction

import numpy as np
import pytest

import symtop
from symtop.model import charts
from symtop.model.exact.digits import PreciseForm
from symtop.model.top import flat
from symtop.run import guard
from symtop.run.linear_stability import nutation_growth, trace
from symtop.run.motion import landmarks
from symtop.run.reference.sensitivity import conditioning, displacement
from symtop.run.simulation import make_plan
from tests.conftest import defer
from tests.hostile.random_runs import LONGEST, NEWER, draw_run, outcome_of, run_all, summary
from tests.run.test_guard import nutating

# runs of the first 20,000 that were wrong in silence, and of the next 40,000
SILENT = [
    *((k, 20_000) for k in (1055, 1275, 1763, 1892, 1976, 2577, 2896, 4661, 8100, 10078, 11067, 11649, 12727, 13569)),
    *((k, 20_000) for k in (16036, 16754, 17553, 18038, 18170, 18335)),
    *zip((3649, 13968, 6006, 6460, 9501, 4513, 9380), (1, 2, 4, 4, 5, 6, 6), strict=True),
]
FALSE = [74, 511, 780, 990, 1929, 2413, 4178, 5013]  # right runs that were warned of growth that was none


@pytest.mark.parametrize(("k", "seed"), [*SILENT[::3], *defer(*SILENT[1::3], *SILENT[2::3])])
def test_what_was_wrong_in_silence_is_warned_of(k, seed):
    run = outcome_of(k, seed)
    assert run.wrong
    assert run.warning


@pytest.mark.parametrize("k", FALSE)
def test_what_is_right_is_not_warned_of(k):
    run = outcome_of(k)
    assert run.right
    assert run.warning == ""


OLDER = tuple(name for name in symtop.integrators() if name not in NEWER)


@pytest.mark.quick
@pytest.mark.parametrize(("count", "without"), [
    (28, NEWER), (40, OLDER), pytest.param(1500, NEWER, marks=pytest.mark.slow)])  # fmt: skip
def test_random_runs_are_not_wrong_in_silence(count, without):
    """Many in a process apart, which may end or not; a few here."""
    runs = run_all(count, 3, without) if count > 40 else [outcome_of(k, 3, without=without) for k in range(count)]
    assert not {run.integrator for run in runs} & {*without}
    assert sum(run.wrong for run in runs) > 2
    assert not [run for run in runs if run.wrong and not run.warning], summary(runs)
    assert not [run for run in runs if run.outcome in ("endless", "crashed") or run.seconds > LONGEST], summary(runs)
    right = [run for run in runs if run.right]
    assert len(right) > count / 4
    assert sum(bool(run.warning) for run in right) < max(0.01 * len(right), 3), summary(runs)


def test_growth_is_that_of_linear_theory_for_methods_that_are_not_symmetric_and_knows_its_rounding():
    """rk4 damps: |R(i x)|^2 = 1 - x^6/72 + x^8/576. Of engines of first order some grow and some damp."""
    scene = nutating()
    frequency = landmarks(scene).frequency
    growth = lambda name, turn: nutation_growth(symtop.integrator(name), scene, turn / frequency, "axis", frequency)
    for turn in (0.5, 1.0, 1.5):
        assert growth("rk4", turn).factor == pytest.approx(math.sqrt(1.0 - turn**6 / 72.0 + turn**8 / 576.0), rel=5e-3)
    assert growth("strang", 0.5).factor == pytest.approx(1.0, abs=1e-5)  # it is symmetric
    for name, sign in (("physx", 1.0), ("rapier", 1.0), ("yade", -1.0), ("bullet", -1.0)):
        assert sign * (growth(name, 0.1).factor - 1.0) > 1e-3
    # in fifty fine steps the motion hardly turns, and two roots cannot be told apart: that is no growth
    for turn in (1e-3, 1e-4, 1e-5, 1e-6):  # the truth is 1 - turn^6/144
        fine = growth("rk4", turn)
        assert abs(fine.factor - 1.0) <= fine.doubt
    assert growth("rk4", 0.5).doubt < 1e-7
    engine = growth("rapier", 0.01)
    assert engine.factor - 1.0 > 10.0 * engine.doubt  # the control: growth that is there is seen


def test_growth_does_not_see_what_two_runs_share():
    """The control: the trace of the same method and step takes a drift for growth."""
    run = draw_run(74)
    scene, method, step = run.scene(), symtop.integrator(run.integrator), run.control["step_size"]
    frequency = landmarks(scene).frequency
    assert trace(method, scene, step, "axis").growth > 1.005
    assert nutation_growth(method, scene, step, "axis", frequency).factor == pytest.approx(1.0, abs=1e-6)


def test_a_probe_ends_where_a_solver_takes_ever_smaller_steps(monkeypatch):
    """Beside a pole in the angles chart a solver takes ever smaller steps: the probe took as long as the run, 29 s."""
    assert guard.MOST_WORK == {"compiled": 5e6, "python": 5e5}
    for implementation, limit in guard.MOST_WORK.items():  # a tenth of the work and less than a tenth of the time
        monkeypatch.setitem(guard.MOST_WORK, implementation, limit / 10.0)
    run = draw_run(620, 2)
    scene, method = run.scene(), symtop.integrator(run.integrator)
    plan, _ = make_plan(scene, method, tolerance=run.control["tolerance"], horizon=run.horizon, samples=11)
    start = time.process_time()
    assert guard.forecast(scene, method, "angles", plan).outcome == "out_of_budget"
    assert time.process_time() - start < 1.5


# I1, I3, mgl, theta, theta', psi', method, observed, tolerance, horizon: of random runs, those that nobody warned of
CALM = [
    (3.066, 3.664, 20.93, 5.625e-08, 0.0, 4.259, "lsoda", "attitude", 7.1e-6, 124.0),
    (1.013, 1.0997, 0.7126, 2.3655e-4, 0.0, 0.8863, "lsoda", "attitude", 1.74e-7, 94.0),
    (2.9908668545839157, 4.5, 10.158360686738936, 0.8929912156902926, 1.591597688, 0.0, "dop853", "axis", 5.5e-7, 65.8),
    (3.6568154168556344, 3.7, 38.51315691592893, 1.6200118443501565, -4.7010652464, 0.0, "dop853", "axis", 2e-8, 11.4),
    (0.406, 0.6634, 5.0126, 0.0027228, 0.0, 1.84047, "radau", "attitude", 1.2e-3, 5.44),
]  # fmt: skip


def sleeper(tilt, ratio=0.9):
    """A top let go almost upright, at a share of the spin from which it sleeps."""
    top = symtop.SymmetricTop(1.3, 0.7, 2.1)
    spin = ratio * 2.0 * math.sqrt(top.I1 * top.mgl) / top.I3
    return symtop.Scene("sleeper", top, symtop.Angles(tilt, psi_dot=spin), 50.0)


@pytest.mark.parametrize("case", CALM, ids=lambda case: f"{case[6]}-{case[3]:.1g}")
def test_the_guard_warns_where_the_motion_grows_what_a_tolerance_leaves(case):
    I1, I3, mgl, theta, theta_dot, psi_dot, name, observe, tolerance, horizon = case
    top, start = symtop.SymmetricTop(I1, I3, mgl), symtop.Angles(theta, 0.3, 0.1, theta_dot, 0.0, psi_dot)
    scene, messages = symtop.Scene("unstable", top, start, horizon), []
    run = symtop.simulate(scene, name, tolerance=tolerance, observe=observe, samples=201, guard=messages.append)
    truth = symtop.ClosedForm(top, start).axis(run["time"].values)
    assert run.attrs["outcome"] == "ok"
    assert charts.axis_distance(run["axis"].values, truth).max() > 0.05
    assert len(messages) == 1
    assert "try tolerance" in messages[0]


@pytest.mark.parametrize("tilt", [1e-3, 1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize("ratio", [0.9, *(pytest.param(share, marks=pytest.mark.slow) for share in (0.3, 0.99))])
def test_what_two_integrations_differ_by_is_the_start_and_not_the_closed_form(tilt, ratio):
    """heyoka in quadruple precision, from the same doubles, is where the bound says.

    From a momentum that is rounded once more, as in an integration that starts from (e, L) in doubles, it is not.
    """
    pytest.importorskip("heyoka")
    from symtop.run.reference.independent_checks import integrate

    scene = sleeper(tilt, ratio)
    times = np.linspace(0.0, 2.0 * scene.nutation_period, 21)[1:]
    truth = symtop.reference(scene, times)
    quad, _ = integrate(scene, times, "quad")
    distances = charts.axis_distance(charts.axis_from_quaternion(quad[:, :4].astype(float)), truth["axis"].values)
    assert (distances <= truth["axis_error_bound"]).all()
    rounding = np.finfo(float).eps * scene.top.I3 * scene.start.psi_dot / scene.top.I1
    axes = symtop.ClosedForm(scene.top, dataclasses.replace(scene.start, theta_dot=rounding)).axis(times)
    shift = charts.axis_distance(axes, truth["axis"].values).max()
    assert shift < 10.0 * conditioning(scene, float(times[-1])) * np.finfo(float).eps
    if tilt <= 1e-5:
        assert shift > 1e2 * truth["axis_error_bound"].max()
        assert "rounding the start anew moves the axis by" in truth.attrs["conditioning"]


def test_it_is_silent_where_the_motion_is_stable_and_conditioning_is_its_growth():
    scenes = sleeper(1e-3, 1.2), symtop.scene("spheroid"), symtop.scene("goldstein")
    for scene, name in itertools.product(scenes, ("dop853", "lsoda", "rk45")):
        method = symtop.integrator(name)
        plan, _ = make_plan(scene, method, tolerance=1e-8, horizon=5.0 * scene.nutation_period, samples=101)
        assert guard.warning(scene, method, method.chart_for("axis"), plan) == ""
    flat, steep = conditioning(symtop.scene("spheroid"), 5.0), conditioning(sleeper(1e-6), 60.0)
    assert 1.0 <= flat < 100.0
    assert steep > 1e5
    assert displacement(sleeper(1e-6), 1e-9, 60.0) > 1e-5
    assert "rounding" not in symtop.reference("spheroid", [5.0]).attrs["conditioning"]


@pytest.mark.parametrize(("name", "time"), [("separatrix", 100.0), ("spheroid", 1e15), ("spheroid", 1e25)])
def test_where_one_rounding_moves_the_axis_anywhere_the_answer_says_so(name, time):
    """A distance ends at pi: divided by a change that departs as far it is far below the growth."""
    scene = symtop.scene(name)
    words, factor = symtop.reference(scene, [time]).attrs["conditioning"], conditioning(scene, time)
    assert words.startswith("at least ")
    assert "or more: nothing is known of the axis" in words
    times, starts = np.linspace(0.0, time, 101)[1:], [scene.start]
    for rate in ("phi_dot", "psi_dot"):
        ulp_more = math.nextafter(getattr(scene.start, rate), math.inf)
        starts.append(dataclasses.replace(scene.start, **{rate: ulp_more}))
    true, *paths = (symtop.ClosedForm(scene.top, start).axis(times) for start in starts)
    shift = max(charts.axis_distance(path, true).max() for path in paths)
    assert shift > 0.3
    assert factor * np.finfo(float).eps > shift / 10.0


@pytest.mark.parametrize("time", [64.0, 68.0])
def test_where_a_small_change_departs_far_a_smaller_one_shows_the_growth(time):
    """Against a change of 1e-25 in 50 digits: that of 64 roundings shows 0.78 and 0.12 of its growth."""
    scene, change = symtop.scene("separatrix"), Fraction(1, 10**25)
    start = [Fraction(value) for value in flat(scene.top, scene.start)[3:]]
    neighbour = start[:3] + [rate * (1 + change) for rate in start[3:]]
    first, second = (PreciseForm(scene.top, numbers, 50).axis(time) for numbers in (start, neighbour))
    growth = math.hypot(*(float((a - b) * 10**25) for a, b in zip(first, second, strict=True)))
    assert conditioning(scene, time) == pytest.approx(growth, rel=0.1)


@pytest.mark.parametrize("I3", [1e-30, *(pytest.param(I3, marks=pytest.mark.slow) for I3 in (1e-6, 1e-18, 1e-40))])
def test_exact_is_right_for_a_top_without_inertia_about_its_axis(I3):
    for start in (symtop.Angles(1.0, psi_dot=2.0), symtop.Angles(2.5, 0.1, 0.2, -1.0, 0.0, -3.0)):
        scene = symtop.Scene("needle", symtop.SymmetricTop(1.0, I3, 1.0), start, 20.0)
        run, form = symtop.simulate(scene, "exact", samples=11), PreciseForm(scene.top, scene.start, 40)
        true = np.array([[float(part) for part in form.quaternion(float(t))] for t in run["time"].values])
        assert charts.attitude_distance(run["quaternion"].values, true).max() < 4e-15
