"""The Runge-Kutta-Nystrom pair: order conditions of every Nystrom tree, steps, samples, momenta, and the poles."""

import functools
import itertools

import numpy as np
import pytest

import symtop
from symtop.core.jit import compile_kernel
from symtop.methods.runge_kutta import nystrom
from symtop.methods.runge_kutta.nystrom import DPRKN8, REDUCED
from symtop.model.scenes import closed_form

NODES = np.array([0.0, *DPRKN8.c])
MATRIX = np.array([np.pad(row, (0, len(NODES) - len(row))) for row in ((), *DPRKN8.a)])


@functools.cache
def trees(order):
    """Trees of q'' = F(q) of an order: how many velocities F is derived along, and the trees of other F in it."""
    return tuple((leaves, forest) for leaves in range(order) for forest in forests(order - 1 - leaves))


@functools.cache
def forests(order):
    """Sorted tuples of trees, each of which takes two orders more than its own F for a position: t + 1."""
    if order == 0:
        return ((),)
    made = set()
    for first in range(1, order):
        for tree, rest in itertools.product(trees(first), forests(order - first - 1)):
            made.add(tuple(sorted((tree, *rest))))
    return tuple(sorted(made))


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


def order_of(matrix, position, velocity, most=10):
    """The order to which weights of positions and velocities meet all conditions."""
    b, c = (np.pad(weights, (0, len(NODES) - len(weights))) for weights in (position, velocity))
    for order in range(1, most):
        for tree in trees(order):
            weight, (factor, power) = elementary(tree, matrix), moment(tree)
            if abs(c @ weight - factor / (power + 1)) > 1e-12:
                return order - 1
        for tree in trees(order - 1) if order > 1 else ():
            weight, (factor, power) = elementary(tree, matrix), moment(tree)
            if abs(b @ weight - factor / ((power + 1) * (power + 2))) > 1e-12:
                return order - 1
    return most


def less(weights, error):
    return np.subtract(*(np.pad(row, (0, len(NODES) - len(row))) for row in (weights, error)))


@functools.cache
def kernel(name):
    """Of `sample` or `refine`, from the start of a step."""
    part = getattr(nystrom.Nystrom(DPRKN8)(REDUCED.field), name)

    def sample(par, state, memory, h):
        return part(par, state, state, memory, 1.0, h)

    def refine(par, state, memory, h):
        return part(par, state, memory, h)

    return compile_kernel(sample if name == "sample" else refine)


def compiled(name, scene, h, **changed):
    """What `sample` returns for a step of h from the start of a scene, or `refine` leaves in the last row."""
    par, state = REDUCED.prepare(scene.top, scene.start)
    par = par._replace(**changed)
    memory = np.zeros((3, 4))
    memory[0] = REDUCED.field(par, state)
    made = kernel(name)(par, state, memory, h)
    return par, made, memory[-1]


@pytest.mark.parametrize(("name", "step"), [("spheroid", 0.03), ("goldstein", 0.06)])
def test_one_step_has_an_error_of_order_nine(name, step):
    scene = symtop.scene(name)
    steps = np.array([step, 0.5 * step]) * scene.nutation_period
    exact, errors = closed_form(scene).axis(steps), []
    for h, axis in zip(steps, exact, strict=True):
        _, (theta, _, phi, _), _ = compiled("sample", scene, float(h))
        mine = np.sin(theta) * np.sin(phi), -np.sin(theta) * np.cos(phi), np.cos(theta)
        errors.append(np.linalg.norm(mine - axis))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(9.0, abs=0.6)


@pytest.mark.parametrize("factor", [1.0, 1.01])
def test_momenta_come_from_the_increments(factor):
    """Those of a step that was made with another p_psi are shown, not those of the start."""
    scene = symtop.scene("spheroid")
    momenta = scene.top.momenta(scene.start)
    p_psi = factor * momenta.p_psi
    changed = {"p_psi": p_psi, "north": momenta.p_phi - p_psi, "south": momenta.p_phi + p_psi}
    _, _, shown = compiled("refine", scene, 0.02, **changed)
    np.testing.assert_allclose(shown[:2], [momenta.p_phi, p_psi], rtol=1e-13)


def test_the_table_has_order_eight_its_estimate_six_and_it_needs_fewer_forces_than_dop853():
    assert [len(trees(order)) for order in range(1, 6)] == [1, 1, 2, 3, 6]
    assert order_of(MATRIX, DPRKN8.b, DPRKN8.velocity) == 8
    lower = less(DPRKN8.b, DPRKN8.error), less(DPRKN8.velocity, DPRKN8.velocity_error)
    assert order_of(MATRIX, *lower) == 6
    np.testing.assert_allclose(MATRIX.sum(axis=1), NODES**2 / 2.0, atol=1e-14)
    np.testing.assert_array_equal(DPRKN8.a[-1], DPRKN8.b)  # the ninth stage is the first of the next step
    wrong = MATRIX.copy()
    wrong[-3, 0] += 1e-8
    assert order_of(wrong, DPRKN8.b, DPRKN8.velocity) < 8
    for tolerance in (1e-6, 1e-9, 1e-12):
        mine, theirs = (
            symtop.simulate("spheroid", f"{name}[angles]", tolerance=tolerance, guard=False)
            for name in ("dprkn8", "dop853-compiled")
        )
        error = float(symtop.errors(mine)["axis"].max())
        assert mine.attrs["force_evaluations"] < theirs.attrs["force_evaluations"]
        assert error < min(tolerance, float(symtop.errors(theirs)["axis"].max()))
