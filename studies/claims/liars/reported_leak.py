"""Strang's splitting, whose states keep p_phi, and which reports one that leaks: a wrong formula of what is shown."""

import dataclasses

import symtop

strang = symtop.integrator("strang")


def solve(top, start, plan):
    """The family's run and another p_phi than its states have."""
    run = strang.solvers["attitude"](top, start, plan)
    return run._replace(p_phi=run.p_phi - 1e-4 * plan.times)


symtop.register(dataclasses.replace(strang, name="reported-leak", solvers={"attitude": solve}))
