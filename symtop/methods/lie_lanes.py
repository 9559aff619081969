"""Maps that make a step as a rotation, in lanes: the loop of `lie_loop` with shares outside and lanes inside.

    for each share:   q, L <- state + step;   (m, v, dL) of the map;   step <- step with that rotation
    at the end:       the compensated sums

A family writes what stands between, one loop over the lanes or several (`stepped`), or hands over the parts of an
iteration (`iterated`). Both charts are shown by the same kernel.

*Iterations.* One pass x <- x + c(x) evaluates all lanes, and a lane that has ended keeps its x; a step takes as many
passes as its slowest lane. A lane that is live after half of the passes that a run alone may take is given up, and so
is one whose equation cannot be solved: alone, it goes on or fails.

The table holds the numbers of the top, those of the rule and, share by share, what a share is made of.
"""

from collections.abc import Callable
from typing import Any

from symtop.base.compiled import register_jitable
from symtop.base.vectors import wide_vectors
from symtop.methods.lanes import Lanes, W, column, put
from symtop.methods.lie_loop import SPUN, STILL, Carried, composed, ended, reached, shown_in
from symtop.methods.loop import accumulate
from symtop.methods.one_loop_lanes import reading
from symtop.methods.outcomes import OK
from symtop.methods.space import axis_of

SIZE = len(STILL)
LOW, STEP, FLAG, WORK, CARRY = SIZE, 2 * SIZE, 3 * SIZE, 3 * SIZE + 1, 3 * SIZE + 2


@register_jitable
def begin(par: Any, rule: Any, state: Any, h: float) -> Any:
    """A step depends on its start alone, and an empty tuple has no type of entry."""
    return (0.0,)


@register_jitable
def entered(block: Any, j: int) -> Any:
    """The quaternion that lane j has come to, its axis, and the momentum."""
    q, L = reached(column(block, 0, j, STILL), column(block, STEP, j, STILL))
    return q, axis_of(*q), L


@register_jitable
def left(block: Any, j: int, q: Any, m: float, v: Any, dL: Any) -> None:
    """Add the rotation of a share to the step of lane j."""
    put(block, STEP, j, composed(column(block, STEP, j, STILL), q, m, v, dL))


@register_jitable
def give_up(block: Any, j: int, when: bool) -> None:
    """Have lane j run alone, by selection."""
    block[FLAG * W + j] = 1.0 if when else block[FLAG * W + j]


@register_jitable
def no_numbers(rule: Any) -> Any:
    """Of a rule that is nothing but shares."""
    return (0.0,)


def _read(numbers: Any) -> Any:
    """What `observe` and `present` see of the rule, who ask for nothing."""
    return 0.0


def stepped(
    part: Callable[..., None], lay: Callable[..., None], fields: int, each: int, *,
    carried: Carried, carry: int = 1, begin: Callable[..., Any] = begin, room: int = 0,
    effort: Callable[[Any], int] = lambda _: 0,
) -> Lanes:  # fmt: skip
    """A map in lanes: ``part(block, table, row)`` is one share of all lanes, whose own numbers begin with `row`.

    ``lay(par, rule, h, numbers)`` writes `fields` numbers of the rule and `each` of a share.
    """
    shares_at = len(carried.top._fields) + fields
    register_jitable(part)

    def step(block, table):  # type: ignore[no-untyped-def]
        wide_vectors()
        for j in range(W):
            put(block, STEP, j, STILL)
        for share in range((len(table) // W - shares_at) // each):
            part(block, table, table[(shares_at + share * each) * W :])
        for j in range(W):
            state, step = column(block, 0, j, STILL), column(block, STEP, j, STILL)
            give_up(block, j, ended(step) != OK)
            moved, low = accumulate(state, column(block, LOW, j, STILL), step)
            put(block, 0, j, moved)
            put(block, LOW, j, low)

    def size(rule: Any) -> int:
        return fields + each * len(rule.shares)

    show = shown_in(carried)
    return Lanes(step, lay, _read, size, carried.top, SIZE, carry, effort, lambda _: room, begin, show)


def iterated(
    start: Callable[..., Any], again: Callable[..., Any], close: Callable[..., Any], most: int, *,
    opened: int, unknowns: int, numbers: Callable[..., Any] = no_numbers, count: int = 1,
    begin: Callable[..., Any] = begin, carry: int = 1,
) -> Lanes:  # fmt: skip
    """An iterated map of a body in lanes, from the parts of which its `turn` is made.

        numbers(rule) -> rule                      `count` numbers of the rule, as the parts take them
        start(par, rule, e, L, carry, h) -> (opened, x)           what no pass changes, and the first guess
        again(par, rule, carry, h, opened, x) -> (x, ended, lost)    one pass; a lane that is lost runs alone
        close(par, rule, carry, h, opened, x) -> (m, v, dL, carry)

    `opened`, x and the carry are flat tuples. A run alone makes `most` passes.
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
            live = 0
            for j in range(W):
                live += block[live_at * W + j] != 0.0
            if live == 0:
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
