"""Yoshida's composition with one coefficient off by 1e-9, declared order 4. `symtop.composition` would refuse it."""

import dataclasses

import symtop
from symtop.methods.framework.loop import FixedStep
from symtop.methods.framework.space import on_axis
from symtop.methods.splitting import space
from symtop.methods.splitting.coefficients import YOSHIDA_4
from symtop.methods.splitting.loop import Stages

drift = (YOSHIDA_4.drift[0] + 1e-9, *YOSHIDA_4.drift[1:])


def solve(top, start, plan):
    """The family's kernel with a table that nobody closed."""
    half, pull = 0.5 * plan.step_size / top.I1, plan.step_size * top.mgl
    stages = Stages(tuple(a * half for a in drift), tuple(b * pull for b in YOSHIDA_4.kick), (0.0,) * 4, 3, 0, 0.0)
    return FixedStep(space.march_axis, stages, on_axis, 1, implicit=False)(top, start, plan)


symtop.register(dataclasses.replace(symtop.integrator("yoshida-4"), name="coefficient-off", solvers={"axis": solve}))
