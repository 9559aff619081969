"""What the drivers share: a body at its start, the path that an engine takes it along, and the torque of gravity.

Quaternions are (w, x, y, z) and turn the body into space; angular velocities are in space unless a name ends in _body.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from symtop.model import charts
from symtop.model.scenes import Scene

Array = np.ndarray


class Body(NamedTuple):
    """A top and its start; shapes (4,) and (3,), in the units of the scene."""

    I1: float
    I3: float
    mgl: float
    attitude: Array
    velocity: Array

    @property
    def rotation(self) -> Array:
        """The matrix of the attitude."""
        return matrix(self.attitude)

    @property
    def velocity_body(self) -> Array:
        """The angular velocity in body axes."""
        return np.asarray(self.rotation.T @ self.velocity)

    @property
    def arm(self) -> float:
        """From the joint to the centre of a body of mass one: a tenth of sqrt(I1)."""
        return 0.1 * math.sqrt(self.I1)

    @property
    def across(self) -> float:
        """The transverse moment about the centre of the body on a joint."""
        return self.I1 - self.arm**2


class Path(NamedTuple):
    """Attitudes, shape (steps + 1, 4), and angular velocities in space, shape (steps + 1, 3)."""

    attitude: Array
    velocity: Array


class Recorder:
    """Collects a path, row by row."""

    def __init__(self) -> None:
        self.attitudes: list[Any] = []
        self.velocities: list[Any] = []

    def add(self, attitude: Any, velocity: Any) -> None:
        """One more row."""
        self.attitudes.append(np.array(attitude, dtype=float))
        self.velocities.append(np.array(velocity, dtype=float))

    def path(self) -> Path:
        """All rows; quaternions have length one."""
        q = np.array(self.attitudes)
        return Path(q / np.linalg.norm(q, axis=1, keepdims=True), np.array(self.velocities))


def body_of(scene: Scene) -> Body:
    """The body of a scene at its start."""
    top = scene.top
    state = charts.space_state("attitude", top, scene.start)
    return Body(top.I1, top.I3, top.mgl, state[:4], velocities(top.I1, top.I3, state[None])[0])


def velocities(I1: float, I3: float, states: Array) -> Array:
    """Angular velocities of states (q, L), shape (n, 7) to (n, 3)."""
    e, L = charts.axis_from_quaternion(states[:, :4]), states[:, 4:]
    return np.asarray(L / I1 + (1.0 / I3 - 1.0 / I1) * np.sum(e * L, axis=1, keepdims=True) * e)


def torque(mgl: float, attitude: Any) -> tuple[float, float, float]:
    """mgl k x e of a quaternion; one that is not of length one is normalised."""
    w, x, y, z = attitude
    scale = 2.0 * mgl / (w * w + x * x + y * y + z * z)
    return -scale * (y * z - w * x), scale * (x * z + w * y), 0.0


def matrix(attitude: Array) -> Array:
    """The rotation from body to space."""
    return np.asarray(Rotation.from_quat(np.roll(attitude, -1)).as_matrix())


def quaternion(rotation: Any) -> Array:
    """The quaternion of a rotation matrix."""
    return np.roll(Rotation.from_matrix(np.array(rotation, dtype=float)).as_quat(), 1)
