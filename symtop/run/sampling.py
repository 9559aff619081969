"""When runs are sampled: uniformly, unless samples would fall on the same few phases of the nutation again and again.

There an energy error may read 1e5 times too small. Such samples are dithered by the golden ratio. Which are, the widest
stretch of nutation phases decides that none of them shows. Samples of steps lie at whole steps.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symtop.core.jit_functions import inlined
from symtop.core.numbers import GOLDEN
from symtop.model.lazy_kernel import LazyKernel

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

WIDEST_GAP = 0.125  # of a nutation: samples that leave a wider stretch of phases unseen are dithered
STRETCHES = 17  # of a nutation: two of them are less than `WIDEST_GAP`
SECONDS = 4e-6  # of Python for a sample


class Schedule(NamedTuple):
    """When n runs are sampled. A run of fewer steps than samples shows every step; the rest of its row is padded."""

    step_size: Array  # (n,), NaN where a method chooses its steps
    marks: Whole  # (n, samples) whole steps; the last one again beyond `counts`, zeros without a step
    times: Array  # (n, samples), NaN beyond `counts`
    counts: Whole  # (n,) samples of each
    dithered: NDArray[np.bool_]  # (n,)


def schedule(period: Array, horizon: Array, samples: int, steps: Whole | None) -> Schedule:
    """Times and marks of n runs with so many steps each, or without steps of their own (None)."""
    n, last = len(horizon), samples - 1
    h = np.full(n, np.nan) if steps is None else horizon / steps
    marks, times = np.zeros((n, samples), np.int64), np.full((n, samples), np.nan)
    laid_out = Schedule(h, marks, times, np.full(n, samples), np.zeros(n, dtype=bool))
    uniform = np.arange(samples, dtype=float)
    dithered = uniform.copy()
    dithered[1:last] += np.mod(GOLDEN * uniform[1:last], 1.0) - 0.5
    given = period, horizon, np.zeros(0, np.int64) if steps is None else steps
    rows = [np.require(values, requirements=("C", "W")) for values in (*given, np.stack([uniform, dithered]) / last)]
    fill: Any = _layer.compiled if _layer.ready(SECONDS * n * samples) else _lay_out
    fill(*rows, *laid_out)
    return laid_out


def sample_times(horizon: float, samples: int, period: float, steps: int | None = None) -> tuple[Array, Whole, bool]:
    """Times and step marks of the samples of one run, and whether they had to be dithered.

    With `steps`, times are whole multiples of horizon/steps; the first sample is 0 and the last the horizon.
    """
    one = schedule(np.array([period]), np.array([horizon]), samples, None if steps is None else np.array([steps]))
    count = int(one.counts[0])
    return one.times[0, :count], one.marks[0, : 0 if steps is None else count], bool(one.dithered[0])


@inlined
def _unseen(times: Any, period: float, phases: Any) -> Any:
    """The widest stretch of nutation phases, as a fraction of a period, in which no sample falls, or a bound of it.

    Where each of 17 equal stretches has a sample, none of 2/17 is without one, and nothing is sorted. `phases` is room.
    """
    seen = 0
    for k in range(len(times)):
        turns = times[k] / period
        phases[k] = turns - np.floor(turns)  # the remainder, exactly, and 50 ns less
        seen |= 1 << int(STRETCHES * phases[k])
    every = (1 << STRETCHES) - 1
    if seen & every == every:
        return 2.0 / STRETCHES
    phases.sort()
    gap = phases[0] + 1.0 - phases[-1]
    for k in range(1, len(phases)):
        gap = max(gap, phases[k] - phases[k - 1])
    return gap


@inlined
def _distinct(steps: int, places: Any, marks: Any) -> int:
    """Whole steps next to places that ascend, each once, and the last again in the rest of the row; how many."""
    count = 0
    for k in range(len(places)):
        mark = np.int64(np.rint(steps * places[k]))
        if k == 0 or mark > marks[count - 1]:
            marks[count] = mark
            count += 1
    marks[count:] = marks[count - 1]
    return count


def _lay_out(period: Any, horizon: Any, steps: Any, places: Any, h: Any, marks: Any, times: Any, counts: Any,
             dithered: Any) -> None:  # fmt: skip
    """Fill in the rows of a `Schedule`; `places` are those of uniform and of dithered samples, in (0, 1)."""
    samples = places.shape[1]
    phases = np.empty(samples)
    for i in range(len(horizon)):
        if len(steps) and steps[i] < samples:  # every step is shown
            counts[i] = steps[i] + 1
            for k in range(samples):
                marks[i, k] = min(k, steps[i])
            for k in range(counts[i]):
                times[i, k] = k * h[i]
        else:
            long_enough = np.isfinite(period[i]) and horizon[i] > 2.0 * period[i]
            for row in range(2):
                dithered[i] = row == 1
                if len(steps) == 0:
                    for k in range(samples):
                        times[i, k] = horizon[i] * places[row, k]
                else:
                    counts[i] = _distinct(steps[i], places[row], marks[i])
                    for k in range(counts[i]):
                        times[i, k] = marks[i, k] * h[i]
                times[i, counts[i] :] = np.nan
                judged = row == 0 and long_enough
                if not judged or _unseen(times[i, : counts[i]], period[i], phases[: counts[i]]) < WIDEST_GAP:
                    break


_layer = LazyKernel(
    _lay_out,
    "(float64[::1], float64[::1], int64[::1], float64[:, ::1], float64[::1], int64[:, ::1], float64[:, ::1], "
    "int64[::1], boolean[::1])",
    patience=2.0,
)
