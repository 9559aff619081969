"""The attitude as two uncoupled planar quartic oscillators; a chart for kernels, without poles.

    chi_1 = q_w - i q_z = cos(theta/2) exp(-i (phi + psi)/2)
    chi_2 = q_y - i q_x = -i sin(theta/2) exp(i (phi - psi)/2)

with the twist taken off: psi turns here at the rate of a body with I3 = I1. From e' = L x e/I1 and L' = mgl k x e,

    chi_k'' = (2 sigma_k |chi_k|^2 + 3 b_k) chi_k,    sigma = kappa, -kappa,    b = -(kappa + mu)/2, (kappa - mu)/2

kappa = mgl/I1 and mu = E'/3 I1, where E' = |L|^2/2 I1 + mgl e_z is a constant. Each oscillator moves in the plane of
its complex number under a central force, with the angular momentum J_k; both have one Weierstrass function:

    wp(t) = sigma_k |chi_k|^2 + b_k = (kappa e_z - mu)/2,        wp'^2 = 4 wp^3 - g2 wp - g3
    g2 = 3 mu^2 + kappa^2 - kappa p_phi p_psi/I1^2,    g3 = mu (mu^2 - kappa^2 - kappa p_phi p_psi/2 I1^2)
                                                            + kappa^2 (p_phi^2 + p_psi^2)/4 I1^2
    e_x + i e_y = 2 conj(chi_1) chi_2,   p_phi = -2 I1 (J_1 - J_2),   p_psi = -2 I1 (J_1 + J_2),   eta = 2 i I1 chi'
    L_x + i L_y = conj(chi_1) eta_2 + chi_2 conj(eta_1),   L_z = Re(conj(chi_1) eta_1 - conj(chi_2) eta_2)

One parameter of the equations is E': with another energy, or with |chi_1|^2 + |chi_2|^2 other than 1, two oscillators
are no top. A state is (Re chi_1, Im chi_1, Re chi_2, Im chi_2) and the four velocities. Derived here, and checked
against the closed form in the tests; that e_z is an elliptic function and the half angles are Lame's is classical.
Source: Klein and Sommerfeld, Theory of the Top, chapter 6.

`Map` holds the numbers of the exact step of `exact_discrete` from a top, a start and a step, for both oscillators:

    (A - 1) D, D, r, 1/r, delta        r = sqrt(D), of the sign of the step; delta in turns

At a step beyond half a nutation they are those of the rest after whole nutations, and delta counts these. Next to a
separatrix P - e2 is a small difference of large numbers, and so is e1 - e2, on which the turn and the time of a whole
nutation depend: there the step is made of equal parts within half a nutation. Compiled, in double: A^2 - 1 is put
together without the difference of two numbers near 1, and the roots come in differences only.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from symtop.core.jit import register_jitable
from symtop.methods.framework.preparation import Preparation, ScaledRule
from symtop.model.exact.elliptic import differences, half_period, r_j, roots
from symtop.model.top import nutation_period


class OscillatorTop(NamedTuple):
    """The numbers of a top and a start."""

    I1: float
    twist: float  # p_psi (1/I3 - 1/I1)
    kappa: float
    b1: float
    b2: float
    g2: float
    g3: float


def oscillator_numbers(top: Any, at: Any) -> Any:
    """Kernel parameters, chi and chi' of a start."""
    cosine, sine = math.cos(0.5 * at.theta), math.sin(0.5 * at.theta)
    u = math.cos(at.theta)
    spin = top.I3 / top.I1 * (at.psi_dot + at.phi_dot * u)  # p_psi/I1
    swing = at.phi_dot * math.sin(at.theta)
    p_phi = swing * math.sin(at.theta) + spin * u  # over I1, too
    kappa = top.mgl / top.I1
    mu = (0.5 * (at.theta_dot * at.theta_dot + swing * swing + spin * spin) + kappa * u) / 3.0
    product, squares = kappa * p_phi * spin, p_phi * p_phi + spin * spin
    g2 = 3.0 * mu * mu + kappa * kappa - product
    g3 = mu * (mu * mu - kappa * kappa - 0.5 * product) + 0.25 * kappa * kappa * squares
    twist = spin * (top.I1 / top.I3 - 1.0)
    par = OscillatorTop(top.I1, twist, kappa, -0.5 * (kappa + mu), 0.5 * (kappa - mu), g2, g3)
    total, difference = 0.5 * (at.phi + at.psi), 0.5 * (at.phi - at.psi)
    ct, st, cd, sd = math.cos(total), math.sin(total), math.cos(difference), math.sin(difference)
    half_rate = 0.5 * at.theta_dot
    # the rates of both phases without a difference near a pole: phi' + psi' = p_psi/I1 + phi' (1 - u), twist taken off
    turn = cosine * (0.5 * spin + at.phi_dot * sine * sine)
    swerve = sine * (at.phi_dot * cosine * cosine - 0.5 * spin)
    return par, (
        cosine * ct, -cosine * st, sine * sd, -sine * cd,
        -half_rate * sine * ct - turn * st, half_rate * sine * st - turn * ct,
        half_rate * cosine * sd + swerve * cd, swerve * sd - half_rate * cosine * cd,
    )  # fmt: skip


on_oscillators = Preparation(oscillator_numbers, 8)


@register_jitable
def momentum(par: Any, s: Any) -> Any:
    """L of a state."""
    a, b, c, d, A, B, C, D = s
    k = 2.0 * par.I1
    x, y = (b * C - a * D) + (d * A - c * B), (a * C - c * A) + (b * D - d * B)
    return k * x, k * y, k * ((b * A - a * B) + (c * D - d * C))


SHORTEST_STEP = 1e-100  # least length of a step, and of the rest of one that is a whole number of nutations
STEEPEST_RATIO = 16.0  # limit on (P - e3)/(P - e2), the factor by which rounding of the constants is amplified
LEAST_APART = 1e-5  # least (e1 - e2)^2 (e1 - e3)/(b1^2 + b2^2)^1.5; e1 - e2 and a nutation have rounding over it
MOST_PARTS = 10_000  # limit on the parts of a step
TINY_ROOT = 1e-80  # of e1 - e3, in the place of e1 - b where e1 is a zero of chi: J is zero, too


class Map(NamedTuple):
    """The numbers of the step of one start, of both oscillators."""

    aD1: float = 0.0  # (A - 1) D
    D1: float = 1.0
    r1: float = 1.0
    q1: float = 1.0  # 1/r
    turn1: float = 0.0  # delta in turns
    aD2: float = 0.0
    D2: float = 1.0
    r2: float = 1.0
    q2: float = 1.0
    turn2: float = 0.0
    kappa: float = 0.0
    half_turns: float = 0.0  # of a step, beside delta: 1 where it leaves out an odd number of nutations
    parts: float = 1.0  # steps of the map in a step


@register_jitable
def one_oscillator(above: Any, g2: float, g3: float, sigma: float, b: float, J: float) -> Any:
    """(A - 1) D, D and delta of any planar quartic oscillator at 0 < h <= T/2; `above` is P - e_i, and P their mean."""
    P = (above[0] + above[1] + above[2]) / 3.0
    D = P - b
    y = 1.0 / D
    q = 1.0 + b * y  # P/D
    # A^2 - 1 without the difference of two numbers near 1
    gap = 0.25 * y * (12.0 * b * q * q + y * ((4.0 * b * b * b - g3) * y - (g2 + 12.0 * b * b) * q))
    x1, x2, x3 = above[0] * y, above[1] * y, above[2] * y
    delta = sigma * J * y * math.sqrt(y) * r_j(x1, x2, x3, 1.0) / 3.0
    return gap / (1.0 + math.sqrt(x1 * x2 * x3)) * D, D, delta


@register_jitable
def _turn_of_nutation(e: Any, sigma: float, b: float, J: float) -> float:
    """delta of one nutation; where b is next to the root e1 that bounds it, J and the integral are 0 times infinity.

    Of e1 - b and b - e2 only the larger is a difference of roots, which lose digits in it: if that is the second, the
    first is that of J^2 = (e1 - b)(b - e2)(b - e3).
    """
    width, gap, turn = e.e1 - e.e3, e.e1 - b, sigma * J
    y, z = e.e1 - e.e2, width
    if gap < b - e.e2:
        y, z = b - e.e2, b - e.e3
        gap = max(turn * turn / (y * z), TINY_ROOT * width)
        turn = math.copysign(math.sqrt(gap * y * z), turn)
        y, z = y + gap, z + gap
    return 2.0 * turn * r_j(0.0, y, z, gap) / 3.0


@register_jitable
def _oscillator(e: Any, above: Any, par: Any, sigma: float, b: float, J: float, sign: float, nutations: float) -> Any:
    """(A - 1) D, D, r, 1/r and delta in turns of one oscillator, for a step of `nutations` whole ones and a rest."""
    aD, D, delta = one_oscillator(above, par.g2, par.g3, sigma, b, J)
    delta *= sign
    if nutations != 0.0:
        delta += nutations * _turn_of_nutation(e, sigma, b, J)
    r = sign * math.sqrt(D)
    return aD, D, r, 1.0 / r, delta / (2.0 * math.pi)


def _map_of_step(rule: Any, top: Any, at: Any, h: float) -> Any:
    """The numbers of the step h from a start; of `rule` only the type is used."""
    par, s = oscillator_numbers(top, at)
    e = roots(par.g2, par.g3)
    # two roots that are neighbours lose digits: e1 and e2 beside a separatrix, both turning points in a steady motion
    half = half_period(e) if e.e1 - e.e2 > e.e2 - e.e3 else 0.5 * nutation_period(top, at)
    gap, parts = e.e1 - e.e2, 1
    distinct = gap * gap * (e.e1 - e.e3) > LEAST_APART * math.pow(par.b1 * par.b1 + par.b2 * par.b2, 1.5)
    while True:
        nutations = np.rint(0.5 * h / parts / half)
        remainder = h / parts - 2.0 * nutations * half if nutations != 0.0 else h / parts
        above = differences(e, max(abs(remainder), SHORTEST_STEP))
        P = (above[0] + above[1] + above[2]) / 3.0
        # P - e2 or a D, which is small at half a nutation of an axis that comes near a pole
        smallest = min(above[1], P - par.b1, P - par.b2)
        if ((distinct or nutations == 0.0) and not above[2] > STEEPEST_RATIO * smallest) or parts >= MOST_PARTS:
            break
        parts += 1
    sign = 1.0 if remainder >= 0.0 else -1.0
    J1, J2 = s[0] * s[5] - s[1] * s[4], s[2] * s[7] - s[3] * s[6]
    aD1, D1, r1, q1, turn1 = _oscillator(e, above, par, par.kappa, par.b1, J1, sign, nutations)
    aD2, D2, r2, q2, turn2 = _oscillator(e, above, par, -par.kappa, par.b2, J2, sign, nutations)
    odd = nutations - 2.0 * np.floor(0.5 * nutations)
    return Map(aD1, D1, r1, q1, turn1, aD2, D2, r2, q2, turn2, par.kappa, odd, float(parts))


numbers = ScaledRule(Map(), _map_of_step)
