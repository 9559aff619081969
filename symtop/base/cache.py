"""The folder of what can be made again: compiled kernels, references, checkpoints of long runs.

Every use of an entry sets its time of modification, at most once a day. An entry that nobody used for `UNUSED` days is
removed, and then the entries used longest ago until the folder is small enough. Another process may be doing the same.
"""

import contextlib
import functools
import os
import shutil
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TextIO

DAY = 86_400.0  # seconds
UNUSED = 30  # days

COMPILING = "compiling what runs for the first time; the next time it is found on disk"


def is_terminal(stream: TextIO | None) -> bool:
    """Is somebody watching this stream of the process, which is None where it was closed?"""
    return stream is not None and stream.isatty()


def _tell() -> None:
    """Say once, to somebody who is watching, that kernels are being compiled, which takes one second to twenty."""
    on_cold.remove(_tell)
    if "ipykernel" in sys.modules or is_terminal(sys.stderr):
        print(f"symtop: {COMPILING}", file=sys.stderr, flush=True)  # noqa: T201  (no warning: nothing is wrong)


on_cold: list[Callable[[], object]] = [_tell]  # called when a kernel is not in the cache and has to be compiled


def cache_root() -> Path:
    """The folder for everything symtop caches: ``$SYMTOP_CACHE`` or ``symtop`` in the user's cache folder."""
    told = os.environ
    return _root(*(told.get(name) for name in ("SYMTOP_CACHE", "XDG_CACHE_HOME", "HOME", "USERPROFILE")))


@functools.lru_cache(maxsize=16)
def _root(chosen: str | None, caches: str | None, *_homes: str | None) -> Path:
    """The folder in these surroundings, which `Path.home` reads as well: 60 us, and each new start asks four times."""
    return Path(chosen) if chosen else Path(caches or Path.home() / ".cache") / "symtop"


def touch(entry: Path) -> None:
    """Note that an entry is used now; nothing happens if it is not there or was used today."""
    with contextlib.suppress(OSError):
        if entry.stat().st_mtime < time.time() - DAY:
            os.utime(entry)


def size_of(entry: Path) -> int:
    """Bytes of a file, or of all files in a folder."""
    if not entry.is_dir():
        return entry.stat().st_size
    return sum(path.stat().st_size for path in entry.rglob("*") if path.is_file())


def prune(folder: Path, most_bytes: int) -> None:
    """Remove the entries of a folder that nobody used for `UNUSED` days, and the oldest beyond `most_bytes`."""
    oldest, total = time.time() - UNUSED * DAY, 0
    for entry in by_last_use(folder):
        with contextlib.suppress(OSError):
            total += size_of(entry)
            if total > most_bytes or entry.stat().st_mtime < oldest:
                shutil.rmtree(entry, ignore_errors=True) if entry.is_dir() else entry.unlink(missing_ok=True)


def by_last_use(folder: Path) -> list[Path]:
    """The entries of a folder, the one used last first; partial files, whose names begin with a dot, are none."""
    times = {}
    for entry in folder.glob("[!.]*"):
        with contextlib.suppress(OSError):
            times[entry] = entry.stat().st_mtime
    return sorted(times, key=lambda entry: -times[entry])
