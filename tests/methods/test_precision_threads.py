"""Threads that work at the same time, each in a precision of its own, get the digits that they would get alone."""

import threading
from concurrent.futures import ThreadPoolExecutor

import mpmath
import numpy as np
import pytest

import symtop
from symtop.core.numbers import context
from symtop.methods.runge_kutta.gauss import gauss_rule
from symtop.methods.taylor import heyoka

pytest.importorskip("heyoka")
SCENES = ("spheroid", "goldstein")


def together(*tasks):
    """What each task returns, each run in a thread of its own; they begin together."""
    barrier = threading.Barrier(len(tasks))
    with ThreadPoolExecutor(len(tasks)) as pool:
        return [*pool.map(lambda task: (barrier.wait(), task())[1], tasks)]


def coefficients():
    """The Gauss method of 12th order from scratch, in 40 digits."""
    return np.concatenate([np.ravel(part) for part in gauss_rule.__wrapped__(6)])


def numbers(name):
    """A start in quadruple precision, from scratch, in 60 digits."""
    scene = symtop.scene(name)
    return str(heyoka.start_numbers.__wrapped__("attitude", "quad", scene.top, scene.start))


def disturbed(times):
    """What the process-wide context does meanwhile in somebody else's thread."""
    for k in range(times):
        with mpmath.workdps(3 + k % 5):
            mpmath.sqrt(2)


def test_coefficients_and_starts_are_those_computed_alone_while_others_change_the_precision():
    assert [len(str(context(number).sqrt(2))) for number in (20, 50, 20)] == [21, 51, 21]  # a point and the digits
    expected = coefficients(), numbers("spheroid"), numbers("goldstein")
    rule, first, second, _ = together(lambda: [coefficients() for _ in range(5)],
                                      lambda: [numbers("spheroid") for _ in range(20)],
                                      lambda: [numbers("goldstein") for _ in range(20)],
                                      lambda: disturbed(20_000))  # fmt: skip
    assert all(np.array_equal(values, expected[0]) for values in rule)
    assert (set(first), set(second)) == ({expected[1]}, {expected[2]})
    with mpmath.workdps(5):
        assert np.array_equal(coefficients(), expected[0])
        assert (numbers("spheroid"), mpmath.mp.dps) == (expected[1], 5)


def test_taylor_runs_of_one_kind_at_once_do_not_share_a_stepper():
    runs = lambda name: [symtop.simulate(name, "taylor", horizon=50.0, samples=200)["axis"].values for _ in range(20)]
    references = [runs(name)[0] for name in SCENES]
    for expected, states in zip(references, together(*(lambda name=name: runs(name) for name in SCENES)), strict=True):
        assert all(np.array_equal(expected, axes) for axes in states)


def test_the_bare_loop_of_heyoka_computes_what_the_solver_does_and_begins_anew():
    scene, plan = symtop.scene("goldstein"), symtop.Plan.until(np.array([0.0, 8.0]), 1e-9)
    solver = symtop.integrator("taylor[axis]").solvers["axis"]
    run, evaluations = solver.bare(scene.top, scene.start, plan)
    result = solver(scene.top, scene.start, plan)
    assert (evaluations, run()[3], run()[3]) == (result.force_evaluations, result.steps, result.steps)
