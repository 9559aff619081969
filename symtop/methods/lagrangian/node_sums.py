"""Sums over the nodes of a straight step, and the forces that follow from them, with analytic slopes.

    C = sum w c,  S = sum w s^2,  Y = sum w c^2 - C^2,  D = I1 S + I3 Y,     at theta_i = theta0 + a_i d
    v = dphi/h = (p_phi - p_psi C)/D
    W0 = sum w (1-a) s [v p_psi - mgl - v^2 ((I1-I3) c + I3 C)],   W1 the same with a for 1-a

as in `discrete_lagrangian`, where they are derived. p_phi - p_psi C is formed as north sum w cos^2(theta/2) + south
sum w sin^2(theta/2), and Y from the spread of sin^2(theta/2) about its first value: no cancellation at the poles. A
term whose weight the rule makes zero is not added.
"""

from typing import Any, NamedTuple

from symtop.core.jit import register_jitable
from symtop.core.sines import sincos

NOTHING = -0.0  # where a sum begins: adding to it is no operation; adding to +0 is one, as -0 + 0 = 0
NONE_OPENED = (NOTHING,) * 6


class Sums(NamedTuple):
    """Sums over the nodes; `start` or `end` in a name means the weight w (1-a) or w a, the share of that end."""

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
    """What the nodes at the start of the step give to the sums: their terms are those that no iteration changes."""
    first = high = low = square_sine = sine_start = product_start = NOTHING
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
    """All sums over the nodes, from those of `opening` on; terms that the rule makes zero are left out."""
    first, high, low, square_sine, sine_start, product_start = opened
    sine_end = product_end = shift = square = NOTHING
    sine_start_slope = sine_end_slope = product_start_slope = product_end_slope = NOTHING
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
    """The precession rate and the force sums of a step, and how they change with d."""

    v: float  # dphi / h
    W0: float
    W1: float
    v_slope: float  # slopes with respect to d
    W0_slope: float
    W1_slope: float


@register_jitable
def forces(par: Any, sums: Any) -> Any:
    """The precession rate and both force sums of a step, with their slopes."""
    spread = par.I1 - par.I3
    inverse = 1.0 / (par.I1 * sums.square_sine + par.I3 * sums.variance)
    v = (par.north * sums.high + par.south * sums.low) * inverse
    inertia_slope = spread * sums.product_end + par.I3 * sums.cosine * sums.sine_end  # half of dD/dd
    v_slope = (par.p_psi * sums.sine_end - 2.0 * v * inertia_slope) * inverse
    bracket = v * (par.p_psi - v * par.I3 * sums.cosine) - par.mgl
    bracket_slope = v_slope * (par.p_psi - 2.0 * v * par.I3 * sums.cosine) + v * v * par.I3 * sums.sine_end
    square, square_slope = spread * v * v, 2.0 * spread * v * v_slope
    W0_slope = bracket_slope * sums.sine_start + bracket * sums.sine_start_slope
    W1_slope = bracket_slope * sums.sine_end + bracket * sums.sine_end_slope
    return Forces(
        v,
        bracket * sums.sine_start - square * sums.product_start,
        bracket * sums.sine_end - square * sums.product_end,
        v_slope,
        W0_slope - square_slope * sums.product_start - square * sums.product_start_slope,
        W1_slope - square_slope * sums.product_end - square * sums.product_end_slope,
    )
