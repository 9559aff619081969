"""Conditions of tables: numbers of trees and of brackets, known orders, and tables that are off."""

import numpy as np
import pytest

from symtop.measure.order_conditions import (
    commutator,
    conditions,
    density,
    element,
    exponential,
    logarithm,
    product,
    size,
    splitting_conditions,
    trees,
    triangle,
    vanishing,
)
from symtop.methods.runge_kutta.pair_tables import DORMAND_PRINCE
from tests.judging.blind.right import CLASSICAL


def square(rows):
    return triangle([x for row in rows for x in row], len(rows))


def test_there_are_as_many_trees_as_there_are():
    assert [len(trees(n)) for n in range(1, 8)] == [1, 1, 2, 4, 9, 20, 48]
    assert all(size(tree) == 6 for tree in trees(6))
    # tall tree: n!; bush: n
    assert sorted(density(tree) for tree in trees(4)) == [4, 8, 12, 24]


def test_known_tables_have_their_orders():
    assert conditions(square(CLASSICAL[0]), CLASSICAL[1]).order == 4
    assert conditions(square(((), *DORMAND_PRINCE.a)), DORMAND_PRINCE.b).order == 5
    r = 3**0.5 / 6
    assert conditions([[0.25, 0.25 - r], [0.25 + r, 0.25]], [0.5, 0.5]).order == 4
    assert conditions([[0.5]], [1.0]).order == 2
    assert conditions([[0.0]], [1.0]).order == 1
    assert conditions([[0.0]], [0.9]).order == 0


@pytest.mark.parametrize(("off", "order"), [(1e-9, 2), (1e-13, 4)])
def test_a_coefficient_that_is_off_shows_beyond_rounding(off, order):
    # the same nodes; b4 off c3 = off/12 in the tall tree of order 3
    rows = ((), (0.5,), (0.0, 0.5), (off, 0.0, 1.0 - off))
    table = conditions(square(rows), CLASSICAL[1])
    assert table.order == order
    assert table.defect[2] == pytest.approx(off / 12, rel=0.01, abs=1e-16)


FREE = [2, 1, 2, 3, 6, 9, 18, 30, 56, 99]  # dimensions of the free Lie algebra of two letters: Witt's formula


@pytest.mark.parametrize("longest", [9, pytest.param(10, marks=pytest.mark.slow)])
def test_there_are_as_many_conditions_as_there_are(longest):
    """McLachlan and Quispel, Acta Numerica 11 (2002) 341, of Runge-Kutta-Nystrom methods."""
    count = [free - vanishing(length).shape[1] for length, free in enumerate(FREE[:longest], start=1)]
    assert count == [2, 1, 2, 2, 4, 5, 10, 14, 25, 39][:longest]


def test_log_undoes_exp_and_begins_as_baker_campbell_and_hausdorff_say():
    t, v = element(4, t=1.0), element(4, v=1.0)
    words = logarithm(product(exponential(t), exponential(v)))
    np.testing.assert_allclose(words[1], [1.0, 1.0])
    np.testing.assert_allclose(words[2], 0.5 * commutator(t, v)[2])
    third = [a - b for a, b in zip(commutator(t, commutator(t, v)), commutator(v, commutator(t, v)), strict=True)]
    np.testing.assert_allclose(words[3], third[3] / 12.0, atol=1e-16)
    for row in logarithm(exponential(t))[2:]:
        np.testing.assert_allclose(row, 0.0, atol=1e-15)


def test_known_splittings_have_their_orders():
    assert splitting_conditions((1.0,), (1.0, 0.0)).order == 1
    assert splitting_conditions((1.0,), (0.5, 0.5)).order == 2
    assert splitting_conditions((1.0,), (0.5, 0.4)).order == 0
    a, b = (1.0, -2 / 3, 2 / 3), (-1 / 24, 3 / 4, 7 / 24)
    assert splitting_conditions(a, (0.0, *b)).order == 3  # Ruth 1983
    assert splitting_conditions(a, (0.0, *reversed(b))).order < 3


def test_gradients_and_processors_count():
    assert splitting_conditions((0.5, 0.5), (1 / 6, 2 / 3, 1 / 6), (0.0, -1 / 72, 0.0)).order == 4
    assert splitting_conditions((0.5, 0.5), (1 / 6, 2 / 3, 1 / 6), (0.0, 1 / 72, 0.0)).order == 2
    assert splitting_conditions((1.0,), (0.5, 0.5), (-1 / 48, -1 / 48), 1 / 12).order == 4
    assert splitting_conditions((1.0,), (0.5, 0.5), (-1 / 48, -1 / 48)).order == 2
