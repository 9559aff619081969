"""SUNDIALS' C libraries as a wheel ships them, called through ctypes, so that no right-hand side goes through Python.

Every function gets its argument types; a negative return code is an error. `Vector` is an N_Vector over a NumPy array.
"""

import ctypes
import importlib
from ctypes import c_double, c_int, c_long, c_void_p
from pathlib import Path
from typing import Any

import numpy as np

from symtop.methods.framework.plan import Array

NORMAL, NO_COMMUNICATOR = 1, 0


class Sundials:
    """The libraries beside an installed package, found by the start of their names."""

    def __init__(self, package: str, folder: str, *names: str) -> None:
        module = importlib.import_module(package)  # an ImportError here means: skip
        place = Path(str(module.__file__)).parents[1] / folder
        self.core, self.vectors, *self.others = (
            ctypes.CDLL(str(_only(place, f"libsundials_{name}-*.so*"))) for name in ("core", "nvecserial", *names)
        )
        self.context = c_void_p()
        _check(self.core.SUNContext_Create(c_int(NO_COMMUNICATOR), ctypes.byref(self.context)), "SUNContext_Create")

    def vector(self, numbers: Array) -> "Vector":
        """A vector that holds a copy of some numbers."""
        return Vector(self, numbers)


def _only(place: Path, pattern: str) -> Path:
    files = sorted(place.glob(pattern))
    if not files:
        raise ImportError(f"there is no {pattern} in {place}")
    return files[0]


def _check(code: int, name: str) -> None:
    if code < 0:
        raise RuntimeError(f"{name} of SUNDIALS returned {code}")


class Vector:
    """Numbers and the N_Vector over them."""

    def __init__(self, library: Sundials, numbers: Array) -> None:
        self.numbers = np.array(numbers, dtype=float)
        make = library.vectors.N_VMake_Serial
        make.restype, make.argtypes = c_void_p, [ctypes.c_int64, c_void_p, c_void_p]
        self.handle = c_void_p(make(self.numbers.size, self.numbers.ctypes.data, library.context))
        self._free = library.core.N_VDestroy
        self._free.argtypes, self._free.restype = [c_void_p], None

    def __del__(self) -> None:
        self._free(self.handle)


def function(library: ctypes.CDLL, name: str, *arguments: Any, returns: Any = c_int) -> Any:
    """A function of a library with its types; one that returns a code raises RuntimeError if that is negative."""
    symbol = getattr(library, name)
    symbol.argtypes, symbol.restype = list(arguments), returns
    if returns is not c_int:
        return symbol

    def call(*values: Any) -> None:
        _check(symbol(*values), name)

    return call


__all__ = ["NORMAL", "Sundials", "Vector", "c_double", "c_int", "c_long", "c_void_p", "function"]
