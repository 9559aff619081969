"""The runner: computes the cases that are missing, combines them, draws, and writes the findings.

A case is computed only if no file holds its digest, so that an interrupted study resumes and an unchanged one
ends in seconds. Untimed cases share all cores; timed ones run alone. A study may have a second round of cases, made
from what the first one found. Two runs may share one folder: each case is computed by one of them. How a picture is
written to a file is the caller's choice (`Save`): this room knows no style.
"""

import contextlib
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import xarray as xr
from tqdm import tqdm

from symtop.base import datasets, fingerprint
from symtop.base.progress import beating
from symtop.base.validate import SymtopError, label, positive
from symtop.runner import depends, plugins, seen, store
from symtop.runner.execute import execute
from symtop.runner.pools import Workers
from symtop.runner.scripts import file_of, folder, load, names
from symtop.runner.study import Case, Combined, Picture, Study
from symtop.runner.work import Result, Task

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Round", "Save", "findings_of", "folder", "load", "names", "run"]

Save = Callable[["Figure", Path], object]  # writes a picture's figure to a file


def _bar(words: str, *, quiet: bool, **options: Any) -> Any:
    """A progress bar, or without a total the words alone, where somebody is watching."""
    unseen = quiet or sys.stderr is None or not sys.stderr.isatty()
    options = options or {"total": 1, "bar_format": "{desc}"}
    return tqdm(desc=words, disable=unseen, leave=False, **options)


@dataclass
class Round:
    """Cases of a study with their files and datasets, the failures, and how many were computed."""

    study: Study
    results: Path
    done: dict[Path, tuple[Case, xr.Dataset]] = field(default_factory=dict)
    paths: dict[Path, Case] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)
    computed: int = 0

    @classmethod
    def stored(cls, study: Study, results: Path, *, quick: bool, full: bool) -> Self:
        """The cases of a study with what is stored of them; of the second round only if the first one is done."""
        cases = cls(study, results.resolve())
        if not cases.add(study.grid(quick=quick, full=full), fresh=False):
            cases.follow_up(fresh=False)
        return cases

    def add(self, cases: Iterable[Case], *, fresh: bool) -> dict[Path, Case]:
        """Take cases in; returns those that have to be computed."""
        return self.missing(self.named(cases), fresh=fresh)

    def named(self, cases: Iterable[Case]) -> dict[Path, Case]:
        """Cases by their files, which this round now has."""
        asked = list(cases)
        new = dict(zip(store.case_paths(self.results, self.study, asked), asked, strict=True))
        self.paths |= new
        return new

    def missing(self, new: dict[Path, Case], *, fresh: bool) -> dict[Path, Case]:
        """Those of the cases that have to be computed."""
        if not fresh:
            self._look(new)
        return {path: case for path, case in new.items() if path not in self.done}

    def follow_up(self, *, fresh: bool) -> dict[Path, Case]:
        """Take the second round in, made from what the first one found; returns those that have to be computed."""
        return {} if self.study.follow_up is None else self.add(self.study.follow_up(self.combined()), fresh=fresh)

    def _look(self, paths: Iterable[Path]) -> None:
        loaded = {path: data for path in paths if (data := store.load_case(path)) is not None}
        self.done |= {path: (self.paths[path], data) for path, data in loaded.items()}

    def compute(self, missing: dict[Path, Case], workers: Workers, limit: float, *, fresh: bool, quiet: bool) -> None:
        """Have cases computed, with a progress bar where somebody is watching."""
        script = str(file_of(self.study.name))
        tasks = [Task(script, case, str(path), tuple(plugins.loaded()), limit, fresh) for path, case in missing.items()]
        with beating(_bar(self.study.name, quiet=quiet or not tasks, total=len(tasks), unit="case")) as bar:

            def on_result(_: Task, result: Result) -> None:
                if result.state == "failed":
                    self.failures.append(result.message)
                    bar.set_postfix_str(f"{len(self.failures)} failed", refresh=False)
                self.computed += result.state == "computed"
                bar.update()

            execute(self.study, tasks, workers, on_result)
        self._look(missing)

    def combined(self) -> Combined:
        """One dataset of all that was measured, or a tree of one for each group of cases."""
        if not self.done:
            why = self.failures[0] if self.failures else "the grid is empty"
            raise SymtopError(f"study {self.study.name}: no case could be measured; {why}")
        return store.combine([self.done[path] for path in self.paths if path in self.done])


def _stamp(study: Study, digests: Iterable[str], save: Save | None) -> str:
    """Hash of what the findings depend on: the cases, the script and the code that combines, draws and judges."""
    return fingerprint.hashed(*digests, depends.script_digest(file_of(study.name), store, save))


def _drawn(study: Study, results: Path, stamp: str) -> dict[str, Any] | None:
    """The findings of an earlier run, if they and all their pictures are up to date."""
    before = store.read_json(results / f"{study.name}.json")
    if not isinstance(before, dict) or before.get("stamp") != stamp:
        return None
    try:
        pictures = [results / "figures" / picture["file"] for picture in before["pictures"]]
    except (KeyError, TypeError):
        return None
    return before if all(file.is_file() for file in [*pictures, results / f"{study.name}.nc"]) else None


def run(study: Study, results: Path, *, quick: bool = False, full: bool = False, fresh: bool = False,
        jobs: int | None = None, quiet: bool = False, workers: Workers | None = None,
        limit: float | None = None, save: Save | None = None) -> dict[str, Any]:  # fmt: skip
    """Bring a study's dataset, figures and findings up to date; returns the findings.

    `quick` is the coarse grid, `full` the longest one of a study that has it; `limit` is the time a case may take, in
    seconds (the study's own by default); `save` writes figures to files, and without it none are drawn. Cases that fail
    are named in ``failures``, recorded beside the others with their traceback, and tried again the next time.
    Raises SymtopError if the results cannot be written or nothing could be measured.
    """
    began = time.monotonic()
    results = results.resolve()
    seconds = study.limit if limit is None else positive("limit", limit)
    store.prepare(results, study)
    cases = Round(study, results)
    first = cases.named(study.grid(quick=quick, full=full))
    stamp = _stamp(study, sorted(path.name for path in first), save)
    before = _drawn(study, results, stamp)
    if before is not None and not fresh and seen.untouched(results, study, stamp, first):
        return {**before, "computed": 0, "seconds": time.monotonic() - began}
    missing = cases.missing(first, fresh=fresh)
    later = None if missing else cases.follow_up(fresh=fresh)  # not known before the first round is done
    if before is not None and later == {} and seen.dataset_untouched(results, study, stamp):
        seen.note(results, study, stamp, cases.paths)
        return {**before, "computed": 0, "seconds": time.monotonic() - began}
    with Workers(jobs) if workers is None else contextlib.nullcontext(workers) as hired:
        try:
            cases.compute(missing, hired, seconds, fresh=fresh, quiet=quiet)
            later = cases.follow_up(fresh=fresh) if later is None else later
            cases.compute(later, hired, seconds, fresh=fresh, quiet=quiet)
        except BaseException:
            hired.close()  # before what its processes have left is removed
            store.tidy(results, study)
            raise
    with (
        store.locked(results / f"{study.name}.nc", wait=True),
        beating(_bar(f"{study.name}: combining and drawing", quiet=quiet)),
    ):
        findings = _conclude(cases, stamp, save, quick=quick)
    return {**findings, "computed": cases.computed, "seconds": time.monotonic() - began}


def _conclude(cases: Round, stamp: str, save: Save | None, *, quick: bool) -> dict[str, Any]:
    """Combine, draw, judge and write."""
    study, results = cases.study, cases.results
    for file in (results / f"{study.name}.nc", results / f"{study.name}.json"):
        datasets.sweep(file)
    combined = cases.combined()
    units = store.units_of(case.scene for case in cases.paths.values())
    combined = datasets.describe(combined, study.title, units=units, question=study.question)
    datasets.write(combined, results / f"{study.name}.nc")
    store.forget(results, study, cases.paths)
    findings = findings_of(study, combined, results, save, failures=cases.failures, cases=len(cases.paths))
    findings |= {"quick": quick, "stamp": stamp if not cases.failures else ""}
    store.write_json(results / f"{study.name}.json", findings)
    if not cases.failures:
        seen.note(results, study, stamp, cases.paths)
    return findings


def findings_of(
    study: Study, data: Combined, results: Path, save: Save | None, *, failures: list[str], cases: int
) -> dict[str, Any]:
    """Draw a dataset and say what it shows, as the report wants it."""
    pictures = [] if save is None else [_save(results, study, picture, save) for picture in study.pictures(data)]
    first = None
    if study.opening is not None:
        opening = study.opening(data)
        first = opening._asdict() | {"table": opening.table._asdict(), "explained": dict(opening.explained)}
    return {
        "study": study.name,
        **{name: getattr(study, name) for name in ("title", "question", "how_to_read")},
        "verdict": study.verdict(data),
        "tables": [table._asdict() for table in study.tables(data)],
        "charts": [chart._asdict() for chart in study.charts(data)],
        "opening": first,
        "pictures": pictures,
        "failures": failures,
        "cases": cases,
        "quick": False,
        "provenance": datasets.provenance(),
    }


def _save(results: Path, study: Study, picture: Picture, save: Save) -> dict[str, str]:
    suffix = getattr(picture.figure, "suffix", "png")  # a film is a GIF
    file = f"{study.name}-{label('name of a picture', picture.name)}.{suffix}"
    save(picture.figure, results / "figures" / file)
    return {"file": file} | {key: getattr(picture, key) for key in ("name", "caption", "alt", "lead")}
