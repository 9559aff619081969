"""What the study reads out of its dataset: behaviour of the constants, lengths of the runs, predicted losses of phase.

The dataset is a tree of four groups, each over ``scene`` and ``variant``; these say what their variables are:

    histories   a million steps of every method          `growth.history`
    windows     10^8 steps of four methods               `symtop.run.long_run.long_run`
    rounding    ensembles of runs of the same four       `runs.rounding`
    horizons    loss of phase of the fixed-step methods  `phase_loss.phase_loss`
"""

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from symtop.measure.conservation import CONSTANTS, RUN_ROUNDING, behaviour
from symtop.methods.framework.registry import split_name
from symtop.model.charts import Array
from symtop.model.scenes import scenes

HISTORIES, WINDOWS, ROUNDINGS, HORIZONS = "histories", "windows", "rounding", "horizons"  # groups
FAILED = "failed"
BEHAVIOURS = ("kept", "bounded", "random walk", "growing", "drift")  # each is worse than those before it
HELD = BEHAVIOURS[:2]
AS_TIME = 0.1  # of an exponent
APART = 2.0  # times: two charts of one method differ by more than this, one of them above rounding


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


def without_repeats(histories: xr.Dataset) -> xr.Dataset:
    """The variants that are shown: no attitude chart beside an axis chart, whose numbers it repeats."""
    names = list(map(str, histories["variant"].values))
    repeats = {name.replace("[axis]", "[attitude]") for name in names if name.endswith("[axis]")}
    return histories.sel(variant=[name for name in names if name not in repeats])


def fates(histories: xr.Dataset) -> pd.DataFrame:
    """A line a variant: what became of each constant on the scene where it fared worst, and its largest change.

    Columns NAME, one of `BEHAVIOURS` or `FAILED`, and NAME_largest, relative, for each of `CONSTANTS`.
    """
    lines = pd.DataFrame(index=list(map(str, histories["variant"].values)))
    for name in CONSTANTS:
        asked = histories[["outcome", *(f"{name}_{part}" for part in ("largest", "exponent", "exponent_interval"))]]
        lines[name] = [worst_behaviour(asked.isel(variant=k), name) for k in range(len(lines))]
        lines[f"{name}_largest"] = asked[f"{name}_largest"].max("scene").values
    return lines


def phases_by_energy(histories: xr.Dataset) -> dict[str, Array]:
    """Growth exponents of the phase error of all runs, by what the energy does: "bounded", "lost" or "kept"."""
    groups: dict[str, list[float]] = {"bounded": [], "lost": [], "kept": []}
    for name, word in fates(histories)["energy"].items():
        slopes = histories["phase_exponent"].sel(variant=name).values.ravel()
        if word != FAILED:
            groups[word if word in HELD else "lost"].extend(slopes[np.isfinite(slopes)])
    return {word: np.array(slopes) for word, slopes in groups.items()}


def as_time(slopes: Array) -> Array:
    """Which errors grow as t, to `AS_TIME` of the exponent."""
    return np.abs(slopes - 1.0) <= AS_TIME


def faster(slopes: Array) -> Array:
    """Which errors grow faster."""
    return slopes > 1.0 + AS_TIME


def shares(histories: xr.Dataset) -> Array:
    """The length of every variant's run over that of the longest, on the scene where it is least."""
    ends = histories["sample_time"].max("sample")
    return (ends / ends.max("variant")).min("scene").values


class Pair(NamedTuple):
    """One constant in two charts of one method: the largest change over all scenes in each."""

    constant: str
    worse: str  # name of a variant
    better: str
    change: float  # relative, of the worse variant
    other: float  # of the better one


def pairs(histories: xr.Dataset) -> Iterator[Pair]:
    """Every two charts of a method for every constant; runs that ended early are left out."""
    whole = histories.sel(variant=(histories["outcome"] == "ok").all("scene"))
    rows: dict[str, list[str]] = {}
    for name in map(str, whole["variant"].values):
        rows.setdefault(split_name(name)[0], []).append(name)
    for constant in CONSTANTS:
        largest = whole[f"{constant}_largest"].max("scene", skipna=False).to_series()
        for two in itertools.chain.from_iterable(itertools.combinations(names, 2) for names in rows.values()):
            better, worse = sorted(two, key=largest.__getitem__)
            yield Pair(constant, worse, better, float(largest[worse]), float(largest[better]))


def apart(histories: xr.Dataset) -> list[Pair]:
    """Two charts of a method of which one keeps a constant much better than the other."""
    explained = {
        constant: max(rounding(histories.sel(scene=scene), constant) for scene in histories["scene"].values)
        for constant in CONSTANTS
    }
    return [one for one in pairs(histories) if one.change > max(explained[one.constant], APART * one.other)]


def shifts(windows: xr.Dataset) -> xr.DataArray:
    """The mean energy of each window less that of the first window, over the width of its oscillation there.

    The means scatter: short windows hold no whole number of oscillations, and the samples of a longer one may beat
    with them.
    """
    full = windows.dropna("window", how="all", subset=["energy_mean"])
    first = full.isel(window=0)
    return (full["energy_mean"] - first["energy_mean"]) / (first["energy_largest"] - first["energy_least"])
