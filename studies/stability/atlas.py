"""Numbers computed from the maps of outcomes: up to which setting a method is accurate, from which it commonly fails.

The *reach* of a row is the largest setting (step or tolerance) up to which every run of the row is accurate. "Slow" and
"fast" tops are the rows below and above the spin that lets the top sleep upright, r < 1 and r > 3; quoted is the lower
10 % quantile of the reach. A run *fails* if it loses energy, crosses a turning point or ends early; a method fails from
the smallest setting on at which, and at every larger one, at least half of the rows fail.
"""

import math
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.methods.framework.registry import Integrator, integrator, integrators, split_name

from .many_verdicts import BOUNDED_BUT_WRONG, JUDGED, VERDICTS, WRONG
from .measures import MECHANISMS
from .outcome_maps import NOT_RUN, SETTLED

SLOW, FAST = 1.0, 3.0  # relative spin
LOWER_SHARE = 0.1  # the quantile of the reach that is quoted
COMMON = 0.5  # share of the rows that must fail, at every larger setting too, for a threshold to be quoted
LASTING = 3  # least number of settings from a threshold on: with one, "every larger setting" would mean nothing
NEAR, FAR = 1e-4, 0.1  # gaps delta: next to a pole, and well away from it


class Failure(NamedTuple):
    """From which setting on a method commonly fails, and how."""

    setting: float  # NaN if there are no `LASTING` settings at each of which at least `COMMON` of the rows fail
    kind: str  # the most frequent verdict on failed runs from there on (with NaN: on all); empty without any


class OutcomeMap(NamedTuple):
    """One integrator's map as the dataset has it, without unused margins."""

    outcome: np.ndarray  # (parameters, settings), index into VERDICTS; accurate where nothing was run
    parameter: np.ndarray
    settings: np.ndarray  # steps in nutation periods, or tolerances
    control: str  # step_size, tolerance or none
    made: np.ndarray  # (parameters, settings): true if it was run, false if the scene had settled (`outcome_maps`)

    @property
    def reach(self) -> np.ndarray:
        """For each row the largest setting up to which every run is accurate; 0 if the smallest is not."""
        wrong = self.outcome != 0
        first = np.where(wrong.any(axis=1), wrong.argmax(axis=1), self.settings.size)
        return np.where(first > 0, self.settings[np.maximum(first - 1, 0)], 0.0)

    @property
    def usual_reach(self) -> dict[str, float]:
        """The lower 10 % quantile of the reach of fast tops and of slow tops; NaN where the map has none."""
        rows = {"fast": self.reach[self.parameter > FAST], "slow": self.reach[self.parameter < SLOW]}
        return {
            kind: float(np.quantile(values, LOWER_SHARE, method="lower")) if values.size else math.nan
            for kind, values in rows.items()
        }

    @property
    def accurate(self) -> float:
        """The share of the accurate runs."""
        return float(np.mean(self.outcome == 0))

    @property
    def early(self) -> float:
        """The share of the runs that ended early."""
        return float(np.mean((self.outcome >= len(JUDGED)) & (self.outcome != WRONG)))

    @property
    def silent(self) -> float:
        """The share of the inaccurate runs that ended without an error; NaN if every run is accurate."""
        wrong = self.outcome[self.outcome != 0]
        return float(np.mean((wrong < len(JUDGED)) | (wrong == WRONG))) if wrong.size else math.nan

    @property
    def failure(self) -> Failure:
        """Where at least `COMMON` of the rows fail at every larger setting; an energy error below 1 % is no failure."""
        failed = (self.outcome > BOUNDED_BUT_WRONG) & (self.outcome != WRONG)
        share = failed.mean(axis=0)
        rare = np.flatnonzero(share < COMMON)
        first = int(rare[-1]) + 1 if rare.size else 0
        lasting = share.size - first >= LASTING
        part = slice(first, None) if lasting else slice(None)
        kinds = np.bincount(self.outcome[:, part][failed[:, part]], minlength=len(VERDICTS))
        return Failure(
            float(self.settings[first]) if lasting else math.nan, VERDICTS[int(kinds.argmax())] if kinds.any() else ""
        )


def map_of(cell: xr.Dataset) -> OutcomeMap | None:
    """The map in the dataset of one scene and one integrator, or None if there is none."""
    if "outcome" not in cell:
        return None
    outcome = cell["outcome"].values
    rows, columns = (outcome != NOT_RUN).any(axis=1), (outcome != NOT_RUN).any(axis=0)
    if not rows.any():
        return None
    parameter, settings = cell["parameter_value"].values[rows], cell["control"].values[columns]
    outcome = outcome[rows][:, columns]
    made = outcome != SETTLED
    return OutcomeMap(np.where(made, outcome, np.uint8(0)), parameter, settings, str(cell["knob_name"].values), made)


def maps(data: xr.Dataset, scene: str) -> dict[str, OutcomeMap]:
    """The maps over a family of scenes by the names of their integrators."""
    if scene not in data["scene"].values or "outcome" not in data:
        return {}
    part = data[["outcome", "parameter_value", "control", "knob_name"]].sel(scene=scene)
    read = {str(name): map_of(part.sel(variant=name)) for name in data["variant"].values}
    return {name: map_ for name, map_ in read.items() if map_ is not None}


def methods_of(data: xr.Dataset) -> dict[str, Integrator]:
    """The integrators of a dataset that are registered, by the names of their variants."""
    names = map(str, data["variant"].values)
    return {name: integrator(name) for name in names if split_name(name)[0] in integrators()}


def families(data: xr.Dataset) -> list[str]:
    """The scenes that have a map over spin."""
    return [str(name) for name in data["scene"].values if str(name) not in MECHANISMS]


def halved_by_pole(map_: OutcomeMap | None) -> bool | None:
    """Is the median reach at gaps of `NEAR` and less below half of that at `FAR` and more? None with nothing to set."""
    if map_ is None or map_.control == "none":
        return None
    limits, gaps = map_.reach, map_.parameter
    return bool(np.median(limits[gaps <= NEAR]) < 0.5 * np.median(limits[gaps >= FAR]))
