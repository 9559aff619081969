"""Hostile conditions: each ends with one sentence, its documented code and no partial file, and nothing is lost."""

import errno
import json
import os
import random
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
import xarray as xr

from symtop.core import files, netcdf
from symtop.core.errors import SymtopError
from symtop.core.signals import at_most
from symtop.runner import pool as work, run as runner, store
from tests.commands import PROBE, assert_identical, contents, finish, leftovers, probe, stdout_of, stop, symtop
from tests.kills import survive


def assert_refused(results, message):
    """One sentence, code 2, nothing partial."""
    output = probe(results, code=2)
    assert output.count("\n") == 1, output
    assert output.startswith("symtop: cannot write")
    assert message in output
    assert not leftovers(Path(results)) if Path(results).is_dir() else True


def test_a_full_disk_ends_the_run_and_what_was_computed_is_kept(tmp_path, monkeypatch):
    original, count = np.savez, []

    def full(*arguments, **options):
        count.append(1)
        if len(count) > 2:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return original(*arguments, **options)

    monkeypatch.setattr(np, "savez", full)
    assert_refused(tmp_path, "No space left on device")
    assert len(count) == 3  # the third case was the last one tried
    assert len(list(tmp_path.rglob("cases/probe/*.npz"))) == 2
    monkeypatch.undo()
    assert "2 of 4 cases computed" in probe(tmp_path)


@pytest.mark.parametrize(("place", "name", "error", "message"), [
    (xr.Dataset, "to_netcdf", RuntimeError("NetCDF: HDF error"), "NetCDF: HDF error"),
    (store.tempfile, "TemporaryFile", OSError(errno.EROFS, os.strerror(errno.EROFS)), "Read-only file system"),
])  # fmt: skip
def test_what_the_netcdf_library_or_the_system_refuses_to_write(tmp_path, monkeypatch, place, name, error, message):
    monkeypatch.setattr(place, name, Mock(side_effect=error))
    assert_refused(tmp_path, message)
    if place is xr.Dataset:
        monkeypatch.setattr(netcdf, "LITTLE_SPACE", 1e30)
        assert_refused(tmp_path, "no room is left")


def sentences(err):
    """What was written but lines of progress, of which a slow machine shows more."""
    return [line for line in err.splitlines() if not re.search(r", \d+ s$", line)]


@pytest.mark.slow
def test_a_real_limit_on_the_size_of_files(tmp_path):
    """The kernel refuses to let files grow beyond 8 kB: every write fails as on a full disk, in workers too."""
    stdout_of(symtop("study", PROBE, "--results", tmp_path / "warm"))  # kernels are cached now
    code = "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192)); "
    code += "from symtop.cli.main import main; sys.argv[0] = 'symtop'; main()"
    command = [sys.executable, "-c", code, "study", str(PROBE), "--results", str(tmp_path / "small")]
    result = subprocess.run(command, capture_output=True, text=True, timeout=240, check=False)
    assert result.returncode == 2, result.stderr
    assert sentences(result.stderr)[0].startswith("symtop: cannot write")
    assert "Traceback" not in result.stderr
    assert not list((tmp_path / "small").rglob("*.npz"))
    assert not leftovers(tmp_path / "small")


@pytest.mark.parametrize("place", ["quick", "quick/cases", "quick/cases/probe", "quick/figures"])
def test_a_file_where_a_folder_should_be(tmp_path, place):
    (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / place).write_text("I was here first")
    assert_refused(tmp_path, str(tmp_path / "quick"))
    assert (tmp_path / place).read_text() == "I was here first"


def test_files_where_folders_should_be_and_folders_where_files(tmp_path):
    (tmp_path / "file").touch()
    assert "is a file" in probe(tmp_path / "file", code=2)
    assert_refused("/proc/nowhere", "/proc/nowhere")
    probe(tmp_path)
    for name in ("probe.nc", "probe.json", "figures/probe-energy.png"):
        target = tmp_path / "quick" / name
        (tmp_path / "quick" / "probe.nc").unlink(missing_ok=True)  # so that there is something to do
        target.unlink(missing_ok=True)
        target.mkdir()
        assert_refused(tmp_path, "it is a folder")
        target.rmdir()
    case = next((tmp_path / "quick" / "cases" / "probe").glob("*.npz"))
    case.unlink()
    case.mkdir()
    assert_refused(tmp_path, "it is a folder")


def test_truncated_damaged_and_foreign_files_are_computed_again(tmp_path):
    probe(tmp_path)
    before, cases = contents(tmp_path), sorted((tmp_path / "quick" / "cases" / "probe").glob("*.npz"))
    content = cases[0].read_bytes()
    with np.load(cases[1]) as file:
        arrays = dict(file)
    cases[0].write_bytes(content[: len(content) // 2])
    np.savez(cases[1], **arrays | {"0": arrays["0"] * (1.0 + 1e-15)})  # readable, and not what it says
    np.savez(cases[2], energy=[1.0])  # somebody else's
    cases[3].write_bytes(content)  # another case's file under this name
    assert "4 of 4 cases computed" in probe(tmp_path)
    after = contents(tmp_path)
    assert all(before[name].identical(after[name]) for name in before)
    assert "0 of 4 cases computed" in probe(tmp_path)
    record = str(arrays["about"]).replace('"made_of": {', '"made_of": {"code nothing.py": "0", ')
    np.savez(cases[1], **arrays | {"about": record})  # the numbers are right, and what is said of them is not
    assert "1 of 4 cases computed" in probe(tmp_path)


def test_a_lock_keeps_others_out_and_ends_with_its_holder(tmp_path):
    path, order = tmp_path / "case.nc", []

    def wait():
        with files.locked(path, wait=True) as ours:
            order.append(ours)

    with files.locked(path, wait=False) as ours:
        assert ours
        with files.locked(path, wait=False) as second:
            assert not second
        waiting = threading.Thread(target=wait)
        waiting.start()
        time.sleep(0.1)
        assert order == []
    waiting.join(5.0)
    assert order == [True]
    assert not list(tmp_path.iterdir())
    files.lock_path(path).touch()  # what a killed process leaves
    with files.locked(path, wait=False) as ours:
        assert ours


@pytest.mark.slow
def test_two_runs_at_once_share_the_work_and_agree(tmp_path):
    log, words = tmp_path / "log", ["study", PROBE, "--results", tmp_path / "shared", "--jobs", 2]
    runs = [symtop(*words, PROBE_LOG=log, PROBE_PAUSE=0.3) for _ in range(2)]
    for run in runs:
        assert "of 12 cases computed" in stdout_of(run)
    names = log.read_text().split()
    assert len(names) == len(set(names)) == 12
    stdout_of(symtop("study", PROBE, "--results", tmp_path / "alone"))
    assert_identical(tmp_path / "shared", tmp_path / "alone")
    assert not leftovers(tmp_path / "shared")


def test_damaged_findings_and_what_a_killed_worker_left_are_made_again(tmp_path):
    probe(tmp_path)
    path = tmp_path / "quick" / "probe.json"
    findings = json.loads(path.read_text())
    for damage in ("", "{", "[1, 2]", '{"stamp": 3}', "\0\0\0"):
        path.write_text(damage)
        assert "0 of 4 cases computed" in probe(tmp_path), damage
        assert json.loads(path.read_text()) == findings
    (case,) = tmp_path.rglob("cases/probe/goldstein--midpoint--*.npz")
    case.unlink()
    paths = case.with_name(f".{case.stem}.trace"), files.lock_path(case), case.with_name(f".{case.name}.x.part.nc")
    for name in paths:
        name.touch()
    assert "1 of 4 cases computed" in probe(tmp_path)
    assert not leftovers(tmp_path)


def wait_for_cases(log: Path, count: int, process) -> None:
    """Wait until so many cases have begun."""
    end = time.monotonic() + 120.0
    while time.monotonic() < end and process.poll() is None:
        if log.is_file() and len(log.read_text().split()) >= count:
            return
        time.sleep(0.02)
    code = process.poll()
    stop(process)
    pytest.fail(f"it never came to {count} cases: {code}")


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(2, 130), (15, 143), (1, 143)])
@pytest.mark.parametrize("quick", [True, False])
def test_an_interrupt_keeps_what_was_computed(tmp_path, number, code, quick):
    log = tmp_path / "log"
    words = ["study", PROBE, "--results", tmp_path / "r", "--jobs", 2, *(["--quick"] if quick else [])]
    process = symtop(*words, PROBE_LOG=log, PROBE_PAUSE=0.5)
    wait_for_cases(log, 3 if quick else 5, process)
    os.killpg(process.pid, number) if number == signal.SIGHUP else process.send_signal(number)  # as a terminal does
    start = time.monotonic()
    status, _, err = finish(process)
    assert time.monotonic() - start < 10.0
    assert status == code
    word = "interrupted" if number == signal.SIGINT else "terminated"
    assert sentences(err) == [f"symtop: {word}; what was computed is kept, and the same command goes on from there"]
    assert not leftovers(tmp_path / "r")
    count = len(list((tmp_path / "r").rglob("cases/probe/*.npz")))
    assert count >= 1, [path.read_text() for path in (tmp_path / "r").rglob("*.failed.json")]
    assert f"{(4 if quick else 12) - count} of" in stdout_of(symtop(*words, PROBE_LOG=log))
    assert not leftovers(tmp_path / "r")


@pytest.mark.slow
@pytest.mark.parametrize(("words", "longest", "kills"), [  # python -m tests.kills --all: 30
    ([PROBE], 2.5, 10), (["convergence", "factors", "reduction", "--quick"], 15.0, 6)])  # fmt: skip
def test_kill_9_at_random_moments(tmp_path, words, longest, kills):
    outcome = survive(words, tmp_path, longest, kills)
    assert outcome.kills == kills
    assert outcome.lost > 0  # some of the kills did come in the middle of a case
    print(outcome)


@pytest.mark.slow
def test_a_worker_that_is_killed_costs_no_more_than_what_it_was_computing(tmp_path):
    log = tmp_path / "log"
    process = symtop("study", PROBE, "--results", tmp_path / "r", "--jobs", 2, PROBE_LOG=log, PROBE_PAUSE=0.5)
    wait_for_cases(log, 4, process)
    workers = [int(pid) for pid in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()]
    spawned = [pid for pid in workers if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]
    os.kill(spawned[0], signal.SIGKILL)
    assert "12 of 12 cases computed" in stdout_of(process)
    names = log.read_text().split()
    assert len(names) - len(set(names)) <= 2  # one case a worker


BAD = """
import itertools, os, time
import numpy as np
import symtop
from symtop.methods.framework.plan import Run

def raises(top, start, plan):
    raise RuntimeError("no luck")

def hangs(top, start, plan):
    while True:
        time.sleep(0.01)

def deaf(top, start, plan):
    sum(itertools.repeat(0))  # never returns to the interpreter, like a compiled loop

def exits(top, start, plan):
    os._exit(7)

def answers(states):
    n = lambda plan: plan.times.size
    return lambda top, start, plan: Run(states(n(plan)), np.ones(n(plan)), np.ones(n(plan)), 1, 1, 0, "ok", 8.0)

METHODS = {
    "raises": raises, "hangs": hangs, "deaf": deaf, "exits": exits,
    "nan": answers(lambda n: np.full((n, 4), np.nan)), "shape": answers(lambda n: np.ones((n, 3))),
}
for name, solve in METHODS.items():
    symtop.register(symtop.Integrator(name=f"bad-{name}", family="other", summary="", solvers={"angles": solve}))
"""


@pytest.mark.slow
def test_methods_that_raise_hang_end_their_process_or_return_nonsense(tmp_path):
    plugin = tmp_path / "bad.py"
    plugin.write_text(BAD)
    results = tmp_path / "r"
    words = ["study", PROBE, "--results", results, "--jobs", 2]
    stdout_of(symtop(*words))  # the good ones have compiled their kernels
    code, out, err = finish(symtop(*words, "--plugin", plugin, "--limit", 3))
    assert code == 1
    assert "2 of 24 cases computed" in out  # those that return NaN: a result like any other
    expected = {
        "raises": "RuntimeError: no luck", "hangs": "it was not done after 3 s", "exits": "its process was ended",
        "deaf": "it was not done after 3 s and did not answer", "shape": "must return a Run with real states",
    }  # fmt: skip
    lines = sentences(err)
    assert len(lines) == 2 * len(expected)
    for name, sentence in expected.items():
        own_lines = [line for line in lines if f"bad-{name} on " in line]
        assert len(own_lines) == 2, err
        assert all(sentence in line for line in own_lines), own_lines
    data = netcdf.read(results / "probe.nc")
    assert list(data["outcome"].sel(variant="bad-nan").values) == ["not_finite", "not_finite"]
    data = data.drop_sel(variant="bad-nan")
    assert (set(data["outcome"].values.ravel()), data.sizes["variant"]) == ({"ok"}, 6)
    records = [json.loads(path.read_text()) for path in results.rglob("*.failed.json")]
    assert len(records) == 10
    assert any("raise RuntimeError" in line for r in records for line in r["traceback"])
    assert any("in deaf" in line for r in records for line in r["traceback"])
    assert not leftovers(results)
    code, out, _ = finish(symtop("study", PROBE, "--results", results, "--plugin", plugin, "--status", "--json"))
    assert code == 1
    states = [row["state"] for row in json.loads(out)["probe"]]
    assert (states.count("failed"), states.count("done")) == (10, 14)


def test_a_case_has_its_time_and_the_limit_is_heard_by_the_runner(tmp_path, monkeypatch):
    with pytest.raises(TimeoutError, match="not done after"), at_most(0.05, processor=False):
        time.sleep(60.0)
    with at_most(0.2, processor=False):
        pass
    time.sleep(0.3)  # nothing comes later
    assert signal.getitimer(signal.ITIMER_REAL)[0] == 0.0
    monkeypatch.setenv("PROBE_PAUSE", "1.0")
    output = probe(tmp_path, "--limit", 0.05, code=2)  # not one case could be measured
    assert "TimeoutError: it was not done after 0.05 s" in output
    probe(tmp_path, "--limit", -1, code=2)


def test_paths_that_are_not_ascii(tmp_path):
    place, plugin = tmp_path / "Ergebnisse für θ – 結果", tmp_path / "méthode_à_moi.py"
    plugin.write_text("import symtop\n")
    probe(place, "--plugin", plugin)
    assert len(contents(place)) == 5


def test_a_clock_that_jumps(tmp_path, monkeypatch):
    probe(tmp_path / "calm")
    draw = random.Random(1)
    monkeypatch.setattr(time, "time", lambda: draw.uniform(-1e9, 4e9))
    probe(tmp_path / "r")
    monkeypatch.undo()
    assert_identical(tmp_path / "calm", tmp_path / "r")


@pytest.mark.slow
@pytest.mark.parametrize("closed", ["0", "1", "2", "012"])
def test_no_terminal_and_closed_streams(tmp_path, closed):
    words = f"{sys.executable} -m symtop.cli study {PROBE} --results {tmp_path / 'r'} --jobs 2"
    words += "".join(f" {n}>&-" if n != "0" else " 0<&-" for n in closed)
    result = subprocess.run(["/bin/sh", "-c", words], timeout=240, check=False)
    assert (result.returncode, len(contents(tmp_path / "r"))) == (0, 13)


def test_errors_of_the_place_are_not_errors_of_a_case(tmp_path):
    """Sources that changed under a running study end it: nothing else would do better."""
    study = runner.load(str(PROBE))
    case = study.cases(True)[0]
    path = store.case_path(tmp_path, study, case)
    task = work.Task(str(PROBE), case, path, (), 10.0)
    assert (work.execute_case(task).state, work.execute_case(task).state) == ("computed", "found")
    assert work.execute_case(task._replace(fresh=True)).state == "computed"
    control = path.with_name(path.name.replace(store.digest_of(path), "0" * 20))
    with pytest.raises(SymtopError, match="not those that the study was started with"):
        work.execute_case(task._replace(path=control))
    with files.locked(path, wait=False):
        assert work.execute_case(task).state == "busy"
