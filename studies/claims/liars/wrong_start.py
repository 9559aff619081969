"""The midpoint rule, started with q1 = q0 + h q0' instead of the discrete Legendre transform: order 1, sold as 2."""

import dataclasses
import math

import symtop

midpoint = symtop.integrator("midpoint")


def solve(top, start, plan):
    """Midpoint from the momenta that the straight first step q0 + h q0' would have started with."""
    h, middle = plan.step_size, start.theta + 0.5 * plan.step_size * start.theta_dot
    s, c, v = math.sin(middle), math.cos(middle), start.phi_dot
    p_psi = top.I3 * (start.psi_dot + v * c)
    p_phi = top.I1 * s * s * v + p_psi * c
    p_theta = top.I1 * start.theta_dot + 0.5 * h * s * (v * p_psi - v * v * top.I1 * c - top.mgl)
    phi_dot = (p_phi - p_psi * math.cos(start.theta)) / (top.I1 * math.sin(start.theta) ** 2)
    psi_dot = p_psi / top.I3 - phi_dot * math.cos(start.theta)
    moved = dataclasses.replace(start, theta_dot=p_theta / top.I1, phi_dot=phi_dot, psi_dot=psi_dot)
    return midpoint.solvers["angles"](top, moved, plan)


symtop.register(dataclasses.replace(midpoint, name="wrong-start", solvers={"angles": solve}))
