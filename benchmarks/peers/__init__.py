"""What a user would pick instead: other people's solvers on the same tops, with the same error measure and timing."""

import importlib
from typing import NamedTuple

from symtop.methods.registry import Integrator

ADAPTERS = ("scipy", "odeint", "diffrax", "sundae", "mujoco", "rebound", "drake")


class Peer(NamedTuple):
    """One solver of another package."""

    package: str
    method: Integrator
    distribution: str = ""  # that installs it, where its name is another


def load(adapters: tuple[str, ...] = ADAPTERS) -> tuple[list[Peer], list[str]]:
    """All solvers that are installed here, and one sentence for each package that is not."""
    found, missing = [], []
    for name in adapters:
        module = importlib.import_module(f"benchmarks.peers.adapters.{name}")
        distribution = getattr(module, "DISTRIBUTION", module.PACKAGE)
        try:
            found += [Peer(module.PACKAGE, method, distribution) for method in module.peers()]
        except (ImportError, OSError) as error:  # OSError: a shared library that does not load
            missing.append(f"{module.PACKAGE} is not installed here and was skipped: {error}.")
    return found, missing
