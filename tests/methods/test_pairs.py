"""Embedded pairs with their stages written out: tables by rooted trees, SciPy's steps, samples, and orders."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate

import symtop
from symtop.core.jit import register_jitable
from symtop.measure.order_conditions import conditions
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import integrator
from symtop.methods.runge_kutta import pairs
from symtop.methods.runge_kutta.pair_tables import DOP853, DORMAND_PRINCE, TSIT5, VERN9
from symtop.model import scenes as models
from symtop.model.top import flat
from symtop.run.simulation import make_plan

PAIRS = {pair.name: pair for pair in pairs.PAIRS}


def square(table, stages):
    """The matrix of a table with its last stage, f(y+), where an estimate asks for it."""
    rows = [(), *table.a, table.b]
    matrix = np.zeros((stages, stages))
    for i, row in enumerate(rows[:stages]):
        matrix[i, : len(row)] = row
    return matrix


def weights(values, stages):
    return np.pad(values, (0, stages - len(values)))


@pytest.mark.parametrize(
    ("table", "order", "estimate", "third"), [(TSIT5, 5, 4, None), (DOP853, 8, 5, 3), (VERN9, 9, 8, None)]
)
def test_tables_meet_the_order_conditions_of_every_tree_up_to_their_order_and_not_beyond(table, order, estimate, third):
    stages = max(len(table.a) + 1, len(table.error))
    matrix, b = square(table, stages), weights(table.b, stages)
    assert conditions(matrix, b, order + 1).order == order  # 719 trees of ten vertices for the ninth
    assert conditions(matrix, b - weights(table.error, stages), order).order == estimate
    if third is not None:
        assert conditions(matrix, b - weights(table.third, stages), order).order == third
    wrong = matrix.copy()
    wrong[-2, 0] += 1e-9
    assert conditions(wrong, b, order).order < order


def test_the_tables_of_order_five_and_eight_are_scipys():
    theirs, pair = integrate.RK45, DORMAND_PRINCE
    np.testing.assert_array_equal(square(pair, 6)[:, :5], theirs.A)
    for mine, other in ((pair.b, theirs.B), (pair.error, theirs.E), (pair.dense, theirs.P)):
        np.testing.assert_array_equal(mine, other)
    theirs = integrate.DOP853
    np.testing.assert_array_equal(square(DOP853, 12), theirs.A)
    np.testing.assert_array_equal(DOP853.b, theirs.B)
    for mine, other in ((DOP853.error, theirs.E5), (DOP853.third, theirs.E3)):
        np.testing.assert_array_equal(weights(mine, 13), other)
    for mine, other in zip(DOP853.extra + DOP853.dense, [*theirs.A_EXTRA, *theirs.D], strict=True):
        np.testing.assert_array_equal(weights(mine, 16), other)


@pytest.mark.parametrize("chart", list(FORMULATIONS))
@pytest.mark.parametrize(("name", "scene", "tolerance", "close"), [
    ("dop853", "spheroid", 1e-6, 2e-8), ("dop853", "spheroid", 1e-10, 2e-8), ("dop853", "goldstein", 1e-4, 2e-8),
    ("rk45", "spheroid", 1e-6, 1e-9), ("rk45", "spheroid", 1e-7, 1e-9), ("rk45", "goldstein", 1e-4, 1e-9),
])  # fmt: skip
def test_a_pair_accepts_and_rejects_scipys_steps(name, scene, tolerance, close, chart):
    """In angles rounding grows from step to step: a start of spheroid that is off by 1e-15 gives SciPy 462 or 449 steps
    of order 8 instead of 460 until t = 40."""
    for horizon, apart in ((0.5, 1e-12), (8.0 if chart == "angles" else 40.0, close)):
        span = {"tolerance": tolerance, "horizon": horizon, "samples": 301, "guard": False}
        mine, theirs = (symtop.simulate(scene, f"{one}[{chart}]", **span) for one in (f"{name}-compiled", name))
        for count in ("steps", "force_evaluations", "outcome"):
            assert mine.attrs[count] == theirs.attrs[count]
        np.testing.assert_allclose(mine["axis"], theirs["axis"], rtol=0.0, atol=apart)


def test_the_interpolant_of_tsit5_has_order_four_and_costs_where_it_is_asked():
    """b(x) meets sum b_i(x) Phi_i(t) = x^|t| / gamma(t) for the trees of up to four vertices, not for five."""
    matrix = square(TSIT5, 7)
    scale = 0.37  # conditions of the table with the nodes divided by x are those of the interpolant at x
    b = np.array([np.polyval((*reversed(row), 0.0), scale) for row in TSIT5.dense]) / scale
    assert conditions(matrix / scale, b, 5).order == 4
    np.testing.assert_allclose(np.sum(TSIT5.dense, axis=1), weights(TSIT5.b, 7), atol=1e-14)
    few, many = (
        symtop.simulate("spheroid", "dop853-compiled[axis]", tolerance=1e-6, samples=n, guard=False).attrs
        for n in (2, 2000)
    )
    assert few["steps"] == many["steps"]
    assert many["force_evaluations"] - few["force_evaluations"] == 3 * (many["steps"] - 2)  # the first and the last


def test_a_wrong_estimate_takes_other_steps():
    scene, pair = symtop.scene("spheroid"), PAIRS["dop853-compiled"]
    plan, _ = make_plan(scene, integrator("dop853-compiled"), None, 1e-6, horizon=8.0, samples=2)
    wrong = pair._replace(table=DOP853._replace(third=DOP853.error))
    solvers = (pairs.solver(FORMULATIONS["axis"], chosen, chosen.rows) for chosen in (pair, wrong))
    right, other = (solver(scene.top, scene.start, plan) for solver in solvers)
    assert right.steps != other.steps


@pytest.mark.parametrize("name", PAIRS)
def test_one_fixed_step_is_the_table(name):
    table, scene = PAIRS[name].table, symtop.scene("goldstein")
    form = FORMULATIONS["axis"]
    par, state = form.prepare(scene.top, scene.start)
    h, y, slopes = 0.03, np.array(state), []
    for row in ((), *table.a):
        moved = h * sum((a * k for a, k in zip(row, slopes, strict=False)), np.zeros(6))
        slopes.append(np.array(form.field(par, tuple(y + moved))))
    fixed = integrator(f"{name}-fixed[axis]")
    plan, _ = make_plan(scene, fixed, h, None, horizon=h, samples=2)
    run = fixed.solvers["axis"](scene.top, scene.start, plan)
    moved = h * sum(b * k for b, k in zip(table.b, slopes, strict=False))
    np.testing.assert_allclose(run.states[-1], y + moved, rtol=1e-14, atol=1e-14)
    assert run.force_evaluations == len(table.b)


@register_jitable
def number(near, far, which):
    """Of both states, one after the other."""
    return near[which] if which < len(near) else far[which - len(near)]


@pytest.mark.parametrize(("name", "chart"), [("spheroid", "axis"), ("heavy-chaotic", "body")])
def test_two_runs_in_one_register_have_the_bits_of_each_alone(name, chart):
    scene, h, marks = models.scene(name, bodies=True), 0.03, np.array([1, 50, 400])
    moved = replace(scene.start, **({"psi_dot": 1.0} if chart == "axis" else {"omega_body": (0.1, 0.2, 0.3)}))
    run, fixed = pairs.two_runs(chart, pairs.DOP8, number), integrator("dop853-compiled-fixed").solvers[chart]
    near, far = (fixed(scene.top, start, Plan.steps(h, marks)).states for start in (scene.start, moved))
    out = np.empty((near.shape[1] + far.shape[1], marks.size))
    for which, row in enumerate(out):
        run(flat(scene.top, scene.start), flat(scene.top, moved), h, marks, which, row)
    np.testing.assert_array_equal(out.T, np.hstack([near, far]))
    assert not np.array_equal(near, far)
