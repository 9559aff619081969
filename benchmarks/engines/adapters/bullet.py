"""Bullet of the machine, through a driver in C++: the rigid body that PyBullet does not step, in both precisions."""

from benchmarks.engines import FREE, JOINT, Setting, drivers

ENGINE = "Bullet"
DOUBLE = (
    ("default", FREE, "bullet"), ("default", JOINT, ""), ("explicit", FREE, "mujoco-euler"),
    ("flags 0", FREE, "no-gyro"), ("multibody", FREE, "mujoco-euler"),
)  # fmt: skip
SINGLE = (("default", FREE, "bullet-float32"), ("flags 0", FREE, "no-gyro-float32"))


def settings() -> list[Setting]:
    """A rigid body with each gyroscopic flag and a multibody in double, the default and none in single precision."""
    double = drivers.native("bullet", f"{ENGINE}, double", "bullet-float64", DOUBLE)
    return [*double, *drivers.native("bullet", f"{ENGINE}, single", "bullet", SINGLE)]
