"""Errors of a run against the true motion, in quantities that do not depend on the chart.

    axis       angle between the axes, rad                   attitude   angle of the rotation between, rad
    theta      |theta - theta_ref|, rad                      energy     |E - E_ref| / energy of the nutation
    p_phi      |p_phi - ref| / max(|p_phi|, |p_psi|)         p_psi      likewise

The energy of the nutation, `Scene.energy_scale`, is E0 - p_psi^2 / 2 I3 - min V, the height of the start above the
steady precession with the same momenta. V is `top.potential`, which has no spin in it: on `fast` the energy of the
nutation is 9.2e-5, and the kinetic energy, nearly all spin, 5000. Both momenta share one scale because one of them may
vanish. Radians and momenta never share a norm. Of a body without symmetry the scale of the energy is that of the start,
kinetic and |mgl|, and that of p_phi and of the vector L is |L|.

Explicit methods do not keep |e| or |q| at one. A wrong length does not change the angles, but the energy and momenta.

A trajectory of another program is checked first. A quaternion determines the attitude, the axis and theta; so do theta,
phi and psi; theta and phi determine the axis; an axis determines theta. Vectors are scaled to length one, and the
deviation of their length is an error of its own, ``axis_length`` or ``quaternion_length``. It may become large in a
valid run (SciPy's RK45 at 1e-3 takes |q| to 1.16 on `spheroid`), but is small at first unless a column or unit is
wrong.
"""

import contextlib
import json
import math
import warnings
from collections.abc import Callable, Collection, Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from symtop.core import netcdf
from symtop.core.errors import SymtopError, SymtopWarning, one_of
from symtop.core.numbers import EPSILON
from symtop.measure.conservation import CONSTANTS
from symtop.methods.framework.lanes import members_of
from symtop.model import charts
from symtop.model.body import Attitude, RigidBody
from symtop.model.scenes import Scene, scene as find_scene
from symtop.model.top import Angles, SymmetricTop
from symtop.run.ensemble.inputs import read_members, refuse_others
from symtop.run.reference.truth import PRECISIONS, reference
from symtop.run.trajectory import Trajectory, column, dataset

QUANTITIES: dict[str, str] = {
    "axis": "angle between axes (rad)", "attitude": "angle between attitudes (rad)", "theta": "error of theta (rad)",
    "energy": "energy error / energy of the nutation", "p_phi": "relative error of p_phi",
    "p_psi": "relative error of p_psi",
}  # fmt: skip
# for bodies without symmetry: replaces "energy" and adds "momentum"
OF_BODY = {"energy": "energy error / (T0 + |mgl|)", "momentum": "relative error of the momentum"}

ERRORS = {  # long name, with the reference of the error, and units
    "axis": ("angle between the axis and the true axis", "rad"),
    "attitude": ("angle of the rotation between the attitude and the true attitude", "rad"),
    "theta": ("error of theta against the true motion", "rad"),
    "energy": ("error of the energy against that of the start, relative to the energy of the nutation", "1"),
    "p_phi": ("error of p_phi against that of the start, relative to the larger momentum", "1"),
    "p_psi": ("error of p_psi against that of the start, relative to the larger momentum", "1"),
    "momentum": ("error of the angular momentum in the space frame, relative to that of the start", "1"),
}
SCALES = {  # the scale of a relative error for a top, and for a body without symmetry
    "the energy of the nutation": "the kinetic energy of the start and |mgl|",
    "the larger momentum": "the momentum of the start",
}  # fmt: skip


def against(words: str, of_body: Collection[bool]) -> str:
    """A long name with the scales that apply: of tops (`of_body` has False), of bodies (has True) or of both."""
    for top, body in SCALES.items():
        words = words.replace(top, " or of bodies ".join([top] * (False in of_body) + [body] * (True in of_body)))
    return words


def quantity_words(data: xr.Dataset, quantity: str) -> str:
    """The label of a quantity of a dataset of errors, with the scale that the long name of its variable states."""
    name, body = str(data[quantity].attrs.get("long_name", "")), next(iter(SCALES.values()))
    if body not in name:
        return QUANTITIES[quantity]
    return OF_BODY[quantity] if " or of bodies " not in name else f"{QUANTITIES[quantity]}, of bodies / (T0 + |mgl|)"


def errors(
    run: xr.Dataset | Mapping[str, Any], scene: str | Scene | xr.Dataset | Iterable[str | Scene] | None = None, *,
    precision: str = "closed-form",
) -> xr.Dataset:  # fmt: skip
    """The errors of a run, or of another program's trajectory of a scene, at every sample, and their uncertainty.

    `run` is a dataset of `simulate` (or one read back from its file), which holds its top and start; a `scene` (a Scene
    or a name) must then be the same. A member of an `ensemble` needs its scene; samples without a time are left out.
    For a whole ensemble `scene` are its members, a dataset or scenes, and the result is over ``member`` and ``time``.
    With a `scene`, `run` may be any Dataset or mapping with increasing ``time`` (n,) since the start, and one of

        axis         (n, 3)  unit vectors along the top's axis in the space frame, z up
        quaternion   (n, 4)  w, x, y, z from body to space, either sign; the body's third axis is the top's
        theta        (n,)    inclination in [0, pi], rad; with phi, and psi, the other two Euler angles (z-x-z)

    and optionally ``energy``, ``p_phi``, ``p_psi`` (n,) in the units of the scene's top, and for a body without
    symmetry also ``momentum`` (n, 3) in space.

    Returns a Dataset over ``time`` with those of ``axis``, ``attitude``, ``theta`` (rad), ``energy``, ``p_phi``,
    ``p_psi`` or ``momentum`` (relative, scaled as in `symtop.measure.errors`) that follow from the data. For a foreign
    trajectory with axis or quaternion, ``axis_length`` or ``quaternion_length`` is the deviation of its length from
    one, which angles do not show; a first sample off by more than 0.5 is refused. ``NAME_bound`` (n,) is the least
    error that can be distinguished from zero: the bound of the reference and the rounding of the compared doubles.
    Samples that are NaN, as after a failure, stay NaN. ``max("time", skipna=False)`` is therefore NaN for a run that
    ended early (or a member with fewer steps than samples); with ``skipna`` it is the largest error before the end.
    `precision` is that of `reference`; the closed form costs 1 us a sample, and its rounding does not grow with time.

    Warns (`SymtopWarning`) if a foreign trajectory starts elsewhere than the scene, extends beyond a hundred of its
    horizons, or holds NaN. Raises SymtopError for data that are no such trajectory, for an unknown scene or one with
    another top or start than the data have, and if there is neither a `scene` nor one in the data.
    """
    one_of("precision", precision, PRECISIONS)
    if isinstance(run, xr.Dataset) and "member" in run.dims and not isinstance(scene, (str, Scene, type(None))):
        return _of_members(run, scene, precision)
    return _of_run(run, scene, precision, partial(warnings.warn, category=SymtopWarning, stacklevel=3))


def _of_run(run: Any, scene: Any, precision: str, warn: Callable[[str], object]) -> xr.Dataset:
    """The errors of one run or trajectory; calls `warn` with each warning."""
    foreign = scene is not None and "integrator" not in getattr(run, "attrs", {})
    run = unpadded(run) if isinstance(run, xr.Dataset) else run
    problem = scene_of(run) if scene is None else find_scene(scene, bodies=True)
    refuse_other_scene(run, problem)
    data = checked(run) if foreign or "time" not in run else Trajectory.of_data(run)
    truth = reference(problem, data.time, precision)
    check_shapes({name: values for name in SHAPES if (values := getattr(data, name)) is not None}, data.time.size)
    if foreign and data.quaternion is not None:
        refuse_other_order(data.quaternion, truth)
    data = completed(data) if foreign or data.theta is None else data
    if data.theta is None or data.phi is None:  # psi alone shows no attitude
        data = data._replace(psi=None)
    columns = errors_against(problem, data, truth)
    certain = scene is None or _stored(run, "start") is not None
    doubts = [] if certain else start_warnings(data.time, columns)
    if doubts and data.axis is not None:
        x, up, z = data.axis[0]
        if np.min(charts.axis_distance(np.array([[x, -z, up], [x, z, up]]), truth["axis"].values[0])) < RIGHT_WITHIN:
            doubts[0] += " It is the true one if y is read as up, where here z is up."
    for sentence in [*doubts, *(trajectory_warnings(data.time, columns, problem.horizon) if foreign else ())]:
        warn(f"on {problem.name}: {sentence}")
    bounds = {f"{name}_bound": error_bound(problem, data, truth, name) for name in columns}
    for name in UNIT_VECTORS if foreign else ():
        if name in run:
            columns[f"{name}_length"] = np.abs(np.linalg.norm(doubles(name, column(run, name)), axis=1) - 1.0)
            bounds[f"{name}_length_bound"] = np.full(data.time.size, 4.0 * EPSILON)
    table = dataset(data.time, columns | bounds, problem.units)
    for name in columns:
        vector = name.removesuffix("_length")
        words, units = (f"distance of the length of the {vector} from one", "1") if vector != name else ERRORS[name]
        words = against(words, [problem.of_body])
        table.variables[name].attrs.update(long_name=words, units=units)
        table.variables[f"{name}_bound"].attrs.update(long_name=f"least {words} to be told from none", units=units)
    attributes = {"scene": problem.name, "precision": truth.attrs["precision"]}
    if isinstance(run, xr.Dataset) and not foreign:
        table.variables["time"].attrs.update(run["time"].attrs)
        attributes |= {name: run.attrs[name] for name in ("integrator", "chart") if name in run.attrs}
    table.attrs.update(netcdf.CONVENTIONS, title=f"errors on {problem.name}", **attributes)
    return table


def _of_members(runs: xr.Dataset, members: Any, precision: str) -> xr.Dataset:
    """The errors of every member, computed singly; all their warnings are given as one, with their number."""
    record, n = read_members(members), runs.sizes["member"]
    refuse_others(record, runs)
    tables, doubts = [], list[str]()  # `warnings.catch_warnings` would also record warnings of other threads
    for i, (top, start) in enumerate(members_of(record.numbers)):
        run = runs.isel(member=i)
        end = float(run["horizon"]) if "horizon" in run else float(np.nanmax(run["time"].values))
        tables.append(_of_run(run, Scene(f"member-{i}", top, start, end), precision, doubts.append))
    if doubts:
        words = f"{len(doubts)} warnings on members, the first: {doubts[0]}"
        warnings.warn(words, SymtopWarning, stacklevel=3)
    columns = {}
    for name in ("time", *tables[0].data_vars):
        rows = np.full((n, runs.sizes["time"]), np.nan)  # a member that ended early has fewer samples
        for row, table in zip(rows, tables, strict=True):
            row[: table.sizes["time"]] = table.variables[name].values
        columns[name] = ("member", "time"), rows, tables[0].variables[name].attrs
    clock = {"time": columns.pop("time"), **runs["member"].coords}
    return xr.Dataset(columns, clock, {**tables[0].attrs, "title": f"errors of {n} members", "scene": ""})


def error_bound(scene: Scene, run: Trajectory, truth: xr.Dataset, quantity: str) -> charts.Array:
    """The reference's bound on a quantity and the rounding of the compared doubles, at every sample (n,).

    A heavy body may gather far more momentum than it has at the start: rounding is that of the present |L|, and an
    error of the attitude turns |L| and, by the weight, makes up to sqrt(|mgl| I) of it a radian, I the largest moment.
    """
    true = truth.variables  # ``truth[name]`` would make a DataArray
    if scene.of_body and quantity in ("momentum", "p_phi"):
        size, angle_bound = np.linalg.norm(true["momentum"].values, axis=1), np.zeros(truth.sizes["time"])
        if quantity == "momentum":
            swing = math.sqrt(abs(scene.top.mgl) * max(scene.top.moments))
            size, angle_bound = np.maximum(size, swing), true["attitude_error_bound"].values
        return np.asarray((angle_bound + 4.0 * EPSILON) * np.maximum(size / scene.momentum_scale, 1.0))
    if quantity in CONSTANTS:
        grain = scene.energy_grain if quantity == "energy" else 1.0
        return np.full(truth.sizes["time"], 4.0 * EPSILON * grain)
    bound: charts.Array = true[f"{quantity}_error_bound"].values + EPSILON
    if quantity == "attitude" and run.quaternion is None:  # phi and psi are doubles: add their rounding error
        bound = bound + 0.5 * EPSILON * (np.abs(true["phi"].values) + np.abs(true["psi"].values))
    return bound


def errors_against(scene: Scene, run: Trajectory, truth: xr.Dataset) -> dict[str, charts.Array]:
    """Error of every quantity that a run determines, at every sample (n,); NaN where the run had failed.

    `truth` is `reference` at the same times. Where it has a value as a pair of doubles, both are subtracted, so that a
    correctly rounded value has its rounding error and not zero.
    """
    true = {name: variable.values for name, variable in truth.variables.items()}
    units = {"theta": 1.0, "energy": scene.energy_scale, "p_phi": scene.momentum_scale, "p_psi": scene.momentum_scale}
    columns = {}
    with np.errstate(over="ignore", invalid="ignore"):  # a run may have blown up
        if run.axis is not None:
            columns["axis"] = charts.axis_distance(run.axis, true["axis"], true.get("axis_lo", 0.0))
        for name, unit in units.items():
            if (values := getattr(run, name)) is not None and name in true:  # a body has no p_psi
                columns[name] = np.abs((values - true[name]) - true.get(f"{name}_lo", 0.0)) / unit
        if (attitude := completed(run).quaternion) is not None:
            low = true.get("quaternion_lo", 0.0)
            columns["attitude"] = charts.attitude_distance(attitude, true["quaternion"], low)
        if run.momentum is not None and "momentum" in true:
            columns["momentum"] = np.linalg.norm(run.momentum - true["momentum"], axis=1) / scene.momentum_scale
    return columns


LENGTH_OFF = 0.5  # largest deviation from one of the length of the first axis or quaternion; else it is no unit vector
UNIT_VECTORS = ("axis", "quaternion")
WRONG_BEYOND, RIGHT_WITHIN = 0.1, 0.01  # rad from the true attitude: convention of a quaternion
MOST_HORIZONS = 100.0  # a longer run probably has another unit of time (milliseconds for seconds: a factor 1000)
SHAPES = {"axis": (3,), "quaternion": (4,), "momentum": (3,), **dict.fromkeys(("theta", "phi", "psi", *CONSTANTS), ())}


def scene_of(run: xr.Dataset | Mapping[str, Any]) -> Scene:
    """The scene in the attributes of a dataset of `simulate`; SymtopError for any other data."""
    attributes = getattr(run, "attrs", {})
    try:
        end = attributes["horizon"] or 1.0  # the horizon is 0 for a run sampled only at its start
        return Scene(str(attributes["scene"]), _stored(run, "top"), _stored(run, "start"), end)
    except (KeyError, TypeError, ValueError) as error:
        if not isinstance(run, Mapping):
            checked(run)  # says what data may be
        argument = "members" if "member" in getattr(run, "sizes", ()) else "scene"
        words = f"these data do not say of which top and start they are, so give errors(data, {argument})"
        raise SymtopError(f"scene is missing: {words}") from error


def refuse_other_scene(run: xr.Dataset | Mapping[str, Any], scene: Scene) -> None:
    """SymtopError for data with a top or start in their attributes that is not the scene's."""
    attributes = getattr(run, "attrs", {})
    for name, value in (("top", scene.top), ("start", scene.start)):
        if _stored(run, name) not in (None, value):
            rule = f"that of the data, {attributes.get('scene', 'of another name')}, whose {name} is {attributes[name]}"
            remedy = "drop_attrs() makes them a trajectory that is compared with any"
            raise SymtopError(f"scene must be {rule}, not {scene.name}; {remedy}")


def _stored(run: xr.Dataset | Mapping[str, Any], name: str) -> Any:
    """The ``top`` or the ``start`` in the attributes of data; None without one."""
    for kind in (SymmetricTop, RigidBody) if name == "top" else (Angles, Attitude):
        with contextlib.suppress(KeyError, TypeError, ValueError):
            return kind(**json.loads(getattr(run, "attrs", {})[name]))
    return None


def unpadded(run: xr.Dataset) -> xr.Dataset:
    """A run without samples whose time is NaN, which pad the shorter members of an ensemble."""
    # in other data a time of NaN is an error, raised in `checked`
    if "integrator" not in run.attrs or "time" not in run or run["time"].dims != ("time",):
        return run
    valid = np.isfinite(doubles("time", run["time"]))
    return run if valid.all() else run.isel(time=valid)


def checked(data: xr.Dataset | Mapping[str, Any]) -> Trajectory:
    """A foreign trajectory with axis and quaternion scaled to length one; SymtopError for any other data."""
    if not isinstance(data, Mapping):  # a Dataset is one
        rule = "a Dataset or a mapping with time and axis, quaternion or theta"
        raise SymtopError(f"data must be {rule}, not {type(data).__name__}")
    if "time" not in data:
        raise SymtopError("data must hold time, elapsed since the start of the scene; there is none")
    time = doubles("time", data["time"])
    if time.ndim != 1 or time.size == 0:
        raise SymtopError(f"time must be a row of numbers, not of shape {time.shape}")
    invalid = ~np.isfinite(time) | (np.diff(time, prepend=-1.0 if time[0] == 0.0 else 0.0) <= 0.0)
    if invalid.any():
        k = int(np.argmax(invalid))
        after = f" after {time[k - 1]:g}" if k else ""
        raise SymtopError(f"time must be finite, at least 0 and increase, but sample {k} is at {time[k]:g}{after}")
    columns: dict[str, Any] = {name: doubles(name, column(data, name)) for name in SHAPES if name in data}
    check_shapes(columns, time.size)
    positions = [columns[name].reshape(time.size, -1) for name in (*UNIT_VECTORS, "theta") if name in columns]
    if all(np.isnan(position).any(axis=1).all() for position in positions):
        words = "numbers, but every sample of where the top is has a NaN" if positions else (
            "one of axis, quaternion, theta beside time, to show where the top is")  # fmt: skip
        raise SymtopError(f"data must hold {words}")
    for name in UNIT_VECTORS:
        if name in columns:
            largest = np.abs(columns[name]).max(axis=1)  # divide by it, so that squares neither overflow nor underflow
            length = largest * np.linalg.norm(columns[name] / np.where(largest > 0.0, largest, 1.0)[:, None], axis=1)
            invalid = (length == 0.0) | np.isinf(length)  # such a vector has no direction
            first = int(np.argmax(~np.isnan(length)))
            invalid[first] |= np.abs(length[first] - 1.0) > LENGTH_OFF
            if invalid.any():
                rule = f"of length 1, at first within {LENGTH_OFF:g}, and later of any above 0"
                sample_words = f"{length[np.argmax(invalid)]:.6g} at t = {time[np.argmax(invalid)]:.6g}"
                raise SymtopError(f"{name} must be {rule}, but its length is {sample_words}")
            columns[name] = columns[name] / length[:, None]
    theta = columns.get("theta", np.zeros(1))
    if (outside := (theta < 0.0) | (theta > float(np.float32(np.pi)))).any():  # float32(pi) > pi
        sample_words = f"{theta[np.argmax(outside)]:.6g} at t = {time[np.argmax(outside)]:.6g}"
        raise SymtopError(f"theta must be radians from the vertical in [0, pi], but it is {sample_words}")
    return Trajectory(time, **columns)


def check_shapes(columns: Mapping[str, charts.Array], count: int) -> None:
    """SymtopError for columns that do not have the shape (count, ...) of `SHAPES`."""
    for name, values in columns.items():
        if values.shape != (shape := (count, *SHAPES[name])):
            raise SymtopError(f"{name} must have the shape {shape}, one row for each time, not {values.shape}")


def completed(data: Trajectory) -> Trajectory:
    """The trajectory with axis, attitude and theta added where its other variables determine them."""
    angles, axis, attitude, theta = [data.theta, data.phi, data.psi], data.axis, data.quaternion, data.theta
    present = [angle is not None for angle in angles]
    with np.errstate(all="ignore"):  # samples may be NaN
        if attitude is None and all(present):
            attitude = charts.quaternion_from_angles(*angles)
        if axis is None and attitude is not None:
            axis = charts.axis_from_quaternion(attitude)
        elif axis is None and all(present[:2]):
            axis = charts.axis_from_angles(*angles[:2])
        if theta is None and axis is not None:
            theta = charts.theta_from_axis(axis)
    return data._replace(axis=axis, quaternion=attitude, theta=theta)


def doubles(name: str, values: Any) -> charts.Array:
    """Any array of real numbers, or of their text, as doubles; NaN where a sample is missing (None, masked)."""
    try:
        array = np.ma.filled(values.astype(float), np.nan) if np.ma.isMaskedArray(values) else np.asarray(values)
        # complex numbers and dates are refused
        return array.astype(np.float64, casting="same_kind" if array.dtype.kind in "cmM" else "unsafe")
    except (TypeError, ValueError, OverflowError) as error:
        kind = getattr(values, "dtype", type(values).__name__)
        raise SymtopError(f"{name} must be an array of real numbers, not {kind}") from error


def refuse_other_order(quaternion: charts.Array, truth: xr.Dataset) -> None:
    """SymtopError for quaternions that match the true attitude only if read in another convention."""
    true = truth["quaternion"].values  # near some attitudes two conventions agree: the first sample far off decides
    far = np.flatnonzero(charts.attitude_distance(quaternion, true) > WRONG_BEYOND)
    if not far.size:
        return
    sample, k = quaternion[far[0]], far[0]
    for form, q in (("x, y, z, w", np.roll(sample, 1)), ("from space to body", sample * [1.0, -1.0, -1.0, -1.0])):
        if float(charts.attitude_distance(q, true[k])) < RIGHT_WITHIN:
            sample_words = "first sample" if k == 0 else f"sample at t = {truth.time.values[k]:.6g}"
            rule = "quaternion must be in the order w, x, y, z and from body to space"
            raise SymtopError(f"{rule}, but its {sample_words} is the true one if it is read as {form}")


def start_warnings(time: charts.Array, errors: Mapping[str, charts.Array]) -> list[str]:
    """A warning if the first sample of a trajectory is far from the true motion, as a list of at most one sentence."""
    for name in ("attitude", "axis", "theta"):
        if name in errors and errors[name][0] > WRONG_BEYOND:
            offset = f"at t = {time[0]:.6g}, is {errors[name][0]:.2g} rad from the true {name}"
            return [f"the first sample, {offset}: is this the start of the scene, and is its time counted from there?"]
    return []


def trajectory_warnings(time: charts.Array, errors: Mapping[str, charts.Array], horizon: float) -> list[str]:
    """Warnings about a foreign trajectory: times far beyond the scene's horizon, samples that are NaN."""
    sentences = []
    if time[-1] > MOST_HORIZONS * horizon:
        words = f"{time[-1]:.6g}, {time[-1] / horizon:.3g} times the horizon {horizon:.6g}"
        sentences.append(f"times reach to {words}: are they in the scene's unit of time?")
    for name, values in errors.items():
        if np.isnan(values).any():
            start = time[int(np.argmax(np.isnan(values)))]
            sentences.append(f"{name} is not a number from t = {start:.6g}; a largest error leaves these samples out")
            break
    return sentences
