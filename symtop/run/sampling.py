"""Steps and samples of many runs at once: for each member the times and marks that `simulate` gives it alone.

`simulation.sample_times` decides for one run whether its samples have to be dithered, by the widest stretch of nutation
phases that none of them shows. Here that is decided for row after row in compiled code, by the same operations on the
same nutation period: 0.4 microseconds a member with 11 samples, and 0.1 for the period.
"""

import functools
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symtop.core.jit import compile_kernel, register_jitable
from symtop.core.numbers import GOLDEN
from symtop.core.simd import wide_vectors
from symtop.methods.framework.lanes import W, column, put
from symtop.methods.framework.preparation import Body, Start
from symtop.model import top as model
from symtop.run.simulation import STRETCHES, WIDEST_GAP

Array = NDArray[np.float64]
Whole = NDArray[np.int64]


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
    done = Schedule(
        h, np.zeros((n, samples), np.int64), np.full((n, samples), np.nan), np.full(n, samples), np.zeros(n, dtype=bool)
    )
    uniform = np.arange(samples, dtype=float)
    dithered = uniform.copy()
    dithered[1:last] += np.mod(GOLDEN * uniform[1:last], 1.0) - 0.5
    by_steps = np.zeros(0, np.int64) if steps is None else np.ascontiguousarray(steps)
    places = np.stack([uniform / last, dithered / last])
    _laid_out()(np.ascontiguousarray(period), np.ascontiguousarray(horizon), by_steps, places, *done)
    return done


def nutation_periods(numbers: Array) -> Array:
    """`SymmetricTop.nutation_period` of tops and starts (n, 9), to the bit; infinite on a separatrix."""
    periods = np.empty(len(numbers))
    _all_periods()(np.ascontiguousarray(numbers), periods)
    return periods


@functools.cache
def _all_periods() -> Any:
    """The compiled loop over members, whose bisections run in lanes: a third of the time."""
    period_between, cubic_of, bisected, none = model.period_between, model.nutation_cubic, model.bisected, (0.0,) * 9

    @register_jitable
    def member(numbers, i):  # type: ignore[no-untyped-def]
        at = numbers[i]
        return Body(at[0], at[1], at[2]), Start(at[3], at[4], at[5], at[6], at[7], at[8])

    def all_periods(numbers, periods):  # type: ignore[no-untyped-def]
        wide_vectors()
        n, lanes = len(numbers), np.empty(len(none) * W)
        for first in range(0, n, W):
            for j in range(W):
                top, start = member(numbers, min(first + j, n - 1))
                cosine = math.cos(start.theta)
                put(lanes, 0, j, (*cubic_of(top, start), cosine, -1.0, cosine, 1.0, cosine))
            for _ in range(model.BISECTIONS):
                for j in range(W):
                    at = column(lanes, 0, j, none)
                    put(lanes, 5, j, bisected(at[:4], at[4], *at[5:]))
            for j in range(min(W, n - first)):
                top, start = member(numbers, first + j)
                low, below, high, above = column(lanes, 5, j, none[:4])
                periods[first + j] = period_between(top, start, 0.5 * (low + below), 0.5 * (high + above))

    return compile_kernel(all_periods)


@register_jitable
def unseen(times: Any, period: float, phases: Any) -> Any:
    """`simulation._unseen` of one row; `phases` is room for as many numbers."""
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


@functools.cache
def _laid_out() -> Any:  # noqa: C901  (one loop, read in one piece)
    """The compiled loop over rows of a `Schedule`."""

    def lay_out(period, horizon, steps, places, h, marks, times, counts, dithered):  # type: ignore[no-untyped-def]
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
                    asked = row == 0 and long_enough
                    if not asked or unseen(times[i, : counts[i]], period[i], phases[: counts[i]]) < WIDEST_GAP:
                        break

    return compile_kernel(lay_out)


@register_jitable
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
