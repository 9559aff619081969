"""Run the judged code in a process of its own, which answers calls; verdicts are computed in the calling process.

The process is forked, so that any function can be judged, and answers in JSON: foreign code that changes symtop in its
memory, or writes output, cannot change a verdict. If a call does not return, its process is killed, and the rest of its
stage is undecided; if it was a step backwards, the next process refuses such steps. If the system cannot fork, or JAX
is loaded, whose threads a fork would lose, everything is called in this process, without limits.
"""

import contextlib
import faulthandler
import functools
import json
import multiprocessing
import os
import signal
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from symtop.core.errors import SymtopError, last_words, words_of
from symtop.judging.adapters.adapter import Marks, Stepper, heartbeat
from symtop.judging.adapters.python_step import MATRIX, REDUCED, ROTATION
from symtop.judging.findings import as_time
from symtop.methods.framework import equations
from symtop.methods.framework.calling import OWN, solve
from symtop.methods.framework.plan import Array, Plan, Run
from symtop.methods.framework.registry import Integrator
from symtop.model.top import Angles, SymmetricTop

Table = dict[str, Callable[..., Any]]
THREADED = "jax"  # hangs in a process that was forked after its import
LOOK_SECONDS = 0.05  # seconds between two checks for an answer
PATIENCE = 60.0  # seconds for loading
FORMS = {"rotation": ROTATION, "matrix": MATRIX, "plane": REDUCED}  # other steppers have the form of their chart
SENT_ATTRIBUTES = ("name", "chart", "implementation", "own_loop", "takes_field")  # of a stepper


class Process(contextlib.AbstractContextManager["Process"]):
    """A worker process that calls functions of the table that `make` returns in it; a context manager that ends it."""

    def __init__(self, make: Callable[[], Table]) -> None:
        self.make, self.lost, self.limit, self.began = make, "", 0.0, 0.0
        self.calls, self.late = 0, 0.0  # calls of a step before `allow`; mean seconds of one, if `limit` was exceeded
        self.forked = "fork" in multiprocessing.get_all_start_methods() and THREADED not in sys.modules
        self.table: Table | None = None
        self.process: Any = None

    def __exit__(self, *_: object) -> None:
        if self.process is not None:
            if self.process.is_alive():
                with contextlib.suppress(OSError):
                    os.killpg(self.process.pid, signal.SIGKILL)
                self.process.kill()
            self.process.join()
            self.pipe.close()
            self.output.close()
        elif self.table and "close" in self.table:
            self.table["close"]()
        self.process = None

    end = __exit__

    def allow(self, seconds: float) -> None:
        """Limit the total time of the following calls; a process that was lost is started again."""
        self.lost, self.limit, self.began = "", seconds, clock(self.process.pid if self.process else 0)
        self.calls, self.late = heartbeat.calls, 0.0

    def call(self, name: str, *args: Any) -> Any:
        """Call a function of the table in the process; SymtopError if it raises or the process has ended."""
        if self.lost:
            raise SymtopError(self.lost)
        if not self.forked:
            self.table = self.table or self.make()
            return self.table[name](*args)
        if self.process is None:
            self._start()
        try:
            with contextlib.suppress(BrokenPipeError):
                self.pipe.send((name, args))
            kind, answer = self._answer()
        except SymtopError as failure:
            backward = heartbeat.inside and heartbeat.step < 0.0 and not heartbeat.forward_only
            self.end()
            if not backward:
                self.lost = str(failure)
                raise
            heartbeat.forward_only = True
            return self.call(name, *args)
        if kind == "error":
            raise SymtopError(answer)
        return answer

    def _start(self) -> None:
        context: Any = multiprocessing.get_context("fork")
        self.pipe, child_pipe = context.Pipe()
        self.output = tempfile.TemporaryFile()  # noqa: SIM115  (closed with the process)
        self.process = context.Process(target=_serve, args=(self.make, self.pipe, child_pipe, self.output), daemon=True)
        with warnings.catch_warnings():
            # newer versions of Python warn of a fork with threads, which the child does not use
            warnings.filterwarnings("ignore", "This process .* is multi-threaded", DeprecationWarning)
            heartbeat.inside = False
            self.process.start()
        child_pipe.close()
        self.began = clock(self.process.pid)

    def _answer(self) -> Any:
        """The answer of the process; SymtopError if it ends, hangs in a call or exceeds `limit`."""
        calls, start = heartbeat.calls, clock(self.process.pid)
        while not self.pipe.poll(LOOK_SECONDS):
            now = clock(self.process.pid)
            if heartbeat.calls != calls or not heartbeat.inside:
                calls, start = heartbeat.calls, now
            if now - start > heartbeat.allowed:
                raise SymtopError(f"a step of h = {heartbeat.step:.3g} had not returned after {now - start:.0f} s")
            if now - self.began > self.limit:
                self.late = self.limit / max(heartbeat.calls - self.calls, 1)
                raise SymtopError(f"it was not judged within {self.limit:.0f} s, at {as_time(self.late)} a call")
        try:
            return json.loads(self.pipe.recv_bytes())
        except (EOFError, OSError, ValueError):
            raise SymtopError(self._death_message()) from None

    def _death_message(self) -> str:
        self.process.join(2.0)
        code = self.process.exitcode
        if code is not None and code < 0:
            during = f" in a step of h = {heartbeat.step:.3g}" if heartbeat.inside else ""
            name = next((sig.name for sig in signal.Signals if sig == -code), f"signal {-code}")  # one in real time
            return f"its process was ended by {name}{during}"
        self.output.seek(0)
        words = last_words(self.output.read())
        return f"its process ended with code {code}{': ' if words else ''}{words}"


def _serve(make: Callable[[], Table], parent_pipe: Any, pipe: Any, output: Any) -> None:
    os.setsid()  # a process group, so that its children can be killed with it
    parent_pipe.close()  # inherited; left open, it would keep this process waiting after its parent was killed
    for stream in (1, 2):
        os.dup2(output.fileno(), stream)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    faulthandler.disable()  # the parent reports a crash
    warnings.simplefilter("ignore")  # warnings of a step, for instance of overflow, are not reported
    table: Table = {}
    while True:
        try:
            name, args = pipe.recv()
        except EOFError:
            return
        try:
            table = table or make()
            answer = "answer", table[name](*args)
        except BaseException as error:  # noqa: BLE001  (somebody else's code)
            answer = "error", str(error) if isinstance(error, SymtopError) else words_of(error)
        pipe.send_bytes(json.dumps(answer, default=lambda value: value.tolist()).encode())


def clock(pid: int) -> float:
    """Seconds, without the time that process `pid` waited for a processor; only Linux counts that."""
    try:
        waited = int(Path(f"/proc/{pid}/schedstat").read_text(encoding="ascii").split()[1]) * 1e-9
    except (OSError, IndexError, ValueError):
        waited = 0.0
    return time.monotonic() - waited


def try_separately(call: Callable[[], Any], name: str) -> None:
    """Try a call in a process of its own; SymtopError that `name` cannot be loaded if it crashes or takes too long."""
    with Process(lambda: {"call": call}) as process:
        process.allow(PATIENCE)
        with contextlib.suppress(SymtopError):
            process.call("call")
        if process.lost:
            raise SymtopError(f"{name} cannot be loaded: {process.lost}")


def table_of(load: Callable[[], Stepper]) -> Table:
    """The functions of a stepper that `Remote` calls, by name."""
    stepper: Any = load()

    def march(since: float, *args: Any) -> tuple[Any, ...]:
        stepper.since = since
        return stepper.march(*args), stepper.evaluations, stepper.wrote

    def along(f: Any, *args: Any) -> tuple[Any, ...]:
        return stepper.along(f, *args), sorted(getattr(f, "times", ()))

    def about() -> dict[str, Any]:
        facts = {name: getattr(stepper, name) for name in SENT_ATTRIBUTES}
        kind = next((name for name, form in FORMS.items() if form is stepper.form), "")
        return facts | {"kind": kind, "adaptive": stepper.adaptive is not None}

    def adaptive(*args: Any) -> dict[str, Any]:
        return stepper.adaptive(*args)._asdict()  # type: ignore[no-any-return]

    return {"march": march, "along": along, "about": about, "adaptive": adaptive, "close": stepper.close}


class Remote(Stepper):
    """A stepper whose steps are made in a worker process."""

    def __init__(self, process: Process) -> None:
        self.process, facts = process, process.call("about")
        self.form = FORMS.get(facts["kind"]) or equations.FORMS[facts["chart"]]
        self.adaptive = functools.partial(_run, process, "adaptive") if facts["adaptive"] else None
        for name in SENT_ATTRIBUTES:
            setattr(self, name, facts[name])

    def clock(self) -> float:
        """Seconds, without the time that the process waited for a processor."""
        return clock(self.process.process.pid) if self.process.process else time.monotonic()

    def renew(self) -> None:
        """End the process; the next call starts a new one, without memory of earlier calls."""
        self.process.end()

    def march(self, top: SymmetricTop, par: Any, y: Array, h: float, marks: Marks) -> Array:
        """The state at the marks."""
        states, self.evaluations, self.wrote = self.process.call("march", self.since, top, par, y, h, marks)
        return np.array(states, dtype=float).reshape(marks.size, y.size)

    def along(self, f: Any, t: float, y: Array, h: float, marks: Marks) -> Array:
        """The states at the marks for a right-hand side that can be pickled, from time t on."""
        states, times = self.process.call("along", f, t, y, h, marks)
        getattr(f, "times", set[float]()).update(map(float, times))
        return np.array(states, dtype=float).reshape(marks.size, y.size)


def _run(process: Process, name: str, top: SymmetricTop, start: Angles, plan: Plan) -> Run:
    fields = process.call(name, top, start, plan)
    return Run(**fields | {name: np.array(fields[name], dtype=float) for name in Run._fields[:3]})


def separated(method: Integrator, process: Process) -> Integrator:
    """The method with its foreign solvers called in a process with the table `solvers_of`; symtop's stay here."""
    foreign = [chart for chart, run in method.solvers.items() if not getattr(run, "__module__", "").startswith(OWN)]
    solvers = {chart: functools.partial(_run, process, chart) for chart in foreign}
    return replace(method, solvers=dict(method.solvers) | solvers)


def solvers_of(method: Integrator) -> Table:
    """A table of a method's solvers by chart, for `Process`; their runs are checked before they are sent."""
    return {chart: lambda *args, chart=chart: solve(method, chart, *args)._asdict() for chart in method.solvers}
