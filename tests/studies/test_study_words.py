"""Sentences of the studies of long runs, told other numbers: each says something else."""

import math
import sys

import numpy as np
import pytest
import xarray as xr
from symtop_studies.drift import long_runs, phase_loss, tables, words
from symtop_studies.notebook.tables import NOTEBOOK_FIGURES, SCAN, SOLVER, SOLVER_TOLERANCE, solver_scan
from symtop_studies.stability import mechanism_words

import symtop
from symtop.base import datasets
from symtop.measure import conservation
from symtop.runner import run as runner


@pytest.fixture(scope="module")
def notebook():
    runner.load("notebook")
    return sys.modules["symtop_studies.notebook.study"]


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
def test_a_quantity_is_what_it_is_on_its_worst_scene(sizes, exponents, interval, word):
    cell = xr.Dataset({
        "outcome": ("scene", ["ok", "ok"]),
        "energy_largest": ("scene", list(sizes)),
        "energy_exponent": ("scene", list(exponents)),
        "energy_exponent_interval": ("scene", [interval] * 2),
    })  # fmt: skip
    assert tables.worst_behaviour(cell, "energy") == word
    assert tables.worst_behaviour(cell.assign(outcome=("scene", ["ok", "left_chart"])), "energy") == "failed"


def test_runs_over_a_part_of_the_horizon_are_named():
    time = np.linspace(0.0, 1.0, 5) * np.array([1.0, 0.2])[:, None]
    data = xr.Dataset({"sample_time": (("scene", "integrator", "sample"), time[None])},
                      coords={"scene": ["spheroid"], "integrator": ["rk4", "rk45"]})  # fmt: skip
    assert tables.shortened(data) == {"rk45": pytest.approx(0.2)}
    assert tables.shortened(data.sel(integrator=["rk4"])) == {}
    assert "rk45 20 %" in words._shortened_words(data)
    assert words._shortened_words(data.sel(integrator=["rk4"])) == ""


def test_a_change_of_law_is_told_above_rounding_only():
    known = {"exponent": 1.1, "exponent_interval": 0.1, "change": 42.0, "before": 0.1, "after": 2.0, "law": "linear"}
    cell = xr.Dataset({f"energy_{name}": value for name, value in known.items()}).assign(energy_largest=1e-6)
    energy = tables.quantity(cell.assign(sample_time=("sample", [0.0, 8.0])), "energy")
    assert (energy.growth.largest, energy.length) == (1e-6, 8.0)
    assert words.law(energy, above_rounding=True) == "1.10 +- 0.10, linear; t^0.10 to t^2.00 at t = 42"
    assert words.law(energy, above_rounding=False) == "1.10 +- 0.10, linear"


@pytest.mark.parametrize(("power", "says"), [(0.45, "(agrees with"), (0.8, "(does not agree with")])
def test_a_walk_of_rounding_is_held_against_one_half(power, says):
    columns = dict.fromkeys(long_runs.Rounding._fields, math.nan)
    columns |= {"exponent": power, "exponent_interval": 0.06, "end": 1e-15, "gain": 100.0}
    sentence = words.walk_words("strang", long_runs.Rounding(**columns))
    assert f"strang drifts as n^{power:.2f} +- 0.06 {says}" in sentence
    assert "100 times less" in sentence


def test_a_mean_energy_that_moves_is_said_to():
    means = xr.DataArray([[0.0, 1e-5, 3e-5, np.nan]], dims=("integrator", "window"))
    cells = xr.Dataset({"energy_mean": means, "modified_energy_mean": means * 1e-10,
                        "energy_largest": means + 5e-5, "energy_least": means - 5e-5})  # fmt: skip
    assert tables.moved(cells) == pytest.approx((0.3, 3e-15))


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
        losses = {f"method-{k}": phase_loss.PhaseLoss(100.0, 250.0 * ratio, 100.0, 250.0, ratio)
                  for k, ratio in enumerate(ratios)}  # fmt: skip
        return words.prediction_words(losses)

    assert "right to 3 % for 2 of 2" in sentence(1.01, 0.97)
    assert "Off by more" not in sentence(1.01, 0.97)
    assert "for 1 of 2 methods. Off by more than 10%: method-1 (20% off)" in sentence(1.01, 1.2)
    assert "is right" not in sentence(1.3)
    assert "method-0 (not reached)" in sentence(math.nan)


def test_a_column_is_read_as_it_was_stored():
    made = phase_loss.PhaseLoss(100.0, 250.0, 100.0)
    stored = xr.Dataset({"steps": made.steps, "predicted": made.predicted, "short": made.short})
    assert datasets.row(phase_loss.PhaseLoss, stored)[:3] == made[:3]
    assert math.isnan(datasets.row(phase_loss.PhaseLoss, stored).measured)
    with pytest.raises(KeyError, match="predicted"):
        datasets.row(phase_loss.PhaseLoss, stored.drop_vars("predicted"))


def test_the_tolerance_of_the_notebooks_solver_was_chosen_and_the_scan_says_so(notebook):
    found = solver_scan(symtop.scene("spheroid"))
    data = found.expand_dims(scene=["spheroid"], integrator=[SOLVER])
    assert np.any(np.isclose(SCAN, SOLVER_TOLERANCE, rtol=1e-12))
    here = found.isel(tolerance_setting=SCAN.index(SOLVER_TOLERANCE))
    assert {name: int(here[f"scan_{name}_figures"]) for name in NOTEBOOK_FIGURES} == NOTEBOOK_FIGURES
    assert "chosen to give the notebook's 5/6/6 figures" in notebook._scan_words(data)
    assert "2.6e-07" in notebook._scan_words(data)
    assert "none of 7" in notebook._scan_words(data.assign(scan_energy_figures=data["scan_energy_figures"] + 9.0))
    assert "energy rises at 7, falls at 0" in notebook._ways_words(data.assign(
        scan_energy_rise=abs(data["scan_energy_rise"]), scan_energy_doubt=0.0 * data["scan_energy_doubt"]))  # fmt: skip


def test_momenta_that_are_lost_are_named(notebook):
    sizes = np.array([[1e-15, 1e-15, 1e-6]])
    coords = {"scene": ["spheroid"], "integrator": ["midpoint", "strang", SOLVER]}
    data = xr.Dataset(
        {f"{name}_largest": (("scene", "integrator"), sizes) for name in ("p_phi", "p_psi")}, coords=coords
    )
    assert "all 2 discrete methods" in notebook._momenta_words(data)
    lost = data.assign(p_phi_largest=(("scene", "integrator"), [[1e-15, 1e-9, 1e-6]]))
    assert "of 1 of 2" in notebook._momenta_words(lost)
    assert "not those of strang" in notebook._momenta_words(lost)


@pytest.mark.parametrize(
    ("one", "energy", "momentum", "says"),
    [
        (1e-1, 1e-4, 1e-8, ("walk off", "keeps the energy", "but lets the momenta go")),
        (1e-4, 1e-4, 1e-15, ("stay at", "keeps the energy", "and keeps the momenta")),
        (1e-1, 1e-1, 1e-8, ("walk off", "lets the energy go", "and lets the momenta go")),
    ],
)
def test_the_share_of_the_solver_is_read_from_the_numbers(one, energy, momentum, says):
    data = xr.Dataset({
        "plain_energy": ("tolerance_setting", [1e-3, 1e-4]),
        "one_iteration_energy": one,
        "solver_energy": ("tolerance_setting", [energy, 1e-4]),
        "solver_momentum": ("tolerance_setting", [momentum, 1e-15]),
    }).expand_dims(scene=["goldstein"], integrator=["midpoint"])  # fmt: skip
    (said,) = mechanism_words.solver(data)
    for part in says:
        assert part in said
