"""Places where cases are computed: this process, spawned ones or a dask cluster, each a `concurrent.futures` executor.

Pools are opened when they are first needed and kept for the next study, since starting a worker costs two seconds. A
cluster's workers need this version of symtop, the scripts of the studies, and the results folder under the same path.
"""

import contextlib
import gc
import multiprocessing
import os
import warnings
from collections.abc import Callable
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from typing import Any

from symtop.base.validate import SymtopError
from symtop.runner import work

PATIENCE = 10  # seconds to wait for a scheduler's answer
HERE, CLUSTER = 0, -1  # in place of a number of processes


class InProcess(Executor):
    """Computes in this process while it is being submitted to."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> "Future[Any]":
        """A future that is done."""
        future: Future[Any] = Future()
        try:
            future.set_result(function(*args, **kwargs))
        except Exception as error:  # noqa: BLE001  (a future hands on what its function raised)
            future.set_exception(error)
        return future


class Workers(contextlib.AbstractContextManager["Workers"]):
    """Pools of processes by their size, and the cluster if there is one; `jobs` is how many untimed cases may take."""

    def __init__(self, jobs: int | None = None, scheduler: str | None = None) -> None:
        self.jobs = jobs or _cores()
        self.scheduler = scheduler
        self._client: Any = None
        self._pools: dict[int, Executor] = {HERE: InProcess()}
        if scheduler:
            self._connect(scheduler)

    def _connect(self, address: str) -> None:
        try:
            import distributed
        except ImportError:
            raise SymtopError("scheduler needs the package distributed: pip install 'symtop[distributed]'") from None
        failure = ""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # other versions there; the digest of every case is compared anyway
                self._client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
                self._client.wait_for_workers(1, timeout=PATIENCE)
        except (OSError, ValueError, RuntimeError) as error:
            failure = " ".join((str(error) or type(error).__name__).split())[:120]
        if failure:  # out of the handler, so that nothing holds on to what was half made
            self._leave()
            gc.collect()  # a client that never connected closes itself here, and not under a lock of the next one
            must = "the address of a dask scheduler that answers and has workers"
            raise SymtopError(f"scheduler must be {must}, not {address!r} ({failure})")
        self._pools[CLUSTER] = self._client.get_executor(pure=False)

    def pool(self, size: int) -> Executor:
        """The executor of so many processes, of HERE or of the CLUSTER."""
        if size not in self._pools:
            context = multiprocessing.get_context("spawn")
            self._pools[size] = ProcessPoolExecutor(size, context, work.begin_worker, (os.getpid(),))
        return self._pools[size]

    def open_size(self) -> int:
        """The size of the largest pool of processes that is open, or 0."""
        return max(self._pools, default=HERE)

    def width(self, size: int) -> int:
        """How many cases to hand over at a time: enough that nobody waits, few enough to stop soon."""
        if size == CLUSTER:
            return 4 * max(1, int(sum(self._client.ncores().values())))
        return 3 * size if size > 1 else 1

    def drop(self, size: int) -> None:
        """Forget a pool that is broken."""
        pool = self._pools.pop(size, None)
        if isinstance(pool, ProcessPoolExecutor):
            _kill(pool)

    def close(self) -> None:
        """End all processes at once, with what they are computing, for good; what was computed is on disk.

        Left to end by themselves, workers take two seconds to free what they have compiled.
        """
        for size in list(self._pools):
            self.drop(size)
        self._leave()

    def _leave(self) -> None:
        if self._client is not None:
            with contextlib.suppress(Exception):
                self._client.close(timeout=PATIENCE)
            self._client = None

    def __exit__(self, *_: object) -> None:
        self.close()


def _cores() -> int:
    """Cores this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1


def _kill(pool: ProcessPoolExecutor) -> None:
    processes = list((getattr(pool, "_processes", None) or {}).values())
    for process in processes:
        process.terminate()
    for process in processes:
        process.join(2.0)
        if process.is_alive():  # in compiled code, which hears no signal
            process.kill()
    pool.shutdown(wait=True, cancel_futures=True)
