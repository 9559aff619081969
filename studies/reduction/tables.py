"""What modelling less buys: one motion computed with more variables and with fewer, cost and error side by side.

Two comparisons. The same method in every chart that it has, at the same setting of its knob, judged by what all
charts show (the axis, theta, the energy). And a reduced kernel against its unreduced twin: the same map in exact
arithmetic, so that their distance is rounding and nothing else, and the ratio of their costs what reducing saves.

Times are of the bare solver, from start to horizon with two samples, and interleaved (see `timing`).
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from symtop.measure.accuracy import error_table
from symtop.measure.errors import momentum_scale
from symtop.measure.order import LARGEST_ERROR
from symtop.measure.timing import bare_run, timings
from symtop.methods.registry import Integrator, integrator, integrators
from symtop.model.charts import CHARTS
from symtop.model.scenes import Scene
from symtop.run.simulation import simulate

TWIN = "-unreduced"
TIMED = 20_000  # steps of a timed run: a call costs as much as a hundred of them
SMALLEST_FIRST = ("axis", "angles", "attitude")
SHARED = ("axis", "theta", "energy")  # quantities that every chart shows


def several_charts() -> list[Integrator]:
    """The registered integrators that work in more than one chart."""
    return [method for method in integrators().values() if len(method.solvers) > 1]


def twins() -> list[str]:
    """Names of the integrators whose unreduced twin is registered too."""
    return [name for name in integrators() if name + TWIN in integrators()]


def in_chart(method: Integrator, chart: str) -> Integrator:
    """The same integrator with one chart only."""
    return dataclasses.replace(method, solvers={chart: method.solvers[chart]})


def chart_table(
    scene: Scene, method: Integrator, settings: Sequence[float], horizon: float, batches: int = 5
) -> xr.Dataset:
    """Largest errors and seconds a run of one integrator in each of its charts.

    Dimensions ``chart`` (all three; NaN where the integrator has no such chart) and ``setting``.
    """
    shape = (len(CHARTS), len(settings))
    found = {name: np.full(shape, math.nan) for name in (*SHARED, "axis_bound", "seconds", "spread", "steps")}
    runs = [
        (CHARTS.index(chart), k, bare_run(scene, method, chart, setting, horizon))
        for chart in method.solvers
        for k, setting in enumerate(settings)
    ]
    for (row, column, _), timing in zip(runs, timings([run for *_, run in runs], batches), strict=True):
        found["seconds"][row, column], found["spread"][row, column] = timing.best, timing.spread
    for chart in method.solvers:
        table = error_table(scene, in_chart(method, chart), settings, horizon, observe="axis")
        for name in (*SHARED, "axis_bound", "steps"):
            found[name][CHARTS.index(chart)] = table[name].values
    variables = {name: (("chart", "setting"), values) for name, values in found.items()}
    return xr.Dataset(variables, coords={"chart": list(CHARTS)})


class Ratio(NamedTuple):
    """A chart against the smallest one that the same integrator has: above 1 is worse."""

    chart: str
    base: str
    time: float  # median over the settings
    error: float  # of the axis; geometric mean over the settings where both can be judged, NaN if there are none


def _judged(table: xr.Dataset) -> NDArray[np.bool_]:
    """Axis errors that are asymptotic and above what the reference can tell from zero."""
    error = table["axis"].values
    return np.asarray((error > 10.0 * table["axis_bound"].values) & (error < LARGEST_ERROR))


def chart_ratios(cell: xr.Dataset) -> list[Ratio]:
    """Every other chart of one integrator on one scene against its smallest; `cell` is a table of `chart_table`."""
    there = [chart for chart in SMALLEST_FIRST if np.isfinite(cell["seconds"].sel(chart=chart)).any()]
    if not there:
        return []
    base = cell.sel(chart=there[0])
    found = []
    for chart in there[1:]:
        other = cell.sel(chart=chart)
        time = float(np.nanmedian(other["seconds"] / base["seconds"]))
        good = _judged(base) & _judged(other)
        logs = np.log(other["axis"].values[good] / base["axis"].values[good])
        found.append(Ratio(chart, there[0], time, math.exp(float(np.mean(logs))) if logs.size else math.nan))
    return found


def twin_history(scene: Scene, name: str, horizon: float, steps: int, samples: int = 201) -> xr.Dataset:
    """Distances between a reduced kernel and its unreduced twin over one run; dimension ``sample``.

    ``theta_gap``, ``phi_gap``, ``psi_gap`` in radians; ``p_phi_drift`` and ``p_psi_drift`` are the relative changes of
    the twin's momenta, which nothing holds in place.
    """
    reduced, whole = (
        simulate(
            scene, label, step_size=horizon / steps, horizon=horizon, samples=samples, observe="attitude", guard=False
        )
        for label in (name, name + TWIN)
    )
    found = {f"{angle}_gap": np.abs(reduced[angle].values - whole[angle].values) for angle in ("theta", "phi", "psi")}
    for momentum in ("p_phi", "p_psi"):
        values = whole[momentum].values
        found[f"{momentum}_drift"] = np.abs(values - values[0]) / momentum_scale(scene)
    found["sample_time"] = reduced["time"].values
    return xr.Dataset({label: ("sample", values) for label, values in found.items()})


def twin_cost(scene: Scene, name: str, step_sizes: Sequence[float], batches: int = 5) -> xr.Dataset:
    """Seconds and iterations a step of a reduced kernel and its twin; dimensions ``kernel`` and ``twin_step``."""
    labels = (name, name + TWIN)
    runs = [bare_run(scene, integrator(label), "angles", step, TIMED * step) for label in labels for step in step_sizes]
    shape = (2, len(step_sizes))
    steps, iterations = (
        np.array([getattr(run(), count) for run in runs], float).reshape(shape)
        for count in ("steps", "newton_iterations")
    )
    seconds = np.array([timing.best for timing in timings(runs, batches)]).reshape(shape)
    dims = ("kernel", "twin_step")
    return xr.Dataset(
        {
            "seconds_per_step": (dims, seconds / steps),
            "iterations_per_step": (dims, iterations / steps),
            "twin_step_size": ("twin_step", np.array(step_sizes)),
        },
        coords={"kernel": ["reduced", "unreduced"]},
    )
