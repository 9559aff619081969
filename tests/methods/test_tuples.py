"""Rows in kernels are what they are in Python, whether tuples or arrays."""

import numpy as np
import pytest

from symtop.core.jit import compile_kernel
from symtop.methods.simd import times, with_item


def scaled(values, by):
    return times(values, by)


def replaced(values, i, value):
    return with_item(values, i, value)


@pytest.mark.parametrize(("work", "given", "expected"), [
    (scaled, (0.1,), [0.1 * 0.1, 0.1 * 0.3, 0.1 * 0.7]),
    (replaced, (1, 5.0), [0.1, 5.0, 0.7]),
])  # fmt: skip
@pytest.mark.parametrize("compiled", [False, True])
def test_a_tuple_is_new_and_an_array_the_same(work, given, expected, compiled):
    made = compile_kernel(work) if compiled else work
    row = (0.1, 0.3, 0.7)
    assert list(made(row, *given)) == expected
    assert row == (0.1, 0.3, 0.7)
    array = np.array(row)
    assert made(array, *given).tolist() == expected
    assert array.tolist() == expected  # in place: it is the caller's own
