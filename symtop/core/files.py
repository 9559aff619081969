"""Files: those that are whole or absent, the cache of what can be made again, and locks.

The cache holds compiled kernels, references and checkpoints of long runs. Every use of an entry sets its time of
modification, at most once a day. Entries that nobody used for `UNUSED` days are removed, and those used longest ago
until the folder is small enough. Another process may be doing the same.
"""

import contextlib
import errno
import functools
import glob
import os
import shutil
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TextIO

from symtop.core.errors import SymtopError, SymtopWarning

DAY = 86_400.0  # seconds
UNUSED = 30  # days

A_KERNEL, CLOSED_FORM = 3.0, 7  # seconds of a core to compile one; the closed form takes as long as so many
expected = [1]  # kernels that what runs now may have to compile


def is_terminal(stream: TextIO | None) -> bool:
    """Is somebody watching this stream of the process, which is None where it was closed?"""
    return stream is not None and stream.isatty()


def compiling() -> str:
    """What a command says before it compiles."""
    count = f"up to {expected[0]} kernels" if expected[0] > 1 else "a kernel"
    return f"compiling {count}, about {A_KERNEL * expected[0]:.0f} s on one core, once"


def _tell() -> None:
    """Say once, to somebody who is watching, that kernels are being compiled."""
    on_cold.remove(_tell)
    if "ipykernel" in sys.modules or is_terminal(sys.stderr):
        print(f"symtop: {compiling()}", file=sys.stderr, flush=True)  # noqa: T201  (no warning: nothing is wrong)


on_cold: list[Callable[[], object]] = [_tell]  # called when a kernel is not in the cache and has to be compiled


def cache_root() -> Path:
    """The folder for everything symtop caches: ``$SYMTOP_CACHE`` or ``symtop`` in the user's cache folder."""
    folder, caches = os.environ.get("SYMTOP_CACHE"), os.environ.get("XDG_CACHE_HOME")
    return Path(folder) if folder else Path(caches or Path.home() / ".cache") / "symtop"


def make_private(folder: Path) -> None:
    """Make a folder, and those above it that are missing, for nobody but this user."""
    if not folder.is_dir():
        make_private(folder.parent)
        folder.mkdir(0o700, exist_ok=True)


def distrust(path: Path) -> tuple[str, str]:
    """Why code from this file or folder may be somebody else's, and how to mend it; "" and "" if only we can write it.

    What the system's administrator owns is trusted, and so is what is not there.
    """
    try:
        status = path.stat()
    except OSError:
        return "", ""
    if hasattr(os, "geteuid") and status.st_uid not in (0, os.geteuid()):
        return f"{path} belongs to user {status.st_uid}", "set SYMTOP_CACHE to a folder of your own, or remove it"
    if hasattr(os, "geteuid") and status.st_mode & 0o022:
        return f"{path} can be written by others", f"remove it, or if you trust them: chmod -R go-w '{cache_root()}'"
    return "", ""


def is_trusted(path: Path) -> bool:
    """Can nobody else have written this file or folder of compiled code? A warning says why not, once."""
    why, remedy = distrust(path)
    if why:
        _warn(f"kernels are compiled in memory, because {why}; {remedy}")
    return not why


@functools.cache
def _warn(sentence: str) -> None:
    warnings.warn(sentence, SymtopWarning, stacklevel=3)


def touch(entry: Path) -> None:
    """Note that an entry is used now; nothing happens if it is not there or was used today."""
    with contextlib.suppress(OSError):
        if entry.stat().st_mtime < time.time() - DAY:
            os.utime(entry)


def size_of(entry: Path) -> int:
    """Bytes of a file, or of all files in a folder."""
    paths = entry.rglob("*") if entry.is_dir() else [entry]
    return sum(path.stat().st_size for path in paths if path.is_file())


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


@contextlib.contextmanager
def replacing(path: str | os.PathLike[str], suffix: str = "", mode: int = 0o666) -> Iterator[Path]:
    """A file to write to in place of `path`, which it replaces in one move if all goes well and not at all if not.

    The user's umask restricts `mode`, and of a link what it names is replaced. Raises SymtopError if the disk is full,
    the folder cannot be written to, or `path` is a folder.
    """
    if "\0" in str(path):
        raise SymtopError(f"a path must not hold a null character, as {str(path)!r} does")
    target = Path(os.path.realpath(path))
    partial = target.parent / f".{target.name}.{os.urandom(4).hex()}.part{suffix}"
    try:
        if target.is_dir():
            raise SymtopError(f"cannot write {target}: it is a folder")
        target.parent.mkdir(parents=True, exist_ok=True)
        partial.touch(mode, exist_ok=False)
        with contextlib.ExitStack() as stack:
            stack.callback(partial.unlink, missing_ok=True)
            yield partial
            with partial.open("rb+") as file:  # on Windows what is only read cannot be brought to the disk
                os.fsync(file.fileno())
            partial.replace(target)
    except OSError as error:
        raise SymtopError(f"cannot write {target}: {error.strerror or error}") from error


def sweep(path: Path) -> None:
    """Remove partial files of writers that were killed, its parts' too; call it only while nobody else writes it."""
    ours = path.parent.glob(f".{glob.escape(path.name)}.*.part*")
    for partial in (*ours, *path.with_name(f"{path.name}.parts").glob(".*.????????.part*")):
        partial.unlink(missing_ok=True)


try:
    import fcntl
except ImportError:  # no such locks here: two processes may then compute the same, and write the same file
    fcntl = None  # type: ignore[assignment]

NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)  # of file systems that have none, as some of clusters


def lock_path(path: Path) -> Path:
    """The lock of a file, and of every other one of its stem."""
    return path.with_name(f".{path.stem}.lock")


@contextlib.contextmanager
def locked(path: Path, *, wait: bool) -> Iterator[bool]:
    """Hold a file's lock, so that nobody else computes it; yields False if somebody else holds it and `wait` is false.

    The lock's file is there while it is held, and afterwards if its holder was killed.
    """
    if fcntl is None:
        yield True
        return
    lock = lock_path(path)
    while True:
        try:
            lock.parent.mkdir(parents=True, exist_ok=True)
            file = lock.open("a")
        except OSError as error:
            raise SymtopError(f"cannot write {lock}: {error.strerror or error}") from error
        with file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
            except BlockingIOError:
                yield False
                return
            except OSError as error:
                if error.errno not in NO_LOCKS:
                    raise
            if os.fstat(file.fileno()).st_nlink == 0:  # its holder removed it while we waited
                continue
            os.utime(file.fileno())  # since when it is held
            try:
                yield True
            finally:
                lock.unlink(missing_ok=True)
            return


@contextlib.contextmanager
def only_writer(path: Path) -> Iterator[Path]:
    """The folder of a file's parts, while nobody else writes that file; SymtopError if another process does."""
    folder = path.with_name(f"{path.name}.parts")
    with locked(folder, wait=False) as ours:
        if not ours:
            raise SymtopError(f"another process is writing {path}: wait until it has ended, or name another path")
        yield folder
