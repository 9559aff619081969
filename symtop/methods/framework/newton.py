"""Newton's iteration of an implicit kernel: one loop for all of them, for one run and in lanes.

    x <- x + c(x),    c(x) = -F'(x)^-1 F(x)        until |c| is small enough or no longer falls

A kernel supplies three functions of `problem`, a tuple of whatever they need; x is a float or a tuple of floats:

    evaluate(problem, x) -> trial             the terms of the equations at x: sums, forces and their slopes
    correct(problem, trial, x) -> Correction
    restart(problem) -> x                     another first guess, taken once, after half of the evaluations

The iteration ends where ``size <= enough``, or where a correction of at most `grain` is more than half of the last one:
that is rounding. The last correction is *not* applied: the caller has the trial at x and may follow it to first order,
which saves one evaluation a step. In a large step a predicted x may lie outside the basin of attraction of the root;
hence `restart`. All functions are inlined.

`newton_loop` makes the loop of a method from such functions, for one run and in lanes.

In lanes the iteration runs over a block until it has ended in every lane. A lane in which it has ended keeps its x and
evaluates the same numbers again, so that every pass can write all results without a branch. A lane that has not ended
after half of the evaluations is run alone from its start (`lanes`), where `newton` takes another guess at that point.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from symtop.core.jit import register_jitable
from symtop.methods.framework.lanes import Lanes, W, column, move, none_left, put
from symtop.methods.framework.loop import Loop
from symtop.methods.framework.plan import NOT_CONVERGED
from symtop.methods.simd import wide_vectors
from symtop.methods.vectors import accumulate

NEGLIGIBLE_ANGLE = 1e-18  # radians: a correction below this does not change an angle
ANGLE_GRAIN = 1e-12  # radians: a smaller correction that does not halve is rounding (as all are in steady precession)


class Correction(NamedTuple):
    """A Newton correction at x, with the limits that decide about convergence."""

    change: Any  # like x
    after: Any  # x + change
    size: float  # |change|
    enough: float  # converged at this size or below
    grain: float  # at this size or below, a correction that does not halve is rounding


@register_jitable
def settled(correction: Any, last: float) -> Any:
    """Is this correction the last one, after one of size `last`?"""
    size: float = correction.size
    return size <= correction.enough or 0.5 * last <= size <= correction.grain


@register_jitable
def newton(evaluate: Any, correct: Any, restart: Any, problem: Any, guess: Any, limit: int) -> Any:
    """Solve with at most `limit` evaluations: x, the trial there, the correction left, evaluations, convergence."""
    x, trial = guess, evaluate(problem, guess)
    evaluations, size = 1, np.inf
    while True:
        correction = correct(problem, trial, x)
        last, size = size, correction.size
        converged = settled(correction, last)
        if converged or evaluations >= limit:
            return x, trial, correction, evaluations, converged
        x = restart(problem) if evaluations == limit // 2 else correction.after
        trial = evaluate(problem, x)
        evaluations += 1


def newton_loop(  # noqa: C901  (the loops of one step, read in one piece)
    begin: Callable[..., Any], observe: Callable[..., Any], *,
    constants: Callable[..., Any], start: Callable[..., Any], equation: Callable[..., Any],
    predict: Callable[..., Any], evaluate: Callable[..., Any], correct: Callable[..., Any],
    restart: Callable[..., Any], keep: Callable[..., Any], close: Callable[..., Any],
    top: Any, dimension: int, steady: int, opened: int, unknowns: int, ends: int, newest: int, carry: int,
) -> Loop:  # fmt: skip
    """The loop of an implicit method on states that begin with theta; it counts evaluations as work.

        constants(par, h) -> steady                  `steady` numbers that no step changes
        start(par, rule, theta) -> opened            `opened` numbers that no iteration changes
        equation(par, rule, state, steady, opened)   the problem of `newton`
        predict(problem, carry) -> x                 the first guess, `unknowns` numbers
        evaluate, correct, restart                   as `newton` takes them
        keep(trial, correction) -> end               `ends` numbers from which the increment is computed
        close(problem, end) -> (dstate, newest, outcome)

    The next carry is the `newest` numbers of `close`, followed by this carry without as many last ones. In lanes `rule`
    is a compile-time constant of the kernel, so that a branch on it alone does not stop vectorisation.
    """
    older = carry - newest
    for function in (constants, start, equation, predict, evaluate, correct, restart, keep, close):
        register_jitable(function)

    def increment(par, rule, state, carry, h):  # type: ignore[no-untyped-def]
        equations = equation(par, rule, state, constants(par, h), start(par, rule, state[0]))
        guess = predict(equations, carry)
        _, trial, last, work, converged = newton(evaluate, correct, restart, equations, guess, rule.iterations)
        step, fresh, outcome = close(equations, keep(trial, last))
        return step, fresh + carry[:older], work, outcome if converged else NOT_CONVERGED

    zeros = (0.0,) * max(dimension, carry, steady, opened, unknowns, ends, len(top._fields))
    numbers, constant, states, carries = zeros[: len(top._fields)], zeros[:steady], zeros[:dimension], zeros[:carry]
    opens, unknown, end, kept = zeros[:opened], zeros[:unknowns], zeros[:ends], zeros[:older]
    flag, work, carry_at = 3 * dimension, 3 * dimension + 1, 3 * dimension + 2
    opened_at = carry_at + carry
    x_at = opened_at + opened
    end_at = x_at + unknowns
    size_at, live_at, steps_at = (end_at + ends + i for i in range(3))
    room = steps_at + 1 - opened_at

    @register_jitable  # now, as the hash of a method's code must not depend on what has run
    def lay(par, rule, h, numbers):  # type: ignore[no-untyped-def]
        values = constants(par, h)
        for i in range(len(values)):
            numbers[i] = values[i]

    @functools.cache
    def in_lanes(rule: Any) -> Lanes:  # noqa: C901
        sweeps = rule.iterations // 2

        @register_jitable
        def problem(block, table, j):  # type: ignore[no-untyped-def]
            par, steady = top(*column(table, 0, j, numbers)), column(table, len(numbers), j, constant)
            return equation(par, rule, column(block, 0, j, states), steady, column(block, opened_at, j, opens))

        @register_jitable
        def open_step(block, table, j):  # type: ignore[no-untyped-def]
            put(block, opened_at, j, start(top(*column(table, 0, j, numbers)), rule, block[j]))
            put(block, x_at, j, predict(problem(block, table, j), column(block, carry_at, j, carries)))
            block[size_at * W + j] = np.inf
            block[live_at * W + j] = 1.0 if block[flag * W + j] == 0.0 else 0.0

        @register_jitable
        def attempt(block, table, j):  # type: ignore[no-untyped-def]
            equations, x, live = problem(block, table, j), column(block, x_at, j, unknown), block[live_at * W + j]
            trial = evaluate(equations, x)
            correction = correct(equations, trial, x)
            live_after = 0.0 if settled(correction, block[size_at * W + j]) else live
            put(block, end_at, j, keep(trial, correction))
            for i in range(unknowns):
                block[(x_at + i) * W + j] = correction.after[i] if live_after != 0.0 else x[i]
            block[size_at * W + j] = correction.size
            block[live_at * W + j] = live_after
            block[work * W + j] += live

        @register_jitable
        def finish(block, table, j):  # type: ignore[no-untyped-def]
            before = column(block, carry_at, j, kept)
            step, newest, outcome = close(problem(block, table, j), column(block, end_at, j, end))
            move(accumulate, block, dimension, j, step)
            put(block, carry_at, j, newest + before)
            status = -float(outcome) if block[live_at * W + j] == 0.0 else 1.0
            status = status if block[flag * W + j] == 0.0 else block[flag * W + j]
            block[flag * W + j] = status
            block[steps_at * W + j] += 1.0 if status == 0.0 else 0.0

        def step(block, table):  # type: ignore[no-untyped-def]
            wide_vectors()
            for j in range(W):
                open_step(block, table, j)
            for _ in range(sweeps):
                for j in range(W):
                    attempt(block, table, j)
                if none_left(block, live_at):
                    break
            for j in range(W):
                finish(block, table, j)

        return Lanes(step, lay, lambda _: rule, lambda _: steady, top, dimension, carry, room=lambda _: room)

    return Loop(begin, increment, observe, lanes=in_lanes)
