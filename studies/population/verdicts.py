"""What the study's datasets say: costs of all variants on all tops, and verdicts by horizon, target and stratum.

The dataset is a tree. Groups "short" and "long" hold the variants over the two horizons (see `ladder`), "tops" what is
known of the tops, "prices" the seconds of a force evaluation of each variant (see `prices`). A cost is in one of:

    evaluations   force evaluations
    alone         force evaluations x seconds of one in a run by itself
    together      force evaluations x seconds of one in one call for many tops

The seconds are without those of the call, of every variant (see `prices`), and at the tolerance that reaches the
target on a top where a variant has one.

Variants are compared where they show the same quantity: the axis in every chart but the attitude chart of a method
that has the axis chart, which steps the same axis, and the attitude in the charts that show it.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from symtop_studies.memoize import of_one_dataset

from symtop.model.charts import Array
from symtop.run.guard import EXPECTED

from .costs import Detection, Share, Winner, detection, quantiles, slowdowns, winner, wins
from .ladder import KEPT, TENTHS, WRONG
from .prices import of_processes

HORIZONS = ("short", "long")
UNITS = {
    "evaluations": "force evaluations",
    "alone": "force evaluations x measured price of one, alone",
    "together": "force evaluations x measured price of one, in a call for many tops",
}
ALL = "all"  # tops, whatever their stratum
THRESHOLDS = {"foretold": EXPECTED, "watched": KEPT}
WHOLE = 0.999  # of the members must be judged at a setting whose shares are shown


class Cell(NamedTuple):
    """A question: who reaches a target of a quantity over a horizon on the tops of a stratum."""

    horizon: str
    quantity: str
    target: float
    stratum: str = ALL


class Costs(NamedTuple):
    """Costs of variants on the tops of a cell."""

    names: list[str]
    values: Array  # (variants, tops), inf where a variant does not reach the target
    halves: Array  # (2, variants): price of an evaluation by each process that timed it over the least, in the median

    def of(self, name: str) -> Array:
        """The costs of one variant."""
        return np.asarray(self.values[self.names.index(name)])


class Standing(NamedTuple):
    """How a variant does in a cell."""

    name: str
    solved: Share
    slowdown: tuple[
        float, float, float
    ]  # 10 %, median, 90 %: cost over the cheapest on each top that some variant solves
    won: Share
    level: Share


def horizons(data: xr.DataTree) -> list[str]:
    """The groups of variants that are there."""
    return [name for name in HORIZONS if name in data.children]


def nutations(data: xr.DataTree, horizon: str) -> float:
    """The length of a horizon."""
    return float(np.nanmax(data[horizon]["nutations"].values))


def targets(data: xr.DataTree) -> list[float]:
    """The targets."""
    return [float(value) for value in data[horizons(data)[0]]["target"].values]


def members(data: xr.DataTree, horizon: str) -> int:
    """How many tops a horizon has."""
    return int(data[horizon].sizes["member"])


def strata(data: xr.DataTree) -> list[str]:
    """Names of the strata."""
    return [str(name) for name in data["tops"]["stratum"].values]


def stratum_of(data: xr.DataTree, horizon: str) -> Array:
    """The place of each member's stratum."""
    return np.asarray(data["tops"]["stratum_place"].values.ravel()[: members(data, horizon)])


def price(data: xr.DataTree, names: list[str], unit: str, tolerances: Array) -> Array:
    """What a force evaluation costs in a unit, at the least and by each process: (3, variants, n).

    Between the tolerances that were timed it is interpolated in logarithms; NaN is a variant with a step, or no
    tolerance.
    """
    if unit == "evaluations":
        return np.ones((3, *tolerances.shape))
    timed = of_processes(data["prices"].to_dataset()).sel(variant=names)
    halves = timed[f"{unit}_by_half"].transpose("half", "variant", "priced_at").values
    each = np.stack([timed[f"{unit}_by"].transpose("variant", "priced_at").values, *halves])
    seconds = np.repeat(each[:, :, :1], tolerances.shape[1], axis=2)
    known, x = -np.log(timed["priced_at"].values), -np.log(tolerances)
    for part, row in zip(*np.nonzero(np.ptp(each, axis=2)), strict=True):
        at = np.where(np.isnan(x[row]), known[-1], x[row])
        seconds[part, row] = np.exp(np.interp(at, known, np.log(each[part, row])))
    return seconds


@of_one_dataset
def costs(data: xr.DataTree, cell: Cell, unit: str) -> Costs:
    """Costs of all variants that show a cell's quantity, on the tops that are asked."""
    group = data[cell.horizon].to_dataset()[["cost", "met_at"]].isel(scene=0)
    asked = group.sel(quantity=cell.quantity, target=cell.target).transpose("variant", "member")
    values, met = asked["cost"].values, asked["met_at"].values
    if cell.stratum != ALL:
        among = stratum_of(data, cell.horizon) == strata(data).index(cell.stratum)
        values, met = values[:, among], met[:, among]
    rows, tops = ~np.isnan(values).all(axis=1), ~np.isnan(values).all(axis=0)
    names = [str(name) for name in group["variant"].values[rows]]
    chosen = np.ix_(rows, tops)
    values, met = np.where(np.isnan(values), np.inf, values)[chosen], met[chosen]
    seconds = price(data, names, unit, np.where(met, 10.0 ** (-met.astype(float) / TENTHS), np.nan))
    halves = np.median(seconds[1:] / seconds[0], axis=2) if tops.any() else np.ones((2, len(names)))
    return Costs(names, values * seconds[0], halves)


def standings(taken: Costs) -> list[Standing]:
    """All variants of a cell, the one with the most wins first; then by ties, cost, and tops that are solved."""
    won, level = wins(taken.values)
    ratios = slowdowns(taken.values)
    solvable = int(np.isfinite(taken.values).any(axis=0).sum())
    total = taken.values.shape[1]
    listed = [
        Standing(
            name,
            Share(int(np.isfinite(taken.values[row]).sum()), total),
            quantiles(ratios[row]),
            Share(int(won[row].sum()), solvable),
            Share(int((level[row] & np.isfinite(taken.values[row])).sum()), solvable),
        )
        for row, name in enumerate(taken.names)
    ]
    return sorted(listed, key=lambda one: (-one.won.count, -one.level.count, one.slowdown[1], -one.solved.count))


def widest(listed: Sequence[Standing]) -> Standing:
    """The variant that solves the most tops; of those with as many the first."""
    return max(listed, key=lambda one: one.solved.count)


@of_one_dataset
def best(data: xr.DataTree, cell: Cell, unit: str) -> tuple[Costs, Winner | None]:
    """Costs of a cell, and its winner, which is sure if it is with the prices of either process that timed them."""
    taken = costs(data, cell, unit)
    won = winner(taken.values) if taken.names else None
    if won is not None and won.sure:
        halves = [winner(taken.values * half[:, np.newaxis]) for half in taken.halves]
        won = won._replace(steady=all(one is not None and one.sure and one.row == won.row for one in halves))
    return taken, won


def cells(data: xr.DataTree, quantity: str, among: tuple[str, ...] | None = None) -> Iterator[Cell]:
    """The cells of a quantity, by horizon, stratum (all tops at first) and target."""
    for horizon in horizons(data):
        for stratum in (ALL, *strata(data)) if among is None else among:
            for target in targets(data):
                yield Cell(horizon, quantity, target, stratum)


# ---- silent failures and the guard -----------------------------------------------------------------------------------


class Health(NamedTuple):
    """Of one variant over one horizon, by setting: runs judged, wrong ones, silent failures; (settings,)."""

    fixed_step: bool
    setting: Array  # steps a nutation, or tolerances
    runs: Array
    wrong: Array
    silent: Array
    by_kind: Array  # silent failures by stratum, (settings, strata)

    @property
    def hidden(self) -> float:
        """The part of all wrong runs that are silent failures; NaN if none is wrong."""
        return float(self.silent.sum() / self.wrong.sum()) if self.wrong.sum() else np.nan


def health(data: xr.DataTree, name: str, horizon: str = "short") -> Health:
    """Runs, wrong runs and silent failures of a variant at the settings at which (nearly) all members were judged."""
    asked = data[horizon].to_dataset()[["runs", "wrong", "silent", "setting", "control"]]
    group = asked.isel(scene=0).sel(variant=name)
    count = float(data["tops"]["known"].values.ravel()[: members(data, horizon)].sum())
    judged = group["runs"].transpose("level", "stratum").values
    there = judged.sum(axis=1) >= WHOLE * count
    numbers = [group[key].transpose("level", "stratum").values[there] for key in ("runs", "wrong", "silent")]
    fixed = str(group["control"].values) == "step_size"
    return Health(fixed, group["setting"].values[there], *(part.sum(axis=1) for part in numbers), numbers[-1])


def judged_variants(data: xr.DataTree, horizon: str = "short") -> list[str]:
    """The variants whose axis is judged, in the order of the registry."""
    return costs(data, Cell(horizon, "axis", targets(data)[0]), "evaluations").names


def scored(
    data: xr.DataTree, horizon: str, score: str, names: list[str] | None = None
) -> tuple[Array, NDArray[np.bool_]]:
    """A score of the runs that the guard was asked about, and whether they were wrong.

    The score is the guard's forecast of the axis error ("foretold"), or the larger error of energy and momenta of the
    run ("watched"). Runs between `EXPECTED` and `WRONG` are neither right nor wrong and are left out, and so are those
    that the guard's trial repeats whole: there it measures the error and forecasts nothing.
    """
    group = data[horizon].to_dataset().isel(scene=0).sel(variant=names or judged_variants(data, horizon))
    values, errors = group[score].values.ravel(), group["measured"].values.ravel()
    told = ~np.isnan(values) & ((errors <= EXPECTED) | (errors > WRONG))
    asked = told & ~(group["whole"].values.ravel() > 0.0)
    return values[asked], errors[asked] > WRONG


def repeated(data: xr.DataTree, horizon: str, names: list[str] | None = None) -> Share:
    """Of the wrong runs that the guard was asked about, those that its trial repeats whole."""
    group = data[horizon].to_dataset().isel(scene=0).sel(variant=names or judged_variants(data, horizon))
    wrong = (group["measured"].values > WRONG) & ~np.isnan(group["foretold"].values)
    return Share(int((wrong & (group["whole"].values > 0.0)).sum()), int(wrong.sum()))


def detected(
    data: xr.DataTree, horizon: str = "short", score: str = "foretold", names: list[str] | None = None
) -> Detection:
    """How well a score tells wrong runs from right ones."""
    return detection(*scored(data, horizon, score, names))


def caught(
    data: xr.DataTree, horizon: str = "short", score: str = "foretold", names: list[str] | None = None
) -> tuple[Share, Share]:
    """Wrong runs with a score above its threshold, and right ones."""
    values, wrong = scored(data, horizon, score, names)
    warned = values > THRESHOLDS[score]
    return Share(int((warned & wrong).sum()), int(wrong.sum())), Share(
        int((warned & ~wrong).sum()), int((~wrong).sum())
    )
