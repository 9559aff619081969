"""MuJoCo: a free joint with the torque applied before each step, or a ball joint and gravity; constraints off.

Its Runge-Kutta evaluates gravity in the stages, but an applied torque only at the start of the step, so that RK4 is
compared on the joint. `implicitfast` has the gyroscopic derivative
on a free joint only.
"""

import functools
from typing import Any

from benchmarks.engines import FREE, JOINT, Setting
from benchmarks.engines.common import Body, Path, Recorder, matrix, torque

ENGINE = "MuJoCo"
XML = """
<mujoco>
  <compiler autolimits="false"/>
  <option gravity="0 0 {gravity!r}"><flag constraint="disable" contact="disable"/></option>
  <worldbody>
    <body>
      {joint}
      <inertial pos="0 0 {arm!r}" mass="1" diaginertia="{across!r} {across!r} {along!r}"/>
    </body>
  </worldbody>
</mujoco>
"""
JOINTS = {FREE: "<freejoint/>", JOINT: '<joint type="ball" damping="0"/>'}


def _run(mujoco: Any, integrator: str, held: str, body: Body, h: float, steps: int) -> Path:
    pinned = held == JOINT
    arm, across = (body.arm, body.across) if pinned else (0.0, body.I1)
    gravity = -body.mgl / arm if pinned else 0.0
    text = XML.format(gravity=gravity, joint=JOINTS[held], arm=arm, across=across, along=body.I3)
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.timestep, model.opt.integrator = h, int(getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}"))
    data, recorder = mujoco.MjData(model), Recorder()
    q, v = (slice(0, 4), slice(0, 3)) if pinned else (slice(3, 7), slice(3, 6))
    data.qpos[q], data.qvel[v] = body.attitude, body.velocity_body
    for step in range(steps + 1):
        recorder.add(data.qpos[q], matrix(data.qpos[q]) @ data.qvel[v])
        if step < steps:
            if not pinned:
                data.xfrc_applied[1, 3:6] = torque(body.mgl, data.qpos[q])
            mujoco.mj_step(model, data)
    return recorder.path()


def settings() -> list[Setting]:
    """Four integrators; Euler is the default."""
    import mujoco

    version = mujoco.__version__
    runge_kutta = "rkmk4" if int(version.partition(".")[0]) >= 4 else "mujoco3-rk4"
    rows = (
        ("Euler", FREE, "mujoco-euler"), ("Euler", JOINT, "mujoco-euler"), ("implicit", FREE, "mujoco-implicit"),
        ("implicit", JOINT, "mujoco-implicit"), ("implicitfast", FREE, "mujoco-implicit"),
        ("implicitfast", JOINT, "mujoco-euler"), ("RK4", JOINT, runge_kutta),
    )  # fmt: skip
    return [
        Setting(ENGINE, version, name, held, method, functools.partial(_run, mujoco, name, held))
        for name, held, method in rows
    ]
