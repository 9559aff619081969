"""Facts and tables of the study of oscillators."""

import math
from collections.abc import Iterable
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from .measures import AGAINST_RK45, HORIZON, LONG, OSCILLATORS, RK45, RULES, TOPS, Column, order
from .oscillator import ONE_SIDED
from .quartic_measures import ERROR, MAPS, PERIODS, QUARTICS, STEP, STEPS, oscillator_of, quartic_order

CRITICAL = "damping-2"  # the scene of critical damping
COLUMNS = {  # what some variants alone have, and its dimension
    Column.STEP: "setting", Column.POSITION_ERROR: "setting", Column.EXPONENT_ERROR: "setting",
    Column.ENERGY_ERROR: "sample", Column.UPDATE_GAP: "seed_step",
    Column.TOP_STEP: "top_setting", Column.THETA_ERROR: "top_setting",
    Column.BALANCE_PHI: "top_sample", Column.BALANCE_PSI: "top_sample",
    **dict.fromkeys((ERROR, STEP), "quartic_setting"),
}  # fmt: skip


def whole(data: xr.Dataset) -> xr.Dataset:
    """The dataset with every scene, variant and column that is asked for, NaN where nothing was measured."""
    chosen = data.drop_vars("chart").reindex(
        scene=[*OSCILLATORS, *TOPS, *QUARTICS], variant=list(dict.fromkeys([*RULES, ONE_SIDED, RK45, *MAPS]))
    )
    size = chosen.sizes["scene"], chosen.sizes["variant"]
    missing = {
        name: (("scene", "variant", dim), np.full((*size, chosen.sizes.get(dim, 1)), math.nan))
        for name, dim in COLUMNS.items()
        if name not in data
    }
    return chosen.assign(missing)


def facts(data: xr.Dataset) -> dict[str, Any]:
    """Orders, the notebook's update, energies at equal cost, the balance of momenta, and the exact map."""
    data = whole(data)
    orders = [order(data, *run, Column.POSITION_ERROR).slope for run in product(OSCILLATORS, RULES)]
    one_sided = [order(data, name, ONE_SIDED, Column.POSITION_ERROR).slope for name in list(OSCILLATORS)[1:]]
    rates = {name: order(data, CRITICAL, name, Column.EXPONENT_ERROR).slope for name in (*RULES, ONE_SIDED)}
    of_tops = [order(data, *run, Column.THETA_ERROR).slope for run in product(TOPS, RULES)]
    maps = [quartic_order(data, *run).slope for run in product(QUARTICS, MAPS[1:])]
    energies = largest(data, Column.ENERGY_ERROR)
    evaluations = data[Column.EVALUATIONS].sel(scene=list(AGAINST_RK45)) if Column.EVALUATIONS in data else None
    return {
        "horizon": HORIZON, "long": LONG,  # in units of sqrt(m/k)
        "periods": PERIODS,  # of the quartic oscillators
        **ends("order", orders), **ends("one_sided", one_sided), **ends("top_order", of_tops),
        **{f"rate_{name.replace('-', '_')}": slope for name, slope in rates.items()},
        "update_gap": float(data[Column.UPDATE_GAP].max()),
        **{f"{word}_{name}": float(energies.sel(scene=scene, variant=name))  # largest relative error of the energy
           for word, scene in zip(("undamped", "damped"), AGAINST_RK45, strict=True) for name in (*RULES, RK45)},
        "rule_evaluations": None if evaluations is None else float(evaluations.sel(variant=list(RULES)).max()),
        "balance": balance(data),  # of the momenta of damped tops, relative to the larger one
        "exact": float(data[ERROR].sel(variant=MAPS[0]).max()),  # largest relative error of the exact map
        **ends("map_order", maps),
    }  # fmt: skip


def ends(name: str, values: Iterable[float]) -> dict[str, float | None]:
    """The least and the most of those that were measured."""
    known = [value for value in values if math.isfinite(value)]
    return {f"{name}_least": min(known, default=None), f"{name}_most": max(known, default=None)}


def largest(data: xr.Dataset, column: str) -> xr.DataArray:
    """The largest absolute value of a column, by scene and variant."""
    return np.abs(data[column]).max([dim for dim in data[column].dims if dim not in ("scene", "variant")])


def balance(data: xr.Dataset) -> float:
    """The largest relative defect of the momentum balance of the damped tops."""
    runs = data.sel(scene=list(TOPS), variant=list(RULES))
    return max(float(largest(runs, name).max()) for name in (Column.BALANCE_PHI, Column.BALANCE_PSI))


def tables(data: xr.Dataset) -> dict[str, pd.DataFrame]:
    """Orders and energies of the damped oscillator, the lowest order of the rate first; errors of every exact map."""
    data = whole(data)
    energies, rows = largest(data, Column.ENERGY_ERROR), []
    for (name, oscillator), rule in product(OSCILLATORS.items(), (*RULES, ONE_SIDED, RK45)):
        slopes = [order(data, name, rule, error).slope for error in (Column.POSITION_ERROR, Column.EXPONENT_ERROR)]
        energy = float(energies.sel(scene=name, variant=rule))
        if math.isfinite(energy):
            rows.append([oscillator.damping, oscillator.regime, rule, *slopes, energy])
    header = ["b", "regime", "rule", "order of x", "order of the rate of decay", f"energy error to T = {LONG:g}"]
    damped = pd.DataFrame(rows, columns=header).sort_values(header[4], kind="stable")
    shown, rows = (160.3, 20.3, 4.37, 2.1), []
    for method, name in product(MAPS, QUARTICS):
        errors, oscillator = data[ERROR].sel(scene=name, variant=method).values, oscillator_of(name)
        slope = math.nan if method == MAPS[0] else quartic_order(data, name, method).slope
        if np.isfinite(errors).any():
            rows.append([method, name, float(oscillator.sigma), float(oscillator.b), slope,
                         *(float(errors[STEPS.index(steps)]) for steps in shown)])  # fmt: skip
    header = ["map", "oscillator", "sigma", "b", "order", *(f"error at T/{steps:g}" for steps in shown)]
    return {"damped": damped, "quartic": pd.DataFrame(rows, columns=header)}
