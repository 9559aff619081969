"""The midpoint rule with a single Newton iteration from free flight, declared bounded in energy."""

import dataclasses

import numpy as np

import symtop
from symtop.core.jit import register_jitable
from symtop.methods.framework.angles import chart_outcome, on_angles
from symtop.methods.framework.loop import FixedStep, Loop
from symtop.methods.lagrangian import discrete_lagrangian as family
from symtop.methods.lagrangian.discrete_lagrangian import forces, node_sums, opening


def increment(par, rule, state, carry, h):
    """p_theta0 = I1 d/h + h W0(d) solved for d by one iteration, then p_theta1 = I1 d/h - h W1(d)."""
    d = h * state[1] / par.I1
    force = forces_at(par, rule, state[0], d)
    d -= h * h / par.I1 * force.W0 / (1.0 + h * h / par.I1 * force.W0_slope)
    force = forces_at(par, rule, state[0], d)
    p_theta = par.I1 * d / h - h * force.W1
    cosine = np.cos(state[0] + 0.5 * d)
    step = (d, p_theta - state[1], h * force.v, h * (par.p_psi / par.I3 - force.v * cosine))
    return step, carry, 1, chart_outcome(state[0] + d)


@register_jitable
def forces_at(par, rule, theta, d):
    """The family's sums for an increment d."""
    return forces(par, node_sums(rule, theta, d, opening(None, rule, theta)))


march = Loop(family.begin, increment, family.observe)
solver = FixedStep(march, family.Quadrature((0.5,), (1.0,)), on_angles, 1, implicit=True)
symtop.register(
    dataclasses.replace(
        symtop.integrator("midpoint"), name="one-newton", solvers={"angles": solver}, energy_error="bounded"
    )
)
