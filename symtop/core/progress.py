"""A clock on the terminal that goes on while one piece of work takes long, such as a compilation."""

import contextlib
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from symtop.core.files import is_terminal

BEAT = 1.0  # seconds from one look of the clock to the next
CLOCK = Path(__file__).with_name("clock.py")  # run as a script


@contextlib.contextmanager
def beating(bar: Any) -> Iterator[Any]:
    """A progress bar, drawn again each second although nothing is finished; it is closed at the end."""
    ended = threading.Event()

    def beat() -> None:
        while not ended.wait(BEAT):
            bar.refresh()

    thread = threading.Thread(target=beat, daemon=True)
    with bar:
        if not bar.disable:
            thread.start()
        try:
            yield bar
        finally:
            ended.set()
            if thread.is_alive():
                thread.join()


@contextlib.contextmanager
def ticking(words: str) -> Iterator[None]:
    """Some words and the time since, on the standard error if that is a terminal, drawn each second until the end.

    A process of its own draws them: a compiler that holds Python's lock, as heyoka's does for seconds, stops threads.
    """
    if not is_terminal(sys.stderr):
        yield
        return
    command = [sys.executable, "-I", "-S", str(CLOCK), words, str(BEAT)]
    with subprocess.Popen(command, stdin=subprocess.PIPE) as clock:  # noqa: S603  (our own words)
        try:
            yield
        finally:
            assert clock.stdin is not None  # noqa: S101
            clock.stdin.close()  # which ends it, as the end of this process would
            clock.wait()
