"""How runs are judged afterwards: each verdict with its time and its cause, one by one and in bulk."""

import json
import math

import numpy as np
import pytest
from click.testing import CliRunner

import symtop
from symtop.cli.main import main
from symtop.measure.verdicts import VERDICTS, barriers, judge, judgement, verdict
from symtop.methods.framework.plan import OUTCOMES
from symtop.model import charts
from symtop.model.scenes import closed_form, grazing


def judged(scene, name, **controls):
    run = symtop.simulate(scene, name, guard=False, **controls)
    scene = symtop.scene(scene)
    error = charts.axis_distance(run["axis"].values, closed_form(scene).axis(run["time"].values))
    found = judgement(scene, run, error)
    assert found.verdict == verdict(scene, run, error)
    return found


@pytest.mark.parametrize(
    ("scene", "name", "controls", "word", "says"),
    [
        ("goldstein", "strang", {"step_size": 0.01}, "accurate", "accurate to"),
        ("goldstein", "strang", {"step_size": 0.3}, "bounded_but_wrong", "while the energy stayed within"),
        ("goldstein", "rk4", {"step_size": 1.0, "horizon": 400.0, "observe": "axis"}, "drifting", "grew on"),
        ("sleeping", "strang", {"step_size": 2.55, "horizon": 400.0}, "wrong_regime", "never goes"),
        ("spheroid", "stormer-verlet", {"step_size": 1.0, "horizon": 50.0}, "left_chart", "stopped at"),
    ],
)
def test_each_fate_is_judged_with_its_time_and_cause(scene, name, controls, word, says):
    found = judged(scene, name, **controls)
    assert found.verdict == word, found
    assert says in found.sentence
    assert 0.0 <= found.time <= controls.get("horizon", symtop.scene(scene).horizon) * (1.0 + 1e-12)


def test_a_pole_passed_on_the_wrong_side_is_a_wrong_regime():
    where = grazing(1e-3)
    good = symtop.simulate(where, "exact", samples=201)
    error = np.full(201, 0.5)
    assert verdict(where, good, error) == "bounded_but_wrong"
    beyond = good.assign(p_phi=good["p_phi"] - np.where(good["time"] > 2.0, 2e-3, 0.0))
    assert verdict(where, beyond, error) == "wrong_regime"
    assert "passed a pole" in judgement(where, beyond, error).sentence


def test_the_command_line_judges_a_run():
    for name, says in (("0.01", "accurate to"), ("0.3", "bounded but wrong, the axis error passed")):
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
