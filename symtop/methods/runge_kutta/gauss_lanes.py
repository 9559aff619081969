"""Sweeps of a Gauss step in lanes: those of `gauss.gauss_step` over a block, until no lane is live.

A lane whose sweeps have ended keeps its L_i by selection. One whose corrections do not fall to rounding is given up
(`lanes`): alone, Newton's iteration takes over. Stages stand outside and lanes inside, each stage a loop of its own
with the numbers of its row as constants, for a place in `block` that hangs on a variable is no vector. One loop for
each component instead of each stage is slower (gauss-4 on (e, L): 2.3 times the kernel for one, this 4.3).
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from symtop.core.jit import register_jitable, set_item
from symtop.core.simd import wide_vectors
from symtop.methods.framework.lanes import Lanes, W, column, none_left, put
from symtop.methods.vectors import accumulate

Row = tuple[float, ...]


def _after(first: Any, then: Any) -> Any:
    """Both, one after the other."""

    @register_jitable
    def both(block, table):  # type: ignore[no-untyped-def]
        wide_vectors()
        first(block, table)
        then(block, table)

    return both


def swept(  # noqa: C901  (the loops of one step, read in one piece)
    field: Callable[..., Any], weights: Callable[..., Any], unit: Callable[..., Any], bound: Callable[..., Any],
    mu: tuple[Row, ...], predict: tuple[Row, ...], *,
    top: Any, dimension: int, still: int, most: int, round_off: float,
) -> Lanes:  # fmt: skip
    """A Gauss method in lanes: `mu` and `predict` as `gauss.GaussRule` has them.

    ``weights(rule, h, out)`` fills in the h b_i, ``unit(par, state)`` is 1/|L|, and a correction above
    ``bound(sweeps)`` that does not fall has lost its way. Component `still` of a state never moves.
    """
    stages, zeros, numbers = len(mu), (0.0,) * dimension, (0.0,) * len(top._fields)
    tops, flag, work, carry_at = len(numbers), 3 * dimension, 3 * dimension + 1, 3 * dimension + 2
    carry = stages * dimension + 1  # the L_i and the unit
    unit_at = carry_at + carry - 1
    gap_at, pull_at, last_at, live_at = range(unit_at + 1, unit_at + 5)
    nodes, carried = (0.0,) * stages, (0.0,) * carry

    def ahead(m: int) -> Any:
        at = carry_at + m

        @register_jitable
        def continued(block, table):  # type: ignore[no-untyped-def]
            wide_vectors()
            for j in range(W):
                last = nodes
                for q in range(stages):
                    last = set_item(last, q, block[(at + q * dimension) * W + j])
                for i in range(stages):
                    total = 0.0
                    for q in range(stages):
                        total += predict[i][q] * last[q]
                    block[(at + i * dimension) * W + j] = total

        return continued

    def stage(i: int) -> Any:
        row, own = mu[i], carry_at + i * dimension

        @register_jitable
        def renewed(block, table):  # type: ignore[no-untyped-def]
            wide_vectors()
            for j in range(W):
                state, place = column(block, 0, j, zeros), zeros
                for q in range(stages):
                    for m in range(dimension):
                        if m != still:
                            step = row[q] * block[(carry_at + q * dimension + m) * W + j]
                            place = set_item(place, m, place[m] + step)
                for m in range(dimension):
                    place = set_item(place, m, state[m] + place[m])
                slope = field(top(*column(table, 0, j, numbers)), place)
                weight, live = table[(tops + i) * W + j], block[live_at * W + j] != 0.0
                gap = 0.0 if i == 0 else block[gap_at * W + j]
                pull = 0.0 if i == 0 else block[pull_at * W + j]
                for m in range(dimension):
                    if m != still:
                        old, value = block[(own + m) * W + j], weight * slope[m]
                        change = abs(value - old)
                        if 3 <= m < 6:
                            pull = max(pull, change)
                        else:
                            gap = max(gap, change)
                        block[(own + m) * W + j] = value if live else old
                block[gap_at * W + j] = gap
                block[pull_at * W + j] = pull

        return renewed

    moving = [m for m in range(dimension) if m != still]
    extrapolate, sweep = ahead(moving[0]), stage(0)
    for m in moving[1:]:
        extrapolate = _after(extrapolate, ahead(m))
    for i in range(1, stages):
        sweep = _after(sweep, stage(i))

    @register_jitable
    def judge(block, j, largest):  # type: ignore[no-untyped-def]
        correction = max(block[gap_at * W + j], block[pull_at * W + j] * block[unit_at * W + j])
        live, falls = block[live_at * W + j], 0.0 < correction < block[last_at * W + j]
        goes_on = falls or (correction >= round_off and correction <= largest)
        good = goes_on or correction < round_off
        block[work * W + j] += live
        block[last_at * W + j] = correction
        block[flag * W + j] = block[flag * W + j] if good or live == 0.0 else 1.0
        block[live_at * W + j] = live if goes_on else 0.0

    @register_jitable
    def finish(block, j):  # type: ignore[no-untyped-def]
        step = zeros
        for i in range(stages):
            for m in range(dimension):
                step = set_item(step, m, step[m] + block[(carry_at + i * dimension + m) * W + j])
        healthy = np.isfinite(step[0]) and block[live_at * W + j] == 0.0
        moved, low = accumulate(column(block, 0, j, zeros), column(block, dimension, j, zeros), step)
        put(block, 0, j, moved)
        put(block, dimension, j, low)
        put(block, 2 * dimension, j, step)
        block[flag * W + j] = block[flag * W + j] if healthy else 1.0

    def step(block, table):  # type: ignore[no-untyped-def]
        wide_vectors()
        extrapolate(block, table)
        for j in range(W):
            block[last_at * W + j] = np.inf
            block[live_at * W + j] = 1.0 - block[flag * W + j]
        effort = 0
        while effort < most:
            sweep(block, table)
            effort += 1
            largest = bound(effort)
            for j in range(W):
                judge(block, j, largest)
            if none_left(block, live_at):
                break
        for j in range(W):
            finish(block, j)

    def lay(par, rule, h, numbers):  # type: ignore[no-untyped-def]
        weights(rule, h, numbers)

    def begin(par, rule, state, h):  # type: ignore[no-untyped-def]
        shares, slope, values = np.empty(stages), field(par, state), carried
        weights(rule, h, shares)
        for i in range(stages):
            for m in range(dimension):
                values = set_item(values, i * dimension + m, shares[i] * slope[m])
        return set_item(values, carry - 1, unit(par, state))

    def read(numbers):  # type: ignore[no-untyped-def]
        return 0.0

    return Lanes(step, lay, read, lambda _: stages, top, dimension, carry, room=lambda _: 4, begin=begin)
