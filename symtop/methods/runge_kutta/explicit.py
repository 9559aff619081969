"""Explicit Runge-Kutta methods of fixed step, from any Butcher tableau.

    k_i = f(y + h sum_{j<i} a_ij k_j),    i = 1 .. s,        y+ = y + h sum_i b_i k_i

One kernel, three charts (`equations`): the unreduced angles (theta, phi, psi, theta', phi', psi'), and the space
frame, (e, L), where f is quadratic, or (q, L), which shows the spin angle as well; it has no pole. The top's equations
are autonomous, so that c = sum_j a_ij serves only to check what a user gives.

`rk4` is Kutta's classical method: order 4, four evaluations of f a step. No explicit Runge-Kutta method is symplectic
or symmetric: the errors of energy and of every constant that is not linear in the state grow linearly with time. L_z =
p_phi is linear in (e, L) and in (q, L) and stays; in angles nothing does.

In lanes a step is one loop over the lanes. Its stages and the sums of slopes are written out, term by term in the order
of the kernel for one: slopes stay in registers as far as these reach. The table holds h a, row by row, and h b. A
kernel compiles for each number of stages.
Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.1.
"""

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from reprlib import repr as short
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symtop.core.errors import SymtopError, row
from symtop.core.jit import register_jitable, set_item
from symtop.methods.framework.equations import FORMS
from symtop.methods.framework.lanes import Lanes, one_loop, reading
from symtop.methods.framework.loop import FixedStep, Loop, no_carry
from symtop.methods.framework.registry import Integrator
from symtop.methods.simd import combined
from symtop.methods.vectors import summed, zero


@register_jitable  # now, as the hash of a method's code must not depend on what has run
def _lay(par: Any, rule: Any, h: float, numbers: Any) -> None:
    n = len(rule.b)
    weights = n * (n - 1) // 2
    for i in range(weights):
        numbers[i] = h * rule.a[i]
    for i in range(n):
        numbers[weights + i] = h * rule.b[i]


def written_out(count: int, stage: Callable[[int], Callable[..., Any]]) -> Callable[..., Any]:
    """A function (par, state, first, at, h) -> `count` slopes, the others ``stage(i)(par, state, ks, at, h)``."""
    if count == 1:

        def slopes(par, state, first, at, h):  # type: ignore[no-untyped-def]
            return (first,)
    else:
        before, last = written_out(count - 1, stage), register_jitable(stage(count - 1))

        def slopes(par, state, first, at, h):  # type: ignore[no-untyped-def]
            ks = before(par, state, first, at, h)
            return (*ks, last(par, state, ks, at, h))

    return register_jitable(slopes)


def weighted_in_lanes(terms: int, first: int) -> Callable[..., Any]:
    """A function (place, slopes, table, j): place + w_1 k_1 + ..., `terms` of them; w_1 is number `first` of a lane."""
    weights = reading(terms)

    def added(place, slopes, table, j):  # type: ignore[no-untyped-def]
        return combined(place, slopes, weights(table, first, j), 1.0)

    return register_jitable(added)


Row = Sequence[float] | NDArray[Any]
Rows = Sequence[Row] | NDArray[Any]

TABLE_ROUNDING = 1e-12  # sums of a tableau may be off by this: coefficients come with 15 digits or more


class Tableau(NamedTuple):
    """An explicit Butcher tableau; `a` is its strict lower triangle row by row: a21, a31, a32, a41, ..."""

    a: tuple[float, ...]
    b: tuple[float, ...]


@register_jitable
def store(slopes: Any, i: int, slope: Any) -> None:
    """Write a slope into row i."""
    for m in range(len(slope)):
        slopes[i, m] = slope[m]


@register_jitable
def row_of(slopes: Any, i: int, like: Any) -> Any:
    """Row i as a tuple as long as `like`."""
    for m in range(len(like)):
        like = set_item(like, m, slopes[i, m])
    return like


@register_jitable
def add(place: Any, slope: Any, weight: float) -> Any:
    """place + weight slope."""
    for m in range(len(place)):
        place = set_item(place, m, place[m] + weight * slope[m])
    return place


@register_jitable
def later_stages(field: Any, par: Any, a: Any, stages: int, state: Any, slopes: Any, h: float) -> None:
    """Fill the rows 1 .. stages-1 of `slopes`; row 0 is the slope at the start of the step."""
    row = 0
    for i in range(1, stages):
        place = state
        for j in range(i):
            place = add(place, row_of(slopes, j, place), h * a[row + j])
        row += i
        store(slopes, i, field(par, place))


@register_jitable
def weighted(weights: Any, state: Any, slopes: Any, h: float) -> Any:
    """h sum_i weights_i slopes_i, a tuple as long as the state."""
    step = zero(state)
    for i in range(len(weights)):
        step = add(step, row_of(slopes, i, step), h * weights[i])
    return step


def in_lanes(form: Any, increment: Callable[..., Any], lay: Callable[..., None], size: int, cost: int) -> Lanes:
    """Lanes with increments ``increment(par, state, table, j)`` of `cost` evaluations; `lay` writes `size` numbers."""
    ended, increment = form.ended, register_jitable(increment)

    def advance(par, state, carry, table, j):  # type: ignore[no-untyped-def]
        step = increment(par, state, table, j)
        return step, carry, ended(summed(state, step))

    return one_loop(advance, lay, size, top=form.top, dimension=form.prepare.size, begin=no_carry, cost=cost)


def _loop(form: Any) -> Loop:
    """The loop in one chart, for one and in lanes; the work counted is the number of force evaluations."""
    field, ended, zeros, tops = form.field, form.ended, (0.0,) * form.prepare.size, len(form.top._fields)

    def begin(par, rule, state, h):  # type: ignore[no-untyped-def]
        return np.empty((len(rule.b), len(state)))

    def increment(par, rule, state, carry, h):  # type: ignore[no-untyped-def]
        store(carry, 0, field(par, state))
        later_stages(field, par, rule.a, len(rule.b), state, carry, h)
        step = weighted(rule.b, state, carry, h)
        return step, carry, len(rule.b), ended(summed(state, step))

    def stage(i: int) -> Callable[..., Any]:
        place = weighted_in_lanes(i, tops + i * (i - 1) // 2)

        def slope(par, state, ks, table, j):  # type: ignore[no-untyped-def]
            return field(par, place(state, ks, table, j))

        return slope

    @functools.cache
    def lanes(count: int) -> Lanes:
        stages, total = written_out(count, stage), weighted_in_lanes(count, tops + count * (count - 1) // 2)

        def lane_increment(par, state, table, j):  # type: ignore[no-untyped-def]
            return total(zeros, stages(par, state, field(par, state), table, j), table, j)

        return in_lanes(form, lane_increment, _lay, count * (count + 1) // 2, count)

    return Loop(begin, increment, form.observe, lanes=lambda rule: lanes(len(rule.b)))


LOOPS = {chart: _loop(form) for chart, form in FORMS.items()}


def _explicit(a: Rows, b: Row) -> tuple[list[list[float]], list[float]]:
    """The strict lower triangle, by rows, and the weights; refuses what is not an explicit tableau."""
    weights = row("b", b)
    try:
        rows = None if isinstance(a, (str, bytes, dict)) else [row("a", values) for values in a]
    except TypeError:  # not iterable, such as an array without dimensions
        rows = None
    if rows is None:
        raise SymtopError(f"a must be rows of numbers, not {short(a)}")
    if not weights or len(rows) != len(weights):
        raise SymtopError(
            f"a must have one row for each of the {len(weights)} entries of b (at least one), not {len(rows)}"
        )
    lower = []
    for i, values in enumerate(rows):
        if len(values) not in (i, len(weights)) or any(value != 0.0 for value in values[i:]):
            raise SymtopError(
                f"row {i + 1} of a must have {i} entries (or zeros after them) for an explicit method, not {values}"
            )
        lower.append(values[:i])
    if abs(math.fsum(weights) - 1.0) > TABLE_ROUNDING:
        raise SymtopError(f"b must sum to 1, not {math.fsum(weights)!r}")
    return lower, weights


def runge_kutta(
    name: str, a: Rows, b: Row, c: Row | None = None, *,
    order: int | None = None, summary: str = "", reference: str = "",
) -> Integrator:  # fmt: skip
    """An explicit Runge-Kutta method from its Butcher tableau.

    `a` has one row a stage, either the entries below the diagonal (the first row empty) or whole rows with zeros from
    the diagonal on; `b` must sum to 1. All may be arrays. With `c` given, the row sums of `a` are checked against it.

    Raises SymtopError for a tableau that is implicit, ragged or inconsistent.
    """
    lower, weights = _explicit(a, b)
    if c is not None:
        sums, nodes = [math.fsum(values) for values in lower], row("c", c)
        if len(nodes) != len(sums) or any(abs(x - y) > TABLE_ROUNDING for x, y in zip(sums, nodes, strict=True)):
            raise SymtopError(f"c must be the row sums of a, {sums}, not {nodes}")
    triangle = tuple(value for values in lower for value in values)
    rule = Tableau(triangle or (0.0,), tuple(weights))  # Euler's is empty, which numba cannot type
    return Integrator(
        name=name,
        family="runge-kutta",
        summary=summary or f"explicit Runge-Kutta method with {len(weights)} stages",
        solvers={
            chart: FixedStep(LOOPS[chart], rule, form.prepare, 1, implicit=False, present=form.present)
            for chart, form in FORMS.items()
        },
        order=order, explicit=True, symplectic=False, symmetric=False, conserves=frozenset(),
        reference=reference, needs="derivative", general=True,
    )  # fmt: skip


def built_in() -> list[Integrator]:
    """The tableaux that ship with symtop."""
    words = "explicit Euler method on the unreduced equations"
    euler = runge_kutta("euler", ((),), (1.0,), order=1, summary=words, reference="hairer-norsett-wanner-1993")
    return [
        replace(euler, solvers={chart: euler.solvers[chart] for chart in ("angles", "axis")}),  # |q| would not stay one
        runge_kutta(
            "rk4",
            ((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)),
            (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0),
            order=4,
            summary="classical Runge-Kutta method on the unreduced equations",
            reference="kutta-1901",
        ),
    ]  # fmt: skip
