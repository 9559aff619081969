"""The series of a step: the order of every fixed-step method without a run, and defects that no slope shows."""

import dataclasses

import numpy as np
import pytest

import symtop
from symtop.measure.step_map import generic_start, one_step
from symtop.measure.step_series import compared, step_series

SPHEROID = symtop.scene("spheroid")


def series(method, chart, scene=SPHEROID):
    return step_series(one_step(method, chart, scene, 0.01), generic_start(scene), scene.time_scale())


@pytest.mark.parametrize("off", [3e-8, 1e-9])
def test_a_coefficient_that_is_slightly_off_shows_in_the_term_that_it_spoils(off):
    outer = 1.3512071919596577 + off
    inner = 1.0 - 2.0 * outer
    kick = (outer / 2, (outer + inner) / 2, (outer + inner) / 2, outer / 2)
    result = series(symtop.composition("off", (outer, inner, outer), kick, chart="space", order=4), "axis")
    assert result.order == 2
    assert 0.05 * off < result.defect[3] < 20.0 * off
    assert result.noise[3] < 0.01 * off


def test_a_solver_that_makes_no_step_backwards_is_seen_forwards():
    rk4 = symtop.integrator("rk4")

    def solve(top, start, plan):
        if plan.step_size < 0.0:
            raise symtop.SymtopError("forward only")
        return rk4.solvers["axis"](top, start, plan)

    result = series(dataclasses.replace(rk4, name="forward", solvers={"axis": solve}), "axis")
    assert (result.order, result.backward) == (4, False)
    assert result.resolved >= 4


def test_the_terms_of_known_functions_are_found():
    def motion(h):
        return np.array([np.exp(h), np.cos(h)])

    def step(h):
        return motion(h) + np.array([1e-6 * h**2, 0.25 * h**5])

    result = compared(step, motion, 4.0)
    assert result.order == 1
    assert result.defect[2] == pytest.approx(2e-6, rel=1e-3)  # beside 1/2
    assert result.defect[5] == pytest.approx(30.0, rel=1e-3)  # beside 1/120
    assert np.all(result.defect[[0, 1, 3, 4]] < 10.0 * result.noise[[0, 1, 3, 4]])
    assert compared(motion, motion, 4.0).order == compared(motion, motion, 4.0).resolved >= 6


def test_steps_that_never_succeed_are_refused():
    def step(h):
        raise symtop.SymtopError("no luck")

    with pytest.raises(symtop.SymtopError, match="no luck"):
        compared(step, np.cos, 1.0)
