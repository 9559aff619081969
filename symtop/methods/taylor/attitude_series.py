"""Taylor series of the attitude: the half angles beside the series of the axis, by the same heights.

    chi_1 = q_w - i q_z,  chi_2 = q_y - i q_x     chi_k'' = (kappa u - lambda_k) chi_k
    lambda = |L|^2/4 I1^2 + kappa u/2 + kappa |q|^2/2, ... - kappa |q|^2/2

(see `oscillators`; lambda are constants of the motion, of the present state again). With X_n = [Re chi_1, Im chi_1,
Re chi_2, Im chi_2] in one register and u_n from `axis_series`,

    X_{n+2} = (kappa sum_{0<j<=n} u_j X_{n-j} + (kappa u_0 - lambda) X_n)/((n+1)(n+2)),    X_1 = -(i/2 I1) (L.sigma) chi

so that an order of the attitude costs two products of vectors for each pair of terms. State (q, L); the own spin
is exact and put on at samples, as everywhere in the space frame. Explicit, no poles, not symplectic; |q| is kept as far
as the series converges.
"""

import functools
from collections.abc import Callable
from typing import Any

from numba import types
from numba.extending import intrinsic

from symtop.core.simd import Components, Vectors
from symtop.methods.framework.lanes import Lanes
from symtop.methods.framework.loop import Loop, driver
from symtop.methods.framework.one_loop_lanes import one_loop
from symtop.methods.framework.space import SpaceTop, finite_outcome, observe_attitude, with_spin
from symtop.methods.taylor.axis_series import Scale, axis_terms, begin, first_terms, middle_first, size


def _first_halves(v: Vectors, q: Any, w: Any, a: Any, P: Any) -> tuple[Any, Any]:
    """X_0 and X_1: chi' = -(i/2) (P chi_1 + conj(a w) chi_2), -(i/2) (a w chi_1 - P chi_2)."""
    b = v.builder
    mul, fma, neg, half = b.fmul, b.fma, b.fneg, v.number(0.5)
    qw, qx, qy, qz = q
    ar, ai = mul(a, w[0]), mul(a, w[1])
    real1 = fma(P, qw, fma(ar, qy, neg(mul(ai, qx))))
    imag1 = neg(fma(P, qz, fma(ar, qx, mul(ai, qy))))
    real2 = b.fsub(fma(ar, qw, mul(ai, qz)), mul(P, qy))
    imag2 = fma(ai, qw, fma(P, qx, neg(mul(ar, qz))))
    minus = v.number(-0.5)
    return (
        v.pack(qw, neg(qz), qy, neg(qx)),
        v.pack(mul(half, imag1), mul(minus, real1), mul(half, imag2), mul(minus, real2)),
    )


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
            rest = v.pack(rest1, rest1, rest2, rest2)
            X = list(_first_halves(v, (qw, qx, qy, qz), (wx, wy), a, first.P))
            X.append(mul(mul(rest, X[0]), v.constant(0.5)))
            av, mv = v.pack(a), v.pack(m)
            for n in range(1, order - 1):
                product = v.dot([(U[j], X[n - j]) for j in middle_first(n)] + [(U[n], X[0])])
                bent = v.fma(b.fmul(product, mv), av, b.fmul(rest, X[n]))
                X.append(b.fmul(bent, v.constant(1.0 / ((n + 1) * (n + 2)))))
            whole, halves = b.fadd(S[1], v.total(S[2:])), b.fadd(X[1], v.total(X[2:]))
            turned = v.lane(halves, 0), neg(v.lane(halves, 3)), v.lane(halves, 2), neg(v.lane(halves, 1))
            momentum = mul(m, v.lane(whole, 0)), mul(m, v.lane(whole, 1))
            sizes = (b.fadd(size(v, S, n), _size(v, X[n])) for n in (order, order - 1))
            return v.array([*turned, *momentum, *sizes])

        return types.UniTuple(types.float64, 8)(state, a, m), emit

    compiled: Callable[..., Any] = intrinsic(series)
    return compiled


def present(par: Any, rule: Any, state: Any, k: int, h: float) -> Any:
    """The spin since the start."""
    return with_spin(par, state, k * h)


@functools.cache
def march_attitude(order: int) -> Loop:
    """The loop of one order."""
    series = attitude_sum(order)

    def increment(par, rule, state, carry, h):  # type: ignore[no-untyped-def]
        w, x, y, z, wx, wy, _, _ = series(state, rule.turn, rule.pull)
        return (w, x, y, z, wx, wy, 0.0), carry, 1, finite_outcome(w + x + y + z + wx + wy)

    return driver(begin, increment, observe_attitude, present=present, lanes=functools.partial(_attitude_lanes, order))


@functools.cache
def _attitude_in_lanes(order: int) -> Lanes:
    series = attitude_sum(order, Components)

    def advance(par, rule, state, carry):  # type: ignore[no-untyped-def]
        w, x, y, z, wx, wy, _, _ = series(state, rule.turn, rule.pull)
        return (w, x, y, z, wx, wy, 0.0), carry, finite_outcome(w + x + y + z + wx + wy)

    return one_loop(advance, Scale, top=SpaceTop, dimension=7, carry=1)


def _attitude_lanes(order: int, rule: Scale) -> Lanes:
    """What runs an order in lanes."""
    return _attitude_in_lanes(order)
