"""What is up to date is not read, computed, drawn or written again; what was touched since is looked at again."""

import os
import shutil

import pytest

from symtop.core import netcdf
from symtop.runner import run as runner, store
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


def test_a_damaged_manifest_is_not_believed(bring):
    computed, _ = bring()
    for nonsense in ("", "[]", '{"probe": 1, "rounds": 1}', '{"probe": {}, "rounds": {"files": []}}'):
        store.manifest(bring.folder).write_text(nonsense)
        again, read = bring()
        assert (again, read >= computed) == (0, True), nonsense
        assert bring() == (0, 0)
