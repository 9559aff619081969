"""The drift study: behaviours, histories, losses of phase and what it costs to keep it, and windows of many runs."""

import math
from itertools import pairwise

import numpy as np
import pytest
import xarray as xr
from symtop_studies.drift import facts, figures, measures, study
from symtop_studies.drift.growth import ensemble_growth, history, horizon, lost_at, nutation_phase
from symtop_studies.drift.measures import ROUNDINGS
from symtop_studies.drift.phase_loss import phase_loss
from symtop_studies.drift.runs import PLAIN_MEMBERS, elapsed_steps, gauges_of, members, run_history, side_by_side
from symtop_studies.drift.study import TOLERANCE, cases

import symtop
from symtop.judging.claims.constants import KEPT_CHANGE, Constant
from symtop.measure import datasets
from symtop.measure.conservation import CONSTANTS, Change, growth, law
from symtop.methods.framework.lanes import LEAST_MEMBERS
from symtop.methods.framework.registry import integrator
from symtop.model.scenes import scene
from symtop.run import modified_energy as shadow
from symtop.run.long_run import QUANTITIES, chart_of, gauge_of, long_run, scattered
from tests.templates import checked_page


@pytest.mark.parametrize(("sizes", "exponents", "interval", "word"), [
    ((1e-13, 2e-13), (0.5, 1.0), 0.1, "kept"), ((1e-4, 1e-4), (0.0, 0.1), 0.1, "bounded"),
    ((1e-4, 1e-4), (0.0, 0.1), 0.6, "growing"),  # the interval does not exclude a walk
    ((1e-4, 1e-4), (0.0, 1.0), 0.1, "drift"),  # the worse of two scenes
    ((1e-12, 1e-13), (0.5, 0.5), 0.1, "random walk"),
])  # fmt: skip
def test_the_behaviour_of_a_quantity_is_that_on_its_worst_scene(sizes, exponents, interval, word):
    cell = xr.Dataset({
        "outcome": ("scene", ["ok", "ok"]), "energy_largest": ("scene", list(sizes)),
        "energy_exponent": ("scene", list(exponents)), "energy_exponent_interval": ("scene", [interval] * 2),
    })  # fmt: skip
    assert measures.worst_behaviour(cell, "energy") == word
    assert measures.worst_behaviour(cell.assign(outcome=("scene", ["ok", "left_chart"])), "energy") == "failed"


def test_a_history_says_with_what_it_ran_and_has_one_behaviour_in_every_study():
    case = symtop.scene("spheroid")
    short = {"horizon": 20.0 * case.nutation_period, "samples": 101}
    step = run_history(case, symtop.integrator("rk4[axis]"), step_size=case.nutation_period / 50.0, **short)
    loose = run_history(case, symtop.integrator("rk45-compiled[angles]"), tolerance=1e-5, **short)
    default = run_history(case, symtop.integrator("taylor[axis]"), **short)
    assert [float(run["steps_a_nutation"]) for run in (step, loose)] == pytest.approx([50.0, math.nan], nan_ok=True)
    tolerances = [1e-5, symtop.integrator("taylor").default_tolerance]
    assert [float(run["tolerance"]) for run in (loose, default)] == tolerances
    assert [float(run["own_tolerance"]) for run in (step, loose, default)] == [0.0, 0.0, 1.0]
    assert float(step["p_phi_largest"]) == 0.0
    control = run_history(case, symtop.integrator("rk4[angles]"), step_size=case.nutation_period / 50.0, **short)
    assert float(control["p_phi_largest"]) > 1e-9
    # kahan-li-6 changes the energy by 9e-13 of the spin's and has an exponent of 0: an error of the step, bounded.
    for size, exponent, interval in ((9e-12, 0.0, 0.001), (1e-15, 0.9, 0.1), (1e-4, 1.0, 0.1), (1e-4, 0.0, 0.01)):
        growth = {"energy_largest": size, "energy_exponent": exponent, "energy_exponent_interval": interval}
        columns = {"outcome": ("scene", ["ok"]), **{name: ("scene", [value]) for name, value in growth.items()}}
        cell = xr.Dataset(columns, coords={"scene": ["spheroid"]})
        grain = symtop.scene("spheroid").energy_grain
        ledger = Constant(Change(size, 0.0, 1.0, 0.0, exponent, interval, ""), 0.0, KEPT_CHANGE * grain, grain)
        assert measures.worst_behaviour(cell, "energy") == ledger.kind


NAMES = ["strang[axis]", "gauss-4[axis]", "rk4[axis]", "rk4[angles]", "radau[angles]"]
SIZES = {"energy": [1e-4, 1e-15, 1e-3, 1e-2, 1e-6], "p_phi": [0.0, 0.0, 0.0, 1e-5, 1e-6], "p_psi": [0.0] * 5}
SLOPES = {"energy": [0.0, 0.5, 1.0, 1.0, 0.0], "p_phi": [0.0, 0.0, 0.0, 1.0, 1.0], "p_psi": [0.0] * 5}
PHASE = [[1.0, 1.04], [0.4, 1.5], [2.0, 1.9], [2.0, 2.2], [1.0, 2.0]]  # by variant and scene


@pytest.fixture
def histories():
    """Five variants on two scenes: two hold everything, one loses the energy, one that and p_phi, one p_phi."""
    columns = {
        f"{name}_{part}": np.repeat(np.array(values, float)[:, None], 2, axis=1)
        for name in CONSTANTS
        for part, values in (("largest", SIZES[name]), ("exponent", SLOPES[name]), ("exponent_interval", [0.01] * 5))
    }
    columns |= {"phase_exponent": np.array(PHASE), "phase_exponent_interval": np.full((5, 2), 0.01)}
    columns |= {"nutations": np.full((5, 2), 100.0), "steps_a_nutation": np.full((5, 2), 118.0)}
    columns |= {"tolerance": np.full((5, 2), np.nan), "own_tolerance": np.zeros((5, 2))}
    data = xr.Dataset({key: (("variant", "scene"), values) for key, values in columns.items()},
                      coords={"variant": NAMES, "scene": ["spheroid", "goldstein"]})  # fmt: skip
    dims, times = ("variant", "scene"), np.broadcast_to(np.linspace(0.0, 1.0, 3), (5, 2, 3))
    return data.assign(outcome=(dims, np.full((5, 2), "ok")), sample_time=((*dims, "sample"), times))


def test_a_constant_is_kept_bounded_or_lost_on_the_worst_scene(histories):
    fates = measures.fates(histories)
    assert fates["energy"].tolist() == ["bounded", "kept", "drift", "drift", "bounded"]
    assert fates["p_phi_largest"].tolist() == SIZES["p_phi"]
    answers = facts.of_histories(histories)
    assert (answers["variants"], answers["holding"]) == (5, 2)
    assert [answers[f"energy_lost{end}"] for end in ("", "_worst", "_most")] == [2, "rk4[angles]", 1e-2]
    assert (answers["bounded_runs"], answers["bounded_as_t"], answers["lost_faster"]) == (4, 3, 4)
    ended = histories.assign(outcome=histories["outcome"].where(histories["variant"] != "strang[axis]", "left_chart"))
    assert measures.fates(ended)["energy"]["strang[axis]"] == measures.FAILED
    assert facts.of_histories(ended)["holding"] == 1
    brief = histories.copy(deep=True)
    brief["sample_time"] = brief["sample_time"].copy()
    brief["sample_time"].loc[{"variant": "rk4[axis]", "scene": "goldstein"}] *= 0.5
    brief["energy_largest"].loc[{"variant": "gauss-4[axis]"}] = 1e-11  # a random walk
    assert [*map(facts.of_histories(brief).get, ("shortened", "shortest", "energy_lost"))] == [1, 0.5, 3]


@pytest.fixture(scope="module")
def data():
    """All four groups: a few variants, short runs."""
    names = {"strang[axis]", "gauss-4[axis]", "rk4[axis]", "rk4[angles]", "rk45-compiled[axis]", "taylor[axis]"}
    cases = [case for case in study.grid(4000, 6, 100_000, 100_000, 0.05) if case.integrator in names]
    return datasets.combine([(case, study.measure(case)) for case in cases])


def test_the_page_says_what_every_group_shows(data, tmp_path):
    checked_page("drift", data, tmp_path)
    answers = facts.facts(data)
    assert None not in set(answers.values())
    assert (answers["variants"], answers["own"], answers["tolerance"]) == (6, 1, TOLERANCE)
    assert (answers["holding"], answers["energy_lost"]) == (4, 2)  # so soon rk4 in angles has not lost it
    assert answers["gain_least"] > 3.0
    part = data[ROUNDINGS].to_dataset().isel(scene=0, variant=0).dropna("window", subset=["elapsed"])
    mask = part["elapsed"].values > 0.1 * part["elapsed"].values[-1]
    plain, kept = (part[name].dropna(dim)[{dim: slice(PLAIN_MEMBERS), "window": mask}]
                   for dim, name in (("plain_member", "plain_drift"), ("member", "drift")))  # fmt: skip
    assert float(part["gain"]) == pytest.approx(float(np.sqrt((plain**2).mean() / (kept**2).mean())))
    assert (answers["lost_count"], answers["lost_hits"]) == (4, 4)
    assert [len(table) for table in facts.tables(data).values()][1] == 6


@pytest.mark.parametrize("group", list(facts.NAMES))
def test_a_group_alone_has_the_same_facts_and_none_of_the_others(data, group):
    tree = xr.DataTree.from_dict({group: data[group].to_dataset()})
    answers, expected = facts.facts(tree), facts.facts(data)
    assert answers.keys() == expected.keys()
    for key, names in facts.NAMES.items():
        assert all((answers[name] is None) is (key != group) for name in names.split()), key
    assert len(figures.pictures(tree)) == (group in (measures.HISTORIES, measures.ROUNDINGS))


def test_phases_are_grouped_by_the_energy_and_a_run_that_keeps_it_is_none_of_those_that_lose_it(histories):
    groups = measures.phases_by_energy(histories)
    assert (sorted(groups["bounded"]), sorted(groups["lost"])) == ([1.0, 1.0, 1.04, 2.0], [1.9, 2.0, 2.0, 2.2])
    place = {"variant": "rk4[angles]", "scene": "goldstein"}  # of a variant that loses the energy on one scene only
    for name, value in (("energy_largest", 1e-14), ("phase_exponent", 0.5)):
        histories = histories.assign({name: histories[name].copy()})
        histories[name].loc[place] = value
    assert measures.fates(histories)["energy"]["rk4[angles]"] == "drift"
    groups = measures.phases_by_energy(histories)
    assert (len(groups["lost"]), 0.5 in groups["lost"], 0.5 in groups["kept"]) == (3, False, True)


def test_a_prediction_is_judged_by_what_was_measured():
    cells = {"steps": [9.0] * 3, "evaluations": [9.0] * 3, "short": [1000.0] * 3, "ratio": [1.0, 0.75, np.nan],
             "predicted": [2500.0, 1500.0, np.inf], "measured": [2500.0, 2000.0, np.nan]}  # fmt: skip
    horizons = xr.Dataset({name: (("scene", "variant"), [values]) for name, values in cells.items()},
                          coords={"scene": ["spheroid"], "variant": ["a", "b", "c"]})  # fmt: skip
    answers = facts.of_losses(horizons)
    assert (answers["lost_count"], answers["lost_hits"]) == (2, 1)
    assert (answers["lost_later"], facts.loss_table(horizons)["variant"].tolist()) == (2.25, ["b", "a"])


@pytest.mark.parametrize("compensated", [True, False])
@pytest.mark.parametrize("name", ["midpoint[angles]", "cayley[axis]"])
def test_each_has_the_bits_of_a_long_run(in_lanes, name, compensated):
    method, scenes, per_nutation = integrator(name), members(scene("spheroid"), 6), 1000.37  # six: enough for lanes
    gauges = gauges_of(scenes, method, per_nutation)
    ends, values = side_by_side(scenes, gauges, method, 20_000, per_nutation, compensated=compensated)
    for i, member in ((0, scenes[0]), (5, scenes[5])):
        h = member.nutation_period / per_nutation
        expected = long_run(member, method, steps=20_000, step_size=h, compensated=compensated, quiet=True)
        np.testing.assert_array_equal(ends, expected["steps"])
        for quantity in QUANTITIES:
            for k, part in enumerate(("least", "largest", "mean")):
                np.testing.assert_array_equal(values[quantity][i, :, k], expected[f"{quantity}_{part}"])
    runs = [values["modified_energy"][i] for i in range(6)]
    assert not any(np.array_equal(first, second) for first, second in pairwise(runs))  # each is a run of its own


def test_adaptive_methods_drift_at_one_tolerance_and_the_ordinary_ensemble_goes_in_lanes():
    """One value for all of them, except for those that have a default of their own and keep it."""
    grid = [case for case in cases(quick=False) if case.group == measures.HISTORIES]
    assert {case.settings["tolerance"] for case in grid if "tolerance" in case.settings} == {TOLERANCE}
    for case in grid:
        method = symtop.integrator(case.integrator)
        assert len(method.charts()) == 1, case
        has_default = method.adaptive and method.default_tolerance is not None
        assert ("tolerance" in case.settings) == (method.adaptive and not has_default), case
    names = {case.integrator for case in grid}
    assert {"rk4[angles]", "rk4[axis]", "strang[axis]", "five-rotations[attitude]"} <= names
    assert "strang[attitude]" not in names
    asked = {case.integrator for case in cases(quick=False) if case.group == measures.HORIZONS}
    assert "exact-discrete[axis]" in names - asked  # it loses no phase
    # Fewer members, or another sum, would run one after another, 8 times slower.
    ensembles = [case for case in study.cases(False) if case.group == ROUNDINGS]
    assert len(ensembles) == 4
    for case in ensembles:
        row = integrator(case.integrator)
        assert case.settings["count"] >= LEAST_MEMBERS
        assert row.solvers[row.charts()[0]].in_lanes


TIME = np.linspace(0.0, 1000.0, 4001) + 0.3 * np.sin(np.arange(4001))


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
def test_a_planted_exponent_is_found_under_an_oscillation(exponent):
    fit = growth(TIME, 1e-6 * np.abs(TIME) ** exponent + 1e-6 * np.sin(5.3 * TIME))
    assert fit.slope == pytest.approx(exponent, abs=0.05)
    assert law(fit) == {1.0: "linear", 1.5: "t^3/2", 2.0: "quadratic"}[exponent]


def test_a_law_is_named_where_the_interval_holds_one_and_growth_as_time_is_told():
    means = xr.DataArray([[0.0, 1e-5, 3e-5, np.nan]], dims=("variant", "window"))
    cells = xr.Dataset({"energy_mean": means.copy(data=[[0.0, 4e-5, 1e-6, np.nan]]),
                        "energy_largest": means + 5e-5, "energy_least": means - 5e-5})  # fmt: skip
    moves = np.abs(measures.shifts(cells))
    assert (float(moves.isel(window=-1).max()), float(moves.max())) == pytest.approx((0.01, 0.4))
    ends = {f"{name}_{part}": ("variant", [size]) for name in ("p_phi", "p_psi") for part, size in
            (("least", -3e-5), ("largest", 1e-5))} | {"steps": ("variant", [1e8])}  # fmt: skip
    fallen = cells.assign(energy_mean=-cells["energy_mean"]).isel(window=slice(3)).assign(ends)
    answers = facts.of_windows(fallen.expand_dims(scene=["spheroid"]))
    assert [answers[name] for name in ("moved", "scattered", "long_momenta")] == pytest.approx([0.01, 0.4, 3e-5])
    slopes = np.array([0.91, 1.0, 1.09, 0.88, 1.12, 2.0])
    assert measures.as_time(slopes).tolist() == [True, True, True, False, False, False]
    assert measures.faster(slopes).tolist() == [False, False, False, False, True, True]
    assert (law(growth(TIME, np.sin(5.3 * TIME))), law(growth(TIME, np.abs(TIME) ** 0.75))) == ("bounded", "t^0.75")
    fit = growth(TIME, np.abs(TIME))
    assert (law(fit), law(fit._replace(slope=0.8, interval=0.4))) == ("linear", "undecided")


def test_an_ensemble_tells_a_walk_from_a_drift_and_means_of_a_walk_vary_with_the_steps_between():
    draw = np.random.default_rng(3)
    steps = np.unique(np.rint(np.geomspace(10, 100_000, 40)).astype(int))
    walks = np.cumsum(draw.standard_normal((8, 100_000)), axis=1)[:, steps - 1]
    walk, drift = ensemble_growth(steps, walks, 20.0), ensemble_growth(steps, walks + 0.2 * steps, 20.0)
    assert abs(walk.fit.slope - 0.5) < walk.fit.interval < 0.3
    assert ensemble_growth(steps, np.where(steps < 20, 1e3, walks), 20.0).fit[:3] == pytest.approx(walk.fit[:3])
    ensembles = np.cumsum(draw.standard_normal((60, 24, 1000)), axis=2)[..., 99::100]
    fits = [ensemble_growth(np.arange(100, 1001, 100), ensemble, 100.0).fit for ensemble in ensembles]
    assert sum(abs(fit.slope - 0.5) < fit.interval for fit in fits) >= 50  # of 60, at 95 %
    assert drift.fit.slope - drift.fit.interval > 0.65
    ends = np.array([100, 130, 200, 400, 1000])
    walks = np.cumsum(np.random.default_rng(4).standard_normal((20_000, 1000)), axis=1)
    means = np.stack([part.mean(axis=1) for part in np.split(walks, ends[:-1], axis=1)])
    variance = np.mean((means[1:] - means[0]) ** 2, axis=1)
    assert np.isnan(elapsed_steps(ends)[0])
    assert variance == pytest.approx(elapsed_steps(ends)[1:], rel=0.05)
    assert abs(variance[0] / ends[1] - 1.0) > 0.5  # the control: counted from the start


@pytest.mark.parametrize("name", ["stormer-verlet", "midpoint", "strang", "cayley"])
def test_the_mean_of_a_window_is_known_far_better_than_the_energy_has_digits(name):
    """Rounded to one double, the level of the modified energy would put 3.5e-17 of |E| into every window."""
    case, method = symtop.scene("spheroid"), symtop.integrator(name)
    levels = []
    for member in members(case, 6):
        h, solver = member.nutation_period / 1000.37, chart_of(method)[1]
        par, rule, state = solver.setup(member.top, member.start, h)
        result = solver.loop(par, rule, state, h, scattered(0, 5000))
        level = gauge_of(member, method, h)(result.states, result.momenta)["modified_energy"].mean()
        levels.append(level / member.energy_grain)  # relative to |E|, whose rounding it is
    assert np.sqrt(np.mean(np.square(levels))) < 1.2e-17


@pytest.mark.parametrize("bend", [0.0, 3e-9])
def test_a_horizon_is_predicted_from_a_tenth_of_it(bend):
    t = np.linspace(0.0, 10_000.0, 20_001)
    error = 2e-6 + 1e-6 * t + bend * t * t + 1e-6 * np.sin(5.3 * t)
    short, tolerance = t < 1000.0, abs(float(error[-1])) * 0.8
    true = lost_at(t, error, tolerance)
    assert horizon(t[short], error[short], tolerance).time == pytest.approx(true, rel=0.02)
    assert horizon(t[short], -error[short], tolerance).time == pytest.approx(true, rel=0.02)


def test_a_horizon_is_the_first_crossing_and_a_phase_that_is_not_lost_has_none():
    t = np.linspace(0.0, 100.0, 5001)
    assert 25.0 < lost_at(t, 1e-3 * t + np.exp(-(((t - 30.0) / 3.0) ** 2)), 0.5) < 30.0
    t = np.linspace(0.0, 1000.0, 4001)
    assert horizon(t, 1e-6 * t - 1e-11 * t * t, 1e-2).time == pytest.approx(1.127e4, rel=1e-3)  # before it comes back
    assert np.isnan(lost_at(t, -1e-3 * t, 2.0)) != np.isnan(lost_at(t, -1e-3 * t, 0.5))
    error = 1e-6 * np.sin(5.3 * TIME)
    assert horizon(TIME, 1e-6 * TIME + error, 1e-2).constant == 0.0  # as an oscillation leaves it
    assert np.isnan(lost_at(TIME, error, 1e-2))
    assert horizon(TIME, error, 1e-2).time > 1e3 * TIME[-1]


@pytest.mark.parametrize("name", ["spheroid", "goldstein", "cusp", "fast", "hairer-lubich-wanner"])
def test_the_truth_is_never_late_and_a_shift_is_measured(name):
    case = symtop.scene(name)
    exact = symtop.ClosedForm(case.top, case.start)
    times = np.linspace(0.0, 300.7 * case.nutation_period, 3001)
    motion = exact(times)
    assert np.max(np.abs(nutation_phase(case, times, motion.theta, motion.theta_dot))) < 1e-9
    ahead, expected = exact(times * (1.0 + 1e-4)), 2.0 * np.pi * 1e-4 * times / case.nutation_period
    assert nutation_phase(case, times, ahead.theta, ahead.theta_dot) == pytest.approx(expected, abs=1e-9)


def test_a_steady_precession_and_a_failed_sample_have_no_phase():
    steady, spheroid = symtop.scene("steady"), symtop.scene("spheroid")
    times = np.linspace(0.0, 9.0, 101)
    for case, phased in ((steady, 0), (spheroid, 60)):
        motion = symtop.ClosedForm(case.top, case.start)(times)
        phase = nutation_phase(case, times, np.where(np.arange(101) < 60, motion.theta, np.nan), motion.theta_dot)
        assert np.isfinite(phase).sum() == phased
        assert not np.isfinite(phase[60:]).any()


def test_laws_of_growth_of_a_symplectic_method_and_of_runge_kutta():
    case = symtop.scene("spheroid")
    period = case.nutation_period
    step, loose = {"step_size": period / 60.37}, {"tolerance": 1e-8}
    for name, control, energy, phase in (
        ("stormer-verlet", step, 0.0, 1.0), ("strang", step, 0.0, 1.0), ("rk45-compiled", loose, 1.0, 2.0),
        ("rk4", step, 1.0, 2.0),  # a wrong frequency rules for the first 75 nutations, energy then
    ):  # fmt: skip
        result = history(case, symtop.integrator(name), horizon=6000.0 * period, samples=3001, **control)
        assert float(result["energy_exponent"]) == pytest.approx(energy, abs=0.1), name
        assert float(result["phase_exponent"]) == pytest.approx(phase, abs=0.2), name
        assert float(result["phase_exponent_interval"]) < 0.2


@pytest.mark.parametrize("name", ["gauss-8", "kahan-li-6", "rk4"])
def test_a_lost_phase_is_predicted(name):
    result = phase_loss(symtop.scene("spheroid"), symtop.integrator(name), short=100.0, target=250.0)
    assert float(result["measured"]) > 150.0
    assert float(result["ratio"]) == pytest.approx(1.0, abs=0.02)
    assert float(result["ratio"] * result["measured"]) == pytest.approx(float(result["predicted"]), rel=1e-12)
    assert name != "rk4" or float(result["evaluations"] / result["steps"]) == pytest.approx(4.0, rel=1e-3)


@pytest.mark.parametrize("name", ["stormer-verlet", "midpoint", "strang", "cayley"])
def test_a_modified_energy_oscillates_with_the_fourth_power_of_the_step(name):
    case = symtop.scene("spheroid")
    chart, solver = chart_of(symtop.integrator(name))
    plain, modified, residuals = [], [], []
    for steps in (100.37, 200.37):
        h = case.nutation_period / steps
        par, rule, state = solver.setup(case.top, case.start, h)
        states = solver.loop(par, rule, state, h, scattered(0, 4000, 2000)).states
        values = shadow.modified_energy(case, name, chart, states, h)
        section = shadow.section(chart, states)
        plain.append(np.ptp(shadow.energy(case, chart, states)))
        modified.append(np.ptp(values))
        residuals.append(np.ptp(shadow.oscillation(*section, values)(*section, values)))
    assert plain[0] / plain[1] == pytest.approx(4.0, rel=0.1)  # the control: H itself, of second order
    if name == "cayley":
        assert max(modified) < 1e-12
    else:
        assert modified[0] / modified[1] == pytest.approx(16.0, rel=0.1)
    assert max(residuals) < 1e-12
