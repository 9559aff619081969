"""A run as plain arrays, a `Trajectory`, and columns over time as a labelled dataset.

Functions inside symtop pass trajectories; functions for users return datasets.
"""

import functools
from collections.abc import Mapping
from typing import Any, NamedTuple, Self

import numpy as np
import pandas as pd
import xarray as xr

from symtop.core import netcdf
from symtop.methods.framework.plan import Plan, Run
from symtop.model.charts import BODY, Array, View, continuous, readings
from symtop.model.scenes import Scene, closed_form

LABELS = {"component": ("x", "y", "z"), "part": ("w", "x", "y", "z")}  # of the second dimension of vectors
_DIMS = {(): ("time",)} | {(len(labels),): ("time", name) for name, labels in LABELS.items()}


class Trajectory(NamedTuple):
    """One motion at n times, of a run or from other data; None for quantities that it does not have."""

    time: Array  # (n,) elapsed
    theta: Any = None  # (n,) rad
    phi: Any = None  # (n,) rad, unwrapped
    psi: Any = None  # (n,) rad, unwrapped
    axis: Any = None  # (n, 3) unit vectors, space frame
    quaternion: Any = None  # (n, 4) w, x, y, z, body to space
    energy: Any = None  # (n,)
    p_theta: Any = None  # (n,)
    p_phi: Any = None  # (n,)
    p_psi: Any = None  # (n,)
    momentum: Any = None  # (n, 3) L of a body, space frame
    chart: str = ""
    step_size: float = np.nan  # of a fixed-step method
    tolerance: float = np.nan  # of an adaptive method
    steps: int = 0
    force_evaluations: int = 0
    newton_iterations: int = 0
    outcome: str = "ok"
    reached_time: float = np.nan  # end of the last completed step, or of the last sample whose quaternion has length 1

    @classmethod
    def of_run(cls, scene: Scene, chart: str, plan: Plan, run: Run) -> Self:
        """The observables of a run, whatever chart it was computed in; phi and psi are made continuous.

        If the outcome is "ok" but an observable is not finite, because states are too large, or the axis is zero, the
        outcome becomes "not_finite" from there.
        """
        with np.errstate(over="ignore", invalid="ignore"):  # a run may blow up, and that is a result
            view = View(chart, scene.top, run.states, run.p_phi, run.p_psi)
            phi = psi = p_theta = momentum = None
            if chart == BODY:  # of the angles only theta; the momentum in space
                axis, energy, momentum = view.axis, view.energy, view.momentum
            else:
                phi, psi = view.phi, view.psi
                if chart != "angles":
                    angles = [phi] if psi is None else [phi, psi]
                    guides = closed_form(scene).turns(plan.times)[: len(angles)]
                    phi, psi = (*continuous(np.array(angles), guides), None)[:2]
                axis, energy, p_theta = readings(view)
            outcome, reached = run.outcome, run.reached
            valid = np.isfinite(energy + run.p_phi) & axis.any(axis=1)  # an overflow, or an axis of zero
            if outcome == "ok" and not valid.all():
                outcome, reached = "not_finite", plan.last_of(valid)
            return cls(
                plan.times, view.theta, phi, psi, axis, view.quaternion if chart in ("attitude", BODY) else None,
                energy, p_theta, run.p_phi, None if chart == BODY else run.p_psi, momentum, chart, plan.step_size,
                plan.tolerance, *run[3:6], outcome, reached,
            )  # fmt: skip

    @classmethod
    def of_data(cls, data: xr.Dataset | Mapping[str, Any]) -> Self:
        """The trajectory in a dataset of `simulate`, or in any dataset or mapping with some of its variables."""
        attributes = getattr(data, "attrs", {})
        values: dict[str, Any] = {name: np.asarray(column(data, name)) for name in ("time", *COLUMNS) if name in data}
        return cls(**values, **{name: attributes[name] for name in FACTS if name in attributes})

    @property
    def columns(self) -> dict[str, Array]:
        """The quantities that the trajectory has, by name, without ``time``."""
        return {name: values for name in COLUMNS if (values := getattr(self, name)) is not None}


def column(data: xr.Dataset | Mapping[str, Any], name: str) -> Any:
    """The variable `name` of data, with time as first dimension and labelled components in the order of `LABELS`."""
    values = data[name]
    if isinstance(values, xr.DataArray) and values.dims != ("time",):
        for dim, labels in LABELS.items():
            order = values.coords[dim].to_numpy().tolist() if dim in values.coords else [*labels]
            if order != [*labels] and {*order} == {*labels}:
                values = values.sel({dim: [*labels]})
        if "time" in values.dims[1:]:
            values = values.transpose("time", ...)
    return values


COLUMNS, FACTS = Trajectory._fields[1:11], Trajectory._fields[11:]


def dataset(time: Array, columns: Mapping[str, Array], units: str = "") -> xr.Dataset:
    """Columns (n,) or (n, 3 or 4) of doubles over ``time`` and ``component`` (x, y, z) or ``part`` (w, x, y, z).

    Variables that symtop knows get long names and units: `units` is "SI", or empty for a problem without units. All
    columns have the same times, so that nothing needs aligning, and ``xr.Dataset(...)`` would take as long as the rest
    of a short run. The dataset is therefore built with a private constructor of xarray, unless its result differs from
    that of the public one in a small example.
    """
    return (_direct if _direct_works() else _public)(time, columns, units)


def _public(time: Array, columns: Mapping[str, Array], units: str) -> xr.Dataset:
    attributes = netcdf.variable_attributes
    variables = {name: (_DIMS[values.shape[1:]], values, attributes(name, units)) for name, values in columns.items()}
    present = [name for name in LABELS if any(name in dims for dims, _, _ in variables.values())]
    coordinates = {name: (name, list(LABELS[name]), attributes(name, units)) for name in present}
    return xr.Dataset(variables, {"time": ("time", time.copy(), attributes("time", units)), **coordinates})


def _direct(time: Array, columns: Mapping[str, Array], units: str) -> xr.Dataset:
    def variable(kind: type, dims: tuple[str, ...], data: Any, name: str, encoding: Any = None) -> Any:
        instance: Any = object.__new__(kind)
        instance._dims, instance._data, instance._encoding = dims, data, encoding
        instance._attrs = dict(netcdf.variable_attributes(name, units)) or None
        return instance

    variables: dict[str, Any] = {}
    sizes = {"time": len(time)}
    for name, values in columns.items():
        dims = _DIMS[values.shape[1:]]
        variables[name] = variable(xr.Variable, dims, values, name)
        sizes[dims[-1]] = values.shape[-1]
    clock = pd.Index._simple_new(time.copy(), name="time")
    indexes: dict[str, Any] = {"time": xr.indexes.PandasIndex(clock, "time", time.dtype, fastpath=True)}
    adapter = type(_labels("component")[1])
    variables["time"] = variable(xr.IndexVariable, ("time",), adapter(clock), "time", {})
    for name in LABELS:
        if name in sizes:
            indexes[name], labels = _labels(name)
            variables[name] = variable(xr.IndexVariable, (name,), labels, name, {})
    return xr.Dataset._construct_direct(variables, set(indexes), sizes, indexes=indexes)


@functools.cache
def _labels(name: str) -> tuple[Any, Any]:
    """The index of a second dimension and the data of its variable; both are immutable and can be shared."""
    data = xr.Dataset(coords={name: list(LABELS[name])})
    return data.xindexes[name], data.variables[name]._data


@functools.cache
def _direct_works() -> bool:
    """Does `_direct` build the same dataset as the public constructor, in this version of xarray?"""
    example = np.array([0.0, 0.5]), {"theta": np.ones(2), "axis": np.ones((2, 3)), "quaternion": np.ones((2, 4))}
    try:
        direct, public = _direct(*example, ""), _public(*example, "")
        kinds = [[(type(part), type(part._data)) for part in data.variables.values()] for data in (direct, public)]
        return direct.identical(public) and kinds[0] == kinds[1]
    except (AttributeError, TypeError):
        return False
