"""Errors of a run against the truth, in quantities that no chart can distort.

    axis       angle between the axes, rad                   attitude   angle of the rotation between, rad
    theta      |theta - theta_ref|, rad                      energy     |E - E_ref| / (E_ref + |mgl|)
    p_phi      |p_phi - ref| / max(|p_phi|, |p_psi|)         p_psi      likewise

The energy is measured from the lowest potential energy there is, so that the scale is a kinetic energy and
never zero by accident; both momenta share one scale because one of them may vanish. Radians and momenta
never share a norm.
"""

import numpy as np
import xarray as xr

from symtop.model import charts
from symtop.model.scenes import Scene

QUANTITIES: dict[str, str] = {
    "axis": "angle between axes (rad)",
    "attitude": "angle between attitudes (rad)",
    "theta": "error of theta (rad)",
    "energy": "relative error of energy",
    "p_phi": "relative error of p_phi",
    "p_psi": "relative error of p_psi",
}


def energy_scale(scene: Scene) -> float:
    """Alias for studies: `Scene.energy_scale` says it."""
    return scene.energy_scale


def momentum_scale(scene: Scene) -> float:
    """Alias for studies: `Scene.momentum_scale` says it."""
    return scene.momentum_scale


def errors(scene: Scene, run: xr.Dataset, truth: xr.Dataset) -> xr.Dataset:
    """Error of every quantity the run shows at every sample; NaN where the run had failed.

    `truth` holds `axis`, `theta`, `quaternion`, `energy`, `p_phi`, `p_psi` at the same times (see `reference`).
    """
    with np.errstate(over="ignore", invalid="ignore"):  # a run may have blown up
        found = _found(scene, run, truth)
    return xr.Dataset({name: ("time", values) for name, values in found.items()}, coords={"time": run["time"]})


def _found(scene: Scene, run: xr.Dataset, truth: xr.Dataset) -> dict[str, charts.Array]:
    found = {
        "axis": charts.axis_distance(run["axis"].values, truth["axis"].values),
        "theta": np.abs(run["theta"].values - truth["theta"].values),
        "energy": np.abs(run["energy"].values - truth["energy"].values) / scene.energy_scale,
        "p_phi": np.abs(run["p_phi"].values - truth["p_phi"].values) / scene.momentum_scale,
        "p_psi": np.abs(run["p_psi"].values - truth["p_psi"].values) / scene.momentum_scale,
    }
    if "quaternion" in run or "psi" in run:
        found["attitude"] = attitude_error(run, truth)
    return found


def attitude_error(run: xr.Dataset, truth: xr.Dataset) -> charts.Array:
    """Angle between the attitudes of a run that shows them and of the truth, at every sample."""
    if "quaternion" in run:
        attitude = run["quaternion"].values
    else:
        attitude = charts.quaternion_from_angles(run["theta"].values, run["phi"].values, run["psi"].values)
    return charts.attitude_distance(attitude, truth["quaternion"].values)
