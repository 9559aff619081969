"""Numerics of the study: orders fitted to the error curves, and whether they are the declared ones.

The dataset has the columns of `symtop.measure.accuracy.error_table`, over ``scene``, ``integrator`` and ``setting``.
"""

from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.measure.order import Fit, order
from symtop.methods.registry import integrators
from symtop.model.scenes import scene

LARGE = 0.01  # radians: larger errors follow no power of the step
ABOVE_BOUND = 100.0  # times the reference's own error bound: smaller errors may be the reference's
OFF, OFF_SHARE = 0.05, 0.03  # an order differs from the declared one beyond the larger of OFF and this share of it

Pair = tuple[str, str]  # scene, integrator


class Curve(NamedTuple):
    """Errors (setting,) of one method on one scene, in one quantity."""

    step_size: np.ndarray  # time
    error: np.ndarray  # largest of the run, or at its end
    bound: np.ndarray  # of the reference's own error


def pairs(data: xr.Dataset) -> list[Pair]:
    """Every pair of a scene and an integrator."""
    return [(str(name), str(method)) for name in data["scene"].values for method in data["integrator"].values]


def curve(data: xr.Dataset, pair: Pair, quantity: str, *, at_end: bool = False) -> Curve:
    """The errors of a pair in attitude, theta or energy: the largest over the run, or that at its end."""
    cell = data.sel(scene=pair[0], integrator=pair[1])
    names = ("step_size", f"{quantity}_end" if at_end else quantity, f"{quantity}_bound")
    return Curve(*(cell[name].values for name in names))


def declared_order(name: str) -> int | None:
    """The order that an integrator declares; None if it declares none or is not registered any more."""
    known = integrators()
    return known[name].order if name in known else None


def by_order(data: xr.Dataset) -> dict[int, list[str]]:
    """Integrators by their declared order, 0 for none, from low to high."""
    groups: dict[int, list[str]] = {}
    for name in data["integrator"].values:
        groups.setdefault(declared_order(str(name)) or 0, []).append(str(name))
    return dict(sorted(groups.items()))


def fits(data: xr.Dataset, quantity: str, *, at_end: bool = False) -> dict[Pair, Fit]:
    """The fitted order of every pair."""
    fitted = {}
    for pair in pairs(data):
        omega = 2.0 * np.pi / scene(pair[0]).nutation_period
        fitted[pair] = order(*curve(data, pair, quantity, at_end=at_end), omega, declared_order(pair[1]))
    return fitted


def guide_constants(data: xr.Dataset, name: str, quantity: str, power: int) -> list[float]:
    """error / h^power of a scene's points that are neither large nor rounding: where a line of that slope may lie."""
    constants: list[float] = []
    for pair in pairs(data.sel(scene=[name])):
        h, error, bound = curve(data, pair, quantity)
        good = (error < LARGE) & (error > ABOVE_BOUND * bound) & np.isfinite(h)
        constants += [float(value) for value in error[good] / h[good] ** power]
    return constants


class Agreement(NamedTuple):
    """Pairs by whether they show the declared order."""

    right: list[Pair]
    wrong: list[Pair]
    unjudged: dict[str, list[Pair]]  # by the reason


def agreement(fitted: dict[Pair, Fit]) -> Agreement:
    """Compare fitted orders with the declared ones; a method that declares none is in no list."""
    right, wrong, unjudged = [], [], dict[str, list[Pair]]()
    for pair, fit in fitted.items():
        claim = declared_order(pair[1])
        if fit.reason:
            unjudged.setdefault(fit.reason, []).append(pair)
        if np.isfinite(fit.slope) and claim is not None:
            agrees = abs(fit.slope - claim) <= max(OFF, OFF_SHARE * claim)
            (right if agrees else wrong).append(pair)
    return Agreement(right, wrong, unjudged)
