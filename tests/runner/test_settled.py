"""With nothing to do, ``symtop study --all`` imports no study; whatever has changed, it looks at each of them."""

import json
import os
import subprocess
import sys

import pytest
from click.testing import CliRunner

from symtop.cli import study as command
from symtop.cli.main import main
from symtop.core import code_hash
from symtop.methods.framework import registry
from symtop.runner import scripts, settled

SCRIPT = """
import xarray as xr
from symtop.runner.study import Case, Study

def cases(quick):
    return [Case("spheroid", name) for name in ("midpoint", "strang")]

def measure(case):
    if NAME == "failing":
        raise ValueError("no number")
    return xr.Dataset({"letters": float(len(case.integrator))})

def verdict(data):
    return [str(float(data["letters"].sum()))]

STUDY = Study(NAME, NAME, "How many?", "", cases, measure, lambda data: [], verdict)
"""


@pytest.fixture
def every(tmp_path, monkeypatch):
    """Makes some small studies all that there are; returns the folder of their results."""

    def made(*names):
        files = [tmp_path / f"{name}.py" for name in names]
        for name, file in zip(names, files, strict=True):
            file.write_text(f"NAME = {name!r}\n{SCRIPT}")
        monkeypatch.setattr(scripts, "names", lambda: list(map(str, files)))
        return tmp_path / "r"

    return made


def studied(results, *words):
    done = CliRunner().invoke(main, ["study", "--all", "--results", str(results), "--jobs", "1", *words])
    return done.exit_code, done.output


@pytest.fixture
def looked(monkeypatch):
    """How often studies were loaded."""
    count, choose = [], command.choose
    monkeypatch.setattr(command, "choose", lambda *names, **options: count.append(1) or choose(*names, **options))
    return count


def test_nothing_to_do_is_told_as_before_and_loads_no_study(every, looked):
    results = every("one", "two")
    code, first = studied(results)
    assert code == 0
    assert first.count("2 of 2 cases computed") == 2
    before = len(looked)
    again = studied(results)
    assert again == (0, first.replace("2 of 2", "0 of 2"))
    summaries = json.loads(studied(results, "--json")[1])
    assert [(one["study"], one["computed"], one["cases"]) for one in summaries] == [("one", 0, 2), ("two", 0, 2)]
    assert len(looked) == before == 1


def lose_a_case(results):
    next((results / "cases" / "two").glob("*.nc")).unlink()


def add_a_case(results):
    (results / "cases" / "one" / "another.nc").touch()


def touch_a_dataset(results):
    os.utime(results / "one.nc", ns=(1, 1))


def spoil_the_note(results):
    (results / settled.NOTE).write_text("{")


def lose_the_note(results):
    (results / settled.NOTE).unlink()


@pytest.mark.parametrize("change", [lose_a_case, add_a_case, touch_a_dataset, spoil_the_note, lose_the_note])
def test_a_file_that_has_changed_makes_it_look_at_every_study(every, looked, change):
    results = every("one", "two")
    studied(results)
    change(results)
    code, told = studied(results)
    assert code == 0
    assert len(looked) == 2
    assert told.count("1 of 2 cases computed") == (change is lose_a_case)
    studied(results)
    assert len(looked) == 2  # noted again


def test_other_code_another_package_and_another_grid_are_not_the_same(monkeypatch, tmp_path):
    made = settled.made_by("")
    assert made == settled.made_by("")  # the control
    assert made != settled.made_by("quick")
    with monkeypatch.context() as patch:
        patch.setattr(code_hash, "version", lambda name: "0.0" if name == "numba" else "1.0")
        assert made != settled.made_by("")
    (tmp_path / "symtop").mkdir()
    (tmp_path / "studies").mkdir()
    monkeypatch.setattr(settled, "PACKAGE", tmp_path / "symtop")
    hashes = [settled.made_by("")]
    for number, file in enumerate((tmp_path / "symtop" / "a.py", tmp_path / "studies" / "b.py")):
        file.write_text(f"x = {number}\n")
        hashes.append(settled.made_by(""))
    assert len({made, *hashes}) == 4


def test_it_is_the_same_in_a_process_that_has_loaded_no_study_and_sees_every_file(tmp_path, monkeypatch):
    scripts.load("reduction")
    words = [sys.executable, "-c", "from symtop.runner import settled; print(settled.made_by(''))"]
    assert subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip() == settled.made_by("")
    for place in ("symtop", "studies/one", "studies/two"):
        (tmp_path / place).mkdir(parents=True)
    monkeypatch.setattr(settled, "PACKAGE", tmp_path / "symtop")
    (tmp_path / "studies" / "one" / "study.py").write_text("x = 1\n")
    alone = settled.made_by("")
    (tmp_path / "studies" / "two" / "study.py").write_text("x = 2\n")  # the same name in another folder
    assert settled.made_by("") != alone


def test_a_failure_and_a_part_of_the_studies_are_not_noted(every, looked):
    results = every("one", "failing")
    assert studied(results)[0] == 2  # nothing of one study could be measured
    assert not (results / settled.NOTE).exists()
    results = every("one")
    assert CliRunner().invoke(main, ["study", scripts.names()[0], "--results", str(results)]).exit_code == 0
    assert not (results / settled.NOTE).exists()
    assert studied(results)[0] == 0
    assert (results / settled.NOTE).exists()
    count = len(looked)
    for words in (["--fresh"], ["--status"], ["--check"]):
        assert studied(results, *words)[0] == 0
    assert len(looked) == count + 3


def test_names_that_stand_in_two_places_agree():
    assert settled.ENTRY_POINTS == registry.ENTRY_POINTS
    assert scripts.folder().name in settled.STUDIES
    assert scripts.STUDIES in settled.STUDIES


def test_another_version_of_a_package_that_announces_methods_is_seen(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("announcing", "silent"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("")
        (tmp_path / name / "methods.py").write_text("STEP = 0.5\n")
    told = tmp_path / "announcing-1.0.dist-info"
    told.mkdir()
    (told / "METADATA").write_text("Metadata-Version: 2.1\nName: announcing\nVersion: 1.0\n")
    (told / "entry_points.txt").write_text("[symtop.integrators]\nmine = announcing.methods:methods\n")
    before = settled.announced()
    assert before != settled.hashed()
    settled.file_hash.cache_clear()
    (tmp_path / "silent" / "methods.py").write_text("STEP = 0.6\n")
    assert settled.announced() == before
    settled.file_hash.cache_clear()
    (tmp_path / "announcing" / "methods.py").write_text("STEP = 0.6\n")
    assert settled.announced() != before
    assert "announcing" not in sys.modules
