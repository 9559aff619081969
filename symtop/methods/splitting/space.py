"""Splitting on the axis (e, L) and the attitude (q, L): gravity kicks between exact free rotations, no pole anywhere.

    kick(b h):   L += b h mgl (-e_y, e_x, 0),  with a gradient c:  b mgl -> b mgl - 2 c h^2 mgl^2 e_z / I1
    drift(a h):  e <- R e,  q <- r q,  R the rotation about L by the angle a h |L| / I1 and r its quaternion

The drift is the exact free symmetric top, so what is left of the error is gravity's. The body's own spin ``q <- q
exp(twist h k/2)`` commutes with every r and leaves e alone; it is exact for any time and is therefore added where a
sample is shown, not in the step. Both halves are flows on T*SU(2), so any composition is symplectic there and
Lie-Poisson in (e, L); L_z is not touched by either and L.e by rounding alone. {V, {V, {V, T}}} = 0 (T is quadratic in
L), so Runge-Kutta-Nystrom tables apply, and {V, {V, T}} = mgl^2 sin^2(theta) / I1 is the force gradient.

With x = (a h/2 I1) |L| half the angle, s = sin(x)/|L|, w = cos(x) and m = w - 1, no increment is a difference of
large numbers:

    dq = m q + s L q,       de = 2 s (w L x e + s L x (L x e))

Rounding makes w^2 + s^2 L^2 = 1 + 1e-17, the same in every step of a steady motion, and |e| and |q| would drift. So
each drift adds to its s or m what the length lacks at that moment, a turn about L that leaves L.e alone.

A *Cayley* drift has s = tau/sqrt(1 + tau^2 L^2), w = 1/sqrt(1 + tau^2 L^2) instead, tau = h/2 I1: a rotation about L
by a nearby angle that depends on |L| only, so symplectic too. Kick-drift-kick with it is an integrable map, that of the
discrete Lagrange top, and keeps `cayley_energy` at every step size. It is not a Cayley *parametrisation* of an implicit
method. `cayley-tuned` chooses tau from the start of a run: as a map it is symplectic and reversible for that one tau.

Takahashi and Imada's kick (total gradient coefficient -1/24) makes kick-drift-kick conjugate to order 4 through the
processor exp(k h^2 (mgl/I1) G), k = 1/12, G = L.(e x z): the start is mapped once and each sample is mapped back. The
flow of G for a time s is elementary. With D = cosh(s) + e_z sinh(s) and h for horizontal,

    e_h -> e_h / D,   e_z -> (e_z cosh(s) + sinh(s)) / D,   L_h -> D L_h - sinh(s) L_z e_h,   L_z, L.e fixed
    q -> (w e^(s/2), x e^(-s/2), y e^(-s/2), z e^(s/2)) / sqrt(D)

Sources: Touma, Wisdom, Astron. J. 107 (1994) 1189 (splitting); Bobenko, Suris, Commun. Math. Phys. 204 (1999) 147
(Cayley); Takahashi, Imada, J. Phys. Soc. Japan 53 (1984) 3765; Rowlands, J. Comput. Phys. 97 (1991) 235 (processed).
"""

import math
from typing import Any

import numpy as np

from symtop.core.jit import register_jitable
from symtop.core.jit_functions import shared
from symtop.methods.framework.loop import Loop
from symtop.methods.framework.plan import Array
from symtop.methods.framework.space import SpaceTop, axis_of, finite_outcome, observe_attitude, observe_axis, with_spin
from symtop.methods.splitting.loop import compose, composed, stages
from symtop.methods.splitting.rotor import EXACT, half_square, rotor, without_branch
from symtop.model.charts import View, space_energy
from symtop.model.top import Momenta, SymmetricTop, mean_nutation, nutation_cubic, turning_cosines


def scale(rule: Any, top: Any, at: Any, h: float) -> Any:
    """Drifts in half angles over |L|, kicks in angular momentum."""
    return _scaled(rule, top, h, 1.0)


def tuned(rule: Any, top: Any, at: Any, h: float) -> Any:
    """`scale` of a tuned Cayley drift, which turns by the right mean angle."""
    return _scaled(rule, top, h, tangent_scale(top, at, h))


@register_jitable
def _scaled(rule: Any, top: Any, h: float, stretch: float) -> Any:
    half, kick = 0.5 * h / top.I1 * stretch, h * top.mgl
    return stages(rule, half, kick, 2.0 * h * kick * kick / top.I1, rule.processor * h * kick / top.I1)


@shared
def mean_square_momentum(top: Any, at: Any) -> float:
    """The mean of ``|L|^2 = 2 I1 (E - mgl u) + p_psi^2 (1 - I1/I3)`` over a nutation, to 1e-14."""
    low, high = turning_cosines(top, at)
    excess, beta, a, _ = nutation_cubic(top, at)
    _, rise = mean_nutation(top, at, low, high)
    mean: float = top.I1 * top.I1 * (excess + beta * (math.cos(at.theta) - low) - rise + a * a)
    return mean


@shared
def tangent_scale(top: Any, start: Any, h: float) -> float:
    """tan(x)/x, x = h Lm/2 I1: a Cayley drift with tau = (h/2 I1) times this is exact at Lm, Lm^2 = mean |L|^2."""
    x = 0.5 * h * math.sqrt(mean_square_momentum(top, start)) / top.I1
    return math.tan(x) / x if x != 0.0 else 1.0


def cayley_energy(top: SymmetricTop, h: float, tau: float, axis: Array, momentum: Array) -> Array:
    """What kick-drift-kick with a Cayley drift conserves, of axes and momenta (..., 3), shape (...).

    |L|^2/2 + k u/(2 tau) - k^2 (1 - u^2)/8 with k = h mgl and u = e_z; tau is h/2 I1, times `tangent_scale` if tuned.
    Source: Bobenko and Suris 1999.
    """
    kick, u = h * top.mgl, axis[..., 2]
    square: Array = 0.5 * np.sum(momentum * momentum, axis=-1)
    return square + kick * u / (2.0 * tau) - kick * kick * (1.0 - u) * (1.0 + u) / 8.0


@register_jitable
def kick_space(par: Any, force: Any, step: Any, pull: float, bend: float) -> Any:
    """Flow of gravity: L_x and L_y, the last components but one."""
    x, y, z = force
    strength = pull - bend * z
    return (*step[:-3], step[-3] - strength * y, step[-2] + strength * x, step[-1])


def force_axis(par: Any, state: Any, step: Any) -> Any:
    """The present axis: what a kick needs."""
    return state[0] + step[0], state[1] + step[1], state[2] + step[2]


def turn_axis(state: Any, step: Any, s: float, m: float) -> Any:
    """Rotation about L by the angle of s and m."""
    x, y, z = state[0] + step[0], state[1] + step[1], state[2] + step[2]
    Lx, Ly, Lz = state[3] + step[3], state[4] + step[4], state[5] + step[5]
    w = 1.0 + m
    cx, cy, cz = Ly * z - Lz * y, Lz * x - Lx * z, Lx * y - Ly * x
    twice = 2.0 * s
    r = s * (1.0 - (0.5 * w * w - 0.25) * (1.0 - (x * x + y * y + z * z)))
    return (
        step[0] + twice * (w * cx + r * (Ly * cz - Lz * cy)),
        step[1] + twice * (w * cy + r * (Lz * cx - Lx * cz)),
        step[2] + twice * (w * cz + r * (Lx * cy - Ly * cx)),
        step[3], step[4], step[5],
    )  # fmt: skip


def process_axis(s: float, x: float, y: float, z: float, Lx: float, Ly: float, Lz: float) -> Any:
    """Flow of G = L.(e x z) for a time s."""
    c, d = np.cosh(s), np.sinh(s)
    D = c + z * d
    return x / D, y / D, (z * c + d) / D, D * Lx - d * Lz * x, D * Ly - d * Lz * y, Lz


def force_attitude(par: Any, state: Any, step: Any) -> Any:
    """The present axis."""
    return axis_of(state[0] + step[0], state[1] + step[1], state[2] + step[2], state[3] + step[3])


def turn_attitude(state: Any, step: Any, s: float, m: float) -> Any:
    """Rotation about L by the angle of s and m, without the spin about the body's axis."""
    w, x, y, z = state[0] + step[0], state[1] + step[1], state[2] + step[2], state[3] + step[3]
    Lx, Ly, Lz = state[4] + step[4], state[5] + step[5], state[6] + step[6]
    m += 0.5 * (1.0 + m) * (1.0 - (w * w + x * x + y * y + z * z))
    return (
        step[0] + (m * w - s * (Lx * x + Ly * y + Lz * z)),
        step[1] + (m * x + s * (Lx * w + Ly * z - Lz * y)),
        step[2] + (m * y + s * (Ly * w + Lz * x - Lx * z)),
        step[3] + (m * z + s * (Lz * w + Lx * y - Ly * x)),
        step[4], step[5], step[6],
    )  # fmt: skip


def process_attitude(s: float, w: float, x: float, y: float, z: float, Lx: float, Ly: float, Lz: float) -> Any:
    """Flow of G = L.(e x z) for a time s; phi and psi do not move."""
    ex, ey, ez = axis_of(w, x, y, z)
    c, d = np.cosh(s), np.sinh(s)
    D = c + ez * d
    up = np.exp(0.5 * s) / np.sqrt(D)
    down = np.exp(-0.5 * s) / np.sqrt(D)
    return up * w, down * x, down * y, up * z, D * Lx - d * Lz * ex, D * Ly - d * Lz * ey, Lz


def _loop(force: Any, rotate: Any, process: Any, add_spin: Any, observe: Any, dimension: int) -> Loop:
    """The loop of a chart; `process` is the flow of G, `add_spin` adds the spin to a sample."""
    zeros = (0.0,) * dimension
    for part in (force, rotate, process, add_spin):
        register_jitable(part)

    def outcome(state, step):  # type: ignore[no-untyped-def]
        total = step[0] + step[1]
        for i in range(2, dimension - 1):  # all but L_z
            total += step[i]
        return finite_outcome(total)

    exact, cayley = (
        composed(force, kick_space, drift, outcome, top=SpaceTop, dimension=dimension, carry=3, still=1)
        for drift in without_branch(rotate)
    )

    @register_jitable
    def drift(par, rule, state, step, half):  # type: ignore[no-untyped-def]
        s, m = rotor(rule, half_square(state, step, half), half)
        return rotate(state, step, s, m)

    def begin(par, rule, state, h):  # type: ignore[no-untyped-def]
        return force(par, state, zeros)

    def increment(par, rule, state, carry, h):  # type: ignore[no-untyped-def]
        """The work counted is the number of kicks with a new axis."""
        step, axis = compose(force, kick_space, drift, par, rule, state, carry)
        return step, axis, rule.forces, outcome(state, step)

    def enter(par, rule, state, h):  # type: ignore[no-untyped-def]
        return state if rule.boost == 0.0 else process(rule.boost, *state)

    def present(par, rule, state, k, h):  # type: ignore[no-untyped-def]
        return add_spin(par, state if rule.boost == 0.0 else process(-rule.boost, *state), k * h)

    return Loop(begin, increment, observe, enter, present, lanes=lambda rule: exact if rule.turn == EXACT else cayley)


march_axis = _loop(force_axis, turn_axis, process_axis, lambda _par, state, _t: state, observe_axis, 6)
march_attitude = _loop(force_attitude, turn_attitude, process_attitude, with_spin, observe_attitude, 7)


def strang_energy(view: View, momenta: Momenta, h: float) -> Array:
    """What kick-drift-kick with the exact drift conserves to O(h^4), less the energy: h^2 (V_tt/12 - |grad V|^2/24).

    V_tt = mgl (L_z (L.e) - u |L|^2)/I1^2 is the second derivative of V along free motion, u = e_z, and |grad V|^2 =
    mgl^2 (1 - u^2)/I1. Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, section IX.3.
    """
    top, e, L = view.top, view.axis, view.momentum
    u, square = e[:, 2], np.sum(L * L, axis=1)
    V_tt = top.mgl * (L[:, 2] * np.sum(L * e, axis=1) - u * square) / top.I1**2
    return np.asarray(h * h * (V_tt / 12 - top.mgl**2 * (1.0 - u) * (1.0 + u) / (24 * top.I1)))


def cayley_correction(view: View, momenta: Momenta, h: float) -> Array:
    """What kick-drift-kick with a Cayley drift conserves exactly (`cayley_energy` / I1), less the energy."""
    top, e, L = view.top, view.axis, view.momentum
    return np.asarray(cayley_energy(top, h, 0.5 * h / top.I1, e, L) / top.I1 - space_energy(top, e, L, 0.0))


def strang_sleeps_from(h: float) -> float:
    """The spin w3 from which the upright top of I1 = I3 = mgl = 1 sleeps at a step h: w3 tan(w3 h/4) = h."""
    from scipy.optimize import brentq

    return float(brentq(lambda a: a * math.tan(0.25 * a * h) - h, 1.0, min(2.5, 1.9 * math.pi / h)))


def cayley_sleeps_from(h: float) -> float:
    """`strang_sleeps_from` of a Cayley drift: w3^2 = 4 + h^2."""
    return math.sqrt(4.0 + h * h)
