"""A run as plain arrays, a `Trajectory`, and columns over time as a labelled dataset.

Functions inside symtop pass trajectories; a dataset is made where one is returned to the user.
"""

import functools
from collections.abc import Mapping
from typing import Any, NamedTuple, Self

import numpy as np
import pandas as pd
import xarray as xr

from symtop.core import netcdf
from symtop.methods.framework.plan import Plan, Run
from symtop.model.charts import Array, View, continuous, readings
from symtop.model.scenes import Scene, closed_form

LABELS = {"component": ("x", "y", "z"), "part": ("w", "x", "y", "z")}  # of the second dimension of vectors
_DIMS = {(): ("time",)} | {(len(labels),): ("time", name) for name, labels in LABELS.items()}


class Trajectory(NamedTuple):
    """One motion at n times, as a run shows it or as somebody gives it; None for what is not shown."""

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
    chart: str = ""
    step_size: float = np.nan  # of a fixed-step method
    tolerance: float = np.nan  # of an adaptive method
    steps: int = 0
    force_evaluations: int = 0
    newton_iterations: int = 0
    outcome: str = "ok"
    reached_time: float = np.nan  # end of the last completed step

    @classmethod
    def of_run(cls, scene: Scene, chart: str, plan: Plan, run: Run) -> Self:
        """The observables of a run, whatever chart it was computed in; phi and psi are made continuous."""
        with np.errstate(over="ignore", invalid="ignore"):  # a run may blow up, and that is a result
            view = View(chart, scene.top, run.states, run.p_phi, run.p_psi)
            phi, psi = view.phi, view.psi
            if chart != "angles":
                angles = [phi] if psi is None else [phi, psi]
                guides = closed_form(scene).turns(plan.times)[: len(angles)]
                phi, psi = (*continuous(np.array(angles), guides), None)[:2]
            axis, energy, p_theta = readings(view)
            quaternion = view.quaternion if chart == "attitude" else None
            return cls(
                plan.times, view.theta, phi, psi, axis, quaternion, energy, p_theta, run.p_phi, run.p_psi, chart,
                plan.step_size, plan.tolerance, *run[3:],
            )  # fmt: skip

    @classmethod
    def of_data(cls, data: xr.Dataset | Mapping[str, Any]) -> Self:
        """The trajectory in a dataset of `simulate`, or in any dataset or mapping with some of its variables."""
        attributes = getattr(data, "attrs", {})
        values: dict[str, Any] = {name: np.asarray(data[name]) for name in ("time", *COLUMNS) if name in data}
        return cls(**values, **{name: attributes[name] for name in FACTS if name in attributes})

    @property
    def columns(self) -> dict[str, Array]:
        """What is shown, by name, without ``time``."""
        return {name: values for name in COLUMNS if (values := getattr(self, name)) is not None}


COLUMNS, FACTS = Trajectory._fields[1:10], Trajectory._fields[10:]


def dataset(time: Array, columns: Mapping[str, Array], units: str = "") -> xr.Dataset:
    """Columns (n,) or (n, 3 or 4) of doubles over ``time`` and ``component`` (x, y, z) or ``part`` (w, x, y, z).

    Variables that symtop knows have their long names and units: "SI", or empty for a problem without units. Columns of
    one run have one length and one clock, so that nothing is left to check: ``xr.Dataset(...)`` would take as long as
    all the rest of a short run, and twice as long as that.
    """
    attributes = netcdf.variable_attributes
    variables: dict[str, Any] = {}
    sizes = {"time": len(time)}
    for name, values in columns.items():
        dims = _DIMS[values.shape[1:]]
        variables[name] = xr.Variable(dims, values, attributes(name, units), fastpath=True)
        sizes[dims[-1]] = values.shape[-1]
    clock = pd.Index(time, name="time")
    indexes: dict[str, Any] = {"time": xr.indexes.PandasIndex(clock, "time")}
    variables["time"] = xr.IndexVariable("time", clock, attributes("time", units), fastpath=True)
    for name in LABELS:
        if name in sizes:
            indexes[name], labels = _labels(name)
            variables[name] = labels.copy(deep=False)
            variables[name].attrs = attributes(name, units)
    try:
        return xr.Dataset._construct_direct(variables, set(indexes), sizes, indexes=indexes)
    except (AttributeError, TypeError):  # of another version of xarray, where that is private
        return xr.Dataset(variables, {name: variables.pop(name) for name in indexes})


@functools.cache
def _labels(name: str) -> tuple[Any, Any]:
    """The index and the variable of a second dimension."""
    data = xr.Dataset(coords={name: list(LABELS[name])})
    return data.xindexes[name], data.variables[name]
