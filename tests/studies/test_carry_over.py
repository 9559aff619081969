"""What carries over: errors and truth of bodies by other ways, planted differences that are seen, verdicts."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from scipy.linalg import expm
from symtop_studies.carry_over import bodies as drawing, comparison as by, facts, figures, limits as of, measures
from symtop_studies.carry_over.bodies import FAMILIES, FREE, SYMMETRIC, Bodies, as_tops, bodies_of, run_level
from symtop_studies.carry_over.measures import ASYMPTOTE, growth_table, observed_order, own_table, table, verdicts
from symtop_studies.cost.ladder import LEVELS, Climb, one_by_one, setting_of
from symtop_studies.cost.tops import FIRST, MOMENTA
from symtop_studies.stability.linear_limits import sign_changes, sleep_margin

import symtop
from symtop.core import netcdf
from symtop.methods.framework.plan import NOT_CONVERGED, NOT_NORMALISED, OK, Plan
from symtop.methods.framework.registry import integrator
from symtop.model.charts import BODY, attitude_distance
from symtop.run.motion import CHECK_TOLERANCE, FINE_TOLERANCE, IntegratedMotion
from symtop.runner import run as runner
from tests.studies.test_cost import priced

COUNT, PERIODS = 4, 5.0
EVERYONE = np.arange(COUNT)


def bodies_for(family):
    return bodies_of(family, COUNT, 2, PERIODS)


@pytest.mark.parametrize("family", [SYMMETRIC, "0.3", FREE])
def test_errors_of_many_runs_are_those_of_each(family):
    bodies = bodies_for(family)
    errors = bodies.errors("body", run_level(integrator("rk4[body]"), bodies, EVERYONE, 7, 1e6), EVERYONE)
    for k, scene in enumerate(bodies.scenes):
        run = symtop.simulate(scene, "rk4", step_size=bodies.period[k] / FIRST / 128, horizon=bodies.times[k, -1],
                              samples=int(bodies.marks[-1]) * 128 + 1, guard=False)  # fmt: skip
        expected = symtop.errors(run).isel(time=bodies.marks * 128)
        for name in ("attitude", "energy"):
            assert errors[name][k] == pytest.approx(float(expected[name].max()), rel=1e-3, abs=1e-11)
        if scene.top.centre == (0.0, 0.0, 1.0):  # `errors` knows the third axis
            assert errors["axis"][k] == pytest.approx(float(expected["axis"].max()), rel=1e-3, abs=1e-11)
        assert errors[MOMENTA][k] < 1e-2


@pytest.mark.parametrize(("name", "level", "ends"), [
    ("strang", 0, {OK}), ("rk4", 1, {NOT_NORMALISED}), ("rk4", 7, {OK}), ("gauss-4", 1, {OK, NOT_CONVERGED}),
])  # fmt: skip
def test_bodies_in_lanes_run_and_end_as_one_by_one(in_lanes, name, level, ends):
    variant, bodies = integrator(f"{name}[body]"), bodies_for("0.3")
    plans = [Plan.steps(float(period) / FIRST * 0.5**level, bodies.marks << level) for period in bodies.period]
    lanes = run_level(variant, bodies, EVERYONE, level, 1e6)
    singles = one_by_one(variant, bodies.members(EVERYONE), plans)
    for field in ("states", "work", "outcome"):
        np.testing.assert_array_equal(getattr(lanes, field), getattr(singles, field))
    assert {*lanes.outcome.tolist()} == ends


@pytest.mark.parametrize("family", [SYMMETRIC, "0.1", "chaotic", FREE])
def test_the_truth_is_within_its_bound_and_another_body_is_not(family):
    bodies = bodies_for(family)
    states, bounds = bodies.truth
    for k, scene in enumerate(bodies.scenes):
        exact = symtop.reference(scene, bodies.times[k])
        limit = bounds[k] + exact["attitude_error_bound"].values
        assert (attitude_distance(states[k], exact["quaternion"].values) <= limit)[np.isfinite(limit)].all()
    scenes = [symtop.Scene("other", symtop.RigidBody(scene.top.I1 * (1.0 + 1e-6), *scene.top.moments[1:],
              scene.top.mgl, scene.top.centre), scene.start, scene.horizon) for scene in bodies.scenes]  # fmt: skip
    if family != FREE:
        motion = IntegratedMotion(bodies.scenes[0])
        runs = (motion.states(bodies.times[0], tolerance) for tolerance in (FINE_TOLERANCE, CHECK_TOLERANCE))
        fine, check = (drawing.unit(states[:, :4]) for states in runs)
        assert bounds[0] == 4.0 * attitude_distance(check, fine).max() + drawing.FLOOR
    assert bodies.asked([1e-3, 1e-6, 1e-9, 1e-12])["axis"].any(axis=1).tolist() == [True, True, True, False]
    control = Bodies(scenes, bodies.strata, PERIODS).truth[0]
    assert all((attitude_distance(control[k], states[k]).max() > 10.0 * bounds[k]) for k in range(COUNT))


def test_a_body_of_epsilon_zero_moves_as_the_top_that_it_is():
    bodies = bodies_for(SYMMETRIC)
    tops = as_tops(bodies)
    np.testing.assert_array_equal(tops.times, bodies.times)
    assert (attitude_distance(tops.truth[1], bodies.truth[0]).max(axis=1) < bodies.truth[1] + 1e-13).all()
    control = as_tops(bodies_for("0.1"))
    assert (attitude_distance(control.truth[1], bodies_for("0.1").truth[0]).max(axis=1) > 1e-4).all()  # the control


def test_a_setting_that_meets_a_target_meets_it():
    variant, bodies = integrator("rk4[body]"), {name: bodies_for(name) for name in (SYMMETRIC, FREE)}
    data = table(variant, bodies, 2e4)
    assert 3.8 < data["order"].values.min() <= data["order"].values.max() < 4.3
    met = data["met_at"].sel(family=SYMMETRIC, quantity="axis").sel(target=1e-3, method="nearest").values
    levels, tops = np.ceil(np.log2(met / FIRST)).astype(int), bodies[SYMMETRIC]
    for k, level in enumerate(levels):
        runs = (run_level(variant, tops, EVERYONE, place, 1e6) for place in (level, level - 1))
        fine, coarse = (tops.errors("", run, EVERYONE) for run in runs)
        assert fine["axis"][k] <= 1e-3 < coarse["axis"][k]
    own_data = own_table(integrator("rk4[axis]"), bodies, 2e3)
    ratio = own_data["met_at"].sel(quantity="axis").sel(target=1e-3, method="nearest").values / met
    assert 0.2 < ratio.min() < ratio.max() < 5.0


def test_wrong_runs_are_told_by_what_shows_them_and_orders_and_exponents_read_off():
    errors = {"axis": [0.01, 1.0, 1.0, np.inf], "energy": [0.0, 1e-3, 0.5, 0.0], MOMENTA: [0.0, 0.0, 0.0, 0.0]}
    blank = np.full((LEVELS, 4), np.nan)
    work, arrays = blank.copy(), {name: blank.copy() for name in errors}
    for name, values in errors.items():
        arrays[name][0] = values
    work[0] = 1.0
    mask = np.zeros((LEVELS, 4), bool)
    mask[0] = [True, True, True, False]
    climb = Climb(work, arrays, mask, np.array([True, False, False, False]))
    assert (verdicts(climb)[0].tolist(), verdicts(climb)[1].tolist()) == ([1.0, 3.0, 2.0, 2.0], [1.0, 0.0, 0.0, 0.0])
    low, high = ASYMPTOTE
    errors = np.full((LEVELS, 3), np.nan)
    errors[:6] = 1e-2 * 2.0 ** (-4.0 * np.arange(6))[:, np.newaxis]
    errors[1] = 9e-4  # coarse steps do not show the order
    assert observed_order(errors) == pytest.approx(4.0)
    assert np.isnan(observed_order(np.full((LEVELS, 3), 1.0)))
    assert low < high
    time = 5.0 * 2.0 ** np.arange(6)
    for power in (0.0, 1.0, 2.0):
        assert by.exponent(time, 1e-8 * time**power, "attitude") == pytest.approx(power)
    assert by.exponent(time, np.minimum(1e-4 * time**2, 0.5), "attitude") == pytest.approx(2.0)  # while it is small
    assert np.isnan(by.exponent(time, np.full(6, 1e-16), "energy"))


def test_a_median_error_is_the_largest_of_the_last_half_and_a_refuted_truth_is_over_both_bounds(monkeypatch):
    fall = lambda self, _, index: dict.fromkeys(("attitude", "energy"), np.tile(1e-3 / self.marks, (index.size, 1)))
    monkeypatch.setattr(Bodies, "errors_at", fall)
    data = growth_table(integrator("gauss-4[body]"), 2, 3, 1)
    error = data["error_energy"].sel(family=SYMMETRIC).values
    assert by.exponent(data["time"].values, error, "energy") == pytest.approx(-1.0, abs=0.05)
    bodies = bodies_for("0.3")
    turned = bodies.truth[0][0] + 1.5e-10 * np.roll(bodies.truth[0][0], 2, axis=1) * np.array([1.0, 1.0, -1.0, -1.0])
    result = SimpleNamespace(quaternion=turned, bound=np.full(len(turned), 2e-10))  # off by 3e-10
    monkeypatch.setattr(measures, "HeavyBody", lambda *_: SimpleNamespace(samples=lambda _: result))
    stub = SimpleNamespace(scenes=bodies.scenes, times=bodies.times, truth=(bodies.truth[0], np.full(COUNT, 1e-10)))
    assert measures._checked(stub, 0) == pytest.approx(1.0, rel=1e-3)


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
    full = growth_table(integrator("kahan-li-8[body]"), 24, 6, 1)
    assert (full["judged"] == 1.0).all()
    assert power(data) < 1.2 < power(full)  # a symplectic method's phase grows with the time, and chaos faster


def costs_of(medians, bodies=60, seed=0):
    """Methods whose costs scatter by a factor of two over bodies."""
    scatter = np.random.default_rng(seed).lognormal(0.0, 0.3, (len(medians), bodies))
    names = [f"method-{k}[body]" for k in range(len(medians))]
    return by.Costs(names, ["kicks"] * len(medians), np.array(medians)[:, np.newaxis] * scatter,
                    np.full(len(medians), 0.02))  # fmt: skip


def test_a_planted_difference_of_rankings_is_seen_and_scatter_is_none_nor_prices_of_what_is_not_reached():
    medians, rows = 1e-6 * 1.6 ** np.arange(20), ([*range(20)],) * 2
    same = by.bootstrap_tau(costs_of(medians), costs_of(3.0 * medians, seed=1), rows, paired=False)
    mixed = medians.copy()
    mixed[[0, 5, 10, 15]] = mixed[[15, 0, 5, 10]]
    partly = by.bootstrap_tau(costs_of(medians), costs_of(mixed, seed=1), rows, paired=True)
    assert (by.ranking_verdict(same), by.ranking_verdict(partly)) == (by.YES, by.NO)
    assert partly.low <= partly.value <= partly.high < same.low
    assert by.bootstrap_tau(costs_of(medians), costs_of(medians[::-1], seed=1), rows, paired=True).value < -0.9
    half = np.where(np.arange(20) < 10, medians, np.inf)
    first, second = costs_of(half), costs_of(np.roll(half, 5), seed=1)
    free, noisy = (by.bootstrap_tau(*(cost._replace(errors=np.full(20, error)) for cost in (first, second)), rows,
                                    paired=True) for error in (0.0, 0.02))  # fmt: skip
    assert free.low <= free.value <= free.high
    assert (noisy.low, noisy.high) == pytest.approx((free.low, free.high), abs=0.02)
    ref = costs_of(np.ones(20))._replace(errors=np.full(20, 5.0))  # prices alone rank them
    same, apart = (by.bootstrap_tau(ref, two, rows, paired=True) for two in (ref, ref._replace(names=ref.names[::-1])))
    assert apart.low < -0.1 < apart.high < 0.6 < same.low


@pytest.mark.parametrize(("count", "verdict"), [(0, by.FACTOR), (1, by.FACTOR), (2, by.PARTLY)])
def test_steps_beyond_the_budget_are_no_steps_that_carry_over(count, verdict):
    steps = {f"method {k}": np.inf if k < count else 1.5 for k in range(20)}  # one in twenty is allowed
    assert facts.pooled([steps]).verdict == verdict


def test_tau_is_kendalls_with_ties_and_verdicts_follow_limits_fixed_before():
    from scipy.stats import kendalltau  # a second to import

    generator = np.random.default_rng(1)
    for _ in range(20):
        first, second = (generator.integers(0, 8, 15).astype(float) for _ in range(2))
        assert by.tau_of(first, second) == pytest.approx(kendalltau(first, second).statistic)
    work = np.array([1.0, 2.0, 3.0, 1e300, 1e300])
    assert by.tau_of(work, work) == 1.0  # those that nobody reaches say nothing
    assert by.tau_of(np.arange(1.0, 5.0), np.array([1e300, 1.0, 2.0, 3.0])) == 0.0  # what one alone reaches
    assert by.medians(np.array([[1.0, 2.0, 9.0], [1.0, np.inf, np.inf]])).tolist() == [2.0, 1e300]
    assert np.isnan(by.tau_of(work[3:], work[3:]))
    for ends, verdict in (((0.91, 0.99), by.YES), ((0.7, 0.95), by.PARTLY), ((0.6, 0.79), by.NO)):
        assert by.ranking_verdict(by.Interval(0.85, *ends)) == verdict
    words = [by.factor_verdict(ratio) for ratio in (1.05, 1.0 / 1.05, 1.8, 0.6, 2.5, 0.3)]
    assert (words, by.factor_verdict(4.0, by.SEVERAL)) == ([by.YES] * 2 + [by.FACTOR] * 2 + [by.NO] * 2, by.FACTOR)
    assert by.factor_verdict(facts.over(0.0, 0.0), by.SEVERAL) == by.YES  # no silent run of tops or bodies
    assert by.factor_verdict(facts.over(0.2, 0.0), by.SEVERAL) == by.NO
    assert facts.over(0.06, 0.02) == pytest.approx(3.0)


def planted_data(factor):
    """A dataset of three methods whose steps and silent wrong runs on free bodies are `factor` times those of tops."""
    variants, families, members = ["rk4[body]", "strang[body]", "gauss-4[body]"], [*FAMILIES], 40
    steps = np.array([20.0, 40.0, 10.0])[:, None, None, None] * 2.0 ** np.arange(3)[None, None, :, None]
    met = steps * (np.linspace(0.8, 1.2, members) * np.ones((3, len(families), 3, members)))
    met[:, families.index(FREE)] *= factor
    setting = np.array([setting_of(integrator(variants[0]), level) for level in range(LEVELS)])
    status = np.ones((3, len(families), 6, members))
    status[..., members // 2 :] = 2.0  # wrong and seen
    status[:, :, 4, : members // 20] = status[:, families.index(FREE), 4, : int(factor * members / 20)] = 3.0
    dims = ("variant", "family", "quantity", "target", "member")
    work = np.broadcast_to(setting * 10.0, (3, len(families), LEVELS))
    short = xr.Dataset({
        "cost": (dims, np.broadcast_to((10.0 * met)[:, :, None], (3, len(families), 2, 3, members))),
        "met_at": (dims, np.broadcast_to(met[:, :, None], (3, len(families), 2, 3, members))),
        "setting": (("variant", "family", "level"), np.broadcast_to(setting, work.shape)),
        "work": (("variant", "family", "level"), work), "status": (("variant", "family", "kept", "member"), status),
        "control": ("variant", ["step_size"] * 3), "needs": ("variant", ["derivative", "kicks", "derivative"]),
    }, {"variant": variants, "family": families, "quantity": ["axis", "attitude"],
        "target": [1e-3, 1e-6, 1e-9]}).expand_dims("scene")  # fmt: skip
    prices = priced(np.full((3, 3), 1e-7), variants, call=1e-6)
    group = xr.Dataset({"growth": (("scene", "family", "member"), np.full((1, len(families), members), 10.0)),
                        "stratum": (("scene", "family", "member"), np.full((1, len(families), members), "heavy"))},
                       {"scene": ["short"], "family": families}).expand_dims("variant")  # fmt: skip
    return xr.DataTree.from_dict({"/short": short, "/prices": prices, "/bodies": group})


@pytest.mark.parametrize(("gap", "verdict", "words"), [
    (0.2503, by.NO, "1 of 2 exponents within 0.25, all within 0.26"), (0.2497, by.YES, "2 of 2 .*, all within 0.25"),
    (0.5, by.NO, "1 of 2 .*, all within 0.5$"),
])  # fmt: skip
def test_a_gap_that_is_shown_is_no_smaller_than_the_gap(gap, verdict, words, monkeypatch):
    """0.2503 is not within 0.25."""
    monkeypatch.setattr(facts, "exponent_gaps", lambda *_: {"rk4, attitude": gap, "rk4, energy": 0.01})
    text, result = facts.growth_cell(None, "0.3")
    assert (result, bool(re.match(words, text))) == (verdict, True)


def test_a_run_of_some_methods_has_every_fact_of_the_page(quick_results):
    data, page = netcdf.read_any(quick_results / "carry_over.nc"), runner.file_beside("carry_over", "page.md")
    part = xr.DataTree.from_dict({name: data[name].to_dataset() for name in ("short", "own", "prices", "bodies")})
    assert set(re.findall(r"\bf\.(\w+)", page.read_text())) <= set(facts.facts(part))
    answers, short = facts.facts(data), by.group_of(data, "short")
    assert [answers["growth_1_of"], answers["growth_chaotic_of"]] == [facts.exponent_gap(data, "0.1")[1], None]
    assert [*short["needs"].values] == [integrator(str(name)).needs for name in short["variant"].values]


def test_the_least_tau_over_long_runs_is_told_with_the_bodies_it_is_of():
    """Free bodies are judged at 1e-3 alone, four of them, and two of three methods have changed places."""
    data = planted_data(1.0)
    cost, index = data["short"]["cost"].copy(), {"family": [*FAMILIES].index(FREE)}
    cost[index] = cost[index].values[:, [1, 0, 2]]
    cost[{**index, "target": [1, 2]}] = cost[{**index, "target": 0, "member": slice(4, None)}] = np.nan
    data["long"] = data["short"].to_dataset().assign(cost=cost)
    assert [facts.long_tau(data, family) for family in (FREE, "0.1")] == [(pytest.approx(1.0 / 3.0), 4), (1.0, 40)]


def test_planted_factors_of_steps_and_of_silent_runs_are_found():
    for factor in (1.0, 3.0):
        data = planted_data(factor)
        for target in (1e-3, 1e-9):
            assert [*by.step_factors(data, FREE, target).values()] == pytest.approx([factor] * 3)
            assert [*by.step_factors(data, "0.1", target).values()] == pytest.approx([1.0] * 3)
        assert by.silent(data, "rk4[body]", FREE) == pytest.approx(0.05 * factor)
        assert facts.silent_orders(data, FREE) == pytest.approx((0.05 * factor,) * 3)  # strang; rk4 and gauss-4
        assert by.silent(data, "rk4[body]", "0.3", "regular") == pytest.approx(0.05)
        assert np.isnan(by.silent(data, "rk4[body]", "0.3", "chaotic"))
        assert (by.winner(data, FREE, 1e-6), by.winner(data, FREE, 1e-6, "kicks")) == ("gauss-4[body]", "strang[body]")
        assert by.transferred(data, FREE, 1e-6).value == pytest.approx(1.0)
    scatter = np.random.default_rng(1).lognormal(10.0, 0.5, (3, 1, 1, 1, 40))  # the same of each family
    tree = planted_data(1.0)
    tree["short"] = tree["short"].to_dataset().assign(cost=0.0 * tree["short"]["cost"] + scatter)
    paired, apart = (by.tau(tree, family, 1e-3) for family in ("0.1", FREE))
    assert (paired, apart.value) == ((1.0, 1.0, 1.0), 1.0)
    assert apart.low < 0.5
    names = ["rk4[axis]", "strang[axis]", "gauss-4[axis]"]
    tariff, strata = tree["prices"].to_dataset(), tree["bodies"]["stratum"].copy()
    tariff = xr.concat([tariff, tariff.assign(price=tariff["price"] / 3.0).assign_coords(variant=names)], "variant")
    rows = tree["short"].to_dataset().isel(family=0, drop=True).assign_coords(variant=names)
    strata[..., :4] = "thin"  # which need steps a hundred times as short
    met = tree["short"]["met_at"].copy()
    met[{"member": slice(4)}] *= 100.0
    short, group = (tree[name].to_dataset() for name in ("short", "bodies"))
    tree = xr.DataTree.from_dict({"/short": short.assign(met_at=met), "/own": rows, "/prices": tariff,
                                  "/bodies": group.assign(stratum=strata)})  # fmt: skip
    assert [*by.price_factors(tree).values()] == pytest.approx([3.0] * 3)
    ends = [[*by.own_factors(tree, FREE, 1e-3, stratum).values()] for stratum in ("", "thin")]
    assert (min(ends[0]) > 50.0, max(ends[1]) < 1.01) == (True, True)
    cost = data["short"]["cost"].copy()
    cost[{"variant": 0}] = 1.02 * cost[{"variant": 2}].values  # rk4 and gauss-4 are level on tops
    cost[{"variant": 0, "family": [*FAMILIES].index(FREE)}] *= 3.0
    data["short"] = data["short"].to_dataset().assign(cost=cost)
    assert facts.worst_winner(data, FREE).value > 2.0  # of both, whichever is the cheapest


@pytest.mark.parametrize(("unserved", "words"), [
    (0, "median 3, 95\xa0% below 3"), (3, "median 3, 95\xa0% below 3, 1 of 9 cases over budget"),
])  # fmt: skip
def test_a_method_that_no_step_within_the_budget_makes_safe_is_counted(unserved, words):
    data = planted_data(3.0)
    met, index = data["short"]["met_at"].copy(), {"variant": 1, "family": [*FAMILIES].index(FREE), "target": 0}
    met[{**index, "member": slice(unserved)}] = np.inf  # 3 of 40 are more than 5 %
    data["short"] = data["short"].to_dataset().assign(met_at=met)
    assert (facts.steps(data, FREE).words, facts.steps(data, "0.1").words) == (words, "median 1, 95\xa0% below 1")
    assert by.step_factors(data, FREE, 1e-3).get("strang[body]") == pytest.approx(np.inf if unserved else 3.0)
    assert {text.get_text() for text in figures.draw_steps(data).axes[0].texts} == ({"+1"} if unserved else set())
    assert facts.pooled([{"strang[body]": np.inf}]).words == "1 of 1 cases over budget"


GRID = 0.1


def stretched_method(name, factor):
    """A method whose steps are longer than it says: a planted lower limit."""
    solver = integrator(f"{name}[{BODY}]").solvers[BODY]
    many = lambda rows, h, marks: solver.many(rows, factor * h, marks)
    return SimpleNamespace(solvers={BODY: SimpleNamespace(many=many)})


def tilted(n, size=0.05):
    return np.tile([size, 0.0, 0.0, 0.0], (n, 1))


def limit(variant, bodies):
    omega, _, stable = of.reach(bodies, tilted(len(bodies.spin)))
    assert stable.all()
    return of.limits(variant, bodies, omega, GRID)


@pytest.mark.parametrize("spin", [2.5, 3.0, 4.0])
def test_a_body_that_is_a_top_has_the_limit_that_the_study_of_stability_finds(spin):
    bodies = of.Upright(np.ones((1, 3)), np.ones(1), np.array([spin]))
    omega = of.reach(bodies, tilted(1))[0]
    ends = sign_changes(lambda h: sleep_margin(integrator("strang"), spin, h), np.linspace(0.05, 8.0 / spin, 300))
    assert limit(integrator("strang[body]"), bodies) / omega == pytest.approx(ends[:1], rel=1e-5)
    assert limit(stretched_method("strang", 1.05), bodies) / omega == pytest.approx([ends[0] / 1.05], rel=1e-5)


def test_a_body_that_hangs_has_the_limits_of_the_oscillator_and_a_planted_one_is_seen():
    """rk4 2 sqrt 2, the splitting of kicks and free motion 2, whatever the moments; tops have 2.83 in angles too."""
    bodies = of.Upright(np.array([[1.0, 1.3, 0.5], [1.0, 1.0, 0.5]]), -np.ones(2), np.zeros(2))
    for name, expected in (("rk4", np.sqrt(8.0)), ("strang", 2.0)):
        assert limit(integrator(f"{name}[{BODY}]"), bodies) == pytest.approx([expected] * 2, rel=1e-4)
        assert limit(stretched_method(name, 1.25), bodies) == pytest.approx([expected / 1.25] * 2, rel=1e-4)


@pytest.mark.parametrize("family", ["0.3", FREE])
def test_small_motions_are_those_of_the_matrix(family):
    bodies, time = of.upright(family, 4, 3), 1.7
    bodies = bodies._replace(moments=1.3 * bodies.moments)  # the first is not one
    y = np.tile([3e-6, -2e-6, 1e-6, 4e-6], (4, 1))
    out = of.displaced(integrator("kahan-li-8[body]"), bodies.rows(y[:, None])[:, 0], np.full(4, time / 400),
                       np.array([400]))[:, 0]  # fmt: skip
    expected = np.stack([expm(time * slopes) @ row for slopes, row in zip(bodies.slopes, y, strict=True)])
    np.testing.assert_allclose(out, expected, atol=1e-11)
    control = of.upright(SYMMETRIC, 4, 3)
    control_out = np.stack([expm(time * slopes) @ row for slopes, row in zip(control.slopes, y, strict=True)])
    assert np.abs(out - control_out).max(axis=1).min() > 1e-8


def test_a_tilt_grows_beyond_the_limit_alone_and_an_unstable_rotation_has_no_limit(monkeypatch):
    variant, bodies = integrator("strang[body]"), of.upright("0.3", 6, 1)
    omega, amplitude, _ = of.reach(bodies, tilted(6))
    h = of.limits(variant, bodies, omega, GRID)[:, None] * np.array([0.05, 0.2, 1.02]) / omega[:, None]
    mask = of.radius(variant, bodies, h)[:, 2] > 1.05  # one body has left a narrow window by then
    assert mask.sum() == 5
    assert of.grown(variant, bodies, h, tilted(6), amplitude).tolist() == [[False, False, grows] for grows in mask]
    times = np.linspace(0.0, 200.0, 4001)
    matrices, y = bodies.slopes[:2], tilted(1)[0]
    tilts = np.array([[np.hypot(*(expm(t * slopes) @ y)[:2]) for t in times] for slopes in matrices])
    assert (tilts.max(axis=1) / amplitude[:2]) == pytest.approx(0.99, abs=0.02)  # it comes as far, and no farther
    falls = of.Upright(np.array([[1.0, 1.1, 0.5], [1.0, 1.3, 1.15]]), np.array([1.0, 0.0]), np.array([0.5, 3.0]))
    assert not of.reach(falls, tilted(2))[2].any()  # too slow to sleep; about the middle axis
    monkeypatch.setattr(of, "upright", lambda family, count, seed: falls)
    calls, original = [], of.grown
    monkeypatch.setattr(of, "grown", lambda *args: calls.append(args[2]) or original(*args))
    table = of.steady_table(variant, 2, 1, 1.0, 2)
    assert calls[0][:, 1] / calls[0][:, 0] == pytest.approx(3.0)  # a quarter and three quarters of the limit
    assert (table["limit"] == 0.0).all()
    assert table["grown"].isnull().all()


def test_engines_that_leave_out_a_term_lose_bodies_and_those_of_order_four_do_not():
    bodies = {name: bodies_of(name, 6, 1, 10.0) for name in (SYMMETRIC, "0.3")}
    no_gyro, rkmk4 = (of.engine_table(integrator(f"{name}[{BODY}]"), bodies) for name in ("no-gyro", "rkmk4"))
    assert not rkmk4["lost"].any()
    assert 0.3 < no_gyro["lost"].mean() < (no_gyro["error"] > 0.1).mean()  # some are lost after the first period
    ratio = (rkmk4["error"].isel(steps=0) / rkmk4["error"].isel(steps=1)).median("member")
    assert ((ratio > 4.0**3) & (ratio < 4.0**5)).all()  # of order four, two halvings of the step


def dataset(limits, grown, errors):
    """Two methods and six maps on ten bodies of each family: numbers by family, a row of errors by map."""
    columns = (("limit", limits, np.ones(10)), ("grown", grown, 10.0 * np.eye(10)[0]))  # all of the share by one body
    steady = {name: (("variant", "family", "member"), np.broadcast_to(
        np.array([values[family] for family in of.STEADY])[None, :, None] * share, (2, len(of.STEADY), 10)))
        for name, values, share in columns}  # fmt: skip
    error = np.array([errors[name] for name in FAMILIES]).T[:, :, None, None] * np.ones((1, 1, 2, 10))
    dims = ("variant", "family", "steps", "member")
    engines = xr.Dataset({"error": (dims, error), "lost": (dims, 1.0 * (error > 3.0))},
                         {"variant": [f"map-{k}[body]" for k in range(6)], "family": [*FAMILIES]})  # fmt: skip
    first = xr.Dataset(steady, {"variant": ["strang[body]", "rk4[body]"], "family": list(of.STEADY)})
    return xr.DataTree.from_dict({"/steady": first.expand_dims("scene"), "/engines": engines.expand_dims("scene")})


def test_planted_limits_resonances_and_rankings_of_engines_are_found(monkeypatch):
    row = 2.0 ** np.arange(-3.0, 3.0)
    errors = dict.fromkeys(FAMILIES, row) | {FREE: row[::-1], "0.1": 0.99 * row}
    limits = dict.fromkeys(of.STEADY, 2.0) | {"0.1": 1.2, "0.3": 0.8, FREE: np.nan}
    grown = dict.fromkeys(of.STEADY, 0.02) | {"0.01": 0.0, "0.1": 0.05, "0.3": 0.2}
    data = dataset(limits, grown, errors)
    words = {family: [cell(data, family)[1] for cell in (facts.limit_cell, facts.resonance_cell, facts.engine_cell)]
             for family in ("0.01", "0.1", "0.3", FREE)}  # fmt: skip
    assert words["0.01"] == [by.YES, by.FACTOR, by.YES]  # none at all, in units of a hundredth
    expected = [by.FACTOR, by.FACTOR, by.YES], [by.NO, by.NO, by.YES], [by.YES, by.YES, by.NO]
    assert (words["0.1"], words["0.3"], words[FREE]) == expected
    assert by.limit_factors(data, FREE) == pytest.approx(of.MOST / 2.0)  # a limit that is not found is no lower
    assert np.isnan(by.limit_factors(dataset(limits | {"0.3": 0.0}, grown, errors), "0.3")).all()
    assert len(facts.limit_table(data)) == 2 + 2 + 4 * 6
    monkeypatch.setattr(by, "engine_tau", lambda _, __, place: by.Interval((0.9, 0.3)[place], 0.2, 0.95))
    assert facts.engine_cell(data, "0.3")[0].startswith("tau 0.3 [0.2, 0.95]")  # of the step with the lesser
    monkeypatch.setattr(by, "limit_factors", lambda *_: np.linspace(0.0, 1.0, 21))
    assert facts.limit_ends(data, "0.3") == pytest.approx((0.05, 0.5))
    monkeypatch.setattr(by, "exponents", lambda _: {("a", SYMMETRIC, "energy"): 1.0, ("a", "0.3", "energy"): 0.4})
    assert facts.exponent_gap(data, "0.3") == (pytest.approx(0.6), "a, energy")
    monkeypatch.setattr(by, "orders", lambda _: [("a", "0.3", 3.5, 4.0), ("b", "0.3", 2.9, 2.0), ("c", FREE, 1.0, 2.0)])
    assert facts.order_gap(data, "0.3") == (0.5, "a")
    monkeypatch.setattr(by, "orders", lambda _: [("rk4", "0.3", 4.25, 5.0), ("strang", "0.3", 1.75, 2.5)])
    assert facts.order_gap(data, "0.3", claimed=True) == (0.25, "strang")  # declared as 2; rk4 loses what nobody claims
    for count, verdict in ((19, by.YES), (18, by.NO)):
        monkeypatch.setattr(facts, "exponents_within", lambda *_, n=count: (n, 20))
        assert facts.growth_cell(data, "0.3")[1] == verdict  # one that is far away decides no row
    assert facts.least([by.Interval(0.5, 0.4, 0.9), by.Interval(0.6, 0.1, 0.7)]) == (0.5, 0.1, 0.7)
