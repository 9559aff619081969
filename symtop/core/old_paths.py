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
        known = package == "symtop" and old in table()
        return ModuleSpec(name, self, is_package=not table()[old]) if known else None  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        """The module at the new path, with a warning; None, for an empty one, in the place of an old package."""
        new = table()[spec.name.partition(".")[2]]
        if not new:
            return None
        warnings.warn(f"{spec.name} is now symtop.{new}; its old path is for symtop 0.3 only", DeprecationWarning, 2)
        module = importlib.import_module(f"symtop.{new}")
        spec.loader_state = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Give the module back the spec of its new path, in whose place the import has put that of the old one."""
        if module.__spec__ is not None and module.__spec__.loader_state is not None:
            module.__spec__ = module.__spec__.loader_state


if not any(isinstance(finder, OldPaths) for finder in sys.meta_path):
    sys.meta_path.append(OldPaths())
