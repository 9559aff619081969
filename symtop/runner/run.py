"""Runs a study: computes the cases that are missing, combines them, draws, and writes the findings.

A case is computed only if no file holds its digest: an interrupted study resumes, an unchanged one ends in seconds. Two
commands may share one folder: each case is computed by one of them. How a picture is written is the caller's choice.
"""

import contextlib
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, CancelledError
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

from pebble import ProcessExpired

from symtop.core import files, netcdf
from symtop.core.code_hash import hashed
from symtop.core.errors import positive
from symtop.core.progress import beating, progress_bar
from symtop.measure import columns
from symtop.measure.datasets import combine
from symtop.model.scenes import scenes
from symtop.run import plugins
from symtop.runner import fingerprint, manifest, store
from symtop.runner.cases import StudyCases
from symtop.runner.findings import findings_of
from symtop.runner.pool import Pool, prepare
from symtop.runner.scripts import columns_of, file_of, folder, load, names, page_of
from symtop.runner.study import Case, Save, Study

__all__ = ["findings_of", "folder", "load", "names", "page_of", "run", "start"]

Findings = dict[str, Any]


class Started(NamedTuple):
    """A study whose cases are computed: `result` waits for its findings; are they `done`?"""

    result: Callable[[], Findings]
    done: Callable[[], bool] = lambda: True


def run(study: Study, results: Path, *, jobs: int | None = None, pool: Pool | None = None, **options: Any) -> Findings:
    """Bring a study's dataset, figures and findings up to date; returns the findings. The options are those of `start`.

    Cases that fail are named in ``failures``, recorded beside the others with their traceback, and tried again the next
    time. Raises SymtopError if the results cannot be written or nothing could be measured.
    """
    with Pool(jobs) if pool is None else contextlib.nullcontext(pool) as own:
        return start(study, results, own, **options).result()


def start(study: Study, results: Path, pool: Pool, *, quick: bool = False, full: bool = False,
          fresh: bool = False, quiet: bool = False, limit: float | None = None, save: Save | None = None,
          beside: bool = False) -> Started:  # fmt: skip
    """Compute the cases of a study that are missing; what is returned waits for its findings.

    `quick` is the coarse grid, `full` the longest one of a study that has it; `limit` is the time a case may take, in
    seconds (the study's own by default); `save` writes figures to files, and without it none are drawn. The findings
    are made when they are asked for, or `beside` the cases of the next study, in a worker.
    """
    began = time.monotonic()
    results = results.resolve()
    seconds = study.limit if limit is None else positive("limit", limit)
    store.prepare(results, study)
    cases = StudyCases(study, results)
    rounds = cases.rounds(quick=quick, full=full)
    first = next(rounds)
    drawing = drawing_digest(study, save)
    made_of = hashed(*sorted(path.name for path in first), drawing)
    if not fresh and manifest.is_current(results, study.name, made_of):
        known = netcdf.read_json(results / f"{study.name}.json")
        if isinstance(known, dict):
            return Started(lambda: known | {"computed": 0, "seconds": time.monotonic() - began})
    try:
        for new in chain([first], rounds):
            cases.compute(cases.missing(new, fresh=fresh), pool, seconds, fresh=fresh, quiet=quiet)
    except BaseException:
        pool.close()  # before what its processes have left is removed
        store.tidy(results, study)
        raise
    local = any(plugins.is_local(name) for case in cases.cases.values() for name in case.names)
    script = str(file_of(study.name))
    future = None
    if beside and pool.jobs > 1 and not local and study is load(script):
        work = script, plugins.loaded(), results, cases.cases, cases.failures, made_of, drawing, save, quick
        cases.data.clear()  # the worker reads the files
        future = pool.analyse(analyse_stored, *work)
    computing = time.monotonic() - began

    def result() -> Findings:
        begin = time.monotonic()
        with beating(progress_bar(f"{study.name}: combining and drawing", quiet=quiet)):
            findings = None
            with contextlib.suppress(BrokenExecutor, CancelledError, ProcessExpired):  # its process was ended
                findings = None if future is None else future.result()
            if findings is None:
                cases.read_all()
                findings = analyse(cases, made_of, save, quick)
        return findings | {"computed": cases.computed, "seconds": computing + time.monotonic() - begin}

    return Started(result, lambda: future is None or future.done())


def analyse_stored(
    script: str, files_of_plugins: tuple[str, ...], results: Path, stored: dict[Path, Case], failures: list[str],
    made_of: str, drawing: str, save: Save | None, quick: bool,
) -> Findings:  # fmt: skip
    """The findings of a study from the files of its cases; `drawing` is the part of `made_of` that is code."""
    study = prepare(script, files_of_plugins)
    cases = StudyCases(study, results, cases=stored, failures=failures)
    cases.read_all()
    edited = drawing_digest(study, save) != drawing  # since the cases were computed: drawn again next time
    return analyse(cases, "" if edited else made_of, save, quick)


def drawing_digest(study: Study, save: Save | None) -> str:
    """Hash of what combines, draws and judges."""
    beside = page_of(study.name), columns_of(study.name)
    return fingerprint.drawing_digest(study, beside, combine, columns.described, findings_of, save)


def analyse(cases: StudyCases, made_of: str, save: Save | None, quick: bool) -> Findings:
    """Combine, draw, judge and write; `made_of` is noted in the manifest."""
    study, results, catalogue = cases.study, cases.results, scenes()
    dataset, words = results / f"{study.name}.nc", results / f"{study.name}.json"
    with files.locked(dataset, wait=True):
        for file in (dataset, words):
            netcdf.sweep(file)
        combined = cases.combined()
        places = [catalogue.get(case.scene) for case in cases.cases.values()]
        units = "SI" if all(place is not None and place.units == "SI" for place in places) else ""
        combined = columns.described(combined, units, columns.read(columns_of(study.name)))
        combined = netcdf.describe(combined, study.title, units=units, question=study.question)
        netcdf.write(combined, dataset)
        store.forget(results, study, cases.cases)
        findings = findings_of(
            study, combined, results, save, failures=cases.failures, cases=len(cases.cases), quick=quick,
            page=page_of(study.name),
        )  # fmt: skip
        netcdf.write_json(words, findings)
        if not cases.failures and made_of:
            pictures = [results / "figures" / picture["file"] for picture in findings["pictures"]]
            tables = [results / "tables" / table["file"] for table in findings["tables"]]
            manifest.note(results, study.name, made_of, [dataset, words, *pictures, *tables, *cases.cases])
    return findings
