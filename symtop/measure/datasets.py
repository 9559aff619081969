"""Datasets over scene and variant: combined from the datasets of single cases, and compared with each other."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from symtop.core import netcdf
from symtop.core.errors import SymtopError

Combined = xr.Dataset | xr.DataTree  # what a study measured: a tree if its cases are in groups
Cell = tuple[str, str, xr.Dataset]  # a scene, a variant and what was measured

# a variable whose name contains one of these is a measured time, or derived from one
CLOCKED = ("seconds", "reliable", "spread", "first_call", "alone", "together")
PRICES = ("price", "call", "sampled")  # full names of further measured times, taken in a fresh process


def combine(cases: list[tuple[Any, xr.Dataset]]) -> Combined:
    """One dataset over scene and integrator, or, of cases in groups, a tree with such a dataset for each group.

    A dataset of a group covers the scenes and integrators of its own cases only. xarray aligns the coordinates of a
    group with those of the groups above it, so that the root of the tree is empty: all cases are in groups, or none.
    """
    groups: dict[str, list[tuple[Any, xr.Dataset]]] = {}
    for case, data in cases:
        groups.setdefault(case.group, []).append((case, data))
    if not groups.keys() - {""}:
        return _dense(cases)
    if "" in groups:
        raise SymtopError(f"case {groups[''][0][0].label} has no group, but others of its study have one")
    return xr.DataTree.from_dict({group: _dense(members) for group, members in groups.items()})


def _dense(cases: list[tuple[Any, xr.Dataset]]) -> xr.Dataset:
    """One dataset over scene and variant; a cell that was not measured is NaN (a byte 255, a string empty).

    Sizes differ from case to case: each dimension gets the largest one, and a shorter case fills the beginning. A case
    of several variants counts as one for each of them. Two cases may measure different variables of a cell.
    """
    cells: list[Cell] = []
    for case, data in cases:
        if "variant" in data.dims:
            cells += [(case.scene, str(name), data.sel(variant=name, drop=True)) for name in data["variant"].values]
        else:
            cells.append((case.scene, case.integrator, data))
    scenes, methods = (list(dict.fromkeys(names)) for names in list(zip(*cells, strict=True))[:2])
    sizes, coordinates = _coordinates(cells)
    measured: dict[str, dict[tuple[int, int], xr.Variable]] = {}  # by name and index
    for scene, method, data in cells:
        index = scenes.index(scene), methods.index(method)
        for name in map(str, data.data_vars):
            arrays, variable = measured.setdefault(name, {}), data.variables[name]
            if index in arrays:
                words = f"two cases of {method} on {scene} measure {name}, and one would replace the other"
                remedy = "give each a group, or measure all settings in one case, over a dimension of the dataset"
                raise SymtopError(f"{words}: {remedy}")
            if arrays and (axes := next(iter(arrays.values())).dims) != variable.dims:
                words = f"over {axes}, as in other cases, not {variable.dims}"
                raise SymtopError(f"{name} of {method} on {scene} must be {words}")
            arrays[index] = variable
    variables: dict[str, Any] = {}
    for name, arrays in measured.items():
        dims, attributes = next((array.dims, array.attrs) for array in arrays.values())
        shape = len(scenes), len(methods), *(sizes[str(dim)] for dim in dims)
        filled: Any = np.full(shape, *_fill_value([array.dtype for array in arrays.values()]))
        for index, array in arrays.items():
            filled[(*index, *map(slice, array.shape))] = array.values
        variables[name] = ("scene", "variant", *dims), as_text(filled), dict(attributes)
    return xr.Dataset(variables, coords={"scene": scenes, "variant": methods} | coordinates)


def _coordinates(cells: list[Cell]) -> tuple[dict[str, int], dict[str, Any]]:
    """The largest size of each dimension, and its coordinate if it has one; shorter coordinates must begin it."""
    sizes: dict[str, int] = {}
    longest: dict[str, Any] = {}
    for scene, method, data in cells:
        for dim, size in data.sizes.items():
            name = str(dim)
            if name in longest and dim in data.coords:
                shared = min(size, sizes[name])
                if not np.array_equal(data[dim].values[:shared], longest[name].values[:shared]):
                    raise SymtopError(f"the coordinate {name} of {method} on {scene} differs from that of other cases")
            if size > sizes.get(name, 0):
                sizes[name] = size
                if dim in data.coords:
                    longest[name] = data[dim]
    return sizes, longest


def _fill_value(types: "Sequence[np.dtype[Any]]") -> tuple[Any, Any]:
    """The fill value for missing cells of an array of values of those types, and a type that can hold all of them."""
    if any(kind.kind in "OUT" for kind in types):
        return "", object
    kind = np.result_type(*types)
    return (np.iinfo(kind).max, kind) if kind.kind == "u" else (math.nan, kind if kind == np.float32 else float)


def as_text(values: Any) -> Any:
    """An array of Python strings as an array of fixed-width strings, because archives hold no objects."""
    return values.astype(str) if values.dtype == object else values


def differences(stored: Combined, again: Combined, *, attributes: bool = True) -> list[str]:
    """Sentences on how two datasets, or trees of them, differ, except in measured times and provenance."""
    ours, theirs = netcdf.groups(stored), netcdf.groups(again)
    return [f"group {name} is in one of them only" for name in sorted(ours.keys() ^ theirs.keys())] + [
        f"{name}: {difference}" if name else difference
        for name in sorted(ours.keys() & theirs.keys())
        for difference in _differences(ours[name], theirs[name], attributes)
    ]


def _differences(stored: xr.Dataset, new_data: xr.Dataset, attributes: bool) -> list[str]:
    ours, theirs = set(map(str, stored.variables)), set(map(str, new_data.variables))
    sentences = [f"{name} is in one of them only" for name in sorted(ours ^ theirs)]
    for name in sorted(ours & theirs):
        old, new = stored[name], new_data[name]
        if old.dims != new.dims or old.shape != new.shape:
            sentences.append(f"{name} has another shape: {dict(old.sizes)} and {dict(new.sizes)}")
        elif not any(word in name for word in CLOCKED) and not (name in PRICES and old.dtype.kind == "f"):
            numbers = old.dtype.kind == "f" and old.dtype == new.dtype  # equal to the last bit
            if old.values.tobytes() == new.values.tobytes() if numbers else old.equals(new):
                continue
            amount = ""
            if old.dtype.kind == new.dtype.kind == "f":
                with np.errstate(all="ignore"):
                    gap = np.abs(old.values - new.values)
                finite = np.isfinite(gap).any()
                amount = f" by up to {np.nanmax(gap):.3g}" if finite else " in which values are NaN"
            sentences.append(f"{name} differs{amount}")
    for key in sorted({*stored.attrs, *new_data.attrs} - {*netcdf.provenance(), "content"}) if attributes else []:
        before, after = stored.attrs.get(key), new_data.attrs.get(key)
        if before != after and not key.startswith("timed_"):
            sentences.append(f"attribute {key} differs: {before!r} and {after!r}")
    return sentences
