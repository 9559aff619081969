"""Places where cases are computed: this process, spawned ones or a dask cluster, each a `concurrent.futures` executor.

Pools are opened when they are first needed and kept for the next study, since starting a worker costs two seconds. A
cluster's workers need this version of symtop, the scripts of the studies, and the results folder under the same path.
"""

import contextlib
import os
from collections.abc import Callable
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from typing import Any

from symtop.core import cluster, parallel
from symtop.core.parallel import cores
from symtop.model.exact import closed_form
from symtop.runner import trial, work
from symtop.runner.sideline import Beside, Sideline
from symtop.runner.work import ALONE, Company

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
    """Pools of processes by their size, and the cluster if there is one; `jobs` is how many cases may take."""

    def __init__(self, jobs: int | None = None, scheduler: str | None = None) -> None:
        self.jobs = jobs or cores()
        self.scheduler = scheduler
        self._client: Any = None
        self._slowdown: dict[int, float] = {}
        self._sideline = Sideline(lambda: self._spawned(1), self._idle)
        self._pools: dict[int, Executor] = {HERE: InProcess()}
        if scheduler:
            self._client = cluster.connect(scheduler)
            self._pools[CLUSTER] = cluster.Watched(self._client)

    def pool(self, size: int) -> Executor:
        """The executor of so many processes, of HERE or of the CLUSTER."""
        if size not in self._pools:
            self._pools[size] = self._spawned(size)
        return self._pools[size]

    @staticmethod
    def _spawned(size: int) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(size, parallel.context(), work.begin_worker, (os.getpid(),))

    def _idle(self) -> Executor:
        """Workers that have nothing to compute: those that are open, if there are several."""
        size = self.open_size()
        return self.pool(size if size > 1 else self.jobs)

    def open_size(self) -> int:
        """The size of the largest pool of processes that is open, or 0."""
        return max(self._pools, default=HERE)

    def beside(self, function: Callable[..., Any], *args: Any) -> Beside:
        """Call a function in one more process, beside untimed cases, or in a worker that has nothing to compute."""
        return self._sideline.promise(function, *args)

    def open_beside(self) -> None:
        """Start the process of `beside`, which compiles the closed form: every worker would, in 12 s, and interpret it.

        Whoever needs it meanwhile interprets it, and loads it as soon as it is on disk (`symtop.core.lazy_kernel`).
        """
        self._sideline.open(closed_form.compile_now)

    def fill(self) -> None:
        """Let promised calls begin, one after another: cases are computed that are not timed."""
        self._sideline.go_on()

    def quieten(self) -> None:
        """Wait for the call that works beside the others; what has not begun does not begin."""
        self._sideline.pause()

    def finish(self) -> None:
        """Begin all that is promised at once: no more cases are computed."""
        self._sideline.finish()

    def width(self, size: int) -> int:
        """How many cases to hand over at a time: enough that nobody waits, few enough to stop soon."""
        if size == CLUSTER:
            return cluster.width(self._client)
        return 3 * size if size > 1 else 1

    def side_by_side(self, size: int, cases: int) -> Company:
        """How many timed cases to hand over at a time: as many as a trial shows not to disturb each other.

        One for each worker, or half as many, and so on.
        """
        company = ALONE
        width = min(size, cases)
        while width > 1:
            if width not in self._slowdown:
                self._slowdown[width] = trial.slowdown(self.pool(size), width)
            company = Company(1, self._slowdown[width])
            if company.slowdown <= trial.DISTURBED:
                return company._replace(at_once=width)
            width //= 2
        return company

    def drop(self, size: int) -> None:
        """Forget a pool that is broken."""
        pool = self._pools.pop(size, None)
        if isinstance(pool, ProcessPoolExecutor):
            _kill(pool)
        elif pool is not None:
            pool.shutdown()

    def close(self) -> None:
        """End all processes at once, with what they are computing, for good; what was computed is on disk.

        Left to end by themselves, workers take two seconds to free what they have compiled.
        """
        for size in list(self._pools):
            self.drop(size)
        own = self._sideline.close()
        if own is not None:
            _kill(own)
        self._leave()

    def _leave(self) -> None:
        cluster.leave(self._client)
        self._client = None

    def __exit__(self, *_: object) -> None:
        self.close()


def _kill(pool: ProcessPoolExecutor) -> None:
    parallel = list((getattr(pool, "_processes", None) or {}).values())
    for process in parallel:
        process.terminate()
    for process in parallel:
        process.join(2.0)
        if process.is_alive():  # in compiled code, which hears no signal
            process.kill()
    pool.shutdown(wait=True, cancel_futures=True)
