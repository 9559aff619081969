"""The runner: computes the cases that are missing, combines them, draws, and writes the findings.

A case is computed only if no file holds its digest, so that an interrupted study resumes and an unchanged one
ends in seconds. Cases share all cores, and timed ones too if a trial shows that they do
not disturb each other (`trial`); else these run alone. A study may have a second round of cases, made
from what the first one found. Two runs may share one folder: each case is computed by one of them. How a picture is
written to a file is the caller's choice (`Save`): this room knows no style.
"""

import contextlib
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, CancelledError
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from symtop.core import code_hash
from symtop.core.errors import positive
from symtop.core.progress import beating
from symtop.runner import plugins, scripts, seen, store
from symtop.runner.cases import Round, progress_bar
from symtop.runner.conclude import Asked, Save, code_of, conclude, conclude_stored
from symtop.runner.pools import Workers
from symtop.runner.scripts import file_of, folder, load, names
from symtop.runner.study import Study

__all__ = ["begin", "folder", "load", "names", "run"]

Findings = dict[str, Any]


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
        limit: float | None = None, save: Save | None = None) -> Findings:  # fmt: skip
    """Bring a study's dataset, figures and findings up to date; returns the findings.

    `quick` is the coarse grid, `full` the longest one of a study that has it; `limit` is the time a case may take, in
    seconds (the study's own by default); `save` writes figures to files, and without it none are drawn. Cases that fail
    are named in ``failures``, recorded beside the others with their traceback, and tried again the next time.
    Raises SymtopError if the results cannot be written or nothing could be measured.
    """
    with Workers(jobs) if workers is None else contextlib.nullcontext(workers) as hired:
        return begin(study, results, hired, quick=quick, full=full, fresh=fresh, quiet=quiet, limit=limit, save=save)()


def begin(study: Study, results: Path, workers: Workers, *, quick: bool = False, full: bool = False,
          fresh: bool = False, quiet: bool = False, limit: float | None = None, save: Save | None = None,
          beside: bool = False) -> "Begun":  # fmt: skip
    """Compute the cases of a study that are missing; what is returned waits for its findings (see `run`).

    They are made when it is called, or `beside` the untimed cases that are computed until then, in a process of their
    own.
    """
    began = time.monotonic()
    results = results.resolve()
    seconds = study.limit if limit is None else positive("limit", limit)
    store.prepare(results, study)
    cases = Round(study, results)
    first = cases.named(study.grid(quick=quick, full=full))
    code = code_of(study, save)
    stamp = code_hash.hashed(*sorted(path.name for path in first), code)  # of what the findings depend on
    before = _drawn(study, results, stamp)
    if before is not None and not fresh and seen.untouched(results, study, stamp, first):
        return _known(before, began)
    beside = beside and workers.jobs > 1 and not _is_local(cases) and study is scripts.load(str(file_of(study.name)))
    missing = cases.missing(first, fresh=fresh)
    later = None if missing else cases.follow_up(fresh=fresh)  # not known before the first round is done
    if before is not None and later == {} and seen.dataset_untouched(results, study, stamp):
        seen.note(results, study, stamp, cases.paths)
        return _known(before, began)
    try:
        if beside and missing:
            workers.open_beside()
        cases.compute(missing, workers, seconds, fresh=fresh, quiet=quiet)
        later = cases.follow_up(fresh=fresh) if later is None else later
        cases.compute(later, workers, seconds, fresh=fresh, quiet=quiet)
    except BaseException:
        workers.close()  # before what its processes have left is removed
        store.tidy(results, study)
        raise
    return _concluding(cases, workers, (stamp, code), save, began, quick=quick, quiet=quiet, beside=beside)


@dataclass(frozen=True)
class Begun:
    """A study whose cases are computed: called, it waits for the findings; are they `ready`?"""

    findings: Callable[[], Findings]
    ready: Callable[[], bool] = lambda: True

    def __call__(self) -> Findings:
        """The findings, waited for."""
        return self.findings()


def _known(before: Findings, began: float) -> Begun:
    answer = {**before, "computed": 0, "seconds": time.monotonic() - began}
    return Begun(lambda: answer)


def _concluding(
    cases: Round,
    workers: Workers,
    made_of: tuple[str, str],  # the stamp, and the code in it
    save: Save | None,
    began: float,
    *,
    quick: bool,
    quiet: bool,
    beside: bool,
) -> Begun:
    """What waits for the findings of a study whose cases are computed."""
    study, results = cases.study, cases.results
    told = None
    if beside:
        script = str(file_of(study.name))
        asked = Asked(script, results, cases.paths, cases.failures, tuple(plugins.loaded()), *made_of, save, quick)
        cases.done.clear()  # its process reads the files
        told = workers.beside(conclude_stored, asked)
    computing = time.monotonic() - began

    def findings() -> Findings:
        start = time.monotonic()
        with beating(progress_bar(f"{study.name}: combining and drawing", quiet=quiet)):
            try:
                made = None if told is None else told.result()
            except (BrokenExecutor, CancelledError):  # its process was ended
                made = None
            if made is None:
                cases.look_again()
                made = conclude(cases, made_of[0], save, quick=quick)
        return {**made, "computed": cases.computed, "seconds": computing + time.monotonic() - start}

    return Begun(findings, lambda: told is None or told.done())


def _is_local(cases: Round) -> bool:
    """Does this process alone know an integrator or a scene of theirs?"""
    return any(plugins.is_local(name) for case in cases.paths.values() for name in case.names)
