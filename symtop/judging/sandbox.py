"""The battery in a process of its own, watched: a step that hangs, crashes or takes too long costs one verdict.

The process is forked, so that any function can be judged, and tells what it finds as it finds it. The one that waits
looks at its pulse. A call that does not return is ended with its process; if it was a step backwards, the next process
refuses such steps and measures the same claims again, and else the claims stay undecided and say why. Where the system
cannot fork, or JAX is loaded here, whose threads a fork would lose, the battery runs in this process and has no limits;
a file that imports JAX is loaded in the process of its own.
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
from symtop.judging.battery import STAGES, Request, declared, measure, open_request
from symtop.judging.claims import Traces
from symtop.judging.findings import Finding, undecided
from symtop.judging.heartbeat import pulse

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


class Found(NamedTuple):
    """The findings of one stage, and what a figure shows of them."""

    findings: list[Finding]
    traces: Traces


class _Ended(NamedTuple):
    """Why a process was ended, or ended by itself."""

    why: str
    backwards: bool = False  # it was in a step of -h


def judged(request: Request) -> Iterator[About | Found]:
    """First what is judged, then findings as they are made; SymtopError if it cannot be opened."""
    todo = list(STAGES)
    if "fork" not in multiprocessing.get_all_start_methods() or THREADED in sys.modules:
        yield from _work(request, todo)
        return
    pulse.begin_judging(quick=request.quick)
    opened, began = False, time.monotonic()
    while todo:
        ended = None
        with _Process(request, todo, began) as process:
            for event in process.events():
                if isinstance(event, _Ended):
                    ended = event
                elif isinstance(event, Found):
                    todo.pop(0)
                    yield event
                elif not opened:
                    opened = True
                    yield event
        if ended is not None and not opened:
            raise SymtopError(f"it cannot be judged: {ended.why}")
        if ended is None:
            return
        yield from _lost(request, ended, todo)


def _lost(request: Request, ended: _Ended, todo: list[str]) -> Iterator[Found]:
    """What is left undecided by a process that was ended: one verdict; all without a step; none if it went back."""
    if ended.backwards and not pulse.forward_only:
        pulse.forward_only = True
        return
    for stage in todo[:] if todo[0] == "calls" else todo[:1]:
        todo.remove(stage)
        yield Found([undecided(claim, declared(request, claim), ended.why) for claim in STAGES[stage]], {})


def _work(request: Request, todo: list[str]) -> Iterator[About | Found]:
    """The stages, in this process."""
    thing = open_request(request)
    stepper = thing.stepper
    yield About(stepper.name, stepper.chart, stepper.implementation, thing.seconds_a_step)
    for stage in todo:
        traces: Traces = {}
        yield Found(measure(stage, thing, request, traces), traces)


def _limit(spent: float, *, quick: bool) -> float:
    """Seconds for the next stage: as many as one may take, fewer as all of them come near their sum, never too few."""
    most, together, least = QUICK_VERDICT if quick else VERDICT
    return max(least, min(most, together - spent))


class _Process(contextlib.AbstractContextManager["_Process"]):
    """A forked process that works through stages, and its end of the pipe."""

    def __init__(self, request: Request, todo: list[str], first: float) -> None:
        self.request, self.todo, self.first = request, todo, first  # first: when the judging began
        self.said = tempfile.TemporaryFile()  # noqa: SIM115  (closed in __exit__)
        context: Any = multiprocessing.get_context("fork")
        self.ours, theirs = context.Pipe()
        self.process = context.Process(target=self._child, args=(theirs,), daemon=True)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # newer versions of Python warn of threads; the child uses none of theirs
            pulse.end()
            self.process.start()
        theirs.close()

    def _child(self, pipe: Any) -> None:
        os.setsid()  # what it starts is ended with it
        for stream in (1, 2):
            os.dup2(self.said.fileno(), stream)
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        faulthandler.disable()  # a crash is told by us
        try:
            for event in _work(self.request, list(self.todo)):
                pipe.send(event)
        except SymtopError as error:
            pipe.send(error)
        except BaseException as error:  # noqa: BLE001  (somebody else's code: what it raised is told)
            pipe.send(_Ended(words_of(error)))
        pipe.send(None)

    def events(self) -> Iterator[About | Found | _Ended]:
        """What the process tells, and at last why it ended if it did not end well."""
        limit, began = OPENING, time.monotonic()
        calls, since = pulse.look().calls, began
        while True:
            if self.ours.poll(LOOK):
                try:
                    event = self.ours.recv()
                except EOFError:
                    yield _Ended(self._death())
                    return
                if event is None:
                    return
                if isinstance(event, SymtopError):
                    raise event
                yield event
                if isinstance(event, _Ended):
                    return
                began = time.monotonic()
                limit = _limit(began - self.first, quick=self.request.quick)
                continue
            beat, now = pulse.look(), time.monotonic()
            if beat.calls != calls or not beat.inside:
                calls, since = beat.calls, now
            if now - since > beat.allowed:
                yield _Ended(f"a step of h = {beat.step:.3g} had not returned after {now - since:.0f} s", beat.step < 0)
                return
            if now - began > limit:
                yield _Ended(f"it was not judged within {limit:.0f} s")
                return

    def _death(self) -> str:
        self.process.join(2.0)
        code, beat = self.process.exitcode, pulse.look()
        if code is not None and code < 0:
            during = f" in a step of h = {beat.step:.3g}" if beat.inside else ""
            return f"its process was ended by {signal.Signals(-code).name}{during}"
        self.said.seek(0)
        words = " ".join(self.said.read()[-4 * WORDS :].decode(errors="replace").split())[-WORDS:]
        return f"its process ended with code {code}{': ' if words else ''}{words}"

    def __exit__(self, *_: object) -> None:
        if self.process.is_alive():
            with contextlib.suppress(OSError):
                os.killpg(self.process.pid, signal.SIGKILL)
            self.process.kill()
        self.process.join()
        self.ours.close()
        self.said.close()
