"""Plug-ins: a user's Python file that registers integrators and scenes of its own."""

import hashlib
import importlib.util
import sys
from pathlib import Path

from symtop.checks import SymtopError

_loaded: dict[Path, str] = {}


def load(path: str | Path) -> None:
    """Run a plug-in file once; what it registers is then known to every study and command."""
    file = Path(path).resolve()
    if file in _loaded:
        return
    if not file.is_file():
        msg = f"plugin must be a Python file, not {str(path)!r}"
        raise SymtopError(msg)
    name = f"symtop_plugin_{file.stem}"
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        msg = f"plugin must be a Python file, not {str(path)!r}"
        raise SymtopError(msg)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # kernels are cached under the name of their module
    try:
        spec.loader.exec_module(module)
    except SymtopError:
        raise
    except Exception as error:
        msg = f"plugin {file.name} failed: {type(error).__name__}: {error}"
        raise SymtopError(msg) from error
    _loaded[file] = hashlib.sha256(file.read_bytes()).hexdigest()


def loaded() -> list[str]:
    """Paths of the plug-ins in use, in the order they were loaded."""
    return [str(path) for path in _loaded]


def digests() -> list[str]:
    """Hashes of the plug-ins in use."""
    return list(_loaded.values())
