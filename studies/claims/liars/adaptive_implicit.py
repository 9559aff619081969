"""LSODA, which reports how often it corrects a step, declared explicit."""

import dataclasses

import symtop

lsoda = symtop.integrator("lsoda")


def solve(top, start, plan):
    """SciPy's run; every force beyond one a step is an iteration."""
    run = lsoda.solvers["angles"](top, start, plan)
    return run._replace(newton_iterations=run.force_evaluations - run.steps)


symtop.register(dataclasses.replace(lsoda, name="adaptive-implicit", solvers={"angles": solve}, explicit=True))
