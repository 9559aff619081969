"""Embedded pairs, also of Nystrom's kind: tables by trees, SciPy's steps, samples, momenta, orders and poles."""

import functools
import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate, optimize

import symtop
from symtop.core.jit import compile_kernel, register_jitable
from symtop.judging.claims.order_conditions import conditions
from symtop.measure.step_map import generic_start
from symtop.methods.framework.calling import solve
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.runge_kutta import nystrom, pairs, projected
from symtop.methods.runge_kutta.nystrom import DPRKN8, REDUCED
from symtop.methods.runge_kutta.pair_tables import DOP853, DORMAND_PRINCE, TSIT5, VERN9
from symtop.model import scenes as models
from symtop.model.scenes import closed_form
from symtop.model.top import flat
from symtop.run.simulation import make_plan

PAIRS = {pair.name: pair for pair in pairs.PAIRS}


def square(table, stages):
    """The matrix of a table with its last stage, f(y+), where an estimate asks for it."""
    rows, matrix = [(), *table.a, table.b], np.zeros((stages, stages))
    for i, row in enumerate(rows[:stages]):
        matrix[i, : len(row)] = row
    return matrix


def weights(values, stages):
    return np.pad(values, (0, stages - len(values)))


@pytest.mark.parametrize(("table", "order", "estimate", "third"), [
    (TSIT5, 5, 4, None), (DOP853, 8, 5, 3), (VERN9, 9, 8, None)])  # fmt: skip
def test_tables_meet_the_order_conditions_of_every_tree_up_to_their_order_and_not_beyond(table, order, estimate, third):
    stages = max(len(table.a) + 1, len(table.error))
    matrix, b = square(table, stages), weights(table.b, stages)
    assert conditions(matrix, b, order + 1).order == order  # 719 trees of ten vertices for the ninth
    assert conditions(matrix, b - weights(table.error, stages), order).order == estimate
    if third is not None:
        assert conditions(matrix, b - weights(table.third, stages), order).order == third
    wrong_matrix = matrix.copy()
    wrong_matrix[-2, 0] += 1e-9
    assert conditions(wrong_matrix, b, order).order < order


def test_the_tables_of_order_five_and_eight_are_scipys():
    theirs, pair = integrate.RK45, DORMAND_PRINCE
    np.testing.assert_array_equal(square(pair, 6)[:, :5], theirs.A)
    for ours, scipys in ((pair.b, theirs.B), (pair.error, theirs.E), (pair.dense, theirs.P)):
        np.testing.assert_array_equal(ours, scipys)
    theirs = integrate.DOP853
    np.testing.assert_array_equal(square(DOP853, 12), theirs.A)
    np.testing.assert_array_equal(DOP853.b, theirs.B)
    for ours, scipys in ((DOP853.error, theirs.E5), (DOP853.third, theirs.E3)):
        np.testing.assert_array_equal(weights(ours, 13), scipys)
    for ours, scipys in zip(DOP853.extra + DOP853.dense, [*theirs.A_EXTRA, *theirs.D], strict=True):
        np.testing.assert_array_equal(weights(ours, 16), scipys)


@pytest.mark.parametrize("chart", list(FORMULATIONS))
@pytest.mark.parametrize(("name", "scene", "tolerance", "bound"), [
    ("dop853", "spheroid", 1e-6, 2e-8), ("dop853", "spheroid", 1e-10, 2e-8), ("dop853", "goldstein", 1e-4, 2e-8),
    ("rk45", "spheroid", 1e-6, 1e-9), ("rk45", "spheroid", 1e-7, 1e-9), ("rk45", "goldstein", 1e-4, 1e-9),
])  # fmt: skip
def test_a_pair_accepts_and_rejects_scipys_steps(name, scene, tolerance, bound, chart):
    """In angles rounding grows from step to step: a start of spheroid that is off by 1e-15 gives SciPy 462 or 449 steps
    of order 8 instead of 460 until t = 40."""
    for horizon, atol in ((0.5, 1e-12), (8.0 if chart == "angles" else 40.0, bound)):
        span = {"tolerance": tolerance, "horizon": horizon, "samples": 301, "guard": False}
        mine, theirs = (symtop.simulate(scene, f"{key}[{chart}]", **span) for key in (f"{name}-compiled", name))
        for count in ("steps", "force_evaluations", "outcome"):
            assert mine.attrs[count] == theirs.attrs[count]
        np.testing.assert_allclose(mine["axis"], theirs["axis"], rtol=0.0, atol=atol)


def test_the_interpolant_of_tsit5_has_order_four_and_costs_where_it_is_asked():
    """b(x) meets sum b_i(x) Phi_i(t) = x^|t| / gamma(t) for the trees of up to four vertices, not for five."""
    matrix = square(TSIT5, 7)
    scale = 0.37  # conditions of the table with the nodes divided by x are those of the interpolant at x
    b = np.array([np.polyval((*reversed(row), 0.0), scale) for row in TSIT5.dense]) / scale
    assert conditions(matrix / scale, b, 5).order == 4
    np.testing.assert_allclose(np.sum(TSIT5.dense, axis=1), weights(TSIT5.b, 7), atol=1e-14)
    sparse, dense = (symtop.simulate("spheroid", "dop853-compiled[axis]", tolerance=1e-6, samples=n, guard=False).attrs
                     for n in (2, 2000))  # fmt: skip
    assert sparse["steps"] == dense["steps"]
    assert dense["force_evaluations"] - sparse["force_evaluations"] == 3 * (dense["steps"] - 2)  # first and last


def test_a_wrong_estimate_takes_other_steps():
    scene, pair = symtop.scene("spheroid"), PAIRS["dop853-compiled"]
    plan, _ = make_plan(scene, symtop.integrator("dop853-compiled"), None, 1e-6, horizon=8.0, samples=2)
    variant = pair._replace(table=DOP853._replace(third=DOP853.error))
    solvers = (pairs.solver(FORMULATIONS["axis"], entry, entry.rows) for entry in (pair, variant))
    first, second = (solver(scene.top, scene.start, plan) for solver in solvers)
    assert first.steps != second.steps


@pytest.mark.parametrize("name", PAIRS)
def test_one_fixed_step_is_the_table(name):
    table, scene = PAIRS[name].table, symtop.scene("goldstein")
    form = FORMULATIONS["axis"]
    par, state = form.prepare(scene.top, scene.start)
    h, y, slopes = 0.03, np.array(state), []
    for row in ((), *table.a):
        change = h * sum((a * k for a, k in zip(row, slopes, strict=False)), np.zeros(6))
        slopes.append(np.array(form.field(par, tuple(y + change))))
    fixed = symtop.integrator(f"{name}-fixed[axis]")
    plan, _ = make_plan(scene, fixed, h, None, horizon=h, samples=2)
    run = fixed.solvers["axis"](scene.top, scene.start, plan)
    change = h * sum(b * k for b, k in zip(table.b, slopes, strict=False))
    np.testing.assert_allclose(run.states[-1], y + change, rtol=1e-14, atol=1e-14)
    assert run.force_evaluations == len(table.b)


@register_jitable
def number(near, far, which):
    """Of both states, one after the other."""
    return near[which] if which < len(near) else far[which - len(near)]


@pytest.mark.parametrize(("name", "chart"), [("spheroid", "axis"), pytest.param(
    "heavy-chaotic", "body", marks=pytest.mark.quick)])  # fmt: skip
def test_two_runs_in_one_register_have_the_bits_of_each_alone(name, chart):
    scene, h, marks = models.scene(name, bodies=True), 0.03, np.array([1, 50, 400])
    neighbour = replace(scene.start, **({"psi_dot": 1.0} if chart == "axis" else {"omega_body": (0.1, 0.2, 0.3)}))
    run = pairs.two_runs(chart, pairs.DOP853_PAIR, number)
    fixed = symtop.integrator("dop853-compiled-fixed").solvers[chart]
    near, far = (fixed(scene.top, start, symtop.Plan.steps(h, marks)).states for start in (scene.start, neighbour))
    out = np.empty((near.shape[1] + far.shape[1], marks.size))
    for which, row in enumerate(out):
        run(flat(scene.top, scene.start), flat(scene.top, neighbour), h, marks, which, row)
    np.testing.assert_array_equal(out.T, np.hstack([near, far]))
    assert not np.array_equal(near, far)


NODES = np.array([0.0, *DPRKN8.c])
MATRIX = np.array([weights(row, len(NODES)) for row in ((), *DPRKN8.a)])


@functools.cache
def trees(order):
    """Trees of q'' = F(q) of an order: how many velocities F is derived along, and the trees of other F in it."""
    return tuple((leaves, forest) for leaves in range(order) for forest in forests(order - 1 - leaves))


@functools.cache
def forests(order):
    """Sorted tuples of trees, each of which takes two orders more than its own F for a position: t + 1."""
    if order == 0:
        return ((),)
    result = set()
    for first in range(1, order):
        for tree, forest in itertools.product(trees(first), forests(order - first - 1)):
            result.add(tuple(sorted((tree, *forest))))
    return tuple(sorted(result))


def elementary(tree, matrix):
    """Its weight at each stage, the product over its branches."""
    leaves, forest = tree
    weight = NODES**leaves
    for branch in forest:
        weight = weight * (matrix @ elementary(branch, matrix))
    return weight


def moment(tree):
    """The same for the solution, c s^m: a velocity gives s, a position that of F integrated twice."""
    factor, power = 1.0, tree[0]
    for branch in tree[1]:
        inner, m = moment(branch)
        factor, power = factor * inner / ((m + 1) * (m + 2)), power + m + 2
    return factor, power


def order_of(matrix, position, velocity, highest=10):
    """The order to which weights of positions and velocities meet all conditions."""
    b, c = (weights(row, len(NODES)) for row in (position, velocity))
    for order in range(1, highest):
        for row, offset in ((c, 0), (b, 1)):  # a position takes one integration more
            for tree in trees(order - offset):
                factor, power = moment(tree)
                solution = factor / ((power + 1) * (power + 2) ** offset)
                if abs(row @ elementary(tree, matrix) - solution) > 1e-12:
                    return order - 1
    return highest


@functools.cache
def kernel(name):
    """Of `sample` or `refine`, from the start of a step."""
    part = getattr(nystrom.method(REDUCED.field), name)

    def sample(par, state, memory, h):
        return part(par, state, state, memory, 1.0, h)

    def refine(par, state, memory, h):
        return part(par, state, memory, h)

    return compile_kernel(sample if name == "sample" else refine)


def compiled(name, scene, h, **fields):
    """What `sample` returns for a step of h from the start of a scene, or `refine` leaves in the last row."""
    par, state = REDUCED.prepare(scene.top, scene.start)
    par, memory = par._replace(**fields), np.zeros((3, 4))
    memory[0] = REDUCED.field(par, state)
    return par, kernel(name)(par, state, memory, h), memory[-1]


@pytest.mark.parametrize(("name", "step"), [("spheroid", 0.03), ("goldstein", 0.06)])
def test_one_step_has_an_error_of_order_nine(name, step):
    scene = symtop.scene(name)
    steps = np.array([step, 0.5 * step]) * scene.nutation_period
    exact, errors = closed_form(scene).axis(steps), []
    for h, axis in zip(steps, exact, strict=True):
        _, (theta, _, phi, _), _ = compiled("sample", scene, float(h))
        errors.append(np.linalg.norm((np.sin(theta) * np.sin(phi), -np.sin(theta) * np.cos(phi), np.cos(theta)) - axis))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(9.0, abs=0.6)


@pytest.mark.parametrize("factor", [1.0, 1.01])
def test_momenta_come_from_the_increments(factor):
    """Those of a step that was made with another p_psi are shown, not those of the start."""
    scene = symtop.scene("spheroid")
    momenta = scene.top.momenta(scene.start)
    p_psi = factor * momenta.p_psi
    fields = {"p_psi": p_psi, "north": momenta.p_phi - p_psi, "south": momenta.p_phi + p_psi}
    _, _, row = compiled("refine", scene, 0.02, **fields)
    np.testing.assert_allclose(row[:2], [momenta.p_phi, p_psi], rtol=1e-13)


def test_the_table_has_order_eight_its_estimate_six_and_it_needs_fewer_forces_than_dop853():
    assert [len(trees(order)) for order in range(1, 6)] == [1, 1, 2, 3, 6]
    assert order_of(MATRIX, DPRKN8.b, DPRKN8.velocity) == 8
    pairs_of_rows = (DPRKN8.b, DPRKN8.error), (DPRKN8.velocity, DPRKN8.velocity_error)
    lower = (np.subtract(*(weights(row, len(NODES)) for row in pair)) for pair in pairs_of_rows)
    assert order_of(MATRIX, *lower) == 6
    np.testing.assert_allclose(MATRIX.sum(axis=1), NODES**2 / 2.0, atol=1e-14)
    np.testing.assert_array_equal(DPRKN8.a[-1], DPRKN8.b)  # the ninth stage is the first of the next step
    wrong_matrix = MATRIX.copy()
    wrong_matrix[-3, 0] += 1e-8
    assert order_of(wrong_matrix, DPRKN8.b, DPRKN8.velocity) < 8
    for tolerance in (1e-6, 1e-9, 1e-12):
        mine, theirs = (symtop.simulate("spheroid", f"{name}[angles]", tolerance=tolerance, guard=False)
                        for name in ("dprkn8", "dop853-compiled"))  # fmt: skip
        error, dop853_error = (float(symtop.errors(run)["axis"].max()) for run in (mine, theirs))
        assert mine.attrs["force_evaluations"] < theirs.attrs["force_evaluations"]
        assert error < min(tolerance, dop853_error)


def test_a_projected_step_ends_on_the_constants_next_to_where_the_plain_one_ends():
    scene = symtop.scene("goldstein")
    (I1, mgl), plan = (scene.top.I1, scene.top.mgl), symtop.Plan.steps(scene.nutation_period / 4.0, [0, 1])
    plain, result = (solve(symtop.integrator(name), "axis", scene.top, scene.start, plan).states
                     for name in ("dop853-compiled-fixed", "dop853-projected"))  # fmt: skip
    constants = lambda y: np.array([0.5 * y[:3] @ y[:3], y[:3] @ y[3:], 0.5 * y[3:] @ y[3:] / I1 + mgl * y[2]])
    e, L = plain[1, :3], plain[1, 3:]
    gradients = np.array([[*e, 0, 0, 0], [*L, *e], [0, 0, mgl, *L / I1]])
    directions = gradients * ([1.0] * 3 + [plain[0, 3:] @ plain[0, 3:] + I1 * mgl] * 2 + [0.0])
    gap = lambda factors: constants(plain[1] + factors @ directions) - constants(plain[0])
    expected = plain[1] + optimize.root(gap, np.zeros(3), tol=1e-15).x @ directions
    np.testing.assert_allclose(result[1], expected, rtol=0.0, atol=1e-14)
    assert np.abs(gap(np.zeros(3))).max() > 1e-8  # the control: the plain step leaves them


@pytest.mark.parametrize("name", ["steady", "sleeping", "sleeping-unstable"])
def test_a_gradient_that_depends_on_the_others_is_left_out_of_the_projection(name):
    run = symtop.simulate(name, "vern9-projected", step_size=0.02, horizon=2.0, guard=False)
    assert run.attrs["outcome"] == "ok"
    assert float(symtop.errors(run)["axis"].max()) < 1e-9


def test_a_projected_step_has_the_order_of_its_table_though_runs_show_a_higher_one(monkeypatch):
    """Y(h) - Y(h/2) o Y(h/2) begins with h^10: its powers of h by Cauchy's integral over complex steps."""
    monkeypatch.setattr(projected, "summed", lambda u, v: tuple(np.add(u, v)))
    monkeypatch.setattr(projected, "_inverse", lambda value, scale: 1.0 / value)  # complex numbers are not compared
    scene, matrix, f = symtop.scene("spheroid"), square(VERN9, len(VERN9.b)), projected.AXIS.field
    par, start = projected._levels(scene.top, generic_start(scene))
    start = np.array(start)

    def step(y, h):
        k = np.zeros((len(VERN9.b), 6), complex)
        for i, row in enumerate(matrix):
            k[i] = f(par, y + h * row @ k)
        return y + projected.projected(par, y, tuple(h * np.array(VERN9.b) @ k))

    circle = 0.08 * np.exp(2j * np.pi * np.arange(64) / 64)
    gaps = [step(start, h) - step(step(start, 0.5 * h), 0.5 * h) for h in circle * scene.nutation_period]
    sizes = np.max(np.abs(np.fft.fft(gaps, axis=0))[:, :3], axis=1) / 64
    assert sizes[:10].max() < 1e-15
    assert 1e-11 < sizes[10] < 0.25 * sizes[11]  # of steps of 0.08 nutations
