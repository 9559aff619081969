"""Some words and the time since, written again and again until the standard input ends: ``clock.py WORDS BEAT``.

`symtop.core.progress.ticking` starts it as a process of its own, by its file and without the package, so that it needs
Python's own modules alone. It does not hear an interrupt: who started it ends it.
"""

import signal
import sys
import threading
import time


def tell(text: str) -> None:
    """Write over the present line of the terminal."""
    sys.stderr.write(f"\r{text}")
    sys.stderr.flush()


def main(words: str, beat: float) -> None:
    """Draw the clock every `beat` seconds, and clear its line at the end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    began, ended = time.monotonic(), threading.Event()

    def wait_for_the_end() -> None:
        sys.stdin.read()
        ended.set()

    threading.Thread(target=wait_for_the_end, daemon=True).start()
    while not ended.is_set():
        minutes, seconds = divmod(int(time.monotonic() - began), 60)
        tell(f"{words}: {minutes:02d}:{seconds:02d}")
        ended.wait(beat)
    tell("\x1b[K")


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
