"""Strang's splitting, honest on the axis; its attitude solver loses 1e-4 of p_phi in unit time, declared to keep it."""

import dataclasses

import numpy as np

import symtop

strang = symtop.integrator("strang")


def solve(top, start, plan):
    """The family's run with an L_z, and so a p_phi, that leaks."""
    run = strang.solvers["attitude"](top, start, plan)
    leaked = run.states - 1e-4 * np.outer(plan.times, [0, 0, 0, 0, 0, 0, 1])
    return run._replace(states=leaked, p_phi=run.p_phi - 1e-4 * plan.times)


solvers = {"axis": strang.solvers["axis"], "attitude": solve}
symtop.register(dataclasses.replace(strang, name="leaking-chart", solvers=solvers))
