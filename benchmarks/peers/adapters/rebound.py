"""rebound: the extrapolation of Gragg, Bulirsch and Stoer on a user-defined ODE, its right-hand side in C by numba.

Six equations on (e, L); eps_rel = eps_abs = the tolerance. rebound bends its step to stop at a time and does not
interpolate, so that sampling it at given times would change what is measured: its accuracy is judged at the ends of its
own steps.
"""

import ctypes
from typing import Any

import numpy as np

from benchmarks.peers.common import ON_AXIS, c_field, peer, run_of, start_of
from symtop.methods.plan import Plan, Run
from symtop.methods.registry import Integrator
from symtop.model.top import Angles, SymmetricTop

PACKAGE = "rebound"
MOST_STEPS = 200_000


class BulirschStoer:
    """A solver, and its own steps."""

    def __init__(self, rebound: Any) -> None:
        self.rebound = rebound
        self.signature = dict(rebound.ode.ODE._fields_)["_derivatives"]

    def _begin(self, top: SymmetricTop, start: Angles, plan: Plan) -> tuple[Any, Any]:
        simulation = self.rebound.Simulation()
        simulation.integrator = "bs"
        simulation.integrator.eps_rel = plan.tolerance
        simulation.integrator.eps_abs = plan.tolerance
        ode = simulation.create_ode(length=6, needs_nbody=False)
        ode._derivatives = ctypes.cast(c_field(top).address, self.signature)
        for i, value in enumerate(start_of(top, start)):
            ode.y[i] = value
        simulation.dt = 1e-2 * plan.horizon
        return simulation, ode

    def __call__(self, top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        """Integrate from sample to sample."""
        simulation, ode = self._begin(top, start, plan)
        states = []
        for time in plan.times.tolist():
            simulation.integrate(time)
            states.append(ode.y[:6])
        return run_of(plan, states, simulation.steps_done, 0)

    def own_steps(self, top: SymmetricTop, start: Angles, plan: Plan) -> tuple[np.ndarray, np.ndarray]:
        """Times and states (e, L) at the ends of the steps of a run to the horizon."""
        simulation, ode = self._begin(top, start, plan)
        times, states = [0.0], [ode.y[:6]]
        while len(times) < MOST_STEPS:
            simulation.steps(1)
            if simulation.t >= plan.horizon:
                break
            times.append(simulation.t)
            states.append(ode.y[:6])
        else:
            states[-1] = [np.nan] * 6  # a run that does not end is a failure
        return np.array(times), np.array(states)


def peers() -> list[Integrator]:
    """One extrapolation method."""
    import rebound

    says = f"{ON_AXIS}, right-hand side in C; eps_rel = eps_abs = the tolerance"
    return [peer("rebound-bs", BulirschStoer(rebound), says, implementation="compiled")]
