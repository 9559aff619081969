"""Find and load the scripts of the studies.

A study that ships with symtop is a package, ``symtop_studies.NAME``, whose module ``study`` defines ``STUDY``. They lie
beside symtop, in `studies` in a checkout and in `symtop_studies` in an installed wheel. Any other study is a Python
file of the user, alone or in a package, so that it may import files beside it.
"""

import importlib
import sys
from pathlib import Path
from types import ModuleType

from symtop.core import code_hash
from symtop.core.errors import SymtopError, foreign_code, one_of
from symtop.run.plugins import execute, python_file
from symtop.runner.study import Study

STUDIES = "symtop_studies"  # the package of all shipped studies

_own_scripts: dict[str, Path] = {}  # the user's scripts that are loaded, by the name of their study


def folder() -> Path:
    """The folder of the studies that ship with symtop."""
    parent = Path(__file__).resolve().parents[2]
    for path in (parent / STUDIES, parent / "studies"):
        if (path / "__init__.py").is_file():
            return path
    raise SymtopError(f"no studies lie beside the package in {parent}; install symtop again")


def _import_once(name: str, file: Path, paths: list[str] | None = None) -> ModuleType:
    module = sys.modules.get(name)
    return module if module is not None and module.__file__ == str(file) else execute(name, file, paths)


def _package(name: str, path: Path) -> ModuleType:
    code_hash.add_root(name, path)
    return _import_once(name, path / "__init__.py", [str(path)])


def install() -> ModuleType:
    """Import the package ``symtop_studies`` from the folder of the studies, so that later imports of it work."""
    return _package(STUDIES, folder())


def names() -> list[str]:
    """Names of the studies that ship with symtop, in the order of the report, ``ORDER`` of their package."""
    shipped = sorted(path.parent.name for path in folder().glob("*/study.py"))
    return sorted(shipped, key=lambda name: [*install().ORDER, name].index(name))


def file_of(name: str) -> Path:
    """The script of a study by its name, or by its path, which ends in .py."""
    if name.endswith(".py"):
        return python_file(name, "study", "a name or a Python file")
    if (new := install().FORMER.get(name)) is not None:
        raise SymtopError(f"study {name} is now {new}: symtop study {new}")
    return _own_scripts.get(name) or folder() / one_of("study", name, names()) / "study.py"


def file_beside(name: str, file: str) -> Path | None:
    """page.md or columns.tsv beside a study.py, NAME.md or NAME.tsv beside another script NAME.py; None without one."""
    script = file_of(name)
    path = script.with_name(file) if script.stem == "study" else script.with_suffix(Path(file).suffix)
    return path if path.is_file() else None


def _module(file: Path) -> ModuleType:
    if file.parent.parent == folder():
        return importlib.import_module(f"{install().__name__}.{file.parent.name}.{file.stem}")
    if (file.parent / "__init__.py").is_file():
        package = _package(f"symtop_study_{file.parent.name}", file.parent)
        return importlib.import_module(f"{package.__name__}.{file.stem}")
    return _import_once(f"symtop_study_{file.stem}", file)


def load(name: str) -> Study:
    """The study of that name or in that file."""
    file = file_of(name)
    with foreign_code(f"study {file.name}"):
        study = getattr(_module(file), "STUDY", None)
    if not isinstance(study, Study):
        raise SymtopError(f"study {file.name} must define STUDY, a Study, not {study!r}")
    if file.parent.parent != folder():
        if study.name in names():
            raise SymtopError(f"study {file.name} must have a name that is not taken, not {study.name!r}")
        _own_scripts[study.name] = file
    return study
