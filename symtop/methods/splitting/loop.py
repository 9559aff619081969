"""The one composition loop that all splitting kernels share, whatever their chart.

    step = kick(b_0 h) drift(a_1 h) kick(b_1 h) ... drift(a_n h) kick(b_n h)

A kick with a force gradient is the flow of ``b V + c h^2 {V, {V, T}}``: where that bracket depends on position alone it
costs a multiplication and lets all other coefficients stay positive at order 4 (Chin, Phys. Lett. A 226 (1997) 344).
A force is evaluated only where it is kicked with, and the one at the end of a step serves the start of the next, so a
kick-first table with n drifts costs n forces and a drift-first one n - 1, but n drifts: its last drift and the first of
the next step are not merged.

The kernels do not use h: `stages` multiplies the tables by it before a run and corrects each row for rounding, so that
its sum is exact: otherwise the time of every step would be wrong by 1e-16.

In lanes, kick, drift and force of a stage are one loop over the lanes; the last kick and the sums are another. A kick
or a force that a table leaves out is carried out with the coefficient 0, which changes no bit. The coefficients lie in
the table as b_0 c_0 a_1  b_1 c_1 a_2 ... b_n c_n and the processor's parameter: one kernel for tables of any length.
"""

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symtop.core.jit import register_jitable, to_fixed_tuple
from symtop.methods.framework.lanes import Lanes, W, column, move, put
from symtop.methods.framework.plan import OK
from symtop.methods.simd import times, wide_vectors, with_item
from symtop.methods.vectors import accumulate, zero

FEW_DRIFTS = 2  # tables of at most so many drifts are tuples in compiled code


class Composition(NamedTuple):
    """The coefficients of a splitting method, in units of the step."""

    drift: tuple[float, ...]  # a_1 .. a_n
    kick: tuple[float, ...]  # b_0 .. b_n
    gradient: tuple[float, ...]  # c_0 .. c_n
    forces: int  # a step
    turn: int = 0  # which rotation a drift is
    processor: float = 0.0


@functools.cache
def _unpack(n: int) -> Callable[[Any], Composition]:
    """From the numbers in a row to a composition with n drifts, in compiled code."""
    m, end = n + 1, 3 * n + 2

    @register_jitable
    def unpack(row: Any) -> Composition:
        drift, kick = to_fixed_tuple(row[:n], n), to_fixed_tuple(row[n : n + m], m)
        gradient = to_fixed_tuple(row[n + m : end], m)
        return Composition(drift, kick, gradient, int(row[end]), int(row[end + 1]), row[end + 2])

    return unpack


@register_jitable
def _unpack_long(row: Any) -> Composition:
    row, n = row.copy(), (len(row) - 5) // 3  # a copy of its own: `times` multiplies in place
    m, end = 2 * n + 1, 3 * n + 2
    return Composition(row[:n], row[n:m], row[m:end], int(row[end]), int(row[end + 1]), row[end + 2])


def packed(rule: Any) -> tuple[Callable[[Any], Composition], NDArray[np.float64]]:
    """How a composition is passed to compiled code: a function that opens an array of numbers, and the array.

    A call unpacks every number of a tuple, but takes an array as a whole. Short tables are tuples inside, longer ones
    are rows of the array, so that one kernel is compiled for all of them.
    """
    drift, kick, gradient = rule[:3]
    unpack = _unpack(len(drift)) if len(drift) <= FEW_DRIFTS else _unpack_long
    return unpack, np.array([*drift, *kick, *gradient, *rule[3:]], dtype=float)


class Stages(NamedTuple):
    """The drifts and kicks of one run of a kernel, in tuples, or in arrays where the table is long."""

    drift: Any
    kick: Any
    bend: Any
    forces: int
    turn: int  # which rotation a drift is
    boost: float  # parameter of the processor


@register_jitable
def close(values: Any, total: float) -> Any:
    """`exact_sum` of a row in a kernel, by Knuth's two-sums: as `math.fsum` but for 1e-16 of the surplus itself."""
    high, low, n = -total, 0.0, len(values)
    for i in range(n):
        new = high + values[i]
        back = new - high
        low += (high - (new - back)) + (values[i] - back)
        high = new
    surplus, middle = high + low, n // 2
    if n % 2:
        return with_item(values, middle, values[middle] - surplus)
    values = with_item(values, middle - 1, values[middle - 1] - 0.5 * surplus)
    return with_item(values, middle, values[middle] - 0.5 * surplus)


@register_jitable
def stages(rule: Any, drift: float, kick: float, bend: float, boost: float) -> Any:
    """The coefficients of a `Composition` times the drift, kick and bend of a whole step; `boost` as it is."""
    drifts, kicks = close(times(rule.drift, drift), drift), close(times(rule.kick, kick), kick)
    return Stages(drifts, kicks, times(rule.gradient, bend), rule.forces, rule.turn, boost)


@register_jitable
def compose(force: Any, kick: Any, drift: Any, par: Any, rule: Any, state: Any, start_force: Any) -> Any:
    """Increment of one step and the force at its end. A force that no kick uses is not evaluated."""
    step, current, n = zero(state), start_force, len(rule.drift)
    for i in range(n):
        if rule.kick[i] != 0.0:
            step = kick(par, current, step, rule.kick[i], rule.bend[i])
        step = drift(par, rule, state, step, rule.drift[i])
        if rule.kick[i + 1] != 0.0:
            current = force(par, state, step)
    if rule.kick[n] != 0.0:
        step = kick(par, current, step, rule.kick[n], rule.bend[n])
    elif rule.kick[0] != 0.0:  # for the first kick of the next step
        current = force(par, state, step)
    return step, current


def exact_sum(values: Sequence[float], total: float = 1.0) -> tuple[float, ...]:
    """The coefficients with the middle one, or the middle two equally, corrected so that the sum is `total`."""
    closed, n = list(values), len(values)
    surplus = math.fsum((*closed, -total))
    if n % 2:
        closed[n // 2] -= surplus
    else:
        closed[n // 2 - 1] -= 0.5 * surplus
        closed[n // 2] -= 0.5 * surplus
    return tuple(closed)


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


no_rest = register_jitable(lambda _block, _row, _table: None)  # `rest` of a drift that is one loop over lanes


def composed(
    force: Callable[..., Any], kick: Callable[..., Any], drift: Callable[..., Any], outcome: Callable[..., Any], *,
    top: Any, dimension: int, carry: int, still: int = 0, rest: Callable[..., None] = no_rest,
) -> Lanes:  # fmt: skip
    """A composition in lanes, from the functions that `compose` takes, but for the drift.

    ``drift(par, state, step, a)`` returns the step and whether it is accurate, as lanes have no branch. ``ended(state,
    step)`` is the outcome of a step, `carry` how many numbers a force has. The last `still` components of a state never
    move: 0 is added once, which turns -0 into 0 as their sums would. ``rest(block, row, table)`` makes the remaining
    parts of a long drift, in loops of its own, and the force at its end.
    """
    zeros, carry_like, numbers = (0.0,) * dimension, (0.0,) * carry, (0.0,) * len(top._fields)
    step_like, padding = zeros[: dimension - still], zeros[dimension - still :]
    coefficients, step_at, flag, still_at = len(numbers), 2 * dimension, 3 * dimension, len(step_like)
    force_at = flag + 2
    for part in (force, kick, drift, outcome):
        register_jitable(part)

    @register_jitable
    def stage(block, row, table, step, j):  # type: ignore[no-untyped-def]
        state, par = column(block, 0, j, zeros), top(*column(table, 0, j, numbers))
        step = kick(par, column(block, force_at, j, carry_like), step, row[j], row[W + j])
        step, near = drift(par, state, step, row[2 * W + j])
        put(block, step_at, j, step[:still_at])
        put(block, force_at, j, force(par, state, step))
        block[flag * W + j] = block[flag * W + j] if near else 1.0

    @register_jitable
    def last(block, row, table, j):  # type: ignore[no-untyped-def]
        state, step = column(block, 0, j, zeros), column(block, step_at, j, step_like) + padding
        par = top(*column(table, 0, j, numbers))
        step = kick(par, column(block, force_at, j, carry_like), step, row[j], row[W + j])
        block[flag * W + j] = block[flag * W + j] if outcome(state, step) == OK else 1.0
        move(accumulate, block, dimension, j, step[:still_at])
        for i in range(still):
            block[(still_at + i) * W + j] = state[still_at + i] + 0.0

    def step(block, table):  # type: ignore[no-untyped-def]
        wide_vectors()
        drifts = (len(table) // W - coefficients) // 3 - 1
        row = table[coefficients * W :]
        for j in range(W):  # on its own: the sums begin with 0, which need not be written and read
            stage(block, row, table, zeros, j)
        rest(block, row, table)
        for i in range(1, drifts):
            row = table[(coefficients + 3 * i) * W :]
            for j in range(W):
                stage(block, row, table, column(block, step_at, j, step_like) + padding, j)
            rest(block, row, table)
        row = table[(coefficients + 3 * drifts) * W :]
        for j in range(W):
            last(block, row, table, j)

    size, effort = lambda rule: 3 * len(rule.kick), lambda rule: int(rule.forces)
    return Lanes(step, lay, read, size, top, dimension, carry, effort)
