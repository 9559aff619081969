"""Every setting of a method that a ranking of costs needs, from coarse to fine.

A ranking wants all targets, and a fixed ladder gives a method the first rung below each, up to a rung's ratio too
expensive. So each method walks from coarse to fine, about `DECADES` of error a step, until the finest target is met,
rounding stops it, or the next run would exceed a budget of force evaluations; each target is then approached from the
two runs around it, to within a `CLOSE` part. Every run is kept. A target is asked only if it is less than the width of
the nutation: a motion without any nutation meets the others.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from symtop.measure.accuracy import as_table, error_row
from symtop.measure.settings import NEAR_ROUNDING, TARGETS, between, limits
from symtop.measure.verdicts import barriers
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene

COARSEST_TOLERANCE = 1e-2  # that a walk begins with
DECADES = 1.9  # of error between neighbours of the first walk
NOTCHES = 2.5  # decades of tolerance likewise
CLOSE = 0.6  # an error between CLOSE times the target and the target is near enough
AIM = 0.85
REFINEMENTS = 2
NEARBY = 1.2  # a setting less coarser than that is not worth a run
MOST_RUNS = 24  # runs of one walk
ABOVE = 2.0  # times the budget: a run that costs more ends, whatever was foreseen (rk45 at 1e-2 may shrink its steps)
STALLED = 1.5  # two steps in a row that gain less than this, below `NEAR_ROUNDING`, have met rounding
STOPS = ("all targets met", "rounding", "budget", "least tolerance", "nothing to set", "too many runs")
TOO_WIDE = "wider than the nutation"  # of a target
CAPPED = "met at the longest step"  # or the loosest tolerance: a longer one might do

Row = dict[str, Any]


def spans(scene: Scene, periods: Sequence[float]) -> list[float]:
    """Times of so many nutation periods; on a separatrix, of so many tenths of the scene's horizon.

    Tenths, not the eighths of `Scene.time_scale`: the horizons of stored studies are made of them.
    """
    period = scene.nutation_period if math.isfinite(scene.nutation_period) else 0.1 * scene.horizon
    return [count * period for count in periods]


def nutation_width(scene: Scene) -> float:
    """The angle between the lowest and the highest place of the axis in a nutation, rad."""
    ends = barriers(scene)
    return ends.lowest - ends.highest


def coarse_setting(scene: Scene, method: Integrator, horizon: float) -> float:
    """The setting that a walk from coarse to fine begins with."""
    if not method.fixed_step:
        return COARSEST_TOLERANCE
    power = method.order or 2
    step = scene.time_scale(horizon) / (7.37 if power <= 2 else 5.37 if power <= 4 else 4.37)
    return min(step, limits(scene, method, horizon)[1])


class Walk:
    """All runs of one method on one scene to one horizon, by setting."""

    def __init__(self, scene: Scene, method: Integrator, horizon: float, budget: float) -> None:
        self.scene, self.method, self.horizon, self.budget = scene, method, horizon, budget
        self.rows: dict[float, Row] = {}
        self.stopped = ""
        self.power = float(method.order or (2 if method.fixed_step else 8))
        self.finest, self.coarsest = limits(scene, method, horizon)

    def run(self, setting: float) -> Row:
        """Measure a setting, once."""
        if setting not in self.rows:
            most = ABOVE * self.budget if self.method.adaptive else None
            row = error_row(self.scene, self.method, setting, self.horizon, "axis", phases=True, budget=most)
            self.rows[setting] = row | {"setting_value": setting}
        return self.rows[setting]

    def error(self, setting: float) -> float:
        """Largest axis error at a setting, infinite after a failure."""
        error = float(self.run(setting)["axis"])
        return error if math.isfinite(error) else math.inf

    def growth(self, ratio: float) -> float:
        """How the work grows if the setting is divided by `ratio`."""
        return ratio if self.method.fixed_step else ratio ** (1.0 / min(self.power + 1.0, 20.0))

    def descend(self, targets: Sequence[float], expected: float) -> None:
        """Walk from coarse to fine; `expected` is the work of the first run, if known."""
        setting, stepping = coarse_setting(self.scene, self.method, self.horizon), self.method.fixed_step
        ratio = min(max(10.0 ** (DECADES / self.power), 1.35), 3.5) if stepping else 10.0**NOTCHES
        flat, last, work = 0, math.inf, expected
        while True:
            if work > self.budget:
                self.stopped = "budget"
                return
            error = self.error(setting)
            work = float(self.rows[setting]["force_evaluations"])
            flat = flat + 1 if error < NEAR_ROUNDING and error > last / STALLED else 0
            if error <= min(targets) or flat == 2 or setting <= self.finest or len(self.rows) >= MOST_RUNS:
                met, stuck = error <= min(targets), flat == 2
                least = setting <= self.finest
                self.stopped = STOPS[0] if met else STOPS[1] if stuck else STOPS[3] if least else STOPS[5]
                return
            last = error
            room = self.budget / max(work, 1.0)
            if self.growth(ratio) > room > self.growth(1.3) and stepping:
                setting, work = setting / room, self.budget  # the last run that can be afforded
            else:
                setting, work = max(setting / ratio, self.finest), work * self.growth(ratio)

    def coarsen(self, target: float) -> None:
        """Coarser settings, as long as they meet the loosest target."""
        while True:
            last = max(self.rows)
            setting = min(2.0 * last, self.coarsest)
            if setting < NEARBY * last or self.error(last) > target:
                return
            self.run(setting)

    def approach(self, target: float) -> None:
        """Come close to a target between the coarsest run that meets it and its coarser neighbour."""
        for _ in range(REFINEMENTS):
            settings = sorted(self.rows, reverse=True)
            met = [k for k, setting in enumerate(settings) if self.error(setting) <= target]
            if not met or met[0] == 0 or self.error(settings[met[0]]) >= CLOSE * target:
                return
            fine, coarse = settings[met[0]], settings[met[0] - 1]
            setting = between(fine, self.error(fine), coarse, self.error(coarse), AIM * target)
            if self.method.fixed_step and round(self.horizon / setting) in {
                round(self.horizon / fine), round(self.horizon / coarse)
            }:  # fmt: skip
                return
            self.run(setting)

    def reached(self, target: float) -> str:
        """Is a target met, and if not, why? If no run ended well, it is the outcome of the finest."""
        met = [setting for setting in self.rows if self.error(setting) <= target]
        if self.rows and all(row["outcome"] != "ok" for row in self.rows.values()):
            return str(self.rows[min(self.rows)]["outcome"]).replace("_", " ")
        capped = self.method.control is not None and bool(met) and max(met) > self.coarsest / NEARBY
        return CAPPED if capped else "met" if met else self.stopped


def work_table(scene: Scene, method: Integrator, horizons: Sequence[float], budget: float) -> xr.Dataset:
    """Errors and work of every setting that was tried: dimensions ``horizon`` (whole numbers) and ``setting``.

    Horizons increase; the cost of a run is foreseen from the horizon before. Settings go from coarse to fine. Variables
    are those of `error_table`, those of `phase`, ``stopped(horizon)``, one of `STOPS`, which says why there is nothing
    finer, ``reached(horizon, target)``, "met" or why not, and the method's ``control`` and ``nutation_width``.
    """
    width = nutation_width(scene)
    targets = [target for target in TARGETS if target < width] or [min(TARGETS)]
    tables: list[list[Row]] = []
    stops: list[str] = []
    reached: list[list[str]] = []
    spent: dict[float, float] = {}
    before = math.inf
    for horizon in horizons:
        walk = Walk(scene, method, horizon, budget)
        expected = min(spent.values(), default=0.0) * (horizon / before if math.isfinite(before) else 1.0)
        if method.control is None:
            walk.run(math.nan)
            walk.stopped = "nothing to set"
        else:
            walk.descend(targets, expected)
            if walk.rows:
                walk.coarsen(max(targets))
                for target in targets:
                    walk.approach(target)
        spent = {setting: float(row["force_evaluations"]) for setting, row in walk.rows.items()} or spent
        before = horizon if walk.rows else before
        tables.append([walk.rows[setting] for setting in sorted(walk.rows, reverse=True)])
        stops.append(walk.stopped)
        reached.append([walk.reached(target) if target < width else TOO_WIDE for target in TARGETS])
    return (
        _stack(tables, method.implementation)
        .assign(stopped=("horizon", stops), reached=(("horizon", "target"), reached))
        .assign(control=((), method.control or ""), nutation_width=((), width))
        .assign_coords(target=list(TARGETS))
    )


def _stack(tables: Sequence[Sequence[Row]], implementation: str) -> xr.Dataset:
    """One dataset over horizon and setting; settings that were not tried are NaN, their outcome "not_run"."""
    names = next(rows for rows in tables if rows)[0]
    blank = dict.fromkeys(names, math.nan) | {"outcome": "not_run", "implementation": implementation}
    size = max(len(rows) for rows in tables)
    filled = [as_table([*rows, *[blank] * (size - len(rows))]) for rows in tables]
    return xr.concat(filled, dim="horizon") if len(filled) > 1 else filled[0].expand_dims("horizon")


def least_work(data: xr.Dataset, target: float) -> np.ndarray:
    """Place along ``setting``, which comes last, of the run of least work that ended well and meets a target, or -1."""
    work = data["force_evaluations"].values
    with np.errstate(invalid="ignore"):
        good = (data["axis"].values <= target) & (data["outcome"].values == "ok") & np.isfinite(work)
    return np.where(good.any(axis=-1), np.argmin(np.where(good, work, np.inf), axis=-1), -1)
