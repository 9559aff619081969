"""Where a study's results live: one file a case, one dataset a study, written whole or not at all.

results/cases/STUDY/SCENE--INTEGRATOR--SETTINGS--DIGEST.npz            what one case measured
results/cases/STUDY/SCENE--INTEGRATOR--SETTINGS--DIGEST.failed.json    or how it failed, with its traceback
results/cases/STUDY/.SCENE--INTEGRATOR--SETTINGS--DIGEST.lock          while it is being computed
results/STUDY.nc                                                       all of them, with labelled dimensions
results/STUDY.json                                                     verdict, tables and captions for the report
results/figures/STUDY-NAME.png
results/cases/manifest.json                                            what these were made of (`manifest`)

SETTINGS is a hash of what the case was asked to do, DIGEST one of everything that its numbers depend on. Its file holds
the settings and the reasons that make up the digest, and a hash of all that it holds: a truncated, damaged or foreign
file counts as none. A file is removed only when a case with the same SETTINGS and another DIGEST takes its place; what
was computed for another grid stays until a user deletes it. The lock is the operating system's, so that it ends with
the process that holds it, however that ends.
"""

import json
import math
import tempfile
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from symtop.core import netcdf
from symtop.core.code_hash import hashed
from symtop.core.errors import SymtopError
from symtop.core.files import locked
from symtop.runner import fingerprint
from symtop.runner.study import Case, Combined, Study

Cell = tuple[str, str, xr.Dataset]  # a scene, a variant and what was measured

SEED = 0  # of the order in which batches are timed; nothing else here is random


def case_paths(results: Path, study: Study, cases: Sequence[Case]) -> list[Path]:
    """The files of cases; their names hold the digest of everything the numbers depend on."""
    return [
        results / "cases" / study.name / f"{case.label}--{fingerprint.settings_key(study, case)[:8]}--{digest}.npz"
        for case, digest in zip(cases, fingerprint.digests(study, cases), strict=True)
    ]


def digest_of(path: Path) -> str:
    """The digest in the name of a case's file."""
    return path.name.rpartition("--")[2].partition(".")[0]


def identity_of(path: Path) -> str:
    """The scene, integrator and settings in the name of a case's file: what was asked, whatever it was made of."""
    return path.name.rpartition("--")[0]


def prepare(results: Path, study: Study) -> None:
    """Make the folders of a study and see that they can be written to, before hours are spent on computing."""
    for folder in (results / "cases" / study.name, results / "figures"):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError as error:
            raise SymtopError(f"cannot write into {folder}: {error.strerror or error}") from error
    for file in (results / f"{study.name}.nc", results / f"{study.name}.json"):
        if file.is_dir():
            raise SymtopError(f"cannot write {file}: it is a folder")


def save_case(data: xr.Dataset, path: Path, study: Study, case: Case) -> None:
    """Store what a case measured, with what it was made from: arrays, and all that is said of them as JSON."""
    attributes = data.attrs | netcdf.provenance() | {
        "study": study.name, "settings": dict(case.settings), "sources": digest_of(path),
        "made_of": fingerprint.reasons(study, case), "seed": SEED,
    }  # fmt: skip
    arrays = {str(k): _as_text(variable.values) for k, variable in enumerate(data.variables.values())}
    variables = [[str(name), list(variable.dims), variable.attrs, name in data.coords]
                 for name, variable in data.variables.items()]  # fmt: skip
    about = json.dumps(
        {"variables": variables, "attributes": attributes},
        default=lambda value: value.tolist() if hasattr(value, "tolist") else str(value),
    )
    with netcdf.replacing(path) as partial, partial.open("wb") as file:
        np.savez(file, about=about, content=_content(about, arrays), **arrays)
    failure_path(path).unlink(missing_ok=True)


def load_case(path: Path) -> xr.Dataset | None:
    """The dataset of a finished case, or None if there is none or it is damaged (then it is computed again)."""
    if not path.is_file():
        return None
    try:
        with path.open("rb") as stream, np.load(stream) as file:
            arrays = {name: file[name] for name in file.files}
        text, content = str(arrays.pop("about")), str(arrays.pop("content"))
        about = json.loads(text)
    except Exception:  # noqa: BLE001  (a damaged archive raises nearly anything)
        return None
    if content != _content(text, arrays) or about["attributes"]["sources"] != digest_of(path):
        return None
    kinds: tuple[dict[str, Any], dict[str, Any]] = {}, {}  # variables, coordinates
    for k, (name, dims, attributes, is_coordinate) in enumerate(about["variables"]):
        kinds[is_coordinate][name] = dims, arrays[str(k)], attributes
    return xr.Dataset(*kinds, about["attributes"])


def _content(about: str, arrays: dict[str, Any]) -> str:
    return hashed(about, *(netcdf.array_hash(arrays[name]) for name in sorted(arrays)))


def _as_text(values: Any) -> Any:
    """Text of any length as text of one length: archives hold no objects."""
    return values.astype(str) if values.dtype == object else values


def failure_path(path: Path) -> Path:
    """Where the failure of a case is recorded."""
    return path.with_name(f"{path.stem}.failed.json")


def trace_path(path: Path) -> Path:
    """Where the traceback of a case that took too long waits to be recorded."""
    return path.with_name(f".{path.stem}.trace")


def save_failure(path: Path, case: Case, message: str, trace: str) -> None:
    """Record how a case failed; a file that an earlier run may have left is no longer its result."""
    question = {"scene": case.scene, "integrator": case.integrator, "settings": dict(case.settings)}
    write_json(failure_path(path), {**question, "message": message, "traceback": trace.splitlines()})
    path.unlink(missing_ok=True)


def combine(cases: list[tuple[Case, xr.Dataset]]) -> Combined:
    """One dataset over scene and integrator, or, of cases in groups, a tree with such a dataset for each group.

    A dataset of a group covers the scenes and integrators of its own cases only. xarray aligns the coordinates of a
    group with those of the groups above it, so that the root of the tree is empty: all cases are in groups, or none.
    """
    groups: dict[str, list[tuple[Case, xr.Dataset]]] = {}
    for case, data in cases:
        groups.setdefault(case.group, []).append((case, data))
    if not groups.keys() - {""}:
        return _dense(cases)
    if "" in groups:
        raise SymtopError(f"case {groups[''][0][0].label} has no group, but others of its study have one")
    return xr.DataTree.from_dict({group: _dense(members) for group, members in groups.items()})


def _dense(cases: list[tuple[Case, xr.Dataset]]) -> xr.Dataset:
    """One dataset over scene and variant; a cell that was not measured is NaN (a byte 255, a string empty).

    Sizes differ from case to case: each dimension gets the largest one, and a shorter case fills the beginning. A case
    of several variants counts as one for each of them. Two cases may measure different variables of a cell.
    """
    cells = [cell for case, data in cases for cell in _cells(case, data)]
    scenes, methods = (list(dict.fromkeys(names)) for names in list(zip(*cells, strict=True))[:2])
    sizes, coordinates = _coordinates(cells)
    filled: dict[str, tuple[tuple[str, ...], Any, dict[str, Any]]] = {}
    taken = set[tuple[str, str, str]]()
    for scene, method, data in cells:
        place = scenes.index(scene), methods.index(method)
        for name, variable in data.data_vars.items():
            if (scene, method, str(name)) in taken:
                raise SymtopError(
                    f"two cases of {method} on {scene} measure {name}, and one would replace the other: "
                    "give each a group, or measure all settings in one case, over a dimension of the dataset"
                )
            taken.add((scene, method, str(name)))
            dims = tuple(str(dim) for dim in variable.dims)
            if str(name) not in filled:
                blank = np.full((len(scenes), len(methods), *(sizes[dim] for dim in dims)), *_blank(variable.dtype))
                filled[str(name)] = ("scene", "variant", *dims), blank, dict(variable.attrs)
            corner = tuple(slice(0, size) for size in variable.shape)
            filled[str(name)][1][(*place, *corner)] = variable.values
    variables = {name: (dims, _as_text(values), attrs) for name, (dims, values, attrs) in filled.items()}
    return xr.Dataset(variables, coords={"scene": scenes, "variant": methods} | coordinates)


def _coordinates(cells: list[Cell]) -> tuple[dict[str, int], dict[str, Any]]:
    """The largest size of each dimension, and its coordinate if it has one, which shorter ones begin."""
    sizes: dict[str, int] = {}
    longest: dict[str, Any] = {}
    for scene, method, data in cells:
        for dim, size in data.sizes.items():
            name = str(dim)
            if name in longest and dim in data.coords and data[dim].dtype.kind == "f":
                shared = min(size, sizes[name])
                if not np.array_equal(data[dim].values[:shared], longest[name].values[:shared]):
                    raise SymtopError(f"the coordinate {name} of {method} on {scene} differs from that of other cases")
            if size > sizes.get(name, 0):
                sizes[name] = size
                if dim in data.coords:
                    longest[name] = data[dim]
    return sizes, longest


def _cells(case: Case, data: xr.Dataset) -> list[Cell]:
    """Scene, variant and dataset of a case, or of each variant that it measured."""
    if "variant" not in data.dims:
        return [(case.scene, case.integrator, data)]
    names = [str(name) for name in data["variant"].values]
    return [(case.scene, name, data.sel(variant=name, drop=True)) for name in names]


def _blank(kind: "np.dtype[Any]") -> tuple[Any, Any]:
    """What stands for nothing in an array of that type, and the type that can hold it."""
    if kind.kind in "OUT":
        return "", object
    return (np.iinfo(kind).max, kind) if kind.kind == "u" else (math.nan, float)


def write_text(path: Path, text: str) -> None:
    """Replace a small text file in one move."""
    with netcdf.replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")


def write_json(path: Path, content: Any) -> None:
    """Replace a JSON file in one move."""
    write_text(path, json.dumps(content, indent=1, ensure_ascii=False, default=str) + "\n")


def read_json(path: Path) -> Any:
    """The content of a JSON file, or None if there is none or it is damaged."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def stored(results: Path, study: Study) -> list[Path]:
    """The files of all cases of a study that were ever computed and not replaced."""
    return sorted((results / "cases" / study.name).glob("[!.]*.npz"))


def superseded(paths: Iterable[Path], present: Collection[Path]) -> list[Path]:
    """Those files that an edit made stale: present ones have their scene, integrator and settings, none the digest."""
    digests, identities = {digest_of(path) for path in present}, {identity_of(path) for path in present}
    return [path for path in paths if digest_of(path) not in digests and identity_of(path) in identities]


def forget(results: Path, study: Study, present: Collection[Path]) -> None:
    """Remove what newer files replace, and what killed writers left."""
    failures = (results / "cases" / study.name).glob("[!.]*.failed.json")
    for path in superseded([*stored(results, study), *failures], present):
        path.unlink(missing_ok=True)
    tidy(results, study)


def tidy(results: Path, study: Study) -> None:
    """Remove what processes that were killed have left of a study's files, and nobody holds any more."""
    for lock in (results / "cases" / study.name).glob(".*.lock"):
        path = lock.with_name(f"{lock.stem[1:]}.npz")
        with locked(path, wait=False) as ours:
            if ours:
                netcdf.sweep(path)
                trace_path(path).unlink(missing_ok=True)
    with locked(results / f"{study.name}.nc", wait=False) as ours:
        if ours:
            for file in (results / f"{study.name}.nc", results / f"{study.name}.json"):
                netcdf.sweep(file)
            for partial in (results / "figures").glob(f".{study.name}-*.part*"):
                partial.unlink(missing_ok=True)
