"""Which variants, methods in one chart, are the fastest on the random tops nearest to a scene, from a stored study.

The study of cost counts force evaluations on random tops and measures what one costs. The tops nearest to a scene say
which variants served it:

    regime     four numbers without units that fix the motion of the axis: cos(theta) at both turning points, and asinh
               of p_psi and p_phi over sqrt(I1 |mgl|). A top with mgl < 0 moves as one with -mgl whose axis is named the
               other way round: cos(theta) and p_psi change sign, p_phi does not
    distance   Euclid's, to a top or to its mirror image, in which both momenta change sign
    served     the seconds of a variant are at most `WITHIN` times the least of all variants on the same top

Where there is no stored study, `cheapest` reads the table ``candidates.tsv``, which was made from one
(`benchmarks/candidates.py`). A row holds the variants that between them were next to the cheapest on most random tops
of every kind, for an accuracy of a quantity, a length in nutations, a class of `NEEDS`, and, in some, only of methods
that exist for a body without symmetry. Made from half of the tops, five of a row come within 1.1 times the least on 96
to 100 % of the others over 10 nutations, and on 88 to 100 % over 1000.
"""

import functools
import math
from collections.abc import Collection
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.core import netcdf
from symtop.core.errors import SymtopError
from symtop.core.numbers import TINY
from symtop.model.scenes import Scene

STORED = "cost.nc"
PRICED_AT = 1e-8  # tolerance at which the price of an evaluation is taken
NEAREST = 50  # tops
WITHIN = 2.0
SHOWN_AS = {"theta": "axis"}  # quantities that the study has under another name
TABLE = Path(__file__).with_name("candidates.tsv")
ASKED = ("nutations", "quantity", "accuracy", "needs", "general")  # columns of the table, before the variants
ANY = "any"  # class of needs: whatever is not made for this very top
MENU = 6  # variants in a row


class Near(NamedTuple):
    """How many of the nearest tops each variant served, at one target of a quantity over one horizon."""

    served: dict[str, int]  # by variant; the most first, then the cheapest in the median
    tops: int
    quantity: str
    target: float
    nutations: float
    settings: dict[str, float]  # of each variant that served: the median of what meets the target, in steps a nutation

    def words(self, row: str) -> str:
        """What the nearest tops say of a variant."""
        return (
            f"{row} was the cheapest or within {WITHIN:g} times the cheapest on {self.served[row]} of the {self.tops} "
            f"nearest random tops ({self.quantity} {self.target:.0e} over {self.nutations:g} nutations)."
        )


def nearest(
    file: Path, scene: Scene, quantity: str, accuracy: float, horizon: float, needs: Collection[str] = ()
) -> Near | None:
    """The variants that served the tops nearest to a scene; None where the study does not ask for the quantity.

    The target and the horizon of the study are those nearest to `accuracy` and to `horizon` in logarithms; `needs`
    leaves out the variants that need something else, before the cheapest is found. Raises
    SymtopError for a file that is not there, is damaged or of an older version.
    """
    remedy = "run symtop study cost"
    if not file.is_file():
        raise SymtopError(f"results holds no {file.name}: {str(file.parent)!r}; {remedy} first")
    try:
        data = netcdf.read_any(file)  # whole: a tree that is read lazily and closed has ended a process in HDF5
        tree = data if isinstance(data, xr.DataTree) else xr.DataTree(data)
        target = SHOWN_AS.get(quantity, quantity)
        return _counted(tree, scene, target, accuracy, horizon, needs)
    except KeyError as error:
        raise SymtopError(f"{file} is of an older version, without {error}; {remedy} --fresh") from error
    except (OSError, ValueError, RuntimeError) as error:
        raise SymtopError(f"{file} cannot be read ({error}); {remedy} --fresh") from error


def _counted(
    data: xr.DataTree, scene: Scene, quantity: str, accuracy: float, horizon: float, needs: Collection[str]
) -> Near | None:
    groups = {name: data[name].to_dataset() for name in ("short", "long") if name in data}
    if not groups:
        raise KeyError("short")
    spans = {name: float(np.nanmax(group["nutations"].values)) for name, group in groups.items()}
    span = min(spans, key=lambda name: abs(math.log(spans[name] / max(horizon / scene.nutation_period, 1e-3))))
    group = groups[span].isel(scene=0)
    if needs:
        group = group.isel(variant=np.flatnonzero(np.isin(group["needs"].values, list(needs))))
    if quantity not in group["quantity"]:
        return None
    target = min(group["target"].values.tolist(), key=lambda value: abs(math.log(value / accuracy)))
    priced = data["prices"].to_dataset()[["price", "call"]].sel(priced_at=PRICED_AT, method="nearest")
    price = priced.median("scene").sel(variant=group["variant"].values)
    answers = group[["cost", "met_at"]].sel(quantity=quantity, target=target).transpose("variant", "member")
    cost = answers["cost"].values * price["price"].values[:, np.newaxis] + price["call"].values[:, np.newaxis]
    rows = ~np.isnan(cost).all(axis=1)
    regimes = data["tops"].to_dataset()["regime"].sel(scene=span).transpose(..., "member", "number").values
    far = distances(regimes.reshape(-1, 4)[: cost.shape[1]], regime(scene))
    far[np.isnan(cost).all(axis=0) | ~np.isfinite(far)] = np.inf  # nothing was asked of them
    chosen = np.argsort(far, kind="stable")[: min(NEAREST, int(np.isfinite(far).sum()))]
    if not chosen.size:
        return None
    met = np.where(np.isfinite(cost), answers["met_at"].values, np.nan)[np.ix_(rows, chosen)]
    cost = np.where(np.isnan(cost), np.inf, cost)[np.ix_(rows, chosen)]
    best = cost.min(axis=0)
    served = ((cost <= WITHIN * best) & np.isfinite(cost)).sum(axis=1)
    slow = np.median(np.where(np.isfinite(best), cost, np.inf) / np.where(np.isfinite(best), best, 1.0), axis=1)
    names = group["variant"].values[rows]
    order = np.lexsort((slow, -served))
    counts = {str(names[row]): int(served[row]) for row in order}
    usual = {str(names[row]): float(np.nanmedian(met[row])) for row in order if served[row]}
    return Near(counts, int(chosen.size), quantity, float(target), spans[span], usual)


@functools.cache
def _rows() -> dict[tuple[float, str, float, str, bool], list[str]]:
    """The variants of the table by `ASKED`."""
    lines = (line.split("\t") for line in TABLE.read_text(encoding="utf-8").splitlines()[1:])
    return {(float(n), what, float(a), need, g == "yes"): names.split(" ") for n, what, a, need, g, names in lines}


def cheapest(
    needs: Collection[str], quantity: str, accuracy: float, nutations: float, *, general: bool = False
) -> list[str]:
    """Variants of the classes `needs` (empty: `ANY`), mostly the cheapest first; none where the table says nothing.

    Accuracy and length are the nearest in the table, in logarithms. Of several classes the firsts of all come first.
    """
    rows, shown = _rows(), SHOWN_AS.get(quantity, quantity)
    length = min({key[0] for key in rows}, key=lambda value: abs(math.log(value / max(nutations, 1e-3))))
    level = min({key[2] for key in rows}, key=lambda value: abs(math.log(value / accuracy)))
    menus = [rows.get((length, shown, level, need, general), []) for need in needs or (ANY,)]
    return list(dict.fromkeys(name for place in range(MENU) for menu in menus for name in menu[place : place + 1]))


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
