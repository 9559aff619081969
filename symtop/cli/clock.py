"""What a command says while it works: a clock on a terminal, and a line now and then where nobody watches.

Processes of their own write both, which end with this one: a compiler that holds Python's lock stops threads.
"""

import contextlib
import subprocess
import sys
from collections.abc import Iterator

from symtop.core.files import is_terminal
from symtop.core.progress import BEAT, listeners, post

FIRST, EVERY = 2.0, 9.0  # seconds to the first line of a command in a pipe, and from one to the next
LINES = "symtop: {words}, {seconds:.0f} s\n", ""  # what is written, and what at the end
CLOCK = "\r{words}: {minutes:02d}:{rest:02d}", "\r\x1b[K"
WRITER = """\
import signal, sys, threading, time
signal.signal(signal.SIGINT, signal.SIG_IGN)  # who started it ends it
began, ended, (words, shape, last), wait = time.monotonic(), threading.Event(), sys.argv[1:4], float(sys.argv[4])
words = [words]
threading.Thread(target=lambda: (words.extend(map(str.strip, sys.stdin)), ended.set()), daemon=True).start()
while not ended.wait(wait):
    seconds = time.monotonic() - began
    values = {"words": words[-1], "seconds": seconds, "minutes": int(seconds) // 60, "rest": int(seconds) % 60}
    print(shape.format(**values), end="", file=sys.stderr, flush=True)
    wait = float(sys.argv[5])
print(last, end="", file=sys.stderr, flush=True)
"""


@contextlib.contextmanager
def _writing(form: tuple[str, str], words: str, first: float, every: float) -> "Iterator[subprocess.Popen[str]]":
    """A process that writes some words, or the last line that it was given, and the time since, until the end."""
    command = [sys.executable, "-I", "-S", "-c", WRITER, words, *form, str(first), str(every)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, text=True) as writer:  # noqa: S603  (our own words)
        yield writer


@contextlib.contextmanager
def telling(words: str) -> Iterator[None]:
    """Some words, or those last posted, in lines on a standard error that is no terminal, from two seconds on."""
    if is_terminal(sys.stderr):
        yield
        return
    with _writing(LINES, words, FIRST, EVERY) as lines:

        def hear(words: str) -> None:
            with contextlib.suppress(OSError):  # somebody has ended it
                print(words, file=lines.stdin, flush=True)

        listeners.append(hear)
        try:
            yield
        finally:
            listeners.remove(hear)
            lines.kill()  # it has nothing to finish; its start alone takes longer than most commands that are refused


@contextlib.contextmanager
def ticking(words: str) -> Iterator[None]:
    """Some words and the time since, on the standard error if that is a terminal, drawn each second until the end."""
    post(words)
    with _writing(CLOCK, words, 0.0, BEAT) if is_terminal(sys.stderr) else contextlib.nullcontext():
        yield
