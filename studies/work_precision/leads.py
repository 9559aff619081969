"""Which variant is the fastest at an accuracy, and whether its lead is more than noise.

The cost of a target is that of a variant's cheapest timed run that meets it (`symtop.measure.ranking.cheapest`). A lead
is sure if it would be found again. The last `MOST_ROUNDS` rounds that both variants took part in are dealt to two
halves, and in each half the ratio of the smallest samples is at least a margin (`margin`), which comes from the noise
of the scene's own times. Each variant has met its smallest sample again (`met_again`). And if a time misses its
forecast by more than `MISSED`, the forecast leads too. Otherwise the two are level, unless they are `FAR` apart: every
sample of the one is that many times every sample of the other, whatever rounds they were taken in.

A target that is wider than the nutation is not asked.
"""

from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from symtop_studies.memoize import of_one_dataset

from symtop.measure.ranking import NEEDS, Place, cheapest, ranked
from symtop.measure.settings import TARGETS

MARGIN = 1.1  # the least: the same code in another process, elsewhere in memory, differs by some per cent
LEAST_ROUNDS, MOST_ROUNDS = 3, 8
FAR = 3.0  # no spell of a machine that is shared by seven processes made a time 2.4 times as long
AGAIN = 0.1  # a smallest sample that no other comes so close to may be an accident
MISSED = 0.25  # relative miss of a forecast beyond which a time is taken again


class Lead(NamedTuple):
    """How far the first of two is ahead, second time over first, and whether that is more than noise."""

    ratio: float
    sure: bool


class Win(NamedTuple):
    """The fastest variant at one target, those that are level with it, and the lead over the first behind them."""

    best: Place
    level: tuple[str, ...]
    behind: Place | None
    ratio: float  # of the times, `behind` over `best`; NaN if nothing is behind


def targets(cell: xr.Dataset) -> list[float]:
    """The targets that are asked on a scene: those below the width of its nutation."""
    width = float(cell["nutation_width"].max())
    return [target for target in TARGETS if target < width]


def met_again(samples: ArrayLike) -> bool:
    """Does another sample come to within `AGAIN` of the smallest? NaN is no sample."""
    least = np.sort(np.asarray(samples, dtype=float), axis=None)[:2]  # NaN comes last
    return bool(least.size == 2 and least[1] <= (1.0 + AGAIN) * least[0])


def margin(cell: xr.Dataset) -> float:
    """The ratio of two times of one scene and horizon from which on it is more than noise.

    Nine of ten times lie closer to what the other times of their variant foretell than some distance; both times of a
    ratio may be off by it. On a quiet machine it is 0.02 to 0.12. With seven busy processes on two cores it is 0.1 to
    1.4, and there a fixed margin of 1.1 called 2 of 7 winners that did not win again.
    """
    miss = np.abs(cell["seconds"].values / cell["seconds_forecast"].values - 1.0)
    miss = miss[np.isfinite(miss)]
    return max(MARGIN, 1.0 + 2.0 * float(np.quantile(miss, 0.9))) if miss.size else MARGIN


def missed(place: Place) -> bool:
    """Does the time miss its forecast, though it was taken again?"""
    return abs(place.cost / place.forecast - 1.0) > MISSED


def lead(first: Place, second: Place, least: float = MARGIN) -> Lead:
    """By how much the first place is ahead of the second, and whether that is sure.

    It is not if a ratio is less than `least` or there are fewer than `LEAST_ROUNDS` common rounds, but for two that are
    `FAR` apart in every sample.
    """
    both = np.flatnonzero(np.isfinite(first.samples) & np.isfinite(second.samples))[-MOST_ROUNDS:]
    ratio = second.cost / first.cost
    slow, fast = (place.samples[np.isfinite(place.samples)] for place in (second, first))
    if fast.size >= LEAST_ROUNDS and slow.size > 1 and slow.min() >= max(FAR, least) * fast.max():
        return Lead(ratio, True)
    if both.size < LEAST_ROUNDS:
        return Lead(ratio, False)
    slowest = max(first.cost, first.forecast) if missed(first) else first.cost
    soonest = min(second.cost, second.forecast) if missed(second) else second.cost
    halves = [second.samples[half].min() / first.samples[half].min() for half in (both[::2], both[1::2])]
    steady = all(met_again(place.samples) for place in (first, second))
    return Lead(ratio, bool(steady and min(*halves, soonest / slowest) >= least))


def win(cell: xr.Dataset, target: float, implementation: str = "compiled") -> Win | None:
    """The fastest compiled (or plain Python) variant at a target, or None if none met it."""
    places = cheapest(cell, target, implementation=implementation)
    if not places:
        return None
    best, *others = places
    least = margin(cell)
    leads = [(other, lead(best, other, least)) for other in others]
    level = tuple(other.integrator for other, ahead in leads if not ahead.sure)
    behind, ratio = next(((other, ahead.ratio) for other, ahead in leads if ahead.sure), (None, np.nan))
    return Win(best, level, behind, ratio)


@of_one_dataset
def winners(data: xr.Dataset) -> dict[tuple[str, int, float], Win | None]:
    """The compiled winners in axis error of every scene, horizon (by index) and target that is asked there."""
    data = data[["axis", *NEEDS]]
    return {
        (str(scene), far, target): win(data.sel(scene=scene).isel(horizon=far), target)
        for scene in data["scene"].values
        for far in range(data.sizes["horizon"])
        for target in targets(data.sel(scene=scene))
    }


def relative_costs(data: xr.Dataset, among: list[str]) -> xr.DataArray:
    """Seconds of every ranked variant's cheapest run to each target, over the least that any variant of `among` needs.

    Dimensions target, variant, problem; a problem is a scene with a horizon. Infinite where a variant does not meet the
    target, or none of `among` does; NaN where the target is not asked.
    """
    names, data = ranked(data), data[["axis", *NEEDS]]
    problems = [data.sel(scene=scene).isel(horizon=far)
                for scene in data["scene"].values for far in range(data.sizes["horizon"])]  # fmt: skip
    table = np.full((len(TARGETS), len(names), len(problems)), np.inf)
    for k, cell in enumerate(problems):
        meaningful = targets(cell)
        for number, target in enumerate(TARGETS):
            if target not in meaningful:
                table[number, :, k] = np.nan
                continue
            for place in cheapest(cell, target):
                table[number, names.index(place.integrator), k] = place.cost
    costs = xr.DataArray(table, {"target": list(TARGETS), "variant": names}, ("target", "variant", "problem"))
    best = costs.sel(variant=among).min("variant")
    return (costs / best.where(np.isfinite(best))).fillna(np.inf).where(costs.notnull())


def leaders(ratios: xr.DataArray, count: int) -> list[str]:
    """The variants that meet the targets on the most problems, and of these first those that come closest to the best.

    How close a variant comes is the mean of 1/ratio over problems and targets.
    """
    met = np.isfinite(ratios.transpose("variant", ...).values).reshape(ratios.sizes["variant"], -1).sum(axis=1)
    merit = (1.0 / ratios).mean(("target", "problem")).values
    order = np.lexsort((-merit, -met))
    return [str(ratios["variant"].values[k]) for k in order[:count] if met[k] > 0]
