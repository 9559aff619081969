"""Seconds of a force evaluation of every variant, alone and among many tops at once, measured in interleaved rounds.

The study counts force evaluations, because a count is the same on every machine. What an evaluation costs is measured
here for each variant, as the slope between two runs of unlike lengths,

    seconds of an evaluation = (seconds of the long run - of the short one) / (evaluations of the long - of the short)

so that what a call costs by itself, 1 to 30 us, has no part in it, of variants with a step and of those with a
tolerance. It is measured in runs of one top and in calls for `TOGETHER` tops where kernels have lanes and work on
several at once, or for `IN_TURN` where they have not. Ordinary tops that stay `CLEAR` of the poles, so that no chart
is left and no run ends early, stand for all: the arithmetic of a step does not hang on the top, but for the iterations
of implicit methods, which are counted. It hangs on the tolerance where the order does: an evaluation of a Taylor
series costs the more the fewer there are of a step. Such variants have a price at each of `TOLERANCES`.

It hangs on the process, too: of 16 processes that timed `series[axis]` 14 had 3.4 to 3.7 ns, one 4.2 and one 4.5, each
in all its rounds. So two processes time all variants; the smaller price counts, and what is said of a time must
be so with the prices of either.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from symtop.measure.timing import Timing, timings
from symtop.methods.framework.adaptive import Adaptive
from symtop.methods.framework.loop import inside
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import Integrator, integrator
from symtop.model.charts import Array
from symtop.model.exact.closed_form import ClosedForms
from symtop.model.top import Angles, SymmetricTop
from symtop.run.ensemble.population import NUMBERS, population

from .tops import FIRST

TOGETHER, IN_TURN = 256, 16  # tops of a call: side by side in lanes, or one after another
FINE = 5  # FIRST 2^FINE steps a nutation
TOLERANCES = tuple(10.0**-decade for decade in range(2, 16, 2))
TOLERANCE = 1e-8  # of variants whose order is the same at all
KIND, CLEAR = "slow", 0.3  # rad between a pole and the axis of a top that is timed
DRAWN = 8 * TOGETHER
KINDS = ("alone", "together")
PROCESSES = "population", "population-again"  # cases that time all variants, each in a worker of its own
LENGTHS = {"alone": (5, 50), "together": (2, 10)}  # nutations of the short run and of the long one
Call = tuple[Callable[[], object], float]  # with its number of force evaluations


def of_processes(group: xr.Dataset) -> xr.Dataset:
    """The prices that several processes measured, over `scene`: the least, with those of each as ``half``.

    ``spread`` is the largest, or by how much the processes differ. With one process its halves are those of its rounds.
    """
    if group.sizes["scene"] == 1:
        return group.isel(scene=0)
    least = group.min("scene")
    differ = (group["alone"].max("scene") / least["alone"] - 1.0).rename("spread")
    each = group[[*KINDS, *(f"{kind}_by" for kind in KINDS)]].drop_vars("scene").rename(scene="half")
    apart = {f"{name}_half": values for name, values in each.data_vars.items()}
    spread = np.maximum(group["spread"].max("scene"), differ)
    return least.drop_vars(list(apart)).assign({**apart, "spread": spread})


class Pair(NamedTuple):
    """A short run and a long one of a variant."""

    short: Call
    long: Call

    def slopes(self, short: Timing, long: Timing, rounds: int) -> Array:
        """Seconds of an evaluation by the smallest samples of all rounds, and by those of either half of them, (3,).

        Where noise makes the short run the slower one, the long run's whole time counts, which is more than the price.
        """
        (_, few), (_, most) = self
        samples = [np.array(taken.samples[-rounds:]) for taken in (short, long)]
        parts = slice(None), slice(0, None, 2), slice(1, None, 2)
        least = np.array([[each[part].min() for part in parts] for each in samples])
        slopes = (least[1] - least[0]) / (most - few)
        return np.where(slopes > 0.0, slopes, least[1] / most)


@functools.cache
def _tops() -> tuple[Any, Any]:
    """Numbers (TOGETHER, 9) and nutation periods of the tops that are timed."""
    drawn = population(DRAWN, seed=0, kind=KIND)
    numbers = np.stack([drawn[name].values for name in NUMBERS], axis=1)
    low, high = ClosedForms(numbers).theta_range.T
    numbers = np.ascontiguousarray(numbers[(low > CLEAR) & (high < np.pi - CLEAR)][:TOGETHER])
    return numbers, np.array(ClosedForms(numbers).nutation_period)


def tolerances_of(variant: Integrator) -> tuple[float, ...]:
    """The tolerances at which a variant is timed; one where its price does not depend on it."""
    return TOLERANCES if not variant.fixed_step and variant.order is None else (TOLERANCE,)


def alone(variant: Integrator, tolerance: float, nutations: int) -> Call:
    """The run of one top."""
    (chart,), (numbers, period) = variant.charts(), _tops()
    top, start, solver = (
        SymmetricTop(*numbers[0, :3].tolist()),
        Angles(*numbers[0, 3:].tolist()),
        variant.solvers[chart],
    )
    steps = round(nutations * FIRST * 2.0**FINE)
    plan = Plan.steps(float(period[0]) * (nutations / steps), np.array([steps // 2, steps]))
    if not variant.fixed_step:
        plan = Plan.until(np.array([0.5, 1.0]) * nutations * float(period[0]), tolerance)
    return lambda: solver(top, start, plan), float(solver(top, start, plan).force_evaluations)


def together(variant: Integrator, tolerance: float, nutations: int) -> Call | None:
    """The runs of many tops in one call, as the ladder makes them; None where there is no such call."""
    (chart,), (numbers, period) = variant.charts(), _tops()
    solver = variant.solvers[chart]
    if isinstance(solver, Adaptive):
        times = np.array([0.5, 1.0]) * nutations * period[:IN_TURN, np.newaxis]
        tops, same, samples = numbers[:IN_TURN], np.full(IN_TURN, tolerance), np.full(IN_TURN, 2)
        made, _ = solver.many(tops, same, times, samples)
        return lambda: solver.many(tops, same, times, samples), float(made.work.sum())
    loop = inside(solver)
    if loop is None:
        return None
    count, steps = TOGETHER if loop.in_lanes else IN_TURN, round(nutations * FIRST * 2.0**FINE)
    given = numbers[:count], period[:count] * (nutations / steps), np.tile([steps // 2, steps], (count, 1))
    many = loop.many(*given)
    return lambda: loop.many(*given), float(loop.counts(many.steps, many.work)[0].sum())


def pairs(variant: Integrator) -> dict[tuple[str, float], Pair]:
    """The timed runs of a variant, "alone" and "together", at each tolerance."""
    made = {}
    for kind, call in zip(KINDS, (alone, together), strict=True):
        for tolerance in tolerances_of(variant):
            short, long = (call(variant, tolerance, nutations) for nutations in LENGTHS[kind])
            if short is not None and long is not None:
                made[kind, tolerance] = Pair(short, long)
    return made


def prices(names: Sequence[str], rounds: int, batch: float) -> xr.Dataset:
    """Seconds of a force evaluation: ``alone`` and ``together`` over ``variant``, and ``spread`` of the samples.

    The smallest samples count, and those of every other round by themselves (``alone_half``, ``together_half``): what
    is said of a time must be so in both halves. ``alone_by`` and ``together_by`` have the tolerance ``priced_at`` too,
    ``by_half`` behind it likewise; the others are at `TOLERANCE`. A variant whose tops share no call has the price of
    a run alone in both. The spread is the largest of the long runs.
    """
    each = {(name, *key): pair for name in names for key, pair in pairs(integrator(name)).items()}
    taken = timings([call for pair in each.values() for call, _ in pair], rounds, batch, warm=True)
    slopes = {
        key: pair.slopes(short, long, rounds)
        for (key, pair), short, long in zip(each.items(), taken[::2], taken[1::2], strict=True)
    }
    spreads = {name: max(long.spread for key, long in zip(each, taken[1::2], strict=True) if key[0] == name)
               for name in names}  # fmt: skip
    columns: dict[str, Any] = {"spread": ("variant", [spreads[name] for name in names])}
    for kind in KINDS:
        values = np.array([[_of(slopes, name, kind, tolerance) for tolerance in TOLERANCES] for name in names])
        same = values[:, TOLERANCES.index(TOLERANCE)]
        columns |= {
            kind: ("variant", same[:, 0]),
            f"{kind}_half": (("variant", "half"), same[:, 1:]),
            f"{kind}_by": (("variant", "priced_at"), values[..., 0]),
            f"{kind}_by_half": (("variant", "priced_at", "half"), values[..., 1:]),
        }
    return xr.Dataset(columns, coords={"variant": list(names), "priced_at": list(TOLERANCES)})


def _of(slopes: dict[tuple[str, str, float], Array], name: str, kind: str, tolerance: float) -> Array:
    """Of a variant at a tolerance: of its one tolerance if it has but one, of a run alone if there is no other."""
    there = kind if (name, kind, TOLERANCE) in slopes else "alone"
    return slopes.get((name, there, tolerance), slopes[name, there, TOLERANCE])
