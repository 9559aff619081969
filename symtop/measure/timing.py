"""Time of a function call, kept honest.

The first call (compilation, caches) is stored apart. After it, calls are made in batches that last at least
`BATCH` seconds, several functions interleaved in random order so that a slow spell of the machine hits all of
them; every batch is kept. The minimum is the estimate (noise only adds), the spread says how far to trust it.
"""

import random
import statistics
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import xarray as xr

from symtop.integrators.registry import Integrator, Run
from symtop.measure.accuracy import knobs
from symtop.scenes import Scene
from symtop.simulate import choose_chart, make_plan

BATCH = 0.02  # seconds
CLEAR = 2e-4  # seconds
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


def timings(
    functions: Sequence[Callable[[], object]], batches: int = 5, batch: float = BATCH, seed: int = 0
) -> list[Timing]:
    """Time several functions against each other."""
    firsts, calls = [], []
    for function in functions:
        firsts.append(_batch(function, 1))
        count = 1
        while (elapsed := _batch(function, count)) < batch:
            count = max(2 * count, int(1.2 * count * batch / max(elapsed, 1e-9)))
            if elapsed > CLEAR:  # long enough to trust the estimate without a trial
                break
        calls.append(count)
    order = [index for index in range(len(functions)) for _ in range(batches)]
    random.Random(seed).shuffle(order)  # noqa: S311
    samples: list[list[float]] = [[] for _ in functions]
    for index in order:
        samples[index].append(_batch(functions[index], calls[index]) / calls[index])
    return [Timing(tuple(found), first) for found, first in zip(samples, firsts, strict=True)]


def bare_run(scene: Scene, method: Integrator, chart: str, setting: float, horizon: float) -> Callable[[], Run]:
    """A call of one of a method's solvers, start to horizon, with nothing around it."""
    plan, _ = make_plan(scene, method, horizon=horizon, samples=2, **knobs(method, setting))
    solve = method.solvers[chart]
    return lambda: solve(scene.top, scene.start, plan)


def time_settings(
    scene: Scene,
    method: Integrator,
    settings: Sequence[float],
    horizon: float,
    observe: str,
    batches: int = 5,
    batch: float = BATCH,
) -> xr.Dataset:
    """Seconds of one run at each setting, without any observables: dimension ``setting`` (and ``batch``).

    ``seconds`` is the smallest batch, ``seconds_samples`` are all of them, ``reliable`` 1 where the spread allows a
    verdict. The settings of one method are interleaved; other methods are timed before and after.
    """
    chart = choose_chart(method, observe)
    found = timings([bare_run(scene, method, chart, setting, horizon) for setting in settings], batches, batch)
    return xr.Dataset(
        {
            "seconds": ("setting", [timing.best for timing in found]),
            "seconds_samples": (("setting", "batch"), [timing.samples for timing in found]),
            "reliable": ("setting", [float(timing.reliable) for timing in found]),
        }
    )
