"""Runge-Kutta methods on the group SE(3), whose coadjoint orbits the top moves on: RKMK, Crouch-Grossman, CF4.

The vector field on (e, L) is at each point that of an element (w, f) of the algebra se(3),

    e' = w x e,   L' = w x L + f x e,        w = L/I1,  f = mgl k,

and with w and f held fixed its flow over a unit of time is known, the action of exp(w, f):

    e <- R e,   L <- R L + b x R e,      R = exp(w),   b = (1 + B w x + C w x w x) f,
    B = (1 - cos a)/a^2,   C = (a - sin a)/a^3,   a = |w|.

Every such flow keeps |e| and L.e, the Casimirs of se(3)*, whatever w and f are. So does a method that is made of them;
p_phi = L_z and the energy drift. With F_j the algebra element at stage j:

    Crouch-Grossman   y_i = exp(h a_i,i-1 F_i-1) ... exp(h a_i1 F_1) y            one exponential a coefficient
    commutator-free   y_i = ... exp(h sum_j w_2j F_j) exp(h sum_j w_1j F_j) y     few exponentials of sums
    Munthe-Kaas       y_i = exp(U_i) y,  U_i = h sum_j a_ij K_j,  K_i = F_i - [U_i, F_i]/2 + [U_i, [U_i, F_i]]/12

The last is a method for the element U that the solution is the exponential of, U' = dexp^-1_U F; of dexp^-1 two
brackets suffice for order 4. A table is rows of weights, one row an exponential, so that one kernel steps all three.
The engines' `rkmk4` acts with SO(3) x R^3 on body rates instead: another group, which keeps |e| and L.e for that body
alone and turns the spin in its stages.
Sources: Crouch, Grossman, J. Nonlinear Sci. 3 (1993) 1; Munthe-Kaas, Appl. Numer. Math. 29 (1999) 115; Celledoni,
Marthinsen, Owren, Future Gener. Comput. Syst. 19 (2003) 341; Engo, Faltinsen, SIAM J. Numer. Anal. 39 (2001) 128 (heavy
top on coadjoint orbits).
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from symtop.core.jit import register_jitable
from symtop.methods.framework.outcomes import OK
from symtop.methods.framework.registry import Integrator
from symtop.methods.lie_group.lie_exponentials import NOUGHT, acted, any_angle, bent_back, half_square
from symtop.methods.lie_group.lie_loop import UNSPUN, in_both_charts, lie_loop
from symtop.methods.lie_group.lie_runge_kutta_lanes import in_lanes
from symtop.methods.vectors import plus, scaled


class LieTable(NamedTuple):
    """Rows of weights, each of an exponential: those of the stages from the second on, then those of the step."""

    weights: tuple[float, ...]  # row by row, one entry a stage
    counts: tuple[float, ...]  # exponentials of each stage from the second on, and of the step
    bent: float = 0.0  # 1 for Munthe-Kaas
    shares: tuple[float, ...] = (1.0,)


@register_jitable
def _store(slopes: Any, i: int, w: Any, f: Any) -> None:
    """Write an element of the algebra into row i."""
    for k in range(3):
        slopes[i, k], slopes[i, 3 + k] = w[k], f[k]


def begin(par: Any, rule: Any, state: Any, h: float) -> Any:
    """Working space for the elements of the stages."""
    return np.empty((len(rule.counts), 6))


def turn(par: Any, rule: Any, e: Any, L: Any, slopes: Any, h: float) -> Any:
    """One step; the work counted is the number of force evaluations."""
    stages, row = len(rule.counts), 0
    f0 = 0.0, 0.0, par.mgl
    _store(slopes, 0, scaled(1.0 / par.I1, L), f0)
    made = 0.0, NOUGHT, e, NOUGHT
    for i in range(1, stages + 1):
        made = 0.0, NOUGHT, e, NOUGHT
        w, f = NOUGHT, NOUGHT
        for _ in range(int(rule.counts[i - 1])):
            w, f = NOUGHT, NOUGHT
            for j in range(i):
                weight = h * rule.weights[row + j]
                w = plus(w, weight, (slopes[j, 0], slopes[j, 1], slopes[j, 2]))
                f = plus(f, weight, (slopes[j, 3], slopes[j, 4], slopes[j, 5]))
            row += stages
            made = acted(made, L, w, f, any_angle(half_square(w)))
        if i < stages:
            slope, g = scaled(1.0 / par.I1, plus(L, 1.0, made[3])), f0
            if rule.bent != 0.0:
                slope, g = bent_back(w, f, slope, g)
            _store(slopes, i, slope, g)
    return made[0], made[1], made[3], stages, OK


march = lie_loop(turn, begin, in_lanes)


def lie_runge_kutta(
    name: str, rows: Sequence[Sequence[Sequence[float]]], order: int, summary: str, reference: str, *,
    bent: bool = False,
) -> Integrator:  # fmt: skip
    """A method from its table: for each stage from the second on, and for the step, the weights of its exponentials."""
    stages = len(rows)
    weights = [value for part in rows for row in part for value in (*row, *[0.0] * (stages - len(row)))]
    rule = LieTable(tuple(weights), tuple(float(len(part)) for part in rows), float(bent))
    return Integrator(
        name=name, family="lie-group", summary=summary, reference=reference, order=order, explicit=True,
        symplectic=False, symmetric=False, conserves=frozenset({"p_psi", "axis_length"}),
        solvers=in_both_charts(march, rule, UNSPUN, 1, implicit=False),
    )  # fmt: skip


def built_in() -> list[Integrator]:
    """Two methods of Munthe-Kaas, Crouch-Grossman's and the commutator-free one."""
    munthe_kaas = "munthe-kaas-1999 engo-faltinsen-2001"
    return [
        lie_runge_kutta(
            "rkmk-se3-2", (((0.5,),), ((0.0, 1.0),)), 2,
            "Runge-Kutta-Munthe-Kaas on coadjoint orbits, the midpoint tableau", munthe_kaas, bent=True,
        ),
        lie_runge_kutta(
            "rkmk-se3-4", (((0.5,),), ((0.0, 0.5),), ((0.0, 0.0, 1.0),), ((1 / 6, 1 / 3, 1 / 3, 1 / 6),)), 4,
            "Runge-Kutta-Munthe-Kaas on coadjoint orbits, Kutta's tableau", munthe_kaas, bent=True,
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
