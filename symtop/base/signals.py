"""A request to end (SIGTERM) heard as an exception, so that partial files, workers and checkpoints are seen to."""

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType

INTERRUPTED, TERMINATED = 130, 143  # exit codes: 128 and the number of the signal, as shells have it


class TerminatedError(SystemExit):
    """Somebody has asked this process to end; it does so with code 143 unless this is caught."""

    def __init__(self) -> None:
        super().__init__(TERMINATED)


def _end(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
    raise TerminatedError


@contextlib.contextmanager
def ending_on_sigterm() -> Iterator[None]:
    """Raise TerminatedError on SIGTERM, in the main thread; a handler that is there already is left in place."""
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGTERM) != signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, _end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
