"""compare(): what methods cost on one scene for the error that they make, as one dataset.

Each method walks from coarse settings to fine ones (`symtop.measure.settings.Walk`), as in the work-precision study:
about two decades of error a step, until the finest target is met, rounding stops it or a run would exceed the budget;
then it comes close to each target from both sides. Runs are timed afterwards, against each other, in rounds of batches
(`symtop.measure.timing.timings`): a slow spell of the machine hits all methods alike.
"""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from tqdm import tqdm

from symtop.core import netcdf
from symtop.core.errors import SymtopError, boolean, foreign_code, one_of, positive
from symtop.core.parallel import cores, in_threads
from symtop.core.progress import beating
from symtop.measure.errors import QUANTITIES
from symtop.measure.settings import ANGLES, CAPPED, TARGETS, Walk, coarse_setting, observed
from symtop.measure.timing import bare_run, timings
from symtop.methods.framework.registry import Integrator, integrator as find_integrator
from symtop.model.scenes import Scene, horizon_of, scene as find_scene
from symtop.runner.sweep import RAISED, listed

COSTS = ("time", "evaluations")
BUDGET = {"compiled": 3e6, "python": 5e4}  # force evaluations of a run
BATCHES, BATCH, PATIENCE = 15, 0.001, 0.2  # of the timings: samples of a run, seconds of one, seconds of all
COARSER = 2  # steps, each twice the one before, that are tried beyond the coarsest in order to see a method fail
TIMED = (
    "one call of the method's solver from the start to the horizon, with two samples and nothing around it; the least "
    f"of at most {BATCHES} batches of at least {1e3 * BATCH:g} ms each, in random order among those of the other runs"
)
ERRORS = ("energy", "p_phi", "p_psi")
WORDS = {
    "seconds": ("run time, the least of some", "s"),
    "seconds_spread": ("(median - least) / least of the run time", "1"),
    "steps_per_nutation": ("steps in a nutation period", "1"),
    "message": ("why a method could not be run", ""),
    "reached": ("is the error within a target, and if not, why", ""),
    "target": ("largest error that is accepted", ""),
    "exact_seconds": ("run time of the exact motion, the least of some", "s"),
}


class _Tried(NamedTuple):
    """The runs of a variant, coarse to fine, why there are no finer ones, and what refused it."""

    rows: list[dict[str, Any]]
    reached: list[str]
    message: str


def compare(
    scene: "str | Scene", methods: "str | Integrator | Iterable[str | Integrator]", *, horizon: float | None = None,
    nutations: float | None = None, quantity: str = "axis", cost: str = "time", budget: float | None = None,
    quiet: bool = False,
) -> xr.Dataset:  # fmt: skip
    """Error against run time, or against force evaluations, of some methods on one scene.

    `methods` are names, variants such as ``rk4[axis]`` or records; a method without a chart runs in the smallest one
    that shows the `quantity` (axis, attitude, theta, energy, p_phi or p_psi). Runs go to the `horizon`, the scene's own
    by default, or over so many `nutations`. With the `cost` "evaluations" nothing is timed. `budget` is the most force
    evaluations of a run, by default 3e6, for plain Python 5e4.

    Dimensions ``variant``, ``setting`` (coarse to fine) and ``target`` (1e-3, 1e-6, 1e-9, 1e-12). Variables:

        error                            largest of `quantity` over the run, rad or relative as in `symtop.errors`
        error_bound                      the least error that the reference can judge
        energy, p_phi, p_psi             their largest relative errors
        seconds, seconds_spread          least of some run times, s, and their (median - least) / least; of one call of
                                         the solver as the attribute ``timed`` says, also if it ended early
        force_evaluations, steps         work
        step_size, tolerance             coordinates: what was set; NaN where the method has no such setting
        steps_per_nutation               coordinate, of an adaptive method the mean; on a separatrix the unit is an
                                         eighth of the horizon
        outcome, message                 "ok", or how the run ended; "not_run" where a method has fewer settings;
                                         "raised", with the message, if the method refused the scene
        reached(variant, target)         "met", or why not
        exact_seconds                    run time of the exact motion

    Raises SymtopError for arguments that make no sense. `symtop.plot` draws the dataset; `cheapest` reads it.
    """
    chosen = find_scene(scene)
    one_of("quantity", quantity, QUANTITIES)
    one_of("cost", cost, COSTS)
    if horizon is not None and nutations is not None:
        raise SymtopError("compare takes horizon or nutations, not both", "horizon", "nutations")
    if nutations is not None and not math.isfinite(chosen.nutation_period):
        raise SymtopError(f"{chosen.name} has no nutation: give horizon, not nutations", "horizon", "nutations")
    periods = None if nutations is None else positive("nutations", nutations)
    end = chosen.horizon if horizon is None else horizon_of(horizon)
    end = end if periods is None else horizon_of(periods * chosen.nutation_period)
    most = None if budget is None else positive("budget", budget)
    records = [find_integrator(one) for one in listed(methods)]
    variants = [one.variant(one.chart_for(observed(quantity))) for one in records]
    names = [one.name for one in variants]
    if not names or len(set(names)) < len(names):
        raise SymtopError(f"methods must be one or more, each once, not {names!r}", "methods")

    def tried(method: Integrator) -> _Tried:
        limit = BUDGET[method.implementation] * min(method.speed, 1.0) if most is None else most
        return _walk(chosen, method, end, limit, quantity)

    with beating(tqdm(total=len(names), desc="compare", disable=boolean("quiet", quiet) or None, leave=False)) as bar:
        found = []
        for one in in_threads(tried, variants, min(cores(), len(variants))):
            found.append(one)
            bar.update()
        bar.set_description("timing")
        exact = _time(chosen, variants, found, end) if cost == "time" else math.nan
    data = _dataset(chosen, variants, found, end, quantity)
    data["exact_seconds"] = (), exact, _words("exact_seconds")
    return data.assign_attrs(cost=cost, timed=TIMED if cost == "time" else "nothing", budget=str(most or BUDGET))


def _walk(scene: Scene, method: Integrator, horizon: float, budget: float, quantity: str) -> _Tried:
    """All runs of a variant; one that refuses the scene has a single row that says so."""
    walk = Walk(scene, method, horizon, budget, quantity)
    first = coarse_setting(scene, method, horizon)
    try:
        if method.control is None:
            walk.run(math.nan)
        else:
            walk.descend(TARGETS, horizon / first if method.fixed_step else 0.0)
        if method.control is not None and walk.rows:
            walk.coarsen(max(TARGETS))
            for target in TARGETS:
                walk.approach(target)
            for _ in range(COARSER if method.fixed_step else 0):
                if walk.run(max(walk.rows))["outcome"] == "ok":
                    walk.run(min(2.0 * max(walk.rows), walk.coarsest))
    except SymtopError as error:
        if not walk.rows:
            return _Tried([{"outcome": RAISED}], [RAISED] * len(TARGETS), str(error))
        walk.stopped = "the next run was refused"
    if not walk.rows:
        return _Tried([{"outcome": "not_run"}], [walk.stopped] * len(TARGETS), "")
    reached = [walk.reached(target).replace(CAPPED, "met") for target in TARGETS]
    return _Tried([walk.rows[setting] for setting in sorted(walk.rows, reverse=True)], reached, "")


def _time(scene: Scene, variants: list[Integrator], found: list[_Tried], horizon: float) -> float:
    """Time every run, and the exact motion, whose time is returned; rows get ``seconds`` and ``seconds_spread``."""
    exact = find_integrator("exact")
    rows: list[dict[str, Any]] = [{}]
    calls = [bare_run(scene, exact, exact.chart_for("axis"), math.nan, horizon)]
    for method, one in zip(variants, found, strict=True):
        for row in one.rows:
            if "setting_value" in row:
                rows.append(row)
                calls.append(bare_run(scene, method, method.charts()[0], row["setting_value"], horizon))
    with foreign_code("a method that is timed"):
        taken = timings(calls, BATCHES, BATCH, warm=True, patience=PATIENCE)
    for row, timing in zip(rows, taken, strict=True):
        row |= {"seconds": timing.best, "seconds_spread": timing.spread}
    return float(rows[0]["seconds"])


def _dataset(
    scene: Scene, variants: list[Integrator], found: list[_Tried], horizon: float, quantity: str
) -> xr.Dataset:  # fmt: skip
    size, unit = max(len(one.rows) for one in found), "rad" if quantity in ANGLES else "1"
    place = ("variant", "setting")

    def column(name: str, blank: object = math.nan) -> tuple[tuple[str, str], np.ndarray]:
        return place, np.array(
            [[row.get(name, blank) for row in one.rows + [{}] * (size - len(one.rows))] for one in found]
        )

    numbers = ("seconds", "seconds_spread", "force_evaluations", "steps", "reached_time")
    data = xr.Dataset(
        {"error": column(quantity), "error_bound": column(f"{quantity}_bound")}
        | {name: column(name) for name in (*ERRORS, *numbers)}
        | {"outcome": column("outcome", "not_run"), "message": ("variant", [one.message for one in found])}
        | {"reached": (("variant", "target"), [one.reached for one in found])},
        {"variant": [one.name for one in variants], "target": list(TARGETS)}
        | {name: column(name) for name in ("step_size", "tolerance")},
    )
    scale = scene.time_scale(horizon)
    mean_step = data["reached_time"] / data["steps"].where(data["steps"] > 0.0)
    steps = scale / data["step_size"].where(data["step_size"] > 0.0, mean_step)
    data = data.assign_coords(steps_per_nutation=steps).drop_vars("reached_time")
    data = netcdf.describe(
        data, f"error against cost on {scene.name}", units=scene.units, scene=scene.name, quantity=quantity,
        horizon=horizon, nutations=horizon / scene.nutation_period,
    )  # fmt: skip
    for name in ERRORS:
        data[name].attrs = {"long_name": f"{QUANTITIES[name]}, largest over the run", "units": "1"}
    data["error"].attrs = {"long_name": f"{QUANTITIES[quantity]}, largest over the run", "units": unit}
    data["error_bound"].attrs = {"long_name": f"the least {QUANTITIES[quantity]} that can be judged", "units": unit}
    for name in {*WORDS} & {*data.variables}:
        data[name].attrs = _words(name)
    data["target"].attrs["units"] = unit
    return data


def _words(name: str) -> dict[str, str]:
    words, unit = WORDS[name]
    return {"long_name": words, "units": unit} if unit else {"long_name": words}


def cheapest(data: xr.Dataset, target: float) -> np.ndarray:
    """Place along ``setting`` of each variant's cheapest run within a target, or -1; its cost is that of `compare`."""
    cost = data["seconds" if data.attrs["cost"] == "time" else "force_evaluations"].values
    good = (data["outcome"].values == "ok") & (data["error"].values <= target) & np.isfinite(cost)
    return np.where(good.any(axis=1), np.argmin(np.where(good, cost, np.inf), axis=1), -1)


def fails_from(cell: xr.Dataset) -> int:
    """Place of the finest of a variant's coarsest runs that all failed, or -1 if its coarsest one ended well."""
    failed = ~np.isin(cell["outcome"].values, ("ok", "not_run"))
    return int(np.argmin(np.append(failed, False))) - 1
