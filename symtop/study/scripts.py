"""The scripts of the studies: where they are, their names, and how one is loaded."""

import importlib.util
import sys
from pathlib import Path

from symtop.checks import SymtopError, one_of
from symtop.study.study import Study

ORDER = ("truth", "convergence", "work_precision", "drift", "stability", "reduction")  # of the report


def folder() -> Path:
    """The folder of study scripts: beside the package, or in the working directory."""
    for place in (Path(__file__).resolve().parents[2] / "studies", Path.cwd() / "studies"):
        if place.is_dir():
            return place
    msg = "no folder of study scripts was found beside the package or in the working directory"
    raise SymtopError(msg)


def names() -> list[str]:
    """Names of all studies, in the order of the report."""
    found = sorted(path.stem for path in folder().glob("*.py") if not path.stem.startswith("_"))
    return [name for name in ORDER if name in found] + [name for name in found if name not in ORDER]


def load(name: str) -> Study:
    """The study of that name."""
    file = folder() / f"{one_of('study', name, names())}.py"
    module_name = f"symtop_study_{name}"
    if module_name not in sys.modules:
        spec = importlib.util.spec_from_file_location(module_name, file)
        if spec is None or spec.loader is None:
            msg = f"study {name!r} cannot be loaded"
            raise SymtopError(msg)
        module = importlib.util.module_from_spec(spec)
        sys.modules[module_name] = module
        try:
            spec.loader.exec_module(module)
        except BaseException:
            sys.modules.pop(module_name)
            raise
    found = getattr(sys.modules[module_name], "STUDY", None)
    if not isinstance(found, Study):
        msg = f"study {name!r} must define STUDY, a Study, not {found!r}"
        raise SymtopError(msg)
    return found
