"""Computes one case: in this process, in a worker, or on a cluster.

A failure that the case causes (its method, its measure, its time) is recorded and returned, and the others go on. A
failure that the machine causes (a full disk, other sources than the command's) is raised: it would stop the others too.
"""

import contextlib
import faulthandler
import math
import threading
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import xarray as xr

from symtop.core import files, netcdf
from symtop.core.errors import SymtopError, words_of
from symtop.core.signals import at_most, is_of_user
from symtop.runner import fingerprint, plugins, scripts, store
from symtop.runner.study import Case, Study

GRACE = 5.0  # seconds between asking a case to end and ending its process
_loading = threading.Lock()  # a file that two threads load at once would be executed twice


class Neighbours(NamedTuple):
    """How many timed cases ran at once, and how many times longer a run took beside others (`pool.slowdown`)."""

    at_once: int = 1
    slowdown: float = math.nan  # without a trial


ATTRIBUTES = {name: f"timed_{name}" for name in Neighbours._fields}  # of a timed case's file


class Task(NamedTuple):
    """A case to compute, and everything that another process must know for it."""

    study: str  # its script
    case: Case
    path: Path  # absolute: a worker has a folder of its own
    plugins: tuple[str, ...]
    limit: float  # seconds
    fresh: bool = False
    neighbours: Neighbours | None = None  # of a timed case


class Result(NamedTuple):
    """How a task ended: computed, found, failed, or busy (another command is computing it)."""

    state: str
    message: str = ""


def prepare(script: str, files_of_plugins: tuple[str, ...]) -> Study:
    """The study of a script, with the plug-ins that its cases may need."""
    with _loading:
        for file in files_of_plugins:
            plugins.load(file)
        return scripts.load(script)


def execute_case(task: Task, study: Study | None = None) -> Result:
    """Compute a case and store it, or record how it failed.

    A worker is given no `study` and loads it by name. Python code hears the limit; compiled code does not, and its
    process is ended by the pool `GRACE` seconds later. Raises SymtopError where the machine is the cause.
    """
    study = study or prepare(task.study, task.plugins)
    path, case = task.path, task.case
    if fingerprint.digests(study, [case]) != [store.digest_of(path)]:
        raise SymtopError(
            f"the sources or dependencies of {case.integrator} on {case.scene} are not those that the study was "
            "started with; if a file was edited meanwhile, run the study again"
        )
    with files.locked(path, wait=False) as ours:
        if not ours:
            return Result("busy")
        if not task.fresh and store.load_case(path) is not None:
            return Result("found")
        netcdf.sweep(path)  # of a worker that was killed
        try:
            with at_most(task.limit, processor=False), _traced(task):
                data = study.measure(case)
            if not isinstance(data, xr.Dataset):
                raise SymtopError(f"the measure of a study must return a Dataset, not {type(data).__name__}")  # noqa: TRY301
        except BaseException as error:  # (a failing case must not stop the others)
            if is_of_user(error):
                raise
            return failed(task, error, traceback.format_exc())
        if task.neighbours is not None:
            data = data.assign_attrs({ATTRIBUTES[name]: value for name, value in task.neighbours._asdict().items()})
        store.save_case(data, path, study, case)
        return Result("computed")


def _trace(task: Task) -> Path:
    return task.path.with_name(f".{task.path.stem}.trace")


@contextlib.contextmanager
def _traced(task: Task) -> Iterator[None]:
    """Leave a traceback in a file before the process is ended that takes too long; a thread is in no such process."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    try:
        with _trace(task).open("w") as file:
            faulthandler.dump_traceback_later(task.limit + 0.5 * GRACE, file=file)
            try:
                yield
            finally:
                faulthandler.cancel_dump_traceback_later()
    finally:
        _trace(task).unlink(missing_ok=True)


def take_trace(task: Task) -> str:
    """The traceback that an ended process has left."""
    file = _trace(task)
    text = file.read_text(encoding="utf-8") if file.is_file() else ""
    file.unlink(missing_ok=True)
    return text


def failed(task: Task, error: BaseException | str, trace: str = "") -> Result:
    """Record how a case failed."""
    if isinstance(error, BaseException) and not isinstance(error, SymtopError):
        error = words_of(error)
    message = f"{task.case.integrator} on {task.case.scene} failed: {' '.join(str(error).split())}"
    store.save_failure(task.path, task.case, message, trace)
    return Result("failed", message)
