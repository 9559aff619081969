"""Files that are written completely or not at all, the cache folder, and file locks.

The cache holds compiled kernels, references and checkpoints of long runs. Every use of an entry sets its time of
modification, at most once a day. Entries that nobody used for `UNUSED_DAYS` days are removed, and those used longest
ago until the folder is small enough. Several processes may do so at the same time.
"""

import contextlib
import errno
import functools
import glob
import os
import shutil
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

from symtop.core.errors import SymtopError, SymtopWarning, writing

DAY = 86_400.0  # seconds
UNUSED_DAYS = 30  # days


def cache_root() -> Path:
    """The folder for everything symtop caches: ``$SYMTOP_CACHE`` or ``symtop`` in the user's cache folder."""
    folder, caches = os.environ.get("SYMTOP_CACHE"), os.environ.get("XDG_CACHE_HOME")
    return Path(folder).expanduser() if folder else Path(caches or Path.home() / ".cache") / "symtop"


def make_private(folder: Path) -> None:
    """Make a folder and its missing parents, which only this user can access."""
    if not folder.is_dir():
        make_private(folder.parent)
        folder.mkdir(0o700, exist_ok=True)


def distrust(path: Path) -> tuple[str, str]:
    """Why others (not root) may have written a path, and a remedy; "" and "" if they cannot or it is not there."""
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
    """Can no other user have written this file or folder of compiled code? If one can, warn once and say why."""
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
    return sum(path.stat().st_size for path in (entry.rglob("*") if entry.is_dir() else [entry]) if path.is_file())


def prune(folder: Path, most_bytes: int) -> None:
    """Remove the entries of a folder that nobody used for `UNUSED_DAYS` days, and the oldest beyond `most_bytes`."""
    oldest, total = time.time() - UNUSED_DAYS * DAY, 0
    for entry in by_last_use(folder):
        with contextlib.suppress(OSError):
            total += size_of(entry)
            if total > most_bytes or entry.stat().st_mtime < oldest:
                shutil.rmtree(entry, ignore_errors=True) if entry.is_dir() else entry.unlink(missing_ok=True)


def by_last_use(folder: Path) -> list[Path]:
    """The entries of a folder, most recently used first, without partial files, whose names begin with a dot."""
    times = {}
    for entry in folder.glob("[!.]*"):
        with contextlib.suppress(OSError):
            times[entry] = entry.stat().st_mtime
    return sorted(times, key=lambda entry: -times[entry])


@contextlib.contextmanager
def replacing(path: str | os.PathLike[str], suffix: str = "", mode: int = 0o666) -> Iterator[Path]:
    """Yield a temporary file to write to; it replaces `path` in one move if the block succeeds, and not if it fails.

    The user's umask restricts `mode`. Of a symbolic link, the target is replaced. Raises SymtopError if the disk is
    full, the folder cannot be written to, or `path` is a folder, a device or a pipe.
    """
    if "\0" in str(path):
        raise SymtopError(f"a path must not hold a null character, as {str(path)!r} does")
    target = Path(os.path.realpath(path))
    partial = target.parent / f".{target.name}.{os.urandom(4).hex()}.part{suffix}"
    with writing(target), contextlib.ExitStack() as stack:
        if target.exists() and not target.is_file():
            raise SymtopError(f"cannot write {target}: it is a {'folder' if target.is_dir() else 'device or a pipe'}")
        target.parent.mkdir(parents=True, exist_ok=True)
        partial.touch(mode, exist_ok=False)
        stack.callback(partial.unlink, missing_ok=True)
        yield partial
        with partial.open("rb+") as file:  # Windows flushes no file that is open for reading only
            os.fsync(file.fileno())
        partial.replace(target)


def sweep(path: Path) -> None:
    """Remove what killed writers of `path` and of its parts left; call it only while no other process writes them."""
    leftovers = path.parent.glob(f".{glob.escape(path.name)}.*.part*")
    for partial in (*leftovers, *path.with_name(f"{path.name}.parts").glob(".*.????????.part*")):
        partial.unlink(missing_ok=True)


try:
    import fcntl
except ImportError:  # a system without these locks: two processes may compute the same and write the same file
    fcntl = None  # type: ignore[assignment]

NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)  # errors of file systems without locks, as on some clusters


def lock_path(path: Path) -> Path:
    """The lock file of `path`, which all files of that folder and stem share."""
    return path.with_name(f".{path.stem}.lock")


@contextlib.contextmanager
def locked(path: Path, *, wait: bool) -> Iterator[bool]:
    """Hold a file's lock, so that no other process computes it; yields False if one holds it and `wait` is false."""
    if fcntl is None:
        yield True
        return
    lock = lock_path(path)
    while True:
        with writing(lock):
            lock.parent.mkdir(parents=True, exist_ok=True)
            file = lock.open("a")
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
            os.utime(file.fileno())  # the time of the file says since when the lock is held
            try:
                yield True
            finally:
                lock.unlink(missing_ok=True)
            return


@contextlib.contextmanager
def only_writer(path: Path) -> Iterator[Path]:
    """Lock a file for writing and yield the folder of its parts; SymtopError if another process is writing it."""
    folder = path.with_name(f"{path.name}.parts")
    with locked(folder, wait=False) as acquired:
        if not acquired:
            raise SymtopError(f"another process is writing {path}: wait until it has ended, or name another path")
        yield folder
