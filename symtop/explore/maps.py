"""The map of outcomes: one method on one top over a grid of steps and spins, as one ensemble.

A cell is the run from the page's start with its own psi_dot (row) and step size (column). Its value is the largest
angle in radians between its axis and the exact one over nine samples; a run that ended early has none.
"""

import base64
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from symtop.core.errors import SymtopError, finite, positive
from symtop.explore.answers import START, TOP, Setup, setup
from symtop.model import charts
from symtop.model.exact.closed_form import ClosedForm
from symtop.model.top import Angles
from symtop.run.ensemble.ensemble import ensemble

COLUMNS, ROWS = 48, 32  # steps, spins
SAMPLES = 9
MOST_STEPS = 20_000_000  # of all cells; 1.5 s of an implicit method


def grid(fields: Mapping[str, Any]) -> tuple[Setup, np.ndarray, np.ndarray]:
    """The run, the steps and the spins of a map: `step_least`, `step_most` (s), `spin_least`, `spin_most` (rad/s).

    Raises SymtopError for a method without a step, a range that is empty, and a map of too many steps.
    """
    chosen = setup(fields)
    if chosen.method.control != "step_size":
        raise SymtopError(f"integrator must be one with a step for a map, not {chosen.method.name!r}")
    least, most = (positive(name, fields.get(name)) for name in ("step_least", "step_most"))
    low, high = (finite(name, fields.get(name)) for name in ("spin_least", "spin_most"))
    if not (least < most and low < high):
        raise SymtopError(f"the ranges of a map must not be empty, not {least!r} to {most!r} s, {low!r} to {high!r}")
    steps, spins = np.geomspace(least, most, COLUMNS), np.linspace(low, high, ROWS)
    if (total := ROWS * float(np.sum(chosen.scene.horizon / steps))) > MOST_STEPS:
        raise SymtopError(f"a map must have at most {MOST_STEPS} steps, not {total:.3g}: take a shorter time")
    return chosen, steps, spins


def answer(asked: tuple[Setup, np.ndarray, np.ndarray]) -> dict[str, Any]:
    """The map: ``error_rad`` as base64 of float32, row by row from the least spin; NaN where a run ended early."""
    began = time.perf_counter()
    chosen, steps, spins = asked
    scene = chosen.scene
    step, spin = (each.ravel() for each in np.meshgrid(steps, spins))
    numbers = {name: getattr(scene.top, name) for name in TOP} | {name: getattr(scene.start, name) for name in START}
    members = xr.Dataset(
        {name: ("member", np.full(step.size, number)) for name, number in numbers.items() if name != "psi_dot"}
        | {"psi_dot": ("member", spin)}
    )
    runs = ensemble(
        members, chosen.method, step_size=step, horizon=scene.horizon, samples=SAMPLES, variables=["axis"],
        observe="attitude", quiet=True,
    )  # fmt: skip
    times = np.broadcast_to(runs["time"].values, (step.size, SAMPLES)).reshape(ROWS, -1)
    axes = runs["axis"].values.reshape(ROWS, -1, 3)
    start = {name: getattr(scene.start, name) for name in START}
    error = np.full(times.shape, np.nan)
    for row, rate in enumerate(spins):
        known = np.isfinite(times[row]) & np.isfinite(axes[row]).all(axis=-1)
        truth = ClosedForm(scene.top, Angles(**start | {"psi_dot": float(rate)})).axis(times[row, known])
        error[row, known] = charts.axis_distance(axes[row, known], truth)
    worst = np.fmax.reduce(error.reshape(step.size, SAMPLES), axis=1)
    worst[runs["outcome"].values != "ok"] = np.nan
    seconds = time.perf_counter() - began
    return {
        "columns": COLUMNS,
        "rows": ROWS,
        "error_rad": base64.b64encode(worst.astype("<f4").tobytes()).decode(),
        "failed": int(np.isnan(worst).sum()),
        "cells_a_second": step.size / seconds,
    }
