"""Progress of what takes long: a bar or a clock on a terminal, and a line now and then where nobody watches.

Threads write both: neither numba nor heyoka holds Python's lock for half a second of a compilation.
"""

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

from symtop.core.files import is_terminal

BEAT = 1.0  # seconds from one drawing to the next, although nothing is finished
FIRST, EVERY = 2.0, 9.0  # seconds to the first line of a command in a pipe, and from one to the next
listeners: list[Callable[[str], object]] = []  # of the command that runs


def post(words: str) -> None:
    """Say what is being done to those who listen, such as the lines of a command in a pipe."""
    for hear in listeners:
        hear(words)


@contextlib.contextmanager
def progress_bar(words: str, *, quiet: bool = False, **options: Any) -> Iterator[Any]:
    """A progress bar of tqdm, or without options the words and the time since, where somebody is watching."""
    from tqdm import tqdm

    options = options or {"total": 1, "bar_format": "{desc}: {elapsed}"}
    ended = threading.Event()

    def beat() -> None:
        while not ended.wait(BEAT):
            bar.refresh()

    thread = threading.Thread(target=beat, daemon=True)
    with tqdm(desc=words, disable=quiet or not is_terminal(sys.stderr), leave=False, **options) as bar:
        if not bar.disable:
            thread.start()
        try:
            yield bar
        finally:
            ended.set()
            if thread.is_alive():
                thread.join()


def ticking(words: str) -> contextlib.AbstractContextManager[Any]:
    """Some words and the time since, posted, and drawn each second on a terminal until the end."""
    post(words)
    return progress_bar(words) if is_terminal(sys.stderr) else contextlib.nullcontext()  # without importing tqdm


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
