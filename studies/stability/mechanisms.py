"""The tables of the stability study: one dataset for each mechanism of failure and each integrator.

Outcomes are stored as bytes, an index into `VERDICTS`, with 255 where nothing was run. Steps are in nutation periods of
the scene they belong to, phases are h omega.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from symtop.methods.discrete_lagrangian import is_midpoint, rule_of
from symtop.methods.registry import Integrator
from symtop.model.scenes import Scene, scene
from symtop.run.linear_stability import linear_limits, sleeping_threshold, with_momenta

from .failures import plain_midpoint, sampled_energy_error, separatrix_horizon, solver_sweep, surviving_displacement
from .outcome_maps import family, outcome_map

PAST = 1.05  # times the resonant step: far enough for what a resonance kills to live again


def map_table(name: str, method: Integrator, settings: Mapping[str, Any]) -> xr.Dataset:
    """An outcome map over a family of scenes and the knob, with the linear limits of a fixed step over it."""
    parameters, knob = settings["parameters"], settings["ladder"]
    found = outcome_map(name, parameters, method, knob, settings["periods"])
    table: dict[str, Any] = {
        "outcome": (("parameter", "setting"), found.verdict),
        "parameter_value": ("parameter", np.asarray(parameters, float)),
        "knob": ("setting", np.asarray(knob, float)),
        "knob_name": method.knob or "none",
        "grid": f"{len(knob)} x {len(parameters)}",
    }
    if name == "grazing":
        column = int(np.argmin(np.abs(np.log(np.asarray(knob, float) / settings["shown"])))) if method.knob else 0
        table |= {"shown_knob": float(knob[column]), "grazing_error": ("parameter", found.axis_error[:, column])}
    elif method.knob == "step_size" and settings.get("limits"):
        values = np.asarray(settings["limits"], float)
        ends = np.array([family_limits(name, method, float(value), knob[-1]) for value in values])
        table |= {
            "limit_parameter": ("curve", values),
            "linear_limit": ("curve", ends[:, 0]),
            "third_turn": ("curve", ends[:, 1]),
        }
    return xr.Dataset(table)


def family_limits(name: str, method: Integrator, parameter: float, most: float) -> tuple[float, float]:
    """Linear limit and third of a turn, in nutation periods, at the steady precession with a scene's momenta."""
    where = family(name)(parameter)
    momenta, period = where.top.momenta(where.start), where.nutation_period
    theta = where.top.steady_theta(momenta)
    if not 0.0 < theta < math.pi or not math.isfinite(period):
        return math.nan, math.nan
    standing = Scene(where.name, where.top, with_momenta(where.top, theta, momenta), where.horizon)
    limit, third = linear_limits(method, standing, np.geomspace(0.05, most, 48) * period)
    return limit / period, third / period


def resonance_table(name: str, method: Integrator, settings: Mapping[str, Any]) -> xr.Dataset:
    """What survives of a displaced steady precession against h omega, and where the linearised map has its limits."""
    where = scene(name)
    omega = where.top.nutation_frequency(where.top.momenta(where.start))
    phases = np.asarray(settings["phases"], float)
    limit, third = linear_limits(method, where, np.linspace(0.02, phases[-1], 120) / omega)
    alive = [surviving_displacement(method, where, float(x) / omega, settings["steps"]) for x in phases]
    around = [math.nan, math.nan]
    if math.isfinite(third):
        around = [surviving_displacement(method, where, x * third, settings["steps"]) for x in (1.0, PAST)]
    return xr.Dataset(
        {
            "phase_value": ("phase", phases),
            "surviving": ("phase", alive),
            "limit_phase": limit * omega,
            "third_turn_phase": third * omega,
            "surviving_at_third_turn": around[0],
            "surviving_past_third_turn": around[1],
        }
    )


def sleeping_table(name: str, method: Integrator, settings: Mapping[str, Any]) -> xr.Dataset:
    """The spin at which the upright top begins to sleep, against the step."""
    steps = settings["steps"]
    return xr.Dataset(
        {
            "sleeping_step": ("rung", np.asarray(steps, float)),
            "sleeping_threshold": ("rung", [sleeping_threshold(method, float(h)) for h in steps]),
        }
    )


def separatrix_table(name: str, method: Integrator, settings: Mapping[str, Any]) -> xr.Dataset:
    """How long runs next to the separatrix stay right, and how long their early error says that they will."""
    rows = [separatrix_horizon(method, scene(name), float(value)) for value in settings["ladder"]]
    columns: Sequence[Any] = list(zip(*rows, strict=True))
    names = ("early_error", "horizon", "predicted_horizon")
    return xr.Dataset({key: ("setting", np.asarray(column)) for key, column in zip(names, columns, strict=True)})


def sampling_table(name: str, method: Integrator, settings: Mapping[str, Any]) -> xr.Dataset:
    """An energy error as it looks once a nutation and at every step; for discrete Lagrangians, the solver's share."""
    where = scene(name)
    once, every = sampled_energy_error(method, where, settings["steps"], settings["periods"])
    table: dict[str, Any] = {"energy_once": once, "energy_every": every}
    if rule_of(method) is not None:
        tolerances = settings["tolerances"]
        h, steps = settings["step_size"], settings["solver_steps"]
        rows = [solver_sweep(method, where, h, steps, float(value)) for value in tolerances]
        table |= {
            "solver_tolerance": ("tolerance_setting", np.asarray(tolerances, float)),
            "solver_energy": ("tolerance_setting", [entry.energy for entry in rows]),
            "solver_momentum": ("tolerance_setting", [entry.momentum for entry in rows]),
            "solver_iterations": ("tolerance_setting", [entry.iterations for entry in rows]),
        }
        if is_midpoint(method):
            plain = [plain_midpoint(where, h, steps, float(value)).energy for value in tolerances]
            table["plain_energy"] = ("tolerance_setting", plain)
            table["one_iteration_energy"] = plain_midpoint(where, h, steps, 0.0, 1).energy
    return xr.Dataset(table)
