"""What the study reads out of its dataset: behaviour of the constants, lengths of the runs, predicted losses of phase.

The dataset is a tree of four groups, each over ``scene`` and ``variant``; these say what their variables are:

    histories   a million steps of every method          `growth.history`
    windows     10^8 steps of four methods               `symtop.run.long_run.long_run`
    rounding    ensembles of runs of the same four       `runs.rounding`
    horizons    loss of phase of the fixed-step methods  `phase_loss.phase_loss`
"""

import math

import xarray as xr

from symtop.measure.conservation import RUN_ROUNDING, behaviour
from symtop.model.scenes import scenes

HISTORIES, WINDOWS, ROUNDINGS, HORIZONS = "histories", "windows", "rounding", "horizons"  # groups
FAILED = "failed"
BEHAVIOURS = ("kept", "bounded", "random walk", "growing", "drift")  # each is worse than those before it


def by_integrator(data: xr.Dataset) -> dict[str, xr.Dataset]:
    """The parts of a group that ran on one scene."""
    return {str(name): data.isel(scene=0).sel(variant=name) for name in data["variant"].values}


def losses(horizons: xr.Dataset) -> dict[str, xr.Dataset]:
    """The losses of phase by integrator, without those that could not be predicted."""
    return {name: cell for name, cell in by_integrator(horizons).items() if math.isfinite(cell["predicted"])}


def worst_behaviour(histories: xr.Dataset, name: str) -> str:
    """What became of a constant (see `behaviour`) on the scene where it fared worst; `histories` of one integrator."""
    if not (histories["outcome"] == "ok").all():
        return FAILED
    columns = (histories[f"{name}_{part}"].values for part in ("largest", "exponent", "exponent_interval"))
    grains = [grain(str(scene_name), name) for scene_name in histories["scene"].values]
    behaviours = (behaviour(*map(float, one)) for one in zip(*columns, grains, strict=True))
    return max(behaviours, key=BEHAVIOURS.index)


def grain(scene_name: str, name: str) -> float:
    """The rounding of a constant on a scene, in units of the machine's: that of an energy counts from E0 - min V."""
    known = scenes()
    return known[scene_name].energy_grain if name == "energy" and scene_name in known else 1.0


def rounding(cell: xr.Dataset, name: str) -> float:
    """The largest relative change of a constant that a million steps of rounding explain, in a cell of one scene."""
    constant = "energy" if name == "phase" else name
    return RUN_ROUNDING * grain(str(cell["scene"].item()) if "scene" in cell.coords else "", constant)
