"""Runs a study: computes the cases that are missing, combines them, draws, and writes the findings.

A case is computed only if no file holds its digest, so that an interrupted study resumes and an unchanged one ends in
seconds. A study may have a second round of cases, made from what the first one found. Two commands may share one
folder: each case is computed by one of them. How a picture is written to a file is the caller's choice (`Save`): this
room knows no style.
"""

import contextlib
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, CancelledError
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pebble import ProcessExpired

from symtop.core.code_hash import hashed
from symtop.core.errors import positive
from symtop.core.progress import beating
from symtop.runner import manifest, plugins, store
from symtop.runner.analyse import Analysis, Save, analyse, analyse_stored, drawing_digest
from symtop.runner.cases import StudyCases, progress_bar
from symtop.runner.pool import Pool
from symtop.runner.scripts import file_of, folder, load, names
from symtop.runner.study import Study

__all__ = ["folder", "load", "names", "run", "start"]

Findings = dict[str, Any]


@dataclass(frozen=True)
class Started:
    """A study whose cases are computed: `result` waits for its findings; are they `done`?"""

    result: Callable[[], Findings]
    done: Callable[[], bool] = lambda: True


def run(study: Study, results: Path, *, quick: bool = False, full: bool = False, fresh: bool = False,
        jobs: int | None = None, quiet: bool = False, pool: Pool | None = None,
        limit: float | None = None, save: Save | None = None) -> Findings:  # fmt: skip
    """Bring a study's dataset, figures and findings up to date; returns the findings.

    `quick` is the coarse grid, `full` the longest one of a study that has it; `limit` is the time a case may take, in
    seconds (the study's own by default); `save` writes figures to files, and without it none are drawn. Cases that fail
    are named in ``failures``, recorded beside the others with their traceback, and tried again the next time.
    Raises SymtopError if the results cannot be written or nothing could be measured.
    """
    with Pool(jobs) if pool is None else contextlib.nullcontext(pool) as own:
        return start(
            study, results, own, quick=quick, full=full, fresh=fresh, quiet=quiet, limit=limit, save=save
        ).result()


def start(study: Study, results: Path, pool: Pool, *, quick: bool = False, full: bool = False,
          fresh: bool = False, quiet: bool = False, limit: float | None = None, save: Save | None = None,
          beside: bool = False) -> Started:  # fmt: skip
    """Compute the cases of a study that are missing; what is returned waits for its findings (see `run`).

    They are made when they are asked for, or `beside` the cases of the next study, in a worker.
    """
    began = time.monotonic()
    results = results.resolve()
    seconds = study.limit if limit is None else positive("limit", limit)
    store.prepare(results, study)
    cases = StudyCases(study, results)
    first = cases.add(study.grid(quick=quick, full=full))
    drawing = drawing_digest(study, save)
    made_of = hashed(*sorted(path.name for path in first), drawing)
    if not fresh and manifest.is_current(results, study.name, made_of):
        known = store.read_json(results / f"{study.name}.json")
        if isinstance(known, dict):
            return Started(lambda: known | {"computed": 0, "seconds": time.monotonic() - began})
    try:
        for new in (lambda: first, lambda: cases.add(cases.second_round())):
            cases.compute(cases.missing(new(), fresh=fresh), pool, seconds, fresh=fresh, quiet=quiet)
    except BaseException:
        pool.close()  # before what its processes have left is removed
        store.tidy(results, study)
        raise
    local = any(plugins.is_local(name) for case in cases.cases.values() for name in case.names)
    script = str(file_of(study.name))
    future = None
    if beside and pool.jobs > 1 and not local and study is load(script):
        work = Analysis(
            script, results, cases.cases, cases.failures, tuple(plugins.loaded()), made_of, drawing, save, quick
        )
        cases.data.clear()  # the worker reads the files
        future = pool.analyse(analyse_stored, work)
    computing = time.monotonic() - began

    def result() -> Findings:
        begin = time.monotonic()
        with beating(progress_bar(f"{study.name}: combining and drawing", quiet=quiet)):
            findings = None
            with contextlib.suppress(BrokenExecutor, CancelledError, ProcessExpired):  # its process was ended
                findings = None if future is None else future.result()
            if findings is None:
                cases.read_all()
                findings = analyse(cases, made_of, save, quick=quick)
        return findings | {"computed": cases.computed, "seconds": computing + time.monotonic() - begin}

    return Started(result, lambda: future is None or future.done())
