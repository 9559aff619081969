"""What the maps of outcomes say in numbers: how far a method is accurate, and from where on it commonly fails.

The *reach* of a row is the largest setting (step or tolerance) up to which every run of the row is accurate. "Slow" and
"fast" tops are the rows below and above the spin that lets the top sleep upright, r < 1 and r > 3; a sentence quotes
the reach that nine rows in ten have. A failure counts from the smallest setting at which one row in twenty shows it.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.measure.verdicts import BOUNDED_BUT_WRONG, JUDGED, VERDICTS
from symtop.methods.registry import integrators

from .outcome_maps import NOT_RUN
from .tables import MECHANISMS, Column

SLOW, FAST = 1.0, 3.0  # relative spin
LOWER_SHARE = 0.1  # of the rows may reach less far than what is quoted
COMMON = 0.05  # of the rows must fail before a failure counts
NEAR, FAR = 1e-4, 0.1  # gaps delta: next to a pole, and well away from it


class OutcomeMap(NamedTuple):
    """One integrator's map as the dataset has it, without unused margins."""

    outcome: np.ndarray  # (parameters, settings), index into VERDICTS
    parameter: np.ndarray
    settings: np.ndarray  # steps in nutation periods, or tolerances
    control: str  # step_size, tolerance or none


def stored_map(data: xr.Dataset, scene: str, name: str) -> OutcomeMap | None:
    """The map of an integrator over a family of scenes, or None if there is none."""
    if Column.OUTCOME not in data or scene not in data["scene"].values or name not in data["integrator"].values:
        return None
    cell = data.sel(scene=scene, integrator=name)
    outcome = cell[Column.OUTCOME].values
    rows, columns = (outcome != NOT_RUN).any(axis=1), (outcome != NOT_RUN).any(axis=0)
    if not rows.any():
        return None
    parameter, settings = cell[Column.PARAMETER].values[rows], cell[Column.SETTING].values[columns]
    return OutcomeMap(outcome[rows][:, columns], parameter, settings, str(cell[Column.CONTROL].values))


def families(data: xr.Dataset) -> list[str]:
    """The scenes that have a map over spin."""
    return [str(name) for name in data["scene"].values if str(name) not in MECHANISMS]


def maps(data: xr.Dataset, family: str) -> dict[str, OutcomeMap]:
    """The maps over a family by the names of their integrators."""
    read = {str(name): stored_map(data, family, str(name)) for name in data["integrator"].values}
    return {name: one for name, one in read.items() if one is not None}


def reach(one: OutcomeMap) -> np.ndarray:
    """For each row the largest setting up to which every run is accurate; 0 if the smallest is not."""
    wrong = one.outcome != 0
    first = np.where(wrong.any(axis=1), wrong.argmax(axis=1), one.settings.size)
    return np.where(first > 0, one.settings[np.maximum(first - 1, 0)], 0.0)


def first_failures(one: OutcomeMap) -> list[tuple[float, str]]:
    """Smallest setting at which each outcome but `accurate` and `bounded_but_wrong` is common, smallest first."""
    rows = max(1, math.ceil(COMMON * one.outcome.shape[0]))
    starts = []
    for index, word in enumerate(VERDICTS):
        if index in (0, BOUNDED_BUT_WRONG):
            continue
        columns = np.flatnonzero(np.sum(one.outcome == index, axis=0) >= rows)
        if columns.size:
            starts.append((float(one.settings[columns[0]]), word))
    return sorted(starts)


def lower_quantile(values: np.ndarray) -> float:
    """The lower 10 % quantile; NaN of nothing."""
    return float(np.quantile(values, LOWER_SHARE, method="lower")) if values.size else math.nan


class PoleEffect(NamedTuple):
    """How a pole next to the path changes the reach of a method."""

    away: float  # median reach at gaps of `FAR` and more
    near: float  # at gaps of `NEAR` and less
    width: float  # rad, distance of the pole below which the reach is less than half of that away from it

    @property
    def halves(self) -> bool:
        """Is the reach next to the pole less than half of that away from it?"""
        return self.near < 0.5 * self.away


def pole_effect(data: xr.Dataset, name: str) -> PoleEffect | None:
    """The effect of a pole on a method; None if it has no map over the gap, or nothing to set."""
    one = stored_map(data, "grazing", name)
    if one is None or one.control == "none":
        return None
    limits, gaps = reach(one), one.parameter
    away, near = float(np.median(limits[gaps >= FAR])), float(np.median(limits[gaps <= NEAR]))
    return PoleEffect(away, near, 1.1 * float(gaps[limits < 0.5 * away].max(initial=0.0)))


def shares(data: xr.Dataset, family: str) -> dict[str, np.ndarray]:
    """For each integrator the share of its map that each of `VERDICTS` has."""
    return {
        name: np.bincount(one.outcome.ravel(), minlength=len(VERDICTS)) / one.outcome.size
        for name, one in maps(data, family).items()
    }


def silent_share(one: OutcomeMap) -> float:
    """Share of a map's inaccurate runs that ended without an error."""
    wrong = one.outcome != 0
    silent = wrong & (one.outcome < len(JUDGED))
    return float(silent.sum() / wrong.sum()) if wrong.any() else 0.0


def pages(names: Sequence[str]) -> dict[str, list[str]]:
    """The integrators of the atlas by page: one a family, the large splitting family in three."""
    registered = integrators()
    by_page: dict[str, list[str]] = {}
    for name in names:
        method = registered.get(name)
        page = method.family if method else "other"
        if method and page == "splitting":
            if method.charts() == ("angles",):
                page = "splitting-angles"
            else:
                page = "splitting-space" if (method.order or 2) <= 4 else "splitting-high-order"
        elif method and page == "runge-kutta" and method.symmetric:
            page = "gauss"
        elif method and not method.fixed_step:
            page = "adaptive"
        by_page.setdefault(page, []).append(name)
    return by_page
