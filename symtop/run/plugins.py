"""Python files of a user: those that a command runs, and plug-ins, which register integrators and scenes.

What a plug-in registers counts in a fingerprint by its values and by the code that it reaches, wherever that stands.
"""

import contextlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from symtop.core.code_hash import hashed
from symtop.core.errors import SymtopError, at_home, foreign_code
from symtop.methods.framework.registry import integrators, is_built_in, split_name
from symtop.model.scenes import added_scenes, body_scenes, scenes

_loaded: dict[Path, list[str]] = {}  # files of plug-ins in use, and the names that each has registered


def python_file(path: str | Path, name: str, kind: str) -> Path:
    """A file by its path; SymtopError that argument `name` must be of that `kind` if it is not there."""
    with contextlib.suppress(OSError, ValueError):  # a name that is too long, or holds a null character
        if (file := at_home(path).resolve()).is_file():
            return file
    raise SymtopError(f"{name} must be {kind}, not {str(path)!r}", name)


def execute(name: str, file: Path, places: list[str] | None = None) -> ModuleType:
    """A module of that name from a file, which may import what stands beside it, or a package at `places`."""
    for stale in [known for known in sys.modules if known.startswith(f"{name}.")]:
        del sys.modules[stale]  # of another folder with the same name
    if file.suffix != ".py":
        raise SymtopError(f"{str(file)!r} cannot be loaded: its name must end in .py")
    if places is None and str(file.parent) not in sys.path:  # as Python has it for a script, also when its code runs
        sys.path.insert(0, str(file.parent))
    spec = importlib.util.spec_from_file_location(name, file, submodule_search_locations=places)
    assert spec is not None and spec.loader is not None  # noqa: PT018, S101  (its suffix has one)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # also because kernels are cached under the name of their module
    usual, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # no ``__pycache__`` in the user's folder
    try:
        spec.loader.exec_module(module)
    except BaseException:
        sys.modules.pop(name)
        raise
    finally:
        sys.dont_write_bytecode = usual
    return module


def load(path: str | Path) -> list[str]:
    """Run a plug-in file once; what it registers, whose names are returned, is then known to studies and commands."""
    file = python_file(path, "plugin", "a Python file")
    if file in _loaded:
        return _loaded[file]
    before = [*integrators().values(), *scenes().values(), *body_scenes().values()]
    with foreign_code(f"plugin {file.name}"):
        try:
            execute(f"symtop_plugin_{file.stem}_{hashed(str(file))[:8]}", file)
        except SymtopError as error:  # the names in it are the file's, and no options of a command
            raise SymtopError(f"plugin {file.name}: {error}") from error
    entries = (*integrators().items(), *scenes().items(), *body_scenes().items())
    _loaded[file] = [name for name, entry in entries if not any(entry is known for known in before)]
    return _loaded[file]


def loaded() -> tuple[str, ...]:
    """Paths of the plug-ins in use, in the order they were loaded."""
    return tuple(map(str, _loaded))


def is_local(name: str) -> bool:
    """Was this integrator or scene registered by hand in this process, so that no other process can know it?"""
    name = split_name(name)[0]
    registered = name in added_scenes() or (name in integrators() and not is_built_in(name))
    return registered and not any(name in names for names in _loaded.values())
