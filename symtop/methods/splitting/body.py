"""Splitting in the chart `body` (q, M): kicks of the weight between free motions, for any three moments.

    kick(b h):   M += b h Gamma x c
    drift(a h):  R3(a h/2)  R1(a h)  R3(a h/2)  S(a h)

The free motion is not elementary, but M^2/2 I2 commutes with all of it, and its flow S turns the body about L. What is
left of the kinetic energy, (1/I1 - 1/I2) M1^2/2 + (1/I3 - 1/I2) M3^2/2, has two flows that turn about an axis of the
body: R1 by the angle (1/I1 - 1/I2) M1 a h, and R3 likewise. R1 is the identity for I1 = I2, and the drift exact.

A drift is symmetric and of order two, so that kick-drift-kick is, too, and a composition of such steps has the order
that it has elsewhere. Other tables assume an exact free motion and would fall to order two with this one. They drift by
a composition of turns of their own order p, R3 first and last, with S once at its end (`free_motion`): Blanes and
Moan's S6 (p = 4), two of whose turns of each kind go backward, Kahan and Li's compositions (p = 6, 8). Of a generalised
order (8, 6, 4) only the last number remains. With tau = Gamma x c the force gradient is that of W = {V, {V, T}}:

    W = tau.(J^-1 tau),     M += Gamma x (b h c + 2 g h^3 c x J^-1 tau)

Every flow is one of the Hamiltonian: symplectic on T*SO(3), L_z moves by rounding alone, and without a weight all of L.
A processor, the flow of omega.tau, is not elementary here.

*Five rotations.* The whole kinetic energy has three such flows, by M_k/I_k a h, and R1 R2 R3 R2 R1 by halves, the third
by all, is a free motion of order two, too: that of Dullweber, Leimkuhler and McLachlan, and of Miller and others in
quaternions. Nothing in it is exact for a symmetric body, and p_psi wobbles there. On a free body its leading error has
two parts, which with a = 1/I1, b = 1/I2, c = 1/I3 vanish where

    a^2 (b - c) - 2 a b (b - c) - b^2 c = 0 = -a^2 (b - c) + 2 a c (b - c) + 2 b c^2:      1/4 : 3/4 : 1

in this order, and the order is 4 (Fasso). Between kicks it is 2 again. LAMMPS sorts: R1 is about the axis of the
largest moment and R3 about that of the smallest (`SORTED`).

With s, c = sin, cos of a half angle and m = c - 1 = -2 sin^2 of its half, no increment is a difference of large
numbers; the turn S gives q the length that rounding has taken.
Sources: Touma, Wisdom, Astron. J. 107 (1994) 1189; Blanes, Moan, J. Comput. Appl. Math. 142 (2002) 313; Kahan, Li,
Math. Comp. 66 (1997) 1089; Fasso, J. Comput. Phys. 189 (2003) 527; Dullweber, Leimkuhler, McLachlan, J. Chem. Phys.
107 (1997) 5840; Miller and others, J. Chem. Phys. 116 (2002) 8649.
"""

import functools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from symtop.core.jit import register_jitable, set_item
from symtop.methods.framework import body
from symtop.methods.framework.lanes import Lanes, W, column, put
from symtop.methods.framework.loop import FixedStep, Loop
from symtop.methods.framework.preparation import ScaledRule, unpack_top
from symtop.methods.framework.registry import Integrator
from symtop.methods.framework.space import ended_space
from symtop.methods.simd import wide_vectors
from symtop.methods.splitting.coefficients import BLANES_MOAN_6, METHODS, STRANG, Table
from symtop.methods.splitting.loop import Composition, compose, composed, no_rest, packed, stages
from symtop.methods.splitting.rotor import COSINE, SINE, exact, near, series
from symtop.methods.vectors import cross, plus
from symtop.model.body import vertical
from symtop.model.charts import BODY


@register_jitable
def _scale(rule: Any, top: Any, at: Any, h: float) -> Any:
    return stages(rule, h, h, 2.0 * h * h * h, 0.0)


def scaled(rule: Composition) -> ScaledRule:
    """The table as a rule that is scaled by the step of a run."""
    return ScaledRule(rule, _scale, packed, body.unpack_body)


_TURNS = BLANES_MOAN_6, METHODS["kahan-li-6"].table, METHODS["kahan-li-8"].table
_FREE = {table.order: table for table in _TURNS}  # kicks R3, drifts R1


def free_motion(rule: Composition, order: int | None) -> Table | None:
    """The turns of a drift: of order two in kick-drift-kick and drift-kick-drift steps, or of the order of the rule."""
    half = [0.0, *(0.5 * a for a in rule.drift), 0.0]
    steps = all(abs(b - x - y) < 1e-14 for b, x, y in zip(rule.kick, half, half[1:], strict=False))
    if not any(rule.gradient) and (steps or (rule.drift, rule.kick) == ((0.5, 0.5), (0.0, 1.0, 0.0))):
        return STRANG
    return _FREE.get(order or 0)


@register_jitable
def _force(par: Any, state: Any, step: Any) -> Any:
    return vertical(state[0] + step[0], state[1] + step[1], state[2] + step[2], state[3] + step[3])


def _kick_of(gradient: bool | None) -> Callable[..., Any]:
    """A kick with a force gradient, without one, or as its table says (None)."""

    @register_jitable
    def kick(par, force, step, pull, bend):  # type: ignore[no-untyped-def]
        x, y, z = body.torque(par, *force)
        kick = pull * x, pull * y, pull * z
        if gradient or (gradient is None and bend != 0.0):
            slope = cross((par.c1, par.c2, par.c3), (par.a1 * x, par.a2 * y, par.a3 * z))
            kick = plus(kick, bend, cross(force, slope))
        return (*step[:4], step[4] + kick[0], step[5] + kick[1], step[6] + kick[2])

    return kick


@register_jitable
def by_library(x: float) -> Any:
    """sin x, cos x - 1 and True, of any angle by sine and cosine of its half."""
    q = math.sin(0.5 * x)
    return 2.0 * q * math.cos(0.5 * x), -2.0 * q * q, True


@register_jitable
def by_series(x: float) -> Any:
    """sin x, cos x - 1 by series, and whether |x| < 1, where they are accurate."""
    square = x * x
    return x * series(square, SINE), -square * series(square, COSINE), square < 1.0


@register_jitable
def by_either(x: float) -> Any:
    """`by_series` for |x| < 1, otherwise `by_library`."""
    return by_series(x) if x * x < 1.0 else by_library(x)


_Turns = tuple[Callable[..., Any], ...]


def _turns(sine: Callable[..., Any], rotor: Callable[..., Any]) -> _Turns:
    """The turns by M_k `turn` about the three axes of the body, and the flow of turn |M|^2/2 by a rotor of `rotor`.

    Each is a function (state, d, turn) that returns the new increment d, and whether the series was accurate.
    """

    def about_axis(k: int) -> Callable[..., Any]:
        """The turn about axis k; a, b, c are the places in q of axis k and of the two that follow, in M three more."""
        a, b, c = 1 + k, 1 + (k + 1) % 3, 1 + (k + 2) % 3

        @register_jitable
        def rotate(state, d, turn):  # type: ignore[no-untyped-def]
            w, x, y, z = state[0] + d[0], state[a] + d[a], state[b] + d[b], state[c] + d[c]
            M2, M3 = state[b + 3] + d[b + 3], state[c + 3] + d[c + 3]
            s, m, near = sine(0.5 * turn * (state[a + 3] + d[a + 3]))
            C, S = -2.0 * s * s, 2.0 * s * (1.0 + m)
            d = set_item(set_item(d, 0, d[0] + (m * w - s * x)), a, d[a] + (m * x + s * w))
            d = set_item(set_item(d, b, d[b] + (m * y + s * z)), c, d[c] + (m * z - s * y))
            d = set_item(set_item(d, b + 3, d[b + 3] + (C * M2 + S * M3)), c + 3, d[c + 3] + (C * M3 - S * M2))
            return d, near

        return rotate

    @register_jitable
    def momentum(state, d, turn):  # type: ignore[no-untyped-def]
        w, x, y, z = state[0] + d[0], state[1] + d[1], state[2] + d[2], state[3] + d[3]
        M1, M2, M3 = state[4] + d[4], state[5] + d[5], state[6] + d[6]
        half = 0.5 * turn
        square = half * half * (M1 * M1 + M2 * M2 + M3 * M3)
        s, m = rotor(square, half)
        m += 0.5 * (1.0 + m) * (1.0 - (w * w + x * x + y * y + z * z))
        increment = (
            d[0] + (m * w - s * (M1 * x + M2 * y + M3 * z)), d[1] + (m * x + s * (M1 * w + M3 * y - M2 * z)),
            d[2] + (m * y + s * (M2 * w + M1 * z - M3 * x)), d[3] + (m * z + s * (M3 * w + M2 * x - M1 * y)),
            d[4], d[5], d[6],
        )  # fmt: skip
        return increment, square < 1.0

    return about_axis(0), about_axis(1), about_axis(2), momentum


ALONE, TOGETHER = _turns(by_either, exact), _turns(by_series, near)  # with a branch, and without it for lanes
PAR, STATE, STEP, FLAG = (0.0,) * 9, (0.0,) * 7, 14, 21  # numbers of a block, as `lanes` has them


_ended = register_jitable(lambda _state, step: ended_space(step))


def _begin(par: Any, rule: Any, state: Any, h: float) -> Any:
    return _force(par, state, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))


def _march(drift: Callable[..., Any], in_lanes: Callable[..., Any], rest: Any = no_rest) -> Loop:
    kick = _kick_of(None)

    def increment(par, rule, state, carry, h):  # type: ignore[no-untyped-def]
        step, force = compose(_force, kick, drift, par, rule, state, carry)
        return step, force, rule.forces, ended_space(step)

    @functools.cache
    def lanes(gradient: bool) -> Lanes:
        return composed(_force, _kick_of(gradient), in_lanes, _ended, top=body.General, dimension=7, carry=3, rest=rest)

    def lanes_of(rule: Composition) -> Lanes | None:
        return lanes(any(rule.gradient)) if rule.turn == AS_GIVEN else None

    return Loop(_begin, increment, body.observe_body, lanes=lanes_of)


@functools.cache
def march(table: Table) -> Loop:
    """The loop of the tables whose drift is this composition of turns about the third axis and the first."""
    outer, inner = table.kick, table.drift
    first, _, third, momentum = ALONE

    @register_jitable
    def drift(par, rule, state, step, time):  # type: ignore[no-untyped-def]
        about_third, about_first = time * (par.a3 - par.a2), time * (par.a1 - par.a2)
        step, _ = third(state, step, outer[0] * about_third)
        for i in range(len(inner)):
            step, _ = first(state, step, inner[i] * about_first)
            step, _ = third(state, step, outer[i + 1] * about_third)
        return momentum(state, step, time * par.a2)[0]

    return _march(drift, *_drift_in_lanes(outer, inner))


def _drift_in_lanes(outer: tuple[float, ...], inner: tuple[float, ...]) -> tuple[Any, Any]:
    """The drift of `march` in lanes: its first turn, and a function of the others, each in a loop over lanes."""
    first, _, third, momentum = TOGETHER

    @register_jitable
    def begin(par, state, step, time):  # type: ignore[no-untyped-def]
        return third(state, step, outer[0] * (time * (par.a3 - par.a2)))

    @register_jitable
    def load(block, table, j):  # type: ignore[no-untyped-def]
        return body.General(*column(table, 0, j, PAR)), column(block, 0, j, STATE), column(block, STEP, j, STATE)

    @register_jitable
    def turn(block, row, table, part, next_part, j):  # type: ignore[no-untyped-def]
        par, state, step = load(block, table, j)
        step, first_ok = first(state, step, part * (row[2 * W + j] * (par.a1 - par.a2)))
        step, third_ok = third(state, step, next_part * (row[2 * W + j] * (par.a3 - par.a2)))
        put(block, STEP, j, step)
        block[FLAG * W + j] = block[FLAG * W + j] if first_ok & third_ok else 1.0

    @register_jitable
    def close(block, row, table, j):  # type: ignore[no-untyped-def]
        par, state, step = load(block, table, j)
        step, near = momentum(state, step, row[2 * W + j] * par.a2)
        put(block, STEP, j, step)
        put(block, FLAG + 2, j, _force(par, state, step))
        block[FLAG * W + j] = block[FLAG * W + j] if near else 1.0

    @register_jitable
    def rest(block, row, table):  # type: ignore[no-untyped-def]
        wide_vectors()
        for i in range(len(inner)):
            part, next_part = inner[i], outer[i + 1]  # read here: LLVM copies a tuple of 17 to read one number of it
            for j in range(W):
                turn(block, row, table, part, next_part, j)
        for j in range(W):
            close(block, row, table, j)

    return begin, rest


AS_GIVEN, SORTED = range(2)  # the order of the axes of five rotations, in `Composition.turn`


@register_jitable
def _axes(par: Any, turn: int) -> Any:
    """The outer, the middle and the inner axis."""
    if turn == AS_GIVEN:
        return 0, 1, 2
    largest = 2 if max(par.I1, par.I2) <= par.I3 else 0 if par.I1 >= par.I2 else 1
    smallest = 2 if min(par.I1, par.I2) > par.I3 else 0 if par.I1 <= par.I2 else 1
    return largest, 3 - largest - smallest, smallest


def _five_turns(turns: _Turns) -> Callable[..., Any]:
    """A drift of five rotations."""
    first, second, third, momentum = turns

    @register_jitable
    def rotate(par, axis, state, step, time):  # type: ignore[no-untyped-def]
        if axis == 0:
            return first(state, step, time * par.a1)[0]
        if axis == 1:
            return second(state, step, time * par.a2)[0]
        return third(state, step, time * par.a3)[0]

    @register_jitable
    def drift(par, rule, state, step, time):  # type: ignore[no-untyped-def]
        (outer, middle, inner), half = _axes(par, rule.turn), 0.5 * time
        step = rotate(par, middle, state, rotate(par, outer, state, step, half), half)
        step = rotate(par, middle, state, rotate(par, inner, state, step, time), half)
        return momentum(state, rotate(par, outer, state, step, half), 0.0)[0]  # the length of q

    return drift


def _five_lane_turns() -> Callable[..., Any]:
    """A drift of five rotations in lanes, about the axes in the given order."""
    first, second, third, momentum = TOGETHER

    @register_jitable
    def drift(par, state, step, time):  # type: ignore[no-untyped-def]
        half = 0.5 * time
        step, a = first(state, step, half * par.a1)
        step, b = second(state, step, half * par.a2)
        step, c = third(state, step, time * par.a3)
        step, d = second(state, step, half * par.a2)
        step, e = first(state, step, half * par.a1)
        return momentum(state, step, 0.0)[0], a & b & c & d & e

    return drift


march_five = _march(_five_turns(ALONE), _five_lane_turns())
march_five_of_top = replace(_march(_five_turns(_turns(by_library, exact)), _five_lane_turns()), lanes=lambda _: None)


def five_rotations(order_of_axes: int) -> FixedStep:
    """Kicks around five rotations, of a body."""
    rule = Composition((1.0,), (0.5, 0.5), (0.0, 0.0), 1, order_of_axes)
    return FixedStep(march_five, scaled(rule), body.on_body, 1, implicit=False)


def built_in() -> list[Integrator]:
    """`five-rotations`."""
    on_body = five_rotations(AS_GIVEN)
    rule = replace(on_body.rule, unpack=unpack_top)
    on_top = replace(on_body, loop=march_five_of_top, rule=rule, prepare=body.of_top, present=body.in_space)
    return [
        Integrator(
            name="five-rotations", family="splitting", order=2, explicit=True, symplectic=True, symmetric=True,
            summary="gravity kicks around five turns about the body's axes, one force",
            conserves=frozenset({"p_phi"}), solvers={"attitude": on_top, BODY: on_body},
            reference="dullweber-leimkuhler-mclachlan-1997 miller-2002 fasso-2003", needs="kicks", general=True,
        )
    ]  # fmt: skip
