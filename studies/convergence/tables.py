"""Numerics of the study: orders fitted to the error curves, and the declared ones.

The dataset has the columns of `symtop.measure.accuracy.error_table`, over ``scene``, ``integrator`` and ``setting``.
"""

from itertools import product

import numpy as np
import xarray as xr

from symtop.measure.order import Fit, order
from symtop.methods.registry import integrators
from symtop.model.scenes import scene

LARGE = 0.01  # radians: larger errors follow no power of the step
ABOVE_BOUND = 100.0  # times the reference's own error bound: smaller errors may be the reference's

Fits = dict[tuple[str, str], Fit]  # by scene and integrator


def declared_order(name: str) -> int | None:
    """The order that an integrator declares; None if it declares none or is not registered any more."""
    registered = integrators()
    return registered[name].order if name in registered else None


def by_order(data: xr.Dataset) -> dict[int, list[str]]:
    """Integrators by their declared order, 0 for none, from low to high."""
    groups: dict[int, list[str]] = {}
    for name in data["integrator"].values:
        groups.setdefault(declared_order(str(name)) or 0, []).append(str(name))
    return dict(sorted(groups.items()))


def fits(data: xr.Dataset, quantity: str, *, at_end: bool = False) -> Fits:
    """The fitted order of every integrator on every scene, from the largest errors or those at the end."""
    fitted = {}
    for name, method in product(map(str, data["scene"].values), map(str, data["integrator"].values)):
        cell, omega = data.sel(scene=name, integrator=method), 2.0 * np.pi / scene(name).nutation_period
        columns = ("step_size", f"{quantity}_end" if at_end else quantity, f"{quantity}_bound")
        fitted[name, method] = order(*(cell[column].values for column in columns), omega, declared_order(method))
    return fitted


def guide_constant(data: xr.Dataset, quantity: str, power: int) -> float:
    """The least error / h^power of one scene's errors that are neither large nor rounding; NaN if there are none."""
    h, error = data["step_size"], data[quantity]
    usable = (error < LARGE) & (error > ABOVE_BOUND * data[f"{quantity}_bound"])
    return float((error / h**power).where(usable).min())
