"""Modules under the paths that they had in symtop 0.2, for one version: an import warns and names the new path.

`old_paths.txt` has a line for each, ``old new``; an old package whose modules have left for several has no new path.
It is read when a name of symtop is found nowhere else.
"""

import functools
import importlib
import sys
import warnings
from importlib.machinery import ModuleSpec
from types import ModuleType


@functools.cache
def table() -> dict[str, str]:
    """The new path of each old one, both without ``symtop.``."""
    from pathlib import Path  # not with every `import symtop`

    lines = Path(__file__).with_suffix(".txt").read_text(encoding="utf-8").splitlines()
    return {old: new for old, _, new in (line.partition(" ") for line in lines)}


class OldPaths:
    """Finds a module under its old path and loads the one that it has become."""

    def find_spec(self, name: str, _path: object = None, _target: object = None) -> ModuleSpec | None:
        """A spec for an old path; None for every other name."""
        package, _, old = name.partition(".")
        is_old = package == "symtop" and old in table()
        return ModuleSpec(name, self, is_package=not table()[old]) if is_old else None  # type: ignore[arg-type]

    def create_module(self, _spec: ModuleSpec) -> None:
        """An empty module, as an old package remains."""

    def exec_module(self, module: ModuleType) -> None:
        """Put the module at the new path in the place of an empty one, with a warning; the import returns that."""
        name = module.__name__
        if new := table()[name.partition(".")[2]]:
            warnings.warn(f"{name} is now symtop.{new}; its old path is for symtop 0.3 only", DeprecationWarning, 2)
            sys.modules[name] = importlib.import_module(f"symtop.{new}")


if not any(isinstance(finder, OldPaths) for finder in sys.meta_path):
    sys.meta_path.append(OldPaths())
