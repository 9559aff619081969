"""Work and precision: settings that meet targets, timing rounds, leads and their noise, energies within a chart."""

import math
import pickle
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from symtop_studies.work_precision import (
    against_taylor,
    closed_form as work_closed_form,
    energy,
    leads,
    timing_rounds as rounds_module,
    trust,
    worth,
)
from symtop_studies.work_precision.leads import met_again
from symtop_studies.work_precision.timing_rounds import (
    PATIENCE,
    Effort,
    TimedRun,
    contenders,
    forecasts,
    timed_runs,
    timing_rounds,
)  # fmt: skip
from symtop_studies.work_precision.walk import CAPPED, TOO_WIDE, Walk, least_work, nutation_width, spans, work_table

import symtop
from symtop.measure import datasets, ranking
from symtop.measure.accuracy import error_row
from symtop.measure.settings import TARGETS, compared, limits
from symtop.measure.timing import Timing
from symtop.methods.framework.registry import methods
from symtop.runner.study import Case


def timed(name, far=0, place=0, targets=()):
    return TimedRun(name, far, place, 0.1 * (place + 1), 100.0 * (place + 1), 100.0, tuple(targets))


def test_contenders_are_the_runs_that_may_be_the_fastest():
    runs = [timed(name, targets=[0]) for name in "abcdpq"] + [timed("a", place=1, targets=[1]), timed("b", place=1)]
    cost = dict(zip(runs, (1.0, 1.5, 9.0, 10.0, 0.5, 500.0, 1.0, 1.0), strict=True))
    implementation = dict.fromkeys("abcd", "compiled") | dict.fromkeys("pq", "python")
    near = contenders(runs, cost, implementation)
    assert [(run.name, run.place) for run in near] == [("a", 0), ("b", 0)]  # p and the other a are alone in front


def test_a_time_that_misses_its_forecast_by_a_quarter_is_taken_again(monkeypatch):
    scene = symtop.scene("goldstein")
    runs = [timed("rk4[axis]", place=k, targets=[k] if k < 4 else ()) for k in range(5)]
    runs += [timed("strang[axis]", place=k, targets=[k] if k < 4 else ()) for k in range(5)]
    stages, patient = [], []

    def pretended(calls, rounds, batch, seed=0, *, warm=True, patience=math.inf):
        assert warm
        stages.append((sorted(calls), rounds, batch))
        patient.append(patience)
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
    assert patient == [PATIENCE, math.inf, math.inf, math.inf]
    again, rounds, batch = stages[3]
    assert ("strang[axis]", 3) in again
    assert {name for name, _ in again} == {"strang[axis]"}  # its neighbours are foretold from it
    assert (rounds, batch) == (4, 0.005)
    row = table.sel(variant="strang[axis]")
    assert row["seconds"].values.tolist() == [9.0, 18.0, 27.0, 36.0, 45.0]  # the glitch is gone
    assert row["seconds_forecast"].values == pytest.approx(row["seconds"].values)
    assert row["seconds_samples"].isel(setting=3).values[:3].tolist() == [36.0 * 2.8] * 3
    assert np.isnan(table["seconds_samples"].sel(variant="rk4[axis]").values[:, 3:]).all()
    assert table["first_call"].values.tolist() == [7.0, 7.0]
    assert table["set_up_seconds"].isnull().all()


LEADERS = ["kahan-li-6[axis]", "srkn-11-6[axis]", "stormer-verlet[angles]", "taylor[axis]"]


@pytest.fixture(scope="module")
def timed_study():
    """The study's dataset of one scene and four methods over two horizons."""
    scene = symtop.scene("goldstein")
    far = [10.0 * scene.nutation_period, 100.0 * scene.nutation_period]
    tables = [(Case("goldstein", name), work_table(scene, symtop.integrator(name), far, 4e4)) for name in LEADERS]
    data = datasets.combine(tables)
    runs = timed_runs(data.sel(scene="goldstein"), ["stormer-verlet[angles]"])
    seconds = timing_rounds(scene, far, runs, Effort(3, 0.001), Effort(3, 0.002))
    return datasets.combine([*tables, (Case("goldstein", "together"), seconds)]).assign_coords(horizon=[10.0, 100.0])


def test_the_cheapest_runs_of_each_method_have_a_time_and_no_other_run(timed_study):
    assert list(timed_study["variant"].values) == LEADERS
    ran = timed_study["outcome"] == "ok"
    least = [least_work(timed_study.transpose(..., "setting"), target) for target in TARGETS]
    place = xr.DataArray(np.stack(least), dims=("target", *timed_study["axis"].dims[:-1]))
    cheapest = (timed_study["setting"] == place).any("target")
    compared = ran & (timed_study["variant"] == "stormer-verlet[angles]") & (timed_study["horizon"] == 100.0)
    expected, has_time = xr.broadcast(cheapest | compared, timed_study["seconds"].notnull())
    assert (expected == has_time).all()
    assert 0 < has_time.sum() < ran.sum()
    samples = timed_study["seconds_samples"]
    assert ((samples.notnull().sum("batch") >= 2) == has_time).all()
    assert (timed_study["seconds"] == samples.min("batch")).where(has_time, True).all()
    assert trust.measured(timed_study) == 1.0
    modelled = timed_study.assign(seconds=timed_study["seconds"] * 1.01)
    assert trust.measured(modelled) == 0.0


def test_a_crossing_of_two_power_laws_is_found_where_it_is():
    x = np.geomspace(1.0, 1e4, 9)
    table = np.array([1e-3 / x, 1e-1 / x**2])  # equal at 100
    data = xr.Dataset(
        {
            "seconds": (("variant", "setting"), np.array([x, x])),
            "energy": (("variant", "setting"), table),
            "outcome": (("variant", "setting"), np.full((2, 9), "ok")),
        },
        coords={"variant": ["a", "b"], "scene": "x"},
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
            "seconds": (("variant", "setting"), np.tile(x, (6, 1))),
            "energy": (("variant", "setting"), np.array([x**-4.0, x**-2.0, 0.1 * x**-4.0, 1e-3 / x**4, x**-9.0, x])),
            "steps": (("variant", "setting"), np.tile(x, (6, 1))),
            "force_evaluations": (("variant", "setting"), np.array([4.0, 1, 4, 1, 20, 6])[:, None] * x),
            "outcome": (("variant", "setting"), np.full((6, 9), "ok")),
            "control": ("variant", ["step_size"] * 4 + ["tolerance"] * 2),
            "chart": ("variant", ["angles", "angles", "axis", "axis", "axis", "angles"]),
            "structured": ("variant", [0.0, 1, 0, 1, 0, 0]),
            "implementation": ("variant", ["compiled"] * 5 + ["python"]),
        },
        coords={"variant": names},
    ).expand_dims(scene=["x"]).expand_dims(horizon=[1.0])  # fmt: skip
    assert energy.in_chart(data, "axis") == (["rk4[axis]", "taylor[axis]"], ["strang[axis]"])
    assert energy.in_chart(data, "angles") == (["rk4[angles]"], ["midpoint[angles]"])
    pairs = [(classic, row) for chart in energy.CHARTS for classic, rows in energy.crossings(data, chart).items()
             for row in rows]  # fmt: skip
    assert pairs == [("rk4[axis]", "strang[axis]"), ("taylor[axis]", "strang[axis]"),
                     ("rk4[angles]", "midpoint[angles]")]  # fmt: skip
    assert energy.table(data).rows == [
        ["rk4[axis]", "1", "1", "0", "0", "0", "0", "strang[axis]", "none"],
        ["taylor[axis]", "1", "0", "1", "0", "0", "0", "none", "none"],
        ["rk4[angles]", "1", "0", "0", "0", "0", "1", "none", "midpoint[angles]"],
    ]
    assert energy.tallies(data, "axis") == {"rk4[axis]": (1, 0, 0), "taylor[axis]": (0, 1, 0)}
    assert energy.tallies(data, "angles") == {"rk4[angles]": (0, 0, 1)}
    with_gauss = xr.concat([data, data.sel(variant=["strang[axis]"]).assign_coords(variant=["gauss-4[axis]"])],
                           "variant", data_vars="minimal")  # fmt: skip
    assert energy.by_construction(with_gauss, "axis") == ["gauss-4[axis]"]  # and it changes no number
    assert energy.tallies(with_gauss, "axis") == energy.tallies(data, "axis")
    assert energy.timed(with_gauss) == [
        "rk4[axis]", "taylor[axis]", "strang[axis]", "gauss-4[axis]", "rk4[angles]", "midpoint[angles]",
    ]  # fmt: skip
    error, work = energy.at_steps(data.isel(scene=0, horizon=0).sel(variant="rk4[axis]"), 118.0)
    assert (error, work) == (pytest.approx(0.1 * 118.0**-4), pytest.approx(4.0))


def called(seconds, table):
    """The winners that are called beyond the noise, by horizon and target, with all winners."""
    data = datasets.combine([*table, (Case("goldstein", "together"), seconds)])
    wins = leads.winners(data)
    return {key: won.best.integrator for key, won in wins.items() if won and not won.level}, {
        key: won.best.integrator for key, won in wins.items() if won
    }


TIMED_AGAIN = """
import pickle, sys
from symtop.runner import scripts
scripts.install()
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
    runs = [tuple(run) for run in timed_runs(datasets.combine(table).sel(scene="goldstein"))]
    question = tmp_path / "question.pickle"
    question.write_bytes(pickle.dumps((scene, far, runs)))
    outcomes = []
    for number in range(2):
        answer = tmp_path / f"{number}.nc"
        subprocess.run([sys.executable, "-c", TIMED_AGAIN, str(question), str(answer)], check=True)
        outcomes.append(called(xr.load_dataset(answer), table))
    for (sure, _), (_, wins) in (outcomes, outcomes[::-1]):
        assert {key: wins[key] for key in sure} == sure


def test_the_parts_are_compared_at_equal_settings_and_above_rounding():
    settings = [[0.1, 0.05, 0.01], [0.05, 0.1, np.nan]]
    runs = xr.Dataset({"setting_value": (("horizon", "setting"), settings),
                       "shape": (("horizon", "setting"), [[1e-3, 1e-4, 1e-14], [2e-4, 3e-3, np.nan]])})  # fmt: skip
    assert energy.ratios_at_equal_settings(runs, "shape") == pytest.approx([3.0, 2.0])
    assert energy.growth_at_equal_settings(runs, "shape") == pytest.approx(2.5)


def test_settings_come_close_to_every_target_from_below():
    scene, method = symtop.scene("goldstein"), symtop.integrator("kahan-li-6")
    table = work_table(scene, method, [10.0 * scene.nutation_period], 1e6).isel(horizon=0)
    assert str(table["stopped"].values) == "all targets met"
    for target in TARGETS:
        good = table["axis"].values <= target
        best = int(np.flatnonzero(good)[np.argmin(table["steps"].values[good])])
        assert table["axis"].values[best] >= 0.4 * target
        step = float(table["setting_value"].values[best])
        coarser = symtop.simulate(scene, method, step_size=1.25 * step, horizon=10.0 * scene.nutation_period)
        assert symtop.errors(coarser)["axis"].max() > target


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


@pytest.mark.parametrize(("name", "good"), [("sofroniou-spaletta-10[axis]", True), ("takahashi-imada[axis]", False)])
def test_an_accurate_long_step_is_accurate_between_its_ends_too(name, good):
    scene, method = symtop.scene("cusp"), symtop.integrator(name)
    step = scene.nutation_period / 1.27
    at_ends = float(error_row(scene, method, step, 12.0 * step, "axis")["axis"])
    between = []
    for k in range(20):  # runs that end anywhere within a step, with steps that are a little shorter
        horizon = (11.0 + (k + 0.5) / 20.0) * step
        between.append(float(error_row(scene, method, horizon / 12.0, horizon, "axis")["axis_end"]))
    assert (at_ends < 1e-5) is good
    assert max(between) < 1.5 * at_ends


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
    pole = symtop.scene("bruls-cardona-arnold")
    table = work_table(pole, symtop.integrator("midpoint[angles]"), [100.0 * pole.nutation_period], 1e4)
    assert set(map(str, table["reached"].values.ravel())) == {"left chart"}


def test_the_rows_are_every_method_in_every_chart_that_costs_what_the_axis_costs():
    names = [row.name for row in compared("axis")]
    assert {"rk4[angles]", "rk4[axis]", "strang[axis]", "midpoint[angles]", "exact[attitude]"} <= set(names)
    assert "strang[attitude]" not in names  # the same axis for more work
    assert "strang[attitude]" in [row.name for row in compared("attitude")]
    assert {row.method for row in compared("axis")} == {name for name, one in methods().items() if not one.exact_steps}


def test_a_walk_ends_at_its_budget_and_says_so():
    scene, method = symtop.scene("goldstein"), symtop.integrator("stormer-verlet")
    table = work_table(scene, method, [10.0 * scene.nutation_period, 1000.0 * scene.nutation_period], 3e4)
    assert list(table["stopped"].values) == ["budget", "budget"]
    assert np.nanmax(table["force_evaluations"].values) <= 1.05 * 3e4
    assert (table["outcome"].values[1] == "not_run").any()  # padding says that nobody ran
    nothing = work_table(scene, method, [10.0 * scene.nutation_period, 1000.0 * scene.nutation_period], 500.0)
    assert set(nothing["outcome"].values[1]) == {"not_run"}


def test_a_run_that_costs_far_more_than_was_foreseen_ends():
    """At 1e-2 rk45 loses the motion, and its steps shrink: 850,000 evaluations over 1000 nutations for 20,000."""
    scene = symtop.scene("goldstein")
    table = work_table(scene, symtop.integrator("rk45[axis]"), spans(scene, [10.0, 1000.0]), 2.5e4)
    assert table["outcome"].values[1, 0] == "out_of_budget"
    assert 5e4 <= np.nanmax(table["force_evaluations"].values) <= 5.1e4
    assert list(table["stopped"].values) == ["budget", "budget"]
    assert list(table["reached"].values[1]) == ["out of budget"] * 4
    assert (table["outcome"].values[0] == "ok").all()


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


def test_times_are_foretold_by_the_other_runs_of_a_method():
    steps = np.array([40.0, 90.0, 300.0, 1e3, 5e3, 2e4])
    work = steps * np.array([9.0, 8.0, 8.0, 7.0, 6.0, 6.0])
    exact = 1e-5 + 2e-8 * work + 3e-8 * steps
    assert forecasts(exact, work, steps, fixed_step=True) == pytest.approx(exact, rel=1e-9)
    derivatives = 1e-5 + 1e-9 * work**2 / steps
    assert forecasts(derivatives, work, steps, fixed_step=False) == pytest.approx(derivatives, rel=1e-9)
    terms = derivatives + 8e-8 * steps  # a step that prepares itself, whatever its order
    assert forecasts(terms, work, steps, fixed_step=False) == pytest.approx(terms, rel=1e-6)
    glitch = exact.copy()
    glitch[3] *= 2.8  # as one winner of 72 once
    assert glitch[3] / forecasts(glitch, work, steps, fixed_step=True)[3] == pytest.approx(2.8, rel=1e-9)
    assert np.isnan(forecasts(exact[:2], work[:2], steps[:2], fixed_step=True)).all()


def test_a_sample_that_no_other_comes_near_is_not_met_again():
    assert met_again([1.0, 1.05, 3.0, math.nan])
    assert not met_again([1.0, 1.3, 1.3])
    assert not met_again([1.0, math.nan])


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
    data = xr.Dataset({name: (("variant", "setting"), values[:, None]) for name, values in table.items()})
    data["seconds_samples"] = (("variant", "setting", "batch"), samples[:, None, :])
    data["control"] = data["control"].isel(setting=0)
    data["nutation_width"] = ("variant", np.ones(count))
    return data.assign_coords(variant=list("abcdefg"[:count]))


def test_a_lead_is_sure_only_if_every_round_agrees_and_it_is_more_than_a_hair():
    clear = leads.win(cell([[1.0, 1.1, 1.0], [1.3, 1.4, 1.35]]), 1e-6)
    assert clear.best.integrator == "a"
    assert clear.level == ()
    assert (clear.behind.integrator, clear.ratio) == ("b", pytest.approx(1.3, rel=0.03))
    mixed = leads.win(cell([[1.0, 1.6, 1.0], [1.3, 1.4, 1.35]]), 1e-6)
    assert mixed.level == ("b",)
    hair = leads.win(cell([[1.0, 1.0, 1.0], [1.05, 1.05, 1.05]]), 1e-6)
    assert hair.level == ("b",)


def test_the_cost_of_a_target_is_that_of_the_cheapest_timed_run_that_meets_it():
    rows = {"seconds": [0.5, 2.0, math.nan, 7.0], "axis": [1e-2, 1e-4, 1e-5, 1e-12], "outcome": ["ok"] * 4}
    data = xr.Dataset({name: (("variant", "setting"), [values]) for name, values in rows.items()})
    data = data.assign(
        implementation=("variant", ["compiled"]), seconds_samples=data["seconds"].expand_dims(batch=3),
        control=("variant", ["step_size"]), nutation_width=("variant", [1.0]),
        seconds_forecast=math.nan * data["seconds"],
    )  # fmt: skip
    data = data.assign_coords(variant=["a"])
    assert [ranking.cheapest(data, target)[0].cost for target in (1e-1, 1e-3, 3e-5, 1e-12)] == [0.5, 2.0, 7.0, 7.0]
    assert ranking.cheapest(data, 1e-13) == []


def test_the_closed_form_is_not_ranked_but_stands_beside_the_others():
    data = cell([[0.1] * 3, [1.0] * 3, [2.0] * 3], errors=[1e-16, 1e-7, 1e-7])
    assert leads.win(data, 1e-6).best.integrator == "a"
    data["control"][0] = ""
    data = data.assign(
        set_up_seconds=("variant", [0.1, np.nan, np.nan]), sample_seconds=("variant", [6e-7, np.nan, np.nan])
    )
    assert ranking.ranked(data) == ["b", "c"]
    assert leads.win(data, 1e-6).best.integrator == "b"
    assert leads.win(data, 1e-12) is None  # it alone would meet that


def test_the_closed_form_is_compared_with_the_fastest_row():
    data = cell([[0.1] * 3, [1.0] * 3, [2.0] * 3], errors=[1e-16, 1e-7, 1e-7])
    data["control"][0] = ""
    data = data.expand_dims(scene=["x"]).expand_dims(horizon=[10.0])
    pairs = work_closed_form.compared(data)
    assert [(pair.row, pair.target, pair.ratio) for pair in pairs] == [("b", 1e-3, 10.0), ("b", 1e-6, 10.0)]
    (row,) = work_closed_form.table(data, ["ten"]).rows
    assert row == ["x", "ten", "10 (1e+05 us; b)", "10 (1e+05 us; b)", "", ""]


def test_own_rows_are_compared_with_taylor():
    """One is ahead at 1e-3 and alone at 1e-9; without taylor nothing is said, and a slower row is named as such."""
    data = cell([[0.5] * 3, [1.0] * 3, [2.0] * 3], errors=[1e-4, 1e-7, 1e-10])
    data = data.assign_coords(variant=["series[axis]", "taylor[axis]", "rk4[axis]"])
    data = data.expand_dims(scene=["x"]).expand_dims(horizon=[10.0])
    (row,) = against_taylor.table(data, ["over ten"]).rows
    assert row == ["x", "over ten", "0.50 (series[axis])", "2.00 (rk4[axis])", "rk4[axis] alone", "neither"]
    only = data.sel(variant=["series[axis]", "rk4[axis]"])
    assert against_taylor.compared(only) == {}
    assert [one.alone for one in against_taylor.compared(data).values()] == ["", "", "own", ""]


def test_the_rival_is_taylor_in_double_precision_and_its_longer_forms_are_told_where_they_are_alone():
    """In longer arithmetic taylor is slower at 1e-9, and alone at 1e-12; a row of another name is no rival."""
    names = ["series[axis]", "taylor[axis]", "taylor-longdouble[axis]", "taylor-mine[axis]"]
    data = cell([[1.0] * 3, [3.0] * 3, [20.0] * 3, [0.5] * 3], errors=[1e-10, 1e-10, 1e-13, 1e-4])
    data = data.assign_coords(variant=names).expand_dims(scene=["x"]).expand_dims(horizon=[10.0])
    (row,) = against_taylor.table(data, ["over ten"]).rows
    assert row[2:] == ["0.17 (taylor-mine[axis])", "0.33 (series[axis])", "0.33 (series[axis])",
                       "taylor-longdouble[axis] alone"]  # fmt: skip


def test_a_target_wider_than_the_nutation_has_no_winner_and_does_not_count():
    data = cell([[1.0] * 3, [2.0] * 3]).expand_dims(scene=["x"]).expand_dims(horizon=[10.0])
    assert list(leads.winners(data)) == [("x", 0, target) for target in TARGETS]
    narrow = data.assign(nutation_width=4e-4 * data["nutation_width"])
    assert list(leads.winners(narrow)) == [("x", 0, target) for target in TARGETS if target < 4e-4]
    assert leads.relative_costs(narrow, ["a", "b"]).sel(target=1e-3).isnull().all()


def test_a_time_that_misses_its_forecast_leads_only_if_the_forecast_does():
    data = cell([[1.0] * 3, [2.8] * 3])
    assert leads.win(data, 1e-6).level == ()
    data["seconds_forecast"] = (("variant", "setting"), [[1.0], [1.05]])  # the second was unlucky in every round
    assert leads.win(data, 1e-6).level == ("b",)
    data["seconds_forecast"] = (("variant", "setting"), [[1.0], [2.9]])
    assert leads.win(data, 1e-6).level == ()
    data["seconds_forecast"] = (("variant", "setting"), [[2.7], [2.9]])  # the first was timed too short
    assert leads.win(data, 1e-6).level == ("b",)


def test_the_margin_of_a_lead_grows_with_the_noise_of_the_times():
    data = cell([[1.0] * 3, [1.3] * 3, [2.0] * 3, [3.0] * 3])
    data["seconds_forecast"] = data["seconds"] * xr.DataArray(
        [[1.01], [0.99], [1.02], [1.0]], dims=data["seconds"].dims
    )
    assert leads.margin(data) == leads.MARGIN
    assert leads.win(data, 1e-6).level == ()
    data["seconds_forecast"] = data["seconds"] * xr.DataArray([[1.01], [0.8], [1.2], [0.8]], dims=data["seconds"].dims)
    assert leads.margin(data) == pytest.approx(1.5)
    assert leads.win(data, 1e-6).level == ("b",)


def test_a_row_that_meets_an_error_on_more_scenes_comes_before_a_faster_one():
    table = np.array([[1.0, 1.0, math.inf, math.inf], [9.0, 9.0, 1.0, 1.0], [10.0, 12.0, 8.0, 9.0]])
    ratios = xr.DataArray(table[None], {"target": [1e-12], "variant": list("abc")}, ("target", "variant", "problem"))
    assert leads.leaders(ratios, 3) == ["b", "c", "a"]
    assert leads.leaders(ratios.isel(problem=[0, 1]), 3) == ["a", "b", "c"]


def test_a_slow_spell_that_hits_a_whole_round_does_not_blur_a_lead():
    won = leads.win(cell([[1.0, 3.0, 1.0], [1.3, 4.0, 1.3]]), 1e-6)
    assert won.level == ()
    restless = leads.win(cell([[1.0, 1.0, 1.0], [1.3, 5.0, 6.0]]), 1e-6)
    assert restless.level == ("b",)


def test_samples_are_pairs_only_within_a_round_and_the_last_common_rounds_count():
    no = math.nan
    apart = leads.win(cell([[1.0, 1.0, 1.0, no, no, no], [no, no, no, 2.0, 2.0, 2.0]]), 1e-6)
    assert apart.level == ("b",)
    far = [[1.0, 1.3, 1.0, no, no, no], [no, no, no, 4.0, 9.0, no]]
    assert leads.win(cell(far), 1e-6).level == ()
    assert leads.win(cell([[1.0, 1.4, 1.0, no, no, no], far[1]]), 1e-6).level == ("b",)  # one sample of each is near
    assert leads.win(cell([far[0], [no, no, no, 4.0, no, no]]), 1e-6).level == ("b",)  # a single one
    assert leads.win(cell([[1.0, 1.3, no, no, no, no], far[1]]), 1e-6).level == ("b",)  # too few of the first
    base, later = [1.0, 3.0, 1.0], [1.0] * 5
    assert leads.win(cell([[*base, *later], [2.0, 2.0, 2.0, *[1.3] * 5]]), 1e-6).ratio == pytest.approx(1.3)
    assert leads.win(cell([[*base, *later], [2.0, 4.0, 2.0, *[no] * 5]]), 1e-6).ratio == pytest.approx(2.0)


def test_plain_python_is_ranked_apart_and_a_failure_does_not_win():
    data = cell(
        [[0.1] * 3, [1.0] * 3, [0.5] * 3], errors=[1e-7, 1e-7, 1e-4], implementations=["python", "compiled", "compiled"]
    )
    assert leads.win(data, 1e-6).best.integrator == "b"
    assert leads.win(data, 1e-6, implementation="python").best.integrator == "a"
    assert leads.win(data, 1e-9) is None
    data["outcome"][1, 0] = "left_chart"
    assert leads.win(data, 1e-6) is None


def test_costs_relative_to_the_best_keep_failures_visible():
    data = cell([[2.0] * 3, [1.0] * 3], errors=[1e-7, 1e-4]).expand_dims(scene=["x"]).expand_dims(horizon=[10.0])
    ratios = leads.relative_costs(data, ["a", "b"])
    assert ratios.sel(target=1e-3).values.ravel().tolist() == [2.0, 1.0]
    assert ratios.sel(target=1e-6).values.ravel().tolist() == [1.0, math.inf]
    assert np.isinf(ratios.sel(target=1e-12).values).all()
    assert leads.leaders(ratios, 2) == ["a", "b"]


def test_when_to_choose_a_row_is_said_from_its_times_alone():
    fast, slow, level = [1.0, 1.1, 1.0], [3.0, 3.1, 3.2], [1.02, 1.0, 1.1]
    errors = np.array([1e-7, 1e-7, 1e-7, 1e-2])
    one = cell([fast, slow, level, fast], errors).expand_dims(scene=["here"], horizon=[10.0])
    rows = {row[0]: row[1:] for row in worth.table(one).rows}
    assert rows["a"][:3] == ["2", "0", "2 of 4"]  # 1e-3 and 1e-6
    assert rows["c"][:2] == ["0", "2"]
    assert rows["d"][-1] == worth.NO_TARGET


def test_a_row_far_behind_is_not_level_because_its_rounds_were_disturbed():
    data = cell([[1.0, 1.1, 1.0], [3.0, 50.0, 70.0]], [1e-7, 1e-7]).expand_dims(scene=["here"], horizon=[10.0])
    assert leads.winners(data)["here", 0, 1e-6].level == ("b",)  # its least time was not met again
    rows = {row[0]: row[1:] for row in worth.table(data).rows}
    assert rows["b"][1] == "0"
