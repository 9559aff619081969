"""A clock on the terminal that goes on while one piece of work takes long, such as a compilation."""

import contextlib
import threading
from collections.abc import Iterator
from typing import Any

from tqdm import tqdm

BEAT = 1.0  # seconds from one look of the clock to the next


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
def ticking(words: str) -> Iterator[Any]:
    """Some words and the time since, on the standard error if that is a terminal, drawn each second until the end."""
    with beating(tqdm(desc=words, bar_format="{desc}: {elapsed}", disable=None, leave=False)) as bar:
        yield bar
