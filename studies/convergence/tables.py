"""Numerics of the study: orders, what they say of the declared ones, and how errors follow a tolerance.

The dataset has the columns of `symtop.measure.accuracy.error_table`, over ``scene``, ``integrator`` (the name of a row,
``rk4[axis]``) and ``setting``, and ``horizon`` over the first two.
"""

import math
from itertools import product
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.base.numbers import EPSILON
from symtop.measure.order import LARGEST_ERROR, Fit, order_verdict, power_law
from symtop.measure.order_table import observable, order_fit
from symtop.methods.registry import Integrator, integrator, integrators, split_name
from symtop.model.scenes import scene

MAIN = "axis"  # every chart shows it
OTHERS = ("attitude", "theta", "energy")
LARGE = LARGEST_ERROR  # radians: larger errors follow no power of the step
ABOVE_BOUND = 100.0  # times the reference's own error bound: smaller errors may be the reference's
SAME = 0.02  # rows of a method whose errors differ by less are drawn as one

Pairs = dict[tuple[str, str], Fit]  # by scene and row


def registered(name: str) -> Integrator | None:
    """The row of that name; None if its method is not registered any more."""
    return integrator(name) if split_name(name)[0] in integrators() else None


def declared_order(name: str) -> int | None:
    """The order that a row declares; None if it declares none or is not registered any more."""
    row = registered(name)
    return row.order if row else None


def stepping(data: xr.Dataset) -> xr.Dataset:
    """The rows that have a step to choose."""
    return data.sel(integrator=np.isfinite(data["step_size"]).any(["scene", "setting"]))


def adaptive(data: xr.Dataset) -> xr.Dataset:
    """The rows that have a tolerance to choose."""
    return data.sel(integrator=np.isfinite(data["tolerance"]).any(["scene", "setting"]))


def by_order(data: xr.Dataset) -> dict[int, list[str]]:
    """Rows by their declared order, 0 for none, from low to high."""
    groups: dict[int, list[str]] = {}
    for name in data["integrator"].values:
        groups.setdefault(declared_order(str(name)) or 0, []).append(str(name))
    return dict(sorted(groups.items()))


def fits(data: xr.Dataset, quantity: str, *, at_end: bool = False) -> Pairs:
    """The order of every row of fixed step on every scene, from the largest errors or those at the end."""
    column, part = f"{quantity}_end" if at_end else quantity, stepping(data)
    fitted = {}
    for name, label in product(map(str, part["scene"].values), map(str, part["integrator"].values)):
        row, cell = registered(label), part.sel(scene=name, integrator=label)
        if row is not None and not (quantity == "attitude" and observable(row) == "axis"):
            fitted[name, label] = order_fit(scene(name), row, cell, column, float(cell["horizon"]))
    return fitted


class Judged(NamedTuple):
    """The verdict on one row and scene, and the slopes that it rests on."""

    verdict: str  # see `order_verdict`
    fits: dict[str, Fit]  # by quantity; only those that the chart shows


def judged(data: xr.Dataset) -> dict[tuple[str, str], Judged]:
    """What the slopes of every row say of its declared order, on every scene."""
    by_quantity = {quantity: fits(data, quantity) for quantity in (MAIN, *OTHERS)}
    result = {}
    for pair, main in by_quantity[MAIN].items():
        slopes = {quantity: pairs[pair] for quantity, pairs in by_quantity.items() if pair in pairs}
        others = [fit for quantity, fit in slopes.items() if quantity != MAIN]
        result[pair] = Judged(order_verdict(declared_order(pair[1]), main, others), slopes)
    return result


def tolerance_fits(data: xr.Dataset) -> Pairs:
    """error = constant * tolerance^slope of every adaptive row on every scene, a straight line."""
    part, fitted = adaptive(data), {}
    for name, label in product(map(str, part["scene"].values), map(str, part["integrator"].values)):
        cell = part.sel(scene=name, integrator=label)
        error, bound = cell[MAIN].values, cell[f"{MAIN}_bound"].values
        fitted[name, label] = power_law(cell["tolerance"].values, error, (error < LARGE) & (error > 10.0 * bound))
    return fitted


def merged(data: xr.Dataset, quantity: str) -> dict[str, str]:
    """Labels of rows for a figure: rows of one method with the same errors are one, ``strang[axis, attitude]``."""
    labels: dict[str, str] = {}
    for name in map(str, data["integrator"].values):
        method, chart = split_name(name)
        twin = next((one for one in labels if split_name(one)[0] == method and _same(data, one, name, quantity)), None)
        if twin is None:
            labels[name] = name
        else:
            labels[twin] = f"{labels[twin][:-1]}, {chart}]"
    return labels


def _same(data: xr.Dataset, first: str, second: str, quantity: str) -> bool:
    """Do two rows have the same errors, wherever these are above rounding?"""
    one, other = (data[quantity].sel(integrator=name).values for name in (first, second))
    limit = ABOVE_BOUND * data[f"{quantity}_bound"].sel(integrator=first).values
    seen = np.isfinite(one) & np.isfinite(other) & (one > np.maximum(limit, EPSILON))
    return bool(seen.any() and np.all(np.abs(one[seen] - other[seen]) <= SAME * one[seen]))


def evaluations_a_nutation(cell: xr.Dataset, name: str) -> np.ndarray:
    """Force evaluations per nutation period of the runs of one cell."""
    work: np.ndarray = cell["force_evaluations"].values * scene(name).nutation_period / float(cell["horizon"])
    return work


def guide_constant(data: xr.Dataset, quantity: str, power: int) -> float:
    """The least error / h^power of one scene's errors that are neither large nor rounding; NaN if there are none."""
    h, error = data["step_size"], data[quantity]
    usable = (error < LARGE) & (error > ABOVE_BOUND * data[f"{quantity}_bound"])
    least = float((error / h**power).where(usable).min())
    return least if math.isfinite(least) else math.nan
