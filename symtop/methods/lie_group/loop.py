"""The loop around maps that make a step as a rotation in space: Lie-group methods, on the attitude (q, L).

A map takes the axis and the momentum, on which alone the motion of a symmetric top depends, and returns a rotation as a
quaternion less one, (m, v) = p - 1, and the change of L:

    turn(par, rule, e, L, carry, h) -> (m, v, dL, carry, work, outcome),    q <- p q,   e <- p e p*,   L <- L + dL

`rule.shares` are the parts that a step is composed of, in units of h: (1,) for the map itself, and five of Suzuki's for
order 4. The axis chart shows (e, L) of the same run: one kernel, and its attitude has the bits of its axis.

A map in the frame that turns with L/I1 leaves the spin of the body out (`UNSPUN`): where L.e is kept exactly, that spin
is a constant rate and is added at samples, as in `splitting.space`. A map of the body itself (`SPUN`) turns it in the
step, with an error that grows with the spin.

p - 1 in place of p keeps increments free of cancellation. In every step m is corrected for the error of |q|.

A body without symmetry is stepped as (q*, M), for which a map sees Gamma and M (`TURNED`; see `framework.body`).

In lanes the outer loop is over shares and the inner one over lanes. A family supplies the inner one, as one loop over
the lanes or several (`stepped`), or as the parts of an iteration (`iterated_loop`). The table holds the numbers of the
top, those of the rule and those of each share: one kernel for compositions of any length, and for both charts. An
iteration runs until it has ended in all lanes. A lane in which it has not ended after half of the passes allowed to a
run alone is given up, and so is one whose equation cannot be solved.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

from symtop.core.jit import register_jitable
from symtop.methods.framework.body import General, turned, turned_back
from symtop.methods.framework.lanes import Lanes, W, column, none_left, put, reading, showing
from symtop.methods.framework.loop import FixedStep, Loop, no_carry
from symtop.methods.framework.plan import NOT_CONVERGED, OK
from symtop.methods.framework.preparation import BareTop, Preparation, Presentation, as_it_steps
from symtop.methods.framework.space import SpaceTop, axis_of, ended_space, observe_attitude, on_attitude, with_spin
from symtop.methods.simd import wide_vectors
from symtop.methods.vectors import accumulate, displaced, dot, plus, scaled, summed
from symtop.model.charts import BODY

_attitude_numbers = on_attitude.numbers


def _prepare_body(top: Any, at: Any) -> Any:
    return BareTop(top.I1, top.I3, top.mgl), _attitude_numbers(top, at)[1]


class SpinForm(NamedTuple):
    """How the body's spin is stepped: the start of a kernel, and how the attitude is shown."""

    prepare: Preparation
    present: Presentation | None
    top: Any  # the NamedTuple of the numbers of the top


UNSPUN = SpinForm(on_attitude, Presentation(lambda par, t, y: with_spin(par, y, t), 7), SpaceTop)
SPUN = SpinForm(Preparation(_prepare_body, 7), None, BareTop)
TURNED = SpinForm(turned, turned_back, General)  # a body without symmetry
_AXIS = Presentation(lambda _par, _t, y: (*axis_of(y[0], y[1], y[2], y[3]), y[4], y[5], y[6]), 6)
STILL = (0.0,) * 7  # no increment


@register_jitable
def gravity(par: Any, e: Any) -> Any:
    """The torque mgl k x e."""
    return -par.mgl * e[1], par.mgl * e[0], 0.0


@register_jitable
def moved(m: float, v: Any, x: Any) -> Any:
    """How far the rotation p = (1 + m, v) moves a vector: p x p* - x."""
    return displaced((1.0 + m, v[0], v[1], v[2]), x)


@register_jitable
def cayley(u: Any) -> Any:
    """The rotation of a Cayley vector, by 2 arctan |u| about u."""
    square = dot(u, u)
    root = math.sqrt(1.0 + square)
    return -square / (root * (1.0 + root)), scaled(1.0 / root, u)


@register_jitable
def composed(step: Any, q: Any, m: float, v: Any, dL: Any) -> Any:
    """The increment with one more rotation, of q, the quaternion after that increment."""
    a, b, c, d, X, Y, Z = step
    w, x, y, z = q
    m += 0.5 * (1.0 + m) * (1.0 - (w * w + x * x + y * y + z * z))
    a += m * w - (v[0] * x + v[1] * y + v[2] * z)
    b += m * x + (v[0] * w + v[1] * z - v[2] * y)
    c += m * y + (v[1] * w + v[2] * x - v[0] * z)
    d += m * z + (v[2] * w + v[0] * y - v[1] * x)
    return a, b, c, d, X + dL[0], Y + dL[1], Z + dL[2]


def lie_loop(
    turn: Callable[..., Any], begin: Callable[..., Any] = no_carry,
    lanes: Callable[[Any], Lanes | None] = lambda _: None, observe: Callable[..., Any] = observe_attitude,
) -> Loop:  # fmt: skip
    """The loop on (q, L) around a map; `lanes` is how it steps many, by its rule."""
    register_jitable(turn)

    def increment(par, rule, state, carry, h):  # type: ignore[no-untyped-def]
        step = STILL
        effort = outcome = 0
        for share in rule.shares:
            y = summed(state, step)
            m, v, dL, carry, work, outcome = turn(par, rule, axis_of(*y[:4]), y[4:], carry, h * share)
            effort += work
            if outcome != OK:
                break
            step = composed(step, y[:4], m, v, dL)
        if outcome == OK:
            outcome = ended_space(step)
        return step, carry, effort, outcome

    return Loop(begin, increment, observe, lanes=lanes)


def in_charts(
    loop: Loop, rule: Any, form: SpinForm, forces: int, *, implicit: bool, of_body: Loop | None = None
) -> dict[str, FixedStep]:
    """Solvers on the axis and on the attitude, and of a body around a loop on (q*, M) with `observe_turned`.

    A unit of work is so many force evaluations.
    """
    make = functools.partial(FixedStep, rule=rule, evaluations=forces, implicit=implicit)
    presentations = {"axis": _AXIS, "attitude": form.present}
    of_top = {chart: make(loop, prepare=form.prepare, present=present) for chart, present in presentations.items()}
    return of_top if of_body is None else of_top | {BODY: make(of_body, prepare=TURNED.prepare, present=TURNED.present)}


@register_jitable
def inertia(par: Any, e: Any, x: Any) -> Any:
    """J x = I1 x + (I3 - I1)(e.x) e."""
    return plus(scaled(par.I1, x), (par.I3 - par.I1) * dot(e, x), e)


SIZE = len(STILL)
LOW, STEP, FLAG, WORK, CARRY = SIZE, 2 * SIZE, 3 * SIZE, 3 * SIZE + 1, 3 * SIZE + 2


@register_jitable
def present_state(block: Any, j: int) -> Any:
    """The present quaternion of lane j, within the step, its axis, and the momentum."""
    y = summed(column(block, 0, j, STILL), column(block, STEP, j, STILL))
    return y[:4], axis_of(*y[:4]), y[4:]


@register_jitable
def add_rotation(block: Any, j: int, q: Any, m: float, v: Any, dL: Any) -> None:
    """Add the rotation of a share to the step of lane j."""
    put(block, STEP, j, composed(column(block, STEP, j, STILL), q, m, v, dL))


@register_jitable
def give_up(block: Any, j: int, failed: bool) -> None:
    """Mark lane j to be run alone, if `failed`, without a branch."""
    block[FLAG * W + j] = 1.0 if failed else block[FLAG * W + j]


def stepped(
    part: Callable[..., None], lay: Callable[..., None], fields: int, width: int, *,
    carried: SpinForm, carry: int = 1, begin: Callable[..., Any] = no_carry, room: int = 0,
    effort: Callable[[Any], int] = lambda _: 0,
) -> Lanes:  # fmt: skip
    """A map in lanes: ``part(block, table, row)`` makes one share of all lanes; `row` holds the share's numbers.

    ``lay(par, rule, h, numbers)`` writes `fields` numbers of the rule, then `width` for every share.
    """
    shares_at = len(carried.top._fields) + fields
    register_jitable(part)

    def step(block, table):  # type: ignore[no-untyped-def]
        wide_vectors()
        for j in range(W):
            put(block, STEP, j, STILL)
        for share in range((len(table) // W - shares_at) // width):
            part(block, table, table[(shares_at + share * width) * W :])
        for j in range(W):
            state, step = column(block, 0, j, STILL), column(block, STEP, j, STILL)
            give_up(block, j, ended_space(step) != OK)
            new, low = accumulate(state, column(block, LOW, j, STILL), step)  # `move` takes a fifth longer here
            put(block, 0, j, new)
            put(block, LOW, j, low)

    def size(rule: Any) -> int:
        return fields + width * len(rule.shares)

    small, large = showing(_AXIS.sample), showing(as_it_steps if carried.present is None else carried.present.sample)

    def show(par, t, state, out):  # type: ignore[no-untyped-def]
        if len(out) == 6:  # the axis
            small(par, t, state, out)
        else:
            large(par, t, state, out)

    return Lanes(step, lay, lambda _: 0.0, size, carried.top, SIZE, carry, effort, lambda _: room, begin, show)


Parts = tuple[Callable[..., Any], Callable[..., Any], Callable[..., Any]]  # start, iterate and close


def iterated_loop(  # noqa: C901  (the loops of one step, read in one piece)
    parts: Parts, limit: int, *, opened: int, unknowns: int, in_lanes: Parts | None = None,
    numbers: Callable[..., Any] = lambda _: (0.0,), count: int = 1, begin: Callable[..., Any] = no_carry,
    carry: int = 1, carried: SpinForm = SPUN, observe: Callable[..., Any] = observe_attitude,
) -> Loop:  # fmt: skip
    """The loop around an iterated map of a body, for one and in lanes, from its parts; it counts passes as work.

        numbers(rule) -> rule                                        in lanes `count` numbers of it, as the parts take
        start(par, rule, e, L, carry, h) -> (fixed, x)               `opened` numbers that stay, and the first guess
        iterate(par, rule, carry, h, fixed, x) -> (x, converged, failed)      one pass; a lane that failed runs alone
        close(par, rule, carry, h, fixed, x) -> (m, v, dL, carry)    the rotation and the next carry

    `fixed`, x and the carry are flat tuples. A run alone makes at most `limit` passes. `in_lanes` are the parts without
    a branch, where there is one.
    """
    (start, iterate, close), (begin_lane, iterate_lane, close_lane) = parts, in_lanes or parts
    body, tops, first = carried.top, len(carried.top._fields), CARRY + carry
    x_at, live_at = first + opened, first + opened + unknowns
    top_of, rule_of, fixed_of, x_of = reading(tops), reading(count), reading(opened), reading(unknowns)
    carry_of = reading(carry)
    for function in (*parts, *(in_lanes or ()), numbers):
        register_jitable(function)

    @register_jitable
    def load(block, table, row, j):  # type: ignore[no-untyped-def]
        return body(*top_of(table, 0, j)), rule_of(table, tops, j), carry_of(block, CARRY, j), row[j]

    def part(block, table, row):  # type: ignore[no-untyped-def]
        wide_vectors()
        for j in range(W):
            par, rule, carry, h = load(block, table, row, j)
            _, e, L = present_state(block, j)
            fixed, x = begin_lane(par, rule, e, L, carry, h)
            put(block, first, j, fixed)
            put(block, x_at, j, x)
            block[live_at * W + j] = 1.0 - block[FLAG * W + j]
        for _ in range(limit // 2):
            for j in range(W):
                par, rule, carry, h = load(block, table, row, j)
                x, live = x_of(block, x_at, j), block[live_at * W + j]
                after, converged, failed = iterate_lane(par, rule, carry, h, fixed_of(block, first, j), x)
                for i in range(unknowns):
                    block[(x_at + i) * W + j] = after[i] if live != 0.0 else x[i]
                block[FLAG * W + j] = max(block[FLAG * W + j], live if failed else 0.0)
                block[WORK * W + j] += live
                block[live_at * W + j] = 0.0 if converged or failed else live
            if none_left(block, live_at):
                break
        for j in range(W):
            par, rule, carry, h = load(block, table, row, j)
            m, v, dL, newest = close_lane(par, rule, carry, h, fixed_of(block, first, j), x_of(block, x_at, j))
            add_rotation(block, j, present_state(block, j)[0], m, v, dL)
            put(block, CARRY, j, newest)
            give_up(block, j, block[live_at * W + j] != 0.0)

    def lay(par, rule, h, out):  # type: ignore[no-untyped-def]
        values, i = numbers(rule), count
        for q in range(count):
            out[q] = values[q]
        for share in rule.shares:
            out[i] = h * share
            i += 1

    def turn(par, rule, e, L, carry, h):  # type: ignore[no-untyped-def]
        fixed, x = start(par, rule, e, L, carry, h)
        work, converged, failed = 0, False, False
        while not (converged or failed) and work < limit:
            x, converged, failed = iterate(par, rule, carry, h, fixed, x)
            work += 1
        m, v, dL, carry = close(par, rule, carry, h, fixed, x)
        return m, v, dL, carry, work, OK if converged and not failed else NOT_CONVERGED

    lanes = stepped(part, lay, count, 1, carried=carried, carry=carry, begin=begin, room=live_at + 1 - first)
    return lie_loop(turn, begin, lambda _: lanes, observe)
