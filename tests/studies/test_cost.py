"""The study of cost: the ladder, prices, the ranking with its intervals, safe settings, and what its data say."""

import itertools
import math
import timeit
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from symtop_studies.cost import cells, facts, figures, ladder, prices as pricing, ranking, study, tops as tops_module
from symtop_studies.cost.cells import GENERAL, Cell
from symtop_studies.cost.confirm import confirm, rounded, share_served
from symtop_studies.cost.ranking import SAFE, Ladder, Safe, cost_to_reach, hindsight, run_lengths, safe, slowdowns, wins
from symtop_studies.cost.tops import ASKED, FIRST, KINDS, MOMENTA, NATURAL, SCENE, natural, tops_of

import symtop
from benchmarks import candidates
from symtop.core import netcdf
from symtop.measure import datasets
from symtop.measure.accuracy import error_row
from symtop.measure.settings import LEAST_STEPS, TARGETS
from symtop.measure.verdicts import barriers
from symtop.methods.framework.plan import NOT_NORMALISED, Plan
from symtop.methods.framework.registry import integrator
from symtop.model.scenes import Scene
from symtop.model.top import Angles, SymmetricTop, flat
from symtop.report.formats import number
from symtop.report.template import PARTIAL
from symtop.runner.run import load
from symtop.runner.study import Case
from tests.conftest import defer
from tests.templates import checked_page

INF, NAN = math.inf, math.nan
QUIET = np.array([0.01, 0.01])
EACH = ("strang[axis]", "midpoint[angles]", "stormer-verlet-reversible[angles]", "rk4[attitude]", "rk45-compiled[axis]")


def scene_of(tops, member):
    numbers = tops.numbers[member].tolist()
    return Scene(f"m{member}", SymmetricTop(*numbers[:3]), Angles(*numbers[3:]), horizon=float(tops.times[member, -1]))


@pytest.mark.parametrize(("errors", "cost"), [
    ([1e-5, 1e-1, 1e-2, 1e-4], 20.0 * 2.0**1.5),  # the first was luck
    ([INF, INF, 1e-4, 1e-6], 40.0),  # nothing to interpolate from: the hit itself
    ([1e-2, 1e-4, 1e-2, 1e-2], INF),  # the hit is missed again
    ([1e-1, 1e-2, NAN, NAN], INF),  # it left before
    ([1e-4, NAN, NAN, NAN], 10.0),  # the coarsest run is enough
    ([NAN, NAN, NAN, NAN], INF),
    ([1e-2, 1e-3, NAN, NAN], 20.0),  # to the target itself
    ([1e-2, 0.0, NAN, NAN], 10.0),  # an error of zero: close to the miss, and never below it
])  # fmt: skip
def test_what_counts_as_a_hit(errors, cost):
    work = np.where(np.isnan(errors), NAN, [10.0, 20.0, 40.0, 80.0])[:, np.newaxis]
    assert cost_to_reach(work, np.array(errors)[:, np.newaxis], [1e-3])[0, 0] == pytest.approx(cost, rel=0.01)


def test_a_cost_lies_between_miss_and_hit_and_slowdowns_wins_and_run_lengths_follow():
    work = np.array([[10.0], [20.0], [40.0]])
    errors = np.array([[1e-2], [1e-4], [1e-6]])  # two decades for each doubling
    costs = cost_to_reach(work, errors, [1e-2, 1e-3, 1e-4, 1e-5, 1e-7])
    assert costs[:, 0] == pytest.approx([10.0, 10.0 * math.sqrt(2.0), 20.0, 20.0 * math.sqrt(2.0), INF])
    table = np.array([[1.0, 4.0, INF], [2.0, 2.0, INF]])
    assert np.array_equal(slowdowns(table), [[1.0, 2.0, NAN], [2.0, 1.0, NAN]], equal_nan=True)
    won, level = wins(np.array([[1.0, 1.0, 1.0], [1.05, 2.0, 0.5], [3.0, 1.1, INF]]))
    assert won.tolist() == [[False, True, False], [False, False, True], [False, False, False]]
    assert level.tolist() == [[True, True, False], [True, False, True], [False, False, False]]
    budgets = np.array([0.5, 1.0, 2.0, 10.0])
    assert run_lengths(np.array([1.0, 2.0, 3.0, INF, NAN]), budgets).tolist() == [0.0, 0.25, 0.5, 0.75]


def test_wins_and_what_is_met_have_one_denominator_each():
    table = np.array([[1.0, 1.0, 1.0, INF], [1.05, 2.0, 0.5, INF], [INF, INF, 3.0, INF]])
    contest = hindsight(["a", "b", "c"], table, np.full(3, 0.01))
    assert (contest.tops, contest.solved) == (4, 3)
    by_name = {standing.name: standing for standing in contest.standings}
    assert (by_name["a"].share, by_name["a"].level, by_name["a"].met) == pytest.approx((1 / 3, 2 / 3, 3 / 4))
    assert by_name["c"].met == pytest.approx(1 / 4)
    assert not contest.called
    assert hindsight(["a", "b"], np.full((2, 4), INF), QUIET).first is None
    ties = np.array([[1.0, 2.0, 3.0], [2.0, 1.0, 1.0], [3.0, 3.0, 1.05]])  # a and b win on one top each
    assert hindsight("abc", ties, np.full(3, 0.01)).first.name == "b"  # and b is level on one more
    solved = np.random.default_rng(0).random((2, 100)) * [[0.9], [1.0]]
    first, second = hindsight("ab", solved, QUIET), hindsight("ab", np.hstack([solved, np.full((2, 100), INF)]), QUIET)
    assert [row[1:5] for row in second.standings] == [row[1:5] for row in first.standings]  # of the solved tops alone


def test_noise_of_a_price_widens_the_interval_of_a_share_which_covers_it_as_often_as_it_says():
    """Tops from a known distribution: a wins where its cost is 1/1.1 of b's, on a share that can be worked out."""
    draw, inside = np.random.default_rng(5), 0
    true = 1.0 / (2.0 * 1.1)  # of a/b uniform in (0, 2): a wins where a/b < 1/1.1
    for _ in range(60):
        first = hindsight("ab", np.stack([2.0 * draw.random(200), np.ones(200)]), QUIET * 0.0).standings
        standing = next(standing for standing in first if standing.name == "a")
        inside += standing.low <= true <= standing.high
    assert 51 <= inside <= 60
    table = np.stack([np.exp(0.1 * np.random.default_rng(2).standard_normal(3000)), np.full(3000, 1.1)])
    narrow, wide = (hindsight("ab", table, np.array([error, error])).standings[0] for error in (0.0, 0.06))
    assert wide.share == narrow.share
    assert wide.high - wide.low > 3.0 * (narrow.high - narrow.low)


def ladder_of(name, met, per_step=1.0, error=0.0, levels=8):
    settings = 2.0 ** np.arange(levels)
    return Ladder(name, np.asarray(met, dtype=float), settings, per_step * settings, True, error)


def test_a_safe_setting_serves_95_of_100_tops():
    met = np.arange(1.0, 101.0)  # of 100 tops one needs so many steps each
    (choice,), _ = safe([ladder_of("a", met)])
    assert (choice.setting, choice.seconds) == pytest.approx((95.0, 95.0), rel=1e-6)  # a step costs one
    assert choice.low < choice.seconds < choice.high
    (small,), _ = safe([ladder_of("a", np.arange(1.0, 31.0))])  # 28 are less than 95 %, and 30 tops show no upper end
    (choice,), _ = safe([ladder_of("a", np.arange(1.0, 61.0))])  # 58 of 61 draws need at most 52 in 1.5 %, 53 in 3.3 %
    assert (small.setting, small.high, *choice[2:]) == pytest.approx((29.0, INF, 57.0, 53.0, 60.0), rel=1e-6)
    assert (np.diff(ranking.ENDS)[0], sum(ranking.ENDS)) == pytest.approx((0.95, 1.0))
    assert np.log(ranking.factors(np.array([0.8]))).std() == pytest.approx(0.8, rel=0.15)  # and none is negative
    (choice,), called = safe([ladder_of("a", np.where(met > 94.0, INF, met))])
    assert (choice.seconds, called) == (INF, False)  # six tops are never met
    tolerance = Ladder("b", 10.0 ** -np.linspace(2.0, 6.0, 100), 10.0 ** -np.arange(1.0, 9.0), np.arange(8.0) + 1.0,
                       False, 0.0)  # fmt: skip
    (choice,), _ = safe([tolerance])
    assert choice.setting == pytest.approx(10.0 ** -(2.0 + 4.0 * 94 / 99), rel=1e-6)


def test_a_lead_is_called_if_neither_tops_nor_prices_can_turn_it_and_hindsight_may_differ():
    draw = np.random.default_rng(0)
    fair, ahead = draw.random((2, 2000)), draw.random((2, 2000)) * [[0.7], [1.0]]
    assert not hindsight("ab", fair, QUIET).called
    assert [hindsight("ab", ahead[:, :count], QUIET).called for count in (2000, 12)] == [True, False]  # too few tops
    single, many = (hindsight("ab", np.ones((2, tops)) * [[1.0], [2.0]], QUIET) for tops in (1, 200))  # a wins on all
    assert (single.called, *single.first[1:4]) == (False, 1.0, 0.0, 1.0)
    assert (many.called, many.first.low) == (True, pytest.approx(1.0 - 3.0 / 201.0, abs=0.006))
    assert not hindsight("ab", ahead, QUIET * 40.0).called  # the same tops, with prices that are hardly known
    assert not hindsight("ab", ahead, QUIET, marked=["a"]).called
    # A step that suits most tops and fails on one in five, against one that costs a little more on all of them.
    met = np.full(200, 4.0)
    met[::5] = 100.0
    choices, called = safe([ladder_of("spoilt", met), ladder_of("even", np.full(200, 6.0))])
    assert (called, [choice.name for choice in choices]) == (True, ["even", "spoilt"])
    assert hindsight(["spoilt", "even"], np.stack([met, np.full(200, 6.0)]), QUIET).first.name == "spoilt"
    met, pairs = np.full(200, 4.0), 8.0 * np.exp(draw.standard_normal((40, 2, 200)))
    assert not safe([ladder_of("a", met), ladder_of("b", met)])[1]  # equals
    assert sum(safe([*map(ladder_of, "ab", pair)])[1] for pair in pairs) <= 3  # equals, each with hard tops of its own
    for error, called in ((0.005, True), (0.10, False)):
        assert safe([ladder_of("a", met, 1.0, error), ladder_of("b", met, 1.08, error)])[1] is called


def priced(price, names, call=2e-6):
    """Prices (processes, variants) as the study stores them."""
    price = np.asarray(price, dtype=float)
    shape, dims = (*price.shape, len(pricing.TOLERANCES)), ("scene", "variant", "priced_at")
    return xr.Dataset({
        "price": (dims, np.broadcast_to(price[..., np.newaxis], shape)), "call": (dims, np.full(shape, call)),
        "sampled": (dims[:2], np.full(price.shape, NAN)),
    }, {"scene": [f"{pricing.BATCHES[k // 5]}-{k % 5}" for k in range(len(price))], "variant": list(names),
        "priced_at": list(pricing.TOLERANCES)})  # fmt: skip


def tree_of(price, names=("a", "b", "c")):
    return xr.DataTree.from_dict({"prices": priced(price, names)})


def test_a_price_is_the_median_and_a_process_that_is_slower_at_everything_no_spread():
    quiet = np.array([[5e-9, 6e-9, 7e-9]] * 5)
    planted = quiet.copy()
    planted[0, 0], planted[1, 1] = 4e-10, -3e-9  # below what the arithmetic can take, and negative
    planted[2, 2] = 2.3e-8  # a process that was disturbed
    plain, spoilt = (pricing.prices(tree_of(array)) for array in (quiet, planted))
    assert (spoilt.price, spoilt.marked) == (pytest.approx(plain.price), [])
    assert plain.error == pytest.approx(1.25 * 2.78 / 1.96 * 0.04 / math.sqrt(5.0))  # of medians of five, Student's
    dense = tree_of(quiet)
    dense["prices"]["sampled"] = 2.0 * dense["prices"]["price"].isel(priced_at=0, drop=True)
    assert pricing.prices(dense).sampled == pytest.approx(2.0)
    assert np.min(planted, axis=0)[0] == 4e-10  # the control: the least of them would be that
    quiet, names = np.tile(quiet, 4), "abcdefghijkl"
    together = quiet * np.array([1.0, 1.3, 1.1, 0.8, 1.0])[:, np.newaxis]
    independent = quiet * np.random.default_rng(1).uniform(0.7, 1.3, quiet.shape)
    assert pricing.prices(tree_of(together, names)).marked == []
    assert pricing.prices(tree_of(together, names)).spread.max() < 0.01
    assert pricing.prices(tree_of(independent, names)).marked  # the control
    tree = tree_of(together[:, :3])  # of so few a common factor would be their own noise
    assert pricing.prices(tree).marked == ["a", "b", "c"]
    spread = pricing.prices(tree).spread / 0.99  # standard deviations
    assert pricing.prices(tree).error == pytest.approx(1.25 * 2.78 / 1.96 * spread / math.sqrt(5.0))
    tree = tree_of(together, names)
    tree["prices"]["call"] = tree["prices"]["call"] * xr.DataArray([1.0, 2.6, 3.3, 3.2, 5.0], dims="scene")
    assert pricing.prices(tree).call == pytest.approx(6e-6)  # 2, 4, 6, 8, 10 us where a process is slower at all


def test_a_noisy_price_is_measured_again_and_marked_if_it_stays():
    noisy, repeat = np.array([[5e-9, 6e-9, 7e-9]] * 5), np.full((5, 3), NAN)
    noisy[:, 1] *= [1.0, 1.4, 0.7, 1.5, 1.1]
    assert pricing.prices(tree_of(noisy)).marked == ["b"]
    for second, marked in ((6e-9, []), (noisy[:, 1], ["b"])):
        repeat[:, 1] = second
        assert pricing.prices(tree_of(np.concatenate([noisy, repeat]))).marked == marked


def test_a_price_is_the_slope_of_two_runs_and_the_guard_and_who_runs_long_are_counted(monkeypatch):
    monkeypatch.setattr(pricing, "run_of", lambda variant, tolerance, nutations: (nutations, 1000.0 * nutations))
    fakes = lambda calls, *_, **__: [SimpleNamespace(best=2e-6 + 1000.0 * nutations * 7e-9) for nutations in calls]
    monkeypatch.setattr(pricing, "timings", fakes)
    assert pricing.slopes(["rk4[axis]"], 5, 0.01) == [("rk4[axis]", 1e-8, *map(pytest.approx, (7e-9, 2e-6)))]
    dims = "scene", "variant", "level", "guarded"
    columns = {"foretold": 0.05, "measured": 0.5, "watched": 1e-3, "whole": 0.0}
    runs = xr.Dataset({name: (dims, np.full((1, 1, 1, 1), value)) for name, value in columns.items()})
    runs = runs.assign({name: (dims[:2], [[word]]) for name, word in (("chart", "axis"), ("control", "step_size"))})
    (row,) = cells.guard_counts(xr.DataTree.from_dict({"short": runs})).to_dict("records")
    assert (row["wrong"], row["wrong_warned"], row["wrong_seen"]) == (1, 1, 0)  # the forecast alone shows it
    work = np.array([[1.0, 1.0, 100.0], [2.0, 2.0, 2.0]])
    monkeypatch.setattr(cells, "costs", lambda *_: cells.Costs(["a", "b"], work, np.zeros(2)))
    assert cells.fewest(None, None) == "a"  # on the median top
    total, zero = np.full(len(KINDS), 100.0), np.zeros((1, len(KINDS)))
    wrong, silent = zero + 9.0 * np.eye(len(KINDS))[0], zero + 5.0 * np.eye(len(KINDS))[1]
    monkeypatch.setattr(cells, "health", lambda *_: cells.Health(np.array([facts.FINE]), total, wrong, silent, zero))
    answers = facts.silent_facts({"short": xr.Dataset(coords={"variant": [facts.QUOTED]})})
    assert (answers["worst_kind"], answers["worst_wrong"], answers["worst_silent"]) == (KINDS[0], 0.09, 0.0)
    names, charts = ["a", "b", "c", "d"], ["axis", "attitude", "attitude", "angles"]
    dataset = xr.Dataset({"chart": (dims[:2], [charts])}, {"variant": names, "target": [1e-3]})
    work = {"axis": np.array([[1.0], [INF], [INF], [INF]]), "attitude": np.array([[1.0], [1.2], [2.0], [2.0]])}
    monkeypatch.setattr(cells, "costs", lambda _, cell: cells.Costs(names, work[cell.quantity], np.zeros(4)))
    assert cells.contenders(xr.DataTree.from_dict({"short": dataset})) == ["a", "b", "d"]
    names, dims = ["rk4[axis]", "strang[axis]", "takahashi-imada[axis]"], ("scene", "variant", "target")
    columns = {"interpolated": (dims, np.full((1, 3, 1), 10.0)), "served": (dims, [[[10.0], [20.0], [70.0]]]),
               "share": (dims, np.ones((1, 3, 1)))}  # fmt: skip
    data = xr.DataTree.from_dict({cells.CONFIRMED: xr.Dataset(columns, {"variant": names, "target": [1e-3]})})
    assert cells.served_over_interpolated(data, Cell("short", "axis", 1e-3, NATURAL), "strang[axis]") == 2.0
    assert facts.confirmed_facts(data)["finer"] == 2.0


@pytest.mark.slow
def test_prices_of_fresh_processes_agree_with_a_run_timed_by_hand():
    """Evaluations times the price, plus the call, is the time of a run of another length."""
    names = ["strang[axis]", "rk4[axis]"]
    data = pricing.measured(names, 6, 0.001)
    for name in names:
        call, evaluations = pricing.run_of(integrator(name), pricing.TOLERANCE, 20)
        by_hand = min(timeit.repeat(call, number=50, repeat=20)) / 50
        price, overhead = (float(data[key].sel(variant=name).min()) for key in ("price", "call"))
        assert evaluations * price + overhead == pytest.approx(by_hand, rel=0.5)


@pytest.fixture(scope="module")
def tops():
    return tops_of(60, 20, 3, 10.0)


def regime(scene):
    """Cosines of the turning points and asinh of the scaled momenta, of the top whose gravity pulls down."""
    top, momenta = scene.top, scene.top.momenta(scene.start)
    low, high = sorted(top.turning_cosines(scene.start))
    psi, phi = np.arcsinh(np.array([momenta.p_psi, momenta.p_phi]) / math.sqrt(top.I1 * abs(top.mgl)))
    return [low, high, psi, phi] if top.mgl > 0.0 else [-high, -low, -psi, phi]


def test_the_natural_tops_are_written_down_and_variants_of_variable_order_have_prices():
    assert pricing.tolerances_of(integrator("series-adaptive[axis]")) == pricing.TOLERANCES
    assert pricing.tolerances_of(integrator("rk45-compiled[axis]")) == (pricing.TOLERANCE,)
    table = pricing.Prices(["a"], np.array([8.0 / 4.0 ** np.arange(7)]), np.zeros((1, 7)), np.zeros(1), np.zeros(1), [],
                           NAN)  # fmt: skip
    price, _ = table.at("a", np.array([1e-2, 1e-3, 1e-4, NAN]))
    assert price[:3] == pytest.approx([8.0, 4.0, 2.0])
    tops = natural(20_000, 1)
    I1, I3, mgl, theta, _, _, theta_dot, phi_dot, psi_dot = tops.T
    assert (natural(50, 1) == tops[:50]).all()
    assert not (natural(50, 2) == tops[:50]).all()
    assert np.quantile(np.cos(theta), [0.25, 0.5, 0.75]) == pytest.approx([-0.5, 0.0, 0.5], abs=0.02)  # isotropic
    spin = np.log2(np.abs(I3 * (psi_dot + phi_dot * np.cos(theta)) / (2.0 * np.sqrt(I1 * mgl))))
    assert np.quantile(spin, [0.0, 0.5, 1.0]) == pytest.approx([-4.0, 0.5, 5.0], abs=0.05)
    assert ((I3 / I1 > 0.02) & (I3 / I1 < 1.46)).all()
    assert np.hypot(theta_dot, phi_dot * np.sin(theta)).max() <= 2.0 + 1e-9


def test_the_named_scenes_are_tops_among_the_others(tops):
    assert [(tops.kinds == KINDS.index(kind)).sum() for kind in (NATURAL, SCENE)] == [20, len(tops_module.named())]
    assert np.array_equal(tops.numbers[-len(tops_module.named()) :], [*tops_module.named().values()])
    assert "goldstein" in tops_module.named()
    members = list(tops.members(np.array([3, 0, 11])))
    assert np.array_equal([flat(*pair) for pair in members], tops.numbers[[3, 0, 11]])


def test_scales_of_many_tops_are_those_of_scenes_and_samples_fall_on_the_same_times_at_every_step(tops):
    scenes = [scene_of(tops, k) for k in range(80)]
    assert tops.energy_scale[:80] == pytest.approx([scene.energy_scale for scene in scenes], rel=1e-6)
    assert tops.period[:80] == pytest.approx([scene.nutation_period for scene in scenes], rel=1e-6)
    assert tops.regime[:80] == pytest.approx(np.array([regime(scene) for scene in scenes]), abs=1e-6)
    (highest, lowest, *_), wide = np.array([barriers(scene) for scene in scenes]).T, tops.width[:80] > 1e-3
    assert tops.width[:80][wide] == pytest.approx((lowest - highest)[wide], abs=1e-6)
    for level in (0, 3, 9):
        h = tops.period / FIRST * 0.5**level
        assert np.array_equal((tops.marks << level) * h[:, np.newaxis], tops.times, equal_nan=True)
    phases = np.sort(np.mod(tops.times[0] / tops.period[0], 1.0))
    assert np.diff(phases).max() < 0.25  # they see all phases of the nutation


@pytest.mark.parametrize("name", EACH)
def test_errors_of_many_runs_are_those_of_each(tops, name):
    row, indices = integrator(name), np.flatnonzero(tops.kinds < 2)[:4]
    level = 5 if row.fixed_step else 4
    errors = tops.errors(row.charts()[0], ladder.run_level(row, tops, indices, level, 1e6), indices)
    for k, member in enumerate(indices):
        setting = tops.period[member] / FIRST * 0.5**level if row.fixed_step else ladder.setting_of(row, level)
        expected = error_row(scene_of(tops, member), row, setting, float(tops.times[member, -1]))
        if expected["outcome"] != "ok":
            assert errors["axis"][k] == INF
            continue
        for quantity in set(ASKED) & errors.keys():  # a dozen samples against a thousand
            assert 0.3 * expected[quantity] <= errors[quantity][k] <= 1.001 * expected[quantity] + 1e-14
        assert errors[MOMENTA][k] <= max(expected["p_phi"], expected["p_psi"]) * 1.001 + 1e-14


@pytest.mark.parametrize("name", ["rk4[attitude]", "strang[attitude]", *defer("tsit5-fixed[attitude]")])
def test_coarse_runs_end_in_the_ladder_as_they_end_alone(in_lanes, tops, name):
    row, indices = integrator(name), np.flatnonzero(tops.known)
    result = ladder.run_level(row, tops, indices, 0, 1e6)
    plans = [Plan.steps(float(tops.period[member]) / FIRST, tops.marks) for member in indices]
    expected = ladder.one_by_one(row, tops.members(indices), plans)
    mask = expected.outcome == NOT_NORMALISED
    assert np.array_equal(result.outcome == NOT_NORMALISED, mask)
    assert np.array_equal(np.isnan(result.states[mask]).all(axis=2), np.isnan(expected.states[mask]).all(axis=2))
    assert mask.any() == ("strang" not in name)
    assert (tops.errors("attitude", result, indices)["axis"][mask] == INF).all()


def test_a_failed_run_has_an_infinite_error_and_targets_are_asked_where_they_mean_something(tops):
    class Samples:
        states = np.full((1, tops.marks.size, 6), NAN)
        momenta = np.full((1, tops.marks.size, 2), NAN)

    errors = tops.errors("axis", Samples, np.array([4]))
    assert set(errors) == {"axis", "energy", MOMENTA}
    assert all(value == INF for values in errors.values() for value in values)
    masks, bounds = tops.asked(TARGETS), tops.bounds()
    for place, target in enumerate(TARGETS):
        for name in ASKED:
            assert (masks[name][place] <= (tops.width > target)).all()
            assert (bounds[name][masks[name][place]] <= 0.1 * target).all()
    assert not masks["axis"][0].all()  # sleeping tops nutate less than 1e-3


@pytest.fixture(scope="module")
def strang(tops):
    return ladder.table(integrator("strang[axis]"), tops, 2e4, twin=False, guarded=4)


@pytest.mark.parametrize("name", ["strang[axis]", "series-adaptive[axis]"])
def test_the_stored_setting_meets_the_target_at_the_stored_cost(tops, strang, name):
    row = integrator(name)
    table = strang if name == "strang[axis]" else ladder.table(row, tops, 2e4, twin=False, guarded=0)
    finest = table["cost"].sel(quantity="axis", target=1e-12)[tops.kinds == KINDS.index(NATURAL)]
    assert row.fixed_step or np.isfinite(finest).all()  # two tolerances with one error are no rounding
    cell = table.sel(quantity="axis", target=1e-3)
    members = np.flatnonzero(np.isfinite(cell["cost"].values))[:6]
    assert np.array_equal(np.isfinite(cell["met_at"].values), np.isfinite(cell["cost"].values))
    for member in members:
        setting, horizon = float(cell["met_at"][member]), float(tops.times[member, -1])
        step = tops.period[member] / setting if row.fixed_step else setting
        expected = error_row(scene_of(tops, member), row, step, horizon)
        assert expected["axis"] < (4e-3 if row.fixed_step else 1e-2)
        assert expected["force_evaluations"] == pytest.approx(float(cell["cost"][member]), rel=0.1)


def test_finer_targets_cost_more_within_the_budget_and_every_top_is_judged_or_dropped(strang, tops, monkeypatch):
    cost = strang["cost"].transpose("quantity", "target", "member").values
    for values in cost:
        mask = ~np.isnan(values[0]) & ~np.isnan(values[1])
        assert (values[0, mask] <= values[1, mask]).all()
    assert cost[np.isfinite(cost)].max() <= 2e4 * 1.001
    monkeypatch.setattr(ladder, "FORGIVEN", 1e9)  # nobody leaves who would reach a target
    control = ladder.table(integrator("strang[axis]"), tops, 2e4, twin=False, guarded=0)
    assert np.array_equal(np.isfinite(control["cost"]), np.isfinite(strang["cost"]))
    assert np.isnan(strang["cost"].sel(quantity="attitude").values).all()
    runs, wrong, silent = (strang[name].values for name in ("runs", "wrong", "silent"))
    assert (runs[0] == strang["drawn"].values).all()
    assert (runs <= strang["drawn"].values).all()
    assert ((silent <= wrong) & (wrong <= runs)).all()
    assert wrong[0].sum() > wrong[6].sum()
    data = xr.DataTree.from_dict({"short": strang.expand_dims(scene=["tops"], variant=["strang[axis]"])})
    health = cells.health(data, "strang[axis]")
    assert (health.dropped >= 0).all()
    np.testing.assert_array_equal(health.wrong, wrong[: len(health.setting)])
    monkeypatch.setattr(ladder, "costs_of", lambda *args: firsts.append(args[-1]) or {})
    firsts = []  # levels that do not count: longer steps may keep the energy and miss the motion
    ladder.table(integrator("strang[axis]"), tops, 50.0, twin=False, guarded=0)
    assert firsts == [{"energy": 2}] == [{"energy": math.ceil(math.log2(LEAST_STEPS / FIRST))}]
    blank = np.full((ladder.LEVELS, 3), NAN)
    blank[0] = [1.0, 1.0, 10.0]
    errors = {"axis": blank, "energy": 0.2 * blank, MOMENTA: 0.05 * blank}
    climb = ladder.Climb(blank, errors, blank == 1.0, blank[0] > 0.0)
    trio, rk4 = tops_module.Tops(tops.numbers[:3], 10.0), integrator("rk4[axis]")
    assert ladder.typical_work(rk4, climb, trio)[0, 0] == 1.0  # of the median top
    for outcome, error in (("ok", 1.0), ("not_normalised", math.inf)):  # a run that is to end is warned of
        expected = SimpleNamespace(axis_error=1.0, whole=False, outcome=outcome)
        monkeypatch.setattr(ladder, "forecast", lambda *_, expected=expected: expected)
        counts = ladder.guarded_runs(rk4, trio, climb, 2, 4e4)
        assert (counts["watched"][0, 0], counts["foretold"][0, 0]) == (0.2, error)  # the larger
    assert health.dropped[-1].sum() > 0  # a budget ends every ladder of order 2
    rows = cells.guard_counts(data)  # the guard is counted once for every run that it was asked about
    assert rows[["wrong", "between", "right"]].to_numpy().sum() == np.isfinite(strang["foretold"].values).sum() > 0
    assert rows["wrong"][rows["whole"]].sum() > 0  # its trial covers coarse runs whole, and says so
    work = strang["work"].values[:, KINDS.index(NATURAL)]
    assert (np.diff(work) > 0.0).all()
    assert work[5] == pytest.approx(10.0 * FIRST * 2.0**5, rel=0.15)  # one evaluation a step over ten nutations


def test_no_method_of_this_top_takes_part_for_any_body_and_variants_are_asked_for_what_they_show():
    assert ladder.quantities_of(integrator("strang[axis]"), twin=False) == ("axis", "energy")
    assert ladder.quantities_of(integrator("strang[attitude]"), twin=True) == ("attitude",)
    assert ladder.quantities_of(integrator("midpoint[angles]"), twin=False) == ASKED
    assert ladder.quantities_of(integrator("gauss-4[axis]"), twin=False) == ("axis",)
    assert cells.of_class("kicks", True, GENERAL)
    assert cells.of_class("kicks", False, "kicks")
    assert not cells.of_class("kicks", False, GENERAL)  # it exists for symmetric bodies alone
    assert cells.of_class("this-top", False, "this-top")
    assert not cells.of_class("", True, GENERAL)  # a plug-in that does not say what it needs
    assert all(integrator(name).general for name in study.far.candidates())


@pytest.fixture(scope="module")
def data(quick_results):
    return netcdf.read_any(quick_results / "cost.nc")


@pytest.fixture(scope="module")
def small():
    """A few variants on a few tops, with prices that are given."""
    names = ["rk4[axis]", "takahashi-imada[axis]", "taylor[axis]", "series[axis]"]
    settings = study.QUICK["short"] | {"strata": 60, "natural": 30}
    cases = [Case("tops", name, settings, group="short") for name in names]
    cases += [Case("short", "exact", settings, group="tops")]
    far = study.FAR_QUICK | {"members": 2, "levels": 6, "steps": 4e3, "budget": 1e4}
    cases += [Case("natural", "rk4[axis]", far, group="far")]
    results = [(case, study.measure(case)) for case in cases]
    priced = {"prices": tree_of([[7e-9, 3e-8, 1.4e-8, 8e-9]] * 5, names)["prices"]}
    advised = cells.advised(datasets.combine(results).assign(priced), [])
    options = {"members": 60, "seed": 2, "nutations": settings["nutations"]}
    cases = [Case(NATURAL, name, options | {"start": start}, group=study.SAFE) for name, start in advised.items()]
    tree = datasets.combine([*results, *((case, study.measure(case)) for case in cases)]).assign(priced)
    tree.attrs.update(netcdf.provenance())
    return tree


def test_facts_and_tables_are_those_of_the_cells(small):
    answers, tables = facts.facts(small), facts.tables(small)
    winners = tables["winners"].query("tops == 'natural'").set_index(["needs", "error"])
    for place, target in ((3, 1e-3), (6, 1e-6)):
        entry = cells.winner(small, Cell("short", "axis", target, NATURAL))
        assert answers[f"safe_{place}"] == entry["safe"].name
        assert winners.loc[GENERAL, target]["time (us)"] == pytest.approx(1e6 * entry["safe"].seconds)
    assert answers["kicks"] + answers["kicks_serve"] == "takahashi-imada[axis] (symmetric)"
    assert answers["lagrangian"] is None  # there is none among these
    assert cells.safest(small, Cell("short", "axis", 1e-12, NATURAL, "kicks"))[0][0].seconds == INF
    kicks = tables["use"].set_index("you can supply").loc["torque, free motion"]
    assert kicks["1e-12 rad"] == "not within 600 evaluations"
    assert answers["nutations_long"] is None  # nothing was run over a thousand
    assert "takahashi-imada[axis]" not in set(winners.loc[GENERAL]["safe"])  # it exists for symmetric bodies alone
    assert "takahashi-imada[axis] (symmetric)" in kicks["1e-3 rad"]
    assert tables["have"]["you have"].tolist() == ["rk4[axis]"]
    parts = {name: node.to_dataset() for name, node in small.children.items()}
    header, row, *_ = candidates.table(xr.DataTree.from_dict({**parts, "long": parts["short"]}))
    assert header == candidates.ranking.TABLE.read_text().partition("\n")[0]
    assert row.endswith("taylor[axis] rk4[axis]")
    cell = Cell("short", "axis", 1e-3, "strata")
    kinds = cells.kinds_of(small, "short")[cells.chosen(small, "short", "strata")][cells.asked_tops(small, cell)]
    (choice,) = (choice for choice in cells.safest(small, cell)[0] if choice.name == "taylor[axis]")
    taylor, share = parts["short"].isel(scene=0).sel(variant="taylor[axis]"), np.bincount(kinds) / kinds.size
    mean = taylor["work"].transpose("level", "kind").values[:, : share.size] @ share  # of all that are asked
    x, mask = -np.log(taylor["setting"].values), np.isfinite(mean) & np.isfinite(taylor["setting"].values)
    typical = math.exp(np.interp(-math.log(choice.setting), x[mask], np.log(1.4e-8 * mean[mask] + 2e-6)))
    assert choice.seconds == pytest.approx(typical)
    price, name = parts["prices"]["price"], parts["prices"]["variant"] == "taylor[axis]"
    fine, dear = (xr.DataTree.from_dict({**parts, "prices": parts["prices"].assign(price=each)}) for each in
                  (price.where(~name | (price.priced_at > 1e-9), 1.0), price * xr.where(name, 1e3, 1.0)))  # fmt: skip
    before, after = (cells.costs(tree, cell._replace(needs="expression")).values for tree in (small, fine))
    counts = cells.costs(small, cell._replace(needs="expression"), cells.EVALUATIONS).values
    assert before == pytest.approx(1.4e-8 * counts + 2e-6)  # the call is paid for
    table, prices = facts.tables(small)["prices"], pricing.prices(small)
    assert np.log((table["high (ns)"] / table["price (ns)"]).to_numpy()) == pytest.approx(1.96 * prices.error)
    assert np.mean(before == after) > 0.9  # at the prices of tolerances that meet the error, not of the finest
    answers = facts.winners_facts(dear)
    assert 1.0 < answers["misled"] == pytest.approx(answers["fewest_seconds"] / answers["instead_seconds"])
    rk4 = cells.reached(small, 1e-3)["rk4[axis]"]
    best = cells.winner(small, Cell("short", "axis", 1e-3, NATURAL))["safe"]
    assert tables["have"]["1e-3 rad"][0].endswith(f" {number(rk4.seconds / best.seconds)} times")


def test_the_grid_has_every_compiled_variant_and_what_is_kept_is_declared_or_linear():
    for name in ("population", "work_precision", "phase_diagram"):
        with pytest.raises(symtop.SymtopError, match="is now cost"):
            load(name)
    names = {case.integrator for case in study.STUDY.cases(True) if case.group == "short"}
    assert {"strang[axis]", "strang[attitude]", "midpoint[angles]", "rk45-compiled[angles]", "taylor[axis]"} <= names
    assert not {name for name in names if "unreduced" in name or name.startswith("exact")}
    assert sum(case.timed for case in study.STUDY.cases(False)) == 5
    expected = {
        "rk4[axis]": "p_phi", "rk4[angles]": "nothing exactly", "rkmk-se3-4[axis]": "p_psi, |e|",
        "gauss-8[axis]": "p_phi, p_psi, |e|, energy", "takahashi-imada[axis]": "p_phi, p_psi, |e|, energy bounded",
    }  # fmt: skip
    assert {name: facts.keeps(name) for name in expected} == expected


def test_quick_results_hold_every_verdict_and_a_cost_holds_the_call(data):
    assert {"short", "long", "tops", "prices", "far"} <= set(data.children)
    winners = cells.winners(data)
    assert len(winners) == 2 * len(cells.CLASSES) * 2 * len(TARGETS)
    for winner in winners:
        for best in filter(None, (winner["safe"], winner["hindsight"])):
            method = integrator(best.name)
            assert cells.of_class(method.needs, method.general, winner["needs"])
            assert best.low <= best.high
        if winner["hindsight"]:
            assert winner["solved"] <= winner["asked"]
    cell = Cell("short", "axis", 1e-3, NATURAL)
    seconds, counts = cells.costs(data, cell), cells.costs(data, cell, cells.EVALUATIONS)
    assert not any("[attitude]" in name for name in seconds.names if f"{name.split('[')[0]}[axis]" in seconds.names)
    row = seconds.names.index("rk4[axis]")
    price, call = pricing.prices(data).at("rk4[axis]", np.array([NAN]))
    mask = np.isfinite(counts.values[row])
    assert call[0] > 2e-7
    assert seconds.values[row, mask] == pytest.approx(counts.values[row, mask] * price[0] + call[0])
    cell = cell._replace(needs="derivative")
    names, keeping = ({choice.name for choice in cells.safest(data, cell, flag)[0]} for flag in (False, True))
    assert keeping == {name for name in names if name.startswith("gauss-")} < names
    table = facts.confirmed(data).set_index(["variant", "error"])
    for needs, target in itertools.product(cells.CLASSES, cells.targets(data)):  # what the front page advises was run
        for first in cells.safest(data, Cell("short", "axis", target, NATURAL, needs))[0][:1]:
            if np.isfinite(first.seconds):
                assert table.loc[(first.name, target), "served"] == pytest.approx(first.setting)
                assert table.loc[(first.name, target), "share"] >= SAFE


def test_a_setting_is_made_finer_until_it_serves_but_no_tolerance_by_more_than_a_decade(monkeypatch):
    shares = lambda variant, numbers, nutations, setting, target: float(setting <= 8e-10)
    monkeypatch.setitem(confirm.__globals__, "share_served", shares)
    served = confirm(integrator("rk45-compiled[axis]"), 4, 1, 1.0, [4.01e-9, 9e-9, NAN, 6e-10])["served"].values
    np.testing.assert_allclose(served, [7e-10, INF, NAN, 6e-10])


def test_an_advised_setting_was_run_on_other_tops_and_serves_them(small):
    assert [rounded(value, True) for value in (14.11, 209.2, 16.7)] == [14.2, 210.0, 16.7]
    assert [rounded(value, False) for value in (8.9e-5, 1e-9, 2.05e-10)] == [8e-5, 1e-9, 2e-10]
    table = facts.tables(small)["confirmed"].set_index(["variant", "error"])
    for (name, error), row in table.iterrows():
        choices = cells.safest(small, Cell("short", "axis", error, NATURAL, integrator(name).needs))[0]
        text = facts.setting_words(name, next(choice for choice in choices if choice.name == name).setting)
        assert text in (facts.setting_words(name, row["served"]), "inf steps")
    row = table.loc["rk4[axis]", 1e-3]
    variant, tops = integrator("rk4[axis]"), natural(60, 2)
    shares = [share_served(variant, tops, 10.0, part * row["served"], 1e-3) for part in (0.5, 1.0)]
    assert shares[0] < 0.9 < SAFE <= shares[1] == row["share"]
    top, period = (scene := scene_of(tops_module.Tops(tops, 10.0), 0)), scene.nutation_period  # from outside
    run = symtop.simulate(top, "rk4[axis]", step_size=period / row["served"], horizon=10.0 * period)
    largest = float(symtop.errors(run, top)["axis"].max())
    for part, share in ((1.01, 1.0), (0.5, 0.0)):
        assert share_served(variant, tops[:1], 10.0, row["served"], part * largest) == share


def test_the_page_says_what_was_measured_and_shares_of_silent_runs_are_of_their_kind(small, tmp_path):
    counts = facts.tables(small)["silent"].set_index(["variant", "kind of top"])["wrong"].sort_index()
    health, kind = cells.health(small, "rk4[axis]"), KINDS.index("near-separatrix")
    indices = [int(np.argmin(np.abs(health.setting - steps))) for steps in facts.STEPS]
    assert np.array_equal(counts.loc["rk4[axis]", "near-separatrix"], health.wrong[indices, kind] / health.drawn[kind])
    assert PARTIAL in checked_page("cost", small, tmp_path, elsewhere={"use", "have"})  # there are no long runs
    labels = {text.get_text() for text in figures.draw_accuracy(small).axes[0].texts}
    assert {"takahashi-imada (symmetric)", "rk4"} <= labels


def test_where_f_is_dear_the_fewest_calls_win(monkeypatch):
    safes = [Safe("fast", 8.0, 1e-5, 0.0, 0.0), Safe("next", 8.0, 2e-5, 0.0, 0.0), Safe("few", 1e-5, 3e-5, 0.0, 0.0)]
    monkeypatch.setattr(cells, "safest", lambda *_: (safes, True))
    work = {"fast": np.array([500.0, 2000.0]), "next": np.array([80.0, 80.0]), "few": np.array([40.0, 90.0])}
    monkeypatch.setattr(cells, "mean_work", lambda _, __, name: work[name])
    settings = xr.DataArray([[[4.0, 16.0], [4.0, 16.0], [1e-4, 1e-6]]], dims=("scene", "variant", "level"))
    tree = xr.DataTree.from_dict({"short": xr.Dataset({"setting": settings}, {"variant": [*work], "target": [1e-3]})})
    # dearer by 2e-5 / 940 it leaves the fast one behind, but the next only by 1e-5 / 20; halfway between two settings
    assert cells.fewest_calls(tree, Cell("short", "axis", 1e-3, NATURAL)) == (safes[2], *map(pytest.approx, (60, 5e-7)))
    assert cells.advised(tree, [])["few"] == [1e-5]  # run on other tops, as all that the front page names, though slow
    monkeypatch.setattr(cells, "safest", lambda *_: (safes[:1], True))
    assert cells.fewest_calls(tree, Cell("short", "axis", 1e-3, NATURAL)) == (safes[0], pytest.approx(1000.0), 0.0)
    monkeypatch.setattr(cells, "safest", lambda *_: ([], True))
    assert cells.fewest_calls(tree, Cell("short", "axis", 1e-3, NATURAL)) is None


def test_a_row_of_the_front_page_is_of_a_slower_f(monkeypatch):
    calls = {1e-3: cells.FewestCalls(Safe("adams[axis]", 1e-4, 1e-5, 0.0, 0.0), 81.6, 1.7e-7),
             1e-6: cells.FewestCalls(Safe("rk4[axis]", 8.0, 1e-5, 0.0, 0.0), 320.0, 0.0)}  # fmt: skip
    monkeypatch.setattr(cells, "targets", lambda _: [*calls])
    monkeypatch.setattr(cells, "fewest_calls", lambda _, cell: calls[cell.target])
    monkeypatch.setattr(facts, "over", lambda _: "")
    first = "f(t, y) that takes 0.2\xa0us longer", "adams[axis], tolerance 0.0001, 82 evaluations"
    assert (*facts.slower(None)[0].values(),) == (*first, "rk4[axis], 8 steps, 320 evaluations", "p_phi")
    calls[1e-3] = calls[1e-6]  # nothing leads where f is slow that does not lead here
    assert facts.slower(None) == []
