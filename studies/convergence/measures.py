"""Numerics of the study: measured orders, verdicts on the declared ones, and errors as a function of the tolerance.

The dataset has the columns of `symtop.measure.accuracy.error_table`, over ``scene``, ``variant`` (the name of one,
``rk4[axis]``) and ``setting``, and ``horizon`` over the first two.
"""

import math
from itertools import product
from typing import NamedTuple

import numpy as np
import xarray as xr
from symtop_studies.cost.ranking import cost_to_reach
from symtop_studies.memoize import of_one_dataset

from symtop.core.numbers import EPSILON
from symtop.measure.conservation import residuals
from symtop.measure.order import LARGEST_ERROR, Fit, order_verdict, power_law, wrong_limit
from symtop.measure.order_table import observable, order_fit
from symtop.methods.framework.registry import Integrator, integrator, integrators, split_name
from symtop.model.scenes import Scene, scene
from symtop.run.simulation import integrate

MAIN = "axis"  # every chart shows it
OTHERS = ("attitude", "theta", "energy")
NAMED = ("midpoint", "trapezoidal", "stormer-verlet", "rk4", "rk45", "dop853", "taylor")  # well-known methods
LEAST_SCENES = 3  # a median over fewer scenes is not ranked
FEW = 9  # variants that a figure has room for
HISTORY_STEPS, HISTORY_TOLERANCE = 100.0, 1e-6  # steps a nutation, and tolerance, of the runs for the energy over time
LARGE = LARGEST_ERROR  # radians: larger errors follow no power of the step
ABOVE_BOUND = 100.0  # errors below this many times the reference's error bound may be errors of the reference
WRONG, ROUNDED, ALIKE = "wrong limit", 1e-6, 0.9  # errors that stay, above rounding by a pole, and nearly the same
SAME = 0.02  # relative: variants of a method whose errors differ by less are drawn as one

Pairs = dict[tuple[str, str], Fit]  # by scene and variant


def registered(name: str) -> Integrator | None:
    """The variant of that name; None if its method is not registered any more."""
    return integrator(name) if split_name(name)[0] in integrators() else None


def declared_order(name: str) -> int | None:
    """The order that a variant declares; None if it declares none or is not registered any more."""
    row = registered(name)
    return row.order if row else None


def stepping(data: xr.Dataset) -> xr.Dataset:
    """The variants that have a step to choose."""
    return data.sel(variant=np.isfinite(data["step_size"]).any(["scene", "setting"]))


def adaptive(data: xr.Dataset) -> xr.Dataset:
    """The variants that have a tolerance to choose."""
    return data.sel(variant=np.isfinite(data["tolerance"]).any(["scene", "setting"]))


@of_one_dataset
def fits(data: xr.Dataset, quantity: str, *, at_end: bool = False) -> Pairs:
    """The order of every variant of fixed step on every scene, from the largest errors or those at the end."""
    column, part = f"{quantity}_end" if at_end else quantity, stepping(data)
    fitted = {}
    for name, label in product(map(str, part["scene"].values), map(str, part["variant"].values)):
        row, cell = registered(label), part.sel(scene=name, variant=label)
        if row is not None and not (quantity == "attitude" and observable(row) == "axis"):
            fitted[name, label] = order_fit(scene(name), row, cell, column, float(cell["horizon"]))
    return fitted


class OrderVerdict(NamedTuple):
    """The verdict on one variant and scene, and the slopes that it rests on."""

    verdict: str  # see `order_verdict`; or `WRONG`
    fits: dict[str, Fit]  # by quantity; only those that the chart shows


def judged(data: xr.Dataset) -> dict[tuple[str, str], OrderVerdict]:
    """The verdict of the measured slopes on the declared order of every variant, on every scene."""
    by_quantity = {quantity: fits(data, quantity) for quantity in (MAIN, *OTHERS)}
    result = {}
    for pair, main in by_quantity[MAIN].items():
        slopes = {quantity: pairs[pair] for quantity, pairs in by_quantity.items() if pair in pairs}
        others = [fit for quantity, fit in slopes.items() if quantity != MAIN]
        word, cell = order_verdict(declared_order(pair[1]), main, others), data.sel(scene=pair[0], variant=pair[1])
        columns = (cell[name].values for name in ("step_size", MAIN, f"{MAIN}_bound"))
        if word == "undecided" and math.isfinite(wrong_limit(*columns, ROUNDED, ALIKE)):
            word = WRONG
        result[pair] = OrderVerdict(word, slopes)
    return result


def tolerance_fits(data: xr.Dataset) -> Pairs:
    """error = constant * tolerance^slope of every adaptive variant on every scene, a straight line."""
    part, fitted = adaptive(data), {}
    for name, label in product(map(str, part["scene"].values), map(str, part["variant"].values)):
        cell = part.sel(scene=name, variant=label)
        error, bound = cell[MAIN].values, cell[f"{MAIN}_bound"].values
        fitted[name, label] = power_law(cell["tolerance"].values, error, (error < LARGE) & (error > 10.0 * bound))
    return fitted


def merged(data: xr.Dataset, quantity: str) -> dict[str, str]:
    """Labels of variants for a figure: those of one method with the same errors are one, ``strang[axis, attitude]``."""
    labels: dict[str, str] = {}
    for name in map(str, data["variant"].values):
        method, chart = split_name(name)
        twin = next((key for key in labels if split_name(key)[0] == method and _same(data, key, name, quantity)), None)
        if twin is None:
            labels[name] = name
        else:
            labels[twin] = f"{labels[twin][:-1]}, {chart}]"
    return labels


def _same(data: xr.Dataset, first: str, second: str, quantity: str) -> bool:
    """Do two variants have the same errors, wherever these are above rounding?"""
    x, y = (data[quantity].sel(variant=name).values for name in (first, second))
    limit = ABOVE_BOUND * data[f"{quantity}_bound"].sel(variant=first).values
    seen = np.isfinite(x) & np.isfinite(y) & (x > np.maximum(limit, EPSILON))
    return bool(seen.any() and np.all(np.abs(x[seen] - y[seen]) <= SAME * x[seen]))


def evaluations_a_nutation(cell: xr.Dataset, name: str) -> np.ndarray:
    """Force evaluations per nutation period of the runs of one cell."""
    work: np.ndarray = cell["force_evaluations"].values * scene(name).nutation_period / float(cell["horizon"])
    return work


def energy_history(on: Scene, variant: Integrator, nutations: float) -> xr.Dataset:
    """The relative change of the energy over time of a run with `HISTORY_STEPS` or `HISTORY_TOLERANCE`.

    Dimension ``moment``: ``history_time`` in nutation periods, ``history_energy``. An adaptive method with a default
    tolerance, the rounding of its arithmetic, keeps it; ``history_tolerance`` is what it ran with.
    """
    period, tolerance = on.nutation_period, variant.default_tolerance or HISTORY_TOLERANCE
    setting = {"step_size": period / HISTORY_STEPS} if variant.fixed_step else {"tolerance": tolerance}
    run = integrate(on, variant, horizon=nutations * period, samples=801, **setting)
    return xr.Dataset(
        {
            "history_time": ("moment", run.time / period),
            "history_energy": ("moment", np.abs(residuals(on, run)["energy"])),
            "history_tolerance": np.nan if variant.fixed_step else tolerance,
        }
    )


class Efficiency(NamedTuple):
    """The work of a variant for an axis error: force evaluations per nutation."""

    work: float
    foreseen: bool  # extrapolated by error = C h^p, as the error does not lie between those of two runs


def efficiencies(data: xr.Dataset, error: float) -> dict[tuple[str, str], Efficiency]:
    """The work for an axis error of every variant with a fixed step on every scene where it is known.

    It is interpolated, linearly in logarithms, between the two runs next to the error, if all shorter steps have
    smaller errors. Otherwise it is extrapolated for a variant with a reliable order: a step h costs E evaluations, so
    that C h^p = error takes E T (C / error)^(1/p) of them in a nutation T. E is the median over the steps of the fit;
    an implicit method iterates more at longer steps, and needs more there.
    """
    works = {}
    for (name, label), fit in fits(data, MAIN).items():
        work = _between(data.sel(scene=name, variant=label), name, error)
        if np.isfinite(work):
            works[name, label] = Efficiency(work, False)
            continue
        if not (np.isfinite(fit.slope) and fit.used.any()):
            continue
        cell, order = data.sel(scene=name, variant=label), declared_order(label) or round(fit.slope)
        used, steps = fit.used, cell["step_size"].values[fit.used]
        per_step = np.median((evaluations_a_nutation(cell, name)[used] * steps) / scene(name).nutation_period)
        constant = np.median(cell[MAIN].values[used] / steps**order)
        work = float(per_step * scene(name).nutation_period * (constant / error) ** (1.0 / order))
        works[name, label] = Efficiency(work, True)
    return works


def _between(cell: xr.Dataset, name: str, error: float) -> float:
    """The work between the last run with more than an error and the next, by `cost_to_reach`; else not finite."""
    order = np.argsort(-cell["step_size"].values)
    errors, works = cell[MAIN].values[order], evaluations_a_nutation(cell, name)[order]
    good = (errors > 0.0) & (works > 0.0)
    errors, works = errors[good, np.newaxis], works[good, np.newaxis]
    return float(cost_to_reach(works, errors, [error])[0, 0]) if (errors > error).any() else math.nan


TARGET = 1e-6  # rad, the axis error at which costs are compared


def named_variants(data: xr.Dataset) -> tuple[xr.Dataset, dict[str, str]]:
    """The methods `NAMED` on the first scene, on the axis if they have that chart, and their labels.

    If there are few variants, or none of these methods, all variants, but no attitude chart beside an axis chart.
    """
    options = list(map(str, data["variant"].values))
    names = [name for name in options if split_name(name)[0] in NAMED]
    if len(options) <= FEW or not names:
        names = [
            name for name in options if name.replace("[attitude]", "[axis]") not in options or "[attitude]" not in name
        ]
    else:
        names = [name for name in names if name.endswith("[axis]") or f"{split_name(name)[0]}[axis]" not in names]
    return data.sel(variant=names).isel(scene=0), merged(data.sel(variant=names), MAIN)


def ratios(data: xr.Dataset) -> dict[str, np.ndarray]:
    """Axis errors over tolerances of every adaptive variant on all scenes, above rounding and below `LARGE`."""
    by_name: dict[str, list[np.ndarray]] = {}
    for (scene_name, name), fit in tolerance_fits(data).items():
        cell = data.sel(scene=scene_name, variant=name)
        by_name.setdefault(name, []).append((cell[MAIN] / cell["tolerance"]).values[fit.used])
    return {name: np.concatenate(parts) for name, parts in by_name.items()}
