"""Locks of files between processes: the operating system's own, which end with their holder, however that ends."""

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path

from symtop.base.validate import SymtopError

try:
    import fcntl
except ImportError:  # no such locks here: two processes may then compute the same, and write the same file
    fcntl = None  # type: ignore[assignment]

NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)  # of file systems that have none, as some of clusters


def lock_path(path: Path) -> Path:
    """The lock of a file, and of every other one of its stem."""
    return path.with_name(f".{path.stem}.lock")


def _taken(file: int, *, wait: bool) -> bool:
    """Take the lock; False if somebody else holds it."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise
    return True


@contextlib.contextmanager
def locked(path: Path, *, wait: bool) -> Iterator[bool]:
    """Hold a file's lock, so that nobody else computes it; yields False if somebody else holds it and `wait` is false.

    The lock's file is there while it is held, and afterwards if its holder was killed (see `was_begun`).
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
            if not _taken(file.fileno(), wait=wait):
                yield False
                return
            if os.fstat(file.fileno()).st_nlink == 0:  # its holder removed it while we waited
                continue
            os.utime(file.fileno())  # since when it is held
            try:
                yield True
            finally:
                lock.unlink(missing_ok=True)
            return


def was_begun(path: Path) -> bool:
    """Did somebody begin to compute a case, and end before it was done?"""
    if fcntl is None or not lock_path(path).is_file():
        return False
    with locked(path, wait=False) as ours:
        return ours
