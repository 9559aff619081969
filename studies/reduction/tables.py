"""What modelling less buys: one motion computed with more variables and with fewer, cost and error side by side.

Three comparisons. The same integrator in every chart that it has, at the same setting, judged by what all charts show
(the axis, theta, the energy). A reduced kernel against its unreduced form, which steps the same rule with nothing
eliminated: in exact arithmetic both are one map, so that their distance is rounding, and the ratio of their costs is
what reducing saves. And reducing before discretising against discretising before reducing (see `commutation`).

Times are of the bare solver, from start to horizon with two samples, and interleaved (see `symtop.measure.timing`).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from symtop.base.validate import SymtopError
from symtop.measure.accuracy import error_table
from symtop.measure.order import LARGEST_ERROR, power_law
from symtop.measure.timing import bare_run, timings
from symtop.methods import unreduced
from symtop.methods.discrete_lagrangian import is_midpoint, rule_of
from symtop.methods.fixed_step import inside
from symtop.methods.registry import SMALLEST_FIRST, Integrator, integrator, integrators
from symtop.model.charts import CHARTS
from symtop.model.scenes import Scene
from symtop.run.simulation import simulate

from .commutation import commutation_gap, hamiltonian_gap

TIMED_STEPS = 20_000  # of a timed run: a call costs as much as a hundred of them
COMPARED_STEPS = 10_000  # of a reduced kernel and its unreduced form
SHARED = ("axis", "theta", "energy")  # quantities that every chart shows
COMMUTES = 1e-13  # rad: two paths of a few thousand steps with compensated sums are that close if they are one method
# rad, over 10 000 steps without compensation: n^1.5 ulp of theta' h, and phi' is steep near a pole
SAME_MAP = 1e-11


class Column:
    """Variables of the dataset, with unit and dimensions."""

    # an integrator in its charts; chart, setting. Beside these: theta (rad), energy (relative), steps
    AXIS, AXIS_BOUND = "axis", "axis_bound"  # rad, largest error and the least that can be judged
    SECONDS, SPREAD = "seconds", "spread"  # best of the batches; relative
    # a kernel and its unreduced form over time; sample
    TIME = "sample_time"  # s
    THETA_GAP, PHI_GAP, PSI_GAP = "theta_gap", "phi_gap", "psi_gap"  # rad
    P_PHI_DRIFT, P_PSI_DRIFT = "p_phi_drift", "p_psi_drift"  # of the unreduced form, relative
    # cost of both; kernel, twin_step
    SECONDS_A_STEP, ITERATIONS_A_STEP = "seconds_per_step", "iterations_per_step"
    COMPARED_STEP = "twin_step_size"  # s
    # reduced first against reduced last; commutation_step
    COMMUTATION_STEP = "commutation_step_size"  # s
    COMMUTATION_GAP, HAMILTONIAN_GAP = "commutation_gap", "hamiltonian_gap"  # rad, in theta


GAPS = {Column.THETA_GAP: "theta", Column.PHI_GAP: "phi", Column.PSI_GAP: "psi"}


def several_charts() -> list[Integrator]:
    """The registered integrators that work in more than one chart."""
    return [method for method in integrators().values() if len(method.solvers) > 1]


def chart_table(
    scene: Scene, method: Integrator, settings: Sequence[float], horizon: float, batches: int = 5
) -> xr.Dataset:
    """Largest errors and seconds a run of one integrator in each of its charts.

    Dimensions ``chart`` (all three; NaN where the integrator has no such chart) and ``setting``.
    """
    shape = (len(CHARTS), len(settings))
    judged = (*SHARED, Column.AXIS_BOUND, "steps")
    columns = {
        name: np.full(shape, math.nan) for name in (*SHARED, Column.AXIS_BOUND, Column.SECONDS, Column.SPREAD, "steps")
    }
    runs = [
        (CHARTS.index(chart), k, bare_run(scene, method, chart, setting, horizon))
        for chart in method.solvers
        for k, setting in enumerate(settings)
    ]
    for (row, column, _), timing in zip(runs, timings([run for *_, run in runs], batches), strict=True):
        columns[Column.SECONDS][row, column], columns[Column.SPREAD][row, column] = timing.best, timing.spread
    for chart in method.solvers:
        table = error_table(scene, method.only(chart), settings, horizon, observe="axis")
        for name in judged:
            columns[name][CHARTS.index(chart)] = table[name].values
    variables = {name: (("chart", "setting"), values) for name, values in columns.items()}
    return xr.Dataset(variables, coords={"chart": list(CHARTS)})


class Ratio(NamedTuple):
    """A chart against the smallest one that the same integrator has: above 1 is worse."""

    chart: str
    base: str
    time: float  # median over the settings
    error: float  # of the axis; geometric mean over the settings where both can be judged, NaN if there are none


def _judged(table: xr.Dataset) -> NDArray[np.bool_]:
    """Axis errors that are asymptotic and above what the reference can tell from zero."""
    error = table[Column.AXIS].values
    return np.asarray((error > 10.0 * table[Column.AXIS_BOUND].values) & (error < LARGEST_ERROR))


def charts_by_size(cell: xr.Dataset) -> list[str]:
    """The charts that one integrator was timed in, the smallest first."""
    return [chart for chart in SMALLEST_FIRST["axis"] if np.isfinite(cell[Column.SECONDS].sel(chart=chart)).any()]


def chart_ratios(cell: xr.Dataset) -> list[Ratio]:
    """Every other chart of one integrator on one scene against its smallest; `cell` is a table of `chart_table`."""
    smallest, *larger = charts_by_size(cell) or [""]
    ratios = []
    for chart in larger:
        base, other = cell.sel(chart=smallest), cell.sel(chart=chart)
        time = float(np.nanmedian(other[Column.SECONDS] / base[Column.SECONDS]))
        good = _judged(base) & _judged(other)
        logs = np.log(other[Column.AXIS].values[good] / base[Column.AXIS].values[good])
        ratios.append(Ratio(chart, smallest, time, math.exp(float(np.mean(logs))) if logs.size else math.nan))
    return ratios


def unreduced_form(name: str) -> str | None:
    """Name of the registered integrator that steps the rule of a reduced kernel with nothing eliminated."""
    rule = rule_of(integrator(name))
    names = (method.name for method in integrators().values() if rule is not None and _unreduced_rule(method) == rule)
    return next(names, None)


def _unreduced_rule(method: Integrator) -> object:
    """The rule of an integrator of the unreduced kernel; None for any other."""
    kernel = inside(method.solvers["angles"]) if "angles" in method.solvers else None
    return kernel.rule if kernel is not None and kernel.loop is unreduced.march else None


def with_unreduced_form() -> dict[str, str]:
    """The registered reduced integrators that have an unreduced form: its name by theirs."""
    forms = {name: unreduced_form(name) for name in integrators()}
    return {name: form for name, form in forms.items() if form is not None}


def both_forms(name: str) -> tuple[str, str]:
    """The names of a reduced integrator and of its unreduced form; SymtopError if it has none."""
    form = unreduced_form(name)
    if form is None:
        known = ", ".join(with_unreduced_form())
        raise SymtopError(f"integrator must be one with an unreduced form ({known}), not {name!r}")
    return name, form


def unreduced_gaps(scene: Scene, name: str, horizon: float, steps: int, samples: int = 201) -> xr.Dataset:
    """Distances between a reduced kernel and its unreduced form over one run; dimension ``sample``.

    The gaps of the angles are in radians. The drifts are the relative changes of the unreduced form's momenta, which
    are part of its state and conserved only as far as its equations are solved.
    """
    labels = both_forms(name)
    reduced, whole = (
        simulate(
            scene, label, step_size=horizon / steps, horizon=horizon, samples=samples, observe="attitude", guard=False
        )
        for label in labels
    )
    columns = {gap: np.abs(reduced[angle].values - whole[angle].values) for gap, angle in GAPS.items()}
    for drift, momentum in ((Column.P_PHI_DRIFT, "p_phi"), (Column.P_PSI_DRIFT, "p_psi")):
        values = whole[momentum].values
        columns[drift] = np.abs(values - values[0]) / scene.momentum_scale
    columns[Column.TIME] = reduced["time"].values
    return xr.Dataset({label: ("sample", values) for label, values in columns.items()})


def unreduced_cost(scene: Scene, name: str, step_sizes: Sequence[float], batches: int = 5) -> xr.Dataset:
    """Seconds and iterations a step of a reduced kernel and its unreduced form; dimensions ``kernel``, "
    "``twin_step``."""
    labels = both_forms(name)
    runs = [
        bare_run(scene, integrator(label), "angles", step, TIMED_STEPS * step)
        for label in labels
        for step in step_sizes
    ]
    shape = (2, len(step_sizes))
    steps, iterations = (
        np.array([getattr(run(), count) for run in runs], float).reshape(shape)
        for count in ("steps", "newton_iterations")
    )
    seconds = np.array([timing.best for timing in timings(runs, batches)]).reshape(shape)
    dims = ("kernel", "twin_step")
    return xr.Dataset(
        {
            Column.SECONDS_A_STEP: (dims, seconds / steps),
            Column.ITERATIONS_A_STEP: (dims, iterations / steps),
            Column.COMPARED_STEP: ("twin_step", np.array(step_sizes)),
        },
        coords={"kernel": ["reduced", "unreduced"]},
    )


def commutation_table(scene: Scene, method: Integrator, horizon: float, counts: Sequence[int]) -> xr.Dataset:
    """How far reducing first and reducing last end up apart at several step sizes; dimension ``commutation_step``.

    The gaps are the largest differences in theta (radians) over the run; for the midpoint rule there is also the gap
    from the implicit midpoint rule on (theta, p_theta).
    """
    steps = [(horizon / count, count) for count in counts]
    columns = {
        Column.COMMUTATION_STEP: [h for h, _ in steps],
        Column.COMMUTATION_GAP: [commutation_gap(scene, method, *step).theta for step in steps],
    }
    if is_midpoint(method):
        columns[Column.HAMILTONIAN_GAP] = [hamiltonian_gap(scene, method, *step).theta for step in steps]
    return xr.Dataset({name: ("commutation_step", values) for name, values in columns.items()})


def commutation_order(cell: xr.Dataset) -> float:
    """The power of the step with which the gap of one integrator falls; the coarsest step does not enter."""
    return power_law(cell[Column.COMMUTATION_STEP].values[1:], cell[Column.COMMUTATION_GAP].values[1:]).slope
