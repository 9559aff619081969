"""Read and check the members of an ensemble, tops or bodies, from a dataset or scenes, as rows of numbers."""

import difflib
import re
from collections.abc import Iterable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray

from symtop.core import netcdf
from symtop.core.errors import SymtopError, positive, shown
from symtop.model.body import PARTS, from_flat
from symtop.model.charts import BODY, Array
from symtop.model.exact.closed_form import checked_numbers
from symtop.model.scenes import OBSERVABLES, Scene, scene
from symtop.model.top import NUMBERS, flat
from symtop.run.trajectory import column

TOP = dict.fromkeys(NUMBERS, 1)
NEEDED = {"nine": NUMBERS[:4], "14": ("I1", "I2", "I3", "omega_body")}  # required variables; others default to 0 or to
DEFAULTS = {"centre": (0.0, 0.0, 1.0), "quaternion": (1.0, 0.0, 0.0, 0.0)}
KNOWN_NAMES = {*netcdf.VARIABLES, "scene", "member", "period"}  # never taken for misspelled ones
SIMILARITY = 0.8  # of a name that is taken for a misspelled one: thetadot and theta0, not p_phi and theta_max
RATE = re.compile(r"(d|v|w|omega)_?(theta|phi|psi)(_?d?t)?|(theta|phi|psi)_?(d|dt|t|prime|rate|speed|vel|velocity)")
UNNAMED = "dim_0"  # xarray's name for an unnamed dimension


class Members(NamedTuple):
    """Tops or bodies and their starts, with the horizons, labels and units that come with them."""

    numbers: Array  # (n, 9) with the columns `NUMBERS`, or (n, 14) with those of `RigidBody.flat`
    horizon: Array | None  # (n,) of scenes; None for a dataset
    observes: str  # the smallest observable that covers the default one of every scene
    units: str  # "SI", or empty
    labels: dict[str, NDArray[Any]]  # names of scenes, or strata, and the coordinate ``member`` if there is one: (n,)

    @property
    def names(self) -> NDArray[Any] | None:
        """The labels of the members, or None."""
        return self.labels.get("member")


def read_members(members: xr.Dataset | Iterable[str | Scene]) -> Members:
    """Members from a dataset over ``member`` (scalars apply to all) or from scenes or their names.

    A dataset with ``I2`` is of bodies, as `symtop.body_population` makes them. Raises SymtopError for a variable that
    is missing, has another dimension or seems misspelled, for tops together with bodies, and for invalid members, with
    their label or number.
    """
    if isinstance(members, xr.Dataset):
        return _from_dataset(members)
    iterable = isinstance(members, Iterable) and getattr(members, "shape", True) != ()
    if isinstance(members, (str, bytes, Scene)) or not iterable:
        raise SymtopError(f"members must be a dataset or a list of scenes, not {shown(members)}")
    tables = type(members).__module__.startswith("pandas")
    if tables or isinstance(members, (dict, xr.DataArray)):  # iterating over these gives names or numbers
        raise SymtopError(f"members must be an xarray.Dataset or a list of scenes, not a {type(members).__name__}")
    scenes = [scene(entry, bodies=True) for entry in members]
    if not scenes:
        raise SymtopError("members must be at least one")
    if len({entry.of_body for entry in scenes}) > 1:
        raise SymtopError("members must be all tops or all bodies without symmetry, not some of each")
    numbers = np.array([flat(entry.top, entry.start) for entry in scenes])
    horizons, names = (np.array([getattr(entry, name) for entry in scenes]) for name in ("horizon", "name"))
    observes = max((entry.observes for entry in scenes), key=(*OBSERVABLES, BODY).index)
    units = "SI" if all(entry.units == "SI" for entry in scenes) else ""
    return Members(numbers, horizons, observes, units, {"scene": names})


def _from_dataset(data: xr.Dataset) -> Members:
    parts, count, observes = (PARTS, "14", BODY) if "I2" in data else (TOP, "nine", "axis")
    missing = [name for name in NEEDED[count] if name not in data]
    if missing:
        words = f"{', '.join(NEEDED[count])}, not lack {', '.join(missing)}"
        raise SymtopError(f"members must have the variables {words}")
    n = data.sizes.get("member", 1)
    if n == 0:
        raise SymtopError("members must be at least one")
    columns = []
    for name, width in parts.items():
        part = np.broadcast_to(np.reshape(DEFAULTS.get(name, 0.0), (1, -1)), (n, width))
        if name in data:
            values, vector = column(data, name), width > 1
            axes = values.dims[:-1] if vector else values.dims
            fits = not vector or values.shape[-1:] == (width,)
            if axes not in ((), ("member",)) or values.dtype.kind not in "fiu" or not fits:
                actual = f"{values.dtype} {values.shape} over {', '.join(map(str, values.dims)) or 'nothing'}"
                required = f"rows of {width} numbers" if vector else "numbers"
                raise SymtopError(f"{name} of members must be {required} over member, or one for all, not {actual}")
            part = np.broadcast_to(values.to_numpy().reshape(-1, width), (n, width))
        columns.append(part)
    numbers = np.concatenate(columns, axis=1, dtype=float)
    _check_names(data, parts)
    label_names = [name for name in ("scene", "stratum") if name in data]
    for name in label_names:
        if data[name].dims not in ((), ("member",)):
            dims = ", ".join(map(str, data[name].dims))
            raise SymtopError(f"{name} of members must be names over member, or one for all, not over {dims}")
    labels = {name: np.broadcast_to(data[name].to_numpy().astype(str, copy=False), n) for name in label_names}
    if "member" in data.indexes and "member" in data.dims:
        labels["member"] = _plain(data.indexes["member"])
    check = _checked_bodies if observes == BODY else checked_numbers
    return Members(check(numbers, labels.get("member")), None, observes, str(data.attrs.get("units", "")), labels)


def _checked_bodies(numbers: Array, names: NDArray[Any] | None) -> Array:
    """The rows of bodies and starts, checked, with directions scaled to length one."""
    for i, row in enumerate(numbers.tolist()):
        try:
            top, start = from_flat(row)
            numbers[i] = replace(top).flat(replace(start))  # `replace` checks their values
        except SymtopError as error:
            raise SymtopError(f"{member_name(names, i)}: {error}") from None
    return numbers


def _check_names(data: xr.Dataset, parts: dict[str, int]) -> None:
    """SymtopError for a variable whose name seems a misspelling of one in `parts`, or another word for a rate."""
    by_lower = {name.lower(): name for name in parts}
    for name in (name for name in map(str, data.variables) if name not in parts and name not in KNOWN_NAMES):
        near = [by_lower[match] for match in difflib.get_close_matches(name.lower(), by_lower, n=1, cutoff=SIMILARITY)]
        if parts is TOP and (rate := RATE.fullmatch(name.lower())) is not None:
            near = [f"{rate[2] or rate[4]}_dot"]
        if near:
            raise SymtopError(f"members have no variable {name!r}; did you mean {near[0]}?")


def refuse_others(members: Members, runs: xr.Dataset) -> None:
    """SymtopError for members that are not those of the ensemble `runs`, by their number or their labels."""
    if len(members.numbers) != (n := runs.sizes["member"]):
        raise SymtopError(f"members must be the {n} of the ensemble, not {len(members.numbers)}")
    stored = {name: row.to_numpy() for name, row in runs.variables.items() if row.dims == ("member",)}
    for name, labels in members.labels.items():
        if name in stored and [*map(str, labels)] != [*map(str, stored[name])]:
            words = "names" if name == "scene" else "strata" if name == "stratum" else "labels"
            raise SymtopError(f"members must be those of the ensemble in their order, and their {words} are others")


def _plain(index: Any) -> NDArray[Any]:
    """Labels that a netCDF file can hold: numbers as they are, anything else as text."""
    values = index.to_numpy()
    return values if values.dtype.kind in "iuf" else np.array([str(label) for label in values])


def member_name(names: NDArray[Any] | None, i: int) -> str:
    """The name of a member in messages: "member" and its label, or its number if there are no labels."""
    return f"member {i if names is None else names[i]}"


def _aligned(name: str, value: xr.DataArray, n: int, names: NDArray[Any] | None) -> xr.DataArray:
    """`value` in the order of the members, by label where both have labels; SymtopError if it does not fit them."""
    if value.dims not in ((), ("member",), (UNNAMED,)):
        raise SymtopError(f"{name} must be one number or a row over member, not over {', '.join(map(str, value.dims))}")
    if names is None or value.dims != ("member",) or "member" not in value.indexes:
        return value
    labels = pd.Index(_plain(value.indexes["member"]))
    if labels.equals(pd.Index(names)):
        return value
    if len(labels) != n or not labels.is_unique or not labels.isin(names).all():
        raise SymtopError(f"{name} must have the labels of the {n} members, each once, not others along member")
    return value.isel(member=labels.get_indexer(names))


def for_each(name: str, value: object, n: int, names: NDArray[Any] | None = None) -> Array:
    """A positive number for each of n members (n,), from one for all (then read-only) or a row, ordered by `names`."""
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
        positive(f"{name} of {member_name(names, bad[0])}", row[bad[0]])
    return row
