"""Sentences of the studies of long runs, told other numbers: each says something else."""

import math

import numpy as np
import pytest
import xarray as xr
from symtop_studies.drift import behaviours, growth, messages, tables, words
from symtop_studies.drift.runs import run_history
from symtop_studies.drift.study import TOLERANCE, cases
from symtop_studies.drift.variants import charts_table
from symtop_studies.truth import tables as truth_tables, words as truth_words

import symtop
from symtop.judging.claims.long_run import KEPT, Constant
from symtop.measure.conservation import Changed
from symtop.run.trajectory import Trajectory


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


def test_the_same_run_has_one_behaviour_in_every_study():
    """kahan-li-6 changes the energy by 9e-13 of the spin's and has an exponent of 0: an error of the step, bounded."""
    for size, exponent, interval in ((9e-12, 0.0, 0.001), (1e-15, 0.9, 0.1), (1e-4, 1.0, 0.1), (1e-4, 0.0, 0.01)):
        measured = {"energy_largest": size, "energy_exponent": exponent, "energy_exponent_interval": interval}
        columns = {"outcome": ("scene", ["ok"]), **{name: ("scene", [value]) for name, value in measured.items()}}
        cell = xr.Dataset(columns, coords={"scene": ["spheroid"]})
        grain = symtop.scene("spheroid").energy_grain
        changed = Changed(size, 0.0, 1.0, 0.0, exponent, interval, "")
        ledger = Constant(changed, 0.0, KEPT * grain, grain)
        assert tables.worst_behaviour(cell, "energy") == ledger.kind


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
    run = Trajectory(time, theta=time, p_theta=time, steps=1)
    monkeypatch.setattr(growth, "integrate", lambda *_, **__: run)
    monkeypatch.setattr(growth, "residuals", lambda *_: planted)
    found = growth.history(where, symtop.integrator("rk4"))
    assert float(found["energy_change"]) == pytest.approx(0.1 * time[-1], rel=0.5)
    assert float(found["energy_after"]) == pytest.approx(2.0, abs=0.3)
    assert str(found["p_psi_law"].item()) == "linear"
    assert str(found["p_phi_law"].item()) == "bounded"
    assert np.isnan(float(found["p_phi_change"]))
    assert np.isnan(float(found["p_psi_change"]))


@pytest.mark.parametrize(("bound", "holding"), [(2e-9, 2), (5e-10, 1)])
def test_the_truth_study_counts_the_bounds_that_an_error_exceeds(bound, holding):
    data = xr.Dataset({
        truth_tables.ERROR: ("horizon", [1e-9, 1e-9, np.nan, 1e-9]),
        truth_tables.BOUND: ("horizon", [4e-9, bound, 1e-9, np.nan]),
    })  # fmt: skip
    assert f"Of 2 claimed bounds {holding} hold" in truth_words.bounds(data)


def test_a_phase_is_steady_only_if_its_intervals_allow_it_and_faster_only_on_every_scene():
    powers = {
        "strang": (1.0, 1.0),
        "rk4": (2.09, 1.90),
        "taylor": (1.94, 2.03),
        "mixed": (1.0, 1.6),
        "exact": (0.2, 0.1),
    }
    sizes = {"strang": 1.0, "rk4": 1.0, "taylor": 7e-10, "mixed": 1e-3, "exact": 1e-15}
    data = xr.Dataset(
        {
            "phase_exponent": (("variant", "scene"), list(powers.values())),
            "phase_exponent_interval": (("variant", "scene"), np.full((5, 2), 0.15)),
            "phase_largest": (("variant", "scene"), [[size] * 2 for size in sizes.values()]),
        },
        coords={"variant": list(powers), "scene": ["spheroid", "goldstein"]},
    )
    assert {word: [one.row for one in group] for word, group in behaviours.phases(data).items()} == {
        behaviours.STEADY: ["strang"], behaviours.FASTER: ["rk4", "taylor"], behaviours.UNCLEAR: ["mixed"],
    }  # fmt: skip


def test_a_chart_matters_only_where_the_change_is_above_rounding_and_twice_as_large():
    names = ["rk4[angles]", "rk4[axis]", "strang[axis]", "strang[attitude]"]

    def compared(*changes):
        columns = {"p_phi_largest": [*changes, 1e-15, 1e-15], "energy_largest": [1e-15] * 4, "p_psi_largest": [0.0] * 4}
        columns = {key: (("scene", "variant"), [values]) for key, values in (columns | {"outcome": ["ok"] * 4}).items()}
        return charts_table(xr.Dataset(columns, coords={"scene": ["spheroid"], "variant": names}))

    (table,) = compared(1.5e-4, 0.0)
    assert list(table.rows) == [["p_phi", "rk4", "1.5e-04", "exactly 0", ""]]
    assert compared(1.5e-4, 1.2e-4) == compared(1e-14, 0.0) == []


def test_a_loss_that_is_off_by_a_fifth_was_not_predicted():
    def message(*ratios):
        return words.predictions({
            f"method-{k}": xr.Dataset({"short": 100.0, "measured": 250.0, "ratio": ratio})
            for k, ratio in enumerate(ratios)
        })  # fmt: skip

    assert "3% for 2 of 2" in message(1.01, 0.97)
    assert "method-1 (20% off)" in message(1.01, 1.2)
    assert "1% for 1 of 2" in message(1.01, math.nan)
