"""Studies that are concluded in a process of their own, beside the next one: the same files, whatever happens to it."""

import contextlib
import json
import os
import time
from dataclasses import replace

import pytest
import xarray as xr

import symtop
from symtop.core import files
from symtop.runner import run as runner, store
from symtop.runner.cases import StudyCases
from symtop.runner.pool import Pool
from symtop.runner.run import analyse_stored, drawing_digest
from tests.commands import assert_identical, code_and_output, leftovers

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

def facts(data):
    if NAME == "killed" and os.getpid() != int(os.environ["SYMTOP_TESTS_PARENT"]):
        os.kill(os.getpid(), signal.SIGKILL)
    if NAME == "silent":
        raise SymtopError("study silent has nothing to say")
    return {"letters": float(data["letters"].sum()), "said_by": os.getpid()}

STUDY = Study(NAME, NAME, "Who?", cases, measure, facts)
"""


@pytest.fixture
def script(tmp_path):
    """Writes the study of a name, and returns its file."""

    def write(name):
        file = tmp_path / f"{name}.py"
        file.write_text(f"NAME = {name!r}\n{SCRIPT}")
        return str(file)

    return write


@pytest.fixture(scope="module")
def pool():
    with pytest.MonkeyPatch.context() as environment, Pool(2) as workers:
        environment.setenv("SYMTOP_TESTS_PARENT", str(os.getpid()))
        yield workers


@pytest.fixture
def shared(pool, monkeypatch):
    """The command has the workers of this file, and starts none."""
    monkeypatch.setattr("symtop.runner.pool.Pool", lambda *_: contextlib.nullcontext(pool))


def run_studies(results, *files):
    """Exit code and output of one command for several studies."""
    return code_and_output("study", *files, "--results", results, "--jobs", 2)


def process_of(results, name):
    return json.loads((results / f"{name}.json").read_text())["facts"]["said_by"]


@pytest.mark.usefixtures("shared")
def test_each_of_several_is_concluded_by_another_process_to_the_same_files(script, tmp_path):
    files = [script("first"), script("second")]
    code, output = run_studies(tmp_path / "together", *files)
    assert code == 0, output
    assert output.index("first: 2 of 2") < output.index("second: 2 of 2")
    assert {process_of(tmp_path / "together", name) == os.getpid() for name in ("first", "second")} == {False}
    for file in files:
        assert run_studies(tmp_path / "alone", file)[0] == 0  # the control: one by itself has nothing to run beside
    assert {process_of(tmp_path / "alone", name) for name in ("first", "second")} == {os.getpid()}
    assert assert_identical(tmp_path / "together", tmp_path / "alone") == 6
    assert "0 of 2 cases computed" in run_studies(tmp_path / "together", *files)[1]
    assert not leftovers(tmp_path / "together")


@pytest.mark.slow
@pytest.mark.usefixtures("shared")
def test_a_process_that_is_killed_is_done_without(script, tmp_path):
    code, output = run_studies(tmp_path / "r", script("killed"), script("second"))
    assert code == 0, output
    assert process_of(tmp_path / "r", "killed") == os.getpid()
    assert "second: 2 of 2 cases computed" in output  # by whichever process was left
    assert not leftovers(tmp_path / "r")


def test_a_study_that_is_edited_before_it_is_concluded_is_drawn_again(script, tmp_path):
    files = {"first": script("first"), "second": script("second")}  # the second one, the control, is left as it is
    for name, file in files.items():
        study = runner.load(file)
        cases = StudyCases(study, tmp_path / "r")
        runner.run(study, tmp_path / "r", quiet=True)
        cases.add(study.grid())
        store.manifest(tmp_path / "r").unlink()
        drawing = drawing_digest(study, None) if name == "second" else "before the edit"
        analyse_stored(file, (), tmp_path / "r", cases.cases, [], "made of", drawing, None, quick=False)
        assert store.is_current(tmp_path / "r", name, "made of") is (name == "second")


@pytest.mark.usefixtures("shared")
@pytest.mark.parametrize("kind", ["refused", "silent"])
def test_what_stops_one_study_does_not_stop_the_others(script, tmp_path, kind):
    """A grid that is refused ends the command after those before it; of findings that fail the next go on."""
    code, output = run_studies(tmp_path / "r", script("first"), script(kind), script("second"))
    assert code == 2
    assert "first: 2 of 2 cases computed" in output
    assert (tmp_path / "r" / "first.json").is_file()
    assert f"study {kind} has" in output
    assert ("second: 2 of 2 cases computed" in output) == (kind == "silent")
    assert (tmp_path / "r" / "second.json").is_file() == (kind == "silent")
    assert not leftovers(tmp_path / "r")


def test_what_an_ended_process_has_left_is_removed(script, tmp_path):
    study = runner.load(script("first"))
    (tmp_path / "figures").mkdir()
    (tmp_path / "cases" / "first").mkdir(parents=True)
    parts = [tmp_path / name for name in (".first.nc.x.part", ".first.json.y.part", "figures/.first-a.png.z.part.png")]
    other_parts = [tmp_path / name for name in (".other.nc.x.part", "figures/.other-a.png.z.part.png")]
    for file in (*parts, *other_parts):
        file.touch()
    with files.locked(tmp_path / "first.nc", wait=True):
        store.tidy(tmp_path, study)
        assert all(file.is_file() for file in parts)  # somebody writes them
    store.tidy(tmp_path, study)
    assert not any(file.is_file() for file in parts)
    assert all(file.is_file() for file in other_parts)


def test_a_case_whose_file_is_gone_has_failed_and_timed_cases_wait_for_analyses(script, tmp_path, pool, monkeypatch):
    """The study is not taken for whole without it, and the next run computes it again."""
    study, results, analyse, paths = runner.load(script("first")), tmp_path / "r", pool.analyse, []

    def lose(*task):
        paths.append(min((results / "cases" / "first").glob("*.npz")))
        paths[0].unlink()
        return analyse(*task)

    with monkeypatch.context() as patch:
        patch.setattr(pool, "analyse", lose)
        (failure,) = runner.start(study, results, pool, quiet=True, beside=True).result()["failures"]
    (path,) = (results / "cases" / "first").glob("*.npz")
    assert paths[0].name in failure
    assert path.name not in failure
    result = runner.start(study, results, pool, quiet=True).result()
    assert (result["failures"], result["computed"]) == ([], 1)
    states, future = [], pool.analyse(time.sleep, 0.3)
    measure = lambda _: states.append(future.done()) or xr.Dataset()
    for timed in (False, True):
        study = replace(runner.load(script("first")), timed=timed, measure=measure)
        symtop.register_scene(replace(symtop.scene("spheroid"), name=f"here-{timed}"))  # cases of this process
        study = replace(study, cases=lambda _, name=f"here-{timed}": [symtop.Case(name, "midpoint")])
        runner.start(study, tmp_path / "r", pool, quiet=True)
    assert states == [False, True]
