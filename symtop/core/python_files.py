"""A file of Python of the user: looked up by its path, and run as a module."""

import importlib.util
import sys
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType

from symtop.core.errors import SymtopError, at_home


def python_file(path: str | Path, name: str, wanted: str) -> Path:
    """A file by its path; SymtopError that argument `name` must be what is `wanted` if it is not there."""
    try:
        file = at_home(path).resolve()
        if file.is_file():
            return file
    except (OSError, ValueError):  # a name that is too long, or holds a null character
        pass
    raise SymtopError(f"{name} must be {wanted}, not {str(path)!r}", name)


class _Reader(SourceFileLoader):
    """Leaves nothing beside what it loads: Python would write a ``__pycache__`` into the user's folder."""

    def set_data(self, path: str, data: object, *, _mode: int = 0) -> None:
        """Keep no bytecode."""


def execute(name: str, file: Path, places: list[str] | None = None) -> ModuleType:
    """A module of that name from a file, or a package if its `places` are given."""
    for stale in [known for known in sys.modules if known.startswith(f"{name}.")]:
        del sys.modules[stale]  # of another folder with the same name
    if file.suffix != ".py":
        raise SymtopError(f"{str(file)!r} cannot be loaded: its name must end in .py")
    reader = _Reader(name, str(file))
    spec = importlib.util.spec_from_file_location(name, file, loader=reader, submodule_search_locations=places)
    assert spec is not None  # noqa: S101  (it has a loader)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # also because kernels are cached under the name of their module
    try:
        reader.exec_module(module)
    except BaseException:
        sys.modules.pop(name)
        raise
    return module
