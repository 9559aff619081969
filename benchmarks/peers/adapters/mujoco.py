"""MuJoCo: one body on a ball joint, mass off the joint, stepped by the engine's own integrators.

The mass is 1 and the centre of gravity a tenth of sqrt(I1) from the joint, gravity to match mgl. No damping, contacts,
limits or actuators; constraints are switched off, which only saves time. The step is fixed; the loop runs in C.
"""

import functools
from typing import Any

import numpy as np

from benchmarks.peers.common import peer
from symtop.methods.plan import Plan, Run
from symtop.methods.registry import Integrator, Solver
from symtop.model import charts
from symtop.model.top import Angles, SymmetricTop

PACKAGE = "mujoco"
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


def _solver(mujoco: Any, code: str) -> Solver:
    @functools.lru_cache(maxsize=16)
    def model_of(top: SymmetricTop) -> tuple[Any, Any]:
        arm = 0.1 * top.I1**0.5
        text = XML.format(gravity=-top.mgl / arm, step=1e-3, arm=arm, across=top.I1 - arm * arm, along=top.I3)
        model = mujoco.MjModel.from_xml_string(text)
        model.opt.integrator = int(getattr(mujoco.mjtIntegrator, code))
        return model, mujoco.MjData(model)

    def solve(top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        model, data = model_of(top)
        inertia = np.array([top.I1, top.I1, top.I3])
        state = charts.space_state("attitude", top, start)
        mujoco.mj_resetData(model, data)
        model.opt.timestep = plan.step_size
        data.qpos[:] = state[:4]
        data.qvel[:] = (_matrix(state[:4]).T @ state[4:]) / inertia
        shown = np.full((plan.times.size, 7), np.nan)
        done = 0
        for row, mark in enumerate(plan.marks):
            if mark > done:
                mujoco.mj_step(model, data, nstep=int(mark - done))
                done = int(mark)
            quaternion = np.array(data.qpos)
            shown[row, :4], shown[row, 4:] = quaternion, _matrix(quaternion) @ (inertia * data.qvel)
        axis = charts.axis_from_quaternion(shown[:, :4])
        good = bool(np.isfinite(shown).all())
        evaluations = done * (4 if code == "mjINT_RK4" else 1)
        return Run(
            shown, shown[:, 6].copy(), np.sum(axis * shown[:, 4:], axis=1), done, evaluations, 0,
            "ok" if good else "not_finite", plan.horizon if good else 0.0,
        )  # fmt: skip

    return solve


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


def peers() -> list[Integrator]:
    """Three of the engine's integrators; Euler is its default."""
    import mujoco

    return [
        peer(
            f"mujoco-{name.lower()}", _solver(mujoco, code), "a body on a ball joint; fixed step",
            implementation="compiled", control="step_size", order=order, chart="attitude",
        )
        for name, (code, order) in INTEGRATORS.items()
    ]  # fmt: skip
