"""Taylor series of the axis in second order: one product of vectors for each order and pair of terms.

    w = L_x + i L_y,  z = e_x + i e_y,  u = e_z,  kappa = mgl/I1:     w' = i mgl z,   z' = i (p_phi z - u w)/I1
    w'' = i (p_phi/I1) w' + kappa u w,     u'' = 3 kappa u^2 - c1 u + c0,     u' = Im(conj(w) z)/I1
    c1 = |w|^2/I1^2 + 2 kappa u + p_phi^2/I1^2,      c0 = p_phi p_psi/I1^2 - kappa |e|^2

c1 and c0 are constants of the motion, so that the equation of w is linear with the coefficient u, and that of u knows u
alone. With y = w/(h mgl), a = h/I1, m = h mgl, P = a p_phi and S_n = [Re y_n, Im y_n, u_n] the coefficients of
(t/h)^n, an order is one product of u with all three, in one register (`symtop.core.simd`):

    S_{n+2} = [1, 1, 3] (kappa (sum_{0<j<n} u_j S_{n-j} + u_0 S_n) + u_n G)/((n+1)(n+2)) + [-P, P] swap(S_{n+1})/(n+2)
    G = [a Re w, a Im w, 2 kappa u_0 - c1/3]        (u_0 S_n only of y),        S_1 = [-Im z, Re z, a Im(conj(w) z)]
    dw = m sum y_n,    du = sum u_n,    dz = -i sum_{n>1} n y_n

N (N - 1)/2 fused products for the order N, 190 for N = 20, where a general compiler of Taylor series takes six scalar
products, 3 N^2. No pole, no frame, no trigonometry. Explicit, not symplectic; L_z does not move.

Three traps. c1 and c0 are those of the *present* state: constants of the start make it unstable. kappa = a m is applied
as two products: rounded, it drives the energy away 5 times as fast. And L from w'/(i mgl) loses digits where gravity is
weak, so that y carries L and z comes from its slope.

The step must resolve the distance of the pole of wp from the real time, 0.44 nutations in `spheroid`, 0.7 in
`goldstein`, 2.9 in `fast`; a variable step gains at most 1.5 (`series-adaptive`), and 4 to 6 near a separatrix.
The recurrence is derived here; Taylor series with steps from their last terms: Biscani, Izzo, Mon. Not. R. Astron. Soc.
504 (2021) 2614.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types
from numba.extending import intrinsic

from symtop.core.simd import Components, Vectors
from symtop.methods.framework.lanes import Lanes
from symtop.methods.framework.loop import Loop, driver
from symtop.methods.framework.one_loop_lanes import one_loop
from symtop.methods.framework.space import SpaceTop, finite_outcome, observe_axis


class Scale(NamedTuple):
    """The step in the units of the series."""

    turn: float = 1.0  # a = h/I1
    pull: float = 1.0  # m = h mgl


def scale(rule: Any, top: Any, at: Any, h: float) -> Any:
    """The step of one run."""
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
    """0 < j < n, the terms first that are known first."""
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


def slope(v: Vectors, S: list[Any], last: int) -> Any:
    """Sum of n S_n for 1 < n <= last."""
    terms = []
    for n in range(2, last + 1, 2):
        term = v.builder.fmul(S[n], v.constant(n))
        terms.append(v.fma(S[n + 1], v.constant(n + 1), term) if n < last else term)
    return v.total(terms)


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
            whole, bent = b.fadd(S[1], v.total(S[2 : order + 1])), slope(v, S, order + 1)
            turned = v.lane(bent, 1), b.fneg(v.lane(bent, 0)), v.lane(whole, 2)
            momentum = b.fmul(m, v.lane(whole, 0)), b.fmul(m, v.lane(whole, 1))
            return v.array([*turned, *momentum, size(v, S, order), size(v, S, order - 1)])

        return types.UniTuple(types.float64, 7)(state, a, m), emit

    compiled: Callable[..., Any] = intrinsic(series)
    return compiled


def begin(par: Any, rule: Any, state: Any, h: float) -> Any:
    """A step has nothing for the next one."""
    return (0.0,)


@functools.cache
def march_axis(order: int) -> Loop:
    """The loop of one order."""
    series = axis_sum(order)

    def increment(par, rule, state, carry, h):  # type: ignore[no-untyped-def]
        x, y, u, wx, wy, _, _ = series(state, rule.turn, rule.pull)
        return (x, y, u, wx, wy, 0.0), carry, 1, finite_outcome(x + y + u + wx + wy)

    return driver(begin, increment, observe_axis, lanes=functools.partial(_axis_lanes, order))


@functools.cache
def _axis_in_lanes(order: int) -> Lanes:
    series = axis_sum(order, Components)

    def advance(par, rule, state, carry):  # type: ignore[no-untyped-def]
        x, y, u, wx, wy, _, _ = series(state, rule.turn, rule.pull)
        return (x, y, u, wx, wy, 0.0), carry, finite_outcome(x + y + u + wx + wy)

    return one_loop(advance, Scale, top=SpaceTop, dimension=6, carry=1)


def _axis_lanes(order: int, rule: Scale) -> Lanes:
    """What runs an order in lanes."""
    return _axis_in_lanes(order)
