"""Results of the measurements of single mechanisms, each computed from its scene of the dataset."""

import math

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from symtop.model.scenes import scene as scene_of

from .atlas import methods_of
from .failures import growth_rate

BARELY = 0.02  # rad: a resonance is a step at which some displacement below this runs away
NEXT = 1.05  # upper bound of the ratio of the first displacement that runs away to the last that survives
REVIVAL = 3.0  # past a resonance displacements over this many times larger survive; otherwise it is no resonance
LEAST_SAMPLED = 1e-14  # energy errors up to this are rounding
LEAST_ASKED = 1e-12  # only energy errors at every step above this are compared with sampled ones
OUTLASTS = 5.0  # in units of 1/λ, the time in which an error grows by two digits
EARLY = 1e-15, 1e-2  # rad, range of early axis errors that predict the time next to a separatrix: no rounding, small


def measured(data: xr.Dataset, scene: str, variable: str) -> bool:
    """Does any variant have a value of a variable on a scene?"""
    return (
        scene in data["scene"].values
        and variable in data
        and bool(np.isfinite(data[variable].sel(scene=scene).values).any())
    )


def variants_with(part: xr.Dataset, variable: str) -> dict[str, xr.Dataset]:
    """The variants that have a value of a variable, by name."""
    cells = {str(name): part.sel(variant=name) for name in part["variant"].values if variable in part}
    return {name: cell for name, cell in cells.items() if np.isfinite(cell[variable].values).any()}


def limits(part: xr.Dataset) -> dict[str, float]:
    """The least step, as h omega, at which small nutations grow, of the methods that have a limit or a window."""
    cells = variants_with(part, "limit_phase") | variants_with(part, "window_start")
    return {
        name: float(np.fmin(cell.get("limit_phase", math.nan), cell.get("window_start", math.nan)))
        for name, cell in cells.items()
    }  # a narrow window may come first, or be all there is


def resonant(part: xr.Dataset) -> dict[str, float]:
    """By variant the resonant step (h omega): linearly stable, but small displacements run away, and none just past."""
    phases = {}
    for name, cell in variants_with(part, "third_turn_phase").items():
        before, after = float(cell["surviving_at_third_turn"]), float(cell["surviving_past_third_turn"])
        if after > REVIVAL * before and NEXT * before < BARELY:
            phases[name] = float(cell["third_turn_phase"])
    return phases


def rate() -> float:
    """λ of the scene next to whose separatrix methods run."""
    return growth_rate(scene_of("separatrix"))


def outlasting(part: xr.Dataset) -> list[str]:
    """Variants with a run that stays accurate next to the separatrix longer than predicted, by over `OUTLASTS`."""
    longer = rate() * (part["horizon"] - part["predicted_horizon"]).transpose("variant", ...).values
    variants = zip(map(str, part["variant"].values), longer, strict=True)
    return [name for name, values in variants if np.max(values[np.isfinite(values)], initial=0.0) > OUTLASTS]


def lawful(part: xr.Dataset) -> xr.DataArray:
    """To which runs next to the separatrix does the law of their early error apply?"""
    early, methods, apart = part["early_error"], methods_of(part), outlasting(part)
    conserving = [
        name in apart or (name in methods and "energy" in (methods[name].conserves or ()))
        for name in map(str, part["variant"].values)
    ]
    return (early < EARLY[1]) & (early > EARLY[0]) & ~xr.DataArray(conserving, dims="variant")


def misses(part: xr.Dataset) -> NDArray[np.float64]:
    """By how much the law misses the accurate time of the runs to which it applies, in units of 1/λ."""
    gap = rate() * np.abs(part["horizon"] - part["predicted_horizon"]).where(lawful(part)).values
    return np.asarray(gap[np.isfinite(gap)])


def sampled(part: xr.Dataset) -> tuple[list[str], dict[str, float]]:
    """Variants whose energy error is at rounding if sampled once a nutation; for others, true over sampled error.

    No ratio is formed with a number at rounding.
    """
    pairs = {name: (float(cell["energy_once"]), float(cell["energy_every"]))
             for name, cell in variants_with(part, "energy_once").items()}  # fmt: skip
    asked = {name: pair for name, pair in pairs.items() if pair[1] > LEAST_ASKED}
    hidden = [name for name, (once, _) in asked.items() if once <= LEAST_SAMPLED]
    return hidden, {name: every / once for name, (once, every) in asked.items() if name not in hidden}
