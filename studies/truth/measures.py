"""The sources of reference motions, the errors of each on one scene, and how close their bounds are."""

import functools
import time
from typing import Any

import numpy as np
import xarray as xr

from symtop.core.numbers import context
from symtop.model import charts
from symtop.model.scenes import Scene, closed_form
from symtop.run.reference.independent_checks import integrate, integrate_with_checks, iterate_map, precise_form
from symtop.run.reference.truth import PRECISIONS, judged_integration, reference

# name: precision, chart
SOURCES = {
    "double, axis": ("double", "axis"),
    "double, attitude": ("double", "attitude"),
    "long double, axis": ("longdouble", "axis"),
    "long double, attitude": ("longdouble", "attitude"),
    "quadruple, attitude": ("quad", "attitude"),
    "discrete map": ("discrete-map", "attitude"),
    "closed form": ("closed-form", "attitude"),
}
PROBES = 7  # times within the last nutation before a horizon
DIGITS = 45  # of the closed form that every source is compared with

# Variables of the dataset; dimension horizon (s). Sources are the values of the dimension integrator.
ERROR = "axis"  # rad, largest distance of the axis from the closed form in 45 digits over the last nutation
BOUND = "axis_bound"  # rad, the bound that the reference states; NaN for a source without one
SECONDS = "seconds"


def source_errors(scene: Scene, source: str, horizons: list[float]) -> xr.Dataset:
    """`ERROR`, `BOUND` and `SECONDS` of one source at each horizon (dimension ``horizon``).

    One integration gives the error and, by its checks, the bound: the times at which a run is sampled change no step.
    """
    precision, chart = SOURCES[source]
    columns: dict[str, list[float]] = {ERROR: [], BOUND: [], SECONDS: []}
    for horizon in horizons:
        times = horizon - min(scene.nutation_period, 0.9 * horizon) * np.linspace(0.0, 0.93, PROBES)[::-1]
        claims, bound = chart == "attitude" and precision in PRECISIONS, np.nan
        start = time.perf_counter()
        run = integrate_with_checks(scene, times, precision) if claims and precision != "closed-form" else None
        path = axes(scene, times, precision, chart) if run is None else run.axes
        columns[SECONDS].append(time.perf_counter() - start if run is None else run.seconds)
        distances = (distance(axis, true_axis(scene, float(t))) for axis, t in zip(path, times, strict=True))
        columns[ERROR].append(max(distances))
        if claims:
            truth = reference(scene, times) if run is None else judged_integration(scene, times, precision, run)
            bound = truth["axis_error_bound"].max()
        columns[BOUND].append(float(bound))
    return xr.Dataset({name: ("horizon", values) for name, values in columns.items()}, coords={"horizon": horizons})


def axes(scene: Scene, times: charts.Array, precision: str, chart: str) -> Any:
    """The axis at the given times by one source, in its own arithmetic, shape (times, 3)."""
    if precision == "closed-form":
        return closed_form(scene).axis(times)
    if precision == "discrete-map":
        return charts.axis_from_quaternion(iterate_map(scene, times)[0])
    states, _ = integrate(scene, times, precision, chart)
    return states[:, :3] if chart == "axis" else charts.axis_from_quaternion(states[:, :4])


@functools.lru_cache(maxsize=1024)  # 10 ms each; every source of a scene is read at the same times
def true_axis(scene: Scene, t: float) -> Any:
    """The axis of the closed form in `DIGITS` digits."""
    return precise_form(scene.top, scene.start, DIGITS).axis(t)


def distance(axis: Any, true: Any) -> float:
    """Length of the difference of two axes, one in any arithmetic and one in 45 digits, computed in 50."""
    mp = context(50)
    return float(mp.norm([mp.mpf(str(a)) - b for a, b in zip(axis, true, strict=True)]))


def bound_ratios(data: xr.Dataset) -> tuple[int, int, float]:
    """The number of claimed bounds, how many of them an error exceeds, and the median of bound over error."""
    error, bound = data[ERROR].values, data[BOUND].values
    both = np.isfinite(error) & np.isfinite(bound)
    ratios = bound[both] / np.maximum(error[both], 1e-40)
    return int(both.sum()), int(np.sum(error[both] > bound[both])), float(np.median(ratios))
