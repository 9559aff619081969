"""Strang's splitting that adds 1e-10 to p_phi in every step, declared to conserve it."""

import dataclasses

import symtop
from symtop.methods.framework.loop import FixedStep
from symtop.methods.framework.space import on_axis
from symtop.methods.splitting import space as family
from symtop.methods.splitting.coefficients import STRANG
from symtop.methods.splitting.loop import Stages

whole_step = family.march_axis.increment  # numba finds a name of this module, not an attribute of another one's


def increment(par, rule, state, carry, h):
    """The family's step and a little more."""
    step, axis, forces, outcome = whole_step(par, rule, state, carry, h)
    return (step[0], step[1], step[2], step[3], step[4], step[5] + 1e-10), axis, forces, outcome


march = dataclasses.replace(family.march_axis, increment=increment, lanes=lambda _: None)


def solve(top, start, plan):
    """Strang's coefficients, multiplied out."""
    half, pull = 0.5 * plan.step_size / top.I1, plan.step_size * top.mgl
    stages = Stages((half,), tuple(b * pull for b in STRANG.kick), (0.0, 0.0), 1, 0, 0.0)
    return FixedStep(march, stages, on_axis, 1, implicit=False)(top, start, plan)


symtop.register(dataclasses.replace(symtop.integrator("strang"), name="leaking-momentum", solvers={"axis": solve}))
