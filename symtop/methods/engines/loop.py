"""The loop around the maps of physics engines, and what these are made of: a rigid body in space axes.

An engine steps an orientation and the angular velocity w in space, some the angular momentum L. With I_s = I1 + (I3 -
I1) e e^T, the inertia in space,

    I_s w = I1 w + (I3 - I1) (e.w) e,      I_s^-1 L = L/I1 + (1/I3 - 1/I1) (e.L) e,      tau = mgl k x e,

the right sides of Euler's equations need the axis e alone. So every map whose step commutes with a turn of the body
about its axis is one function, on the axis and on the attitude, that returns the rotation of the step as a quaternion p
in space beside the new v, which is w or L:

    step(par, rule, e, v, carry, h) -> (p, v, carry),      e <- p e p*,  q <- p q/|p q|.

To turn w into L or back in every step would let rounding drift in p_phi or in p_psi, so v is what the engine carries.
The samples are (e, L) and (q, L) as in every space-frame chart. Two rotations are in use. With u = h w/2,

    exponential   p = (cos |u|, u sin |u|/|u|)                    the body turns at the rate w for a time h
    linear        p = (1, u)/sqrt(1 + u.u)                        q + h (0, w) q/2, normalised: the Cayley rotation

Every function works in the precision of its arguments: 0, 1/2 and 1 are fields of `EngineTop`, because a literal of
Python would turn an expression in single precision into one in double. In single precision the result of every
operation of the map is a number of that precision; the loop adds the difference of two such numbers, and its
compensated sum gives the second one exactly. The step is h rounded to single precision, while samples are shown at
multiples of h: a relative 6e-8 in time.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from symtop.core.jit import register_jitable
from symtop.methods.framework.loop import Loop, as_stepped, kernel_loop
from symtop.methods.framework.preparation import Body, Preparation
from symtop.methods.framework.space import (
    axis_parts,
    finite_outcome,
    momentum_parts,
    observe_attitude,
    observe_axis,
    quaternion_parts,
)
from symtop.methods.vectors import cross, dot, plus, product, scaled


class EngineTop(NamedTuple):
    """The numbers of the top in the precision of a map."""

    I1: float
    I3: float
    mgl: float
    zero: float = 0.0
    half: float = 0.5
    one: float = 1.0


def _prepared(place_parts: Callable[..., Any], size: int, *, rates: bool) -> Preparation:
    """A start as (e, L) or (q, L), or with `rates` w for L: the angular momentum of a body whose moments are one."""

    def prepare(top, at):  # type: ignore[no-untyped-def]
        body: Any = Body(1.0, 1.0, 0.0) if rates else Body(top.I1, top.I3, top.mgl)
        v = momentum_parts(math, body, at.theta, at.phi, at.theta_dot, at.phi_dot, at.psi_dot)
        return EngineTop(top.I1, top.I3, top.mgl, 0.0, 0.5, 1.0), (*place_parts(at), *v)

    return Preparation(prepare, size)


@register_jitable
def _axis_of_start(at: Any) -> Any:
    return axis_parts(math, at.theta, at.phi)


@register_jitable
def _quaternion_of_start(at: Any) -> Any:
    return quaternion_parts(math, at.theta, at.phi, at.psi)


@register_jitable
def momentum(par: Any, e: Any, w: Any) -> Any:
    """I_s w."""
    return plus(scaled(par.I1, w), (par.I3 - par.I1) * dot(e, w), e)


@register_jitable
def velocity(par: Any, e: Any, L: Any) -> Any:
    """I_s^-1 L."""
    return plus(scaled(par.one / par.I1, L), (par.one / par.I3 - par.one / par.I1) * dot(e, L), e)


@register_jitable
def torque(par: Any, e: Any) -> Any:
    """Gravity about the fixed point."""
    return -par.mgl * e[1], par.mgl * e[0], par.zero


@register_jitable
def acceleration(par: Any, e: Any, w: Any) -> Any:
    """Euler's equations: I_s^-1 (tau - w x I_s w)."""
    return velocity(par, e, plus(torque(par, e), -par.one, cross(w, momentum(par, e, w))))


@register_jitable
def exponential(par: Any, w: Any, h: Any) -> Any:
    """The rotation by h |w| about w."""
    rate = np.sqrt(dot(w, w))
    x = par.half * h * rate
    s = np.sin(x) / rate if rate > 0 else par.half * h
    return np.cos(x), s * w[0], s * w[1], s * w[2]


@register_jitable
def linear(par: Any, w: Any, h: Any) -> Any:
    """The rotation of q + h (0, w) q/2, normalised."""
    u = scaled(par.half * h, w)
    s = par.one / np.sqrt(par.one + dot(u, u))
    return s, s * u[0], s * u[1], s * u[2]


@register_jitable
def normalised(par: Any, q: Any) -> Any:
    """q/|q|."""
    s = par.one / np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return s * q[0], s * q[1], s * q[2], s * q[3]


@register_jitable
def turned(p: Any, v: Any) -> Any:
    """How far the rotation p moves a vector: p v p* - v."""
    u = p[1], p[2], p[3]
    c = cross(u, v)
    d = plus(cross(u, c), p[0], c)
    return d[0] + d[0], d[1] + d[1], d[2] + d[2]  # doubled by addition, in any precision


@register_jitable
def rotated(par: Any, p: Any, v: Any) -> Any:
    """p v p*."""
    return plus(v, par.one, turned(p, v))


@register_jitable
def axis(q: Any) -> Any:
    """The axis of an attitude, the third column of its matrix."""
    x, y = q[1] * q[3] + q[0] * q[2], q[2] * q[3] - q[0] * q[1]
    return x + x, y + y, q[0] * q[0] - q[1] * q[1] - q[2] * q[2] + q[3] * q[3]


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


def _present_rates_on_axis(par: Any, rule: Any, state: Any, k: int, h: float) -> Any:
    """(e, L) of (e, w)."""
    e = state[0], state[1], state[2]
    return (*e, *momentum(par, e, (state[3], state[4], state[5])))


def _present_rates_on_attitude(par: Any, rule: Any, state: Any, k: int, h: float) -> Any:
    """(q, L) of (q, w)."""
    q = state[0], state[1], state[2], state[3]
    return (*q, *momentum(par, axis(q), (state[4], state[5], state[6])))


class Carried(NamedTuple):
    """What a map carries beside an orientation in a chart: how it starts, is observed and is shown."""

    prepare: Preparation
    observe: Callable[..., Any]
    present: Callable[..., Any] = as_stepped


VELOCITY = {
    "axis": Carried(_prepared(_axis_of_start, 6, rates=True), _observe_rates_on_axis, _present_rates_on_axis),
    "attitude": Carried(
        _prepared(_quaternion_of_start, 7, rates=True), _observe_rates_on_attitude, _present_rates_on_attitude
    ),
}
ANGULAR_MOMENTUM = {
    "axis": Carried(_prepared(_axis_of_start, 6, rates=False), observe_axis),
    "attitude": Carried(_prepared(_quaternion_of_start, 7, rates=False), observe_attitude),
}


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

    return kernel_loop(begin, increment, carried.observe, present=carried.present)


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

    return kernel_loop(begin, increment, carried.observe, present=carried.present)


class Substeps(NamedTuple):
    """How many equal parts an engine cuts a step into, and the share of each."""

    parts: int = 1
    share: float = 1.0
