"""Commands on a terminal of 80 x 24: what they print, how long they take, and how long they are silent.

python tests/terminal.py            every command of the README that ends by itself, cold (nothing compiled), then warm
python tests/terminal.py recommend  those whose first word that is

A silence is the longest time between two characters, the start of the process and its end included.
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

README = Path(__file__).resolve().parents[1] / "README.md"
ENDLESS = {"explore", "judge", "long", "study"}  # ends with Ctrl-C, needs a file of one's own, or takes minutes


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


def recorded(words: list[str], limit: float = 300.0, **environment: str) -> Recording:
    """Run a command of symtop on a pseudo-terminal; killed after so many seconds."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    shape = {"COLUMNS": "80", "LINES": "24", "TERM": "xterm"}
    began = last = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, "-m", "symtop.cli", *words], stdin=theirs, stdout=theirs, stderr=theirs,
        env={**os.environ, **shape, **environment},
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
        now = time.monotonic()
        silence, last, said = max(silence, now - last), now, said + part
        drawings.append((now - began, part.decode(errors="replace")))
    os.close(ours)
    process.kill() if time.monotonic() - began >= limit else None
    code = process.wait()
    ended = time.monotonic()
    return Recording(said.decode(errors="replace"), code, ended - began, max(silence, ended - last), drawings)


def commands() -> list[list[str]]:
    """The commands of the README that end by themselves."""
    lines = [line for block in re.findall(r"```sh(?: slow)?\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
             for line in block.splitlines()]  # fmt: skip
    every = [shlex.split(line, comments=True) for line in lines if line.startswith("symtop ")]
    return [words[1:] for words in every if words[1] not in ENDLESS]


if __name__ == "__main__":
    chosen = [words for words in commands() if not sys.argv[1:] or words[0] in sys.argv[1:]]
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for words in chosen:
            for kind in ("cold", "warm"):
                if kind == "cold":
                    cache = tempfile.mkdtemp(dir=folder)
                shown = recorded(words, SYMTOP_CACHE=cache)
                told = f"{shown.seconds:.1f} s, silent {shown.silence:.1f} s at most, {shown.widest} columns"
                print(f"--- symtop {shlex.join(words)} ({kind}): exit {shown.code}, {told}")
                if kind == "warm":
                    print(re.sub(r"[^\n]*\r(?!\n)", "", shown.text).strip())
