"""compare(): error against cost of several methods on one scene, as one dataset.

The setting of each method is searched for each target error (`symtop.measure.settings.seek`), from loose targets to
tight ones, until one is not met; then steps are doubled until a run fails or has only a few steps. All runs are kept.
Good runs are then timed against each other (`symtop.measure.timing`): a slow spell of the machine affects all alike.
"""

import math
from typing import Any

import numpy as np
import xarray as xr

from symtop.core import netcdf
from symtop.core.errors import SymtopError, boolean, one_of, positive
from symtop.core.parallel import cores, in_threads
from symtop.core.progress import CLOSED_FORM, kernels_to_compile, post, progress_bar
from symtop.judging.adapters.adapter import integrator as adapted
from symtop.judging.adapters.external import x64
from symtop.judging.claims.subject import LIBRARIES, open_target
from symtop.measure import columns, settings
from symtop.measure.accuracy import as_table, blank_row
from symtop.measure.errors import QUANTITIES
from symtop.measure.sweep import NOT_TIMED, RAISED, TIMED, attributes, error_row_or_message, listed, timed_rows
from symtop.methods.framework.registry import Integrator, integrator as find_integrator
from symtop.model.exact import closed_form
from symtop.model.scenes import Scene, horizon_of, scene as find_scene
from symtop.run.simulation import chart_of, likely_step

COSTS = ("time", "evaluations")
BUDGET = {"compiled": 3e6, "python": 5e4}  # force evaluations of a run
REASONS = {  # the reasons of `seek`, shortened for the cell of a table
    settings.STOPPED: "rounding or the limits of its setting", settings.BUDGET: "budget", settings.FAILED: "it fails",
    settings.TRIED: "it converges slowly or not at all",
}  # fmt: skip


def compare(
    scene: str | Scene, methods: Any, *, horizon: float | None = None, nutations: float | None = None,
    quantity: str = "axis", cost: str = "time", budget: float | None = None, quiet: bool = False,
) -> xr.Dataset:  # fmt: skip
    """Error against run time, or against force evaluations, of several methods on one scene.

    `methods` are names, variants such as ``rk4[axis]`` or records; a method without a chart runs in the smallest one
    that determines the `quantity` (axis, attitude, theta, energy, p_phi or, for a top, p_psi). A function, a class,
    ``FILE.py:NAME`` or a library is a step in the axis chart, or of a body, as `judge` takes it without a form.
    Runs go to the `horizon`, by default that of the scene, or over a number of `nutations`. With the `cost`
    "evaluations" nothing is timed. `budget` is the most force evaluations of a run, by default 3e6, in Python 5e4.

    Dimensions ``variant``, ``setting`` (coarse to fine), ``target`` (1e-3, 1e-6, 1e-9, 1e-12). Variables: those of
    `sweep`, errors and work of every run, and

        error, error_bound          those of the `quantity`, rad or relative as in `symtop.errors`
        seconds, seconds_spread     least of some run times, s, and their (median - least) / least: of one call of the
                                    solver, as the attribute ``timed`` says; NaN for runs that failed
        steps_per_nutation          the mean of an adaptive method; per eighth of the horizon on a separatrix
        outcome, message            "ok", or how the run ended; "raised", with the message, if the scene was refused
        reached(variant, target)    "met", or why not
        exact_seconds               run time of the exact motion

    Raises SymtopError for invalid arguments. `symtop.plot` draws the dataset.
    """
    problem = find_scene(scene, bodies=True)
    one_of("quantity", quantity, settings.OF_BODY if problem.of_body else QUANTITIES)
    one_of("cost", cost, COSTS)
    if horizon is not None and nutations is not None:
        raise SymtopError("compare takes horizon or nutations, not both", "horizon", "nutations")
    if nutations is not None and not math.isfinite(problem.nutation_period):
        raise SymtopError(f"{problem.name} has no nutation: give horizon, not nutations", "horizon", "nutations")
    duration = horizon if nutations is None else positive("nutations", nutations) * problem.nutation_period
    end = problem.horizon if duration is None else horizon_of(duration)
    budget = None if budget is None else positive("budget", budget)
    with x64(restored=True):
        records = [find(method, problem) for method in listed(methods)]
    variants = [record.variant(chart_of(record, problem.observes, settings.observed(quantity))) for record in records]
    names = [variant.name for variant in variants]
    if not names or len(set(names)) < len(names):
        raise SymtopError(f"methods must be one or more, each once, not {names!r}", "methods")
    if problem.of_body:  # refuse a horizon beyond its reference before any run
        settings.judgeable(problem, quantity, end)

    def runs_of(method: Integrator) -> tuple[list[dict[str, Any]], list[str]]:
        limit = BUDGET[method.implementation] * min(method.speed, 1.0) if budget is None else budget
        return _runs(problem, method, end, limit, quantity)

    exact = find_integrator("exact")
    with progress_bar("compare", quiet=boolean("quiet", quiet), total=len(names)) as bar, x64(restored=True):
        results = []
        kernels = [variant for variant in variants if variant.implementation == "compiled"]
        kernels_to_compile[0] = len(kernels) + (0 if closed_form.load() else CLOSED_FORM)
        post(f"methods that have run: 0 of {len(names)}")
        for runs_and_messages in in_threads(runs_of, variants, min(cores(), len(variants))):
            results.append(runs_and_messages)
            bar.update()
            post(f"methods that have run: {len(results)} of {len(names)}")
        rows: list[dict[str, Any]] = [{"setting_value": math.nan, "outcome": "ok"}]
        if cost == "time":
            bar.set_description("timing")
            post("timing the runs")
            pairs = zip([exact, *variants], [rows, *(runs for runs, _ in results)], strict=True)
            jobs = [(problem, method, end, runs) for method, runs in pairs]
            timed_rows(jobs[1:] if problem.of_body else jobs)
    size = max(len(runs) for runs, _ in results)
    blank: dict[str, Any] = {**NOT_TIMED, "message": "", "setting_value": math.nan}
    tables = [
        as_table([blank | run for run in runs] + [blank_row(method) | blank] * (size - len(runs)))
        for method, (runs, _) in zip(variants, results, strict=True)
    ]
    data = xr.concat(tables, "variant").drop_vars("setting_value")
    mean = data["reached_time"] / data["steps"].where(data["steps"] > 0.0)
    data = data.assign(
        error=data[quantity], error_bound=data[f"{quantity}_bound"], exact_seconds=rows[0].get("seconds", math.nan),
        steps_per_nutation=problem.time_scale(end) / data["step_size"].where(data["step_size"] > 0.0, mean),
        reached=(("variant", "target"), [reached for _, reached in results]),
    )  # fmt: skip
    data = data.assign_coords(variant=names, target=list(settings.TARGETS), scene=problem.name)
    entries = {f"error{suffix}": columns.ERROR_TABLE[f"{quantity}{suffix}"] for suffix in ("", "_bound")}
    entries["target"] = "error that is accepted, largest over the run", *entries["error"][1:]
    error_columns = {name: netcdf.Column(entry, {}) for name, entry in entries.items()}
    columns.described(data, problem.units, error_columns, [problem.of_body])
    return netcdf.describe(
        data, f"error against cost on {problem.name}", units=problem.units, quantity=quantity, cost=cost,
        nutations=end / problem.nutation_period, timed=TIMED if cost == "time" else "nothing",
        budget=str(budget or BUDGET), **attributes([problem], {problem.name: end}),
    )  # fmt: skip


def find(method: Any, on: Scene) -> Integrator:
    """The integrator of a name, a record, or a step as `judge` takes it, in the axis chart or of a body."""
    if isinstance(method, Integrator):
        return method
    if method is None or isinstance(method, (int, float, bytes)):
        raise SymtopError(f"methods must be names, integrators or steps, not {method!r}", "methods")
    library = str(method).partition(":")[0].endswith(LIBRARIES)
    if isinstance(method, str) and not (library or {*"/ "} & {*method} or ".py" in method):
        return find_integrator(method)
    return adapted(open_target(method, "shared" if library else "ode", "axis", on=on))


def _runs(
    scene: Scene, method: Integrator, horizon: float, budget: float, quantity: str
) -> tuple[list[dict[str, Any]], list[str]]:
    rows: dict[float, dict[str, Any]] = {}
    observe = settings.observed(quantity)

    def run(setting: float) -> tuple[float, float]:
        if setting not in rows:
            limit = 2.0 * budget if method.adaptive else None  # rk45 at 1e-2 may make tiny steps
            rows[setting] = error_row_or_message(scene, method, setting, horizon, observe, limit)
            rows[setting]["setting_value"] = setting
        error, work = (float(rows[setting][name]) for name in (quantity, "force_evaluations"))
        steps = horizon / setting if method.fixed_step else 0.0  # a step costs time even where no force is evaluated
        return error if math.isfinite(error) else math.inf, max(work, steps) if math.isfinite(work) else steps

    if method.control is None:
        error, _ = run(math.nan)
        outcomes = ["met" if error <= target else "nothing can be set" for target in settings.TARGETS]
        return list(rows.values()), outcomes
    ends, power = settings.limits(scene, method, horizon, quantity), float(method.order or 2)
    power = power if method.fixed_step else 1.0
    first = settings.TARGETS[0]
    guess = likely_step(scene, method, horizon, first) if method.fixed_step else 0.1 * first
    reached: list[str] = []
    for k, target in enumerate(settings.TARGETS):
        if k:
            error, work = run(guess)
            factor = (0.5 * target / max(error, 1e-3 * target)) ** (1.0 / power)
            affordable = work / budget if method.fixed_step else 0.0
            guess *= min(max(factor, affordable), 1.0)
        if method.fixed_step and horizon / min(guess, ends[1]) > budget:
            why = settings.BUDGET
        else:
            guess, why = settings.seek(run, guess, target, ends, power, fixed_step=method.fixed_step, patience=budget)
        if why == settings.BUDGET and rows and method.fixed_step:  # the last run that can be afforded
            last = min(rows)
            affordable = last * run(last)[1] / budget
            meets = 0.0 < affordable < last / 1.2 and run(affordable)[0] <= target
            guess, why = (affordable, "") if meets else (guess, why)
        if why:
            why = RAISED if rows and all(row["outcome"] == RAISED for row in rows.values()) else REASONS[why]
            reached += [why] * (len(settings.TARGETS) - k)
            break
        reached.append("met")
    while rows and method.fixed_step and rows[max(rows)]["outcome"] == "ok" and max(rows) < ends[1]:
        run(min(2.0 * max(rows), ends[1]))
    return [rows[setting] for setting in sorted(rows, reverse=True)] or [dict(blank_row(method))], reached


def cheapest(data: xr.Dataset, target: float) -> np.ndarray:
    """The index along ``setting`` of each variant's cheapest run with an error within `target`, or -1; (variants,)."""
    cost = data["seconds" if data.attrs["cost"] == "time" else "force_evaluations"].values
    valid = (data["outcome"].values == "ok") & (data["error"].values <= target) & np.isfinite(cost)
    return np.where(valid.any(axis=1), np.argmin(np.where(valid, cost, np.inf), axis=1), -1)


def ranked(data: xr.Dataset) -> tuple[float, dict[str, float]]:
    """The largest number of force evaluations that all variants reach, and their least errors with it, best first."""
    work = data["force_evaluations"].where((data["outcome"] == "ok") & (data["force_evaluations"] > 0.0))  # 0: unknown
    limit = float(work.max("setting").min())
    errors = data["error"].where(work <= limit).min("setting").to_series().dropna()
    return limit, {str(name): float(error) for name, error in errors.sort_values().items()}
