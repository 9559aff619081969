"""What the files of a results folder were made of: ``cases/manifest.json``.

An entry, of a study or of the report, holds a hash of what its files were made of, and the size and the time of the
last change of each file. Whoever damages a file changes its time; a disk that loses bits by itself is found by
``symtop study --check``. Without the manifest everything is read and drawn again, and nothing is computed again.
"""

import contextlib
import importlib.metadata
import importlib.util
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from symtop.core import files
from symtop.core.code_hash import PACKAGE, digest, file_hash, hashed, packages, processor

PAGE = "report.html"  # the entry that is no study's
ENTRY_POINTS = "symtop.integrators"  # as in `symtop.methods.framework.registry`, which takes longer to import
STUDIES = ("symtop_studies", "studies")  # folders beside the package, as in `scripts`


def path_of(results: Path) -> Path:
    """The manifest of a folder."""
    return results / "cases" / "manifest.json"


def _entries(results: Path) -> dict[str, Any]:
    with contextlib.suppress(OSError, ValueError):
        content = json.loads(path_of(results).read_text(encoding="utf-8"))
        return content if isinstance(content, dict) else {}
    return {}


def _marks(results: Path, paths: Iterable[Path]) -> dict[str, list[int] | None]:
    """Size and time of the last change (ns) of files by their place in the folder; None for one that is missing."""
    marks: dict[str, list[int] | None] = {path.relative_to(results).as_posix(): None for path in paths}
    for name in marks:
        with contextlib.suppress(OSError):
            facts = (results / name).stat()
            marks[name] = [facts.st_size, facts.st_mtime_ns]
    return marks


def is_current(results: Path, name: str, made_of: str) -> bool:
    """Was an entry made of that, and is every file of it there and unchanged?"""
    entry = _entries(results).get(name)
    if not isinstance(entry, dict) or entry.get("made_of") != made_of or not isinstance(entry.get("files"), dict):
        return False
    known = entry["files"]
    return None not in known.values() and known == _marks(results, [results / file for file in known])


def note(results: Path, name: str, made_of: str, paths: Iterable[Path]) -> None:
    """Write that the files of an entry are up to date; another process may be writing another entry."""
    from symtop.core import netcdf  # xarray
    from symtop.runner import store

    with files.locked(path_of(results), wait=True):
        netcdf.sweep(path_of(results))
        entry = {"made_of": made_of, "files": _marks(results, paths)}
        store.write_json(path_of(results), _entries(results) | {name: entry})


def report_hash(results: Path, *, embed: bool) -> str:
    """Hash of what the report is made of, but for the content of its files (`report_files`).

    Its code is all of symtop, the studies, and packages that announce integrators; these are not imported.
    """
    points = sorted(importlib.metadata.entry_points(group=ENTRY_POINTS), key=str)
    specs = [importlib.util.find_spec(point.module.partition(".")[0]) for point in points]
    places = [Path(place) for spec in specs for place in (spec and spec.submodule_search_locations) or ()]
    code = {
        path.relative_to(folder.parent).as_posix(): file_hash(path)
        for folder in [PACKAGE, *(PACKAGE.parent / name for name in STUDIES), *places]
        for path in folder.rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    }
    facts = {"announced": hashed(*map(str, points)), "processor": processor(), "embed": str(embed)}
    shown = {"shown": hashed(*(path.name for path in report_files(results)))}
    return digest(code | packages() | packages("matplotlib", "jinja2") | facts | shown)


def report_files(results: Path) -> list[Path]:
    """The findings, datasets and figures that the report shows or links."""
    return sorted(path for kind in ("*.json", "*.nc", "figures/[!.]*") for path in results.glob(kind))
