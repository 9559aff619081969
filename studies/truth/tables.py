"""What is computed and stored of one source of truth on one scene, and the published values it is held against."""

import time

import numpy as np
import xarray as xr

from symtop.model.precise_form import PreciseForm
from symtop.model.scenes import Scene
from symtop.run.reference import reference

from .sources import SOURCES, axes, distance, probe_times

DIGITS = 45  # of the closed form that every source is compared with


class Column:
    """Variables of the dataset; dimension horizon (s). Sources are the values of the dimension integrator."""

    ERROR = "axis"  # rad, largest distance of the axis from the closed form in 45 digits over the last nutation
    BOUND = "axis_bound"  # rad, what the reference claims; NaN for a source without a bound of its own
    SECONDS = "seconds"


def source_errors(scene: Scene, source: str, horizons: list[float]) -> xr.Dataset:
    """Axis error, claimed bound and seconds of one source at each horizon (dimension ``horizon``).

    The error is the distance to the closed form in 45 digits, the largest over the last nutation.
    """
    precision, chart = SOURCES[source]
    precise = PreciseForm(scene.top, scene.start, digits=DIGITS)
    rows = []
    for horizon in horizons:
        times = probe_times(scene, horizon)
        start = time.perf_counter()
        paths = axes(scene, times, precision, chart)
        seconds = time.perf_counter() - start
        worst = max(distance(axis, precise.axis(float(t))) for axis, t in zip(paths, times, strict=True))
        bound = np.nan
        if chart == "attitude":
            bound = float(reference(scene, times, precision)["axis_error_bound"].values.max())
        rows.append((worst, bound, seconds))
    errors, bounds, costs = zip(*rows, strict=True)
    data = xr.Dataset(coords={"horizon": horizons})
    for name, values in ((Column.ERROR, errors), (Column.BOUND, bounds), (Column.SECONDS, costs)):
        data[name] = ("horizon", list(values))
    return data


def bound_ratios(data: xr.Dataset) -> tuple[int, int, float]:
    """The number of claimed bounds, how many of them an error exceeds, and the median of bound over error."""
    error, bound = data[Column.ERROR].values, data[Column.BOUND].values
    both = np.isfinite(error) & np.isfinite(bound)
    ratios = bound[both] / np.maximum(error[both], 1e-40)
    return int(both.sum()), int(np.sum(error[both] > bound[both])), float(np.median(ratios))
