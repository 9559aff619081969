"""Load Python files of a user: those that a command runs, and plug-ins, which register integrators and scenes.

The fingerprint of a case covers the values that a plug-in registers and all code that it calls, in whatever file.
"""

import contextlib
import importlib.util
import sys
import traceback
from pathlib import Path
from types import ModuleType

from symtop.core.code_hash import hashed
from symtop.core.errors import SymtopError, at_home, foreign_code
from symtop.methods.framework.registry import integrators, is_built_in, split_name
from symtop.model.scenes import added_scenes, body_scenes, scenes

_loaded: dict[Path, list[str]] = {}  # files of plug-ins in use, and the names that each has registered


def python_file(path: str | Path, name: str, kind: str) -> Path:
    """The file at a path; without one, SymtopError that the argument `name` must be `kind`, such as "a Python file"."""
    exists = False
    with contextlib.suppress(OSError, ValueError):  # a name that is too long, or holds a null character
        if (file := at_home(path).resolve()).is_file():
            return file
        exists = file.exists()
    raise SymtopError(f"{name} must be {kind}, not {str(path)!r}{'' if exists else ', which does not exist'}", name)


def execute(name: str, file: Path, places: list[str] | None = None) -> ModuleType:
    """Import a file as the module `name`, which may import files beside it, or as a package with the paths `places`."""
    for stale in [loaded for loaded in sys.modules if loaded.startswith(f"{name}.")]:
        del sys.modules[stale]  # submodules of another folder with the same name
    if file.suffix != ".py":
        raise SymtopError(f"{str(file)!r} cannot be loaded: its name must end in .py")
    if places is None and str(file.parent) not in sys.path:  # as for a script, and still when its functions run
        sys.path.insert(0, str(file.parent))
    spec = importlib.util.spec_from_file_location(name, file, submodule_search_locations=places)
    assert spec is not None and spec.loader is not None  # noqa: PT018, S101  (its suffix has one)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # also because kernels are cached under the name of their module
    previous, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # no ``__pycache__`` in the user's folder
    try:
        spec.loader.exec_module(module)
    except BaseException:
        sys.modules.pop(name)
        raise
    finally:
        sys.dont_write_bytecode = previous
    return module


def load(path: str | Path) -> list[str]:
    """Run a plug-in file, once per process, and return the names of the integrators and scenes that it registers."""
    file = python_file(path, "plugin", "a Python file")
    if file in _loaded:
        return _loaded[file]
    before = [*integrators().values(), *scenes().values(), *body_scenes().values()]
    try:
        execute(f"symtop_plugin_{file.stem}_{hashed(str(file))[:8]}", file)
    except BaseException as error:
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(file)]
        source = f"plugin {file.name}, line {lines[-1]}" if lines else f"plugin {file.name}"
        if isinstance(error, SymtopError):  # without its argument's name, which is no option of a command
            raise SymtopError(f"{source}: {error}") from error
        with foreign_code(source):
            raise
    entries = (*integrators().items(), *scenes().items(), *body_scenes().items())
    _loaded[file] = [name for name, entry in entries if not any(entry is record for record in before)]
    return _loaded[file]


def loaded() -> tuple[str, ...]:
    """Paths of the plug-ins in use, in the order they were loaded."""
    return tuple(map(str, _loaded))


def is_local(name: str) -> bool:
    """Was this integrator or scene registered in this process and not by a plug-in, so that others do not have it?"""
    name = split_name(name)[0]
    registered = name in added_scenes() or (name in integrators() and not is_built_in(name))
    return registered and not any(name in names for names in _loaded.values())
