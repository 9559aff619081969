"""Errors of a run against the truth, in quantities that no chart can distort.

    axis       angle between the axes, rad                   attitude   angle of the rotation between, rad
    theta      |theta - theta_ref|, rad                      energy     |E - E_ref| / (E0 - min V)
    p_phi      |p_phi - ref| / max(|p_phi|, |p_psi|)         p_psi      likewise

The energy's scale is `Scene.energy_scale`, the energy of the nutation above the steady precession with the same
momenta, without the energy of the spin: on `fast` it is 9.2e-5, and the kinetic energy, nearly all spin, 5000. Both
momenta share one scale because one of them may vanish. Radians and momenta never share a norm.
"""

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from symtop.core import netcdf
from symtop.core.errors import SymtopWarning, one_of
from symtop.core.numbers import EPSILON
from symtop.measure.trajectory import (
    CONSTANTS,
    checked,
    completed,
    doubts,
    refuse_other_order,
    refuse_other_scene,
    sampled,
    scene_of,
)
from symtop.model import charts
from symtop.model.scenes import Scene, scene as find_scene
from symtop.run.reference.truth import PRECISIONS, reference
from symtop.run.trajectory import dataset

QUANTITIES: dict[str, str] = {
    "axis": "angle between axes (rad)",
    "attitude": "angle between attitudes (rad)",
    "theta": "error of theta (rad)",
    "energy": "energy error / (E0 - min V)",
    "p_phi": "relative error of p_phi",
    "p_psi": "relative error of p_psi",
}


def errors(
    run: xr.Dataset | Mapping[str, Any], scene: "str | Scene | None" = None, *, precision: str = "closed-form"
) -> xr.Dataset:
    """The errors of a run, or of anybody's trajectory of a scene, at every sample, and how far they can be trusted.

    `run` is a dataset of `simulate` (or one read back from its file), which holds its top and start; a `scene` (a Scene
    or a name) must then be the same. A member of an `ensemble` needs its scene; samples without a time are left out.
    With a `scene` it is also any Dataset or mapping with ``time`` (n,), elapsed since the start, increasing, and one of

        axis         (n, 3)  unit vectors along the top's axis in the space frame, z up
        quaternion   (n, 4)  w, x, y, z from body to space, either sign; the body's third axis is the top's
        theta        (n,)    inclination in [0, pi], rad; with phi, and psi, the other two Euler angles (z-x-z)

    and, where there are any, ``energy``, ``p_phi``, ``p_psi`` (n,), in the units of the scene's top.

    Returns a Dataset over ``time`` with those of ``axis``, ``attitude``, ``theta`` (rad), ``energy``, ``p_phi``,
    ``p_psi`` (relative, see above) that the data show. ``NAME_bound`` (n,) is the least error that can be told from
    none: the bound of the reference and the rounding of the compared doubles. Samples that are NaN, as after a failure,
    stay NaN. `precision` is that of `reference`; the closed form costs a microsecond a sample, and its rounding does
    not grow with time.

    Warns (`SymtopWarning`) where a foreign trajectory starts elsewhere than the scene, goes on for a hundred of its
    horizons, or holds NaN.
    Raises SymtopError for data that are no such trajectory, an unknown scene, one of another top or start than the data
    name, and no scene where they name none.
    """
    one_of("precision", precision, PRECISIONS)
    foreign = scene is not None and "integrator" not in getattr(run, "attrs", {})
    run = sampled(run) if isinstance(run, xr.Dataset) else run
    chosen = scene_of(run) if scene is None else find_scene(scene)
    refuse_other_scene(run, chosen)
    data = checked(run) if foreign or not isinstance(run, xr.Dataset) else run
    truth = reference(chosen, data["time"].values, precision)
    if foreign and "quaternion" in data:
        refuse_other_order(data, truth)
    data = completed(data) if foreign else data
    columns = _columns(chosen, data, truth)
    for sentence in doubts(data, columns, chosen.horizon) if foreign else ():
        warnings.warn(f"on {chosen.name}: {sentence}", SymtopWarning, stacklevel=2)
    bounds = {f"{name}_bound": error_bound(chosen, data, truth, name) for name in columns}
    shown = _beside(data, columns | bounds)
    for name in columns:
        units = "1" if name in CONSTANTS else "rad"
        shown.variables[name].attrs.update(long_name=QUANTITIES[name], units=units)
        shown.variables[f"{name}_bound"].attrs.update(long_name=f"the least {QUANTITIES[name]} to be seen", units=units)
    told = {"scene": chosen.name, "precision": truth.attrs["precision"]}
    if isinstance(run, xr.Dataset) and "integrator" in run.attrs:
        told["integrator"] = run.attrs["integrator"]
    shown.attrs.update(netcdf.CONVENTIONS, title=f"errors on {chosen.name}", **told)
    return shown


def error_bound(scene: Scene, run: xr.Dataset, truth: xr.Dataset, quantity: str) -> charts.Array:
    """The reference's bound on a quantity and the rounding of the compared doubles, at every sample (n,)."""
    if quantity in CONSTANTS:
        grain = scene.energy_grain if quantity == "energy" else 1.0
        return np.full(truth.sizes["time"], 4.0 * EPSILON * grain)
    true = truth.variables
    bound: charts.Array = true[f"{quantity}_error_bound"].values + EPSILON
    if quantity == "attitude" and "quaternion" not in run:  # phi and psi come as doubles; their rounding is an angle
        bound = bound + 0.5 * EPSILON * (np.abs(true["phi"].values) + np.abs(true["psi"].values))
    return bound


def errors_against(scene: Scene, run: xr.Dataset, truth: xr.Dataset) -> xr.Dataset:
    """Error of every quantity that a run shows at every sample; NaN where the run had failed.

    Where the reference knows a value beyond double, the difference is taken from both of its halves: a run that is
    right to its last digit has the error of that digit and not zero. `truth` holds `axis`, `theta`,
    `quaternion`, `energy`, `p_phi`, `p_psi` at the same times (see `reference`).
    """
    return _beside(run, _columns(scene, run, truth))


def _beside(run: xr.Dataset, columns: dict[str, charts.Array]) -> xr.Dataset:
    """Columns over the times of a run."""
    time = run.variables["time"]
    shown = dataset(time.values, columns)
    shown.variables["time"].attrs.update(time.attrs)
    return shown


def _columns(scene: Scene, run: xr.Dataset, truth: xr.Dataset) -> dict[str, charts.Array]:
    mine, true = run.variables, truth.variables  # ``run[name]`` would make a DataArray, 6 us for each
    columns = {}
    units = {"theta": 1.0, "energy": scene.energy_scale, "p_phi": scene.momentum_scale, "p_psi": scene.momentum_scale}
    with np.errstate(over="ignore", invalid="ignore"):  # a run may have blown up
        if "axis" in mine:
            columns["axis"] = charts.axis_distance(mine["axis"].values, true["axis"].values, _low(truth, "axis"))
        for name, unit in units.items():
            if name in mine:
                columns[name] = np.abs((mine[name].values - true[name].values) - _low(truth, name)) / unit
        if "quaternion" in mine or "psi" in mine:
            columns["attitude"] = attitude_error(run, truth)
    return columns


def attitude_error(run: xr.Dataset, truth: xr.Dataset) -> charts.Array:
    """Angle between the attitudes of a run that shows them and of the truth, at every sample."""
    if "quaternion" in run:
        attitude = run["quaternion"].values
    else:
        attitude = charts.quaternion_from_angles(run["theta"].values, run["phi"].values, run["psi"].values)
    return charts.attitude_distance(attitude, truth["quaternion"].values, _low(truth, "quaternion"))


def _low(truth: xr.Dataset, name: str) -> charts.Array | float:
    """What the reference knows of a value beyond its double."""
    low: charts.Array | float = truth.variables[f"{name}_lo"].values if f"{name}_lo" in truth.variables else 0.0
    return low
