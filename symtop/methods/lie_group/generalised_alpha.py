"""The generalised-alpha method on the rotation group, the integrator of flexible multibody codes.

    R_1 = R_0 exp(h W_0 + h^2 (1/2 - beta) a_0 + h^2 beta a_1),      W_1 = W_0 + h (1 - gamma) a_0 + h gamma a_1,
    (1 - alpha_m) a_1 + alpha_m a_0 = (1 - alpha_f) W'_1 + alpha_f W'_0,       J W' = R^T tau - W x J W,

W in body axes. The numbers follow from one, the spectral radius r for infinitely stiff springs, 0 <= r <= 1,

    alpha_m = (2 r - 1)/(r + 1),   alpha_f = r/(r + 1),   gamma = 1/2 + alpha_f - alpha_m,   beta = (gamma + 1/2)^2/4,

which make the method of order 2 and damp what a step does not resolve. A rigid top has nothing to damp; the energy and
p_phi are lost all the same. W' has no part along the axis of the body and so a has none: p_psi is kept. a and W' are
carried from step to step, in axes that turn with the body, and a starts as W': a step is no map of (q, L) alone,
neither symplectic nor symmetric. Newton's iteration for W'_1 leaves out the derivative of gravity, which is of order
h^2, and stops where the correction no longer falls.
Sources: Bruls, Cardona, Arnold, Mech. Mach. Theory 48 (2012) 121; Chung, Hulbert, J. Appl. Mech. 60 (1993) 371.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from symtop.core.errors import SymtopError, finite
from symtop.core.jit import register_jitable
from symtop.methods.framework.plan import NOT_CONVERGED, OK
from symtop.methods.framework.registry import Integrator
from symtop.methods.framework.space import axis_of
from symtop.methods.lie_group.loop import SPUN, gravity, in_both_charts, inertia, iterated, lie_loop, moved
from symtop.methods.splitting.rotor import EXACT, near, rotor
from symtop.methods.vectors import cross, plus, scaled, solve3

MOST = 50  # iterations of a step; 4 to 6 are the rule
ENOUGH = 1e-14  # a correction of W', relative to its parts, that is rounding


class Alpha(NamedTuple):
    """The numbers of one spectral radius."""

    m: float
    f: float
    gamma: float
    beta: float
    turn: float = float(EXACT)  # what `rotor` asks of a rule
    shares: tuple[float, ...] = (1.0,)


@register_jitable
def _rates(par: Any, e: Any, x: Any) -> Any:
    """J^-1 x."""
    along = (x[0] * e[0] + x[1] * e[1] + x[2] * e[2]) * (1.0 / par.I3 - 1.0 / par.I1)
    return plus(scaled(1.0 / par.I1, x), along, e)


@register_jitable
def _initial(par: Any, state: Any) -> Any:
    """W' of the start, in space."""
    e = axis_of(state[0], state[1], state[2], state[3])
    w = _rates(par, e, (state[4], state[5], state[6]))
    return _rates(par, e, plus(gravity(par, e), -1.0, cross(w, inertia(par, e, w))))


def _begin(par: Any, rule: Any, state: Any, h: float) -> Any:
    """a and W' of the start, in space."""
    carry, change = np.empty(6), _initial(par, state)
    for k in range(3):
        carry[k] = carry[3 + k] = change[k]
    return carry


@register_jitable
def _known(rule: Any, a: Any, before: Any) -> Any:
    """What a_1 has beside W'_1, and the share that it has of that."""
    share = 1.0 / (1.0 - rule.m)
    return scaled(share, plus(scaled(rule.f, before), -rule.m, a)), share * (1.0 - rule.f)


@register_jitable
def _ahead(rule: Any, w: Any, a: Any, known: Any, share: float, h: float, slope: Any) -> Any:
    """a_1, the rotation vector and the gain of W that follow from W'_1, and the square of half the angle."""
    b = plus(known, share, slope)
    angle = scaled(h, plus(plus(w, h * (0.5 - rule.beta), a), h * rule.beta, b))
    gain = plus(scaled(h * (1.0 - rule.gamma), a), h * rule.gamma, b)
    return b, angle, gain, 0.25 * (angle[0] * angle[0] + angle[1] * angle[1] + angle[2] * angle[2])


@register_jitable
def _corrected(par: Any, e: Any, w: Any, m: float, v: Any, gain: Any, by: float, slope: Any, last: float) -> Any:
    """The next W'_1, the size of its correction, and whether it is the last, after a correction of size `last`."""
    rate = plus(w, 1.0, gain)
    torque = gravity(par, plus(e, 1.0, moved(m, v, e)))
    torque = plus(torque, 1.0, moved(m, scaled(-1.0, v), torque))
    J = inertia(par, e, rate)
    rest = plus(plus(torque, -1.0, cross(rate, J)), -1.0, inertia(par, e, slope))
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    Jx, Jy, Jz = inertia(par, e, x), inertia(par, e, y), inertia(par, e, z)
    change = solve3(
        plus(Jx, by, plus(cross(x, J), 1.0, cross(rate, Jx))),
        plus(Jy, by, plus(cross(y, J), 1.0, cross(rate, Jy))),
        plus(Jz, by, plus(cross(z, J), 1.0, cross(rate, Jz))),
        rest,
    )
    size = abs(change[0]) + abs(change[1]) + abs(change[2])
    scale = abs(par.mgl) / par.I1 + rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2]
    ended = size <= ENOUGH * scale or (size >= last and size <= 1e-10 * scale)
    return plus(slope, 1.0, change), size, ended


@register_jitable
def _ended(par: Any, e: Any, w: Any, m: float, v: Any, gain: Any, b: Any, slope: Any) -> Any:
    """The change of L, and a and W' of the next step in the axes that the rotation leads to."""
    b, after = plus(b, 1.0, moved(m, v, b)), plus(slope, 1.0, moved(m, v, slope))
    J = inertia(par, e, plus(w, 1.0, gain))
    return plus(inertia(par, e, gain), 1.0, moved(m, v, J)), b, after


def turn(par: Any, rule: Any, e: Any, L: Any, carry: Any, h: float) -> Any:
    """One step, in the body's axes of its start; the work counted is the number of iterations."""
    a, before = (carry[0], carry[1], carry[2]), (carry[3], carry[4], carry[5])
    w = _rates(par, e, L)
    known, share = _known(rule, a, before)
    slope, last = before, math.inf
    for k in range(MOST):
        b, angle, gain, square = _ahead(rule, w, a, known, share, h, slope)
        s, m = rotor(rule, square, 0.5)
        v = scaled(s, angle)
        slope, last, ended = _corrected(par, e, w, m, v, gain, h * rule.gamma * share, slope, last)
        if ended:
            dL, b, after = _ended(par, e, w, m, v, gain, b, slope)
            for i in range(3):
                carry[i], carry[3 + i] = b[i], after[i]
            return m, v, dL, k + 1, OK
    return 0.0, a, a, MOST, NOT_CONVERGED


# ---- in lanes: x is W'_1, the size of its last correction, and W'_1 before that, which the rotation is made of -------


def _carried(par: Any, rule: Any, state: Any, h: float) -> Any:
    change = _initial(par, state)
    return (*change, *change)


def _numbers(rule: Any) -> Any:
    return rule.m, rule.f, rule.gamma, rule.beta


@register_jitable
def _rule(numbers: Any) -> Alpha:
    return Alpha(numbers[0], numbers[1], numbers[2], numbers[3], float(EXACT), (1.0,))


@register_jitable
def _near(numbers: Any, carry: Any, h: float, opened: Any, slope: Any) -> Any:
    """a_1, the rotation of an angle below 2, the gain, by how much W'_1 enters it, and is the angle below 2."""
    rule = _rule(numbers)
    known, share = _known(rule, carry[:3], carry[3:])
    b, angle, gain, square = _ahead(rule, opened[3:], carry[:3], known, share, h, slope)
    s, m = near(square, 0.5)
    return b, m, scaled(s, angle), gain, h * rule.gamma * share, square < 1.0


def _start(par: Any, numbers: Any, e: Any, L: Any, carry: Any, h: float) -> Any:
    before = carry[3:]
    return (*e, *_rates(par, e, L)), (*before, math.inf, *before)


def _again(par: Any, numbers: Any, carry: Any, h: float, opened: Any, x: Any) -> Any:
    slope = x[:3]
    _, m, v, gain, by, is_near = _near(numbers, carry, h, opened, slope)
    after, size, ended = _corrected(par, opened[:3], opened[3:], m, v, gain, by, slope, x[3])
    return (*after, size, *slope), ended, not is_near


def _close(par: Any, numbers: Any, carry: Any, h: float, opened: Any, x: Any) -> Any:
    b, m, v, gain, _, _ = _near(numbers, carry, h, opened, x[4:])
    dL, b, after = _ended(par, opened[:3], opened[3:], m, v, gain, b, x[:3])
    return m, v, dL, (*b, *after)


_LANES = iterated(
    _start, _again, _close, MOST, opened=6, unknowns=7, numbers=_numbers, count=4, begin=_carried, carry=6
)
march = lie_loop(turn, _begin, lambda _: _LANES)


def generalised_alpha(name: str, spectral_radius: float, *, summary: str = "") -> Integrator:
    """The method of a spectral radius from 0 (annihilates what is not resolved) to 1; SymtopError beyond."""
    r = finite("spectral_radius", spectral_radius)
    if not 0.0 <= r <= 1.0:
        raise SymtopError(f"spectral_radius must be between 0 and 1, not {r!r}")
    m, f = (2.0 * r - 1.0) / (r + 1.0), r / (r + 1.0)
    gamma = 0.5 + f - m
    rule = Alpha(m, f, gamma, 0.25 * (gamma + 0.5) ** 2)
    return Integrator(
        name=name, family="lie-group", order=2, explicit=False, symplectic=False, symmetric=False,
        summary=summary or f"Lie-group generalised-alpha method of spectral radius {r:g}",
        conserves=frozenset({"p_psi", "axis_length"}),
        solvers=in_both_charts(march, rule, SPUN, 1, implicit=True),
        reference="bruls-cardona-arnold-2012 chung-hulbert-1993", needs="group", general=True,
    )  # fmt: skip


def built_in() -> list[Integrator]:
    """`generalised-alpha`, of spectral radius 0.9."""
    return [generalised_alpha("generalised-alpha", 0.9)]
