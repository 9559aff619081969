"""PhysX 5.6.1 through node, as physx-js-webidl ships it, in single precision: the gyroscopic flag is off by default."""

from benchmarks.engines import FREE, JOINT, Setting, drivers

ENGINE = "PhysX (physx-js-webidl)"
OFF, ON = "default", "gyroscopic"


def settings() -> list[Setting]:
    """Both settings of eENABLE_GYROSCOPIC_FORCES, and a spherical joint."""
    rows = ((OFF, FREE, "no-gyro-float32"), (ON, FREE, "physx-float32"), (ON, JOINT, ""))
    return drivers.of_npm("physx", ENGINE, "physx-js-webidl", rows)
