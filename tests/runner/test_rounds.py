"""Two rounds of cases: what is computed again if the second is incomplete, and timed cases in new workers."""

import os
from pathlib import Path

import numpy as np
import pytest

from symtop.runner import pool as pools, run as runner, store
from symtop.runner.pool import Pool

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

STUDY = Study("rounds", "Rounds", "Both?", cases, measure,
              follow_up=follow_up)
"""


@pytest.fixture
def study(tmp_path):
    """Two cases in a first round and one timed case in a second, with a record of a shipped study in its settings."""
    (tmp_path / "rounds.py").write_text(ROUNDS)
    return runner.load(str(tmp_path / "rounds.py"))


def cases_of(results: Path, timed: bool) -> list[Path]:
    return [path for path in (results / "cases" / "rounds").glob("*.npz") if ("--together--" in path.name) == timed]


def test_timed_cases_that_alone_are_missing_run_in_new_workers(study, tmp_path, monkeypatch):
    """A new worker knows nothing of the studies' package, and is handed settings that hold a record from it."""
    results = tmp_path / "r"
    assert runner.run(study, results, quiet=True)["failures"] == []
    (later,) = cases_of(results, timed=True)
    assert set(np.ravel(store.load_case(later)["process"])) == {os.getpid()}  # the control: few cases need no workers
    later.unlink()
    monkeypatch.setattr(pools, "WORTH_WORKERS", 1)
    with Pool(2) as pool:
        result = runner.run(study, results, quiet=True, pool=pool)
    assert (result["computed"], result["failures"]) == (1, [])
    again = store.load_case(later)
    assert os.getpid() not in set(np.ravel(again["process"]))
    assert set(np.ravel(again["later"])) == {2.0}
