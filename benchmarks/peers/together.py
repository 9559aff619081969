"""Many tops at once: diffrax under vmap beside lanes and heyoka's batch mode, in one process and on one core.

    python -m benchmarks.peers.together

The tops are neighbours of spheroid, theta within `WIDTH` of each other, from the start to t = `HORIZON`; a call ends
with the last states. diffrax and heyoka choose their steps by a tolerance. Lanes run a method of fixed step, with the
coarsest step of a ladder whose error is no larger than heyoka's at that tolerance, and so does rk4, whose steps are
the ones that others count. The error is the largest of all tops, of the axis at t = `HORIZON`, against the closed form.
"""

import argparse
import os
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

import symtop
from benchmarks import lanes
from benchmarks.pages import Table
from benchmarks.peers.adapters import diffrax as adapter
from symtop.measure.timing import timings
from symtop.methods.framework.lanes import members_of
from symtop.methods.framework.plan import Array
from symtop.methods.framework.space import on_axis
from symtop.model import charts
from symtop.model.exact.closed_form import ClosedForms
from symtop.model.top import flat

MEMBERS = (1000, 10_000)
WIDTH = 0.128  # rad
TOLERANCES, HORIZON = lanes.TOLERANCES, lanes.HORIZON
FIXED = (lanes.RIVAL, ("rk4", "axis"))
ROUNDS = 5
FEW = 64  # tops on which the step of a method in lanes is chosen

Call = Callable[[], tuple[Array, float]]  # the last axes (members, 3), and steps made by a top in the mean


class Row(NamedTuple):
    """One way of running so many tops to an error."""

    name: str
    members: int
    tolerance: float  # of those that have one; of the others, whose error they meet
    error: float  # rad
    steps: float  # made by a top, in the mean
    seconds: float  # a top

    @property
    def nanoseconds(self) -> float:
        """Of a step and top."""
        return self.seconds / self.steps * 1e9


def neighbours(count: int) -> Array:
    """Tops and starts near spheroid: (count, 9)."""
    scene = symtop.scene("spheroid")
    numbers = np.tile(flat(scene.top, scene.start), (count, 1))
    numbers[:, 3] += np.linspace(-0.5 * WIDTH, 0.5 * WIDTH, count)
    return numbers


def fixed(name: str, chart: str, numbers: Array, steps: int) -> Call:
    """A method in lanes."""
    solver, count = lanes.solver_of(name, chart), len(numbers)
    arguments = numbers, np.full(count, HORIZON / steps), np.full((count, 1), steps)
    return lambda: (solver.many(*arguments, compiling=True).states[:, 0, :3], float(steps))


def coarsest(name: str, chart: str, numbers: Array, error: float) -> int | None:
    """The fewest steps of the ladder with which a method is at least as accurate; None if none are enough."""
    sample = numbers[:: max(1, len(numbers) // FEW)]
    return next((n for n in map(int, lanes.LADDER) if worst(fixed(name, chart, sample, n), sample) <= error), None)


def batched(numbers: Array, tolerance: float) -> Call:
    """heyoka's batch mode, as many tops at a time as the processor has room for in a vector."""
    run = lanes.Batches(numbers, tolerance)
    return lambda: (run.side_by_side()[:, :3], run.steps_a_top)


def vmapped(solver: str, numbers: Array, tolerance: float) -> Call:
    """A pair of diffrax under vmap, jitted, with arrays that JAX holds."""
    import jax

    states, inverse = np.array([on_axis(*top)[1] for top in members_of(numbers)]), 1.0 / numbers[:, 0]
    run = adapter.many_tops(solver)
    put = jax.numpy.asarray
    arguments = put(states), put([0.0, HORIZON]), (put(inverse), put(numbers[:, 2])), put(tolerance)

    def call() -> tuple[Array, float]:
        ends, steps = run(*arguments)
        return np.asarray(ends)[:, -1, :3], float(np.mean(steps))

    return call


def worst(call: Call, numbers: Array) -> float:
    """The largest error of the axis; infinite if a top got lost."""
    true = ClosedForms(numbers).axis(np.full((len(numbers), 1), HORIZON))[:, 0]
    errors = charts.axis_distance(call()[0], true)
    return float(errors.max()) if np.isfinite(errors).all() else np.inf


def measure(solvers: Iterable[str] = tuple(adapter.SOLVERS)) -> list[Row]:
    """Every way at every tolerance and number of tops, in alternating rounds, on one core of those that there are.

    `solvers` are those of diffrax.
    """
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(allowed)})
    try:
        return [row for count in MEMBERS for tolerance in TOLERANCES for row in _cell(count, tolerance, solvers)]
    finally:
        os.sched_setaffinity(0, allowed)


def _cell(count: int, tolerance: float, solvers: Iterable[str]) -> list[Row]:
    numbers = neighbours(count)
    calls = {"heyoka, batch mode": batched(numbers, tolerance)}
    error = worst(calls["heyoka, batch mode"], numbers)
    for name, chart in FIXED:
        steps = coarsest(name, chart, numbers, error)
        if steps is not None:
            calls[f"{name}[{chart}], lanes"] = fixed(name, chart, numbers, steps)
    calls |= {f"diffrax {solver}, vmap": vmapped(solver, numbers, tolerance) for solver in solvers}
    errors = {name: worst(call, numbers) for name, call in calls.items()}  # compiles, too
    results = timings([*calls.values()], ROUNDS, batch=0.0, warm=True)
    return [Row(name, count, tolerance, errors[name], call()[1], timing.best / count)
            for (name, call), timing in zip(calls.items(), results, strict=True)]  # fmt: skip


def table(rows: list[Row]) -> Table:
    """What the report shows."""
    return Table(
        f"Many tops at once to t = {HORIZON:g}, one core",
        ["members", "tolerance", "how", "axis error", "steps a top", "us a top", "ns a step and top"],
        [
            [f"{row.members:,}", f"{row.tolerance:g}", row.name, f"{row.error:.1e}", f"{row.steps:.0f}",
             f"{row.seconds * 1e6:.2f}", f"{row.nanoseconds:.1f}"]
            for row in rows
        ],
    )  # fmt: skip


def verdict(rows: list[Row]) -> list[str]:
    """How lanes stand beside the others, by tolerance, with the most tops."""
    sentences = []
    largest = max((row.members for row in rows), default=0)
    for tolerance in TOLERANCES:
        cell = [row for row in rows if (row.members, row.tolerance) == (largest, tolerance)]
        ours = min((row for row in cell if row.name.endswith("lanes")), key=lambda row: row.seconds, default=None)
        if ours is None:
            continue
        others = sorted((row for row in cell if not row.name.endswith("lanes")), key=lambda row: row.seconds)
        ends = dict.fromkeys(others[:1] + others[-1:])
        beside = " and ".join(
            f"{row.name} takes {row.seconds / ours.seconds:.3g} times as long (error {row.error:.0e})" for row in ends
        )
        comparison = {0: "", 1: f" {beside}."}.get(len(others), f" Of {len(others)} others {beside}.")
        sentences.append(
            f"{largest:,} tops on one core at {tolerance:g}: {ours.name}, takes {ours.seconds * 1e6:.1f} us a top and "
            f"{ours.nanoseconds:.1f} ns a step to an error of {ours.error:.0e}.{comparison}"
        )
    return sentences


if __name__ == "__main__":
    argparse.ArgumentParser(description=str(__doc__).partition("\n")[0]).parse_args()  # it has --help alone
    rows = measure()
    print("\n".join([table(rows).text, *verdict(rows)]))
