"""What a number was made of: a mapping from labels to hashes, found without running anything.

    file symtop/methods/gauss.py                 a file that counts as a whole
    function symtop_studies/drift/study.py:measure   a function that counts by its text
    constant symtop_studies/drift/study.py:STEPS     a value that such a function names
    integrator gauss-2, scene goldstein, settings    values: coefficients, numbers, what a case is given
    package numba, processor                     where it was computed

The digest of a mapping is the hash of all of it; two mappings are compared label by label, which says *why* a stored
number is stale. Cases of studies, cached kernels and references, checkpoints and plug-ins are all told apart this way.

A value is walked from object to object (`Walk`). Functions of a known package (`imports.roots`) count by their file and
by the files that it imports; functions of scripts, of plug-ins and of an unknown package count by their text and by the
globals that they name, so that a new caption measures nothing again. Libraries count by name; `packages` has their
versions. Of a dataclass, fields with the metadata ``words`` do not count: they are said and not computed with.
"""

import functools
import hashlib
import importlib.metadata
import inspect
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any, TypeVar

import numpy as np

from symtop.base.imports import PACKAGE, closure, imports_in, root_of, roots

__all__ = ["PACKAGE", "Reasons", "Walk", "add_root", "by_name", "changes", "digest", "file_reasons", "packages"]

Reasons = dict[str, str]
Parts = Callable[[Any], Iterable[Any]]
Function = TypeVar("Function", bound=Callable[..., Any])

LENGTH = 20  # hexadecimal digits of a digest
COMPUTING = ("numpy", "scipy", "numba", "heyoka", "xarray", "netCDF4", "mpmath")  # packages that numbers pass through
LIBRARIES = sys.stdlib_module_names | {
    "numpy", "scipy", "numba", "llvmlite", "heyoka", "xarray", "netCDF4", "matplotlib", "mpmath", "pandas", "tqdm",
    "click", "dask", "distributed", "packaging",
}  # fmt: skip

_look_ups: set[Callable[..., Any]] = set()
_by_text: dict[str, frozenset[str]] = {}  # of a known package: names of files that count by the text of their functions
_CONTAINERS: tuple[tuple[Any, Parts], ...] = (
    (functools.partial, lambda thing: (thing.func, thing.args, thing.keywords)),
    (MethodType, lambda thing: (thing.__func__, thing.__self__)),
    (property, lambda thing: (thing.fget, thing.fset)),
    (Mapping, lambda thing: [part for key in sorted(thing, key=repr) for part in (key, thing[key])]),
    ((set, frozenset), lambda thing: sorted(thing, key=repr)),
    ((tuple, list), lambda thing: (type(thing), *thing)),
)


def add_root(name: str, folder: Path, *, by_text: Iterable[str] = ()) -> None:
    """Make a package known, so that its files count as wholes; files named in `by_text` count by their functions."""
    roots[name] = folder.resolve()
    _by_text[name] = frozenset(by_text)


def by_name(function: Function) -> Function:
    """Let a function count by its name, as a decorator: it looks up what it is given, and that is counted by itself."""
    _look_ups.add(function)
    return function


def looks_up(function: FunctionType) -> bool:
    """Does a function count by its name?"""
    return function in _look_ups


def hashed(*parts: str) -> str:
    """Hash of some text, 20 hexadecimal digits."""
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:LENGTH]


def digest(reasons: Mapping[str, str]) -> str:
    """The hash of a mapping."""
    return hashed(*(f"{label}\t{reasons[label]}" for label in sorted(reasons)))


def changes(before: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """The labels in which two mappings differ, and how."""
    labels = [label for label in sorted(before) if label in now and now[label] != before[label]]
    labels += [f"{label} (no longer counts)" for label in sorted(set(before) - set(now))]
    return labels + [f"{label} (did not count before)" for label in sorted(set(now) - set(before))]


def merged(mappings: Iterable[Mapping[str, str]]) -> Reasons:
    """All labels of some mappings; a label with several hashes has the hash of them all."""
    hashes: dict[str, set[str]] = {}
    for mapping in mappings:
        for label, value in mapping.items():
            hashes.setdefault(label, set()).add(value)
    return {label: values.pop() if len(values) == 1 else hashed(*sorted(values)) for label, values in hashes.items()}


@functools.cache
def file_hash(path: Path) -> str:
    """Hash of a file as it was when it was first asked for."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:LENGTH]


def file_label(path: Path) -> str:
    """The name of a file: with its package if that is known, by itself otherwise."""
    root = root_of(path)
    return f"{root}/{path.relative_to(roots[root]).as_posix()}" if root else path.name


def file_reasons(files: Iterable[Path]) -> Reasons:
    """Hashes of files."""
    return {f"file {file_label(path)}": file_hash(path) for path in files}


@functools.cache
def version(package: str) -> str:
    """The installed version of a package, or ``absent``."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "absent"


def packages(*names: str) -> Reasons:
    """Versions of packages; of those that numbers pass through by default."""
    return {f"package {name}": version(name) for name in names or COMPUTING}


def is_whole(file: Path) -> bool:
    """Does a file count as a whole?"""
    root = root_of(file)
    return bool(root) and file.name not in _by_text.get(root, ())


@functools.cache
def _path(name: str) -> Path:
    return Path(name).resolve()


def is_library(module: str | None) -> bool:
    """Does a module belong to a library, which counts by name and version?"""
    return (module or "").partition(".")[0] in LIBRARIES


@dataclass
class Walk:
    """Collects what things are made of; `label` is what values count for until a function has a label of its own."""

    label: str
    files: set[Path] = field(default_factory=set)  # that count as wholes, without those they import
    strings: set[str] = field(default_factory=set)  # constants of the functions that count by their text
    functions: list[FunctionType] = field(default_factory=list)  # every function that was reached
    _values: dict[str, list[str]] = field(default_factory=dict, repr=False)
    _seen: dict[tuple[str, int], object] = field(default_factory=dict, repr=False)

    def add(self, thing: Any, label: str = "") -> None:
        """Walk anything that a solver or a measure may hold, for a label."""
        before, self.label = self.label, label or self.label
        try:
            self._add(thing)
        finally:
            self.label = before

    def values(self) -> Reasons:
        """Hashes of the values of each label."""
        return {label: hashed(*values) for label, values in self._values.items()}

    def closure(self) -> frozenset[Path]:
        """The files that count, and those that they import."""
        return closure(frozenset(self.files))

    def reasons(self) -> Reasons:
        """Values and files."""
        return self.values() | file_reasons(self.closure())

    def _note(self, *values: str) -> None:
        self._values.setdefault(self.label, []).extend(values)

    def _add(self, thing: Any) -> None:
        if isinstance(thing, (type(None), bool, int, float, complex, str, bytes, np.generic)):
            self._note(repr(thing))
            return
        if not isinstance(thing, (FunctionType, type, ModuleType)):  # compiled by numba, or cached
            if hasattr(thing, "targetoptions"):
                self._note(repr(sorted(thing.targetoptions.items())))
            thing = getattr(thing, "py_func", getattr(thing, "__wrapped__", thing))
        key = (self.label, id(thing))
        if key not in self._seen:
            self._seen[key] = thing  # held, so that its id stays its own
            parts = next((parts(thing) for kind, parts in _CONTAINERS if isinstance(thing, kind)), None)
            if parts is None:
                self._add_one(thing)
            else:
                self._add_all(parts)

    def _add_all(self, things: Iterable[Any]) -> None:
        for thing in things:
            self._add(thing)

    def _add_one(self, thing: Any) -> None:
        if isinstance(thing, FunctionType):
            self.functions.append(thing)
            self._add_function(thing)
        elif isinstance(thing, ModuleType):
            self._note(thing.__name__)
            self._add_file(getattr(thing, "__file__", None))
        elif isinstance(thing, type):
            self._note(f"{thing.__module__}.{thing.__qualname__}")
            if not is_library(thing.__module__):
                self._add_class(thing)
        elif isinstance(thing, np.ndarray):
            self._note(f"{thing.dtype}{thing.shape}{hashlib.sha256(thing.tobytes()).hexdigest()}")
        elif is_dataclass(thing):
            counted = [part.name for part in fields(thing) if not part.metadata.get("words")]
            self._add_all((type(thing), *(getattr(thing, name) for name in counted)))
        else:
            self._add(type(thing))
            if not is_library(type(thing).__module__):
                self._add(getattr(thing, "__dict__", None))

    def _add_file(self, name: str | None) -> bool:
        """Count a file as a whole if it is one that does."""
        path = _path(name) if name else None
        whole = path is not None and is_whole(path)
        if path is not None and whole:
            self.files.add(path)
        return whole

    def _add_class(self, kind: type) -> None:
        if not self._add_file(getattr(sys.modules.get(kind.__module__), "__file__", None)):
            parts = [getattr(part, "__func__", part) for _, part in sorted(vars(kind).items())]
            self._note(text_of(kind))
            self._add_all(part for part in parts if isinstance(part, (FunctionType, property)))

    def _add_function(self, function: FunctionType) -> None:
        if is_library(function.__module__):
            self._note(f"{function.__module__}.{function.__qualname__}")
        elif self._add_file(function.__code__.co_filename):
            self._note(function.__qualname__)
            self._add_all(held(function))
        else:
            name = f"{file_label(_path(function.__code__.co_filename))}:{function.__qualname__}"
            self._note(name)
            before, self.label = self.label, f"function {name}"
            if (self.label, id(function)) not in self._seen:
                self._seen[self.label, id(function)] = function
                self._add_text(function)
            self.label = before

    def _add_text(self, function: FunctionType) -> None:
        """The text of a function, what it imports and the globals that it names."""
        text, file = text_of(function), _path(function.__code__.co_filename)
        self._note(text)
        self.files |= {path for path in imports_in(text, file) if is_whole(path)}
        self._add_all(held(function))
        self.strings |= {c for code in codes(function.__code__) for c in code.co_consts if isinstance(c, str)}
        for name, value in named(function):
            plain = not callable(value) and not isinstance(value, ModuleType)
            self.add(value, f"constant {file_label(file)}:{name}" if plain else "")


def held(function: FunctionType) -> Iterator[object]:
    """What a function holds besides its code: defaults and what it closes over."""
    yield from function.__defaults__ or ()
    yield function.__kwdefaults__
    for cell in function.__closure__ or ():
        try:
            yield cell.cell_contents
        except ValueError:  # not filled yet
            continue


def named(function: FunctionType) -> Iterator[tuple[str, object]]:
    """The globals that a function names, sorted, and what it may take from the modules among them."""
    names = sorted({name for code in codes(function.__code__) for name in code.co_names})
    for name in names:
        if name not in function.__globals__:
            continue
        value = function.__globals__[name]
        yield name, value
        if isinstance(value, ModuleType) and not is_library(value.__name__):
            yield from ((f"{name}.{part}", getattr(value, part)) for part in names if hasattr(value, part))


def codes(code: CodeType) -> Iterator[CodeType]:
    """A code object and those within it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from codes(constant)


def text_of(thing: FunctionType | type) -> str:
    """The text of a function or a class; the code of a function whose text is not there."""
    try:
        return inspect.getsource(thing)
    except (OSError, TypeError):
        return thing.__code__.co_code.hex() if isinstance(thing, FunctionType) else ""
