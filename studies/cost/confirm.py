"""The safe setting of a variant checked: runs on tops that it was not chosen from, sampled at `SAMPLES` times.

The ladder's safe setting is interpolated between two that were run, from errors at a dozen times, and is an order
statistic of the tops that it serves. All three make it too coarse. Here a variant begins with that setting, rounded as
tables print it, on other tops of the natural population, and goes on to finer ones until `SAFE` of the tops keep the
error. The first setting with which they do is recommended.

Variables over `target`: interpolated(target) and served(target), the settings, inf where none was found, and
share(target), of the tops of which the target is asked.
"""

import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from symtop.measure.settings import TARGETS
from symtop.methods.framework.registry import Integrator
from symtop.model.charts import Array

from .ladder import at_tolerance, stepped
from .ranking import SAFE
from .tops import Tops, natural

SAMPLES = 200  # of a run
DENSE = 40.0  # grid points a nutation, on which the samples of an adaptive run lie
FINER = {True: 1.03, False: 0.7}  # factor from one setting to the next, by whether the step is fixed
DIGITS = {True: 3, False: 1}  # of a setting, in tables
MOST = {True: 4.0, False: 10.0}  # limit on the ratio to the interpolated setting, of steps and of tolerances


def rounded(setting: float, fixed: bool) -> float:
    """A setting as it is printed, never a coarser one."""
    unit = 10.0 ** (math.floor(math.log10(setting)) - DIGITS[fixed] + 1)
    whole = math.ceil(setting / unit - 1e-9) if fixed else math.floor(setting / unit + 1e-9)
    return float(f"{whole * unit:.{DIGITS[fixed]}g}")


def share_served(variant: Integrator, numbers: Array, nutations: float, setting: float, target: float) -> float:
    """The share of the tops, rows (n, 9), with an axis error of at most `target`, of those of which it is asked."""
    fixed, (chart,) = variant.fixed_step, variant.solvers
    tops = Tops(numbers, nutations, first=setting if fixed else DENSE, samples=SAMPLES)
    members = np.flatnonzero(tops.asked([target])["axis"][0])
    if fixed:
        marks = np.broadcast_to(tops.marks, (members.size, tops.marks.size))
        runs = stepped(variant, tops.numbers[members], tops.period[members] / setting, marks)
    else:
        runs = at_tolerance(variant, tops, members, setting, math.inf)
    error = np.where(runs.outcome == 0, tops.errors(chart, runs, members)["axis"], np.inf)
    return float(np.mean(error <= target)) if members.size else math.nan


def confirm(variant: Integrator, members: int, seed: int, nutations: float, start: Sequence[float]) -> xr.Dataset:
    """Settings with which `SAFE` of the tops meet each target, from the interpolated `start` on; NaN: not asked."""
    numbers, fixed = natural(members, seed), variant.fixed_step
    served, share = np.full((2, len(TARGETS)), np.nan)
    for place, (target, first) in enumerate(zip(TARGETS, start, strict=True)):
        setting = rounded(first, fixed) if math.isfinite(first) else math.nan
        while math.isfinite(setting):
            share[place] = share_served(variant, numbers, nutations, setting, target)
            if share[place] >= SAFE:
                break
            setting = rounded(setting * FINER[fixed], fixed)
            ratio = setting / first if fixed else first / setting
            if ratio > MOST[fixed] or not (fixed or setting >= variant.least_tolerance):
                setting = math.inf
        served[place] = setting
    variables = {"interpolated": np.array(start), "served": served, "share": share}
    return xr.Dataset({name: ("target", values) for name, values in variables.items()}, {"target": list(TARGETS)})
