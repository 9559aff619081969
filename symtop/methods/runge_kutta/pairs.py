"""Explicit pairs of order 5 to 9 with a tolerance, and the same tables with fixed steps, their stages written out.

    k_i = f(y + h sum_{j<i} a_ij k_j),  y+ = y + h sum_i b_i k_i    each sum without the terms whose coefficient is zero

The steps are chosen as SciPy chooses them (`dormand_prince`), |err| by the order of the estimate:

    name              order   f a step   |err|, e_p = rms(err of order p)   samples between steps
    tsit5             5       6          e_4                                order 4, no further f
    dop853-compiled   8       12         e_5^2 / sqrt(e_5^2 + e_3^2/100)    order 7, three f for all of a step
    vern9             9       16         e_8                                by a shorter step, 15 f each

`dop853-compiled` accepts and rejects the steps of SciPy's `dop853` and takes as many f. Stages that are written out
keep their slopes in registers: on the axis a step of order 8 takes a quarter of the time of a loop over the table.
Explicit, neither symplectic nor symmetric; nothing is conserved but what is linear in the state (`equations`).
Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, sections II.5 and II.6; `pair_tables`.
"""

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from symtop.core.jit import combined, register_jitable, set_item
from symtop.methods.framework.angles import LEAST_TOLERANCE
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.fixed_step import FixedStep
from symtop.methods.framework.loop import Loop, driver
from symtop.methods.framework.registry import Integrator
from symtop.methods.runge_kutta.dormand_prince import Method, interpolate, nothing_more, rms, solver
from symtop.methods.runge_kutta.explicit import Tableau, add, plus, row_of, store, weighted
from symtop.methods.runge_kutta.pair_tables import DOP853, TSIT5, VERN9, Row, Table


@register_jitable
def zero(state: Any) -> Any:
    """A state of zeros."""
    for m in range(len(state)):
        state = set_item(state, m, 0.0)
    return state


@register_jitable
def _forget(slopes: Any, i: int, slope: Any) -> None:
    """Slopes that nobody reads again."""


def _sum(weights: Sequence[float]) -> Callable[..., Any]:
    """``(place, made, h)`` to place + h sum_j w_j k_j, term by term, of a tuple of slopes."""
    used = tuple(float(weight) if weight else None for weight in weights)

    def added(place, made, h):  # type: ignore[no-untyped-def]
        return combined(place, made, used, h)

    return register_jitable(added)


def _stages(field: Callable[..., Any], rows: Sequence[Row], keep: Callable[..., Any]) -> Callable[..., Any]:
    """``(par, state, first, slopes, h)`` to the slopes of a step, a tuple of tuples; `keep` writes each down."""
    if not rows:

        def alone(par, state, first, slopes, h):  # type: ignore[no-untyped-def]
            return (first,)

        return register_jitable(alone)
    before, place, last = _stages(field, rows[:-1], keep), _sum(rows[-1]), len(rows)

    def stages(par, state, first, slopes, h):  # type: ignore[no-untyped-def]
        made = before(par, state, first, slopes, h)
        slope = field(par, place(state, made, h))
        keep(slopes, last, slope)
        return (*made, slope)

    return register_jitable(stages)


class Pair(NamedTuple):
    """An explicit pair with its stages written out."""

    name: str
    table: Table
    order: int
    estimate: int  # order of the error estimate
    summary: str
    reference: str

    def method(self, field: Callable[..., Any]) -> Method:
        """What `dormand_prince.loop` steps by: attempts, their error, and samples."""
        table, dense = self.table, self.table.dense
        keep = store if dense else _forget
        stages, total = _stages(field, table.a, keep), _sum(table.b)
        error, third, cost = _sum(table.error), _sum(table.third), len(table.a) + 1
        two = bool(self.table.third)

        @register_jitable
        def attempt(par, state, slopes, h, tolerance):  # type: ignore[no-untyped-def]
            none, first = zero(state), row_of(slopes, 0, state)
            made = stages(par, state, first, slopes, h)
            new = plus(state, total(none, made, h))
            last = field(par, new)
            store(slopes, cost, last)
            size = rms(error(none, (*made, last), h), state, new, tolerance)
            if two:
                other = rms(third(none, made, h), state, new, tolerance)
                size = 0.0 if size == other == 0.0 else size * size / math.sqrt(size * size + 0.01 * other * other)
            return new, size

        @register_jitable
        def polynomial(par, state, new, slopes, h, x):  # type: ignore[no-untyped-def]
            return interpolate(dense, state, slopes, h, x)

        @register_jitable
        def shorter(par, state, new, slopes, h, x):  # type: ignore[no-untyped-def]
            part = x * h
            return plus(state, total(zero(state), stages(par, state, row_of(slopes, 0, state), slopes, part), part))

        parts = Method(
            attempt, nothing_more, polynomial if dense else shorter, cost + 1, cost, -1 / (self.estimate + 1)
        )
        return parts if not two else parts._replace(**_order_seven(table, field, cost))

    def adaptive(self) -> Integrator:
        """The pair with a tolerance."""
        return self._integrator(self.name, {chart: solver(chart, self) for chart in FORMULATIONS}, "tolerance")

    def fixed(self) -> Integrator:
        """The table of the higher order with a step."""
        a, b = self.table.a[: len(self.table.b) - 1], self.table.b
        triangle = [value for i, row in enumerate(a) for value in (*row, *(0.0,) * (i + 1 - len(row)))]
        rule = Tableau(np.array(triangle), np.array(b))  # type: ignore[arg-type]  (in arrays they travel faster)
        solvers = {
            chart: FixedStep(fixed_loop(chart, self), rule, form.prepare, 1, implicit=False, present=form.present)
            for chart, form in FORMULATIONS.items()
        }
        return self._integrator(f"{self.name}-fixed", solvers, "step_size")

    def _integrator(self, name: str, solvers: Any, control: str) -> Integrator:
        chosen = "with SciPy's step control" if control == "tolerance" else "with fixed steps"
        return Integrator(
            name=name, family="runge-kutta", summary=f"{self.summary} {chosen}, compiled", solvers=solvers,
            control=control, order=self.order, explicit=True, symplectic=False, symmetric=False, conserves=frozenset(),
            least_tolerance=LEAST_TOLERANCE if control == "tolerance" else 0.0, reference=self.reference,
            needs="derivative", general=True,
        )  # fmt: skip


def _order_seven(table: Table, field: Callable[..., Any], cost: int) -> dict[str, Any]:
    """The samples of DOP853: three further stages, and a polynomial of degree 7 in nested form."""
    stages = cost + 1 + len(table.extra)
    rows = np.zeros((2, 4, stages))
    for i, part in enumerate((table.extra, table.dense)):
        for j, row in enumerate(part):
            rows[i, j, : len(row)] = row
    extra, dense = rows[0, :3], rows[1]

    @register_jitable
    def refine(par, state, slopes, h):  # type: ignore[no-untyped-def]
        for i in range(len(extra)):
            place = plus(state, weighted(extra[i, : cost + 1 + i], state, slopes, h))
            store(slopes, cost + 1 + i, field(par, place))
        return len(extra)

    @register_jitable
    def sample(par, state, new, slopes, h, x):  # type: ignore[no-untyped-def]
        at = zero(state)
        for i in range(len(dense)):
            at = add(at, weighted(dense[len(dense) - 1 - i], state, slopes, h), 1.0)
            for m in range(len(state)):
                at = set_item(at, m, at[m] * (x if i % 2 == 0 else 1.0 - x))
        first, last = row_of(slopes, 0, state), row_of(slopes, cost, state)
        for m in range(len(state)):
            moved = new[m] - state[m]
            bent = (at[m] + 2.0 * moved - h * (last[m] + first[m])) * x
            at = set_item(at, m, state[m] + ((bent + h * first[m] - moved) * (1.0 - x) + moved) * x)
        return at

    return {"refine": refine, "sample": sample, "rows": stages}


@functools.cache
def fixed_loop(chart: str, pair: Pair) -> Loop:
    """The loop with fixed steps in one chart; the rule is the table as a `Tableau`, for whoever wants to see it."""
    form = FORMULATIONS[chart]
    field, ended_at, rows = form.field, form.ended, pair.table.a[: len(pair.table.b) - 1]
    stages, total, cost = _stages(field, rows, _forget), _sum(pair.table.b), len(pair.table.b)

    def begin(par, rule, state, h):  # type: ignore[no-untyped-def]
        return 0.0

    def increment(par, rule, state, carry, h):  # type: ignore[no-untyped-def]
        step = total(zero(state), stages(par, state, field(par, state), rule.b, h), h)
        return step, carry, cost, ended_at(plus(state, step))

    return driver(begin, increment, form.observe)


PAIRS = (
    Pair("tsit5", TSIT5, 5, 4, "Tsitouras's pair 5(4)", "tsitouras-2011"),
    Pair("dop853-compiled", DOP853, 8, 7, "Dormand-Prince 8(5,3)", "prince-dormand-1981 hairer-norsett-wanner-1993"),
    Pair("vern9", VERN9, 9, 8, "Verner's most efficient pair 9(8)", "verner-2010"),
)


def built_in() -> list[Integrator]:
    """Each pair with a tolerance and with a step."""
    return [make() for pair in PAIRS for make in (pair.adaptive, pair.fixed)]
