"""Adapters of steps outside NumPy: shared objects, programs, batches of torch and JAX, and solvers of diffrax.

*shared*, ``void step(double *y, double h, const double *par, long n)`` replaces y by the state n steps of h later; par
holds I1, I3 and mgl:

    gcc -O3 -shared -fPIC my.c -o my.so          symtop judge ./my.so --chart axis

*program* reads one line on the standard input and writes states on the standard output:

    in      I1 I3 mgl h n stride y1 y2 ...           numbers, separated by blanks
    out     the state after 0, stride, 2 stride, ... n steps, as text (any blanks or commas) or as raw doubles

n is a multiple of stride. It is started for every run, so that it keeps no data between runs. *server* is a program
that is started once, for languages that start slowly: it answers line after line, each answer in text, ended by an
empty line and flushed; it writes nothing before it is asked, and NaN for a state that it cannot make. For all three, y
is (e, L) on the axis, (q, L) on the attitude, (theta, phi, psi and their rates) in angles, and h may be negative.

*torch*, *jax*: a function ``step(f, t, y, h) -> y``; y has the shape (batch, 6), a row (e, L) on the axis, or
(batch, 7), (q, L) on the attitude, and f(t, y) has the same. A torch function is called without gradients; a JAX
function is compiled by `jax.jit`. The batch has two rows, the judged state and another, on which its step must not
depend: this is tested once at the beginning.

*diffrax*: a solver such as ``diffrax.Tsit5()``, run with fixed steps in a compiled loop, as by `diffrax.diffeqsolve`
with a constant step; its internal data (a last slope, a second state) are kept during a run. The stages of an implicit
solver are solved by Newton's iteration to `SAME_ROW`, whatever its root finder, because there is no step control to
take tolerances from. A library is imported when a step of it is judged, and computes in double precision; JAX does so
while a file is loaded, too, which may make constants.
"""

import contextlib
import ctypes
import dataclasses
import functools
import importlib
import os
import re
import select
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from symtop.core.errors import SymtopError, at_home, last_words
from symtop.judging.adapters.adapter import Marks, Stepper, heartbeat, in_runs, label_of, relative_gap, repeat
from symtop.judging.adapters.python_step import MOST_NEWTON, state_like
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.plan import QUATERNIONS, Array
from symtop.model.top import SymmetricTop

MOST_STEPS = 20_000  # steps of one call, so that a call that hangs can be distinguished from a long run
GUARD_DOUBLES, GUARD_VALUE = 8, -1.2345e-67  # number and value of doubles behind the state that must not be overwritten
TEXT = b"0123456789+-.eEinfaINFA, \t\r\n"  # characters of numbers as text
WRITTEN_ROUNDING = 1e-3  # relative: largest rounding of the numbers that a program writes
STARTING_SECONDS, CHUNK_BYTES = 30.0, 65536  # more for a server's first answer; read of it at once
EMPTY_LINE = re.compile(rb"\n[ \t\r]*\n")  # the line that ends a server's answer
TIME_SLACK = 5.0  # limit of the time of a run, in times expected from earlier runs
COMPILING_SECONDS = 60.0  # additional seconds for the first call, which compiles
SECOND_ROW = 0.7  # ratio of momenta of the second row of a batch to the first
SAME_ROW = 1e-12  # relative: difference of a row alone and in a batch; tolerance of Newton's iteration
CHARTS = ("axis", "attitude")  # their equations need only arithmetic; those in angles need each library's own sine

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

    def march(self, top: SymmetricTop, _par: Any, y: Array, h: float, marks: Marks) -> Array:
        """The state at the marks; SymtopError if it writes beyond its state or into the parameters."""
        numbers, size = np.array([top.I1, top.I3, top.mgl]), y.size
        par, room = numbers.copy(), np.full(size + GUARD_DOUBLES, GUARD_VALUE)
        room[:size] = y

        def run(_first: int, steps: int, room: Array) -> Array:
            with heartbeat.call(h):
                self.function(room.ctypes.data_as(Doubles), h, par.ctypes.data_as(Doubles), steps)
            return room

        states = in_runs(run, room, marks, MOST_STEPS, lambda room: room[:size])
        if (room[size:] != GUARD_VALUE).any():
            raise SymtopError(f"{self.name} writes beyond the {size} numbers of its state")
        if (par != numbers).any():
            raise SymtopError(f"{self.name} writes into its parameters")
        return states


class Program(Stepper):
    """A stepper around a command."""

    own_loop = True
    starting: Any = 0.0  # additional seconds for a call
    ending = ""  # what ends an answer

    def __init__(self, command: str, chart: str) -> None:
        self.words, self.chart, self.form = [], chart, FORMULATIONS[chart]
        with contextlib.suppress(ValueError):  # a quotation that does not end
            self.words = shlex.split(command)
        self.words[:1] = [str(at_home(word)) if word.startswith("~") else word for word in self.words[:1]]
        if not self.words or shutil.which(self.words[0]) is None:
            raise SymtopError(f"a program must be a command that can be run, not {command!r}")
        self.name = label_of(Path(self.words[0]).name)
        self.seconds_a_step = 0.0  # of the slowest run so far

    def march(self, top: SymmetricTop, _par: Any, y: Array, h: float, marks: Marks) -> Array:
        """The state at the marks; SymtopError if the program fails or writes anything else."""
        stride, last = max(int(np.gcd.reduce(marks)), 1), int(marks[-1])
        numbers = [top.I1, top.I3, top.mgl, h, last, stride, *y.tolist()]
        answer = self._answer(" ".join(map(repr, numbers)) + "\n", h, last)
        states = _states(answer, last // stride + 1, y.size, self.name)
        deviation = states[0] - y  # zero except for rounding, the sign of a quaternion and multiples of 2 pi
        if self.chart in QUATERNIONS and states[0, :4] @ y[:4] < 0.0:
            deviation[:4] = states[0, :4] + y[:4]
        if self.chart == "angles":
            deviation[:3] = np.sin(0.5 * deviation[:3])
        if np.isfinite(states[0]).all() and not (np.abs(deviation) <= WRITTEN_ROUNDING * np.abs(y).max()).all():
            first = ", ".join(f"{value:.4g}" for value in states[0])
            words = f"{self.name} must write the start that it was given as the first of its states, not {first}"
            raise SymtopError(words)
        return states[marks // stride]

    def _answer(self, line: str, h: float, steps: int) -> bytes:
        seconds, began = heartbeat.patience + TIME_SLACK * self.seconds_a_step * steps + self.starting, time.monotonic()
        with heartbeat.call(h, 2.0 * seconds):
            try:
                answer, code, errors = self._run(line, seconds)
            except subprocess.TimeoutExpired:
                request = f"{steps} step{'s' * (steps != 1)} of {h:.3g}"
                words = f"had not ended{self.ending} {seconds:.0f} s after it was asked for {request}"
                raise SymtopError(f"{self.name} {words}") from None
        if code != 0:
            raise SymtopError(f"{self.name} ended with code {code}: {last_words(errors) or 'it said nothing'}")
        if steps > 50:  # with fewer, starting takes most of the time
            self.seconds_a_step = max(self.seconds_a_step, (time.monotonic() - began) / steps)
        return answer

    def _run(self, line: str, seconds: float) -> tuple[bytes, int, bytes]:
        """What it writes, its exit code and its errors."""
        result = subprocess.run(  # noqa: S603  (the command is the user's)
            self.words, input=line.encode(), capture_output=True, timeout=seconds, check=False
        )
        return result.stdout, result.returncode, result.stderr


class Server(Program):
    """A stepper around a program that answers line after line, as long as it does not end."""

    ending = " its answer with an empty line"
    _server: Any = None

    @property
    def starting(self) -> float:
        """Additional seconds for a call that starts the program."""
        return STARTING_SECONDS if self._server is None else 0.0

    def _run(self, line: str, seconds: float) -> tuple[bytes, int, bytes]:
        started, end = self._server is None, time.monotonic() + seconds
        if started:
            self._errors, pipe = tempfile.TemporaryFile(), subprocess.PIPE  # noqa: SIM115  (open as long as it runs)
            self._server = subprocess.Popen(self.words, stdin=pipe, stdout=pipe, stderr=self._errors, bufsize=0)  # noqa: S603
        output = self._server.stdout
        leftover = select.select([output], [], [], 0.0)[0] and os.read(output.fileno(), CHUNK_BYTES).strip()
        with contextlib.suppress(BrokenPipeError):
            self._server.stdin.write(line.encode())
        try:
            answer, *after = EMPTY_LINE.split(b"" if leftover else self._read(end), 1)
            if leftover or b"".join(after).strip():
                self.close()
                raise SymtopError(f"{self.name} must write nothing but its answer, which an empty line ends")
            if after:
                return answer, 0, b""
            code = self._server.wait(max(end - time.monotonic(), 0.0))
            self._errors.seek(0)
            errors = self._errors.read()
        except subprocess.TimeoutExpired:
            self.close()
            raise
        self.close()
        if code == 0:
            when = "after one: its form is program" if started and answer.strip() else "without an answer"
            raise SymtopError(f"{self.name} must answer line after line, and ended {when}")
        return answer, code, errors

    def _read(self, end: float) -> bytes:
        """What it writes, up to an empty line behind something else, or until it ends; TimeoutExpired after `end`."""
        output, answer, part = self._server.stdout, b"", b"\n"
        while part and not EMPTY_LINE.search(answer):
            if not select.select([output], [], [], max(end - time.monotonic(), 0.0))[0]:
                raise subprocess.TimeoutExpired(self.words, 0.0)
            part = os.read(output.fileno(), CHUNK_BYTES)
            answer = (answer + part).lstrip()
        return answer

    def close(self) -> None:
        """End the program; the next call starts another."""
        if self._server is not None:
            self._server.kill()
            for stream in (self._server.stdin, self._server.stdout, self._errors):
                stream.close()
            self._server.wait()
        self._server = None


def _states(answer: bytes, rows: int, size: int, name: str) -> Array:
    if len(answer) == 8 * rows * size and answer.translate(None, TEXT):
        return np.frombuffer(answer).reshape(rows, size).copy()
    try:
        values = np.array(answer.decode("ascii").replace(",", " ").split(), dtype=float)
    except ValueError:
        excerpt = answer[:40].decode(errors="replace").strip()
        raise SymtopError(f"{name} must write numbers, as text or as raw doubles, not {excerpt!r}") from None
    if values.size != rows * size:
        rule = f"{rows} states of {size} numbers (the start and one every stride steps), {rows * size} in all"
        raise SymtopError(f"{name} must write {rule}, not {values.size}")
    return values.reshape(rows, size)


class BatchStep(Stepper):
    """A stepper around the function; `form` is torch or jax."""

    def __init__(self, function: Callable[..., Any], chart: str, form: str, name: str = "") -> None:
        self.library, self.jax = library(form, form, chart), form == "jax"
        self.function, self.chart, self.form = function, chart, FORMULATIONS[chart]
        self.name = label_of(name or function)
        self._step = self.library.jit(self._with_field) if self.jax else self._with_field
        self._tried = False

    def march(self, _top: SymmetricTop, par: Any, y: Array, h: float, marks: Marks) -> Array:
        """The state at the marks: the first row of the batch."""
        with double_precision(self.library) if self.jax else self.library.no_grad():
            step = functools.partial(self._step, par)
            batch = self._array(np.stack([y, np.concatenate([y[:-3], SECOND_ROW * y[-3:]])]))
            if not self._tried:
                self._try(step, y, batch, h)
            return repeat(
                lambda k, rows: _call(step, self.since + k * h, rows, h), batch, marks, lambda rows: np.asarray(rows)[0]
            )

    def _array(self, values: Array) -> Any:
        return self.library.numpy.asarray(values) if self.jax else self.library.tensor(values)

    def _with_field(self, par: Any, t: float, y: Any, h: float) -> Any:
        stack, last = (self.library.numpy.stack, "axis") if self.jax else (self.library.stack, "dim")
        return self.function(field_of(self.chart, par, lambda rows: stack(rows, **{last: -1})), t, y, h)

    def _try(self, step: Callable[..., Any], y: Array, batch: Any, h: float) -> None:
        """Compare a step of the first row alone with one in the batch; SymtopError if they differ."""
        pair = (_call(step, 0.0, rows, h, COMPILING_SECONDS)[0] for rows in (self._array(y[None]), batch + 0.0))
        single, batched = (state_like(y, np.asarray(row)) for row in pair)
        if (gap := relative_gap(single, batched)) > SAME_ROW:
            detail = f"the same state with another row beside it comes out different by {gap:.1e}"
            raise SymtopError(f"a row of a batch must be stepped by itself: {detail}")
        self._tried = True


def _call(step: Callable[..., Any], t: float, batch: Any, h: float, seconds: float = 0.0) -> Any:
    with heartbeat.call(h, seconds):
        after = step(t, batch, h)
    if tuple(getattr(after, "shape", ())) != tuple(batch.shape):
        shape = getattr(after, "shape", None)
        form = type(after).__name__ if shape is None else f"shape {tuple(shape)}"
        raise SymtopError(f"step must return a batch of states, shape {tuple(batch.shape)}, not {form}")
    return after


def library(form: str, name: str, chart: str) -> Any:
    """Import the package `name`; SymtopError if it is not installed, or for a chart that is not in `CHARTS`."""
    try:
        package = importlib.import_module(name)
    except ImportError:
        raise SymtopError(f"form {form} needs the package {name}, which is not installed") from None
    if chart not in CHARTS:
        raise SymtopError(f"chart must be axis or attitude for the form {form}, not {chart!r}", "chart")
    return package


def field_of(chart: str, par: Any, stack: Any) -> Any:
    """f(t, y) on arrays; `stack(columns)` joins arrays of shape (...) along a new last axis."""
    field = FORMULATIONS[chart].field

    def f(_t: Any, y: Any) -> Any:
        """The time derivative of y, of the shape of y."""
        columns = tuple(y[..., k] for k in range(y.shape[-1]))
        zeros = 0.0 * columns[0]  # added to a constant derivative, which is a float and no array
        return stack([value + zeros if isinstance(value, float) else value for value in field(par, columns)])

    return f


@contextlib.contextmanager
def double_precision(jax: Any) -> Iterator[None]:
    """A context in which JAX computes in double precision."""
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    try:
        yield
    finally:
        jax.config.update("jax_enable_x64", before)


@contextlib.contextmanager
def x64(*, restored: bool = False) -> Iterator[None]:
    """A context in which JAX makes arrays of double precision, as constants of a file that is loaded in it, too.

    Where JAX was not imported before, its mode after is single precision if `restored`, and else stays double.
    """
    set_here, imported = "JAX_ENABLE_X64" not in os.environ, "jax" in sys.modules
    os.environ.setdefault("JAX_ENABLE_X64", "1")  # read where JAX is imported
    try:
        with double_precision(sys.modules["jax"]) if imported else contextlib.nullcontext():
            yield
    finally:
        if set_here:
            os.environ.pop("JAX_ENABLE_X64", None)
        if set_here and restored and not imported and "jax" in sys.modules:
            sys.modules["jax"].config.update("jax_enable_x64", False)


def is_solver(target: Any) -> bool:
    """Is it an instance of a solver of diffrax, or of a class derived from one?"""
    bases = [base.__module__.partition(".")[0] for base in type(target).__mro__]
    return "diffrax" in bases and hasattr(target, "term_structure")


class DiffraxSolver(Stepper):
    """A stepper around the solver."""

    implementation = "compiled"
    own_loop = True

    def __init__(self, solver: Any, chart: str, name: str = "") -> None:
        self.jax, self.diffrax = (library("diffrax", name, chart) for name in ("jax", "diffrax"))
        if not is_solver(solver):
            raise SymtopError(f"form diffrax needs an instance of a solver, such as diffrax.Tsit5(), not {solver!r}")
        if isinstance(solver.term_structure, tuple):
            name = type(solver).__name__
            words = f"{name} steps a system in two parts; form diffrax has one, y' = f(y): judge it with form separable"
            raise SymtopError(words)
        if hasattr(solver, "root_finder"):
            newton = importlib.import_module("optimistix").Newton(rtol=SAME_ROW, atol=SAME_ROW)
            solver = dataclasses.replace(solver, root_finder=newton, root_find_max_steps=MOST_NEWTON)
        self.solver, self.chart, self.form = solver, chart, FORMULATIONS[chart]
        self.name = label_of(name or solver)
        self._begin, self._run = self._compiled()
        self._fresh = True  # nothing is compiled yet

    def march(self, _top: SymmetricTop, par: Any, y: Array, h: float, marks: Marks) -> Array:
        """The state at the marks; NaN where the solver says that a step failed."""

        def run(first: int, steps: int, carry: Any) -> Any:
            with heartbeat.call(h, COMPILING_SECONDS if self._fresh else 0.0):
                after = self._run(par, *carry, self.since + first * h, h, steps)
                self.jax.block_until_ready(after)
            self._fresh = False
            return after

        with double_precision(self.jax):
            with heartbeat.call(h, COMPILING_SECONDS if self._fresh else 0.0):
                start = self.jax.numpy.asarray(y)
                memory = self._begin(par, start, h)
            return in_runs(run, (start, memory), marks, MOST_STEPS, lambda carry: np.asarray(carry[0]))

    def _compiled(self) -> tuple[Any, Any]:
        """Two compiled functions: the start of a run, and `count` steps. The top is an argument: no recompilation."""
        jax, diffrax, solver, stack = self.jax, self.diffrax, self.solver, self.jax.numpy.stack
        term = diffrax.ODETerm(lambda t, y, par: field_of(self.chart, par, lambda rows: stack(rows, axis=-1))(t, y))

        def begin(par: Any, y: Any, h: Any) -> Any:
            return solver.init(term, 0.0 * h, h, y, par)

        def run(par: Any, y: Any, memory: Any, t: Any, h: Any, count: Any) -> Any:
            def body(k: Any, carry: Any) -> Any:
                state, memory = carry
                start = t + k * h
                after, _, _, memory, result = solver.step(term, start, start + h, state, par, memory, False)
                return jax.numpy.where(result != diffrax.RESULTS.successful, jax.numpy.nan, after), memory

            return jax.lax.fori_loop(0, count, body, (y, memory))

        return jax.jit(begin), jax.jit(run)
