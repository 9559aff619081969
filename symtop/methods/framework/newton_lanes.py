"""Newton's iteration in lanes: `newton.newton` over a block, until no lane is live.

    x_j <- x_j + c(x_j)    in every lane j that is live;    a lane whose iteration has ended keeps its x_j

A lane that keeps its x evaluates the same numbers again, so that all that follows from them may be written at every
pass, and only x is chosen. One pass evaluates 32 lanes: a step takes as many passes as its slowest lane, two where the
lanes by themselves take 1.1 to 1.8. A lane that is live after half of the evaluations is given up (`lanes`): there
`newton` begins again with another guess.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from symtop.core.jit import register_jitable
from symtop.core.simd import wide_vectors
from symtop.methods.framework.lanes import Lanes, W, column, none_left, put
from symtop.methods.framework.newton import settled
from symtop.methods.framework.outcomes import OK
from symtop.methods.vectors import accumulate


def iterated(  # noqa: C901  (the loops of one step, read in one piece)
    rule: Any, constants: Callable[..., Any], start: Callable[..., Any], equation: Callable[..., Any],
    predict: Callable[..., Any], evaluate: Callable[..., Any], correct: Callable[..., Any], keep: Callable[..., Any],
    close: Callable[..., Any], *,
    top: Any, end: Any, dimension: int, steady: int, opened: int, unknowns: int, newest: int, carry: int,
) -> Lanes:  # fmt: skip
    """An implicit method in lanes, from the functions of which its `increment` is made.

        constants(par, h) -> steady                  `steady` numbers that no step changes
        start(par, rule, theta) -> opened            `opened` numbers that no iteration changes
        equation(par, rule, state, steady, opened)   the problem of `newton`
        predict(problem, carry) -> x                 the first guess, `unknowns` numbers
        evaluate, correct                            as `newton` takes them
        keep(trial, correction) -> end               what the increment is made of, a NamedTuple of floats
        close(problem, end) -> (dstate, newest, outcome)

    The next carry is `newest`, so many numbers, and this carry without as many at its end. `rule` is a constant of the
    kernel: a branch that hangs on it alone is none.
    """
    like = (0.0,) * max(dimension, carry, steady, opened, unknowns, len(end._fields), len(top._fields))
    numbers, constant, states, carries = like[: len(top._fields)], like[:steady], like[:dimension], like[:carry]
    opens, unknown, ends, kept = like[:opened], like[:unknowns], like[: len(end._fields)], like[: carry - newest]
    flag, work, carry_at = 3 * dimension, 3 * dimension + 1, 3 * dimension + 2
    opened_at = carry_at + carry
    x_at = opened_at + opened
    end_at = x_at + unknowns
    size_at, live_at = end_at + len(ends), end_at + len(ends) + 1
    most = rule.iterations // 2

    @register_jitable
    def problem(block, table, j):  # type: ignore[no-untyped-def]
        par, steady = top(*column(table, 0, j, numbers)), column(table, len(numbers), j, constant)
        return equation(par, rule, column(block, 0, j, states), steady, column(block, opened_at, j, opens))

    @register_jitable
    def begin(block, table, j):  # type: ignore[no-untyped-def]
        put(block, opened_at, j, start(top(*column(table, 0, j, numbers)), rule, block[j]))
        put(block, x_at, j, predict(problem(block, table, j), column(block, carry_at, j, carries)))
        block[size_at * W + j] = np.inf
        block[live_at * W + j] = 1.0 - block[flag * W + j]

    @register_jitable
    def attempt(block, table, j):  # type: ignore[no-untyped-def]
        equations, x, live = problem(block, table, j), column(block, x_at, j, unknown), block[live_at * W + j]
        trial = evaluate(equations, x)
        correction = correct(equations, trial, x)
        left = 0.0 if settled(correction, block[size_at * W + j]) else live
        put(block, end_at, j, keep(trial, correction))
        for i in range(unknowns):
            block[(x_at + i) * W + j] = correction.after[i] if left != 0.0 else x[i]
        block[size_at * W + j] = correction.size
        block[live_at * W + j] = left
        block[work * W + j] += live

    @register_jitable
    def finish(block, table, j):  # type: ignore[no-untyped-def]
        state, before = column(block, 0, j, states), column(block, carry_at, j, kept)
        step, newest, outcome = close(problem(block, table, j), end(*column(block, end_at, j, ends)))
        moved, low = accumulate(state, column(block, dimension, j, states), step)
        put(block, 0, j, moved)
        put(block, dimension, j, low)
        put(block, 2 * dimension, j, step)
        put(block, carry_at, j, newest + before)
        healthy = outcome == OK and block[live_at * W + j] == 0.0
        block[flag * W + j] = block[flag * W + j] if healthy else 1.0

    def step(block, table):  # type: ignore[no-untyped-def]
        wide_vectors()
        for j in range(W):
            begin(block, table, j)
        for _ in range(most):
            for j in range(W):
                attempt(block, table, j)
            if none_left(block, live_at):
                break
        for j in range(W):
            finish(block, table, j)

    def lay(par, rule, h, numbers):  # type: ignore[no-untyped-def]
        values = constants(par, h)
        for i in range(len(values)):
            numbers[i] = values[i]

    def read(numbers):  # type: ignore[no-untyped-def]
        return rule

    room = live_at + 1 - opened_at
    return Lanes(step, lay, read, lambda _: steady, top, dimension, carry, room=lambda _: room)
