"""The two constructors of a plan, and the scales of a scene."""

import math

import numpy as np

import symtop
from symtop.methods.framework.plan import Plan

SCENE = symtop.scene("spheroid")


def test_a_plan_of_steps_says_the_same_in_steps_and_in_times():
    plan = Plan.steps(0.1, [0, 3, 7])
    assert plan.marks.dtype == np.int64
    np.testing.assert_array_equal(plan.times, np.array([0, 3, 7]) * 0.1)
    assert plan.horizon == 7.0 * 0.1
    assert math.isnan(plan.tolerance)
    assert Plan.steps(8.0 / 3.0, [3], 8.0).horizon == 8.0  # where the product would be rounded


def test_a_plan_with_a_tolerance_has_no_steps():
    plan = Plan.until([0.5, 2.0], 1e-6, budget=100.0)
    assert (plan.horizon, plan.marks.size, plan.tolerance, plan.most(5.0)) == (2.0, 0, 1e-6, 100.0)
    assert math.isnan(plan.step_size)
    assert Plan.until([1.0], 1e-6).most(5.0) == 5.0


def test_a_scene_has_a_time_scale_even_on_a_separatrix():
    assert SCENE.time_scale() == SCENE.time_scale(3.0) == SCENE.nutation_period
    start = symtop.Angles(theta=0.0, psi_dot=1.0)  # upright and too slow to stay there: it falls after all time
    endless = symtop.Scene("endless", symtop.SymmetricTop(1.0, 1.0, 1.0), start, 20.0)
    assert math.isinf(endless.nutation_period)
    assert endless.time_scale() == endless.horizon / 8.0
    assert endless.time_scale(4.0) == 0.5
