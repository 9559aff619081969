"""What the files of a results folder were made of: ``cases/manifest.json``.

The entry of a study holds a hash of what its files were made of, and size and time of the last
change of each. A disk that loses bits by itself is found by ``symtop study --check``. Without the manifest everything
is read and drawn again, and nothing is computed again.
"""

import contextlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from symtop.core import files, netcdf


def path_of(results: Path) -> Path:
    """The manifest of a folder."""
    return results / "cases" / "manifest.json"


def _entries(results: Path) -> dict[str, Any]:
    content = netcdf.read_json(path_of(results))
    return content if isinstance(content, dict) else {}


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
    marks = entry["files"]
    return None not in marks.values() and marks == _marks(results, [results / file for file in marks])


def note(results: Path, name: str, made_of: str, paths: Iterable[Path]) -> None:
    """Write that the files of an entry are up to date; another process may be writing another entry."""
    with files.locked(path_of(results), wait=True):
        netcdf.sweep(path_of(results))
        entry = {"made_of": made_of, "files": _marks(results, paths)}
        netcdf.write_json(path_of(results), _entries(results) | {name: entry})
