"""Who is fastest at an accuracy, and whether the lead is more than noise.

The cost of a target is that of a method's run of least work that meets it, if it was raced, which is whom the race was
for; otherwise of the run of least seconds that meets it, measured or foreseen.
Two methods are compared by the ratios of their samples round by round, which were taken within a second or two of each
other: a slow spell of the machine hits both.
A lead is sure if both methods' samples are steady (see `timing`), every round agrees on it, and both its median and the
ratio of the smallest samples are at least `MARGIN`, because the same code in another process, elsewhere in memory, may
differ by some per cent; otherwise the two are level. A rival that was not timed itself, because it was foreseen behind,
is behind for sure if it is so by `FAR` and by more than any forecast on that scene was seen to miss.
"""

from typing import NamedTuple, Self

import numpy as np
import xarray as xr

from symtop.measure.timing import NOISY
from symtop.measure.work import TARGETS, least_work, meeting

MARGIN = 1.1
WITHIN = 1.6  # of the fastest: methods that are timed in rounds
FAR = 0.9 * WITHIN
LEAST_ROUNDS = 3


class Place(NamedTuple):
    """A method's cheapest run that meets a target."""

    cost: float
    integrator: str
    tier: str
    setting: int
    error: float


class Lead(NamedTuple):
    """How far the first of two is ahead: median and extremes of the paired ratios."""

    ratio: float
    low: float
    high: float
    sure: bool


class Win(NamedTuple):
    """The fastest method at one target, who is level with it, and the lead over the first who is not."""

    best: Place
    level: tuple[str, ...]
    behind: Place | None
    lead: Lead | None

    @property
    def reliable(self) -> bool:
        """Is it alone in front, beyond the noise?"""
        return not self.level

    @property
    def rival_timed(self) -> bool:
        """Was the first that is behind timed in the same race? Otherwise its time is foreseen."""
        return self.lead is not None and bool(np.isfinite(self.lead.low))


def cheapest(
    cell: xr.Dataset, target: float, quantity: str = "axis", cost: str = "seconds", tier: str | None = None
) -> list[Place]:
    """Methods that meet a target, cheapest first; `cell` is one scene and one horizon of the study's dataset.

    Each takes part with its run of least work if that was raced, else with that of least cost.
    """
    needed = cell[list({quantity, cost, "outcome", "force_evaluations", "seconds_race"} & set(cell.data_vars))]
    table = needed.transpose("integrator", "setting")
    price = table[cost].values
    good = meeting(table, target, quantity) & (table["outcome"].values == "ok") & np.isfinite(price)
    entered, least = least_work(table, target, quantity), np.argmin(np.where(good, price, np.inf), axis=-1)
    tiers = cell["tier"].transpose("integrator", ...).values.reshape(price.shape[0], -1)[:, 0]
    places = []
    for row, name in enumerate(cell["integrator"].values):
        k = int(entered[row])
        if k < 0 or not good[row].any() or tier not in (None, str(tiers[row])):
            continue
        if cost != "seconds" or not (good[row, k] and table["seconds_race"].values[row, k] > 0.0):
            k = int(least[row])
        places.append(Place(float(price[row, k]), str(name), str(tiers[row]), k, float(table[quantity].values[row, k])))
    return sorted(places)


def _worst_miss(cell: xr.Dataset) -> float:
    """The largest relative miss of a foreseen time on this scene, as far as it was tested."""
    misses = cell["foreseen_miss"].values if "foreseen_miss" in cell else np.zeros(1)
    return float(np.nanmax(misses)) if np.isfinite(misses).any() else 0.0


class Raced(NamedTuple):
    """What a lead is judged by: one scene and one horizon."""

    names: list[str]
    samples: np.ndarray  # (integrator, setting, batch)
    races: np.ndarray  # (integrator, setting)
    miss: float  # of a forecast

    @classmethod
    def of(cls, cell: xr.Dataset) -> Self:
        """Out of the study's dataset."""
        samples = cell["seconds_samples"].transpose("integrator", "setting", "batch").values
        races = cell["seconds_race"].transpose("integrator", "setting").values
        return cls(cell["integrator"].values.tolist(), samples, races, _worst_miss(cell))


def lead(raced: Raced, first: Place, second: Place) -> Lead:
    """By how much the first place is ahead of the second."""
    places = [(raced.names.index(place.integrator), place.setting) for place in (first, second)]
    ours, theirs = (raced.samples[at] for at in places)
    races = [raced.races[at] for at in places]
    both = np.isfinite(ours) & np.isfinite(theirs) & (races[0] == races[1]) & (races[0] > 0.0)
    if both.sum() < LEAST_ROUNDS:
        ratio = second.cost / first.cost
        return Lead(ratio, np.nan, np.nan, bool(ratio >= max(FAR, MARGIN * (1.0 + raced.miss))))
    ratios = theirs[both] / ours[both]
    middle, low, high = float(np.median(ratios)), float(ratios.min()), float(ratios.max())
    steady = all(np.median(row[both]) < (1.0 + NOISY) * row[both].min() for row in (ours, theirs))
    return Lead(middle, low, high, bool(steady and low > 1.0 and min(middle, second.cost / first.cost) >= MARGIN))


def win(
    cell: xr.Dataset, target: float, quantity: str = "axis", tier: str = "compiled", without: tuple[str, ...] = ()
) -> Win | None:
    """The fastest method of a tier at a target, or None if nobody met it."""
    places = [place for place in cheapest(cell, target, quantity, tier=tier) if place.integrator not in without]
    if not places:
        return None
    best, *others = places
    raced = Raced.of(cell) if others else None
    leads = [(other, lead(raced, best, other)) for other in others if raced is not None]
    level = tuple(other.integrator for other, ahead in leads if not ahead.sure)
    behind, ahead = next(((other, ahead) for other, ahead in leads if ahead.sure), (None, None))
    return Win(best, level, behind, ahead)


def winners(data: xr.Dataset, targets: tuple[float, ...] = TARGETS) -> dict[tuple[str, int, float], Win | None]:
    """The compiled winners in axis error of every scene, horizon (by index) and target."""
    return {
        (str(scene), far, target): win(data.sel(scene=scene).isel(horizon=far), target)
        for scene in data["scene"].values
        for far in range(data.sizes["horizon"])
        for target in targets
    }


def counted(data: xr.Dataset) -> tuple[xr.Dataset, list[str]]:
    """The scenes that may be counted, and the names of those left out: those without a nutation.

    A steady precession starts in a fixed point of several maps, which then have no error at any step: their wins there
    say nothing about any other motion. If there are no other scenes, nothing is left out.
    """
    if "nutation_lag" not in data:
        return data, []
    nutating = {str(name): bool(data["nutation_lag"].sel(scene=name).notnull().any()) for name in data["scene"].values}
    kept = [name for name, moves in nutating.items() if moves]
    return (data.sel(scene=kept), [name for name in nutating if name not in kept]) if kept else (data, [])


def costs(
    data: xr.Dataset, targets: tuple[float, ...] = TARGETS, quantity: str = "axis", cost: str = "seconds"
) -> xr.DataArray:
    """Cost of the cheapest run of every method that meets each target, infinite where none does.

    Dimensions target, integrator, problem; a problem is a scene with a horizon.
    """
    names = [str(name) for name in data["integrator"].values]
    problems = [(str(scene), far) for scene in data["scene"].values for far in range(data.sizes["horizon"])]
    table = np.full((len(targets), len(names), len(problems)), np.inf)
    for number, target in enumerate(targets):
        for k, (scene, far) in enumerate(problems):
            for place in cheapest(data.sel(scene=scene).isel(horizon=far), target, quantity, cost):
                table[number, names.index(place.integrator), k] = place.cost
    return xr.DataArray(
        table, dims=("target", "integrator", "problem"), coords={"target": list(targets), "integrator": names}
    )


def relative(table: xr.DataArray, among: list[str]) -> xr.DataArray:
    """Costs over the least cost that any method of `among` has on a problem; problems nobody solved are infinite."""
    best = table.sel(integrator=among).min("integrator")
    return (table / best.where(np.isfinite(best))).fillna(np.inf)


def leaders(ratios: xr.DataArray, count: int) -> list[str]:
    """The methods that come closest to the best most often: by the mean of 1/ratio over problems and targets."""
    merit = (1.0 / ratios).mean(("target", "problem"))
    order = np.argsort(-merit.values, kind="stable")
    return [str(merit["integrator"].values[k]) for k in order[:count] if merit.values[k] > 0.0]


class Crossing(NamedTuple):
    """Energy at equal cost: the share of the common range of costs in which the first of two methods is better."""

    scene: str
    first: str
    second: str
    share: float  # of the common range, in the logarithm of cost
    at_least: bool  # is the first better at the least common cost,
    at_most: bool  # at the largest?
    dearest_won: float  # the largest cost at which the first is better; NaN if none
    error: float  # energy error of the first where its lead is largest (or its lag smallest)
    gain: float  # ratio of the energy errors there, second over first


def crossing(
    cell: xr.Dataset, first: str, second: str, quantity: str = "energy", cost: str = "seconds"
) -> Crossing | None:
    """Compare the best error that each of two methods has for a cost; None if their costs do not overlap.

    The error for a cost is that of the most accurate run that is no dearer, joined by straight lines in the logarithms.
    """
    curves = []
    for name in (first, second):
        runs = cell.sel(integrator=name)
        x, y = runs[cost].values, runs[quantity].values
        good = np.isfinite(x) & np.isfinite(y) & (runs["outcome"].values == "ok")
        order = np.argsort(x[good])
        x, y = x[good][order], np.minimum.accumulate(np.maximum(y[good][order], 1e-17))
        if x.size < 2:
            return None
        curves.append((np.log(x), np.log(y)))
    low, high = (pick(ends) for pick, ends in ((max, [c[0][0] for c in curves]), (min, [c[0][-1] for c in curves])))
    if high <= low:
        return None
    at = np.linspace(low, high, 201)
    ours, theirs = (np.interp(at, *curve) for curve in curves)
    ahead, best = ours < theirs, int(np.argmax(theirs - ours))
    won = np.exp(at[ahead]) if ahead.any() else np.array([np.nan])
    name = str(cell["scene"].values)
    gain, error = float(np.exp(theirs[best] - ours[best])), float(np.exp(ours[best]))
    ends = bool(ahead[0]), bool(ahead[-1])
    return Crossing(name, first, second, float(ahead.mean()), *ends, float(won[-1]), error, gain)


def growth_at_equal_settings(runs: xr.Dataset, quantity: str, far: int = -1) -> float:
    """Median ratio of an error at a long horizon to that at the first one, over settings that were run at both."""
    near, later = runs.isel(horizon=0), runs.isel(horizon=far)
    ratios = [
        later[quantity].values[j] / near[quantity].values[k]
        for k, setting in enumerate(near["setting_value"].values)
        for j in np.flatnonzero(np.isclose(later["setting_value"].values, setting, rtol=1e-9))
        if near[quantity].values[k] > 1e-12
    ]
    good = [ratio for ratio in ratios if np.isfinite(ratio)]
    return float(np.median(good)) if good else np.nan
