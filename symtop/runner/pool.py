"""Compute the cases of a study in this process, in worker processes, or on a dask cluster.

Worker processes are Pebble's: a time limit also ends compiled code, and if a worker dies, only its own case fails. They
are kept for the next study. Few cases, and those of integrators registered in this process only, are computed here. On
a dask cluster, for untimed cases, workers need this version of symtop, the studies, and results at the same path.

If a case fails, the failure is recorded and the others go on; an error of the machine (a full disk) is raised.
"""

import contextlib
import faulthandler
import gc
import math
import os
import signal
import threading
import time
import traceback
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from functools import partial
from multiprocessing import parent_process, resource_tracker
from pathlib import Path
from typing import Any, NamedTuple

import xarray as xr
from pebble import ProcessExpired, ProcessPool
from tqdm import tqdm

from symtop.core import files, netcdf, parallel
from symtop.core.errors import SymtopError, words_of
from symtop.core.signals import HANGUP, at_most, is_of_user
from symtop.measure.timing import DISTURBED_RATIO, slowdown
from symtop.methods.framework.registry import integrators, split_name
from symtop.run import cluster, plugins
from symtop.runner import fingerprint, scripts, store
from symtop.runner.study import Case, Study

WORTH_WORKERS = 8  # least cases for which workers are started, which takes two seconds each
MOST_FRUITLESS = 3  # times in a row that the pool may break without a result
CASES_AHEAD = 3  # cases submitted per worker: enough to keep all busy, few enough to stop soon
BUSY_SECONDS = 0.05  # seconds between two checks of a case that another command computes
GRACE = 5.0  # seconds between asking a case to end and ending its process
ENDED = "its process was ended, by the system (memory) or by the method itself"

_loading = threading.Lock()


class Task(NamedTuple):
    """A case to compute, with everything that a worker process needs for it."""

    study: str  # its script
    case: Case
    path: Path  # of the result; absolute, because a worker may have another working directory
    plugins: tuple[str, ...]
    limit: float  # seconds
    fresh: bool = False  # compute it even if a result is stored
    timed: tuple[int, float] | None = None  # of timed cases: how many run at once, and the slowdown by that


class Result(NamedTuple):
    """How a task ended: computed, found (already stored), failed, died (its process), or busy (in another command)."""

    state: str
    message: str = ""


OnResult = Callable[[Task, Result], None]


def prepare(script: str, files_of_plugins: tuple[str, ...]) -> Study:
    """Load plug-ins, and then the study of a script."""
    with _loading:  # otherwise two threads might execute a file twice
        for file in files_of_plugins:
            plugins.load(file)
        return scripts.load(script)


def execute_case(task: Task, study: Study | None = None) -> Result:
    """Compute a case and store the result, or record the failure; SymtopError if the machine is the cause."""
    study = study or prepare(task.study, task.plugins)
    path, case = task.path, task.case
    if fingerprint.digest(study, case) != store.digest_of(path):
        words = f"the sources or dependencies of {case.integrator} on {case.scene}"
        remedy = "if a file was edited meanwhile, run the study again"
        raise SymtopError(f"{words} are not those that the study was started with; {remedy}")
    with files.locked(path, wait=False) as acquired:
        if not acquired:
            return Result("busy")
        if not task.fresh and store.load_case(path) is not None:
            return Result("found")
        files.sweep(path)  # remove partial files of a killed worker
        try:
            with at_most(task.limit, processor=False), _traced(task):  # does not end compiled code: see `GRACE`
                data = study.measure(case)
            if not isinstance(data, xr.Dataset):
                raise SymtopError(f"the measure of a study must return a Dataset, not {type(data).__name__}")  # noqa: TRY301
        except BaseException as error:  # (a failing case must not stop the others)
            if is_of_user(error):
                raise
            return failed(task, error if isinstance(error, SymtopError) else words_of(error), traceback.format_exc())
        if task.timed is not None:
            data = data.assign_attrs(timed_at_once=task.timed[0], timed_slowdown=task.timed[1])
        store.save_case(data, path, study, case)
        return Result("computed")


@contextlib.contextmanager
def _traced(task: Task) -> Iterator[None]:
    """Write a traceback to a file before the process is killed by the time limit; in the main thread only."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    trace = store.trace_path(task.path)
    with contextlib.ExitStack() as stack:
        stack.callback(trace.unlink, missing_ok=True)
        file = stack.enter_context(trace.open("w"))
        stack.callback(faulthandler.cancel_dump_traceback_later)
        faulthandler.dump_traceback_later(task.limit + 0.5 * GRACE, file=file)
        yield


def failed(task: Task, why: object, trace: str = "") -> Result:
    """Record the failure of a case, and remove a result of an earlier run."""
    message = f"{task.case.integrator} on {task.case.scene} failed: {' '.join(str(why).split())}"
    question = {"scene": task.case.scene, "integrator": task.case.integrator, "settings": dict(task.case.settings)}
    record = question | {"message": message, "traceback": trace.splitlines()}
    netcdf.write_json(store.failure_path(task.path), record)
    task.path.unlink(missing_ok=True)
    return Result("failed", message)


class Pool(contextlib.AbstractContextManager["Pool"]):
    """At most `jobs` worker processes (by default one per core), and the dask cluster at `scheduler`, if given."""

    def __init__(self, jobs: int | None = None, scheduler: str | None = None) -> None:
        self.jobs = jobs or parallel.cores()
        self.client: Any = cluster.connect(scheduler) if scheduler else None
        self.size = 0  # number of workers
        self._workers: ProcessPool | None = None
        self._analyses: list[Future[Any]] = []
        self._trials: dict[int, float] = {}  # slowdown of a run by the number that run at once

    def open(self, size: int) -> None:
        """Make sure that there are at least `size` workers, up to `jobs`."""
        if self._workers is None or size > self.size:
            wait(self._analyses)
            self.close_workers()
            self.size = min(size, self.jobs)
            if hasattr(os, "fork") and threading.current_thread() is threading.main_thread():
                # start the resource tracker, except on Windows, so that it ignores SIGHUP, as it does SIGTERM
                before = signal.signal(HANGUP, signal.SIG_IGN)
                resource_tracker.ensure_running()
                signal.signal(HANGUP, before)
            self._workers = ProcessPool(self.size, initializer=begin_worker, context=parallel.OneThreadEach())

    def submit(self, function: Callable[..., Any], *args: Any, limit: float | None = None) -> Future[Any]:
        """Call a function in a worker; after `limit` seconds the worker is killed, and the future has TimeoutError."""
        assert self._workers is not None  # noqa: S101
        return self._workers.schedule(function, args=args, timeout=limit)

    def analyse(self, function: Callable[..., Any], *args: Any) -> Future[Any]:
        """Call a function in a worker while cases of the next study run; timed cases wait until it is done."""
        self.open(self.jobs)
        self._analyses = [future for future in self._analyses if not future.done()]
        self._analyses.append(self.submit(function, *args))
        return self._analyses[-1]

    def run(self, study: Study, tasks: Sequence[Task], on_result: OnResult) -> None:
        """Compute all tasks, timed ones last, and call `on_result` with each as it ends."""
        for timed in (False, True):
            batch = in_order([task for task in tasks if study.is_timed(task.case) == timed])
            if batch and timed:
                wait(self._analyses)
            local = any(plugins.is_local(name) for task in batch for name in (task.case.scene, *task.case.integrators))
            if self.client is not None and not timed and not local:
                submit = partial(self.client.get_executor(pure=False).submit, execute_case)
                _drain(batch, submit, cluster.width(self.client), on_result)
            elif local or (len(batch) < WORTH_WORKERS and not self.size):

                def inline(task: Task) -> Future[Result]:
                    (future := Future[Result]()).set_result(execute_case(task, study))
                    return future

                _drain([task._replace(timed=(1, math.nan) if timed else None) for task in batch], inline, 1, on_result)
            else:
                self._in_workers(batch, on_result, timed=timed)

    def _in_workers(self, tasks: list[Task], on_result: OnResult, *, timed: bool) -> None:
        """Compute tasks in workers; a case whose worker dies is retried once, with no other case running."""
        remaining, retries = {task.path: task for task in tasks}, dict[Path, Task]()
        fruitless = 0

        def settle(task: Task, result: Result) -> None:
            nonlocal fruitless
            fruitless = 0
            del remaining[task.path]
            if result.state == "died" and not last_round:
                retries[task.path] = task
            else:
                on_result(task, failed(task, ENDED) if result.state == "died" else result)

        for last_round in (False, True):
            while remaining:
                self.open(min(self.jobs, len(remaining)))
                concurrency = self.at_once(min(self.size, len(remaining))) if timed else None
                width = 1 if last_round else CASES_AHEAD * self.size if concurrency is None else concurrency[0]
                try:
                    queue = [task._replace(timed=concurrency) for task in remaining.values()]
                    _drain(queue, lambda task: self.submit(execute_case, task, limit=task.limit + GRACE), width, settle)
                except BrokenExecutor:
                    self.close_workers()
                    fruitless += 1
                    if fruitless == MOST_FRUITLESS:
                        words = "the worker processes end before they begin; try --jobs 1 or look at the free memory"
                        raise SymtopError(words) from None
            remaining.update(retries)

    def at_once(self, width: int) -> tuple[int, float]:
        """Timed cases that run at once, and the slowdown: `width`, halved until a trial is within `DISTURBED_RATIO`."""
        ratio = math.nan  # without a trial
        while width > 1:
            if width not in self._trials:
                self._trials[width] = slowdown(self.submit, width)
            ratio = self._trials[width]
            if ratio <= DISTURBED_RATIO:
                break
            width //= 2
        return width, ratio

    def close_workers(self) -> None:
        """End all workers at once; results that are complete are on disk."""
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


def begin_worker() -> None:
    """Initialise a worker: SIGTERM also ends compiled code, and the worker exits when its parent process has ended."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    gc.set_threshold(50_000, 10, 10)  # with the default of 700, garbage collection takes 4 % of a quick run
    scripts.install()  # to unpickle records that settings of a case may hold
    tqdm.set_lock(threading.RLock())  # the default is a system semaphore, which would leak if a worker is killed

    def watch() -> None:
        if (parent := parent_process()) is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def in_order(tasks: Sequence[Task]) -> list[Task]:
    """Order tasks: the first case of every family of methods, then the second, ...; a family shares kernels."""
    methods, count = integrators(), Counter[str]()

    def rank(task: Task) -> int:
        method = methods.get(split_name(task.case.integrator)[0])
        family = task.case.integrator if method is None else method.family
        count[family] += 1
        return count[family]

    return sorted(tasks, key=rank)


def _drain(tasks: Sequence[Task], submit: Callable[[Task], Future[Result]], width: int, settle: OnResult) -> None:
    """Submit all tasks, `width` at a time, and settle each; one that is busy in another command is submitted again."""
    queue, futures = deque(tasks), dict[Future[Result], Task]()
    while queue or futures:
        while queue and len(futures) < width:
            task = queue.popleft()
            futures[submit(task)] = task
        for future in wait(futures, return_when=FIRST_COMPLETED).done:
            task = futures.pop(future)
            result = _result(future, task)
            if result.state == "busy":
                queue.append(task)
                time.sleep(BUSY_SECONDS)
            else:
                settle(task, result)


def _result(future: Future[Result], task: Task) -> Result:
    """The result of a future: failed after a timeout or an error of the cluster, died if the process ended."""
    try:
        return future.result()
    except (SymtopError, BrokenExecutor):
        raise
    except TimeoutError:
        trace = store.trace_path(task.path)
        text = trace.read_text(encoding="utf-8") if trace.is_file() else ""
        trace.unlink(missing_ok=True)
        return failed(task, f"it was not done after {task.limit:g} s and did not answer", text)
    except ProcessExpired:
        return Result("died")
    except CancelledError:
        raise SymtopError("the cluster has gone away; what was computed is kept") from None
    except Exception as error:
        if type(error).__module__.partition(".")[0] != "distributed":
            raise
        return failed(task, f"the cluster gave it up: {type(error).__name__}: {error}")
