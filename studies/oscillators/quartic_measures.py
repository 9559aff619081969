"""The measurements on the planar quartic oscillator (`quartic`).

Scenes are oscillators: a harmonic one, two that belong to no top, and the two of spheroid. Times are in periods T.
"""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from symtop.measure.order import Fit, power_law
from symtop.model.charts import Array
from symtop.model.scenes import scene

from .quartic import Quartic, discrete_path, of_top, true_path

MAPS = ("exact-discrete", "mcmillan", "stormer-verlet", "midpoint")
TOP = "spheroid"
CHI = (f"{TOP}-chi-1", f"{TOP}-chi-2")
PLAIN = {
    "planar-harmonic": Quartic(0.0, -1.0 / 3.0, 1.0 + 0.0j, 0.5j),
    "planar-hardening": Quartic(-1.0, -1.0 / 3.0, 1.0 + 0.0j, 0.5j),
    "planar-softening": Quartic(1.0, -1.0, 0.8 + 0.0j, 0.6j),
}
QUARTICS = (*PLAIN, *CHI)
PERIODS = 5.0  # of the runs whose errors are measured
STEPS = (2.1, 2.3, 3.3, 4.37, 6.7, 10.3, 20.3, 40.3, 80.3, 160.3)  # a period
ASYMPTOTIC = 0.03  # largest step, in periods, that enters the fit of an order
ROUNDING = 1e-13  # relative: gaps of constants below it are not fitted

# Variables. Errors relative to the largest |x|; step sizes in periods; quartic_setting
STEP, ERROR = "quartic_step", "quartic_error"


def oscillator_of(name: str) -> Quartic:
    """The oscillator of a scene in `QUARTICS`."""
    return PLAIN[name] if name in PLAIN else of_top(scene(TOP))[CHI.index(name)]


def quartic_table(name: str, method: str, per_period: Sequence[float], periods: float) -> xr.Dataset:
    """Largest errors of a map at every step."""
    oscillator = oscillator_of(name)
    T, paths = oscillator.period, _true_paths(oscillator, per_period, periods)
    largest = max(np.abs(path).max() for path in paths) ** 2
    errors = [
        np.abs(discrete_path(oscillator, method, T / steps, len(path) - 1) - path).max() / np.sqrt(largest)
        for steps, path in zip(per_period, paths, strict=True)
    ]
    steps = 1.0 / np.array(per_period)
    return xr.Dataset({STEP: ("quartic_setting", steps), ERROR: ("quartic_setting", errors)})


def _true_paths(oscillator: Quartic, per_period: Sequence[float], periods: float) -> list[Array]:
    """For each step size, the true positions after each of its steps."""
    times = [oscillator.period / steps * np.arange(int(periods * steps) + 1) for steps in per_period]
    true, order = np.empty(sum(map(len, times)), complex), np.argsort(np.concatenate(times), kind="stable")
    true[order] = true_path(oscillator, np.concatenate(times)[order])
    return np.split(true, np.cumsum([len(part) for part in times])[:-1])


def quartic_order(data: xr.Dataset, name: str, method: str) -> Fit:
    """Slope of an error against the step."""
    cell = data.sel(scene=name, variant=method)
    steps, errors = cell[STEP].values, cell[ERROR].values
    return power_law(steps, errors, (steps < ASYMPTOTIC) & (errors > ROUNDING))
