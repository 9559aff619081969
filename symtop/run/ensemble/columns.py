"""Columns over members as the dataset of an ensemble."""

from typing import Any

import numpy as np
import xarray as xr

from symtop.run.trajectory import LABELS


def same_times(times: Any, row: Any) -> bool:
    """Are these times of members (n, samples) all that row? NaN is what both have beyond runs of few steps."""
    if (times == row).all():
        return True
    return bool(np.isnan(row).any() and np.array_equal(times, np.broadcast_to(row, times.shape), equal_nan=True))


def as_dataset(columns: dict[str, Any], labels: dict[str, Any], *, shared: bool | None = None) -> xr.Dataset:
    """Columns (n, ...) and labels (n,) as a dataset; times that all members share are one row.

    `shared` says so where the columns are not those of all members.
    """
    times = columns["time"]
    if shared is None:
        shared = same_times(times, times[0])
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
            **{name: list(LABELS[name]) for name in parts},
        },
    )
