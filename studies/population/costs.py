"""From a ladder of runs to the cost of a target, and from costs to shares of tops: arithmetic on arrays alone.

    cost       log-log interpolation between the last miss (E1, e1) and the first hit (E2, e2) behind it:
               log E = log E1 + (log E2 - log E1) log(e1/target)/log(e1/e2)
    slowdown   cost over the least cost of any variant on the same top
    share      k of n with Wilson's interval: (p + z^2/2n +- z sqrt(p (1-p)/n + z^2/4n^2)) / (1 + z^2/n)

A hit that a finer setting misses is luck and no hit. A variant wins on a top if every other variant costs at least
`TIE` times as much; within that it is level with the cheapest. A cell's winner is sure if its share of wins is ahead
of the next by `Z` standard errors of the difference, which for shares of one sample is sqrt((p + q - (p - q)^2)/n).
Source: Wilson, J. Am. Stat. Assoc. 22 (1927) 209; run-length distributions: Hoos and Stuetzle, J. Autom. Reasoning 24
(2000) 421.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from symtop.model.charts import Array

TIE = 1.1  # costs of a ratio below this are level
Z = 3.0  # standard errors: one winner in 400 that chance alone makes
CENTRAL = (0.1, 0.5, 0.9)  # quantiles that tables give


def cost_to_reach(work: Array, errors: Array, targets: Sequence[float]) -> Array:
    """Work (targets, n) that reaches each target, inf where none of the runs does.

    `work` and `errors` are (settings, n), coarse to fine; NaN where a member was not run. A failed run has an infinite
    error. Where the coarsest run meets the target, its work is the answer.
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


def slowdowns(costs: Array) -> Array:
    """Costs (variants, n) over the least on each top; NaN where no variant reaches it."""
    best = np.min(costs, axis=0, initial=np.inf)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(np.isfinite(best), costs / best, np.nan))


def quantiles(values: Array) -> tuple[float, float, float]:
    """The `CENTRAL` quantiles of numbers that may be infinite; NaN is left out. The nearest value is taken."""
    there = np.sort(values[~np.isnan(values)])
    if not there.size:
        return math.nan, math.nan, math.nan
    low, middle, high = (float(there[min(int(q * there.size), there.size - 1)]) for q in CENTRAL)
    return low, middle, high


class Share(NamedTuple):
    """k of n, with Wilson's 95 % interval."""

    count: int
    total: int

    @property
    def value(self) -> float:
        """k/n."""
        return self.count / self.total if self.total else math.nan

    def interval(self, z: float = 1.96) -> tuple[float, float]:
        """Wilson's interval at z standard errors."""
        n, p = self.total, self.value
        if not n:
            return 0.0, 1.0
        middle, spread = p + z * z / (2 * n), z * math.sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n))
        return max(0.0, (middle - spread) / (1.0 + z * z / n)), min(1.0, (middle + spread) / (1.0 + z * z / n))


def wins(costs: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Of costs (variants, n): where a variant wins beyond ties, and where it is level with the cheapest or wins."""
    with np.errstate(invalid="ignore"):
        level = costs < TIE * np.min(costs, axis=0, initial=np.inf)
    return level & (level.sum(axis=0) == 1), level


class Winner(NamedTuple):
    """The variant with the most wins of a cell, and the next."""

    row: int
    share: Share
    next_variant: int
    next_share: Share
    steady: bool = True  # is it also the winner if times are measured again?

    @property
    def sure(self) -> bool:
        """Is the lead more than chance?"""
        p, q, n = self.share.value, self.next_share.value, self.share.total
        return self.steady and n > 0 and p - q > Z * math.sqrt(max(p + q - (p - q) ** 2, 1.0 / n) / n)


def winner(costs: Array) -> Winner | None:
    """The winner of costs (variants, n) over the tops that some variant solves; None if there are none."""
    solved = np.isfinite(costs).any(axis=0)
    if not solved.any() or len(costs) < 2:
        return None
    won, level = (part[:, solved] for part in wins(costs))
    order = np.lexsort((-level.sum(axis=1), -won.sum(axis=1)))
    total = int(solved.sum())
    first, second = int(order[0]), int(order[1])
    return Winner(first, Share(int(won[first].sum()), total), second, Share(int(won[second].sum()), total))


def run_lengths(costs: Array, budgets: Array) -> Array:
    """The share of tops solved within each budget: an empirical distribution, NaN costs (not asked) left out."""
    asked = np.sort(costs[~np.isnan(costs)])
    return np.searchsorted(asked, budgets, side="right") / max(asked.size, 1)


class Detection(NamedTuple):
    """Hits and false alarms of a score, from the highest threshold to the lowest, and the area below the curve."""

    hits: Array
    alarms: Array
    area: float


def detection(score: Array, wrong: NDArray[np.bool_]) -> Detection:
    """How well a score tells wrong runs from right ones: the receiver operating characteristic.

    Runs of equal score are taken together, so that ties count half in the area.
    """
    score = np.minimum(score, 1e300)
    order = np.argsort(-score, kind="stable")
    ends = np.append(np.flatnonzero(np.diff(score[order]) != 0.0), score.size - 1) if score.size else np.array([], int)
    hits = np.append(0.0, np.cumsum(wrong[order])[ends]) / max(int(wrong.sum()), 1)
    alarms = np.append(0.0, np.cumsum(~wrong[order])[ends]) / max(int((~wrong).sum()), 1)
    area = float(np.sum(np.diff(alarms) * 0.5 * (hits[1:] + hits[:-1])))
    return Detection(hits, alarms, area if wrong.any() and not wrong.all() else math.nan)
