"""Times of a force evaluation and of a call, measured in five fresh processes, and their errors.

The study counts force evaluations, because a count is the same on every machine. Seconds are

    seconds of a run = evaluations x price + call
    price = (seconds of a long run - of a short one) / (evaluations of the long - of the short)
    call = seconds of the short run - its evaluations x price

of bare runs of one ordinary top that stays `CLEAR` of the poles, by the smallest of a few samples in interleaved
rounds. The arithmetic of a step does not depend on the top, but for the iterations of implicit methods, which are
counted. It depends on the tolerance where the order does: such variants have a price at each of `TOLERANCES`.

A price also depends on the process (where its memory and code lie) and on what else the machine does. So each of
`PROCESSES` interpreters that are started for it times every variant; a process that is slower at everything is divided
by its common factor, the median of all its ratios; the price is the median over processes. The smallest of several
slopes would be an outlier: a short run that was disturbed makes a slope too small. A slope below `FLOOR` is rejected.

    spread   half the sample (25 to 75 %) over the median
    error    standard error of a median over n processes, 1.25 s/sqrt(n), times Student's 2.78/1.96 for five; s from the
             quartiles, at least `GRAIN`

Variants with a spread above `NOISY`, or with fewer than `ENOUGH` slopes, are timed by five more processes, with
some that are not noisy; the five processes with the smaller spread count. One that is still noisy is marked, and no
lead of it is called.

heyoka is timed as its own `propagate_until`, with nothing of symtop around it. The solver of `taylor[axis]`, which
samples by dense output, is timed in the same rounds, and the ratio is a table.
"""

import functools
import warnings
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import xarray as xr
from symtop_studies import fresh_process
from symtop_studies.memoize import of_one_dataset

from symtop.measure.timing import timings
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import Integrator, integrator
from symtop.model.body import Attitude, RigidBody
from symtop.model.charts import BODY, Array
from symtop.model.exact.closed_form import ClosedForms
from symtop.model.scenes import body_scenes
from symtop.model.top import NUMBERS, Angles, SymmetricTop
from symtop.run.ensemble.population import population

from .tops import FIRST

PROCESSES = 5
ENOUGH = 3  # of them; a quick pass starts no more
COMPANY = 8  # least number of variants for a common factor of a process; with fewer it would hide their own noise
BATCHES = "first", "again"  # of processes: those that time every variant, and those that time the noisy ones again
FINE = 5  # FIRST 2^FINE steps a nutation
TOLERANCES = tuple(10.0**-decade for decade in range(2, 16, 2))
TOLERANCE = 1e-8  # at which variants are timed whose order does not depend on it
KIND, CLEAR = "slow", 0.3  # rad between a pole and the axis of the top that is timed
DRAWN = 64  # tops that it is chosen from
LENGTHS = (0.1, 50.0)  # nutations of the short run, whose time is nearly all that of the call, and of the long one
FLOOR = 1e-9  # seconds: the dozen multiplications of two cross products take as long at four a cycle
NOISY = 0.10
GRAIN = 0.04  # relative: two runs, on an idle and on a busy machine, differ by that even if their processes agree
OUTER = 0.99  # standard deviations between the quartiles of five numbers, on average; of very many it would be 1.35
MEDIAN, STUDENT = 1.25, 2.78 / 1.96
HEYOKA, SAMPLED = "taylor[axis]", "with dense output"
Call = tuple[Callable[[], object], float]  # with its number of force evaluations


@functools.cache
def timed_top() -> tuple[SymmetricTop, Angles, float]:
    """The top that is timed, its start and its nutation period."""
    members = population(DRAWN, seed=0, kind=KIND)
    numbers = np.stack([members[name].values for name in NUMBERS], axis=1)
    forms = ClosedForms(numbers)
    low, high = forms.theta_range.T
    chosen = int(np.flatnonzero((low > CLEAR) & (high < np.pi - CLEAR))[0])
    top, start = SymmetricTop(*numbers[chosen, :3].tolist()), Angles(*numbers[chosen, 3:].tolist())
    return top, start, float(forms.nutation_period[chosen])


@functools.cache
def timed_body() -> tuple[RigidBody, Attitude, float]:
    """The body without symmetry that is timed, its start and its natural period."""
    scene = body_scenes()["heavy-brick"]
    return scene.top, scene.start, scene.time_scale()


def tolerances_of(variant: Integrator) -> tuple[float, ...]:
    """The tolerances at which a variant is timed; one where its price does not depend on it."""
    return TOLERANCES if not variant.fixed_step and variant.order is None else (TOLERANCE,)


def run_of(variant: Integrator, tolerance: float, nutations: float, *, own: bool = True) -> Call:
    """The bare run of the top over so many nutations, of heyoka by its `own` loop."""
    ((chart, solver),) = variant.solvers.items()
    top, start, period = timed_body() if chart == BODY else timed_top()
    steps = max(round(nutations * FIRST * 2.0**FINE), 2)
    plan = Plan.steps(period * (nutations / steps), np.array([steps // 2, steps]))
    if not variant.fixed_step:
        plan = Plan.until(np.array([0.5, 1.0]) * nutations * period, tolerance)
    if own and hasattr(solver, "bare"):
        run, evaluations = solver.bare(top, start, plan)
        return run, float(evaluations)
    return lambda: solver(top, start, plan), float(solver(top, start, plan).force_evaluations)


def slopes(names: list[str], rounds: int, batch: float) -> list[tuple[str, float, float, float]]:
    """In this process: price and call of each variant at each of its tolerances, as (name, tolerance, price, call)."""
    makers = {(name, tolerance): functools.partial(run_of, integrator(name), tolerance)
              for name in names for tolerance in tolerances_of(integrator(name))}  # fmt: skip
    if HEYOKA in names:
        makers[SAMPLED, TOLERANCE] = functools.partial(run_of, integrator(HEYOKA), TOLERANCE, own=False)
    runs = {key: [make(nutations) for nutations in LENGTHS] for key, make in makers.items()}
    times = timings([call for pair in runs.values() for call, _ in pair], rounds, batch, warm=True)
    rows = []
    for (key, ((_, n_short), (_, n_long))), short, long in zip(runs.items(), times[::2], times[1::2], strict=True):
        if n_long > n_short:  # a run that fails early has no slope
            price = (long.best - short.best) / (n_long - n_short)
            rows.append((*key, price, short.best - n_short * price))
    return rows


def measured(names: list[str], rounds: int, batch: float) -> xr.Dataset:
    """Prices and calls that one fresh process measures: ``price``, ``call`` over ``variant`` and ``priced_at``.

    ``sampled`` is the price of `taylor[axis]` with dense output.
    """
    price, call = (np.full((len(names), len(TOLERANCES)), np.nan) for _ in range(2))
    sampled = np.full(len(names), np.nan)
    for name, tolerance, slope, intercept in fresh_process.call(slopes, names, rounds, batch):
        if name == SAMPLED:
            sampled[names.index(HEYOKA)] = slope
            continue
        column = TOLERANCES.index(tolerance) if len(tolerances_of(integrator(name))) > 1 else slice(None)
        price[names.index(name), column], call[names.index(name), column] = slope, max(intercept, 0.0)
    data = {"price": (("variant", "priced_at"), price), "call": (("variant", "priced_at"), call)}
    return xr.Dataset(data | {"sampled": ("variant", sampled)}, {"variant": names, "priced_at": list(TOLERANCES)})


class Prices(NamedTuple):
    """Prices of variants: medians over processes, with their errors."""

    names: list[str]
    price: Array  # (variants, tolerances), seconds of an evaluation
    call: Array  # (variants, tolerances), seconds
    error: Array  # (variants,) relative standard error
    spread: Array  # (variants,)
    marked: list[str]  # too noisy to be ranked
    sampled: float  # price of `taylor[axis]` with dense output over that of heyoka by itself, median of the processes

    def at(self, name: str, tolerances: Array) -> tuple[Array, Array]:
        """Price and call at each tolerance, interpolated in logarithms; NaN is a variant with a step."""
        row, x = self.names.index(name), -np.log(TOLERANCES)
        u = np.where(np.isfinite(tolerances), -np.log(np.where(tolerances > 0.0, tolerances, 1.0)), x[-1])
        known = np.isfinite(self.price[row])  # of a run that fails at a loose tolerance there is none
        if not known.any():
            return np.full(u.shape, np.nan), np.full(u.shape, np.nan)
        price = np.exp(np.interp(u, x[known], np.log(self.price[row, known])))
        return price, np.interp(u, x[known], self.call[row, known])


def quartile_spread(samples: Array, axis: int = -1) -> Array:
    """The distance of the quartiles over the median along an axis, of the samples that are not NaN."""
    low, middle, high = np.nanquantile(samples, (0.25, 0.5, 0.75), axis=axis)
    return np.asarray((high - low) / middle)


def spread_of(values: Array) -> Array:
    """The distance of the quartiles over the median, along the first axis; infinite where too few are left."""
    return np.where(np.isfinite(values).sum(axis=0) >= ENOUGH, quartile_spread(values, axis=0), np.inf)


def combined(price: Array, call: Array) -> tuple[Array, Array, Array, Array]:
    """Prices, calls, relative errors and spreads (variants, tolerances), from (processes, variants, tolerances)."""
    good = np.where(price >= FLOOR, price, np.nan)
    with np.errstate(all="ignore"), warnings.catch_warnings(action="ignore"):  # on variants that a batch has not timed
        middle = np.nanmedian(good, axis=0)
        common = np.nanmedian(good / middle, axis=(1, 2), keepdims=True)  # of a process that is slower at everything
        if np.isfinite(middle).any(axis=1).sum() < COMPANY:
            common = np.ones_like(common)
        level = good / common
        spread = spread_of(level)
        count = np.maximum(np.isfinite(level).sum(axis=0), 1)
        error = MEDIAN * STUDENT * np.maximum(spread / OUTER, GRAIN) / np.sqrt(count)
        return np.nanmedian(level, axis=0), np.nanmedian(call / common, axis=0), error, spread


def quiet_median(values: Array) -> Array:
    """The median over the tolerances that were timed; infinite where none was."""
    return np.array([np.median(row[np.isfinite(row)]) if np.isfinite(row).any() else np.inf for row in values])


@of_one_dataset
def prices(data: xr.DataTree) -> Prices:
    """The prices of a dataset: for each variant those of the five processes with the smaller spread."""
    group = data["prices"].to_dataset().transpose("scene", "variant", "priced_at")
    names = [str(name) for name in group["variant"].values]
    of_batch = [str(name).partition("-")[0] for name in group["scene"].values]
    places = [[k for k, name in enumerate(of_batch) if name == batch] for batch in BATCHES]
    batches = [group.isel(scene=chosen) for chosen in places if chosen]
    results = [combined(batch["price"].values, batch["call"].values) for batch in batches]
    spreads = np.stack([quiet_median(spread) for *_, spread in results])  # (batches, variants)
    best = np.argmin(spreads, axis=0)

    def chosen(parts: list[Array]) -> Array:
        return np.stack([parts[batch][row] for row, batch in enumerate(best)])

    price, error = chosen([middle for middle, *_ in results]), chosen([quiet_median(error) for *_, error, _ in results])
    call = chosen([call for _, call, *_ in results])
    with np.errstate(all="ignore"):
        ratio = group["sampled"].values / group["price"].sel(priced_at=TOLERANCE, method="nearest").values
    spread = np.array([spreads[batch, row] for row, batch in enumerate(best)])
    marked = [name for name, value in zip(names, spread, strict=True) if not value <= NOISY]
    return Prices(names, price, call, np.minimum(error, 1.0), spread, marked,
                  float(np.nanmedian(ratio)) if np.isfinite(ratio).any() else np.nan)  # fmt: skip
