"""Variational integrators of the heavy top from any quadrature rule, reduced exactly to one equation.

A rule with nodes a_i and weights w_i (sum w = 1) on the straight line from q0 to q1 gives

    L_d(q0, q1) = h sum_i w_i L(q0 + a_i (q1 - q0), (q1 - q0)/h)

and the step is p0 = -D1 L_d, p1 = D2 L_d. phi and psi are cyclic: their discrete momenta are conserved and
their increments follow from p_phi, p_psi and theta alone, so what remains is one scalar equation for
d = theta1 - theta0. With sums over the nodes theta_i = theta0 + a_i d (c = cos, s = sin),

    C = sum w c,  S = sum w s^2,  Y = sum w c^2 - C^2,  D = I1 S + I3 Y
    v = dphi/h = (p_phi - p_psi C)/D,                    dpsi = h (p_psi/I3 - v C)
    W0 = sum w (1-a) s [v p_psi - mgl - v^2 ((I1-I3) c + I3 C)],   W1 the same with a for 1-a
    p_theta0 = I1 d/h + h W0   (Newton, analytic slope),           p_theta1 = p_theta0 - h (W0 + W1)

`midpoint` is a = (1/2), w = (1); `trapezoidal` is a = (0, 1), w = (1/2, 1/2); `simpson-linear` is a = (0, 1/2, 1),
w = (1/6, 2/3, 1/6) and gains no order from its better quadrature, because the path is still a straight line (see
`galerkin`). All are symmetric, symplectic, of order 2, and conserve p_phi and p_psi exactly. The midpoint rule
equals the implicit midpoint rule on the reduced Hamiltonian (reduction and discretisation commute); the trapezoidal
rule does *not* commute with the reduction and must not be confused with Stormer-Verlet, which is explicit.

The start is p0 = dL/dq' (the discrete Legendre transform); starting from q1 = q0 + h q0' instead costs an order.
p_phi - p_psi C is formed as north sum w cos^2(theta/2) + south sum w sin^2(theta/2), and Y from the spread of
sin^2(theta/2) about its first value: no cancellation at the poles. A term whose weight the rule makes zero is not
added. Source: Marsden and West, Discrete mechanics and variational integrators, Acta Numerica 10 (2001) 357.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from symtop.core.errors import SymtopError, row
from symtop.core.jit import register_jitable
from symtop.core.jit_functions import fused
from symtop.core.sines import sincos
from symtop.methods.framework.angles import ReducedTop, chart_outcome, on_angles
from symtop.methods.framework.loop import FixedStep, inside
from symtop.methods.framework.newton import ANGLE_GRAIN, NEGLIGIBLE_ANGLE, Correction, newton_loop
from symtop.methods.framework.plan import Array
from symtop.methods.framework.registry import Integrator
from symtop.model.charts import View
from symtop.model.top import Momenta

RULES = {  # on [0, 1]: nodes a_i, weights w_i, and a line of words
    "midpoint": ((0.5,), (1.0,), "discrete Lagrangian, midpoint rule"),
    "trapezoidal": ((0.0, 1.0), (0.5, 0.5), "discrete Lagrangian, trapezoidal rule"),
    "simpson-linear": (
        (0.0, 0.5, 1.0), (1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0),
        "discrete Lagrangian, Simpson's rule on a straight line (order 2: the line limits it)",
    ),
}  # fmt: skip


class Quadrature(NamedTuple):
    """Nodes and weights of a rule on [0, 1], and the stop rule of its Newton iteration.

    It stops after a correction below `tolerance` times the step's increment. Newton converges quadratically and the
    last correction is applied to first order, so 1e-8 leaves only rounding.
    """

    nodes: tuple[float, ...]
    weights: tuple[float, ...]
    tolerance: float = 1e-8
    iterations: int = 50


def quadrature(nodes: Sequence[float], weights: Sequence[float]) -> tuple[Quadrature, bool]:
    """The checked rule with its nodes in order, and whether it reads the same from both ends."""
    points, shares = tuple(row("nodes", nodes)), tuple(row("weights", weights))
    if len(points) != len(shares) or not points:
        raise SymtopError(f"nodes and weights must be equally many, at least one, not {len(points)} and {len(shares)}")
    if not all(0.0 <= node <= 1.0 for node in points):
        raise SymtopError(f"nodes must lie in [0, 1], not {points}")
    if abs(math.fsum(shares) - 1.0) > 1e-14:
        raise SymtopError(f"weights must sum to 1, not {math.fsum(shares)!r}")
    pairs = sorted(zip(points, shares, strict=True))
    mirror = sorted((1.0 - node, share) for node, share in pairs)
    symmetric = all(abs(a - c) + abs(b - d) < 1e-15 for (a, b), (c, d) in zip(pairs, mirror, strict=True))
    points, shares = (tuple(column) for column in zip(*pairs, strict=True))
    return Quadrature(points, shares), symmetric


NEGATIVE_ZERO = -0.0  # initial value of a sum: the compiler drops an addition to -0, but not to +0, as -0 + 0 = 0
NONE_OPENED = (NEGATIVE_ZERO,) * 6


class Sums(NamedTuple):
    """Sums over the nodes; `start` or `end` in a name means the weight w (1-a) or w a."""

    high: float  # sum w cos^2(theta/2)
    low: float  # sum w sin^2(theta/2)
    cosine: float  # C
    square_sine: float  # S
    variance: float  # Y, of the cosine
    sine_start: float  # sum w (1-a) s
    sine_end: float  # sum w a s
    product_start: float  # sum w (1-a) s c
    product_end: float  # sum w a s c
    sine_start_slope: float  # slopes of these four with respect to d
    sine_end_slope: float
    product_start_slope: float
    product_end_slope: float


@register_jitable
def opening(par: Any, rule: Any, theta: float) -> Any:
    """The contributions to the sums of nodes at the start of the step, which no iteration changes."""
    first = high = low = square_sine = sine_start = product_start = NEGATIVE_ZERO
    if rule.nodes[0] == 0.0:
        sin_x, cos_x = sincos(0.5 * theta)
        sin2_x, cos2_x = sin_x * sin_x, cos_x * cos_x
        s, c = 2.0 * sin_x * cos_x, cos2_x - sin2_x
        first = sin2_x
        for i in range(len(rule.nodes)):
            if rule.nodes[i] == 0.0:
                w = rule.weights[i]
                high += w * cos2_x
                low += w * sin2_x
                square_sine += w * s * s
                sine_start += w * s
                product_start += w * s * c
    return first, high, low, square_sine, sine_start, product_start


@register_jitable
def node_sums(rule: Any, theta: float, d: float, opened: Any) -> Any:
    """All sums over the nodes, beginning with the contributions of `opening`."""
    first, high, low, square_sine, sine_start, product_start = opened
    sine_end = product_end = shift = square = NEGATIVE_ZERO
    sine_start_slope = sine_end_slope = product_start_slope = product_end_slope = NEGATIVE_ZERO
    for i in range(len(rule.nodes)):
        a, w = rule.nodes[i], rule.weights[i]
        if a > 0.0:
            sin_x, cos_x = sincos(0.5 * (theta + a * d))
            sin2_x, cos2_x = sin_x * sin_x, cos_x * cos_x
            s, c = 2.0 * sin_x * cos_x, cos2_x - sin2_x
            # Y = 4 var(sin^2 x), shifted by the first node: no cancellation at either pole
            if i == 0:
                first = sin2_x
            else:
                gap = sin2_x - first
                shift += w * gap
                square += w * gap * gap
            high += w * cos2_x
            low += w * sin2_x
            square_sine += w * s * s
            right, double = w * a, (c - s) * (c + s)
            sine_end += right * s
            product_end += right * s * c
            sine_end_slope += right * a * c
            product_end_slope += right * a * double
            if a < 1.0:
                left = w * (1.0 - a)
                sine_start += left * s
                product_start += left * s * c
                sine_start_slope += left * a * c
                product_start_slope += left * a * double
    return Sums(
        high, low, high - low, square_sine, 4.0 * (square - shift * shift),
        sine_start, sine_end, product_start, product_end,
        sine_start_slope, sine_end_slope, product_start_slope, product_end_slope,
    )  # fmt: skip


class Forces(NamedTuple):
    """The precession rate and the force sums of a step, with their slopes in d."""

    v: float  # dphi / h
    W0: float
    W1: float
    v_slope: float  # slopes with respect to d
    W0_slope: float
    W1_slope: float


@register_jitable
def forces(par: Any, sums: Any) -> Any:
    """`Forces` of a step."""
    spread = par.I1 - par.I3
    inverse = 1.0 / (par.I1 * sums.square_sine + par.I3 * sums.variance)
    v = (par.north * sums.high + par.south * sums.low) * inverse
    inertia_slope = spread * sums.product_end + par.I3 * sums.cosine * sums.sine_end  # half of dD/dd
    v_slope = (par.p_psi * sums.sine_end - 2.0 * v * inertia_slope) * inverse
    bracket = v * (par.p_psi - v * par.I3 * sums.cosine) - par.mgl
    bracket_slope = v_slope * (par.p_psi - 2.0 * v * par.I3 * sums.cosine) + v * v * par.I3 * sums.sine_end
    square, square_slope = spread * v * v, 2.0 * spread * v * v_slope
    W0 = bracket * sums.sine_start - square * sums.product_start
    W1 = bracket * sums.sine_end - square * sums.product_end
    W0_slope = bracket_slope * sums.sine_start + bracket * sums.sine_start_slope
    W1_slope = bracket_slope * sums.sine_end + bracket * sums.sine_end_slope
    W0_slope = W0_slope - square_slope * sums.product_start - square * sums.product_start_slope
    W1_slope = W1_slope - square_slope * sums.product_end - square * sums.product_end_slope
    return Forces(v, W0, W1, v_slope, W0_slope, W1_slope)


def begin(par: Any, rule: Any, state: Any, h: float) -> Any:
    """The force sum W0 of a step of length zero, as a flat history for the predictor."""
    W0 = forces(par, node_sums(rule, state[0], 0.0, opening(par, rule, state[0]))).W0
    return (W0, W0, W0, W0)


class _Step(NamedTuple):
    """The scalar equation of one step, d = flight - scale W0(d)."""

    par: Any
    rule: Any
    theta: float
    opened: Any  # as `opening` makes it
    h: float
    lever: float  # h / I1
    spin: float  # p_psi / I3
    momentum: float
    flight: float  # h p / I1, d without any force
    scale: float  # h^2 / I1


def _equation(par: Any, rule: Any, state: Any, steady: Any, opened: Any) -> Any:
    # h^2/I1 rounded once would bias the energy: increments are computed from h and h/I1 alone
    h, lever, spin = steady
    flight, scale = lever * state[1], lever * h
    opened = opened if rule.nodes[0] == 0.0 else NONE_OPENED  # constants need not be loaded from memory
    return _Step(par, rule, state[0], opened, h, lever, spin, state[1], flight, scale)


def _predict(step: Any, carry: Any) -> Any:
    """W0 is smooth in time: the cubic through its last four values predicts the next one."""
    return (step.flight - step.scale * (4.0 * (carry[0] + carry[2]) - 6.0 * carry[1] - carry[3]),)


def _evaluate(step: Any, x: Any) -> Any:
    sums = node_sums(step.rule, step.theta, x[0], step.opened)
    return sums, forces(step.par, sums)


def _correct(step: Any, trial: Any, x: Any) -> Any:
    """Newton's correction, judged against the step's own increment."""
    (d,), (_, force) = x, trial
    change = (step.lever * (step.momentum - step.h * force.W0) - d) / (1.0 + step.scale * force.W0_slope)
    enough = step.rule.tolerance * (abs(step.flight) + abs(step.scale * force.W0)) + NEGLIGIBLE_ANGLE
    return Correction(change, (d + change,), abs(change), enough, ANGLE_GRAIN)


def _keep(trial: Any, correction: Any) -> Any:
    """The forces and two sums of the last trial, and the last correction of d, which is not applied, and d with it."""
    sums, (v, W0, W1, v_slope, W0_slope, W1_slope) = trial
    last, after = correction.change, correction.after[0]
    return v, W0, W1, v_slope, W0_slope, W1_slope, sums.cosine, sums.sine_end, last, after


def _close(step: Any, end: Any) -> Any:
    v, W0, W1, v_slope, W0_slope, W1_slope, cosine, sine_end, change, after = end
    h = step.h
    # the last correction is added to all terms to first order; the remainder is its square. If it were added before the
    # product with h, the sum would be rounded to one side over long parts of an orbit: some starts then lose 3e-14 of
    # their energy in 1e8 steps; as it is, the error of the energy stays at 3e-15
    kick0 = fused(h, W0, h * (W0_slope * change))
    kick1 = fused(h, W1, h * (W1_slope * change))
    turn = fused(h, v, h * (v_slope * change))
    # theta moves by the same rounded force as p. Newton's own d differs from that by a twentieth of a rounding, but
    # always to the same side: with it the energy drifts by 4e-14 in 3e6 steps
    d = step.lever * (step.momentum - kick0)
    dstate = (d, -(kick0 + kick1), turn, fused(h, step.spin, -(turn * (cosine - sine_end * change))))
    return dstate, (W0 + W0_slope * change,), chart_outcome(step.theta + after)


def observe(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """p_phi and p_psi by the discrete Legendre transform of the increments that were added."""
    theta, d = before[0], dstate[0]
    sums = node_sums(rule, theta, d, opening(par, rule, theta))
    v, u = dstate[2] / h, dstate[3] / h
    square_cosine = sums.variance + sums.cosine * sums.cosine
    p_phi = par.I1 * sums.square_sine * v + par.I3 * (square_cosine * v + sums.cosine * u)
    return p_phi, par.I3 * (u + sums.cosine * v)


march = newton_loop(
    begin, observe, constants=lambda par, h: (h, h / par.I1, par.p_psi / par.I3), start=opening, equation=_equation,
    predict=_predict, evaluate=_evaluate, correct=_correct, restart=lambda step: (step.flight,), keep=_keep,
    close=_close, top=ReducedTop, dimension=4, steady=3, opened=6, unknowns=1, ends=10, newest=1, carry=4,
)  # fmt: skip


def rule_of(method: Integrator) -> Quadrature | None:
    """The rule of an integrator that `discrete_lagrangian` made; None for any other."""
    solver = inside(method.solvers.get("angles"))
    return solver.rule if solver is not None and solver.loop is march else None


def is_midpoint(method: Integrator) -> bool:
    """Is it the midpoint rule, made by `discrete_lagrangian`, under any name?"""
    rule = rule_of(method)
    return rule is not None and (rule.nodes, rule.weights) == RULES["midpoint"][:2]


def midpoint_energy(view: View, momenta: Momenta, h: float) -> Array:
    """The rule's energy to O(h^4), less E: -h^2 (p^2 V''/I1^2 + V'^2/I1)/24 (Hairer, Lubich, Wanner, IX.3)."""
    top, p = view.top, view.p_theta
    slope = top.potential_slope(view.theta, momenta)
    return np.asarray(
        -h * h / 24 * ((p / top.I1) ** 2 * top.potential_curvature(view.theta, momenta) + slope**2 / top.I1)
    )


def discrete_lagrangian(
    name: str, nodes: Sequence[float], weights: Sequence[float], *, order: int | None = None, summary: str = "",
    reference: str = "marsden-west-2001",
) -> Integrator:  # fmt: skip
    """A variational integrator from the nodes and weights of a quadrature rule on [0, 1].

    The rule is symmetric if it reads the same from both ends, and has order 2 if it integrates t exactly. Raises
    SymtopError for nodes outside [0, 1], for other numbers of weights, and for weights that do not sum to 1.
    """
    rule, symmetric = quadrature(nodes, weights)
    start_nodes = sum(node == 0.0 for node in rule.nodes)  # evaluated once a step, not once an iteration
    new_nodes = len(rule.nodes) - start_nodes
    method = Integrator(
        name=name,
        family="discrete-lagrangian",
        summary=summary or f"discrete Lagrangian with nodes {rule.nodes} and weights {rule.weights}",
        solvers={"angles": FixedStep(march, rule, on_angles, new_nodes, implicit=True, each_step=start_nodes)},
        order=order, explicit=False, symplectic=True, symmetric=symmetric, conserves=frozenset({"p_phi", "p_psi"}),
        reference=reference, needs="lagrangian", general=True,
    )  # fmt: skip
    return replace(method, modified_energy=midpoint_energy) if is_midpoint(method) else method


def built_in() -> list[Integrator]:
    """The rules that ship with symtop."""
    return [discrete_lagrangian(name, *rule[:2], order=2, summary=rule[2]) for name, rule in RULES.items()]
