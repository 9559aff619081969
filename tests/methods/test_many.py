"""Many members in one call have the bits of runs alone, whatever the others do, in stretches and from threads."""

import math
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
import pytest

import symtop
from symtop.methods.framework import loop as loops
from symtop.methods.framework.lanes import groups, members_of
from symtop.methods.framework.loop import FixedStep, inside
from symtop.methods.framework.plan import OUTCOMES, Plan
from symtop.methods.framework.registry import variants
from symtop.methods.framework.space import on_axis
from symtop.methods.splitting import space
from symtop.model.top import flat

SCENES = ("spheroid", "grazing", "fast", "simo-wong", "kinon-betsch", "steady")
SOLVERS = {row.name: solver for row in variants() for solver in filter(None, map(inside, row.solvers.values()))}


def members(count=12, samples=5):
    """Numbers, steps and marks: some members with steps that are far too large, each with marks of its own."""
    scenes = [symtop.scene(SCENES[i % len(SCENES)]) for i in range(count)]
    numbers = np.array([flat(scene.top, scene.start) for scene in scenes])
    h = np.array([min(scene.nutation_period, 2.0) / (60.0 if i % 5 else 3.0) for i, scene in enumerate(scenes)])
    marks = np.array([np.arange(samples) * (3 + i % 4) + i % 2 for i in range(count)])
    return numbers, h, marks


def assert_alone(solver, numbers, h, marks, done):
    """Every member has the bits of a run alone."""
    for i, (top, start) in enumerate(members_of(numbers)):
        run = solver(top, start, Plan.steps(h[i], marks[i]))
        np.testing.assert_array_equal(done.states[i], run.states)
        np.testing.assert_array_equal(done.momenta[i].T, (run.p_phi, run.p_psi))
        evaluations, iterations = solver.counts(done.steps[i], done.work[i])
        assert (done.steps[i], evaluations, iterations, OUTCOMES[done.outcome[i]]) == run[3:7]


@pytest.mark.parametrize(
    "name",
    ["strang[axis]", "strang[attitude]", "midpoint[angles]", "midpoint-unreduced[angles]", "takahashi-imada[attitude]",
     "cayley-tuned[axis]", "gauss-4[attitude]", "rk4[axis]", "stormer-verlet[angles]"],
)  # fmt: skip
def test_members_have_the_bits_of_runs_alone(name):
    given = members()
    done = SOLVERS[name].many(*given)
    assert_alone(SOLVERS[name], *given, done)
    assert done.states.shape[:2] == (12, 5)


@pytest.mark.slow
@pytest.mark.parametrize("name", SOLVERS)
def test_members_of_every_method_have_the_bits_of_runs_alone(name):
    given = members(60, 9)
    assert_alone(SOLVERS[name], *given, SOLVERS[name].many(*given))


def test_a_member_with_another_start_is_another_run():
    """The negative control: one bit of one start shows in that member and in no other."""
    numbers, h, marks = members()
    moved = numbers.copy()
    moved[3, 3] = math.nextafter(moved[3, 3], 4.0)
    one, other = (SOLVERS["strang[axis]"].many(start, h, marks).states for start in (numbers, moved))
    differs = (one != other).any(axis=(1, 2))
    assert np.flatnonzero(differs).tolist() == [3]


def test_a_member_that_fails_fails_alone():
    """Starts on a pole, a number that is none, steps that jump over a pole: the others do not notice."""
    numbers, h, marks = members()
    solver = SOLVERS["stormer-verlet[angles]"]
    whole = solver.many(numbers, h, marks)
    numbers[2, 3], numbers[5, 3], numbers[7, 6] = 0.0, math.pi, math.nan
    done = solver.many(numbers, h, marks)
    assert [OUTCOMES[done.outcome[i]] for i in (2, 5, 7)] == ["left_chart", "left_chart", "not_finite"]
    assert np.isnan(done.states[[2, 5]]).all()
    assert done.steps[[2, 5]].tolist() == [0, 0]
    rest = np.setdiff1d(np.arange(12), [2, 5, 7])
    np.testing.assert_array_equal(done.states[rest], whole.states[rest])
    assert "left_chart" in {OUTCOMES[i] for i in whole.outcome}
    assert "ok" in {OUTCOMES[i] for i in whole.outcome}


def test_functions_of_python_and_single_members_do_as_well():
    numbers, h, marks = members()
    strang = SOLVERS["strang[axis]"]
    python = FixedStep(space.march_axis, strang.rule.__call__, on_axis, 1, implicit=False)
    assert python.in_python
    assert not strang.in_python
    for one, other in zip(python.many(numbers, h, marks), strang.many(numbers, h, marks), strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(
        strang.many(numbers[3:4], h[3:4], marks[3:4]).states[0], strang.many(numbers, h, marks).states[3]
    )


def test_long_members_and_long_calls_return_to_python(monkeypatch):
    given = members()
    solver = SOLVERS["midpoint[angles]"]
    whole = solver.many(*given)
    monkeypatch.setattr(loops, "BLOCK", 15)
    for one, other in zip(whole, solver.many(*given), strict=True):
        np.testing.assert_array_equal(one, other)


def test_groups_hold_every_member_once_and_no_more_steps_than_asked():
    steps = np.random.default_rng(1).integers(1, 50, 200)
    chosen = np.flatnonzero(steps != 7)
    parts = groups(chosen, steps, 300)
    np.testing.assert_array_equal(np.concatenate(parts), chosen)
    assert max(int(steps[part].sum()) for part in parts) < 350
    assert len(parts) > 10
    assert groups(chosen[:0], steps, 300) == []
    assert all(a[-1] < b[0] for a, b in pairwise(parts))


def test_threads_get_the_bits_of_one():
    given = members(40)
    for name in ("strang[axis]", "gauss-4[axis]", "midpoint[angles]"):
        alone = SOLVERS[name].many(*given)
        with ThreadPoolExecutor(4) as pool:
            for made in pool.map(lambda _, name=name: SOLVERS[name].many(*given), range(8)):
                for one, other in zip(made, alone, strict=True):
                    np.testing.assert_array_equal(one, other)
