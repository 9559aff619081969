"""Runs the missing cases of a study in worker processes; a case whose worker dies is retried alone.

Two workers that need the same kernel at the same time both compile it. So the first case of every method goes first,
neighbours of different families, because methods of a family share kernels; the first cases of its other charts follow
it, and each of these is followed by its others, which find their kernels on disk (`Queue`). A case that another run is
computing is left to it, and looked for again at the end. If a worker is killed, all cases that were begun are computed
again, each by itself, so that a case that kills its process can be told from the others.
"""

from collections import Counter, deque
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from pathlib import Path

from symtop.core import files
from symtop.core.errors import SymtopError
from symtop.methods.framework.registry import integrators, split_name
from symtop.runner import plugins, store, work
from symtop.runner.pools import CLUSTER, HERE, Workers
from symtop.runner.study import Study
from symtop.runner.work import Result, Task

WORTH_A_POOL = 8  # cases; starting a worker costs two seconds
MOST_FRUITLESS = 3  # pools that may break without having begun anything

OnResult = Callable[[Task, Result], None]


def execute(study: Study, tasks: Iterable[Task], workers: Workers, on_result: OnResult) -> None:
    """Compute all tasks and call `on_result` with each as it ends, in any order; timed ones last.

    Those run one at a time, or one on each core where a trial shows that they do not disturb each other (`trial`).

    Raises SymtopError if the results cannot be written or the workers cannot work.
    """
    chosen = list(tasks)
    for timed in (False, True):
        group = [task for task in chosen if study.is_timed(task.case) == timed]
        if group:
            if timed:
                workers.quieten()
            else:
                workers.fill()
            _run_until_done(study, group, workers, size_for(group, workers, timed=timed), on_result, timed=timed)


def size_for(tasks: list[Task], workers: Workers, *, timed: bool) -> int:
    """How many processes: none for integrators and scenes that only this process knows, nor for few cases.

    Few are not worth the start of a process; workers that are open take them, since they have kernels already.
    """
    if any(plugins.is_local(name) for task in tasks for name in task.case.names):
        return HERE
    if workers.scheduler and not timed:
        return CLUSTER
    if len(tasks) < WORTH_A_POOL:
        return workers.open_size()
    return max(workers.open_size(), min(workers.jobs, len(tasks)))


def _run_until_done(
    study: Study, tasks: list[Task], workers: Workers, size: int, on_result: OnResult, *, timed: bool
) -> None:
    left = {task.path: task for task in tasks}
    suspects: list[Task] = []
    fruitless = 0

    def settle(task: Task, result: Result) -> None:
        left.pop(task.path)
        on_result(task, result)

    while left:
        suspect = next((task for task in suspects if task.path in left), None)
        now = size if suspect is None else 1
        try:
            _drain(study, list(left.values()) if suspect is None else [suspect], workers, now, settle, timed=timed)
        except BrokenExecutor:
            workers.drop(now)
            begun = [task for task in left.values() if files.was_begun(Path(task.path))]
            fruitless = 0 if begun else fruitless + 1
            if fruitless == MOST_FRUITLESS:
                raise SymtopError(
                    "the worker processes end before they begin; try --jobs 1 or look at the memory that is left"
                ) from None
            for task in begun:
                result = _settled(task, alone=task is suspect)
                if result is None:
                    suspects.append(task)
                else:
                    settle(task, result)


def _settled(task: Task, *, alone: bool) -> Result | None:
    """How a case failed whose process has ended: it hung, or it ended its process; None if that is not known yet."""
    trace = store.trace_path(Path(task.path))
    traceback = trace.read_text() if trace.is_file() else ""
    trace.unlink(missing_ok=True)
    if traceback:
        return _failed(task, f"it was not done after {task.limit:g} s and did not answer", traceback)
    return _failed(task, "its process was ended, by the system (memory) or by the method itself") if alone else None


def _failed(task: Task, reason: str, trace: str = "") -> Result:
    message = work.sentence(task.case, reason)
    store.save_failure(Path(task.path), task.case, message, trace)
    return Result("failed", message)


class Queue:
    """Tasks that are `ready` to begin, and those that wait for another one to end, whose kernels they need."""

    def __init__(self, tasks: Iterable[Task], *, timed: bool) -> None:
        rows: dict[str, list[Task]] = {}
        for task in tasks:  # a timed case compiles before it times
            rows.setdefault(task.path if timed else task.case.integrator, []).append(task)
        charts: dict[str, list[str]] = {}
        for row in rows:
            charts.setdefault(row if timed else split_name(row)[0], []).append(row)
        self._followers = {row: group[1:] for row, group in rows.items()}
        self._charts = {method: [rows[row][0] for row in several[1:]] for method, several in charts.items()}
        family = dict.fromkeys(charts, "") if timed else {method: _family(method) for method in charts}
        seen: Counter[str] = Counter()
        rank = dict[str, int]()  # the first method of every family, then the second, ...
        for method in charts:
            rank[method] = seen[family[method]]
            seen[family[method]] += 1
        self.ready = deque(rows[charts[method][0]][0] for method in sorted(charts, key=rank.__getitem__))

    def ended(self, task: Task) -> None:
        """What waited for the task may begin."""
        row = task.case.integrator
        self.ready.extend(self._followers.pop(row, ()))
        self.ready.extend(self._charts.pop(split_name(row)[0], ()))


def _family(method: str) -> str:
    """The family of a method; a name that none has, such as that of a case of several, is one by itself."""
    known = integrators().get(method)
    return method if known is None else known.family


def _drain(study: Study, tasks: list[Task], workers: Workers, size: int, settle: OnResult, *, timed: bool) -> None:
    """Hand over all tasks in the order of a `Queue`."""
    pool, width = workers.pool(size), workers.width(size)
    if timed:
        company = workers.side_by_side(size, len(tasks))
        tasks, width = [task._replace(company=company) for task in tasks], company.at_once
    given = study if size == HERE else None  # other processes load it by name
    queue = Queue(tasks, timed=timed)
    futures: dict[Future[Result], Task] = {}
    elsewhere: list[Task] = []
    patient = False
    while queue.ready or futures or elsewhere:
        if not queue.ready and not futures:
            queue.ready, elsewhere, patient = deque(elsewhere), [], True
        while queue.ready and len(futures) < width:
            task = queue.ready.popleft()
            futures[pool.submit(work.compute, task, given, wait=patient)] = task
        for future in wait(futures, return_when=FIRST_COMPLETED).done:
            task = futures.pop(future)
            result = _result(future, task, workers)
            queue.ended(task)
            if result.state == "busy":
                elsewhere.append(task)
            else:
                settle(task, result)


def _result(future: "Future[Result]", task: Task, workers: Workers) -> Result:
    """The result that a worker returned; a case that the cluster gave up has failed."""
    try:
        return future.result()
    except (SymtopError, BrokenExecutor):
        raise
    except Exception as error:
        if not workers.scheduler:
            raise
        return _failed(task, f"the cluster gave it up: {type(error).__name__}: {error}")
