"""Explicit Runge-Kutta steps, each projected onto the constants of the motion, on the state (e, L).

    y~ = y + h sum_i b_i k_i,    y+ = y~ + sum_j t_j D c_j,    g(y+) = 0,    g = ((|e|^2 - 1)/2, L.e - p_psi, H - E)

p_phi = L_z is linear, so that the Runge-Kutta step keeps it, and no correction moves it. The c_j are the gradients of g
at y~ without their part along L_z, made orthogonal one after another; lengths of L are in units of s,

    (u, v) = u_e.v_e + s^2 (u_x v_x + u_y v_y),    D = (1, 1, 1, s^2, s^2, 0),    s^2 = |L|^2 + I1 |mgl| at the start,

as the corrections of e have no unit and those of L have. The t_j follow from simplified Newton iteration, two passes
with the same c_j, which leave g at the order of e^3 of a step's error e. A gradient that depends on those before it,
as L.e does on an upright top and H in a steady precession, changes g by no first order, and is left out.

f(t, y) does not suffice: a user supplies the constants and their gradients, too. A step is neither symmetric nor
symplectic; on the top, whose motion has as many constants as its phase space leaves room for, the error of the phase
grows linearly with time, where that of the step without projection grows quadratically.
Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, section IV.4.
"""

from dataclasses import replace
from typing import Any, NamedTuple

from symtop.core.jit import register_jitable
from symtop.methods.framework.equations import FORMS
from symtop.methods.framework.loop import FixedStep
from symtop.methods.framework.preparation import Preparation
from symtop.methods.framework.registry import Integrator
from symtop.methods.framework.space import L_at, e_at
from symtop.methods.runge_kutta.pairs import DOP853_PAIR, VERN9_PAIR, loop_of
from symtop.methods.vectors import dot, summed

SMALL_PART = 1e-8  # a gradient depends on those before it if less than this part of its square is normal to them
AXIS = FORMS["axis"]


class Levels(NamedTuple):
    """The numbers of a top, its constants of the motion, and s^2."""

    I1: float
    mgl: float
    p_psi: float
    energy: float
    weight: float


@register_jitable
def _levels(top: Any, at: Any) -> Any:
    e, L = e_at(at), L_at(top, at)
    square = dot(L, L)
    energy = 0.5 * square / top.I1 + top.mgl * e[2]
    return Levels(top.I1, top.mgl, dot(L, e), energy, square + top.I1 * abs(top.mgl)), (*e, *L)


on_levels = Preparation(_levels, 6)


@register_jitable
def _product(par: Any, u: Any, v: Any) -> Any:
    """(u, v) of vectors of five components, in which L_z is left out."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2] + par.weight * (u[3] * v[3] + u[4] * v[4])


@register_jitable
def _without(u: Any, part: Any, v: Any) -> Any:
    """u - part v."""
    return u[0] - part * v[0], u[1] - part * v[1], u[2] - part * v[2], u[3] - part * v[3], u[4] - part * v[4]


@register_jitable
def _inverse(part: Any, square: Any) -> Any:
    """1/part, of the square of a gradient's own part; 0 where that is below `SMALL_PART` times its whole `square`."""
    return 1.0 / part if part > SMALL_PART * square else 0.0


@register_jitable
def projected(par: Any, state: Any, step: Any) -> Any:
    """The step with the correction that brings its end back onto the constants."""
    end = summed(state, step)
    a, L = 1.0 / par.I1, end[3:]
    g1 = end[0], end[1], end[2], 0.0, 0.0
    g2 = L[0], L[1], L[2], end[0], end[1]
    g3 = 0.0, 0.0, par.mgl, a * L[0], a * L[1]
    # Gram-Schmidt; what is left out has a multiplier of 0
    i1 = 1.0 / _product(par, g1, g1)
    p21 = _product(par, g2, g1)
    c2 = _without(g2, p21 * i1, g1)
    i2 = _inverse(_product(par, c2, c2), _product(par, g2, g2))
    p31, p32 = _product(par, g3, g1), _product(par, g3, c2)
    c3 = _without(_without(g3, p31 * i1, g1), p32 * i2, c2)
    i3 = _inverse(_product(par, c3, c3), _product(par, g3, g3))
    for _ in range(2):
        e, L = end[:3], end[3:]
        t1 = 0.5 * (1.0 - dot(e, e)) * i1
        t2 = (par.p_psi - dot(L, e) - p21 * t1) * i2
        t3 = (par.energy - 0.5 * a * dot(L, L) - par.mgl * e[2] - p31 * t1 - p32 * t2) * i3
        shift = _without(_without(_without((0.0, 0.0, 0.0, 0.0, 0.0), -t1, g1), -t2, c2), -t3, c3)
        step = summed(step, (shift[0], shift[1], shift[2], par.weight * shift[3], par.weight * shift[4], 0.0))
        end = summed(state, step)
    return step


def built_in() -> list[Integrator]:
    """Two pairs with fixed steps, projected."""
    methods = []
    for pair, name in ((DOP853_PAIR, "dop853-projected"), (VERN9_PAIR, "vern9-projected")):
        method = pair.fixed()
        solver: Any = method.solvers["axis"]
        loop = loop_of(AXIS._replace(prepare=on_levels, top=Levels), pair.table, projected)
        methods.append(replace(
            method, name=name, summary=f"{pair.summary} with fixed steps, projected onto the constants of the motion",
            solvers={"axis": FixedStep(loop, solver.rule, on_levels, 1, implicit=False)},
            conserves=frozenset({"energy", "p_phi", "p_psi", "axis_length"}), needs="constants", general=False,
            reference=f"{method.reference} hairer-lubich-wanner-2006",
        ))  # fmt: skip
    return methods
