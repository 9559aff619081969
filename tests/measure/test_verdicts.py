"""How runs are judged afterwards: each verdict with its time and its cause, one by one and in bulk."""

import json

import numpy as np
import pytest

import symtop
from symtop.measure.verdicts import judgement
from symtop.model import charts
from symtop.model.scenes import closed_form, grazing
from tests.commands import call


@pytest.mark.parametrize(("scene", "name", "controls", "word", "phrase"), [
    ("goldstein", "strang", {"step_size": 0.01}, "accurate", "accurate to"),
    ("goldstein", "strang", {"step_size": 0.3}, "bounded_but_wrong", "while the energy stayed within"),
    ("goldstein", "rk4", {"step_size": 1.0, "horizon": 400.0, "observe": "axis"}, "drifting", "grew on"),
    ("sleeping", "strang", {"step_size": 2.55, "horizon": 400.0}, "wrong_regime", "never goes"),
    ("spheroid", "stormer-verlet", {"step_size": 1.0, "horizon": 50.0}, "left_chart", "stopped at"),
])  # fmt: skip
def test_each_fate_is_judged_with_its_time_and_cause(scene, name, controls, word, phrase):
    run, scene = symtop.simulate(scene, name, guard=False, **controls), symtop.scene(scene)
    error = charts.axis_distance(run["axis"].values, closed_form(scene).axis(run["time"].values))
    result = judgement(scene, run, error)
    assert result.verdict == word, result
    assert phrase in result.sentence
    assert 0.0 <= result.time <= controls.get("horizon", scene.horizon) * (1.0 + 1e-12)


@pytest.mark.parametrize(("first", "last", "excess", "error", "word"), [
    (0.0, 0.0102, 0.0, 0.5, "drifting"), (0.0, 0.0098, 0.0, 0.5, "wrong"), (1e-3, 1.32e-3, 0.0, 0.5, "wrong"),
    (1e-3, 1.28e-3, 0.0, 0.5, "bounded_but_wrong"), (0.0, 6e-11, 0.0, 0.5, "bounded_but_wrong"),
    (0.0, 7e-11, 0.0, 0.5, "wrong"), (0.0, 0.0, 0.098, 0.5, "bounded_but_wrong"),
    (0.0, 0.0, 0.102, 0.5, "wrong_regime"), (0.0, 0.0, 0.0, 0.0098, "accurate"),
    (0.0, 0.0, 0.0, 0.0102, "bounded_but_wrong"),
])  # fmt: skip
def test_each_bound_is_where_it_is_said_to_be(first, last, excess, error, word):
    """Energy errors of the halves of a run, what theta is beyond a turning point over the width, and the axis error."""
    scene = symtop.scene("goldstein")
    low, high = np.sort(np.arccos(scene.top.turning_cosines(scene.start)))
    run = symtop.simulate(scene, "exact", samples=101)
    run["energy"] = "time", run["energy"].values[0] + scene.energy_scale * np.repeat([0.0, first, last], [1, 49, 51])
    run["theta"] = "time", np.where(np.arange(101) == 60, high + excess * (high - low), run["theta"].values)
    result = judgement(scene, run, np.full(101, error))
    assert result.verdict == word
    assert "within 0.0013" in result.sentence or last != 1.28e-3  # rounded up


def test_a_pole_passed_on_the_wrong_side_is_a_wrong_regime():
    scene = grazing(1e-3)
    run, error = symtop.simulate(scene, "exact", samples=201), np.full(201, 0.5)
    assert judgement(scene, run, error).verdict == "bounded_but_wrong"
    shifted = run.assign(p_phi=run["p_phi"] - np.where(run["time"] > 2.0, 2e-3, 0.0))
    assert judgement(scene, shifted, error).verdict == "wrong_regime"
    assert "passed a pole" in judgement(scene, shifted, error).sentence


def test_the_command_line_judges_a_run_against_the_width_of_the_nutation():
    result = call("run", "goldstein", "strang", "--step-size", "0.3", "--samples", "2", "--json")
    assert json.loads(result.stdout)["judgement"]["verdict"] == "bounded_but_wrong"
    scene = symtop.scene("fast")  # `fast` nutates over 4e-4 rad: half a thousandth of a radian is not accurate there
    run = symtop.simulate(scene, "exact", samples=101)
    assert judgement(scene, run, np.full(101, 1e-5)).verdict == "accurate"
    assert judgement(scene, run, np.full(101, 5e-4)).verdict != "accurate"
