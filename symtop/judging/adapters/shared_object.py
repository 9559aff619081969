"""A function of a shared object, ``void step(double *y, double h, const double *par, long n)``.

It replaces y by the state n steps of h later. par holds I1, I3 and mgl; y is (e, L) on the axis, (q, L) on the
attitude, (theta, phi, psi and their rates) in angles. The loop is the library's own, so that it runs at its own speed:

    gcc -O3 -shared -fPIC my.c -o my.so          symtop judge ./my.so --chart axis
"""

import ctypes
from pathlib import Path
from typing import Any

import numpy as np

from symtop.core.errors import SymtopError, at_home
from symtop.judging.adapters.adapter import March, Marks, Stepper, label_of
from symtop.judging.heartbeat import heartbeat
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.plan import Array
from symtop.model.top import SymmetricTop

MOST = 20_000  # steps of one call, so that a call that hangs is told from a long run
GUARD, MARK = 8, -1.2345e-67  # doubles behind the state that must stay as they are

Doubles = ctypes.POINTER(ctypes.c_double)


class SharedObject(Stepper):
    """A stepper around one function of a library."""

    implementation = "compiled"
    own_loop = True

    def __init__(self, path: str | Path, chart: str, symbol: str = "step") -> None:
        self.path, self.chart, self.form = at_home(path).resolve(), chart, FORMULATIONS[chart]
        self.name = label_of(f"{self.path.stem}-{symbol}" if symbol != "step" else self.path.stem)
        if not self.path.is_file():
            raise SymtopError(f"a shared object must be a file that is there, not {str(path)!r}")
        try:
            self.function: Any = getattr(ctypes.CDLL(str(self.path)), symbol)
        except OSError as error:
            raise SymtopError(f"{self.path.name} is no shared object that can be loaded: {error}") from None
        except AttributeError:
            raise SymtopError(f"{self.path.name} must have a function {symbol!r}, and has none") from None
        self.function.argtypes = [Doubles, ctypes.c_double, Doubles, ctypes.c_long]
        self.function.restype = None

    def march(self, top: SymmetricTop, _par: Any, y: Array, h: float, marks: Marks) -> March:
        """The state at the marks; SymtopError if it writes beyond its state or into the parameters."""
        numbers, size = np.array([top.I1, top.I3, top.mgl]), y.size
        par, room = numbers.copy(), np.full(size + GUARD, MARK)
        room[:size] = y
        states, done = np.full((marks.size, size), np.nan), 0
        for place, mark in enumerate(marks):
            while done < mark:
                some = min(MOST, int(mark) - done)
                with heartbeat.call(h):
                    self.function(room.ctypes.data_as(Doubles), h, par.ctypes.data_as(Doubles), some)
                done += some
            states[place] = room[:size]
            if not np.isfinite(room[:size]).all():
                break
        if (room[size:] != MARK).any():
            raise SymtopError(f"{self.name} writes beyond the {size} numbers of its state")
        if (par != numbers).any():
            raise SymtopError(f"{self.name} writes into its parameters")
        return March(states, 0)
