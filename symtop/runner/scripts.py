"""The scripts of the studies: where they are, their names, and how one is loaded.

A study that ships with symtop is a package of its own, ``symtop_studies.NAME``, whose module ``study`` defines
``STUDY``. Its folder lies beside the package: `studies` in a checkout, `symtop_studies` in an installed wheel; both are
imported under the second name, in the same way. Any other study is a Python file that the user names, alone or in a
package of its own (a folder with an ``__init__.py``), so that it may import what stands beside it.
"""

import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from symtop.base import fingerprint
from symtop.base.signals import TerminatedError
from symtop.base.validate import SymtopError, one_of
from symtop.runner.study import Study

STUDIES = "symtop_studies"  # the package that every shipped study belongs to

_elsewhere: dict[str, Path] = {}  # scripts of the user's own, by the name of their study


def folder() -> Path:
    """The folder of the studies that ship with symtop."""
    beside = Path(__file__).resolve().parents[2]
    for place in (beside / STUDIES, beside / "studies"):
        if (place / "__init__.py").is_file():
            return place
    raise SymtopError(f"no studies lie beside the package in {beside}; install symtop again")


def _package(name: str, place: Path) -> ModuleType:
    """The package of that name in that folder; imported once."""
    file = place / "__init__.py"
    module = sys.modules.get(name)
    if module is None or getattr(module, "__file__", None) != str(file):
        for stale in [known for known in sys.modules if known.startswith(f"{name}.")]:
            del sys.modules[stale]  # of another folder with the same name
        module = _executed(name, file, [str(place)])
    return module


def _executed(name: str, file: Path, places: list[str] | None = None) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, file, submodule_search_locations=places)
    if spec is None or spec.loader is None:
        raise SymtopError(f"study {str(file)!r} cannot be loaded")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        sys.modules.pop(name)
        raise
    return module


def install() -> ModuleType:
    """Make ``import symtop_studies`` work, wherever the studies lie.

    Their files count as wholes in a fingerprint, but for the scripts: a new caption measures nothing again.
    """
    fingerprint.add_root(STUDIES, folder(), by_text=["study.py"])
    return _package(STUDIES, folder())


def names() -> list[str]:
    """Names of the studies that ship with symtop, in the order of the report, which their package says."""
    shipped = sorted(path.parent.name for path in folder().glob("*/study.py"))
    order = install().ORDER
    return [name for name in order if name in shipped] + [name for name in shipped if name not in order]


def file_of(name: str) -> Path:
    """The script of a study: a shipped one by its name, or any by its path, which ends in .py."""
    if not name.endswith(".py"):
        return _elsewhere.get(name) or folder() / one_of("study", name, names()) / "study.py"
    try:
        path = Path(name).resolve()
        is_there = path.is_file()
    except (OSError, ValueError):  # a name that is too long, or holds a null character
        is_there = False
    if not is_there:
        raise SymtopError(f"study must be a name or a Python file that is there, not {name!r}")
    return path


def _module(file: Path) -> ModuleType:
    """The module of a script, imported once."""
    if file.parent.parent == folder():
        install()
        return importlib.import_module(f"{STUDIES}.{file.parent.name}.{file.stem}")
    if (file.parent / "__init__.py").is_file():
        package = _package(f"symtop_study_{file.parent.name}", file.parent)
        return importlib.import_module(f"{package.__name__}.{file.stem}")
    name = f"symtop_study_{file.stem}"
    module = sys.modules.get(name)
    return module if module is not None and module.__file__ == str(file) else _executed(name, file)


def load(name: str) -> Study:
    """The study of that name or in that file."""
    file = file_of(name)
    try:
        module = _module(file)
    except (SymtopError, TerminatedError):
        raise
    except (Exception, SystemExit) as error:
        raise SymtopError(f"study {file.name} failed: {type(error).__name__}: {error}") from error
    study = getattr(module, "STUDY", None)
    if not isinstance(study, Study):
        raise SymtopError(f"study {file.name} must define STUDY, a Study, not {study!r}")
    if file.parent.parent != folder():
        _elsewhere[study.name] = file
    return study
