"""Explicit Runge-Kutta methods of fixed step in lanes: `runge_kutta.explicit_step` written out for a number of stages.

    k_i = f(y + h a_i1 k_1 + ... + h a_i,i-1 k_i-1),    y+ = y + h b_1 k_1 + ... + h b_s k_s

A step is one loop over the lanes. Its stages are written out, and so are the sums of slopes, term by term in the order
in which the kernel for one adds them: slopes stay in registers as far as these reach, and what all stages need, such as
1/I1, is made once. With a loop for each stage and the slopes in `block`, rk4 takes 1.2 times as long in the space
frame. The table holds h a, row by row, and h b. A kernel compiles for each number of stages, as that for one does.
"""

import functools
from collections.abc import Callable
from typing import Any

from symtop.core.jit import register_jitable
from symtop.core.simd import wide_vectors
from symtop.methods.framework.lanes import Lanes, W, column, put
from symtop.methods.framework.outcomes import OK
from symtop.methods.vectors import accumulate


@register_jitable
def begin_in_lanes(par: Any, rule: Any, state: Any, h: float) -> Any:
    """Nothing is carried from step to step, and an empty tuple has no type of entry."""
    return (0.0,)


def lay(par: Any, rule: Any, h: float, numbers: Any) -> None:
    """h a and h b of one member in the order in which a step reads them."""
    n = len(rule.b)
    weights = n * (n - 1) // 2
    for i in range(weights):
        numbers[i] = h * rule.a[i]
    for i in range(n):
        numbers[weights + i] = h * rule.b[i]


def read(numbers: Any) -> Any:
    """What `observe` sees of the rule, which asks for nothing."""
    return numbers


def _sum(add: Callable[..., Any], terms: int, weights: int) -> Callable[..., Any]:
    """``(place, slopes, table, j)`` to place + w_1 k_1 + ... of so many terms, whose weights begin at this number."""
    if terms == 0:

        def added(place, slopes, table, j):  # type: ignore[no-untyped-def]
            return place
    else:
        before, last, weight = _sum(add, terms - 1, weights), terms - 1, weights + terms - 1

        def added(place, slopes, table, j):  # type: ignore[no-untyped-def]
            return add(before(place, slopes, table, j), slopes[last], table[weight * W + j])

    registered: Callable[..., Any] = register_jitable(added)
    return registered


def _stages(field: Callable[..., Any], add: Callable[..., Any], count: int, tops: int) -> Callable[..., Any]:
    """``(par, state, table, j)`` to the first `count` slopes, a tuple of tuples."""
    if count == 1:

        def slopes(par, state, table, j):  # type: ignore[no-untyped-def]
            return (field(par, state),)
    else:
        before = _stages(field, add, count - 1, tops)
        place = _sum(add, count - 1, tops + (count - 1) * (count - 2) // 2)

        def slopes(par, state, table, j):  # type: ignore[no-untyped-def]
            made = before(par, state, table, j)
            return (*made, field(par, place(state, made, table, j)))

    registered: Callable[..., Any] = register_jitable(slopes)
    return registered


def explicit_in_lanes(
    field: Callable[..., Any], add: Callable[..., Any], ended: Callable[..., Any], *, top: Any, dimension: int
) -> Callable[[Any], Lanes]:
    """Explicit tableaux in lanes: ``add(place, slope, weight)`` is a term, ``ended(state, step)`` a step's outcome."""
    d, zeros, numbers = dimension, (0.0,) * dimension, (0.0,) * len(top._fields)
    tops, step_at, flag = len(numbers), 2 * d, 3 * d

    @functools.cache
    def lanes(count: int) -> Lanes:
        stages, total = _stages(field, add, count, tops), _sum(add, count, tops + count * (count - 1) // 2)

        def step(block, table):  # type: ignore[no-untyped-def]
            wide_vectors()
            for j in range(W):
                state, par = column(block, 0, j, zeros), top(*column(table, 0, j, numbers))
                step = total(zeros, stages(par, state, table, j), table, j)
                block[flag * W + j] = block[flag * W + j] if ended(state, step) == OK else 1.0
                moved, low = accumulate(state, column(block, d, j, zeros), step)
                put(block, 0, j, moved)
                put(block, d, j, low)
                put(block, step_at, j, step)

        return Lanes(step, lay, read, _size, top, d, 1, effort=_evaluations, begin=begin_in_lanes)

    return lambda rule: lanes(len(rule.b))


def _size(rule: Any) -> int:
    n = len(rule.b)
    return n * (n + 1) // 2


def _evaluations(rule: Any) -> int:
    return len(rule.b)
