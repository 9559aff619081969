"""The tables of the stability study: one dataset for each mechanism of failure and each integrator.

Outcomes are stored as bytes, an index into `VERDICTS`; 255 means that nothing was run. Steps are in nutation periods of
the scene they belong to; phases are h omega, the step times the angular frequency of small nutations.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from symtop.methods.discrete_lagrangian import is_midpoint, rule_of
from symtop.methods.registry import Integrator
from symtop.model import scenes
from symtop.model.scenes import Scene
from symtop.run.linear_stability import linear_limits, sleeping_threshold, with_momenta

from .failures import sampled_energy_error, separatrix_horizon, surviving_displacement
from .outcome_maps import family, outcome_map
from .solver_tolerance import solver_sweep, textbook_midpoint

PERIODS = 12.0  # nutations of a run of a map over spin
PAST_RESONANCE = 1.05  # times the resonant step: far enough for what a resonance kills to live again


class Column:
    """Names of the variables of the study's dataset."""

    # maps of outcomes, dimensions parameter and setting
    OUTCOME = "outcome"
    PARAMETER = "parameter_value"  # relative spin, or gap delta
    SETTING = "knob"  # step in nutation periods, or tolerance
    CONTROL = "knob_name"  # step_size, tolerance or none
    GRID = "grid"  # settings x parameters
    # along a map over spin, dimension curve
    LIMIT_PARAMETER = "limit_parameter"
    LINEAR_LIMIT = "linear_limit"
    THIRD_TURN = "third_turn"
    # one column of the map over the gap to a pole
    SHOWN_SETTING = "shown_knob"
    GRAZING_ERROR = "grazing_error"
    # resonances, dimension phase
    PHASE = "phase_value"
    SURVIVING = "surviving"
    LIMIT_PHASE = "limit_phase"
    THIRD_TURN_PHASE = "third_turn_phase"
    SURVIVING_AT_THIRD_TURN = "surviving_at_third_turn"
    SURVIVING_PAST_THIRD_TURN = "surviving_past_third_turn"
    # the sleeping top, dimension rung
    SLEEPING_STEP = "sleeping_step"
    SLEEPING_THRESHOLD = "sleeping_threshold"
    # next to the separatrix, dimension setting
    EARLY_ERROR = "early_error"
    HORIZON = "horizon"
    PREDICTED_HORIZON = "predicted_horizon"
    # sampling
    ENERGY_ONCE = "energy_once"
    ENERGY_EVERY = "energy_every"
    # the solver of an implicit method, dimension tolerance_setting
    SOLVER_TOLERANCE = "solver_tolerance"
    SOLVER_ENERGY = "solver_energy"
    SOLVER_MOMENTUM = "solver_momentum"
    SOLVER_ITERATIONS = "solver_iterations"
    TEXTBOOK_ENERGY = "plain_energy"
    ONE_ITERATION_ENERGY = "one_iteration_energy"


def map_table(name: str, method: Integrator, settings: Mapping[str, Any]) -> xr.Dataset:
    """An outcome map over a family of scenes and the control, with the linear limits of a fixed step over it."""
    parameters, ladder = settings["parameters"], settings["ladder"]
    runs = outcome_map(name, parameters, method, ladder, settings["periods"])
    table: dict[str, Any] = {
        Column.OUTCOME: (("parameter", "setting"), runs.verdict),
        Column.PARAMETER: ("parameter", np.asarray(parameters, float)),
        Column.SETTING: ("setting", np.asarray(ladder, float)),
        Column.CONTROL: method.knob or "none",
        Column.GRID: f"{len(ladder)} x {len(parameters)}",
    }
    if name == "grazing":
        nearest = np.abs(np.log(np.asarray(ladder, float) / settings["shown"]))
        column = int(np.argmin(nearest)) if method.knob else 0
        table[Column.SHOWN_SETTING] = float(ladder[column])
        table[Column.GRAZING_ERROR] = ("parameter", runs.axis_error[:, column])
    elif method.fixed_step and settings.get("limits"):
        values = np.asarray(settings["limits"], float)
        ends = np.array([family_limits(name, method, float(value), ladder[-1]) for value in values])
        table[Column.LIMIT_PARAMETER] = ("curve", values)
        table[Column.LINEAR_LIMIT] = ("curve", ends[:, 0])
        table[Column.THIRD_TURN] = ("curve", ends[:, 1])
    return xr.Dataset(table)


def family_limits(name: str, method: Integrator, parameter: float, most: float) -> tuple[float, float]:
    """Linear limit and third of a turn, in nutation periods, at the steady precession with a scene's momenta."""
    member = family(name)(parameter)
    momenta, period = member.top.momenta(member.start), member.nutation_period
    theta = member.top.steady_theta(momenta)
    if not 0.0 < theta < math.pi or not math.isfinite(period):
        return math.nan, math.nan
    steady = Scene(member.name, member.top, with_momenta(member.top, theta, momenta), member.horizon)
    limit, third = linear_limits(method, steady, np.geomspace(0.05, most, 48) * period)
    return limit / period, third / period


def resonance_table(name: str, method: Integrator, settings: Mapping[str, Any]) -> xr.Dataset:
    """What survives of a displaced steady precession against h omega, and where the linearised map has its limits."""
    scene = scenes.scene(name)
    omega = scene.top.nutation_frequency(scene.top.momenta(scene.start))
    phases = np.asarray(settings["phases"], float)
    limit, third = linear_limits(method, scene, np.linspace(0.02, phases[-1], 120) / omega)
    alive = [surviving_displacement(method, scene, float(x) / omega, settings["steps"]) for x in phases]
    at, past = math.nan, math.nan
    if math.isfinite(third):
        at, past = (surviving_displacement(method, scene, x * third, settings["steps"]) for x in (1.0, PAST_RESONANCE))
    return xr.Dataset(
        {
            Column.PHASE: ("phase", phases),
            Column.SURVIVING: ("phase", alive),
            Column.LIMIT_PHASE: limit * omega,
            Column.THIRD_TURN_PHASE: third * omega,
            Column.SURVIVING_AT_THIRD_TURN: at,
            Column.SURVIVING_PAST_THIRD_TURN: past,
        }
    )


def sleeping_table(name: str, method: Integrator, settings: Mapping[str, Any]) -> xr.Dataset:
    """The spin at which the upright top begins to sleep, against the step."""
    steps = settings["steps"]
    return xr.Dataset(
        {
            Column.SLEEPING_STEP: ("rung", np.asarray(steps, float)),
            Column.SLEEPING_THRESHOLD: ("rung", [sleeping_threshold(method, float(h)) for h in steps]),
        }
    )


def separatrix_table(name: str, method: Integrator, settings: Mapping[str, Any]) -> xr.Dataset:
    """How long runs next to the separatrix stay right, and how long their early error says that they will."""
    rows = [separatrix_horizon(method, scenes.scene(name), float(value)) for value in settings["ladder"]]
    columns: Sequence[Any] = list(zip(*rows, strict=True))
    names = (Column.EARLY_ERROR, Column.HORIZON, Column.PREDICTED_HORIZON)
    return xr.Dataset({key: ("setting", np.asarray(column)) for key, column in zip(names, columns, strict=True)})


def sampling_table(name: str, method: Integrator, settings: Mapping[str, Any]) -> xr.Dataset:
    """An energy error as it looks once a nutation and at every step; for discrete Lagrangians, the solver's share."""
    scene = scenes.scene(name)
    once, every = sampled_energy_error(method, scene, settings["steps"], settings["periods"])
    table: dict[str, Any] = {Column.ENERGY_ONCE: once, Column.ENERGY_EVERY: every}
    if rule_of(method) is not None:
        tolerances = settings["tolerances"]
        h, steps = settings["step_size"], settings["solver_steps"]
        rows = [solver_sweep(method, scene, h, steps, float(value)) for value in tolerances]
        table |= {
            Column.SOLVER_TOLERANCE: ("tolerance_setting", np.asarray(tolerances, float)),
            Column.SOLVER_ENERGY: ("tolerance_setting", [entry.energy for entry in rows]),
            Column.SOLVER_MOMENTUM: ("tolerance_setting", [entry.momentum for entry in rows]),
            Column.SOLVER_ITERATIONS: ("tolerance_setting", [entry.iterations for entry in rows]),
        }
        if is_midpoint(method):
            textbook = [textbook_midpoint(scene, h, steps, float(value)).energy for value in tolerances]
            table[Column.TEXTBOOK_ENERGY] = ("tolerance_setting", textbook)
            table[Column.ONE_ITERATION_ENERGY] = textbook_midpoint(scene, h, steps, 0.0, 1).energy
    return xr.Dataset(table)


MECHANISMS = {  # by the scene on which each is measured; every other scene has a map over its spin
    "grazing": map_table,
    "steady-fast": resonance_table,
    "sleeping": sleeping_table,
    "separatrix": separatrix_table,
    "goldstein": sampling_table,
}
