"""Facts and tables of the truth study, from its dataset and from the published values."""

from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from symtop.measure.published import TRAJECTORY, published_values

from .measures import BOUND, DIGITS, ERROR, SECONDS, SOURCES, bound_ratios


def facts(data: xr.Dataset) -> dict[str, Any]:
    """How well each source is known (rad), how many bounds hold, and how many published values are met."""
    bounds, broken, ratio = bound_ratios(data)
    published = published_values()
    printed = [value for value in published if value.kind == "printed"]
    worst = at_worst(data, ("double, axis", "double, attitude"))
    return {
        "digits": DIGITS,
        "longest": float(data["horizon"].max()),  # s
        "bounds": bounds or None,
        "bounds_held": bounds - broken if bounds else None,
        "bound_ratio": ratio if bounds else None,  # median of bound over error
        "closed_form": largest(data, ("closed form",)),  # rad, at any time
        "integrated": None if worst is None else float(worst),  # rad, Taylor in double at its worst
        "integrated_after": None if worst is None else float(worst["horizon"]),  # s
        "quadruple": largest(data, ("quadruple, attitude",)),  # rad, its distance from the closed form in 45 digits
        "published": len(published),
        "printed": len(printed),
        "printed_met": sum(value.reproduced for value in printed),
        "printed_trajectory": sum(value.tests == TRAJECTORY for value in printed),
    }


def at_worst(data: xr.Dataset, sources: tuple[str, ...]) -> xr.DataArray | None:
    """The largest error of some sources, with its horizon; None if none of them was measured."""
    names = [name for name in sources if name in data["variant"].values]
    errors = data[ERROR].sel(variant=names).stack(run=("scene", "variant", "horizon")).dropna("run")
    return errors[int(np.argmax(errors.values))] if errors.size else None


def largest(data: xr.Dataset, sources: tuple[str, ...]) -> float | None:
    """The largest error of some sources, rad; None if none of them was measured."""
    worst = at_worst(data, sources)
    return None if worst is None else float(worst)


def tables(data: xr.Dataset) -> dict[str, pd.DataFrame]:
    """Each source at its longest time, the worst first; published values beside ours."""
    rows = []
    for scene, source in product(data["scene"].values, data["variant"].values):
        cell = data.sel(scene=scene, variant=source).dropna("horizon", subset=[ERROR])
        if cell.sizes["horizon"]:
            last = cell.isel(horizon=-1)
            rows.append([scene, source, *(float(last[name]) for name in ("horizon", ERROR, BOUND, SECONDS))])
    header = ["scene", "source", "time (s)", "axis error (rad)", "claimed bound (rad)", "run time (s)"]
    order = {source: place for place, source in enumerate(SOURCES)}
    ends = pd.DataFrame(rows, columns=header).sort_values(
        "source", key=lambda column: column.map(order), kind="stable", ascending=False
    )
    header = ["source", "quantity", "published", "ours", "to the last digit", "kind", "tests"]
    values = pd.DataFrame(
        [[value.source, value.quantity, value.published, value.ours, value.reproduced, value.kind, value.tests]
         for value in published_values()],
        columns=header,
    )  # fmt: skip
    return {"sources": ends, "published": values}
