"""Work and precision: parts of an error, settings that meet targets, timing rounds, rankings, follow-up cases."""

import dataclasses
import math

import numpy as np
import pytest
import xarray as xr
from symtop_studies.work_precision import opening
from symtop_studies.work_precision import timing_rounds as rounds_module
from symtop_studies.work_precision import words as work_words
from symtop_studies.work_precision.tables import Column
from symtop_studies.work_precision.timing_rounds import (
    TimedRun,
    calibration_runs,
    contenders,
    cost_line,
    speed_probe,
    timed_runs,
    timing_rounds,
)

import symtop
from symtop.measure import ranking
from symtop.measure.phase import phase, split
from symtop.measure.timing import Timing, timings
from symtop.measure.work import TARGETS, Walk, spans, work_table
from symtop.model import charts
from symtop.model.scenes import closed_form
from symtop.run.reference import reference
from symtop.runner import depends, store
from symtop.runner import run as runner
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


def test_no_fixed_step_is_longer_than_a_quarter_of_a_nutation():
    scene = symtop.scene("steady")  # a fixed point of the midpoint rule, which is right there at any step
    for name in ("midpoint", "srkn-14-6"):
        table = work_table(scene, symtop.integrator(name), [10.0 * scene.nutation_period], 5e3, [1e-6]).isel(horizon=0)
        ran = table["outcome"].values == "ok"
        assert table["axis"].values[ran].min() < 1e-6
        assert 40.0 <= table["steps"].values[ran].min() < 60.0


def test_a_walk_ends_at_its_budget_and_says_so():
    scene, method = symtop.scene("goldstein"), symtop.integrator("stormer-verlet")
    table = work_table(scene, method, [10.0 * scene.nutation_period, 1000.0 * scene.nutation_period], 3e4)
    assert list(table["stopped"].values) == ["budget", "budget"]
    assert np.nanmax(table["force_evaluations"].values) <= 1.05 * 3e4
    assert (table["outcome"].values[1] == "not_run").any()  # padding says that nobody ran
    nothing = work_table(scene, method, [10.0 * scene.nutation_period, 1000.0 * scene.nutation_period], 500.0)
    assert set(nothing["outcome"].values[1]) == {"not_run"}


def test_a_coarse_setting_that_is_good_enough_is_made_coarser():
    scene, method = symtop.scene("fast"), symtop.integrator("strang")
    walk = Walk(scene, method, 10.0 * scene.nutation_period, 1e4)
    walk.run(scene.nutation_period / 20.37)
    walk.coarsen(1e-3)
    assert max(walk.rows) > 2.0 * scene.nutation_period / 20.37


def test_attitude_errors_come_from_a_chart_that_shows_them():
    scene, method = symtop.scene("goldstein"), symtop.integrator("gauss-4")
    row = work_table(scene, method, [5.0], 2e4).isel(horizon=0)
    assert np.isfinite(row["attitude"].values[0])
    assert row["attitude"].values[0] >= 0.5 * row["axis"].values[0]


def test_a_separatrix_has_spans_too():
    top, third = symtop.SymmetricTop(1.0, 1.0, 1.0), 1.0 / math.sqrt(3.0)
    edge = symtop.Scene("edge", top, symtop.Angles(theta=math.pi / 3, phi_dot=2 * third, psi_dot=2 * third), 10.0)
    assert all(math.isfinite(span) for span in spans(edge, [10.0, 100.0]))
    scene = symtop.scene("fast")
    assert spans(scene, [10.0]) == [10.0 * scene.nutation_period]


def timed(name, far=0, place=0, work=100.0, targets=()):
    return TimedRun(name, far, place, 0.1, work, tuple(targets))


def test_a_line_of_cost_goes_through_two_runs_and_never_pays_for_starting():
    assert cost_line([(100.0, 3e-6), (1100.0, 13e-6)]) == pytest.approx((2e-6, 1e-8))
    assert cost_line([(100.0, 1e-6), (200.0, 3e-6)]) == pytest.approx((0.0, 1.5e-8))  # a negative overhead is noise
    assert cost_line([(100.0, 1e-6)]) == pytest.approx((0.0, 1e-8))


def test_calibration_runs_are_a_short_and_a_longer_run_near_a_target():
    runs = [timed("a", place=k, work=10.0**k, targets=[0] if k in (2, 4) else []) for k in range(8)]
    assert [run.place for run in calibration_runs(runs, "compiled")] == [0, 4]
    alone = [timed("a", place=k, work=10.0**k, targets=[0] if k == 2 else []) for k in range(8)]
    assert [run.place for run in calibration_runs(alone, "compiled")] == [0, 2]
    coarse = [timed("a", place=k, work=10.0**k, targets=[0] if k == 0 else []) for k in range(8)]
    assert [run.place for run in calibration_runs(coarse, "compiled")] == [0, 5]


def test_contenders_are_the_runs_that_may_be_the_fastest():
    runs = [timed(name, targets=[0]) for name in "abc"] + [timed("p", targets=[0])]
    runs += [timed("d", targets=[0]), timed("q", targets=[0])]
    cost = dict(zip(runs, (1.0, 1.5, 9.0, 50.0, 10.0, 500.0), strict=True))
    tier = dict.fromkeys("abcd", "compiled") | dict.fromkeys("pq", "python")
    groups = [[run.name for run in group] for group in contenders(runs, cost, tier)]
    assert groups == [["a", "b", "c"], ["p"]]  # c is the first behind: a lead must be over one that was timed


def test_the_speed_ratio_is_measured_on_the_longest_run_that_a_batch_can_hold():
    runs = [timed("a", place=k, work=10.0**k) for k in range(3)]
    taken = {run: Timing((10.0 ** (k - 3),), 1.0) for k, run in enumerate(runs)}
    assert speed_probe(runs, taken, 0.02).place == 1
    assert speed_probe(runs, taken, 1e-6).place == 0


def test_a_machine_that_turns_slow_before_the_rounds_slows_the_predictions_too(monkeypatch):
    scene = symtop.scene("goldstein")
    runs = [timed(name, place=k, work=w) for name in ("strang", "midpoint") for k, w in enumerate((10.0, 1e3, 1e5))]
    runs[1] = timed("strang", place=1, work=1e3, targets=[0])
    calls_made = []

    def slower(calls, batches, batch, seed=0):
        calls_made.append(len(calls))
        return [Timing((1e-8 * work * (3.0 if seed else 1.0),) * batches, 1.0) for work in calls]

    monkeypatch.setattr(rounds_module, "timings", slower)
    monkeypatch.setattr(rounds_module, "_call", lambda _where, _methods, run, *_: run.work)
    table = timing_rounds(scene, [1.0], runs, rounds=3, size=3).isel(horizon=0)
    assert len(calls_made) == 2  # the second is three times slower
    true = 3e-8 * np.array([10.0, 1e3, 1e5])
    np.testing.assert_allclose(table["seconds"].sel(integrator="strang"), true)  # one of them timed, two predicted
    np.testing.assert_allclose(
        table["seconds"].sel(integrator="midpoint"), true
    )  # no contender: the others' speed ratio
    assert table["seconds_timed"].values.tolist() == [[0.0, 1.0, 0.0], [0.0, 0.0, 0.0]]
    assert table["seconds_pace"].values[0] == pytest.approx(3.0)


def test_batches_of_a_round_are_neighbours_in_time():
    called = []
    timings([lambda name=name: called.append(name) for name in "abc"], batches=4, batch=0.0)
    rounds = ["".join(sorted(called[-12 + 3 * k : -9 + 3 * k or None])) for k in range(4)]
    assert rounds == ["abc"] * 4


LEADERS = ["kahan-li-6", "srkn-11-6", "stormer-verlet", "taylor"]


@pytest.fixture(scope="module")
def timed_study():
    """The study's dataset of one scene and four methods over two horizons."""
    scene = symtop.scene("goldstein")
    far = [10.0 * scene.nutation_period, 100.0 * scene.nutation_period]
    tables = [(Case("goldstein", name), work_table(scene, symtop.integrator(name), far, 4e4)) for name in LEADERS]
    data = store.combine(tables)
    runs = timed_runs(data.sel(scene="goldstein"))
    seconds = timing_rounds(scene, far, runs, rounds=3, batch=0.002, size=data.sizes["setting"])
    return store.combine([*tables, (Case("goldstein", "together"), seconds)]).assign_coords(horizon=[10.0, 100.0])


def test_timing_rounds_time_every_leader_and_predict_the_rest(timed_study):
    assert list(timed_study["integrator"].values) == LEADERS
    for key, won in ranking.winners(timed_study).items():
        if won is not None:
            cell = timed_study.sel(scene="goldstein", integrator=won.best.integrator)
            run = cell.isel(horizon=key[1], setting=won.best.setting)
            assert float(run["seconds_timed"]) == 1.0
            assert float(run["seconds_race"]) >= 1.0
            assert np.isfinite(run["seconds_samples"].values).sum() == 3
    ran = np.isfinite(timed_study["seconds"].values)
    assert np.array_equal(ran, timed_study["outcome"].values == "ok")
    assert 0 < np.nansum(timed_study["seconds_timed"].values) < ran.sum()


def test_the_variables_that_figures_and_words_read_are_written(timed_study):
    assert {value for key, value in vars(Column).items() if key.isupper()} <= set(timed_study.data_vars)


def test_a_point_of_the_chart_says_whether_its_time_was_measured(timed_study):
    (chart,) = opening.charts(timed_study)
    for panel, far in zip(chart.panels.values(), range(2), strict=True):
        words = [point[2] for series in panel for point in series.points]
        measured = timed_study["seconds_timed"].isel(scene=0, horizon=far).values == 1.0
        assert sum("(predicted)" not in one for one in words) == measured.sum()
        assert any("(predicted)" in one for one in words)


def cell(samples, errors=None, tiers=None, races=None):
    """One scene and one horizon of a dataset: a setting each, with the given samples."""
    samples = np.asarray(samples, float)
    count = len(samples)
    races = np.full(count, 1.0) if races is None else np.array(races)
    names = list("abcdefg"[:count])
    errors = np.full(count, 1e-7) if errors is None else np.asarray(errors)
    return xr.Dataset(
        {
            "seconds": (("integrator", "setting"), samples.min(axis=1)[:, None]),
            "seconds_samples": (("integrator", "setting", "batch"), samples[:, None, :]),
            "seconds_race": (
                ("integrator", "setting"),
                np.full((count, 1), 1.0) if races is None else np.array(races)[:, None],
            ),
            "force_evaluations": (("integrator", "setting"), np.full((count, 1), 100.0)),
            "axis": (("integrator", "setting"), errors[:, None]),
            "outcome": (("integrator", "setting"), np.full((count, 1), "ok")),
            "tier": (("integrator", "setting"), np.array(tiers or ["compiled"] * count)[:, None]),
        },
        coords={"integrator": names},
    )


def test_a_lead_is_sure_only_if_every_round_agrees_and_it_is_more_than_a_hair():
    clear = ranking.win(cell([[1.0, 1.1, 1.0], [1.3, 1.4, 1.35]]), 1e-6)
    assert clear.best.integrator == "a"
    assert clear.reliable
    mixed = ranking.win(cell([[1.0, 1.6, 1.0], [1.3, 1.4, 1.35]]), 1e-6)
    assert mixed.level == ("b",)
    hair = ranking.win(cell([[1.0, 1.0, 1.0], [1.05, 1.05, 1.05]]), 1e-6)
    assert not hair.reliable


def settings_of_one(seconds, errors, races):
    """One method on one scene and horizon: settings coarse to fine."""
    data = {
        "seconds": seconds, "axis": errors, "seconds_race": races, "outcome": ["ok"] * len(seconds),
        "tier": ["compiled"] * len(seconds), "force_evaluations": [10.0**k for k in range(len(seconds))],
    }  # fmt: skip
    return xr.Dataset({k: (("integrator", "setting"), [v]) for k, v in data.items()}, {"integrator": ["a"]})


def test_a_run_raced_for_a_finer_target_is_not_the_cost_of_a_coarse_one():
    data = settings_of_one([2.0, 1.0, 7.0], [1e-4, 1e-5, 1e-12], [0.0, 0.0, 1.0])
    assert ranking.cheapest(data, 1e-3)[0].cost == 1.0  # nothing was raced for it: the least seconds
    assert ranking.cheapest(data, 1e-11)[0].cost == 7.0
    data = settings_of_one([2.0, 1.0, 7.0], [1e-4, 1e-5, 1e-12], [1.0, 0.0, 1.0])
    assert ranking.cheapest(data, 1e-3)[0].cost == 2.0  # raced for it: more sure than a forecast


def test_a_scene_without_nutation_is_shown_but_not_counted():
    data = xr.Dataset(
        {"nutation_lag": (("scene", "setting"), [[np.nan, 1.0], [np.nan, np.nan]])}, {"scene": ["x", "y"]}
    )
    kept, uncounted = ranking.counted(data)
    assert (list(kept["scene"].values), uncounted) == (["x"], ["y"])
    assert "Not counted: y" in work_words.left_out(uncounted)
    assert work_words.left_out(ranking.counted(kept)[1]) == ""
    assert ranking.counted(data.isel(scene=[1]))[1] == []  # nothing else to count


def test_a_lead_over_a_rival_that_was_not_timed_is_called_predicted():
    both, one = (cell([[1.0] * 3, [2.0] * 3], races=races) for races in ([1.0, 1.0], [1.0, 0.0]))
    assert ranking.win(both, 1e-6).rival_timed
    assert not ranking.win(one, 1e-6).rival_timed
    assert "2.0 times faster than b)" in work_words.lead(1e-6, both)
    assert "2.0 times faster than b, by a predicted time)" in work_words.lead(1e-6, one)


def test_a_slow_spell_that_hits_a_whole_round_does_not_blur_a_lead():
    won = ranking.win(cell([[1.0, 3.0, 1.0], [1.3, 4.0, 1.3]]), 1e-6)
    assert won.reliable
    apart = ranking.win(cell([[1.0, 3.0, 1.0], [1.3, 4.0, 1.3]], races=[1.0, 2.0]), 1e-6)
    restless = ranking.win(cell([[1.0, 1.0, 1.0], [1.3, 5.0, 6.0]]), 1e-6)
    assert not restless.reliable
    assert not apart.reliable  # samples of different races are no pairs


def test_a_rival_that_was_only_predicted_is_behind_by_no_less_than_predictions_miss():
    data = cell([[1.0] * 3, [2.0] * 3], races=[1.0, 0.0])
    assert ranking.win(data, 1e-6).reliable
    doubtful = data.assign(foreseen_miss=("integrator", [1.5, np.nan]))
    assert ranking.win(doubtful, 1e-6).level == ("b",)


def test_plain_python_is_ranked_apart_and_a_failure_does_not_win():
    data = cell([[0.1] * 3, [1.0] * 3, [0.5] * 3], errors=[1e-7, 1e-7, 1e-4], tiers=["python", "compiled", "compiled"])
    assert ranking.win(data, 1e-6).best.integrator == "b"
    assert ranking.win(data, 1e-6, tier="python").best.integrator == "a"
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
    crossing = ranking.crossing(data, "a", "b")
    assert crossing.dearest_won == pytest.approx(100.0, rel=0.06)
    assert (crossing.at_least, crossing.at_most) == (True, False)
    assert crossing.share == pytest.approx(0.5, abs=0.01)
    assert crossing.gain == pytest.approx(100.0)
    turned = ranking.crossing(data, "b", "a")
    assert (turned.at_least, turned.at_most) == (False, True)
    assert turned.dearest_won == pytest.approx(1e4)


def test_costs_relative_to_the_best_keep_failures_visible():
    data = cell([[2.0] * 3, [1.0] * 3], errors=[1e-7, 1e-4]).expand_dims(scene=["x"]).expand_dims(horizon=[10.0])
    ratios = ranking.relative(ranking.costs(data), ["a", "b"])
    assert ratios.sel(target=1e-3).values.ravel().tolist() == [2.0, 1.0]
    assert ratios.sel(target=1e-6).values.ravel().tolist() == [1.0, math.inf]
    assert np.isinf(ratios.sel(target=1e-12).values).all()
    assert ranking.leaders(ratios, 2) == ["a", "b"]


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
