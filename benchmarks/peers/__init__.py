"""What a user would pick instead: other people's solvers on the same tops, with the same error measure and timing."""

import importlib
from typing import NamedTuple

from symtop.methods.framework.registry import Integrator

ADAPTERS = ("scipy", "odeint", "diffrax", "sundae", "cvode", "arkode", "mujoco", "rebound", "drake")


class Peer(NamedTuple):
    """One solver of another package."""

    package: str
    method: Integrator
    language: str  # of the right-hand side, and who calls it
    distribution: str = ""  # that installs it, where its name is another

    @property
    def chart(self) -> str:
        """The one chart it runs in."""
        return self.method.chart_for("axis")

    @property
    def row(self) -> str:
        """What a table calls it: ``method[chart]``."""
        return f"{self.method.name}[{self.chart}]"


def distributions() -> dict[str, str]:
    """What installs each package, installed here or not: CVODE comes with scikit-sundae."""
    modules = [importlib.import_module(f"benchmarks.peers.adapters.{name}") for name in ADAPTERS]
    return {module.PACKAGE: getattr(module, "DISTRIBUTION", module.PACKAGE) for module in modules}


def load(adapters: tuple[str, ...] = ADAPTERS) -> tuple[list[Peer], list[str]]:
    """All solvers that are installed here, and one sentence for each package that is not."""
    peers, missing = [], []
    for name in adapters:
        module = importlib.import_module(f"benchmarks.peers.adapters.{name}")
        distribution = getattr(module, "DISTRIBUTION", module.PACKAGE)
        try:
            peers += [Peer(module.PACKAGE, method, language, distribution) for method, language in module.peers()]
        except (ImportError, OSError) as error:  # OSError: a shared library that does not load
            missing.append(f"{module.PACKAGE} is not installed here and was skipped: {error}.")
    return peers, missing
