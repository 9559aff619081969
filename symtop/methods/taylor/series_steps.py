"""The steps of the own Taylor series with a tolerance: the order follows from it, each step from its last two terms.

    order N: the least of 8, 12, 16, 20 that is at least 3 - log(tolerance)/2
    e = max(|S_N|, |S_{N-1}|/4),    accepted if e <= 4 tolerance,    h <- h min(4, 0.95 (tolerance/e)^(1/N))

|S_n| are the terms of the axis, or of the attitude, at the end of the step: the tolerance is an error of one step in
radians. The first neglected term is smaller than e by the ratio of two terms, 0.2 to 0.5. A rejected step costs one
series. So does a sample, the series of the step with a shorter time, 0.1 us: it is the method's dense output and, as
that of `taylor`, no force evaluation of the run, whose work would otherwise depend on who looks at it. Time and state
are sums with compensation. `taylor` does the same on equations that its compiler knows nothing of.
Source: Biscani, Izzo, Mon. Not. R. Astron. Soc. 504 (2021) 2614 (order and step of a tolerance).
"""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from symtop.core.jit import compile_kernel, register_jitable, set_item
from symtop.methods.framework.adaptive import Adaptive
from symtop.methods.framework.outcomes import NOT_FINITE, STEP_TOO_SMALL
from symtop.methods.framework.preparation import Body, Start
from symtop.methods.framework.space import axis_of, on_attitude, on_axis, with_spin
from symtop.methods.taylor.attitude_series import attitude_sum
from symtop.methods.taylor.axis_series import axis_sum
from symtop.methods.vectors import accumulate

ORDERS = (8, 12, 16, 20)
BLOCK = 1_000_000  # series between returns to Python
SERIES = 200_000_000  # of one run: about half a minute
ACCEPTED, SAFETY, GROW, EARLIER = 4.0, 0.95, 4.0, 0.25


class Chart(NamedTuple):
    """What a chart's series and samples are."""

    numbers: Callable[..., Any]
    series: Callable[[int], Callable[..., Any]]
    sample: Callable[..., Any]  # (par, state, t)
    axis: Callable[..., Any]  # of the first components of a state
    size: int


@register_jitable
def _as_summed(par: Any, state: Any, t: float) -> Any:
    return state


@register_jitable
def _first_three(state: Any) -> Any:
    return state[0], state[1], state[2]


@register_jitable
def _of_quaternion(state: Any) -> Any:
    return axis_of(state[0], state[1], state[2], state[3])


CHARTS = {
    "axis": Chart(on_axis.numbers, axis_sum, _as_summed, _first_three, 6),
    "attitude": Chart(on_attitude.numbers, attitude_sum, with_spin, _of_quaternion, 7),
}


def order_for(tolerance: float) -> int:
    """The order that reaches a tolerance with the least work."""
    return next((order for order in ORDERS if order >= 3.0 - 0.5 * math.log(tolerance)), ORDERS[-1])


@functools.cache
def march_adaptive(chart: str, order: int) -> Callable[..., tuple[int, int, int, int]]:  # noqa: C901
    """The loop of one order in one chart, compiled when it is first used.

    It is a loop as `adaptive` takes it, from the place (state, its low half, time, its low half, step), and counts
    the series of its steps.
    """
    prepare, series_of, sample, axis, size = CHARTS[chart]
    series = series_of(order)

    def terms(state, body, h):  # type: ignore[no-untyped-def]
        out = series(state, h / body.I1, h * body.mgl)
        dstate = state
        for i in range(size - 1):
            dstate = set_item(dstate, i, out[i])
        last = max(math.sqrt(out[size - 1]), EARLIER * math.sqrt(out[size]))
        return set_item(dstate, size - 1, 0.0), last

    register_jitable(terms)

    def run(numbers, tolerance, times, budget, seen, place, states, momenta):  # type: ignore[no-untyped-def]  # noqa: C901
        body = Body(*numbers[:3])
        par, state = prepare(body, Start(*numbers[3:]))
        low = state
        for i in range(size):
            low = set_item(low, i, 0.0)
        t = rest = 0.0
        turn = (state[size - 3] ** 2 + state[size - 2] ** 2 + state[size - 1] ** 2) / body.I1**2
        h = 1.0 / math.sqrt(turn + 4.0 * abs(body.mgl) / body.I1 + 1.0 / times[-1] ** 2)
        if seen >= 0:
            for i in range(size):
                state, low = set_item(state, i, place[i]), set_item(low, i, place[size + i])
            t, rest, h = place[2 * size], place[2 * size + 1], place[2 * size + 2]
        seen = max(seen, 0)
        steps = effort = outcome = 0
        while seen < len(times) and effort < budget:
            dstate, last = terms(state, body, h)
            effort += 1
            change = GROW if last == 0.0 else min(GROW, SAFETY * (tolerance / last) ** (1.0 / order))
            if last <= ACCEPTED * tolerance:
                ahead = t + h
                after = (rest + (t - ahead)) + h if t > h else (rest + (h - ahead)) + t
                while seen < len(times) and (times[seen] - ahead) - after <= 0.0:
                    part, _ = terms(state, body, (times[seen] - t) - rest)
                    shown, _ = accumulate(state, low, part)
                    shown = sample(par, shown, times[seen])
                    for i in range(size):
                        states[seen, i] = shown[i]
                    e = axis(shown)
                    momenta[seen, 0] = shown[size - 1]
                    momenta[seen, 1] = shown[size - 3] * e[0] + shown[size - 2] * e[1] + shown[size - 1] * e[2]
                    seen += 1
                state, low = accumulate(state, low, dstate)
                t, rest = ahead, after
                steps += 1
            elif not last < np.inf:
                change = 0.1
            h *= change
            if not t + h > t:
                outcome = STEP_TOO_SMALL
                break
            if not np.isfinite(state[0] + state[size - 2]):
                outcome = NOT_FINITE
                break
        for i in range(size):
            place[i], place[size + i] = state[i], low[i]
        place[2 * size], place[2 * size + 1], place[2 * size + 2] = t, rest, h
        return seen, steps, effort, outcome

    compiled: Callable[..., tuple[int, int, int, int]] = compile_kernel(run)
    return compiled


def solver(chart: str) -> Adaptive:
    """A solver of the registry in one chart."""
    size = CHARTS[chart].size
    return Adaptive(
        lambda tolerance: march_adaptive(chart, order_for(tolerance)), size, 2 * size + 3, 2 * size, SERIES, BLOCK, order_for
    )
