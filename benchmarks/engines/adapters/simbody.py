"""Simbody of the machine, through a driver in C++: a ball joint and gravity, by three of its integrators.

They step the quaternion and its derivative and normalise; none of them is a map of the catalogue.
"""

from benchmarks.engines import JOINT, Setting, drivers

ENGINE = "Simbody"


def settings() -> list[Setting]:
    """A first-order integrator, the one it recommends for molecules, and Runge-Kutta-Merson, all at a fixed step."""
    rows = [(name, JOINT, "") for name in ("SemiExplicitEuler", "Verlet", "RungeKuttaMerson")]
    return drivers.native("simbody", ENGINE, "simbody", rows)
