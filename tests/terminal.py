"""Commands on a terminal of 80 x 24 or in a pipe: what they print, how long they take, and how long they are silent.

A silence is the longest time between two characters, the start of the process and its end included.

    python tests/terminal.py        every command of the README in a pipe, with an empty cache: none is silent for 10 s
"""

import fcntl
import os
import pty
import re
import select
import shlex
import struct
import subprocess
import sys
import tempfile
import termios
import time
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from pages import ROOT, blocks


class Recording(NamedTuple):
    """What a command printed on both streams, and when."""

    text: str
    code: int
    seconds: float
    silence: float  # seconds
    drawings: list[tuple[float, str]]  # seconds since the start, and what was printed then

    def longest_wait(self, pattern: str) -> float:
        """Seconds between two drawings of what matches, so that the start of the process does not count."""
        times = [when for when, text in self.drawings if re.search(pattern, text)]
        return max(after - before for before, after in pairwise(times))

    @property
    def widest(self) -> int:
        """Columns of the longest line; a progress bar is a line each time it is drawn again."""
        plain = re.sub(r"\x1b\[[0-9;]*[A-Za-z]", "", self.text)
        return max(len(line) for line in re.split(r"[\r\n]+", plain))


def recorded(words: list[str], limit: float = 300.0, *, piped: bool = False, **environment: str) -> Recording:
    """Run a command of symtop on a pseudo-terminal, or with both streams in a pipe; killed after so many seconds."""
    ours, theirs = os.pipe() if piped else pty.openpty()
    if not piped:
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    shape = {"COLUMNS": "80", "LINES": "24", "TERM": "xterm"}
    began = last = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, "-m", "symtop.cli", *words], stdin=subprocess.DEVNULL if piped else theirs, stdout=theirs,
        stderr=theirs, env={**os.environ, **shape, **environment},
    )  # fmt: skip
    os.close(theirs)
    said, silence, drawings = b"", 0.0, []
    while time.monotonic() - began < limit:
        if not select.select([ours], [], [], 0.05)[0]:
            if process.poll() is not None:
                break
            continue
        try:
            part = os.read(ours, 65536)
        except OSError:  # the other end was closed
            break
        if not part:  # that of a pipe
            break
        now = time.monotonic()
        silence, last, said = max(silence, now - last), now, said + part
        drawings.append((now - began, part.decode(errors="replace")))
    os.close(ours)
    process.kill() if time.monotonic() - began >= limit else None
    code = process.wait()
    ended = time.monotonic()
    return Recording(said.decode(errors="replace"), code, ended - began, max(silence, ended - last), drawings)


MOST = 10.0  # seconds of silence in a pipe


def main() -> int:
    """Follow the README in a folder of its own; 1 if a command fails or is silent for longer than `MOST`."""
    bad = 0
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        environment = {"SYMTOP_CACHE": str(Path(folder) / "cache"), "PYTHONPATH": str(ROOT)}
        for block in blocks((ROOT / "README.md").read_text(encoding="utf-8")):
            if block.file:
                Path(block.file).write_text(block.code, encoding="utf-8")
            for line in block.code.splitlines() if block.language == "sh" else []:
                done = recorded(shlex.split(line, comments=True)[1:], 1800.0, piped=True, **environment)
                wrong = done.code != 0 or done.silence > MOST
                bad += wrong
                print(
                    f"{done.silence:5.1f} s silent of {done.seconds:5.1f} s, exit code {done.code}: {line}", flush=True
                )
                if wrong:
                    print(done.text)
    return min(bad, 1)


if __name__ == "__main__":
    sys.exit(main())
