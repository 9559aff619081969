"""Runge-Kutta methods on the group SE(3) in lanes: `lie_runge_kutta.turn` written out for the shape of a table.

The shape is how many exponentials each stage has and whether slopes are bent back (Munthe-Kaas); a kernel compiles for
each. The weights are numbers in the table, those that are 0 too, and are all carried out, in the order in which the
kernel for one does. A lane with an exponential that turns by more than two radians is given up.
"""

import functools
from collections.abc import Callable
from typing import Any

from symtop.core.jit import register_jitable
from symtop.core.simd import wide_vectors
from symtop.methods.framework.lanes import Lanes, W, column
from symtop.methods.lie_group.lie_exponentials import NOUGHT, acted, bent_back, half_square, near
from symtop.methods.lie_group.lie_lanes import entered, give_up, left, stepped
from symtop.methods.lie_group.lie_loop import UNSPUN
from symtop.methods.vectors import plus, scaled

Part = Callable[..., Any]
TOP: Any = UNSPUN.top
NUMBERS = (0.0,) * len(TOP._fields)


def lay(par: Any, rule: Any, h: float, numbers: Any) -> None:
    """The weights times the step, share by share."""
    i = 0
    for share in rule.shares:
        for weight in rule.weights:
            numbers[i] = (h * share) * weight
            i += 1


def _sum(terms: int, first: int) -> Part:
    """``(slopes, row, j)`` to the sum of so many slopes, whose weights begin at this number of the row."""
    if terms == 0:

        def summed(slopes, row, j):  # type: ignore[no-untyped-def]
            return NOUGHT, NOUGHT
    else:
        before, last, at = _sum(terms - 1, first), terms - 1, first + terms - 1

        def summed(slopes, row, j):  # type: ignore[no-untyped-def]
            (w, f), weight = before(slopes, row, j), row[at * W + j]
            return plus(w, weight, slopes[last][0]), plus(f, weight, slopes[last][1])

    registered: Part = register_jitable(summed)
    return registered


def _product(count: int, terms: int, first: int, stages: int) -> Part:
    """``(e, L, slopes, row, j)`` to the product of so many exponentials, the last of them, and whether all are near."""
    if count == 0:

        def made(e, L, slopes, row, j):  # type: ignore[no-untyped-def]
            return (0.0, NOUGHT, e, NOUGHT), NOUGHT, NOUGHT, 0.0
    else:
        before, summed = _product(count - 1, terms, first, stages), _sum(terms, first + (count - 1) * stages)

        def made(e, L, slopes, row, j):  # type: ignore[no-untyped-def]
            so_far, _, _, far = before(e, L, slopes, row, j)
            w, f = summed(slopes, row, j)
            square = half_square(w)
            return acted(so_far, L, w, f, near(square)), w, f, far if square < 1.0 else 1.0

    registered: Part = register_jitable(made)
    return registered


def _stages(counts: tuple[int, ...], stages: int, bent: bool) -> Part:
    """``(par, e, L, row, j)`` to the slopes of the stages, one more than there are counts, and whether all are near."""
    if not counts:

        def slopes(par, e, L, row, j):  # type: ignore[no-untyped-def]
            return ((scaled(1.0 / par.I1, L), (0.0, 0.0, par.mgl)),), 0.0
    else:
        before = _stages(counts[:-1], stages, bent)
        made = _product(counts[-1], len(counts), sum(counts[:-1]) * stages, stages)

        def slopes(par, e, L, row, j):  # type: ignore[no-untyped-def]
            known, far = before(par, e, L, row, j)
            so_far, w, f, too_far = made(e, L, known, row, j)
            slope, g = scaled(1.0 / par.I1, plus(L, 1.0, so_far[3])), (0.0, 0.0, par.mgl)
            if bent:
                slope, g = bent_back(w, f, slope, g)
            return (*known, (slope, g)), max(far, too_far)

    registered: Part = register_jitable(slopes)
    return registered


@functools.cache
def _of_shape(counts: tuple[int, ...], bent: bool) -> Lanes:
    stages = len(counts)
    slopes = _stages(counts[:-1], stages, bent)
    whole = _product(counts[-1], stages, sum(counts[:-1]) * stages, stages)

    def part(block, table, row):  # type: ignore[no-untyped-def]
        wide_vectors()
        for j in range(W):
            par, (q, e, L) = TOP(*column(table, 0, j, NUMBERS)), entered(block, j)
            known, far = slopes(par, e, L, row, j)
            (m, v, _, dL), _, _, too_far = whole(e, L, known, row, j)
            left(block, j, q, m, v, dL)
            give_up(block, j, max(far, too_far) != 0.0)

    each = sum(counts) * stages
    return stepped(part, lay, 0, each, carried=UNSPUN, effort=_evaluations)


def _evaluations(rule: Any) -> int:
    return len(rule.counts) * len(rule.shares)


def in_lanes(rule: Any) -> Lanes:
    """The lanes of a table."""
    return _of_shape(tuple(int(count) for count in rule.counts), rule.bent != 0.0)
