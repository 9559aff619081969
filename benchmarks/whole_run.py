"""Times of the parts of one call of `simulate`, and of a run of one step of every compiled fixed-step method.

The items of a run are timed by themselves, all in one go: the plan, the guard, the solver, the columns, the dataset and
its attributes. What is left between their sum and the whole is Python between them. Beside each stands its time in
steps of the method, which travels between machines better than microseconds do.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import symtop
from benchmarks.pages import Table
from symtop.core import netcdf
from symtop.measure.timing import bare_run, timings
from symtop.methods.framework.calling import solve
from symtop.methods.framework.loop import inside
from symtop.methods.framework.registry import methods
from symtop.model.charts import BODY
from symtop.model.lazy_kernel import LAZY
from symtop.model.scenes import closed_form
from symtop.run.guard import warning
from symtop.run.simulation import make_plan
from symtop.run.trajectory import Trajectory, dataset

SCENE, METHOD, CHART, STEPS = "spheroid", "strang", "axis", 400
BATCHES, BATCH = 40, 2e-3


class Item(NamedTuple):
    """One part of a run."""

    name: str
    seconds: float
    steps: float  # the time in steps of the method


def measure() -> list[Item]:
    """The parts of one run, and the whole, in a process that has loaded every kernel."""
    for kernel in LAZY:
        kernel.compile()
    scene, method = symtop.scene(SCENE), symtop.integrator(METHOD).variant(CHART)
    h = scene.horizon / STEPS
    plan, _ = make_plan(scene, method, h, None, horizon=scene.horizon, samples=501)
    run = solve(method, CHART, scene.top, scene.start, plan)
    trajectory, form = Trajectory.of_run(scene, CHART, plan, run), closed_form(scene)
    axes, columns = trajectory.axis[:300], trajectory.columns
    attributes: dict[str, Any] = dict(symtop.simulate(scene, method, step_size=h).attrs)
    del attributes["title"]
    calls: dict[str, Callable[[], object]] = {
        "the steps alone": bare_run(scene, method, CHART, h, scene.horizon),
        "plan": lambda: make_plan(scene, method, h, None, horizon=scene.horizon, samples=501),
        "guard": lambda: warning(scene, method, CHART, plan),
        "closed form at the guard's points": lambda: form.axis_distance(plan.times[:300], axes),
        "solver, every step shown": lambda: solve(method, CHART, scene.top, scene.start, plan),
        "columns": lambda: Trajectory.of_run(scene, CHART, plan, run),
        "closed form at the samples": lambda: form.turns(plan.times),
        "dataset of columns": lambda: dataset(plan.times, columns),
        "attributes": lambda: netcdf.attributes_of("bench", **attributes),
        "simulate without the guard": lambda: symtop.simulate(scene, method, step_size=h, guard=False),
        "simulate": lambda: symtop.simulate(scene, method, step_size=h),
    }
    best = [timing.best for timing in timings(list(calls.values()), batches=BATCHES, batch=BATCH)]
    step = best[0] / STEPS
    return [Item(name, seconds, seconds / step) for name, seconds in zip(calls, best, strict=True)]


def one_step() -> dict[str, float]:
    """Seconds of a run of one step, of every compiled fixed-step method in each of its charts."""
    scene = symtop.scene(SCENE)
    calls = {
        f"{method.name}[{chart}]": bare_run(scene, method, chart, 0.01, 0.01)
        for method in methods().values()
        for chart, solver in method.solvers.items()
        if chart != BODY and method.fixed_step and inside(solver) is not None
    }
    best = [timing.best for timing in timings(list(calls.values()), batches=BATCHES, batch=BATCH / 4)]
    return dict(zip(calls, best, strict=True))


def tables(items: Sequence[Item], steps: Mapping[str, float]) -> list[Table]:
    """The parts of a run, and the run of one step of every method."""
    return [
        Table(
            f"A run of {STEPS} steps of {METHOD} on {SCENE}, by its parts",
            ["part", "us", "steps of the method"],
            [[item.name, f"{item.seconds * 1e6:.1f}", f"{item.steps:.0f}"] for item in items],
        ),
        Table("A run of one step", ["method", "us"], [[name, f"{s * 1e6:.2f}"] for name, s in steps.items()]),
    ]


def verdict(items: Sequence[Item], steps: Mapping[str, float]) -> list[str]:
    """Sentences: the times of a run, of its largest parts, and of the slowest run of one step."""
    took = {item.name: item.seconds * 1e6 for item in items}
    slowest = max(steps, key=lambda name: steps[name])
    run = (
        f"`simulate` takes {took['simulate']:.0f} us for {STEPS} steps of {METHOD}[{CHART}] on {SCENE}, "
        f"{took['solver, every step shown']:.0f} in the solver and {took['guard']:.0f} in the guard."
    )
    return [run, f"A run of one step takes {steps[slowest] * 1e6:.1f} us at most, with {slowest}."]
