"""Drake: a multibody plant, three revolute joints z-x-z with the body on the last, stepped by its error-controlled
integrators.

The mass is 1 and the centre of gravity a tenth of sqrt(I1) from the joint. The target accuracy is the control; the
largest step is a tenth of a nutation. Drake stops at every time it is asked for, so the public call keeps the ends of
its own steps, and its accuracy is judged there. The public call builds plant and simulator.
"""

import importlib
from typing import Any

import numpy as np

from benchmarks.peers import common
from benchmarks.peers.common import Inner, Library, Motion
from symtop.methods.framework.plan import Array, Plan
from symtop.methods.framework.registry import Integrator
from symtop.model.top import Angles, SymmetricTop

PACKAGE = "drake"
LANGUAGE = "built in (C++)"
LEAST = 1e-11  # below it the steps shrink until the run does not end
MOST_STEPS = 60_000
SCHEMES = {"runge_kutta3": 3, "runge_kutta5": 5}


class Chain(Library):
    """One of Drake's integrators; rows are the angles phi, theta, psi and their rates."""

    chart = "angles"
    shows = common.OWN_STEPS

    def __init__(self, scheme: str) -> None:
        self.scheme = scheme

    def _simulator_of(self, top: SymmetricTop, start: Angles, plan: Plan) -> tuple[Any, Any, Any]:
        from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator

        plant = _plant(top)
        simulator = Simulator(plant)
        ResetIntegratorFromFlags(simulator, self.scheme, 0.1 * top.nutation_period(start))
        simulator.get_mutable_integrator().set_target_accuracy(plan.tolerance)
        context = simulator.get_mutable_context()
        plant.SetPositionsAndVelocities(context, _begin(start))
        simulator.Initialize()
        return simulator, plant, context

    def _steps(self, top: SymmetricTop, start: Angles, plan: Plan) -> tuple[list[float], list[Any]]:
        from pydrake.systems.framework import EventStatus

        simulator, plant, _ = self._simulator_of(top, start, plan)
        times: list[float] = []
        rows: list[Any] = []

        def keep(context: Any) -> Any:
            times.append(context.get_time())
            rows.append(plant.GetPositionsAndVelocities(context))
            if len(times) < MOST_STEPS:
                return EventStatus.DidNothing()
            rows[-1] = np.full(6, np.nan)  # a run that does not end is a failure
            return EventStatus.ReachedTermination(None, "out of steps")

        simulator.set_monitor(keep)
        simulator.AdvanceTo(plan.horizon)
        return times, rows

    def public(self, top: SymmetricTop, start: Angles, plan: Plan) -> Motion:
        """Build everything and keep the state after every step."""
        times, rows = self._steps(top, start, plan)
        return Motion(rows, len(times) - 1)

    def own_steps(self, top: SymmetricTop, start: Angles, plan: Plan) -> tuple[Array, Array]:
        """Times and axes at the ends of the steps of a run to the horizon."""
        times, rows = self._steps(top, start, plan)
        return np.array(times), self.axes(top, start, rows)

    def inner(self, top: SymmetricTop, start: Angles, plan: Plan) -> Inner:
        """Put the context back to the start and advance to the horizon."""
        simulator, plant, context = self._simulator_of(top, start, plan)
        state, horizon = _begin(start), plan.horizon

        def call() -> Any:
            context.SetTime(0.0)
            plant.SetPositionsAndVelocities(context, state)
            simulator.Initialize()
            simulator.AdvanceTo(horizon)
            return context

        return Inner(call, plant.GetPositionsAndVelocities)

    def states_of(self, top: SymmetricTop, start: Angles, rows: Array) -> Array:
        """theta, p_theta, phi and psi."""
        del start
        return np.stack([rows[:, 1], top.I1 * rows[:, 4], rows[:, 0], rows[:, 2]], axis=-1)


def _begin(start: Angles) -> Array:
    return np.array([start.phi, start.theta, start.psi, start.phi_dot, start.theta_dot, start.psi_dot])


def _plant(top: SymmetricTop) -> Any:
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import RevoluteJoint, SpatialInertia, UnitInertia

    arm = 0.1 * top.I1**0.5
    plant = MultibodyPlant(0.0)
    body = SpatialInertia(1.0, [0.0, 0.0, arm], UnitInertia(top.I1, top.I1, top.I3))
    inner = [plant.AddRigidBody(name, SpatialInertia.Zero()) for name in ("node", "tilt")]
    links = [plant.world_body(), *inner, plant.AddRigidBody("top", body)]
    for name, axis, parent, child in zip(("phi", "theta", "psi"), ("z", "x", "z"), links, links[1:], strict=False):
        direction = [1.0, 0.0, 0.0] if axis == "x" else [0.0, 0.0, 1.0]
        plant.AddJoint(RevoluteJoint(name, parent.body_frame(), child.body_frame(), direction, damping=0.0))
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -top.mgl / arm])
    plant.Finalize()
    return plant


def peers() -> list[tuple[Integrator, str]]:
    """Two of its error-controlled integrators."""
    importlib.import_module("pydrake.multibody.plant")  # an ImportError here means: skip

    return [
        (
            common.record(
                f"drake-{scheme.replace('_', '-')}",
                Chain(scheme),
                "a plant of three revolute joints; target accuracy = the tolerance",
                order=order,
                least=LEAST,
            ),
            LANGUAGE,
        )
        for scheme, order in SCHEMES.items()
    ]
