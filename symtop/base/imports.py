"""The import statements of Python files, and the files of known packages that they lead to.

A package is known by its name and folder (`roots`). Statements are found wherever they stand, also within functions;
what imports a module under a name that is made at run time is not seen. Files of `PLUMBING` move numbers and make none:
bad input, labels, caches and fingerprints, and every ``__init__.py``.
"""

import ast
import functools
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent.parent
PLUMBING = frozenset(
    Path(__file__).resolve().with_name(f"{name}.py")
    for name in ("cache", "code", "datasets", "fingerprint", "imports", "signals", "validate")
)
roots: dict[str, Path] = {PACKAGE.name: PACKAGE}  # name of a package: its folder

# parsing whole files takes 3 ms each, their import statements alone 0.1 ms
_STATEMENT = re.compile(
    rb"^[ \t]*(?:import[ \t]|from[ \t]+[.\w]+[ \t]+import\b)(?:[^\n(]*\([^)]*\)|[^\n]*)", re.MULTILINE
)


def root_of(file: Path) -> str:
    """The name of the known package that a file belongs to; empty if it belongs to none."""
    return next((name for name, folder in roots.items() if folder in file.parents), "")


def module_file(name: str) -> Path | None:
    """The file of a module of a known package, by its dotted name."""
    first, *rest = name.split(".")
    if first not in roots:
        return None
    place = roots[first].joinpath(*rest)
    return next((path for path in (place.with_suffix(".py"), place / "__init__.py") if path.is_file()), None)


def imported(file: Path) -> list[tuple[str, tuple[str, ...]]]:
    """(module, names) of every import statement of a file."""
    return list(_imported(file, root_of(file)))


@functools.cache
def _imported(file: Path, root: str) -> list[tuple[str, tuple[str, ...]]]:
    return list(_statements(file.read_bytes(), _package(file, root)))


def _package(file: Path, root: str) -> list[str]:
    return [root, *file.relative_to(roots[root]).parent.parts] if root else []


def _statements(source: bytes, package: list[str]) -> Iterator[tuple[str, tuple[str, ...]]]:
    for statement in _STATEMENT.findall(source):
        try:
            (node,) = ast.parse(statement.strip()).body
        except (SyntaxError, ValueError):  # prose that begins like a statement
            continue
        if isinstance(node, ast.Import):
            yield from ((alias.name, ()) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            yield module, tuple(alias.name for alias in node.names)


def imports_of(file: Path) -> frozenset[Path]:
    """The files of known packages that a file imports, without the plumbing."""
    return _imports_of(file, tuple(roots))


@functools.cache
def _imports_of(file: Path, _: tuple[str, ...]) -> frozenset[Path]:
    return frozenset(path for path in _files(imported(file)) if not is_plumbing(path))


def imports_in(text: str, file: Path) -> set[Path]:
    """The files of known packages that part of a file's text imports."""
    return set(_files(_statements(text.encode(), _package(file, root_of(file)))))


def _files(statements: Iterable[tuple[str, tuple[str, ...]]]) -> Iterator[Path]:
    for module, names in statements:
        places = [module_file(name) for name in (module, *(f"{module}.{name}" for name in names))]
        yield from (place for place in places if place is not None)


def is_plumbing(file: Path) -> bool:
    """Does a file move numbers without making any?"""
    return file.name == "__init__.py" or file in PLUMBING


def closure(files: frozenset[Path], stops: frozenset[Path] = frozenset()) -> frozenset[Path]:
    """Those files, the files they import, and so on, without the plumbing; what `stops` import is left out."""
    reached: set[Path] = set()
    ahead = {file for file in files if not is_plumbing(file)}
    while ahead:
        reached |= ahead
        ahead = {path for file in ahead - stops for path in imports_of(file)} - reached
    return frozenset(reached)
