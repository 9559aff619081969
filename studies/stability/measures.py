"""The measurements of a case: one dataset for each mechanism of failure and each integrator.

Outcomes are stored as bytes, an index into `VERDICTS`; 254 means that a scene had settled (`outcome_maps`) and was not
run, 255 that there is no such cell. Steps are in nutation periods of the scene they belong to; phases are h omega, the
step times the angular frequency of small nutations.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from symtop.methods.framework.registry import Integrator
from symtop.methods.lagrangian.discrete_lagrangian import is_midpoint, rule_of
from symtop.model import scenes
from symtop.model.scenes import Scene
from symtop.run.linear_stability import NO_TRACE, trace, with_momenta

from .failures import sampled_energy_error, separatrix_horizon, surviving_displacements
from .linear_limits import linear_limits, sleeping_threshold, surpasses
from .outcome_maps import SETTLED, family, outcome_map
from .solver_tolerance import solver_sweep, textbook_midpoint

PERIODS = 10.0  # nutations of a run of a map over spin, as in the other studies' short runs
SOUGHT_PHASE, SOUGHT_STEPS = 10.0, 300  # a linear limit is searched up to this h omega, at so many steps
CURVE_STEPS = 48  # steps at which it is searched at every spin of a map
PAST_RESONANCE = 1.05  # times the resonant step: beyond the resonance, where displacements survive again


def map_table(name: str, method: Integrator, settings: Mapping[str, Any]) -> xr.Dataset:
    """An outcome map over a family of scenes and the control, with the linear limits of a fixed step over it."""
    parameters, ladder = settings["parameters"], settings["ladder"]
    columns = []
    if name == "grazing":
        nearest = np.abs(np.log(np.asarray(ladder, float) / settings["shown"]))
        columns = [int(np.argmin(nearest)) if method.control else 0]
    runs = outcome_map(name, parameters, method, ladder, settings["periods"], columns)
    table: dict[str, Any] = {
        "outcome": (("parameter", "setting"), np.where(runs.made, runs.verdict, np.uint8(SETTLED))),
        "checks": float(runs.checks),
        "refuted": float(runs.refuted),
        "parameter_value": ("parameter", np.asarray(parameters, float)),
        "control": ("setting", np.asarray(ladder, float)),
        "knob_name": method.control or "none",
        "grid": f"{len(ladder)} x {len(parameters)}",
    }
    for column in columns:
        table["shown_knob"] = float(ladder[column])
        table["grazing_error"] = ("parameter", runs.axis_error[:, column])
    if method.fixed_step and settings.get("limits"):
        values = np.asarray(settings["limits"], float)
        ends = np.array([family_limits(name, method, float(value), ladder[-1]) for value in values])
        table["limit_parameter"] = ("curve", values)
        table["linear_limit"] = ("curve", ends[:, 0])
        table["third_turn"] = ("curve", ends[:, 1])
    return xr.Dataset(table)


def family_limits(name: str, method: Integrator, parameter: float, longest: float) -> tuple[float, float]:
    """Linear limit and third of a turn, in nutation periods, at the steady precession with a scene's momenta."""
    member = family(name)(parameter)
    momenta, period = member.top.momenta(member.start), member.nutation_period
    theta = member.top.steady_theta(momenta)
    if not 0.0 < theta < math.pi or not math.isfinite(period):
        return math.nan, math.nan
    steady = Scene(member.name, member.top, with_momenta(member.top, theta, momenta), member.horizon)
    limit, third = linear_limits(method, steady, np.geomspace(0.05, longest, CURVE_STEPS) * period)
    return limit / period, third / period


def resonance_table(name: str, method: Integrator, settings: Mapping[str, Any]) -> xr.Dataset:
    """Which displacements of a steady precession survive, against h omega, and the limits of the linearised map.

    The limits are searched at 300 steps up to h omega = 10, NaN if there is none; then narrow windows of growth between
    these steps (`Window`).
    """
    scene = scenes.scene(name)
    omega = scene.top.nutation_frequency(scene.top.momenta(scene.start))
    phases = np.asarray(settings["phases"], float)
    grid = np.linspace(0.02, SOUGHT_PHASE, SOUGHT_STEPS) / omega
    (limit, third), window = linear_limits(method, scene, grid), narrow_window(method, scene, grid)
    steps = [*(phases / omega).tolist(), third, PAST_RESONANCE * third]
    *surviving, at_third, past_third = surviving_displacements(method, scene, steps, settings["steps"]).tolist()
    columns: dict[str, Any] = {
        "phase_value": ("phase", phases),
        "surviving": ("phase", surviving),
        "displaced_steps": float(settings["steps"]),
        "limit_phase": limit * omega,
        "third_turn_phase": third * omega,
        "window_start": window.start * omega,
        "window_end": window.end * omega,
        "sought_phase": SOUGHT_PHASE,
        "surviving_at_third_turn": at_third,
        "surviving_past_third_turn": past_third,
    }
    return xr.Dataset(columns)


def sleeping_table(name: str, method: Integrator, settings: Mapping[str, Any]) -> xr.Dataset:
    """The spin at which the upright top begins to sleep, against the step."""
    steps = np.asarray(settings["steps"], float)
    thresholds = [sleeping_threshold(method, float(h)) for h in steps]
    return xr.Dataset({"sleeping_step": ("rung", steps), "sleeping_threshold": ("rung", thresholds)})


def separatrix_table(name: str, method: Integrator, settings: Mapping[str, Any]) -> xr.Dataset:
    """How long runs next to the separatrix stay accurate, and the prediction of that from their early error."""
    rows = [separatrix_horizon(method, scenes.scene(name), float(value)) for value in settings["ladder"]]
    names = "early_error", "horizon", "predicted_horizon", "broken"  # in the order of a Horizon
    return xr.Dataset(
        {name: ("setting", list(values)) for name, values in zip(names, zip(*rows, strict=True), strict=True)}
    )


def sampling_table(name: str, method: Integrator, settings: Mapping[str, Any]) -> xr.Dataset:
    """An energy error sampled once a nutation and at every step; for discrete Lagrangians, the solver's part in it."""
    scene, rule = scenes.scene(name), rule_of(method)
    once, every = sampled_energy_error(method, scene, settings["steps"], settings["periods"])
    table: dict[str, Any] = {
        "energy_once": once, "energy_every": every,
        "sampled_steps": float(settings["steps"]), "sampled_periods": float(settings["periods"]),
    }  # fmt: skip
    if rule is not None:
        run, tolerances = (scene, settings["step_size"], settings["solver_steps"]), settings["tolerances"]
        rows = [solver_sweep(rule, *run, float(value)) for value in tolerances]
        columns = {
            "solver_tolerance": tolerances,
            "solver_energy": [entry.energy for entry in rows],
            "solver_momentum": [entry.momentum for entry in rows],
            "solver_iterations": [entry.iterations for entry in rows],
        }
        table["solver_step"], table["solver_steps"] = settings["step_size"], float(settings["solver_steps"])
        if is_midpoint(method):
            columns["plain_energy"] = [textbook_midpoint(*run, float(value)) for value in tolerances]
            table["one_iteration_energy"] = textbook_midpoint(*run, 0.0, 1)
        table |= {column: ("tolerance_setting", np.asarray(values, float)) for column, values in columns.items()}
    return xr.Dataset(table)


MECHANISMS = {  # by the scene on which each is measured; every other scene has a map over its spin
    "grazing": map_table,
    "steady-fast": resonance_table,
    "sleeping": sleeping_table,
    "separatrix": separatrix_table,
    "goldstein": sampling_table,
}


NEARLY = 1.9  # a maximum of |t| on the grid above this may hide a window
TRIED = 200  # steps between the neighbours of a maximum


class Window(NamedTuple):
    """A narrow window of steps at which small nutations grow lies between these two steps, at which they do not.

    Where a step turns the nutation by half a turn or a whole one, |t| = 2, a pair of eigenvalues meets
    (`linear_stability`). At half turns the error of a splitting may take t beyond -2. At whole turns it pushes the
    nutation the same way in every step, and the fixed point goes away as one over the distance to that step: at the
    ends of the window it is some 1e-3 rad off, within there is none near, and runs swing by 0.01 rad. With a method of
    high order a window is a few thousandths of h omega wide. Where it lies, |t| has a maximum next to 2 on the grid;
    there, and only there, many more steps are tried.
    """

    start: float
    end: float


NO_WINDOW = Window(math.nan, math.nan)


def narrow_window(method: Integrator, scene: Scene, grid: np.ndarray) -> Window:
    """The first window between steps of a grid at each of which a symmetric method is stable.

    One that is narrower than a hundredth of the grid's spacing may be missed, and so may one with a maximum of |t| that
    passes 2 by less than rounding.
    """
    last = earlier = math.nan
    before = first = NO_TRACE
    for h in map(float, grid if method.symmetric else ()):
        at = trace(method, scene, h)
        if not surpasses(at, at.doubt) <= 0.0:
            break
        if abs(first.trace) <= abs(before.trace) >= max(NEARLY, abs(at.trace)):
            close = np.linspace(earlier, h, TRIED + 1)
            traces = [trace(method, scene, x) for x in close.tolist()]
            lost = np.flatnonzero([not surpasses(value, value.doubt) <= 0.0 for value in traces])
            if lost.size:
                return Window(float(close[lost[0] - 1]), float(close[lost[-1] + 1]))
        earlier, last, first, before = last, h, before, at
    return NO_WINDOW
