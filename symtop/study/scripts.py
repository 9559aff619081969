"""The scripts of the studies: where they are, their names, and how one is loaded."""

import importlib.util
import sys
from pathlib import Path

from symtop.checks import SymtopError, one_of
from symtop.study.study import Study

ORDER = ("truth", "convergence", "work_precision", "drift", "stability", "reduction")  # of the report


_elsewhere: dict[str, Path] = {}  # scripts that are in no folder of studies, by the name of their study


def _beside() -> Path:
    return Path(__file__).resolve().parents[2] / "studies"


def folder() -> Path:
    """The folder of study scripts: beside the package, or in the working directory."""
    for place in (_beside(), Path.cwd() / "studies"):
        if place.is_dir():
            return place
    msg = "no folder of study scripts was found beside the package or in the working directory"
    raise SymtopError(msg)


def names() -> list[str]:
    """Names of all studies, in the order of the report."""
    found = sorted(path.stem for path in folder().glob("*.py") if not path.stem.startswith("_"))
    return [name for name in ORDER if name in found] + [name for name in found if name not in ORDER]


def file_of(name: str) -> Path:
    """The script of a study: one of the folder's by its name, or any by its path, which ends in .py."""
    if not name.endswith(".py"):
        return _elsewhere.get(name) or folder() / f"{one_of('study', name, names())}.py"
    try:
        path = Path(name).resolve()
        there = path.is_file()
    except (OSError, ValueError):  # a name that is too long, or holds a null character
        there = False
    if not there:
        msg = f"study must be a name or a Python file that is there, not {name!r}"
        raise SymtopError(msg)
    return path


def load(name: str) -> Study:
    """The study of that name or in that file."""
    file = file_of(name)
    module_name = f"symtop_study_{file.stem}"
    if getattr(sys.modules.get(module_name), "__file__", None) != str(file):
        spec = importlib.util.spec_from_file_location(module_name, file)
        if spec is None or spec.loader is None:
            msg = f"study {name!r} cannot be loaded"
            raise SymtopError(msg)
        module = importlib.util.module_from_spec(spec)
        sys.modules[module_name] = module
        try:
            spec.loader.exec_module(module)
        except SymtopError:
            sys.modules.pop(module_name)
            raise
        except (Exception, SystemExit) as error:
            sys.modules.pop(module_name)
            msg = f"study {file.name} failed: {type(error).__name__}: {error}"
            raise SymtopError(msg) from error
    found = getattr(sys.modules[module_name], "STUDY", None)
    if not isinstance(found, Study):
        msg = f"study {file.name} must define STUDY, a Study, not {found!r}"
        raise SymtopError(msg)
    if file.parent != _beside():
        _elsewhere[found.name] = file
    return found
