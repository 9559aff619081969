"""Havok through node, as @babylonjs/havok ships it, in single precision: its interface has no gyroscopic switch."""

from benchmarks.engines import FREE, JOINT, Setting, drivers

ENGINE = "Havok (@babylonjs/havok)"


def settings() -> list[Setting]:
    """The default, free and on a constraint that locks the three translations."""
    return drivers.of_npm(
        "havok", ENGINE, "@babylonjs/havok", (("default", FREE, "no-gyro-float32"), ("default", JOINT, ""))
    )
