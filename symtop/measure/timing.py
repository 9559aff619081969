"""The time that a function call takes.

The first call (compilation, caches) is stored apart. After it, calls are made in batches that last at least
`BATCH_SECONDS` seconds, several functions interleaved in random order so that a slow spell of the machine affects all
of them; every batch is kept. The minimum is the estimate, because noise only adds time; the spread shows how reliable
it is. Batches come in rounds: one of every function, shuffled, then the next round. Samples of one round are neighbours
in time, and the ratio of two of them is less noisy than the ratio of two minima.
"""

import math
import os
import random
import statistics
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any, NamedTuple

from symtop.methods.framework.registry import Integrator, integrator
from symtop.model.exact import closed_form
from symtop.model.scenes import Scene, scene
from symtop.run.simulation import make_plan

BATCH_SECONDS = 0.02  # seconds
TRIAL_SECONDS = 1e-3  # seconds: from a trial at least that long the number of calls in a batch is estimated
MOST_GROWTH = 16  # largest factor by which the number of calls grows from one trial to the next
LEAST_SAMPLES = 5  # samples needed before the three least are compared with each other
NOISY_SPREAD = 0.25  # relative spread beyond which a timing is not called reliable


class Timing(NamedTuple):
    """Seconds a call: the samples (one a batch), and the first call by itself."""

    samples: tuple[float, ...]
    first_call: float

    @property
    def best(self) -> float:
        """The smallest sample."""
        return min(self.samples)

    @property
    def spread(self) -> float:
        """(median - minimum) / minimum."""
        return statistics.median(self.samples) / self.best - 1.0

    @property
    def reliable(self) -> bool:
        """Is the spread below `NOISY_SPREAD`?"""
        return self.spread < NOISY_SPREAD


def _batch(function: Callable[[], object], calls: int) -> float:
    start = time.perf_counter()
    for _ in range(calls):
        function()
    return time.perf_counter() - start


def first_call(function: Callable[[], object]) -> float:
    """Seconds of one call, including any compilation that it causes."""
    return _batch(function, 1)


def _calibrate(function: Callable[[], object], batch: float, limit: float) -> tuple[int, list[float]]:
    """How many calls last a little over `batch` seconds; if a single call does, also the times of the trial calls."""
    count, single = 1, [_batch(function, 1)]
    if min(TRIAL_SECONDS, batch) <= single[0] < limit:  # once more: a garbage collection may have disturbed the first
        single.append(_batch(function, 1))
    elapsed = min(single)
    while elapsed < min(TRIAL_SECONDS, batch):
        count *= max(2, min(MOST_GROWTH, int(1.2 * TRIAL_SECONDS / max(elapsed, 1e-9))))
        elapsed = _batch(function, count)
    if elapsed < batch:
        return max(1, math.ceil(1.15 * count * batch / elapsed)), []
    return count, single if count == 1 else []


def timings(
    functions: Sequence[Callable[[], object]], batches: int = 5, batch: float = BATCH_SECONDS, *, warm: bool = False,
    patience: float = math.inf, close: float = 0.0, least: int = 2, exact: bool = True,
) -> list[Timing]:  # fmt: skip
    """Time several functions against each other.

    With `warm`, functions have been called before: they have no first call (NaN), and a trial call that lasts longer
    than a batch counts as a sample, so that a long run is called no more often than it has samples. A function gets no
    more samples once it has `least` of them that took `patience` seconds together, because a long call averages fast
    and slow moments of the machine; all end once the samples of each other one `agree` to the relative difference
    `close`: one that ended by itself in a slow spell would be compared with those that outlast it. The closed form is
    compiled before anything is timed, unless no function uses it (`exact` is False).
    """
    if exact:
        closed_form.compile_now()
    firsts, calls = [], []
    samples: list[list[float]] = []
    for function in functions:
        firsts.append(math.nan if warm else first_call(function))
        count, single = _calibrate(function, batch, math.inf if least > 1 else patience)
        calls.append(count)
        samples.append(single if warm else [])
    rng = random.Random(0)  # noqa: S311
    for number in range(batches):
        ready = [len(row) >= least and count * sum(row) >= patience for row, count in zip(samples, calls, strict=True)]
        if all(stop or agree(row, close) for row, stop in zip(samples, ready, strict=True)):
            break
        for index in rng.sample(range(len(functions)), len(functions)):
            if len(samples[index]) <= number and not ready[index]:
                samples[index].append(_batch(functions[index], calls[index]) / calls[index])
    return [Timing(tuple(row), first) for row, first in zip(samples, firsts, strict=True)]


def agree(samples: Sequence[float], close: float) -> bool:
    """Do the least three of at least `LEAST_SAMPLES` samples agree within `close`? Fewer may agree on a wrong time."""
    fastest = sorted(samples)[:3]
    return len(samples) >= LEAST_SAMPLES and fastest[2] < (1.0 + close) * fastest[0]


def bare_run(
    scene: Scene, method: Integrator, chart: str, setting: float, horizon: float, budget: float | None = None
) -> Callable[[], Any]:
    """A solver in a chart as a call, two samples and no checks; heyoka's own loop unless there is a `budget`."""
    plan, _ = make_plan(scene, method, **method.given(setting), horizon=horizon, samples=2, budget=budget)
    solve = method.solvers[chart]
    if budget is None and hasattr(solve, "bare"):
        run, _ = solve.bare(scene.top, scene.start, plan)
        return run  # type: ignore[no-any-return]
    return lambda: solve(scene.top, scene.start, plan)


TURN_SECONDS = 0.03  # seconds for which a worker repeats the run in one turn
TURNS = 7  # comparisons of one worker alone with all at once
TRIES = 20  # attempts to have every worker process take one of the calls; at first some may still be starting
DISTURBED_RATIO = 1.05  # slowdown beyond which timed cases run one after another


def timed_turn() -> tuple[int, float, float, float]:
    """Process id, begin, end and mean seconds of short runs of a compiled method, repeated for `TURN_SECONDS`."""
    run = bare_run(scene("spheroid"), integrator("strang"), "axis", 1e-3, 4.0)
    run()  # its kernel may have to be compiled
    begin, count = time.monotonic(), 0  # all processes share this clock
    while (end := time.monotonic()) < begin + TURN_SECONDS:
        run()
        count += 1
    return os.getpid(), begin, end, (end - begin) / count


def slowdown(submit: Callable[..., Future[Any]], size: int) -> float:
    """How many times longer a run takes while `size` workers run; infinite if they never ran at the same time.

    Workers time the same run, alternately one alone and all at once. The ratio is 1 where cores share nothing that a
    run needs, and up to 2 where two workers run on two hardware threads of one core.
    """

    def concurrent_turns() -> list[tuple[int, float, float, float]]:
        return [future.result() for future in [submit(timed_turn) for _ in range(size)]]

    for _ in range(TRIES):
        if len({process for process, *_ in concurrent_turns()}) == size:
            break
    ratios = []
    for _ in range(TURNS):
        single, parallel = submit(timed_turn).result(), concurrent_turns()
        if min(end for _, _, end, _ in parallel) - max(begin for _, begin, _, _ in parallel) > 0.5 * TURN_SECONDS:
            ratios.append(max(seconds for *_, seconds in parallel) / single[-1])
    return statistics.median(ratios) if ratios else math.inf
