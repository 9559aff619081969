"""cannon-es through node, in double precision: no gyroscopic term, and a linear rotation."""

from benchmarks.engines import FREE, JOINT, Setting, drivers

ENGINE = "cannon-es"


def settings() -> list[Setting]:
    """The default, free and on its point-to-point constraint."""
    rows = (("default", FREE, "no-gyro-linear"), ("default", JOINT, ""))
    return drivers.of_npm("cannon", ENGINE, "cannon-es", rows)
