"""Explicit pairs of order 5 to 9 with SciPy's control of the step, compiled, and the same tables with fixed steps.

    k_1 = f(y),  k_i = f(y + h sum_{j<i} a_ij k_j),  y+ = y + h sum_i b_i k_i,  f(y+) is the k_1 of the next step
    |err| as below, of parts err_m / (atol + rtol max(|y_m|, |y+_m|)), must be below 1;  q: order - 1
    h <- h min(10, .9 |err|^(-1/(q+1))) after a step (min(1, ..) after a rejection),  h max(.2, ..) when rejected

    name              order   f a step   |err|, e_p = rms(err of order p)   samples between steps
    rk45-compiled     5       6          e_4                                order 4, no further f
    tsit5             5       6          e_4                                order 4, no further f
    dop853-compiled   8       12         e_5^2 / sqrt(e_5^2 + e_3^2/100)    order 7, three f for all of a step
    vern9             9       16         e_8                                a shorter step, not counted

`rk45-compiled` and `dop853-compiled` are SciPy's `rk45` and `dop853` on the same equations (see `equations`): they
accept and reject the same steps and take as many f, so that their errors are equal and their times differ only by the
cost of Python: with them a comparison of methods does not depend on the language.

The stages of a step are written out, without the terms whose coefficient is zero, and keep their slopes in registers:
on the axis a step of order 8 takes a quarter of the time of a loop over the table. In lanes (`explicit.in_lanes`) the
same stages step many members, a step of one in a quarter of the time that it takes alone. Nothing is symplectic,
symmetric or conserved but what is linear in the state. Sources: those of `pair_tables`; the initial step: Hairer,
Norsett, Wanner, Solving Ordinary Differential Equations I, section II.4.
"""

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from symtop.core.jit import compile_kernel, register_jitable, set_item
from symtop.methods.framework.adaptive import Adaptive, AdaptiveLoop
from symtop.methods.framework.angles import LEAST_TOLERANCE
from symtop.methods.framework.equations import FORMS
from symtop.methods.framework.lanes import W
from symtop.methods.framework.loop import FixedStep, Loop, no_carry
from symtop.methods.framework.plan import OK, STEP_TOO_SMALL
from symtop.methods.framework.preparation import as_it_steps
from symtop.methods.framework.registry import Integrator
from symtop.methods.runge_kutta.explicit import Tableau, add, in_lanes, row_of, store, weighted, written_out
from symtop.methods.runge_kutta.pair_tables import DOP853, DORMAND_PRINCE, TSIT5, VERN9, Row, Table
from symtop.methods.simd import apart, combined, side_by_side
from symtop.methods.vectors import accumulate, summed, zero

BLOCK_EVALUATIONS = 5_000_000  # evaluations between returns to Python, so that an interrupt is heard within a second
EVALUATIONS = 1_000_000_000  # limit of a run: about half a minute

SAFETY, SHRINK, GROW = 0.9, 0.2, 10.0


class Method(NamedTuple):
    """A method in one chart, in functions that compile; `memory` (rows, size) begins with f(y), the rest is its own."""

    advance: Callable[..., Any]  # (par, state, memory, tolerance, t, step, end) -> state, t, step, evaluations, outcome
    refine: Callable[..., int]  # (par, state, memory, h) -> evaluations: further slopes for samples within a step
    sample: Callable[..., Any]  # (par, state, new, memory, h, x) -> the state at a fraction x of the step
    last: int  # the row of f(y+) after a step
    power: float  # of the error in the choice of the first step


@register_jitable
def rms(vector: Any, state: Any, new: Any, tolerance: float) -> float:
    """Root mean square of a vector in units of the allowed error, tolerance (1 + |y|)."""
    total = 0.0
    for m in range(len(vector)):
        part = vector[m] / (tolerance + max(abs(state[m]), abs(new[m])) * tolerance)
        total += part * part
    return math.sqrt(total / len(vector))


nothing_more = register_jitable(lambda _par, _state, _slopes, _h: 0)  # `refine` where samples need no evaluations


def trying(attempt: Callable[..., Any], cost: int, power: float) -> Any:
    """`Method.advance`: shrink the step until the error of ``attempt(par, state, slopes, h, tolerance)`` passes."""

    @register_jitable
    def advance(par, state, slopes, tolerance, t, step, end):  # type: ignore[no-untyped-def]
        shortest = 10.0 * (np.nextafter(t, np.inf) - t)
        step = max(step, shortest)
        grow = GROW
        evaluations = 0
        while step >= shortest:
            after = min(t + step, end)
            h = after - t
            new, error = attempt(par, state, slopes, h, tolerance)
            evaluations += cost
            change = GROW if error == 0.0 else SAFETY * error**power
            if error < 1.0:
                return new, after, h * min(grow, change), evaluations, OK
            step = h * (change if change > SHRINK else SHRINK)  # noqa: FURB136  (max would pass NaN on)
            grow = 1.0
        return state, t, step, evaluations, STEP_TOO_SMALL

    return advance


@register_jitable
def first_step(field: Any, par: Any, state: Any, slope: Any, end: float, tolerance: float, power: float) -> float:
    """SciPy's initial step: 1 % of |y|/|f|, then from the size of the second derivative, by one evaluation of f."""
    d0, d1 = rms(state, state, state, tolerance), rms(slope, state, state, tolerance)
    trial = min(1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1, end)
    change = add(field(par, add(state, slope, trial)), slope, -1.0)
    d2 = rms(change, state, state, tolerance) / trial
    guess = max(1e-6, 1e-3 * trial) if max(d1, d2) <= 1e-15 else (0.01 / max(d1, d2)) ** -power
    return min(100.0 * trial, guess, end)


@register_jitable
def copy(rows: Any, target: Any) -> None:
    """Copy rows; numba's assignment of slices would take a third of a kernel's compilation, for an error message."""
    for j in range(len(rows)):
        for m in range(rows.shape[1]):
            target[j, m] = rows[j, m]


@functools.cache
def loop(form: Any, method: Any, rows: int) -> AdaptiveLoop:
    """The compiled loop of ``method(field)``, a `Method` whose memory has `rows` rows, on a `Formulation`.

    It counts force evaluations. The place is (state, memory, time, step). `observe` sees the memory and the step that a
    sample lies in.
    """
    field, ended, observe, prepare, size = form.field, form.ended, form.observe, form.prepare.numbers, form.prepare.size
    unpack = form.prepare.unpack
    sample = as_it_steps if form.present is None else form.present.sample
    register_jitable(observe)
    advance, refine, between, last, power = method(field)
    clock = size + rows * size

    def march(numbers, tolerance, times, budget, index, place, states, momenta):  # type: ignore[no-untyped-def]
        par, state = prepare(*unpack(numbers))
        memory, zeros, end = np.zeros((rows, size)), zero(state), times[-1]
        record = place[:clock].reshape(1 + rows, size)  # the state, and the memory, there across lines of the cache
        steps = effort = outcome = 0
        if index < 0:
            slope = field(par, state)
            store(memory, 0, slope)
            index, t, step, effort = 0, 0.0, first_step(field, par, state, slope, end, tolerance, power), 2
        else:
            t, step = place[clock], place[clock + 1]
            state = row_of(record, 0, state)
            copy(record[1:], memory)
        while t < end and effort < budget:
            before, start = state, t
            state, t, step, work, outcome = advance(par, before, memory, tolerance, start, step, end)
            effort += work
            if outcome != OK:
                break
            steps += 1
            h = t - start
            if index < len(times) and times[index] <= t:
                effort += refine(par, before, memory, h)
            while index < len(times) and times[index] <= t:
                y = between(par, before, state, memory, h, (times[index] - start) / h)
                store(states, index, sample(par, times[index], y))
                momenta[index, 0], momenta[index, 1] = observe(par, memory, y, zeros, h)
                index += 1
            outcome = ended(state)
            store(memory, 0, row_of(memory, last, state))
            if outcome != OK:
                break
        store(record, 0, state)
        copy(memory, record[1:])
        place[clock], place[clock + 1] = t, step
        return index, steps, effort, outcome

    compiled: AdaptiveLoop = compile_kernel(march)
    return compiled


def solver(form: Any, method: Any, rows: int, *, light: bool = False) -> Adaptive:
    """A solver of the registry on the equations of a `Formulation`; `light` as `Adaptive` has it."""
    size, width = form.prepare.size, form.prepare.size if form.present is None else form.present.size
    clock = size * (1 + rows)

    @functools.cache  # once: the hash of a table takes a fifth of the time of a call
    def compiled() -> AdaptiveLoop:
        return loop(form, method, rows)

    limits = EVALUATIONS, BLOCK_EVALUATIONS
    return Adaptive(lambda _: compiled(), width, clock + 2, clock, *limits, check=form.prepare.check, light=light)


def integrator(name: str, summary: str, reference: str, method: Any, rows: int, **claims: Any) -> Integrator:
    """The `Integrator` of a method with a tolerance that needs f and nothing else, in every chart."""
    solvers = {chart: solver(form, method, rows) for chart, form in FORMS.items()}
    return Integrator(
        name=name, family="runge-kutta", summary=summary, solvers=solvers, control="tolerance", explicit=True,
        conserves=frozenset(), least_tolerance=LEAST_TOLERANCE, reference=reference, needs="derivative", general=True,
        **claims,
    )  # fmt: skip


_forget = register_jitable(lambda _slopes, _i, _slope: None)  # `record` for slopes that are not used again


def combination(weights: Sequence[float]) -> Any:
    """A function (place, ks, h): place + h sum_j w_j k_j, term by term, of the tuple `ks` of slopes."""
    factors = tuple(float(weight) if weight else None for weight in weights)

    def combine(place, ks, h):  # type: ignore[no-untyped-def]
        return combined(place, ks, factors, h)

    return register_jitable(combine)


def _stages(field: Callable[..., Any], rows: Sequence[Row], record: Callable[..., Any]) -> Any:
    """A function (par, state, first, slopes, h): the slopes of a step, a tuple of tuples; `record` stores each."""

    def stage(i: int) -> Callable[..., Any]:
        place = combination(rows[i - 1])

        def slope(par, state, ks, slopes, h):  # type: ignore[no-untyped-def]
            new = field(par, place(state, ks, h))
            record(slopes, i, new)
            return new

        return slope

    return written_out(len(rows) + 1, stage)


def stages_of(field: Callable[..., Any], table: Table) -> Any:
    """A function (par, state, first, at, h): the slopes of a step, which are not stored."""
    return _stages(field, table.a[: len(table.b) - 1], _forget)


class Pair(NamedTuple):
    """An explicit pair with its stages written out."""

    name: str
    table: Table
    order: int
    estimate: int  # order of the error estimate
    summary: str
    reference: str

    @property
    def rows(self) -> int:
        """Slopes of a step, with the first of the next one and those that only samples need."""
        return len(self.table.a) + 2 + len(self.table.extra)

    def __call__(self, field: Callable[..., Any]) -> Method:
        """The `Method` for `loop`: attempts, their error, and samples."""
        table, dense = self.table, self.table.dense
        record = store if dense else _forget
        stages, total = _stages(field, table.a, record), combination(table.b)
        error, third, cost = combination(table.error), combination(table.third), len(table.a) + 1
        two = bool(self.table.third)

        @register_jitable
        def attempt(par, state, slopes, h, tolerance):  # type: ignore[no-untyped-def]
            zeros, first = zero(state), row_of(slopes, 0, state)
            ks = stages(par, state, first, slopes, h)
            new = summed(state, total(zeros, ks, h))
            last = field(par, new)
            store(slopes, cost, last)
            size = rms(error(zeros, (*ks, last), h), state, new, tolerance)
            if two:
                size3 = rms(third(zeros, ks, h), state, new, tolerance)
                size = 0.0 if size == size3 == 0.0 else size * size / math.sqrt(size * size + 0.01 * size3 * size3)
            return new, size

        @register_jitable
        def polynomial(par, state, new, slopes, h, x):  # type: ignore[no-untyped-def]
            weights = dense[0] + dense[1][:3]  # a tuple of seven
            for i in range(len(dense)):
                row = dense[i]
                weights = set_item(weights, i, x * (row[0] + x * (row[1] + x * (row[2] + x * row[3]))))
            return summed(state, weighted(weights, state, slopes, h))

        @register_jitable
        def shorter(par, state, new, slopes, h, x):  # type: ignore[no-untyped-def]
            part = x * h
            return summed(state, total(zero(state), stages(par, state, row_of(slopes, 0, state), slopes, part), part))

        sample, power = polynomial if dense else shorter, -1.0 / (self.estimate + 1)
        parts = Method(trying(attempt, cost, power), nothing_more, sample, cost, power)
        return parts if not two else parts._replace(**_order_seven(table, field, cost))

    def adaptive(self) -> Integrator:
        """The pair with a tolerance."""
        summary = f"{self.summary} with SciPy's step control, compiled"
        return integrator(
            self.name, summary, self.reference, self, self.rows, order=self.order, symplectic=False, symmetric=False
        )

    def fixed(self) -> Integrator:
        """The table of the higher order with a step."""
        a, b = self.table.a[: len(self.table.b) - 1], self.table.b
        triangle = [value for i, row in enumerate(a) for value in (*row, *(0.0,) * (i + 1 - len(row)))]
        arrays: Any = np.array(triangle), np.array(b)  # faster arguments than tuples
        rule = Tableau(*arrays)
        solvers = {
            chart: FixedStep(fixed_loop(chart, self), rule, form.prepare, 1, implicit=False, present=form.present)
            for chart, form in FORMS.items()
        }
        return replace(
            self.adaptive(), name=f"{self.name}-fixed", summary=f"{self.summary} with fixed steps, compiled",
            solvers=solvers, control="step_size", least_tolerance=0.0,
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
            place = summed(state, weighted(extra[i, : cost + 1 + i], state, slopes, h))
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
            change = new[m] - state[m]
            bent = (at[m] + 2.0 * change - h * (last[m] + first[m])) * x
            at = set_item(at, m, state[m] + ((bent + h * first[m] - change) * (1.0 - x) + change) * x)
        return at

    return {"refine": refine, "sample": sample}


@functools.cache
def fixed_loop(chart: str, pair: Pair) -> Loop:
    """The loop with fixed steps in one chart; its rule, the table as a `Tableau`, is not used by the kernel."""
    return loop_of(FORMS[chart], pair.table, lambda _par, _state, step: step)


def loop_of(form: Any, table: Table, finish: Callable[..., Any]) -> Loop:
    """The loop of a table's steps, for one and in lanes; ``finish(par, state, step)`` changes each increment."""
    field, ended, finish = form.field, form.ended, register_jitable(finish)
    stages, total, cost = stages_of(field, table), combination(table.b), len(table.b)
    zeros, step_at = (0.0,) * form.prepare.size, len(form.top._fields) * W

    @register_jitable
    def make_step(par, state, h):  # type: ignore[no-untyped-def]
        step = total(zeros, stages(par, state, field(par, state), 0.0, h), h)
        return finish(par, state, step)

    def increment(par, rule, state, carry, h):  # type: ignore[no-untyped-def]
        step = make_step(par, state, h)
        return step, carry, cost, ended(summed(state, step))

    def lay(par, rule, h, numbers):  # type: ignore[no-untyped-def]
        numbers[0] = h

    def lane_increment(par, state, table, j):  # type: ignore[no-untyped-def]
        return make_step(par, state, table[step_at + j])

    lanes = in_lanes(form, lane_increment, lay, 1, cost)
    return Loop(no_carry, increment, form.observe, lanes=lambda _: lanes)


@functools.cache
def two_runs(chart: str, pair: Pair, compare: Callable[..., float]) -> Callable[..., None]:
    """``run(near, far, h, marks, data, out)``: two starts by the same steps, in the time of one and to the same bits.

    `near` and `far` are the plain numbers (`preparation`) of one top or body with each start. After each mark `out`
    has ``compare(state, other state, data)``. An overflow is not reported: the run goes on.
    """
    form: Any = FORMS[chart]
    field, numbers, unpack = form.field, form.prepare.numbers, form.prepare.unpack
    stages, total = stages_of(field, pair.table), combination(pair.table.b)

    def run(near, far, h, marks, data, out):  # type: ignore[no-untyped-def]
        par, first = numbers(*unpack(near))
        zeros, state = zero(first), side_by_side(first, numbers(*unpack(far))[1])
        zero_pair = low = side_by_side(zeros, zeros)
        k = 0
        for j in range(len(marks)):
            while k < marks[j]:
                state, low = accumulate(state, low, total(zero_pair, stages(par, state, field(par, state), 0.0, h), h))
                k += 1
            out[j] = compare(*apart(state), data)

    compiled: Callable[..., None] = compile_kernel(run)
    return compiled


RK45 = Pair("rk45-compiled", DORMAND_PRINCE, 5, 4, "Dormand-Prince", "dormand-prince-1980")
DOP853_PAIR = Pair("dop853-compiled", DOP853, 8, 7, "Dormand-Prince 8(5,3)", "hairer-norsett-wanner-1993")
VERN9_PAIR = Pair("vern9", VERN9, 9, 8, "Verner's most efficient pair 9(8)", "verner-2010")
PAIRS = Pair("tsit5", TSIT5, 5, 4, "Tsitouras's pair 5(4)", "tsitouras-2011"), DOP853_PAIR, VERN9_PAIR


def built_in() -> list[Integrator]:
    """Each pair with a tolerance and, but for SciPy's RK45, with a step."""
    return [RK45.adaptive()] + [make() for pair in PAIRS for make in (pair.adaptive, pair.fixed)]
