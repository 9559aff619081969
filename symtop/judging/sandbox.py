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
from pathlib import Path
from typing import Any, NamedTuple

from symtop.core.errors import SymtopError, words_of
from symtop.judging.adapters.adapter import heartbeat
from symtop.judging.battery import Stage, measure, stages, unmeasured
from symtop.judging.claims.subject import Request
from symtop.judging.findings import About, Finding

THREADED = "jax"  # hangs in a process that was forked after its import
LOOK = 0.05  # seconds between two looks
OPENING = 60.0  # seconds for loading a file and its imports
# seconds for the claims of one stage: at most, for all stages together, and at least however many were spent
VERDICT, QUICK_VERDICT = (45.0, 120.0, 15.0), (12.0, 40.0, 6.0)
WORDS = 160  # characters of what a process says before it ends


class Results(NamedTuple):
    """The findings of one stage, and what a figure shows of all stages so far."""

    findings: list[Finding]
    traces: dict[str, Any]


class _LostError(Exception):
    """A process was ended, or ended by itself: why, and whether it was in a step of -h."""


def run(request: Request) -> Iterator[About | Results]:
    """First what is judged, then findings as they are made; SymtopError if it cannot be opened."""
    todo = stages("step")
    if "fork" not in multiprocessing.get_all_start_methods() or THREADED in sys.modules:
        yield from _work(request, todo)
        return
    heartbeat.reset(quick=request.quick)
    opened, began = False, time.monotonic()
    while todo:
        try:
            for event in _isolated(request, todo, began):
                if isinstance(event, Results):
                    todo.pop(0)
                if isinstance(event, Results) or not opened:
                    yield event
                opened = True
        except _LostError as failure:
            if not opened:
                raise SymtopError(f"it cannot be judged: {failure.args[0]}") from None
            yield from _left_open(request, todo, *failure.args)
        else:
            return


def _left_open(request: Request, todo: list[Stage], why: str, backwards: bool) -> Iterator[Results]:
    """What a failure leaves undecided: one stage; all without a call; none if it was a step of -h, then refused."""
    if backwards and not heartbeat.forward_only:
        heartbeat.forward_only = True
        return
    for stage in todo[:] if todo[0][0].name == "calls" else todo[:1]:
        todo.remove(stage)
        yield Results(unmeasured(stage, request.claimed(), why), {})


def _work(request: Request, todo: list[Stage]) -> Iterator[About | Results]:
    """The stages, in this process."""
    subject = request.open()
    stepper = subject.stepper
    yield About(stepper.name, stepper.chart, stepper.implementation, subject.seconds_a_step)
    for stage in todo:
        yield Results(measure(stage, subject), subject.traces)


def _isolated(request: Request, todo: list[Stage], first: float) -> Iterator[About | Results]:
    """The stages in a forked process; `first` is when the judging began."""
    context: Any = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe()
    with tempfile.TemporaryFile() as output, ours:
        process = context.Process(target=_child, args=(request, list(todo), theirs, output), daemon=True)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # newer versions of Python warn of threads; the child uses none of theirs
            heartbeat.inside = False
            process.start()
        theirs.close()
        try:
            yield from _events(process, ours, output, first, quick=request.quick)
        finally:
            if process.is_alive():
                with contextlib.suppress(OSError):
                    os.killpg(process.pid, signal.SIGKILL)
                process.kill()
            process.join()


def _child(request: Request, todo: list[Stage], pipe: Any, output: Any) -> None:
    os.setsid()  # what it starts is ended with it
    for stream in (1, 2):
        os.dup2(output.fileno(), stream)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    faulthandler.disable()  # a crash is reported by the one that waits
    try:
        for event in _work(request, todo):
            pipe.send(event)
    except BaseException as error:  # noqa: BLE001  (somebody else's code)
        pipe.send(error if isinstance(error, SymtopError) else _LostError(words_of(error), False))
    pipe.send(None)


def _events(process: Any, pipe: Any, output: Any, first: float, *, quick: bool) -> Iterator[About | Results]:
    """What the process sends; _LostError if it ends otherwise, hangs in a call or takes too long for a stage."""
    limit, began = OPENING, _clock(process.pid)
    calls, since = heartbeat.calls, began
    while True:
        if pipe.poll(LOOK):
            try:
                event = pipe.recv()
            except EOFError:
                event = _LostError(_death(process, output), False)
            if isinstance(event, Exception):
                raise event
            if event is None:
                return
            yield event
            began = _clock(process.pid)
            most, together, least = QUICK_VERDICT if quick else VERDICT
            limit = max(least, min(most, together - (began - first)))
            continue
        now = _clock(process.pid)
        if heartbeat.calls != calls or not heartbeat.inside:
            calls, since = heartbeat.calls, now
        if now - since > heartbeat.allowed:
            why = f"a step of h = {heartbeat.step:.3g} had not returned after {now - since:.0f} s"
            raise _LostError(why, heartbeat.step < 0)
        if now - began > limit:
            raise _LostError(f"it was not judged within {limit:.0f} s", False)


def _clock(pid: int) -> float:
    """Seconds, less those that a process has waited for a processor: limits are those of a machine that is idle.

    Linux counts the waiting; elsewhere, and while a process waits for a program of its own, all time counts.
    """
    try:
        waited = int(Path(f"/proc/{pid}/schedstat").read_text(encoding="ascii").split()[1]) * 1e-9
    except (OSError, IndexError, ValueError):
        waited = 0.0
    return time.monotonic() - waited


def _death(process: Any, output: Any) -> str:
    process.join(2.0)
    code = process.exitcode
    if code is not None and code < 0:
        during = f" in a step of h = {heartbeat.step:.3g}" if heartbeat.inside else ""
        return f"its process was ended by {signal.Signals(-code).name}{during}"
    output.seek(0)
    words = " ".join(output.read()[-4 * WORDS :].decode(errors="replace").split())[-WORDS:]
    return f"its process ended with code {code}{': ' if words else ''}{words}"
