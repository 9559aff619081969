"""Which method is the fastest at an accuracy, and whether its lead is more than noise.

The cost of a target is that of a method's cheapest timed run that meets it. Samples of one round were taken within
seconds of each other, so that a slow spell of the machine hits both of two methods: they are compared by the ratios of
their samples round by round, over the last `MOST_ROUNDS` rounds that both took part in. A lead is sure if both methods'
samples are steady (see `timing`), every round agrees on it, and both its median and the ratio of the smallest samples
are at least `MARGIN`, because the same code in another process, elsewhere in memory, may differ by some per cent;
otherwise the two are level.
"""

from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.measure.timing import NOISY
from symtop.measure.work import TARGETS

MARGIN = 1.1
LEAST_ROUNDS, MOST_ROUNDS = 3, 5


class Place(NamedTuple):
    """A method's cheapest run that meets a target."""

    cost: float  # seconds
    integrator: str
    setting: int
    samples: np.ndarray  # seconds, one a round; NaN for a round without it


class Lead(NamedTuple):
    """How far the first of two is ahead: the median of the paired ratios, and whether that is more than noise."""

    ratio: float
    sure: bool


class Win(NamedTuple):
    """The fastest method at one target, the methods that are level with it, and the lead over the first behind them."""

    best: Place
    level: tuple[str, ...]
    behind: Place | None
    ratio: float  # of the times, `behind` over `best`; NaN if nothing is behind


def cheapest(cell: xr.Dataset, target: float, quantity: str = "axis", implementation: str | None = None) -> list[Place]:
    """The cheapest timed run of each method that meets a target, cheapest first.

    `cell` is one scene and one horizon of the study's dataset.
    """
    table = cell[[quantity, "seconds", "outcome"]].transpose("integrator", "setting")
    seconds = table["seconds"].values
    good = (table[quantity].values <= target) & (table["outcome"].values == "ok")
    price = np.where(good & np.isfinite(seconds), seconds, np.inf)
    samples = cell["seconds_samples"].transpose("integrator", "setting", "batch").values
    implementations = cell["implementation"].transpose("integrator", ...).values.reshape(len(price), -1)[:, 0]
    places = [
        Place(float(price[row, k]), str(name), k, samples[row, k])
        for row, (name, k) in enumerate(zip(cell["integrator"].values, map(int, price.argmin(axis=1)), strict=True))
        if np.isfinite(price[row, k]) and implementation in (None, str(implementations[row]))
    ]
    return sorted(places, key=lambda place: place[:2])


def lead(first: Place, second: Place) -> Lead:
    """By how much the first place is ahead of the second; never sure over fewer than `LEAST_ROUNDS` common rounds."""
    both = np.flatnonzero(np.isfinite(first.samples) & np.isfinite(second.samples))[-MOST_ROUNDS:]
    ratio = second.cost / first.cost
    if both.size < LEAST_ROUNDS:
        return Lead(ratio, False)
    ours, theirs = first.samples[both], second.samples[both]
    middle = float(np.median(theirs / ours))
    steady = all(np.median(row) < (1.0 + NOISY) * row.min() for row in (ours, theirs))
    return Lead(middle, bool(steady and (theirs > ours).all() and min(middle, ratio) >= MARGIN))


def win(cell: xr.Dataset, target: float, implementation: str = "compiled", without: tuple[str, ...] = ()) -> Win | None:
    """The fastest compiled (or plain Python) method at a target, or None if none met it."""
    places = [
        place for place in cheapest(cell, target, implementation=implementation) if place.integrator not in without
    ]
    if not places:
        return None
    best, *others = places
    leads = [(other, lead(best, other)) for other in others]
    level = tuple(other.integrator for other, ahead in leads if not ahead.sure)
    behind, ratio = next(((other, ahead.ratio) for other, ahead in leads if ahead.sure), (None, np.nan))
    return Win(best, level, behind, ratio)


def winners(data: xr.Dataset) -> dict[tuple[str, int, float], Win | None]:
    """The compiled winners in axis error of every scene, horizon (by index) and target."""
    return {
        (str(scene), far, target): win(data.sel(scene=scene).isel(horizon=far), target)
        for scene in data["scene"].values
        for far in range(data.sizes["horizon"])
        for target in TARGETS
    }


def counted(data: xr.Dataset) -> tuple[xr.Dataset, list[str]]:
    """The scenes that may be counted, and the names of those left out: those without a nutation.

    A steady precession starts in a fixed point of several maps, which then have no error at any step: their wins there
    say nothing about any other motion. If there are no other scenes, nothing is left out.
    """
    nutating = {str(name): bool(data["nutation_lag"].sel(scene=name).notnull().any()) for name in data["scene"].values}
    kept = [name for name, moves in nutating.items() if moves]
    return (data.sel(scene=kept), [name for name in nutating if name not in kept]) if kept else (data, [])


def relative_costs(data: xr.Dataset, among: list[str]) -> xr.DataArray:
    """Seconds of every method's cheapest run to each target, over the least that any method of `among` needs.

    Dimensions target, integrator, problem; a problem is a scene with a horizon. Infinite where a method does not meet
    the target, or none of `among` does.
    """
    names = [str(name) for name in data["integrator"].values]
    problems = [data.sel(scene=scene).isel(horizon=far)
                for scene in data["scene"].values for far in range(data.sizes["horizon"])]  # fmt: skip
    table = np.full((len(TARGETS), len(names), len(problems)), np.inf)
    for number, target in enumerate(TARGETS):
        for k, cell in enumerate(problems):
            for place in cheapest(cell, target):
                table[number, names.index(place.integrator), k] = place.cost
    costs = xr.DataArray(table, {"target": list(TARGETS), "integrator": names}, ("target", "integrator", "problem"))
    best = costs.sel(integrator=among).min("integrator")
    return (costs / best.where(np.isfinite(best))).fillna(np.inf)


def leaders(ratios: xr.DataArray, count: int) -> list[str]:
    """The methods that come closest to the best most often: by the mean of 1/ratio over problems and targets."""
    merit = (1.0 / ratios).mean(("target", "problem"))
    order = np.argsort(-merit.values, kind="stable")
    return [str(merit["integrator"].values[k]) for k in order[:count] if merit.values[k] > 0.0]
