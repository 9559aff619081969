"""Verdicts in one compiled pass against `judgement`, run by run."""

import math

import numpy as np
import pytest
import xarray as xr
from symtop_studies.stability.many_verdicts import VERDICTS, judge_runs, truths

import symtop
from symtop.measure.verdicts import judgement
from symtop.methods.framework.calling import solve
from symtop.model.charts import View, axis_distance
from symtop.model.scenes import closed_form, grazing, scene

SAMPLES = 41


def run_of(scene_, name, chart, step, count):
    """A run with its times, and the dataset that `judgement` reads."""
    h = step * scene_.nutation_period
    plan = symtop.Plan.steps(h, np.unique(np.rint(np.linspace(0, count, SAMPLES)).astype(np.int64)))
    run = solve(symtop.integrator(name), chart, scene_.top, scene_.start, plan)
    view = View(chart, scene_.top, run.states, run.p_phi, run.p_psi)
    columns = {name: ("time", getattr(view, name)) for name in ("theta", "energy", "p_phi", "p_psi")}
    return plan.times, run, view, xr.Dataset(columns, {"time": plan.times}, {"outcome": run.outcome})


def one_pass(scene_, times, states, momenta, followed=True):
    """The verdict and the error of one run, by arrays of one row and one column."""
    phases, outcome = times[None] / scene_.nutation_period, np.zeros((1, 1), dtype=np.int64)
    runs = np.array([followed]), states[None, None], momenta[None, None], outcome
    judged = judge_runs(truths([scene_]), phases, *runs)
    return VERDICTS[judged.verdict[0, 0]], judged.axis_error[0, 0]


@pytest.mark.parametrize(("name", "chart", "step", "word"), [
    ("strang", "axis", 0.03, "accurate"), ("strang", "axis", 0.12, "bounded_but_wrong"),
    ("stormer-verlet", "angles", 0.03, "accurate"), ("stormer-verlet", "angles", 0.1, "bounded_but_wrong"),
    ("rk4", "axis", 0.1, "drifting"), ("rk4", "axis", 0.5, "wrong_regime"), ("rk4", "attitude", 0.03, "accurate"),
    ("commutator-free-4", "attitude", 0.3, "wrong_regime"), ("rk4", "angles", 0.15, "drifting"),
    ("rk4", "angles", 0.1, "wrong"), ("symplectic-euler", "angles", 0.25, "wrong_regime"),
])  # fmt: skip
def test_one_pass_says_what_judgement_says(name, chart, step, word):
    cusp = scene("cusp")
    times, run, view, data = run_of(cusp, name, chart, step, 400)
    error = axis_distance(view.axis, closed_form(cusp).axis(times))
    momenta = np.stack([run.p_phi, run.p_psi], axis=-1)
    mapped, largest = one_pass(cusp, times, run.states, momenta)
    assert mapped == judgement(cusp, data, error).verdict == word
    assert largest == pytest.approx(error.max(), rel=1e-9)
    verdict, bound = one_pass(cusp, times, run.states, momenta, followed=False)
    assert verdict == word
    assert bound <= largest
    assert (bound <= 1e-2) == (word == "accurate")


@pytest.mark.parametrize("step", [0.08, 0.1])
def test_a_quaternion_that_leaves_length_one_has_failed_in_one_pass_as_alone(step):
    cusp = scene("cusp")
    times, run, _, _ = run_of(cusp, "rk4", "attitude", step, 400)
    assert run.outcome == "not_normalised"
    plan = symtop.Plan.steps(step * cusp.nutation_period, np.arange(0, 401, 10))
    bare = symtop.integrator("rk4").solvers["attitude"](cusp.top, cusp.start, plan)  # it says nothing of it
    assert bare.outcome == "ok"
    word, error = one_pass(cusp, times, bare.states, np.stack([bare.p_phi, bare.p_psi], axis=-1))
    assert word == "not_normalised"
    assert math.isnan(error)


@pytest.mark.parametrize("name", ["rk4", "commutator-free-4", "rkmk-se3-4"])
def test_one_pass_says_what_judgement_says_of_runs_of_few_steps(name):
    """Fewer steps than a run has samples: each run has halves of its own, and fewer than 16 samples never drift."""
    cusp, words = scene("cusp"), set()
    for count in range(6, 41):
        for step in (0.08, 0.13, 0.2, 0.3):
            times, run, view, data = run_of(cusp, name, "axis", step, count)
            if run.outcome == "ok":
                error = axis_distance(view.axis, closed_form(cusp).axis(times))
                arrays = times, run.states, np.stack([run.p_phi, run.p_psi], axis=-1)  # its rows end in NaN
                padded = [np.r_[array, np.full((SAMPLES - len(array), *array.shape[1:]), math.nan)] for array in arrays]
                word = one_pass(cusp, *padded)[0]
                assert word == judgement(cusp, data, error).verdict, (count, step)
                words.add((word, times.size < 16))
    assert ("bounded_but_wrong", True) in words
    assert (("drifting", False) in words) == (name != "rkmk-se3-4")
    assert ("drifting", True) not in words


def test_a_state_that_is_not_finite_and_a_pole_on_the_wrong_side_are_seen():
    case, times = grazing(1e-3), np.linspace(0.0, 4.0, SAMPLES)
    states, p_phi, p_psi = closed_form(case).run(times)
    momenta = np.stack([p_phi, p_psi], axis=-1)
    assert one_pass(case, times, states, momenta) == ("accurate", pytest.approx(0.0, abs=1e-14))
    broken = states.copy()
    broken[-1, 5] = math.nan
    word, error = one_pass(case, times, broken, momenta)
    assert word == "not_finite"
    assert math.isnan(error)
    turned = states.copy()  # by half a turn about the vertical
    turned[:, :4] = states[:, [3, 2, 1, 0]] * np.array([-1.0, -1.0, 1.0, 1.0])
    assert one_pass(case, times, turned, momenta)[0] == "bounded_but_wrong"
    for place, factor, word in ((SAMPLES // 2, 1.5, "drifting"), (SAMPLES // 2 - 1, 1.5, "bounded_but_wrong"),
                                (SAMPLES // 2, 1.0001, "wrong"), (SAMPLES // 2 - 1, 1.0001, "bounded_but_wrong"),
                                (SAMPLES // 2, 1.0 + 1e-14, "bounded_but_wrong")):  # fmt: skip
        (bent := turned.copy())[place, 4:] *= factor  # energy at the first sample of the second half, or before it
        assert one_pass(case, times, bent, momenta)[0] == word
    assert one_pass(case, times, turned, momenta - np.array([2e-3, 0.0]))[0] == "wrong_regime"
