"""Outcome maps against single runs, and facts against maps whose content is known."""

import dataclasses
import math

import numpy as np
import pytest
import xarray as xr
from symtop_studies.stability import atlas, facts, mechanisms, outcome_maps, study
from symtop_studies.stability.many_verdicts import JUDGED, VERDICTS
from symtop_studies.stability.measures import family_limits, map_table, sampling_table
from symtop_studies.stability.outcome_maps import NOT_RUN, family, outcome_map, row_plan, spin_unit, with_spin

import symtop
from symtop.core import netcdf
from symtop.measure import datasets
from symtop.measure.verdicts import judgement
from symtop.methods.framework.plan import OUTCOMES
from symtop.methods.framework.registry import integrator
from symtop.model.scenes import closed_form, scene
from symtop.model.top import flat
from symtop.runner.study import Case
from tests.templates import checked_page

STEPS = [0.011, 0.053, 0.17, 0.31, 0.83]


@pytest.mark.parametrize("name", ["midpoint", "stormer-verlet", "strang", "gauss-4", "rk4"])
def test_a_map_says_what_single_runs_say(name):
    """The same runs through `simulate`, the reference and `judgement`, sampled more densely."""
    runs = outcome_map("cusp", [0.3, 1.0, 8.0], integrator(name), STEPS, 12.0)
    for place, ratio in enumerate((0.3, 1.0, 8.0)):
        spun = with_spin(scene("cusp"), ratio)
        for column, value in enumerate(STEPS):
            horizon = math.ceil(12.0 / value) * value * spun.nutation_period
            run = symtop.simulate(spun, name, step_size=value * spun.nutation_period, horizon=horizon, samples=241,
                                  observe="axis", guard=False)  # fmt: skip
            error, mapped = symtop.errors(run)["axis"].values, VERDICTS[runs.verdict[place, column]]
            single = judgement(spun, run, error).verdict
            assert (mapped == "accurate") == (single == "accurate"), (ratio, value, mapped, single)
            if run.attrs["outcome"] != "ok":
                assert mapped == run.attrs["outcome"]
                assert math.isnan(runs.axis_error[place, column])
            else:
                assert runs.axis_error[place, column] <= 1.0001 * error.max()
                assert runs.axis_error[place, column] >= 0.3 * error.max()


def column_groups(plan, n, alone=()):
    """The settings of each call of a map of n scenes, from the last to the first."""
    pieces, end = [], len(plan.settings)
    while end:
        first = outcome_maps.group_below(plan, end, n, alone)
        pieces.append(slice(first, end))
        end = first
    return pieces


@pytest.mark.parametrize("name", ["strang", "stormer-verlet", "midpoint"])
def test_columns_that_are_run_together_have_the_bits_of_runs_one_by_one(in_lanes, name, monkeypatch):
    """Runs of few steps, which show every step, and runs that fail among them."""
    method, spins, steps = integrator(name), np.geomspace(0.1, 30.0, 7).tolist(), [*STEPS, 2.0]
    plan, tops = row_plan(method, steps, 2.0), [family("cusp")(spin) for spin in spins]
    expected, chart = outcome_map("cusp", spins, method, steps, 2.0), method.chart_for("axis")
    singles = [outcome_maps.one_by_one(plan, chart, scene_) for scene_ in tops]
    numbers = np.array([flat(scene_.top, scene_.start) for scene_ in tops])
    periods = np.array([scene_.nutation_period for scene_ in tops])
    for columns in column_groups(plan, len(tops)):
        result = outcome_maps.together(plan, method.solvers[chart], columns, numbers, periods)
        for single, part in zip(singles, zip(result.states, result.momenta, result.outcome, strict=True), strict=True):
            for values, batch in zip(single, part, strict=True):
                row = values[0, columns][:, : result.states.shape[2]] if batch.ndim > 1 else values[0, columns]
                np.testing.assert_array_equal(row, batch)
    monkeypatch.setattr(outcome_maps, "MOST", plan.phases.size)  # other columns together
    assert len(column_groups(plan, len(tops))) == len(steps)
    for values, second in zip(expected, outcome_map("cusp", spins, method, steps, 2.0), strict=True):
        np.testing.assert_array_equal(values, second)


SETTLING = {"strang": np.geomspace(0.01, 2.0, 40), "gauss-4": np.geomspace(0.02, 2.0, 30),
            "stormer-verlet": np.geomspace(0.01, 0.5, 30), "rk45-compiled": np.geomspace(1e-9, 0.1, 30)}  # fmt: skip


@pytest.mark.parametrize("name", SETTLING)
def test_what_is_not_run_would_have_been_accurate(name):
    """The same map run as a whole: equal cell by cell, with every top run at the settings that check it."""
    spins, steps = np.geomspace(0.1, 30.0, 40).tolist(), SETTLING[name].tolist()
    part, full = (outcome_map("cusp", spins, integrator(name), steps, 10.0, checks) for checks in ([], None))
    np.testing.assert_array_equal(part.verdict, full.verdict)
    np.testing.assert_array_equal(part.axis_error[part.made & (part.verdict == 0)],
                                  full.axis_error[part.made & (part.verdict == 0)])  # fmt: skip
    assert full.made.all()
    assert 0.05 < np.mean(~part.made) < 0.9
    assert part.made[:, [0, -1]].all()
    assert part.checks > 0
    assert part.refuted == 0
    assert np.isnan(part.axis_error[~part.made]).all()
    factor = 10.0 if name == "rk45-compiled" else 2.0
    for row, mask in enumerate(part.made):  # from the longest step that is left out, accurate over a factor above
        if not mask.all():
            last = np.flatnonzero(~mask)[-1]
            window = (SETTLING[name] > steps[last]) & (SETTLING[name] <= factor * steps[last])
            assert (full.verdict[row, window] == 0).all()


def test_a_top_that_had_settled_and_is_not_accurate_is_run_at_every_setting(monkeypatch):
    """The verdicts of one spin at the two shortest steps are turned; the others are left as they are."""
    steps, spins = np.geomspace(0.01, 0.5, 30).tolist(), [0.3, 3.0, 8.0]
    result = outcome_map("cusp", [3.0], integrator("gauss-4"), (1e-3 * 1.3 ** np.arange(20)).tolist(), 2.0, [])
    assert np.flatnonzero(result.made[0]).tolist() == [0, 5, 10, 14, 16, 17, 18, 19]  # four, and those that check them
    before, run = outcome_map("cusp", spins, integrator("gauss-4"), steps, 10.0, []), outcome_maps._Descent._run

    def run_and_turn(self, rows, columns):
        run(self, rows, columns)
        self.judged.verdict[1, :2] = VERDICTS.index("drifting")

    monkeypatch.setattr(outcome_maps._Descent, "_run", run_and_turn)
    after = outcome_map("cusp", spins, integrator("gauss-4"), steps, 10.0, [])
    assert (before.refuted, after.refuted) == (0, 1)
    assert not before.made[1].all()
    assert after.made[1].all()
    np.testing.assert_array_equal(after.made[[0, 2]], before.made[[0, 2]])
    assert (after.verdict[1] == VERDICTS.index("drifting")).sum() == 2


def test_rows_share_phases_and_errors_are_followed_where_they_are_asked_for():
    """A column that is not followed has the same verdicts, and an error that is too large where the run is wrong."""
    spins, method = [0.3, 1.0, 8.0], integrator("strang")
    full, single = (outcome_map("cusp", spins, method, STEPS, 12.0, followed) for followed in (None, [3]))
    np.testing.assert_array_equal(full.verdict, single.verdict)
    np.testing.assert_array_equal(full.axis_error[:, 3], single.axis_error[:, 3])
    np.testing.assert_array_equal(full.axis_error[full.verdict == 0], single.axis_error[full.verdict == 0])
    assert (single.axis_error < full.axis_error).any()
    runs = row_plan(integrator("strang"), [0.01, 0.25, 2.0], 12.0)
    assert [marks[-1] for marks in runs.marks] == [1200, 48, 6]
    assert np.isnan(runs.phases[2]).sum() == 49 - 7
    assert np.max(np.diff(np.sort(np.mod(runs.phases[0], 1.0)))) < 0.125
    assert [piece.stop - piece.start for piece in column_groups(runs, 1)] == [1, 1, 1]  # too far apart
    plan = row_plan(integrator("strang"), [0.01, 0.0105, 0.1, 0.105, 0.25, 1.9, 1.91], 12.0)
    assert [piece.stop - piece.start for piece in column_groups(plan, 1)] == [2, 1, 2, 2]
    assert [piece.stop - piece.start for piece in column_groups(plan, 1, alone={1, 2})] == [2, 1, 1, 1, 1, 1]


def test_the_families_are_what_they_say_and_limits_end_at_verlets_and_rk4s():
    for ratio in (0.1, 1.0, 30.0):
        case = with_spin(scene("cusp"), ratio)
        assert case.start.spin * case.top.I3 / (2.0 * math.sqrt(case.top.I1 * case.top.mgl)) == pytest.approx(ratio)
        assert case.start.theta == scene("cusp").start.theta
    case = symtop.Scene("free", symtop.SymmetricTop(1.0, 1.0, 0.0), symtop.Angles(theta=1.0, psi_dot=2.0), 1.0)
    assert spin_unit(case) == 1.0
    assert closed_form(family("grazing")(1e-3)).theta_range[0] == pytest.approx(1.1e-3, rel=0.05)
    # A fast top's nutation is harmonic: h omega = 2 is 1/pi of a nutation, 2 sqrt 2 of one for rk4.
    limit, third = family_limits("cusp", integrator("stormer-verlet"), 30.0, 2.0)
    assert limit == pytest.approx(1.0 / math.pi, rel=1e-3)
    assert third == pytest.approx(math.sqrt(3.0) / (2.0 * math.pi), rel=1e-3)
    settings = {"parameters": [30.0], "ladder": [0.1, 2.0], "periods": 1.0, "limits": [30.0]}
    table = map_table("cusp", integrator("stormer-verlet"), settings)
    assert (table["linear_limit"].item(), table["third_turn"].item()) == (limit, third)
    assert math.isnan(family_limits("cusp", integrator("midpoint"), 1.5, 2.0)[0])
    third = family_limits("cusp", integrator("gauss-2"), 30.0, 2.0)[1]
    assert third == pytest.approx(math.sqrt(3.0) / math.pi, rel=1e-2)  # 2 atan(h omega/2), as the midpoint rule has


@pytest.mark.parametrize("name", ["gauss-2", "gauss-4", "gauss-12"])
def test_gauss_methods_go_on_beyond_the_limit_of_their_sweeps(name):
    """Up to two nutation periods a step, h omega = 12.6, but for slow tops that swing widely."""
    for spins, longest in (([1.0, 8.0, 30.0], 2.0), ([0.3, 0.6], 0.83)):
        runs = outcome_map("cusp", spins, integrator(name), np.geomspace(0.11, longest, 5).tolist(), 12.0)
        assert {VERDICTS[k] for k in np.unique(runs.verdict)} <= set(JUDGED)


def hand_made(words, control=(0.01, 0.1, 1.0), parameter=(0.3, 0.6, 5.0, 10.0), knob="step_size", scene="cusp"):
    """A dataset with one integrator's map, from variants of words."""
    outcome = np.array([[VERDICTS.index(word) for word in line] for line in words], dtype=np.uint8)
    values = {"parameter_value": ("parameter", np.asarray(parameter, float)),
              "control": ("setting", np.asarray(control, float)), "knob_name": knob}  # fmt: skip
    data = xr.Dataset(values | {"outcome": (("parameter", "setting"), outcome), "checks": 0.0, "refuted": 0.0})
    return datasets.combine([(Case(scene, "midpoint"), data)])


A, B, L = "accurate", "bounded_but_wrong", "left_chart"


def failure_step(*shares, starts=20, word="drifting"):
    """From which step on a map fails of which these shares of the starts do, step by step."""
    columns = [[word] * round(share * starts) + [A] * (starts - round(share * starts)) for share in shares]
    control, parameter = np.geomspace(0.01, 1.0, len(shares)), np.geomspace(0.1, 30.0, starts)
    return atlas.maps(hand_made(np.array(columns).T.tolist(), control, parameter), "cusp")["midpoint"].failure.setting


def test_thresholds_hold_at_every_larger_step_and_reach_and_failures_are_read_off():
    data = hand_made([[A, B, L, L, L], [A, A, L, L, L], [A, A, L, L, L], [A, A, B, B, B]], (0.01, 0.1, 1.0, 1.5, 2.0))
    result = atlas.maps(data, "cusp")["midpoint"]
    assert (result.usual_reach, result.failure) == ({"fast": 0.1, "slow": 0.01}, (1.0, "left_chart"))
    assert (result.accurate, result.early, result.silent) == (7 / 20, 9 / 20, 4 / 13)
    assert math.isnan(atlas.maps(hand_made([[A, A, A]] * 4), "cusp")["midpoint"].silent)  # no run is wrong
    result = atlas.maps(hand_made([[A, A, "wrong"]] * 4), "cusp")["midpoint"]  # inaccurate, said by nobody, no failure
    assert (result.accurate, result.early, result.silent, math.isnan(result.failure.setting)) == (2 / 3, 0.0, 1.0, True)
    row = facts.tables(data)["atlas"].iloc[0]
    assert (row["accurate up to, fast tops"], row["fails from"]) == (0.1, 1.0)
    assert (row["fails mostly by"], row["accurate (%)"]) == ("ended early: left chart", pytest.approx(35.0))
    # Five steps from 0.01 to 1: 0.01, 0.032, 0.1, 0.32, 1.
    assert failure_step(0.0, 0.9, 0.5, 0.7, 1.0) == pytest.approx(10.0**-1.5)
    assert failure_step(0.7, 0.4, 0.6, 0.7, 1.0) == pytest.approx(0.1)
    for shares in ((0.05, 0.0, 0.0), (0.6, 0.0, 0.2), (0.0, 0.1, 0.2, 0.4, 0.6), (0.0, 0.0, 0.0)):
        assert math.isnan(failure_step(*shares))


def test_bytes_stay_bytes_in_a_combined_dataset(tmp_path):
    sizes = {"strang": {"parameters": [1e-3, 0.1], "ladder": [0.01, 0.048]},
             "midpoint": {"parameters": [1e-3, 0.1, 0.2], "ladder": [0.01, 0.05, 0.1]}}  # fmt: skip
    tables = [(Case("grazing", name), map_table("grazing", integrator(name), grid | {"periods": 1.0, "shown": 0.04}))
              for name, grid in sizes.items()]  # fmt: skip
    data = netcdf.read(netcdf.write(datasets.combine(tables), tmp_path / "maps.nc"))
    assert data["outcome"].dtype == np.uint8
    assert data["shown_knob"].values.tolist() == [[0.048, 0.05]]
    assert (data["outcome"].sel(variant="strang").values[0, 2] == NOT_RUN).all()
    shapes = {name: entry.outcome.shape for name, entry in atlas.maps(data, "grazing").items()}
    assert shapes == {"strang": (2, 2), "midpoint": (3, 3)}


def spins(**variants):
    """Maps over three slow and three fast tops, at three settings, by variant."""
    cells = []
    for name, (control, lines) in variants.items():
        data = hand_made(lines, parameter=(0.2, 0.5, 0.8, 4.0, 8.0, 16.0), knob=control)
        cells.append((Case("cusp", f"{name}[axis]"), data.sel(scene="cusp", variant="midpoint", drop=True)))
    return datasets.combine(cells)


SLOW_FINER = [[A, L, L]] * 3 + [[A, A, L]] * 3


def test_a_pole_that_halves_the_reach_is_told_and_variants_that_reach_equally_far_are_all_named():
    gaps = (1e-6, 1e-5, 1e-4, 1e-2, 0.1)
    data = hand_made([[L, L, L], [L, L, L], [A, A, L], [A, L, L], [A, A, L]], parameter=gaps, scene="grazing")
    assert atlas.halved_by_pole(atlas.maps(data, "grazing")["midpoint"]) is True
    data = hand_made([[L, L, L], *[[A, A, L]] * 4], parameter=gaps, scene="grazing")
    assert atlas.halved_by_pole(atlas.maps(data, "grazing")["midpoint"]) is False
    data = spins(rk4=("step_size", SLOW_FINER), strang=("step_size", SLOW_FINER), rk45=("tolerance", SLOW_FINER))
    answers = facts.atlas_facts(data, "cusp")
    assert (answers["slow_shorter"], answers["stepped"]) == (2, 2)
    data = spins(rk4=("step_size", SLOW_FINER), strang=("step_size", SLOW_FINER), cayley=("step_size", [[A, B, B]] * 6),
                 none=("step_size", [[L, L, L]] * 3 + [[A, L, L]] * 3))  # fmt: skip
    answers = facts.atlas_facts(data, "cusp")
    assert [answers[name] for name in ("slow_none", "slow_shorter", "silent")] == [1, 3, 0.0]  # of 0, 0, 1 and 0
    assert (answers["fast_variant"], answers["slow_variant"].count("`")) == ("`rk4[axis]` and `strang[axis]`", 6)
    assert "fast_reach" not in facts.atlas_facts(hand_made([[A, L, L]] * 2, parameter=(0.2, 0.5)), "cusp")


def test_runs_that_outlast_the_law_are_not_counted_nor_floors_of_ratios_and_windows_count_without_a_limit():
    columns = {"early_error": (("variant", "setting"), [[1e-6, 1e-8, 1e-16]] * 2),
               "predicted_horizon": (("variant", "setting"), [[29.0, 38.2, 75.0]] * 2),
               "horizon": (("variant", "setting"), [[28.5, 38.4, 70.0], [72.0, 71.0, 70.0]]),
               "broken": (("variant", "setting"), np.zeros((2, 3)))}  # fmt: skip
    part = xr.Dataset(columns, coords={"variant": ["rk4[axis]", "gauss-4[axis]"]})
    assert mechanisms.outlasting(part) == ["gauss-4[axis]"]
    assert facts.separatrix_facts(part)["outlasting"] == "`gauss-4[axis]`"
    assert mechanisms.misses(part) == pytest.approx([0.25, 0.1])  # 1/λ = 2 s
    answers = facts.separatrix_facts(part)
    assert (answers["law_runs"], answers["law_early"]) == (2, 0)
    part["horizon"][0, 1] = part["horizon"][1, 1] = math.nan
    part["broken"][0, 1] = part["broken"][1, 1] = 1.0  # to the second the law does not apply
    assert mechanisms.misses(part) == pytest.approx([0.25])
    answers = facts.separatrix_facts(part)
    assert (answers["law_runs"], answers["law_early"]) == (1, 1)
    columns = {"limit_phase": ("variant", [math.nan, 5.9, 2.0, math.nan]),
               "window_start": ("variant", [6.28, 3.14, math.nan, math.nan])}  # fmt: skip
    names = ["srkn-11-6[axis]", "strang[axis]", "stormer-verlet[angles]", "cayley[axis]"]
    expected = dict(zip(names, (6.28, 3.14, 2.0), strict=False))
    assert mechanisms.limits(xr.Dataset(columns, coords={"variant": names})) == expected
    columns = {"energy_once": ("variant", [0.0, 5e-9, 2e-5, 1e-16]),
               "energy_every": ("variant", [4.2e-8, 2.5e-4, 3e-5, 1e-15])}  # fmt: skip
    part = xr.Dataset(columns, coords={"variant": ["yoshida-4", "stormer-verlet", "rkmk-se3-2", "gauss-4"]})
    hidden, ratios = mechanisms.sampled(part)
    assert (hidden, ratios) == (["yoshida-4"], pytest.approx({"stormer-verlet": 5e4, "rkmk-se3-2": 1.5}))
    answers = facts.sampling_facts(part)
    assert (answers["sampled"], answers["hidden"], answers["small"]) == (3, 1, 1)
    table = {"third_turn_phase": 1.0, "surviving_at_third_turn": [0.01, 0.01, 0.0195, 0.0],
             "surviving_past_third_turn": [0.031, 0.03, 0.3, 0.1]}  # fmt: skip
    part = xr.Dataset({key: ("variant", np.broadcast_to(row, 4)) for key, row in table.items()}, {"variant": names})
    assert mechanisms.resonant(part) == dict.fromkeys((names[0], names[3]), 1.0)
    steps, spins = np.array([0.1, 0.5]), {name: integrator(name).sleeps_from for name in (names[1], names[3])}
    sleeps = [[low(step) - place * 0.01 for place, step in enumerate(steps)] for low in spins.values()]
    columns = {"sleeping_step": ("rung", steps), "sleeping_threshold": (("variant", "rung"), sleeps)}
    answers = facts.sleeping_facts(xr.Dataset(columns, {"variant": [*spins]}))
    assert (answers["sleep_miss"], answers["strang_sleeps"]) == pytest.approx((0.01, sleeps[0][1]))


def test_the_midpoint_rule_is_known_by_its_nodes_and_not_by_its_name():
    settings = {"steps": 20, "periods": 1, "step_size": 0.1, "tolerances": [1e-2, 1e-8], "solver_steps": 50}
    renamed = dataclasses.replace(integrator("midpoint"), name="my-rule")
    first, second = (sampling_table("goldstein", method, settings) for method in (integrator("midpoint"), renamed))
    assert "plain_energy" in first
    xr.testing.assert_identical(first, second)
    assert "plain_energy" not in sampling_table("goldstein", integrator("trapezoidal"), settings)


def test_facts_are_those_of_the_mechanisms_and_the_page_says_them_but_none_of_what_was_not_measured(tmp_path):
    """Some quick cases of three variants in all parts of the study, with fewer settings."""
    names, cases = ("stormer-verlet[angles]", "midpoint[angles]", "strang[axis]"), []
    for case in study.cases(True):
        if case.integrator in names:
            settings = dict(case.settings)
            if case.scene == study.FAMILY:
                settings |= {key: settings[key][::4] for key in ("parameters", "ladder")}
            cases.append(dataclasses.replace(case, settings=settings))
    data = datasets.combine([(case, study.measure(case)) for case in cases])
    answers = facts.facts(data)
    assert answers.keys() >= set(facts.NAMES)
    assert {name for name in facts.NAMES if answers[name] is None} == {"cayley_sleeps", "outlasting"}
    resonances = mechanisms.resonant(data.sel(scene="steady-fast"))
    assert resonances["stormer-verlet[angles]"] == pytest.approx(math.sqrt(3.0), abs=1e-4)
    assert resonances["midpoint[angles]"] == pytest.approx(2.0 * math.sqrt(3.0), abs=1e-4)
    assert answers["limit_variant"] == "stormer-verlet[angles]"
    assert answers["limit_least"] == pytest.approx(2.0, abs=1e-6)
    assert answers["sleep_miss"] < 1e-8 < abs(answers["strang_sleeps"] - 2.0)
    assert answers["one_iteration"] > 10.0 * answers["solved"]
    assert (answers["angles"], answers["others"], answers["others_halved"]) == (2, 1, 0)
    shares = {name: entry.accurate for name, entry in atlas.maps(data, study.FAMILY).items()}
    table = facts.tables(data)["atlas"]
    assert dict(zip(table["variant"], table["accurate (%)"] / 100.0, strict=True)) == pytest.approx(shares)
    assert table["accurate (%)"].is_monotonic_decreasing
    assert f"{answers['angles_halved']} of 2 variants in Euler's angles" in checked_page("stability", data, tmp_path)
    answers = facts.facts(hand_made([[A, B, L]] * 4))
    assert (answers["settled"], answers["cells"], answers["resonant"], answers["others"]) == (0.0, 12, None, None)
    assert facts.tables(hand_made([[A, B, L]] * 4))["limits"].empty


def test_adaptive_methods_are_mapped_over_their_tolerance_to_their_budget():
    runs = outcome_map("cusp", [1.0], integrator("rk45-compiled"), [1e-10, 1e-6, 0.3], 12.0)
    assert [VERDICTS[k] for k in runs.verdict[0][:2]] == ["accurate", "accurate"]
    assert VERDICTS[runs.verdict[0][2]] != "accurate"
    assert runs.axis_error[0, 0] < 1e-6 < runs.axis_error[0, 1]
    assert (outcome_map("cusp", [0.3, 3.0], integrator("exact"), [math.nan], 12.0).verdict == 0).all()
    tolerances = np.geomspace(1e-10, 0.5, 25)[[12, 22]].tolist()
    top = family("cusp")(float(np.geomspace(0.1, 30.0, 120)[36]))
    result = outcome_maps.one_by_one(row_plan(integrator("adams[axis]"), tolerances, 10.0), "axis", top)
    assert [OUTCOMES[k] for k in result.outcome[0]] == ["ok", "out_of_budget"]
