"""Work and precision: parts of an error, settings that meet targets, timing rounds, rankings, follow-up cases."""

import dataclasses
import math
import pickle
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from symtop_studies.work_precision import energy, opening, timing_rounds as rounds_module, words as work_words
from symtop_studies.work_precision.timing_rounds import Effort, TimedRun, contenders, timed_runs, timing_rounds

import symtop
from symtop.measure import ranking
from symtop.measure.phase import phase, split
from symtop.measure.settings import compared, limits
from symtop.measure.timing import Timing, forecasts, met_again, timings
from symtop.measure.work import CAPPED, TARGETS, TOO_WIDE, Walk, least_work, nutation_width, spans, work_table
from symtop.model import charts
from symtop.model.scenes import closed_form
from symtop.run.reference import reference
from symtop.runner import depends, run as runner, store
from symtop.runner.study import Case, Study


def moved(name, periods=20.0, early=0.0, faster=0.0, turned=0.0, turning=0.0, lifted=0.0, samples=301):
    """The true motion, early, too fast, turned about the vertical, turning, or lifted: a run whose errors are known."""
    scene = symtop.scene(name)
    times = np.linspace(0.0, periods * scene.nutation_period, samples)
    motion = closed_form(scene)(times * (1.0 + faster) + early)
    columns = {
        "theta": motion.theta + lifted,
        "phi": motion.phi + turned + turning * times,
        "p_theta": scene.top.I1 * motion.theta_dot,
    }
    run = xr.Dataset({key: ("time", value) for key, value in columns.items()}, {"time": times}, {"outcome": "ok"})
    return scene, run, reference(scene, times, precision="closed-form")


@pytest.mark.parametrize("name", ["spheroid", "cusp", "hairer-lubich-wanner", "bruls-cardona-arnold"])
def test_a_motion_that_is_early_and_turned_has_the_right_shape(name):
    scene, run, truth = moved(name, early=0.013, turned=-0.2)
    parts = phase(scene, run, truth)
    omega = 2.0 * math.pi / scene.nutation_period
    sine = np.sin(run["theta"].values)
    assert parts.shape < 1e-13
    assert parts.nutation_lag == pytest.approx(0.013 * omega, rel=1e-9)
    assert parts.precession_lag == pytest.approx(0.2 * sine.max(), rel=1e-9)
    assert parts.nutation_period < 1e-12
    assert parts.precession_rate < 1e-10


def test_lags_may_be_longer_than_a_nutation_and_a_turn():
    scene, run, truth = moved("goldstein", early=0.3, faster=0.1, turned=9.0)
    parts = split(scene, run)
    assert np.max(np.abs(parts.lag - (0.3 + 0.1 * run["time"].values))) < 1e-11
    assert np.max(np.abs(parts.turn - 9.0)) < 1e-10
    assert phase(scene, run, truth).shape < 1e-12


def test_wrong_frequencies_are_found_one_by_one():
    scene, run, truth = moved("spheroid", faster=1e-5)
    parts = phase(scene, run, truth)
    assert parts.nutation_period == pytest.approx(1e-5, rel=1e-4)
    assert parts.precession_rate == pytest.approx(1e-5, rel=1e-4)  # it turns faster by as much
    scene, run, truth = moved("spheroid", turning=1e-5)
    parts, form = phase(scene, run, truth), closed_form(scene)
    assert parts.nutation_period < 1e-14
    assert parts.precession_rate == pytest.approx(1e-5 * form.nutation_period / form.phi_per_period, rel=1e-9)


def test_a_motion_of_another_shape_is_not_called_late():
    scene, run, truth = moved("spheroid", lifted=1e-4)
    parts = phase(scene, run, truth)
    assert 3e-5 < parts.shape < 2e-4
    omega = 2.0 * math.pi / scene.nutation_period
    assert parts.nutation_lag < 1e-3
    assert parts.nutation_period < 3.0 * parts.nutation_lag / (omega * float(run["time"][-1]))  # a bounded lag


def test_a_pole_that_is_passed_on_the_other_side_is_not_a_turn():
    scene = symtop.scene("bruls-cardona-arnold")
    period = scene.nutation_period
    run = symtop.simulate(
        scene, "strang", step_size=period / 40.37, horizon=400.0 * period, samples=331, observe="axis", guard=False
    )
    truth = reference(scene, run["time"], precision="closed-form")
    distance = charts.axis_distance(run["axis"].values, truth["axis"].values).max()
    assert phase(scene, run, truth).precession_lag < 2.0 * distance


def test_a_steady_precession_has_no_nutation_to_be_late():
    scene, run, truth = moved("steady", turned=1e-6)
    parts = phase(scene, run, truth)
    assert math.isnan(parts.nutation_lag)
    assert math.isnan(parts.nutation_period)
    assert parts.shape < 1e-14
    assert parts.precession_lag == pytest.approx(1e-6 * math.sin(scene.start.theta), rel=1e-8)


@pytest.mark.parametrize("name", ["spheroid", "fast"])
def test_frequencies_of_the_exact_motion_are_wrong_by_no_more_than_their_bounds(name):
    scene = symtop.scene(name)
    run = symtop.simulate(scene, "exact", horizon=10.0 * scene.nutation_period, samples=331, observe="axis")
    parts = phase(scene, run, reference(scene, run["time"], precision="closed-form"))
    assert parts.nutation_period <= parts.nutation_period_bound
    assert parts.precession_rate <= parts.precession_rate_bound
    failed = phase(
        scene, run.assign_attrs(outcome="left_chart"), reference(scene, run["time"], precision="closed-form")
    )
    assert all(math.isnan(value) for value in failed)


def test_settings_come_close_to_every_target_from_below():
    scene, method = symtop.scene("goldstein"), symtop.integrator("kahan-li-6")
    table = work_table(scene, method, [10.0 * scene.nutation_period], 1e6).isel(horizon=0)
    assert str(table["stopped"].values) == "all targets met"
    for target in TARGETS:
        good = table["axis"].values <= target
        best = int(np.flatnonzero(good)[np.argmin(table["steps"].values[good])])
        assert table["axis"].values[best] >= 0.4 * target
        step = float(table["setting_value"].values[best])
        coarser = symtop.simulate(
            scene, method, step_size=1.25 * step, horizon=10.0 * scene.nutation_period, samples=331
        )
        truth = reference(scene, coarser["time"], precision="closed-form")
        assert charts.axis_distance(coarser["axis"].values, truth["axis"].values).max() > target


def test_a_step_may_be_as_long_as_the_method_is_accurate():
    scene, method = symtop.scene("cusp"), symtop.integrator("sofroniou-spaletta-10[axis]")
    horizon = 10.0 * scene.nutation_period
    table = work_table(scene, method, [horizon], 1e6).isel(horizon=0)
    good = table["axis"].values <= 1e-3
    longest = float(table["setting_value"].values[good].max())
    assert longest > 0.8 * scene.nutation_period  # a quarter of a nutation would be three times the work
    assert longest <= limits(scene, method, horizon)[1]
    assert limits(scene, method, horizon, "energy")[1] <= 0.25 * scene.nutation_period  # it says nothing of the motion
    coarse = table["axis"].values[table["setting_value"].values > 1.05 * longest]
    assert (coarse > 1e-3).all() or str(table["reached"].sel(target=1e-3).values) == CAPPED


def test_a_target_that_is_wider_than_the_nutation_is_not_asked():
    scene, method = symtop.scene("fast"), symtop.integrator("rk4[axis]")
    assert nutation_width(scene) == pytest.approx(3.84e-4, rel=1e-2)
    table = work_table(scene, method, [10.0 * scene.nutation_period], 1e5).isel(horizon=0)
    reached = dict(zip(TARGETS, map(str, table["reached"].values), strict=True))
    assert (reached[1e-3], reached[1e-6]) == (TOO_WIDE, "met")
    still = np.cross(symtop.simulate(scene, "exact", horizon=10.0 * scene.nutation_period)["axis"].values, [0, 0, 1])
    angle = np.arcsin(np.linalg.norm(still, axis=1))
    assert np.ptp(angle) < 1e-3  # an axis that does not nutate at all is within 1e-3 of the truth
    assert nutation_width(symtop.scene("spheroid")) > 1.0


def test_what_is_not_reached_has_a_reason():
    scene = symtop.scene("spheroid")
    horizon = 10.0 * scene.nutation_period
    for name, budget, target, why in (
        ("stormer-verlet[angles]", 3e4, 1e-9, "budget"),
        ("rk45-compiled[angles]", 1e6, 1e-12, "least tolerance"),
        ("taylor[axis]", 1e6, 1e-12, "met"),
    ):
        table = work_table(scene, symtop.integrator(name), [horizon], budget).isel(horizon=0)
        assert str(table["reached"].sel(target=target).values) == why


def test_the_rows_are_every_method_in_every_chart_that_costs_what_the_axis_costs():
    names = [row.name for row in compared("axis")]
    assert {"rk4[angles]", "rk4[axis]", "strang[axis]", "midpoint[angles]", "exact[attitude]"} <= set(names)
    assert "strang[attitude]" not in names  # the same axis for more work
    assert "strang[attitude]" in [row.name for row in compared("attitude")]
    assert {row.method for row in compared("axis")} >= set(symtop.integrators())


def test_a_walk_ends_at_its_budget_and_says_so():
    scene, method = symtop.scene("goldstein"), symtop.integrator("stormer-verlet")
    table = work_table(scene, method, [10.0 * scene.nutation_period, 1000.0 * scene.nutation_period], 3e4)
    assert list(table["stopped"].values) == ["budget", "budget"]
    assert np.nanmax(table["force_evaluations"].values) <= 1.05 * 3e4
    assert (table["outcome"].values[1] == "not_run").any()  # padding says that nobody ran
    nothing = work_table(scene, method, [10.0 * scene.nutation_period, 1000.0 * scene.nutation_period], 500.0)
    assert set(nothing["outcome"].values[1]) == {"not_run"}


def test_a_coarse_setting_that_is_good_enough_is_made_coarser():
    scene, method = symtop.scene("fast"), symtop.integrator("strang[axis]")
    walk = Walk(scene, method, 10.0 * scene.nutation_period, 1e4)
    walk.run(scene.nutation_period / 20.37)
    walk.coarsen(1e-3)
    assert walk.error(sorted(walk.rows)[-2]) <= 1e-3
    assert max(walk.rows) > 2.0 * scene.nutation_period / 20.37


def test_a_separatrix_has_spans_too():
    top, third = symtop.SymmetricTop(1.0, 1.0, 1.0), 1.0 / math.sqrt(3.0)
    edge = symtop.Scene("edge", top, symtop.Angles(theta=math.pi / 3, phi_dot=2 * third, psi_dot=2 * third), 10.0)
    assert all(math.isfinite(span) for span in spans(edge, [10.0, 100.0]))
    scene = symtop.scene("fast")
    assert spans(scene, [10.0]) == [10.0 * scene.nutation_period]


def timed(name, far=0, place=0, targets=()):
    return TimedRun(name, far, place, 0.1 * (place + 1), 100.0 * (place + 1), 100.0, tuple(targets))


def test_contenders_are_the_runs_that_may_be_the_fastest():
    runs = [timed(name, targets=[0]) for name in "abcdpq"] + [timed("a", place=1, targets=[1]), timed("b", place=1)]
    cost = dict(zip(runs, (1.0, 1.5, 9.0, 10.0, 0.5, 500.0, 1.0, 1.0), strict=True))
    implementation = dict.fromkeys("abcd", "compiled") | dict.fromkeys("pq", "python")
    near = contenders(runs, cost, implementation)
    assert [(run.name, run.place) for run in near] == [("a", 0), ("b", 0)]  # p and the other a are alone in front


def test_times_are_foretold_by_the_other_runs_of_a_method():
    steps = np.array([40.0, 90.0, 300.0, 1e3, 5e3, 2e4])
    work = steps * np.array([9.0, 8.0, 8.0, 7.0, 6.0, 6.0])
    exact = 1e-5 + 2e-8 * work + 3e-8 * steps
    assert forecasts(exact, work, steps, fixed_step=True) == pytest.approx(exact, rel=1e-9)
    derivatives = 1e-5 + 1e-9 * work**2 / steps
    assert forecasts(derivatives, work, steps, fixed_step=False) == pytest.approx(derivatives, rel=1e-9)
    glitch = exact.copy()
    glitch[3] *= 2.8  # as one winner of 72 once
    assert glitch[3] / forecasts(glitch, work, steps, fixed_step=True)[3] == pytest.approx(2.8, rel=1e-9)
    assert np.isnan(forecasts(exact[:2], work[:2], steps[:2], fixed_step=True)).all()


def test_a_sample_that_no_other_comes_near_is_not_met_again():
    assert met_again([1.0, 1.05, 3.0, math.nan])
    assert not met_again([1.0, 1.3, 1.3])
    assert not met_again([1.0, math.nan])


def test_a_time_that_misses_its_forecast_by_a_quarter_is_taken_again(monkeypatch):
    scene = symtop.scene("goldstein")
    runs = [timed("rk4[axis]", place=k, targets=[k] if k < 4 else ()) for k in range(5)]
    runs += [timed("strang[axis]", place=k, targets=[k] if k < 4 else ()) for k in range(5)]
    stages = []

    def pretended(calls, rounds, batch, seed=0, *, warm=True):
        stages.append((sorted(calls), rounds, batch))
        slow = {("strang[axis]", 3, 0): 2.8}
        unit = {"rk4[axis]": 1.0, "strang[axis]": 9.0}
        return [
            Timing((unit[name] * (place + 1) * slow.get((name, place, seed), 1.0),) * rounds, math.nan)
            for name, place in calls
        ]

    monkeypatch.setattr(rounds_module, "timings", pretended)
    monkeypatch.setattr(rounds_module, "first_call", lambda _: 7.0)
    monkeypatch.setattr(
        rounds_module, "bare_run", lambda _scene, method, _chart, setting, *_: (method.name, round(10.0 * setting) - 1)
    )
    table = timing_rounds(scene, [1.0], runs, Effort(3, 0.005), Effort(5, 0.01)).isel(horizon=0)
    assert stages[0] == (sorted((run.name, run.place) for run in runs if run.targets), 3, 0.005)
    assert stages[1] == (sorted((run.name, run.place) for run in runs if not run.targets), 2, 0.005)
    assert stages[2][0] == []  # nobody is near the fastest
    again, rounds, batch = stages[3]
    assert ("strang[axis]", 3) in again
    assert {name for name, _ in again} == {"strang[axis]"}  # its neighbours are foretold from it
    assert (rounds, batch) == (4, 0.005)
    row = table.sel(integrator="strang[axis]")
    assert row["seconds"].values.tolist() == [9.0, 18.0, 27.0, 36.0, 45.0]  # the glitch is gone
    assert row["seconds_forecast"].values == pytest.approx(row["seconds"].values)
    assert row["seconds_samples"].isel(setting=3).values[:3].tolist() == [36.0 * 2.8] * 3
    assert np.isnan(table["seconds_samples"].sel(integrator="rk4[axis]").values[:, 3:]).all()
    assert table["first_call"].values.tolist() == [7.0, 7.0]
    assert table["set_up_seconds"].isnull().all()


def test_batches_of_a_round_are_neighbours_in_time():
    called = []
    timings([lambda name=name: called.append(name) for name in "abc"], batches=4, batch=0.0)
    rounds = ["".join(sorted(called[-12 + 3 * k : -9 + 3 * k or None])) for k in range(4)]
    assert rounds == ["abc"] * 4


LEADERS = ["kahan-li-6[axis]", "srkn-11-6[axis]", "stormer-verlet[angles]", "taylor[axis]"]


@pytest.fixture(scope="module")
def timed_study():
    """The study's dataset of one scene and four methods over two horizons."""
    scene = symtop.scene("goldstein")
    far = [10.0 * scene.nutation_period, 100.0 * scene.nutation_period]
    tables = [(Case("goldstein", name), work_table(scene, symtop.integrator(name), far, 4e4)) for name in LEADERS]
    data = store.combine(tables)
    runs = timed_runs(data.sel(scene="goldstein"), ["stormer-verlet[angles]"])
    seconds = timing_rounds(scene, far, runs, Effort(3, 0.001), Effort(3, 0.002))
    return store.combine([*tables, (Case("goldstein", "together"), seconds)]).assign_coords(horizon=[10.0, 100.0])


def test_the_cheapest_runs_of_each_method_have_a_time_and_no_other_run(timed_study):
    assert list(timed_study["integrator"].values) == LEADERS
    ran = timed_study["outcome"] == "ok"
    least = [least_work(timed_study.transpose(..., "setting"), target) for target in TARGETS]
    place = xr.DataArray(np.stack(least), dims=("target", *timed_study["axis"].dims[:-1]))
    cheapest = (timed_study["setting"] == place).any("target")
    compared = ran & (timed_study["integrator"] == "stormer-verlet[angles]") & (timed_study["horizon"] == 100.0)
    expected, has_time = xr.broadcast(cheapest | compared, timed_study["seconds"].notnull())
    assert (expected == has_time).all()
    assert 0 < has_time.sum() < ran.sum()
    samples = timed_study["seconds_samples"]
    assert ((samples.notnull().sum("batch") >= 2) == has_time).all()
    assert (timed_study["seconds"] == samples.min("batch")).where(has_time, True).all()
    assert work_words.measured(timed_study) == 1.0
    modelled = timed_study.assign(seconds=timed_study["seconds"] * 1.01)
    assert work_words.measured(modelled) == 0.0


def test_a_chart_shows_timed_runs_against_seconds_and_every_run_against_work(timed_study):
    seconds, work = (
        [[point for series in panel for point in series.points] for panel in chart.panels.values()]
        for chart in opening.charts(timed_study)
    )
    ran = (timed_study["outcome"] == "ok").sum(["integrator", "setting"]).values.ravel()
    assert (
        list(map(len, seconds))
        == timed_study["seconds"].notnull().sum(["integrator", "setting"]).values.ravel().tolist()
    )
    assert list(map(len, work)) == ran.tolist()
    assert all(any(f" {unit}," in words for unit in ("us", "ms")) for panel in seconds for *_, words in panel)
    assert sum("us," in words or "ms," in words for *_, words in work[0]) == len(
        seconds[0]
    )  # a time where there is one


def cell(samples, errors=None, implementations=None):
    """One scene and one horizon of a dataset: a setting each, with the given samples."""
    samples = np.asarray(samples, float)
    count = len(samples)
    errors = np.full(count, 1e-7) if errors is None else np.asarray(errors)
    table = {
        "seconds": np.nanmin(samples, axis=1), "axis": errors, "outcome": np.full(count, "ok"),
        "implementation": np.array(implementations or ["compiled"] * count), "nutation_lag": np.zeros(count),
        "seconds_forecast": np.full(count, np.nan), "control": np.full(count, "step_size"),
    }  # fmt: skip
    data = xr.Dataset({name: (("integrator", "setting"), values[:, None]) for name, values in table.items()})
    data["seconds_samples"] = (("integrator", "setting", "batch"), samples[:, None, :])
    data["control"] = data["control"].isel(setting=0)
    data["nutation_width"] = ("integrator", np.ones(count))
    return data.assign_coords(integrator=list("abcdefg"[:count]))


def test_a_lead_is_sure_only_if_every_round_agrees_and_it_is_more_than_a_hair():
    clear = ranking.win(cell([[1.0, 1.1, 1.0], [1.3, 1.4, 1.35]]), 1e-6)
    assert clear.best.integrator == "a"
    assert clear.level == ()
    assert (clear.behind.integrator, clear.ratio) == ("b", pytest.approx(1.3, rel=0.03))
    assert "1.3 times faster than b)" in work_words.lead(1e-6, cell([[1.0, 1.1, 1.0], [1.3, 1.4, 1.35]]))
    mixed = ranking.win(cell([[1.0, 1.6, 1.0], [1.3, 1.4, 1.35]]), 1e-6)
    assert mixed.level == ("b",)
    hair = ranking.win(cell([[1.0, 1.0, 1.0], [1.05, 1.05, 1.05]]), 1e-6)
    assert hair.level == ("b",)


def test_the_cost_of_a_target_is_that_of_the_cheapest_timed_run_that_meets_it():
    rows = {"seconds": [0.5, 2.0, math.nan, 7.0], "axis": [1e-2, 1e-4, 1e-5, 1e-12], "outcome": ["ok"] * 4}
    data = xr.Dataset({name: (("integrator", "setting"), [values]) for name, values in rows.items()})
    data = data.assign(
        implementation=("integrator", ["compiled"]), seconds_samples=data["seconds"].expand_dims(batch=3),
        control=("integrator", ["step_size"]), nutation_width=("integrator", [1.0]),
        seconds_forecast=math.nan * data["seconds"],
    )  # fmt: skip
    data = data.assign_coords(integrator=["a"])
    assert [ranking.cheapest(data, target)[0].cost for target in (1e-1, 1e-3, 3e-5, 1e-12)] == [0.5, 2.0, 7.0, 7.0]
    assert ranking.cheapest(data, 1e-13) == []


def test_the_closed_form_is_not_ranked_but_stands_beside_the_others():
    data = cell([[0.1] * 3, [1.0] * 3, [2.0] * 3], errors=[1e-16, 1e-7, 1e-7])
    assert ranking.win(data, 1e-6).best.integrator == "a"
    data["control"][0] = ""
    data = data.assign(
        set_up_seconds=("integrator", [0.1, np.nan, np.nan]), sample_seconds=("integrator", [6e-7, np.nan, np.nan])
    )
    assert ranking.ranked(data) == ["b", "c"]
    assert ranking.win(data, 1e-6).best.integrator == "b"
    assert ranking.win(data, 1e-12) is None  # it alone would meet that
    said = work_words.beside(data)
    assert "a is not ranked" in said
    assert "100 ms" in said
    assert "600 us" not in said
    assert work_words.beside(data.sel(integrator=["b", "c"])) == ""


def test_a_target_wider_than_the_nutation_has_no_winner_and_does_not_count():
    data = cell([[1.0] * 3, [2.0] * 3]).expand_dims(scene=["x"]).expand_dims(horizon=[10.0])
    assert list(ranking.winners(data)) == [("x", 0, target) for target in TARGETS]
    narrow = data.assign(nutation_width=4e-4 * data["nutation_width"])
    assert list(ranking.winners(narrow)) == [("x", 0, target) for target in TARGETS if target < 4e-4]
    assert ranking.relative_costs(narrow, ["a", "b"]).sel(target=1e-3).isnull().all()
    assert "1e-03 on x (0.0004 rad wide)" in work_words.not_asked(narrow)
    assert work_words.not_asked(data) == ""


def test_a_time_that_misses_its_forecast_leads_only_if_the_forecast_does():
    data = cell([[1.0] * 3, [2.8] * 3])
    assert ranking.win(data, 1e-6).level == ()
    data["seconds_forecast"] = (("integrator", "setting"), [[1.0], [1.05]])  # the second was unlucky in every round
    assert ranking.win(data, 1e-6).level == ("b",)
    data["seconds_forecast"] = (("integrator", "setting"), [[1.0], [2.9]])
    assert ranking.win(data, 1e-6).level == ()
    data["seconds_forecast"] = (("integrator", "setting"), [[2.7], [2.9]])  # the first was timed too short
    assert ranking.win(data, 1e-6).level == ("b",)


def test_a_row_that_meets_an_error_on_more_scenes_comes_before_a_faster_one():
    table = np.array([[1.0, 1.0, math.inf, math.inf], [9.0, 9.0, 1.0, 1.0], [10.0, 12.0, 8.0, 9.0]])
    ratios = xr.DataArray(
        table[None], {"target": [1e-12], "integrator": list("abc")}, ("target", "integrator", "problem")
    )
    assert ranking.leaders(ratios, 3) == ["b", "c", "a"]
    assert ranking.leaders(ratios.isel(problem=[0, 1]), 3) == ["a", "b", "c"]


def test_a_slow_spell_that_hits_a_whole_round_does_not_blur_a_lead():
    won = ranking.win(cell([[1.0, 3.0, 1.0], [1.3, 4.0, 1.3]]), 1e-6)
    assert won.level == ()
    restless = ranking.win(cell([[1.0, 1.0, 1.0], [1.3, 5.0, 6.0]]), 1e-6)
    assert restless.level == ("b",)


def test_samples_are_pairs_only_within_a_round_and_the_last_common_rounds_count():
    no = math.nan
    apart = ranking.win(cell([[1.0, 1.0, 1.0, no, no, no], [no, no, no, 2.0, 2.0, 2.0]]), 1e-6)
    assert apart.level == ("b",)
    base, later = [1.0, 3.0, 1.0], [1.0] * 5
    assert ranking.win(cell([[*base, *later], [2.0, 2.0, 2.0, *[1.3] * 5]]), 1e-6).ratio == pytest.approx(1.3)
    assert ranking.win(cell([[*base, *later], [2.0, 4.0, 2.0, *[no] * 5]]), 1e-6).ratio == pytest.approx(2.0)


def test_plain_python_is_ranked_apart_and_a_failure_does_not_win():
    data = cell(
        [[0.1] * 3, [1.0] * 3, [0.5] * 3], errors=[1e-7, 1e-7, 1e-4], implementations=["python", "compiled", "compiled"]
    )
    assert ranking.win(data, 1e-6).best.integrator == "b"
    assert ranking.win(data, 1e-6, implementation="python").best.integrator == "a"
    assert ranking.win(data, 1e-9) is None
    data["outcome"][1, 0] = "left_chart"
    assert ranking.win(data, 1e-6) is None


def test_a_crossing_of_two_power_laws_is_found_where_it_is():
    x = np.geomspace(1.0, 1e4, 9)
    table = np.array([1e-3 / x, 1e-1 / x**2])  # equal at 100
    data = xr.Dataset(
        {
            "seconds": (("integrator", "setting"), np.array([x, x])),
            "energy": (("integrator", "setting"), table),
            "outcome": (("integrator", "setting"), np.full((2, 9), "ok")),
        },
        coords={"integrator": ["a", "b"], "scene": "x"},
    )
    crossing = energy.crossing(data, "a", "b")
    assert crossing.longest_won == pytest.approx(100.0, rel=0.06)
    assert (crossing.at_least, crossing.at_most) == (True, False)
    assert crossing.share == pytest.approx(0.5, abs=0.01)
    assert crossing.gain == pytest.approx(100.0)
    turned = energy.crossing(data, "b", "a")
    assert (turned.at_least, turned.at_most) == (False, True)
    assert turned.longest_won == pytest.approx(1e4)


def test_energies_are_compared_within_a_chart():
    names = ["rk4[angles]", "midpoint[angles]", "rk4[axis]", "strang[axis]", "taylor[axis]", "rk45[angles]"]
    x = np.geomspace(1.0, 1e3, 9)
    data = xr.Dataset(
        {
            "seconds": (("integrator", "setting"), np.tile(x, (6, 1))),
            "energy": (("integrator", "setting"), np.array([x**-4.0, x**-2.0, 0.1 * x**-4.0, 1e-3 / x**4, x**-9.0, x])),
            "steps": (("integrator", "setting"), np.tile(x, (6, 1))),
            "force_evaluations": (("integrator", "setting"), np.array([4.0, 1, 4, 1, 20, 6])[:, None] * x),
            "outcome": (("integrator", "setting"), np.full((6, 9), "ok")),
            "control": ("integrator", ["step_size"] * 4 + ["tolerance"] * 2),
            "chart": ("integrator", ["angles", "angles", "axis", "axis", "axis", "angles"]),
            "symplectic": ("integrator", [0.0, 1, 0, 1, 0, 0]),
            "implementation": ("integrator", ["compiled"] * 5 + ["python"]),
        },
        coords={"integrator": names},
    ).expand_dims(scene=["x"]).expand_dims(horizon=[1.0])  # fmt: skip
    assert energy.in_chart(data, "axis") == (["rk4[axis]", "taylor[axis]"], ["strang[axis]"])
    assert energy.in_chart(data, "angles") == (["rk4[angles]"], ["midpoint[angles]"])
    pairs = [(classic, row) for chart in energy.CHARTS for classic, rows in energy.crossings(data, chart).items()
             for row in rows]  # fmt: skip
    assert pairs == [("rk4[axis]", "strang[axis]"), ("taylor[axis]", "strang[axis]"),
                     ("rk4[angles]", "midpoint[angles]")]  # fmt: skip
    assert "On every scene and at all run times: strang[axis]" in energy.sentence(data, "axis")
    assert "On no scene: midpoint[angles]" in energy.sentence(data, "angles")
    error, work = energy.at_steps(data.isel(scene=0, horizon=0).sel(integrator="rk4[axis]"), 118.0)
    assert (error, work) == (pytest.approx(0.1 * 118.0**-4), pytest.approx(4.0))
    assert "strang[axis] (1 force evaluations a step)" in energy.at_equal_steps(
        data, ["rk4[axis]", "strang[axis]"], "x"
    )


def test_costs_relative_to_the_best_keep_failures_visible():
    data = cell([[2.0] * 3, [1.0] * 3], errors=[1e-7, 1e-4]).expand_dims(scene=["x"]).expand_dims(horizon=[10.0])
    ratios = ranking.relative_costs(data, ["a", "b"])
    assert ratios.sel(target=1e-3).values.ravel().tolist() == [2.0, 1.0]
    assert ratios.sel(target=1e-6).values.ravel().tolist() == [1.0, math.inf]
    assert np.isinf(ratios.sel(target=1e-12).values).all()
    assert ranking.leaders(ratios, 2) == ["a", "b"]


def called(seconds, table):
    """The winners that are called beyond the noise, by horizon and target, with all winners."""
    data = store.combine([*table, (Case("goldstein", "together"), seconds)])
    wins = ranking.winners(data)
    return {key: won.best.integrator for key, won in wins.items() if won and not won.level}, {
        key: won.best.integrator for key, won in wins.items() if won
    }


TIMED_AGAIN = """
import pickle, sys
from symtop_studies.work_precision.timing_rounds import Effort, TimedRun, timing_rounds
scene, far, runs = pickle.load(open(sys.argv[1], "rb"))
timing_rounds(scene, far, [TimedRun(*run) for run in runs], Effort(3, 0.004), Effort(8, 0.01)).to_netcdf(sys.argv[2])
"""


@pytest.mark.slow
def test_a_winner_that_is_called_beyond_the_noise_wins_in_another_process_too(tmp_path):
    scene = symtop.scene("goldstein")
    far = [count * scene.nutation_period for count in (10.0, 100.0)]
    names = [*LEADERS, "takahashi-imada[axis]", "rk4[axis]", "rk4[angles]", "gauss-8[axis]", "srkn-14-6[axis]"]
    table = [(Case("goldstein", name), work_table(scene, symtop.integrator(name), far, 2e5)) for name in names]
    runs = [tuple(run) for run in timed_runs(store.combine(table).sel(scene="goldstein"))]
    question = tmp_path / "question.pickle"
    question.write_bytes(pickle.dumps((scene, far, runs)))
    outcomes = []
    for number in range(2):
        answer = tmp_path / f"{number}.nc"
        subprocess.run([sys.executable, "-c", TIMED_AGAIN, str(question), str(answer)], check=True)
        outcomes.append(called(xr.load_dataset(answer), table))
    for (sure, _), (_, wins) in (outcomes, outcomes[::-1]):
        assert {key: wins[key] for key in sure} == sure


def _first(case):
    return xr.Dataset({"found": ("setting", [float(len(case.integrator)), 1.0])})


def _both(case):
    if not case.timed:
        return _first(case)
    names = case.settings["integrators"]
    return xr.Dataset({"later": ("integrator", [float(k) for k in range(len(names))])}, coords={"integrator": names})


def test_a_study_may_have_a_second_round_made_from_the_first(tmp_path, monkeypatch):
    sizes = []

    def again(data):
        sizes.append(dict(data.sizes))
        names = [str(name) for name in data["integrator"].values]
        return [Case("spheroid", "together", {"integrators": names}, timed=True)]

    study = Study(
        name="stability", title="", question="", how_to_read="", measure=_both, pictures=lambda _: [],
        cases=lambda _: [Case("spheroid", name) for name in ("midpoint", "strang")], verdict=lambda _: ["done"],
        follow_up=again,
    )  # fmt: skip
    monkeypatch.setattr(runner, "load", lambda _: study)
    first = runner.run(study, tmp_path, quiet=True)
    assert first["computed"] == 3
    assert sizes == [{"scene": 1, "integrator": 2, "setting": 2}]
    data = xr.open_dataset(tmp_path / "stability.nc").load()
    assert data["later"].values.tolist() == [[0.0, 1.0]]
    assert data["found"].sel(integrator="strang").values.tolist() == [[6.0, 1.0]]
    next((tmp_path / "cases" / "stability").glob("*together*")).unlink()
    (tmp_path / "stability.nc").unlink()
    assert runner.run(study, tmp_path, quiet=True)["computed"] == 1
    assert runner.run(study, tmp_path, quiet=True)["computed"] == 0
    alone = Case("spheroid", "midpoint", timed=True)
    assert depends.digest(study, alone) == depends.digest(study, dataclasses.replace(alone))
