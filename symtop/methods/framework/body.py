"""The chart `body` for kernels: state (q, M) of a rigid body with any three moments. Nothing is singular.

    q' = q omega/2,     M' = M x omega + Gamma x c,     omega = (M1/I1, M2/I2, M3/I3),     Gamma = q* k q

q turns body vectors into space vectors, M is the angular momentum in body axes (`symtop.model.body`). f is quadratic in
the state. |q| stays one only as far as a method keeps it; p_phi = L_z = M.Gamma is read off the state.

Seen from the body, space turns by q*, and Gamma takes the place of a top's axis, M that of its L:

    Gamma' = w x Gamma,     M' = w x M + f x Gamma,     w = -omega,   f = -c,     (q*)' = w q*/2

are the equations of (e, L) with another element (w, f) of se(3). So a kernel on (q, L) of a top that makes its step of
e and L alone also steps (q*, M) of a body (`turned`); if it keeps L.e of a top, it keeps p_phi of a body.
"""

from typing import Any, NamedTuple

from symtop.core.jit import register_jitable
from symtop.methods.framework.preparation import Preparation, Presentation
from symtop.methods.framework.space import L_at, observe_attitude, q_at
from symtop.methods.vectors import rotated
from symtop.model.body import vertical


class General(NamedTuple):
    """The numbers of a body: the reciprocals of its moments, the moments, and c = mgl chi."""

    a1: float
    a2: float
    a3: float
    I1: float
    I2: float
    I3: float
    c1: float
    c2: float
    c3: float


class Pose(NamedTuple):
    """A start: quaternion and momentum in body axes."""

    w: float
    x: float
    y: float
    z: float
    M1: float
    M2: float
    M3: float


@register_jitable
def unpack_body(row: Any) -> Any:
    """A body and a start, from their 14 numbers."""
    I1, I2, I3, mgl, x, y, z = row[:7]
    body = General(1.0 / I1, 1.0 / I2, 1.0 / I3, I1, I2, I3, mgl * x, mgl * y, mgl * z)
    w, x, y, z, w1, w2, w3 = row[7:]
    return body, Pose(w, x, y, z, I1 * w1, I2 * w2, I3 * w3)


@register_jitable
def _momenta(body: Any, at: Any) -> Any:
    """L_z and M3."""
    g1, g2, g3 = vertical(at.w, at.x, at.y, at.z)
    return at.M1 * g1 + at.M2 * g2 + at.M3 * g3, at.M3


def _prepare_top(top: Any, at: Any) -> Any:
    w, x, y, z = q_at(at)
    a1, a3 = 1.0 / top.I1, 1.0 / top.I3
    body = General(a1, a1, a3, top.I1, top.I1, top.I3, 0.0, 0.0, top.mgl)
    return body, (w, x, y, z, *rotated((w, -x, -y, -z), L_at(top, at)))


def _momentum_in_space(par: Any, t: float, y: Any) -> Any:
    q = y[0], y[1], y[2], y[3]
    return (*q, *rotated(q, (y[4], y[5], y[6])))


of_top, in_space = Preparation(_prepare_top, 7), Presentation(_momentum_in_space, 7)  # a top as (q, M), shown as (q, L)


def prepared(numbers: Any) -> Preparation:
    """The preparation of a kernel with seven numbers in its state: ``numbers(body, start)``, `General` and `Pose`."""
    return Preparation(numbers, 7, unpack=unpack_body, momenta=_momenta, given=14)


on_body = prepared(lambda body, at: (body, (at.w, at.x, at.y, at.z, at.M1, at.M2, at.M3)))
turned = prepared(lambda body, at: (body, (at.w, -at.x, -at.y, -at.z, at.M1, at.M2, at.M3)))
turned_back = Presentation(lambda _par, _t, y: (y[0], -y[1], -y[2], -y[3], y[4], y[5], y[6]), 7)


@register_jitable
def torque(par: Any, g1: Any, g2: Any, g3: Any) -> Any:
    """Gamma x c."""
    return g2 * par.c3 - g3 * par.c2, g3 * par.c1 - g1 * par.c3, g1 * par.c2 - g2 * par.c1


@register_jitable
def field_body(par: Any, y: Any) -> Any:
    """Time derivative of (q, M)."""
    w, x, y1, z, M1, M2, M3 = y[0], y[1], y[2], y[3], y[4], y[5], y[6]
    w1, w2, w3 = par.a1 * M1, par.a2 * M2, par.a3 * M3
    h1, h2, h3 = 0.5 * w1, 0.5 * w2, 0.5 * w3
    t1, t2, t3 = torque(par, *vertical(w, x, y1, z))
    return (
        -(x * h1 + y1 * h2 + z * h3), w * h1 + y1 * h3 - z * h2,
        w * h2 - x * h3 + z * h1, w * h3 + x * h2 - y1 * h1,
        M2 * w3 - M3 * w2 + t1, M3 * w1 - M1 * w3 + t2, M1 * w2 - M2 * w1 + t3,
    )  # fmt: skip


def observe_body(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """L_z and M3 after the step."""
    M1, M2, M3 = before[4] + dstate[4], before[5] + dstate[5], before[6] + dstate[6]
    g1, g2, g3 = vertical(before[0] + dstate[0], before[1] + dstate[1], before[2] + dstate[2], before[3] + dstate[3])
    return M1 * g1 + M2 * g2 + M3 * g3, M3


def observe_turned(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """L_z and M3 after a step of (q*, M), where M3 stands in the place of L_z, and M.Gamma in that of L.e."""
    M3, L_z = observe_attitude(par, rule, before, dstate, h)
    return L_z, M3
