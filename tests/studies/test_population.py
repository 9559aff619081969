"""The study of populations: scales and errors of many tops, the arithmetic of costs and shares, and its verdicts."""

import math

import numpy as np
import pytest
import xarray as xr
from symtop_studies.population import costs, ladder, prices as pricing, study, tops as tops_module, verdicts, words
from symtop_studies.population.costs import Share, cost_to_reach, detection, quantiles, run_lengths, slowdowns, winner
from symtop_studies.population.prices import Pair, prices
from symtop_studies.population.tops import ASKED, FIRST, MOMENTA, Tops, strata_of
from symtop_studies.population.verdicts import Cell
from symtop_studies.work_precision.walk import nutation_width

import symtop
from symtop import advise
from symtop.core import netcdf
from symtop.measure.accuracy import error_row
from symtop.measure.datasets import differences
from symtop.measure.ranking import nearest
from symtop.measure.settings import TARGETS
from symtop.measure.timing import Timing
from symtop.methods.framework.registry import integrator
from symtop.model.scenes import Scene
from symtop.model.top import Angles, SymmetricTop
from symtop.run.guard import EXPECTED

INF, NAN = math.inf, math.nan


def scene_of(tops, member):
    numbers = tops.numbers[member].tolist()
    return Scene(f"m{member}", SymmetricTop(*numbers[:3]), Angles(*numbers[3:]), horizon=float(tops.times[member, -1]))


# ---- the arithmetic of costs and shares ------------------------------------------------------------------------------


def test_a_cost_lies_on_the_line_between_the_last_miss_and_the_first_hit():
    work = np.array([[10.0], [20.0], [40.0]])
    errors = np.array([[1e-2], [1e-4], [1e-6]])  # two decades for each doubling
    reached = cost_to_reach(work, errors, [1e-2, 1e-3, 1e-4, 1e-5, 1e-7])
    assert reached[:, 0] == pytest.approx([10.0, 10.0 * math.sqrt(2.0), 20.0, 20.0 * math.sqrt(2.0), INF])


@pytest.mark.parametrize(
    ("errors", "cost"),
    [
        ([1e-5, 1e-1, 1e-2, 1e-4], 20.0 * 2.0**1.5),  # the first was luck
        ([INF, INF, 1e-4, 1e-6], 40.0),  # nothing to interpolate from: the hit itself
        ([1e-2, 1e-4, 1e-2, 1e-2], INF),  # the hit is missed again
        ([1e-1, 1e-2, NAN, NAN], INF),  # it left before
        ([1e-4, NAN, NAN, NAN], 10.0),  # the coarsest run is enough
        ([NAN, NAN, NAN, NAN], INF),
        ([1e-2, 0.0, NAN, NAN], 10.0),  # an error of zero: close to the miss, and never below it
    ],
)
def test_what_counts_as_a_hit(errors, cost):
    work = np.where(np.isnan(errors), NAN, [10.0, 20.0, 40.0, 80.0])[:, np.newaxis]
    assert cost_to_reach(work, np.array(errors)[:, np.newaxis], [1e-3])[0, 0] == pytest.approx(cost, rel=0.01)


def test_a_slowdown_is_over_the_cheapest_on_the_same_top():
    table = np.array([[1.0, 4.0, INF], [2.0, 2.0, INF]])
    assert np.array_equal(slowdowns(table), [[1.0, 2.0, NAN], [2.0, 1.0, NAN]], equal_nan=True)
    assert quantiles(np.array([*range(1, 10), INF, NAN])) == (2.0, 6.0, INF)
    assert all(map(math.isnan, quantiles(np.array([NAN]))))


def test_wilsons_interval():
    low, high = Share(81, 263).interval()  # Newcombe, Statistics in Medicine 17 (1998) 857, method 3
    assert (round(low, 4), round(high, 4)) == (0.2553, 0.3662)
    assert Share(0, 20).interval()[0] == 0.0 < Share(0, 20).interval()[1] == pytest.approx(0.1611, abs=1e-4)
    assert Share(0, 0).interval() == (0.0, 1.0)


def test_a_win_is_beyond_ties():
    table = np.array([[1.0, 1.0, 1.0, INF], [1.05, 2.0, 0.5, INF], [3.0, 1.2, INF, INF]])
    won, level = costs.wins(table[:, :3])
    assert won.tolist() == [[False, True, False], [False, False, True], [False, False, False]]
    assert level.tolist() == [[True, True, False], [True, False, True], [False, False, False]]
    first = winner(table)
    assert (first.row, first.share, first.next_variant, first.next_share) == (0, Share(1, 3), 1, Share(1, 3))
    assert not first.sure
    assert winner(np.full((3, 4), INF)) is None


def test_a_winner_is_sure_if_its_lead_is_more_than_chance():
    draw = np.random.default_rng(0)
    fair, ahead = draw.random((2, 2000)), draw.random((2, 2000)) * [[0.8], [1.0]]
    assert not winner(fair).sure
    assert winner(ahead).sure
    assert winner(ahead).row == 0
    assert not winner(ahead[:, :20]).sure


def test_run_lengths_are_shares_of_the_tops_that_were_asked():
    budgets = np.array([0.5, 1.0, 2.0, 10.0])
    assert run_lengths(np.array([1.0, 2.0, 3.0, INF, NAN]), budgets).tolist() == [0.0, 0.25, 0.5, 0.75]


def test_the_area_of_a_perfect_score_is_one_and_that_of_a_constant_a_half():
    wrong = np.array([True, False, True, False])
    assert detection(np.array([3.0, 1.0, INF, 0.5]), wrong).area == 1.0
    assert detection(np.array([1.0, 3.0, 0.5, INF]), wrong).area == 0.0
    assert detection(np.full(4, 7.0), wrong).area == 0.5
    assert math.isnan(detection(np.ones(4), np.ones(4, bool)).area)


# ---- many tops against one -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def tops():
    return Tops.drawn(60, 3, 10.0)


def test_scales_of_many_tops_are_those_of_scenes(tops):
    scenes = [scene_of(tops, k) for k in range(60)]
    assert tops.energy_scale == pytest.approx([one.energy_scale for one in scenes], rel=1e-6)
    assert tops.period == pytest.approx([one.nutation_period for one in scenes], rel=1e-6)
    assert tops.regime == pytest.approx(np.array([advise.regime(one) for one in scenes]), abs=1e-6)
    wide = tops.width > 1e-3
    assert tops.width[wide] == pytest.approx(np.array([nutation_width(one) for one in scenes])[wide], abs=1e-6)


def test_samples_fall_on_the_same_times_at_every_step(tops):
    for level in (0, 3, 9):
        h = tops.period / FIRST * 0.5**level
        assert np.array_equal((tops.marks << level) * h[:, np.newaxis], tops.times)
    phases = np.sort(np.mod(tops.times[0] / tops.period[0], 1.0))
    assert np.diff(phases).max() < 0.25  # they see all phases of the nutation


EACH = ("strang[axis]", "midpoint[angles]", "stormer-verlet-reversible[angles]", "rk4[attitude]", "rk45-compiled[axis]")


@pytest.mark.parametrize("name", EACH)
def test_errors_of_many_runs_are_those_of_each(tops, name):
    row, chosen = integrator(name), np.flatnonzero(strata_of(60, 3) < 2)[:4]
    level = 5 if row.fixed_step else 4
    shown = ladder.run_level(row, tops, chosen, level, 1e6)
    many = tops.errors(row.charts()[0], shown, chosen)
    for k, member in enumerate(chosen):
        setting = tops.period[member] / FIRST * 0.5**level if row.fixed_step else ladder.setting_of(row, level)
        alone = error_row(scene_of(tops, member), row, setting, float(tops.times[member, -1]))
        if alone["outcome"] != "ok":
            assert many["axis"][k] == INF
            continue
        for quantity in set(ASKED) & many.keys():  # a dozen samples against a thousand
            assert 0.3 * alone[quantity] <= many[quantity][k] <= 1.001 * alone[quantity] + 1e-14
        assert many[MOMENTA][k] <= max(alone["p_phi"], alone["p_psi"]) * 1.001 + 1e-14


def test_runs_in_turn_are_those_of_a_shared_loop(tops, monkeypatch):
    row, chosen = integrator("stormer-verlet[angles]"), np.arange(6)
    shared = ladder.run_level(row, tops, chosen, 5, 1e6)
    monkeypatch.setattr(ladder, "inside", lambda _: None)
    for one, other in zip(shared, ladder.run_level(row, tops, chosen, 5, 1e6), strict=True):
        assert np.array_equal(one, other, equal_nan=True)


def test_errors_do_not_hang_on_how_many_are_computed_together(tops, monkeypatch):
    chosen = np.arange(60)
    for name in ("strang[attitude]", "midpoint[angles]", "strang[axis]"):
        row = integrator(name)
        shown = ladder.run_level(row, tops, chosen, 4, 1e6)
        at_once = tops.errors(row.charts()[0], shown, chosen)
        monkeypatch.setattr(tops_module, "TOGETHER", 7)
        in_pieces = tops.errors(row.charts()[0], shown, chosen)
        monkeypatch.undo()
        assert at_once.keys() == in_pieces.keys()
        for quantity, values in at_once.items():
            assert np.array_equal(values, in_pieces[quantity])


def test_a_failed_run_has_an_infinite_error(tops):
    class Shown:
        states = np.full((1, tops.marks.size, 6), NAN)
        momenta = np.full((1, tops.marks.size, 2), NAN)

    errors = tops.errors("axis", Shown, np.array([4]))
    assert set(errors) == {"axis", "energy", MOMENTA}
    assert all(value == INF for values in errors.values() for value in values)


def test_targets_are_asked_where_they_mean_something(tops):
    asked, bounds = tops.asked(TARGETS), tops.bounds()
    for place, target in enumerate(TARGETS):
        for name in ASKED:
            assert (asked[name][place] <= (tops.width > target)).all()
            assert (bounds[name][asked[name][place]] <= 0.1 * target).all()
    assert not asked["axis"][0].all()  # sleeping tops nutate less than 1e-3
    assert asked["axis"][1:].mean() > 0.95


# ---- a method on the tops --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def strang(tops):
    return table_of(integrator("strang[axis]"), tops)


def table_of(row, tops, budget=2e4, guarded=3):
    strata = strata_of(len(tops.period), 3)
    return ladder.table(row, tops, strata, 6, budget, twin=False, guarded=guarded)


def test_finer_targets_cost_more_and_never_more_than_the_budget(strang):
    cost = strang["cost"].transpose("quantity", "target", "member").values
    for values in cost:
        both = ~np.isnan(values[0]) & ~np.isnan(values[1])
        assert (values[0, both] <= values[1, both]).all()
    assert cost[np.isfinite(cost)].max() <= 2e4 * 1.001
    assert np.isnan(strang["cost"].sel(quantity="attitude").values).all()


def test_a_reached_cost_is_reached(tops, strang):
    members = np.flatnonzero(np.isfinite(strang["cost"].sel(quantity="axis", target=1e-3).values))[:8]
    for member in members:
        evaluations = float(strang["cost"].sel(quantity="axis", target=1e-3)[member])
        horizon = float(tops.times[member, -1])
        row = error_row(scene_of(tops, member), integrator("strang[axis]"), horizon / evaluations, horizon)
        assert row["axis"] < 4e-3


def test_wrong_runs_are_few_where_steps_are_fine_and_silent_ones_are_wrong(strang):
    runs, wrong, silent = (strang[name].sum("stratum").values for name in ("runs", "wrong", "silent"))
    assert runs[0] == 60 >= wrong[0] > wrong[6]
    assert (silent <= wrong).all()
    assert (wrong <= runs).all()
    asked = np.isfinite(strang["foretold"].values)
    assert asked.any()
    assert np.isfinite(strang["measured"].values[asked]).any()


def test_runs_that_the_trial_of_the_guard_covers_are_no_forecasts(strang):
    """Over five nutations coarse runs are shorter than the trial and fine ones longer; over 600, none is as short."""
    there = np.isfinite(strang["foretold"].values)
    assert set(strang["whole"].values[there]) == {0.0, 1.0}
    exact = strang["whole"].values == 1.0  # then the forecast is the error, but for where it is looked at
    ratio = strang["foretold"].values[exact] / strang["measured"].values[exact]
    assert 0.9 < np.nanmedian(ratio) < 1.1
    long = table_of(integrator("strang[axis]"), Tops.drawn(6, 3, 600.0), 1e6, 2)
    assert set(long["whole"].values[np.isfinite(long["foretold"].values)]) == {0.0}
    data = xr.DataTree.from_dict({"short": strang.expand_dims(scene=["population"], variant=["strang[axis]"])})
    scores, wrong = verdicts.scored(data, "short", "foretold", ["strang[axis]"])
    error, counted = strang["measured"].values, there & ~exact
    clear = counted & ((error <= EXPECTED) | (error > ladder.WRONG))
    assert scores.size == clear.sum() > 0
    assert wrong.sum() == (clear & (error > ladder.WRONG)).sum()
    share = verdicts.repeated(data, "short", ["strang[axis]"])
    wrong_ones = there & (error > ladder.WRONG)
    assert (share.count, share.total) == ((exact & wrong_ones).sum(), wrong_ones.sum())


# ---- verdicts --------------------------------------------------------------------------------------------------------


def tree(costs_by_row, price=None, met_at=None):
    """A dataset of the study with these costs (tops,) of the axis at 1e-3, all tops of one stratum.

    A method has the prices (2,) of the halves, or those at the tolerances 1e-2 and 1e-6, (2, 2).
    """
    names, table = list(costs_by_row), np.array(list(costs_by_row.values()))
    price = dict.fromkeys(names, (1.0, 1.0)) | (price or {})
    met = np.array([(met_at or {}).get(name, np.zeros(table.shape[1])) for name in names], dtype=np.uint8)
    dims = "scene", "variant", "quantity", "target", "member"
    short = xr.Dataset(
        {name: (dims, values[np.newaxis, :, np.newaxis, np.newaxis])
         for name, values in (("cost", table), ("met_at", met))},
        coords={"scene": ["population"], "variant": names, "quantity": ["axis"], "target": [1e-3]},
    )  # fmt: skip
    about = xr.Dataset({"stratum_place": ("member", np.zeros(table.shape[1]))}, coords={"stratum": ["slow"]})
    halves = np.array([np.broadcast_to(price[name], (2, 2)) for name in names])  # variants, tolerances, halves
    prices = xr.Dataset(
        {"alone_by": (("scene", "variant", "priced_at"), halves.min(axis=2)[np.newaxis]),
         "alone_by_half": (("scene", "variant", "priced_at", "half"), halves[np.newaxis])},
        coords={"scene": ["population"], "variant": names, "priced_at": [1e-2, 1e-6]},
    )  # fmt: skip
    return xr.DataTree.from_dict({"short": short, "tops": about, "prices": prices})


def test_the_cheaper_of_two_processes_counts_and_both_must_agree():
    """One process had `series` at 4.5 ns an evaluation in all its rounds, where others have 3.6."""
    one, other = (
        xr.Dataset(
            {
                "alone": ("variant", [value, 3.0]),
                "together": ("variant", [value, 1.0]),
                "spread": ("variant", [0.02, 0.03]),
            },
            coords={"variant": ["a", "b"]},
        )
        for value in (4.5, 3.6)
    )
    for data in (one, other):
        for kind in ("alone", "together"):
            data[f"{kind}_half"] = data[kind].expand_dims(half=2, axis=1)
            data[f"{kind}_by"] = data[kind].expand_dims(priced_at=[1e-8], axis=1)
            data[f"{kind}_by_half"] = data[f"{kind}_by"].expand_dims(half=2, axis=2)
    both = xr.concat([one, other], xr.Variable("scene", list(pricing.PROCESSES)))
    taken = pricing.of_processes(both)
    assert taken["alone"].values.tolist() == [3.6, 3.0]
    assert taken["alone_half"].transpose("variant", "half").values.tolist() == [[4.5, 3.6], [3.0, 3.0]]
    assert taken["alone_by_half"].transpose("variant", "priced_at", "half").values[0, 0].tolist() == [4.5, 3.6]
    assert taken["spread"].values == pytest.approx([0.25, 0.03])
    alone = pricing.of_processes(both.isel(scene=[0]))
    assert alone["alone"].values.tolist() == [4.5, 3.0]  # the control: one process knows nothing of others


def test_prices_that_are_measured_again_differ_in_times_alone():
    """A variant in lanes and one without; a check of stored results looks at everything but times."""
    one, other = (prices(["strang[axis]", "kahan[axis]"], 9, 2e-3) for _ in range(2))
    assert (one["together"] < 0.5 * one["alone"]).values.tolist() == [True, False]
    assert differences(one, other) == []
    assert differences(one.rename(alone="price"), other.rename(alone="price")) != []


def test_a_price_is_a_slope_whatever_a_call_costs():
    call, each = 3e-5, 6e-9
    samples = [tuple(call * noise + each * n for noise in (1.0, 1.2, 1.0, 1.1)) for n in (1e3, 1e4)]
    pair = pricing.Pair(*((lambda: None, n) for n in (1e3, 1e4)))
    slopes = pair.slopes(*(Timing(one, NAN) for one in samples), 4)
    assert slopes == pytest.approx([each] * 3)
    assert samples[1][0] / 1e4 > 1.4 * each  # the time of the long run over its evaluations


def test_the_runs_that_are_timed_go_on_to_their_end():
    """Ten times the nutations take ten times the evaluations; tops that leave the chart of angles took fewer."""
    for name in (*EACH, "stormer-verlet[angles]", "rk4[angles]"):
        row = integrator(name)
        for pair in pricing.pairs(row).values():
            lengths = pricing.LENGTHS["alone"] if pair.short[1] < 2e3 else pricing.LENGTHS["together"]
            assert pair.long[1] / pair.short[1] == pytest.approx(lengths[1] / lengths[0], rel=0.5)
    timed = prices(["stormer-verlet[angles]", "strang[axis]"], 3, 1e-3)["alone"].values
    assert timed[0] < 3.0 * timed[1]  # both make one evaluation a step


def test_rows_whose_order_follows_the_tolerance_are_timed_at_several():
    assert pricing.tolerances_of(integrator("series-adaptive[axis]")) == pricing.TOLERANCES
    assert pricing.tolerances_of(integrator("rk45-compiled[axis]")) == (pricing.TOLERANCE,)
    timed = prices(["series-adaptive[axis]", "rk45-compiled[axis]"], 5, 1e-3)
    by = timed["alone_by"].values
    assert by[0, 0] > 1.2 * by[0, -1]
    assert np.ptp(by[1]) == 0.0
    assert np.array_equal(timed["alone"].values, timed["alone_by"].sel(priced_at=pricing.TOLERANCE).values)
    assert (timed["together"] != timed["alone"]).all()  # tops of such variants share a call


def test_an_evaluation_costs_what_it_does_at_the_tolerance_that_meets_the_target():
    """Prices of 8 and 2 at 1e-2 and 1e-6, in logarithms: 4 between them, and the nearest beyond."""
    by = {"a": [[8.0, 8.0], [2.0, 2.0]], "b": [[3.0, 3.0], [3.0, 3.0]]}
    costs_of = {"a": [10.0, 10.0, 10.0, 10.0, INF], "b": [1.0, 1.0, 1.0, NAN, 1.0]}
    data = tree(costs_of, by, {"a": [20, 40, 60, 90, 0]})
    taken = verdicts.costs(data, Cell("short", "axis", 1e-3), "alone")
    assert taken.of("a") == pytest.approx([80.0, 40.0, 20.0, 20.0, INF])
    assert taken.of("b") == pytest.approx([3.0, 3.0, 3.0, INF, 3.0])
    counted = verdicts.costs(data, Cell("short", "axis", 1e-3), "evaluations")
    assert counted.of("a") == pytest.approx([10.0, 10.0, 10.0, 10.0, INF])


def test_the_stored_tolerance_meets_the_target(tops, strang):
    row = integrator("series-adaptive[axis]")
    done = table_of(row, tops, guarded=0)
    for target in (1e-3, 1e-6):
        one = done.sel(quantity="axis", target=target)
        met, cost = one["met_at"].values.astype(float), one["cost"].values
        assert np.array_equal(met > 0, np.isfinite(cost))
        for member in np.flatnonzero(met)[:6]:
            alone = error_row(scene_of(tops, member), row, 10.0 ** (-met[member] / 10.0), tops.times[member, -1])
            assert alone["axis"] < 10.0 * target
            if met[member] > 40:  # the control: a tolerance a thousand times as large
                loose = error_row(scene_of(tops, member), row, 10.0 ** (3 - met[member] / 10.0), tops.times[member, -1])
                assert loose["axis"] > target
    assert not strang["met_at"].values.any()


def test_standings_of_known_costs():
    data = tree({"a": [1.0, 1.0, 1.0, INF], "b": [2.0, 1.05, 0.5, INF], "c": [INF, NAN, 3.0, INF]})
    first, second, third = verdicts.standings(verdicts.costs(data, Cell("short", "axis", 1e-3), "alone"))
    assert (first.name, first.won, first.level, first.solved) == ("a", Share(1, 3), Share(2, 3), Share(3, 4))
    assert (second.name, second.won, second.level) == ("b", Share(1, 3), Share(2, 3))
    assert third.solved == Share(1, 4)


def test_the_widest_solves_the_most_tops_and_is_the_first_of_equals():
    for fails_too, row in ((0, "b"), (4, "a")):
        data = tree({"a": [1.0] * 6 + [INF] * 4, "b": [3.0] * (10 - fails_too) + [INF] * fails_too})
        taken = verdicts.costs(data, Cell("short", "axis", 1e-3), "alone")
        assert verdicts.widest(verdicts.standings(taken)).name == row


def test_a_method_made_worse_loses():
    """The same costs with a hundredth of noise: level; one of them twice as dear: it wins nowhere."""
    draw = np.random.default_rng(1)
    same = {name: np.exp(0.003 * draw.standard_normal(500)) for name in "ab"}
    _, won = verdicts.best(tree(same), Cell("short", "axis", 1e-3), "alone")
    assert not won.sure
    assert won.share.count == 0
    _, won = verdicts.best(tree({"a": 2.0 * same["a"], "b": same["b"]}), Cell("short", "axis", 1e-3), "alone")
    assert won.sure
    assert (won.row, won.share, won.next_share) == (1, Share(500, 500), Share(0, 500))


def test_a_winner_by_times_that_are_not_met_again_is_not_sure():
    even = {"a": np.ones(500), "b": np.ones(500)}
    for price, sure in (({"a": (1.0, 1.0), "b": (1.3, 1.3)}, True), ({"a": (1.0, 1.4), "b": (1.3, 1.3)}, False)):
        _, won = verdicts.best(tree(even, price), Cell("short", "axis", 1e-3), "alone")
        assert (won.row, won.sure) == (0, sure)


def winners_of(seed, members, rows):
    """The winners in force evaluations of a small population, by target of the axis."""
    tops = Tops.drawn(members, seed, 10.0)
    strata = strata_of(members, seed)
    tables = [ladder.table(integrator(name), tops, strata, 6, 6e3, twin=False, guarded=0) for name in rows]
    cost = np.stack([one["cost"].sel(quantity="axis").values for one in tables])
    found = {}
    for place, target in enumerate(TARGETS):
        values = cost[:, place]
        found[target] = winner(values[:, ~np.isnan(values).all(axis=0)])
    return found


SOME = ("takahashi-imada[axis]", "strang[axis]", "rk4[axis]", "srkn-14-6[axis]", "midpoint[angles]", "gauss-6[axis]")


def compare_seeds(members, rows):
    first, second = (winners_of(seed, members, rows) for seed in (1, 2))
    pairs = [(first[target], second[target]) for target in TARGETS if first[target] and second[target]]
    sure = [(a.row, b.row) for a, b in pairs if a.sure and b.sure]
    assert len(sure) >= 2
    assert all(a == b for a, b in sure)
    return first


def test_two_seeds_agree_on_every_sure_winner():
    first = compare_seeds(150, SOME)
    assert all(one is None or SOME[one.row] != "midpoint[angles]" for one in first.values())


@pytest.mark.slow
def test_two_seeds_agree_on_every_sure_winner_of_all_rows():
    rows = [row.name for row in study.compiled_variants() if not study.has_twin(row)]
    compare_seeds(1000, rows)


def test_quick_results_hold_every_verdict(quick_results):
    data = netcdf.read_any(quick_results / "population.nc")
    assert set(data.children) == {"short", "long", "tops", "prices"}
    taken, won = verdicts.best(data, Cell("short", "axis", 1e-3), "evaluations")
    assert won is not None
    assert len(taken.names) > 30
    assert not any("[attitude]" in name for name in taken.names if f"{name.split('[')[0]}[axis]" in taken.names)
    health = verdicts.health(data, "midpoint[angles]")
    assert health.wrong[0] > health.wrong[-1] >= 0
    hits, alarms = verdicts.caught(data)
    assert hits.value > 0.9
    assert alarms.value < 0.2


@pytest.mark.parametrize("quantity", ["axis", "attitude", "energy"])
def test_advice_counts_the_nearest_tops_of_the_quick_results(quick_results, quantity):
    scene = symtop.scene("goldstein")
    near = nearest(quick_results / "population.nc", scene, quantity, 1e-6, scene.horizon)
    assert near.tops == 50
    assert (near.quantity, near.target) == (quantity, 1e-6)
    counts = list(near.served.values())
    assert counts == sorted(counts, reverse=True)
    assert 20 <= counts[0] <= 50  # some variant is near the cheapest on most of them
    assert counts[-1] <= 5  # and some on hardly any
    advice = symtop.recommend(scene, accuracy=1e-6, quantity=quantity, horizon=20.0, results=quick_results)
    assert "of the 50 nearest random tops" in advice.nearest
    assert advice.nearest in str(advice)


def test_silent_runs_at_small_steps_are_counted_by_kind_of_top(quick_results):
    data = netcdf.read_any(quick_results / "population.nc")
    share, each = words.hidden(data), words.hidden_by_steps(data)
    assert share.kind in verdicts.strata(data)
    assert share.of_kind <= share.silent_fine == pytest.approx(share.fine * share.wrong_fine)
    assert [step for step, _, _ in each] == sorted(step for step, _, _ in each)
    assert sum(wrong for step, wrong, _ in each if step >= words.FINE) == share.wrong_fine < share.wrong
    assert sum(silent for step, _, silent in each if step >= words.FINE) == pytest.approx(share.silent_fine)


def test_a_price_lost_in_noise_is_the_long_runs_whole_time():
    """A short run that was timed longer than the long one gives no slope; a price is positive all the same."""
    pair = Pair((lambda: None, 100.0), (lambda: None, 300.0))
    assert pair.slopes(Timing((1.0, 2.0), 0.0), Timing((5.0, 4.0), 0.0), 2) == pytest.approx(
        [3 / 200, 4 / 200, 2 / 200]
    )
    assert pair.slopes(Timing((6.0, 6.0), 0.0), Timing((3.0, 3.0), 0.0), 2) == pytest.approx([0.01] * 3)
