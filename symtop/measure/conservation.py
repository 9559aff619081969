"""What a run does to the constants of the motion: residuals, and whether they have a trend.

A trend is the slope of the least-squares line through the means of `BLOCKS` equal stretches, with Student's 95 %
interval, widened by the correlation of what the line leaves over. Samples are never commensurate with the
nutation, so that a fast oscillation averages out. A random walk, which is what rounding makes, has no slope but
wanders: in 33 % of cases its interval is too narrow (white noise: 3 %), so that near rounding the exponent of growth,
1/2, is the better witness.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from symtop.measure.growth import change_point, growth, law, tops
from symtop.measure.phase import nutation_phase
from symtop.measure.statistics import line, student
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene
from symtop.run.simulation import integrate
from symtop.run.trajectory import Trajectory

CONSTANTS = ("energy", "p_phi", "p_psi")
BLOCKS = 24
WINDOWS = 24  # for a change of law: each side of it needs at least five
SETTLED = 30.0  # nutations: before, an oscillation switches on, which is no change of law


class Trend(NamedTuple):
    """A linear trend of a residual."""

    slope: float  # per unit time
    interval: float  # half-width, 95 %
    rise: float  # slope times the length of the run

    @property
    def significant(self) -> bool:
        """Does the interval exclude zero?"""
        return bool(abs(self.slope) > self.interval)


class Changed(NamedTuple):
    """What became of a quantity that the true motion keeps: its size, its trend and its law of growth."""

    largest: float  # NaN if there is no finite sample
    slope: float  # of the trend, per unit time
    interval: float
    rise: float
    exponent: float  # of growth with time
    exponent_interval: float  # half-width, 95 %
    law: str  # name of the exponent


def constant_of(time: ArrayLike, residual: ArrayLike, decades: float = 2.0) -> Changed:
    """Size, trend and growth over the last `decades` of a residual (n,) at times (n,); samples may be NaN."""
    size, power = np.abs(np.asarray(residual, float)), growth(time, residual, decades)
    largest = float(np.max(size[np.isfinite(size)], initial=-1.0))
    return Changed(
        largest if largest >= 0.0 else math.nan, *trend(time, residual), power.slope, power.interval, law(power)
    )


def history(scene: Scene, method: Integrator, **settings: Any) -> xr.Dataset:
    """One run and what became of the constants of the motion and of its phase.

    Dimension ``sample``: ``sample_time`` and, for energy, p_phi and p_psi, ``NAME_residual``. For each of them the
    ``largest``, the linear ``slope`` with its ``interval`` and ``rise``, and the ``exponent`` of growth over the last
    two decades; for the phase of the nutation (rad; NaN where there is none) ``largest`` and ``exponent``, over the
    last decade, because a wrong frequency gives way to a drifting one only late. ``exponent_interval`` goes with each,
    and ``law``, its name; where one law gives way to another, ``change`` is the time, ``before`` and ``after`` are the
    exponents (NaN where none does).
    """
    run = integrate(scene, method, observe="nutation", **settings)
    time = run.time
    columns: dict[str, Any] = {"sample_time": ("sample", time), "outcome": run.outcome, "steps": run.steps}
    period = scene.nutation_period
    late = time > (SETTLED * period if math.isfinite(period) else 0.0)
    for name, values in residuals(scene, run).items():
        columns[f"{name}_residual"] = ("sample", values)
        columns |= _columns(name, constant_of(time, values)._asdict(), time[late], values[late])
    phase = nutation_phase(scene, time, run.theta, run.p_theta / scene.top.I1)
    changed = constant_of(time, phase, 1.0)._asdict()
    without_trend = {part: value for part, value in changed.items() if part not in Trend._fields}
    return xr.Dataset(columns | _columns("phase", without_trend, time[late], phase[late]))


def _columns(name: str, changed: dict[str, Any], time: np.ndarray, values: np.ndarray) -> dict[str, Any]:
    """What became of a quantity, and where within the last two decades another law than that of the end ended."""
    change = change_point(*tops(time, values, count=WINDOWS)) if time.size else None
    when, before, after = (math.nan,) * 3 if change is None else change
    parts = changed | {"change": when, "before": before, "after": after}
    return {f"{name}_{part}": value for part, value in parts.items()}


def residuals(scene: Scene, run: Trajectory) -> dict[str, np.ndarray]:
    """Relative change of energy, p_phi and p_psi since the start, signed."""
    scales = {"energy": scene.energy_scale, "p_phi": scene.momentum_scale, "p_psi": scene.momentum_scale}
    values = {name: getattr(run, name) for name in CONSTANTS}
    return {name: (values[name] - values[name][0]) / scales[name] for name in CONSTANTS}


def trend(time: ArrayLike, residual: ArrayLike) -> Trend:
    """The linear trend of a residual (n,) at times (n,), from the means of `BLOCKS` equal stretches of the run."""
    t, r = np.asarray(time, float), np.asarray(residual, float)
    good = np.isfinite(r)
    t, r = t[good], r[good]
    if t.size < 2 * BLOCKS:
        return Trend(math.nan, math.nan, math.nan)
    t_mean = np.array([part.mean() for part in np.array_split(t, BLOCKS)])
    r_mean = np.array([part.mean() for part in np.array_split(r, BLOCKS)])
    slope, error, _, rest = line(t_mean, r_mean)
    # first-order autocorrelation r of the residuals leaves (1-r)/(1+r) of them independent; r is biased by about -4/n
    power = float(rest @ rest)
    memory = float(rest[1:] @ rest[:-1]) / power + 4.0 / BLOCKS if power > 0.0 else 0.0
    memory = min(max(memory, 0.0), 0.95)
    error *= math.sqrt((1.0 + memory) / (1.0 - memory))
    return Trend(slope, student(BLOCKS - 2) * error, slope * float(t[-1] - t[0]))
