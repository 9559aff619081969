"""Galerkin variational integrators with Gauss's quadrature: s = 2, 3, 4 and 6 nodes, order 2s.

The path of a step is a polynomial of degree s, and Gauss's rule on its nodes c_i, with weights b_i, sums the action:

    L_d(q0, q1) = ext h sum_i b_i L(Q_i, Q_i'),     Q_i = q0 + h sum_j a_ij Q_j',     q1 = q0 + h sum_i b_i Q_i'

The stationary path is that of the partitioned Runge-Kutta method with a and b_j - b_j a_ji/b_i, which is Gauss's
collocation on Hamilton's equations for every regular L, as b_i a_ij + b_j a_ji = b_i b_j. So p_phi and p_psi stay the
same inside a step, and it makes no difference whether they are eliminated before or after: what remains is, with
F_j = -V'(theta_j; p_phi, p_psi) of the effective potential,

    theta_i = theta0 + h c_i p_theta/I1 + (h^2/I1) sum_j (a a)_ij F_j
    theta1  = theta0 + h p_theta/I1 + (h^2/I1) sum_j b_j (1 - c_j) F_j,         p_theta1 = p_theta + h sum_j b_j F_j

and phi, psi move by h sum_j b_j phi'(theta_j) and so on. With x = theta/2 the step also sums

    dS = h sum_j b_j/(4 I1 cos^2 x_j),       dN = h sum_j b_j/(4 I1 sin^2 x_j)

in which the increments of phi and psi are linear in p_phi and p_psi: from these four a sample shows both again. Order
2s, symmetric, symplectic; energy is not kept, but its error is bounded. `gauss-4` and its kin are the same collocation
on other variables, (e, L), in which it keeps the energy and is not symplectic.

*Iteration.* Newton's on the F_j, with the analytic V''_i, from the polynomial through those of the last step:

    (1 + (h^2/I1) diag(V'') a a) dF = -V'(theta(F)) - F,          dtheta = (h^2/I1) (a a) dF

by elimination without pivots, two or three times a step; what follows from the last trial follows its correction to
first order. Where that does not converge, as when a long step meets a pole, the run ends as `not_converged`.
With P_k Legendre's polynomials on [0, 1] the Lagrange basis on the nodes is l_j(t) = b_j sum_(k<s) (2k+1) P_k(c_j)
P_k(t), whose integral is known, so that a and the predictor need no inverse of a matrix.
Sources: Marsden and West, Discrete mechanics and variational integrators, Acta Numerica 10 (2001) 357, section 2.6;
Hairer, Lubich, Wanner, Geometric Numerical Integration, section VI.6.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import legendre

from symtop.core.jit import register_jitable, set_item
from symtop.methods.framework.angles import ReducedTop, chart_outcome, momenta_of_turns, on_angles, require_chart
from symtop.methods.framework.loop import FixedStep, Loop
from symtop.methods.framework.newton import ANGLE_GRAIN, NEGLIGIBLE_ANGLE, Correction, newton_loop
from symtop.methods.framework.plan import Array
from symtop.methods.framework.preparation import LazyRule, Preparation, Presentation
from symtop.methods.framework.registry import Integrator
from symtop.methods.lagrangian.galerkin import node_at, pull_at
from symtop.methods.vectors import dot_of, each, total, zero

NODES = (2, 3, 4, 6)

Row = tuple[float, ...]


class Rule(NamedTuple):
    """The numbers of a method, in tuples, which are constants of its kernel."""

    c: Row
    b: Row
    reach: tuple[Row, ...]  # a a
    last: Row  # b (1 - c)
    predict: tuple[Row, ...]  # the last step's forces, continued to the nodes of this one
    tolerance: float = 1e-8
    iterations: int = 50


@functools.cache
def gauss_rule(s: int) -> Rule:
    """The rule of the method with s nodes, from the zeros of Legendre's polynomial."""
    x, w = legendre.leggauss(s)
    c, b = 0.5 * (x + 1.0), 0.5 * w
    k = np.arange(s)
    weights = (legendre.legvander(x, s - 1) * (2 * k + 1)).T * b  # (k, j)
    continuation = legendre.legvander(x + 2.0, s - 1)
    P = legendre.legvander(x, s)
    integrals: Array = np.empty((s, s))  # of P_k from 0 to c_i
    integrals[:, 0] = c
    integrals[:, 1:] = (P[:, 2:] - P[:, :-2]) / (2.0 * (2 * k[1:] + 1))
    a = integrals @ weights
    rows = [tuple(map(tuple, matrix.tolist())) for matrix in (a @ a, continuation @ weights)]
    return Rule(tuple(c.tolist()), tuple(b.tolist()), rows[0], tuple((b * (1.0 - c)).tolist()), rows[1])


class _Step(NamedTuple):
    par: ReducedTop
    rule: Rule
    theta: float
    momentum: float
    h: float
    lever: float  # h/I1


class _Trial(NamedTuple):
    """At one node; the last six times its weight."""

    force: float  # F
    stiffness: float  # V''
    south: float  # 1/(4 I1 cos^2 x)
    north: float  # 1/(4 I1 sin^2 x)
    roll: float  # phi' cos(theta)
    south_by: float  # the slopes of the three
    north_by: float
    roll_by: float


def _steady(par: Any, h: float) -> Any:
    return h, h / par.I1


def _open(par: Any, rule: Any, theta: float) -> Any:
    return (theta,)


def _equations(par: Any, rule: Any, state: Any, steady: Any, opened: Any) -> Any:
    return _Step(par, rule, state[0], state[1], steady[0], steady[1])


def _evaluation(s: int) -> Callable[..., Any]:
    """The trials at all s nodes."""
    product = dot_of(s)

    def node(i):  # type: ignore[no-untyped-def]
        return lambda step, forces: evaluate(step, step.rule.c[i], step.rule.b[i], product(step.rule.reach[i], forces))

    @register_jitable
    def evaluate(step, c, b, force_sum):  # type: ignore[no-untyped-def]
        par = step.par
        momentum = c * step.momentum + step.h * force_sum
        node = node_at(par, step.theta + step.lever * momentum)
        pull = pull_at(par, node, par.south, par.north)
        precession, bend = node.d * par.south + node.a * par.north, pull.south + pull.north
        return _Trial(
            -pull.slope, pull.stiffness, b * node.d, b * node.a, b * (precession * node.cosine),
            b * (node.d * node.tangent), -b * (node.a / node.tangent),
            b * (bend * node.cosine - precession * node.sine),
        )  # fmt: skip

    return each(node, s)


def _elimination(s: int) -> Callable[..., Any]:
    """A function that solves s equations, in rows of s + 1 numbers, the last of them the right-hand side."""
    if s == 1:
        return register_jitable(lambda rows: (rows[0][1] / rows[0][0],))
    reduce_row = each(lambda j: lambda row, factor, first: row[j + 1] - factor * first[j + 1], s)
    reduce_all = each(lambda i: lambda rows, inverse: reduce_row(rows[i + 1], rows[i + 1][0] * inverse, rows[0]), s - 1)
    solve_below, subtract = _elimination(s - 1), total(lambda j: lambda row, x: -(row[j + 1] * x[j]), s - 1)

    @register_jitable
    def solve(rows):  # type: ignore[no-untyped-def]
        inverse = 1.0 / rows[0][0]
        x = solve_below(reduce_all(rows, inverse))
        return (subtract(rows[0][s], rows[0], x) * inverse, *x)

    return solve


def _correction(s: int) -> Callable[..., Any]:
    """Newton's correction with s nodes."""
    product, solve = dot_of(s), _elimination(s)
    row = each(lambda j: lambda stiffness, reach: stiffness * reach[j], s)

    def equation(i):  # type: ignore[no-untyped-def]
        def equation(step, trial, forces, scale):  # type: ignore[no-untyped-def]
            left = row(scale * trial[i].stiffness, step.rule.reach[i])
            return (*set_item(left, i, left[i] + 1.0), trial[i].force - forces[i])

        return equation

    rows = each(equation, s)
    add = each(lambda i: lambda forces, change: forces[i] + change[i], s)
    size = total(lambda i: lambda shift: abs(shift[i]), s)
    turning = each(lambda i: lambda step, change, scale: scale * product(step.rule.reach[i], change), s)

    def correct(step, trial, forces):  # type: ignore[no-untyped-def]
        scale = step.lever * step.h
        change = solve(rows(step, trial, forces, scale))
        after, shift, largest = add(forces, change), turning(step, change, scale), 0.0
        for i in range(s):
            largest = max(largest, abs(after[i]))
        enough = step.rule.tolerance * (abs(step.lever * step.momentum) + scale * largest) + NEGLIGIBLE_ANGLE
        return Correction(shift, after, size(0.0, shift), enough, ANGLE_GRAIN)

    return correct


def _prediction(s: int) -> Callable[..., Any]:
    """The last step's forces, continued."""
    product = dot_of(s)
    return each(lambda i: lambda step, carry: product(step.rule.predict[i], carry), s)


def _no_forces(step: Any) -> Any:
    return zero(step.rule.c)


def _keeping(s: int) -> Callable[..., Any]:
    """The last trial with the last correction added to first order; the remainder is its square."""
    south = total(lambda i: lambda trial, shift: trial[i].south + trial[i].south_by * shift[i], s)
    north = total(lambda i: lambda trial, shift: trial[i].north + trial[i].north_by * shift[i], s)
    roll = total(lambda i: lambda trial, shift: trial[i].roll + trial[i].roll_by * shift[i], s)

    def keep(trial, correction):  # type: ignore[no-untyped-def]
        shift = correction.change
        return (*correction.after, south(0.0, trial, shift), north(0.0, trial, shift), roll(0.0, trial, shift))

    return keep


def _closing(s: int) -> Callable[..., Any]:
    """The increment of a step, and the forces that the next one begins with."""
    product = dot_of(s)

    def close(step, end):  # type: ignore[no-untyped-def]
        h, par = step.h, step.par
        south, north = h * end[s], h * end[s + 1]
        d = step.lever * (step.momentum + h * product(step.rule.last, end))
        turn = south * par.south + north * par.north
        dstate = (d, h * product(step.rule.b, end), turn, h * (par.p_psi / par.I3 - end[s + 2]), south, north)
        return dstate, end[:s], chart_outcome(step.theta + d)

    return close


def begin(par: Any, rule: Any, state: Any, h: float) -> Any:
    """The force at the start, for each force of a step before, and once more, so that no tuple is empty in lanes."""
    force, forces = -pull_at(par, node_at(par, state[0]), par.south, par.north).slope, rule.c
    for i in range(len(forces)):
        forces = set_item(forces, i, force)
    return (*forces, force)


def observe(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """p_phi and p_psi by the discrete Legendre transform."""
    return momenta_of_turns(par, dstate[5], dstate[4], h, dstate)


_reduced = on_angles.numbers


@register_jitable
def _prepare_sums(top: Any, at: Any) -> Any:
    par, state = _reduced(top, at)
    return par, (*state, 0.0, 0.0)


with_sums = Preparation(_prepare_sums, 6, require_chart)
to_angles = Presentation(lambda _par, _t, y: (y[0], y[1], y[2], y[3]), 4)


@functools.cache
def loop(s: int) -> Loop:
    """The loop of the method with s nodes, on (theta, p_theta, phi, psi, S, N)."""
    return newton_loop(
        begin, observe, constants=_steady, start=_open, equation=_equations, predict=_prediction(s),
        evaluate=_evaluation(s), correct=_correction(s), restart=_no_forces, keep=_keeping(s), close=_closing(s),
        top=ReducedTop, dimension=6, steady=2, opened=1, unknowns=s, ends=s + 3, newest=s, carry=s + 1,
    )  # fmt: skip


def built_in() -> list[Integrator]:
    """galerkin-gauss-4, -6, -8 and -12, named after their orders."""
    rules = {s: LazyRule(functools.partial(gauss_rule, s)) for s in NODES}
    return [
        Integrator(
            name=f"galerkin-gauss-{2 * s}", family="discrete-lagrangian",
            summary=f"Galerkin discrete Lagrangian, polynomial of degree {s} and Gauss's rule with {s} nodes",
            solvers={"angles": FixedStep(loop(s), rule, with_sums, s, implicit=True, present=to_angles)},
            order=2 * s, explicit=False, symplectic=True, symmetric=True, conserves=frozenset({"p_phi", "p_psi"}),
            reference="marsden-west-2001 hairer-lubich-wanner-2006", needs="lagrangian", general=True,
        )
        for s, rule in rules.items()
    ]  # fmt: skip
