"""What a value is made of, found by walking from object to object: hashes by label, and files (see `fingerprint`).

A function counts in one of two ways.

    by its file    a function of a known package (`imports.roots`), with all files that its file imports
    by its code    a function of a script or a plug-in, and every function if `whole` is false (kernels, checkpoints):
                   instructions, constants and names, defaults, what it closes over, the globals that it names, modules'
                   attributes among them, and so on; a module that it imports when it runs counts by its file

Comments, docstrings, line numbers and places of files are no part of the code, so that a new caption measures nothing
again. Libraries count by name; `fingerprint.packages` has their versions. Of a dataclass, fields with the metadata
``words`` do not count: they are said and not computed with. The walk of a kernel takes about a third of a millisecond.
"""

import dis
import functools
import hashlib
import importlib.util
import inspect
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any, TypeVar

import numpy as np

from symtop.base.fingerprint import Reasons, file_label, hashed
from symtop.base.imports import closure, files_of, root_of

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
