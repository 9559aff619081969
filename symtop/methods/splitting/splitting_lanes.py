"""The composition loop of splitting methods in lanes: `splitting_loop.compose`, stages outside and lanes inside.

Kick, drift and force of a stage are one loop over the lanes; the last kick and the sums are another. A kick or a force
that a table leaves out is carried out with the coefficient 0, which changes no bit. The coefficients lie in the table
as b_0 c_0 a_1  b_1 c_1 a_2 ... b_n c_n and the processor's parameter: one kernel for tables of any length.
"""

from collections.abc import Callable
from typing import Any

from symtop.core.jit import register_jitable
from symtop.core.simd import wide_vectors
from symtop.methods.framework.lanes import Lanes, W, column, put
from symtop.methods.framework.outcomes import OK
from symtop.methods.splitting.splitting_loop import Composition, Stages, packed_for_lanes
from symtop.methods.vectors import accumulate


def lay(par: Any, rule: Any, h: float, numbers: Any) -> None:
    """The stages of one member in the order in which a step reads them."""
    n = len(rule.drift)
    for i in range(n + 1):
        numbers[3 * i], numbers[3 * i + 1] = rule.kick[i], rule.bend[i]
    for i in range(n):
        numbers[3 * i + 2] = rule.drift[i]
    numbers[3 * n + 2] = rule.boost


def read(numbers: Any) -> Any:
    """The stages that `lay` wrote."""
    last = len(numbers) - 1
    return Stages(numbers[2:last:3], numbers[0:last:3], numbers[1:last:3], 0, 0, numbers[last])


def composed(
    force: Callable[..., Any], kick: Callable[..., Any], drift: Callable[..., Any], ended: Callable[..., Any], *,
    top: Any, dimension: int, carry: int, still: int = 0,
) -> Lanes:  # fmt: skip
    """A composition in lanes, from the functions that `compose` takes, but for the drift.

    ``drift(state, step, a)`` returns the step and whether it can do without a branch. ``ended(state, step)`` is the
    outcome of a step, `carry` how many numbers a force has. The last `still` components of a state never move: of their
    sums only the one is made that turns -0 into 0.
    """
    zeros, none, numbers = (0.0,) * dimension, (0.0,) * carry, (0.0,) * len(top._fields)
    moving, rest = zeros[: dimension - still], zeros[dimension - still :]
    coefficients, step_at, flag, still_at = len(numbers), 2 * dimension, 3 * dimension, len(moving)
    force_at = flag + 2

    @register_jitable
    def stage(block, row, table, step, j):  # type: ignore[no-untyped-def]
        state, par = column(block, 0, j, zeros), top(*column(table, 0, j, numbers))
        step = kick(par, column(block, force_at, j, none), step, row[j], row[W + j])
        step, near = drift(state, step, row[2 * W + j])
        put(block, step_at, j, step[:still_at])
        put(block, force_at, j, force(par, state, step))
        block[flag * W + j] = block[flag * W + j] if near else 1.0

    @register_jitable
    def last(block, row, table, j):  # type: ignore[no-untyped-def]
        state, step = column(block, 0, j, zeros), column(block, step_at, j, moving) + rest
        par = top(*column(table, 0, j, numbers))
        step = kick(par, column(block, force_at, j, none), step, row[j], row[W + j])
        block[flag * W + j] = block[flag * W + j] if ended(state, step) == OK else 1.0
        moved, low = accumulate(state[:still_at], column(block, dimension, j, moving), step[:still_at])
        put(block, 0, j, moved)
        put(block, dimension, j, low)
        put(block, step_at, j, step[:still_at])
        for i in range(still):
            block[(still_at + i) * W + j] = state[still_at + i] + 0.0

    def step(block, table):  # type: ignore[no-untyped-def]
        wide_vectors()
        drifts = (len(table) // W - coefficients) // 3 - 1
        row = table[coefficients * W :]
        for j in range(W):  # on its own: the sums begin with 0, which need not be written and read
            stage(block, row, table, zeros, j)
        for i in range(1, drifts):
            row = table[(coefficients + 3 * i) * W :]
            for j in range(W):
                stage(block, row, table, column(block, step_at, j, moving) + rest, j)
        row = table[(coefficients + 3 * drifts) * W :]
        for j in range(W):
            last(block, row, table, j)

    return Lanes(step, lay, read, _size, top, dimension, carry, effort=_forces, pack=packed_for_lanes)


def _size(rule: Composition) -> int:
    return 3 * len(rule.kick)


def _forces(rule: Composition) -> int:
    return rule.forces
