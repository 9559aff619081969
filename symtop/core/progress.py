"""Progress of long work: a bar or the elapsed time on a terminal, a line now and then in a pipe, and what compiles.

Threads write bar and lines, also during compilations: neither numba nor heyoka holds Python's lock for half a second.
"""

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, TextIO

REDRAW_SECONDS = 1.0  # seconds between drawings of a bar, even if no part of the work has finished
FIRST_LINE, NEXT_LINE = 2.0, 9.0  # seconds to the first line of a command in a pipe, and from one to the next
listeners: list[Callable[[str], object]] = []  # functions that `post` calls
A_KERNEL, CLOSED_FORM = 3.0, 7  # seconds to compile a kernel on one core; the closed form takes this many times as long
kernels_to_compile = [1]  # how many kernels the running command may have to compile


def is_terminal(stream: TextIO | None) -> bool:
    """Is this stream a terminal? A standard stream of the process that was closed is None."""
    return stream is not None and stream.isatty()


def compiling() -> str:
    """The message before a compilation: how many kernels there are to compile, and how long that may take."""
    count = f"up to {kernels_to_compile[0]} kernels" if kernels_to_compile[0] > 1 else "a kernel"
    return f"compiling {count}, about {A_KERNEL * kernels_to_compile[0]:.0f} s on one core, once"


def _print_once() -> None:
    """Print once, on a terminal or in a notebook, that kernels are being compiled."""
    on_cold.remove(_print_once)
    if "ipykernel" in sys.modules or is_terminal(sys.stderr):
        print(f"symtop: {compiling()}", file=sys.stderr, flush=True)  # noqa: T201  (no warning: nothing is wrong)


on_cold: list[Callable[[], object]] = [_print_once]  # called when a kernel is not in the cache and has to be compiled


def post(words: str) -> None:
    """Pass a description of the present work to all `listeners`, such as the one of `showing_work`."""
    for hear in listeners:
        hear(words)


@contextlib.contextmanager
def progress_bar(words: str, *, quiet: bool = False, **options: Any) -> Iterator[Any]:
    """A progress bar of tqdm on a terminal; without options it shows `words` and the elapsed time."""
    from tqdm import tqdm

    options = options or {"total": 1, "bar_format": "{desc}: {elapsed}"}
    stop = threading.Event()

    def beat() -> None:
        while not stop.wait(REDRAW_SECONDS):
            bar.refresh()

    thread = threading.Thread(target=beat, daemon=True)
    with tqdm(desc=words, disable=quiet or not is_terminal(sys.stderr), leave=False, **options) as bar:
        if not bar.disable:
            thread.start()
        try:
            yield bar
        finally:
            stop.set()
            if thread.is_alive():
                thread.join()


def showing_seconds(words: str) -> contextlib.AbstractContextManager[Any]:
    """Post `words`, and show them with the elapsed time on a terminal, each second until the block ends."""
    post(words)
    return progress_bar(words) if is_terminal(sys.stderr) else contextlib.nullcontext()  # without importing tqdm


@contextlib.contextmanager
def showing_work(words: str) -> Iterator[None]:
    """Print `words`, or those last posted, now and then to a standard error that is no terminal, after two seconds."""
    if sys.__stderr__ is None or is_terminal(sys.stderr):
        yield
        return
    posted, began, stop = [words], time.monotonic(), threading.Event()

    def tell() -> None:
        wait = FIRST_LINE
        with contextlib.suppress(OSError):  # the reader of the pipe has ended
            while not stop.wait(wait):
                seconds, wait = time.monotonic() - began, NEXT_LINE
                print(f"symtop: {posted[-1]}, {seconds:.0f} s", file=sys.__stderr__, flush=True)

    listeners.append(posted.append)
    threading.Thread(target=tell, daemon=True).start()
    try:
        yield
    finally:
        stop.set()
        listeners.remove(posted.append)
