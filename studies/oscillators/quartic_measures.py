"""What is computed and stored of the planar quartic oscillator (`quartic`).

Scenes are oscillators: a plain harmonic one, two that are no top, and the two of spheroid. Times are in periods T.
"""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from symtop.measure.order import Fit, power_law
from symtop.model.charts import Array
from symtop.model.scenes import scene

from .quartic import Quartic, discrete_path, exact, mcmillan, of_top, true_path

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
SHOWN, POINTS = (12.3, 4.37), 70  # steps a period and points of the discrete orbits that are drawn
CURVE = 200
ASYMPTOTIC = 0.03  # largest step, in periods, that enters the fit of an order
ROUNDING = 1e-13  # relative: gaps of constants below it are not fitted

# Variables. Errors relative to the largest |x|; step sizes in periods; quartic_setting
STEP, ERROR = "quartic_step", "quartic_error"
# of McMillan's constants, exact-discrete alone; quartic_setting
A, B_OVER, DELTA, GAPS = "constant_a", "constant_b", "constant_delta", ("gap_a", "gap_b", "gap_delta")
# |x_n|^2 over the largest one, of POINTS steps; quartic_shown, quartic_point. And of the motion, the same a step on
ORBIT, CURVE_HERE, CURVE_AHEAD = "quartic_orbit", "curve_here", "curve_ahead"


def oscillator_of(name: str) -> Quartic:
    """The oscillator of a scene of this part."""
    return PLAIN[name] if name in PLAIN else of_top(scene(TOP))[CHI.index(name)]


def quartic_table(name: str, method: str, per_period: Sequence[float], periods: float) -> xr.Dataset:
    """Errors of a map at every step, its discrete orbits, and of `exact-discrete` the constants and the true curves."""
    oscillator = oscillator_of(name)
    T, paths = oscillator.period, _true_paths(oscillator, per_period, periods)
    largest = max(np.abs(path).max() for path in paths) ** 2
    errors = [
        np.abs(discrete_path(oscillator, method, T / steps, len(path) - 1) - path).max() / np.sqrt(largest)
        for steps, path in zip(per_period, paths, strict=True)
    ]
    orbits = [np.abs(discrete_path(oscillator, method, T / steps, POINTS)) ** 2 / largest for steps in SHOWN]
    columns = {STEP: ("quartic_setting", 1.0 / np.array(per_period)), ERROR: ("quartic_setting", errors)}
    columns[ORBIT] = (("quartic_shown", "quartic_point"), orbits)
    if method == "exact-discrete":
        columns |= _constants(oscillator, per_period) | _curves(oscillator, largest)
    return xr.Dataset(columns)


def _true_paths(oscillator: Quartic, per_period: Sequence[float], periods: float) -> list[Array]:
    """Positions at the points of every step."""
    times = [oscillator.period / steps * np.arange(int(periods * steps) + 1) for steps in per_period]
    true, order = np.empty(sum(map(len, times)), complex), np.argsort(np.concatenate(times), kind="stable")
    true[order] = true_path(oscillator, np.concatenate(times)[order])
    return np.split(true, np.cumsum([len(part) for part in times])[:-1])


def _constants(oscillator: Quartic, per_period: Sequence[float]) -> dict[str, object]:
    """A, B/(-sigma h^2) and delta at every step, and their relative distances from the limit of small steps."""
    steps = oscillator.period / np.array(per_period)
    true, limit = (np.array([rule(oscillator, h) for h in steps]) for rule in (exact, mcmillan))
    over = -oscillator.sigma * steps**2 if oscillator.sigma else np.full_like(steps, np.nan)
    values = {A: 1.0 + true[:, 0], B_OVER: true[:, 1] / over, DELTA: true[:, 3]}
    gaps = np.abs(true[:, 0] - limit[:, 0]), np.abs(true[:, 1] - limit[:, 1]), np.abs(true[:, 3])
    values |= dict(zip(GAPS, gaps, strict=True))
    return {name: ("quartic_setting", column) for name, column in values.items()}


def _curves(oscillator: Quartic, largest: float) -> dict[str, object]:
    """|x(t)|^2 and |x(t + h)|^2 over a period, for each step that is shown."""
    here, ahead = [], []
    for steps in SHOWN:
        times = oscillator.period * np.linspace(0.0, 1.0, CURVE)
        both = np.concatenate([times, times + oscillator.period / steps])
        order = np.argsort(both)
        squares = np.empty_like(both)
        squares[order] = np.abs(true_path(oscillator, both[order])) ** 2 / largest
        here.append(squares[:CURVE])
        ahead.append(squares[CURVE:])
    dims = ("quartic_shown", "quartic_curve")
    return {CURVE_HERE: (dims, here), CURVE_AHEAD: (dims, ahead)}


def quartic_order(data: xr.Dataset, name: str, method: str, column: str = ERROR) -> Fit:
    """Slope of an error, or of a gap of a constant, against the step."""
    cell = data.sel(scene=name, variant=method)
    steps, errors = cell[STEP].values, cell[column].values
    return power_law(steps, errors, (steps < ASYMPTOTIC) & (errors > ROUNDING))
