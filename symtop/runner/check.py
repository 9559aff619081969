"""Compares stored results with what this version computes: cases are computed again in another folder.

All but the measured times must agree to the last bit: nothing here is random and no file holds a date. `CLOCKED` names
the variables that are times or made from them.
"""

import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.core import netcdf
from symtop.runner import store
from symtop.runner.cases import StudyCases
from symtop.runner.execute_case import ATTRIBUTES
from symtop.runner.pool import Pool
from symtop.runner.study import Combined, Study

SAMPLE = 5  # cases of each study
# in the names of variables of measured times, or of such a time over a count
CLOCKED = ("seconds", "reliable", "spread", "first_call", "alone", "together")


class Checked(NamedTuple):
    """The outcome of checking one study."""

    study: str
    stored: int  # cases that are up to date on disk
    compared: int
    differences: list[str]

    def verdict(self) -> str:
        """The outcome in a phrase."""
        return f"{len(self.differences)} differences" if self.differences else "the same to the last bit, times aside"


def differences(stored: Combined, again: Combined) -> list[str]:
    """In what two datasets, or trees of them, differ besides measured times and where they were made."""
    ours, theirs = netcdf.groups(stored), netcdf.groups(again)
    return [f"group {name} is in one of them only" for name in sorted(ours.keys() ^ theirs.keys())] + [
        f"{name}: {difference}" if name else difference
        for name in sorted(ours.keys() & theirs.keys())
        for difference in _differences(ours[name], theirs[name])
    ]


def _differences(stored: xr.Dataset, again: xr.Dataset) -> list[str]:
    ours, theirs = set(map(str, stored.variables)), set(map(str, again.variables))
    differing = [f"{name} is in one of them only" for name in sorted(ours ^ theirs)]
    for name in sorted(ours & theirs):
        one, other = stored[name], again[name]
        if one.dims != other.dims or one.shape != other.shape:
            differing.append(f"{name} has another shape: {dict(one.sizes)} and {dict(other.sizes)}")
        elif not any(word in name for word in CLOCKED) and not _same(one, other):
            differing.append(f"{name} differs{_how_much(one, other)}")
    kept = sorted((set(stored.attrs) | set(again.attrs)) - set(netcdf.provenance()) - {"content", *ATTRIBUTES.values()})
    pairs = [(key, stored.attrs.get(key), again.attrs.get(key)) for key in kept]
    return [
        *differing,
        *(f"attribute {key} differs: {one!r} and {other!r}" for key, one, other in pairs if one != other),
    ]


def _bare(data: Combined) -> Combined:
    """Without the attributes."""
    return data.drop_attrs() if isinstance(data, xr.Dataset) else data.map_over_datasets(xr.Dataset.drop_attrs)


def _same(one: xr.DataArray, other: xr.DataArray) -> bool:
    """To the last bit, for numbers."""
    if one.dtype.kind == "f" and one.dtype == other.dtype:
        return one.values.tobytes() == other.values.tobytes()
    return one.equals(other)


def _how_much(one: xr.DataArray, other: xr.DataArray) -> str:
    if one.dtype.kind != "f" or other.dtype.kind != "f":
        return ""
    with np.errstate(all="ignore"):
        gap = np.abs(one.values - other.values)
    return f" by up to {np.nanmax(gap):.3g}" if np.isfinite(gap).any() else " in which values are NaN"


def check(
    study: Study, results: Path, pool: Pool, *, quick: bool = False, full: bool = False, everything: bool = False
) -> Checked:
    """Compute `SAMPLE` stored cases again, or every one, and compare; likewise the dataset that they make together."""
    cases = StudyCases.stored(study, results, quick=quick, full=full)
    # in the order of their digests, so that a sample is one of all parts of the grid
    stored = sorted(cases.data.items(), key=lambda item: store.digest_of(item[0]))
    chosen = {path.name: data for path, data in stored[: None if everything else SAMPLE]}
    with tempfile.TemporaryDirectory(prefix="symtop-check-") as elsewhere:
        again = StudyCases(study, Path(elsewhere).resolve())
        missing = again.add(case for path, case in cases.cases.items() if path.name in chosen)
        again.compute(missing, pool, study.limit, fresh=False, quiet=True)
        again.read(missing)
    differing = again.failures
    for path, data in again.data.items():
        label = f"{again.cases[path].integrator} on {again.cases[path].scene}"
        differing += [f"{label}: {text}" for text in differences(chosen[path.name], data)]
    whole = results / f"{study.name}.nc"
    if whole.is_file() and len(stored) == len(cases.cases):
        kept, made = _bare(netcdf.read_any(whole)), _bare(cases.combined())
        differing += [f"{whole.name}: {text}" for text in differences(kept, made)]
    return Checked(study.name, len(stored), len(chosen), differing)
