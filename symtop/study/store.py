"""Where a study's results live: one file a case, one dataset a study, written whole or not at all.

results/cases/STUDY/SCENE--INTEGRATOR--DIGEST.nc     what one case measured
results/STUDY.nc                                     all of them, with labelled dimensions
results/STUDY.json                                   verdict, tables and captions for the report
results/figures/STUDY-NAME.png
"""

import json
import math
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from symtop import datasets
from symtop.checks import SymtopError
from symtop.study.study import Case, Study


def case_path(results: Path, study: Study, case: Case) -> Path:
    """The file of a case; its name holds the digest of everything the numbers depend on."""
    return results / "cases" / study.name / f"{case.label}--{study.digest(case)}.nc"


def load_case(path: Path) -> xr.Dataset | None:
    """The dataset of a finished case, or None if there is none or it is damaged (then it is computed again)."""
    if not path.is_file():
        return None
    try:
        return datasets.read(path)
    except SymtopError:
        return None


def combine(cases: list[tuple[Case, xr.Dataset]]) -> xr.Dataset:
    """One dataset over scene and integrator; a cell nobody measured is NaN (a byte 255, a string empty)."""
    scenes = list(dict.fromkeys(case.scene for case, _ in cases))
    methods = list(dict.fromkeys(case.integrator for case, _ in cases))
    sizes: dict[str, int] = {}
    coordinates: dict[str, Any] = {"scene": scenes, "integrator": methods}
    for case, data in cases:
        for name, size in data.sizes.items():
            if name in data.coords and name in coordinates and data[name].dtype.kind == "f":
                shared = min(size, sizes[str(name)])
                if not np.array_equal(data[name].values[:shared], coordinates[str(name)].values[:shared]):
                    msg = f"the coordinate {name} of {case.label} differs from that of the other cases"
                    raise SymtopError(msg)
            if size > sizes.get(str(name), 0):
                sizes[str(name)] = size
                if name in data.coords:
                    coordinates[str(name)] = data[name]
    filled: dict[str, tuple[tuple[str, ...], Any, dict[str, Any]]] = {}
    for case, data in cases:
        place = scenes.index(case.scene), methods.index(case.integrator)
        for name, variable in data.data_vars.items():
            dims = tuple(str(dim) for dim in variable.dims)
            if str(name) not in filled:
                shape = (len(scenes), len(methods), *(sizes[dim] for dim in dims))
                blank = np.full(shape, *_blank(variable.dtype))
                filled[str(name)] = (("scene", "integrator", *dims), blank, dict(variable.attrs))
            corner = tuple(slice(0, size) for size in variable.shape)
            filled[str(name)][1][(*place, *corner)] = variable.values
    variables = {
        name: (dims, values.astype(str) if values.dtype == object else values, attrs)
        for name, (dims, values, attrs) in filled.items()
    }
    return xr.Dataset(variables, coords=coordinates)


def _blank(kind: "np.dtype[Any]") -> tuple[Any, Any]:
    """What stands for nothing in an array of that type, and the type that can hold it."""
    if kind.kind in "OUT":
        return "", object
    return (np.iinfo(kind).max, kind) if kind.kind == "u" else (math.nan, float)


def write_text(path: Path, text: str) -> None:
    """Replace a small text file in one move."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        Path(name).chmod(0o644)
        Path(name).replace(path)
    finally:
        Path(name).unlink(missing_ok=True)


def write_json(path: Path, content: Any) -> None:
    """Replace a JSON file in one move."""
    write_text(path, json.dumps(content, indent=1, ensure_ascii=False, default=str) + "\n")


def read_json(path: Path) -> Any:
    """The content of a JSON file, or None if there is none or it is damaged."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
