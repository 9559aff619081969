"""What the study reads out of its dataset: columns of the histories, behaviour of the constants, lengths of the runs.

The dataset is a tree of four groups, each over ``scene`` and ``integrator``:

    histories   a million steps of every method          `symtop.measure.conservation.history`, read as `Quantity`
    windows     10^8 steps of four methods               `long_runs.windows`, read as `Band`
    rounding    ensembles of runs of the same four       `long_runs.rounding`, read as `Rounding`
    horizons    loss of phase of the fixed-step methods  `phase_loss.phase_loss`, read as `PhaseLoss`
"""

import math
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.base.datasets import row
from symtop.measure.conservation import Trend
from symtop.measure.growth import behaviour

from .long_runs import Rounding
from .phase_loss import PhaseLoss

HISTORIES, WINDOWS, ROUNDINGS, HORIZONS = "histories", "windows", "rounding", "horizons"  # groups
ROUNDED = 3e-13  # relative: the largest change that a million steps of rounding explain
FAILED = "failed"
BEHAVIOURS = ("kept", "bounded", "random walk", "growing", "drift")  # each is worse than those before it
FULL_LENGTH = 0.99  # of the longest run of a scene: a shorter run is named
CLOSE = 0.1  # a prediction that is further off, relative, counts as missed


class Growth(NamedTuple):
    """Columns of a history that energy, p_phi, p_psi and phase have, each under its name: ``energy_largest``, ..."""

    largest: float  # relative; rad for the phase
    exponent: float  # of the growth with time
    exponent_interval: float  # half-width, 95 %
    law: str  # that the exponent agrees with
    change: float  # time at which another law gives way to it; NaN if none does
    before: float  # exponents before and after
    after: float


class Quantity(NamedTuple):
    """What became of one quantity in one run."""

    growth: Growth
    trend: Trend  # all NaN for the phase
    length: float  # of the run, time

    @property
    def doubt(self) -> float:
        """Half-width of the 95 % interval of the linear trend over the whole run."""
        return self.trend.interval * self.length


class Band(NamedTuple):
    """Relative change of one quantity in each window (window,) of a long run."""

    least: np.ndarray
    mean: np.ndarray
    largest: np.ndarray


def cells(data: xr.Dataset) -> list[tuple[str, str, xr.Dataset]]:
    """(scene, integrator, its part of the dataset) of every cell."""
    names = [(str(scene), str(name)) for scene in data["scene"].values for name in data["integrator"].values]
    return [(scene, name, data.sel(scene=scene, integrator=name)) for scene, name in names]


def quantity(cell: xr.Dataset, name: str) -> Quantity:
    """What became of energy, p_phi, p_psi or phase in one run of the histories."""
    trend = row(Trend, cell, f"{name}_") if f"{name}_slope" in cell else Trend(math.nan, math.nan, math.nan)
    return Quantity(row(Growth, cell, f"{name}_"), trend, float(np.nanmax(cell["sample_time"])))


def worst_behaviour(histories: xr.Dataset, name: str) -> str:
    """What became of a constant (see `behaviour`) on the scene where it fared worst; `histories` of one integrator."""
    if not (histories["outcome"] == "ok").all():
        return FAILED
    columns = (histories[f"{name}_{part}"].values for part in ("largest", "exponent", "exponent_interval"))
    return max((behaviour(*map(float, one), ROUNDED) for one in zip(*columns, strict=True)), key=BEHAVIOURS.index)


def shortened(histories: xr.Dataset) -> dict[str, float]:
    """Integrators whose runs are shorter than the others', with the share of the horizon that they were given."""
    ends = histories["sample_time"].max("sample")
    shares = (ends / ends.max("integrator")).min("scene")
    values = {str(name): float(shares.sel(integrator=name)) for name in histories["integrator"].values}
    return {name: share for name, share in values.items() if share < FULL_LENGTH}


def band(cell: xr.Dataset, name: str) -> Band:
    """Relative change of energy, modified_energy, p_phi or p_psi in the windows of one long run."""
    return row(Band, cell, f"{name}_")


def moved(windows: xr.Dataset) -> tuple[float, float]:
    """How far the mean of a window moved from the first to the last, at most over the integrators.

    The energy in widths of its band in the first window, the modified energy relative to the energy's scale.
    """
    full = windows.dropna("window", how="all", subset=["energy_mean"])
    energy, modified = (
        np.abs(full[f"{name}_mean"].isel(window=-1) - full[f"{name}_mean"].isel(window=0))
        for name in ("energy", "modified_energy")
    )
    width = (full["energy_largest"] - full["energy_least"]).isel(window=0)
    return float((energy / width).max()), float(modified.max())


def roundings(data: xr.Dataset) -> dict[str, Rounding]:
    """The ensembles of the group ``rounding``, by integrator."""
    return {name: row(Rounding, cell) for _, name, cell in cells(data)}


def phase_losses(data: xr.Dataset) -> dict[str, PhaseLoss]:
    """The losses of phase of the group ``horizons``, by integrator; without those that could not be predicted."""
    losses = {name: row(PhaseLoss, cell) for _, name, cell in cells(data)}
    return {name: loss for name, loss in losses.items() if math.isfinite(loss.predicted)}


class Missed(NamedTuple):
    """How well the losses of phase were predicted."""

    hits: dict[str, float]  # relative errors of the predictions that are off by `CLOSE` at most
    misses: dict[str, float]  # of the others; NaN where the loss was not reached
    median: float  # of the measured times, in lengths of the run that predicts


def predictions(losses: dict[str, PhaseLoss]) -> Missed:
    """Who was predicted to `CLOSE` when it loses its phase, and who was not."""
    off = {name: abs(loss.ratio - 1.0) for name, loss in losses.items()}
    hits = {name: error for name, error in off.items() if error <= CLOSE}
    times = [loss.measured / loss.short for loss in losses.values() if math.isfinite(loss.measured)]
    misses = {name: error for name, error in off.items() if name not in hits}
    return Missed(hits, misses, float(np.median(times)) if times else math.nan)
