"""Rooted trees and the conditions of tables: numbers of trees, known orders, and tables that are off."""

import pytest

from symtop.measure.order_conditions import conditions, density, size, trees, triangle
from symtop.methods.runge_kutta.pair_tables import DORMAND_PRINCE

RK4 = ((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)), (1 / 6, 1 / 3, 1 / 3, 1 / 6)


def square(rows):
    return triangle([x for row in rows for x in row], len(rows))


def test_there_are_as_many_trees_as_there_are():
    assert [len(trees(n)) for n in range(1, 8)] == [1, 1, 2, 4, 9, 20, 48]
    assert all(size(tree) == 6 for tree in trees(6))
    # tall tree: n!; bush: n
    assert sorted(density(tree) for tree in trees(4)) == [4, 8, 12, 24]


def test_known_tables_have_their_orders():
    assert conditions(square(RK4[0]), RK4[1]).order == 4
    fine = [value for row in DORMAND_PRINCE.a for value in row]
    stages = len(DORMAND_PRINCE.b)
    assert conditions(triangle(fine, stages), DORMAND_PRINCE.b).order == 5
    r = 3**0.5 / 6
    assert conditions([[0.25, 0.25 - r], [0.25 + r, 0.25]], [0.5, 0.5]).order == 4
    assert conditions([[0.5]], [1.0]).order == 2
    assert conditions([[0.0]], [1.0]).order == 1
    assert conditions([[0.0]], [0.9]).order == 0


@pytest.mark.parametrize(("off", "found"), [(1e-9, 2), (1e-13, 4)])
def test_a_coefficient_that_is_off_shows_beyond_rounding(off, found):
    rows = (
        (),
        (0.5,),
        (0.0, 0.5),
        (off, 0.0, 1.0 - off),
    )  # the same nodes, b4 off c3 = off/12 in the tall tree of order 3
    table = conditions(square(rows), RK4[1])
    assert table.order == found
    assert table.defect[2] == pytest.approx(off / 12, rel=0.01, abs=1e-16)
