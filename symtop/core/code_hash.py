"""What a number was made of: a mapping from labels to hashes, found without running anything.

    file symtop/methods/runge_kutta/gauss.py                     a file that counts as a whole
    function symtop_studies/drift/study.py:measure   a function that counts by its code
    constant symtop_studies/drift/study.py:STEPS     a value that such a function names
    integrator gauss-2, scene goldstein, settings    values: coefficients, numbers, what a case is given
    package numba, python, processor                 where it was computed

The digest of a mapping is the hash of all of it; two mappings are compared label by label, which says *why* a stored
number is stale. Cases of studies, cached kernels and references, checkpoints and plug-ins are all told apart this way.

`Walk` goes from object to object. A function counts in one of two ways.

    by its file    a function of a known package (`roots`), with all files that its file imports
    by its code    a function of a script or a plug-in, and every function if `whole` is false (kernels, checkpoints):
                   instructions, constants and names, defaults, what it closes over, the globals that it names, modules'
                   attributes among them, and so on; a module that it imports when it runs counts by its file

Comments, docstrings, line numbers and places of files are no part of the code. Libraries count by name; `packages` has
their versions. Of a dataclass, fields with the metadata ``words`` do not count: they are said and not computed with.
"""

import ast
import contextlib
import dis
import functools
import hashlib
import importlib.metadata
import importlib.util
import inspect
import platform
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any, TypeVar

import numpy as np

Reasons = dict[str, str]

LENGTH = 20  # hexadecimal digits of a digest
COMPUTING = ("numpy", "scipy", "numba", "heyoka", "xarray", "netCDF4", "mpmath")  # packages that numbers pass through


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
    return _within(root, roots[root], path) if root else path.name


@functools.cache  # 60 us in Python 3.12, asked for twice for each function of a kernel
def _within(root: str, folder: Path, path: Path) -> str:
    return f"{root}/{path.relative_to(folder).as_posix()}"


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


@functools.cache
def processor() -> str:
    """The name of this machine's processor."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def packages(*names: str) -> Reasons:
    """Versions of packages; by default those that numbers pass through, and Python, whose code differs by version."""
    python = {} if names else {"package python": ".".join(platform.python_version_tuple()[:2])}
    return {f"package {name}": version(name) for name in names or COMPUTING} | python


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


Parts = Callable[[Any], Iterable[Any]]
Function = TypeVar("Function", bound=Callable[..., Any])

LIBRARIES = sys.stdlib_module_names | {
    "numpy", "scipy", "numba", "llvmlite", "heyoka", "xarray", "netCDF4", "matplotlib", "mpmath", "pandas", "tqdm",
    "click", "dask", "distributed", "packaging",
}  # fmt: skip
_IMPORT = dis.opmap["IMPORT_NAME"]

by_code: set[Path] = set()  # files of known packages whose functions count by their code
_look_ups: set[Callable[..., Any]] = set()
_CONTAINERS: tuple[tuple[Any, Parts], ...] = (
    (functools.partial, lambda thing: (thing.func, thing.args, thing.keywords)),
    (MethodType, lambda thing: (thing.__func__, thing.__self__)),
    (property, lambda thing: (thing.fget, thing.fset)),
    (Mapping, lambda thing: [part for key in sorted(thing, key=repr) for part in (key, thing[key])]),
    ((set, frozenset), lambda thing: sorted(thing, key=repr)),
    ((tuple, list), lambda thing: (type(thing), *thing)),
)


def by_name(function: Function) -> Function:
    """Let a function count by its name, as a decorator: it looks up what it is given, and that is counted by itself."""
    _look_ups.add(function)
    return function


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
    whole: bool = True  # functions of known packages count by their files
    also: Parts = lambda _: ()  # what stands for a function once it is compiled
    files: set[Path] = field(default_factory=set)  # that count, without those they import
    strings: set[str] = field(default_factory=set)  # constants of the functions that count by their code
    functions: set[FunctionType] = field(default_factory=set)  # every function that was reached
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
        return closure(self.files)

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
            self._add_function(thing)
        elif isinstance(thing, ModuleType):
            self._note(thing.__name__)
            self._add_file(getattr(thing, "__file__", None))
        elif isinstance(thing, type):
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
        if not self.whole or path is None or not root_of(path) or path in by_code:
            return False
        self.files.add(path)
        return True

    def _add_class(self, kind: type) -> None:
        self._note(f"{kind.__module__}.{kind.__qualname__}")
        if is_library(kind.__module__) or self._add_file(getattr(sys.modules.get(kind.__module__), "__file__", None)):
            return
        parts = ((name, getattr(part, "__func__", part)) for name, part in sorted(vars(kind).items()))
        self._add_all(
            part for name, part in parts if isinstance(part, (FunctionType, property)) or not name.startswith("__")
        )
        self._add_all(kind.__bases__)

    def _add_function(self, function: FunctionType) -> None:
        file = function.__code__.co_filename
        if is_library(function.__module__):
            self._note(f"{function.__module__}.{function.__qualname__}")
        elif self._add_file(file):
            self._note(function.__qualname__)
            self._add_all(held(function))
        else:
            name = f"{file_label(_path(file))}:{function.__qualname__}"
            self._note(name)
            if function not in _look_ups and function not in self.functions:
                self.functions.add(function)
                before, self.label = self.label, f"function {name}"
                self._add_code(function)
                self.label = before
        self.functions.add(function)

    def _add_code(self, function: FunctionType) -> None:
        """The code of a function, what it imports, what it holds and the globals that it names."""
        parts = list(codes(function.__code__))
        for part in parts:
            constants = [value for value in part.co_consts if not isinstance(value, CodeType)]
            if part is function.__code__ and constants[:1] == [function.__doc__]:
                del constants[0]
            self._note(part.co_code.hex(), part.co_exceptiontable.hex(), *map(_constant, constants))
            counts = part.co_argcount, part.co_kwonlyargcount, _flags(part)
            self._note(repr((part.co_names, part.co_freevars, *counts)))
            self.strings |= {value for value in constants if isinstance(value, str)}
            self.files |= set(files_of(_imports(part, function.__globals__.get("__package__") or "")))
        self._add_all(held(function))
        self._add_all(self.also(function))
        file = file_label(_path(function.__code__.co_filename))
        for name, value in named(function):
            plain = not callable(value) and not isinstance(value, ModuleType)
            self.add(value, f"constant {file}:{name}" if plain else "")


def codes(code: CodeType) -> Iterator[CodeType]:
    """A code object and those within it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from codes(constant)


def _flags(code: CodeType) -> int:
    """The flags of a code object; every function has `CO_OPTIMIZED`, but numba clears it where a profiler watches."""
    return code.co_flags | (inspect.CO_OPTIMIZED if code.co_flags & inspect.CO_NEWLOCALS else 0)


def _constant(value: Any) -> str:
    """A constant in words that are the same in every process."""
    return f"frozenset({sorted(map(repr, value))})" if isinstance(value, frozenset) else repr(value)


def _imports(code: CodeType, package: str) -> Iterator[tuple[str, tuple[str, ...]]]:
    """(module, names) of the import statements in a function's code."""
    if _IMPORT in code.co_code[::2]:
        steps = [step for step in dis.get_instructions(code) if step.opname != "EXTENDED_ARG"]
        for level, names, step in zip(steps, steps[1:], steps[2:], strict=False):
            if step.opname == "IMPORT_NAME":
                yield importlib.util.resolve_name("." * level.argval + step.argval, package), names.argval or ()


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
