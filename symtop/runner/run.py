"""Run a study: compute the cases that are missing, combine them, draw, and write the findings.

A case is computed only if no file has its fingerprint in its name: an interrupted study resumes, an unchanged one ends
in seconds. Two commands may share one folder: each case is computed by one of them. The caller passes the function that
writes figures. The findings, NAME.json, hold facts and the names of tables, figures and charts, for the report.
"""

import contextlib
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

from pebble import ProcessExpired

from symtop.core import code_hash, files, netcdf
from symtop.core.errors import label, positive, shown
from symtop.core.progress import progress_bar
from symtop.measure import columns
from symtop.measure.datasets import Combined, combine
from symtop.model.scenes import all_scenes
from symtop.run import plugins
from symtop.runner import fingerprint, store
from symtop.runner.cases import StudyCases
from symtop.runner.pool import Pool, prepare
from symtop.runner.scripts import file_beside, file_of, folder, load, names
from symtop.runner.study import LONGEST, Case, Chart, Picture, Save, Study, StudyError, each, failing

__all__ = ["file_beside", "findings_of", "folder", "load", "names", "run", "start"]

Findings = dict[str, Any]
QUICK = "quick pass: coarse grid"  # text at the edge of figures of a quick pass


class PendingFindings(NamedTuple):
    """A study whose cases are computed, except `failures`: `result` waits for its findings, `done` is True if ready."""

    result: Callable[[], Findings]
    done: Callable[[], bool] = lambda: True
    failures: Sequence[str] = ()


def run(study: Study, results: Path, *, jobs: int | None = None, pool: Pool | None = None, **options: Any) -> Findings:
    """Bring a study's dataset, figures and findings up to date; returns the findings. The options are those of `start`.

    Failed cases are named in ``failures``, recorded beside the others with their traceback, and tried again by the next
    run. Raises SymtopError if the results cannot be written or nothing could be measured.
    """
    with Pool(jobs) if pool is None else contextlib.nullcontext(pool) as workers:
        return start(study, results, workers, **options).result()


def start(study: Study, results: Path, pool: Pool, *, quick: bool = False, full: bool = False,
          fresh: bool = False, quiet: bool = False, limit: float | None = None, save: Save | None = None,
          beside: bool = False) -> PendingFindings:  # fmt: skip
    """Compute the missing cases of a study; the findings are made by `PendingFindings.result`.

    `quick` is the coarse grid, `full` the longest one of a study that has it; `limit` is the time a case may take, in
    seconds (the study's own by default); `save` writes figures to files, and without it none are drawn. With `beside`
    the findings are made in a worker, while cases of the next study run.
    """
    began = time.monotonic()
    results = results.resolve()
    seconds = study.limit if limit is None else positive("limit", limit)
    store.prepare(results, study)
    cases = StudyCases(study, results)
    rounds = cases.rounds(quick=quick, full=full)
    first = next(rounds)
    drawing = drawing_digest(study, save)
    made_of = code_hash.hashed(*sorted(path.name for path in first), drawing)
    if not fresh and store.is_current(results, study.name, made_of):
        stored = netcdf.read_json(results / f"{study.name}.json")
        if isinstance(stored, dict):
            return PendingFindings(lambda: stored | {"computed": 0, "seconds": time.monotonic() - began})
    try:
        for new in chain([first], rounds):
            cases.compute(cases.missing(new, fresh=fresh), pool, seconds, fresh=fresh, quiet=quiet)
    except BaseException:
        pool.close()  # before its partial files are removed
        store.tidy(results, study)
        raise
    local = any(plugins.is_local(name) for case in cases.cases.values() for name in (case.scene, *case.integrators))
    script = str(file_of(study.name))
    future = None
    if beside and pool.jobs > 1 and not local and study is load(script):
        work = script, plugins.loaded(), results, cases.cases, cases.failures, made_of, drawing, save, quick
        cases.data.clear()  # the worker reads the files itself
        future = pool.analyse(analyse_stored, *work)
    computing = time.monotonic() - began

    def result() -> Findings:
        begin = time.monotonic()
        with progress_bar(f"{study.name}: combining and drawing", quiet=quiet):
            findings = None
            with contextlib.suppress(BrokenExecutor, CancelledError, ProcessExpired):  # if the worker was killed
                findings = None if future is None else future.result()
            if findings is None:
                cases.read_all()
                findings = analyse(cases, made_of, save, quick)
        return findings | {"computed": cases.computed, "seconds": computing + time.monotonic() - begin}

    return PendingFindings(result, lambda: future is None or future.done(), cases.failures)


def analyse_stored(
    script: str, files_of_plugins: tuple[str, ...], results: Path, stored: dict[Path, Case], failures: list[str],
    made_of: str, drawing: str, save: Save | None, quick: bool,
) -> Findings:  # fmt: skip
    """The findings of a study from the files of its cases; `drawing` is the `drawing_digest` at the start."""
    study = prepare(script, files_of_plugins)
    cases = StudyCases(study, results, cases=stored, failures=failures)
    cases.read_all()
    changed = drawing_digest(study, save) != drawing  # then the next run must draw again
    return analyse(cases, "" if changed else made_of, save, quick)


def drawing_digest(study: Study, save: Save | None) -> str:
    """Hash of what follows on the first round: a second one, combining and drawing, the template and the columns."""
    functions = study.facts, study.pictures, study.tables, study.charts, study.follow_up, study.title, study.question
    drawing = combine, columns.described, findings_of, save
    files_beside = (file_beside(study.name, name) for name in ("page.md", "columns.tsv"))
    texts = {f"file {file.name}": code_hash.hashed(file.read_text(encoding="utf-8")) for file in files_beside if file}
    code = fingerprint.reached().reasons("drawing", functions, drawing)
    timed_later = {"processor": code_hash.processor()} if study.follow_up else {}
    return code_hash.digest(code | texts | timed_later | code_hash.packages("matplotlib"))


def analyse(cases: StudyCases, made_of: str, save: Save | None, quick: bool) -> Findings:
    """Combine the cases, and write dataset, figures, tables and findings; `made_of` goes into the manifest."""
    study, results, catalogue = cases.study, cases.results, all_scenes()
    dataset, words = results / f"{study.name}.nc", results / f"{study.name}.json"
    with files.locked(dataset, wait=True):
        for file in (dataset, words):
            files.sweep(file)
        combined = cases.combined()
        systems = {getattr(catalogue.get(case.scene), "units", "") for case in cases.cases.values()}
        units = "SI" if systems == {"SI"} else ""
        combined = columns.described(combined, units, netcdf.read_columns(file_beside(study.name, "columns.tsv")))
        combined = netcdf.describe(combined, study.title, units=units, question=study.question)
        netcdf.write(combined, dataset)
        store.forget(results, study, cases.cases)
        findings = findings_of(
            study, combined, results, save, failures=cases.failures, cases=len(cases.cases), quick=quick,
            page=file_beside(study.name, "page.md"),
        )  # fmt: skip
        netcdf.write_json(words, findings)
        if not cases.failures and made_of:
            pictures = [results / "figures" / picture["file"] for picture in findings["pictures"]]
            tables = [results / "tables" / table["file"] for table in findings["tables"]]
            store.note(results, study.name, made_of, [dataset, words, *pictures, *tables, *cases.cases])
    return findings


def findings_of(
    study: Study, data: Combined, results: Path, save: Save | None, *, failures: list[str], cases: int,
    quick: bool = False, page: Path | None = None,
) -> Findings:  # fmt: skip
    """Draw the figures of a dataset, write its tables, and return the findings; `page` is the template of its page."""
    charts = each(study.name, "charts", lambda: study.charts(data), Chart, "a list of Chart")
    return {
        "study": study.name, "title": study.title, "question": study.question,
        "charts": [chart._asdict() | {"marks": dict(chart.marks)} for chart in charts],
        "failures": failures, "cases": cases, "quick": quick,
        "provenance": netcdf.provenance(changes=True),
        "facts": dict(_facts(study, data)),
        "tables": list(_tables(study, data, results)),
        "pictures": [] if save is None else list(_saved(study, data, results, save, quick=quick)),
        "page": None if page is None else page.read_text(encoding="utf-8"),
    }  # fmt: skip


def _answers(study: Study, function: str, data: Combined, form: str) -> Iterator[tuple[Any, Any]]:
    with failing(study.name, function):
        values = getattr(study, function)(data)
    if not isinstance(values, Mapping):
        raise StudyError(f"study {study.name}: {function} must return {form} by name, not {shown(values)[:LONGEST]}")
    yield from values.items()


def _facts(study: Study, data: Combined) -> Iterator[tuple[str, float | str | bool | None]]:
    """The facts as values for JSON: numbers, text, and None for NaN."""
    for name, raw in () if study.facts is None else _answers(study, "facts", data, "numbers"):
        if not (isinstance(name, str) and name.isidentifier()):
            raise StudyError(f"study {study.name}: a fact's name must be a word of letters, digits and _, not {name!r}")
        value = raw.item() if getattr(raw, "ndim", None) == 0 else raw  # a scalar of NumPy
        if value is not None and not isinstance(value, (bool, int, float, str)):
            rule = f"fact {name} must be a number, text or None, not {shown(value)[:LONGEST]}"
            raise StudyError(f"study {study.name}: {rule}")
        yield name, None if isinstance(value, float) and math.isnan(value) else value


def _tables(study: Study, data: Combined, results: Path) -> Iterator[dict[str, Any]]:
    import pandas as pd

    for name, frame in _answers(study, "tables", data, "tables"):
        if not isinstance(frame, pd.DataFrame):
            raise StudyError(f"study {study.name}: table {name} must be a DataFrame, not a {type(frame).__name__}")
        with failing(study.name, "tables"):
            label("name of a table", name)
        file = f"{study.name}-{name}.csv"
        netcdf.write_text(results / "tables" / file, frame.to_csv(index=False))
        yield {"name": name, "file": file, "rows": len(frame)}


def _saved(study: Study, data: Combined, results: Path, save: Save, *, quick: bool) -> Iterator[dict[str, str]]:
    names = set[str]()
    for picture in each(study.name, "pictures", lambda: study.pictures(data), Picture, "or yield Pictures"):
        if not hasattr(picture.figure, "savefig"):
            kind = type(picture.figure).__name__
            raise StudyError(f"study {study.name}: the figure of a Picture must be one of matplotlib, not a {kind}")
        with failing(study.name, "pictures"):
            label("name of a picture", picture.name)
        if picture.name in names:
            raise StudyError(f"study {study.name}: pictures must have a name each, and two are called {picture.name}")
        names.add(picture.name)
        file = f"{study.name}-{picture.name}.{getattr(picture.figure, 'suffix', 'png')}"  # an animation is a GIF
        if quick and hasattr(picture.figure, "text"):
            look = {"ha": "right", "va": "bottom", "fontsize": 6.0, "color": "#AD4A00"}
            picture.figure.text(0.998, 0.01, QUICK, rotation=90.0, **look)
        save(picture.figure, results / "figures" / file)
        yield {"name": picture.name, "file": file}
