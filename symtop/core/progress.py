"""What a command says while it works: a clock on a terminal, and a line now and then where nobody watches.

Processes of their own write both, which end with this one: a compiler that holds Python's lock stops threads.
"""

import contextlib
import subprocess
import sys
import threading
from collections.abc import Iterator
from typing import Any

from symtop.core.files import is_terminal

BEAT = 1.0  # seconds from one drawing to the next
FIRST, EVERY = 2.0, 9.0  # seconds to the first line of a command in a pipe, and from one to the next
LINES = """\
import signal, sys, threading, time
signal.signal(signal.SIGINT, signal.SIG_IGN)
began, ended, words, wait = time.monotonic(), threading.Event(), [sys.argv[1]], float(sys.argv[2])
threading.Thread(target=lambda: (words.extend(map(str.strip, sys.stdin)), ended.set()), daemon=True).start()
while not ended.wait(wait):
    print(f"symtop: {words[-1]}, {time.monotonic() - began:.0f} s", file=sys.stderr, flush=True)
    wait = float(sys.argv[3])
"""
CLOCK = """\
import signal, sys, threading, time
signal.signal(signal.SIGINT, signal.SIG_IGN)  # who started it ends it
began, ended = time.monotonic(), threading.Event()
threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
while not ended.is_set():
    minutes, seconds = divmod(int(time.monotonic() - began), 60)
    print(f"\\r{sys.argv[1]}: {minutes:02d}:{seconds:02d}", end="", file=sys.stderr, flush=True)
    ended.wait(float(sys.argv[2]))
print("\\r\\x1b[K", end="", file=sys.stderr, flush=True)
"""


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
def telling(words: str) -> Iterator[None]:
    """Some words, or those of `ticking`, in lines on a standard error that is no terminal, from two seconds on."""
    if is_terminal(sys.stderr):
        yield
        return
    command = [sys.executable, "-I", "-S", "-c", LINES, words, str(FIRST), str(EVERY)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, text=True) as lines:  # noqa: S603  (our own words)
        _listeners.append(lines)
        try:
            yield
        finally:
            _listeners.remove(lines)
            lines.kill()  # it has nothing to finish; its start alone takes longer than most commands that are refused


_listeners: "list[subprocess.Popen[str]]" = []  # of the command that runs


@contextlib.contextmanager
def ticking(words: str) -> Iterator[None]:
    """Some words and the time since, on the standard error if that is a terminal, drawn each second until the end."""
    for lines in _listeners:
        with contextlib.suppress(OSError):  # somebody has ended it
            print(words, file=lines.stdin, flush=True)
    if not is_terminal(sys.stderr):
        yield
        return
    command = [sys.executable, "-I", "-S", "-c", CLOCK, words, str(BEAT)]
    with subprocess.Popen(command, stdin=subprocess.PIPE) as clock:  # noqa: S603  (our own words)
        try:
            yield
        finally:
            assert clock.stdin is not None  # noqa: S101
            clock.stdin.close()
            clock.wait()


def progress_bar(words: str, *, quiet: bool, **options: Any) -> Any:
    """A progress bar, or without a total the words alone, where somebody is watching."""
    from tqdm import tqdm

    options = options or {"total": 1, "bar_format": "{desc}"}
    return tqdm(desc=words, disable=quiet or not is_terminal(sys.stderr), leave=False, **options)
