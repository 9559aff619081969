"""Jolt through node, as jolt-physics ships it, in single precision: the gyroscopic term is off by default."""

from benchmarks.engines import FREE, JOINT, Setting, drivers

ENGINE = "Jolt (jolt-physics)"
OFF, ON = "default", "gyroscopic"


def settings() -> list[Setting]:
    """Both settings of mApplyGyroscopicForce, and a point constraint."""
    rows = ((OFF, FREE, "no-gyro-float32"), (ON, FREE, "jolt-float32"), (ON, JOINT, ""))
    return drivers.of_npm("jolt", ENGINE, "jolt-physics", rows)
