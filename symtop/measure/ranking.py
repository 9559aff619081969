"""Which variant, a method in one chart, is the fastest at an accuracy, and whether its lead is more than noise.

The cost of a target is that of a variant's cheapest timed run that meets it: the smallest of its samples, because noise
only adds. A lead is sure if it would be found again. The last `MOST_ROUNDS` rounds that both variants took part in are
dealt to two halves, and in each half the ratio of the smallest samples is at least a margin (`margin`), which comes
from the noise of the scene's own times. Each variant has met its smallest sample again (`timing.met_again`). And if a
time misses its forecast by more than `MISSED`, the forecast leads too. Otherwise the two are level, unless they are
`FAR` apart: every sample of the one is that many times every sample of the other, whatever rounds they were taken in.

Only variants that take steps are ranked. The closed form is what errors are measured by, and its cost is that of its
constants, whatever the horizon: it stands beside the rankings. A target that is wider than the nutation is not asked.
"""

from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.core.memoize import of_one_dataset
from symtop.measure.settings import TARGETS
from symtop.measure.timing import MISSED, met_again

MARGIN = 1.1  # the least: the same code in another process, elsewhere in memory, differs by some per cent
NEEDS = ("control", "nutation_width", "outcome", "implementation", "seconds", "seconds_samples", "seconds_forecast")
LEAST_ROUNDS, MOST_ROUNDS = 3, 8
FAR = 3.0  # no spell of a machine that is shared by seven processes made a time 2.4 times as long


class Place(NamedTuple):
    """A variant's cheapest run that meets a target."""

    cost: float  # seconds
    integrator: str
    setting: int
    samples: np.ndarray  # seconds, one a round; NaN for a round without it
    forecast: float  # seconds, from the variant's other runs; NaN if there are too few

    @property
    def doubtful(self) -> bool:
        """Does the time miss its forecast, though it was taken again?"""
        return abs(self.cost / self.forecast - 1.0) > MISSED


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


def ranked(data: xr.Dataset) -> list[str]:
    """The variants that take steps."""
    names = data["variant"].values
    control = data["control"].transpose("variant", ...).values.reshape(len(names), -1)
    return [
        str(name)
        for name, known in zip(names, control, strict=True)
        if any(isinstance(one, str) and one for one in known)
    ]


def targets(cell: xr.Dataset) -> list[float]:
    """The targets that are asked on a scene: those below the width of its nutation."""
    width = float(cell["nutation_width"].max())
    return [target for target in TARGETS if target < width]


def cheapest(cell: xr.Dataset, target: float, quantity: str = "axis", implementation: str | None = None) -> list[Place]:
    """The cheapest timed run of each ranked variant that meets a target, cheapest first.

    `cell` is one scene and one horizon of the study's dataset.
    """
    few = cell[[quantity, "seconds", "seconds_forecast", "outcome", "seconds_samples", "implementation"]]
    cell = few.sel(variant=ranked(cell))  # of these alone: a dataset has dozens
    table = cell[[quantity, "seconds", "seconds_forecast", "outcome"]].transpose("variant", "setting")
    seconds, forecast = table["seconds"].values, table["seconds_forecast"].values
    good = (table[quantity].values <= target) & (table["outcome"].values == "ok")
    price = np.where(good & np.isfinite(seconds), seconds, np.inf)
    samples = cell["seconds_samples"].transpose("variant", "setting", "batch").values
    implementations = cell["implementation"].transpose("variant", ...).values.reshape(len(price), -1)[:, 0]
    places = [
        Place(float(price[row, k]), str(name), k, samples[row, k], float(forecast[row, k]))
        for row, (name, k) in enumerate(zip(cell["variant"].values, map(int, price.argmin(axis=1)), strict=True))
        if np.isfinite(price[row, k]) and implementation in (None, str(implementations[row]))
    ]
    return sorted(places, key=lambda place: place[:2])


def margin(cell: xr.Dataset) -> float:
    """The ratio of two times of one scene and horizon from which on it is more than noise.

    Nine of ten times lie closer to what the other times of their variant foretell than some distance; both times of a
    ratio may be off by it. On a quiet machine it is 0.02 to 0.12. With seven busy processes on two cores it is 0.1 to
    1.4, and there a fixed margin of 1.1 called 2 of 7 winners that did not win again.
    """
    miss = np.abs(cell["seconds"].values / cell["seconds_forecast"].values - 1.0)
    miss = miss[np.isfinite(miss)]
    return max(MARGIN, 1.0 + 2.0 * float(np.quantile(miss, 0.9))) if miss.size else MARGIN


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
    slowest = max(first.cost, first.forecast) if first.doubtful else first.cost
    soonest = min(second.cost, second.forecast) if second.doubtful else second.cost
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
        asked = targets(cell)
        for number, target in enumerate(TARGETS):
            if target not in asked:
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
