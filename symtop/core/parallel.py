"""Threads for functions that release Python's lock, and processes that each use one thread for linear algebra.

OpenBLAS spins while it waits: a least-squares fit takes a hundred times as long with two threads on two busy cores as
with one. It reads its variable when it is loaded, so that it is set while a process starts; a user's own setting stays.
"""

import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from itertools import islice
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any, ClassVar, TypeVar

Piece = TypeVar("Piece")
Result = TypeVar("Result")

MOST_THREADS = 1024
MOST_WAITING = 2  # pieces for each thread that are computed before their turn: results that wait take memory
VARIABLES = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")  # of NumPy's and SciPy's builds
_stop = threading.local()
_starting = threading.Lock()  # held while a process starts, as its environment is set meanwhile


class StoppedError(Exception):
    """The work that this thread is part of was interrupted."""


def cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def check_interrupt() -> None:
    """Raise `StoppedError` if the work was interrupted; for long pieces to call between their compiled calls."""
    if (stopped := getattr(_stop, "stopped", None)) is not None and stopped.is_set():
        raise StoppedError


def in_threads(work: Callable[[Piece], Result], pieces: Iterable[Piece], threads: int) -> Iterator[Result]:
    """The results of the pieces, in their order.

    An exception of one piece, or an interrupt while waiting, drops the pieces that have not begun and is raised at
    once; pieces that have begun end at their next `check_interrupt`. With one thread the work is done in the caller's.
    """
    if threads == 1:
        yield from map(work, pieces)
        return
    stopped = threading.Event()
    pool = ThreadPoolExecutor(threads, initializer=setattr, initargs=(_stop, "stopped", stopped))
    try:
        yield from in_order(pool, work, pieces, MOST_WAITING * threads)
    except BaseException:
        stopped.set()
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown()


def in_order(pool: Executor, work: Callable[[Piece], Result], pieces: Iterable[Piece], ahead: int) -> Iterator[Result]:
    """The results of the pieces that a pool computes, in their order; `ahead` of them are with the pool at a time."""
    remaining = iter(pieces)
    submitted: deque[Future[Result]] = deque(pool.submit(work, piece) for piece in islice(remaining, ahead))
    while submitted:
        yield submitted.popleft().result()
        submitted += [pool.submit(work, piece) for piece in islice(remaining, 1)]


class OneThread(SpawnProcess):
    """A process with one thread for linear algebra."""

    def start(self) -> None:
        """Start it; the environment of this process is afterwards what it was."""
        with _starting:
            unset = [name for name in VARIABLES if name not in os.environ]
            os.environ.update(dict.fromkeys(unset, "1"))
            try:
                super().start()
            finally:
                for name in unset:
                    del os.environ[name]


class OneThreadEach(SpawnContext):
    """The multiprocessing context with which pools start such processes."""

    Process: ClassVar[Any] = OneThread
