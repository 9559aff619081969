"""Computes one case: in this process, in a worker of a pool, or on a cluster.

A failure that the case causes (its method, its measure, its time) is recorded and returned, and the others go on. A
failure that the machine causes (a full disk, other sources than the command's) is raised: it would stop the others too.
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
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import NamedTuple

import xarray as xr
from tqdm import tqdm

from symtop.core import files, netcdf
from symtop.core.errors import SymtopError, words_of
from symtop.core.signals import is_of_user
from symtop.runner import depends, plugins, scripts, store
from symtop.runner.study import Case, Study

GRACE = 5.0  # seconds between asking a case to end and ending its process
_loading = threading.Lock()  # a file that two threads load at once would be executed twice
_expendable: list[bool] = []  # not empty in workers: only they may be ended when a case hangs


class Company(NamedTuple):
    """How many timed cases ran at once, and how many times longer a trial run took beside others (`trial`)."""

    at_once: int
    slowdown: float  # NaN without a trial


ALONE = Company(1, math.nan)
TOLD = {name: f"timed_{name}" for name in Company._fields}  # the attributes of a file that tell it


class Task(NamedTuple):
    """A case to compute, and everything that another process must know for it."""

    study: str
    case: Case
    path: str  # absolute: a worker has a folder of its own
    plugins: tuple[str, ...]
    limit: float  # seconds
    fresh: bool = False
    company: Company | None = None  # of a timed case


class Result(NamedTuple):
    """How a task ended: computed, found, failed, or busy (another run is computing it)."""

    state: str
    message: str = ""


class OverdueError(TimeoutError):
    """A case took longer than its limit."""


def compute(task: Task, study: Study | None = None, *, wait: bool = False) -> Result:
    """Compute a case and store it, or record how it failed.

    Another process is given no `study` and loads it by name. Raises SymtopError where the machine is the cause.
    """
    with _loading:
        for file in task.plugins:
            plugins.load(file)
        study = study or scripts.load(task.study)
    path, case = Path(task.path), task.case
    if depends.digest(study, case) != store.digest_of(path):
        raise SymtopError(
            f"the sources or dependencies of {case.integrator} on {case.scene} are not those that the study was "
            "started with; if a file was edited meanwhile, run the study again"
        )
    with files.locked(path, wait=wait) as ours:
        if not ours:
            return Result("busy")
        if not task.fresh and store.load_case(path) is not None:
            return Result("found")
        return _compute(study, task, path)


def _compute(study: Study, task: Task, path: Path) -> Result:
    netcdf.sweep(path)
    store.trace_path(path).unlink(missing_ok=True)  # of a worker that was killed
    try:
        with limited(task.limit, store.trace_path(path)):
            data = study.measure(task.case)
        if not isinstance(data, xr.Dataset):
            raise SymtopError(f"the measure of a study must return a Dataset, not {type(data).__name__}")  # noqa: TRY301
    except BaseException as error:  # (a failing case must not stop the others)
        if is_of_user(error):
            raise
        message = sentence(task.case, error)
        store.save_failure(path, task.case, message, traceback.format_exc())
        return Result("failed", message)
    if task.company is not None:
        data = data.assign_attrs({TOLD[name]: value for name, value in task.company._asdict().items()})
    store.save_case(data, path, study, task.case)
    return Result("computed")


def sentence(case: Case, error: BaseException | str) -> str:
    """How a case failed, in one line."""
    if isinstance(error, BaseException) and not isinstance(error, SymtopError):
        error = words_of(error)
    return f"{case.integrator} on {case.scene} failed: {' '.join(str(error).split())}"


@contextlib.contextmanager
def limited(seconds: float, trace: Path) -> Iterator[None]:
    """Raise OverdueError after so many seconds; if the code does not hear it, end a process that may be ended.

    Measured by the kernel's interval timer, which a change of the clock does not touch. Compiled code is deaf to it, so
    a worker ends itself `GRACE` seconds later, its traceback left in `trace`. In a thread there is no limit.
    """
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return

    def too_long(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
        raise OverdueError(f"it was not done after {seconds:g} s")

    before = signal.signal(signal.SIGALRM, too_long)
    signal.setitimer(signal.ITIMER_REAL, seconds, 1.0)  # again each second, for code that catches everything
    try:
        with _last_resort(seconds + GRACE, trace) if _expendable else contextlib.nullcontext():
            yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@contextlib.contextmanager
def _last_resort(seconds: float, trace: Path) -> Iterator[None]:
    try:
        with trace.open("w") as file:
            faulthandler.dump_traceback_later(seconds, exit=True, file=file)
            try:
                yield
            finally:
                faulthandler.cancel_dump_traceback_later()
    finally:
        trace.unlink(missing_ok=True)


def begin_worker(parent: int) -> None:
    """Initialise a worker of a pool: ignore interrupts, and exit when the parent process has ended."""
    _expendable.append(True)
    gc.set_threshold(50_000, 10, 10)  # at 700, looking for garbage takes 4 % of a quick run
    scripts.install()  # settings of a case may hold records of a study's own
    tqdm.set_lock(threading.RLock())  # its own would be a semaphore of the system, left behind when a worker is ended
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
