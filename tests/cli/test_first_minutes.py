"""What somebody new meets in the first minutes: each point was a complaint of a trial, and stays mended."""

import re
import shlex
import time

import pytest
from terminal import record

import symtop
from symtop.core import netcdf, progress
from symtop.measure.verdicts import ACCURATE_ERROR
from symtop.methods.framework.registry import split_name
from symtop.run.guard import EXPECTED
from tests.commands import call

AXIS_ONLY = """\
import symtop

options = {"solvers": {"axis": symtop.integrator("rk4").solvers["axis"]}, "order": 4, "implementation": "python"}
symtop.register(symtop.Integrator("on-the-axis", "other", "rk4 on the axis alone", **options))
top, start = symtop.SymmetricTop(1.5, 1.0, 3.0), symtop.Angles(theta=1.0, psi_dot=4.0)
symtop.register_scene(symtop.Scene("of-a-user", top, start, horizon=6.0))
"""


def test_one_method_alone_takes_part_in_a_study_on_a_users_scene_too(tmp_path):
    axis_only = tmp_path / "axis_only.py"
    axis_only.write_text(AXIS_ONLY, encoding="utf-8")
    tmp_path /= "two words"
    words = ["study", "convergence", "--quick", "--only", "on-the-axis", "--results", tmp_path, "--plugin", axis_only]
    lines = call(*words).output.splitlines()
    assert f"next: symtop report --results '{tmp_path / 'quick' / 'only'}', one" in lines[-1]
    data = netcdf.read(tmp_path / "quick" / "only" / "convergence.nc")
    assert {split_name(str(row))[0] for row in data["variant"].values} == {"on-the-axis"}
    assert "of-a-user" in data["scene"]
    assert data.sizes["scene"] > 1
    assert not (tmp_path / "quick" / "convergence.nc").exists()
    assert {file.suffix for file in (tmp_path / "quick" / "only" / "figures").iterdir()} == {".png"}  # no PDF to print
    assert call(*words, "--status").output.strip() == f"convergence: {lines[0].split()[1]} done"
    call("report", "--results", tmp_path / "quick" / "only", "--plugin", axis_only)
    page = (tmp_path / "quick" / "only" / "report.html").read_text(encoding="utf-8")
    assert "on-the-axis" in page
    assert "of-a-user" in page
    call("study", "convergence", "--only", "no-such", code=2)
    result = call("study", "truth", "--quick", "--only", "on-the-axis", "--plugin", axis_only, code=2)
    assert "study truth has no case of on-the-axis" in result.stderr
    for name in ("on-the-axis", "on-the-axis,exact"):  # exact is the closed form, which stays where others are measured
        words = ["--quick", "--only", name, "--status", "--results", tmp_path, "--plugin", axis_only]
        result = call("study", "truth", "convergence", *words)
        assert "study truth has no case of on-the-axis" in result.stderr
        assert result.stderr.rstrip().endswith("it is left out")
        assert result.stdout.startswith("convergence: ")


def test_a_proposed_step_is_of_use_and_the_guard_warns_of_what_the_verdict_calls_wrong():
    assert EXPECTED == ACCURATE_ERROR
    coarse = call("run", "spheroid", "midpoint", "--step-size", "0.01")
    assert "expect an axis error" in coarse.stderr
    assert "judged against the truth: bounded but wrong, the axis error passed 0.01 rad" in coarse.stdout
    fine = call("run", "spheroid", "midpoint", "--step-size", "0.002")
    assert fine.stderr == ""
    assert "judged against the truth: accurate to" in fine.stdout
    # The error that it leads to is between a tenth and ten times the 1e-3 rad that it is proposed for.
    for name in ("midpoint", "strang", "rk4", "gauss-4"):
        step = float(call("run", "spheroid", name, code=2).stderr.split("for example ")[1])
        error = float(symtop.errors(symtop.simulate("spheroid", name, step_size=step, guard=False))["axis"].max())
        assert 1e-5 < error < 1e-2


def test_a_bar_is_drawn_again_while_nothing_is_finished(monkeypatch):
    refreshes = []
    monkeypatch.setattr(progress, "REDRAW_SECONDS", 0.01)
    monkeypatch.setattr(progress, "is_terminal", lambda _: True)
    monkeypatch.setattr("tqdm.tqdm.refresh", lambda *_, **__: refreshes.append(1))
    with progress.progress_bar("a bar"):
        time.sleep(0.1)
    count = len(refreshes)
    assert count >= 3
    time.sleep(0.05)
    with progress.progress_bar("a bar", quiet=True):
        time.sleep(0.05)
    assert len(refreshes) == count


@pytest.mark.slow  # half a minute: lanes of one method are compiled
def test_a_cold_ensemble_is_never_silent_for_long_and_a_recording_hears_a_silence(tmp_path):
    words = "ensemble strang --members 2000 --per-nutation 50 --nutations 2"
    recording = record(words.split(), SYMTOP_CACHE=str(tmp_path))
    assert recording.code == 0, recording.text
    assert recording.silence < 2.0
    assert recording.widest <= 80
    # Negative control: a plug-in that sleeps while it is loaded, and a table of every column.
    (tmp_path / "sleeps.py").write_text("import time\ntime.sleep(2.1)\n")
    recording = record(["scenes", "--wide", "--plugin", str(tmp_path / "sleeps.py")])
    assert recording.silence > 2.0
    assert recording.widest > 80


@pytest.mark.quick
def test_the_command_of_a_recommendation_holds_the_options_of_the_body():
    body = ["--body", "2,1.5,1", "--rates=-0.1,0,3"]
    output = call("recommend", "body", *body, "--accuracy", "1e-3", "--needs", "derivative", "--horizon", "10").output
    (command,) = re.findall(r"^Run it: symtop (.*)$", output, re.MULTILINE)
    assert " --horizon 10.0 " in command
    assert command.endswith(" --body 2.0,1.5,1.0 --rates -0.1,0.0,3.0")
    assert "accurate to" in call(*shlex.split(command)).output
