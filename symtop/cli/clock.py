"""What a command says while it works: a clock on a terminal, and a line now and then where nobody watches.

A thread writes both: neither numba nor heyoka holds Python's lock for half a second of a compilation.
"""

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterator

from symtop.core.files import is_terminal
from symtop.core.progress import BEAT, listeners, post

FIRST, EVERY = 2.0, 9.0  # seconds to the first line of a command in a pipe, and from one to the next


@contextlib.contextmanager
def _writing(text: Callable[[float], str], last: str, wait: float, every: float) -> Iterator[None]:
    """Write a text of the seconds since, after `wait` of them and then again and again, and `last` at the end."""
    began, ended = time.monotonic(), threading.Event()

    def write() -> None:
        pause = wait
        with contextlib.suppress(OSError):  # its reader has left
            while not ended.wait(pause):
                print(text(time.monotonic() - began), end="", file=sys.__stderr__, flush=True)
                pause = every
            print(last, end="", file=sys.__stderr__, flush=True)

    writer = threading.Thread(target=write, daemon=True)
    writer.start()
    try:
        yield
    finally:
        ended.set()
        writer.join(BEAT)  # no longer, should its reader not read


@contextlib.contextmanager
def telling(words: str) -> Iterator[None]:
    """Some words, or those last posted, in lines on a standard error that is no terminal, from two seconds on."""
    if sys.__stderr__ is None or is_terminal(sys.stderr):
        yield
        return
    posted = [words]
    listeners.append(posted.append)
    try:
        with _writing(lambda seconds: f"symtop: {posted[-1]}, {seconds:.0f} s\n", "", FIRST, EVERY):
            yield
    finally:
        listeners.remove(posted.append)


@contextlib.contextmanager
def ticking(words: str) -> Iterator[None]:
    """Some words and the time since, on the standard error if that is a terminal, drawn each second until the end."""
    post(words)

    def clock(seconds: float) -> str:
        return f"\r{words}: {int(seconds) // 60:02d}:{int(seconds) % 60:02d}"

    with _writing(clock, "\r\x1b[K", 0.0, BEAT) if is_terminal(sys.stderr) else contextlib.nullcontext():
        yield
