"""Worker processes: order, side by side or alone, and what is computed where."""

import itertools
import math
import os

import pytest

from symtop.measure import timing
from symtop.runner import pool as pools, run as runner, store
from symtop.runner.pool import Pool, Task, in_order
from symtop.runner.study import Case

SCRIPT = """
import os, time
from pathlib import Path
import xarray as xr
from symtop.runner.study import Case, Study

def cases(quick):
    return [Case("spheroid", ("midpoint", "strang")[k % 2], {"k": k}, k >= 8, f"case-{k}") for k in range(12)]

def measure(case):
    begin, crew = time.monotonic(), Path(__file__).with_name("crew")
    (crew / str(os.getpid())).touch()
    while not case.timed and len(list(crew.iterdir())) < 2 and time.monotonic() < begin + 60.0:
        time.sleep(0.01)  # until the second worker has begun a case, too
    time.sleep(0.2 if case.timed else 0.05)
    return xr.Dataset({"begin": begin, "end": time.monotonic(), "process": os.getpid(), "timed": float(case.timed)})

STUDY = Study("slept", "Slept", "When?", cases, measure)
"""


@pytest.fixture(scope="module")
def pool():
    with Pool(2) as workers:
        yield workers


def study(folder, expression="range(12)"):
    """Eight ordinary cases and four timed ones, or as many as `expression` has."""
    (folder / "crew").mkdir(parents=True)
    (folder / "slept.py").write_text(SCRIPT.replace("range(12)", expression))
    return runner.load(str(folder / "slept.py"))


def computed(study, results, pool):
    """The datasets of its ordinary and of its timed cases, in the order in which they began."""
    runner.run(study, results, pool=pool, quiet=True)
    cases = [store.load_case(file) for file in (results / "cases" / "slept").glob("*.npz")]
    cases.sort(key=lambda case: float(case["begin"]))
    return [[case for case in cases if float(case["timed"]) == kind] for kind in (0.0, 1.0)]


def crew(cases):
    return {int(case["process"]) for case in cases}


def overlaps(cases):
    """How many pairs of neighbours overlap."""
    return sum(float(first["end"]) > float(second["begin"]) for first, second in itertools.pairwise(cases))


@pytest.mark.slow
def test_a_trial_decides_whether_timed_cases_run_at_once_in_workers_that_are_there(tmp_path, monkeypatch, pool):
    """After all others; few of them, too: workers have the kernels, this process has not."""
    for ratio in (pools.DISTURBED_RATIO, 1.01 * pools.DISTURBED_RATIO):
        sizes, side_by_side, folder = [], ratio <= pools.DISTURBED_RATIO, tmp_path / str(ratio)
        monkeypatch.setattr(pools, "slowdown", lambda _, size, sizes=sizes, ratio=ratio: sizes.append(size) or ratio)
        monkeypatch.setattr(pool, "_trials", {})
        slept = study(folder)
        ordinary, timed = computed(slept, folder / "r", pool)
        assert (len(ordinary), len(timed)) == (8, 4)
        assert overlaps(ordinary) > 0  # the control
        assert max(float(case["end"]) for case in ordinary) <= float(timed[0]["begin"])
        assert crew(timed) <= crew(ordinary)
        assert os.getpid() not in crew(ordinary)
        assert (overlaps(timed) >= 2) is side_by_side
        assert (overlaps(timed) == 0) is not side_by_side
        for case in timed:
            assert (case.attrs["timed_at_once"], case.attrs["timed_slowdown"]) == (2 if side_by_side else 1, ratio)
        computed(slept, folder / "again", pool)
        assert sizes == [2]  # once for all studies of a command


def test_families_do_not_begin_side_by_side_and_half_as_many_workers_may_not_disturb_each_other(tmp_path, monkeypatch):
    names = ["midpoint", "trapezoidal", "strang", "cayley", "rk4", "together"]
    tasks = [Task("", Case("spheroid", name), tmp_path / name, (), 1.0) for name in names]
    begun = [task.case.integrator for task in in_order(tasks)]
    assert begun == ["midpoint", "strang", "rk4", "together", "trapezoidal", "cayley"]
    assert in_order([]) == []
    monkeypatch.setattr(pools, "slowdown", lambda _, size: 0.3 * size)
    with Pool(1) as pool:
        assert (pool.at_once(8), pool.at_once(3)) == ((2, 0.6), (3, 0.3 * 3))
        assert pool.at_once(1) == (1, pytest.approx(math.nan, nan_ok=True))


def test_few_cases_are_computed_here_and_timed_ones_need_no_trial(tmp_path):
    with Pool(1) as pool:
        _, cases = computed(study(tmp_path, "range(8, 12)"), tmp_path / "r", pool)
    assert (overlaps(cases), crew(cases)) == (0, {os.getpid()})
    assert {case.attrs["timed_at_once"] for case in cases} == {1}
    assert all(math.isnan(case.attrs["timed_slowdown"]) for case in cases)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system puts no process on a core")
def test_the_trial_sees_workers_that_share_a_core(monkeypatch, pool):
    """There a run takes twice as long; the last test of the file, as the workers stay there."""
    monkeypatch.setattr(timing, "TURNS", 3)
    pool.open(2)
    for worker in {turn.result()[0] for turn in [pool.submit(timing.timed_turn) for _ in range(8)]}:
        os.sched_setaffinity(worker, {min(os.sched_getaffinity(0))})
    assert 1.3 < timing.slowdown(pool.submit, 2) < math.inf
