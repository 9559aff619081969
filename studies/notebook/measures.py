"""The measurements on one integrator on one of the notebook's two scenes.

For every integrator: residuals, the differences of energy and momenta from their start. For the notebook's own solver
also its path, a comparison of the two derivations, and (second scene) the rate that belongs to the printed alpha; for
two discrete methods their modified energy (formulas and source: `symtop.run.modified_energy`), about which the energy
itself oscillates by O(h^2).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from symtop.measure.conservation import residuals
from symtop.measure.settings import smallest_charts
from symtop.methods.framework.registry import integrator
from symtop.methods.library.scipy_ivp import integrated
from symtop.model.scenes import Scene, closed_form
from symtop.run.modified_energy import modified_energy
from symtop.run.simulation import integrate

from .derivations import easy_way, energies, hard_way, nutation_cubic, six_variables, with_alpha

SOLVER = "lsoda[angles]"  # the default solver of the notebook's system is of this family
SOLVER_TOLERANCE = 2.6e-7  # with it LSODA keeps as many figures as the notebook reports, whose tolerance is unknown
STEPS_A_NUTATION = 118.02  # of every discrete method; no whole number, so that samples and nutation do not lock
MIDPOINT = "midpoint[angles]"
MODIFIED = (MIDPOINT, "stormer-verlet[angles]")  # variants whose modified energy is stored
ALPHA = 1.6  # of the second scene, as the notebook prints it
SAMPLES, PATH_SAMPLES = 301, 1201


def discrete_methods() -> list[str]:
    """Variants of the discrete Lagrangians and splittings of the registry, in the angles or the axis chart."""
    families = "discrete-lagrangian", "splitting"
    return [variant.name for variant in smallest_charts("nutation") if variant.family in families]


def residual_history(scene: Scene, name: str, setting: float) -> xr.Dataset:
    """Energy, momenta and their relative residuals of one integrator over the scene's horizon; dimension ``sample``.

    `setting` is a step size in seconds or a tolerance, whichever the integrator takes.
    """
    control = integrator(name).given(setting)
    run = integrate(scene, name, observe="nutation", samples=SAMPLES, **control)
    columns: dict[str, Any] = {"outcome": run.outcome, "sample_time": ("sample", run.time)}
    for constant, values in residuals(scene, run).items():
        columns[constant] = ("sample", getattr(run, constant))
        columns[f"{constant}_residual"] = ("sample", values)
        columns[f"{constant}_largest"] = float(np.nanmax(np.abs(values)))
    return xr.Dataset(columns)


def notebook_path(scene: Scene) -> xr.Dataset:
    """theta, theta' and phi by the notebook's solver on six variables, and by the closed form; dimension ``path``."""
    times = np.linspace(0.0, scene.horizon, PATH_SAMPLES)
    hard = integrated(hard_way(scene), six_variables(scene), times, "LSODA", SOLVER_TOLERANCE)
    truth = closed_form(scene)(times)
    solver = {"hard_theta": hard[1], "hard_phi": hard[0], "hard_theta_dot": hard[4]}
    true = {"true_theta": truth.theta, "true_phi": truth.phi, "true_theta_dot": truth.theta_dot}
    columns = {"path_time": times, **solver, **true}
    return xr.Dataset({name: ("path", values) for name, values in columns.items()})


def both_derivations(scene: Scene) -> xr.Dataset:
    """The two derivations integrated at 1e-13, their distance, and the two energies; dimension ``both``."""
    times, six = np.linspace(0.0, scene.horizon, SAMPLES), six_variables(scene)
    hard = integrated(hard_way(scene), six, times, "DOP853", 1e-13)
    easy = integrated(easy_way(scene), (*six[:3], six[4]), times, "DOP853", 1e-13)
    truth = closed_form(scene)(times)
    true = np.array([truth.phi, truth.theta, truth.psi])
    E, E1, spin = energies(scene, hard)
    columns = {
        "both_time": times,
        "ways_gap": np.max(np.abs(hard[:3] - easy[:3]), axis=0),
        "hard_gap": np.max(np.abs(hard[:3] - true), axis=0),
        "easy_gap": np.max(np.abs(easy[:3] - true), axis=0),
        "energy_gap": np.abs(E1 + spin - E) / scene.energy_scale,
    }
    return xr.Dataset({name: ("both", values) for name, values in columns.items()})


def alpha_table(scene: Scene, alpha: float) -> xr.Dataset:
    """The alpha of a start at rest, and the rate of theta that belongs to the printed alpha."""
    rate = with_alpha(scene, alpha, 1.0).start.theta_dot
    return xr.Dataset({"alpha_at_rest": nutation_cubic(scene).alpha, "alpha_rate": rate})


def modified_energy_table(scene: Scene, name: str, steps: Sequence[float]) -> xr.Dataset:
    """Largest change of the energy and of the modified energy at several steps, and both over time at the first.

    Dimensions ``shadow_setting`` and ``shadow_sample``; relative to the scale of energies.
    """
    runs = [integrate(scene, name, step_size=h, observe="nutation", samples=SAMPLES) for h in steps]
    used = [run.step_size for run in runs]
    modified = [
        modified_energy(scene, name, "angles", np.stack([run.theta, run.p_theta], axis=1), h)
        for run, h in zip(runs, used, strict=True)
    ]
    energy = [run.energy for run in runs]
    time = ("shadow_sample", runs[0].time)
    data: dict[str, Any] = {"shadow_step_size": ("shadow_setting", used), "shadow_time": time}
    for column, curves in (("energy_swing", energy), ("modified_swing", modified)):
        changes = [(values - values[0]) / scene.energy_scale for values in curves]
        data[column] = ("shadow_setting", [float(np.max(np.abs(change))) for change in changes])
        data[f"{column}_history"] = ("shadow_sample", changes[0])
    return xr.Dataset(data)
