"""Times against each other: forecasts, samples met again, rankings and their leads."""

import math

import numpy as np
import pytest
import xarray as xr
from symtop_studies.work_precision import against_taylor, closed_form as work_closed_form, leads, worth
from symtop_studies.work_precision.leads import met_again
from symtop_studies.work_precision.timing_rounds import forecasts

from symtop.measure import ranking
from symtop.measure.settings import TARGETS
from symtop.measure.timing import timings


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


def test_batches_of_a_round_are_neighbours_in_time():
    called = []
    timings([lambda name=name: called.append(name) for name in "abc"], batches=4, batch=0.0)
    rounds = ["".join(sorted(called[-12 + 3 * k : -9 + 3 * k or None])) for k in range(4)]
    assert rounds == ["abc"] * 4


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


def test_the_median_of_the_closed_form_is_over_all_combinations_and_not_those_that_it_wins():
    short = cell([[2.0] * 3, [1.0] * 3, [4.0] * 3], errors=[1e-16, 1e-4, 1e-7])
    short["control"][0] = ""
    message = work_closed_form.headline(short.expand_dims(scene=["x"]).expand_dims(horizon=[10.0]), ["over ten"])
    assert "1 of 2" in message
    assert "0.5 to 2 (median of all 2: 1.2)" in message  # of the one that it wins it would be 2


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
    assert rows["a"][-1] == "for errors of 1e-03 (1), 1e-06 (1) on here (2)"
    assert rows["c"][:2] == ["0", "2"]
    assert rows["b"][-1] == "never: at its best it takes 3 times the fastest"
    assert rows["d"][-1] == worth.NO_TARGET


def test_a_row_far_behind_is_not_level_because_its_rounds_were_disturbed():
    data = cell([[1.0, 1.1, 1.0], [3.0, 50.0, 70.0]], [1e-7, 1e-7]).expand_dims(scene=["here"], horizon=[10.0])
    assert leads.winners(data)["here", 0, 1e-6].level == ("b",)  # its least time was not met again
    rows = {row[0]: row[1:] for row in worth.table(data).rows}
    assert rows["b"][1] == "0"
    assert rows["b"][-1] == "never: at its best it takes 3 times the fastest"
