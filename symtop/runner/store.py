"""The files of a study's results: one per case, one dataset per study, all written atomically.

results/cases/STUDY/SCENE--INTEGRATOR--SETTINGS--DIGEST.npz            the dataset of one case
results/cases/STUDY/SCENE--INTEGRATOR--SETTINGS--DIGEST.failed.json    or how it failed, with its traceback
results/cases/STUDY/.SCENE--INTEGRATOR--SETTINGS--DIGEST.lock          while it is being computed
results/STUDY.nc                                                       all cases, with labelled dimensions
results/STUDY.json                                                     facts, and names of figures and tables
results/figures/STUDY-NAME.png, results/tables/STUDY-NAME.csv
results/cases/manifest.json                                            hashes from which these were made

SETTINGS is a hash of the declaration of the case, DIGEST one of everything that its numbers depend on; its file holds
both in full, and a hash of all its content: a truncated, damaged or foreign file is ignored. It is removed when a
case with the same SETTINGS and another DIGEST replaces it. The operating system releases the lock of a dead process.

The entry of a study in the manifest holds a hash of all that its files depend on, and size and modification time of
each file. Corruption of the disk is found by ``symtop study --check``. Without the manifest everything is read and
drawn again, and nothing is computed again.
"""

import contextlib
import json
import tempfile
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from symtop.core import netcdf
from symtop.core.code_hash import hashed
from symtop.core.errors import SymtopError
from symtop.core.files import locked, replacing, sweep
from symtop.measure.datasets import as_text
from symtop.runner import fingerprint
from symtop.runner.study import Case, Study

SEED = 0  # of the random order of timed batches, as stored with a case; nothing else is random


def case_path(results: Path, study: Study, case: Case) -> Path:
    """The file of a case; its name holds the digest of everything the numbers depend on."""
    name = f"{case.label}--{fingerprint.settings_key(study, case)[:8]}--{fingerprint.digest(study, case)}.npz"
    return results / "cases" / study.name / name


def digest_of(path: Path) -> str:
    """The digest in the name of a case's file."""
    return path.name.rpartition("--")[2].partition(".")[0]


def identity_of(path: Path) -> str:
    """The scene, integrator and settings in the name of a case's file, without the digest."""
    return path.name.rpartition("--")[0]


def prepare(results: Path, study: Study) -> None:
    """Make the folders of a study; SymtopError if they cannot be written to."""
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
    """Write the dataset of a case with its provenance: arrays, and names, dimensions and attributes as JSON."""
    attributes = data.attrs | netcdf.provenance() | {
        "study": study.name, "settings": dict(case.settings), "sources": digest_of(path),
        "made_of": fingerprint.reasons(study, case), "seed": SEED,
    }  # fmt: skip
    arrays = {str(k): as_text(variable.values) for k, variable in enumerate(data.variables.values())}
    variables = [[str(name), list(variable.dims), variable.attrs, name in data.coords]
                 for name, variable in data.variables.items()]  # fmt: skip
    header = json.dumps(
        {"variables": variables, "attributes": attributes},
        default=lambda value: value.tolist() if hasattr(value, "tolist") else str(value),
    )
    with replacing(path) as partial, partial.open("wb") as file:
        np.savez(file, about=header, content=_content(header, arrays), **arrays)
    failure_path(path).unlink(missing_ok=True)


def load_case(path: Path) -> xr.Dataset | None:
    """The dataset of a finished case, or None if there is none or it is damaged (then it is computed again)."""
    try:
        with path.open("rb") as stream, np.load(stream) as file:
            arrays = {name: file[name] for name in file.files}
        text, content = str(arrays.pop("about")), str(arrays.pop("content"))
        header = json.loads(text)
    except Exception:  # noqa: BLE001  (no file, or a damaged archive, which raises nearly anything)
        return None
    if content != _content(text, arrays) or header["attributes"]["sources"] != digest_of(path):
        return None
    kinds: tuple[dict[str, Any], dict[str, Any]] = {}, {}  # variables, coordinates
    for k, (name, dims, attributes, is_coordinate) in enumerate(header["variables"]):
        kinds[is_coordinate][name] = dims, arrays[str(k)], attributes
    return xr.Dataset(*kinds, header["attributes"])


def _content(header: str, arrays: dict[str, Any]) -> str:
    return hashed(header, *(netcdf.array_hash(arrays[name]) for name in sorted(arrays)))


def failure_path(path: Path) -> Path:
    """The file with the failure of a case."""
    return path.with_name(f"{path.stem}.failed.json")


def trace_path(path: Path) -> Path:
    """The temporary file with the traceback of a case that exceeds its time limit."""
    return path.with_name(f".{path.stem}.trace")


def stored(results: Path, study: Study) -> list[Path]:
    """The files of all stored cases of a study, up to date or not."""
    return sorted((results / "cases" / study.name).glob("[!.]*.npz"))


def superseded(paths: Iterable[Path], present: Collection[Path]) -> list[Path]:
    """Those of `paths` that are stale: a present case has the same scene, integrator and settings, none the digest."""
    digests, identities = {digest_of(path) for path in present}, {identity_of(path) for path in present}
    return [path for path in paths if digest_of(path) not in digests and identity_of(path) in identities]


def forget(results: Path, study: Study, present: Collection[Path]) -> None:
    """Remove files that newer ones replace, and files left by killed processes."""
    failures = (results / "cases" / study.name).glob("[!.]*.failed.json")
    for path in superseded([*stored(results, study), *failures], present):
        path.unlink(missing_ok=True)
    tidy(results, study)


def tidy(results: Path, study: Study) -> None:
    """Remove partial files of a study that killed processes have left, unless another process holds the lock."""
    for lock in (results / "cases" / study.name).glob(".*.lock"):
        path = lock.with_name(f"{lock.stem[1:]}.npz")
        with locked(path, wait=False) as acquired:
            if acquired:
                sweep(path)
                trace_path(path).unlink(missing_ok=True)
    with locked(results / f"{study.name}.nc", wait=False) as acquired:
        if acquired:
            for file in (results / f"{study.name}.nc", results / f"{study.name}.json"):
                sweep(file)
            for partial in (results / "figures").glob(f".{study.name}-*.part*"):
                partial.unlink(missing_ok=True)


def manifest(results: Path) -> Path:
    """The manifest of a folder."""
    return results / "cases" / "manifest.json"


def _entries(results: Path) -> dict[str, Any]:
    content = netcdf.read_json(manifest(results))
    return content if isinstance(content, dict) else {}


def _file_marks(results: Path, paths: Iterable[Path]) -> dict[str, list[int] | None]:
    """Size and modification time (ns) of files by relative path; None for one that is missing."""
    marks: dict[str, list[int] | None] = {path.relative_to(results).as_posix(): None for path in paths}
    for name in marks:
        with contextlib.suppress(OSError):
            stat = (results / name).stat()
            marks[name] = [stat.st_size, stat.st_mtime_ns]
    return marks


def is_current(results: Path, name: str, made_of: str) -> bool:
    """Has the entry `name` of the manifest the hash `made_of`, and are all its files unchanged?"""
    entry = _entries(results).get(name)
    if not isinstance(entry, dict) or entry.get("made_of") != made_of or not isinstance(entry.get("files"), dict):
        return False
    marks = entry["files"]
    return None not in marks.values() and marks == _file_marks(results, [results / file for file in marks])


def note(results: Path, name: str, made_of: str, paths: Iterable[Path]) -> None:
    """Write an entry of the manifest; a lock protects it from other processes."""
    with locked(manifest(results), wait=True):
        sweep(manifest(results))
        entry = {"made_of": made_of, "files": _file_marks(results, paths)}
        netcdf.write_json(manifest(results), _entries(results) | {name: entry})
