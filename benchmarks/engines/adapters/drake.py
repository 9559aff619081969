"""Drake: a free body of a discrete plant, the torque as an external spatial force of every step.

A discrete plant makes its first update at t = 0, so that the state after k steps is read at (k - 1/2) h. It turns the
quaternion linearly and leaves its length to grow: of the catalogue's maps mujoco-euler is the nearest and not its own.
"""

import functools
from importlib import metadata
from typing import Any

import numpy as np

from benchmarks.engines import FREE, Setting
from benchmarks.engines.common import Body, Path, Recorder, torque

ENGINE = "Drake"


def _torque(drake: Any, body: Body, plant: Any, index: Any) -> Any:
    """A system whose output is the torque of the plant's state."""

    class Torque(drake.LeafSystem):  # type: ignore[misc]
        """From the state of the plant to one applied force."""

        def __init__(self) -> None:
            super().__init__()
            self.DeclareVectorInputPort("x", plant.num_multibody_states())
            self.DeclareAbstractOutputPort("f", lambda: drake.Value([drake.ExternallyAppliedSpatialForce()]), self.push)

        def push(self, context: Any, out: Any) -> None:
            """Evaluate the output."""
            force = drake.ExternallyAppliedSpatialForce()
            force.body_index, force.p_BoBq_B = index, np.zeros(3)
            pulled = torque(body.mgl, self.get_input_port().Eval(context)[:4])
            force.F_Bq_W = drake.SpatialForce(np.array(pulled), np.zeros(3))
            out.set_value([force])

    return Torque()


def _run(drake: Any, body: Body, h: float, steps: int) -> Path:
    builder, plant, recorder = drake.DiagramBuilder(), drake.MultibodyPlant(h), Recorder()
    inertia = drake.RotationalInertia(body.I1, body.I1, body.I3)
    link = plant.AddRigidBody("top", drake.SpatialInertia.MakeFromCentralInertia(1.0, np.zeros(3), inertia))
    plant.mutable_gravity_field().set_gravity_vector([0, 0, 0])
    plant.Finalize()
    builder.AddSystem(plant)
    push = builder.AddSystem(_torque(drake, body, plant, link.index()))
    builder.Connect(plant.get_state_output_port(), push.get_input_port())
    builder.Connect(push.get_output_port(), plant.get_applied_spatial_force_input_port())
    simulator = drake.Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.SetPositions(context, np.concatenate([body.attitude, np.zeros(3)]))
    plant.SetVelocities(context, np.concatenate([body.velocity, np.zeros(3)]))
    recorder.add(body.attitude, body.velocity)
    simulator.Initialize()
    for step in range(1, steps + 1):
        simulator.AdvanceTo((step - 0.5) * h)
        recorder.add(plant.GetPositions(context)[:4], plant.GetVelocities(context)[:3])
    return recorder.path()


def settings() -> list[Setting]:
    """The discrete plant."""
    import pydrake.all as drake

    version = metadata.version("drake")
    return [Setting(ENGINE, version, "discrete plant", FREE, "", functools.partial(_run, drake))]
