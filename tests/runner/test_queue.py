"""In what order cases begin: two workers should not need the same kernel at the same time."""

import pytest

from symtop.methods.framework.registry import integrators
from symtop.runner.execute import Queue
from symtop.runner.study import Case
from symtop.runner.work import Task

ROWS = ("gauss-2[axis]", "gauss-2[attitude]", "gauss-4[axis]", "gauss-4[attitude]", "strang[axis]", "yoshida-4[axis]")
SCENES = ("spheroid", "goldstein")


def tasks(rows=ROWS, scenes=SCENES):
    return [Task("mine", Case(scene, row), f"{scene}--{row}", (), 60.0) for scene in scenes for row in rows]


def names(ready):
    return [(task.case.integrator, task.case.scene) for task in ready]


def test_methods_of_one_family_do_not_begin_side_by_side():
    assert [integrators()[name].family for name in ("gauss-2", "gauss-4", "strang", "yoshida-4")] == (
        ["runge-kutta"] * 2 + ["splitting"] * 2
    )
    begun = names(Queue(tasks(), timed=False).ready)
    assert begun == [(f"{name}[axis]", "spheroid") for name in ("gauss-2", "strang", "gauss-4", "yoshida-4")]


def test_the_other_charts_of_a_method_follow_its_first_case_and_every_row_its_own():
    queue = Queue(tasks(), timed=False)
    first = queue.ready.popleft()
    queue.ready.clear()
    queue.ended(first)
    assert names(queue.ready) == [("gauss-2[axis]", "goldstein"), ("gauss-2[attitude]", "spheroid")]
    other = queue.ready.pop()
    queue.ready.clear()
    queue.ended(other)
    assert names(queue.ready) == [("gauss-2[attitude]", "goldstein")]
    queue.ready.clear()
    queue.ended(other)  # of another scene, later: nothing waits for it any more
    assert not queue.ready


@pytest.mark.parametrize("timed", [False, True])
def test_every_task_begins_once(timed):
    """Names that no method has among them, as those of cases of several."""
    given = tasks((*ROWS, "together", "rk4", "my-own[axis]"))
    queue, begun = Queue(given, timed=timed), []
    while queue.ready:
        task = queue.ready.popleft()
        begun.append(task)
        queue.ended(task)
    assert sorted(task.path for task in begun) == sorted(task.path for task in given)


def test_timed_tasks_wait_for_none():
    """They compile before they time, and stand in the order of the study."""
    given = tasks()
    assert list(Queue(given, timed=True).ready) == given
