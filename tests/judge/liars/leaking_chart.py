"""Strang's splitting, honest on the axis; its attitude solver loses 1e-4 of p_phi in unit time, declared to keep it."""

import dataclasses

import symtop

strang = symtop.integrator("strang")


def solve(top, start, plan):
    """The family's run and a p_phi that leaks."""
    run = strang.solvers["attitude"](top, start, plan)
    return run._replace(p_phi=run.p_phi - 1e-4 * plan.times)


solvers = {"axis": strang.solvers["axis"], "attitude": solve}
symtop.register(dataclasses.replace(strang, name="leaking-chart", solvers=solvers))
