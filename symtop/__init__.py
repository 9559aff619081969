"""symtop: integrators compared on the heavy symmetric top.

    >>> import symtop
    >>> data = symtop.simulate("spheroid", "midpoint", step_size=0.01)

Names are imported on first use, so that ``import symtop`` costs nothing.
"""

import importlib
import sys
from types import ModuleType
from typing import Any

__version__ = "0.1.0"

_HOME = {
    "Angles": "top",
    "SymmetricTop": "top",
    "Momenta": "top",
    "Scene": "scenes",
    "register_scene": "scenes",
    "scene": "scenes",
    "scenes": "scenes",
    "SymtopError": "checks",
    "SymtopWarning": "checks",
    "Integrator": "integrators.registry",
    "Plan": "integrators.registry",
    "Run": "integrators.registry",
    "integrator": "integrators.registry",
    "integrators": "integrators.registry",
    "register": "integrators.registry",
    "discrete_lagrangian": "integrators.discrete_lagrangian",
    "citation": "integrators.citations",
    "composition": "integrators.splitting",
    "runge_kutta": "integrators.runge_kutta",
    "simulate": "simulate",
    "long_run": "measure.longrun",
    "reference": "reference",
    "ClosedForm": "exact",
    "recommend": "advise",
    "Advice": "advise",
}

__all__ = ["__version__", *_HOME]  # noqa: PLE0604  (strings all)


class _Package(ModuleType):
    """Keeps `symtop.scenes`, `integrators`, `simulate` and `reference` the functions that users call.

    The import system would bind the submodules of the same names over them.
    """

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        msg = f"module 'symtop' has no attribute {name!r}"
        raise AttributeError(msg)
    value = getattr(importlib.import_module(f"symtop.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__


sys.modules[__name__].__class__ = _Package
