"""The classical Runge-Kutta method on (e, L), which reports the momenta of its start and claims to keep both."""

import dataclasses

import numpy as np

import symtop

rk4 = symtop.integrator("rk4")


def solve(top, start, plan):
    """The family's run and momenta that are copied."""
    run, momenta = rk4.solvers["axis"](top, start, plan), top.momenta(start)
    return run._replace(p_phi=np.full(plan.times.size, momenta.p_phi), p_psi=np.full(plan.times.size, momenta.p_psi))


symtop.register(
    dataclasses.replace(rk4, name="copied-momenta", solvers={"axis": solve}, conserves=frozenset({"p_phi", "p_psi"}))
)
