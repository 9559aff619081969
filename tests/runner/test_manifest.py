"""What is up to date is not read, computed, drawn or written again; what was touched since is looked at again."""

import os
import shutil

import pytest
from click.testing import CliRunner

from symtop.cli.main import main
from symtop.core import netcdf
from symtop.report import sources
from symtop.runner import manifest, run as runner, scripts, store
from tests.commands import PROBE
from tests.runner.test_rounds import ROUNDS


@pytest.fixture(params=["probe", "rounds"])
def bring(request, tmp_path, monkeypatch):
    """A study, as a function that brings it up to date and returns how many cases were computed and how many read."""
    script = PROBE
    if request.param == "rounds":
        script = tmp_path / "rounds.py"
        script.write_text(ROUNDS)
    study = runner.load(str(script))
    read, load = [], store.load_case

    def reading(path):
        read.append(path)
        return load(path)

    monkeypatch.setattr(store, "load_case", reading)

    def brought(folder="r"):
        read.clear()
        computed = runner.run(study, tmp_path / folder, quick=True, quiet=True)["computed"]
        return computed, len(read)

    brought.folder = tmp_path / "r"
    brought.files = lambda: sorted((tmp_path / "r" / "cases" / study.name).glob("[!.]*.npz"))
    brought.dataset = tmp_path / "r" / f"{study.name}.nc"
    return brought


def test_nothing_is_read_the_second_time(bring):
    computed, read = bring()
    assert computed >= 3
    assert read >= computed
    assert bring() == (0, 0)


def test_a_case_of_any_round_that_is_gone_or_damaged_is_computed_again(bring):
    bring()
    for file in bring.files():
        size = file.stat().st_size
        for spoil in (file.unlink, lambda file=file, size=size: file.write_bytes(b"\0" * size)):
            spoil()
            assert bring()[0] == 1, file
            assert bring() == (0, 0)


def test_what_was_copied_or_touched_is_read_once(bring):
    computed, _ = bring()
    shutil.copytree(bring.folder, bring.folder.with_name("copy"), copy_function=shutil.copyfile)
    again, read = bring("copy")
    assert (again, read >= computed) == (0, True)
    assert bring("copy") == (0, 0)
    file = bring.files()[0]
    os.utime(file, ns=(0, file.stat().st_mtime_ns + 1))
    again, read = bring()
    assert (again, read >= computed) == (0, True)


def test_a_dataset_that_is_gone_or_damaged_is_made_again(bring):
    bring()
    whole = netcdf.read_any(bring.dataset)
    for spoil in (bring.dataset.unlink, lambda: bring.dataset.write_bytes(b"\0" * 9)):
        spoil()
        assert bring()[0] == 0
        assert netcdf.read_any(bring.dataset).identical(whole)


@pytest.mark.parametrize("nonsense", ["", "[]", '{"probe": 1, "rounds": 1}', '{"probe": {}, "rounds": {"files": []}}'])
def test_a_damaged_manifest_is_not_believed(bring, nonsense):
    computed, _ = bring()
    manifest.path_of(bring.folder).write_text(nonsense)
    again, read = bring()
    assert (again, read >= computed) == (0, True)
    assert bring() == (0, 0)


SMALL = """
import xarray as xr
from symtop.runner.study import Case, Study

STUDY = Study(
    {0!r}, {0!r}, "Is it?", lambda quick: [Case("spheroid", "strang")], lambda case: xr.Dataset({{"one": 1.0}}),
)
"""


@pytest.fixture
def every(tmp_path, monkeypatch):
    """Let the studies that ship with symtop be two small ones; returns their results after ``study --all``."""
    for name in ("one", "two"):
        (tmp_path / f"{name}.py").write_text(SMALL.format(name))
    monkeypatch.setattr(scripts, "names", lambda: ["one", "two"])
    monkeypatch.setattr(scripts, "file_of", lambda name: tmp_path / f"{name.removesuffix('.py').split('/')[-1]}.py")
    said = CliRunner().invoke(main, ["study", "--all", "--results", str(tmp_path / "r")])
    assert said.exit_code == 0, said.output
    return tmp_path / "r"


def test_the_hash_of_the_report_follows_sources_processor_and_files(tmp_path, monkeypatch):
    before = sources.report_hash(tmp_path, embed=False)
    assert sources.report_hash(tmp_path, embed=False) == before != sources.report_hash(tmp_path, embed=True)
    (tmp_path / "one.json").touch()
    assert sources.report_hash(tmp_path, embed=False) != before
    (tmp_path / "one.json").unlink()
    monkeypatch.setattr(sources, "processor", lambda: "another")
    assert sources.report_hash(tmp_path, embed=False) != before
    monkeypatch.undo()
    real = sources.file_hash
    monkeypatch.setattr(sources, "file_hash", lambda path: real(path) + "x" * (path.name == "page.js"))
    assert sources.report_hash(tmp_path, embed=False) != before


def test_the_report_is_written_again_only_if_something_has_changed(every):
    words = ["report", "--results", str(every)]

    def said():
        done = CliRunner().invoke(main, words)
        assert done.exit_code == 0, done.output
        return done.output

    assert "up to date" not in said()
    assert "up to date" in said()
    (every / "more.json").write_text((every / "one.json").read_text())
    assert "up to date" not in said()
    assert "up to date" in said()
    (every / "report.html").unlink()
    assert "up to date" not in said()
