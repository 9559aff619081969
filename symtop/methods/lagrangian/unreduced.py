"""Variational integrators of the heavy top from any quadrature rule, with nothing eliminated.

The same discrete Lagrangian as `discrete_lagrangian`, stepped as a system in all three angles. The unknown is the
mean rate (w, v, u) = (dtheta, dphi, dpsi)/h; with theta_i = theta + a_i h w (c = cos, s = sin) and the derivatives

    f = dL/dtheta = s [(I1-I3) v^2 c - I3 u v + mgl],   l = dL/dphi' = (I1 s^2 + I3 c^2) v + I3 c u,   m = I3 (u + c v)

the step is p0 = -D1 L_d, solved by Newton with an analytic 3 x 3 Jacobian, and then p1 = D2 L_d:

    p_theta0 = I1 w - h sum w_i (1-a_i) f_i,    p_phi0 = sum w_i l_i,    p_psi0 = sum w_i m_i
    p_theta1 = I1 w + h sum w_i a_i f_i,        p_phi1 = sum w_i l_i,    p_psi1 = sum w_i m_i

All three momenta are variables of the state: p_phi and p_psi are conserved only as far as the equations were solved.
Order 2, symplectic, symmetric if the rule is. It is there to check the reduced kernel: in exact arithmetic both are one
map. It is not a method to use: its solver iterates more often (the study `reduction` measures both), p1 is formed at
full size, so that no compensated sum undoes its rounding, and p_phi - p_psi cos(theta) cancels near a pole. Friction of
the bearings (`damped_top`) is part of the equations; it is zero for the methods of the registry.
Source: Marsden and West, Discrete mechanics and variational integrators, Acta Numerica 10 (2001) 357.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from symtop.core.errors import SymtopError
from symtop.core.jit import register_jitable
from symtop.methods.framework.angles import chart_outcome, require_chart
from symtop.methods.framework.loop import FixedStep, Loop
from symtop.methods.framework.newton import Correction, newton
from symtop.methods.framework.plan import NOT_CONVERGED
from symtop.methods.framework.preparation import Preparation, Presentation, conserved
from symtop.methods.framework.registry import Integrator
from symtop.methods.lagrangian.discrete_lagrangian import built_in as reduced_methods, rule_of

NEGLIGIBLE_RATE = 0.25 * float(np.finfo(float).eps)  # relative to the rates: a correction that changes nothing


class _Sums(NamedTuple):
    before: float  # sum w (1-a) f
    after: float  # sum w a f
    stiffness: float  # sum w (1-a) a df/dtheta
    before_v: float  # sum w (1-a) df/dv
    before_u: float
    after_v: float  # sum w a df/dv, which is dl/dtheta seen from theta1
    after_u: float
    across: float  # sum w (I1 s^2 + I3 c^2)
    mixed: float  # I3 sum w c


@register_jitable
def _node_sums(par: Any, rule: Any, theta: float, rate: Any, h: float) -> Any:
    before = after = stiffness = before_v = before_u = after_v = after_u = across = mixed = 0.0
    w, v, u = rate
    spread = par.I1 - par.I3
    for i in range(len(rule.nodes)):
        a, share = rule.nodes[i], rule.weights[i]
        place = theta + a * (h * w)
        s, c = np.sin(place), np.cos(place)
        left, right = share * (1.0 - a), share * a
        bracket = v * (spread * v * c - par.I3 * u) + par.mgl
        force_v = s * (2.0 * spread * v * c - par.I3 * u)
        force_u = -par.I3 * s * v
        before += left * s * bracket
        after += right * s * bracket
        stiffness += left * a * (c * bracket - spread * v * v * s * s)
        before_v += left * force_v
        before_u += left * force_u
        after_v += right * force_v
        after_u += right * force_u
        across += share * (par.I1 * s * s + par.I3 * c * c)
        mixed += share * par.I3 * c
    return _Sums(before, after, stiffness, before_v, before_u, after_v, after_u, across, mixed)


@register_jitable
def _solve(first: Any, second: Any, third: Any, right: Any) -> Any:
    """Elimination from the last row up; the pivots are positive: I3, the inertia with psi eliminated, and nearly I1."""
    upper, lower = second[2] / third[2], first[2] / third[2]
    pivot = second[1] - upper * third[1]
    middle = first[1] - lower * third[1]
    reduced = right[1] - upper * right[2]
    factor = middle / pivot
    slope = second[0] - upper * third[0]
    x = (right[0] - lower * right[2] - factor * reduced) / (first[0] - lower * third[0] - factor * slope)
    y = (reduced - slope * x) / pivot
    return x, y, (right[2] - third[0] * x - third[1] * y) / third[2]


@register_jitable
def _correction(par: Any, sums: Any, rate: Any, momentum: Any, h: float) -> Any:
    """Newton's correction to the rates; half a step of friction stands beside the inertia."""
    w, v, u = rate
    across, along = sums.across + 0.5 * h * par.c_phi, par.I3 + 0.5 * h * par.c_psi
    residual = (
        momentum[0] - par.I1 * w + h * sums.before,
        momentum[1] - across * v - sums.mixed * u,
        momentum[2] - sums.mixed * v - along * u,
    )
    return _solve(
        (par.I1 - h * h * sums.stiffness, -h * sums.before_v, -h * sums.before_u),
        (h * sums.after_v, across, sums.mixed),
        (h * sums.after_u, sums.mixed, along),
        residual,
    )


@register_jitable
def _rates(par: Any, state: Any) -> Any:
    """theta', phi', psi' at the start of a step, from the momenta there."""
    s, c = np.sin(state[0]), np.cos(state[0])
    precession = (state[4] - state[5] * c) / (par.I1 * s * s)
    return state[3] / par.I1, precession, state[5] / par.I3 - precession * c


def begin(par: Any, rule: Any, state: Any, h: float) -> Any:
    """The rates at the start, as a history for the predictor."""
    rate = _rates(par, state)
    return (rate, rate, rate)


@register_jitable
def _evaluate(step: Any, rate: Any) -> Any:
    par, rule, state, h = step
    return _node_sums(par, rule, state[0], rate, h)


@register_jitable
def _restart(step: Any) -> Any:
    return _rates(step[0], step[2])


@register_jitable
def _correct(step: Any, sums: Any, rate: Any) -> Any:
    """Newton's correction, whose size is compared with the rates, until it no longer falls.

    p1 comes from the sums whose residual has converged. If the iteration stopped as in the reduced kernel, after a
    correction of 1e-8, p_phi of `goldstein` would drift linearly, 2e-12 in 1e6 steps at h = 0.01 against 3e-13.
    """
    (par, rule, state, h), (w, v, u) = step, rate
    dw, dv, du = _correction(par, sums, rate, state[3:], h)
    change, size = abs(dw) + abs(dv) + abs(du), abs(w) + abs(v) + abs(u)
    return Correction((dw, dv, du), (w + dw, v + dv, u + du), change, NEGLIGIBLE_RATE * size, rule.tolerance * size)


def increment(par: Any, rule: Any, state: Any, carry: Any, h: float) -> Any:
    """One step on (theta, phi, psi, p_theta, p_phi, p_psi); the work counted is the number of Newton iterations.

    D2 L_d and the friction come from the sums and from nothing else: that momenta balance is a result, not an input.
    """
    # the rates are smooth in time: the parabola through their last three values predicts the next ones
    near, far, farther = carry
    guess = (
        3.0 * (near[0] - far[0]) + farther[0],
        3.0 * (near[1] - far[1]) + farther[1],
        3.0 * (near[2] - far[2]) + farther[2],
    )
    step = par, rule, state, h
    rate, sums, _, work, converged = newton(_evaluate, _correct, _restart, step, guess, rule.iterations)
    w, v, u = rate
    outcome = chart_outcome(state[0] + h * w) if converged else NOT_CONVERGED
    p_phi = sums.across * v + sums.mixed * u - 0.5 * h * par.c_phi * v
    p_psi = sums.mixed * v + par.I3 * u - 0.5 * h * par.c_psi * u
    dstate = (h * w, h * v, h * u, par.I1 * w + h * sums.after - state[3], p_phi - state[4], p_psi - state[5])
    return dstate, (rate, carry[0], carry[1]), work, outcome


def observe(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """p_phi and p_psi as the step left them."""
    return before[4] + dstate[4], before[5] + dstate[5]


march = Loop(begin, increment, observe)


class DampedTop(NamedTuple):
    """The top and viscous coefficients of its bearings, for precession and for spin."""

    I1: float
    I3: float
    mgl: float
    c_phi: float
    c_psi: float


def _prepare_momenta(top: Any, at: Any) -> Any:
    momenta = conserved(top, at)
    return DampedTop(top.I1, top.I3, top.mgl, 0.0, 0.0), (
        at.theta, at.phi, at.psi, top.I1 * at.theta_dot, momenta.p_phi, momenta.p_psi,
    )  # fmt: skip


with_momenta = Preparation(_prepare_momenta, 6, require_chart)
# (theta, p_theta, phi, psi) of the six state variables; p_phi and p_psi are columns of their own
in_angles = Presentation(lambda _par, _t, y: (y[0], y[3], y[1], y[2]), 4)


def unreduced(method: Integrator) -> Integrator:
    """A method that `discrete_lagrangian` made, stepped in all three angles."""
    rule = rule_of(method)
    if rule is None:
        raise SymtopError(f"unreduced takes a method that discrete_lagrangian made, not {method.name!r}")
    return replace(
        method,
        name=f"{method.name}-unreduced",
        summary=f"{method.summary}, in all three angles with nothing eliminated",
        solvers={"angles": FixedStep(march, rule, with_momenta, len(rule.nodes), implicit=True, present=in_angles)},
        modified_energy=None,
        about="",
    )


def built_in() -> list[Integrator]:
    """The unreduced forms of two reduced methods."""
    return [unreduced(method) for method in reduced_methods() if method.name in {"midpoint", "trapezoidal"}]
