"""What the study reads out of its dataset: behaviour of the constants, lengths of the runs, predicted losses of phase.

The dataset is a tree of four groups, each over ``scene`` and ``integrator``; these say what their variables are:

    histories   a million steps of every method          `symtop.measure.conservation.history`
    windows     10^8 steps of four methods               `symtop.run.long_run.long_run`
    rounding    ensembles of runs of the same four       `long_runs.rounding`
    horizons    loss of phase of the fixed-step methods  `phase_loss.phase_loss`
"""

import math

import xarray as xr

from symtop.measure.growth import behaviour

HISTORIES, WINDOWS, ROUNDINGS, HORIZONS = "histories", "windows", "rounding", "horizons"  # groups
ROUNDED = 3e-13  # relative: the largest change that a million steps of rounding explain
FAILED = "failed"
BEHAVIOURS = ("kept", "bounded", "random walk", "growing", "drift")  # each is worse than those before it


def by_integrator(data: xr.Dataset) -> dict[str, xr.Dataset]:
    """The parts of a group that ran on one scene."""
    return {str(name): data.isel(scene=0).sel(integrator=name) for name in data["integrator"].values}


def losses(horizons: xr.Dataset) -> dict[str, xr.Dataset]:
    """The losses of phase by integrator, without those that could not be predicted."""
    return {name: cell for name, cell in by_integrator(horizons).items() if math.isfinite(cell["predicted"])}


def worst_behaviour(histories: xr.Dataset, name: str) -> str:
    """What became of a constant (see `behaviour`) on the scene where it fared worst; `histories` of one integrator."""
    if not (histories["outcome"] == "ok").all():
        return FAILED
    columns = (histories[f"{name}_{part}"].values for part in ("largest", "exponent", "exponent_interval"))
    return max((behaviour(*map(float, one), ROUNDED) for one in zip(*columns, strict=True)), key=BEHAVIOURS.index)
