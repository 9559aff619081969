"""Ten cells that were foretold, run in full: is the winner right, and what does it cost?

A cell is chosen on the one scene if it was foretold, its winner is beyond a tie, and its runs are within a number of
force evaluations; from each panel in turn that whose horizon is furthest beyond the last one that was measured. The
winner and the next variant run at the two settings on both sides of the target, to the horizon of the cell. Of cells
that the same runs decide, one is chosen.
"""

from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from symtop.methods.framework.registry import integrator
from symtop.model.charts import Array

from ..population.costs import cost_to_reach
from . import tables
from .runs import QUANTITIES, Asked, horizons, measured, tops_of

COUNT = 10


def chosen(data: xr.DataTree, limit: float) -> list[dict[str, Any]]:
    """Settings of the checks: quantity, target, horizon, and of two variants the two settings; the dearest first."""
    eligible: dict[str, list[tuple[float, float, dict[str, Any]]]] = {}
    for quantity in QUANTITIES:
        panel = tables.diagram(data, tables.SCENE, quantity)
        eligible[quantity] = []
        variants = [_Row.of(data, name, quantity) for name in panel.names]
        for at in zip(
            *np.nonzero(panel.foretold & (panel.ratio >= tables.TIE) & np.isfinite(panel.ratio)), strict=True
        ):
            pair = [int(panel.winner[at]), int(panel.second[at])]
            parts = [variants[place].settings(at) for place in pair]
            horizon = float(panel.horizons[at[1]])
            dearest = max(work for _, work, _ in parts) * horizon
            if dearest > limit:
                continue
            names = [panel.names[place] for place in pair]
            settings = {"integrators": names, "quantity": quantity, "target": tables.TARGETS[at[0]], "horizon": horizon,
                        "settings": [values for values, _, _ in parts]}  # fmt: skip
            eligible[quantity].append((horizon / parts[0][2], dearest, settings))
    queues = [sorted(each, key=lambda one: -one[0]) for each in eligible.values()]
    taken: list[tuple[float, dict[str, Any]]] = []
    runs: list[Any] = []
    while any(queues) and len(taken) < COUNT:
        for queue in queues:
            while queue and len(taken) < COUNT:
                _, dearest, one = queue.pop(0)
                decided_by = one["integrators"], one["settings"]
                if decided_by not in runs:
                    runs.append(decided_by)
                    taken.append((dearest, one))
                    break
    return [one for _, one in sorted(taken, key=lambda each: -each[0])]  # the last to begin are short


class _Row(NamedTuple):
    """What was measured of a variant, and the finer of the two settings that each cell comes from."""

    one: xr.Dataset
    level: Array

    @classmethod
    def of(cls, data: xr.DataTree, name: str, quantity: str) -> "_Row":
        one = tables.cell(data, tables.SCENE, name)
        return cls(one, tables.cost_of(one, quantity, np.ones(one.sizes["setting"]))[1])

    def settings(self, at: tuple[int, int]) -> tuple[list[float], float, float]:
        """The coarser and the finer setting in a cell, the evaluations a nutation of the finer, the variant's reach."""
        fine = min(int(self.level[at][0]), self.one.sizes["setting"] - 1)
        pair = [max(fine - 1, 0), fine]
        values, reach = self.one["setting_value"].values[pair], self.one["reach"].values[pair].min()
        return values.tolist(), float(np.nanmax(self.one["work"].values[fine])), float(reach)


def cost(one: xr.Dataset, rank: int, prices: Array) -> float:
    """The cost a nutation of the winner or of the next variant of a check; infinite if the target is not reached.

    `prices` (sides,) are those of an evaluation.
    """
    work = tables.answered(one["work"].values[rank]) * prices
    errors = one["errors"].values[rank]
    return float(cost_to_reach(work[:, np.newaxis], errors[:, np.newaxis], (float(one["target"]),))[0, 0])


def check(asked: Any) -> xr.Dataset:
    """Errors and ``work``, evaluations a nutation, of the runs that decide a cell, over ``rank`` and ``side``.

    The ranks are the winner and the next variant, the sides the coarser and the finer setting. ``quantity``,
    ``target``, ``horizon`` and ``contender`` say which cell it is.
    """
    tops, far = tops_of(tables.SCENE, 1, 0), horizons()
    ends = far[far <= 1.0001 * asked["horizon"]]
    place = QUANTITIES.index(asked["quantity"])
    shown, work = np.full((2, 2), np.nan), np.full((2, 2), np.nan)
    for rank, (name, pair) in enumerate(zip(asked["integrators"], asked["settings"], strict=True)):
        runs = measured(integrator(name), tops, [Asked(setting, ends, np.inf) for setting in pair])
        shown[rank] = [errors[place].max() for errors, _ in runs]
        work[rank] = [float(each[0]) for _, each in runs]
    return xr.Dataset(
        {
            "errors": (("rank", "side"), shown),
            "work": (("rank", "side"), work),
            "setting_value": (("rank", "side"), np.array(asked["settings"])),
            "contender": ("rank", list(asked["integrators"])),
            "quantity": ((), asked["quantity"]),
            "target": ((), asked["target"]),
            "checked_horizon": ((), asked["horizon"]),
        }
    )
