"""Rapier in single precision: a free body with an applied torque, with the gyroscopic term and without."""

import functools
from importlib import metadata
from typing import Any

import numpy as np

from benchmarks.engines import FREE, Setting
from benchmarks.engines.common import Body, Path, Recorder, torque

ENGINE = "Rapier"
SUBSTEPS = 4  # the default


def _run(rapier: Any, gyroscopic: bool, body: Body, h: float, steps: int) -> Path:
    vector, recorder = rapier.Vec3, Recorder()
    world = rapier.PhysicsWorld(gravity=vector(0, 0, 0))
    world.integration_parameters.dt = h
    world.integration_parameters.num_solver_iterations = SUBSTEPS
    inertia = rapier.MassProperties(rapier.Point3(0.0, 0.0, 0.0), 1.0, vector(body.I1, body.I1, body.I3))
    turn = rapier.Rotation3(*body.attitude.tolist()).scaled_axis
    builder = rapier.RigidBody.dynamic().rotation(turn).angvel(vector(*body.velocity.tolist()))
    builder = builder.additional_mass_properties(inertia).can_sleep(False).gyroscopic_forces(gyroscopic)
    key = world.add_body(builder)
    for step in range(steps + 1):
        top = world.rigid_bodies[key]
        q, w = top.rotation, top.angvel
        attitude = np.array([q.w, q.i, q.j, q.k])
        recorder.add(attitude, (w.x, w.y, w.z))
        if step < steps:
            top.reset_torques(True)  # they persist
            top.add_torque(vector(*torque(body.mgl, attitude)), True)
            world.step()
    return recorder.path()


def settings() -> list[Setting]:
    """The default; without the gyroscopic term its rotation is linear, which no map of the catalogue has."""
    import rapier3d as rapier

    version = metadata.version("rapier3d")
    rows = (("default", True, "rapier-float32"), ("gyroscopic_forces(False)", False, ""))
    return [
        Setting(ENGINE, version, name, FREE, method, functools.partial(_run, rapier, gyroscopic))
        for name, gyroscopic, method in rows
    ]
