"""What a run does to the constants of the motion: residuals, and whether they have a trend.

A trend is the slope of the least-squares line through the means of `BLOCKS` equal stretches, with Student's 95 %
interval, widened by the correlation of what the line leaves over. Samples are never commensurate with the
nutation, so that a fast oscillation averages out. A random walk, which is what rounding makes, has no slope but
wanders: in 33 % of cases its interval is too narrow (white noise: 3 %), so that near rounding the exponent of growth,
1/2, is the better witness.
"""

import math
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from symtop.measure.errors import energy_scale, momentum_scale
from symtop.scenes import Scene

CONSTANTS = ("energy", "p_phi", "p_psi")
BLOCKS = 24


class Trend(NamedTuple):
    """A linear trend of a residual."""

    slope: float  # per unit time
    interval: float  # half-width, 95 %
    rise: float  # slope times the length of the run

    @property
    def significant(self) -> bool:
        """Does the interval exclude zero?"""
        return bool(abs(self.slope) > self.interval)


def residuals(scene: Scene, run: xr.Dataset) -> dict[str, np.ndarray]:
    """Relative change of energy, p_phi and p_psi since the start, signed."""
    scales = {"energy": energy_scale(scene), "p_phi": momentum_scale(scene), "p_psi": momentum_scale(scene)}
    return {name: (run[name].values - run[name].values[0]) / scales[name] for name in CONSTANTS}


def trend(time: ArrayLike, residual: ArrayLike) -> Trend:
    """The linear trend of a residual (n,) at times (n,), from the means of `BLOCKS` equal stretches of the run."""
    from scipy.stats import t as student  # noqa: PLC0415  (0.5 s to import)

    t, r = np.asarray(time, float), np.asarray(residual, float)
    good = np.isfinite(r)
    t, r = t[good], r[good]
    if t.size < 2 * BLOCKS:
        return Trend(math.nan, math.nan, math.nan)
    t_mean = np.array([part.mean() for part in np.array_split(t, BLOCKS)])
    r_mean = np.array([part.mean() for part in np.array_split(r, BLOCKS)])
    dt, dr = t_mean - t_mean.mean(), r_mean - r_mean.mean()
    spread = float(dt @ dt)
    slope = float(dt @ dr) / spread
    rest = dr - slope * dt
    error = math.sqrt(float(rest @ rest) / (BLOCKS - 2) / spread)
    # first-order autocorrelation r of the residuals leaves (1-r)/(1+r) of them independent; r is biased by about -4/n
    power = float(rest @ rest)
    memory = float(rest[1:] @ rest[:-1]) / power + 4.0 / BLOCKS if power > 0.0 else 0.0
    memory = min(max(memory, 0.0), 0.95)
    error *= math.sqrt((1.0 + memory) / (1.0 - memory))
    return Trend(slope, float(student.ppf(0.975, BLOCKS - 2)) * error, slope * float(t[-1] - t[0]))
