"""Work and precision: timing rounds, energies within a chart, charts, and the second round of cases."""

import math
import pickle
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from symtop_studies.work_precision import energy, figures, leads, timing_rounds as rounds_module, trust
from symtop_studies.work_precision.timing_rounds import (
    PATIENCE,
    Effort,
    TimedRun,
    contenders,
    timed_runs,
    timing_rounds,
)  # fmt: skip
from symtop_studies.work_precision.walk import least_work, work_table

import symtop
from symtop.measure.settings import TARGETS
from symtop.measure.timing import Timing
from symtop.runner import store
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
    data = store.combine(tables)
    runs = timed_runs(data.sel(scene="goldstein"), ["stormer-verlet[angles]"])
    seconds = timing_rounds(scene, far, runs, Effort(3, 0.001), Effort(3, 0.002))
    return store.combine([*tables, (Case("goldstein", "together"), seconds)]).assign_coords(horizon=[10.0, 100.0])


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
    said = energy.sentence(data, "axis")
    assert "in 100% of 1 comparisons with rk4[axis] and 0% of 1 with taylor[axis]." in said
    assert "in 0% of 1 comparisons with rk4[angles]." in energy.sentence(data, "angles")
    assert energy.table(data).rows == [
        ["rk4[axis]", "1", "1", "0", "0", "0", "0", "strang[axis]", "none"],
        ["taylor[axis]", "1", "0", "1", "0", "0", "0", "none", "none"],
        ["rk4[angles]", "1", "0", "0", "0", "0", "1", "none", "midpoint[angles]"],
    ]
    assert energy.tallies(data, "axis") == {"rk4[axis]": (1, 0, 0), "taylor[axis]": (0, 1, 0)}
    assert energy.tallies(data, "angles") == {"rk4[angles]": (0, 0, 1)}
    assert energy.message(data, "axis") == (
        "Structure-preserving methods in the axis chart keep energy better at every run time in at least half of the "
        "comparisons with rk4 (100%), in less than half of the comparisons with taylor (0%)"
    )
    with_gauss = xr.concat([data, data.sel(variant=["strang[axis]"]).assign_coords(variant=["gauss-4[axis]"])],
                           "variant", data_vars="minimal")  # fmt: skip
    assert energy.by_construction(with_gauss, "axis") == ["gauss-4[axis]"]  # and it changes no number
    assert energy.tallies(with_gauss, "axis") == energy.tallies(data, "axis")
    assert energy.message(with_gauss, "axis") == energy.message(data, "axis")
    assert "(e, L), without 1 that conserves the energy by construction, have" in energy.sentence(with_gauss, "axis")
    assert "by construction" not in said
    assert energy.timed(with_gauss) == [
        "rk4[axis]", "taylor[axis]", "strang[axis]", "gauss-4[axis]", "rk4[angles]", "midpoint[angles]",
    ]  # fmt: skip
    error, work = energy.at_steps(data.isel(scene=0, horizon=0).sel(variant="rk4[axis]"), 118.0)
    assert (error, work) == (pytest.approx(0.1 * 118.0**-4), pytest.approx(4.0))
    assert "with strang[axis] (1)" in energy.at_equal_steps(data, ["rk4[axis]", "strang[axis]"], "x")


def test_times_that_no_other_predicts_are_told_apart(timed_study):
    known = timed_study["seconds_forecast"].where(timed_study["seconds"].notnull())
    assert trust.trust(timed_study).forecast == int(known.notnull().sum())
    lone = timed_study.assign(seconds_forecast=known.where(known["variant"] != "taylor[axis]"))
    least = int((timed_study["seconds"].sel(variant="taylor[axis]").notnull()).sum())
    whole = int(timed_study["seconds"].notnull().sum())
    rest = int((timed_study["seconds"].notnull() & lone["seconds_forecast"].isnull()).sum())
    assert rest >= least > 0
    said = trust.sentence(lone)
    assert said.startswith(f"{whole - rest} of the {whole} times were compared with the one")
    assert f"The other {rest} belong to variants with too few times" in said
    full = timed_study.assign(seconds_forecast=timed_study["seconds"])
    assert "The other" not in trust.sentence(full)


def called(seconds, table):
    """The winners that are called beyond the noise, by horizon and target, with all winners."""
    data = store.combine([*table, (Case("goldstein", "together"), seconds)])
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


def test_the_parts_are_compared_at_equal_settings_and_above_rounding():
    settings = [[0.1, 0.05, 0.01], [0.05, 0.1, np.nan]]
    runs = xr.Dataset({"setting_value": (("horizon", "setting"), settings),
                       "shape": (("horizon", "setting"), [[1e-3, 1e-4, 1e-14], [2e-4, 3e-3, np.nan]])})  # fmt: skip
    assert energy.ratios_at_equal_settings(runs, "shape") == pytest.approx([3.0, 2.0])
    assert energy.growth_at_equal_settings(runs, "shape") == pytest.approx(2.5)


@pytest.mark.parametrize(
    ("share", "text"), [(0.0, "0%"), (1 / 163, "0.6%"), (0.47, "47%"), (0.998, "99.8%"), (1.0, "100%")]
)
def test_a_share_that_is_neither_none_nor_all_does_not_read_as_such(share, text):
    assert energy.percent(share) == text


def test_the_middle_slowdown_counts_targets_that_are_not_met_as_endless():
    table = xr.DataArray([[1.0, 1.0, np.nan, np.nan], [50.0, 60.0, 70.0, np.nan]], dims=("variant", "problem"),
                         coords={"variant": ["quick", "sure"]})  # fmt: skip
    assert figures.middles(table) == (3, [("quick", 2, 1.0), ("sure", 3, 60.0)])


def test_what_stays_is_told_from_what_grows():
    message = figures.growth_message(("10", "1000"), [1.0, 1.02, 99.0], [100.0, 101.0, 9e3])
    assert "2 of the 3" in message
    assert "101 times" in message
