"""PyBullet: Bullet's multibody in double precision, free with an external torque or on a spherical joint.

Damping and the limit of speed are switched off. The rigid body of Bullet, with its implicit gyroscopic term, is reached
with `useMaximalCoordinates` alone, where external torques end in speeds of 1e4 rad/s; it is not run here.
"""

import functools
import tempfile
from pathlib import Path as File
from typing import Any

import numpy as np

from benchmarks.engines import FREE, JOINT, Setting
from benchmarks.engines.common import Body, Path, Recorder, torque

ENGINE = "PyBullet"
FAST = 1e6  # rad/s, far above any speed of a scene
URDF = """<robot name="top">
<link name="base"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="top"><inertial><origin xyz="0 0 {arm!r}"/><mass value="1"/>
<inertia ixx="{across!r}" iyy="{across!r}" izz="{along!r}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="joint" type="spherical"><parent link="base"/><child link="top"/></joint></robot>"""


def _on_joint(bullet: Any, body: Body, start: list[float]) -> int:
    with tempfile.TemporaryDirectory() as folder:
        file = File(folder) / "top.urdf"
        file.write_text(URDF.format(arm=body.arm, across=body.across, along=body.I3), encoding="utf-8")
        top = bullet.loadURDF(str(file), useFixedBase=True, flags=bullet.URDF_USE_INERTIA_FROM_FILE)
    bullet.changeDynamics(top, 0, linearDamping=0, angularDamping=0, jointDamping=0, maxJointVelocity=FAST)
    bullet.setJointMotorControlMultiDof(
        top, 0, bullet.POSITION_CONTROL, targetPosition=[0, 0, 0, 1], positionGain=0, velocityGain=0, force=[0, 0, 0]
    )
    bullet.resetJointStateMultiDof(top, 0, start, body.velocity_body.tolist())
    return int(top)


def _free(bullet: Any, body: Body, start: list[float]) -> int:
    shape = bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=0.001)
    top = bullet.createMultiBody(1, shape, baseOrientation=start)
    bullet.changeDynamics(
        top, -1, localInertiaDiagonal=[body.I1, body.I1, body.I3], linearDamping=0, angularDamping=0,
        maxJointVelocity=FAST, activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING,
    )  # fmt: skip
    bullet.resetBaseVelocity(top, [0, 0, 0], body.velocity.tolist())
    return int(top)


def _run(bullet: Any, held: str, body: Body, h: float, steps: int) -> Path:
    client, recorder, pinned = bullet.connect(bullet.DIRECT), Recorder(), held == JOINT
    try:
        bullet.setTimeStep(h)
        bullet.setGravity(0, 0, -body.mgl / body.arm if pinned else 0)
        top = (_on_joint if pinned else _free)(bullet, body, np.roll(body.attitude, -1).tolist())
        for step in range(steps + 1):
            if pinned:
                link = bullet.getLinkState(top, 0, computeLinkVelocity=1, computeForwardKinematics=1)
                q, w = np.roll(link[5], 1), link[7]
            else:
                q, w = np.roll(bullet.getBasePositionAndOrientation(top)[1], 1), bullet.getBaseVelocity(top)[1]
            recorder.add(q, w)
            if step < steps:
                if not pinned:
                    bullet.applyExternalTorque(top, -1, torque(body.mgl, q), bullet.WORLD_FRAME)
                bullet.stepSimulation()
    finally:
        bullet.disconnect(client)
    return recorder.path()


def settings() -> list[Setting]:
    """The default, free and on a joint."""
    from importlib import metadata

    import pybullet as bullet

    version = metadata.version("pybullet")
    return [
        Setting(ENGINE, version, "multibody", held, "mujoco-euler", functools.partial(_run, bullet, held))
        for held in (FREE, JOINT)
    ]
