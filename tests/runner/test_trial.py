"""Timed cases run side by side where a trial shows that they do not disturb each other, and one by one elsewhere."""

import itertools
import math

import pytest
from symtop.runner.pools import InProcess, Workers

from symtop.core import netcdf
from symtop.core.parallel import cores
from symtop.runner import run as runner, trial

SCRIPT = """
import os, time
import xarray as xr
from symtop.runner.study import Case, Study

def cases(quick):
    return [Case("spheroid", name) for name in ("midpoint", "strang", "cayley", "rk4")]

def measure(case):
    begun = time.monotonic()
    time.sleep(0.2)
    return xr.Dataset({"begun": begun, "ended": time.monotonic(), "process": float(os.getpid())})

STUDY = Study("slept", "Slept", "When?", "", cases, measure, lambda data: [], lambda data: ["Slept."], timed=True)
"""


@pytest.fixture
def study(tmp_path):
    file = tmp_path / "slept.py"
    file.write_text(SCRIPT)
    return runner.load(str(file))


def computed(study, results, workers):
    """The datasets of its cases, in the order in which they began."""
    runner.run(study, results, workers=workers, quiet=True)
    cases = [netcdf.read_own(file) for file in (results / "cases" / "slept").glob("*.nc")]
    return sorted(cases, key=lambda case: float(case["begun"]))


def at_once(cases):
    """How many pairs of neighbours overlap."""
    return sum(float(one["ended"]) > float(other["begun"]) for one, other in itertools.pairwise(cases))


@pytest.mark.parametrize("ratio", [trial.DISTURBED, 1.01 * trial.DISTURBED])
def test_a_trial_decides_whether_timed_cases_run_at_once(study, tmp_path, monkeypatch, ratio):
    asked = []
    monkeypatch.setattr(trial, "slowdown", lambda pool, size: asked.append(size) or ratio)
    side_by_side = ratio <= trial.DISTURBED
    with Workers(2) as workers:
        workers.pool(2)
        cases = computed(study, tmp_path / "r", workers)
        assert (at_once(cases) >= 2) is side_by_side
        assert (at_once(cases) == 0) is not side_by_side
        for case in cases:
            assert case.attrs["timed_at_once"] == (2 if side_by_side else 1)
            assert case.attrs["timed_slowdown"] == ratio
        computed(study, tmp_path / "again", workers)
    assert asked == [2]  # once for all studies of a command


def test_where_all_workers_disturb_each_other_half_as_many_may_not(monkeypatch):
    asked = []
    monkeypatch.setattr(trial, "slowdown", lambda _, size: asked.append(size) or 0.3 * size)
    with Workers(1) as workers:
        assert workers.side_by_side(8, 100) == (2, 0.6)
        assert workers.side_by_side(8, 3) == (3, 0.3 * 3)
        assert asked == [8, 4, 2, 3]
        monkeypatch.setattr(trial, "slowdown", lambda *_: 2.0)
        assert workers.side_by_side(5, 5) == (2, 0.6)
        assert workers.side_by_side(7, 7) == (3, 0.3 * 3)
        assert workers.side_by_side(8, 1) == workers.side_by_side(1, 8) == (1, pytest.approx(math.nan, nan_ok=True))


def test_untimed_cases_need_no_trial(tmp_path, monkeypatch):
    (tmp_path / "slept.py").write_text(SCRIPT.replace("timed=True", "timed=False"))
    study = runner.load(str(tmp_path / "slept.py"))
    monkeypatch.setattr(trial, "slowdown", lambda *_: pytest.fail("a trial for cases that are not timed"))
    with Workers(2) as workers:
        workers.pool(2)
        cases = computed(study, tmp_path / "r", workers)
    assert at_once(cases) >= 1
    assert not any("timed_at_once" in case.attrs for case in cases)


def test_in_one_process_there_is_nothing_to_try(study, tmp_path):
    with Workers(1) as workers:
        cases = computed(study, tmp_path / "r", workers)
    assert at_once(cases) == 0
    assert {case.attrs["timed_at_once"] for case in cases} == {1}
    assert all(math.isnan(case.attrs["timed_slowdown"]) for case in cases)


def test_the_trial_sees_workers_that_share_a_core(monkeypatch):
    """With twice as many workers as cores a run takes twice as long; calls that never overlap decide nothing."""
    crowd = 2 * cores()
    monkeypatch.setattr(trial, "TURNS", 3)
    with Workers(crowd) as workers:
        assert 1.3 < trial.slowdown(workers.pool(crowd), crowd) < math.inf
    monkeypatch.setattr(trial, "TRIES", 1)
    assert trial.slowdown(InProcess(), 2) == math.inf
