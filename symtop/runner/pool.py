"""Worker processes for cases and figures, and the order in which cases are handed to them.

The pool is Pebble's: it ends a case that takes longer than its limit, in compiled code as well, and a worker that dies
fails its own case and no other. Workers are started when they are first needed, and stay for the next study, because a
start takes two seconds. Few cases, and those of integrators that only this process knows, are computed in this process.
A dask cluster may take the place of the workers for cases that are not timed; its own workers need this version of
symtop, the scripts of the studies, and the results folder under the same path.
"""

import contextlib
import gc
import math
import os
import signal
import statistics
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from functools import partial
from pathlib import Path
from typing import Any

from pebble import ProcessExpired, ProcessPool
from tqdm import tqdm

from symtop.core import cluster, parallel
from symtop.core.errors import SymtopError
from symtop.measure.timing import bare_run
from symtop.methods.framework.registry import integrator, integrators, split_name
from symtop.model.scenes import scene
from symtop.runner import plugins, scripts
from symtop.runner.execute_case import GRACE, Neighbours, Result, Task, execute_case, failed, take_trace
from symtop.runner.study import Study

WORTH_WORKERS = 8  # cases; starting a worker takes two seconds
MOST_FRUITLESS = 3  # times that all workers may end without having computed anything
AHEAD = 3  # cases with the pool for each worker: enough that nobody waits, few enough to stop soon
BUSY = 0.05  # seconds until a case that another command computes is looked for again
ENDED = "its process was ended, by the system (memory) or by the method itself"

OnResult = Callable[[Task, Result], None]


class Pool(contextlib.AbstractContextManager["Pool"]):
    """Worker processes, as many as `jobs`, and the cluster at the address `scheduler` if there is one."""

    def __init__(self, jobs: int | None = None, scheduler: str | None = None) -> None:
        self.jobs = jobs or parallel.cores()
        self.client: Any = cluster.connect(scheduler) if scheduler else None
        self.size = 0  # workers that are open
        self._workers: ProcessPool | None = None
        self._analyses: list[Future[Any]] = []
        self._trials: dict[int, Neighbours] = {}

    def open(self, size: int) -> None:
        """Have at least so many workers."""
        if self._workers is None or size > self.size:
            self.close_workers(wait_for=self._analyses)
            self.size = min(size, self.jobs)
            self._workers = ProcessPool(
                self.size, initializer=begin_worker, initargs=(os.getpid(),), context=parallel.context()
            )

    def submit(self, function: Callable[..., Any], *args: Any, limit: float | None = None) -> "Future[Any]":
        """Call a function in a worker; after `limit` seconds the worker is ended, and the result is TimeoutError."""
        assert self._workers is not None  # noqa: S101
        future: Future[Any] = self._workers.schedule(function, args=args, timeout=limit)
        return future

    def analyse(self, function: Callable[..., Any], *args: Any) -> "Future[Any]":
        """Call a function in a worker beside the cases of the next study; timed ones wait until it is done."""
        self.open(self.jobs)
        self._analyses = [other for other in self._analyses if not other.done()]
        self._analyses.append(self.submit(function, *args))
        return self._analyses[-1]

    def run(self, study: Study, tasks: Sequence[Task], on_result: OnResult) -> None:
        """Compute all tasks and call `on_result` with each as it ends, in any order; timed ones last.

        Timed cases run one at a time, or one on each core where a trial shows that they do not disturb each other.
        Raises SymtopError if the results cannot be written or the workers cannot work.
        """
        for timed in (False, True):
            chosen = in_order([task for task in tasks if study.is_timed(task.case) == timed])
            if not chosen:
                continue
            if timed:
                wait(self._analyses)
            local = any(plugins.is_local(name) for task in chosen for name in task.case.names)
            if self.client is not None and not timed and not local:
                executor = self.client.get_executor(pure=False)
                _drain(chosen, partial(executor.submit, execute_case), cluster.width(self.client), on_result)
            elif local or (len(chosen) < WORTH_WORKERS and not self.size):
                alone = [task._replace(neighbours=Neighbours() if timed else None) for task in chosen]
                _drain(alone, lambda task: _done(execute_case, task, study), 1, on_result)
            else:
                self._in_workers(chosen, on_result, timed=timed)

    def _in_workers(self, tasks: list[Task], on_result: OnResult, *, timed: bool) -> None:
        """Compute tasks in workers; one whose worker dies is computed once more, with nobody beside it."""
        left, died = {task.path: task for task in tasks}, dict[Path, Task]()
        fruitless = 0

        def settle(task: Task, result: Result) -> None:
            nonlocal fruitless
            fruitless = 0
            del left[task.path]
            if result.state != "died":
                on_result(task, result)
            elif alone:
                on_result(task, failed(task, ENDED))
            else:
                died[task.path] = task

        for alone in (False, True):
            while left:
                self.open(min(self.jobs, len(left)))
                neighbours = self.neighbours(min(self.size, len(left))) if timed else None
                width = 1 if alone else AHEAD * self.size if neighbours is None else neighbours.at_once
                batch = [task._replace(neighbours=neighbours) for task in left.values()]
                try:
                    _drain(batch, self._submit_case, width, settle)
                except BrokenExecutor:
                    self.close_workers()
                    fruitless += 1
                    if fruitless == MOST_FRUITLESS:
                        raise SymtopError(
                            "the worker processes end before they begin; try --jobs 1 or look at the free memory"
                        ) from None
            left.update(died)

    def _submit_case(self, task: Task) -> "Future[Result]":
        return self.submit(execute_case, task, limit=task.limit + GRACE)

    def neighbours(self, width: int) -> Neighbours:
        """How many timed cases may run at once: one for each worker if a trial shows no disturbance, or half, ..."""
        known = Neighbours()
        while width > 1:
            if width not in self._trials:
                self._trials[width] = Neighbours(width, slowdown(self.submit, width))
            if self._trials[width].slowdown <= DISTURBED:
                return self._trials[width]
            known = Neighbours(1, self._trials[width].slowdown)
            width //= 2
        return known

    def close_workers(self, wait_for: Sequence["Future[Any]"] = ()) -> None:
        """End all workers at once, with what they are computing; what was computed is on disk."""
        wait(wait_for)
        if self._workers is not None:
            self._workers.stop()
            self._workers.join()
        self._workers, self.size = None, 0

    def close(self) -> None:
        """End all workers and leave the cluster."""
        self.close_workers()
        cluster.leave(self.client)
        self.client = None

    def __exit__(self, *_: object) -> None:
        self.close()


def begin_worker(parent: int) -> None:
    """Initialise a worker: SIGTERM ends it in compiled code as well, and it exits when the parent process has ended."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    gc.set_threshold(50_000, 10, 10)  # at 700, looking for garbage takes 4 % of a quick run
    scripts.install()  # settings of a case may hold records of a study's own
    tqdm.set_lock(threading.RLock())  # its own would be a semaphore of the system, left behind when a worker is ended

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def in_order(tasks: Sequence[Task]) -> list[Task]:
    """The first case of every family of methods, then the second, ...: methods of a family share kernels to compile."""
    known, count = integrators(), Counter[str]()
    ranks = []
    for task in tasks:
        method = known.get(split_name(task.case.integrator)[0])
        family = task.case.integrator if method is None else method.family
        ranks.append(count[family])
        count[family] += 1
    return [tasks[k] for k in sorted(range(len(tasks)), key=ranks.__getitem__)]


def _done(function: Callable[..., Any], *args: Any) -> "Future[Any]":
    """What a call in this process returned, as the future of one elsewhere."""
    future: Future[Any] = Future()
    try:
        future.set_result(function(*args))
    except Exception as error:  # noqa: BLE001  (a future hands on what its function raised)
        future.set_exception(error)
    return future


def _drain(tasks: Sequence[Task], submit: Callable[[Task], "Future[Result]"], width: int, settle: OnResult) -> None:
    """Hand over all tasks, so many at a time; one that another command computes is looked for until that has ended."""
    ahead, futures = deque(tasks), dict[Future[Result], Task]()
    while ahead or futures:
        while ahead and len(futures) < width:
            task = ahead.popleft()
            futures[submit(task)] = task
        for future in wait(futures, return_when=FIRST_COMPLETED).done:
            task = futures.pop(future)
            result = _result(future, task)
            if result.state == "busy":
                ahead.append(task)
                time.sleep(BUSY)
            else:
                settle(task, result)


def _result(future: "Future[Result]", task: Task) -> Result:
    """The result of a case; one that took too long, whose process ended or that the cluster gave up has failed."""
    try:
        return future.result()
    except (SymtopError, BrokenExecutor):
        raise
    except TimeoutError:
        return failed(task, f"it was not done after {task.limit:g} s and did not answer", take_trace(task))
    except ProcessExpired:
        return Result("died")
    except CancelledError:
        raise SymtopError("the cluster has gone away; what was computed is kept") from None
    except Exception as error:
        if type(error).__module__.partition(".")[0] != "distributed":
            raise
        return failed(task, f"the cluster gave it up: {type(error).__name__}: {error}")


METHOD, CHART, SCENE, STEPS, STEP = "strang", "axis", "spheroid", 4000, 1e-3  # a short run of a compiled method
SPAN = 0.03  # seconds of a worker in one turn
TURNS = 7
TRIES = 20  # to have all workers at once, the first time when they have to start
DISTURBED = 1.05  # times as long as alone: beyond it timed cases run one after another


def timed_turn() -> tuple[int, float, float, float]:
    """Process, begin, end and mean seconds of runs for `SPAN` seconds, on the clock that all processes share."""
    run = bare_run(scene(SCENE), integrator(METHOD), CHART, STEP, STEPS * STEP)
    run()  # its kernel may have to be compiled
    begin, count = time.monotonic(), 0
    while (end := time.monotonic()) < begin + SPAN:
        run()
        count += 1
    return os.getpid(), begin, end, (end - begin) / count


def slowdown(submit: Callable[..., "Future[Any]"], size: int) -> float:
    """How many times longer a run takes while `size` workers run; infinite if they never did at once.

    Workers time the same run, one of them alone and all at once, in turns. Beside others it takes as long as alone
    where cores share nothing that a run needs, and up to twice as long where two of them are threads of one core.
    """

    def at_once() -> list[tuple[int, float, float, float]]:
        return [future.result() for future in [submit(timed_turn) for _ in range(size)]]

    for _ in range(TRIES):
        if len({process for process, *_ in at_once()}) == size:
            break
    ratios = []
    for _ in range(TURNS):
        alone, together = submit(timed_turn).result(), at_once()
        if min(end for _, _, end, _ in together) - max(begin for _, begin, _, _ in together) > 0.5 * SPAN:
            ratios.append(max(seconds for *_, seconds in together) / alone[-1])
    return statistics.median(ratios) if ratios else math.inf
