"""rebound: Gragg, Bulirsch and Stoer's extrapolation on a user-defined ODE, and IAS15 on the axis as a particle.

Right-hand sides in C by numba. The ODE has the six equations on (e, L), eps_rel = eps_abs = the tolerance. IAS15 has no
ODEs: the axis is its one particle with a force that depends on the velocity (see `callbacks`), and epsilon is the
tolerance. rebound bends its step to stop at a time and does not interpolate: the public call keeps the ends of its own
steps, and accuracy is judged there.
"""

import ctypes
from typing import Any

import numpy as np

from benchmarks.peers import callbacks, common
from benchmarks.peers.common import Inner, Library, Motion
from symtop.methods.framework.plan import Array, Plan
from symtop.methods.framework.registry import Integrator
from symtop.model.top import Angles, SymmetricTop

PACKAGE = "rebound"
MOST_STEPS = 200_000
FIRST_STEP = 1e-2  # of the horizon
SIX = ctypes.c_double * 6
SIZE = ctypes.sizeof(SIX)


class Rebound(Library):
    """What both have in common: a simulation, and a state that is read and written."""

    shows = common.OWN_STEPS
    kind = ""
    tolerances: tuple[str, ...] = ()

    def __init__(self, rebound: Any) -> None:
        self.rebound = rebound
        simulation = rebound.Simulation()
        simulation.integrator = self.kind
        fields = simulation.integrator.callbacks.field_descriptor_list
        self.offsets = [fields.field_descriptor_for_name(name).offset for name in self.tolerances]

    def begin(self, top: SymmetricTop, start: Angles) -> tuple[Any, Any]:
        """A simulation and what holds its state."""
        raise NotImplementedError

    def write(self, holder: Any, state: Any) -> None:
        """Put a state in."""
        raise NotImplementedError

    def read(self, holder: Any) -> list[float]:
        """The state now."""
        raise NotImplementedError

    def first(self, top: SymmetricTop, start: Angles) -> Any:
        """The state at the start."""
        return SIX(*common.start_of(top, start))

    def renew(self, simulation: Any, tolerance: float) -> None:
        """Choose the integrator anew, which forgets the steps that it took, and set its tolerance.

        By addresses: the same through rebound's attributes takes 20 us in Python.
        """
        self.rebound.clibrebound.reb_simulation_set_integrator(ctypes.byref(simulation), self.kind.encode())
        state = simulation.integrator.state
        for offset in self.offsets:
            ctypes.c_double.from_address(state + offset).value = tolerance

    def _simulation_of(self, top: SymmetricTop, start: Angles, plan: Plan) -> tuple[Any, Any]:
        simulation, holder = self.begin(top, start)
        self.renew(simulation, plan.tolerance)
        self.write(holder, self.first(top, start))
        simulation.dt = FIRST_STEP * plan.horizon
        return simulation, holder

    def public(self, top: SymmetricTop, start: Angles, plan: Plan) -> Motion:
        """Build a simulation and keep the state after every step; the last step ends at the horizon."""
        times, rows = self._steps(top, start, plan)
        return Motion(rows, len(times) - 1)

    def _steps(self, top: SymmetricTop, start: Angles, plan: Plan) -> tuple[list[float], list[list[float]]]:
        simulation, holder = self._simulation_of(top, start, plan)
        times, rows = [0.0], [self.read(holder)]
        while simulation.t + simulation.dt < plan.horizon and len(times) < MOST_STEPS:
            simulation.steps(1)
            times.append(simulation.t)
            rows.append(self.read(holder))
        if times[-1] < plan.horizon:
            simulation.integrate(plan.horizon)
            times.append(simulation.t)
            rows.append(self.read(holder))
        return times, rows

    def own_steps(self, top: SymmetricTop, start: Angles, plan: Plan) -> tuple[Array, Array]:
        """Times and axes at the ends of the steps of a run to the horizon."""
        times, rows = self._steps(top, start, plan)
        keep = np.array(times) <= plan.horizon
        return np.array(times)[keep], self.axes(top, start, rows)[keep]

    def inner(self, top: SymmetricTop, start: Angles, plan: Plan) -> Inner:
        """Put a simulation back to the start and go to the horizon in one call."""
        simulation, holder = self._simulation_of(top, start, plan)
        state, tolerance, horizon = self.first(top, start), plan.tolerance, plan.horizon

        def call() -> Any:
            self.renew(simulation, tolerance)
            self.write(holder, state)
            simulation.t, simulation.dt = 0.0, FIRST_STEP * horizon
            simulation.integrate(horizon)
            return holder

        return Inner(call, self.read)


class BulirschStoer(Rebound):
    """A user-defined ODE."""

    kind, tolerances = "bs", ("eps_rel", "eps_abs")

    def begin(self, top: SymmetricTop, start: Angles) -> tuple[Any, Any]:
        """A simulation without particles, and its ODE."""
        del start
        simulation = self.rebound.Simulation()
        simulation.integrator = "bs"
        ode = simulation.create_ode(length=6, needs_nbody=False)
        signature = dict(self.rebound.ode.ODE._fields_)["_derivatives"]
        ode._derivatives = ctypes.cast(callbacks.ode_field(top).address, signature)
        return simulation, ode

    def write(self, holder: Any, state: Any) -> None:
        """Six numbers."""
        ctypes.memmove(holder.y, state, SIZE)

    def read(self, holder: Any) -> list[float]:
        """(e, L)."""
        return list(holder.y[:6])


class Ias15(Rebound):
    """The axis as a particle."""

    kind, tolerances = "ias15", ("epsilon",)

    def begin(self, top: SymmetricTop, start: Angles) -> tuple[Any, Any]:
        """A simulation with one particle and no gravity of its own."""
        simulation = self.rebound.Simulation()
        simulation.integrator, simulation.gravity = "ias15", "none"
        simulation.add(m=0.0, x=1.0)
        simulation.force_is_velocity_dependent = 1
        kind = dict(self.rebound.Simulation._fields_)["_additional_forces"]
        force = callbacks.particle_force(top, start, self.rebound.Simulation._particles.offset)
        simulation._additional_forces = ctypes.cast(force.address, kind)
        numbers = ctypes.cast(simulation._particles, ctypes.POINTER(ctypes.c_double))
        return simulation, (numbers, simulation)  # the numbers live as long as the simulation

    def first(self, top: SymmetricTop, start: Angles) -> Any:
        """e and e' = L x e / I1."""
        state = common.start_of(top, start)
        return SIX(*state[:3], *(np.cross(state[3:], state[:3]) / top.I1))

    def write(self, holder: Any, state: Any) -> None:
        """Position and velocity."""
        ctypes.memmove(holder[0], state, SIZE)

    def read(self, holder: Any) -> list[float]:
        """(e, e')."""
        return list(holder[0][:6])


def peers() -> list[tuple[Integrator, str]]:
    """An extrapolation method and the library's own integrator of order 15."""
    import rebound

    return [
        (
            common.record(
                "rebound-bs", BulirschStoer(rebound), "a user-defined ODE; eps_rel = eps_abs = the tolerance"
            ),
            common.NUMBA_IN_C,
        ),
        (
            common.record(
                "rebound-ias15",
                Ias15(rebound),
                "the axis as a particle, e'' = a(e, e'); epsilon = the tolerance",
                order=15,
            ),
            common.NUMBA_IN_C,
        ),
    ]
