"""MuJoCo: one body on a ball joint, mass off the joint, stepped by the engine's own integrators.

The mass is 1 and the centre of gravity a tenth of sqrt(I1) from the joint, gravity to match mgl. No damping, contacts,
limits or actuators; constraints are switched off, which only saves time. The step is fixed; the loop runs in C. The
public call compiles the model from its XML.
"""

from typing import Any

import numpy as np

from benchmarks.peers import common
from benchmarks.peers.common import Inner, Library, Motion
from symtop.methods.framework.plan import Array, Plan
from symtop.methods.framework.registry import Integrator
from symtop.model import charts
from symtop.model.top import Angles, SymmetricTop

PACKAGE = "mujoco"
LANGUAGE = "built in (C)"
INTEGRATORS = {"RK4": ("mjINT_RK4", 4), "Euler": ("mjINT_EULER", 1), "implicit": ("mjINT_IMPLICIT", 1)}
XML = """
<mujoco>
  <compiler autolimits="false"/>
  <option gravity="0 0 {gravity!r}" timestep="{step!r}"><flag constraint="disable" contact="disable"/></option>
  <worldbody>
    <body>
      <joint type="ball" damping="0"/>
      <inertial pos="0 0 {arm!r}" mass="1" diaginertia="{across!r} {across!r} {along!r}"/>
    </body>
  </worldbody>
</mujoco>
"""


class Ball(Library):
    """One of the engine's integrators; rows are qpos and qvel."""

    chart = "attitude"

    def __init__(self, mujoco: Any, name: str) -> None:
        self.mujoco, self.code = mujoco, INTEGRATORS[name][0]
        self.stages = 4 if name == "RK4" else 1

    def _model_and_data(self, top: SymmetricTop, step: float) -> tuple[Any, Any]:
        arm = 0.1 * top.I1**0.5
        text = XML.format(gravity=-top.mgl / arm, step=step, arm=arm, across=top.I1 - arm * arm, along=top.I3)
        model = self.mujoco.MjModel.from_xml_string(text)
        model.opt.integrator = int(getattr(self.mujoco.mjtIntegrator, self.code))
        return model, self.mujoco.MjData(model)

    def public(self, top: SymmetricTop, start: Angles, plan: Plan) -> Motion:
        """Compile the model and step it from sample to sample."""
        model, data = self._model_and_data(top, plan.step_size)
        data.qpos[:], data.qvel[:] = _begin(top, start)
        rows, steps = np.empty((plan.times.size, 7)), 0
        for row, mark in zip(rows, plan.marks.tolist(), strict=True):
            if mark > steps:
                self.mujoco.mj_step(model, data, nstep=mark - steps)
                steps = mark
            row[:4], row[4:] = data.qpos, data.qvel
        return Motion(rows, steps, steps * self.stages)

    def inner(self, top: SymmetricTop, start: Angles, plan: Plan) -> Inner:
        """Put the data back to the start and make all steps in one call."""
        model, data = self._model_and_data(top, plan.step_size)
        (position, velocity), steps, step = _begin(top, start), int(plan.marks[-1]), self.mujoco.mj_step

        def call() -> Any:
            self.mujoco.mj_resetData(model, data)
            data.qpos[:], data.qvel[:] = position, velocity
            step(model, data, nstep=steps)
            return data

        return Inner(call, lambda data: np.concatenate([data.qpos, data.qvel]))

    def states_of(self, top: SymmetricTop, start: Angles, rows: Array) -> Array:
        """The angular momentum in space in place of the velocity in the body."""
        del start
        inertia = np.array([top.I1, top.I1, top.I3])
        momenta = [_matrix(row[:4]) @ (inertia * row[4:]) for row in rows]
        return np.concatenate([rows[:, :4], momenta], axis=1)


def _begin(top: SymmetricTop, start: Angles) -> tuple[Array, Array]:
    """Attitude, and angular velocity in the body."""
    state = charts.space_state("attitude", top, start)
    return state[:4], (_matrix(state[:4]).T @ state[4:]) / np.array([top.I1, top.I1, top.I3])


def _matrix(quaternion: np.ndarray) -> np.ndarray:
    """The rotation from body to space."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def peers() -> list[tuple[Integrator, str]]:
    """Three of the engine's integrators; Euler is its default."""
    import mujoco

    return [
        (
            common.record(
                f"mujoco-{name.lower()}", Ball(mujoco, name), "a body on a ball joint; fixed step",
                control="step_size", order=order,
            ),
            LANGUAGE,
        )
        for name, (_, order) in INTEGRATORS.items()
    ]  # fmt: skip
