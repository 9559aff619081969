"""Studies that are concluded in a process of their own, beside the next one: the same files, whatever happens to it."""

import json
import os
import time
from concurrent.futures import BrokenExecutor
from dataclasses import replace
from pathlib import Path

import pytest
import xarray as xr
from click.testing import CliRunner
from symtop.runner.pools import Workers

from symtop.cli.main import main
from symtop.core import files
from symtop.core.errors import SymtopError
from symtop.runner import run as runner, store
from tests.commands import contents, leftovers

SCRIPT = """
import os, signal
import xarray as xr
from symtop.core.errors import SymtopError
from symtop.runner.study import Case, Study

def cases(quick):
    if NAME == "refused":
        raise SymtopError("study refused has no grid")
    return [Case("spheroid", name) for name in ("midpoint", "strang")]

def measure(case):
    return xr.Dataset({"letters": float(len(case.integrator))})

def verdict(data):
    if NAME == "killed" and os.getpid() != int(os.environ["SYMTOP_TESTS_PARENT"]):
        os.kill(os.getpid(), signal.SIGKILL)
    if NAME == "silent":
        raise SymtopError("study silent has nothing to say")
    return [str(float(data["letters"].sum())), f"said by {os.getpid()}"]

STUDY = Study(NAME, NAME, "Who?", "", cases, measure, lambda data: [], verdict)
"""


@pytest.fixture
def script(tmp_path, monkeypatch):
    """Writes the study of a name, and returns its file."""
    monkeypatch.setenv("SYMTOP_TESTS_PARENT", str(os.getpid()))

    def written(name):
        file = tmp_path / f"{name}.py"
        file.write_text(f"NAME = {name!r}\n{SCRIPT}")
        return str(file)

    return written


def studied(results, *files):
    """Exit code and output of one command for several studies."""
    done = CliRunner().invoke(main, ["study", *files, "--results", str(results), "--jobs", "2"])
    return done.exit_code, done.output


def said_by(results, name):
    (sentence,) = [one for one in json.loads((results / f"{name}.json").read_text())["verdict"] if "said by" in one]
    return int(sentence.split()[-1])


def test_each_of_several_is_concluded_by_another_process_to_the_same_files(script, tmp_path):
    files = [script("first"), script("second")]
    code, told = studied(tmp_path / "together", *files)
    assert code == 0, told
    assert told.index("first: 2 of 2") < told.index("second: 2 of 2")
    assert {said_by(tmp_path / "together", name) == os.getpid() for name in ("first", "second")} == {False}
    for file in files:
        assert studied(tmp_path / "alone", file)[0] == 0  # the control: one by itself has nothing to run beside
    assert {said_by(tmp_path / "alone", name) for name in ("first", "second")} == {os.getpid()}
    one, other = contents(tmp_path / "together"), contents(tmp_path / "alone")
    assert one.keys() == other.keys()
    assert len(one) == 6
    assert all(one[name].identical(other[name]) for name in one)
    assert "0 of 2 cases computed" in studied(tmp_path / "together", *files)[1]
    assert not leftovers(tmp_path / "together")


def test_a_process_that_is_killed_is_done_without(script, tmp_path):
    code, told = studied(tmp_path / "r", script("killed"), script("second"))
    assert code == 0, told
    assert said_by(tmp_path / "r", "killed") == os.getpid()
    assert "second: 2 of 2 cases computed" in told  # by whichever process was left
    assert not leftovers(tmp_path / "r")


def test_what_begins_after_its_process_was_killed_says_so():
    """`findings` then concludes in this process; a call that was not killed (the control) answers."""
    with Workers(2) as workers:
        assert workers.beside(abs, -1.0).result() == 1.0
        killed, later = workers.beside(os.abort), workers.beside(abs, -1.0)
        with pytest.raises(BrokenExecutor):
            killed.result()
        with pytest.raises(BrokenExecutor):
            later.result()


def test_a_process_that_dies_stops_nobody_who_waits():
    """The next call is not handed over from a callback: from Python 3.12 on that waited for itself."""
    with Workers(2) as workers:
        promised = [workers.beside(os.abort), workers.beside(abs, -1.0)]
        workers.fill()
        for one in promised:
            with pytest.raises(BrokenExecutor):
                one.result()
        workers.quieten()


def test_a_case_whose_file_is_gone_has_failed(script, tmp_path):
    """The study is not taken for whole without it, and the next run computes it again."""
    study, results = runner.load(script("first")), tmp_path / "r"
    with Workers(2) as workers:
        answer = runner.begin(study, results, workers, quiet=True, beside=True)
        gone, other = sorted((results / "cases" / "first").glob("*.npz"))
        gone.unlink()
        (failure,) = answer()["failures"]
        assert gone.name in failure
        assert other.name not in failure
        again = runner.begin(study, results, workers, quiet=True)()
        assert (again["failures"], again["computed"]) == ([], 1)


def test_a_study_that_is_edited_before_it_is_concluded_is_drawn_again(script, tmp_path):
    files = [script("first"), script("second")]  # the second one, the control, is left as it is
    with Workers(2) as workers:
        answers = [runner.begin(runner.load(file), tmp_path / "r", workers, quiet=True, beside=True) for file in files]
        with Path(files[0]).open("a") as text:
            text.write("CAPTION = 'edited'\n")
        assert [answer()["stamp"] == "" for answer in answers] == [True, False]


def test_files_of_cases_are_not_read_where_they_are_handed_out(script, tmp_path, monkeypatch):
    """Only who concludes reads them, unless a second round hangs on them (the control)."""
    read, load = [], store.load_case

    def counted(path):
        data = load(path)
        if data is not None:
            read.append(path)
        return data

    monkeypatch.setattr(store, "load_case", counted)
    first, second = runner.load(script("first")), runner.load(script("second"))
    with Workers(2) as workers:
        answer = runner.begin(first, tmp_path / "r", workers, quiet=True, beside=True)
        assert read == []
        assert answer()["cases"] == 2
        assert read == []
        runner.begin(replace(second, follow_up=lambda _: []), tmp_path / "r", workers, quiet=True)
        assert len(read) == 2


@pytest.mark.parametrize("bad", ["refused", "silent"])
def test_what_stops_one_study_does_not_stop_the_others(script, tmp_path, bad):
    """A grid that is refused ends the command after those before it; of findings that fail the next go on."""
    code, told = studied(tmp_path / "r", script("first"), script(bad), script("second"))
    assert code == 2
    assert "first: 2 of 2 cases computed" in told
    assert (tmp_path / "r" / "first.json").is_file()
    assert f"study {bad} has" in told
    assert ("second: 2 of 2 cases computed" in told) == (bad == "silent")
    assert (tmp_path / "r" / "second.json").is_file() == (bad == "silent")
    assert not leftovers(tmp_path / "r")


@pytest.mark.parametrize("timed", [True, False])
@pytest.mark.parametrize("begun", [True, False])
def test_timed_cases_run_alone(script, tmp_path, timed, begun):
    """They wait for what runs beside them, and what has not begun waits for them; untimed ones begin it."""
    seen = []
    with Workers(2) as workers:
        promised = workers.beside(time.sleep, 1.0)
        if begun:
            promised.start()

        def measure(_):
            seen.append((promised._future is not None, promised.done()))
            return xr.Dataset()

        study = replace(runner.load(script("first")), timed=timed, measure=measure)
        runner.begin(study, tmp_path / "r", workers, quiet=True)
        expected = (begun, begun) if timed else (True, False)
        assert seen == [expected, expected]
        assert promised.result() is None  # asked for, it begins


def processes(workers):
    """How many processes each pool has: the one beside, and those that compute."""
    return [len(pool._processes) for pool in (workers._sideline._own, workers._pools.get(2)) if pool]


def test_what_runs_beside_runs_one_after_another_until_nothing_is_computed():
    """So that timed cases wait for one of them at most; at the end all run at once."""
    with Workers(2) as workers:
        promised = [workers.beside(time.sleep, 0.4) for _ in range(5)]
        workers.fill()
        assert [one.begun() for one in promised] == [True, False, False, False, False]
        workers.quieten()
        time.sleep(0.3)
        assert promised[0].done()
        assert not promised[1].begun()
        workers.fill()
        while not promised[2].begun():
            time.sleep(0.01)
        assert promised[1].done()
        assert not promised[3].begun()
        assert processes(workers) == [1]
        workers.finish()
        assert all(one.begun() for one in promised)
        assert [one.result() for one in promised] == [None] * 5
        assert processes(workers) == [1, 2]


def test_its_process_is_started_while_the_first_cases_are_computed_and_not_where_none_are(script, tmp_path):
    study = runner.load(script("first"))
    for again, expected in ((False, [1]), (True, [])):
        with Workers(2) as workers:
            answer = runner.begin(study, tmp_path / "r", workers, quiet=True, beside=True)
            assert processes(workers) == expected
            assert answer()["computed"] == (0 if again else 2)
            (tmp_path / "r" / "first.json").unlink()  # so that it is concluded again
    with Workers(2) as workers:  # a study by itself concludes in this process
        runner.begin(study, tmp_path / "other", workers, quiet=True)()
        assert processes(workers) == []


def test_a_timed_phase_waits_until_the_process_beside_has_started():
    with Workers(2) as workers:
        workers.open_beside()
        (started,) = workers._sideline._promised
        assert not started.done()
        workers.quieten()
        assert started.done()


def test_a_conclusion_waits_for_the_timed_study_that_follows(script, tmp_path):
    """Both are told in their order all the same."""
    first, second = runner.load(script("first")), runner.load(script("second"))
    with Workers(2) as workers:
        answer = runner.begin(first, tmp_path / "r", workers, quiet=True, beside=True)
        later = runner.begin(replace(second, timed=True), tmp_path / "r", workers, quiet=True)
        assert not answer.ready()
        assert later.ready()
        assert not (tmp_path / "r" / "first.json").is_file()
        assert answer()["cases"] == 2
        assert answer.ready()


def test_what_an_ended_process_has_left_is_removed(script, tmp_path):
    study = runner.load(script("first"))
    (tmp_path / "figures").mkdir()
    (tmp_path / "cases" / "first").mkdir(parents=True)
    left = [tmp_path / name for name in (".first.nc.x.part", ".first.json.y.part", "figures/.first-a.png.z.part.png")]
    others = [tmp_path / name for name in (".other.nc.x.part", "figures/.other-a.png.z.part.png")]
    for file in (*left, *others):
        file.touch()
    with files.locked(tmp_path / "first.nc", wait=True):
        store.tidy(tmp_path, study)
        assert all(file.is_file() for file in left)  # somebody writes them
    store.tidy(tmp_path, study)
    assert not any(file.is_file() for file in left)
    assert all(file.is_file() for file in others)


def test_a_study_that_says_nothing_is_told_when_it_is_asked(script, tmp_path):
    with Workers(2) as workers:
        answer = runner.begin(runner.load(script("silent")), tmp_path / "r", workers, quiet=True, beside=True)
        with pytest.raises(SymtopError, match="study silent has nothing to say"):
            answer()


def test_the_process_beside_compiles_the_closed_form_for_all():
    compiled = "__import__('symtop.model.exact.closed_form', fromlist=['_'])._build.compiled is not None"
    with Workers(2) as workers:
        assert not workers.beside(eval, compiled).result()
    with Workers(2) as workers:
        workers.open_beside()
        assert workers.beside(eval, compiled).result()
