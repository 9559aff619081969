"""The two calls of symtop's own methods: `simulate` as a user types it, and the kernel alone.

The kernel alone is one compiled call, from top, start and step to the last state; `taylor` has a compiled stepper of
heyoka whose time, state and parameters are set back. An adaptive kernel of ours is called with a ready plan.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

import symtop
from benchmarks.peers.common import Inner
from symtop.methods.framework.calling import solve
from symtop.methods.framework.loop import inside
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import Integrator
from symtop.methods.taylor import heyoka
from symtop.model.scenes import Scene

LANGUAGE = "numba, inside the kernel"
TAYLOR_LANGUAGE = "LLVM by heyoka, inside the stepper"


def public(scene: Scene, method: Integrator, setting: float, horizon: float) -> Callable[[], Any]:
    """`simulate` with its defaults, at most a sample a step, momenta, energy, the guard; only the axis is asked for."""
    name, options = method.name, method.given(setting)
    return lambda: symtop.simulate(scene, name, horizon=horizon, observe="axis", **options)


def inner(scene: Scene, method: Integrator, chart: str, plan: Plan) -> Inner:
    """The kernel alone, from the start to the horizon."""
    top, start = scene.top, scene.start
    fixed = inside(method.solvers[chart])
    if fixed is not None:
        ends = Plan.steps(plan.step_size, plan.marks[-1:])
        return Inner(lambda: fixed(top, start, ends), lambda run: run.states[-1])
    if method.name == "taylor":
        stepper = heyoka.stepper(chart, "double", plan.tolerance)
        numbers, parameters = heyoka.start_numbers(chart, "double", top, start)
        begin, par, horizon = np.array(numbers), np.array(parameters[: stepper.pars.size]), plan.horizon

        def call() -> Any:
            stepper.time = 0.0
            stepper.state[:], stepper.pars[:] = begin, par
            stepper.propagate_until(horizon)
            return stepper.state

        return Inner(call, lambda state: state)
    return Inner(lambda: solve(method, chart, top, start, plan), lambda run: run.states[-1])
