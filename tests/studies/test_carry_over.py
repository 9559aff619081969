"""What carries over: errors and truth of bodies by other ways, planted differences that are seen, verdicts."""

import re

import numpy as np
import pytest
import xarray as xr
from scipy.stats import kendalltau
from symtop_studies.carry_over import comparison as by, facts, figures, measures
from symtop_studies.carry_over.bodies import FAMILIES, FREE, SYMMETRIC, Bodies, as_tops, bodies_of, run_level
from symtop_studies.carry_over.measures import ASYMPTOTE, growth_table, observed_order, own_table, table, verdicts
from symtop_studies.cost.ladder import LEVELS, Climb, one_by_one, setting_of
from symtop_studies.cost.tops import FIRST, MOMENTA

import symtop
from symtop.methods.framework.plan import NOT_CONVERGED, NOT_NORMALISED, OK, Plan
from symtop.methods.framework.registry import integrator
from symtop.model.charts import attitude_distance

COUNT, PERIODS = 4, 5.0


def drawn(family):
    return bodies_of(family, COUNT, 2, PERIODS)


def everyone():
    return np.arange(COUNT)


@pytest.mark.parametrize("family", [SYMMETRIC, "0.3", FREE])
def test_errors_of_many_runs_are_those_of_each(family):
    bodies = drawn(family)
    shown = bodies.errors("body", run_level(integrator("rk4[body]"), bodies, everyone(), 7, 1e6), everyone())
    for k, scene in enumerate(bodies.scenes):
        run = symtop.simulate(scene, "rk4", step_size=bodies.period[k] / FIRST / 128, horizon=bodies.times[k, -1],
                              samples=int(bodies.marks[-1]) * 128 + 1, guard=False)  # fmt: skip
        wrong = symtop.errors(run).isel(time=bodies.marks * 128)
        for name in ("attitude", "energy"):
            assert shown[name][k] == pytest.approx(float(wrong[name].max()), rel=1e-3, abs=1e-11)
        if scene.top.centre == (0.0, 0.0, 1.0):  # `errors` knows the third axis
            assert shown["axis"][k] == pytest.approx(float(wrong["axis"].max()), rel=1e-3, abs=1e-11)
        assert shown[MOMENTA][k] < 1e-2


@pytest.mark.parametrize(
    ("name", "level", "ends"),
    [("strang", 0, {OK}), ("rk4", 1, {NOT_NORMALISED}), ("rk4", 7, {OK}), ("gauss-4", 1, {OK, NOT_CONVERGED})],
)
def test_bodies_in_lanes_run_and_end_as_one_by_one(name, level, ends):
    variant, bodies = integrator(f"{name}[body]"), drawn("0.3")
    plans = [Plan.steps(float(period) / FIRST * 0.5**level, bodies.marks << level) for period in bodies.period]
    lanes, each = (
        run_level(variant, bodies, everyone(), level, 1e6), one_by_one(variant, bodies.members(everyone()), plans)
    )  # fmt: skip
    for field in ("states", "work", "outcome"):
        np.testing.assert_array_equal(getattr(lanes, field), getattr(each, field))
    assert {*lanes.outcome.tolist()} == ends


@pytest.mark.parametrize("family", [SYMMETRIC, "0.1", "chaotic", FREE])
def test_the_truth_is_within_its_bound_and_another_body_is_not(family):
    bodies = drawn(family)
    states, bounds = bodies.truth
    for k, scene in enumerate(bodies.scenes):
        exact = symtop.reference(scene, bodies.times[k])
        known = bounds[k] + exact["attitude_error_bound"].values
        assert (attitude_distance(states[k], exact["quaternion"].values) <= known)[np.isfinite(known)].all()
    other = [symtop.Scene("other", symtop.RigidBody(one.top.I1 * (1.0 + 1e-6), *one.top.moments[1:], one.top.mgl,
             one.top.centre), one.start, one.horizon) for one in bodies.scenes]  # fmt: skip
    moved = Bodies(other, bodies.strata, PERIODS).truth[0]
    assert all((attitude_distance(moved[k], states[k]).max() > 10.0 * bounds[k]) for k in range(COUNT))


def test_a_body_of_epsilon_zero_moves_as_the_top_that_it_is():
    bodies = drawn(SYMMETRIC)
    tops = as_tops(bodies)
    np.testing.assert_array_equal(tops.times, bodies.times)
    gap = attitude_distance(tops.truth[1], bodies.truth[0])
    assert (gap.max(axis=1) < bodies.truth[1] + 1e-13).all()
    other = as_tops(drawn("0.1"))
    assert (attitude_distance(other.truth[1], drawn("0.1").truth[0]).max(axis=1) > 1e-4).all()  # the negative control


def test_a_setting_that_meets_a_target_meets_it():
    variant, bodies = integrator("rk4[body]"), {name: drawn(name) for name in (SYMMETRIC, FREE)}
    data = table(variant, bodies, 2e4)
    assert (data["order"].values > 3.8).all()
    assert (data["order"].values < 4.3).all()
    met = data["met_at"].sel(family=SYMMETRIC, quantity="axis").sel(target=1e-3, method="nearest").values
    at = np.ceil(np.log2(met / FIRST)).astype(int)
    tops = bodies[SYMMETRIC]
    for k, level in enumerate(at):
        runs = (run_level(variant, tops, everyone(), place, 1e6) for place in (level, level - 1))
        fine, coarse = (tops.errors("", run, everyone()) for run in runs)
        assert fine["axis"][k] <= 1e-3 < coarse["axis"][k]
    own = own_table(integrator("rk4[axis]"), bodies, 2e3)
    ratio = own["met_at"].sel(quantity="axis").sel(target=1e-3, method="nearest").values / met
    assert (ratio > 0.2).all()
    assert (ratio < 5.0).all()


def test_wrong_runs_are_told_by_whether_something_shows_it():
    errors = {"axis": [0.01, 1.0, 1.0, np.inf], "energy": [0.0, 1e-3, 0.5, 0.0], MOMENTA: [0.0, 0.0, 0.0, 0.0]}
    blank = np.full((LEVELS, 4), np.nan)
    work, each = blank.copy(), {name: blank.copy() for name in errors}
    for name, values in errors.items():
        each[name][0] = values
    work[0] = 1.0
    ended = np.zeros((LEVELS, 4), bool)
    ended[0] = [True, True, True, False]
    done = Climb(work, each, ended, np.array([True, False, False, False]))
    assert verdicts(done)[0].tolist() == [1.0, 3.0, 2.0, 2.0]
    assert verdicts(done)[1].tolist() == [1.0, 0.0, 0.0, 0.0]


def test_orders_and_exponents_are_read_off():
    low, high = ASYMPTOTE
    errors = np.full((LEVELS, 3), np.nan)
    errors[:6] = 1e-2 * 2.0 ** (-4.0 * np.arange(6))[:, np.newaxis]
    assert observed_order(errors) == pytest.approx(4.0)
    assert np.isnan(observed_order(np.full((LEVELS, 3), 1.0)))
    assert low < high
    time = 5.0 * 2.0 ** np.arange(6)
    for power in (0.0, 1.0, 2.0):
        assert by.exponent(time, 1e-8 * time**power, "attitude") == pytest.approx(power)
    assert np.isnan(by.exponent(time, np.full(6, 1e-16), "energy"))


@pytest.mark.slow
def test_errors_grow_on_bodies_whose_truth_is_known_to_the_end(monkeypatch):
    """At epsilon = 0.3 some bodies turn chaotic after the ten periods that choose them."""
    data = growth_table(integrator("kahan-li-8[body]"), 24, 6, 1)
    shares = dict(zip(data["family"].values.tolist(), data["judged"].values.tolist(), strict=True))
    assert shares["0.3"] < 0.9 < shares[SYMMETRIC]
    assert shares[FREE] == 1.0

    def power(table):
        return by.exponent(table["time"].values, table["error_attitude"].sel(family="0.3").values, "attitude")

    monkeypatch.setattr(measures, "CLEAR", np.inf)
    everyone = growth_table(integrator("kahan-li-8[body]"), 24, 6, 1)
    assert (everyone["judged"] == 1.0).all()
    assert power(data) < 1.2 < power(everyone)  # a symplectic method's phase grows with the time, and chaos faster


def costs_of(medians, bodies=60, seed=0):
    """Methods whose costs scatter by a factor of two over bodies."""
    scatter = np.random.default_rng(seed).lognormal(0.0, 0.3, (len(medians), bodies))
    names = [f"method-{k}[body]" for k in range(len(medians))]
    return by.Costs(names, ["kicks"] * len(medians), np.array(medians)[:, np.newaxis] * scatter,
                    np.full(len(medians), 0.02))  # fmt: skip


def test_tau_is_kendalls_with_ties():
    generator = np.random.default_rng(1)
    for _ in range(20):
        first, second = (generator.integers(0, 8, 15).astype(float) for _ in range(2))
        assert by.tau_of(first, second) == pytest.approx(kendalltau(first, second).statistic)
    reached = np.array([1.0, 2.0, 3.0, 1e300, 1e300])
    assert by.tau_of(reached, reached) == 1.0  # those that nobody reaches say nothing
    assert np.isnan(by.tau_of(reached[3:], reached[3:]))


def test_a_planted_difference_of_rankings_is_seen_and_scatter_is_none():
    medians, rows = 1e-6 * 1.6 ** np.arange(20), ([*range(20)],) * 2
    same = by.bootstrap_tau(costs_of(medians), costs_of(3.0 * medians, seed=1), rows, paired=False)
    assert by.ranking_verdict(same) == by.YES
    mixed = medians.copy()
    mixed[[0, 5, 10, 15]] = mixed[[15, 0, 5, 10]]
    partly = by.bootstrap_tau(costs_of(medians), costs_of(mixed, seed=1), rows, paired=True)
    assert by.ranking_verdict(partly) == by.NO
    assert partly.low <= partly.value <= partly.high < same.low
    turned = by.bootstrap_tau(costs_of(medians), costs_of(medians[::-1], seed=1), rows, paired=True)
    assert turned.value < -0.9


def test_prices_do_not_rank_methods_that_reach_nothing():
    half, rows = 1e-6 * 1.6 ** np.arange(20), ([*range(20)],) * 2
    half[10:] = np.inf
    first, second = costs_of(half), costs_of(np.roll(half, 5), seed=1)
    free, noisy = (
        by.bootstrap_tau(*(one._replace(errors=np.full(20, error)) for one in (first, second)), rows, paired=True)
        for error in (0.0, 0.02)
    )
    assert free.low <= free.value <= free.high
    assert (noisy.low, noisy.high) == pytest.approx((free.low, free.high), abs=0.02)


@pytest.mark.parametrize(("beyond", "verdict"), [(0, by.FACTOR), (1, by.FACTOR), (2, by.PARTLY)])
def test_steps_beyond_the_budget_are_no_steps_that_carry_over(beyond, verdict):
    each = {f"method {k}": np.inf if k < beyond else 1.5 for k in range(20)}  # one in twenty is allowed
    assert facts.pooled([each]).verdict == verdict


def test_verdicts_follow_the_limits_that_were_fixed_before():
    for ends, verdict in (((0.91, 0.99), by.YES), ((0.7, 0.95), by.PARTLY), ((0.6, 0.79), by.NO)):
        assert by.ranking_verdict(by.Interval(0.85, *ends)) == verdict
    assert [by.factor_verdict(one) for one in (1.05, 1.0 / 1.05, 1.8, 0.6, 2.5, 0.3)] == [
        by.YES, by.YES, by.FACTOR, by.FACTOR, by.NO, by.NO,
    ]  # fmt: skip
    assert by.factor_verdict(4.0, by.SEVERAL) == by.FACTOR
    assert by.factor_verdict(facts.over(0.0, 0.0), by.SEVERAL) == by.YES  # no silent run of tops or bodies
    assert by.factor_verdict(facts.over(0.2, 0.0), by.SEVERAL) == by.NO
    assert facts.over(0.06, 0.02) == pytest.approx(3.0)


def planted(factor):
    """A dataset of three methods whose steps and silent wrong runs on free bodies are `factor` times those of tops."""
    variants, families, members = ["rk4[body]", "strang[body]", "gauss-4[body]"], [*FAMILIES], 40
    steps = np.array([20.0, 40.0, 10.0])[:, None, None, None] * 2.0 ** np.arange(3)[None, None, :, None]
    spread = np.linspace(0.8, 1.2, members) * np.ones((3, len(families), 3, members))
    met = steps * spread
    met[:, families.index(FREE)] *= factor
    setting = np.array([setting_of(integrator(variants[0]), level) for level in range(LEVELS)])
    status = np.ones((3, len(families), 6, members))
    status[..., : members // 20] = 3.0
    status[:, families.index(FREE), :, : int(factor * members / 20)] = 3.0
    over = ("variant", "family", "quantity", "target", "member")
    work = np.broadcast_to(setting * 10.0, (3, len(families), LEVELS))
    short = xr.Dataset(
        {
            "cost": (over, np.broadcast_to((10.0 * met)[:, :, None], (3, len(families), 2, 3, members))),
            "met_at": (over, np.broadcast_to(met[:, :, None], (3, len(families), 2, 3, members))),
            "setting": (("variant", "family", "level"), np.broadcast_to(setting, work.shape)),
            "work": (("variant", "family", "level"), work),
            "status": (("variant", "family", "kept", "member"), status),
            "control": ("variant", ["step_size"] * 3), "needs": ("variant", ["derivative", "kicks", "derivative"]),
        },
        {"variant": variants, "family": families, "quantity": ["axis", "attitude"], "target": [1e-3, 1e-6, 1e-9]},
    ).expand_dims("scene")  # fmt: skip
    prices = xr.Dataset(
        {name: (("scene", "variant", "priced_at"), np.full((3, 3, 7), value)) for name, value in
         (("price", 1e-7), ("call", 1e-6))} | {"sampled": (("scene", "variant"), np.full((3, 3), np.nan))},
        {"variant": variants, "priced_at": 10.0 ** -np.arange(2.0, 16.0, 2.0),
         "scene": ["first-0", "first-1", "first-2"]},
    )  # fmt: skip
    about = xr.Dataset(
        {"growth": (("scene", "family", "member"), np.full((1, len(families), members), 10.0)),
         "stratum": (("scene", "family", "member"), np.full((1, len(families), members), "heavy"))},
        {"scene": ["short"], "family": families},
    ).expand_dims("variant")  # fmt: skip
    return xr.DataTree.from_dict({"/short": short, "/prices": prices, "/bodies": about})


@pytest.mark.parametrize(("gap", "verdict", "words"), [
    (0.2503, by.NO, "1 of 2 exponents within 0.25, all within 0.26"), (0.2497, by.YES, "2 of 2 .*, all within 0.25"),
    (0.5, by.NO, "1 of 2 .*, all within 0.5$"),
])  # fmt: skip
def test_a_gap_that_is_shown_is_no_smaller_than_the_gap(gap, verdict, words, monkeypatch):
    """0.2503 is not within 0.25."""
    monkeypatch.setattr(facts, "exponent_gaps", lambda *_: {"rk4, attitude": gap, "rk4, energy": 0.01})
    why, told = facts.growth_cell(None, "0.3")
    assert told == verdict
    assert re.match(words, why)


def test_planted_factors_of_steps_and_of_silent_runs_are_found():
    for factor in (1.0, 3.0):
        data = planted(factor)
        for target in (1e-3, 1e-9):
            found = by.step_factors(data, FREE, target)
            assert len(found) == 3
            assert [*found.values()] == pytest.approx([factor] * 3)
            assert [*by.step_factors(data, "0.1", target).values()] == pytest.approx([1.0] * 3)
        assert by.silent(data, "rk4[body]", FREE) == pytest.approx(0.05 * factor)
        assert facts.silent_orders(data, FREE) == pytest.approx((0.05 * factor,) * 3)  # strang; rk4 and gauss-4
        assert by.silent(data, "rk4[body]", "0.3", "regular") == pytest.approx(0.05)
        assert np.isnan(by.silent(data, "rk4[body]", "0.3", "chaotic"))
        assert by.winner(data, FREE, 1e-6) == "gauss-4[body]"
        assert by.winner(data, FREE, 1e-6, "kicks") == "strang[body]"
        assert by.transferred(data, FREE, 1e-6).value == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("unserved", "words"),
    [(0, "median 3, 95\xa0% below 3"), (3, "median 3, 95\xa0% below 3, 1 of 9 beyond the budget")],
)
def test_a_method_that_no_step_within_the_budget_makes_safe_is_counted(unserved, words):
    data = planted(3.0)
    met = data["short"]["met_at"].copy()
    at = {"variant": 1, "family": [*FAMILIES].index(FREE), "target": 0}
    met[{**at, "member": slice(unserved)}] = np.inf  # 3 of 40 are more than 5 %
    data["short"] = data["short"].to_dataset().assign(met_at=met)
    assert facts.steps(data, FREE).words == words
    assert facts.steps(data, "0.1").words == "median 1, 95\xa0% below 1"
    assert by.step_factors(data, FREE, 1e-3).get("strang[body]") == pytest.approx(np.inf if unserved else 3.0)
    drawn_texts = {one.get_text() for one in figures.draw_steps(data).axes[0].texts}
    assert drawn_texts == ({"+1"} if unserved else set())
    everyone_beyond = facts.pooled([{"strang[body]": np.inf}])
    assert everyone_beyond.words == "1 of 1 beyond the budget"
