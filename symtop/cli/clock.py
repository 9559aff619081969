"""What a command says while it works: a clock on a terminal, and a line now and then where nobody watches.

Threads write both: neither numba nor heyoka holds Python's lock for half a second of a compilation.
"""

import contextlib
import sys
import threading
import time
from collections.abc import Iterator

from symtop.core.files import is_terminal
from symtop.core.progress import listeners, post, progress_bar

FIRST, EVERY = 2.0, 9.0  # seconds to the first line of a command in a pipe, and from one to the next


@contextlib.contextmanager
def telling(words: str) -> Iterator[None]:
    """Some words, or those last posted, in lines on a standard error that is no terminal, from two seconds on."""
    if sys.__stderr__ is None or is_terminal(sys.stderr):
        yield
        return
    posted, began, ended = [words], time.monotonic(), threading.Event()

    def tell() -> None:
        wait = FIRST
        with contextlib.suppress(OSError):  # its reader has left
            while not ended.wait(wait):
                seconds, wait = time.monotonic() - began, EVERY
                print(f"symtop: {posted[-1]}, {seconds:.0f} s", file=sys.__stderr__, flush=True)

    listeners.append(posted.append)
    threading.Thread(target=tell, daemon=True).start()
    try:
        yield
    finally:
        ended.set()
        listeners.remove(posted.append)


@contextlib.contextmanager
def ticking(words: str) -> Iterator[None]:
    """Some words and the time since, on the standard error if that is a terminal, drawn each second until the end."""
    post(words)
    with progress_bar(words) if is_terminal(sys.stderr) else contextlib.nullcontext():
        yield
