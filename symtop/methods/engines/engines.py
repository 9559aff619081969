"""The integrators that physics engines ship, as methods of the registry: family ``engine``.

Each of these is the map by which an engine steps a free body with a torque, written anew from its source and run
against it (`make engines`); the top is a body whose centre is fixed, in a torque mgl k x e. An engine that works in
single precision has its map in both precisions, as ``jolt`` and ``jolt-float32``: the first shows the method, the
second the effect of rounding; the second claims no order, as its error has no limit for h -> 0.

*A body in space axes.* An engine steps an orientation and the angular velocity w in space, some the angular momentum L.
With I_s = I1 + (I3 - I1) e e^T, the inertia in space,

    I_s w = I1 w + (I3 - I1) (e.w) e,      I_s^-1 L = L/I1 + (1/I3 - 1/I1) (e.L) e,      tau = mgl k x e,

the right sides of Euler's equations need the axis e alone. So every map whose step commutes with a turn of the body
about its axis is one function, on the axis and on the attitude, that returns the rotation of the step as a quaternion p
in space beside the new v, which is what the engine carries, w or L:

    step(par, e, v, carry, h) -> (p, v, carry),      e <- p e p*,  q <- p q/|p q|.

A *body without symmetry* has I_s = q I q*, and the attitude takes the place of the axis: the same functions, except for
those that contain I_s or the lever (`by_length`), and for two equations solved in closed form, which are three there.

Two rotations are in use. With u = h w/2,

    exponential   p = (cos |u|, u sin |u|/|u|)                    the body turns at the rate w for a time h
    linear        p = (1, u)/sqrt(1 + u.u)                        q + h (0, w) q/2, normalised: the Cayley rotation

Every function works in the precision of its arguments: 0, 1/2 and 1 are fields of `EngineTop`, for a literal of Python
would make it double. The loop's compensated sum gives a rounded state exactly; samples are shown at multiples of h.

*Kicks.* The angular velocity changes first, then the body turns by it: the semi-implicit family. They differ in their
treatment of the gyroscopic term w x I_s w, so that two engines differ on a top and agree on a ball. All evaluate tau
once, at the start of the step. With L = I_s w and [v] x = v x x:

    none        w += h I_s^-1 tau
    explicit    w += h I_s^-1 (tau - w x L)
    implicit    w += h J^-1 (tau - w x L),    J = I + h ([w] I - [I w]) in body axes: one Newton step for the velocity
    rescaled    N = L - h w x L,  w = I_s^-1 N |L|/|N|                        turns L but keeps its length
    projected   (I_s - h [L]) w' = L                                          implicit in w, explicit in L

In body axes the third row of J is (0, 0, I3), so that the spin is kept and two equations are left, I1 x + h (I1 - I3)
w3 e x x = r; the projected form has a closed form too. All are of order 1, but for the first, which leaves out a term
of the equations: it follows the spherical top with I3 := I1, started with the same w, at any step. What `rescaled`
keeps is |L|, not L: in a fast top the axis wanders away from L by (1 - I3/I1)^2 w3^2 h/2 a second, relatively, until
the body lies flat.

*Half kicks*, as in molecular dynamics, where L is what is carried: L += h tau/2 before and after a rotation of order 2,
not the exact one of a free body (`strang` takes that). With w(q, L) = R(q) I^-1 R(q)^T L and n(q) = q/|q|:

    richardson   q1 = n(q + h w q/2);  q2 = n(q + h w q/4), q2 = n(q2 + h w(q2, L) q2/4);  q <- n(2 q2 - q1)
    leapfrog     q_h = q + h w q/4, not normalised;  q <- n(q + h w' q_h/2),  w' = R(q_h) I^-1 A^T (L + h tau/2)
    no squish    exact turns q <- q exp(t (L_k/I_k) b_k) about s1 s2 s3 s2 s1 by h/2, h/2, h, h/2, h/2

The leapfrog is of order 2 with A = R(q_h), as Fincham published it; with A = R(q), as one code has it, of order 1. Each
turn of the last is the flow of one term of the kinetic energy, so that the step is symplectic on (q, L), symmetric and
of order 2; L.e is the momentum of one of the three turns only and wobbles. s3 is the axis of the smallest moment, as
LAMMPS sorts them: the result depends on the choice of the transverse axes of a symmetric body, here by psi.

*SPIRAL* in its leapfrog version, with velocities at whole steps: rates in body axes by half a step of Shu and Osher's
method of three stages, the torque as it stands, q <- q exp(h b/2), and rates by the other half with the new torque. Its
authors call it of order three; the turn is the midpoint's, and the order two.

*Stages* of a Runge-Kutta method in the axes of the start of the step, q_i = q exp(Theta_i) and rates b_i:

    b_i = b + h sum_j a_ij b'_j,      Theta_i = h sum_j a_ij k_j,      k_i = dexp^-1(Theta_i) b_i   (Munthe-Kaas)

k_i = b_i, without dexp^-1, is of order 2 at most on a body that turns about more than one axis, whatever the tableau.
Sources: each engine's own file (`Integrator.reference`); Munthe-Kaas, Appl. Numer. Math. 29 (1999) 115; Fincham, Mol.
Simul. 8 (1992) 165; del Valle and others, Comput. Phys. Commun. 297 (2024) 109077; Miller, Eleftheriou, Pattnaik,
Ndirango, Newns, Martyna, J. Chem. Phys. 116 (2002) 8649.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from symtop.core.jit import by_length, register_jitable, set_item
from symtop.methods.framework.body import prepared
from symtop.methods.framework.loop import FixedStep, Loop, as_stepped, no_carry
from symtop.methods.framework.preparation import BareTop, Preparation
from symtop.methods.framework.registry import ENGINE, Integrator
from symtop.methods.framework.space import L_at, axis_of, e_at, ended_space, observe_attitude, observe_axis, q_at
from symtop.methods.splitting.body import SORTED, five_rotations
from symtop.methods.vectors import conjugate, cross, displaced, dot, plus, rotated, scaled, summed
from symtop.model.body import product
from symtop.model.charts import BODY


class EngineTop(NamedTuple):
    """The numbers of the top in the precision of a map."""

    I1: float
    I3: float
    mgl: float
    zero: float = 0.0
    half: float = 0.5
    one: float = 1.0


class EngineBody(NamedTuple):
    """The numbers of a body without symmetry in the precision of a map."""

    I1: float
    I2: float
    I3: float
    c1: float
    c2: float
    c3: float
    zero: float = 0.0
    half: float = 0.5
    one: float = 1.0


def _prepare_top(place_at: Callable[..., Any], size: int, *, rates: bool) -> Preparation:
    """A start as (e, L) or (q, L), or with `rates` w for L: the angular momentum of a body whose moments are one."""

    def prepare(top, at):  # type: ignore[no-untyped-def]
        body: Any = BareTop(1.0, 1.0, 0.0) if rates else BareTop(top.I1, top.I3, top.mgl)
        return EngineTop(top.I1, top.I3, top.mgl, 0.0, 0.5, 1.0), (*place_at(at), *L_at(body, at))

    return Preparation(prepare, size)


def _prepare_body(*, rates: bool) -> Preparation:
    """`_prepare_top` of a body without symmetry: a start as (q, L), or with `rates` w for L."""

    def prepare(body, at):  # type: ignore[no-untyped-def]
        q, v = (at.w, at.x, at.y, at.z), (at.M1, at.M2, at.M3)
        if rates:
            v = body.a1 * at.M1, body.a2 * at.M2, body.a3 * at.M3
        par = EngineBody(body.I1, body.I2, body.I3, body.c1, body.c2, body.c3, 0.0, 0.5, 1.0)
        return par, (*q, *rotated(q, v))

    return prepared(prepare)


def _body_momentum(par: Any, q: Any, w: Any) -> Any:
    b = rotated(conjugate(q), w)
    return rotated(q, (par.I1 * b[0], par.I2 * b[1], par.I3 * b[2]))


def _body_velocity(par: Any, q: Any, L: Any) -> Any:
    M = rotated(conjugate(q), L)
    return rotated(q, (M[0] / par.I1, M[1] / par.I2, M[2] / par.I3))


# functions of the orientation: of a top its axis, of a body its attitude
momentum = by_length(  # I_s w
    (3, lambda par, e, w: plus(scaled(par.I1, w), (par.I3 - par.I1) * dot(e, w), e)), (4, _body_momentum)
)
velocity = by_length(  # I_s^-1 L
    (3, lambda par, e, L: plus(scaled(par.one / par.I1, L), (par.one / par.I3 - par.one / par.I1) * dot(e, L), e)),
    (4, _body_velocity),
)
pulled = by_length(  # gravity about the fixed point where the vertical is `up`
    (3, lambda par, e, up: scaled(par.mgl, cross(up, e))),
    (4, lambda par, q, up: cross(up, rotated(q, (par.c1, par.c2, par.c3)))),
)
torque = by_length(
    (3, lambda par, e: (-par.mgl * e[1], par.mgl * e[0], par.zero)),
    (4, lambda par, q: pulled(par, q, (par.zero, par.zero, par.one))),
)
oriented = by_length((3, lambda _par, e, p: rotated(p, e)), (4, lambda _par, q, p: product(p, q)))  # after a turn p


@register_jitable
def moment(par: Any, e: Any, w: Any) -> Any:
    """tau - w x I_s w."""
    return plus(torque(par, e), -par.one, cross(w, momentum(par, e, w)))


@register_jitable
def acceleration(par: Any, e: Any, w: Any) -> Any:
    """Euler's equations: I_s^-1 (tau - w x I_s w)."""
    return velocity(par, e, moment(par, e, w))


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


_nothing = register_jitable(lambda _par, _e, _v: 0.0)


ORIENTATION: dict[str, Callable[..., Any]] = {  # from a state, the orientation that a map takes
    "axis": lambda y: y[:3], "attitude": lambda y: axis_of(*y[:4]), BODY: lambda y: y[:4],
}  # fmt: skip
pointing = by_length((3, lambda _par, e: e), (4, lambda _par, q: axis_of(*q)))  # the axis of it


def _observer(chart: str) -> Callable[..., Any]:
    """p_phi = L_z and p_psi = L.e of a state with rates."""
    orientation = register_jitable(ORIENTATION[chart])

    def observe(par, rule, before, dstate, h):  # type: ignore[no-untyped-def]
        y = summed(before, dstate)
        L = momentum(par, orientation(y), y[-3:])
        return L[2], dot(L, pointing(par, orientation(y)))

    return observe


def _presenter(chart: str) -> Callable[..., Any]:
    """`present` of a map that carries rates: the state with L in their place."""
    orientation = register_jitable(ORIENTATION[chart])

    def present(par, rule, state, k, h):  # type: ignore[no-untyped-def]
        return (*state[:-3], *momentum(par, orientation(state), state[-3:]))

    return present


@register_jitable
def _present_in_body(par: Any, rule: Any, state: Any, k: int, h: float) -> Any:
    """`present` of a body: the state with L in the axes of the body."""
    return (*state[:4], *rotated(conjugate(state[:4]), state[4:]))


def _present_momentum_in_body(par: Any, rule: Any, state: Any, k: int, h: float) -> Any:
    w, x, y, z, b1, b2, b3 = _present_in_body(par, rule, state, k, h)
    return w, x, y, z, par.I1 * b1, par.I2 * b2, par.I3 * b3


class MapForm(NamedTuple):
    """The functions of a map's state in a chart: its start, its momenta and its samples."""

    prepare: Preparation
    observe: Callable[..., Any]
    present: Callable[..., Any] = as_stepped


VELOCITY = {
    "axis": MapForm(_prepare_top(e_at, 6, rates=True), _observer("axis"), _presenter("axis")),
    "attitude": MapForm(_prepare_top(q_at, 7, rates=True), _observer("attitude"), _presenter("attitude")),
    BODY: MapForm(_prepare_body(rates=True), _observer(BODY), _present_momentum_in_body),
}
ANGULAR_MOMENTUM = {
    "axis": MapForm(_prepare_top(e_at, 6, rates=False), observe_axis),
    "attitude": MapForm(_prepare_top(q_at, 7, rates=False), observe_attitude),
    BODY: MapForm(_prepare_body(rates=False), observe_attitude, _present_in_body),
}


NONE = (0.0,)  # the rule of a map, which has no numbers; numba cannot type the entries of an empty tuple
RAPIER_SUBSTEPS = 4  # substeps of a step of Rapier


@register_jitable
def _gap(after: Any, before: Any) -> Any:
    """after - before, numbers of any precision and of a state in double, in double."""
    gap = before
    for i in range(len(before)):
        gap = set_item(gap, i, np.float64(after[i]) - before[i])
    return gap


def _axis_moved(par: Any, e: Any, p: Any, start: Any) -> Any:
    x, y, z = displaced(p, e)
    r, s, t = e[0] + x, e[1] + y, e[2] + z
    defect = 0.5 * (1.0 - (r * r + s * s + t * t))  # |e| = 1 to rounding, as engines keep |q|
    return x + defect * r, y + defect * s, z + defect * t


# how far the rotation p moves an axis, in double, or an attitude, from the one in a state
moved = by_length((3, _axis_moved), (4, lambda par, q, p, start: _gap(normalised(par, product(p, q)), start)))


def engine_loop(
    step: Callable[..., Any], chart: str, form: MapForm, first_carry: Callable[..., Any] = _nothing,
    number: Any = np.float64,
) -> Loop:  # fmt: skip
    """The loop around a map; `first_carry` as `Loop.begin`; `number` is its type, single only with a quaternion."""
    orientation, step = register_jitable(ORIENTATION[chart]), register_jitable(step)
    kind: Any = EngineBody if chart == BODY else EngineTop
    numbers, zeros = (number(0.0),) * len(kind._fields), (number(0.0),) * form.prepare.size

    @register_jitable
    def narrow(values, result):  # type: ignore[no-untyped-def]
        for i in range(len(result)):
            result = set_item(result, i, number(values[i]))
        return result

    def begin(par, rule, state, h):  # type: ignore[no-untyped-def]
        return first_carry(par, orientation(state), state[-3:])

    def increment(par, rule, state, carry, h):  # type: ignore[no-untyped-def]
        params, y = kind(*narrow(par, numbers)), narrow(state, zeros)
        p, v, carry = step(params, orientation(y), y[-3:], carry, number(h))
        dstate = (*moved(params, y[:-3], p, state[:-3]), *_gap(v, state[-3:]))
        return dstate, carry, 1, ended_space(dstate)

    return Loop(begin, increment, form.observe, present=form.present)


@register_jitable
def _with_torque(par: Any, e: Any, w: Any, h: Any) -> Any:
    """w + h I_s^-1 tau."""
    return plus(w, h, velocity(par, e, torque(par, e)))


@register_jitable
def _solve(par: Any, h: Any, columns: Any, y: Any) -> Any:
    """x of (I + h A) x = y, the columns of A as vectors."""
    a, b, c = columns
    a, b = plus((par.I1, par.zero, par.zero), h, a), plus((par.zero, par.I2, par.zero), h, b)
    c = h * c[0], h * c[1], par.I3 + h * c[2]
    bc, ca, ab = cross(b, c), cross(c, a), cross(a, b)
    return scaled(par.one / dot(a, bc), (dot(bc, y), dot(ca, y), dot(ab, y)))


@register_jitable
def _columns(par: Any, u: Any, v: Any) -> Any:
    """The columns (I_k u + v) x b_k."""
    x, y, z = plus(v, par.I1, u), plus(v, par.I2, u), plus(v, par.I3, u)
    return (par.zero, x[2], -x[1]), (-y[2], par.zero, y[0]), (z[1], -z[0], par.zero)


def _body_implicit(par: Any, q: Any, w: Any, r: Any, h: Any) -> Any:
    back = conjugate(q)
    b = rotated(back, w)
    columns = _columns(par, b, (-par.I1 * b[0], -par.I2 * b[1], -par.I3 * b[2]))
    return rotated(q, _solve(par, h, columns, rotated(back, r)))


def _top_implicit(par: Any, e: Any, w: Any, r: Any, h: Any) -> Any:
    """r lies across the axis."""
    k = h * (par.I1 - par.I3) * dot(e, w)
    return scaled(par.one / (par.I1 * par.I1 + k * k), plus(scaled(par.I1, r), -k, cross(e, r)))


implicit = by_length((3, _top_implicit), (4, _body_implicit))  # J^-1 r


@register_jitable
def _rescaled(par: Any, e: Any, w: Any, h: Any) -> Any:
    """The gyroscopic term in an explicit step, at the length that L had."""
    L = momentum(par, e, w)
    N = plus(L, -h, cross(w, L))
    square = dot(N, N)
    stretch = np.sqrt(dot(L, L) / square) if square > 0 else par.zero  # a body at rest stays so, as in the engines
    return velocity(par, e, scaled(stretch, N))


def _implicit_then_torque(par: Any, e: Any, w: Any, h: Any) -> Any:
    return _with_torque(par, e, plus(w, -h, implicit(par, e, w, cross(w, momentum(par, e, w)), h)), h)


def _torque_then_rescaled(par: Any, e: Any, w: Any, h: Any) -> Any:
    """|L| kept by a change of w: in single precision I_s^-1 (I_s w) would round w the same way in every step."""
    w = _with_torque(par, e, w, h)
    L = momentum(par, e, w)
    N = plus(L, -h, cross(w, L))
    length = np.sqrt(dot(N, N))
    stretch = np.sqrt(dot(L, L)) / length if length > 0 else par.zero
    return plus(w, par.one, velocity(par, e, plus(scaled(stretch, N), -par.one, L)))


def _top_projected(par: Any, e: Any, L: Any, h: Any) -> Any:
    """w' of (I_s - h [L]) w' = L.

    With L = a + l e and a across the axis: w3' = l (D + h^2 a.a)/(I3 D + h^2 I1 a.a) where D = I1^2 + h^2 l^2, and
    D w_a' = (I1 + h^2 l w3') a + h (l - I1 w3') e x a.
    """
    spin = dot(e, L)
    across = plus(L, -spin, e)
    D, stretch = par.I1 * par.I1 + h * h * spin * spin, h * h * dot(across, across)
    w3 = spin * (D + stretch) / (par.I3 * D + par.I1 * stretch)
    turn = plus(scaled(par.I1 + h * h * spin * w3, across), h * (spin - par.I1 * w3), cross(e, across))
    return plus(scaled(par.one / D, turn), w3, e)


def _body_projected(par: Any, q: Any, L: Any, h: Any) -> Any:
    M = rotated(conjugate(q), L)
    zero = par.zero, par.zero, par.zero
    return rotated(q, _solve(par, h, _columns(par, zero, scaled(-par.one, M)), M))


projected = by_length((3, _top_projected), (4, _body_projected))


def _kicker(rate: Callable[..., Any], turn: Callable[..., Any] = exponential) -> Callable[..., Any]:
    """The map that changes w by ``rate(par, e, w, h)`` and turns the body by the new one."""
    register_jitable(rate)

    def step(par, e, w, carry, h):  # type: ignore[no-untyped-def]
        w = rate(par, e, w, h)
        return turn(par, w, h), w, carry

    return step


def substepped(par: Any, e: Any, w: Any, carry: Any, h: Any) -> Any:
    """Equal parts of the step, the torque's share of each taken once at the start; linear rotations."""
    part = par.half * par.half * h
    pull = scaled(part, velocity(par, e, torque(par, e)))
    p = par.one, par.zero, par.zero, par.zero
    for _ in range(RAPIER_SUBSTEPS):
        w = _rescaled(par, e, plus(w, par.one, pull), part)
        turn = linear(par, w, part)
        e, p = oriented(par, e, turn), product(turn, p)
    return p, w, carry


SMALL_ANGLE = 1e-4  # angle below which 1/12 is the coefficient of dexp^-1 to rounding (the next term is a^2/720)


@register_jitable
def _advance(q: Any, w: Any, factor: Any, h: Any) -> Any:
    """q + h (0, w) over/2."""
    rate = product((0.0, w[0], w[1], w[2]), factor)
    half = 0.5 * h
    return q[0] + half * rate[0], q[1] + half * rate[1], q[2] + half * rate[2], q[3] + half * rate[3]


def richardson(par: Any, e: Any, L: Any, carry: Any, h: Any) -> Any:
    """Half kick, a rotation extrapolated from one and two linear ones, half kick."""
    L = plus(L, 0.5 * h, torque(par, e))
    w = velocity(par, e, L)
    full, half = linear(par, w, h), linear(par, w, 0.5 * h)
    half = product(linear(par, velocity(par, oriented(par, e, half), L), 0.5 * h), half)
    a, b, c, d = half
    p = normalised(par, (2.0 * a - full[0], 2.0 * b - full[1], 2.0 * c - full[2], 2.0 * d - full[3]))
    return p, plus(L, 0.5 * h, torque(par, oriented(par, e, p))), carry


def _leapfrog(*, published: bool) -> Callable[..., Any]:
    """The rotational leapfrog, with the momentum in the body axes of the half step, or of the start of the step."""

    def step(par, e, L, carry, h):  # type: ignore[no-untyped-def]
        one = 1.0, 0.0, 0.0, 0.0
        middle = _advance(one, velocity(par, e, L), one, 0.5 * h)
        L = plus(L, 0.5 * h, torque(par, e))
        turn = normalised(par, middle)
        w = velocity(par, oriented(par, e, turn), L) if published else rotated(turn, velocity(par, e, L))
        p = normalised(par, _advance(one, w, middle, h))
        return p, plus(L, 0.5 * h, torque(par, oriented(par, e, p))), carry

    return step


@register_jitable
def _slope(par: Any, e: Any, p: Any, b: Any) -> Any:
    """b' of rates in the axes of the start, where the body stands p further."""
    up = rotated(conjugate(p), (0.0, 0.0, 1.0))
    net = plus(pulled(par, e, up), -1.0, cross(b, momentum(par, e, b)))
    return velocity(par, e, net)


@register_jitable
def _dexp_inverse(turn: Any, b: Any) -> Any:
    """dexp^-1(turn) b = b + turn x b/2 + c turn x (turn x b), c = (1 - (a/2) cot(a/2))/a^2, a = |turn|."""
    square = dot(turn, turn)
    a = np.sqrt(square)
    c = (1.0 - 0.5 * a / np.tan(0.5 * a)) / square if a > SMALL_ANGLE else 1.0 / 12.0
    bracket = cross(turn, b)
    return plus(plus(b, 0.5, bracket), c, cross(turn, bracket))


def _kutta(*, munthe_kaas: bool) -> Callable[..., Any]:
    """Kutta's classical tableau; the stages' turns are those of Munthe-Kaas (order 4), or the rates (order 2)."""

    def step(par, e, b, carry, h):  # type: ignore[no-untyped-def]
        turns = total = scaled(0.0, b)
        rates, slopes, gain = b, total, total
        for i in range(4):
            node = 0.0 if i == 0 else h if i == 3 else 0.5 * h
            weight = h / 3.0 if 0 < i < 3 else h / 6.0
            turn = scaled(node, turns)
            rates = plus(b, node, slopes)
            slopes = _slope(par, e, exponential(par, turn, 1.0), rates)
            turns = _dexp_inverse(turn, rates) if munthe_kaas else rates
            total, gain = plus(total, weight, turns), plus(gain, weight, slopes)
        p = exponential(par, total, 1.0)
        return p, rotated(p, plus(b, 1.0, gain)), carry

    return step


@register_jitable
def _three_stages(par: Any, e: Any, b: Any, h: Any) -> Any:
    """b after a time h by Shu and Osher's method, in the axes of the body, which stands still."""
    first = scaled(h, acceleration(par, e, b))
    second = scaled(h, acceleration(par, e, plus(b, 1.0, first)))
    total = plus(first, 1.0, second)
    third = scaled(h, acceleration(par, e, plus(b, 0.25, total)))
    return plus(b, 1.0 / 6.0, plus(total, 4.0, third))


def spiral(par: Any, e: Any, w: Any, carry: Any, h: Any) -> Any:
    """Half a step of the rates, a turn by them, which does not change them in body or space axes, the other half."""
    w = _three_stages(par, e, w, 0.5 * h)
    p = exponential(par, w, h)
    return p, _three_stages(par, oriented(par, e, p), w, 0.5 * h), carry


def explicit_euler(par: Any, e: Any, w: Any, carry: Any, h: Any) -> Any:
    """Attitude and body rates both from the start of the step; a linear rotation."""
    p = linear(par, w, h)
    return p, rotated(p, plus(w, h, acceleration(par, e, w))), carry


def adams_bashforth(par: Any, e: Any, w: Any, carry: Any, h: Any) -> Any:
    """Rates by Adams and Bashforth, the attitude by Magnus; `carry` is the last acceleration, turned with the body."""
    slope = acceleration(par, e, w)
    p = exponential(par, plus(plus(w, 0.5 * h, slope), h * h / 12.0, cross(slope, w)), h)
    w = plus(plus(w, 1.5 * h, slope), -0.5 * h, carry)
    return p, rotated(p, w), rotated(p, slope)


def _turn(k: int) -> Callable[..., Any]:
    """The turn about axis k of the body, with L in body axes."""
    a, b, c = 1 + k, 1 + (k + 1) % 3, 1 + (k + 2) % 3

    @register_jitable
    def turned(par, q, L, h):  # type: ignore[no-untyped-def]
        x = 0.5 * h * L[k] / (par.I3 if k == 2 else par.I1)
        cos, sin = np.cos(x), np.sin(x)
        C, S = cos * cos - sin * sin, 2.0 * sin * cos
        partial = set_item(set_item(q, 0, q[0] * cos - q[a] * sin), a, q[a] * cos + q[0] * sin)
        new = set_item(set_item(partial, b, q[b] * cos + q[c] * sin), c, q[c] * cos - q[b] * sin)
        i, j = b - 1, c - 1
        return new, set_item(set_item(L, i, C * L[i] + S * L[j]), j, C * L[j] - S * L[i])

    return turned


_first_turn, _second_turn, _third_turn = map(_turn, range(3))


@register_jitable
def _five_turns(outer: Any, inner: Any, par: Any, q: Any, L: Any, h: float) -> Any:
    q, L = outer(par, q, L, 0.5 * h)
    q, L = _second_turn(par, q, L, 0.5 * h)
    q, L = inner(par, q, L, h)
    q, L = _second_turn(par, q, L, 0.5 * h)
    return outer(par, q, L, 0.5 * h)


def _increment_no_squish(par: Any, rule: Any, state: Any, carry: Any, h: float) -> Any:
    """One step on (q, L); the free rotation leaves L in space as it is."""
    q, half = state[:4], 0.5 * h
    kick = scaled(half, torque(par, axis_of(*q)))
    L = rotated(conjugate(q), plus(state[4:], 1.0, kick))
    if par.I3 < par.I1:
        q, L = _five_turns(_first_turn, _third_turn, par, q, L, h)
    else:
        q, L = _five_turns(_third_turn, _first_turn, par, q, L, h)
    q = normalised(par, q)
    kick = plus(kick, half, torque(par, axis_of(*q)))
    dstate = (*_gap(q, state[:4]), *kick)
    return dstate, carry, 1, ended_space(dstate)


march_no_squish = Loop(no_carry, _increment_no_squish, observe_attitude)


def _engine(
    name: str, step: Callable[..., Any], order: int | None, summary: str, reference: str, momenta: str = "", *,
    forms: Mapping[str, MapForm] = VELOCITY, first_carry: Callable[..., Any] = _nothing, forces: int = 1,
    energy_error: str | None = None, number: Any = np.float64,
) -> Integrator:  # fmt: skip
    """A map in every chart (in single precision, those with a quaternion); `momenta` names those it conserves."""
    charts = [chart for chart in forms if chart != "axis" or number is np.float64]
    loops = {chart: engine_loop(step, chart, forms[chart], first_carry, number) for chart in charts}
    return Integrator(
        name=name, family=ENGINE, summary=summary, reference=reference, order=order, explicit=True, symplectic=False,
        symmetric=False, conserves=frozenset(momenta.split()), energy_error=energy_error, needs="group", general=True,
        solvers={at: FixedStep(loops[at], NONE, forms[at].prepare, forces, implicit=False) for at in charts},
    )  # fmt: skip


def _both(*args: Any, **options: Any) -> list[Integrator]:
    """A map in double and in the single precision of the engine."""
    double, single = _engine(*args, **options), _engine(*args, **options, number=np.float32)
    variant = replace(
        single, name=f"{single.name}-float32", summary=f"{single.summary}, in single precision", order=None,
        conserves=frozenset(), energy_error=None, precision="single",
    )  # fmt: skip
    return [double, variant]


def built_in() -> list[Integrator]:
    """The maps in double precision, and those of engines in single precision also in single."""
    return [
        *_both("no-gyro", _kicker(_with_torque), None, "Havok, PhysX and Jolt by default: no gyroscopic term",
               "havok physx jolt", "p_psi", energy_error="bounded"),
        _engine("no-gyro-linear", _kicker(_with_torque, linear), None,
                "cannon-es, ODE with its gyroscopic mode off: no gyroscopic term, a linear turn", "cannon-es ode",
                "p_psi", energy_error="bounded"),
        _engine("mujoco-euler", _kicker(lambda par, e, w, h: plus(w, h, acceleration(par, e, w))), 1,
                "MuJoCo Euler, PyBullet, DART: explicit gyroscopic term", "mujoco pybullet dart"),
        _engine("mujoco-implicit",
                _kicker(lambda par, e, w, h: plus(w, h, implicit(par, e, w, moment(par, e, w), h))), 1,
                "MuJoCo implicit: one Newton step of the velocity", "mujoco", "p_psi"),
        *_both("bullet", _kicker(_implicit_then_torque), 1,
               "Bullet by default: implicit gyroscopic term, then the torque", "bullet", "p_psi"),
        *_both("jolt", _kicker(lambda par, e, w, h: _with_torque(par, e, _rescaled(par, e, w, h), h)), 1,
               "Jolt with its gyroscopic term: |L| kept, then the torque", "jolt"),
        *_both("physx", _kicker(_torque_then_rescaled), 1, "PhysX with its gyroscopic flag: the torque, then |L| kept",
               "physx"),
        *_both("rapier", substepped, 1, "Rapier by default: four substeps, |L| kept in each", "rapier"),
        _engine("ode", _kicker(
                    lambda par, e, w, h: _with_torque(par, e, projected(par, e, momentum(par, e, w), h), h), linear), 1,
                "ODE by default: gyroscopic term implicit in the velocity", "ode lacoursiere-2006"),
        _engine("lammps-rigid", richardson, 2, "LAMMPS fix rigid: half kicks around an extrapolated rotation",
                "lammps", "p_phi", forms=ANGULAR_MOMENTUM),
        Integrator(
            name="no-squish", family=ENGINE, summary="LAMMPS fix rigid/nve: turns about the body's axes", order=2,
            reference="miller-2002 lammps", explicit=True, symplectic=True, symmetric=True,
            conserves=frozenset({"p_phi"}), needs="kicks", general=True, solvers={
                "attitude": FixedStep(march_no_squish, NONE, ANGULAR_MOMENTUM["attitude"].prepare, 1, implicit=False),
                BODY: five_rotations(SORTED),
            },
        ),
        _engine("yade", _leapfrog(published=False), 1, "YADE: rotational leapfrog with the axes of the start of a step",
                "yade", "p_phi", forms=ANGULAR_MOMENTUM),
        _engine("fincham", _leapfrog(published=True), 2, "the rotational leapfrog as published", "fincham-1992",
                "p_phi", forms=ANGULAR_MOMENTUM),
        _engine("spiral", spiral, 2, "SPIRAL, YADE's later choice and JaxDEM's: a turn between halves of three stages",
                "del-valle-2024", "p_psi"),
        _engine("mujoco3-rk4", _kutta(munthe_kaas=False), 2, "MuJoCo RK4 up to 3.17: stages turn by their rates",
                "mujoco-3", "p_psi", forces=4),
        _engine("rkmk4", _kutta(munthe_kaas=True), 4, "MuJoCo 4.0 RK4, Exudyn: Runge-Kutta-Munthe-Kaas",
                "munthe-kaas-1999 mujoco exudyn", "p_psi", forces=4),
        _engine("jsbsim-default", explicit_euler, 1, "JSBSim by default: explicit Euler", "jsbsim"),
        _engine("jsbsim-buss2", adams_bashforth, 2, "JSBSim Buss2 and AB2: Adams-Bashforth and Magnus",
                "jsbsim buss-2000", first_carry=acceleration),
    ]  # fmt: skip
