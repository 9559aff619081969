"""Facts and tables of the stability study, from its dataset."""

from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from symtop.methods.framework.registry import split_name
from symtop.report.formats import abridged

from .atlas import COMMON, FAST, NEAR, SLOW, families, halved_by_pole, map_of, maps, methods_of
from .failures import LOST, MOST
from .many_verdicts import SAID
from .measures import PERIODS
from .mechanisms import BARELY, lawful, limits, measured, misses, outlasting, resonant, sampled

QUOTED = "stormer-verlet[angles]"  # whose numbers are quoted
NAMES = (  # of all facts that are measured
    "family", "stepped", "fast_variant", "fast_reach", "slow_variant", "slow_reach", "slow_none", "shortest",
    "slow_shorter", "quoted_fast", "quoted_fails", "silent", "cells", "settled", "checks", "refuted", "angles",
    "angles_halved", "others", "others_halved", "limited", "sought", "limit_least", "limit_variant", "resonant",
    "turned", "sleep_step", "strang_sleeps", "cayley_sleeps", "sleep_miss", "law_middle", "law_runs", "law_early",
    "outlasting", "sampled", "hidden", "small", "one_iteration", "solved",
)  # fmt: skip


def facts(data: xr.Dataset) -> dict[str, Any]:
    """Up to which setting methods are accurate, how they fail, and the mechanisms. Steps of maps are in nutations."""
    values: dict[str, Any] = dict.fromkeys(NAMES)
    values |= {"periods": PERIODS, "slow": SLOW, "fast": FAST, "near": NEAR, "barely": BARELY, "lost": LOST,
              "common": COMMON, "tried": MOST}  # fmt: skip
    if family := next(iter(families(data)), None):
        values |= atlas_facts(data, family)
    for scene, variable, read in READ:
        if measured(data, scene, variable):
            values |= read(data.sel(scene=scene))
    return values


def atlas_facts(data: xr.Dataset, family: str) -> dict[str, Any]:
    """The shares and reaches of the maps over the spin of one family."""
    family_maps, known = maps(data, family), methods_of(data)
    steps = {name: map_ for name, map_ in family_maps.items()
             if map_.control == "step_size" and not (name in known and known[name].exact_steps)}  # fmt: skip
    ran = np.concatenate([map_.made.ravel() for map_ in family_maps.values()])
    values = {
        "family": family,
        "silent": float(pd.Series([map_.silent for map_ in family_maps.values()]).median()),  # of the inaccurate runs
        "cells": ran.size,
        "settled": 1.0 - ran.mean(),  # share that was not run
        **{name: int(data[name].sel(scene=family).sum()) for name in ("checks", "refuted")},
    }
    if steps:
        for kind in ("fast", "slow"):
            known = {name: reach for name, map_ in steps.items() if np.isfinite(reach := map_.usual_reach[kind])}
            if known:  # settings are a grid: there are ties
                largest = max(known.values())
                best = [f"`{name}`" for name, reach in known.items() if reach == largest]
                values |= {f"{kind}_variant": abridged(best), f"{kind}_reach": largest}
        reaches = [map_.usual_reach for map_ in steps.values()]
        values |= {"stepped": len(steps), "shortest": min(float(map_.settings[0]) for map_ in steps.values()),
                  "slow_none": sum(reach["slow"] == 0.0 for reach in reaches),
                  "slow_shorter": sum(reach["slow"] < reach["fast"] for reach in reaches)}  # fmt: skip
    if QUOTED in steps:
        values |= {"quoted_fast": steps[QUOTED].usual_reach["fast"], "quoted_fails": steps[QUOTED].failure.setting}
    return values


def pole_facts(part: xr.Dataset) -> dict[str, Any]:
    """For how many fixed-step variants a pole halves the accurate step, in angles and in other charts."""
    halved: dict[bool, list[bool]] = {True: [], False: []}
    for name, method in methods_of(part).items():
        halves = halved_by_pole(map_of(part.sel(variant=name)))
        if halves is not None and method.control == "step_size":
            halved[method.charts() == ("angles",)].append(halves)
    groups = {"angles": halved[True], "others": halved[False]}
    values = {name: len(group) for name, group in groups.items() if group}
    return values | {f"{name}_halved": sum(groups[name]) for name in values}


def resonance_facts(part: xr.Dataset) -> dict[str, Any]:
    """Where small nutations grow (h omega), and how many variants a third of a turn a step loses a top with."""
    phases = limits(part)
    least = min(phases, key=lambda name: phases[name], default=None)
    return {"limited": len(phases), "sought": float(part["sought_phase"].max()),
            "limit_least": phases.get(least), "limit_variant": least,
            "resonant": len(resonant(part)), "turned": int(part["third_turn_phase"].count())}  # fmt: skip


def sleeping_facts(part: xr.Dataset) -> dict[str, Any]:
    """The spin from which a top sleeps at the longest step, and how far all of them are from theory."""
    values: dict[str, Any] = {"sleep_step": float(part["sleeping_step"].max())}
    misses_ = []
    for name, method in methods_of(part).items():
        cell = part.sel(variant=name).dropna("rung", subset=["sleeping_threshold"])
        if method.sleeps_from is not None and cell.sizes["rung"]:
            steps, spins = (cell[key].values for key in ("sleeping_step", "sleeping_threshold"))
            misses_ += [abs(spin - method.sleeps_from(float(h))) for h, spin in zip(steps, spins, strict=True)]
            if split_name(name)[0] in ("strang", "cayley"):
                values[f"{split_name(name)[0]}_sleeps"] = float(spins[-1])
    return values | {"sleep_miss": max(misses_, default=None)}


def separatrix_facts(part: xr.Dataset) -> dict[str, Any]:
    """The error of the prediction from the early error (1/λ), and the variants with runs that last longer."""
    names = ", ".join(f"`{name}`" for name in outlasting(part))
    early = lawful(part) & (part["broken"] > 0.0)
    return {"law_middle": float(pd.Series(misses(part)).median()), "law_runs": misses(part).size,
            "law_early": int(early.sum()), "outlasting": names or None}  # fmt: skip


def sampling_facts(part: xr.Dataset) -> dict[str, Any]:
    """Energy errors sampled once a nutation against true ones, and the solver's part in that of the midpoint rule."""
    hidden, ratios = sampled(part)
    values: dict[str, Any] = {"sampled": len(hidden) + len(ratios), "hidden": len(hidden),
                               "small": sum(ratio > 10.0 for ratio in ratios.values())}  # fmt: skip
    if "plain_energy" in part:
        rule = part.dropna("variant", how="all", subset=["one_iteration_energy"]).isel(variant=0)
        values |= {"one_iteration": float(rule["one_iteration_energy"]),
                  "solved": float(rule["plain_energy"][-1])}  # fmt: skip
    return values


READ = (
    ("grazing", "outcome", pole_facts), ("steady-fast", "third_turn_phase", resonance_facts),
    ("sleeping", "sleeping_threshold", sleeping_facts), ("goldstein", "energy_once", sampling_facts),
    ("separatrix", "horizon", separatrix_facts),
)  # fmt: skip


def tables(data: xr.Dataset) -> dict[str, pd.DataFrame]:
    """Every map in numbers, the largest accurate share first; every limit in numbers."""
    return {"atlas": atlas_table(data), "limits": limits_table(data)}


def atlas_table(data: xr.Dataset) -> pd.DataFrame:
    """A row for each family and variant; steps are in nutation periods."""
    rows: list[dict[str, Any]] = []
    for family in families(data):
        for name, map_ in maps(data, family).items():
            limit = data["linear_limit"].sel(scene=family, variant=name) if "linear_limit" in data else None
            rows.append({
                "variant": name, "scene": family, "set": map_.control.replace("step_size", "step"),
                "accurate (%)": 100.0 * map_.accurate,
                "accurate up to, fast tops": map_.usual_reach["fast"],
                "accurate up to, slow tops": map_.usual_reach["slow"],
                "fails from": map_.failure.setting, "fails mostly by": SAID.get(map_.failure.kind, ""),
                "ended early (%)": 100.0 * map_.early, "wrong without an error (%)": 100.0 * map_.silent,
                "small nutations grow from": None if limit is None else float(limit.min()),
            })  # fmt: skip
    place = {"step": 0, "tolerance": 1, "none": 2}
    table = pd.DataFrame(rows)
    return table if table.empty else table.sort_values(
        ["set", "accurate (%)"], key=lambda column: column.map(place) if column.name == "set" else -column
    )  # fmt: skip


LIMITS = {  # header: scene, variable
    "nutations grow from h omega (rad)": ("steady-fast", "limit_phase"),
    "first window of growth from h omega (rad)": ("steady-fast", "window_start"),
    "h omega of a third of a turn (rad)": ("steady-fast", "third_turn_phase"),
    "displacement survived there (rad)": ("steady-fast", "surviving_at_third_turn"),
    "least I3 w3 that sleeps": ("sleeping", "sleeping_threshold"),
    "energy error (J), every step": ("goldstein", "energy_every"),
    "energy error (J), once a nutation": ("goldstein", "energy_once"),
}


def limits_table(data: xr.Dataset) -> pd.DataFrame:
    """Limits of every fixed-step variant, the least linear limit first; of several step sizes those of the longest."""
    known = {key: limit for key, limit in LIMITS.items() if limit[0] in data["scene"].values and limit[1] in data}
    columns = {
        key: data[name].sel(scene=scene).transpose("variant", ...).values for key, (scene, name) in known.items()
    }
    table = pd.DataFrame({"variant": data["variant"].values.astype(str)} | {
        key: values if values.ndim == 1 else values[:, -1] for key, values in columns.items()
    }).dropna(how="all", subset=list(columns))  # fmt: skip
    first = next(iter(LIMITS))
    return table.sort_values(first, kind="stable") if first in table else table
