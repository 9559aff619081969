"""Worker processes: order, side by side or alone, and what is computed where."""

import itertools
import math
import os
import time

import pytest

from symtop.core.parallel import cores
from symtop.measure import timing
from symtop.runner import pool as pools, run as runner, store
from symtop.runner.pool import Pool, Task, in_order
from symtop.runner.study import Case

SCRIPT = """
import os, time
import xarray as xr
from symtop.runner.study import Case, Study

def cases(quick):
    return [Case("spheroid", name) for name in ("midpoint", "strang", "cayley", "rk4")]

def measure(case):
    begin = time.monotonic()
    time.sleep(0.2)
    return xr.Dataset({"begin": begin, "end": time.monotonic(), "process": float(os.getpid())})

STUDY = Study("slept", "Slept", "When?", cases, measure, timed=True)
"""


@pytest.fixture
def study(tmp_path):
    file = tmp_path / "slept.py"
    file.write_text(SCRIPT)
    return runner.load(str(file))


def computed(study, results, pool):
    """The datasets of its cases, in the order in which they began."""
    runner.run(study, results, pool=pool, quiet=True)
    cases = [store.load_case(file) for file in (results / "cases" / "slept").glob("*.npz")]
    return sorted(cases, key=lambda case: float(case["begin"]))


def waited():
    """The process that has slept."""
    time.sleep(0.2)
    return os.getpid()


def at_once(cases):
    """How many pairs of neighbours overlap."""
    return sum(float(one["end"]) > float(other["begin"]) for one, other in itertools.pairwise(cases))


def test_methods_of_one_family_do_not_begin_side_by_side(tmp_path):
    names = ["midpoint", "trapezoidal", "strang", "cayley", "rk4", "together"]
    tasks = [Task("", Case("spheroid", name), tmp_path / name, (), 1.0) for name in names]
    assert [task.case.integrator for task in in_order(tasks)] == [
        "midpoint", "strang", "rk4", "together", "trapezoidal", "cayley",
    ]  # fmt: skip
    assert in_order([]) == []


@pytest.mark.parametrize("ratio", [pools.DISTURBED, 1.01 * pools.DISTURBED])
def test_a_trial_decides_whether_timed_cases_run_at_once(study, tmp_path, monkeypatch, ratio):
    sizes = []
    monkeypatch.setattr(pools, "slowdown", lambda _, size: sizes.append(size) or ratio)
    side_by_side = ratio <= pools.DISTURBED
    with Pool(2) as pool:
        pool.open(2)
        while len({future.result() for future in [pool.submit(waited) for _ in range(2)]}) < 2:
            pass  # until both have started
        cases = computed(study, tmp_path / "r", pool)
        assert (at_once(cases) >= 2) is side_by_side
        assert (at_once(cases) == 0) is not side_by_side
        for case in cases:
            assert case.attrs["timed_at_once"] == (2 if side_by_side else 1)
            assert case.attrs["timed_slowdown"] == ratio
        computed(study, tmp_path / "again", pool)
    assert sizes == [2]  # once for all studies of a command


def test_where_all_workers_disturb_each_other_half_as_many_may_not(monkeypatch):
    monkeypatch.setattr(pools, "slowdown", lambda _, size: 0.3 * size)
    with Pool(1) as pool:
        assert pool.at_once(8) == (2, 0.6)
        assert pool.at_once(3) == (3, 0.3 * 3)
        assert pool.at_once(1) == (1, pytest.approx(math.nan, nan_ok=True))


def test_few_cases_are_computed_here_and_timed_ones_need_no_trial(study, tmp_path):
    with Pool(1) as pool:
        cases = computed(study, tmp_path / "r", pool)
    assert at_once(cases) == 0
    assert {int(case["process"]) for case in cases} == {os.getpid()}
    assert {case.attrs["timed_at_once"] for case in cases} == {1}
    assert all(math.isnan(case.attrs["timed_slowdown"]) for case in cases)


def test_the_trial_sees_workers_that_share_a_core(monkeypatch):
    """With twice as many workers as cores a run takes twice as long."""
    crowd = 2 * cores()
    monkeypatch.setattr(timing, "TURNS", 3)
    with Pool(crowd) as pool:
        pool.open(crowd)
        assert 1.3 < timing.slowdown(pool.submit, crowd) < math.inf
