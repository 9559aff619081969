"""Anybody's trajectory as symtop names it: time, axis, attitude, theta, energy and momenta, checked.

What is given decides what is shown: a quaternion shows the attitude, the axis and theta; theta, phi and psi the same;
theta and phi the axis; an axis shows theta. Vectors that are not quite of length one are scaled to it. Samples that
hold a NaN stay NaN.
"""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from symtop.core.errors import SymtopError, positive
from symtop.model import charts
from symtop.model.scenes import Scene
from symtop.model.top import Angles, SymmetricTop

LENGTH = 1e-3  # how far from one the length of an axis or a quaternion may be: more than single precision leaves
FAR, NEAR = 0.1, 0.01  # rad from the true attitude: another order of a quaternion, and the right one
BEYOND = 100.0  # horizons: milliseconds for seconds are a thousand
CONSTANTS = ("energy", "p_phi", "p_psi")
SHAPES: dict[str, tuple[tuple[str, ...], tuple[int, ...]]] = {
    "axis": (("time", "component"), (3,)),
    "quaternion": (("time", "part"), (4,)),
    **dict.fromkeys(("theta", "phi", "psi", *CONSTANTS), (("time",), ())),
}
ENOUGH = ("axis", "quaternion", "theta")  # one of them there must be


def scene_of(run: xr.Dataset | Mapping[str, Any]) -> Scene:
    """The scene that a dataset of `simulate` says that it was made of.

    Raises SymtopError for any other data.
    """
    attributes = getattr(run, "attrs", {})
    try:
        top, start = (json.loads(attributes[name]) for name in ("top", "start"))
        name, horizon = str(attributes["scene"]), positive("horizon", attributes["horizon"])
        return Scene(name, SymmetricTop(**top), Angles(**start), horizon)
    except (KeyError, TypeError, ValueError) as error:
        raise SymtopError(
            "scene is missing: these data do not say of which top and start they are, so give errors(data, scene)"
        ) from error


def refuse_other_scene(run: xr.Dataset | Mapping[str, Any], scene: Scene) -> None:
    """Refuse data that say of which top and start they are, if those are not the scene's."""
    attributes = getattr(run, "attrs", {})
    for name, own in (("top", scene.top), ("start", scene.start)):
        try:
            told = type(own)(**json.loads(attributes[name]))
        except (KeyError, TypeError, ValueError):  # they do not say
            continue
        if told != own:
            raise SymtopError(
                f"scene must be that of the data, {attributes.get('scene', 'of another name')}, whose {name} is "
                f"{attributes[name]}, not {scene.name}; drop_attrs() makes them a trajectory that is compared with any"
            )


def sampled(run: xr.Dataset) -> xr.Dataset:
    """A run without the samples that it does not have: a member of an ensemble fills its row with times that are NaN.

    Of other data times are left as they are, so that one that is no number is refused.
    """
    if "integrator" not in run.attrs or "time" not in run or run["time"].dims != ("time",):
        return run
    there = np.isfinite(_numbers("time", run["time"]))
    return run if there.all() else run.isel(time=there)


def checked(data: xr.Dataset | Mapping[str, Any]) -> xr.Dataset:
    """The known variables of a foreign trajectory over ``time``; an axis and a quaternion are scaled to length one.

    Raises SymtopError for anything that is not such a trajectory.
    """
    if not isinstance(data, Mapping):  # a Dataset is one
        raise SymtopError(
            f"data must be a Dataset or a mapping with time and axis, quaternion or theta, not {type(data).__name__}"
        )
    time = _times(data)
    variables = {name: _values(data, name, time.size) for name in SHAPES if name in data}
    if not set(ENOUGH) & set(variables):
        raise SymtopError("data must hold one of axis, quaternion, theta beside time, to show where the top is")
    for name in ("axis", "quaternion"):
        if name in variables:
            variables[name] = _unit(name, variables[name], time)
    if "theta" in variables:
        _inclined(variables["theta"], time)
    return xr.Dataset({name: (SHAPES[name][0], values) for name, values in variables.items()}, {"time": time})


def completed(data: xr.Dataset) -> xr.Dataset:
    """The same with the axis, the attitude and theta that follow from what is there."""
    with np.errstate(all="ignore"):  # of samples that are NaN
        if "quaternion" not in data and all(name in data for name in ("theta", "phi", "psi")):
            attitude = charts.quaternion_from_angles(*(data[name].values for name in ("theta", "phi", "psi")))
            data = data.assign(quaternion=(("time", "part"), attitude))
        if "axis" not in data and "quaternion" in data:
            data = data.assign(axis=(("time", "component"), charts.axis_from_quaternion(data["quaternion"].values)))
        if "axis" not in data and all(name in data for name in ("theta", "phi")):
            axis = charts.axis_from_angles(data["theta"].values, data["phi"].values)
            data = data.assign(axis=(("time", "component"), axis))
        if "theta" not in data:
            data = data.assign(theta=("time", charts.theta_from_axis(data["axis"].values)))
    return data


def _times(data: xr.Dataset | Mapping[str, Any]) -> charts.Array:
    if "time" not in data:
        raise SymtopError("data must hold time, elapsed since the start of the scene; there is none")
    time = _numbers("time", data["time"])
    if time.ndim != 1 or time.size == 0:
        raise SymtopError(f"time must be a row of numbers, not of shape {time.shape}")
    if not np.isfinite(time).all() or time[0] < 0.0 or (np.diff(time) <= 0.0).any():
        raise SymtopError("time must be finite, at least 0 and increase from sample to sample")
    return time


def _numbers(name: str, values: Any) -> charts.Array:
    try:
        given = np.asarray(values)
        return given.astype(np.float64, casting="same_kind" if given.dtype.kind == "c" else "unsafe")
    except (TypeError, ValueError) as error:
        raise SymtopError(f"{name} must be an array of real numbers, not {type(values).__name__}") from error


def _values(data: xr.Dataset | Mapping[str, Any], name: str, count: int) -> charts.Array:
    values, wanted = _numbers(name, data[name]), (count, *SHAPES[name][1])
    if values.shape != wanted:
        raise SymtopError(f"{name} must have the shape {wanted}, one row for each time, not {values.shape}")
    return values


def _unit(name: str, values: charts.Array, time: charts.Array) -> charts.Array:
    length = np.sqrt(np.sum(values * values, axis=-1))
    off = np.abs(length - 1.0) > LENGTH  # false where it is NaN
    if off.any():
        k = int(np.argmax(off))
        raise SymtopError(
            f"{name} must be of length 1 within {LENGTH:g}, but its length is {length[k]:.6g} at t = {time[k]:.6g}"
        )
    unit: charts.Array = values / length[:, None]
    return unit


def _inclined(theta: charts.Array, time: charts.Array) -> None:
    off = (theta < 0.0) | (theta > np.pi)
    if off.any():
        k = int(np.argmax(off))
        raise SymtopError(
            f"theta must be radians from the vertical in [0, pi], but it is {theta[k]:.6g} at t = {time[k]:.6g}"
        )


def refuse_other_order(data: xr.Dataset, truth: xr.Dataset) -> None:
    """Refuse quaternions whose first sample is the true attitude only when it is read in another convention."""
    finite = np.flatnonzero(np.isfinite(data["quaternion"].values).all(axis=1))
    if not finite.size:
        return
    first, true = data["quaternion"].values[finite[0]], truth["quaternion"].values[finite[0]]
    as_given = float(charts.attitude_distance(first, true))
    for other, moved in (("x, y, z, w", np.roll(first, 1)), ("from space to body", first * [1.0, -1.0, -1.0, -1.0])):
        if as_given > FAR and float(charts.attitude_distance(moved, true)) < NEAR:
            raise SymtopError(
                "quaternion must be in the order w, x, y, z and from body to space, but its first sample is the true "
                f"one if it is read as {other}"
            )


def doubts(data: xr.Dataset, errors: Mapping[str, charts.Array], horizon: float) -> list[str]:
    """What is wrong with a foreign trajectory as a whole: another start, another clock, samples that are not numbers.

    `horizon` is that of the scene: times far beyond it may be in another unit.
    """
    said, time = [], data["time"].values
    name = "attitude" if "attitude" in errors else "axis" if "axis" in errors else "theta"
    if errors[name][0] > FAR:
        said.append(
            f"the first sample, at t = {time[0]:.6g}, is {errors[name][0]:.2g} rad from the true {name}: is this the "
            "start of the scene, and is its time counted from there?"
        )
    if time[-1] > BEYOND * horizon:
        said.append(
            f"times reach to {time[-1]:.6g}, {time[-1] / horizon:.3g} times the horizon {horizon:.6g}: are they in the "
            "scene's unit of time?"
        )
    for name, values in errors.items():
        if np.isnan(values).any():
            since = time[int(np.argmax(np.isnan(values)))]
            said.append(f"{name} is not a number from t = {since:.6g}; a largest error leaves these samples out")
            break
    return said
