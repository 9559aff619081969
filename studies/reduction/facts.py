"""Facts and tables of the reduction study, from its dataset."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from .measures import CHART_PERIODS, COMMUTES, COMPARED_STEPS, GAPS, chart_ratios, commutation_order

RATIO = "time to the same error (ratio)"
WORST = "largest difference (rad)"
AS_FAST = 1.1  # times with a ratio up to this are equal within their noise


def cells(data: xr.Dataset, variable: str) -> list[tuple[str, str, xr.Dataset]]:
    """Scene, integrator and data of the cells in which a variable was measured."""
    if variable not in data:
        return []
    known = np.isfinite(data[variable]).any([dim for dim in data[variable].dims if dim not in ("scene", "variant")])
    return [
        (str(scene), str(name), data.sel(scene=scene, variant=name))
        for scene in data["scene"].values
        for name in data["variant"].values
        if known.sel(scene=scene, variant=name)
    ]


def facts(data: xr.Dataset) -> dict[str, Any]:
    """Which rules commute with the reduction (rad), how far an unreduced form is from its kernel, times of charts."""
    gaps, kernels, charts = tables(data).values()
    compared = cells(data, "theta_gap")
    same, apart = (gaps[(gaps[WORST] < COMMUTES) == commutes] for commutes in (True, False))
    ends = {"least": apart["power of h"].min(), "most": apart["power of h"].max()}
    return {
        "charts_periods": CHART_PERIODS,  # nutations
        "compared_steps": COMPARED_STEPS,
        "as_fast": AS_FAST - 1.0,
        "spread": float(data["spread"].median()) if "spread" in data else None,
        **{f"{chart}_{key}": fact for chart in ("angles", "attitude") for key, fact in against(charts, chart).items()},
        "commuting": listed(same["rule"]),
        "commuting_gap": same[WORST].max(),
        "others": listed(apart["rule"]),
        **{f"power_{word}": end for word, end in ends.items()},
        **{f"{word}_rules": listed(apart["rule"][apart["power of h"].round() == np.round(end)])
           for word, end in ends.items()},
        "rules": listed(name for _, name, _ in compared),
        "twins_gap": max((float(cell[gap].max()) for *_, cell in compared for gap in GAPS), default=None),
        "step_least": kernels["time (ratio)"].min(), "step_most": kernels["time (ratio)"].max(),
        "iterations_least": kernels["iterations (ratio)"].min(), "iterations_most": kernels["iterations (ratio)"].max(),
    }  # fmt: skip


def against(charts: pd.DataFrame, chart: str) -> dict[str, Any]:
    """Of the methods in a chart and on the axis: the ratios of their times to the same error, as `charts` is sorted."""
    rows = charts[charts["variant"].str.endswith(f"[{chart}]") & (charts["against"] == "axis")].dropna(subset=RATIO)
    ratio = rows[RATIO]
    longer, shorter = int((ratio > AS_FAST).sum()), int((ratio < 1.0 / AS_FAST).sum())
    return {"count": len(rows) or None, "median": ratio.median(), "longer": longer, "shorter": shorter,
            "most": ratio.max(), "slowest": listed(rows["variant"][:1])}  # fmt: skip


def listed(names: Iterable[str]) -> str | None:
    """Names, each once."""
    return ", ".join(dict.fromkeys(names)) or None


def commutation(data: xr.Dataset) -> pd.DataFrame:
    """The difference between reducing first and last, by scene and rule; no power of h where it is rounding."""
    rows = []
    for scene, rule, cell in cells(data, "commutation_gap"):
        gap, worst = cell["commutation_gap"].dropna("commutation_step").values, float(cell["commutation_gap"].max())
        power = None if worst < COMMUTES else commutation_order(cell)
        rows.append([scene, rule, power, worst, gap[-1], float(cell["commutation_step_size"].max())])
    header = ["scene", "rule", "power of h", WORST, "at the finest step (rad)", "coarsest step (s)"]
    return pd.DataFrame(rows, columns=header).astype({"power of h": float})


def tables(data: xr.Dataset) -> dict[str, pd.DataFrame]:
    """Reducing first or last; kernels and their unreduced forms at each step; every other chart against the axis."""
    kernels, charts = [], []
    for scene, rule, cell in cells(data, "seconds_per_step"):
        for step in range(cell.sizes["twin_step"]):
            row = cell.isel(twin_step=step)
            seconds, counts = (row[name].sel(kernel=["reduced", "unreduced"]).values
                             for name in ("seconds_per_step", "iterations_per_step"))  # fmt: skip
            time, work = seconds[1] / seconds[0], counts[1] / counts[0]
            kernels.append([scene, rule, float(row["twin_step_size"]), time, work, time / work, *seconds, *counts])
    for scene, method, cell in cells(data, "seconds"):
        for ratio in chart_ratios(cell):
            name = f"{method}[{ratio.chart}]"
            charts.append([scene, name, ratio.base, ratio.time, ratio.error, ratio.to_error])
    header = ["scene", "rule", "step (s)", "time (ratio)", "iterations (ratio)", "time of an iteration (ratio)",
              "a step, reduced (s)", "unreduced (s)", "iterations a step, reduced", "unreduced"]  # fmt: skip
    columns = ["scene", "variant", "against", "time (ratio)", "axis error (ratio)", RATIO]
    return {
        "commutation": commutation(data),
        "kernels": pd.DataFrame(kernels, columns=header),
        "charts": pd.DataFrame(charts, columns=columns).sort_values(RATIO, ascending=False, kind="stable"),
    }
