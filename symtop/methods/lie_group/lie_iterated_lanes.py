"""Iterated maps of `lie_loop` in lanes: passes over a block until no lane is live.

    x_j <- x_j + c(x_j)    in every lane j that is live;    a lane whose iteration has ended keeps its x_j

A step takes as many passes as its slowest lane. A lane that is live after half of the passes that a run alone may make
is given up (`lanes`), and so is one whose equation cannot be solved: alone, it goes on or fails. A pass is the function
that a run alone calls, too, and all that follows from the last x is made once, when no lane is live any more.
"""

from collections.abc import Callable
from typing import Any

from symtop.core.jit import register_jitable
from symtop.core.simd import wide_vectors
from symtop.methods.framework.lanes import Lanes, W, none_left, put
from symtop.methods.framework.one_loop_lanes import reading
from symtop.methods.lie_group.lie_lanes import CARRY, FLAG, WORK, _empty_carry, entered, give_up, left, stepped
from symtop.methods.lie_group.lie_loop import SPUN


@register_jitable
def no_numbers(rule: Any) -> Any:
    """Of a rule that is nothing but shares."""
    return (0.0,)


def iterated(  # noqa: C901  (the loops of one step, read in one piece)
    start: Callable[..., Any], again: Callable[..., Any], close: Callable[..., Any], most: int, *,
    opened: int, unknowns: int, numbers: Callable[..., Any] = no_numbers, count: int = 1,
    begin: Callable[..., Any] = _empty_carry, carry: int = 1,
) -> Lanes:  # fmt: skip
    """An iterated map of a body in lanes, from the parts of which its `turn` is made.

        numbers(rule) -> rule                                        `count` numbers of it, as the others take them
        start(par, rule, e, L, carry, h) -> (opened, x)              what no pass changes, and the first guess
        again(par, rule, carry, h, opened, x) -> (x, ended, lost)    one pass; a lane that is lost runs alone
        close(par, rule, carry, h, opened, x) -> (m, v, dL, carry)   the rotation and the next carry

    `opened`, x and the carry are flat tuples. A run alone makes at most `most` passes.
    """
    body, top_of = SPUN.top, reading(len(SPUN.top._fields))
    tops, first = len(body._fields), CARRY + carry
    x_at, live_at = first + opened, first + opened + unknowns
    rule_of, carried, opens, unknown = reading(count), reading(carry), reading(opened), reading(unknowns)
    for function in (start, again, close, numbers):
        register_jitable(function)

    @register_jitable
    def given(block, table, row, j):  # type: ignore[no-untyped-def]
        return body(*top_of(table, 0, j)), rule_of(table, tops, j), carried(block, CARRY, j), row[j]

    @register_jitable
    def begun(block, table, row, j):  # type: ignore[no-untyped-def]
        par, rule, carry, h = given(block, table, row, j)
        _, e, L = entered(block, j)
        fixed, x = start(par, rule, e, L, carry, h)
        put(block, first, j, fixed)
        put(block, x_at, j, x)
        block[live_at * W + j] = 1.0 - block[FLAG * W + j]

    @register_jitable
    def passed(block, table, row, j):  # type: ignore[no-untyped-def]
        par, rule, carry, h = given(block, table, row, j)
        x, live = unknown(block, x_at, j), block[live_at * W + j]
        after, ended, lost = again(par, rule, carry, h, opens(block, first, j), x)
        for i in range(unknowns):
            block[(x_at + i) * W + j] = after[i] if live != 0.0 else x[i]
        block[FLAG * W + j] = max(block[FLAG * W + j], live if lost else 0.0)
        block[WORK * W + j] += live
        block[live_at * W + j] = 0.0 if ended or lost else live

    @register_jitable
    def closed(block, table, row, j):  # type: ignore[no-untyped-def]
        par, rule, carry, h = given(block, table, row, j)
        m, v, dL, after = close(par, rule, carry, h, opens(block, first, j), unknown(block, x_at, j))
        left(block, j, entered(block, j)[0], m, v, dL)
        put(block, CARRY, j, after)
        give_up(block, j, block[live_at * W + j] != 0.0)

    def part(block, table, row):  # type: ignore[no-untyped-def]
        wide_vectors()
        for j in range(W):
            begun(block, table, row, j)
        for _ in range(most // 2):
            for j in range(W):
                passed(block, table, row, j)
            if none_left(block, live_at):
                break
        for j in range(W):
            closed(block, table, row, j)

    def lay(par, rule, h, out):  # type: ignore[no-untyped-def]
        values, i = numbers(rule), count
        for q in range(count):
            out[q] = values[q]
        for share in rule.shares:
            out[i] = h * share
            i += 1

    room = live_at + 1 - first
    return stepped(part, lay, count, 1, carried=SPUN, carry=carry, begin=begin, room=room)
