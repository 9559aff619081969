"""Columns over members as the dataset of an ensemble."""

from typing import Any

import xarray as xr

from symtop.base.over_time import PARTS


def as_dataset(columns: dict[str, Any], labels: dict[str, Any], *, shared: bool | None = None) -> xr.Dataset:
    """Columns (n, ...) and labels (n,) as a dataset; times that all members share are one row.

    `shared` says so where the columns are not those of all members.
    """
    times = columns["time"]
    if shared is None:
        shared = bool((times == times[0]).all())
    parts = [name for name, held in (("component", "axis"), ("part", "quaternion")) if held in columns]
    ends = {"axis": "component", "quaternion": "part"}
    variables = {
        name: (("member", "time", *([ends[name]] if name in ends else []))[: values.ndim], values)
        for name, values in columns.items()
        if name != "time"
    }
    return xr.Dataset(
        {**variables, **{name: ("member", values) for name, values in labels.items()}},
        {
            "time": ("time", times[0]) if shared else (("member", "time"), times),
            **{name: list(PARTS[name]) for name in parts},
        },
    )
