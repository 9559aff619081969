"""Taylor series of the space-frame equations in forms made for them: `series` and `series-adaptive`.

*The axis*, in second order: one product of vectors for each order and pair of terms.

    w = L_x + i L_y,  z = e_x + i e_y,  u = e_z,  kappa = mgl/I1:     w' = i mgl z,   z' = i (p_phi z - u w)/I1
    w'' = i (p_phi/I1) w' + kappa u w,     u'' = 3 kappa u^2 - c1 u + c0,     u' = Im(conj(w) z)/I1
    c1 = |w|^2/I1^2 + 2 kappa u + p_phi^2/I1^2,      c0 = p_phi p_psi/I1^2 - kappa |e|^2

c1 and c0 are constants of the motion, so that the equation of w is linear with the coefficient u, and that of u knows u
alone. With y = w/(h mgl), a = h/I1, m = h mgl, P = a p_phi and S_n = [Re y_n, Im y_n, u_n] the coefficients of
(t/h)^n, a term from n = 3 on is one product of u with all three, in one register (`symtop.methods.simd`). Here kappa
and c1 are in units of the step, kappa = a m:

    S_{n+2} = [1, 1, 3] (kappa (sum_{0<j<n} u_j S_{n-j} + u_0 S_n) + u_n G)/((n+1)(n+2)) + [-P, P] swap(S_{n+1})/(n+2)
    G = [a Re w, a Im w, 2 kappa u_0 - c1/3]        (u_0 S_n only of y),        S_1 = [-Im z, Re z, a Im(conj(w) z)]
    dw = m sum_{0<n<=N} y_n,    du = sum_{0<n<=N} u_n,    dz = -i sum_{1<n<=N+1} n y_n

N (N - 1)/2 fused products for the order N, 190 for N = 20, where a general compiler of Taylor series takes six scalar
products, 3 N^2. Three traps. c1 and c0 are those of the *present* state: constants of the start make it unstable.
kappa = a m is applied as two products: rounded, it drives the energy away. And L from w'/(i mgl) loses
digits where gravity is weak, so that y carries L and z comes from its slope.

*The attitude*: the half angles beside the axis, by the same heights.

    chi_1 = q_w - i q_z,  chi_2 = q_y - i q_x     chi_k'' = (kappa u - lambda_k) chi_k
    lambda = |L|^2/4 I1^2 + kappa u/2 + kappa |q|^2/2, ... - kappa |q|^2/2

(see `oscillators`; lambda are constants of the motion, of the present state again). With X_n = [Re chi_1, Im chi_1,
Re chi_2, Im chi_2] in one register,

    X_{n+2} = (kappa sum_{0<j<=n} u_j X_{n-j} + (kappa u_0 - lambda) X_n)/((n+1)(n+2)),    X_1 = -(i/2 I1) (L.sigma) chi

The own spin is exact and put on at samples, as everywhere in the space frame; |q| is kept as far as the series
converges.

*With a tolerance* the order follows from it, each step from its last two terms, in radians at the end of the step, as
the tolerance is: T_n = (n y_n, u_n), those of z and u, on the attitude with 2 X_n beside them.

    order N: the least of 8, 12, 16, 20 that is at least 3 - log(tolerance)/2
    e = max(|T_N|, |T_{N-1}|/4),    accepted if e <= 4 tolerance,    h <- h min(4, 0.95 (tolerance/e)^(1/N))
    first h = 1/sqrt(|L|^2/I1^2 + 4 |mgl|/I1 + 1/t^2), t the last sample

The first neglected term is smaller than e by the ratio of two terms, 0.02 to 0.5. A rejected step costs one series. So
does a sample, the series of the step with a shorter time: it is the method's dense output and, as that of `taylor`, not
counted as a force evaluation, so that the work of a run does not depend on its samples. Time and state are compensated
sums.

The step must resolve the distance of the pole of wp from the real time, 0.44 nutations in `spheroid`, 0.7 in
`goldstein`, 2.9 in `fast`; a variable step gains at most 1.5, and 4 to 6 near a separatrix. Explicit, no poles; L_z
does not move; not symplectic, which shows where the truncation lies above rounding: the energy then drifts.
Source: Biscani, Izzo, Mon. Not. R. Astron. Soc. 504 (2021) 2614 (steps and orders); the recurrences are derived here.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import intrinsic

from symtop.core.errors import SymtopError, whole
from symtop.core.jit import compile_kernel, register_jitable, set_item
from symtop.core.numbers import EPSILON
from symtop.methods.framework import space
from symtop.methods.framework.adaptive import Adaptive
from symtop.methods.framework.lanes import Lanes, loop_with_rule
from symtop.methods.framework.loop import FixedStep, Loop, no_carry
from symtop.methods.framework.plan import NOT_FINITE, STEP_TOO_SMALL
from symtop.methods.framework.preparation import BareTop, Presentation, ScaledRule, Start, as_it_steps
from symtop.methods.framework.registry import Integrator
from symtop.methods.framework.space import SpaceTop, axis_of, finite_outcome, with_spin
from symtop.methods.runge_kutta.explicit import row_of, store
from symtop.methods.simd import Components, Vectors
from symtop.methods.vectors import accumulate, zero


class Scale(NamedTuple):
    """The step in the units of the series."""

    turn: float = 1.0  # a = h/I1
    pull: float = 1.0  # m = h mgl


def _scale(rule: Any, top: Any, at: Any, h: float) -> Any:
    return Scale(h / top.I1, h * top.mgl)


class First(NamedTuple):
    """Vectors of the present state that every order needs."""

    s1: Any
    s2: Any
    g: Any
    u0: Any  # u, but for u itself
    turn: Any  # -P, P
    square: Any  # |w|^2 h^2/I1^2
    P: Any
    ku: Any  # kappa u h^2


def first_terms(v: Vectors, z: Any, u: Any, norm: Any, w: Any, a: Any, p: Any, m: Any) -> First:
    """S_1, S_2 and G from z and w, pairs of scalars, the height u, the length |e|^2, a, L_z and m."""
    b, c = v.builder, v.number
    mul, fma, neg = b.fmul, b.fma, b.fneg
    zero = c(0.0)
    P, ar, ai = mul(a, p), mul(a, w[0]), mul(a, w[1])
    ku = mul(mul(m, u), a)
    square = fma(ar, ar, mul(ai, ai))
    c1 = fma(c(2.0), ku, fma(P, P, square))
    c0 = fma(P, fma(ar, z[0], fma(ai, z[1], mul(P, u))), neg(mul(mul(m, norm), a)))
    u1 = fma(ar, z[1], neg(mul(ai, z[0])))
    twice_u2 = fma(u, fma(c(3.0), ku, neg(c1)), c0)
    s1 = v.pack(neg(z[1]), z[0], u1, zero)
    turn = v.pack(neg(P), P, zero, zero)
    bent = v.pack(mul(u, ar), mul(u, ai), twice_u2, zero)
    s2 = mul(v.fma(v.shuffled(s1, 1, 0, 2, 3), turn, bent), v.constant(0.5))
    g = v.pack(ar, ai, fma(c(2.0), ku, mul(c1, c(-1.0 / 3.0))), zero)
    return First(s1, s2, g, v.pack(u, u, zero, zero), turn, square, P, ku)


def middle_first(n: int) -> list[int]:
    """The j with 0 < j < n, in the order in which the terms of the product become known."""
    return sorted(range(1, n), key=lambda j: -min(j, n - j))


def axis_terms(v: Vectors, first: First, a: Any, m: Any, last: int) -> tuple[list[Any], list[Any]]:
    """S_1 .. S_last, and u_1 .. u_(last - 2) in all lanes; index 0 is empty."""
    b = v.builder
    S, U = [None, first.s1, first.s2], [None, *(v.shuffled(s, 2, 2, 2, 2) for s in (first.s1, first.s2))]
    for n in range(1, last - 1):
        pairs = [(U[j], S[n - j]) for j in middle_first(n)]
        product = v.fma(first.u0, S[n], v.dot(pairs)) if pairs else b.fmul(first.u0, S[n])
        bent = v.fma(b.fmul(product, m), a, b.fmul(U[n], first.g))
        per = 1.0 / ((n + 1) * (n + 2))
        turned = b.fmul(first.turn, v.constant(1.0 / (n + 2)))
        scaled = b.fmul(bent, v.constant(per, per, 3.0 * per, 3.0 * per))
        S.append(v.fma(v.shuffled(S[n + 1], 1, 0, 2, 3), turned, scaled))
        U.append(v.shuffled(S[-1], 2, 2, 2, 2))
    return S, U


def size(v: Vectors, S: list[Any], n: int) -> Any:
    """Square of the length of the terms u_n and -i n y_n, of which the second is that of z one order lower."""
    b = v.builder
    square = b.fmul(S[n], b.fmul(S[n], v.constant(n * n, n * n, 1.0, 0.0)))
    return b.fadd(b.fadd(v.lane(square, 0), v.lane(square, 1)), v.lane(square, 2))


@functools.cache
def axis_sum(order: int, arithmetic: type[Vectors] = Vectors) -> Callable[..., Any]:
    """For kernels: (state, a, m) -> increments of e_x, e_y, e_z, L_x, L_y, and the squares of the last two terms."""

    def series(typing, state, a, m):  # type: ignore[no-untyped-def]
        def emit(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            state, a, m = arguments
            v = arithmetic(builder)
            b = v.builder
            x, y, u, wx, wy, p = (b.extract_value(state, k) for k in range(6))
            norm = b.fma(x, x, b.fma(y, y, b.fmul(u, u)))
            first = first_terms(v, (x, y), u, norm, (wx, wy), a, p, m)
            S, _ = axis_terms(v, first, v.pack(a), v.pack(m), order + 1)
            change = b.fadd(S[1], v.total(S[2 : order + 1]))
            pairs = ((S[n + 1], v.constant(n + 1), b.fmul(S[n], v.constant(n))) for n in range(2, order + 1, 2))
            slope = v.total([v.fma(*pair) for pair in pairs])  # the sum of n S_n from 2 on
            axis = v.lane(slope, 1), b.fneg(v.lane(slope, 0)), v.lane(change, 2)
            momentum = b.fmul(m, v.lane(change, 0)), b.fmul(m, v.lane(change, 1))
            return v.array([*axis, *momentum, size(v, S, order), size(v, S, order - 1)])

        return types.UniTuple(types.float64, 7)(state, a, m), emit

    return intrinsic(series)  # type: ignore[no-any-return]


def _size(v: Vectors, term: Any) -> Any:
    """Square of a term of both halves, as a rotation: an angle is twice a distance of quaternions."""
    square = v.builder.fmul(v.builder.fmul(term, term), v.constant(4.0))
    return v.builder.fadd(
        v.builder.fadd(v.lane(square, 0), v.lane(square, 1)), v.builder.fadd(v.lane(square, 2), v.lane(square, 3))
    )


@functools.cache
def attitude_sum(order: int, arithmetic: type[Vectors] = Vectors) -> Callable[..., Any]:
    """For kernels: (state, a, m) -> increments of w, x, y, z, L_x, L_y, and the squares of the last two terms."""

    def series(typing, state, a, m):  # type: ignore[no-untyped-def]
        def emit(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            state, a, m = arguments
            v = arithmetic(builder)
            b, c = v.builder, v.number
            mul, fma, neg = b.fmul, b.fma, b.fneg
            qw, qx, qy, qz, wx, wy, p = (b.extract_value(state, k) for k in range(7))
            two = c(2.0)
            z = mul(two, fma(qx, qz, mul(qw, qy))), mul(two, fma(qy, qz, neg(mul(qw, qx))))
            upper, lower = fma(qw, qw, mul(qz, qz)), fma(qx, qx, mul(qy, qy))
            u, norm = b.fsub(upper, lower), b.fadd(upper, lower)
            first = first_terms(v, z, u, mul(norm, norm), (wx, wy), a, p, m)
            S, U = axis_terms(v, first, v.pack(a), v.pack(m), order)
            # kappa u - lambda of both halves
            pull = mul(mul(m, norm), a)
            base = fma(c(0.25), fma(first.P, first.P, first.square), mul(c(0.5), first.ku))
            rest1 = b.fsub(first.ku, fma(c(0.5), pull, base))
            rest2 = b.fsub(first.ku, fma(c(-0.5), pull, base))
            factor = v.pack(rest1, rest1, rest2, rest2)
            # chi' = -(i/2) (P chi_1 + conj(a w) chi_2), -(i/2) (a w chi_1 - P chi_2)
            ar, ai, half, minus = mul(a, wx), mul(a, wy), c(0.5), c(-0.5)
            real1 = fma(first.P, qw, fma(ar, qy, neg(mul(ai, qx))))
            imag1 = neg(fma(first.P, qz, fma(ar, qx, mul(ai, qy))))
            real2 = b.fsub(fma(ar, qw, mul(ai, qz)), mul(first.P, qy))
            imag2 = fma(ai, qw, fma(first.P, qx, neg(mul(ar, qz))))
            X = [v.pack(qw, neg(qz), qy, neg(qx))]
            X.append(v.pack(mul(half, imag1), mul(minus, real1), mul(half, imag2), mul(minus, real2)))
            X.append(mul(mul(factor, X[0]), v.constant(0.5)))
            av, mv = v.pack(a), v.pack(m)
            for n in range(1, order - 1):
                product = v.dot([(U[j], X[n - j]) for j in middle_first(n)] + [(U[n], X[0])])
                bent = v.fma(b.fmul(product, mv), av, b.fmul(factor, X[n]))
                X.append(b.fmul(bent, v.constant(1.0 / ((n + 1) * (n + 2)))))
            change, halves = b.fadd(S[1], v.total(S[2:])), b.fadd(X[1], v.total(X[2:]))
            quaternion = v.lane(halves, 0), neg(v.lane(halves, 3)), v.lane(halves, 2), neg(v.lane(halves, 1))
            momentum = mul(m, v.lane(change, 0)), mul(m, v.lane(change, 1))
            sizes = (b.fadd(size(v, S, n), _size(v, X[n])) for n in (order, order - 1))
            return v.array([*quaternion, *momentum, *sizes])

        return types.UniTuple(types.float64, 8)(state, a, m), emit

    return intrinsic(series)  # type: ignore[no-any-return]


def _loop(series_of: Callable[..., Any], size: int, observe: Callable[..., Any]) -> Callable[[int], Loop]:
    """The loop of an order on states of `size` numbers, of which the last, L_z, does not move."""
    still = size - 1

    def stepping(order: int, arithmetic: type[Vectors]) -> Callable[..., Any]:
        series, zeros = series_of(order, arithmetic), (0.0,) * size

        @register_jitable
        def stepped(rule, state):  # type: ignore[no-untyped-def]
            values, step, total = series(state, rule.turn, rule.pull), zeros, 0.0
            for i in range(still):
                step = set_item(step, i, values[i])
                total += values[i]
            return step, finite_outcome(total)

        return stepped

    @functools.cache
    def in_lanes(order: int) -> Lanes:
        stepped = stepping(order, Components)

        def advance(par, rule, state, carry):  # type: ignore[no-untyped-def]
            step, outcome = stepped(rule, state)
            return step, carry, outcome

        return loop_with_rule(advance, Scale, top=SpaceTop, dimension=size)

    @functools.cache
    def loop(order: int) -> Loop:
        stepped = stepping(order, Vectors)

        def increment(par, rule, state, carry, h):  # type: ignore[no-untyped-def]
            step, outcome = stepped(rule, state)
            return step, carry, 1, outcome

        return Loop(no_carry, increment, observe, lanes=lambda _: in_lanes(order))

    return loop


march_axis = _loop(axis_sum, 6, space.observe_axis)
march_attitude = _loop(attitude_sum, 7, space.observe_attitude)
spun = Presentation(lambda par, t, state: with_spin(par, state, t), 7)  # with the spin since the start

ORDERS = (8, 12, 16, 20)
BLOCK_SERIES = 1_000_000  # series between returns to Python
MOST_SERIES = 200_000_000  # limit on the series of one run: about half a minute
ACCEPTED_RATIO, SAFETY, GROW, EARLIER = 4.0, 0.95, 4.0, 0.25

CHARTS: dict[str, tuple[Any, ...]] = {  # preparation, series, sample(par, t, state), axis of a state
    "axis": (space.on_axis, axis_sum, as_it_steps, lambda state: state[:3]),
    "attitude": (space.on_attitude, attitude_sum, spun.sample, lambda state: axis_of(*state[:4])),
}


def order_for(tolerance: float) -> int:
    """The order that reaches a tolerance with the least work."""
    return next((order for order in ORDERS if order >= 3.0 - 0.5 * math.log(tolerance)), ORDERS[-1])


@functools.cache
def march_adaptive(chart: str, order: int) -> Callable[..., tuple[int, int, int, int]]:  # noqa: C901
    """The loop of one order as `adaptive` takes it, counting series; place: (state, low half, time, low half, step)."""
    preparation, series_of, sample, axis = CHARTS[chart]
    prepare, size, series = preparation.numbers, preparation.size, series_of(order)
    register_jitable(axis)

    @register_jitable
    def terms(state, body, h):  # type: ignore[no-untyped-def]
        out = series(state, h / body.I1, h * body.mgl)
        dstate = state
        for i in range(size - 1):
            dstate = set_item(dstate, i, out[i])
        last = max(math.sqrt(out[size - 1]), EARLIER * math.sqrt(out[size]))
        return set_item(dstate, size - 1, 0.0), last

    def run(numbers, tolerance, times, budget, index, place, states, momenta):  # type: ignore[no-untyped-def]
        body = BareTop(*numbers[:3])
        par, state = prepare(body, Start(*numbers[3:]))
        low, t, t_low = zero(state), 0.0, 0.0
        turn = (state[size - 3] ** 2 + state[size - 2] ** 2 + state[size - 1] ** 2) / body.I1**2
        h = 1.0 / math.sqrt(turn + 4.0 * abs(body.mgl) / body.I1 + 1.0 / times[-1] ** 2)
        record = place[: 2 * size].reshape(2, size)
        if index >= 0:
            state, low = row_of(record, 0, state), row_of(record, 1, low)
            t, t_low, h = place[2 * size], place[2 * size + 1], place[2 * size + 2]
        index = max(index, 0)
        steps = effort = outcome = 0
        while index < len(times) and effort < budget:
            dstate, last = terms(state, body, h)
            effort += 1
            change = GROW if last == 0.0 else min(GROW, SAFETY * (tolerance / last) ** (1.0 / order))
            if last <= ACCEPTED_RATIO * tolerance:
                t_new = t + h
                t_new_low = (t_low + (t - t_new)) + h if t > h else (t_low + (h - t_new)) + t
                while index < len(times) and (times[index] - t_new) - t_new_low <= 0.0:
                    part, _ = terms(state, body, (times[index] - t) - t_low)
                    y, _ = accumulate(state, low, part)
                    y = sample(par, times[index], y)
                    store(states, index, y)
                    e = axis(y)
                    momenta[index, 0] = y[size - 1]
                    momenta[index, 1] = y[size - 3] * e[0] + y[size - 2] * e[1] + y[size - 1] * e[2]
                    index += 1
                state, low = accumulate(state, low, dstate)
                t, t_low = t_new, t_new_low
                steps += 1
            elif not last < np.inf:
                change = 0.1
            h *= change
            if not t + h > t:
                outcome = STEP_TOO_SMALL
                break
            if not np.isfinite(state[0] + state[size - 2]):
                outcome = NOT_FINITE
                break
        store(record, 0, state)
        store(record, 1, low)
        place[2 * size], place[2 * size + 1], place[2 * size + 2] = t, t_low, h
        return index, steps, effort, outcome

    return compile_kernel(run)  # type: ignore[no-any-return]


def solver(chart: str) -> Adaptive:
    """A solver of the registry in one chart."""
    size = CHARTS[chart][0].size
    return Adaptive(
        lambda tolerance: march_adaptive(chart, order_for(tolerance)),
        size, 2 * size + 3, 2 * size, MOST_SERIES, BLOCK_SERIES, order_for,
    )  # fmt: skip


DEFAULT_ORDER = 16


def series(name: str, order: int = DEFAULT_ORDER) -> Integrator:
    """The series of an order, 8, 12, 16 or 20, with a fixed step. Raises SymtopError for another order."""
    order = whole("order", order, 1)
    if order not in ORDERS:
        raise SymtopError(f"order must be one of {', '.join(map(str, ORDERS))}, not {order!r}")
    rule = ScaledRule(Scale(), _scale)
    return Integrator(
        name=name, family="taylor",
        summary=f"Taylor series on the space-frame equations, order {order}, by products of vectors",
        solvers={
            "axis": FixedStep(march_axis(order), rule, space.on_axis, order, implicit=False),
            "attitude": FixedStep(march_attitude(order), rule, space.on_attitude, order, implicit=False, present=spun),
        },
        order=order, explicit=True, symplectic=False, symmetric=False, conserves=frozenset({"p_phi"}),
        reference="biscani-izzo-2021", needs="this-top", general=False, inner_loop="vector registers",
    )  # fmt: skip


def built_in() -> list[Integrator]:
    """`series` and `series-adaptive`."""
    adaptive = Integrator(
        name="series-adaptive", family="taylor",
        summary="Taylor series on the space-frame equations with order and steps of a tolerance, compiled",
        solvers={chart: solver(chart) for chart in CHARTS},
        control="tolerance", explicit=True, symplectic=False, symmetric=False, conserves=frozenset({"p_phi"}),
        least_tolerance=EPSILON / 1000.0, default_tolerance=EPSILON / 10.0,
        reference="biscani-izzo-2021", needs="this-top", general=False, inner_loop="vector registers",
    )  # fmt: skip
    return [series("series"), adaptive]
