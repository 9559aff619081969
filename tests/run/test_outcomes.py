"""How runs end: every outcome produced, said and timed; no run hangs; runs judged afterwards; scenes built to fail."""

import json
import math
import re
import time

import numpy as np
import pytest
from click.testing import CliRunner

import symtop
from symtop.cli.main import main
from symtop.measure.verdicts import VERDICTS, barriers, judge, judgement, verdict
from symtop.methods.outcomes import OUTCOMES
from symtop.model import charts
from symtop.model.scenes import closed_form, grazing, sleeping, spinning, steady

# ---- outcomes in the kernels -----------------------------------------------------------------------------------------

HUGE = symtop.Scene("huge", symtop.SymmetricTop(1.0, 1.0, 1e30), symtop.Angles(theta=1.0, psi_dot=1.0), 8.0)


@pytest.mark.parametrize(
    ("scene", "name", "knobs", "outcome"),
    [
        ("spheroid", "stormer-verlet", {"step_size": 1.0, "horizon": 50.0}, "left_chart"),
        ("spheroid", "rk4", {"step_size": 0.4, "horizon": 40.0}, "left_chart"),
        ("bruls-cardona-arnold", "rk45", {"tolerance": 0.5}, "left_chart"),
        ("spheroid", "gauss-2", {"step_size": 0.5, "observe": "axis"}, "not_converged"),
        ("sleeping", "trapezoidal", {"step_size": 2.0, "horizon": 4000.0}, "not_converged"),
        ("simo-wong", "rk4", {"step_size": 1.0, "observe": "axis"}, "not_finite"),
        (grazing(1e-14), "rk45-compiled", {"tolerance": 1e-12}, "step_too_small"),
        ("spheroid", "rk45-compiled", {"tolerance": 1e-9, "budget": 100}, "out_of_budget"),
        ("spheroid", "dop853", {"tolerance": 1e-9, "budget": 100}, "out_of_budget"),
        ("spheroid", "taylor", {"budget": 3}, "out_of_budget"),
    ],
)
def test_every_outcome_is_produced_said_and_timed(scene, name, knobs, outcome):
    run = symtop.simulate(scene, name, samples=201, guard=False, **knobs)
    reached = run.attrs["reached_time"]
    assert run.attrs["outcome"] == outcome
    assert re.fullmatch(rf"stopped at t = {reached:.6g} of [\d.e+-]+: .+; .+", run.attrs["outcome_message"])
    assert 0.0 <= reached < run.attrs["horizon"]
    known = np.isfinite(run["axis"].values).all(axis=1)
    after = run["time"].values > reached * (1.0 + 1e-9)
    assert known[0]
    assert not known[after].any()  # nothing is made up


def test_a_budget_is_no_failure_for_a_run_that_ends_within_it():
    free = symtop.simulate("spheroid", "rk45-compiled", tolerance=1e-6)
    count = free.attrs["force_evaluations"]
    assert symtop.simulate("spheroid", "rk45-compiled", tolerance=1e-6, budget=count).equals(free)
    assert symtop.simulate("spheroid", "rk45", tolerance=1e-6, budget=count + 2).attrs["outcome"] == "ok"
    assert symtop.simulate("spheroid", "taylor", budget=1e4).attrs["outcome"] == "ok"
    with pytest.raises(symtop.SymtopError, match="the limit is 700"):
        symtop.simulate("spheroid", "midpoint", step_size=0.01, budget=700)
    assert symtop.simulate("spheroid", "midpoint", step_size=0.01, budget=800).attrs["outcome"] == "ok"


@pytest.mark.parametrize("name", ["midpoint", "trapezoidal", "simpson-linear", "galerkin-simpson"])
@pytest.mark.parametrize("turn", [0.3, 1.0, 1.9])
def test_implicit_steps_are_solved_where_nothing_moves_but_rounding(name, turn):
    """On a steady precession the increment of theta is rounding, and no correction is small beside it."""
    for scene in (steady(20.0), symtop.scene("steady")):
        frequency = scene.top.nutation_frequency(scene.top.momenta(scene.start))
        h = turn / frequency
        run = symtop.simulate(scene, name, step_size=h, horizon=1000 * h, samples=101, guard=False)
        assert run.attrs["outcome"] == "ok"
        assert run.attrs["newton_iterations"] < 7 * run.attrs["steps"]
        assert float(np.abs(run["theta"] - math.pi / 3.0).max()) < 1e-11


# ---- a run never hangs -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scene", "name", "knobs"),
    [
        ("spheroid", "midpoint", {"step_size": 1e-300}),
        ("spheroid", "stormer-verlet", {"step_size": 5e-324}),
        ("spheroid", "midpoint", {"step_size": 0.01, "horizon": 1e300}),
        ("spheroid", "strang", {"step_size": 1e299, "horizon": 1e300}),
        ("spheroid", "rk45", {"tolerance": 1e-6, "horizon": 1e300}),
        ("separatrix", "rk45-compiled", {"tolerance": 1e-6, "horizon": 1e300}),
        ("spheroid", "taylor", {"horizon": 1e300}),
        ("spheroid", "exact", {"horizon": 1e300}),
        ("spheroid", "rk45", {"tolerance": 1e-300}),
        ("spheroid", "dop853", {"tolerance": 1e300}),
        ("spheroid", "taylor", {"tolerance": 1e-300}),
        (HUGE, "midpoint", {"step_size": 0.01}),
        (HUGE, "galerkin-simpson", {"step_size": 0.01}),
        (HUGE, "stormer-verlet", {"step_size": 0.01}),
        (HUGE, "strang", {"step_size": 0.01}),
        (HUGE, "gauss-8", {"step_size": 0.01}),
        (HUGE, "rk4", {"step_size": 0.01}),
        (HUGE, "rk45", {"tolerance": 1e-6}),
        (HUGE, "rk45-compiled", {"tolerance": 1e-6}),
        (HUGE, "taylor", {}),
    ],
)
def test_absurd_runs_end_at_once_with_a_sentence(scene, name, knobs):
    symtop.simulate("spheroid", name, guard=False, **({"step_size": 0.1} if "step_size" in knobs else _fine(name)))
    start, heard = time.process_time(), []  # of this process: others may be busy
    try:
        run = symtop.simulate(scene, name, guard=heard.append, **knobs)
        said = run.attrs["outcome_message"] if run.attrs["outcome"] != "ok" else heard[0]
    except symtop.SymtopError as error:
        said = str(error)
    assert time.process_time() - start < 2.0
    assert len(said) > 20
    assert "\n" not in said


def _fine(name):
    return {} if name in ("taylor", "exact") else {"tolerance": 1e-3}


# ---- judged afterwards -----------------------------------------------------------------------------------------------


def judged(scene, name, **knobs):
    run = symtop.simulate(scene, name, guard=False, **knobs)
    scene = symtop.scene(scene)
    error = charts.axis_distance(run["axis"].values, closed_form(scene).axis(run["time"].values))
    found = judgement(scene, run, error)
    assert found.verdict == verdict(scene, run, error)
    return found


@pytest.mark.parametrize(
    ("scene", "name", "knobs", "word", "says"),
    [
        ("goldstein", "strang", {"step_size": 0.01}, "accurate", "accurate to"),
        ("goldstein", "strang", {"step_size": 0.3}, "bounded_but_wrong", "while the energy stayed within"),
        ("goldstein", "rk4", {"step_size": 1.0, "horizon": 400.0, "observe": "axis"}, "drifting", "grew on"),
        ("sleeping", "strang", {"step_size": 2.55, "horizon": 400.0}, "wrong_regime", "never goes"),
        ("spheroid", "stormer-verlet", {"step_size": 1.0, "horizon": 50.0}, "left_chart", "stopped at"),
    ],
)
def test_each_fate_is_judged_with_its_time_and_cause(scene, name, knobs, word, says):
    found = judged(scene, name, **knobs)
    assert found.verdict == word, found
    assert says in found.sentence
    assert 0.0 <= found.time <= knobs.get("horizon", symtop.scene(scene).horizon) * (1.0 + 1e-12)


def test_a_pole_passed_on_the_wrong_side_is_a_wrong_regime():
    where = grazing(1e-3)
    good = symtop.simulate(where, "exact", samples=201)
    error = np.full(201, 0.5)
    assert verdict(where, good, error) == "bounded_but_wrong"
    beyond = good.assign(p_phi=good["p_phi"] - np.where(good["time"] > 2.0, 2e-3, 0.0))
    assert verdict(where, beyond, error) == "wrong_regime"
    assert "passed a pole" in judgement(where, beyond, error).sentence


def test_the_command_line_judges_a_run():
    for name, says in (("0.01", "accurate, accurate to"), ("0.3", "bounded_but_wrong, the axis error passed")):
        done = CliRunner().invoke(main, ["run", "goldstein", "strang", "--step-size", name, "--no-guard"])
        assert f"judged against the truth: {says}" in done.output
    few = CliRunner().invoke(main, ["run", "goldstein", "strang", "--step-size", "0.3", "--samples", "2", "--json"])
    assert json.loads(few.stdout)["judgement"]["verdict"] == "bounded_but_wrong"


def test_a_million_runs_are_judged_as_one_is():
    rng = np.random.default_rng(1)
    truth = barriers(symtop.scene("spheroid"))
    shape = (40, 50)
    outcome = np.where(rng.random(shape) < 0.2, rng.integers(1, len(OUTCOMES), shape), 0)
    error = 10.0 ** rng.uniform(-4.0, 0.0, shape)
    low, high = rng.uniform(0.2, 0.5, shape), rng.uniform(1.6, 1.9, shape)
    early, late = rng.uniform(0.0, 0.03, shape), rng.uniform(0.0, 0.03, shape)
    words = judge(truth, outcome, error, low, high, early, late)
    assert words.shape == shape
    assert set(np.unique(words)) == set(range(len(VERDICTS)))
    for index in np.ndindex(8, 50):
        alone = judge(truth, *(part[index] for part in (outcome, error, low, high, early, late)))
        assert alone == words[index]
        if outcome[index]:
            assert VERDICTS[alone] == OUTCOMES[outcome[index]]
    nothing = (math.nan,) * 5
    assert VERDICTS[int(judge(truth, 0, *nothing))] == "wrong_regime"  # NaN is never accurate


# ---- scenes with their failure built in ------------------------------------------------------------------------------


@pytest.mark.parametrize("delta", [1e-1, 1e-3, -1e-3, 1e-6])
def test_grazing_misses_the_pole_by_eleven_tenths_of_its_gap(delta):
    where = grazing(delta)
    momenta = where.top.momenta(where.start)
    assert momenta.north == pytest.approx(delta, rel=1e-9)
    assert momenta.p_psi == pytest.approx(1.0, rel=1e-15)
    assert closed_form(where).theta_range[0] == pytest.approx(1.105 * abs(delta), rel=0.05)
    assert where.nutation_period == pytest.approx(where.horizon, rel=0.03)


def test_a_top_sleeps_above_the_threshold_and_falls_below_it():
    assert closed_form(sleeping(2.05)).theta_range[1] < 0.01
    slow = sleeping(1.9, 1e-5)
    assert closed_form(slow).theta_range[1] == pytest.approx(math.acos(0.5 * 1.9**2 - 1.0), rel=1e-6)
    theta = closed_form(slow)(np.array([20.0, 22.0])).theta
    assert math.log(theta[1] / theta[0]) / 2.0 == pytest.approx(0.5 * math.sqrt(4.0 - 1.9**2), rel=1e-3)


def test_steady_precession_is_steady_and_impossible_below_its_spin():
    for spin in (3.0, 20.0, 100.0):
        low, high = closed_form(steady(spin)).theta_range
        assert high - low < 1e-7
    with pytest.raises(symtop.SymtopError, match="spin must be at least"):
        steady(2.5)


def test_the_separatrix_never_comes_back():
    where = symtop.scene("separatrix")
    times = np.array([1.0, 5.0, 15.0])
    cosine = np.cos(closed_form(where)(times).theta)
    assert cosine == pytest.approx(1.0 / (1.0 + 1.0 / np.cosh(times)), abs=1e-12)  # g = 1


def test_families_carry_their_parameter_in_their_name():
    names = [make(value).name for make in (spinning, grazing, sleeping, steady) for value in (3.0, 4.5)]
    assert len(set(names)) == len(names)
    assert spinning(10.0, name="cusp").start == symtop.scene("cusp").start
    assert {"grazing", "sleeping", "sleeping-unstable", "separatrix", "steady-fast"} <= set(symtop.scenes())
