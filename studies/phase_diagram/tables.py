"""From errors at all horizons to a diagram: what each variant costs for a target and a horizon, and the cheapest.

cost(variant)   median over the tops of seconds a nutation: force evaluations a nutation of the cheapest setting that
            keeps the error below the target up to the horizon, times the measured seconds of an evaluation at that
            setting (`population.prices`), interpolated in logarithms between settings
            (`population.costs.cost_to_reach`). No run is timed
winner      the variant of the least cost; level with it is every variant within `TIE`
foretold    if for most tops one of the two settings of the winner was not run as far as the horizon
"""

from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from symtop_studies.memoize import of_one_dataset

from symtop.methods.framework.registry import integrator
from symtop.model.charts import Array

from ..population import verdicts
from ..population.costs import cost_to_reach

LADDERS, PRICES, CHECKS = "ladders", "prices", "checks"  # groups
SCENE = "spheroid"
TIE = 1.25
TARGETS = tuple(float(target) for target in np.logspace(-2, -12, 21))


class Diagram(NamedTuple):
    """One panel: arrays over targets and horizons, `costs` over variants before them."""

    names: list[str]
    horizons: Array
    costs: Array  # seconds a nutation, inf where not reached
    winner: NDArray[np.int64]  # -1 where nobody reaches the target
    second: NDArray[np.int64]
    ratio: Array  # cost of the second over that of the winner
    foretold: NDArray[np.bool_]

    def place(self, target: float, horizon: float) -> tuple[int, int]:
        """Indices of a cell."""
        return int(np.argmin(np.abs(np.log(np.array(TARGETS) / target)))), int(
            np.argmin(np.abs(np.log(self.horizons / horizon)))
        )


def tops_run(data: xr.DataTree) -> list[str]:
    """What was run: the population, the scene."""
    return [str(name) for name in data[LADDERS].to_dataset()["scene"].values]


def rows_of(data: xr.DataTree, scene: str, quantity: str) -> list[str]:
    """Variants of a panel: those that conserve the energy by construction keep it and the shape at any step."""
    group = data[LADDERS].to_dataset().sel(scene=scene)
    return [
        str(name) for name in group["variant"].values
        if quantity == "axis" or float(group["conserves_energy"].sel(variant=name)) != 1.0
    ]  # fmt: skip


def cell(data: xr.DataTree, scene: str, name: str) -> xr.Dataset:
    """What was measured of a variant: without padding, with errors of runs that failed or have no law infinite."""
    one = data[LADDERS].to_dataset().sel(scene=scene, variant=name)
    ran = np.isfinite(one["setting_value"].values)
    one = one.isel(setting=np.flatnonzero(ran))
    there = one["error"].notnull().any(["quantity", "setting", "horizon"]).values
    one = one.isel(member=np.flatnonzero(there))
    dead = one["work"].isnull().all("member")  # it failed within ten nutations: there is nothing more to measure
    return one.assign(error=one["error"].fillna(np.inf), reach=one["reach"].where(~dead, np.inf))


def price(data: xr.DataTree, name: str, settings: Array) -> Array:
    """Seconds of a force evaluation in a run by itself, without the call, at each setting: steps, or tolerances."""
    fixed = integrator(name).fixed_step
    return verdicts.price(data, [name], "alone", np.where(fixed, np.nan, settings)[np.newaxis])[0, 0]


def answered(work: Array) -> Array:
    """Evaluations a nutation with a number for runs that failed, whose infinite error keeps it out of every answer."""
    return np.where(np.isfinite(work), work, 1.0)


def cost_of(one: xr.Dataset, quantity: str, prices: Array) -> tuple[Array, Array]:
    """Cost a nutation (targets, horizons, n) of a variant, and the finer of the two settings that it comes from.

    `prices` (settings,) are those of an evaluation.
    """
    errors = one["error"].sel(quantity=quantity).transpose("setting", "horizon", "member").values
    work = answered(one["work"].transpose("setting", "member").values) * prices[:, np.newaxis]
    costs = np.stack([cost_to_reach(work, errors[:, k], TARGETS) for k in range(errors.shape[1])], axis=1)
    levels = np.arange(len(work))[:, np.newaxis, np.newaxis]
    missed = np.stack([np.where(errors <= target, -1, levels).max(axis=0) for target in TARGETS])
    return costs, missed + 1


@of_one_dataset
def diagram(data: xr.DataTree, scene: str, quantity: str) -> Diagram:
    """The panel of a quantity on a population or a scene."""
    names = rows_of(data, scene, quantity)
    costs, unseen = [], []
    for name in names:
        one = cell(data, scene, name)
        seconds, level = cost_of(one, quantity, price(data, name, one["setting_value"].values))
        costs.append(np.median(seconds, axis=2))
        reach, far = one["reach"].values, one["horizon"].values
        fine = np.minimum(level, len(reach) - 1)
        shorter = np.minimum(reach[fine], reach[np.maximum(level - 1, 0)])
        unseen.append((shorter < 0.999 * far[:, np.newaxis]).mean(axis=2) > 0.5)
    table = np.array(costs)
    order = np.argsort(table, axis=0, kind="stable")
    best = np.take_along_axis(table, order, axis=0)
    solved = np.isfinite(best[0])
    with np.errstate(invalid="ignore"):
        ratio = best[1] / best[0]
    foretold = np.take_along_axis(np.array(unseen), order[:1], axis=0)[0]
    far = data[LADDERS].to_dataset()["horizon"].values
    winner = np.where(solved, order[0], -1)
    return Diagram(names, far, table, winner, order[1], ratio, foretold & solved)
