"""What the study reads out of its dataset: behaviour of the constants, lengths of the runs, predicted losses of phase.

The dataset is a tree of four groups, each over ``scene`` and ``variant``; these say what their variables are:

    histories   a million steps of every method          `growth.history`
    windows     10^8 steps of four methods               `symtop.run.long_run.long_run`
    rounding    ensembles of runs of the same four       `runs.rounding`
    horizons    loss of phase of the fixed-step methods  `phase_loss.phase_loss`
"""

import math

import numpy as np
import pandas as pd
import xarray as xr

from symtop.measure.conservation import CONSTANTS, behaviour
from symtop.model.charts import Array
from symtop.model.scenes import scenes

HISTORIES, WINDOWS, ROUNDINGS, HORIZONS = "histories", "windows", "rounding", "horizons"  # groups
FAILED = "failed"
BEHAVIOURS = ("kept", "bounded", "random walk", "growing", "drift")  # each is worse than those before it
HELD = BEHAVIOURS[:2]
AS_TIME = 0.1  # of an exponent


def by_integrator(data: xr.Dataset) -> dict[str, xr.Dataset]:
    """The parts of a group that ran on one scene."""
    return {str(name): data.isel(scene=0).sel(variant=name) for name in data["variant"].values}


def losses(horizons: xr.Dataset) -> dict[str, xr.Dataset]:
    """The losses of phase by integrator, without those that could not be predicted."""
    return {name: cell for name, cell in by_integrator(horizons).items() if math.isfinite(cell["predicted"])}


def worst_behaviour(histories: xr.Dataset, name: str) -> str:
    """The worst behaviour (see `behaviour`) of a constant over all scenes; `histories` of one integrator."""
    if not (histories["outcome"] == "ok").all():
        return FAILED
    columns = (histories[f"{name}_{part}"].values for part in ("largest", "exponent", "exponent_interval"))
    grains = [grain(str(scene_name), name) for scene_name in histories["scene"].values]
    behaviours = (behaviour(*map(float, row)) for row in zip(*columns, grains, strict=True))
    return max(behaviours, key=BEHAVIOURS.index)


def grain(scene_name: str, name: str) -> float:
    """The rounding of a constant on a scene, in machine epsilons; an energy's is relative to that of the nutation."""
    known = scenes()
    return known[scene_name].energy_grain if name == "energy" and scene_name in known else 1.0


def fates(histories: xr.Dataset) -> pd.DataFrame:
    """One row for each variant: the worst behaviour of each constant over all scenes, and its largest change.

    Columns NAME, one of `BEHAVIOURS` or `FAILED`, and NAME_largest, relative, for each of `CONSTANTS`.
    """
    lines = pd.DataFrame(index=list(map(str, histories["variant"].values)))
    for name in CONSTANTS:
        columns = histories[["outcome", *(f"{name}_{part}" for part in ("largest", "exponent", "exponent_interval"))]]
        lines[name] = [worst_behaviour(columns.isel(variant=k), name) for k in range(len(lines))]
        lines[f"{name}_largest"] = columns[f"{name}_largest"].max("scene").values
    return lines


def phases_by_energy(histories: xr.Dataset) -> dict[str, Array]:
    """Growth exponents of the phase error of all runs, by what the energy does: "bounded", "lost" or "kept"."""
    groups: dict[str, list[float]] = {"bounded": [], "lost": [], "kept": []}
    for name in histories["scene"].values:  # a variant may keep the energy on one scene and lose it on another
        part = histories.sel(scene=[name])
        for word, slope in zip(fates(part)["energy"], part["phase_exponent"].squeeze("scene").values, strict=True):
            if word != FAILED and np.isfinite(slope):
                groups[word if word in HELD else "lost"].append(float(slope))
    return {word: np.array(slopes) for word, slopes in groups.items()}


def as_time(slopes: Array) -> Array:
    """Which errors grow as t: their exponent is 1 within `AS_TIME`."""
    return np.abs(slopes - 1.0) <= AS_TIME


def faster(slopes: Array) -> Array:
    """Which errors grow faster than t."""
    return slopes > 1.0 + AS_TIME


def shares(histories: xr.Dataset) -> Array:
    """The length of every variant's run over that of the longest, on the scene where it is least."""
    ends = histories["sample_time"].max("sample")
    return (ends / ends.max("variant")).min("scene").values


def shifts(windows: xr.Dataset) -> xr.DataArray:
    """The mean energy of each window less that of the first window, over the width of its oscillation there.

    The means scatter: short windows hold no whole number of oscillations, and the samples of a longer one may beat
    with them.
    """
    full = windows.dropna("window", how="all", subset=["energy_mean"])
    first = full.isel(window=0)
    return (full["energy_mean"] - first["energy_mean"]) / (first["energy_largest"] - first["energy_least"])
