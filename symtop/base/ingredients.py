"""What something was made of: the files of this package and the values that can be reached from it, without running it.

    a function      its file; what it closes over; its defaults (a compiled one: the function that was compiled)
    a table         a tuple of coefficients, a dataclass, an array: its values
    a plug-in's     function: its text, and the globals that it names

Two integrators of one name but other coefficients or other code differ in it, and so do an integrator and its edited
self in the next process.
"""

import functools
import hashlib
import inspect
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from symtop.methods.registry import Integrator, integrators

PACKAGE = Path(__file__).resolve().parent.parent
WORDS = ("summary", "reference")  # of an Integrator: said, not computed
SCRIPTS = ("symtop_study_", "symtop_plugin_", "symtop_studies.")  # what modules of scripts and plug-ins are called

_CONTAINERS: tuple[tuple[Any, Callable[[Any], Iterable[Any]]], ...] = (
    (functools.partial, lambda thing: (thing.func, thing.args, thing.keywords)),
    (MethodType, lambda thing: (thing.__func__, thing.__self__)),
    (Mapping, lambda thing: [part for key in sorted(thing, key=repr) for part in (key, thing[key])]),
    ((set, frozenset), lambda thing: sorted(thing, key=repr)),
    ((tuple, list), lambda thing: (type(thing), *thing)),
)


@dataclass
class Ingredients:
    """Files of the package and values that something was made of."""

    files: set[Path] = field(default_factory=set)
    values: list[str] = field(default_factory=list)
    constants: set[str] = field(default_factory=set)  # strings in the functions of scripts
    lists: bool = False  # such a function asks for all integrators
    _seen: dict[int, object] = field(default_factory=dict, repr=False)

    def add(self, thing: Any) -> None:
        """Walk anything that a solver or a measure may hold."""
        if isinstance(thing, (type(None), bool, int, float, complex, str, bytes, np.generic)):
            self.values.append(repr(thing))
        elif id(thing) not in self._seen:
            self._seen[id(thing)] = thing
            if not isinstance(thing, (FunctionType, type)):  # compiled by numba, or cached
                thing = getattr(thing, "py_func", getattr(thing, "__wrapped__", thing))
            parts = next((parts(thing) for kind, parts in _CONTAINERS if isinstance(thing, kind)), None)
            if parts is None:
                self._add_one(thing)
            else:
                self._add_all(parts)

    def _add_one(self, thing: Any) -> None:
        if isinstance(thing, FunctionType):
            self._add_function(thing)
        elif isinstance(thing, ModuleType):
            self._is_ours(thing)
        elif isinstance(thing, type):
            self.values.append(f"{thing.__module__}.{thing.__qualname__}")
            if not self._is_ours(sys.modules.get(thing.__module__)) and thing.__module__.startswith(SCRIPTS):
                self._add_all(part for _, part in sorted(vars(thing).items()) if isinstance(part, FunctionType))
        elif isinstance(thing, np.ndarray):
            self.values.append(f"{thing.dtype}{thing.shape}{hashlib.sha256(thing.tobytes()).hexdigest()}")
        elif is_dataclass(thing):
            spoken = WORDS if isinstance(thing, Integrator) else ()
            self._add_all((type(thing), *(getattr(thing, f.name) for f in fields(thing) if f.name not in spoken)))
        else:
            self.add(type(thing))
            if self._is_ours(sys.modules.get(type(thing).__module__)):
                self.add(getattr(thing, "__dict__", None))

    def _add_all(self, things: Iterable[Any]) -> None:
        for thing in things:
            self.add(thing)

    def _is_ours(self, module: ModuleType | None) -> bool:
        return self._add_file(getattr(module, "__file__", None))

    def _add_file(self, name: str | None) -> bool:
        path = Path(name).resolve() if name else None
        ours = path is not None and PACKAGE in path.parents
        if ours and path is not None:
            self.files.add(path)
        return ours

    def _add_function(self, function: FunctionType) -> None:
        self.values.append(function.__qualname__)
        self._add_all(function.__defaults__ or ())
        self.add(function.__kwdefaults__)
        for cell in function.__closure__ or ():
            try:
                self.add(cell.cell_contents)
            except ValueError:  # not filled yet
                continue
        if not self._add_file(function.__code__.co_filename):  # a script or a plug-in: its text, and what it names
            self.values.append(_text(function))
            self.constants |= {c for part in _codes(function.__code__) for c in part.co_consts if isinstance(c, str)}
            named = [name for name in _names(function.__code__) if name in function.__globals__]
            self.lists = self.lists or any(function.__globals__[name] is integrators for name in named)
            self._add_all(function.__globals__[name] for name in named)


def _text(function: FunctionType) -> str:
    try:
        return inspect.getsource(function)
    except (OSError, TypeError):
        return function.__code__.co_code.hex()


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _names(code: CodeType) -> list[str]:
    """Names in a function's code, sorted, so that equal sources give equal digests."""
    return sorted({name for part in _codes(code) for name in part.co_names})
