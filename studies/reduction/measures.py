"""Cost and error of one motion computed with more variables and with fewer.

In exact arithmetic a reduced kernel and its unreduced form are one map, so that their distance is rounding.
Times are of the bare solver, from start to horizon with two samples, and interleaved (see `symtop.measure.timing`).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.core.errors import SymtopError
from symtop.measure.accuracy import as_table, error_table
from symtop.measure.order import LARGEST_ERROR, power_law
from symtop.measure.timing import bare_run, timings
from symtop.methods.framework.loop import inside
from symtop.methods.framework.registry import SMALLEST_FIRST, Integrator, integrator, integrators
from symtop.methods.lagrangian import unreduced
from symtop.methods.lagrangian.discrete_lagrangian import rule_of
from symtop.model.charts import CHARTS, Array
from symtop.model.scenes import Scene
from symtop.run.simulation import simulate

from .commutation import gap, reduced_first

BATCH = 0.005  # seconds, of runs in several charts
TIMED_STEPS = 20_000  # of a timed run: the overhead of a call is that of a hundred steps
COMPARED_STEPS = 10_000  # of a reduced kernel and its unreduced form
COMMUTES = 1e-13  # rad: two paths of a few thousand steps with compensated sums are that close if they are one method
SAME = 1e-3  # relative: axis errors that differ by less are the same
CHART_PERIODS = 32.0  # nutations: long enough that the call itself does not count


GAPS = {"theta_gap": "theta", "phi_gap": "phi", "psi_gap": "psi"}


def chart_table(
    scene: Scene, method: Integrator, settings: Sequence[float], horizon: float, batches: int = 5
) -> xr.Dataset:
    """Largest errors and seconds a run of one integrator in each of its charts.

    Dimensions ``chart`` (all three; NaN where the integrator has no such chart) and ``setting``.
    """
    columns, charts = ["axis", "theta", "energy", "axis_bound", "steps"], method.charts()
    runs = [bare_run(scene, method, chart, setting, horizon) for chart in charts for setting in settings]
    times = np.array([(timing.best, timing.spread) for timing in timings(runs, batches, BATCH)])
    tables = []
    for chart, (seconds, spread) in zip(charts, times.reshape(len(charts), -1, 2).swapaxes(1, 2), strict=True):
        errors = error_table(scene, method.variant(chart), settings, horizon, observe="axis")[columns].astype(float)
        tables.append(errors.assign({"seconds": ("setting", seconds), "spread": ("setting", spread)}))
    return xr.concat(tables, "chart").assign_coords(chart=list(charts)).reindex(chart=list(CHARTS))


class Ratio(NamedTuple):
    """A chart against the preferred one that the same integrator has, mostly the axis: above 1 is worse."""

    chart: str
    base: str
    time: float  # median over the settings with which both runs end well, NaN if there are none
    error: float  # of the axis; geometric mean over the settings where both can be judged, NaN if there are none
    to_error: float  # of the times to the same error, see `time_to_error`


def judged(table: xr.Dataset) -> Array:
    """Which errors of the axis are asymptotic, and above what the reference can tell from zero."""
    return np.asarray((table["axis"] > 10.0 * table["axis_bound"]) & (table["axis"] < LARGEST_ERROR))


def time_to_error(base: xr.Dataset, other: xr.Dataset) -> float:
    """Time of the other chart over that of the base to the same axis error: the median over the errors of both.

    Between two settings a time is interpolated as a power of the error. NaN if no error of one is between the other's.
    """
    curves = [np.log([table[name].values[judged(table)] for name in ("axis", "seconds")]) for table in (base, other)]
    (x, before), (y, after) = (curve[:, np.argsort(curve[0])] for curve in curves)
    low, high = max(u.min(initial=np.inf) for u in (x, y)), min(u.max(initial=-np.inf) for u in (x, y))
    grid = np.concatenate([x, y])
    grid = grid[(grid > low - SAME) & (grid < high + SAME)]
    return math.exp(np.median(np.interp(grid, y, after) - np.interp(grid, x, before))) if grid.size else math.nan


def chart_ratios(cell: xr.Dataset) -> list[Ratio]:
    """Every other chart of one integrator on one scene against the preferred; `cell` is a table of `chart_table`."""
    by_size = [cell.sel(chart=chart) for chart in SMALLEST_FIRST["axis"]]
    base, *larger = [table for table in by_size if np.isfinite(table["seconds"]).any()] or by_size[:1]
    ratios = []
    for other in larger:
        ended = np.isfinite(other["axis"].values) & np.isfinite(base["axis"].values)  # a failed run has no time
        times = (other["seconds"] / base["seconds"]).values[ended]
        time = float(np.median(times)) if times.size else math.nan
        good = judged(base) & judged(other)
        logs = np.log(other["axis"].values[good] / base["axis"].values[good])
        error = math.exp(float(np.mean(logs))) if logs.size else math.nan
        charts = (str(table["chart"].item()) for table in (other, base))
        ratios.append(Ratio(*charts, time, error, time_to_error(base, other)))
    return ratios


def unreduced_forms() -> dict[str, str]:
    """By name of a registered reduced integrator, the name of its unreduced form, which steps the same rule."""
    forms: dict[object, str] = {}
    for method in integrators().values():
        kernel = inside(method.solvers["angles"]) if "angles" in method.solvers else None
        if kernel is not None and kernel.loop is unreduced.march:
            forms.setdefault(kernel.rule, method.name)
    return {name: forms[rule] for name, method in integrators().items() if (rule := rule_of(method)) in forms}


def unreduced_gaps(scene: Scene, name: str, horizon: float, steps: int) -> xr.Dataset:
    """Distances (rad) between a reduced kernel and its unreduced form over one run; dimension ``sample``.

    The momenta of the unreduced form are part of its state, conserved only as far as its equations are solved.
    """
    plan = {"step_size": horizon / steps, "horizon": horizon, "samples": 201}
    reduced, whole = (
        simulate(scene, label, **plan, observe="attitude", guard=False) for label in (name, unreduced_forms()[name])
    )
    columns = {column: np.abs(reduced[angle].values - whole[angle].values) for column, angle in GAPS.items()}
    for drift, momentum in (("p_phi_drift", "p_phi"), ("p_psi_drift", "p_psi")):
        values = whole[momentum].values
        columns[drift] = np.abs(values - values[0]) / scene.momentum_scale
    columns["sample_time"] = reduced["time"].values
    return xr.Dataset({label: ("sample", values) for label, values in columns.items()})


def unreduced_cost(scene: Scene, name: str, step_sizes: Sequence[float], batches: int = 5) -> xr.Dataset:
    """Seconds and iterations a step of a kernel and its unreduced form; dimensions ``kernel``, ``twin_step``."""
    pair = [integrator(label) for label in (name, unreduced_forms()[name])]
    runs = [bare_run(scene, method, "angles", step, TIMED_STEPS * step) for method in pair for step in step_sizes]
    work = np.array([(run.steps, run.newton_iterations) for run in (call() for call in runs)], float)
    steps, iterations = work.T.reshape(2, 2, -1)
    seconds = np.array([timing.best for timing in timings(runs, batches)]).reshape(2, -1)
    dims = ("kernel", "twin_step")
    columns = {"seconds_per_step": (dims, seconds / steps), "iterations_per_step": (dims, iterations / steps)}
    coords = {"kernel": ["reduced", "unreduced"]}
    return xr.Dataset({**columns, "twin_step_size": ("twin_step", np.array(step_sizes))}, coords=coords)


def commutation_table(scene: Scene, method: Integrator, horizon: float, counts: Sequence[int]) -> xr.Dataset:
    """Gaps between reducing first and last at several numbers of steps; dimension ``commutation_step``.

    SymtopError for an integrator that `reduced_first` does not know.
    """
    step = reduced_first(scene, method)
    if step is None:
        raise SymtopError(f"method must be a reduced discrete Lagrangian, not {method.name!r}")
    steps = [(horizon / count, count) for count in counts]
    rows = [{"commutation_step_size": h, "commutation_gap": gap(scene, step, method, h, count)} for h, count in steps]
    return as_table(rows).rename_dims(setting="commutation_step")


def commutation_order(cell: xr.Dataset) -> float:
    """The power of the step with which the gap of one integrator falls; the coarsest step does not enter."""
    return power_law(cell["commutation_step_size"].values[1:], cell["commutation_gap"].values[1:]).slope
