"""Plug-ins: a user's Python file that registers integrators and scenes of its own.

What it registers counts in a fingerprint by its values and by the code that it reaches, wherever that stands.
"""

from pathlib import Path

from symtop.core.errors import SymtopError, foreign_code
from symtop.core.files import execute, python_file
from symtop.methods.framework.registry import integrators, is_built_in, split_name
from symtop.model.scenes import added_scenes, body_scenes, scenes

_loaded: dict[Path, list[str]] = {}  # files of plug-ins in use, and the names that each has registered


def load(path: str | Path) -> list[str]:
    """Run a plug-in file once; what it registers, whose names are returned, is then known to studies and commands."""
    file = python_file(path, "plugin", "a Python file")
    if file in _loaded:
        return _loaded[file]
    before = [*integrators().values(), *scenes().values(), *body_scenes().values()]
    with foreign_code(f"plugin {file.name}"):
        try:
            execute(f"symtop_plugin_{file.stem}", file)
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
