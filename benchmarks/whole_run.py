"""What one call of `simulate` is made of, and what one step of every compiled fixed-step method costs as a run.

The items of a run are timed by themselves, all in one go: the plan, the guard, the solver, the columns, the dataset and
its attributes. What is left between their sum and the whole is Python between them. Beside each stands its time in
steps of the method, which travels between machines better than microseconds do.
"""

import statistics
from collections.abc import Callable
from typing import Any, NamedTuple

import symtop
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
    steps: float  # the same in steps of the method


def measure() -> list[Item]:
    """The parts of one run, and the whole, in a process that has loaded every kernel."""
    for kernel in LAZY:
        kernel.compile()
    scene, method = symtop.scene(SCENE), symtop.integrator(METHOD).variant(CHART)
    h = scene.horizon / STEPS
    plan, _ = make_plan(scene, method, h, None, horizon=scene.horizon, samples=501)
    run = solve(method, CHART, scene.top, scene.start, plan)
    shown, form = Trajectory.of_run(scene, CHART, plan, run), closed_form(scene)
    axes, columns = shown.axis[:300], shown.columns
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


def lines(items: list[Item], steps: dict[str, float]) -> list[str]:
    """The tables."""
    head = f"{STEPS} steps of {METHOD}[{CHART}] on {SCENE}"
    rows = [f"{item.name:<42}{item.seconds * 1e6:>10.1f} us{item.steps:>12.0f}" for item in items]
    slowest = max(steps, key=lambda name: steps[name])
    middle = statistics.median(steps.values())
    last = f"a run of one step: {middle * 1e6:.1f} us (median), at most {steps[slowest] * 1e6:.1f} us, {slowest}"
    return [f"{head:<42}{'':>13}{'steps':>12}", *rows, last]


def main() -> None:
    """Print the tables, with every method by itself."""
    steps = one_step()
    print("\n".join([*lines(measure(), steps), *(f"  {name:<40}{s * 1e6:>10.2f} us" for name, s in steps.items())]))


if __name__ == "__main__":
    main()
