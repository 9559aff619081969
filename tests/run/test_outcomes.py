"""How runs end: every outcome produced, with its sentence and its time; no run hangs."""

import math
import re
import time

import numpy as np
import pytest

import symtop
from symtop.model import charts
from symtop.model.scenes import grazing, steady

HUGE = symtop.Scene("huge", symtop.SymmetricTop(1.0, 1.0, 1e30), symtop.Angles(theta=1.0, psi_dot=1.0), 8.0)


@pytest.mark.parametrize(("scene", "name", "controls", "outcome"), [
    ("spheroid", "stormer-verlet", {"step_size": 1.0, "horizon": 50.0}, "left_chart"),
    ("spheroid", "rk4", {"step_size": 0.4, "horizon": 40.0}, "left_chart"),
    ("bruls-cardona-arnold", "rk45", {"tolerance": 0.5}, "left_chart"),
    ("spheroid", "gauss-2", {"step_size": 10.0, "horizon": 200.0, "observe": "axis"}, "not_converged"),
    ("sleeping", "trapezoidal", {"step_size": 2.0, "horizon": 4000.0}, "not_converged"),
    ("simo-wong", "rk4", {"step_size": 1.0, "observe": "axis"}, "not_finite"),
    (grazing(1e-14), "rk45-compiled", {"tolerance": 1e-12}, "step_too_small"),
    ("spheroid", "rk45-compiled", {"tolerance": 1e-9, "budget": 100}, "out_of_budget"),
    ("spheroid", "dop853", {"tolerance": 1e-9, "budget": 100}, "out_of_budget"),
    ("spheroid", "taylor", {"budget": 3}, "out_of_budget"),
    ("spheroid", "taylor", {"tolerance": 1e-9, "budget": 40, "samples": 2}, "out_of_budget"),
    ("spheroid", "rk45-compiled", {"tolerance": 1e-9, "budget": 40, "samples": 2}, "out_of_budget"),
    ("spheroid", "rk4[attitude]", {"step_size": 0.2}, "not_normalised"),
])  # fmt: skip
def test_every_outcome_is_produced_said_and_timed(scene, name, controls, outcome):
    run = symtop.simulate(scene, name, guard=False, **{"samples": 201, **controls})
    reached, unit = run.attrs["reached_time"], symtop.scene(scene).second
    assert run.attrs["outcome"] == outcome
    assert re.fullmatch(rf"stopped at t = {reached:.6g} of [\d.e+-]+{unit}: .+; .+", run.attrs["outcome_message"])
    assert 0.0 <= reached < run.attrs["horizon"]
    assert reached > 0.0 or outcome != "out_of_budget"
    known = np.isfinite(run["axis"].values).all(axis=1)
    after = run["time"].values > reached * (1.0 + 1e-9)
    assert known[0]
    assert not known[after].any()  # nothing is made up


def test_an_early_end_is_announced_and_a_budget_that_was_kept_is_no_failure():
    for gap, tolerance, outcome in ((1e-14, 1e-9, "step_too_small"), (1e-6, 1e-6, "ok")):
        sentences, controls = [], {"observe": "nutation", "samples": 11}
        run = symtop.simulate(grazing(gap), "radau", tolerance=tolerance, guard=sentences.append, **controls)
        assert run.attrs["outcome"] == outcome
        assert len(sentences) == (outcome != "ok")
        reached = f"expect the run to be stopped at t = {run.attrs['reached_time']:.6g} "
        assert all(reached in sentence and "step size fell below" in sentence for sentence in sentences)
    free = symtop.simulate("spheroid", "rk45-compiled", tolerance=1e-6)
    count = free.attrs["force_evaluations"]
    assert symtop.simulate("spheroid", "rk45-compiled", tolerance=1e-6, budget=count).equals(free)
    assert symtop.simulate("spheroid", "rk45", tolerance=1e-6, budget=count + 2).attrs["outcome"] == "ok"
    assert symtop.simulate("spheroid", "taylor", budget=1e4).attrs["outcome"] == "ok"
    with pytest.raises(symtop.SymtopError, match="the limit is 700"):
        symtop.simulate("spheroid", "midpoint", step_size=0.01, budget=700)
    assert symtop.simulate("spheroid", "midpoint", step_size=0.01, budget=800, guard=False).attrs["outcome"] == "ok"


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


@pytest.mark.parametrize(("scene", "name", "controls"), [
    ("spheroid", "midpoint", {"step_size": 1e-300}),
    ("spheroid", "midpoint", {"step_size": 0.01, "horizon": 1e300}),
    ("spheroid", "strang", {"step_size": 1e299, "horizon": 1e300}),
    ("spheroid", "rk45", {"tolerance": 1e-6, "horizon": 1e300}),
    ("separatrix", "rk45-compiled", {"tolerance": 1e-6, "horizon": 1e300}),
    ("spheroid", "taylor", {"horizon": 1e300}),
    ("spheroid", "exact", {"horizon": 1e300}),
    ("spheroid", "dop853", {"tolerance": 1e300}),
    *((HUGE, name, {"step_size": 0.01}) for name in ("midpoint", "galerkin-simpson", "stormer-verlet", "strang")),
    *((HUGE, name, {"step_size": 0.01}) for name in ("gauss-8", "rk4")),
    *((HUGE, name, {"tolerance": 1e-6}) for name in ("rk45", "rk45-compiled", "taylor")),
])  # fmt: skip
def test_absurd_runs_end_at_once_with_a_sentence(scene, name, controls):
    usual = {None: {}, "step_size": {"step_size": 0.1}, "tolerance": {"tolerance": 1e-3}}
    symtop.simulate("spheroid", name, guard=False, **usual[symtop.integrator(name).control])
    start, sentences = time.process_time(), []  # of this process: others may be busy
    try:
        run = symtop.simulate(scene, name, guard=sentences.append, **controls)
        sentence = run.attrs["outcome_message"] if run.attrs["outcome"] != "ok" else sentences[0]
    except symtop.SymtopError as error:
        sentence = str(error)
    assert time.process_time() - start < 2.0
    assert len(sentence) > 20
    assert "\n" not in sentence


@pytest.mark.parametrize(("name", "step_size"), [("rk4[attitude]", 0.2), ("series[attitude]", 0.5)])
def test_a_quaternion_that_leaves_length_one_has_failed_alone_and_in_an_ensemble(name, step_size):
    options = {"step_size": step_size, "horizon": 8.0, "samples": 41}
    run = symtop.simulate("spheroid", name, **options, guard=False)
    assert run.attrs["outcome"] == "not_normalised"
    assert "0.1 %" in run.attrs["outcome_message"]
    shown = np.isfinite(run["quaternion"].values).all(axis=1)
    assert 0 < shown.sum() < shown.size
    assert (np.diff(shown.astype(int)) <= 0).all()  # nothing after the failure
    lengths = np.linalg.norm(run["quaternion"].values[shown], axis=1)
    assert np.abs(lengths - 1.0).max() <= 1e-3
    assert run.attrs["reached_time"] == run["time"].values[shown][-1]
    assert np.isnan(run["p_phi"].values[~shown]).all()
    assert np.nanmax(symtop.errors(run)["attitude"].values) <= np.pi
    many = symtop.ensemble(["spheroid", "goldstein"], name, **options, observe="attitude", quiet=True).isel(member=0)
    assert many["outcome"].item() == "not_normalised"
    assert many["reached_time"].item() == run.attrs["reached_time"]
    np.testing.assert_array_equal(many["quaternion"].values[: shown.size], run["quaternion"].values)


DOUBTFUL = symtop.Scene(
    "doubtful", symtop.SymmetricTop(0.1862, 0.2285, 0.1828), symtop.Angles(0.00337, psi_dot=-1.61), 87.0
)


def test_a_quaternion_that_keeps_its_length_has_not_failed_and_a_state_whose_squares_overflow_is_not_finite():
    run = symtop.simulate("spheroid", "strang[attitude]", step_size=0.5, guard=False)
    assert run.attrs["outcome"] == "ok"
    near = symtop.simulate("spheroid", "rk4[attitude]", step_size=0.05, guard=False)
    assert near.attrs["outcome"] == "ok"
    assert np.abs(np.linalg.norm(near["quaternion"].values, axis=1) - 1.0).max() > 5e-4
    far = charts.attitude_distance(np.array([3e116, 0.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0, 0.0]))
    assert far == np.pi
    # L is finite, about 1e160; the energy is the square of it.
    run = symtop.simulate(DOUBTFUL, "rk4[axis]", step_size=43.5, horizon=130.5, guard=False)
    assert np.isfinite(run["axis"].values).all()
    assert not np.isfinite(run["energy"].values).all()
    assert (run.attrs["outcome"], run.attrs["reached_time"]) == ("not_finite", 87.0)
    both = symtop.ensemble([DOUBTFUL] * 2, "rk4[axis]", step_size=43.5, horizon=130.5, quiet=True)
    assert both["outcome"].values.tolist() == ["not_finite"] * 2
    assert both["reached_time"].values.tolist() == [87.0] * 2
    good = symtop.simulate(DOUBTFUL, "rk4[axis]", step_size=0.5, guard=False)  # the control
    assert good.attrs["outcome"] == "ok"


def test_every_variant_shows_finite_numbers_or_says_that_it_does_not():
    draw, ended = np.random.default_rng(50), set()
    for row in (method.variant(chart) for method in symtop.integrators().values() for chart in method.charts()):
        for _ in range(4):
            I1, mgl, rate = 10.0 ** draw.uniform(-2.0, 2.0, 3)
            top = symtop.SymmetricTop(I1, I1 * draw.uniform(0.05, 1.95), mgl * draw.choice([-1.0, 1.0]))
            start = symtop.Angles(
                draw.choice([1e-3, 1.0, 3.0]), theta_dot=rate, psi_dot=draw.choice([-1.0, 1.0]) * rate
            )
            h = 10.0 ** draw.uniform(0.0, 4.0) / rate
            scene, control = symtop.Scene("drawn", top, start, 4.0 * h if row.fixed_step else 20.0 / rate), {}
            if row.control == "step_size":
                control = {"step_size": h}
            elif row.control == "tolerance":
                control = {"tolerance": max(10.0 ** draw.uniform(-6.0, -0.1), row.least_tolerance), "budget": 2000}
            run = symtop.simulate(scene, row, **control, guard=False)
            finite = all(np.isfinite(values).all() for values in run.data_vars.values())
            assert finite or run.attrs["outcome"] != "ok", (row.name, scene, control)
            ended.add(run.attrs["outcome"])
    assert {"ok", "not_finite", "left_chart"} <= ended
