"""The test set of scenes: its digits against independent evaluations, the reference and heyoka, and its two forms."""

import csv
import io
from decimal import Decimal, localcontext

import numpy as np
import pytest

import symtop
from symtop.report import archive
from symtop.report.archive import ANGLES, COLUMNS, DIGITS, TIMES

THEIRS = dict(zip(ANGLES, ("theta", "phi", "psi", "thetadot", "phidot", "psidot"), strict=True))


def read(text):
    """CSV as a list of rows by column."""
    return list(csv.DictReader(io.StringIO(text)))


def like(entry):
    """The scene of an entry of the stored truth, whose numbers are doubles."""
    top = symtop.SymmetricTop(*(float(entry[key]) for key in ("I1", "I3", "mgl")))
    start = symtop.Angles(*map(float, [*entry["q0_theta_phi_psi"], *entry["v0"]]))
    return symtop.Scene("stored", top, start, float(entry["t"]))


def digit_gap(printed, stored):
    """By how many units of the last of 30 digits two numbers differ."""
    digit = Decimal(stored).adjusted() - (DIGITS - 1)
    return abs(Decimal(printed) - Decimal(stored)).scaleb(-digit)


@pytest.mark.parametrize("name", ["spheroid_ieee", "goldstein_at_rest_ieee"])
def test_thirty_digits_agree_with_four_independent_evaluations(truth, name):
    entry = truth[name]
    row = read(archive.states_csv([like(entry)]))[-1]
    assert float(row["time"]) == float(entry["t"])
    stored = {ours: entry["state"][theirs] for ours, theirs in THEIRS.items()}
    stored |= dict(zip(COLUMNS[6:], [*entry["axis_xyz"], *entry["quaternion_wxyz"]], strict=True))
    assert all(digit_gap(row[column], value) <= 1 for column, value in stored.items())
    other = read(archive.states_csv([like(entry | {"mgl": str(float(entry["mgl"]) * (1.0 + 2.3e-16))})]))[-1]
    assert digit_gap(other["theta"], stored["theta"]) > 1e10  # another last bit of mgl is another motion


def test_every_scene_has_ten_times_up_to_its_horizon():
    rows = read(archive.states_csv(symtop.scenes().values()))
    assert [row["scene"] for row in rows] == [name for name in symtop.scenes() for _ in range(TIMES)]
    for name, scene in symtop.scenes().items():
        times = [float(row["time"]) for row in rows if row["scene"] == name]
        assert times == sorted(times)
        assert times[-1] == pytest.approx(scene.horizon, rel=1e-5)
    problems = read(archive.scenes_csv(symtop.scenes().values()))
    for row, scene in zip(problems, symtop.scenes().values(), strict=True):
        assert symtop.SymmetricTop(*(float(row[key]) for key in ("I1", "I3", "mgl"))) == scene.top
        assert symtop.Angles(*(float(row[key]) for key in ANGLES)) == scene.start


def distances(data, true, name):
    """How far the reference's axis and theta are from the test set's, with low halves where there are any (rad)."""
    cell = data.sel(scene=name)
    axis = cell["axis"].values - true["axis"].values + cell["axis_lo"].values
    theta = cell["theta"].values - true["theta"].values + cell["theta_lo"].values
    if "theta_lo" in true:
        theta = theta - true["theta_lo"].values
    if "axis_lo" in true:
        axis = axis - true["axis_lo"].values
    return np.linalg.norm(axis, axis=-1), np.abs(theta)


@pytest.mark.parametrize(
    ("names", "precision", "shift"),
    [([*symtop.scenes()], "", 1e-13), (["goldstein", "bruls-cardona-arnold"], "quad", 1e-24)],  # the last by a pole
)
def test_the_reference_agrees_with_the_test_set_to_its_bounds(names, precision, shift):
    if precision:
        pytest.importorskip("heyoka")
    data = archive.states([symtop.scene(name) for name in names])
    for name in names:
        true = symtop.reference(name, data["time"].sel(scene=name).values, *filter(None, [precision]))
        axis, theta = distances(data, true, name)
        assert np.all(axis <= true["axis_error_bound"].values + 1e-31), name
        assert np.all(theta <= true["theta_error_bound"].values + 1e-31), name
    assert not precision or true["axis_error_bound"].values.max() < 1e-25
    wrong = data.assign(axis_lo=data["axis_lo"] + shift)
    assert np.any(distances(wrong, true, name)[0] > true["axis_error_bound"].values)


def test_the_dataset_and_the_text_hold_the_same_numbers():
    chosen = [symtop.scene("spheroid"), symtop.scene("fast")]
    data, rows = archive.states(chosen), read(archive.states_csv(chosen))
    with localcontext(prec=80):
        for k, row in enumerate(rows):
            cell = data.isel(scene=k // TIMES, sample=k % TIMES)
            for name in ANGLES:
                pair = Decimal(float(cell[name])) + Decimal(float(cell[f"{name}_lo"]))
                assert abs(pair - Decimal(row[name])) <= Decimal("1e-29") * abs(pair)
        assert all("units" in data[name].attrs and data[name].attrs["long_name"] for name in data.data_vars)
