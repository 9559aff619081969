"""From a ladder of runs to the cost of a target, and from costs to winners with intervals: arithmetic on arrays alone.

    cost       log-log interpolation between the last miss (E1, e1) and the first hit (E2, e2) behind it:
               log E = log E1 + (log E2 - log E1) log(e1/target)/log(e1/e2)
    slowdown   cost over the least cost of any variant on the same top
    wins       the share of tops, of those that some variant solves, on which all others cost at least `TIE` times as
               much; on other tops the variants within `TIE` of the least are level
    safe       the cost at the one setting with which `SAFE` of the tops meet the error

A hit that a finer setting misses does not count. Intervals are for the draw of the tops and for the prices: a bootstrap
draws tops with replacement, the same for all variants, and each variant's price from a log-normal distribution of its
relative error. Of a safe cost the tops decide the setting; the work at it is that of the median top, which is not drawn
again. One more top, of which nothing is known, is drawn with the n that were run: any variant may win it, and
no setting serves it. So a share of 1 has an interval, and neither a lead on a few tops nor the upper end of a safe cost
from fewer than some 70 tops is certain. A lead is called if `SURE` of the draws have it. Sources: Efron and Tibshirani,
An Introduction to the Bootstrap (1993); run-length distributions: Hoos and Stuetzle, J. Autom. Reasoning 24
(2000) 421.
"""

import functools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from symtop.model.charts import Array

TIE = 1.1  # costs of a ratio below this are level
SAFE = 0.95  # share of the tops that a safe setting serves
DRAWS = 200  # of the bootstrap
SURE = 0.995  # a lead is called if at least this share of the draws has it
ENDS = (0.025, 0.975)  # quantiles at the ends of an interval
CLOSE = 2.0  # a variant that costs at least this many times the least on every top wins in no draw


def cost_to_reach(work: Array, errors: Array, targets: Sequence[float]) -> Array:
    """Work (targets, n) that reaches each target, inf where none of the runs does.

    `work` and `errors` are (settings, n), coarse to fine; NaN where a member was not run. A failed run has an infinite
    error. Where the coarsest run meets the target, its work is returned. `work` may be any number of a setting.
    """
    ran = np.isfinite(work)
    last = ran.sum(axis=0) - 1
    members, costs = np.arange(work.shape[1]), np.full((len(targets), work.shape[1]), np.inf)
    levels = np.arange(len(work))[:, np.newaxis]
    for place, target in enumerate(targets):
        missed = np.where(ran & ~(errors <= target), levels, -1).max(axis=0)
        first = np.minimum(missed + 1, np.maximum(last, 0))
        fine, coarse = work[first, members], work[missed, members]
        low, high = np.maximum(errors[first, members], 1e-300), errors[missed, members]
        with np.errstate(all="ignore"):
            part = np.log(high / target) / np.log(high / low)
            between = coarse * (fine / coarse) ** part
        smooth = (missed >= 0) & np.isfinite(high) & np.isfinite(between)
        costs[place] = np.where(missed < last, np.where(smooth, between, fine), np.inf)
    return costs


def wins(costs: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """For costs (variants, n): where a variant wins without a tie, and where it wins or is level with the cheapest."""
    with np.errstate(invalid="ignore"):
        level = costs < TIE * np.min(costs, axis=0, initial=np.inf)
    return level & (level.sum(axis=0) == 1), level


def slowdowns(costs: Array) -> Array:
    """Costs (variants, n) over the least on each top; NaN where no variant reaches it."""
    best = np.min(costs, axis=0, initial=np.inf)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(np.isfinite(best), costs / best, np.nan))


def run_lengths(costs: Array, budgets: Array) -> Array:
    """The share of tops solved within each budget: an empirical distribution, NaN costs (not asked) left out."""
    known = np.sort(costs[~np.isnan(costs)])
    return np.searchsorted(known, budgets, side="right") / max(known.size, 1)


def factors(errors: Array, draws: int = DRAWS) -> Array:
    """Price factors (draws, variants) of relative standard errors (variants,); the same for the same errors."""
    normal = np.random.default_rng(1).standard_normal((draws, errors.size))
    return np.asarray(np.exp(errors * normal))


@functools.cache
def bootstrap_counts(n: int) -> NDArray[np.int64]:
    """How often each of n tops is drawn, and, in the last place, the unknown one, (`DRAWS`, n + 1)."""
    return np.random.default_rng(2).multinomial(n + 1, np.full(n + 1, 1.0 / (n + 1)), size=DRAWS)


class Standing(NamedTuple):
    """The result of a variant in a cell, in hindsight: with the best setting for each top."""

    name: str
    share: float  # of wins, of the tops that a variant solves
    low: float
    high: float
    level: float  # share of tops on which it wins or is level
    met: float  # share of all tops on which it meets the error


class Contest(NamedTuple):
    """A cell: the standings, the one with the most wins first, and whether the lead of the first is called."""

    standings: list[Standing]
    called: bool
    tops: int
    solved: int

    @property
    def first(self) -> Standing | None:
        """The variant with the most wins, if any is level with the cheapest anywhere."""
        return self.standings[0] if self.standings and self.solved else None


def hindsight(names: Sequence[str], costs: Array, errors: Array, marked: Sequence[str] = ()) -> Contest:
    """The contest of variants with costs (variants, n) and relative errors of their prices (variants,).

    Where two have as many wins, that with more ties is first. Marked variants stay in the count of others' wins, and
    a cell that one of them leads has no called winner.
    """
    n = costs.shape[1] if costs.size else 0
    solved = np.isfinite(costs).any(axis=0) if n else np.zeros(0, bool)
    if not solved.any():
        return Contest([], False, n, 0)
    ratio = slowdowns(costs[:, solved])
    won, level = wins(ratio)
    near = np.flatnonzero((ratio < CLOSE).any(axis=1))
    weights, total = bootstrap_counts(int(solved.sum())), solved.sum() + 1
    lucky = np.random.default_rng(3).integers(len(names), size=DRAWS)
    shares = np.zeros((DRAWS, len(names)))
    for draw, factor in enumerate(factors(errors)):
        wins_, _ = wins(ratio[near] * factor[near, np.newaxis])
        shares[draw, near] = wins_ @ weights[draw, :-1] / total
        shares[draw, lucky[draw]] += weights[draw, -1] / total
    middle, half = won.mean(axis=1), level.mean(axis=1)
    low, high = np.quantile(shares, ENDS, axis=0)
    order = np.lexsort((-half, -middle))
    first = order[0]
    rivals = np.delete(shares, first, axis=1).max(axis=1, initial=0.0)
    called = bool(middle[first] > 0.0 and np.mean(shares[:, first] > rivals) >= SURE and names[first] not in marked)
    met = np.isfinite(costs).mean(axis=1)
    standings = [Standing(names[k], *(float(part[k]) for part in (middle, low, high, half, met))) for k in order]
    return Contest(standings, called, n, int(solved.sum()))


class Ladder(NamedTuple):
    """The input of a safe choice, of one variant: by top the setting that meets the error, by setting the seconds."""

    name: str
    met_at: Array  # (n,) steps a nutation or tolerance, inf or NaN where the error is not met
    settings: Array  # (levels,)
    seconds: Array  # (levels,) of a run of the typical top
    fixed: bool
    error: float  # of the price, relative


class Safe(NamedTuple):
    """The one setting with which `SAFE` of the tops meet the error, and its cost with an interval."""

    name: str
    setting: float  # inf where it is not met within the budget
    seconds: float
    low: float
    high: float


def _rank(n: int) -> int:
    """The least number of n that is at least `SAFE` of them."""
    return math.ceil(SAFE * n - 1e-9)


def safe(ladders: Sequence[Ladder], marked: Sequence[str] = ()) -> tuple[list[Safe], bool]:
    """The safe choices of all variants, cheapest first, and whether the lead of the first is called."""
    factor = factors(np.array([ladder.error for ladder in ladders]))
    choices, draws = [], []
    for ladder, prices in zip(ladders, factor.T, strict=True):
        fine = np.log(np.where(ladder.met_at > 0.0, ladder.met_at, np.inf)) * (1.0 if ladder.fixed else -1.0)
        fine = np.where(np.isfinite(ladder.met_at) & (ladder.met_at > 0.0), fine, np.inf)
        by_setting, n = np.argsort(fine), fine.size
        many = bootstrap_counts(n)[:, np.append(by_setting, n)].cumsum(axis=1) >= _rank(n + 1)
        fine = np.append(fine[by_setting], np.inf)
        chosen = np.append(fine[max(_rank(n), 1) - 1], fine[many.argmax(axis=1)])
        known = np.isfinite(ladder.seconds) & np.isfinite(ladder.settings)
        x = np.log(ladder.settings[known]) * (1.0 if ladder.fixed else -1.0)
        costs = np.full(len(chosen), np.inf)
        if known.any():
            within = np.isfinite(chosen) & (chosen <= x[-1] + 1e-9)
            costs[within] = np.exp(np.interp(np.asarray(chosen)[within], x, np.log(ladder.seconds[known])))
        sample = costs[1:] * prices
        setting = math.exp(chosen[0] if ladder.fixed else -chosen[0]) if np.isfinite(costs[0]) else math.inf
        ends = np.quantile(sample, ENDS, method="nearest")
        choices.append(Safe(ladder.name, setting, float(costs[0]), float(ends[0]), float(ends[1])))
        draws.append(sample)
    order = sorted(range(len(choices)), key=lambda place: choices[place].seconds)
    if not order or not math.isfinite(choices[order[0]].seconds):
        return [choices[place] for place in order], False
    table = np.array(draws)
    others = np.delete(table, order[0], axis=0).min(axis=0, initial=np.inf)
    called = bool(np.mean(table[order[0]] < others) >= SURE and choices[order[0]].name not in marked)
    return [choices[place] for place in order], called
