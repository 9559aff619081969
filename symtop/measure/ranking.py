"""Which variant, a method in one chart, is the fastest at an accuracy, from the datasets of stored studies.

The work-precision study times variants on scenes. The cost of a target is that of a variant's cheapest timed run that
meets it: the smallest of its samples, because noise only adds. Only variants that take steps are ranked. The closed
form is what errors are measured by, and its cost is that of its constants, whatever the horizon.

The population study counts costs on random tops. Those nearest to a scene say which variants served it:

    regime     four numbers without units that fix the motion of the axis: cos(theta) at both turning points, and asinh
               of p_psi and p_phi over sqrt(I1 |mgl|). A top with mgl < 0 moves as one with -mgl whose axis is named the
               other way round: cos(theta) and p_psi change sign, p_phi does not
    distance   Euclid's, to a top or to its mirror image, in which both momenta change sign
    served     the seconds of a variant, alone, are at most `WITHIN` times the least of all variants on the same top

Of the costs, 60 MB for 10,000 tops, the part of one horizon, one quantity and one target is used.
"""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.core import netcdf
from symtop.core.errors import SymtopError
from symtop.core.numbers import TINY
from symtop.model.scenes import Scene

NEEDS = ("control", "nutation_width", "outcome", "implementation", "seconds", "seconds_samples", "seconds_forecast")
STORED = "population.nc"
NEAREST = 50  # tops
WITHIN = 2.0
SHOWN_AS = {"theta": "axis"}  # quantities that the study has under another name


class Place(NamedTuple):
    """A variant's cheapest run that meets a target."""

    cost: float  # seconds
    integrator: str
    setting: int
    samples: np.ndarray  # seconds, one a round; NaN for a round without it
    forecast: float  # seconds, from the variant's other runs; NaN if there are too few


def ranked(data: xr.Dataset) -> list[str]:
    """The variants that take steps."""
    names = data["variant"].values
    control = data["control"].transpose("variant", ...).values.reshape(len(names), -1)
    return [
        str(name)
        for name, known in zip(names, control, strict=True)
        if any(isinstance(one, str) and one for one in known)
    ]


def cheapest(cell: xr.Dataset, target: float, quantity: str = "axis", implementation: str | None = None) -> list[Place]:
    """The cheapest timed run of each ranked variant that meets a target, cheapest first.

    `cell` is one scene and one horizon of the study's dataset.
    """
    columns = (quantity, "outcome", "seconds", "seconds_forecast")
    cell = cell[[*columns, "seconds_samples", "implementation"]].sel(variant=ranked(cell))  # of dozens of variables
    error, outcome, seconds, forecast = (cell[name].transpose("variant", "setting").values for name in columns)
    price = np.where((error <= target) & (outcome == "ok") & np.isfinite(seconds), seconds, np.inf)
    samples = cell["seconds_samples"].transpose("variant", "setting", "batch").values
    kinds = cell["implementation"].transpose("variant", ...).values.reshape(len(price), -1)[:, 0]
    places = [
        Place(float(price[row, k]), str(name), k, samples[row, k], float(forecast[row, k]))
        for row, (name, k) in enumerate(zip(cell["variant"].values, map(int, price.argmin(axis=1)), strict=True))
        if np.isfinite(price[row, k]) and implementation in (None, str(kinds[row]))
    ]
    return sorted(places, key=lambda place: place[:2])


class Near(NamedTuple):
    """How many of the nearest tops each variant served, at one target of a quantity over one horizon."""

    served: dict[str, int]  # by variant; the most first, then the cheapest in the median
    tops: int
    quantity: str
    target: float
    nutations: float

    def words(self, row: str) -> str:
        """What the nearest tops say of a variant."""
        return (
            f"{row} was the cheapest or within {WITHIN:g} times the cheapest on {self.served[row]} of the {self.tops} "
            f"nearest random tops ({self.quantity} {self.target:.0e} over {self.nutations:g} nutations)."
        )


def regime(scene: Scene) -> np.ndarray:
    """Four dimensionless numbers of a scene: cos(theta) at both turning points, asinh of both scaled momenta."""
    top, start = scene.top, scene.start
    low, high = sorted(top.turning_cosines(start))
    unit = math.sqrt(top.I1 * max(abs(top.mgl), TINY))
    momenta = top.momenta(start)
    numbers = [low, high, math.asinh(momenta.p_psi / unit), math.asinh(momenta.p_phi / unit)]
    return np.array(numbers if top.mgl >= 0.0 else [-high, -low, -numbers[2], numbers[3]])


def distances(regimes: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Distances of regimes (n, 4) from one, (n,)."""
    images = numbers * np.array([[1.0, 1.0, 1.0, 1.0], [1.0, 1.0, -1.0, -1.0]])
    each = np.sqrt(((regimes[:, np.newaxis] - images) ** 2).sum(axis=2))
    return np.asarray(each.min(axis=1))


def nearest(file: Path, scene: Scene, quantity: str, accuracy: float, horizon: float) -> Near | None:
    """The variants that served the tops nearest to a scene; None where the study is not stored or has no answer.

    The target and the horizon of the study are those nearest to `accuracy` and to `horizon` in logarithms. Raises
    SymtopError for a file that is damaged or of an older version.
    """
    quantity = SHOWN_AS.get(quantity, quantity)
    if not file.is_file():
        return None
    remedy = "run symtop study population --fresh"
    try:
        data = netcdf.read_any(file)  # whole: a tree that is read lazily and closed has ended a process in HDF5
        tree = data if isinstance(data, xr.DataTree) else xr.DataTree(data)
        return _counted(tree, regime(scene), quantity, accuracy, horizon / scene.nutation_period)
    except KeyError as error:
        raise SymtopError(f"{file} is of an older version, without {error}; {remedy}") from error
    except (OSError, ValueError, RuntimeError) as error:
        raise SymtopError(f"{file} cannot be read ({error}); {remedy}") from error


def _counted(data: xr.DataTree, numbers: np.ndarray, quantity: str, accuracy: float, nutations: float) -> Near | None:
    groups = {name: data[name].to_dataset() for name in ("short", "long") if name in data}
    if not groups:
        raise KeyError("short")
    spans = {name: float(np.nanmax(group["nutations"].values)) for name, group in groups.items()}
    nutations = nutations if math.isfinite(nutations) else 1e-3
    span = min(spans, key=lambda name: abs(math.log(spans[name] / max(nutations, 1e-3))))
    group = groups[span].isel(scene=0)
    if quantity not in group["quantity"]:
        return None
    target = min(group["target"].values.tolist(), key=lambda value: abs(math.log(value / accuracy)))
    price = data["prices"].to_dataset()["alone"].min("scene").sel(variant=group["variant"].values)
    cost = group["cost"].sel(quantity=quantity, target=target).transpose("variant", "member").values
    cost *= price.values[:, np.newaxis]
    rows = ~np.isnan(cost).all(axis=1)
    regimes = data["tops"].to_dataset()["regime"].transpose(..., "member", "number").values
    far = distances(regimes.reshape(-1, 4)[: cost.shape[1]], numbers)
    far[np.isnan(cost).all(axis=0) | ~np.isfinite(far)] = np.inf  # nothing was asked of them
    chosen = np.argsort(far, kind="stable")[: min(NEAREST, int(np.isfinite(far).sum()))]
    if not chosen.size:
        return None
    cost = np.where(np.isnan(cost), np.inf, cost)[np.ix_(rows, chosen)]
    best = cost.min(axis=0)
    served = ((cost <= WITHIN * best) & np.isfinite(cost)).sum(axis=1)
    slow = np.median(np.where(np.isfinite(best), cost, np.inf) / np.where(np.isfinite(best), best, 1.0), axis=1)
    names = group["variant"].values[rows]
    order = np.lexsort((slow, -served))
    counts = {str(names[row]): int(served[row]) for row in order}
    return Near(counts, int(chosen.size), quantity, float(target), spans[span])
