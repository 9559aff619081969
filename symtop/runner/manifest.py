"""What the files of a results folder were made of: ``cases/manifest.json``.

An entry, of a study, of all studies together or of the report, holds a hash of what its files were made of, and the
size and the time of the last change of each file. Whoever damages a file changes its time; a disk that loses bits by
itself is found by ``symtop study --check``. Without the manifest everything is read and drawn again, and nothing is
computed again.
"""

import importlib.metadata
import importlib.util
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from symtop.core import files
from symtop.core.code_hash import PACKAGE, digest, file_hash, hashed, packages, processor

ALL, PAGE = "all studies", "report.html"  # entries that are no study's
ENTRY_POINTS = "symtop.integrators"  # as in `symtop.methods.framework.registry`, which takes longer to import
STUDIES = ("symtop_studies", "studies")  # folders beside the package, as in `scripts`


def path_of(results: Path) -> Path:
    """The manifest of a folder."""
    return results / "cases" / "manifest.json"


def _entries(results: Path) -> dict[str, Any]:
    try:
        content = json.loads(path_of(results).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def _marks(results: Path, paths: Iterable[Path]) -> dict[str, list[int]]:
    """Size and time of the last change (ns) of files by their place in the folder; zeros for one that is missing."""
    marks = {}
    for path in paths:
        try:
            facts = path.stat()
            mark = [facts.st_size, facts.st_mtime_ns]
        except OSError:
            mark = [0, 0]
        marks[path.relative_to(results).as_posix()] = mark
    return marks


def is_current(results: Path, name: str, made_of: str) -> bool:
    """Was an entry made of that, and is every file of it there and unchanged?"""
    entry = _entries(results).get(name)
    if not isinstance(entry, dict) or entry.get("made_of") != made_of or not isinstance(entry.get("files"), dict):
        return False
    known = entry["files"]
    return [0, 0] not in known.values() and known == _marks(results, [results / file for file in known])


def note(results: Path, name: str, made_of: str, paths: Iterable[Path], **facts: Any) -> None:
    """Write that the files of an entry are up to date; another process may be writing another entry."""
    from symtop.core import netcdf  # xarray
    from symtop.runner import store

    with files.locked(path_of(results), wait=True):
        netcdf.sweep(path_of(results))
        entry = {"made_of": made_of, "files": _marks(results, paths), **facts}
        store.write_json(path_of(results), _entries(results) | {name: entry})


def note_all(results: Path, names: list[str], made_of: str) -> None:
    """Write that all studies are up to date."""
    entries = _entries(results)
    paths = [results / file for name in names for file in entries.get(name, {}).get("files", ())]
    note(results, ALL, made_of, paths, names=names)


def all_made_of(grid: Mapping[str, bool]) -> str:
    """Hash of what all studies are made by on a grid: whether it is `quick` or `full`."""
    return hashed(sources_hash(), *(name for name in sorted(grid) if grid[name]))


def all_findings(results: Path, grid: Mapping[str, bool]) -> list[dict[str, Any]] | None:
    """The findings of all studies in their order, if they are up to date on a grid; no study is loaded."""
    names = _entries(results).get(ALL, {}).get("names")
    if not names or not is_current(results, ALL, all_made_of(grid)):
        return None
    return [json.loads((results / f"{name}.json").read_text(encoding="utf-8")) for name in names]


def report_hash(results: Path, *, embed: bool) -> str:
    """Hash of what the report is made of, but for the content of its files (`report_files`)."""
    return hashed(sources_hash(), str(embed), *(path.name for path in report_files(results)))


def report_files(results: Path) -> list[Path]:
    """The findings, datasets and figures that the report shows or links."""
    return sorted(path for kind in ("*.json", "*.nc", "figures/[!.]*") for path in results.glob(kind))


def sources_hash() -> str:
    """Hash of everything that studies and the report are made by: sources, packages, what these announce, processor."""
    folders = [PACKAGE, *(place for name in STUDIES if (place := PACKAGE.parent / name).is_dir())]
    points = sorted(importlib.metadata.entry_points(group=ENTRY_POINTS), key=str)
    code = {
        path.relative_to(folder.parent).as_posix(): file_hash(path)
        for folder in [*folders, *(place for point in points for place in _folders(point.module))]
        for path in folder.rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    }
    facts = {"announced": hashed(*map(str, points)), "processor": processor()}
    return digest(code | packages() | packages("matplotlib", "jinja2") | facts)


def _folders(module: str) -> list[Path]:
    """The folder of a package that announces integrators, or of a module; it is not imported."""
    spec = importlib.util.find_spec(module.partition(".")[0])
    places = () if spec is None else spec.submodule_search_locations or ()
    return [Path(place) for place in places]
