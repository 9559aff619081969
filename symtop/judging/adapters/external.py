"""Loops of somebody else: a function of a shared object, and any program.

*shared*, ``void step(double *y, double h, const double *par, long n)`` replaces y by the state n steps of h later; par
holds I1, I3 and mgl:

    gcc -O3 -shared -fPIC my.c -o my.so          symtop judge ./my.so --chart axis

*program* reads one line on the standard input and writes states on the standard output:

    in      I1 I3 mgl h n stride y1 y2 ...           numbers, separated by blanks
    out     the state after 0, stride, 2 stride, ... n steps, as text (any blanks or commas) or as raw doubles

n is a multiple of stride. It is started for every run, so that nothing is left from one to the next. For both, y is
(e, L) on the axis, (q, L) on the attitude, (theta, phi, psi and their rates) in angles, and h may be negative.
"""

import contextlib
import ctypes
import os
import shlex
import shutil
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np

from symtop.core.errors import SymtopError, at_home
from symtop.judging.adapters.adapter import March, Marks, Stepper, heartbeat, label_of
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.plan import Array
from symtop.model.top import SymmetricTop

MOST = 20_000  # steps of one call, so that a call that hangs is told from a long run
GUARD, MARK = 8, -1.2345e-67  # doubles behind the state that must stay as they are
WORDS = 100  # characters of what a program says when it fails
TEXT = b"0123456789+-.eEinfaINFA, \t\r\n"  # the letters of numbers
SHORT = 1e-3  # relative: digits that a program may leave out
SLACK = 5.0  # times the seconds that earlier runs make one expect

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


class Program(Stepper):
    """A stepper around a command."""

    own_loop = True

    def __init__(self, command: str, chart: str) -> None:
        self.words, self.chart, self.form = shlex.split(command), chart, FORMULATIONS[chart]
        self.words[:1] = [str(at_home(word)) if word.startswith("~") else word for word in self.words[:1]]
        if not self.words or shutil.which(self.words[0]) is None:
            raise SymtopError(f"a program must be a command that can be run, not {command!r}")
        self.name = label_of(Path(self.words[0]).name)
        self.seconds_a_step = 0.0  # of the slowest run so far

    def march(self, top: SymmetricTop, _par: Any, y: Array, h: float, marks: Marks) -> March:
        """The state at the marks; SymtopError if the program fails or writes anything else."""
        stride, last = max(int(np.gcd.reduce(marks)), 1), int(marks[-1])
        numbers = [top.I1, top.I3, top.mgl, h, last, stride, *y.tolist()]
        answer = self._answer(" ".join(map(repr, numbers)) + "\n", h, last)
        states = _states(answer, last // stride + 1, y.size, self.name)
        if not _begins(states[0], y):
            raise SymtopError(
                f"{self.name} must write the start that it was given as the first of its states, not "
                f"{', '.join(f'{value:.4g}' for value in states[0])}"
            )
        return March(states[marks // stride], 0)

    def _answer(self, line: str, h: float, steps: int) -> bytes:
        expected = SLACK * self.seconds_a_step * steps
        seconds = heartbeat.patience + expected
        with heartbeat.call(h, expected + seconds):
            began = time.monotonic()
            with subprocess.Popen(  # noqa: S603  (the command is the user's)
                self.words,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                start_new_session=True,
            ) as process:
                try:
                    out, errors = process.communicate(line.encode(), timeout=seconds)
                except subprocess.TimeoutExpired:
                    with contextlib.suppress(OSError):
                        os.killpg(process.pid, signal.SIGKILL)
                    what = f"{steps} steps of {h:.3g}"
                    raise SymtopError(
                        f"{self.name} had not ended {seconds:.0f} s after it was asked for {what}"
                    ) from None
        if process.returncode != 0:
            words = " ".join(errors.decode(errors="replace").split())[-WORDS:]
            raise SymtopError(f"{self.name} ended with code {process.returncode}: {words or 'it said nothing'}")
        if steps > 0:
            self.seconds_a_step = max(self.seconds_a_step, (time.monotonic() - began) / steps) if steps > 50 else 0.0
        return out


def _states(answer: bytes, rows: int, size: int, name: str) -> Array:
    """The states that a program wrote, shape (rows, size)."""
    if len(answer) == 8 * rows * size and answer.translate(None, TEXT):
        return np.frombuffer(answer).reshape(rows, size).copy()
    try:
        values = np.array(answer.decode("ascii").replace(",", " ").split(), dtype=float)
    except ValueError:
        shown = answer[:40].decode(errors="replace").strip()
        raise SymtopError(f"{name} must write numbers, as text or as raw doubles, not {shown!r}") from None
    if values.size != rows * size:
        raise SymtopError(
            f"{name} must write {rows} states of {size} numbers (the start and one every stride steps), "
            f"{rows * size} in all, not {values.size}"
        )
    return values.reshape(rows, size)


def _begins(state: Array, start: Array) -> bool:
    """Is a state the start, but for rounding, the sign of a quaternion and whole turns?"""
    turns = np.stack([state - start, state + start, np.sin(0.5 * (state - start))])  # any of them shows that it is
    return bool((np.abs(turns).min(axis=0) <= SHORT * np.abs(start).max()).all()) or not np.isfinite(state).all()
