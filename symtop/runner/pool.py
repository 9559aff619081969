"""Computes cases: in this process, in worker processes, or on a dask cluster, and in which order.

The workers are Pebble's: a limit ends compiled code, too, and a worker that dies fails its own case alone. They stay
for the next study. Few cases, and those of integrators that only this process knows, are computed here. On a dask
cluster, for untimed cases, workers need this version of symtop, the studies, and the results folder at the same path.

A failure that a case causes is recorded and the others go on; one of the machine's (a full disk) is raised.
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
from symtop.measure.timing import DISTURBED, slowdown
from symtop.methods.framework.registry import integrators, split_name
from symtop.run import cluster, plugins
from symtop.runner import fingerprint, scripts, store
from symtop.runner.study import Case, Study

WORTH_WORKERS = 8  # cases; starting a worker takes two seconds
MOST_FRUITLESS = 3  # times that all workers may end without having computed anything
AHEAD = 3  # cases with the pool for each worker: enough that nobody waits, few enough to stop soon
BUSY = 0.05  # seconds until a case that another command computes is looked for again
GRACE = 5.0  # seconds between asking a case to end and ending its process
ENDED = "its process was ended, by the system (memory) or by the method itself"

_loading = threading.Lock()


class Task(NamedTuple):
    """A case to compute, and everything that another process must know for it."""

    study: str  # its script
    case: Case
    path: Path  # absolute: a worker has a folder of its own
    plugins: tuple[str, ...]
    limit: float  # seconds
    fresh: bool = False
    timed: tuple[int, float] | None = None  # how many ran at once, and how many times longer a run took than alone


class Result(NamedTuple):
    """How a task ended: computed, found, failed, died (its process), or busy (another command is computing it)."""

    state: str
    message: str = ""


OnResult = Callable[[Task, Result], None]


def prepare(script: str, files_of_plugins: tuple[str, ...]) -> Study:
    """The study of a script, with the plug-ins that its cases may need."""
    with _loading:  # a file that two threads load at once would be executed twice
        for file in files_of_plugins:
            plugins.load(file)
        return scripts.load(script)


def execute_case(task: Task, study: Study | None = None) -> Result:
    """Compute a case and store it, or record how it failed; SymtopError where the machine is the cause."""
    study = study or prepare(task.study, task.plugins)
    path, case = task.path, task.case
    if fingerprint.digest(study, case) != store.digest_of(path):
        of = f"the sources or dependencies of {case.integrator} on {case.scene}"
        remedy = "if a file was edited meanwhile, run the study again"
        raise SymtopError(f"{of} are not those that the study was started with; {remedy}")
    with files.locked(path, wait=False) as ours:
        if not ours:
            return Result("busy")
        if not task.fresh and store.load_case(path) is not None:
            return Result("found")
        files.sweep(path)  # of a worker that was killed
        try:
            with at_most(task.limit, processor=False), _traced(task):  # compiled code hears no limit: see `GRACE`
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
    """Leave a traceback in a file before the process is ended that takes too long; a thread is in no such process."""
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
    """Record how a case failed; a file that an earlier run may have left is no longer its result."""
    message = f"{task.case.integrator} on {task.case.scene} failed: {' '.join(str(why).split())}"
    question = {"scene": task.case.scene, "integrator": task.case.integrator, "settings": dict(task.case.settings)}
    record = question | {"message": message, "traceback": trace.splitlines()}
    netcdf.write_json(store.failure_path(task.path), record)
    task.path.unlink(missing_ok=True)
    return Result("failed", message)


class Pool(contextlib.AbstractContextManager["Pool"]):
    """Worker processes, as many as `jobs`, and the cluster at the address `scheduler` if there is one."""

    def __init__(self, jobs: int | None = None, scheduler: str | None = None) -> None:
        self.jobs = jobs or parallel.cores()
        self.client: Any = cluster.connect(scheduler) if scheduler else None
        self.size = 0  # workers that are open
        self._workers: ProcessPool | None = None
        self._analyses: list[Future[Any]] = []
        self._trials: dict[int, float] = {}  # by how many ran at once: how many times longer a run took

    def open(self, size: int) -> None:
        """Have at least so many workers."""
        if self._workers is None or size > self.size:
            wait(self._analyses)
            self.close_workers()
            self.size = min(size, self.jobs)
            if hasattr(os, "fork") and threading.current_thread() is threading.main_thread():
                # the process that counts semaphores, but on Windows, is deaf to SIGHUP; to SIGTERM Python makes it so
                before = signal.signal(HANGUP, signal.SIG_IGN)
                resource_tracker.ensure_running()
                signal.signal(HANGUP, before)
            self._workers = ProcessPool(self.size, initializer=begin_worker, context=parallel.OneThreadEach())

    def submit(self, function: Callable[..., Any], *args: Any, limit: float | None = None) -> "Future[Any]":
        """Call a function in a worker; after `limit` seconds the worker is ended, and the result is TimeoutError."""
        assert self._workers is not None  # noqa: S101
        return self._workers.schedule(function, args=args, timeout=limit)

    def analyse(self, function: Callable[..., Any], *args: Any) -> "Future[Any]":
        """Call a function in a worker beside the cases of the next study; timed ones wait until it is done."""
        self.open(self.jobs)
        self._analyses = [other for other in self._analyses if not other.done()]
        self._analyses.append(self.submit(function, *args))
        return self._analyses[-1]

    def run(self, study: Study, tasks: Sequence[Task], on_result: OnResult) -> None:
        """Compute all tasks, timed ones last, and call `on_result` with each as it ends."""
        for timed in (False, True):
            part = in_order([task for task in tasks if study.is_timed(task.case) == timed])
            if part and timed:
                wait(self._analyses)
            local = any(plugins.is_local(name) for task in part for name in (task.case.scene, *task.case.integrators))
            if self.client is not None and not timed and not local:
                submit = partial(self.client.get_executor(pure=False).submit, execute_case)
                _drain(part, submit, cluster.width(self.client), on_result)
            elif local or (len(part) < WORTH_WORKERS and not self.size):

                def here(task: Task) -> Future[Result]:
                    (future := Future[Result]()).set_result(execute_case(task, study))
                    return future

                _drain([task._replace(timed=(1, math.nan) if timed else None) for task in part], here, 1, on_result)
            else:
                self._in_workers(part, on_result, timed=timed)

    def _in_workers(self, tasks: list[Task], on_result: OnResult, *, timed: bool) -> None:
        """Compute tasks in workers; one whose worker dies is computed once more, with nobody beside it."""
        remaining, died = {task.path: task for task in tasks}, dict[Path, Task]()
        fruitless = 0

        def settle(task: Task, result: Result) -> None:
            nonlocal fruitless
            fruitless = 0
            del remaining[task.path]
            if result.state == "died" and not alone:
                died[task.path] = task
            else:
                on_result(task, failed(task, ENDED) if result.state == "died" else result)

        for alone in (False, True):
            while remaining:
                self.open(min(self.jobs, len(remaining)))
                together = self.at_once(min(self.size, len(remaining))) if timed else None
                width = 1 if alone else AHEAD * self.size if together is None else together[0]
                try:
                    ahead = [task._replace(timed=together) for task in remaining.values()]
                    _drain(ahead, lambda task: self.submit(execute_case, task, limit=task.limit + GRACE), width, settle)
                except BrokenExecutor:
                    self.close_workers()
                    fruitless += 1
                    if fruitless == MOST_FRUITLESS:
                        words = "the worker processes end before they begin; try --jobs 1 or look at the free memory"
                        raise SymtopError(words) from None
            remaining.update(died)

    def at_once(self, width: int) -> tuple[int, float]:
        """How many timed cases may run at once, one for each worker if a trial shows no disturbance, or half, ...

        Beside it stands how many times longer a run took beside so many, or beside the fewest that were tried.
        """
        ratio = math.nan  # without a trial
        while width > 1:
            if width not in self._trials:
                self._trials[width] = slowdown(self.submit, width)
            ratio = self._trials[width]
            if ratio <= DISTURBED:
                break
            width //= 2
        return width, ratio

    def close_workers(self) -> None:
        """End all workers at once, with what they are computing; what was computed is on disk."""
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
    """Initialise a worker: SIGTERM ends it in compiled code as well, and it exits when the parent process has ended."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    gc.set_threshold(50_000, 10, 10)  # at 700, looking for garbage takes 4 % of a quick run
    scripts.install()  # settings of a case may hold records of a study's own
    tqdm.set_lock(threading.RLock())  # its own would be a semaphore of the system, left behind when a worker is ended

    def watch() -> None:
        if (parent := parent_process()) is not None:  # whose number Windows leaves to its children
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def in_order(tasks: Sequence[Task]) -> list[Task]:
    """The first case of every family of methods, then the second, ...: methods of a family share kernels to compile."""
    methods, count = integrators(), Counter[str]()

    def rank(task: Task) -> int:
        method = methods.get(split_name(task.case.integrator)[0])
        family = task.case.integrator if method is None else method.family
        count[family] += 1
        return count[family]

    return sorted(tasks, key=rank)


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
