"""The Open Dynamics Engine of the machine, through a driver in C++, in the precision the library was built in."""

from benchmarks.engines import FREE, JOINT, Setting, drivers

ENGINE = "ODE"


def settings() -> list[Setting]:
    """The default, free and on a ball joint; its rotation is linear, which the finite rotation mode replaces."""
    rows = (
        ("default", FREE, "ode"), ("default", JOINT, ""), ("finite rotation", FREE, ""),
        ("no gyroscopic mode", FREE, "no-gyro-linear"),
    )  # fmt: skip
    return drivers.native("ode", ENGINE, "ode", rows)
