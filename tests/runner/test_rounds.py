"""Two rounds of cases: what is computed again if the second is incomplete, and timed cases in new workers."""

import os
import shutil
from dataclasses import replace

import numpy as np
import pytest

from symtop.core import code_hash, netcdf
from symtop.runner import pool as pools, run as runner, store
from symtop.runner.pool import Pool
from tests.commands import PROBE

ROUNDS = """
import os
import xarray as xr
from symtop.runner.study import Case, Study
from symtop_studies.stability.atlas import Failure

def cases(quick):
    return [Case("spheroid", name) for name in ("midpoint", "strang")]

def measure(case):
    if not case.timed:
        return xr.Dataset({"steps": float(len(case.integrator))})
    names, setting = case.settings["integrators"], case.settings["effect"].setting
    later = {"later": ("variant", [setting] * len(names)), "process": ("variant", [os.getpid()] * len(names))}
    return xr.Dataset(later, coords={"variant": names})

def follow_up(data):
    names = [str(name) for name in data["variant"].values]
    return [Case("spheroid", "together", {"integrators": names, "effect": Failure(2.0, "left_chart")}, timed=True)]

STUDY = Study("rounds", "Rounds", "Both?", cases, measure, follow_up=follow_up)
"""


def test_timed_cases_that_alone_are_missing_run_in_new_workers(tmp_path, monkeypatch):
    """A new worker knows nothing of the studies' package, and is handed settings that hold a record from it."""
    (tmp_path / "rounds.py").write_text(ROUNDS)
    study, results = runner.load(str(tmp_path / "rounds.py")), tmp_path / "r"
    assert runner.run(study, results, quiet=True)["failures"] == []
    (path,) = (results / "cases" / "rounds").glob("*--together--*.npz")
    assert set(np.ravel(store.load_case(path)["process"])) == {os.getpid()}  # the control: few cases need no workers
    path.unlink()
    monkeypatch.setattr(pools, "WORTH_WORKERS", 1)
    with Pool(2) as pool:
        result = runner.run(study, results, quiet=True, pool=pool)
    assert (result["computed"], result["failures"]) == (1, [])
    data = store.load_case(path)
    assert os.getpid() not in set(np.ravel(data["process"]))
    assert set(np.ravel(data["later"])) == {2.0}
    monkeypatch.undo()
    monkeypatch.setattr(code_hash, "processor", lambda: "another")
    assert runner.run(study, results, quiet=True)["computed"] == 1
    assert runner.run(replace(study, follow_up=lambda _: []), results, quiet=True)["cases"] == 2


@pytest.fixture(params=["probe", "rounds"])
def bring(request, tmp_path, monkeypatch):
    """A study, as a function that brings it up to date and returns how many cases were computed and how many read."""
    script = PROBE
    if request.param == "rounds":
        (script := tmp_path / "rounds.py").write_text(ROUNDS)
    study = runner.load(str(script))
    read, load = [], store.load_case
    monkeypatch.setattr(store, "load_case", lambda path: read.append(path) or load(path))

    def brought(folder="r"):
        read.clear()
        return runner.run(study, tmp_path / folder, quick=True, quiet=True)["computed"], len(read)

    brought.folder = tmp_path / "r"
    brought.files = lambda: sorted((tmp_path / "r" / "cases" / study.name).glob("[!.]*.npz"))
    brought.dataset = tmp_path / "r" / f"{study.name}.nc"
    return brought


def test_what_was_copied_or_touched_is_read_once(bring):
    computed, _ = bring()
    shutil.copytree(bring.folder, bring.folder.with_name("copy"), copy_function=shutil.copyfile)
    count, read = bring("copy")
    assert (count, read >= computed) == (0, True)
    assert bring("copy") == (0, 0)
    file = bring.files()[0]
    os.utime(file, ns=(0, file.stat().st_mtime_ns + 1))
    count, read = bring()
    assert (count, read >= computed) == (0, True)


def test_a_case_of_any_round_or_a_dataset_that_is_gone_or_damaged_is_made_again(bring):
    bring()
    for file in bring.files():
        size = file.stat().st_size
        for spoil in (file.unlink, lambda file=file, size=size: file.write_bytes(b"\0" * size)):
            spoil()
            assert bring()[0] == 1, file
            assert bring() == (0, 0)
    bring()
    expected = netcdf.read_any(bring.dataset)
    for spoil in (bring.dataset.unlink, lambda: bring.dataset.write_bytes(b"\0" * 9)):
        spoil()
        assert bring()[0] == 0
        assert netcdf.read_any(bring.dataset).identical(expected)


def test_nothing_is_read_twice_and_a_damaged_manifest_is_not_believed(bring):
    computed, read = bring()
    assert computed >= 3
    assert read >= computed
    assert bring() == (0, 0)
    for nonsense in ("", "[]", '{"probe": 1, "rounds": 1}', '{"probe": {}, "rounds": {"files": []}}'):
        store.manifest(bring.folder).write_text(nonsense)
        count, read = bring()
        assert (count, read >= computed) == (0, True), nonsense
        assert bring() == (0, 0)
