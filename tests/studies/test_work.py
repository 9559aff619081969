"""Work and precision: parts of an error, settings that meet targets, timing rounds, rankings, follow-up cases."""

import dataclasses
import math

import numpy as np
import pytest
import xarray as xr
from symtop_studies.work_precision import energy, opening, timing_rounds as rounds_module, words as work_words
from symtop_studies.work_precision.timing_rounds import Effort, TimedRun, contenders, timed_runs, timing_rounds

import symtop
from symtop.measure import ranking
from symtop.measure.phase import phase, split
from symtop.measure.timing import Timing, timings
from symtop.measure.work import TARGETS, Walk, least_work, spans, work_table
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


def timed(name, far=0, place=0, targets=()):
    return TimedRun(name, far, place, 0.1, tuple(targets))


def test_contenders_are_the_runs_that_may_be_the_fastest():
    runs = [timed(name, targets=[0]) for name in "abcdpq"] + [timed("a", place=1, targets=[1]), timed("b", place=1)]
    cost = dict(zip(runs, (1.0, 1.5, 9.0, 10.0, 0.5, 500.0, 1.0, 1.0), strict=True))
    implementation = dict.fromkeys("abcd", "compiled") | dict.fromkeys("pq", "python")
    near = contenders(runs, cost, implementation)
    assert [(run.name, run.place) for run in near] == [("a", 0), ("b", 0)]  # p and the other a are alone in front


def test_a_time_that_is_taken_twice_and_differs_by_a_quarter_is_taken_again(monkeypatch):
    scene = symtop.scene("goldstein")
    runs = [timed("strang", targets=[0]), timed("midpoint", targets=[0]), timed("rk4", place=2, targets=[0])]
    speed = {"strang": (1.0, 1.1, 9.0), "midpoint": (1.2, 1.6, 1.4), "rk4": (9.0, 9.0, 9.0)}
    stages = []

    def pretended(names, rounds, batch, seed):
        stages.append((sorted(names), rounds, batch))
        return [Timing((speed[name][seed],) * rounds, 7.0 + seed) for name in names]

    monkeypatch.setattr(rounds_module, "timings", pretended)
    monkeypatch.setattr(rounds_module, "bare_run", lambda _scene, method, *_: method.name)
    table = timing_rounds(scene, [1.0], runs, Effort(3, 0.005), Effort(5, 0.01)).isel(horizon=0)
    assert stages == [
        (["midpoint", "rk4", "strang"], 3, 0.005),
        (["midpoint", "strang"], 5, 0.01),
        (["midpoint"], 5, 0.01),
    ]
    row = table.sel(integrator="midpoint").isel(setting=0)
    assert row["seconds_samples"].values.tolist() == [1.2] * 3 + [1.6] * 5 + [1.4] * 5
    assert float(row["seconds"]) == 1.2
    assert float(row["spread"]) == pytest.approx(1.4 / 1.2 - 1.0)
    assert table["seconds"].isel(setting=1).isnull().all()  # nobody timed it: no time
    assert float(table["seconds"].sel(integrator="rk4").isel(setting=2)) == 9.0
    assert table["first_call"].values.tolist() == [7.0] * 3


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
    runs = timed_runs(data.sel(scene="goldstein"), ["stormer-verlet"])
    seconds = timing_rounds(scene, far, runs, Effort(3, 0.001), Effort(3, 0.002))
    return store.combine([*tables, (Case("goldstein", "together"), seconds)]).assign_coords(horizon=[10.0, 100.0])


def test_the_cheapest_runs_of_each_method_have_a_time_and_no_other_run(timed_study):
    assert list(timed_study["integrator"].values) == LEADERS
    ran = timed_study["outcome"] == "ok"
    least = [least_work(timed_study.transpose(..., "setting"), target) for target in TARGETS]
    place = xr.DataArray(np.stack(least), dims=("target", *timed_study["axis"].dims[:-1]))
    cheapest = (timed_study["setting"] == place).any("target")
    compared = ran & (timed_study["integrator"] == "stormer-verlet") & (timed_study["horizon"] == 100.0)
    expected, has_time = xr.broadcast(cheapest | compared, timed_study["seconds"].notnull())
    assert (expected == has_time).all()
    assert 0 < has_time.sum() < ran.sum()
    samples = timed_study["seconds_samples"]
    assert ((samples.notnull().sum("batch") >= 3) == has_time).all()
    assert (timed_study["seconds"] == samples.min("batch")).where(has_time, True).all()


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
    }  # fmt: skip
    data = xr.Dataset({name: (("integrator", "setting"), values[:, None]) for name, values in table.items()})
    data["seconds_samples"] = (("integrator", "setting", "batch"), samples[:, None, :])
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
        implementation=("integrator", ["compiled"]), seconds_samples=data["seconds"].expand_dims(batch=3)
    )
    data = data.assign_coords(integrator=["a"])
    assert [ranking.cheapest(data, target)[0].cost for target in (1e-1, 1e-3, 3e-5, 1e-12)] == [0.5, 2.0, 7.0, 7.0]
    assert ranking.cheapest(data, 1e-13) == []


def test_a_scene_without_nutation_is_shown_but_not_counted():
    data = xr.Dataset(
        {"nutation_lag": (("scene", "setting"), [[np.nan, 1.0], [np.nan, np.nan]])}, {"scene": ["x", "y"]}
    )
    kept, uncounted = ranking.counted(data)
    assert (list(kept["scene"].values), uncounted) == (["x"], ["y"])
    assert "Not counted: y" in work_words.left_out(uncounted)
    assert work_words.left_out(ranking.counted(kept)[1]) == ""
    assert ranking.counted(data.isel(scene=[1]))[1] == []  # nothing else to count


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


def test_costs_relative_to_the_best_keep_failures_visible():
    data = cell([[2.0] * 3, [1.0] * 3], errors=[1e-7, 1e-4]).expand_dims(scene=["x"]).expand_dims(horizon=[10.0])
    ratios = ranking.relative_costs(data, ["a", "b"])
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
