"""Plug-ins: a user's Python file that registers integrators and scenes of its own."""

from collections.abc import Iterable
from pathlib import Path

from symtop.base import fingerprint
from symtop.base.python_files import execute, python_file
from symtop.base.strangers import door
from symtop.methods.registry import integrators, is_built_in, split_name
from symtop.model.scenes import added_scenes, scenes

MOST_NEIGHBOURS = 100  # files beside a plug-in that count, because it may import them
_loaded: dict[Path, str] = {}  # files of plug-ins in use, and their hashes
_owners: dict[str, tuple[str, str]] = {}  # of an integrator or a scene: the label and hash of its plug-in


def load(path: str | Path) -> list[str]:
    """Run a plug-in file once; what it registers, whose names are returned, is then known to studies and commands."""
    file = python_file(path, "plugin must be a Python file")
    if file in _loaded:
        return _registered_by(file)
    before = [*integrators().values(), *scenes().values()]
    with door(f"plugin {file.name}"):
        execute(f"symtop_plugin_{file.stem}", file)
    beside = [file, *sorted(file.parent.glob("*.py"))[:MOST_NEIGHBOURS]]
    _loaded[file] = fingerprint.hashed(*(fingerprint.file_hash(path) for path in beside))
    made_of = f"plug-in {file.name}", _loaded[file]
    for name, entry in (*integrators().items(), *scenes().items()):
        if not any(entry is known for known in before):
            _owners[name] = made_of
    return _registered_by(file)


def _registered_by(file: Path) -> list[str]:
    return [name for name, made_of in _owners.items() if made_of == (f"plug-in {file.name}", _loaded[file])]


def loaded() -> list[str]:
    """Paths of the plug-ins in use, in the order they were loaded."""
    return [str(path) for path in _loaded]


def reasons(names: Iterable[str]) -> fingerprint.Reasons:
    """Hashes of the plug-ins that registered some integrators and scenes."""
    return fingerprint.merged(dict([_owners[name]]) for name in names if name in _owners)


def is_local(name: str) -> bool:
    """Was this integrator or scene registered by hand in this process, so that no other process can know it?"""
    name = split_name(name)[0]
    return name not in _owners and (name in added_scenes() or (name in integrators() and not is_built_in(name)))
