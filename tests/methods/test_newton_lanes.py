"""Newton's iteration over lanes: each lane ends when it would alone, and one that does not end disturbs no other."""

import numpy as np
import pytest

from symtop.methods.framework.lanes import W
from symtop.methods.framework.plan import OUTCOMES
from symtop.methods.lagrangian.discrete_lagrangian import discrete_lagrangian
from symtop.methods.lagrangian.unreduced import built_in as unreduced
from symtop.model.scenes import scene
from symtop.model.top import flat
from tests.methods.test_lanes import SOLVERS, assert_runs_alone, left_alone, members

IMPLICIT = ("midpoint[angles]", "trapezoidal[angles]", "simpson-linear[angles]", "galerkin-simpson[angles]")


@pytest.mark.parametrize("name", IMPLICIT)
def test_members_have_the_bits_of_runs_alone(name):
    """Some of them leave the chart, in some Newton does not converge: so they do alone."""
    given = members(seed=7)
    done = SOLVERS[name].many(*given)
    assert_runs_alone(SOLVERS[name], *given, done)
    assert {OUTCOMES[k] for k in done.outcome} == {"ok", "left_chart", "not_converged"}
    left = left_alone(SOLVERS[name], *given)
    assert set(np.flatnonzero(done.outcome != 0)) <= set(left.tolist())
    assert len(left) < 200


@pytest.mark.parametrize("name", ["gauss-4[axis]", "gauss-8[axis]", "gauss-4[attitude]"])
def test_sweeps_of_gauss_have_the_bits_of_runs_alone(name):
    """Where they do not converge, Newton's iteration takes over in the kernel for one."""
    solver, given = SOLVERS[name], members(300, seed=9)
    assert solver.in_lanes
    done = solver.many(*given)
    assert_runs_alone(solver, *given, done)
    assert {OUTCOMES[k] for k in done.outcome} == {"ok", "not_converged"}


def test_gauss_methods_of_more_stages_and_unreduced_kernels_run_alone():
    assert not any(SOLVERS[name].in_lanes for name in ("gauss-12[axis]", "gauss-6[attitude]"))
    assert not any(method.solvers["angles"].in_lanes for method in unreduced())


def test_a_rule_of_ones_own_runs_in_lanes():
    """Two nodes at the start, one inside, one at the end, and weights that are not symmetric."""
    method = discrete_lagrangian("mixed", (0.0, 0.0, 0.3, 1.0), (0.1, 0.2, 0.3, 0.4))
    solver, given = method.solvers["angles"], members(200, seed=8)
    assert solver.in_lanes
    assert_runs_alone(solver, *given, solver.many(*given))


def test_a_lane_that_takes_more_iterations_changes_no_other():
    """Steps so large that Newton takes many iterations in one lane; the others keep bits and counts."""
    numbers, h, marks = spread(W, 40)
    solver = SOLVERS["midpoint[angles]"]
    before = solver.many(numbers, h, marks)
    h[5] *= 40.0
    after = solver.many(numbers, h, marks)
    others = np.arange(W) != 5
    assert after.work[5] > before.work[5]
    for one, other in zip(before, after, strict=True):
        np.testing.assert_array_equal(one[others], other[others])


def spread(count, steps):
    """Starts and tops around a scene, all of them with 300 steps to its nutation."""
    draw, at = np.random.default_rng(0), scene("spheroid")
    numbers = np.tile(flat(at.top, at.start), (count, 1))
    numbers[:, 3:] *= draw.uniform(0.8, 1.2, (count, 6))
    numbers[:, 1] *= draw.uniform(0.8, 1.2, count)
    return numbers, np.full(count, at.nutation_period / 300), np.tile([0, steps], (count, 1))
