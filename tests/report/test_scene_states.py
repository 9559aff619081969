"""The test sets of scenes and of bodies: digits by other ways, the two forms, and checkers that see a wrong sign."""

import csv
import io
import shutil
import subprocess
import sys
from decimal import Decimal, localcontext

import numpy as np
import pytest

import symtop
from symtop.core import netcdf
from symtop.core.numbers import context
from symtop.model.body import Attitude, RigidBody
from symtop.model.exact.body_digits import body_digits
from symtop.report import archive, test_set
from symtop.report.archive import ANGLES, COLUMNS, DIGITS, TIMES
from symtop.run.ensemble.bodies import body_population, scenes_of
from tests.commands import call
from tests.model.bodies import PreciseBody

THEIRS = dict(zip(ANGLES, ("theta", "phi", "psi", "thetadot", "phidot", "psidot"), strict=True))


def read(text):
    """CSV as a list of rows by column."""
    return list(csv.DictReader(io.StringIO(text)))


def rows_of(file):
    return read(file.read_text(encoding="utf-8"))


def like(entry):
    """The scene of an entry of the stored truth, whose numbers are doubles."""
    top = symtop.SymmetricTop(*(float(entry[key]) for key in ("I1", "I3", "mgl")))
    start = symtop.Angles(*map(float, [*entry["q0_theta_phi_psi"], *entry["v0"]]))
    return symtop.Scene("stored", top, start, float(entry["t"]))


def digit_gap(printed, stored):
    """By how many units of the last of 30 digits two numbers differ."""
    return abs(Decimal(printed) - Decimal(stored)).scaleb(DIGITS - 1 - Decimal(stored).adjusted())


@pytest.mark.parametrize("name", ["spheroid_ieee", "goldstein_at_rest_ieee"])
def test_thirty_digits_agree_with_four_independent_evaluations(truth, name):
    entry = truth[name]
    row = read(archive.states_csv([like(entry)]))[-1]
    assert float(row["time"]) == float(entry["t"])
    expected = {ours: entry["state"][theirs] for ours, theirs in THEIRS.items()}
    expected |= dict(zip(COLUMNS[6:], [*entry["axis_xyz"], *entry["quaternion_wxyz"]], strict=True))
    assert all(digit_gap(row[column], value) <= 1 for column, value in expected.items())
    control = read(archive.states_csv([like(entry | {"mgl": str(float(entry["mgl"]) * (1.0 + 2.3e-16))})]))[-1]
    assert digit_gap(control["theta"], expected["theta"]) > 1e10  # another last bit of mgl is another motion


def distances(data, true, name):
    """How far the reference's axis and theta are from the test set's, with low halves where there are any (rad)."""
    cell = data.sel(scene=name)
    low = lambda part: true[f"{part}_lo"].values if f"{part}_lo" in true else 0.0
    axis, theta = (cell[part].values - true[part].values + cell[f"{part}_lo"].values - low(part)
                   for part in ("axis", "theta"))  # fmt: skip
    return np.linalg.norm(axis, axis=-1), np.abs(theta)


@pytest.mark.parametrize(("names", "precision", "shift"), [  # the last by a pole
    ([*symtop.scenes()], "", 1e-13), (["goldstein", "bruls-cardona-arnold"], "quad", 1e-24)])  # fmt: skip
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
    control = data.assign(axis_lo=data["axis_lo"] + shift)
    assert np.any(distances(control, true, name)[0] > true["axis_error_bound"].values)


def test_every_scene_has_ten_times_and_the_dataset_the_numbers_of_the_text():
    rows = read(archive.states_csv(symtop.scenes().values()))
    assert [row["scene"] for row in rows] == [name for name in symtop.scenes() for _ in range(TIMES)]
    for name, scene in symtop.scenes().items():
        times = [float(row["time"]) for row in rows if row["scene"] == name]
        assert times == sorted(times)
        assert times[-1] == pytest.approx(scene.horizon, rel=1e-5)
    for row, scene in zip(read(archive.scenes_csv(symtop.scenes().values())), symtop.scenes().values(), strict=True):
        assert symtop.SymmetricTop(*(float(row[key]) for key in ("I1", "I3", "mgl"))) == scene.top
        assert symtop.Angles(*(float(row[key]) for key in ANGLES)) == scene.start
    scenes = [symtop.scene("spheroid"), symtop.scene("fast")]
    data, rows = archive.states(scenes), read(archive.states_csv(scenes))
    with localcontext(prec=80):
        for k, row in enumerate(rows):
            cell = data.isel(scene=k // TIMES, sample=k % TIMES)
            for name in ANGLES:
                pair = Decimal(float(cell[name])) + Decimal(float(cell[f"{name}_lo"]))
                assert abs(pair - Decimal(row[name])) <= Decimal("1e-29") * abs(pair)
        assert all("units" in data[name].attrs and data[name].attrs["long_name"] for name in data.data_vars)


@pytest.fixture(scope="module")
def bodies(tmp_path_factory):
    """A test set of three problems over one natural period, and their scenes."""
    kinds = ("near-separatrix", "regular", "lagrange")
    scenes = [scenes_of(body_population(1, seed=3, kind=kind))[0] for kind in kinds]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(test_set, "PERIODS", 1.0)
        return test_set.write(tmp_path_factory.mktemp("set") / "bodies", scenes), scenes


def run_checker(folder, mine, reference="states-17.csv"):
    """Of each problem the largest errors of attitude and momentum and the number beyond the bound."""
    words = [sys.executable, str(folder / "check.py"), str(mine), str(folder / reference)]
    result = subprocess.run(words, capture_output=True, text=True, check=True)
    rows = [line.split() for line in result.stdout.splitlines()]
    return {row[0]: (float(row[2]), float(row[5]), int(row[6])) for row in rows}, result.stdout


def own_file(path, scenes, times, change=lambda body: body):
    """States of `dop853` on the bodies, `change` made to each."""
    lines = [",".join(("name", "time", *test_set.STATE))]
    for scene in scenes:
        body_scene = symtop.Scene(scene.name, change(scene.top), scene.start, scene.horizon)
        t = np.array([float(row["time"]) for row in times if row["name"] == scene.name])
        run = symtop.simulate(body_scene, "dop853", tolerance=1e-12, horizon=float(t[-1]), samples=2001)
        q = [np.interp(t, run.time.values, column) for column in run["quaternion"].values.T]
        L = [np.interp(t, run.time.values, column) for column in run["momentum"].values.T]
        q /= np.linalg.norm(q, axis=0)
        lines += [",".join([scene.name, *map(repr, row)]) for row in np.stack([t, *q, *L], axis=1).tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_the_reference_has_nothing_beyond_its_bounds_and_what_is_printed_is_what_is_meant(bodies):
    folder, scenes = bodies
    for reference in ("states-17.csv", "states-30.csv"):
        rows, _ = run_checker(folder, folder / reference, reference)
        assert [*rows] == [scene.name for scene in scenes]
        assert all(beyond == 0 and attitude == momentum == 0.0 for attitude, momentum, beyond in rows.values())
    rows, _ = run_checker(folder, folder / "states-30.csv")  # rounding to 17 digits is within the bound
    assert all(beyond == 0 and 0.0 < attitude < 2e-16 for attitude, _, beyond in rows.values())
    with pytest.raises(subprocess.CalledProcessError):
        run_checker(folder, folder / "problems.csv")
    data, rows = (netcdf.read(folder / "states.nc"), rows_of(folder / "states-30.csv"))
    for scene, problem in zip(scenes, rows_of(folder / "problems.csv"), strict=True):
        times = [float(row["time"]) for row in rows if row["name"] == scene.name]
        assert times == data["time"].sel(problem=scene.name).values.tolist()
        assert [float(problem[name]) for name in test_set.GIVEN] == list(scene.top.flat(scene.start))
    text = " ".join((folder / "README.md").read_text(encoding="utf-8").split())
    assert "a number that is given, of a problem or a time, is the double nearest to what is printed" in text


def test_a_sign_in_the_inertia_is_found_by_both_checkers(bodies, tmp_path):
    folder, scenes = bodies
    times = rows_of(folder / "states-17.csv")
    right = own_file(tmp_path / "right.csv", scenes, times)
    wrong = own_file(tmp_path / "wrong.csv", scenes, times, lambda b: RigidBody(*b.moments[::-1], b.mgl, b.centre))
    errors, _ = run_checker(folder, right)
    control, output = run_checker(folder, wrong)
    assert max(attitude for attitude, _, _ in errors.values()) < 1e-5  # of the lines between its samples
    assert all(attitude > 0.01 and beyond == test_set.TIMES for attitude, _, beyond in control.values())
    if (compiler := shutil.which("cc")) is None:
        pytest.skip("no compiler of C")
    subprocess.run([compiler, str(folder / "check.c"), "-o", str(tmp_path / "check"), "-lm"], check=True)
    for mine, expected in ((wrong, output), (folder / "states-17.csv", None)):
        words = [str(tmp_path / "check"), str(mine), str(folder / "states-17.csv")]
        result = subprocess.run(words, capture_output=True, text=True, check=True).stdout
        assert result == expected if expected else result.count(" 0 beyond the bound") == len(scenes)


@pytest.mark.parametrize("column", ["qw", "qz", "Lx", "Lz"])
def test_a_number_that_is_lost_is_beyond_the_bound(column, bodies, tmp_path):
    folder, scenes = bodies
    rows = rows_of(folder / "states-17.csv")
    for row in rows[: test_set.TIMES]:
        row[column] = "nan"
    with (tmp_path / "lost.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    beyond = [row[2] for row in run_checker(folder, tmp_path / "lost.csv")[0].values()]
    assert beyond == [test_set.TIMES] + [0] * (len(scenes) - 1)
    result = subprocess.run([sys.executable, str(folder / "check.py")], capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (1, "usage: python check.py MINE.csv states-17.csv\n")


def test_the_digits_are_those_of_other_ways(bodies):
    """A free body by its closed form in 50 digits, heavy ones in quadruple precision; the pairs of doubles likewise."""
    pytest.importorskip("heyoka")
    folder, scenes = bodies
    data, rows = (netcdf.read(folder / "states.nc"), rows_of(folder / "states-30.csv"))
    mp = context(100)  # in which the product of two doubles is exact
    for scene in scenes:
        times = data["time"].sel(problem=scene.name).values
        own_rows = [row for row in rows if row["name"] == scene.name]
        if scene.top.free:
            momentum = [mp.mpf(a) * mp.mpf(b) for a, b in zip(scene.top.moments, scene.start.omega_body, strict=True)]
            true = PreciseBody(scene.top.moments, scene.start.quaternion, momentum)
            for row, state in zip(own_rows, true.states(times), strict=True):
                q = [true.mp.mpf(row[name]) for name in ("qw", "qx", "qy", "qz")]
                gap = min(true.mp.norm([a - s * b for a, b in zip(q, state[:4], strict=True)]) for s in (1, -1))
                assert gap < 3e-30
        else:
            truth = symtop.reference(scene, times, "quad")
            high, low = (data[f"quaternion{end}"].sel(problem=scene.name).values for end in ("", "_lo"))
            gap = (high - truth["quaternion"].values) + (low - truth["quaternion_lo"].values)
            assert 2.0 * np.abs(gap).max() < float(truth["attitude_error_bound"].max()) < 1e-26


def test_a_start_that_is_moved_by_a_rounding_is_another_motion(monkeypatch):
    scene = scenes_of(body_population(1, seed=3, kind="regular"))[0]
    first, second = (body_digits(scene.top, scene.start, [0.5]) for _ in range(2))
    assert first == second
    w1, w2, w3 = scene.start.omega_body
    control = body_digits(scene.top, Attitude(scene.start.quaternion, (np.nextafter(w1, 9.0), w2, w3)), [0.5])
    assert 1e-18 < abs(control.momentum[0][0] - first.momentum[0][0]) < 1e-14
    monkeypatch.setattr("symtop.model.exact.body_digits.MOST_STEPS", 5)
    with pytest.raises(symtop.SymtopError, match="times must be within 5 steps of the series, not reach 1000"):
        body_digits(scene.top, scene.start, [1000.0])


def test_the_command_refuses_a_folder_that_holds_something(tmp_path, monkeypatch):
    (tmp_path / "test-set").mkdir()
    (tmp_path / "test-set" / "mine").touch()
    for place in (("--results", tmp_path), ("--output", tmp_path / "test-set")):
        result = call("archive", "--test-set", *place, code=2)
        assert "the test set needs a folder that is new or empty" in result.stderr
    with monkeypatch.context() as patch:  # told before anything is computed
        patch.setattr(test_set, "body_digits", None)
        call("archive", "--test-set", "--output", tmp_path / "test-set" / "mine" / "folder", code=2)
    (tmp_path / "test-set" / "mine").unlink()
    monkeypatch.setattr(test_set, "problems", lambda: scenes_of(body_population(1, seed=3, kind="lagrange")))
    monkeypatch.setattr(test_set, "PERIODS", 0.1)
    call("archive", "--test-set", "--output", tmp_path / "test-set")
    assert len(rows_of(tmp_path / "test-set" / "problems.csv")) == 1
