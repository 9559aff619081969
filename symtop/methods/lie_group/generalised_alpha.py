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
from collections.abc import Callable
from typing import Any, NamedTuple

from symtop.core.errors import SymtopError, finite
from symtop.core.jit import register_jitable
from symtop.methods.framework.registry import Integrator
from symtop.methods.framework.space import axis_of
from symtop.methods.lie_group.loop import SPUN, Parts, gravity, in_charts, inertia, iterated_loop, moved
from symtop.methods.splitting.rotor import exact, near
from symtop.methods.vectors import cross, dot, plus, scaled, solve3

MOST_SWEEPS = 50  # limit on the iterations of a step; 4 to 6 are usual
CONVERGED_CORRECTION = 1e-14  # a correction of W', relative to its parts, that is rounding


class Alpha(NamedTuple):
    """The numbers of one spectral radius."""

    m: float
    f: float
    gamma: float
    beta: float
    shares: tuple[float, ...] = (1.0,)


@register_jitable
def _rates(par: Any, e: Any, x: Any) -> Any:
    """J^-1 x."""
    along = (x[0] * e[0] + x[1] * e[1] + x[2] * e[2]) * (1.0 / par.I3 - 1.0 / par.I1)
    return plus(scaled(1.0 / par.I1, x), along, e)


def _begin(par: Any, rule: Any, state: Any, h: float) -> Any:
    """a and W' of the start, in space."""
    e = axis_of(state[0], state[1], state[2], state[3])
    w = _rates(par, e, (state[4], state[5], state[6]))
    change = _rates(par, e, plus(gravity(par, e), -1.0, cross(w, inertia(par, e, w))))
    return (*change, *change)


@register_jitable
def _correct(par: Any, e: Any, w: Any, m: float, v: Any, gain: Any, factor: float, slope: Any, last: float) -> Any:
    """The next W'_1, the size of its correction, and whether it is the last, after a correction of size `last`."""
    rate = plus(w, 1.0, gain)
    torque = gravity(par, plus(e, 1.0, moved(m, v, e)))
    torque = plus(torque, 1.0, moved(m, scaled(-1.0, v), torque))
    J = inertia(par, e, rate)
    residual = plus(plus(torque, -1.0, cross(rate, J)), -1.0, inertia(par, e, slope))
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    Jx, Jy, Jz = inertia(par, e, x), inertia(par, e, y), inertia(par, e, z)
    change = solve3(
        plus(Jx, factor, plus(cross(x, J), 1.0, cross(rate, Jx))),
        plus(Jy, factor, plus(cross(y, J), 1.0, cross(rate, Jy))),
        plus(Jz, factor, plus(cross(z, J), 1.0, cross(rate, Jz))),
        residual,
    )
    size = abs(change[0]) + abs(change[1]) + abs(change[2])
    scale = abs(par.mgl) / par.I1 + rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2]
    converged = size <= CONVERGED_CORRECTION * scale or (size >= last and size <= 1e-10 * scale)
    return plus(slope, 1.0, change), size, converged


def _parts(rotation: Callable[..., Any], *, alone: bool) -> Parts:
    """The parts of an iteration in the body's axes of the start, with the rotor of any angle, or of one below 2.

    x is W'_1 and the size of its last correction; then, with `alone`, the results of `derive` in the last pass, which
    fit in registers, and in lanes W'_1 before that correction, from which they are computed again.
    """

    @register_jitable
    def derive(rule, carry, h, fixed, slope):  # type: ignore[no-untyped-def]
        """a_1, the rotation and the gain of W that follow from W'_1, its share in a_1, and is the angle below 2."""
        w, a, part = fixed[3:], carry[:3], 1.0 / (1.0 - rule[0])
        base, share = scaled(part, plus(scaled(rule[1], carry[3:]), -rule[0], a)), part * (1.0 - rule[1])
        b = plus(base, share, slope)
        angle = scaled(h, plus(plus(w, h * (0.5 - rule[3]), a), h * rule[3], b))
        square = 0.25 * dot(angle, angle)
        s, m = rotation(square, 0.5)
        return b, m, scaled(s, angle), plus(scaled(h * (1.0 - rule[2]), a), h * rule[2], b), share, square < 1.0

    def start(par, rule, e, L, carry, h):  # type: ignore[no-untyped-def]
        before, room = carry[3:], (0.0,) * 10 if alone else (0.0,) * 3
        return (*e, *_rates(par, e, L)), (*before, math.inf, *room)

    def iterate(par, rule, carry, h, fixed, x):  # type: ignore[no-untyped-def]
        slope = x[:3]
        b, m, v, gain, share, is_near = derive(rule, carry, h, fixed, slope)
        after, size, converged = _correct(par, fixed[:3], fixed[3:], m, v, gain, h * rule[2] * share, slope, x[3])
        tail = (*b, m, *v, *gain) if alone else slope
        return (*after, size, *tail), converged, not (alone or is_near)

    def close(par, rule, carry, h, fixed, x):  # type: ignore[no-untyped-def]
        """The rotation, the change of L, and a and W' of the next step in the axes that the rotation leads to."""
        if alone:
            b, m, v, gain = x[4:7], x[7], x[8:11], x[11:]
        else:
            b, m, v, gain, _, _ = derive(rule, carry, h, fixed, x[4:])
        J = inertia(par, fixed[:3], plus(fixed[3:], 1.0, gain))
        dL = plus(inertia(par, fixed[:3], gain), 1.0, moved(m, v, J))
        return m, v, dL, (*plus(b, 1.0, moved(m, v, b)), *plus(x[:3], 1.0, moved(m, v, x[:3])))

    return start, iterate, close


march = iterated_loop(
    _parts(exact, alone=True), MOST_SWEEPS, in_lanes=_parts(near, alone=False), begin=_begin, opened=6, unknowns=7,
    carry=6,
    count=4, numbers=lambda rule: (rule.m, rule.f, rule.gamma, rule.beta),
)  # fmt: skip


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
        solvers=in_charts(march, rule, SPUN, 1, implicit=True),
        reference="bruls-cardona-arnold-2012 chung-hulbert-1993", needs="group", general=True,
    )  # fmt: skip


def built_in() -> list[Integrator]:
    """`generalised-alpha`, of spectral radius 0.9."""
    return [generalised_alpha("generalised-alpha", 0.9)]
