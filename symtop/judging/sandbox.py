"""The battery in a process of its own: a step that hangs, crashes or takes too long costs one verdict.

The process is forked, so that any function can be judged, and sends its findings as they are made. The one that waits
looks at its heartbeat. A call that does not return is ended with its process; if it was a step backwards, the next
process refuses such steps and measures the same claims again, and else the claims stay undecided and say why. Where the
system cannot fork, or JAX is loaded here, whose threads a fork would lose, the battery runs in this process and has no
limits; a file that imports JAX is loaded in the process of its own.
"""

import contextlib
import faulthandler
import multiprocessing
import os
import signal
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from typing import Any, NamedTuple

from symtop.core.errors import SymtopError, words_of
from symtop.judging.battery import Stage, measure, stages, unmeasured
from symtop.judging.claims.subject import Request
from symtop.judging.findings import Finding
from symtop.judging.heartbeat import heartbeat

THREADED = "jax"  # hangs in a process that was forked after its import
LOOK = 0.05  # seconds between two looks
OPENING = 60.0  # seconds for loading a file and its imports
VERDICT, QUICK_VERDICT = (45.0, 120.0, 15.0), (12.0, 40.0, 6.0)  # seconds for the claims of one stage, see `_limit`
WORDS = 160  # characters of what a process says before it ends


class About(NamedTuple):
    """What is judged, once it is open."""

    name: str
    chart: str
    implementation: str
    seconds_a_step: float


class Results(NamedTuple):
    """The findings of one stage, and what a figure shows of all stages so far."""

    findings: list[Finding]
    traces: dict[str, Any]


class _Failure(NamedTuple):
    """Why a process was ended, or ended by itself."""

    why: str
    backwards: bool = False  # it was in a step of -h


def run(request: Request) -> Iterator[About | Results]:
    """First what is judged, then findings as they are made; SymtopError if it cannot be opened."""
    todo = stages("step")
    if "fork" not in multiprocessing.get_all_start_methods() or THREADED in sys.modules:
        yield from _work(request, todo)
        return
    heartbeat.reset(quick=request.quick)
    opened, began = False, time.monotonic()
    while todo:
        failure = None
        with _Process(request, todo, began) as process:
            for event in process.events():
                if isinstance(event, _Failure):
                    failure = event
                elif isinstance(event, Results):
                    todo.pop(0)
                    yield event
                elif not opened:
                    opened = True
                    yield event
        if failure is None:
            return
        if not opened:
            raise SymtopError(f"it cannot be judged: {failure.why}")
        yield from _lost(request, failure, todo)


def _lost(request: Request, failure: _Failure, todo: list[Stage]) -> Iterator[Results]:
    """What a failure leaves undecided: one stage; all without a call; none if it was a step of -h, then refused."""
    if failure.backwards and not heartbeat.forward_only:
        heartbeat.forward_only = True
        return
    for stage in todo[:] if todo[0][0].name == "calls" else todo[:1]:
        todo.remove(stage)
        yield Results(unmeasured(stage, request.claimed(), failure.why), {})


def _work(request: Request, todo: list[Stage]) -> Iterator[About | Results]:
    """The stages, in this process."""
    subject = request.open()
    stepper = subject.stepper
    yield About(stepper.name, stepper.chart, stepper.implementation, subject.seconds_a_step)
    for stage in todo:
        yield Results(measure(stage, subject), subject.traces)


def _limit(spent: float, *, quick: bool) -> float:
    """Seconds for the next stage: as many as one may take, fewer as all of them come near their sum, never too few."""
    most, together, least = QUICK_VERDICT if quick else VERDICT
    return max(least, min(most, together - spent))


class _Process(contextlib.AbstractContextManager["_Process"]):
    """A forked process that works through stages, and its end of the pipe."""

    def __init__(self, request: Request, todo: list[Stage], first: float) -> None:
        self.request, self.todo, self.first = request, todo, first  # first: when the judging began
        self.output = tempfile.TemporaryFile()  # noqa: SIM115  (closed in __exit__)
        context: Any = multiprocessing.get_context("fork")
        self.ours, theirs = context.Pipe()
        self.process = context.Process(target=self._child, args=(theirs,), daemon=True)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # newer versions of Python warn of threads; the child uses none of theirs
            self.process.start()
        theirs.close()

    def _child(self, pipe: Any) -> None:
        os.setsid()  # what it starts is ended with it
        for stream in (1, 2):
            os.dup2(self.output.fileno(), stream)
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        faulthandler.disable()  # a crash is told by us
        try:
            for event in _work(self.request, list(self.todo)):
                pipe.send(event)
        except SymtopError as error:
            pipe.send(error)
        except BaseException as error:  # noqa: BLE001  (somebody else's code: what it raised is told)
            pipe.send(_Failure(words_of(error)))
        pipe.send(None)

    def events(self) -> Iterator[About | Results | _Failure]:
        """What the process tells, and at last why it ended if it did not end well."""
        limit, began = OPENING, time.monotonic()
        calls, since = heartbeat.look().calls, began
        while True:
            if self.ours.poll(LOOK):
                try:
                    event = self.ours.recv()
                except EOFError:
                    yield _Failure(self._death())
                    return
                if event is None:
                    return
                if isinstance(event, SymtopError):
                    raise event
                yield event
                if isinstance(event, _Failure):
                    return
                began = time.monotonic()
                limit = _limit(began - self.first, quick=self.request.quick)
                continue
            beat, now = heartbeat.look(), time.monotonic()
            if beat.calls != calls or not beat.inside:
                calls, since = beat.calls, now
            if now - since > beat.allowed:
                yield _Failure(
                    f"a step of h = {beat.step:.3g} had not returned after {now - since:.0f} s", beat.step < 0
                )
                return
            if now - began > limit:
                yield _Failure(f"it was not judged within {limit:.0f} s")
                return

    def _death(self) -> str:
        self.process.join(2.0)
        code, beat = self.process.exitcode, heartbeat.look()
        if code is not None and code < 0:
            during = f" in a step of h = {beat.step:.3g}" if beat.inside else ""
            return f"its process was ended by {signal.Signals(-code).name}{during}"
        self.output.seek(0)
        words = " ".join(self.output.read()[-4 * WORDS :].decode(errors="replace").split())[-WORDS:]
        return f"its process ended with code {code}{': ' if words else ''}{words}"

    def __exit__(self, *_: object) -> None:
        if self.process.is_alive():
            with contextlib.suppress(OSError):
                os.killpg(self.process.pid, signal.SIGKILL)
            self.process.kill()
        self.process.join()
        self.ours.close()
        self.output.close()
