"""A trajectory without a method: what is found is that of the run it was made by."""

import json
import re

import numpy as np
import pytest
import xarray as xr

import symtop
from symtop.core import netcdf
from symtop.judging.claims.subject import open_target
from symtop.methods.framework.equations import FORMULATIONS
from symtop.model.body import product, rotated
from tests.commands import call
from tests.judging.blind.right import euler, midpoint

SPHEROID = symtop.scene("spheroid")
H, STRIDE, SAMPLES = 0.01, 10, 1001


@pytest.fixture(scope="module")
def table():
    """Times, axes and angular momenta of a run of the midpoint tableau, shape (1001, 7)."""
    stepper = open_target(midpoint, None, "axis")
    par, state = FORMULATIONS["axis"].prepare(SPHEROID.top, SPHEROID.start)
    marks = STRIDE * np.arange(SAMPLES)
    states = stepper.march(SPHEROID.top, par, np.array(state), H, marks)
    states[:, :3] /= np.linalg.norm(states[:, :3], axis=1)[:, None]
    return np.column_stack([marks * H, states])


def text(table, head="time,ex,ey,ez,Lx,Ly,Lz"):
    return head + "\n" + "\n".join(",".join(map(repr, row)) for row in table.tolist()) + "\n"


def test_reported_constants_do_not_hide_those_of_the_states_nor_an_energy_that_blows_up(table):
    """Euler's method gains energy; that of `table` drifts, and friction that takes all of it is no blow-up."""
    stepper, columns = open_target(euler, None, "axis"), {"time": table[:101, 0], "axis": table[:101, 1:4]}
    par, state = FORMULATIONS["axis"].prepare(SPHEROID.top, SPHEROID.start)
    states = stepper.march(SPHEROID.top, par, np.array(state), H, STRIDE * np.arange(101))
    states[:, :3] /= np.linalg.norm(states[:, :3], axis=1)[:, None]
    ledger = symtop.judge({"time": columns["time"], "axis": states[:, :3], "momentum": states[:, 3:]}, energy="bounded")
    assert (ledger["energy"].measured.kind, ledger.refuted) == ("blows up", ["energy"])
    damped = symtop.judge(columns | {"momentum": np.exp(-columns["time"])[:, None] * table[:101, 4:]}, energy="bounded")
    assert damped["energy"].measured.kind != "blows up"
    copied = {"time": table[:, 0], "axis": table[:, 1:4], "momentum": table[:, 4:], "p_psi": np.full(SAMPLES, 0.1)}
    assert symtop.judge(copied, conserves=["p_psi"])["p_psi"].verdict == "refuted"
    del copied["momentum"]
    assert list(ledger := symtop.judge(copied)) == ["axis_error", "theta_error", "p_psi"]
    assert str(ledger["p_psi"].measured) == "kept, to 0e+00, as the file reports it, and begins 8e-01 from the scene's"


def test_a_claim_that_the_samples_do_not_show_is_undecided_and_not_lost(table, tmp_path):
    file, columns = tmp_path / "run.csv", {"time": table[:, 0], "axis": table[:, 1:4]}
    claims = ["p_phi", "axis_length"]
    ledger = symtop.judge(columns, conserves=claims, energy="bounded")
    undecided = {finding.claim: finding.declared for finding in ledger.findings if finding.verdict == "undecided"}
    assert ("p_psi" in ledger, undecided) == (False, {"energy": "bounded", "p_phi": "kept", "axis_length": "kept"})
    ledger = symtop.judge(columns | {"momentum": table[:, 4:]}, conserves=claims, energy="bounded")
    assert (ledger["p_phi"].verdict, ledger["energy"].verdict) == ("confirmed", "refuted")
    infinite = columns | {"momentum": np.where(table[:, :1] < 3.0, table[:, 4:], np.inf)}
    assert symtop.judge(infinite, conserves=claims)["p_phi"].verdict == "refuted"
    file.write_text(text(table[:, :4], "time,ex,ey,ez"), encoding="utf-8")
    assert "Claims: 2 undecided." in call("judge", file, "--conserves", "p_phi", "--energy", "kept").output


def test_an_unknown_claim_about_a_trajectory_is_refused_and_one_that_a_ledger_has_not(table, tmp_path):
    (tmp_path / "run.csv").write_text(text(table), encoding="utf-8")
    result = call("judge", tmp_path / "run.csv", "--conserves", "p_phi,enrgy", code=2)
    assert "'enrgy' is unknown; did you mean energy" in result.output
    columns = {"time": table[:, 0], "axis": table[:, 1:4]}
    with pytest.raises(symtop.SymtopError, match="conserves must be a list of names, not 'p_phi'"):
        symtop.judge(columns, conserves="p_phi")
    ledger = symtop.judge(columns)
    assert [ledger[claim].claim for claim in ledger] == ["axis_error", "theta_error"]
    with pytest.raises(symtop.SymtopError, match="claim 'order' is not in this ledger, which has axis_error, theta_"):
        ledger["order"]


def test_the_command_takes_a_file(table, tmp_path):
    file = tmp_path / "run.tsv"
    file.write_text(text(table), encoding="utf-8")
    result = call("judge", file, "--energy", "kept", "--json", code=1)
    assert {row["claim"]: row["verdict"] for row in json.loads(result.output)}["energy"] == "refuted"
    for option in ("card", "figure"):
        words = (f"--{option}", tmp_path / f"a.{'html' if option == 'card' else 'png'}", "--output", tmp_path / "a.nc")
        result = call("judge", file, *words, code=2)
        assert ("a card or a figure shows a method: there is none" in result.stderr, result.stdout) == (True, "")
    assert [path.name for path in tmp_path.iterdir()] == ["run.tsv"]
    call("judge", file, "-o", tmp_path / "a.nc", "--badge", tmp_path / "a.svg")
    assert "must be another file than" in call("judge", tmp_path / "a.nc", "-o", tmp_path / "a.nc", code=2).stderr


@pytest.mark.parametrize(("content", "words"), [
    ("time,x\n0,1\n", "names, commas or spaces between: time .*, but of 'time x' x is none of them$"),
    ("ex,ey,ez\n0,0,1\n", "names, commas or spaces between: time .*, but of 'ex ey ez' there is no time$"),
    ("time,ex,ey,ez,mass,note\n0,0,0,1,2,3\n", "mass is none of them, note is none of them$"),
    ("time,theta,theta\n0,1,1\n", "theta is there twice$"),
    ("0,0.1,0.2,0.3,0.4\n", r"0 is none of them, 0.1 is none of them, 0.2 is none of them \.\.\.$"),
    ("time,theta\n0,0.4\n1\n", "2 numbers in each line: the number of columns changed from 2 to 1"),
    ("time,theta\n0,high\n", "numbers in each line: could not convert string 'high' to float64"),
    ("time,theta\n\n", "run.csv must have a line of numbers below its names, and has none"),
    ("time,theta,energy\n0,0.4\n1,0.4\n", "3 numbers in each line, not 2$"),
    ("time,theta,Lx,Ly\n0,0.4,1,1\n", "run.csv must have all of Lx, Ly, Lz, and lacks Lz"),
    ("", "cannot be read: it is empty"),
])  # fmt: skip
def test_what_is_no_trajectory_is_told(tmp_path, content, words):
    (tmp_path / "run.csv").write_text(content, encoding="utf-8")
    with pytest.raises(symtop.SymtopError, match=words):
        symtop.judge(str(tmp_path / "run.csv"))
    with pytest.raises(symtop.SymtopError, match="a trajectory shows no order"):
        symtop.judge(str(tmp_path / "run.csv"), order=4)
    with pytest.raises(symtop.SymtopError, match="cannot be read: No such file"):
        symtop.judge("nothing.csv")


def test_csv_netcdf_mappings_and_blanks_are_the_same_and_utf_16_is_told(table, tmp_path):
    file = tmp_path / "run.csv"
    file.write_text(text(table), encoding="utf-8")
    ledger = symtop.judge(file, conserves=["p_phi", "p_psi"], energy="bounded")
    truth = symtop.errors({"time": table[:, 0], "axis": table[:, 1:4]}, SPHEROID)
    assert ledger["axis_error"].value == pytest.approx(float(truth["axis"].max()), rel=1e-6)
    L, e, top = table[:, 4:], table[:, 1:4], SPHEROID.top
    energy = (L**2).sum(1) / (2 * top.I1) + (L * e).sum(1) ** 2 * (1 / top.I3 - 1 / top.I1) / 2 + top.mgl * e[:, 2]
    assert ledger["energy"].value == pytest.approx(np.abs(energy - energy[0]).max() / SPHEROID.energy_scale, rel=1e-6)
    assert ledger["energy"].measured.kind == "drift"
    assert (ledger["p_phi"].verdict, ledger["energy"].verdict) == ("confirmed", "refuted")
    columns = {"time": table[:, 0], "axis": table[:, 1:4], "momentum": table[:, 4:]}
    expected = [finding.value for finding in symtop.judge(columns).findings]
    (tmp_path / "run.txt").write_text("# " + text(table).replace(",", "  "), encoding="utf-8")
    rows = {name: (("time", "component"), columns[name]) for name in ("axis", "momentum")}
    netcdf.write(xr.Dataset(rows, {"time": columns["time"]}), tmp_path / "run.nc")
    for name in ("run.txt", "run.nc"):
        assert [finding.value for finding in symtop.judge(str(tmp_path / name)).findings] == expected
    file.write_text(text(table), encoding="utf-8-sig")
    assert symtop.judge(file)["axis_error"].value > 0.0
    file.write_text(text(table), encoding="utf-16")
    assert "run.csv cannot be read: it must be text in UTF-8" in call("judge", file, code=2).stderr


def test_columns_are_read_by_their_labels_and_lost_samples_are_said_to_be_lost(table):
    error = symtop.judge({"time": (time := table[:, 0]), "axis": table[:, 1:4]})["axis_error"]
    data = xr.Dataset({"axis": (("time", "component"), table[:, 3:0:-1])}, {"time": time, "component": ["z", "y", "x"]})
    assert symtop.judge(data)["axis_error"].value == symtop.judge(data.transpose())["axis_error"].value == error.value
    energy = np.ma.masked_greater(np.where(np.arange(time.size) == 7, 1e20, 1.0), 1.0)
    columns = {"time": time, "axis": np.where(time[:, None] > 4.0, np.nan, table[:, 1:4]), "energy": energy}
    with pytest.warns(symtop.SymtopWarning, match="is not a number from"):
        ledger = symtop.judge(columns, conserves=["energy"])
    assert ledger["energy"].verdict == "confirmed"
    assert f" rad to t = {time[time <= 4.0][-1]:.4g} s" in (words := str(ledger["axis_error"].measured))
    assert f"{(time > 4.0).sum()} of {time.size} samples lost" in words


def test_an_axis_that_contradicts_its_quaternion_is_refused_and_one_of_few_digits_is_not(tmp_path):
    truth = symtop.reference(SPHEROID, np.linspace(0.0, 6.0, 61))
    columns = np.column_stack([truth[name].values for name in ("time", "axis", "quaternion")])
    head, file = "time,ex,ey,ez,qw,qx,qy,qz", tmp_path / "run.csv"
    rows = np.column_stack([columns[:, 0], np.round(columns[:, 1:], 4)])
    rows[7, 1:4] = np.nan  # a sample that was lost
    file.write_text(text(rows, head), encoding="utf-8")
    with pytest.warns(symtop.SymtopWarning, match="not a number from t = 0.7"):
        assert symtop.judge(file)["axis_error"].value < 1e-3
    turned, swapped = columns.copy(), columns[:, [0, 2, 1, 3, 4, 5, 6, 7]]
    direction = np.cross(turned[40, 1:4], [0.0, 0.0, 1.0])
    turned[40, 1:4] += 2e-3 * direction / np.linalg.norm(direction)
    for rows, words in ((swapped, r"at t = .* the axis is \d.* rad"), (turned, r"at t = 4 the axis is 0\.002 rad")):
        file.write_text(text(rows, head), encoding="utf-8")
        message = " ".join(call("judge", file, code=2).stderr.split())
        assert re.search(f"axis and quaternion must show one attitude within 0.001 rad, but {words}", message)
    assert symtop.judge({"time": turned[:, 0], "axis": turned[:, 1:4]})["axis_error"].value > 1e-3  # it is alone
    turned[:, 1:] = columns[:, 1:] * [1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0]
    file.write_text(text(turned, head), encoding="utf-8")
    assert "the true one if it is read as from space to body" in " ".join(call("judge", file, code=2).stderr.split())


def of_body(scene, change=1.0):
    """Time, attitudes and rates of the exact motion of a body, the rates in units of `change` rad per unit time."""
    truth = symtop.reference(scene, np.linspace(0.0, 20.0, 101))
    q, moments = truth["quaternion"].values, symtop.scene(scene, bodies=True).top.moments
    rates = rotated(q * CONJUGATE, truth["momentum"].values) / np.array(moments)
    return np.column_stack([truth["time"].values, q, change * rates])


CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
OF_BODY = "time,qw,qx,qy,qz,wx,wy,wz"


@pytest.mark.parametrize("scene", ["check-case-2", "heavy-brick", "tennis-racket"])
def test_a_body_is_judged_by_attitudes_and_rates(scene, tmp_path):
    file, true = tmp_path / "run.csv", of_body(scene)
    file.write_text(text(true, OF_BODY), encoding="utf-8")
    ledger = symtop.judge(file, scene=scene, conserves=["p_phi"], energy="kept")
    assert {"attitude_error", "momentum_error", "rates_error", "energy", "p_phi"} <= {*ledger}
    assert "p_psi" not in ledger
    assert max(finding.value for finding in ledger.findings if finding.claim.endswith("_error")) < 1e-13
    assert [ledger[name].verdict for name in ("energy", "p_phi")] == ["confirmed"] * 2
    turned = true.copy()  # an attitude that creeps, and rates that are right
    turned[:, 1:5] = [product(rows[1:5], (1.0, 1e-4 * rows[0], 0.0, 0.0)) for rows in true]
    file.write_text(text(turned, OF_BODY), encoding="utf-8")
    ledger = symtop.judge(file, scene=scene)
    assert ledger["attitude_error"].value == pytest.approx(2.0 * np.arctan(1e-4 * true[-1, 0]), rel=1e-9)
    assert (ledger["rates_error"].value < 1e-13, ledger["momentum_error"].value > 1e-5) == (True, True)
    file.write_text(text(of_body(scene, 1.001), OF_BODY), encoding="utf-8")
    expected = 1e-3 * np.linalg.norm(true[:, 5:], axis=1).max()
    assert symtop.judge(file, scene=scene)["rates_error"].value == pytest.approx(expected, rel=1e-9)


def test_a_conjugate_attitude_of_a_body_is_refused_although_it_starts_right(tmp_path):
    """The scene starts where body and space axes agree."""
    file, table = tmp_path / "run.csv", of_body("check-case-2")
    table[:, 1:5] *= CONJUGATE
    file.write_text(text(table, OF_BODY), encoding="utf-8")
    result = call("judge", file, "--scene", "check-case-2", code=2)
    assert "its sample at t = 0.2 is the true one if it is read as from space to body" in result.stderr
    axis, part = text(table[:, [0, 5, 6, 7]], "time,wx,wy,wz"), np.copy(table[:, :5])
    for content, words in [
        (axis, "one of axis, quaternion, theta"),
        (text(part[::-1], OF_BODY[:16]), "at least 0 and increase, but sample 1 is at"),
        (text(part * [1.0, 2.0, 2.0, 2.0, 2.0], OF_BODY[:16]), "quaternion must be of length 1, at first within 0.5"),
        (text(table[:, [0, 3, 5, 6, 7]], "time,theta,wx,wy,wz").replace(",-0.", ",0."), "rows of 3 beside an attitude"),
    ]:
        file.write_text(content, encoding="utf-8")
        with pytest.raises(symtop.SymtopError, match=words):
            symtop.judge(str(file), scene="check-case-2")


def test_the_true_motion_keeps_everything_and_rates_of_a_top_are_its_momentum():
    truth = symtop.reference(SPHEROID, np.linspace(0.0, 60.0, 801))
    names = ("axis", "quaternion", "energy", "p_phi", "p_psi")
    columns = {"time": truth["time"].values} | {name: truth[name].values for name in names}
    ledger = symtop.judge(columns, conserves=["p_phi", "p_psi"], energy="kept")
    assert ({ledger[name].verdict for name in ("energy", "p_phi", "p_psi")}, ledger.refuted) == ({"confirmed"}, [])
    assert max(ledger[f"{name}_error"].value for name in ("axis", "attitude", "theta")) < 1e-13
    top = SPHEROID.top
    run = symtop.simulate(SPHEROID, "strang[attitude]", step_size=1e-3, horizon=3.0, samples=31)
    q, axis, rates = run["quaternion"].values, run["axis"].values, np.ones((run.time.size, 3)) * [0.3, -0.2, 0.5]
    energy = symtop.judge({"time": run["time"].values, "quaternion": q, "omega_body": rates, "axis": axis})["energy"]
    moving = 0.5 * (top.I1 * 0.13 + top.I3 * 0.25) + top.mgl * axis[:, 2]
    assert energy.value == pytest.approx(np.abs(moving - moving[0]).max() / SPHEROID.energy_scale, rel=1e-9)
    start = symtop.Attitude((0.8, 0.6, 0.0, 0.0), (0.0, 0.0, 1e-8))  # |L| becomes 1e8 times that
    scene = symtop.Scene("let-go", symtop.scene("heavy-brick", bodies=True).top, start, 20.0)
    time, q, rates = np.split(of_body(scene), [1, 5], axis=1)
    ledger = symtop.judge({"time": time[:, 0], "quaternion": q, "omega_body": rates}, scene=scene, conserves=["p_phi"])
    assert (ledger["p_phi"].verdict, ledger["rates_error"].resolution > 1e-15) == ("confirmed", True)


def test_one_sample_is_judged_and_the_first_nutation_of_a_bounded_energy_is_no_growth(tmp_path):
    """6.8 nutations of a splitting do not refute its bounded energy; those of a method that gains energy do."""
    for time in (0.0, 0.5):
        theta = symtop.reference(SPHEROID, [time])["theta"].item() + 0.05
        (tmp_path / "one.csv").write_text(f"time,theta,energy\n{time},{theta!r},1\n", encoding="utf-8")
        ledger = symtop.judge(tmp_path / "one.csv", energy="bounded")
        assert (ledger["theta_error"].value, ledger["energy"].verdict) == (pytest.approx(0.05), "undecided")
    runs = (symtop.simulate("spheroid", name, step_size=0.01, guard=False) for name in ("strang", "rkmk-se3-2"))
    splitting, gaining = (symtop.judge(run, scene="spheroid", energy="bounded")["energy"] for run in runs)
    assert (splitting.verdict == "refuted", gaining.verdict) == (False, "refuted")
    assert splitting.measured.kind != "drift"
