"""The study of speed: costs are those of its runs, and its figure and page show them."""

import math

import numpy as np
import pytest
import xarray as xr
from symtop_studies.speed import facts, study

import symtop
from symtop.measure import datasets
from tests.templates import checked_page


@pytest.fixture(scope="module")
def data():
    """A few methods on one scene at five settings each."""
    settings = {"lengths": (10.0,), "settings": 5}
    names = ("exact", "rk4[axis]", "rk4[attitude]", "strang[axis]", "stormer-verlet[angles]", "taylor[axis]")
    runs = [(case, study.measure(case)) for case in (symtop.Case("goldstein", name, settings) for name in names)]
    return datasets.combine(runs + [(case, study.measure(case)) for case in study.follow_up(datasets.combine(runs))])


def test_a_cost_lies_between_the_runs_and_one_of_the_coarsest_setting_is_an_upper_bound(data):
    cell = facts.shown(data.assign(seconds=data["force_evaluations"])).sel(variant="strang[axis]")
    error, seconds = cell["axis"].values, cell["seconds"].values
    assert facts.cost(cell, math.sqrt(error[1] * error[2])) == pytest.approx(math.sqrt(seconds[1] * seconds[2]))
    assert (facts.cost(cell, error[2]), facts.cost(cell, 1e-3 * error.min())) == (pytest.approx(seconds[2]), math.inf)
    assert facts.tables(data)["times"].set_index("variant")["upper bound at (rad)"].eq("").all()  # the control
    finer = data.assign(axis=data["axis"] * xr.where(data["variant"] == "strang[axis]", 1e-3, 1.0))
    column = facts.tables(finer)["times"].set_index("variant")["upper bound at (rad)"]
    assert (column["strang[axis]"], {*column.drop("strang[axis]")}) == ("1e-03", {""})


def test_the_fastest_on_f_alone_is_named_and_others_are_told_over_it(data, monkeypatch):
    names = "takahashi-imada", "rk4", "rk45-compiled", "dop853-compiled", "rk45"
    times = dict(zip([f"{name}[axis]" for name in names], (1e-6, 2e-6, 4e-6, 6e-6, 8e-4), strict=True))
    monkeypatch.setattr(facts, "costs", lambda _, to: {1e-9: times, 1e-6: times | {"rk45[axis]": 4e-4}}.get(to, {}))
    for spread, scipy in ((0.0, pytest.approx(100.0)), (1.0, None)):  # at 1e-6, others at 1e-9; not on a busy machine
        answers = facts.facts(data.assign(seconds_spread=spread + 0.0 * data["seconds"]))
        values = [answers[name] for name in ("fastest_9", "fastest_9_seconds", "beside", "scipy", "variants")]
        assert values == ["rk4[axis]", 2e-6, pytest.approx(3.0), scipy, 5]  # without the exact motion


def test_a_run_is_that_of_its_setting_and_the_page_says_what_was_measured(data, tmp_path):
    cell, scene = facts.shown(data).sel(variant="rk4[axis]"), symtop.scene("goldstein")
    step = float(cell["step_size"][2])
    run = symtop.simulate(scene, "rk4[axis]", step_size=step, horizon=10.0 * scene.nutation_period, guard=False)
    assert float(symtop.errors(run)["axis"].max()) == pytest.approx(float(cell["axis"][2]), rel=0.05)
    assert np.isfinite(cell["seconds"]).all()
    attitude = facts.shown(data).sel(variant="rk4[attitude]")
    outcome = symtop.simulate(scene, "rk4[attitude]", step_size=float(attitude["step_size"][0]),
                              horizon=10.0 * scene.nutation_period, guard=False).attrs["outcome"]  # fmt: skip
    assert outcome == "not_normalised"  # so long a step loses the quaternion's length, and is neither judged nor timed
    assert not np.isfinite(attitude[["attitude", "seconds"]].isel(setting=0).to_array()).any()
    assert np.isfinite(attitude[["attitude", "seconds"]].isel(setting=slice(1, None)).to_array()).all()
    assert not np.isfinite(facts.shown(data)["axis"].sel(variant="rk4[attitude]")).any()
    assert "`takahashi" not in checked_page("speed", data, tmp_path, elsewhere={"error-against-time"})
    assert facts.facts(data)["scipy"] is None


def test_methods_on_a_scene_are_timed_in_one_case_and_those_for_symmetric_bodies_told(data):
    assert not any(study.STUDY.is_timed(case) for case in study.cases(False))
    (together,) = study.follow_up(data.drop_vars(["seconds", "seconds_spread"]))
    assert (together.scene, together.settings["integrators"]) == ("goldstein", data["variant"].values.tolist())
    assert together.timed
    names = "rk4[axis]", "takahashi-imada[axis]", "series[axis]"
    assert [facts.on_f_alone(name) for name in names] == [True, False, False]
