"""What compiled code is made of: the bytecode of a function and of all that it may call, and the values they hold.

No file is read, and comments, docstrings, line numbers and places of files do not count. Of each function count its
module and name, its instructions, constants and names, its defaults, what it closes over, and the globals that it
names, modules' attributes among them, and so on. A module that is imported when a function runs counts by its file.
The walk of a kernel takes about a third of a millisecond.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from types import CodeType, FunctionType
from typing import Any

from symtop.base.fingerprint import Walk, held, is_library, looks_up, named
from symtop.base.imports import module_file


def _nothing(_: FunctionType) -> Iterable[object]:
    return ()


@dataclass
class CodeWalk(Walk):
    """Collects what things are made of by bytecode.

    `also` gives what else stands for a function once it is compiled.
    """

    also: Callable[[FunctionType], Iterable[object]] = _nothing

    def _add_file(self, name: str | None) -> bool:  # noqa: ARG002
        return False

    def _add_class(self, kind: type) -> None:
        self._note(repr(getattr(kind, "_fields", ())), repr(getattr(kind, "_field_defaults", {})))
        parts = [getattr(part, "__func__", part) for _, part in sorted(vars(kind).items())]
        self._add_all(part for part in parts if isinstance(part, (FunctionType, property)))

    def _add_function(self, function: FunctionType) -> None:
        self._note(f"{function.__module__}.{function.__qualname__}")
        if is_library(function.__module__) or looks_up(function):
            return
        self._note(*_code(function.__code__, function.__doc__))
        lazy = [module_file(name) for name in function.__code__.co_names if "." in name]
        self.files |= {path for path in lazy if path is not None}
        self._add_all(held(function))
        self._add_all(value for _, value in named(function))
        self._add_all(self.also(function))


def _code(code: CodeType, doc: str | None = None) -> Iterator[str]:
    """What instructions are made of."""
    yield code.co_code.hex()
    yield code.co_exceptiontable.hex()
    yield repr((code.co_names, code.co_freevars, code.co_argcount, code.co_kwonlyargcount, code.co_flags))
    for place, constant in enumerate(code.co_consts):
        if isinstance(constant, CodeType):
            yield from _code(constant)
        elif place > 0 or constant != doc:
            yield _constant(constant)


def _constant(value: Any) -> str:
    """A constant in words that are the same in every process."""
    return f"frozenset({sorted(map(repr, value))})" if isinstance(value, frozenset) else repr(value)
