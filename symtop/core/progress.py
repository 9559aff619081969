"""Progress of what takes long: a bar on a terminal, and words for whoever listens elsewhere."""

import contextlib
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any

from symtop.core.files import is_terminal

BEAT = 1.0  # seconds from one drawing to the next
listeners: list[Callable[[str], object]] = []  # of the command that runs


def post(words: str) -> None:
    """Say what is being done to those who listen, such as the lines of a command in a pipe."""
    for hear in listeners:
        hear(words)


@contextlib.contextmanager
def progress_bar(words: str, *, quiet: bool = False, **options: Any) -> Iterator[Any]:
    """A progress bar of tqdm, or without options the words and the time since, where somebody is watching.

    It is drawn again each second although nothing is finished, and closed at the end.
    """
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
