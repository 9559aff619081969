"""Facts and tables of the study of oscillators."""

import math
from collections.abc import Iterable
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from symtop.methods.lagrangian.damped_oscillator import ONE_SIDED

from .measures import AGAINST_RK45, HORIZON, LONG, OSCILLATORS, RK45, RULES, TOPS, order
from .quartic_measures import ERROR, MAPS, PERIODS, QUARTICS, STEP, STEPS, oscillator_of, quartic_order

CRITICAL = "damping-2"  # the scene of critical damping
COLUMNS = {  # variables that only some variants have: their dimension
    "step_size": "setting", "position_error": "setting", "exponent_error": "setting",
    "energy_error": "sample", "update_gap": "seed_step",
    "top_step_size": "top_setting", "theta_error": "top_setting",
    "balance_phi": "top_sample", "balance_psi": "top_sample",
    **dict.fromkeys((ERROR, STEP), "quartic_setting"),
}  # fmt: skip


def whole(data: xr.Dataset) -> xr.Dataset:
    """The dataset with every scene, variant and column that the facts use, NaN where nothing was measured."""
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
    orders = [order(data, *run, "position_error").slope for run in product(OSCILLATORS, RULES)]
    one_sided = [order(data, name, ONE_SIDED, "position_error").slope for name in list(OSCILLATORS)[1:]]
    rates = {name: order(data, CRITICAL, name, "exponent_error").slope for name in (*RULES, ONE_SIDED)}
    of_tops = [order(data, *run, "theta_error").slope for run in product(TOPS, RULES)]
    maps = [quartic_order(data, *run).slope for run in product(QUARTICS, MAPS[1:])]
    energies = largest(data, "energy_error")
    evaluations = data["evaluations"].sel(scene=list(AGAINST_RK45)) if "evaluations" in data else None
    return {
        "horizon": HORIZON, "long": LONG,  # in units of sqrt(m/k)
        "periods": PERIODS,  # of the quartic oscillators
        **ends("order", orders), **ends("one_sided", one_sided), **ends("top_order", of_tops),
        **{f"rate_{name.replace('-', '_')}": slope for name, slope in rates.items()},
        "update_gap": float(data["update_gap"].max()),
        **{f"{word}_{name}": float(energies.sel(scene=scene, variant=name))  # largest relative error of the energy
           for word, scene in zip(("undamped", "damped"), AGAINST_RK45, strict=True) for name in (*RULES, RK45)},
        "rule_evaluations": None if evaluations is None else float(evaluations.sel(variant=list(RULES)).max()),
        "balance": balance(data),  # of the momenta of damped tops, relative to the larger one
        "exact": float(data[ERROR].sel(variant=MAPS[0]).max()),  # largest relative error of the exact map
        **ends("map_order", maps),
    }  # fmt: skip


def ends(name: str, values: Iterable[float]) -> dict[str, float | None]:
    """The least and the largest finite value, under the names NAME_least and NAME_most; None without one."""
    known = [value for value in values if math.isfinite(value)]
    return {f"{name}_least": min(known, default=None), f"{name}_most": max(known, default=None)}


def largest(data: xr.Dataset, column: str) -> xr.DataArray:
    """The largest absolute value of a column, by scene and variant."""
    return np.abs(data[column]).max([dim for dim in data[column].dims if dim not in ("scene", "variant")])


def balance(data: xr.Dataset) -> float:
    """The largest relative defect of the momentum balance of the damped tops."""
    runs = data.sel(scene=list(TOPS), variant=list(RULES))
    return max(float(largest(runs, name).max()) for name in ("balance_phi", "balance_psi"))


def tables(data: xr.Dataset) -> dict[str, pd.DataFrame]:
    """Orders and energies of the damped oscillator, the lowest order of the rate first; errors of every exact map."""
    data = whole(data)
    energies, rows = largest(data, "energy_error"), []
    for (name, oscillator), rule in product(OSCILLATORS.items(), (*RULES, ONE_SIDED, RK45)):
        slopes = [order(data, name, rule, error).slope for error in ("position_error", "exponent_error")]
        energy = float(energies.sel(scene=name, variant=rule))
        if math.isfinite(energy):
            rows.append([oscillator.damping, oscillator.regime, rule, *slopes, energy])
    header = ["b", "regime", "rule", "order of x", "order of the rate of decay", f"energy error to T = {LONG:g}"]
    damped = pd.DataFrame(rows, columns=header).sort_values(header[4], kind="stable")
    steps_shown, rows = (160.3, 20.3, 4.37, 2.1), []
    for method, name in product(MAPS, QUARTICS):
        errors, oscillator = data[ERROR].sel(scene=name, variant=method).values, oscillator_of(name)
        slope = math.nan if method == MAPS[0] else quartic_order(data, name, method).slope
        if np.isfinite(errors).any():
            rows.append([method, name, float(oscillator.sigma), float(oscillator.b), slope,
                         *(float(errors[STEPS.index(steps)]) for steps in steps_shown)])  # fmt: skip
    header = ["map", "oscillator", "sigma", "b", "order", *(f"error at T/{steps:g}" for steps in steps_shown)]
    return {"damped": damped, "quartic": pd.DataFrame(rows, columns=header)}
