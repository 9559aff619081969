"""The time that a function call takes.

The first call (compilation, caches) is stored apart. After it, calls are made in batches that last at least
`BATCH` seconds, several functions interleaved in random order so that a slow spell of the machine hits all of
them; every batch is kept. The minimum is the estimate (noise only adds), the spread says how far to trust it.
Batches come in rounds: one of every function, shuffled, then the next round. Samples of one round are neighbours in
time, and the ratio of two of them is less noisy than the ratio of two minima.
"""

import math
import random
import statistics
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

from symtop.methods.framework.plan import Run
from symtop.methods.framework.registry import Integrator
from symtop.model.exact import closed_form
from symtop.model.scenes import Scene
from symtop.run.simulation import make_plan

BATCH = 0.02  # seconds
CLEAR = 1e-3  # seconds: a trial that long shows how many calls make a batch
STRIDE = 16  # the calls of a trial grow at most so much
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


def _calibrate(function: Callable[[], object], batch: float) -> tuple[int, float | None]:
    """How many calls last at least `batch` seconds, and a little more; with the time of one call, if that is enough."""
    count = 1
    while (elapsed := _batch(function, count)) < min(CLEAR, batch):
        count *= max(2, min(STRIDE, int(1.2 * CLEAR / max(elapsed, 1e-9))))
    if elapsed < batch:
        return max(1, math.ceil(1.15 * count * batch / elapsed)), None
    return count, elapsed if count == 1 else None


def timings(
    functions: Sequence[Callable[[], object]],
    batches: int = 5,
    batch: float = BATCH,
    seed: int = 0,
    *,
    warm: bool = False,
    patience: float = math.inf,
) -> list[Timing]:
    """Time several functions against each other.

    Those that are `warm`, called before, have no first call (NaN), and a call that turns out to be longer than a batch
    is the first sample of its function: a long run costs no more calls than it has samples. A function whose samples
    have taken `patience` seconds together has no more of them, but two at least: a long one meets both fast and slow
    moments of the machine. The closed form is compiled before anything is timed, whoever calls it.
    """
    closed_form.compile_now()
    firsts, calls = [], []
    samples: list[list[float]] = []
    for function in functions:
        firsts.append(math.nan if warm else first_call(function))
        count, long = _calibrate(function, batch)
        calls.append(count)
        samples.append([long] if warm and long is not None else [])
    draw = random.Random(seed)  # noqa: S311
    for number in range(batches):
        for index in draw.sample(range(len(functions)), len(functions)):
            taken = samples[index]
            tired = len(taken) > 1 and calls[index] * sum(taken) >= patience
            if len(taken) <= number and not tired:
                taken.append(_batch(functions[index], calls[index]) / calls[index])
    return [Timing(tuple(taken), first) for taken, first in zip(samples, firsts, strict=True)]


def bare_run(
    scene: Scene, method: Integrator, chart: str, setting: float, horizon: float, samples: int = 2
) -> Callable[[], Run]:
    """A call of one of a method's solvers, start to horizon, with nothing around it."""
    plan, _ = make_plan(scene, method, **method.setting(setting).kwargs(), horizon=horizon, samples=samples)
    solve = method.solvers[chart]
    return lambda: solve(scene.top, scene.start, plan)
