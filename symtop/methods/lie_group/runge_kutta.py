"""Runge-Kutta methods on the group SE(3), whose coadjoint orbits the top moves on: RKMK, Crouch-Grossman, CF4.

The vector field on (e, L) is at each point that of an element (w, f) of the algebra se(3),

    e' = w x e,   L' = w x L + f x e,        w = L/I1,  f = mgl k,

and with w and f held fixed its flow over a unit of time is known, the action of exp(w, f):

    e <- R e,   L <- R L + b x R e,      R = exp(w),   b = (1 + B w x + C w x w x) f,      a = |w|
    B = (1 - cos a)/a^2 = 2 s^2,   C = (a - sin a)/a^3,      the quaternion of R = (1 + m, s w).

s, m and C are functions of the square of half the angle alone: series where that is less than 1, sine and cosine
beyond. Every such flow keeps |e| and L.e, the Casimirs of se(3)*, whatever w and f are. So does a method that is made
of them; p_phi = L_z and the energy drift. With F_j the algebra element at stage j:

    Crouch-Grossman   y_i = exp(h a_i,i-1 F_i-1) ... exp(h a_i1 F_1) y            one exponential a coefficient
    commutator-free   y_i = ... exp(h sum_j w_2j F_j) exp(h sum_j w_1j F_j) y     few exponentials of sums
    Munthe-Kaas       y_i = exp(U_i) y,  U_i = h sum_j a_ij K_j,  K_i = F_i - [U_i, F_i]/2 + [U_i, [U_i, F_i]]/12 - ...

The last is a method for the element U that the solution is the exponential of, U' = dexp^-1_U F = sum_k B_k/k! ad_U^k F
with Bernoulli's numbers B_k; q nested brackets suffice for order q + 3, as B_3 = B_5 = B_7 = 0: two for 5, four for 7,
six for 9. A table is rows of weights, one row an exponential, so that one kernel steps all three. The engines' `rkmk4`
acts with another group, SO(3) x R^3, on body rates and turns the spin in its stages. A body without symmetry moves by
an element of se(3), too, and q* with it (`framework.body`): p_phi is the Casimir kept there.

In lanes a kernel compiles for each shape of a table: how many exponentials each stage has, and whether slopes are bent
back (Munthe-Kaas). The weights are numbers in the table, and those that are 0 are carried out too, in the order of the
kernel for one. Lanes take the series; one that turns by more than two radians is given up.
Sources: Crouch, Grossman, J. Nonlinear Sci. 3 (1993) 1; Munthe-Kaas, Appl. Numer. Math. 29 (1999) 115; Celledoni,
Marthinsen, Owren, Future Gener. Comput. Syst. 19 (2003) 341; Engo, Faltinsen, SIAM J. Numer. Anal. 39 (2001) 128 (heavy
top on coadjoint orbits).
"""

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from symtop.core.jit import register_jitable
from symtop.methods.framework.body import observe_turned
from symtop.methods.framework.lanes import Lanes, W, reading
from symtop.methods.framework.loop import Loop
from symtop.methods.framework.plan import OK
from symtop.methods.framework.registry import Integrator
from symtop.methods.framework.space import observe_attitude
from symtop.methods.lie_group.loop import (
    TURNED,
    UNSPUN,
    SpinForm,
    add_rotation,
    give_up,
    in_charts,
    lie_loop,
    moved,
    present_state,
    stepped,
)  # fmt: skip
from symtop.methods.runge_kutta.explicit import add, row_of, store, weighted_in_lanes
from symtop.methods.runge_kutta.pair_tables import DOP853, TSIT5
from symtop.methods.simd import wide_vectors
from symtop.methods.splitting import rotor
from symtop.methods.vectors import cross, dot, plus, scaled

CUBIC = tuple(1.0 / math.factorial(2 * k + 3) for k in range(9))  # C in powers of -a^2
NOUGHT, NO_SLOPE = (0.0,) * 3, (0.0,) * 6


@register_jitable
def half_square(element: Any) -> Any:
    """The square of half the angle of exp(w, f)."""
    return 0.25 * dot(element[:3], element[:3])


@register_jitable
def near(square: float) -> Any:
    """s, m and C of an exponential that turns by less than two radians, of the square of half the angle."""
    return (*rotor.near(square, 0.5), rotor.series(4.0 * square, CUBIC))


@register_jitable
def any_angle(square: float) -> Any:
    """`near` for any angle."""
    if square < 1.0:
        return near(square)
    x = math.sqrt(square)
    half = math.sin(0.5 * x)
    s, m = 0.5 * math.sin(x) / x, -2.0 * half * half
    return s, m, (1.0 - 2.0 * s * (1.0 + m)) / (4.0 * square)


@register_jitable
def times_exponential(product: Any, L: Any, element: Any, rotation: Any) -> Any:
    """A product of exponentials with one more, exp(w, f) of s, m and C: its rotation, the axis and the change of L."""
    (total, v, x, dL), (s, m, cubic), w, f = product, rotation, element[:3], element[3:]
    u, bent = scaled(s, w), cross(w, f)
    b = plus(plus(f, 2.0 * s * s, bent), cubic, cross(w, bent))
    x = plus(x, 1.0, moved(m, u, x))
    dL = plus(plus(dL, 1.0, moved(m, u, plus(L, 1.0, dL))), 1.0, cross(b, x))
    real = total + m + total * m - dot(u, v)
    return real, plus(plus(scaled(1.0 + m, v), 1.0 + total, u), 1.0, cross(u, v)), x, dL


@register_jitable
def _bracket(left: Any, right: Any) -> Any:
    """[(w, f), (x, g)] = (w x x, w x g + f x x)."""
    w, f, x, g = left[:3], left[3:], right[:3], right[3:]
    return (*cross(w, x), *plus(cross(w, g), 1.0, cross(f, x)))


@register_jitable
def dexp_inverse(element: Any, slope: Any, brackets: Any) -> Any:
    """dexp^-1 of an element of the algebra, two, four or six nested brackets of it, on another one."""
    once = _bracket(element, slope)
    twice = _bracket(element, once)
    result = add(add(slope, once, -0.5), twice, 1.0 / 12.0)
    if brackets > 2:
        four = _bracket(element, _bracket(element, twice))
        result = add(result, four, -1.0 / 720.0)
        if brackets > 4:
            result = add(result, _bracket(element, _bracket(element, four)), 1.0 / 30240.0)
    return result


@register_jitable
def _top_element(par: Any, L: Any) -> Any:
    """The element of se(3) that the field is at L."""
    return (*scaled(1.0 / par.I1, L), 0.0, 0.0, par.mgl)


@register_jitable
def _body_element(par: Any, M: Any) -> Any:
    """The element of se(3) of a body at M, in body axes (`framework.body`)."""
    return -par.a1 * M[0], -par.a2 * M[1], -par.a3 * M[2], -par.c1, -par.c2, -par.c3


Part = Callable[..., Any]


@register_jitable  # now, as the hash of a method's code must not depend on what has run
def _lay(par: Any, rule: Any, h: float, numbers: Any) -> None:
    i = 0
    for share in rule.shares:
        for weight in rule.weights:
            numbers[i] = (h * share) * weight
            i += 1


def _product(count: int, terms: int, first: int, stages: int) -> Part:
    """A function (e, L, slopes, row, j): the product of `count` exponentials, the last one, and 0 if all are near."""
    if count == 0:

        def multiply(e, L, slopes, row, j):  # type: ignore[no-untyped-def]
            return (0.0, NOUGHT, e, NOUGHT), NO_SLOPE, 0.0
    else:
        before = _product(count - 1, terms, first, stages)
        weighted = weighted_in_lanes(terms, first + (count - 1) * stages)

        def multiply(e, L, slopes, row, j):  # type: ignore[no-untyped-def]
            product, _, far = before(e, L, slopes, row, j)
            element = weighted(NO_SLOPE, slopes, row, j)
            square = half_square(element)
            return times_exponential(product, L, element, near(square)), element, far if square < 1.0 else 1.0

    return register_jitable(multiply)


def _stages(field: Part, counts: tuple[int, ...], stages: int, brackets: int) -> Part:
    """A function (par, e, L, row, j): the slopes of the stages, one more than `counts`, and 0 if all are near."""
    if not counts:

        def slopes(par, e, L, row, j):  # type: ignore[no-untyped-def]
            return (field(par, L),), 0.0
    else:
        before = _stages(field, counts[:-1], stages, brackets)
        multiply = _product(counts[-1], len(counts), sum(counts[:-1]) * stages, stages)

        def slopes(par, e, L, row, j):  # type: ignore[no-untyped-def]
            values, far = before(par, e, L, row, j)
            product, element, far_product = multiply(e, L, values, row, j)
            slope = field(par, plus(L, 1.0, product[3]))
            if brackets:
                slope = dexp_inverse(element, slope, brackets)
            return (*values, slope), max(far, far_product)

    return register_jitable(slopes)


@functools.cache
def _lanes_of_shape(field: Part, form: SpinForm, counts: tuple[int, ...], brackets: int) -> Lanes:
    stages, top, top_at = len(counts), form.top, reading(len(form.top._fields))
    slopes = _stages(field, counts[:-1], stages, brackets)
    multiply = _product(counts[-1], stages, sum(counts[:-1]) * stages, stages)

    def part(block, table, row):  # type: ignore[no-untyped-def]
        wide_vectors()
        for j in range(W):
            par, (q, e, L) = top(*top_at(table, 0, j)), present_state(block, j)
            stage_slopes, far = slopes(par, e, L, row, j)
            (m, v, _, dL), _, far_product = multiply(e, L, stage_slopes, row, j)
            add_rotation(block, j, q, m, v, dL)
            give_up(block, j, max(far, far_product) != 0.0)

    width = sum(counts) * stages
    return stepped(part, _lay, 0, width, carried=form, effort=lambda rule: len(rule.counts) * len(rule.shares))


class LieTable(NamedTuple):
    """Rows of weights, each of an exponential: those of the stages from the second on, then those of the step."""

    weights: tuple[float, ...]  # row by row, one entry a stage
    counts: tuple[float, ...]  # exponentials of each stage from the second on, and of the step
    brackets: float = 0.0  # 2, 4 or 6 for Munthe-Kaas
    shares: tuple[float, ...] = (1.0,)


def _begin(par: Any, rule: Any, state: Any, h: float) -> Any:
    return np.empty((len(rule.counts), 6))


def _loop(field: Part, form: SpinForm, observe: Callable[..., Any]) -> Loop:
    """The loop around a step with ``field(par, L)`` in se(3); the work counted is the number of force evaluations."""

    def turn(par, rule, e, L, slopes, h):  # type: ignore[no-untyped-def]
        stages, row = len(rule.counts), 0
        store(slopes, 0, field(par, L))
        product = 0.0, NOUGHT, e, NOUGHT
        for i in range(1, stages + 1):
            product, element = (0.0, NOUGHT, e, NOUGHT), NO_SLOPE
            for _ in range(int(rule.counts[i - 1])):
                element = NO_SLOPE
                for j in range(i):
                    element = add(element, row_of(slopes, j, NO_SLOPE), h * rule.weights[row + j])
                row += stages
                product = times_exponential(product, L, element, any_angle(half_square(element)))
            if i < stages:
                slope = field(par, plus(L, 1.0, product[3]))
                store(slopes, i, dexp_inverse(element, slope, rule.brackets) if rule.brackets > 0.0 else slope)
        return product[0], product[1], product[3], slopes, stages, OK

    def lanes(rule: LieTable) -> Lanes:
        return _lanes_of_shape(field, form, tuple(map(int, rule.counts)), int(rule.brackets))

    return lie_loop(turn, _begin, lanes, observe)


march, march_body = _loop(_top_element, UNSPUN, observe_attitude), _loop(_body_element, TURNED, observe_turned)


def lie_runge_kutta(
    name: str, rows: Sequence[Sequence[Sequence[float]]], order: int, summary: str, reference: str, *,
    brackets: int = 0,
) -> Integrator:  # fmt: skip
    """A method from its table: for each stage from the second on, and for the step, the weights of its exponentials.

    With `brackets` of dexp^-1 it is one of Munthe-Kaas, and a Butcher tableau, one exponential a row, makes it.
    """
    stages = len(rows)
    weights = [value for part in rows for row in part for value in (*row, *[0.0] * (stages - len(row)))]
    rule = LieTable(tuple(weights), tuple(float(len(part)) for part in rows), float(brackets))
    return Integrator(
        name=name, family="lie-group", summary=summary, reference=reference, order=order, explicit=True,
        symplectic=False, symmetric=False, conserves=frozenset({"p_psi", "axis_length"}),
        solvers=in_charts(march, rule, UNSPUN, 1, implicit=False, of_body=march_body),
        needs="group", general=True,
    )  # fmt: skip


def built_in() -> list[Integrator]:
    """Four methods of Munthe-Kaas, Crouch-Grossman's and the commutator-free one."""
    munthe_kaas = "munthe-kaas-1999 engo-faltinsen-2001"
    five, eight = (tuple((row,) for row in (*table.a[: len(table.b) - 1], table.b)) for table in (TSIT5, DOP853))
    return [
        lie_runge_kutta(
            "rkmk-se3-2", (((0.5,),), ((0.0, 1.0),)), 2,
            "Runge-Kutta-Munthe-Kaas on coadjoint orbits, the midpoint tableau", munthe_kaas, brackets=2,
        ),
        lie_runge_kutta(
            "rkmk-se3-4", (((0.5,),), ((0.0, 0.5),), ((0.0, 0.0, 1.0),), ((1 / 6, 1 / 3, 1 / 3, 1 / 6),)), 4,
            "Runge-Kutta-Munthe-Kaas on coadjoint orbits, Kutta's tableau", munthe_kaas, brackets=2,
        ),
        lie_runge_kutta(
            "rkmk-se3-5", five, 5, "Runge-Kutta-Munthe-Kaas on coadjoint orbits, Tsitouras's tableau",
            f"{munthe_kaas} tsitouras-2011", brackets=4,
        ),
        lie_runge_kutta(
            "rkmk-se3-8", eight, 8, "Runge-Kutta-Munthe-Kaas on coadjoint orbits, the tableau of DOP853",
            f"{munthe_kaas} hairer-norsett-wanner-1993", brackets=6,
        ),
        lie_runge_kutta(
            "crouch-grossman-3",
            (((3 / 4,),), ((119 / 216,), (0.0, 17 / 108)), ((13 / 51,), (0.0, -2 / 3), (0.0, 0.0, 24 / 17))), 3,
            "Crouch-Grossman: a product of exponentials, one for each coefficient", "crouch-grossman-1993",
        ),
        lie_runge_kutta(
            "commutator-free-4",
            (((0.5,),), ((0.0, 0.5),), ((0.5,), (-0.5, 0.0, 1.0)),
             ((1 / 4, 1 / 6, 1 / 6, -1 / 12), (-1 / 12, 1 / 6, 1 / 6, 1 / 4))), 4,
            "commutator-free Lie-group method, two exponentials for the step", "celledoni-marthinsen-owren-2003",
        ),
    ]  # fmt: skip
