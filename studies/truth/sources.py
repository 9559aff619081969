"""How far each source of truth can be trusted: its error and its cost against the horizon."""

import time
from typing import Any

import numpy as np
import xarray as xr

from symtop.model import charts
from symtop.model.precise_form import PreciseForm
from symtop.model.scenes import Scene, closed_form
from symtop.run.reference import integrate, reference

SOURCES = {
    "double, axis": ("double", "axis"),
    "double, attitude": ("double", "attitude"),
    "long double, axis": ("longdouble", "axis"),
    "long double, attitude": ("longdouble", "attitude"),
    "quadruple, attitude": ("quad", "attitude"),
    "closed form": ("closed-form", "attitude"),
}
PROBES = 7  # times within the last nutation before a horizon


def probe_times(scene: Scene, horizon: float) -> charts.Array:
    """Times spread over the last nutation before the horizon."""
    return horizon - min(scene.nutation_period, 0.9 * horizon) * np.linspace(0.0, 0.93, PROBES)[::-1]


def source_errors(scene: Scene, source: str, horizons: list[float]) -> xr.Dataset:
    """Axis error, claimed bound and seconds of one source at each horizon (dimension ``horizon``).

    The error is the distance to the closed form in 45 digits, the largest over the last nutation.
    """
    precision, chart = SOURCES[source]
    precise = PreciseForm(scene.top, scene.start, digits=45)
    rows = []
    for horizon in horizons:
        times = probe_times(scene, horizon)
        start = time.perf_counter()
        found = _axes(scene, times, precision, chart)
        seconds = time.perf_counter() - start
        worst = max(_distance(axis, precise.axis(float(t))) for axis, t in zip(found, times, strict=True))
        bound = np.nan
        if chart == "attitude":
            bound = float(reference(scene, times, precision)["axis_error_bound"].values.max())
        rows.append((worst, bound, seconds))
    error, bounds, costs = zip(*rows, strict=True)
    data = xr.Dataset(coords={"horizon": horizons})
    for name, values in (("axis", error), ("axis_bound", bounds), ("seconds", costs)):
        data[name] = ("horizon", list(values))
    return data


def _axes(scene: Scene, times: charts.Array, precision: str, chart: str) -> Any:
    if precision == "closed-form":
        return closed_form(scene).axis(times)
    states, _ = integrate(scene, times, precision, chart)
    return states[:, :3] if chart == "axis" else charts.axis_from_quaternion(states[:, :4])


def _distance(found: Any, true: Any) -> float:
    """Length of the difference of two axes, one in any arithmetic and one in 45 digits."""
    from mpmath import mp, mpf, workdps

    with workdps(50):
        return float(mp.norm([mpf(str(a)) - b for a, b in zip(found, true, strict=True)]))
