"""Kernels in lanes whose step is one function of numbers, without stages or iterations: one loop over the lanes.

The table holds the numbers of the top and the fields of the rule as they are.
"""

from collections.abc import Callable
from typing import Any

from symtop.core.jit import register_jitable, set_item
from symtop.core.simd import wide_vectors
from symtop.methods.framework.lanes import Lanes, W, column, put
from symtop.methods.framework.outcomes import OK
from symtop.methods.vectors import accumulate

AT_ONCE = 8  # numbers of a tuple that LLVM still reads without a loop, which would stand in the way


def reading(count: int) -> Callable[..., Any]:
    """``(array, first, j)`` to so many numbers of lane j."""
    like, after = (0.0,) * min(count, AT_ONCE), count - AT_ONCE
    if after <= 0:

        def read(array, first, j):  # type: ignore[no-untyped-def]
            return column(array, first, j, like)
    else:
        rest = reading(after)

        def read(array, first, j):  # type: ignore[no-untyped-def]
            return column(array, first, j, like) + rest(array, first + AT_ONCE, j)

    registered: Callable[..., Any] = register_jitable(read)
    return registered


def one_loop(
    advance: Callable[..., Any], rule: Any, *, top: Any, dimension: int, carry: int,
    add: Callable[..., Any] = accumulate,
) -> Lanes:  # fmt: skip
    """``advance(par, rule, state, carry)`` is the increment, the next carry and an outcome; `rule` its NamedTuple.

    `add` is how increments are summed, as in `loop.driver`.
    """
    tops, fields = len(top._fields), len(rule._fields)
    zeros, given = (0.0,) * dimension, (0.0,) * fields
    step_at, flag, carry_at = 2 * dimension, 3 * dimension, 3 * dimension + 2
    register_jitable(advance)
    top_of, rule_of, carried = reading(tops), reading(fields), reading(carry)

    def lay(par, rule, h, numbers):  # type: ignore[no-untyped-def]
        for i in range(fields):
            numbers[i] = rule[i]

    def read(numbers):  # type: ignore[no-untyped-def]
        values = given
        for i in range(fields):
            values = set_item(values, i, numbers[i])
        return rule(*values)

    def step(block, table):  # type: ignore[no-untyped-def]
        wide_vectors()
        for j in range(W):
            par, scaled = top(*top_of(table, 0, j)), rule(*rule_of(table, tops, j))
            state, lost = column(block, 0, j, zeros), block[flag * W + j]
            dstate, after, outcome = advance(par, scaled, state, carried(block, carry_at, j))
            block[flag * W + j] = lost if outcome == OK else 1.0
            moved, low = add(state, column(block, dimension, j, zeros), dstate)
            put(block, 0, j, moved)
            put(block, dimension, j, low)
            put(block, step_at, j, dstate)
            put(block, carry_at, j, after)

    return Lanes(step, lay, read, lambda _: fields, top, dimension, carry, effort=_once)


def _once(rule: Any) -> int:
    return 1
