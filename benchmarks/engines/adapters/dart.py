"""DART: a free joint with an external torque, or a ball joint and gravity.

Since 6.20 the velocities of a free joint are in the frame of its parent, those of a ball joint in the body's.
"""

import functools
from importlib import metadata
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.engines import FREE, JOINT, Setting
from benchmarks.engines.common import Body, Path, Recorder, quaternion, torque

ENGINE = "DART"


def _run(dart: Any, held: str, body: Body, h: float, steps: int) -> Path:
    pinned, world, skeleton = held == JOINT, dart.simulation.World(), dart.dynamics.Skeleton("top")
    arm, across = (body.arm, body.across) if pinned else (0.0, body.I1)
    world.setTimeStep(h)
    world.setGravity([0, 0, -body.mgl / arm if pinned else 0])
    if pinned:
        make = skeleton.createBallJointAndBodyNodePair
        joint, node = make(None, dart.dynamics.BallJointProperties(), dart.dynamics.BodyNodeProperties())
    else:
        make = skeleton.createFreeJointAndBodyNodePair
        joint, node = make(None, dart.dynamics.FreeJointProperties(), dart.dynamics.BodyNodeProperties())
    node.setInertia(dart.dynamics.Inertia(1.0, [0, 0, arm], np.diag([across, across, body.I3])))
    world.addSkeleton(skeleton)
    turn = Rotation.from_matrix(body.rotation).as_rotvec()
    joint.setPositions(turn if pinned else np.concatenate([turn, np.zeros(3)]))
    joint.setVelocities(body.velocity_body if pinned else np.concatenate([body.velocity, np.zeros(3)]))
    recorder = Recorder()
    for step in range(steps + 1):
        q = quaternion(node.getWorldTransform().rotation())
        recorder.add(q, node.getAngularVelocity())
        if step < steps:
            if not pinned:
                node.addExtTorque(torque(body.mgl, q), False)
            world.step()
    return recorder.path()


def settings() -> list[Setting]:
    """The default, free and on a joint."""
    import dartpy as dart

    version = metadata.version("dartpy")
    return [
        Setting(ENGINE, version, "default", held, "mujoco-euler", functools.partial(_run, dart, held))
        for held in (FREE, JOINT)
    ]
