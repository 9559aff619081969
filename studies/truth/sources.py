"""The sources of truth: how each computes the path of the axis, and the distance of two paths in 50 digits."""

from typing import Any

import numpy as np

from symtop.base.multiprecision import context
from symtop.model import charts
from symtop.model.scenes import Scene, closed_form
from symtop.run.reference import integrate

# name: precision, chart
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
    """Times (s) spread over the last nutation before the horizon, shape (PROBES,)."""
    return horizon - min(scene.nutation_period, 0.9 * horizon) * np.linspace(0.0, 0.93, PROBES)[::-1]


def axes(scene: Scene, times: charts.Array, precision: str, chart: str) -> Any:
    """The axis at the given times by one source, in its own arithmetic, shape (times, 3)."""
    if precision == "closed-form":
        return closed_form(scene).axis(times)
    states, _ = integrate(scene, times, precision, chart)
    return states[:, :3] if chart == "axis" else charts.axis_from_quaternion(states[:, :4])


def distance(found: Any, true: Any) -> float:
    """Length of the difference of two axes, one in any arithmetic and one in 45 digits."""
    mp = context(50)
    return float(mp.norm([mp.mpf(str(a)) - b for a, b in zip(found, true, strict=True)]))
