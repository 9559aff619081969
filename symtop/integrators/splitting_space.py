"""Splitting on the axis (e, L) and on the attitude (q, L): gravity kicks between exact free rotations, no pole anywhere.

    kick(b h):   L += b h mgl (-e_y, e_x, 0),  with a gradient c:  b mgl -> b mgl - 2 c h^2 mgl^2 e_z / I1
    drift(a h):  e <- R e,  q <- r q,  R the rotation about L by the angle a h |L| / I1 and r its quaternion

The drift is the exact free symmetric top, so what is left of the error is gravity's: in a fast top it is 100 times
smaller than Stormer-Verlet's. The body's own spin ``q <- q exp(twist h k/2)`` commutes with every r and leaves e alone;
it is exact for any time and is therefore added where a sample is shown, not in the step. Both halves are flows on
T*SU(2), so any composition is symplectic there and Lie-Poisson in (e, L); L_z is not touched by either and L.e by
rounding alone. {V, {V, {V, T}}} = 0 (T is quadratic in L), so Runge-Kutta-Nystrom tables apply, and
{V, {V, T}} = mgl^2 sin^2(theta) / I1 is the force gradient.

With v = s L and w the quaternion of half the angle x = (a h/2 I1) |L|, s = sin(x)/|L| and w = 1 + m:

    dq = s L q + m q,       de = 2 s (w L x e + s L x (L x e)),       exact: m = cos(x) - 1,  Cayley below

No increment is a difference of large numbers. A *Cayley* drift has s = tau/sqrt(1 + tau^2 L^2), w = 1/sqrt(1 + tau^2 L^2)
instead, tau = h/2 I1: a rotation about L by a nearby angle that depends on |L| only, so symplectic too. Kick-drift-kick
with it is an integrable map, that of the discrete Lagrange top, and keeps `cayley_energy` at every step size.
It must not be confused with a Cayley *parametrisation* of an implicit method.

Takahashi and Imada's kick (total gradient coefficient -1/24) makes kick-drift-kick conjugate to order 4 through the
processor exp(k h^2 (mgl/I1) G), k = 1/12, G = L.(e x z): the start is mapped once and each sample is mapped back. The
flow of G is elementary: with D = cosh(s) + e_z sinh(s) and h for horizontal,

    e_h -> e_h / D,   e_z -> (e_z cosh(s) + sinh(s)) / D,   L_h -> D L_h - sinh(s) L_z e_h,   L_z, L.e fixed
    q -> (w e^(s/2), x e^(-s/2), y e^(-s/2), z e^(s/2)) / sqrt(D)

Sources: McLachlan, Zanna, Found. Comput. Math. 5 (2005) 87 (splitting); Bobenko, Suris, Commun. Math. Phys. 204 (1999)
147 (Cayley); Takahashi, Imada, J. Phys. Soc. Japan 53 (1984) 3765; Blanes, Casas, Ros, SIAM J. Sci. Comput. 21 (1999)
711 (processing).
"""

from typing import Any

import numpy as np

from symtop.integrators.compiled import register_jitable
from symtop.integrators.drive import driver
from symtop.integrators.space import finite_outcome, observe_attitude, observe_axis
from symtop.integrators.splitting_loop import compose


@register_jitable
def rotor(par: Any, rule: Any, Lx: float, Ly: float, Lz: float, tau: float) -> Any:
    """s and m: the rotation about L for a time tau has the quaternion (1 + m, s L)."""
    half = 0.5 * tau / par.I1
    if rule.cayley != 0.0:
        half *= rule.cayley
        square = half * half * (Lx * Lx + Ly * Ly + Lz * Lz)
        root = np.sqrt(1.0 + square)
        return half / root, -square / (root * (1.0 + root))
    square = half * half * (Lx * Lx + Ly * Ly + Lz * Lz)
    x = np.sqrt(square + 1e-300)
    sin, cos = np.sin(0.5 * x), np.cos(0.5 * x)
    return half * (2.0 * sin * cos / x), -2.0 * sin * sin


@register_jitable
def kicked(par: Any, force: Any, tau: float, bend: float) -> Any:
    """Increments of L_x and L_y by gravity in a time tau."""
    x, y, z = force
    strength = par.mgl * (tau - 2.0 * bend * par.mgl * z / par.I1)
    return -strength * y, strength * x


# ---- the axis --------------------------------------------------------------------------------------------------------


@register_jitable
def force_axis(par: Any, state: Any, step: Any) -> Any:  # noqa: ARG001
    """The present axis: what a kick needs."""
    return state[0] + step[0], state[1] + step[1], state[2] + step[2]


@register_jitable
def kick_axis(par: Any, force: Any, step: Any, tau: float, bend: float) -> Any:
    """Flow of gravity for a time tau."""
    x, y = kicked(par, force, tau, bend)
    return step[0], step[1], step[2], step[3] + x, step[4] + y, step[5]


@register_jitable
def drift_axis(par: Any, rule: Any, state: Any, step: Any, tau: float) -> Any:
    """Free rotation for a time tau."""
    x, y, z = force_axis(par, state, step)
    Lx, Ly, Lz = state[3] + step[3], state[4] + step[4], state[5] + step[5]
    s, m = rotor(par, rule, Lx, Ly, Lz, tau)
    w = 1.0 + m
    cx, cy, cz = Ly * z - Lz * y, Lz * x - Lx * z, Lx * y - Ly * x
    twice = 2.0 * s
    return (
        step[0] + twice * (w * cx + s * (Ly * cz - Lz * cy)),
        step[1] + twice * (w * cy + s * (Lz * cx - Lx * cz)),
        step[2] + twice * (w * cz + s * (Lx * cy - Ly * cx)),
        step[3],
        step[4],
        step[5],
    )


def begin_axis(par: Any, rule: Any, state: Any, h: float) -> Any:
    """The axis at the start."""
    return force_axis(par, state, (0.0, 0.0, 0.0))


def increment_axis(par: Any, rule: Any, state: Any, carry: Any, h: float) -> Any:
    """One step on (e, L); the work counted is the number of kicks with a new axis."""
    step, axis = compose(force_axis, kick_axis, drift_axis, par, rule, state, carry, h)
    return step, axis, rule.forces, finite_outcome(step[0] + step[1] + step[2] + step[3] + step[4])


@register_jitable
def process_axis(s: float, x: float, y: float, z: float, Lx: float, Ly: float, Lz: float) -> Any:
    """Flow of G = L.(e x z) for a time s."""
    c, d = np.cosh(s), np.sinh(s)
    D = c + z * d
    return x / D, y / D, (z * c + d) / D, D * Lx - d * Lz * x, D * Ly - d * Lz * y, Lz


def enter_axis(par: Any, rule: Any, state: Any, h: float) -> Any:
    """The start in the variables of a processed method."""
    if rule.processor == 0.0:
        return state
    return process_axis(rule.processor * h * h * par.mgl / par.I1, *state)


def present_axis(par: Any, rule: Any, state: Any, k: int, h: float) -> Any:
    """Back from the variables of a processed method."""
    if rule.processor == 0.0:
        return state
    return process_axis(-rule.processor * h * h * par.mgl / par.I1, *state)


# ---- the attitude ----------------------------------------------------------------------------------------------------


@register_jitable
def axis_of(w: float, x: float, y: float, z: float) -> Any:
    """The axis of a quaternion."""
    return 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w - x * x - y * y + z * z


@register_jitable
def force_attitude(par: Any, state: Any, step: Any) -> Any:  # noqa: ARG001
    """The present axis: what a kick needs."""
    return axis_of(state[0] + step[0], state[1] + step[1], state[2] + step[2], state[3] + step[3])


@register_jitable
def kick_attitude(par: Any, force: Any, step: Any, tau: float, bend: float) -> Any:
    """Flow of gravity for a time tau."""
    x, y = kicked(par, force, tau, bend)
    return step[0], step[1], step[2], step[3], step[4] + x, step[5] + y, step[6]


@register_jitable
def drift_attitude(par: Any, rule: Any, state: Any, step: Any, tau: float) -> Any:
    """Free rotation for a time tau, without the spin about the body's axis."""
    w, x, y, z = state[0] + step[0], state[1] + step[1], state[2] + step[2], state[3] + step[3]
    Lx, Ly, Lz = state[4] + step[4], state[5] + step[5], state[6] + step[6]
    s, m = rotor(par, rule, Lx, Ly, Lz, tau)
    return (
        step[0] + (m * w - s * (Lx * x + Ly * y + Lz * z)),
        step[1] + (m * x + s * (Lx * w + Ly * z - Lz * y)),
        step[2] + (m * y + s * (Ly * w + Lz * x - Lx * z)),
        step[3] + (m * z + s * (Lz * w + Lx * y - Ly * x)),
        step[4],
        step[5],
        step[6],
    )


def begin_attitude(par: Any, rule: Any, state: Any, h: float) -> Any:
    """The axis at the start."""
    return force_attitude(par, state, (0.0, 0.0, 0.0, 0.0))


def increment_attitude(par: Any, rule: Any, state: Any, carry: Any, h: float) -> Any:
    """One step on (q, L); the work counted is the number of kicks with a new axis."""
    step, axis = compose(force_attitude, kick_attitude, drift_attitude, par, rule, state, carry, h)
    return step, axis, rule.forces, finite_outcome(step[0] + step[1] + step[2] + step[3] + step[4] + step[5])


@register_jitable
def process_attitude(s: float, w: float, x: float, y: float, z: float, Lx: float, Ly: float, Lz: float) -> Any:
    """Flow of G = L.(e x z) for a time s; phi and psi do not move."""
    ex, ey, ez = axis_of(w, x, y, z)
    c, d = np.cosh(s), np.sinh(s)
    D = c + ez * d
    up = np.exp(0.5 * s) / np.sqrt(D)
    down = np.exp(-0.5 * s) / np.sqrt(D)
    return up * w, down * x, down * y, up * z, D * Lx - d * Lz * ex, D * Ly - d * Lz * ey, Lz


def enter_attitude(par: Any, rule: Any, state: Any, h: float) -> Any:
    """The start in the variables of a processed method."""
    if rule.processor == 0.0:
        return state
    return process_attitude(rule.processor * h * h * par.mgl / par.I1, *state)


def present_attitude(par: Any, rule: Any, state: Any, k: int, h: float) -> Any:
    """The spin since the start, and back from the variables of a processed method."""
    if rule.processor != 0.0:
        state = process_attitude(-rule.processor * h * h * par.mgl / par.I1, *state)
    w, x, y, z, Lx, Ly, Lz = state
    half = 0.5 * par.twist * (k * h)
    c, s = np.cos(half), np.sin(half)
    return w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s, Lx, Ly, Lz


march_axis = driver(begin_axis, increment_axis, observe_axis, enter_axis, present_axis)
march_attitude = driver(begin_attitude, increment_attitude, observe_attitude, enter_attitude, present_attitude)
