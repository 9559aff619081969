"""The import statements of Python files, and the files of known packages that they lead to.

A package is known by its name and folder (`roots`). Statements are found wherever they stand, also within functions;
what imports a module under a name that is made at run time is not seen. Files of `PLUMBING` move numbers and make none:
bad input, labels, caches, clocks and fingerprints, and every ``__init__.py``.
"""

import ast
import functools
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent.parent
PLUMBING = frozenset(
    Path(__file__).resolve().with_name(f"{name}.py")
    for name in ("cache", "clock", "datasets", "fingerprint", "imports", "progress", "signals", "validate", "walk")
)
roots: dict[str, Path] = {PACKAGE.name: PACKAGE}  # name of a package: its folder
Imported = tuple[str, tuple[str, ...]]  # module, names

# parsing whole files takes 3 ms each, their import statements alone 0.1 ms
_STATEMENT = re.compile(
    rb"^[ \t]*(?:import[ \t]|from[ \t]+[.\w]+[ \t]+import\b)(?:[^\n(]*\([^)]*\)|[^\n]*)", re.MULTILINE
)


def add_root(name: str, folder: Path) -> None:
    """Make a package known."""
    if roots.get(name) != folder.resolve():
        roots[name] = folder.resolve()
        for cached in (root_of, imported, imports_of):
            cached.cache_clear()


@functools.cache
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


@functools.cache
def imported(file: Path) -> list[Imported]:
    """(module, names) of every import statement of a file."""
    root = root_of(file)
    package = [root, *file.relative_to(roots[root]).parent.parts] if root else []
    return list(_statements(file.read_bytes(), package))


def _statements(source: bytes, package: list[str]) -> Iterator[Imported]:
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


def files_of(statements: Iterable[Imported]) -> Iterator[Path]:
    """The files of known packages that import statements lead to, without the plumbing."""
    for module, names in statements:
        places = [module_file(name) for name in (module, *(f"{module}.{name}" for name in names))]
        yield from (place for place in places if place is not None and not is_plumbing(place))


@functools.cache
def imports_of(file: Path) -> frozenset[Path]:
    """The files of known packages that a file imports, without the plumbing."""
    return frozenset(files_of(imported(file)))


def is_plumbing(file: Path) -> bool:
    """Does a file move numbers without making any?"""
    return file.name == "__init__.py" or file in PLUMBING


def closure(files: Iterable[Path], stops: frozenset[Path] = frozenset()) -> frozenset[Path]:
    """Those files, the files they import, and so on, without the plumbing; what `stops` import is left out."""
    reached: set[Path] = set()
    ahead = {file for file in files if not is_plumbing(file)}
    while ahead:
        reached |= ahead
        ahead = {path for file in ahead - stops for path in imports_of(file)} - reached
    return frozenset(reached)
