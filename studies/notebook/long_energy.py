"""From when on a discrete method keeps the energy better than the notebook's solver, in runs far beyond the notebook.

A discrete Lagrangian has an energy error of O(h^2) from the first nutation on, which does not grow. The solver begins
with an error of its tolerance, which grows about as t. The time at which they cross is measured here with the
notebook's own settings: largest error so far against the time, on a logarithmic grid of times.
"""

import math
from typing import Any

import numpy as np
import xarray as xr

from symtop.measure.conservation import residuals
from symtop.methods.framework.registry import integrator
from symtop.model.scenes import Scene
from symtop.run.simulation import integrate

from .measures import SOLVER

FIRST = 1.0  # s, of the times at which the largest error so far is stored
TIMES = 320  # of them: neighbours are 2 to 3 % apart
SAMPLES = 12_001  # of a run


def long_energy(scene: Scene, name: str, setting: float, horizon: float) -> xr.Dataset:
    """Largest relative energy error so far of one variant, at times from `FIRST` to `horizon`; dimension ``long``."""
    method = integrator(name)
    control = method.given(setting)
    run = integrate(scene, method, observe="nutation", samples=SAMPLES, horizon=horizon, **control)
    largest = np.fmax.accumulate(np.abs(residuals(scene, run)["energy"]))
    times = np.geomspace(FIRST, horizon, TIMES)
    indices = np.maximum(np.searchsorted(run.time, times * (1.0 + 1e-12), side="right") - 1, 0)
    values = np.where(times <= run.reached_time * (1.0 + 1e-12), largest[indices], math.nan)
    columns: dict[str, Any] = {"long_time": ("long", times), "long_energy": ("long", values)}
    return xr.Dataset(columns)


def better_from(data: xr.Dataset, scene: str, name: str) -> float:
    """The time (s) from which a variant has a smaller energy error than the solver, up to the end; inf if it never has.

    0 means that it is smaller at every stored time.
    """
    cell = data.sel(scene=scene)
    ours = cell["long_energy"].sel(variant=name).values
    times, solver = (cell[column].sel(variant=SOLVER).values for column in ("long_time", "long_energy"))
    worse = np.flatnonzero(~(ours < solver))
    if not worse.size:
        return 0.0
    return float(times[worse[-1] + 1]) if worse[-1] + 1 < times.size else math.inf


def notebook_end(data: xr.Dataset, scene: str) -> float:
    """The notebook's own horizon (s)."""
    return float(data["sample_time"].sel(scene=scene).max())


def energy_until(data: xr.Dataset, scene: str, name: str, time: float) -> float:
    """The largest energy error of a variant up to a time."""
    cell = data.sel(scene=scene, variant=name)
    return float(cell["long_energy"].values[np.searchsorted(cell["long_time"].values, time)])
