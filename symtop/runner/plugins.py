"""Plug-ins: a user's Python file that registers integrators and scenes of its own."""

import hashlib
import importlib.util
import sys
from pathlib import Path

from symtop.base.validate import SymtopError
from symtop.methods.registry import integrators, is_built_in
from symtop.model.scenes import added_scenes, scenes

MOST_NEIGHBOURS = 100
_loaded: dict[Path, str] = {}
_owners: dict[str, str] = {}


def load(path: str | Path) -> None:
    """Run a plug-in file once; what it registers is then known to every study and command."""
    file = Path(path).absolute()
    try:
        file = file.resolve()
        there = file.is_file()
    except (OSError, ValueError):  # a name that is too long, or holds a null character
        there = False
    if file in _loaded:
        return
    if not there:
        raise SymtopError(f"plugin must be a Python file, not {str(path)!r}")
    before = set(integrators()) | set(scenes())
    name = f"symtop_plugin_{file.stem}"
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        raise SymtopError(f"plugin must be a Python file, not {str(path)!r}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # kernels are cached under the name of their module
    try:
        spec.loader.exec_module(module)
    except SymtopError:
        raise
    except (Exception, SystemExit) as error:
        raise SymtopError(f"plugin {file.name} failed: {type(error).__name__}: {error}") from error
    digest = hashlib.sha256(file.read_bytes())
    for near in sorted(file.parent.glob("*.py"))[:MOST_NEIGHBOURS]:  # it may import what stands beside it
        digest.update(near.read_bytes())
    _loaded[file] = digest.hexdigest()
    for name in (set(integrators()) | set(scenes())) - before:
        _owners[name] = digest.hexdigest()


def loaded() -> list[str]:
    """Paths of the plug-ins in use, in the order they were loaded."""
    return [str(path) for path in _loaded]


def digest_of(name: str) -> str:
    """Hash of the plug-in that registered an integrator or a scene; empty for everything else."""
    return _owners.get(name, "")


def is_local(name: str) -> bool:
    """Was this integrator or scene registered by hand in this process, so that no other process can know it?"""
    return name not in _owners and (name in added_scenes() or (name in integrators() and not is_built_in(name)))
