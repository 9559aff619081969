"""Who takes part in an ensemble: rows of nine numbers, read from a dataset or from scenes, and refused by number."""

import difflib
import re
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from symtop.core import netcdf
from symtop.core.errors import SymtopError, positive, shown
from symtop.model.exact.closed_form import checked_numbers
from symtop.model.scenes import OBSERVABLES, Scene, scene
from symtop.model.top import NUMBERS, flat

Array = NDArray[np.float64]

NEEDED = NUMBERS[:4]  # the others are zero where nobody gives them, as in `Angles`
WRITTEN = {*netcdf.VARIABLES, "scene", "member", "period"}  # names that symtop gives, which no one misspells
NEAR = 0.8  # likeness of a name that is taken for a misspelled one: thetadot and theta0, not p_phi and theta_max
RATE = re.compile(r"(d|v|w|omega)_?(theta|phi|psi)(_?d?t)?|(theta|phi|psi)_?(d|dt|t|prime|rate|speed|vel|velocity)")
UNNAMED = "dim_0"  # what xarray calls a dimension that nobody has named


class Members(NamedTuple):
    """Tops and starts, and what else is known of them."""

    numbers: Array  # (n, 9), columns as `NUMBERS`
    horizon: Array | None  # (n,) of scenes; None where nobody has said it
    observes: str  # the smallest observable that shows what every scene is watched for
    units: str  # "SI", or empty
    labels: dict[str, NDArray[Any]]  # names of scenes, or strata, and the coordinate ``member`` if there is one: (n,)

    @property
    def names(self) -> NDArray[Any] | None:
        """What members are called, where they have labels."""
        return self.labels.get("member")


def read_members(given: "xr.Dataset | Iterable[str | Scene]") -> Members:
    """Members from a dataset over ``member`` (scalars count for all) or from scenes or their names.

    Raises SymtopError for a variable that is missing or has another dimension, for one that looks like a misspelled one
    of the nine, and for members that are no top or no start: by label or number, and reason.
    """
    if isinstance(given, xr.Dataset):
        return _from_dataset(given)
    if isinstance(given, (str, bytes, Scene)) or not isinstance(given, Iterable):
        raise SymtopError(f"members must be a dataset or a list of scenes, not {shown(given)}")
    tables = type(given).__module__.startswith("pandas")
    if tables or isinstance(given, (dict, xr.DataArray)):  # which go through their names or numbers
        raise SymtopError(f"members must be an xarray.Dataset or a list of scenes, not a {type(given).__name__}")
    try:
        chosen = [scene(entry) for entry in given]
    except TypeError:  # an array without dimensions
        raise SymtopError(f"members must be a dataset or a list of scenes, not {shown(given)}") from None
    if not chosen:
        raise SymtopError("members must be at least one")
    numbers = np.array([flat(entry.top, entry.start) for entry in chosen])
    horizons, names = (np.array([getattr(entry, name) for entry in chosen]) for name in ("horizon", "name"))
    observes = max((entry.observes for entry in chosen), key=OBSERVABLES.index)
    units = "SI" if all(entry.units == "SI" for entry in chosen) else ""
    return Members(numbers, horizons, observes, units, {"scene": names})


def _from_dataset(data: xr.Dataset) -> Members:
    missing = [name for name in NEEDED if name not in data]
    if missing:
        raise SymtopError(f"members must have the variables {', '.join(NEEDED)}, not lack {', '.join(missing)}")
    n = data.sizes.get("member", 1)
    if n == 0:
        raise SymtopError("members must be at least one")
    numbers = np.zeros((n, len(NUMBERS)))
    for name in NUMBERS:
        if name in data:
            if data[name].dims not in ((), ("member",)) or data[name].dtype.kind not in "fiu":
                over = f"{data[name].dtype} over {', '.join(map(str, data[name].dims)) or 'nothing'}"
                raise SymtopError(f"{name} of members must be numbers over member, or one for all, not {over}")
            numbers[:, NUMBERS.index(name)] = data[name].values
    _check_names(data)
    named = [name for name in ("scene", "stratum") if name in data]
    labels = {name: np.broadcast_to(data[name].values.astype(str, copy=False), n) for name in named}
    if "member" in data.indexes and "member" in data.dims:
        labels["member"] = _plain(data.indexes["member"])
    numbers, units = checked_numbers(numbers, labels.get("member")), str(data.attrs.get("units", ""))
    return Members(numbers, None, "axis", units, labels)


def _check_names(data: xr.Dataset) -> None:
    """Refuse a variable that looks like one of the nine, in case, letters, underscores or another word for a rate."""
    known = {name.lower(): name for name in NUMBERS}
    for name in (name for name in map(str, data.variables) if name not in NUMBERS and name not in WRITTEN):
        near = [known[like] for like in difflib.get_close_matches(name.lower(), known, n=1, cutoff=NEAR)]
        if (rate := RATE.fullmatch(name.lower())) is not None:
            near = [f"{rate[2] or rate[4]}_dot"]
        if near:
            raise SymtopError(f"members have no variable {name!r}; did you mean {near[0]}?")


def _plain(index: Any) -> NDArray[Any]:
    """Labels that a netCDF file can hold: numbers as they are, anything else as text."""
    values = index.to_numpy()
    return values if values.dtype.kind in "iuf" else np.array([str(label) for label in values])


def called(names: NDArray[Any] | None, i: int) -> str:
    """A member in a sentence: by its label where it has one, otherwise by its number."""
    return f"member {i if names is None else names[i]}"


def _aligned(name: str, value: xr.DataArray, n: int, names: NDArray[Any] | None) -> xr.DataArray:
    """A row in the order of the members, by label where both have labels."""
    if value.dims not in ((), ("member",), (UNNAMED,)):
        raise SymtopError(f"{name} must be one number or a row over member, not over {', '.join(map(str, value.dims))}")
    if names is None or value.dims != ("member",) or "member" not in value.indexes:
        return value
    given, wanted = _plain(value.indexes["member"]), names
    if np.array_equal(given, wanted):
        return value
    places = {label: place for place, label in enumerate(given.tolist())}
    if len(places) < len(given) or len(given) != n or places.keys() != {*wanted.tolist()}:
        raise SymtopError(f"{name} must have the labels of the {n} members, each once, not others along member")
    return value.isel(member=[places[label] for label in wanted.tolist()])


def for_each(name: str, value: object, n: int, names: NDArray[Any] | None = None) -> Array:
    """A number above zero for each of n members, of one for all (then read-only) or of a row of them, by `names`."""
    if np.ma.is_masked(value):
        raise SymtopError(f"{name} must be numbers without a mask, not a masked array: what is masked has no value")
    if isinstance(value, xr.DataArray):
        value = _aligned(name, value, n, names)
    array = np.asarray(value) if isinstance(value, (xr.DataArray, np.ndarray, list, tuple)) else None
    if array is None or array.ndim == 0:
        return np.broadcast_to(positive(name, value if array is None else array.item()), n)
    if array.shape != (n,) or array.dtype.kind not in "fiu":
        raise SymtopError(f"{name} must be one number or one for each of {n} members, not {array.dtype} {array.shape}")
    row = array.astype(float)
    bad = np.flatnonzero(~(np.isfinite(row) & (row > 0.0)))
    if bad.size:
        positive(f"{name} of {called(names, bad[0])}", row[bad[0]])
    return row
