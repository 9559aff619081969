"""The stepping loop around the maps of engines: on the axis and on the attitude, in double and in single precision.

A map of `engine_kicks` or `engine_schemes` returns the rotation of a step, which turns the axis in one chart and the
attitude in the other. Beside them is carried what the engine carries, the angular velocity w or the angular momentum L:
to turn one into the other in every step would let rounding drift in p_phi or in p_psi. The samples are (e, L) and (q,
L) as in every space-frame chart, with L = I_s w.

In single precision each component of the state is a number of that precision, as is the result of every operation of
the map; the loop adds the difference of two such numbers, and its compensated sum gives the second one exactly. The
step is h rounded to single precision, while samples are shown at multiples of h: a relative 6e-8 in time.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from symtop.core.jit import register_jitable
from symtop.methods.engines.engine_parts import MOMENTUM, RATES, EngineTop, axis, momentum, normalised, turned
from symtop.methods.framework.loop import Loop, driver
from symtop.methods.framework.preparation import Preparation
from symtop.methods.framework.space import finite_outcome, observe_attitude, observe_axis
from symtop.methods.vectors import product


@register_jitable
def double(x: Any) -> Any:
    """A number in double precision."""
    return np.float64(x)


@register_jitable
def single(x: Any) -> Any:
    """A number in single precision."""
    return np.float32(x)


@register_jitable
def nothing(par: Any, e: Any, v: Any) -> Any:
    """What a step reuses of the one before: nothing."""
    return 0.0


@register_jitable
def _momenta(par: Any, e: Any, w: Any) -> Any:
    """p_phi = L_z and p_psi = L.e."""
    L = momentum(par, e, w)
    return L[2], L[0] * e[0] + L[1] * e[1] + L[2] * e[2]


@register_jitable
def _after(before: Any, dstate: Any, i: int) -> Any:
    """Three components of the state after a step, from the i-th on."""
    return before[i] + dstate[i], before[i + 1] + dstate[i + 1], before[i + 2] + dstate[i + 2]


def _observe_rates_on_axis(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """The momenta after the step."""
    return _momenta(par, _after(before, dstate, 0), _after(before, dstate, 3))


def _observe_rates_on_attitude(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """The momenta after the step."""
    return _momenta(par, axis((before[0] + dstate[0], *_after(before, dstate, 1))), _after(before, dstate, 4))


def _enter(par: Any, rule: Any, state: Any, h: float) -> Any:
    """The start is prepared as the map carries it."""
    return state


def _present_rates_on_axis(par: Any, rule: Any, state: Any, k: int, h: float) -> Any:
    """(e, L) of (e, w)."""
    e = state[0], state[1], state[2]
    return (*e, *momentum(par, e, (state[3], state[4], state[5])))


def _present_rates_on_attitude(par: Any, rule: Any, state: Any, k: int, h: float) -> Any:
    """(q, L) of (q, w)."""
    q = state[0], state[1], state[2], state[3]
    return (*q, *momentum(par, axis(q), (state[4], state[5], state[6])))


def _present_momentum(par: Any, rule: Any, state: Any, k: int, h: float) -> Any:
    """The state is shown as it is carried."""
    return state


class Carried(NamedTuple):
    """What a map carries beside an orientation: how it starts, is observed and is shown, by chart."""

    prepare: dict[str, Preparation]
    observe: dict[str, Callable[..., Any]]
    present: dict[str, Callable[..., Any]]


VELOCITY = Carried(
    RATES,
    {"axis": _observe_rates_on_axis, "attitude": _observe_rates_on_attitude},
    {"axis": _present_rates_on_axis, "attitude": _present_rates_on_attitude},
)
ANGULAR_MOMENTUM = Carried(
    MOMENTUM,
    {"axis": observe_axis, "attitude": observe_attitude},
    {"axis": _present_momentum, "attitude": _present_momentum},
)


@register_jitable
def _rounded(number: Any, par: Any) -> Any:
    """The numbers of the top in the precision of the map."""
    return EngineTop(
        number(par.I1), number(par.I3), number(par.mgl), number(par.zero), number(par.half), number(par.one)
    )


def axis_loop(step: Callable[..., Any], carried: Carried, reused: Callable[..., Any] = nothing) -> Loop:
    """The loop on the axis around a map; `reused` is what its first step takes for the one before."""
    register_jitable(step)

    def begin(par, rule, state, h):  # type: ignore[no-untyped-def]
        return reused(par, (state[0], state[1], state[2]), (state[3], state[4], state[5]))

    def increment(par, rule, state, carry, h):  # type: ignore[no-untyped-def]
        e, v = (state[0], state[1], state[2]), (state[3], state[4], state[5])
        p, new, carry = step(par, rule, e, v, carry, h)
        x, y, z = turned(p, e)
        r, s, t = e[0] + x, e[1] + y, e[2] + z
        lost = 0.5 * (1.0 - (r * r + s * s + t * t))  # |e| = 1 to rounding, as engines keep |q|
        dstate = x + lost * r, y + lost * s, z + lost * t, new[0] - v[0], new[1] - v[1], new[2] - v[2]
        total = dstate[0] + dstate[1] + dstate[2] + dstate[3] + dstate[4] + dstate[5]
        return dstate, carry, 1, finite_outcome(total)

    return driver(begin, increment, carried.observe["axis"], _enter, carried.present["axis"])


def attitude_loop(
    step: Callable[..., Any], carried: Carried, reused: Callable[..., Any] = nothing,
    number: Callable[..., Any] = double,
) -> Loop:  # fmt: skip
    """The loop on the attitude around a map, in the precision of `number`."""
    register_jitable(step)

    def begin(par, rule, state, h):  # type: ignore[no-untyped-def]
        return reused(par, axis((state[0], state[1], state[2], state[3])), (state[4], state[5], state[6]))

    def increment(par, rule, state, carry, h):  # type: ignore[no-untyped-def]
        top, cut = _rounded(number, par), Substeps(rule.parts, number(rule.share))
        q = number(state[0]), number(state[1]), number(state[2]), number(state[3])
        v = number(state[4]), number(state[5]), number(state[6])
        p, v, carry = step(top, cut, axis(q), v, carry, number(h))
        q = normalised(top, product(p, q))
        dstate = (
            double(q[0]) - state[0], double(q[1]) - state[1], double(q[2]) - state[2], double(q[3]) - state[3],
            double(v[0]) - state[4], double(v[1]) - state[5], double(v[2]) - state[6],
        )  # fmt: skip
        total = dstate[0] + dstate[1] + dstate[2] + dstate[3] + dstate[4] + dstate[5] + dstate[6]
        return dstate, carry, 1, finite_outcome(total)

    return driver(begin, increment, carried.observe["attitude"], _enter, carried.present["attitude"])


class Substeps(NamedTuple):
    """How many equal parts an engine cuts a step into, and the share of each."""

    parts: int = 1
    share: float = 1.0
