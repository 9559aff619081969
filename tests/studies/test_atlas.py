"""Outcome maps against single runs, and the sentences against maps whose content is known."""

import dataclasses
import math

import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from symtop_studies.stability import atlas, atlas_figures, atlas_words, figures, messages, outcome_maps, words
from symtop_studies.stability.outcome_maps import NOT_RUN, family, outcome_map, row_plan, spin_unit, with_spin
from symtop_studies.stability.tables import Column, family_limits, map_table, sampling_table

import symtop
from symtop.core import netcdf
from symtop.measure.errors import errors_against
from symtop.measure.verdicts import JUDGED, VERDICTS, verdict
from symtop.methods.framework.registry import integrator, methods
from symtop.model.scenes import closed_form, scene
from symtop.model.top import flat
from symtop.report import style
from symtop.report.style import OUTCOME_COLORS
from symtop.run.reference.truth import reference
from symtop.runner import run as runner, store
from symtop.runner.study import Case

STEPS = [0.011, 0.053, 0.17, 0.31, 0.83]


@pytest.mark.parametrize("name", ["midpoint", "stormer-verlet", "strang", "gauss-4", "rk4"])
def test_a_map_says_what_single_runs_say(name):
    """The same runs through `simulate`, the reference and `verdict`, sampled more densely."""
    runs = outcome_map("cusp", [0.3, 1.0, 8.0], integrator(name), STEPS, 12.0)
    for place, ratio in enumerate((0.3, 1.0, 8.0)):
        spun = with_spin(scene("cusp"), ratio)
        for column, value in enumerate(STEPS):
            horizon = math.ceil(12.0 / value) * value * spun.nutation_period
            run = symtop.simulate(
                spun, name, step_size=value * spun.nutation_period, horizon=horizon, samples=241, observe="axis",
                guard=False,
            )  # fmt: skip
            error = errors_against(spun, run, reference(spun, run["time"].values, "closed-form"))["axis"].values
            mapped = VERDICTS[runs.verdict[place, column]]
            single = verdict(spun, run, error)
            assert (mapped == "accurate") == (single == "accurate"), (ratio, value, mapped, single)
            if run.attrs["outcome"] != "ok":
                assert mapped == run.attrs["outcome"]
                assert math.isnan(runs.axis_error[place, column])
            else:
                assert runs.axis_error[place, column] <= 1.0001 * error.max()
                assert runs.axis_error[place, column] >= 0.3 * error.max()


def together_in(plan, n, alone=()):
    """The settings of each call of a map of n scenes, from the last to the first."""
    pieces, end = [], len(plan.settings)
    while end:
        first = outcome_maps.group_below(plan, end, n, alone)
        pieces.append(slice(first, end))
        end = first
    return pieces


@pytest.mark.parametrize("name", ["strang", "stormer-verlet", "midpoint"])
def test_columns_that_are_run_together_have_the_bits_of_runs_one_by_one(name, monkeypatch):
    """Runs of few steps, which show every step, and runs that fail among them."""
    method, spins, steps = integrator(name), np.geomspace(0.1, 30.0, 7).tolist(), [*STEPS, 2.0]
    plan, tops = row_plan(method, steps, 2.0), [family("cusp")(spin) for spin in spins]
    whole, chart = outcome_map("cusp", spins, method, steps, 2.0), method.chart_for("axis")
    alone = [outcome_maps.one_by_one(plan, chart, scene_) for scene_ in tops]
    numbers = np.array([flat(scene_.top, scene_.start) for scene_ in tops])
    periods = np.array([scene_.nutation_period for scene_ in tops])
    for columns in together_in(plan, len(tops)):
        made = outcome_maps.together(plan, method.solvers[chart], columns, numbers, periods)
        for one, part in zip(alone, zip(made.states, made.momenta, made.outcome, strict=True), strict=True):
            for values, others in zip(one, part, strict=True):
                seen = values[0, columns][:, : made.states.shape[2]] if others.ndim > 1 else values[0, columns]
                np.testing.assert_array_equal(seen, others)
    monkeypatch.setattr(outcome_maps, "MOST", plan.phases.size)  # other columns together
    assert len(together_in(plan, len(tops))) == len(steps)
    for values, others in zip(whole, outcome_map("cusp", spins, method, steps, 2.0), strict=True):
        np.testing.assert_array_equal(values, others)


def test_errors_are_followed_where_they_are_asked_for():
    """A column that is not followed has the same verdicts, and an error that is too large where the run is wrong."""
    spins, method = [0.3, 1.0, 8.0], integrator("strang")
    whole, one = (outcome_map("cusp", spins, method, STEPS, 12.0, followed) for followed in (None, [3]))
    np.testing.assert_array_equal(whole.verdict, one.verdict)
    np.testing.assert_array_equal(whole.axis_error[:, 3], one.axis_error[:, 3])
    np.testing.assert_array_equal(whole.axis_error[whole.verdict == 0], one.axis_error[whole.verdict == 0])
    assert (one.axis_error <= whole.axis_error).all()
    assert (one.axis_error < whole.axis_error).any()


SETTLING = {"strang": np.geomspace(0.01, 2.0, 40), "gauss-4": np.geomspace(0.02, 2.0, 30),
            "stormer-verlet": np.geomspace(0.01, 0.5, 30), "rk45-compiled": np.geomspace(1e-9, 0.1, 30)}  # fmt: skip


@pytest.mark.parametrize("name", SETTLING)
def test_what_is_not_run_would_have_been_accurate(name):
    """The same map run as a whole: equal cell by cell, with every top run at the settings that check it."""
    spins, steps = np.geomspace(0.1, 30.0, 40).tolist(), SETTLING[name].tolist()
    some, all_of_it = (outcome_map("cusp", spins, integrator(name), steps, 10.0, chosen) for chosen in ([], None))
    np.testing.assert_array_equal(some.verdict, all_of_it.verdict)
    np.testing.assert_array_equal(some.axis_error[some.made & (some.verdict == 0)],
                                  all_of_it.axis_error[some.made & (some.verdict == 0)])  # fmt: skip
    assert all_of_it.made.all()
    assert 0.05 < np.mean(~some.made) < 0.9
    assert some.made[:, [0, -1]].all()
    assert some.checks > 0
    assert some.refuted == 0
    assert np.isnan(some.axis_error[~some.made]).all()
    factor = 10.0 if name == "rk45-compiled" else 2.0
    for row, made in enumerate(some.made):  # from the longest step that is left out, accurate over a factor above
        if not made.all():
            last = np.flatnonzero(~made)[-1]
            above = (SETTLING[name] > steps[last]) & (SETTLING[name] <= factor * steps[last])
            assert (all_of_it.verdict[row, above] == 0).all()


def test_a_top_that_had_settled_and_is_not_accurate_is_run_at_every_setting(monkeypatch):
    """The verdicts of one spin at the two shortest steps are turned; the others are left as they are."""
    steps, spins = np.geomspace(0.01, 0.5, 30).tolist(), [0.3, 3.0, 8.0]
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


def test_cells_that_were_not_run_are_pale_and_counted():
    spins, steps = [0.3, 3.0, 8.0, 20.0], np.geomspace(0.01, 0.5, 30).tolist()
    settings = {"parameters": spins, "ladder": steps, "periods": 10.0}
    data = store.combine([(Case("cusp", name), map_table("cusp", integrator(name), settings))
                          for name in ("gauss-4[axis]", "strang[axis]")])  # fmt: skip
    one = atlas.maps(data, "cusp")["gauss-4[axis]"]
    assert set(np.unique(data[Column.OUTCOME].values)) > {0, outcome_maps.SETTLED}
    assert one.made.mean() < 0.8
    assert (one.outcome[~one.made] == 0).all()
    pale = np.isclose(atlas_figures.painted(one.outcome, one.made), to_rgb(atlas_figures.PALE_GREEN)).all(axis=-1)
    assert pale.mean() == pytest.approx(1.0 - one.made.mean(), abs=0.02)
    said = atlas_words.summary(data, "cusp")[-1]
    left = sum((~each.made).sum() for each in atlas.maps(data, "cusp").values())
    assert said.startswith(f"Of the 240 cells of these maps {left / 240:.0%} were not run")
    assert said.endswith(f"{int(data[Column.CHECKS].sum())} runs of such tops check this, and none is inaccurate.")
    data[Column.REFUTED] += 1.0  # of each of the two variants
    assert atlas_words.summary(data, "cusp")[-1].endswith("check this; 2 tops failed and ran at every setting.")
    drawn = {picture.name: picture for picture in figures.pictures(data)}["atlas-cusp-steps"]
    assert atlas_figures.SETTLED["step_size"] in {text.get_text() for text in drawn.figure.legends[0].get_texts()}


def test_adaptive_methods_are_mapped_over_their_tolerance():
    runs = outcome_map("cusp", [1.0], integrator("rk45-compiled"), [1e-10, 1e-6, 0.3], 12.0)
    assert [VERDICTS[k] for k in runs.verdict[0][:2]] == ["accurate", "accurate"]
    assert VERDICTS[runs.verdict[0][2]] != "accurate"
    assert runs.axis_error[0, 0] < 1e-6 < runs.axis_error[0, 1]
    exact = outcome_map("cusp", [0.3, 3.0], integrator("exact"), [math.nan], 12.0)
    assert (exact.verdict == 0).all()


def test_rows_share_phases_and_are_not_commensurate_with_the_nutation():
    runs = row_plan(integrator("strang"), [0.01, 0.25, 2.0], 12.0)
    assert [marks[-1] for marks in runs.marks] == [1200, 48, 6]
    assert np.isnan(runs.phases[2]).sum() == 49 - 7
    phases = np.sort(np.mod(runs.phases[0], 1.0))
    assert np.max(np.diff(phases)) < 0.125
    assert [piece.stop - piece.start for piece in together_in(runs, 1)] == [1, 1, 1]  # too far apart
    near = row_plan(integrator("strang"), [0.01, 0.0105, 0.1, 0.105, 0.25, 1.9, 1.91], 12.0)
    assert [piece.stop - piece.start for piece in together_in(near, 1)] == [2, 1, 2, 2]
    assert [piece.stop - piece.start for piece in together_in(near, 1, alone={1, 2})] == [2, 1, 1, 1, 1, 1]


def test_the_families_are_what_they_say():
    for ratio in (0.1, 1.0, 30.0):
        spun = with_spin(scene("cusp"), ratio)
        assert spun.start.spin * spun.top.I3 / (2.0 * math.sqrt(spun.top.I1 * spun.top.mgl)) == pytest.approx(ratio)
        assert spun.start.theta == scene("cusp").start.theta
    free = symtop.Scene("free", symtop.SymmetricTop(1.0, 1.0, 0.0), symtop.Angles(theta=1.0, psi_dot=2.0), 1.0)
    assert spin_unit(free) == 1.0
    assert closed_form(family("grazing")(1e-3)).theta_range[0] == pytest.approx(1.1e-3, rel=0.05)


def test_limits_over_a_family_end_at_verlets_and_rk4s():
    """A fast top's nutation is harmonic: h omega = 2 is 1/pi of a nutation, 2 sqrt 2 of one for rk4."""
    limit, third = family_limits("cusp", integrator("stormer-verlet"), 30.0, 2.0)
    assert limit == pytest.approx(1.0 / math.pi, rel=1e-3)
    assert third == pytest.approx(math.sqrt(3.0) / (2.0 * math.pi), rel=1e-3)
    for name in ("midpoint", "gauss-2", "gauss-4", "gauss-12"):
        for spin in (1.5, 30.0):
            assert math.isnan(family_limits("cusp", integrator(name), spin, 2.0)[0])
    third = family_limits("cusp", integrator("gauss-2"), 30.0, 2.0)[1]
    assert third == pytest.approx(math.sqrt(3.0) / math.pi, rel=1e-2)  # 2 atan(h omega/2), as the midpoint rule has


@pytest.mark.parametrize("name", ["gauss-2", "gauss-4", "gauss-12"])
def test_gauss_methods_go_on_beyond_the_limit_of_their_sweeps(name):
    """Up to two nutation periods a step, h omega = 12.6, but for slow tops that swing widely."""
    for spins, longest in (([1.0, 8.0, 30.0], 2.0), ([0.3, 0.6], 0.83)):
        runs = outcome_map("cusp", spins, integrator(name), np.geomspace(0.11, longest, 5).tolist(), 12.0)
        assert {VERDICTS[k] for k in np.unique(runs.verdict)} <= set(JUDGED)


def mechanism(limit, third):
    """A dataset of `steady-fast` with one method of these limits."""
    names = {Column.LIMIT_PHASE: limit, Column.THIRD_TURN_PHASE: third, Column.SOUGHT_PHASE: 10.0}
    return store.combine([(Case("steady-fast", "midpoint"), xr.Dataset(names))])


def test_a_method_without_a_linear_limit_is_said_to_have_none():
    free = mechanism(math.nan, 3.4641)
    said = words.limits(free.sel(scene="steady-fast"))
    assert "first grow, or it is lost, at none of 300 steps up to h omega = 10 with midpoint." in said
    assert words.tables(free)[-1].rows[0][1] == "none of 300 steps up to 10"
    bound = mechanism(1.9999, 1.7321)
    assert "none of" not in words.limits(bound.sel(scene="steady-fast"))
    assert words.tables(bound)[-1].rows[0][1] == "1.9999"
    narrow = free.assign({Column.WINDOW_START: free[Column.LIMIT_PHASE].fillna(6.28),
                          Column.WINDOW_END: free[Column.LIMIT_PHASE].fillna(6.287)})  # fmt: skip
    said = words.limits(narrow.sel(scene="steady-fast"))
    assert "only between steps tried, in windows up to 0.007 wide from 6.28 on, with midpoint" in said
    assert "none of" not in said
    assert words.tables(narrow)[-1].rows[0][1:3] == ["none of 300 steps up to 10", "6.280"]
    both = narrow.assign({Column.LIMIT_PHASE: narrow[Column.WINDOW_START] + 2.0})  # strang is of this kind
    assert "first grow, or it is lost, at h omega at 6.28 (midpoint)" in words.limits(both.sel(scene="steady-fast"))
    assert words.tables(both)[-1].rows[0][1:3] == ["8.2800", "6.280"]
    unknown = mechanism(math.nan, math.nan)  # not symmetric: nothing is claimed
    assert words.limits(unknown.sel(scene="steady-fast")) == ""


def test_a_resonance_is_said_to_lose_some_displacement_and_not_every_larger_one():
    """What is measured is the displacement up to which all stay: the next one may be 5 % larger."""
    for at, said in ((0.006, True), (0.0195, False)):
        data = mechanism(math.nan, 3.4641)
        for name, value in ((Column.SURVIVING_AT_THIRD_TURN, at), (Column.SURVIVING_PAST_THIRD_TURN, 0.2)):
            data[name] = data[Column.THIRD_TURN_PHASE] * 0.0 + value
        part = data.sel(scene="steady-fast")
        assert (
            "with 1 of 1 variant a top is lost at some displacement of at most 0.02 rad" in words.resonances(part)
        ) is (said)
        assert ("lose a top at some displacement of at most 0.02 rad" in messages.of_mechanism("resonances", part)) is (
            said
        )


def test_the_caption_of_a_page_names_the_methods_without_a_limit():
    for limit, said in ((math.nan, True), (0.3, False)):
        data = hand_made([[A, B, B]] * 4)
        for variable, value in ((Column.LINEAR_LIMIT, limit), (Column.THIRD_TURN, 0.55)):
            data[variable] = (("scene", "variant", "curve"), [[[value, value]]])
        caption = atlas_words.caption(data, "cusp", ["midpoint"])
        text = "With midpoint small nutations grow at no spin at any of 48 steps tried up to 1 nutation periods"
        assert (text in caption) is said
        (table,) = atlas_words.atlas_tables(data, "cusp")
        assert table.rows[0][-1] == ("none" if said else "0.3")


def hand_made(
    words, control=(0.01, 0.1, 1.0), parameter=(0.3, 0.6, 5.0, 10.0), knob_name="step_size", scene_name="cusp"
):
    """A dataset with one integrator's map, from variants of words."""
    outcome = np.array([[VERDICTS.index(word) for word in line] for line in words], dtype=np.uint8)
    data = xr.Dataset(
        {
            "outcome": (("parameter", "setting"), outcome),
            "parameter_value": ("parameter", np.asarray(parameter, float)),
            "control": ("setting", np.asarray(control, float)),
            "knob_name": knob_name,
        }
    )
    return store.combine([(Case(scene_name, "midpoint"), data)])


A, B, L = "accurate", "bounded_but_wrong", "left_chart"


def test_advice_reads_reach_and_failures_off_the_map():
    data = hand_made([[A, B, L, L, L], [A, B, L, L, L], [A, A, L, L, L], [A, A, B, B, B]], (0.01, 0.1, 1.0, 1.5, 2.0))
    line = atlas_words.advice(data, "cusp")["midpoint"]
    assert line.use == "with steps up to 0.1 nutation periods on fast tops and up to 0.01 on slow tops"
    assert (
        line.fails
        == "it fails at h = 1 nutation periods and every larger step in at least 75% of 4 starts (of these runs 100% "
        "leave their chart). It is wrong with bounded energy in 25% of its map"
    )
    assert line.sentence.startswith("Use it with steps up to 0.1")


def test_advice_on_a_method_that_is_never_right_or_always():
    never = atlas_words.advice(hand_made([[B, B, L]] * 4), "cusp")["midpoint"]
    assert never.use == "with steps below 0.01 nutation periods only"
    always = atlas_words.advice(hand_made([[A, A, A]] * 4), "cusp")["midpoint"]
    assert always.fails == "it fails nowhere on the map"
    assert list(atlas_words.advice(hand_made([[A, A, A]] * 4), "cusp")) == ["midpoint"]


D = "drifting"


def failing(*shares, starts=20, word=D):
    """A map of which these shares of the starts fail, step by step."""
    columns = [[word] * round(share * starts) + [A] * (starts - round(share * starts)) for share in shares]
    data = hand_made(
        np.array(columns).T.tolist(), np.geomspace(0.01, 1.0, len(shares)), np.geomspace(0.1, 30.0, starts)
    )
    return atlas_words.advice(data, "cusp")["midpoint"].fails


def test_one_start_that_fails_at_one_step_is_no_threshold():
    """A share of one in twenty at one step, and none at the next: what was once said to be "from here on"."""
    assert failing(0.05, 0.0, 0.0) == (
        "it fails in up to 5% of 20 starts (of these runs 100% change their energy by more than 1% and ever more)"
    )
    assert "h = " not in failing(0.6, 0.0, 0.2)
    assert "up to 60% of 20 starts, but not in half of them at every larger step" in failing(0.6, 0.0, 0.2)


def test_a_threshold_holds_at_every_larger_step_and_says_in_how_many_starts():
    """Five steps from 0.01 to 1: 0.01, 0.032, 0.1, 0.32, 1."""
    said = failing(0.0, 0.9, 0.6, 0.7, 1.0)
    assert "fails at h = 0.032 nutation periods and every larger step in at least 60% of 20 starts" in said
    assert "fails at h = 0.1 nutation periods" in failing(0.7, 0.4, 0.6, 0.7, 1.0)
    late = failing(0.0, 0.1, 0.2, 0.4, 0.6)  # of the last step alone, "every larger" says nothing
    assert "in up to 60% of 20 starts, half of them only at the largest steps of the map" in late
    assert failing(0.0, 0.0, 0.0) == "it fails nowhere on the map"


def test_the_two_charts_of_a_method_are_compared_and_one_alone_is_not():
    cells = [(Case("cusp", name), hand_made(rows).sel(scene="cusp", variant="midpoint", drop=True))
             for name, rows in (("rk4[angles]", [[A, L, L]] * 4), ("rk4[axis]", [[A, A, L]] * 4))]  # fmt: skip
    said = " ".join(atlas_words.summary(store.combine(cells), "cusp"))
    assert "matters most for rk4: accurate in 33% with rk4[angles] and 67% with rk4[axis] of the map of cusp" in said
    assert "0 of 2 variants never end a run early" in said
    every, charts = atlas_words.atlas_tables(store.combine(cells), "cusp")
    assert list(charts.rows) == [["rk4", "33%", "67%"]]
    assert [row[3:6] for row in every.rows] == [["33%", "67%", "0%"], ["67%", "33%", "0%"]]
    assert {len(row) for row in every.rows} == {len(every.header)}
    assert "The chart alone" not in " ".join(atlas_words.summary(store.combine(cells[:1]), "cusp"))


def test_rows_that_reach_less_than_the_smallest_step_are_the_least_and_are_counted():
    """On slow tops (the first two variants of a map) one of two methods is inaccurate at the smallest step already."""
    cells = [(Case("cusp", name), hand_made(rows).sel(scene="cusp", variant="midpoint", drop=True))
             for name, rows in (("rk4[axis]", [[B, B, B]] * 2 + [[A, A, B]] * 2), ("strang[axis]", [[A, A, B]] * 4),
                                ("gauss-2[axis]", [[A, B, B]] * 4))]  # fmt: skip
    said = atlas_words.summary(store.combine(cells), "cusp")[0]
    assert "from 0.01 (gauss-2[axis]) to 0.1 (rk4[axis]) on fast tops" in said
    assert "from below 0.01 (rk4[axis]) to 0.1 (strang[axis]) on slow tops" in said
    never = store.combine([(Case("cusp", "rk4[axis]"), cells[0][1].isel(parameter=[0, 0, 1, 1]))])
    assert "is from below 0.01 (rk4[axis]) on slow tops" in atlas_words.summary(never, "cusp")[0]
    without = store.combine([*cells, (Case("cusp", "rk45[axis]"), hand_made([[A, B, B]] * 4, knob_name="tolerance").sel(
        scene="cusp", variant="midpoint", drop=True))])  # fmt: skip
    assert said.endswith("in nutation periods.")
    assert atlas_words.summary(without, "cusp")[0].endswith("Not counted: 1 variant without a fixed step.")


def test_a_row_without_an_inaccurate_run_has_no_share_of_them():
    cells = [(Case("cusp", name), hand_made(rows).sel(scene="cusp", variant="midpoint", drop=True))
             for name, rows in (("rk4[axis]", [[A, B, L]] * 4), ("strang[axis]", [[A, A, A]] * 4))]  # fmt: skip
    assert math.isnan(atlas.maps(store.combine(cells), "cusp")["strang[axis]"].silent)
    assert "With the median variant 50% of inaccurate runs end" in atlas_words.summary(store.combine(cells), "cusp")[-1]
    (table,) = atlas_words.atlas_tables(store.combine(cells), "cusp")
    assert [row[5] for row in table.rows] == ["50%", ""]
    right = atlas_words.summary(store.combine(cells[1:]), "cusp")[-1]
    assert right.startswith("1 of 1 variant never end a run early")


def test_a_pole_that_spoils_is_named():
    gaps = (1e-6, 1e-5, 1e-2, 0.2)
    near = hand_made([[L, L, L], [L, L, L], [A, L, L], [A, A, L]], parameter=gaps, scene_name="grazing")
    both = xr.concat([hand_made([[A, A, A]] * 4), near], "scene")
    assert (
        "needs steps less than half as long within 0.01 rad of a pole (right next to it, smaller than any on the map)"
        in atlas_words.advice(both, "cusp")["midpoint"].fails
    )
    unspoiled = hand_made([[A, A, L]] * 4, parameter=gaps, scene_name="grazing")
    both = xr.concat([hand_made([[A, A, A]] * 4), unspoiled], "scene")
    assert "pole" not in atlas_words.advice(both, "cusp")["midpoint"].fails


def test_bytes_stay_bytes_in_a_combined_dataset(tmp_path):
    small = map_table("grazing", integrator("strang"), {"parameters": [1e-3, 0.1], "ladder": [0.01, 0.05],
                                                        "periods": 1.0, "shown": 0.01})  # fmt: skip
    large = map_table("grazing", integrator("midpoint"), {"parameters": [1e-3, 0.1, 0.2], "ladder": [0.01, 0.05, 0.1],
                                                          "periods": 1.0, "shown": 0.01})  # fmt: skip
    data = store.combine([(Case("grazing", "strang"), small), (Case("grazing", "midpoint"), large)])
    symtop_file = tmp_path / "maps.nc"
    netcdf.write(data, symtop_file)
    again = netcdf.read(symtop_file)
    assert again["outcome"].dtype == np.uint8
    assert (again["outcome"].sel(variant="strang").values[0, 2] == NOT_RUN).all()
    shapes = {name: one.outcome.shape for name, one in atlas.maps(again, "grazing").items()}
    assert shapes == {"strang": (2, 2), "midpoint": (3, 3)}


@pytest.mark.parametrize("size", ["small", "enlarged"])
def test_maps_can_be_read_without_colours(size):
    """Every outcome that is not plain has a hatch of its own, and any two colours differ in lightness or have one."""
    hatched = {}
    for index, word in enumerate(VERDICTS):
        image = atlas_figures.painted(np.full((4, 6), index, dtype=np.uint8), np.full((4, 6), True), size)
        hatched[word] = tuple(np.unique(image.reshape(-1, 3), axis=0).shape)
    plain = [word for word, shape in hatched.items() if shape[0] == 1]
    lightness = {word: 0.2126 * r + 0.7152 * g + 0.0722 * b for word in plain
                 for r, g, b in [tuple(int(OUTCOME_COLORS[word][k : k + 2], 16) / 255 for k in (1, 3, 5))]}  # fmt: skip
    for first in plain:
        for second in plain:
            assert first == second or abs(lightness[first] - lightness[second]) > 0.1, (first, second)
    assert {"left_chart", "wrong_regime", "not_converged", "drifting"} <= set(VERDICTS) - set(plain)


def two_maps():
    """A dataset of a method with steps and one with tolerances, the first accurate more often."""
    step, tolerance = hand_made([[A, A, B]] * 4), hand_made([[A, L, L]] * 4, knob_name="tolerance")
    cells = [(Case("cusp", name), one.sel(scene="cusp", variant="midpoint", drop=True))
             for name, one in (("rk4[axis]", step), ("strang[axis]", hand_made([[A, B, B]] * 4)),
                               ("rk45[axis]", tolerance))]  # fmt: skip
    return store.combine(cells)


def test_a_page_of_small_maps_shows_every_row_once_in_the_order_of_its_accurate_share():
    drawn = {picture.name: picture for picture in figures.pictures(two_maps())}
    assert list(drawn) == ["atlas-cusp-enlarged", "atlas-cusp-steps", "atlas-cusp-tolerances"]
    titles = [axis.get_title() for axis in drawn["atlas-cusp-steps"].figure.axes if axis.get_visible()]
    assert titles == ["rk4\n[axis] 67%", "strang\n[axis] 33%"]
    assert "2 variants" in drawn["atlas-cusp-steps"].caption
    (title,) = (axis.get_title() for axis in drawn["atlas-cusp-tolerances"].figure.axes if axis.get_visible())
    assert title == "rk45\n[axis] 33%"
    assert "to the right the tolerance" in drawn["atlas-cusp-tolerances"].caption


def test_the_enlarged_map_is_that_of_a_familiar_row_and_names_its_regions():
    data = two_maps()
    figure = next(figures.pictures(data)).figure
    assert figure.get_suptitle() == "rk4[axis] is accurate in 67% of the map of cusp"
    assert {text.get_text() for text in figure.axes[0].texts} == {"accurate", "bounded but wrong"}
    renamed = data.assign_coords(variant=["rk4[axis]", figures.FAMILIAR, "rk45[axis]"])
    assert next(figures.pictures(renamed)).figure.get_suptitle().startswith(figures.FAMILIAR)


def test_the_message_of_a_mechanism_follows_from_its_numbers():
    def said(once, every):
        columns = {Column.ENERGY_ONCE: ("variant", once), Column.ENERGY_EVERY: ("variant", every)}
        return messages.of_mechanism("sampling", xr.Dataset(columns, coords={"variant": ["rk4[axis]", "strang[axis]"]}))

    assert "up to 1000 times too small (rk4[axis])" in said([1e-7, 1e-6], [1e-4, 1e-6])
    assert "not seen" not in said([1e-7, 1e-6], [1e-4, 1e-6])
    assert "that of 1 method is not seen at all" in said([1e-7, 1e-16], [1e-4, 1e-6])


def test_the_message_of_the_sleeping_top_says_where_the_threshold_goes_not_how_far():
    columns = {Column.SLEEPING_THRESHOLD: (("variant", "rung"), [[2.0, 1.92], [2.01, 2.24], [2.0, 2.0]])}
    names = ["strang[axis]", "cayley[axis]", "midpoint[angles]"]
    said = messages.of_mechanism("sleeping", xr.Dataset(columns, coords={"variant": names}))
    assert "from 2 to 2.24 with cayley[axis], 1.92 with strang[axis]; 1 methods keep it" in said


def test_the_message_of_the_pole_is_that_of_the_step_drawn():
    gaps, broken = [1e-6, 1e-5, 0.2], [math.nan, math.nan, 1e-3]
    columns = {
        Column.PARAMETER: (("variant", "parameter"), [gaps, gaps]),
        Column.GRAZING_ERROR: (("variant", "parameter"), [broken, [2e-4, 2e-4, 1e-4]]),
    }
    part = xr.Dataset(columns, coords={"variant": ["stormer-verlet[angles]", "strang[axis]"]})
    said = messages.of_mechanism("pole", part)
    assert said.startswith("At one step 1 of 1 fixed-step methods in angles end early within 0.0001 rad of a pole")
    assert said.endswith("the 1 in other charts have errors that differ at most 2 times between all gaps")
    part[Column.GRAZING_ERROR][1, 2] = 4e-5  # the base is the smallest error at any gap
    assert "differ at most 5 times" in messages.of_mechanism("pole", part)


def test_the_runs_that_outlast_the_law_of_the_separatrix_are_named_and_not_counted():
    columns = {
        Column.EARLY_ERROR: (("variant", "setting"), [[1e-6, 1e-8], [1e-6, 1e-8]]),
        Column.PREDICTED_HORIZON: (("variant", "setting"), [[29.0, 38.2], [29.0, 38.2]]),
        Column.HORIZON: (("variant", "setting"), [[29.5, 38.4], [72.0, 71.0]]),
    }
    part = xr.Dataset(columns, coords={"variant": ["rk4[axis]", "gauss-4[axis]"]})
    assert words.outlasting(part) == ["gauss-4[axis]"]
    assert words.misses(part) == pytest.approx([0.5, 0.2])
    assert messages.of_mechanism("separatrix", part).endswith("to 0.35/λ in the median; 1 method lasts longer")
    assert words.horizons(part).endswith("gauss-4[axis] lasts more than 10/λ longer.")
    assert "more run" not in words.horizons(part)
    part[Column.HORIZON][0, 1] = math.nan  # it never reaches the error of which the law speaks
    assert "1 more run (rk4[axis]) never did." in words.horizons(part)
    part[Column.BROKEN] = ("variant", "setting"), [[0.0, 1.0], [0.0, 0.0]]
    assert "predicts when 1 runs reach" in words.horizons(part)
    assert "1 more run (rk4[axis]) ended before." in words.horizons(part)
    assert "; 1 method lasts longer, 1 run never got there" in messages.of_mechanism("separatrix", part)


def slope(pixels):
    """Do the dark lines of a picture rise to the right (+1), fall (-1), or neither (0)?"""
    dark = np.mean(pixels[..., :3], axis=-1)
    dark = dark < 0.5 * (dark.min() + dark.max())
    rising, falling = (np.mean(dark[3:-3, 3:-3] & np.roll(dark, (-3 * k, 3), (0, 1))[3:-3, 3:-3]) for k in (1, -1))
    return int(np.sign(rising - falling)) if abs(rising - falling) > 0.2 * max(rising, falling) else 0


@pytest.mark.parametrize("word", ["left_chart", "wrong_regime", "not_converged"])
def test_the_hatch_of_a_map_has_the_slope_of_its_swatch_in_the_legend(word):
    style.use()
    index = np.full((40, 60), VERDICTS.index(word), dtype=np.uint8)
    slopes = []
    for draw in ("map", "swatch"):
        figure = Figure(figsize=(2.0, 1.6), dpi=200, layout="none")
        axis = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        if draw == "map":
            axes = np.geomspace(0.1, 30.0, 40), np.geomspace(0.01, 1.0, 60)
            one = atlas.OutcomeMap(index, *axes, "step_size", np.full(index.shape, True))
            atlas_figures.draw_map(axis, one, "small")
        else:
            swatch = atlas_figures._handle(word)
            axis.add_patch(Rectangle((0, 0), 1, 1, fc=swatch.get_facecolor(), hatch=swatch.get_hatch(), ec="black"))
        axis.set_axis_off()
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        slopes.append(slope(np.asarray(canvas.buffer_rgba())[20:-20, 20:-20] / 255.0))
    assert slopes[0] == slopes[1]
    assert slopes[0] == {"left_chart": 1, "wrong_regime": -1, "not_converged": 0}[word]


def tolerances(*ladders):
    """Maps of methods over tolerances: accurate up to 1e-4."""
    names = ["rk45[axis]", "radau[axis]", "dop853[axis]", "lsoda[axis]"]
    cells = []
    for name, ladder in zip(names, ladders, strict=False):
        cell = hand_made([[A if value < 2e-4 else B for value in ladder]] * 4, ladder, knob_name="tolerance")
        cells.append((Case("cusp", name), cell.sel(scene="cusp", variant="midpoint", drop=True)))
    return store.combine(cells)


def test_shares_of_a_page_are_of_what_all_its_maps_have_and_panels_share_their_axes():
    data = tolerances([1e-10, 1e-8, 1e-6, 1e-4, 1e-2], [1e-6, 1e-4, 1e-2])
    shares = {name: one.shares[0] for name, one in atlas.common(atlas.maps(data, "cusp")).items()}
    assert shares == pytest.approx({"rk45[axis]": 2 / 3, "radau[axis]": 2 / 3})
    drawn = {picture.name: picture for picture in figures.pictures(data)}["atlas-cusp-tolerances"]
    seen = [axis for axis in drawn.figure.axes if axis.get_visible()]
    assert seen[0].get_xlim() == pytest.approx(seen[1].get_xlim())
    assert "Maps and shares are of what was tried with all: 1e-06 to 0.01." in drawn.caption
    for axis in seen:  # the share that is printed is the share that is seen
        low, high = axis.get_xlim()
        assert (10.0**low, 10.0**high) == pytest.approx((1e-6, 1e-2))
        painted = np.isclose(axis.images[0].get_array(), to_rgb(OUTCOME_COLORS["accurate"])).all(axis=-1)
        assert painted.mean() == pytest.approx(2 / 3, abs=0.02)
        assert axis.get_title().endswith("67%")
    key = {text.get_text() for text in drawn.figure.legends[0].get_texts()}
    assert key == {"accurate", "bounded but wrong"}


def test_the_share_of_a_coarse_map_is_seen_beside_that_of_a_fine_one():
    data = tolerances([1e-6, 1e-5, 1e-4, 1e-3, 1e-2], [1e-6, 1e-4, 1e-2])
    shares = [one.shares[0] for one in atlas.common(atlas.maps(data, "cusp")).values()]
    drawn = {picture.name: picture for picture in figures.pictures(data)}["atlas-cusp-tolerances"]
    for axis in (axis for axis in drawn.figure.axes if axis.get_visible()):
        printed = float(axis.get_title().split()[-1].rstrip("%")) / 100.0
        assert any(printed == pytest.approx(share, abs=0.005) for share in shares)
        left, right, low, high = axis.images[0].get_extent()  # all of it is inside the panel
        assert (left, right, low, high) == pytest.approx((*axis.get_xlim(), *axis.get_ylim()))
        painted = np.isclose(axis.images[0].get_array(), to_rgb(OUTCOME_COLORS["accurate"])).all(axis=-1)
        assert painted.mean() == pytest.approx(printed, abs=0.02)


def test_rows_that_are_accurate_everywhere_share_a_panel():
    right = hand_made([[A, A, A]] * 4).sel(scene="cusp", variant="midpoint", drop=True)
    wrong = hand_made([[A, B, B]] * 4).sel(scene="cusp", variant="midpoint", drop=True)
    names = ["yoshida-4[axis]", "suzuki-4[axis]", "strang[axis]", "rk4[axis]"]
    data = store.combine([(Case("cusp", name), wrong if name == "rk4[axis]" else right) for name in names])
    drawn = {picture.name: picture for picture in figures.pictures(data)}["atlas-cusp-steps"]
    titles = [axis.get_title() for axis in drawn.figure.axes if axis.get_visible()]
    assert titles == ["3 methods\n(named below) 100%", "rk4\n[axis] 33%"]
    assert "everywhere, all [axis]: yoshida-4, suzuki-4, strang." in drawn.figure.legends[0].get_title().get_text()


def test_the_page_of_the_pole_tells_charts_apart_and_names_an_exception():
    rows = {"rk4[axis]": [0, 0, 0], "strang[axis]": [0, 0, 1], "rk4[angles]": [0, 1, 1],
            "stormer-verlet-reversible[angles]": [0, 0, 1]}  # fmt: skip
    axes = np.array([1e-6, 0.3]), np.array([0.001, 0.01, 0.1]), "step_size"
    shown = {name: atlas.OutcomeMap(np.array([row] * 2), *axes, np.full((2, 3), True)) for name, row in rows.items()}
    data = xr.Dataset(coords={"variant": list(rows)})
    assert atlas_words.page_message(data, "grazing", shown) == (
        "Past a pole methods on the axis are accurate in 67% to 100% of their maps, methods in angles in 33%, but for "
        "stormer-verlet-reversible (67%)"
    )


def test_a_tie_has_no_single_winner():
    ladder = [1e-6, 1e-4, 1e-2]
    data = tolerances(ladder, ladder, ladder)
    best, worst = atlas_words.ends(atlas.maps(data, "cusp"))
    assert best == worst == "3 methods (67%)"


def test_words_of_mechanisms_come_only_from_what_is_there():
    data = hand_made([[A, B, L]] * 4)
    assert words.mechanism_sentences(data) == []
    assert [table.title for table in words.tables(data)] == [
        "The atlas in words: cusp with its spin changed, 10 nutations"
    ]


def test_the_full_grid_is_as_large_as_promised():
    cases = [case for case in runner.load("stability").cases(False) if case.scene == "cusp"]
    assert {integrator(case.integrator).method for case in cases} >= set(methods())
    assert {"rk4[angles]", "rk4[axis]"} <= {case.integrator for case in cases}
    full = [case for case in cases if integrator(case.integrator).control == "step_size"]
    for case in full:
        assert len(case.settings["ladder"]) >= 200
        assert len(case.settings["parameters"]) >= 120
        if case.integrator == "strang[axis]":  # in lanes
            assert len(case.settings["ladder"]) * len(case.settings["parameters"]) >= 6 * 24_000


def test_every_named_column_is_written_and_every_variable_has_a_name():
    """What figures and words read, they read by a name of `Column`; the quick grid writes each of them."""
    study = runner.load("stability")
    scenes = {"cusp", "grazing", "steady-fast", "sleeping", "separatrix", "goldstein"}
    written = set()
    for case in study.cases(True):
        if case.integrator == "midpoint[angles]" and case.scene in scenes:
            small = {key: value[:3] if isinstance(value, list) else value for key, value in case.settings.items()}
            written |= set(study.measure(Case(case.scene, case.integrator, small)).data_vars)
    assert written == {value for key, value in vars(Column).items() if key.isupper()}


def test_the_midpoint_rule_is_known_by_its_nodes_and_not_by_its_name():
    settings = {"steps": 20, "periods": 1, "step_size": 0.1, "tolerances": [1e-2, 1e-8], "solver_steps": 50}
    renamed = dataclasses.replace(integrator("midpoint"), name="my-rule")
    one, other = (sampling_table("goldstein", method, settings) for method in (integrator("midpoint"), renamed))
    assert Column.TEXTBOOK_ENERGY in one
    xr.testing.assert_identical(one, other)
    assert Column.TEXTBOOK_ENERGY not in sampling_table("goldstein", integrator("trapezoidal"), settings)
