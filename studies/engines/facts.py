"""Facts and tables of the study of engines: what each map does on two tops and on the population."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from symtop.methods.framework.registry import integrator, split_name
from symtop.model.scenes import scene

from .measures import BODIES, FREQUENCIES, HORIZON, SCENES

SLOW, FAST = SCENES
BETWEEN = (400.0, 3000.0)  # steps a nutation that the measured order is taken between
NEAR = 5.0  # degrees: a top of the population counts as followed if the error at the end is below this
USUAL = 240.0  # steps a second, the usual rate, for which numbers are quoted
KEPT = 0.01  # limit on the relative change of a kept energy or spin in the long run
ROUNDING = 1e-12  # rad: smaller errors are dominated by rounding
LOST = 1.0  # rad: with a larger error the direction of the axis is lost
WORSE = 1.5  # the shortest step is worse than a longer one if its error is above this many times the least
BESIDE = "strang[axis]"  # quoted beside the maps of engines


def read(data: xr.DataTree, group: str, variable: str, **at: Any) -> np.ndarray:
    """Values at some coordinates; NaN where none were measured."""
    try:
        return np.asarray(data[group][variable].sel(at).values)
    except KeyError:
        return np.array(math.nan)


def curve(data: xr.DataTree, variant: str) -> tuple[np.ndarray, np.ndarray]:
    """Steps a nutation on the slow top, and the axis error (rad) there."""
    error = read(data, "tops", "axis", scene=SLOW, variant=variant)
    good = np.isfinite(error)
    return (data["tops"]["per_nutation"].values[good], error[good]) if good.any() else (np.empty(0), np.empty(0))


def slope(count: np.ndarray, error: np.ndarray) -> float:
    """The power of the step that an error follows; NaN from fewer than two."""
    return -float(np.polyfit(np.log(count), np.log(error), 1)[0]) if np.size(error) > 1 else math.nan


def long_time(data: xr.DataTree) -> float:
    """The longer of the two horizons (s)."""
    return float(np.max(data["tops"]["horizon"].values)) if "tops" in data.children else math.nan


def frame(data: xr.DataTree, variable: str, variant: str, scene: str = SLOW, *, long: bool = False) -> float:
    """A variable at the usual rate of steps, or of evaluations, a second, after the short time or the `long` one."""
    horizon = long_time(data) if long else HORIZON
    return float(read(data, "tops", variable, scene=scene, variant=variant, rate=USUAL, horizon=horizon))


def lines(data: xr.DataTree) -> pd.DataFrame:
    """One row for each variant, by name; errors in rad, `share` of followed tops, `group` the order of its map."""
    groups = (group for key, group in data.children.items() if key != "bodies")
    names = dict.fromkeys(str(name) for group in groups for name in group["variant"].values)
    table = pd.DataFrame(_lines(data, names or {BESIDE: None})).set_index("variant", drop=False)
    return table if names else table.iloc[:0]


def _lines(data: xr.DataTree, names: dict[str, None]) -> Iterator[dict[str, Any]]:
    for name in names:
        entry, (count, error) = integrator(name), curve(data, name)
        part = (count > BETWEEN[0]) & (count < BETWEEN[1]) & (error > ROUNDING)
        order, least = slope(count[part], error[part]), int(np.argmin(error)) if error.size else None
        single, term = entry.precision == "single", not split_name(name)[0].startswith("no-gyro")
        angles = np.degrees(read(data, "population", "off", scene="population", variant=name))
        yield {
            "variant": name, "summary": entry.summary, "engine": entry.family == "engine", "single": single,
            "term": term, "order": order, "group": 0.0 if not term else 1.0 if single else max(1.0, np.round(order)),
            "best": math.nan if least is None else error[least],
            "best_count": math.nan if least is None else count[least],
            "last": math.nan if least is None else error[-1],
            "slow": frame(data, "frame_axis", name), "fast": frame(data, "frame_axis", name, FAST),
            "slow_level": frame(data, "level_axis", name), "fast_level": frame(data, "level_axis", name, FAST),
            "energy": frame(data, "frame_energy", name, long=True), "spin": frame(data, "frame_spin", name, long=True),
            "spherical": frame(data, "frame_spherical", name),
            "share": math.nan if np.isnan(angles).any() else np.mean(angles <= NEAR),
        }  # fmt: skip


def on_bodies(data: xr.DataTree) -> pd.DataFrame:
    """One row for each variant: largest attitude errors (rad) on each free body at each rate; order; engine or not."""
    names = [str(name) for name in data["bodies"]["variant"].values] if "bodies" in data.children else []
    table = pd.DataFrame(index=pd.Index(names, name="variant"))
    entries = [integrator(name) for name in names]
    table["order"] = [0.0 if row.method.startswith("no-gyro") else float(row.order or math.nan) for row in entries]
    table["engine"] = [row.family == "engine" and row.precision == "double" for row in entries]
    for body in BODIES:
        for rate in FREQUENCIES:
            table[f"{body}, 1/{rate:g} s"] = [
                float(read(data, "bodies", "attitude", scene=body, variant=name, rate=rate)) for name in names
            ]
    return table


def facts(data: xr.DataTree) -> dict[str, Any]:
    """The best and the worst maps, at equal steps and equal cost; the effect of the gyroscopic term. Errors in rad."""
    table = lines(data)
    maps = table[table["engine"] & ~table["single"]]
    with_term, without_term = maps[maps["term"]], maps[~maps["term"]]
    floors = table[table["single"] & table["term"]]["best"]
    reference = table.loc[BESIDE] if BESIDE in table.index else dict.fromkeys(table.columns)
    members = read(data, "population", "steps_a_nutation")
    bodies = on_bodies(data)
    racket, case = (bodies[bodies["engine"] & (bodies["order"] > 0)][f"{body}, 1/{USUAL:g} s"] for body in BODIES)
    still = bodies[bodies["engine"] & (bodies["order"] == 0)][[f"{BODIES[1]}, 1/{rate:g} s" for rate in FREQUENCIES]]
    long = {name: maps[name].abs()[maps["slow"].notna()] for name in ("energy", "spin")}
    numbers: dict[str, Any] = {
        "slow": SLOW, "fast": FAST, "fast_nutation": scene(FAST).nutation_period,  # s
        "beside": BESIDE, "beside_fast_level": reference["fast_level"], "beside_share": reference["share"],
        "near": NEAR, "usual": USUAL, "short": HORIZON, "long": long_time(data),  # s
        "maps": len(maps) or None,  # of engines, in double precision
        "members": members.shape[-1] if members.ndim else None,
        "wall": without_term["best"].min(),  # without the term, at any step
        "spherical": without_term["spherical"].max(),  # from the spherical top, which they follow
        "share_least": maps["share"].min(), "share_most": maps["share"].max(),
        "singles": floors.count() or None, "single_best": floors.min(),
        "lost": int((with_term["fast_level"] > LOST).sum()) if with_term["fast_level"].notna().any() else None,
        "racket": BODIES[0], "case": BODIES[1], "body_maps": int(case.count()) or None,
        "racket_best": racket.min(), "racket_worst": racket.max(),
        "case_best": case.min(), "case_worst": case.max(), "case_wall": still.min(axis=None),
        "case_best_variant": case.idxmin() if case.count() else None,
        "case_worst_variant": case.idxmax() if case.count() else None,
        "turned": len(with_term) or None,  # maps with the term
        "lacking": len(without_term), "in_single": int((table["engine"] & table["single"]).sum()),
        "every": int(table["engine"].sum()) or None,
        "limit": LOST, "kept": KEPT,
        # a run that ended early has no energy or spin
        **{f"{name}_lost": int((~(sizes <= KEPT)).sum()) if len(sizes) else None for name, sizes in long.items()},
    }  # fmt: skip
    for name, values, pick in (("best", with_term["slow"], "min"), ("worst", with_term["slow"], "max"),
                               ("level_fast", maps["fast_level"], "min")):  # fmt: skip
        known = values.dropna()
        numbers |= {
            name: getattr(known, pick)(),
            f"{name}_variant": getattr(known, f"idx{pick}")() if len(known) else None,
        }
    return numbers


def tables(data: xr.DataTree) -> dict[str, pd.DataFrame]:
    """Errors by the order of a map; every map at the usual step; errors on free bodies."""
    table = lines(data).sort_values("slow", kind="stable")
    groups = table[table["engine"] & ~table["single"]].groupby("group")
    columns = {"slow": f"error on {SLOW} (rad)", "fast": f"error on {FAST} (rad)", "share": "share of tops followed"}
    ranges = groups[list(columns)].agg(["min", "max"])
    ranges.columns = pd.Index([f"{columns[name]}, {'least' if pick == 'min' else 'most'}" for name, pick in ranges])
    orders = ranges.assign(maps=groups.size()).rename_axis("measured order").reset_index()
    names = {
        "variant": "variant", "summary": "what it is", "order": "measured order", "slow": columns["slow"],
        "fast": columns["fast"], "share": columns["share"], "best": "least error (rad)",
        "best_count": "at steps a nutation", "last": "error at the most steps (rad)",
        "energy": f"energy, {long_time(data):g} s", "spin": f"spin, {long_time(data):g} s",
        "spherical": "off the spherical top (rad)",
    }  # fmt: skip
    bodies = on_bodies(data).drop(columns="engine").reset_index().rename(columns={"order": "declared order"})
    bodies = bodies.sort_values(f"{BODIES[1]}, 1/{USUAL:g} s", kind="stable")
    return {
        "bodies": bodies,
        "orders": orders[["measured order", "maps", *ranges.columns]],
        "maps": table[list(names)].rename(columns=names),
    }
