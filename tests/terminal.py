"""Commands on a terminal of 80 x 24: what they print, and the longest time between characters, ends included."""

import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
import time
from typing import NamedTuple


class Recording(NamedTuple):
    """What a command printed on both streams, and its longest silence."""

    text: str
    code: int
    silence: float  # seconds

    @property
    def widest(self) -> int:
        """Columns of the longest line; a progress bar is a line each time it is drawn again."""
        text = re.sub(r"\x1b\[[0-9;]*[A-Za-z]", "", self.text)
        return max(len(line) for line in re.split(r"[\r\n]+", text))


def record(words: list[str], limit: float = 300.0, code: str | None = None, **environment: str) -> Recording:
    """Run a command of symtop, or Python code, on a pseudo-terminal; it is killed after so many seconds."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    shape = {"COLUMNS": "80", "LINES": "24", "TERM": "xterm"}
    start_time = last = time.monotonic()
    start = ["-m", "symtop.cli"] if code is None else ["-c", code]
    process = subprocess.Popen([sys.executable, *start, *words], stdin=theirs, stdout=theirs, stderr=theirs,
                               env={**os.environ, **shape, **environment})  # fmt: skip
    os.close(theirs)
    output, silence = b"", 0.0
    while time.monotonic() - start_time < limit:
        if not select.select([ours], [], [], 0.05)[0]:
            if process.poll() is not None:
                break
            continue
        try:
            part = os.read(ours, 65536)
        except OSError:  # the other end was closed
            break
        now = time.monotonic()
        silence, last, output = max(silence, now - last), now, output + part
    os.close(ours)
    process.kill() if time.monotonic() - start_time >= limit else None
    return Recording(output.decode(errors="replace"), process.wait(), max(silence, time.monotonic() - last))
