"""Drake: a multibody plant, three revolute joints z-x-z with the body on the last, stepped by its error-controlled
integrators.

The mass is 1 and the centre of gravity a tenth of sqrt(I1) from the joint. The target accuracy is the control; the
largest step is a tenth of a nutation. Drake stops at every time it is asked for, so its accuracy is judged at its own
steps.
"""

import functools
import importlib
from typing import Any

import numpy as np

from benchmarks.peers.common import peer
from symtop.methods.plan import Plan, Run
from symtop.methods.registry import Integrator
from symtop.model import charts
from symtop.model.top import Angles, SymmetricTop

PACKAGE = "drake"
LEAST = 1e-11  # below it the steps shrink until the run does not end
MOST_STEPS = 60_000
SCHEMES = {"runge_kutta3": 3, "runge_kutta5": 5}


class Chain:
    """A solver around one of Drake's integrators, and its own steps."""

    def __init__(self, scheme: str) -> None:
        self.scheme = scheme
        self.plant_of = functools.lru_cache(maxsize=16)(_plant)

    def _begin(self, top: SymmetricTop, start: Angles, plan: Plan) -> tuple[Any, Any, Any]:
        from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator

        plant = self.plant_of(top)
        simulator = Simulator(plant)
        ResetIntegratorFromFlags(simulator, self.scheme, 0.1 * top.nutation_period(start))
        simulator.get_mutable_integrator().set_target_accuracy(plan.tolerance)
        context = simulator.get_mutable_context()
        angles = [start.phi, start.theta, start.psi]
        rates = [start.phi_dot, start.theta_dot, start.psi_dot]
        plant.SetPositionsAndVelocities(context, np.array(angles + rates))
        simulator.Initialize()
        return simulator, plant, context

    def __call__(self, top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        """Integrate from sample to sample."""
        simulator, plant, context = self._begin(top, start, plan)
        rows = []
        for time in plan.times.tolist():
            simulator.AdvanceTo(time)
            rows.append(plant.GetPositionsAndVelocities(context))
        phi, theta, psi, phi_dot, theta_dot, psi_dot = np.array(rows).T
        spin = top.I3 * (psi_dot + phi_dot * np.cos(theta))
        p_phi = top.I1 * phi_dot * np.sin(theta) ** 2 + spin * np.cos(theta)
        states = np.stack([theta, top.I1 * theta_dot, phi, psi], axis=-1)
        steps = simulator.get_integrator().get_num_steps_taken()
        evaluations = simulator.get_integrator().get_num_derivative_evaluations()
        return Run(states, p_phi, spin, int(steps), int(evaluations), 0, "ok", plan.horizon)

    def own_steps(self, top: SymmetricTop, start: Angles, plan: Plan) -> tuple[np.ndarray, np.ndarray]:
        """Times and axes at the ends of the steps of a run to the horizon."""
        from pydrake.systems.framework import EventStatus

        simulator, plant, _ = self._begin(top, start, plan)
        times, axes = [], []

        def keep(context: Any) -> Any:
            phi, theta = plant.GetPositions(context)[:2]
            times.append(context.get_time())
            axes.append(charts.axis_from_angles(theta, phi))
            if len(times) < MOST_STEPS:
                return EventStatus.DidNothing()
            axes[-1] = np.full(3, np.nan)  # a run that does not end is a failure
            return EventStatus.ReachedTermination(None, "out of steps")

        simulator.set_monitor(keep)
        simulator.AdvanceTo(plan.horizon)
        return np.array(times), np.array(axes)


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


def peers() -> list[Integrator]:
    """Two of its error-controlled integrators."""
    importlib.import_module("pydrake.multibody.plant")  # an ImportError here means: skip

    says = "multibody plant with three revolute joints (Euler angles); target accuracy = the tolerance"
    return [
        peer(
            f"drake-{scheme.replace('_', '-')}",
            Chain(scheme),
            says,
            implementation="compiled",
            order=order,
            chart="angles",
            least=LEAST,
        )
        for scheme, order in SCHEMES.items()
    ]
