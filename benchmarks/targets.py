"""Time to an attitude error on spheroid at t = 8, in microseconds and in steps of Stormer-Verlet, in one run.

For every fixed-step method that shows the attitude: the coarsest step on a fine ladder that meets the accuracy (all
finer ones do too), and the time of that run with everything a call costs. Verlet steps travel between machines better
than microseconds do.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

import symtop
from benchmarks.pages import Table
from symtop.measure.timing import timings
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import methods
from symtop.model import charts

HORIZON = 8.0
ACCURACY = 1e-9
LADDER = np.unique(np.rint(np.geomspace(24, 60_000, 260)).astype(int))  # steps, 3 % apart


def plan_of(steps: int) -> Plan:
    """The plan of a run from the start to the horizon with one sample at the end."""
    return Plan.steps(HORIZON / steps, [steps], HORIZON)


def steps_needed(method: symtop.Integrator, scene: symtop.Scene, chart: str, accuracy: float) -> int | None:
    """The least number of steps on the ladder such that it and all larger ones are accurate enough."""
    true = symtop.ClosedForm(scene.top, scene.start).quaternion([HORIZON])[0]
    fewest = None
    for steps in LADDER[::-1]:
        state = method.solvers[chart](scene.top, scene.start, plan_of(int(steps))).states[-1]
        in_angles = chart == "angles"
        quaternion = charts.quaternion_from_angles(state[0], state[2], state[3]) if in_angles else state[:4]
        if not charts.attitude_distance(quaternion, true) <= accuracy:
            return fewest
        fewest = int(steps)
    return fewest


class MethodCost(NamedTuple):
    """Steps and time of one method to the accuracy."""

    name: str
    steps: int
    seconds: float
    verlet_steps: float


def measure(accuracy: float = ACCURACY) -> list[MethodCost]:
    """Find the steps, time the runs; the fastest method first."""
    scene = symtop.scene("spheroid")
    solvers = {}
    for method in methods().values():
        chart = "attitude" if "attitude" in method.solvers else "angles"
        if method.fixed_step and chart in method.solvers:
            steps = steps_needed(method, scene, chart, accuracy)
            if steps is not None:
                solvers[method.name] = (method.solvers[chart], steps)
    verlet = symtop.integrator("stormer-verlet").solvers["angles"]
    base = 20_000
    calls = [lambda: verlet(scene.top, scene.start, plan_of(base))]
    calls += [lambda s=solve, n=steps: s(scene.top, scene.start, plan_of(n)) for solve, steps in solvers.values()]
    step, *times = (timing.best for timing in timings(calls, batches=40, batch=1e-3))
    step /= base
    rows = [
        MethodCost(name, steps, seconds, seconds / step)
        for (name, (_, steps)), seconds in zip(solvers.items(), times, strict=True)
    ]
    return sorted(rows, key=lambda row: row.seconds)


def table(rows: Sequence[MethodCost], accuracy: float) -> Table:
    """Every method that meets the accuracy."""
    return Table(
        f"Time to an attitude error of {accuracy:g} on spheroid at t = {HORIZON:g}",
        ["method", "steps", "us", "steps of stormer-verlet"],
        [[row.name, str(row.steps), f"{row.seconds * 1e6:.1f}", f"{row.verlet_steps:.0f}"] for row in rows],
    )
