"""Maps that make a step as a rotation, in lanes: the loop of `lie_loop` with shares outside and lanes inside.

    for each share:   q, L <- state + step;   (m, v, dL) of the map;   step <- step with that rotation
    at the end:       the compensated sums

A family writes what stands between, one loop over the lanes or several; `lie_iterated_lanes` does it for iterations.
The table holds the numbers of the top, those of the rule and, share by share, what a share is made of: one kernel for
compositions of any length, and for both charts, which differ in what is shown of a sample.
"""

from collections.abc import Callable
from typing import Any

from symtop.core.jit import register_jitable
from symtop.core.simd import wide_vectors
from symtop.methods.framework.lanes import Lanes, W, column, put
from symtop.methods.framework.outcomes import OK
from symtop.methods.framework.space import axis_of
from symtop.methods.lie_group.lie_loop import STILL, Carried, composed, ended, reached, shown_in
from symtop.methods.vectors import accumulate

SIZE = len(STILL)
LOW, STEP, FLAG, WORK, CARRY = SIZE, 2 * SIZE, 3 * SIZE, 3 * SIZE + 1, 3 * SIZE + 2


@register_jitable
def _empty_carry(par: Any, rule: Any, state: Any, h: float) -> Any:
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


def _read(numbers: Any) -> Any:
    """What `observe` and `present` see of the rule, who ask for nothing."""
    return 0.0


def stepped(
    part: Callable[..., None], lay: Callable[..., None], fields: int, each: int, *,
    carried: Carried, carry: int = 1, begin: Callable[..., Any] = _empty_carry, room: int = 0,
    effort: Callable[[Any], int] = lambda _: 0,
) -> Lanes:  # fmt: skip
    """A map in lanes: ``part(block, table, row)`` is one share of all lanes, whose own numbers begin with `row`.

    ``lay(par, rule, h, numbers)`` writes `fields` numbers of the rule, then `each` for every share.
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
