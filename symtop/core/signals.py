"""Signals of the user, raised as exceptions of their own: to end (SIGTERM, SIGHUP), and to interrupt (SIGINT).

Own types tell a signal from what a plug-in raises. The exception may start between any two instructions, also between
taking a lock and entering the block that releases it. Around calls of a library that does so (xarray's lock of HDF5: of
twenty interrupted writes one left it locked, and the next waited for ever), signals are `deferred` to the call's end.
"""

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from typing import Any, TypeGuard

INTERRUPTED, TERMINATED, BROKEN_PIPE = 130, 143, 141  # exit codes: 128 and the number of the signal, as shells have it
HANGUP = getattr(signal, "SIGHUP", signal.SIGTERM)  # Windows has none


class TerminatedError(SystemExit):
    """SIGTERM or SIGHUP has reached this process, which ends with code 143 unless this is caught."""

    def __init__(self) -> None:
        super().__init__(TERMINATED)


class InterruptedByUser(KeyboardInterrupt):
    """The user has pressed Ctrl-C (SIGINT), within `told_apart`."""


def _end(*_: object) -> None:
    raise TerminatedError


def _interrupt(number: int, frame: Any) -> None:
    while frame is not None and "_object_cache_" not in frame.f_code.co_name:
        frame = frame.f_back
    if frame is None:
        raise InterruptedByUser
    threading.Timer(0.1, signal.raise_signal, [number]).start()  # what a callback of LLVM raises is printed and lost


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


@contextlib.contextmanager
def _handling(number: int, default: Any, handler: Callable[..., None]) -> Iterator[None]:
    """Handle a signal in the main thread; a handler that is there already, other than the usual one, stays."""
    replaces = _in_main_thread() and signal.getsignal(number) == default
    try:
        if replaces:
            signal.signal(number, handler)
        yield
    except SystemError as error:  # what a handler raises as numba converts the result of compiled code
        if is_of_user(error.__cause__):
            raise error.__cause__ from None
        raise
    finally:
        if replaces:
            signal.signal(number, default)


@contextlib.contextmanager
def ending_on_sigterm() -> Iterator[None]:
    """Raise TerminatedError on SIGTERM, and on SIGHUP, of a terminal that was closed; a handler of ``nohup`` stays."""
    with _handling(signal.SIGTERM, signal.SIG_DFL, _end), _handling(HANGUP, signal.SIG_DFL, _end):
        yield


def told_apart() -> contextlib.AbstractContextManager[None]:
    """Raise InterruptedByUser on SIGINT, in the main thread, to tell Ctrl-C from a plug-in's KeyboardInterrupt."""
    return _handling(signal.SIGINT, signal.default_int_handler, _interrupt)


@contextlib.contextmanager
def deferred() -> Iterator[None]:
    """Delay SIGINT, SIGTERM and SIGHUP, where handled, to the end of the block (milliseconds), in the main thread."""
    requests: list[int] = []
    numbers = {signal.SIGINT, signal.SIGTERM, HANGUP} if _in_main_thread() else ()
    handlers = {number: signal.getsignal(number) for number in numbers}
    usual = {number: handler for number, handler in handlers.items() if callable(handler)}
    try:
        for number in usual:
            signal.signal(number, lambda number, _frame: requests.append(number))
        yield
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)
        with contextlib.ExitStack() as stack:  # each is raised, whatever the one before raises
            for number in reversed(dict.fromkeys(requests)):
                stack.callback(signal.raise_signal, number)


@contextlib.contextmanager
def at_most(seconds: float | None, *, processor: bool = True) -> Iterator[None]:
    """Raise TimeoutError in Python code of the main thread after so much processor time, or wall-clock time.

    It is raised again each second, for code that catches everything. Compiled code is stopped only when it returns.
    There is no limit in other threads, on a system without such a timer, and for None.
    """
    if seconds is None or not _in_main_thread() or not hasattr(signal, "setitimer"):
        yield
        return

    def stop(*_: object) -> None:
        raise TimeoutError(f"it was not done after {seconds:g} s")

    number, timer = (signal.SIGVTALRM, signal.ITIMER_VIRTUAL) if processor else (signal.SIGALRM, signal.ITIMER_REAL)
    before = signal.signal(number, stop)
    outer = signal.setitimer(timer, seconds, 1.0)
    try:
        yield
    finally:
        left = signal.setitimer(timer, 0.0)[0]
        signal.signal(number, before)
        signal.setitimer(timer, max(outer[0] - (seconds - left), 1e-3) if outer[0] else 0.0, outer[1])  # an outer limit


def is_of_user(error: BaseException | None) -> TypeGuard[BaseException]:
    """Was it raised by a signal of the user? Outside of `told_apart` every KeyboardInterrupt counts as one."""
    if isinstance(error, KeyboardInterrupt):
        return isinstance(error, InterruptedByUser) or signal.getsignal(signal.SIGINT) is not _interrupt
    return isinstance(error, TerminatedError)
