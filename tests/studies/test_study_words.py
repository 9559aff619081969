"""Sentences of the studies of long runs, told other numbers: each says something else."""

import math

import numpy as np
import pytest
import xarray as xr
from symtop_studies.drift import behaviours, messages, tables, variants, words
from symtop_studies.drift.histories import run_history
from symtop_studies.drift.study import TOLERANCE, cases
from symtop_studies.stability import words as stability_words
from symtop_studies.truth import tables as truth_tables, words as truth_words

import symtop
from symtop.judging.claims.long_run import KEPT, Constant
from symtop.measure import conservation, published


@pytest.mark.parametrize(
    ("sizes", "exponents", "interval", "word"),
    [
        ((1e-13, 2e-13), (0.5, 1.0), 0.1, "kept"),
        ((1e-4, 1e-4), (0.0, 0.1), 0.1, "bounded"),
        ((1e-4, 1e-4), (0.0, 0.1), 0.6, "growing"),  # the interval does not exclude a walk
        ((1e-4, 1e-4), (0.0, 1.0), 0.1, "drift"),  # the worse of two scenes
        ((1e-12, 1e-13), (0.5, 0.5), 0.1, "random walk"),
    ],
)
def test_the_behaviour_of_a_quantity_is_that_on_its_worst_scene(sizes, exponents, interval, word):
    cell = xr.Dataset({
        "outcome": ("scene", ["ok", "ok"]),
        "energy_largest": ("scene", list(sizes)),
        "energy_exponent": ("scene", list(exponents)),
        "energy_exponent_interval": ("scene", [interval] * 2),
    })  # fmt: skip
    assert tables.worst_behaviour(cell, "energy") == word
    assert tables.worst_behaviour(cell.assign(outcome=("scene", ["ok", "left_chart"])), "energy") == "failed"


def test_runs_over_a_part_of_the_horizon_are_named():
    time = np.linspace(0.0, 1.0, 5) * np.array([1.0, 0.2, 0.5])[:, None]
    data = xr.Dataset({"sample_time": (("scene", "variant", "sample"), time[None])},
                      coords={"scene": ["spheroid"], "variant": ["rk4", "rk45", "radau"]})  # fmt: skip
    said = "radau, rk45 ran over 20% (rk45) to 50% of the horizon only, and are judged on that part."
    assert words.shortened(data).endswith(said)
    assert words.shortened(data.sel(variant=["rk4"])) == ""


def histories(**changes):
    """Largest changes of p_phi as given, at rounding in everything else; the last is adaptive."""
    names = ["rk4[angles]", "rk4[axis]", "strang[axis]", "strang[attitude]", "rk45[angles]", "taylor[axis]"]
    sizes = [changes.get(name.replace("[", "_").rstrip("]"), 1e-15) for name in names]
    per_row = {
        "p_phi_largest": sizes, "energy_largest": [1e-15] * 6, "p_psi_largest": [0.0] * 6, "outcome": ["ok"] * 6,
        "nutations": [100.0] * 6, "steps_a_nutation": [118.0] * 4 + [np.nan] * 2,
        "tolerance": [np.nan] * 4 + [1e-8, 2.2e-18], "own_tolerance": [0.0] * 5 + [1.0],
    }  # fmt: skip
    coords = {"scene": ["spheroid"], "variant": names}
    return xr.Dataset({key: (("scene", "variant"), [values]) for key, values in per_row.items()}, coords=coords)


def test_what_a_chart_does_is_not_said_of_the_method():
    said = variants.charts_apart(histories(rk4_angles=1.5e-4, rk4_axis=0.0))
    assert "p_phi changes by 1.5e-04 with rk4[angles] and by exactly 0 with rk4[axis]" in said
    assert "strang" not in said
    assert said.endswith("It matters more than 2-fold for 1 of 2 methods that have two charts.")
    (table,) = variants.charts_table(histories(rk4_angles=1.5e-4, rk4_axis=0.0))
    assert list(table.rows) == [["p_phi", "rk4", "1.5e-04", "exactly 0", ""]]
    for alike in ({"rk4_angles": 1.5e-4, "rk4_axis": 1.2e-4}, {"rk4_angles": 1e-14, "rk4_axis": 0.0}):
        assert "The chart alone" not in variants.charts_apart(histories(**alike))
        assert variants.charts_table(histories(**alike)) == []


def test_every_tolerance_is_stated_and_a_default_says_that_it_is_one():
    said = variants.setting(histories())
    assert "100 nutations of spheroid, 118 steps a nutation or tolerance 1e-08 (rk45[angles])." in said
    assert said.endswith("taylor[axis] keeps its default tolerance, the rounding of the arithmetic.")
    cells = [histories().sel(scene="spheroid", variant=name) for name in ("rk4[axis]", "rk45[angles]", "taylor[axis]")]
    assert [variants.used(cell) for cell in cells] == [
        "118.00 steps a nutation", "tolerance 1.0e-08", "tolerance 2.2e-18 (its default: rounding)",
    ]  # fmt: skip


def test_adaptive_methods_drift_at_one_tolerance():
    """One value for all of them, except for those that have a default of their own and keep it."""
    asked = [case for case in cases(quick=False) if case.group == tables.HISTORIES]
    given = {case.settings["tolerance"] for case in asked if "tolerance" in case.settings}
    assert given == {TOLERANCE}
    for case in asked:
        method = symtop.integrator(case.integrator)
        assert len(method.charts()) == 1, case
        own = method.adaptive and method.default_tolerance is not None
        assert ("tolerance" in case.settings) == (method.adaptive and not own), case
    assert {"rk4[angles]", "rk4[axis]", "strang[attitude]"} <= {case.integrator for case in asked}


def test_a_history_says_with_what_it_ran():
    on = symtop.scene("spheroid")
    short = {"horizon": 20.0 * on.nutation_period, "samples": 101}
    step = run_history(on, symtop.integrator("rk4[axis]"), step_size=on.nutation_period / 50.0, **short)
    loose = run_history(on, symtop.integrator("rk45-compiled[angles]"), tolerance=1e-5, **short)
    default = run_history(on, symtop.integrator("taylor[axis]"), **short)
    assert [float(one["steps_a_nutation"]) for one in (step, loose)] == pytest.approx([50.0, math.nan], nan_ok=True)
    assert [float(one["tolerance"]) for one in (loose, default)] == [
        1e-5,
        symtop.integrator("taylor").default_tolerance,
    ]
    assert [float(one["own_tolerance"]) for one in (step, loose, default)] == [0.0, 0.0, 1.0]
    assert float(step["p_phi_largest"]) == 0.0
    other = run_history(on, symtop.integrator("rk4[angles]"), step_size=on.nutation_period / 50.0, **short)
    assert float(other["p_phi_largest"]) > 1e-9


def test_a_change_of_law_is_told_above_rounding_only():
    grown = {"exponent": 1.1, "exponent_interval": 0.1, "change": 42.0, "before": 0.1, "after": 2.0, "law": "linear"}
    for name in ("energy", "phase"):
        cell = xr.Dataset({f"{name}_{column}": value for column, value in grown.items()})
        bent = words.law(cell.assign(energy_largest=1e-6), name)
        assert bent == "1.10 +- 0.10, linear; t^0.10 to t^2.00 at t = 42"
        below = "linear" if name == "phase" else "at rounding"
        assert words.law(cell.assign(energy_largest=1e-13), name) == f"1.10 +- 0.10, {below}"


def test_what_is_said_of_the_phase_follows_from_its_exponents():
    """A phase is called steady only if the intervals of its exponents allow 1; one that grows as t^2 is named."""
    exponents = {
        "strang": (1.0, 1.0),
        "rk4": (2.09, 1.90),
        "taylor": (1.94, 2.03),
        "mixed": (1.0, 1.6),
        "exact": (0.2, 0.1),
    }
    sizes = {"strang": 1.0, "rk4": 1.0, "taylor": 7e-10, "mixed": 1e-3, "exact": 1e-15}
    data = xr.Dataset(
        {
            "phase_exponent": (("variant", "scene"), list(exponents.values())),
            "phase_exponent_interval": (("variant", "scene"), np.full((5, 2), 0.15)),
            "phase_largest": (("variant", "scene"), [[size] * 2 for size in sizes.values()]),
        },
        coords={"variant": list(exponents), "scene": ["spheroid", "goldstein"]},
    )
    said = behaviours.phase_sentence(data)
    assert said.startswith("The phase error grows as t with strang. It grows faster with rk4, taylor, and is largest")
    assert "largest with rk4 (t^2.09 and t^1.90, to 1 rad)." in said
    assert said.endswith("With mixed no one power fits all scenes. With 1 variant none is seen.")
    assert "exact" not in said
    lost = data.assign(phase_exponent=data["phase_exponent"].where(data["variant"] != "mixed"))
    assert behaviours.phase_sentence(lost).endswith("With 1 variant none is seen. With 1 variant no power was fitted.")
    groups = behaviours.phases(data)
    assert {word: [one.row for one in group] for word, group in groups.items()} == {
        behaviours.STEADY: ["strang"], behaviours.FASTER: ["rk4", "taylor"], behaviours.UNCLEAR: ["mixed"],
    }  # fmt: skip
    assert groups[behaviours.FASTER][1].said == "taylor (t^1.94 and t^2.03, to 7e-10 rad)"


def fast_rows(**energy):
    """Three whose phase error grows as t^2, the last over a fiftieth of the horizon; largest energy, exponent."""
    given = {"rk4[axis]": (1e-3, 1.0), "taylor[axis]": (1e-15, 0.5), "radau[angles]": (1e-6, 0.0)} | energy
    sizes, powers = zip(*given.values(), strict=True)
    per_row = {
        "outcome": ["ok"] * 3, "energy_largest": sizes, "energy_exponent": powers,
        "energy_exponent_interval": [0.05] * 3,
        "phase_largest": [1.0, 7e-10, 3e-6], "phase_exponent": [2.0] * 3, "phase_exponent_interval": [0.05] * 3,
    }  # fmt: skip
    columns = {key: (("scene", "variant"), [list(values)]) for key, values in per_row.items()}
    time = np.linspace(0.0, 1.0, 3) * np.array([[1.0], [1.0], [0.02]])
    columns["sample_time"] = (("scene", "variant", "sample"), time[None])
    return xr.Dataset(columns, coords={"scene": ["spheroid"], "variant": list(given)})


def test_a_phase_that_grows_faster_is_not_laid_to_an_energy_that_does_not_drift():
    assert behaviours.faster_sentence(fast_rows()) == (
        "Of 3 variants whose phase error grows faster than t, the energy drifts with 1; it has a bounded error with 1 "
        "(radau[angles] over 2% of the horizon); it is at rounding with 1 (taylor[axis]: phase errors below 1e-09 rad, "
        "which may be rounding)."
    )
    drifting = behaviours.faster_sentence(fast_rows(**{"taylor[axis]": (1e-3, 1.0), "radau[angles]": (1e-3, 1.0)}))
    assert drifting == "Of 3 variants whose phase error grows faster than t, the energy drifts with 3."
    steady = fast_rows()
    assert behaviours.faster_sentence(steady.assign(phase_exponent=steady["phase_exponent"] * 0.5)) == ""


def test_the_same_run_has_one_behaviour_in_every_study():
    """kahan-li-6 changes the energy by 9e-13 of the spin's and has an exponent of 0: an error of the step, bounded."""
    for size, exponent, interval in ((9e-12, 0.0, 0.001), (1e-15, 0.9, 0.1), (1e-4, 1.0, 0.1), (1e-4, 0.0, 0.01)):
        measured = {"energy_largest": size, "energy_exponent": exponent, "energy_exponent_interval": interval}
        columns = {"outcome": ("scene", ["ok"]), **{name: ("scene", [value]) for name, value in measured.items()}}
        cell = xr.Dataset(columns, coords={"scene": ["spheroid"]})
        grain = symtop.scene("spheroid").energy_grain
        changed = conservation.Changed(size, 0.0, 1.0, 0.0, exponent, interval, "")
        ledger = Constant(changed, 0.0, KEPT * grain, grain)
        assert tables.worst_behaviour(cell, "energy") == ledger.kind


def test_an_energy_error_that_no_sample_sees_is_below_rounding_and_no_ratio_of_a_floor():
    part = xr.Dataset(
        {stability_words.Column.ENERGY_ONCE: ("variant", [0.0, 5e-9, 2e-5, 1e-16]),
         stability_words.Column.ENERGY_EVERY: ("variant", [4.2e-8, 2.5e-4, 3e-5, 1e-15])},
        coords={"variant": ["yoshida-4", "stormer-verlet", "rkmk-se3-2", "gauss-4"]},
    )  # fmt: skip
    sentence = stability_words.sampling(part)
    assert "errors of 2 of 3 variants look more than 10 times too small" in sentence
    assert ": 1 below rounding, 1 up to 5e+04 times (stormer-verlet)." in sentence
    assert (
        "Those of 1 variant drift and look at most 1.5 times too small. 1 variant with errors up to 1e-12 are not"
        in sentence
    )
    assert "e+08" not in sentence


@pytest.mark.parametrize(("power", "agreeing"), [(0.45, 2), (0.8, 1)])
def test_a_walk_of_rounding_is_held_against_one_half(power, agreeing):
    cells = {
        name: xr.Dataset({"exponent": exponent, "exponent_interval": 0.06, "gain": gain})
        for name, exponent, gain in (("strang", power, 100.0), ("cayley", 0.5, 40.0))
    }
    sentence = words.walks(cells)
    assert f"as n^{min(power, 0.5):.2f} to n^{max(power, 0.5):.2f} in n steps" in sentence
    assert f"with {agreeing} of 2 variants that agrees with the 1/2 of a random walk" in sentence
    assert "drift 40 to 100 times as far" in sentence


def test_the_shift_of_the_mean_energy_is_relative_to_its_band():
    means = xr.DataArray([[0.0, 1e-5, 3e-5, np.nan]], dims=("variant", "window"))
    cells = xr.Dataset({"energy_mean": means, "modified_energy_mean": means * 1e-10,
                        "energy_largest": means + 5e-5, "energy_least": means - 5e-5})  # fmt: skip
    sentence = words.moved(cells)
    assert "at most 3e-01 of the width of its oscillation from the first window to the last" in sentence
    assert "off by up to 3e-01 of that width" in words.scatter(cells)
    assert "the mean modified energy by at most 3e-15 of" in sentence
    there_and_back = cells.assign(energy_mean=means.copy(data=[[0.0, 4e-5, 1e-6, np.nan]]))
    assert messages.strayed(there_and_back) == pytest.approx((0.01, 0.4))
    said = messages.windows(there_and_back.assign(steps=means * 0.0 + 1e8))
    assert "moves by at most 1% of the width of its oscillation in 10⁸ steps, from the first window to the last" in said
    assert "(first row)" in said


def test_a_change_of_law_is_found_in_a_run_and_an_oscillation_that_switches_on_is_none(monkeypatch):
    where = symtop.scene("spheroid")
    time = np.linspace(0.0, 5000.0 * where.nutation_period, 4001)
    planted = {"energy": 1e-9 + 1e-9 * (time / time[-1] / 0.1) ** 2, "p_phi": np.tanh(time), "p_psi": 1e-9 * time}
    run = xr.Dataset(
        {name: ("time", values) for name, values in {**planted, "theta": time, "p_theta": time}.items()},
        coords={"time": time},
        attrs={"outcome": "ok", "steps": 1},
    )
    monkeypatch.setattr(conservation, "simulate", lambda *_, **__: run)
    monkeypatch.setattr(conservation, "residuals", lambda *_: planted)
    found = conservation.history(where, symtop.integrator("rk4"))
    assert float(found["energy_change"]) == pytest.approx(0.1 * time[-1], rel=0.5)
    assert float(found["energy_after"]) == pytest.approx(2.0, abs=0.3)
    assert str(found["p_psi_law"].item()) == "linear"
    assert str(found["p_phi_law"].item()) == "bounded"
    assert np.isnan(float(found["p_phi_change"]))
    assert np.isnan(float(found["p_psi_change"]))


def test_a_loss_that_is_off_by_a_fifth_was_not_predicted():
    def sentence(*ratios):
        losses = {f"method-{k}": xr.Dataset({"short": 100.0, "measured": 250.0, "ratio": ratio})
                  for k, ratio in enumerate(ratios)}  # fmt: skip
        return words.predictions(losses)

    assert "right to 3% for 2 of 2" in sentence(1.01, 0.97)
    assert "Off by more" not in sentence(1.01, 0.97)
    assert "for 1 of 2 variants. Off by more than 10%: method-1 (20% off)" in sentence(1.01, 1.2)
    assert "predicts when the phase error reaches 0.01 rad, 2.5 times as late" in sentence(1.01)
    assert "right to" not in sentence(1.3)
    unreached = sentence(1.01, math.nan)
    assert unreached.endswith("for 1 of 2 variants. Not reached by the end of a run: method-1.")
    assert "Off by more" not in unreached
    known = {"method-0": xr.Dataset({"short": 100.0, "measured": 250.0, "ratio": 1.01})}
    assert words.predictions(known, left=["rk4[axis]"]).endswith("No prediction was possible for: rk4[axis].")
    assert "No prediction" not in sentence(1.01)


@pytest.mark.parametrize(
    ("one", "energy", "momentum", "says"),
    [
        (1e-1, 1e-4, 1e-8, ("grows to", "conserves the energy", "but loses the momenta")),
        (1e-4, 1e-4, 1e-15, ("stays at", "conserves the energy", "and conserves the momenta")),
        (1e-1, 1e-1, 1e-8, ("grows to", "loses the energy", "and loses the momenta")),
    ],
)
def test_the_share_of_the_solver_is_read_from_the_numbers(one, energy, momentum, says):
    data = xr.Dataset({
        "plain_energy": ("tolerance_setting", [1e-3, 1e-4]),
        "one_iteration_energy": one,
        "solver_energy": ("tolerance_setting", [energy, 1e-4]),
        "solver_momentum": ("tolerance_setting", [momentum, 1e-15]),
    }).expand_dims(scene=["goldstein"], variant=["midpoint"])  # fmt: skip
    (said,) = stability_words.mechanism_sentences(data)
    for part in says:
        assert part in said


def test_the_truth_study_says_what_the_printed_values_test():
    def value(ours, tests, kind="printed"):
        return published.Published("somebody", "something", 1.0, ours, 1e-3, kind, tests=tests)

    values = [value(1.0, published.TRAJECTORY), value(1.1, published.TRAJECTORY), value(1.0, published.START)]
    sentence = " ".join(truth_words.published([*values, value(1.0, published.START, "formula")]))
    assert "2 of 3 printed values" in sentence
    assert (
        "Only 2 of them test a trajectory of the top (somebody); 1 tests the energy of a start, and 0 belong"
        in sentence
    )
    assert "1 of 1 agree; 0 of them test a trajectory and 1 a start." in sentence
    everything = " ".join(truth_words.published(published.published_values()))
    assert "7 of 7 printed values" in everything
    assert "Only 3 of them test a trajectory" in everything
    assert "6 of 6 agree; 4 of them test a trajectory and 2 a start." in everything


def test_the_title_of_the_truth_study_has_a_number_whatever_was_run_longest():
    """An integration is not run as long as the closed form: its last error is that of its own longest time."""
    errors = [[[1e-15, 1e-13, np.nan], [3e-16, 4e-16, 5e-16]]]
    coords = {"scene": ["spheroid"], "variant": ["double, axis", "closed form"], "horizon": [8.0, 1e4, 1e6]}
    data = xr.Dataset({truth_tables.ERROR: (("scene", "variant", "horizon"), errors)}, coords=coords)
    said = truth_words.message(data).replace("\N{NO-BREAK SPACE}", " ")
    assert "right to 5 × 10⁻¹⁶ rad" in said
    assert "off by up to 10⁻¹³ rad after 10⁴ s" in said
    alone = truth_words.message(data.sel(variant=["closed form"]))
    assert "nan" not in said + alone


def test_the_truth_study_says_what_errors_are_measured_against_and_what_else_agrees():
    errors = [[[1e-31, 2e-31], [3e-16, 5e-16]]]
    coords = {"scene": ["spheroid"], "variant": ["quadruple, attitude", "closed form"], "horizon": [8.0, 1e2]}
    data = xr.Dataset({truth_tables.ERROR: (("scene", "variant", "horizon"), errors)}, coords=coords)
    said = truth_words.measured_against(data).replace("\N{NO-BREAK SPACE}", " ")
    assert "from the closed form in 45 digits" in said
    assert said.endswith("agrees with it to 2 × 10⁻³¹ rad.")
    alone = truth_words.measured_against(data.sel(variant=["closed form"]))
    assert alone == "Error: the distance from the closed form in 45 digits."


@pytest.mark.parametrize(("bound", "holding"), [(2e-9, 2), (5e-10, 1)])
def test_the_truth_study_counts_the_bounds_that_an_error_exceeds(bound, holding):
    data = xr.Dataset({
        truth_tables.ERROR: ("horizon", [1e-9, 1e-9, np.nan, 1e-9]),
        truth_tables.BOUND: ("horizon", [4e-9, bound, 1e-9, np.nan]),
    })  # fmt: skip
    assert f"Of 2 claimed bounds {holding} hold" in truth_words.bounds(data)


def test_the_fates_of_all_rows_are_counted_in_a_sentence_and_listed_in_tables():
    """Two methods at rounding, one that bounds its error, one that loses the constant."""
    sizes = {"strang": (1e-15, 0.5), "cayley": (2e-15, 0.5), "verlet": (1e-4, 0.0), "rk4": (1e-2, 1.0)}
    columns = {}
    for constant in conservation.CONSTANTS:
        for part, values in (("largest", [size for size, _ in sizes.values()]), ("exponent_interval", [0.01] * 4),
                             ("exponent", [power for _, power in sizes.values()])):  # fmt: skip
            columns[f"{constant}_{part}"] = (("variant", "scene"), np.array(values)[:, None])
    columns |= {
        f"phase_{part}": (("variant", "scene"), np.full((4, 1), value))
        for part, value in (("largest", 1e-3), ("exponent", 1.0), ("exponent_interval", 0.01))
    }
    data = xr.Dataset(columns, coords={"variant": list(sizes), "scene": ["spheroid"]})
    data = data.assign(outcome=(("variant", "scene"), [["ok"]] * 4))
    assert behaviours.constant_sentence(data, "p_phi") == (
        "Of 4 variants, the relative change of p_phi is no more than rounding with 2 (up to 2.0e-15), stays bounded "
        "over the run with 1 (up to 1.0e-04, verlet), and grows in time with 1 (up to 1.0e-02, rk4)."
    )
    counts, every = behaviours.tables(data)
    assert list(counts.rows[0]) == ["energy", "at rounding", "2", "1.0e-15", "strang", "2.0e-15", "cayley"]
    assert [row[0] for row in every.rows] == list(sizes)
    zero = data.assign(p_phi_exponent=data["p_phi_exponent"] * math.nan)
    assert not any("nan" in text for row in behaviours.tables(zero)[1].rows for text in row)
    assert {len(row) for row in every.rows} == {len(every.header)}
    ended = data.assign(outcome=data["outcome"].where(data["variant"] != "rk4", "left_chart"))
    assert behaviours.constant_sentence(ended, "energy").endswith("is unknown with 1 whose run ended early.")
