"""Uncounted arrays hold the same numbers, and nobody's count changes."""

import sys

import numpy as np
import pytest
from numba import njit

from symtop.core.borrowed import borrowed


@njit
def _weighed(table, row):
    held = borrowed(table)
    total = 0.0
    for value in held[row:, 1]:
        total += value
    held[0, 0] = total
    return total


@pytest.mark.parametrize("order", ["C", "F"])
def test_the_numbers_are_those_of_the_array_and_what_is_written_stays(order):
    table = np.asarray(np.arange(12.0).reshape(4, 3), order=order)
    before = sys.getrefcount(table)
    for _ in range(3):
        assert _weighed(table, 1) == 4.0 + 7.0 + 10.0
    assert table[0, 0] == 21.0
    assert sys.getrefcount(table) == before


def test_a_temporary_lives_as_long_as_the_call():
    assert [_weighed(np.full((50, 2), float(k)), 0) for k in range(200)] == [50.0 * k for k in range(200)]
