"""The five methods that every reader knows, and what they pay for one accuracy.

Apart from `tables`, which cases are made with: what is only said of them makes no case stale.
"""

from collections.abc import Mapping

import numpy as np
import xarray as xr

from symtop.methods.framework.registry import split_name

from .tables import MAIN, NAMED, evaluations_a_nutation, merged

TARGET = 1e-6  # rad, the axis error at which costs are compared


def named_variants(data: xr.Dataset) -> tuple[xr.Dataset, dict[str, str]]:
    """The five named methods on the first scene, without a chart that another covers, and their labels."""
    named = [name for name in map(str, data["variant"].values) if split_name(name)[0] in NAMED]
    names = [name for name in named if name.replace("[attitude]", "[axis]") not in named or "[attitude]" not in name]
    return data.sel(variant=names).isel(scene=0), merged(data.sel(variant=names), MAIN)


def least_work(part: xr.Dataset, labels: Mapping[str, str]) -> list[tuple[str, float]]:
    """What each variant pays for an error below `TARGET`: force evaluations per nutation, the least first.

    `part` is one scene.
    """
    paid, scene = {}, str(part["scene"].values)
    for name in labels:
        cell = part.sel(variant=name)
        work = evaluations_a_nutation(cell, scene)[cell[MAIN].values <= TARGET]
        if work.size:
            paid[name] = float(np.min(work))
    return sorted(paid.items(), key=lambda one: one[1])
