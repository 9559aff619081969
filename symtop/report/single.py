"""One run as a picture: its motion beside the true one, its errors, and the residuals of constants of the motion."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from symtop.core.errors import at_home
from symtop.measure.conservation import residuals
from symtop.measure.errors import QUANTITIES
from symtop.model.scenes import Scene
from symtop.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    headline,
    legend_below,
    panels,
    save,
)  # fmt: skip
from symtop.run.trajectory import Trajectory

COLORS = {"axis": BLACK, "attitude": GREY, "theta": SKY, "energy": VERMILLION, "p_phi": GREEN, "p_psi": PURPLE}
LEAST = 1e-17  # what is smaller is drawn here


def draw(scene: Scene, run: xr.Dataset, truth: xr.Dataset, errors: xr.Dataset, path: str | Path) -> Path:
    """Three panels into a PNG: theta and the truth's, errors in angles, residuals of energy and momenta."""
    figure, axes = panels(3, 1, height=1.7, sharex=True)
    times = run["time"].values
    motion, angles, constants = axes[:, 0]
    motion.plot(times, np.degrees(truth["theta"].values), color=ORANGE, lw=2.4, alpha=0.6, label="true theta")
    motion.plot(times, np.degrees(run["theta"].values), color=BLUE, lw=1.0, label=f"theta of {run.attrs['integrator']}")
    motion.set_ylabel("theta (degrees)")
    headline(figure, f"{run.attrs['title']}: {run.attrs['outcome_message']}")
    for name in ("axis", "attitude", "theta"):
        if name in errors:
            _line(angles, times, errors[name].values, COLORS[name], QUANTITIES[name])
    for name, values in residuals(scene, Trajectory.of_data(run)).items():
        _line(constants, times, np.abs(values), COLORS[name], f"residual of {name}, relative")
    angles.set(yscale="log", ylabel="error (rad)")
    constants.set(yscale="log", ylabel="|change| since the start", xlabel="time")
    if run.attrs["outcome"] != "ok":
        for axis in axes[:, 0]:
            axis.axvline(run.attrs["reached_time"], color=VERMILLION, ls="--", label="stopped here")
    legend_below(figure, axes)
    target = at_home(path)
    save(figure, target)
    return target


def _line(axis: Any, times: Any, values: Any, color: str, label: str) -> None:
    axis.plot(times[1:], np.maximum(values[1:], LEAST), color=color, lw=1.0, label=label)
