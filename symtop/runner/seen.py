"""Which files of a study were read whole and found good, and have not been touched since.

Reading the 1,400 files of the quick grids takes 12 s, asking for their sizes and times of change 10 ms. As git's index
does, `cases/STUDY/seen.json` keeps both from when the study was concluded, with the stamp of what it was drawn from.
Whoever damages a file changes its time; a disk that loses bits by itself is found by ``symtop study --check``.
"""

from collections.abc import Iterable
from pathlib import Path

from symtop.runner import store
from symtop.runner.study import Study

MISSING = [0, 0]  # size and time of a file that is not there


def _record(results: Path, study: Study) -> Path:
    return results / "cases" / study.name / "seen.json"


def _marks(paths: Iterable[Path]) -> dict[str, list[int]]:
    """Size and time of the last change (ns) of files; zeros for one that is missing."""
    marks = {}
    for path in paths:
        try:
            told = path.stat()
            marks[path.name] = [told.st_size, told.st_mtime_ns]
        except OSError:
            marks[path.name] = MISSING
    return marks


def note(results: Path, study: Study, stamp: str, paths: Iterable[Path]) -> None:
    """Remember the files of all rounds of a study, and its dataset, that were just read or written."""
    files = _marks([results / f"{study.name}.nc", *paths])
    store.write_json(_record(results, study), {"stamp": stamp, "files": files})


def _known(results: Path, study: Study, stamp: str) -> dict[str, list[int]]:
    """What is remembered of the study as it was drawn of that stamp; empty if nothing is."""
    record = store.read_json(_record(results, study))
    fits = isinstance(record, dict) and record.get("stamp") == stamp and isinstance(record.get("files"), dict)
    return record["files"] if fits else {}


def dataset_untouched(results: Path, study: Study, stamp: str) -> bool:
    """Is the study's dataset the one that was written?"""
    file = results / f"{study.name}.nc"
    return _known(results, study, stamp).get(file.name) == _marks([file])[file.name]


def untouched(results: Path, study: Study, stamp: str, paths: Iterable[Path]) -> bool:
    """Were these files, among those of the study, good when it was last drawn of the same, and are all unchanged?"""
    known = _known(results, study, stamp)
    folder, dataset = results / "cases" / study.name, f"{study.name}.nc"
    cases = known.keys() - {dataset}
    if not {path.name for path in paths} <= cases or not dataset_untouched(results, study, stamp):
        return False
    marks = _marks(folder / name for name in cases)
    return MISSING not in marks.values() and marks == {name: known[name] for name in cases}
