"""Many tops in one call of `symtop.ensemble` against as many calls of `simulate`, and the parts of the call.

python -m benchmarks.ensemble

Both make the same runs of the same tops, to the same bits. Calls of `simulate` are timed on `ALONE` tops from all over
the population, without its guard, which an ensemble does not have, and with it, as a user calls it. Rounds of all of
them alternate, and the best of each counts.

An error of 1e-3 needs 100 steps a nutation period in the median of the population: the setting here. It limits how much
an ensemble can gain: a step of strang[axis] is 152 sums and products, 76 cycles for eight tops on a processor that
begins two vector operations a cycle, and no way of calling it makes it less. `verdict` says how often the steps alone,
on all cores, go into the time of `simulate`.

`calls` times what a user writes, `symtop.ensemble(population, METHOD, samples=2, observe="axis")` of `CALLED` tops on
all cores, with two numbers of steps: what a step takes, and what a member takes beside its steps; and a step of one
long `simulate` alone.
"""

import argparse
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

import symtop
from benchmarks.pages import Table
from symtop.core.parallel import cores
from symtop.measure.timing import timings
from symtop.methods.framework.lanes import members_of
from symtop.methods.framework.loop import FixedStep
from symtop.model.charts import View
from symtop.run.ensemble import inputs as reading
from symtop.run.ensemble.chunks import Job, nutation_periods, schedule, together

METHOD, CHART, PER_NUTATION, NUTATIONS, SAMPLES = "strang", "axis", 100, 10, 11
MEMBERS, ALONE, ROUNDS = 10_000, 300, 9
SHOWN = ("axis", "energy")
WHOLE = "`ensemble`, axis and energy"
STEPS_ALONE, CALLER = "of it: the steps, without starts and samples", "of it: in the calling thread"


class Item(NamedTuple):
    """One part of an ensemble, or a way of making its runs."""

    name: str
    seconds: float  # for one member
    ratio: float  # how many times faster than `simulate` with its guard


def measure() -> list[Item]:
    """Times a member of `simulate`, of the whole call, and of its parts on one thread."""
    tops = symtop.population(MEMBERS, seed=1)
    numbers = reading.read_members(tops).numbers
    row = symtop.integrator(METHOD).variant(CHART)
    period = nutation_periods(numbers)
    horizon, steps = NUTATIONS * period, np.full(MEMBERS, NUTATIONS * PER_NUTATION)
    plan, solver = schedule(period, horizon, SAMPLES, steps), row.solvers[CHART]
    assert isinstance(solver, FixedStep)
    options: dict[str, Any] = {"per_nutation": PER_NUTATION, "nutations": NUTATIONS, "samples": SAMPLES, "quiet": True}

    def one_by_one(*, guard: bool) -> Callable[[], None]:
        chosen = np.linspace(0, MEMBERS - 1, ALONE).astype(int)
        scenes = [
            symtop.Scene("one", top, start, float(end))
            for (top, start), end in zip(members_of(numbers[chosen]), horizon[chosen], strict=True)
        ]

        def run() -> None:
            for scene in scenes:
                warned = (lambda _: None) if guard else False
                symtop.simulate(
                    scene, row, step_size=scene.horizon / (NUTATIONS * PER_NUTATION), samples=SAMPLES, guard=warned
                )

        return run

    def stepped(times: int) -> Callable[[], object]:
        """A function that makes `times` as many steps and returns the last state only."""
        return lambda: solver.many(numbers, plan.step_size, times * plan.marks[:, -1:])

    def whole(threads: int, variables: tuple[str, ...] | None) -> Callable[[], object]:
        return lambda: symtop.ensemble(tops, row, threads=threads, variables=variables, **options)

    job, phi_job = (Job(row, CHART, numbers, horizon, steps, None, SAMPLES, None, names) for names in (SHOWN, ("phi",)))
    runs = job._runs(plan)
    cell = (
        CHART,
        together(numbers),
        runs.states,
        runs.momenta[..., 0],
        runs.momenta[..., 1],
    )  # a view keeps what it gave
    calls: dict[str, tuple[Callable[[], object], int]] = {
        "`simulate`": (one_by_one(guard=True), ALONE),
        "`simulate` without its guard": (one_by_one(guard=False), ALONE),
        WHOLE: (whole(1, SHOWN), MEMBERS),
        "`ensemble`, all variables": (whole(1, None), MEMBERS),
        f"{WHOLE}, {cores()} threads": (whole(cores(), SHOWN), MEMBERS),
        f"`ensemble`, all variables, {cores()} threads": (whole(cores(), None), MEMBERS),
        "of it: nutation periods": (lambda: nutation_periods(numbers), MEMBERS),
        "of it: steps and samples laid out": (lambda: schedule(period, horizon, SAMPLES, steps), MEMBERS),
        "of it: the steps": (lambda: solver.many(numbers, plan.step_size, plan.marks), MEMBERS),
        "once the steps": (stepped(1), MEMBERS),
        "twice the steps": (stepped(2), MEMBERS),
        "of it: axis and energy": (lambda: job._observables(View(*cell), plan.times), MEMBERS),
        "of it: phi, with its closed form": (lambda: phi_job._observables(View(*cell), plan.times), MEMBERS),
    }
    best = dict.fromkeys(calls, np.inf)
    caller = np.inf
    for _ in range(ROUNDS):
        for name, (call, count) in calls.items():
            wall, cpu = time.perf_counter(), time.thread_time()
            call()
            best[name] = min(best[name], (time.perf_counter() - wall) / count)
            if name == f"{WHOLE}, {cores()} threads" and cores() > 1:
                caller = min(caller, (time.thread_time() - cpu) / count)
    best[STEPS_ALONE] = best.pop("twice the steps") - best.pop("once the steps")
    if caller < np.inf:
        best[CALLER] = caller
    return [Item(name, seconds, best["`simulate`"] / seconds) for name, seconds in best.items()]


CALLED, ALL_ROUNDS = 4096, 7
SHORT, LONG, STEPS = (20, 1), (100, 20), 200_000  # steps in a nutation, and nutations; of the run alone


class Call(NamedTuple):
    """One call of `ensemble` as a user makes it: seconds."""

    method: str
    beside: float  # time of a member apart from its steps
    step: float  # time of the long call over the steps of all its members
    alone: float  # time of a step of one long run


def calls() -> list[Call]:
    """Time the call with an explicit method and with an implicit one."""
    tops, scene, rows = symtop.population(CALLED, seed=1), symtop.scene("spheroid"), []
    h = scene.nutation_period / LONG[0]
    for method in (METHOD, "midpoint"):

        def together(per: int, nutations: int, name: str = method) -> object:
            lengths = {"per_nutation": per, "nutations": nutations}
            return symtop.ensemble(tops, name, samples=2, observe="axis", quiet=True, **lengths)

        def alone(name: str = method) -> object:
            return symtop.simulate(scene, name, step_size=h, horizon=STEPS * h, samples=2, observe="axis", guard=False)

        results = timings([lambda: together(*SHORT), lambda: together(*LONG), alone], ALL_ROUNDS, batch=0.0)
        n0, n1 = SHORT[0] * SHORT[1], LONG[0] * LONG[1]
        short, long = (timing.best / CALLED for timing in results[:2])
        rows.append(Call(method, short - n0 * (long - short) / (n1 - n0), long / n1, results[2].best / STEPS))
    return rows


def call_sentences(rows: Sequence[Call]) -> list[str]:
    """Sentences: the times of the calls of a user."""
    return [
        f"`symtop.ensemble` of {CALLED} tops, {row.method}, two samples of the axis, {cores()} cores: "
        f"{row.beside * 1e6:.2f} us a member beside its steps, {row.step * 1e9:.2f} ns a step, "
        f"{row.alone / row.step:.1f} times the steps a second of one long `simulate`."
        for row in rows
    ]


def verdict(items: Sequence[Item]) -> list[str]:
    """Sentences: how much faster an ensemble is, and the limit that its steps alone set."""
    by_name = {item.name: item for item in items}
    fast = max((item for item in items if item.name.startswith(WHOLE)), key=lambda item: item.ratio)
    text = (
        f"{MEMBERS} tops, {NUTATIONS * PER_NUTATION} steps of {METHOD}[{CHART}]: `ensemble` is {fast.ratio:.0f} times "
        "faster than as many calls of `simulate`"
    )
    if STEPS_ALONE in by_name:
        text += f"; the steps alone, on {cores()} cores, bound that at {cores() * by_name[STEPS_ALONE].ratio:.0f} times"
    return [f"{text}."]


def table(items: Sequence[Item]) -> Table:
    """Times of all parts, and of all ways of making the runs."""
    return Table(
        f"A member of an ensemble: {NUTATIONS * PER_NUTATION} steps of {METHOD} [{CHART}], {SAMPLES} samples, "
        f"{MEMBERS} tops",
        ["what", "us a member", "times faster than `simulate`"],
        [[item.name, f"{item.seconds * 1e6:.2f}", f"{item.ratio:.3g}"] for item in items],
    )


def main() -> None:
    """Measure and print."""
    items = measure()
    print("\n".join([table(items).text, *verdict(items), *call_sentences(calls())]))


if __name__ == "__main__":
    argparse.ArgumentParser(description=str(__doc__).partition("\n")[0]).parse_args()  # it has --help alone
    main()
