"""Who takes part in an ensemble: rows of nine numbers, read from a dataset or from scenes, and refused by number."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from symtop.base.validate import SymtopError, positive, shown
from symtop.model.closed_forms import NUMBERS, checked
from symtop.model.scenes import OBSERVABLES, Scene, scene
from symtop.model.top import flat

Array = NDArray[np.float64]

NEEDED = NUMBERS[:4]  # the others are zero where nobody gives them, as in `Angles`


class Members(NamedTuple):
    """Tops and starts, and what else is known of them."""

    numbers: Array  # (n, 9), columns as `NUMBERS`
    horizon: Array | None  # (n,) of scenes; None where nobody has said it
    observes: str  # the smallest observable that shows what every scene is watched for
    units: str  # "SI", or empty
    labels: dict[str, NDArray[np.str_]]  # names of scenes, or strata: (n,)


def read_members(given: "xr.Dataset | Iterable[str | Scene]") -> Members:
    """Members from a dataset over ``member`` (scalars count for all) or from scenes or their names.

    Raises SymtopError for a variable that is missing or has another dimension, and for members that are no top or no
    start: by number and reason.
    """
    if isinstance(given, xr.Dataset):
        return _from_dataset(given)
    if isinstance(given, (str, bytes, Scene)) or not isinstance(given, Iterable):
        raise SymtopError(f"members must be a dataset or a list of scenes, not {shown(given)}")
    try:
        chosen = [scene(entry) for entry in given]
    except TypeError:  # an array without dimensions
        raise SymtopError(f"members must be a dataset or a list of scenes, not {shown(given)}") from None
    if not chosen:
        raise SymtopError("members must be at least one")
    names = np.array([entry.name for entry in chosen])
    return Members(
        np.array([flat(entry.top, entry.start) for entry in chosen]),
        np.array([entry.horizon for entry in chosen]),
        max((entry.observes for entry in chosen), key=OBSERVABLES.index),
        "SI" if all(entry.units == "SI" for entry in chosen) else "",
        {"scene": names},
    )


def _from_dataset(data: xr.Dataset) -> Members:
    missing = [name for name in NEEDED if name not in data]
    if missing:
        raise SymtopError(f"members must have the variables {', '.join(NEEDED)}, not lack {', '.join(missing)}")
    n = data.sizes.get("member", 1)
    if n == 0:
        raise SymtopError("members must be at least one")
    numbers = np.zeros((n, len(NUMBERS)))
    for column, name in enumerate(NUMBERS):
        if name in data:
            if data[name].dims not in ((), ("member",)) or data[name].dtype.kind not in "fiu":
                raise SymtopError(
                    f"{name} of members must be numbers over member, or one for all, not {data[name].dtype} "
                    f"over {', '.join(map(str, data[name].dims)) or 'nothing'}"
                )
            numbers[:, column] = data[name].values
    labels = {
        name: np.broadcast_to(data[name].values.astype(str, copy=False), n)
        for name in ("scene", "stratum")
        if name in data
    }
    return Members(checked(numbers), None, "axis", str(data.attrs.get("units", "")), labels)


def for_each(name: str, value: object, n: int) -> Array:
    """A number above zero for each of n members, of one for all or of a row of them; read-only where it is one."""
    array = np.asarray(value) if isinstance(value, (xr.DataArray, np.ndarray, list, tuple)) else None
    if array is None or array.ndim == 0:
        return np.broadcast_to(positive(name, value if array is None else array.item()), n)
    if array.shape != (n,) or array.dtype.kind not in "fiu":
        raise SymtopError(f"{name} must be one number or one for each of {n} members, not {array.dtype} {array.shape}")
    row = array.astype(float)
    bad = np.flatnonzero(~(np.isfinite(row) & (row > 0.0)))
    if bad.size:
        positive(f"{name} of member {bad[0]}", row[bad[0]])
    return row
