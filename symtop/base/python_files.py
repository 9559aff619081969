"""A user's Python file: found, run as a module, and its errors said in one sentence."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from symtop.base.validate import SymtopError


def python_file(path: str | Path, wanted: str) -> Path:
    """A file by its path; SymtopError with the sentence `wanted` if it is not there."""
    try:
        file = Path(path).resolve()
        if file.is_file():
            return file
    except (OSError, ValueError):  # a name that is too long, or holds a null character
        pass
    raise SymtopError(f"{wanted}, not {str(path)!r}")


def execute(name: str, file: Path, places: list[str] | None = None) -> ModuleType:
    """A module of that name from a file, or a package if its `places` are given."""
    for stale in [known for known in sys.modules if known.startswith(f"{name}.")]:
        del sys.modules[stale]  # of another folder with the same name
    spec = importlib.util.spec_from_file_location(name, file, submodule_search_locations=places)
    if spec is None or spec.loader is None:
        raise SymtopError(f"{str(file)!r} cannot be loaded: its name must end in .py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # also because kernels are cached under the name of their module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        sys.modules.pop(name)
        raise
    return module
