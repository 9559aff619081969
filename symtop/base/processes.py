"""Processes that each use one thread for linear algebra.

A process a core and a thread a core in each of them make as many threads as cores squared. Those of OpenBLAS spin while
they wait for work: a least-squares fit of 4096 by 81 takes 7.5 ms of processor with one thread, and 0.6 s with two on
two cores that are at work. The library reads the variable when it is loaded, so that it is set while a process starts.
Whoever has set it is obeyed.
"""

import multiprocessing
import os
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any, ClassVar

VARIABLES = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")  # of NumPy's and SciPy's builds


class OneThread(SpawnProcess):
    """A process with one thread for linear algebra."""

    def start(self) -> None:
        """Start it; the environment of this process is afterwards what it was."""
        added = [name for name in VARIABLES if name not in os.environ]
        os.environ.update(dict.fromkeys(added, "1"))
        try:
            super().start()
        finally:
            for name in added:
                del os.environ[name]


class _Context(SpawnContext):
    Process: ClassVar[Any] = OneThread


def context() -> multiprocessing.context.SpawnContext:
    """What `concurrent.futures.ProcessPoolExecutor` starts such processes with."""
    return _Context()
