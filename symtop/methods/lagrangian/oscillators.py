"""The attitude as two planar quartic oscillators that do not see each other; a chart for kernels, without poles.

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

The price is one parameter, E': off the level of energy that it names, or off |chi_1|^2 + |chi_2|^2 = 1, two oscillators
are no top. A state is (Re chi_1, Im chi_1, Re chi_2, Im chi_2) and the four velocities. Derived here, and checked
against the closed form in the tests; that e_z is an elliptic function and the half angles are Lame's is classical.
Source: Klein and Sommerfeld, Theory of the Top, chapter 6.
"""

import math
from typing import Any, NamedTuple

from symtop.core.jit import register_jitable
from symtop.methods.framework.preparation import Preparation
from symtop.methods.framework.space import with_spin


class OscillatorTop(NamedTuple):
    """The numbers of a top and a start that the two oscillators need."""

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
    nod = 0.5 * at.theta_dot
    # the rates of both phases without a difference near a pole: phi' + psi' = p_psi/I1 + phi' (1 - u), twist taken off
    turn = cosine * (0.5 * spin + at.phi_dot * sine * sine)
    swerve = sine * (at.phi_dot * cosine * cosine - 0.5 * spin)
    return par, (
        cosine * ct, -cosine * st, sine * sd, -sine * cd,
        -nod * sine * ct - turn * st, nod * sine * st - turn * ct,
        nod * cosine * sd + swerve * cd, swerve * sd - nod * cosine * cd,
    )  # fmt: skip


on_oscillators = Preparation(oscillator_numbers, 8)


@register_jitable
def momentum(par: Any, s: Any) -> Any:
    """L of a state."""
    a, b, c, d, A, B, C, D = s
    k = 2.0 * par.I1
    x, y = (b * C - a * D) + (d * A - c * B), (a * C - c * A) + (b * D - d * B)
    return k * x, k * y, k * ((b * A - a * B) + (c * D - d * C))


@register_jitable
def axis_state(par: Any, s: Any) -> Any:
    """(e, L) of a state."""
    a, b, c, d = s[0], s[1], s[2], s[3]
    return (2.0 * (a * c + b * d), 2.0 * (a * d - b * c), (a * a + b * b) - (c * c + d * d), *momentum(par, s))


@register_jitable
def attitude_state(par: Any, s: Any, t: float) -> Any:
    """(q, L) of a state at the time t, the twist since the start put on again."""
    return with_spin(par, (s[0], -s[3], s[2], -s[1], *momentum(par, s)), t)
