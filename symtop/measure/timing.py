"""The time that a function call takes.

The first call (compilation, caches) is stored apart. After it, calls are made in batches that last at least
`BATCH` seconds, several functions interleaved in random order so that a slow spell of the machine hits all of
them; every batch is kept. The minimum is the estimate (noise only adds), the spread says how far to trust it.
Batches come in rounds: one of every function, shuffled, then the next round. Samples of one round are neighbours in
time, and the ratio of two of them is less noisy than the ratio of two minima.
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

BATCH = 0.02  # seconds
CLEAR = 1e-3  # seconds: a trial that long shows how many calls make a batch
STRIDE = 16  # the calls of a trial grow at most so much
ENOUGH = 5  # samples whose three least may agree
NOISY = 0.25  # relative spread beyond which a timing is not called reliable


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
        """Is the spread small enough for a verdict?"""
        return self.spread < NOISY


def _batch(function: Callable[[], object], calls: int) -> float:
    start = time.perf_counter()
    for _ in range(calls):
        function()
    return time.perf_counter() - start


def first_call(function: Callable[[], object]) -> float:
    """Seconds of one call, with the compilation that it may bring about."""
    return _batch(function, 1)


def _calibrate(function: Callable[[], object], batch: float, once: float) -> tuple[int, list[float]]:
    """How many calls last at least `batch` seconds, and a little more; if one does, with the times of those made."""
    count, single = 1, [_batch(function, 1)]
    if min(CLEAR, batch) <= single[0] < once:  # it may have met a pause, as when Python collects garbage
        single.append(_batch(function, 1))
    elapsed = min(single)
    while elapsed < min(CLEAR, batch):
        count *= max(2, min(STRIDE, int(1.2 * CLEAR / max(elapsed, 1e-9))))
        elapsed = _batch(function, count)
    if elapsed < batch:
        return max(1, math.ceil(1.15 * count * batch / elapsed)), []
    return count, single if count == 1 else []


def timings(
    functions: Sequence[Callable[[], object]], batches: int = 5, batch: float = BATCH, *, warm: bool = False,
    patience: float = math.inf, close: float = 0.0, least: int = 2, exact: bool = True,
) -> list[Timing]:  # fmt: skip
    """Time several functions against each other.

    Those that are `warm`, called before, have no first call (NaN), and calls that turn out to be longer than a batch
    are the first samples of their function: a long run costs no more calls than it has samples. A function has no more
    samples, but `least` of them, if they have taken `patience` seconds together: a long one meets both fast and slow
    moments of the machine. It has no more either once they `agree` within the part `close`. The closed form is compiled
    before anything is timed, whoever calls it; if nothing that is timed does (not `exact`), it stays as it is.
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
    draw = random.Random(0)  # noqa: S311
    for number in range(batches):
        for index in draw.sample(range(len(functions)), len(functions)):
            row = samples[index]
            done = (len(row) >= least and calls[index] * sum(row) >= patience) or agree(row, close)
            if len(row) <= number and not done:
                row.append(_batch(functions[index], calls[index]) / calls[index])
    return [Timing(tuple(row), first) for row, first in zip(samples, firsts, strict=True)]


def agree(samples: Sequence[float], close: float) -> bool:
    """Do the three least of `ENOUGH` samples differ by less than the part `close`?

    Fewer may agree on what is wrong: on a busy machine a batch that is interrupted takes one slice of time longer.
    """
    least = sorted(samples)[:3]
    return len(samples) >= ENOUGH and least[2] < (1.0 + close) * least[0]


def bare_run(
    scene: Scene, method: Integrator, chart: str, setting: float, horizon: float, budget: float | None = None
) -> Callable[[], Any]:
    """A call of one of a method's solvers, start to horizon, with two samples and nothing around it.

    Of heyoka it is the own loop, but with a budget, after which the caller may ask how the run ended.
    """
    plan, _ = make_plan(scene, method, **method.given(setting), horizon=horizon, samples=2, budget=budget)
    solve = method.solvers[chart]
    if budget is None and hasattr(solve, "bare"):
        run, _ = solve.bare(scene.top, scene.start, plan)
        return run  # type: ignore[no-any-return]
    return lambda: solve(scene.top, scene.start, plan)


SPAN = 0.03  # seconds of a worker in one turn
TURNS = 7
TRIES = 20  # to have all workers at once, the first time when they have to start
DISTURBED = 1.05  # times as long as alone: beyond it timed cases run one after another


def timed_turn() -> tuple[int, float, float, float]:
    """Process, begin, end and mean seconds of short runs of a compiled method for `SPAN` seconds."""
    run = bare_run(scene("spheroid"), integrator("strang"), "axis", 1e-3, 4.0)
    run()  # its kernel may have to be compiled
    begin, count = time.monotonic(), 0  # of the clock that all processes share
    while (end := time.monotonic()) < begin + SPAN:
        run()
        count += 1
    return os.getpid(), begin, end, (end - begin) / count


def slowdown(submit: Callable[..., "Future[Any]"], size: int) -> float:
    """How many times longer a run takes while `size` workers run; infinite if they never did at once.

    Workers time the same run, one of them alone and all at once, in turns. Beside others it takes as long as alone
    where cores share nothing that a run needs, and up to twice as long where two of them are threads of one core.
    """

    def at_once() -> list[tuple[int, float, float, float]]:
        return [future.result() for future in [submit(timed_turn) for _ in range(size)]]

    for _ in range(TRIES):
        if len({process for process, *_ in at_once()}) == size:
            break
    ratios = []
    for _ in range(TURNS):
        alone, together = submit(timed_turn).result(), at_once()
        if min(end for _, _, end, _ in together) - max(begin for _, begin, _, _ in together) > 0.5 * SPAN:
            ratios.append(max(seconds for *_, seconds in together) / alone[-1])
    return statistics.median(ratios) if ratios else math.inf
