"""The cases of a study: their states, computing those that are missing, and checking stored ones.

    done       a file holds the result of the present version
    failed     it failed, and is tried again by the next run
    stale      it was computed, and something that its numbers depend on has changed since
    missing    it was never computed with these settings

To say why a case is stale, the hashes of its dependencies are stored in its file and compared with the present ones by
label. A stored case that is computed again (`check`) must agree to the last bit except for measured times: nothing here
is random and no file holds a date.
"""

import json
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import xarray as xr

from symtop.core import code_hash, netcdf
from symtop.core.progress import post, progress_bar
from symtop.measure.datasets import Combined, combine, differences
from symtop.run import plugins
from symtop.runner import fingerprint, store
from symtop.runner.pool import Pool, Result, Task
from symtop.runner.scripts import file_of
from symtop.runner.study import Case, Study, StudyError, failing

DONE, FAILED, STALE, MISSING = STATES = ("done", "failed", "stale", "missing")
LONGEST_LIMIT = 1e9  # seconds: largest limit of a case; the timers of a process take up to ten times as many
CHECKED_CASES = 5  # cases of each study that are checked


@dataclass
class StudyCases:
    """Cases of a study by their files, the datasets of stored ones, messages of failed ones, the number computed."""

    study: Study
    results: Path
    cases: dict[Path, Case] = field(default_factory=dict)
    data: dict[Path, xr.Dataset] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)
    computed: int = 0

    @classmethod
    def stored(cls, study: Study, results: Path, *, quick: bool, full: bool) -> Self:
        """The cases of a study with their stored datasets; the second round only if the first one is complete."""
        cases = cls(study, results.resolve())
        for new in cases.rounds(quick=quick, full=full):
            if cases.missing(new):
                break
        return cases

    def rounds(self, *, quick: bool, full: bool) -> Iterator[dict[Path, Case]]:
        """The cases of the first round by their files, then those of the second round, if there is one."""
        yield self.add(self.study.grid(quick=quick, full=full))
        if self.study.follow_up is not None:
            yield self.add(self.study.later(self.combined()))

    def add(self, cases: Iterable[Case]) -> dict[Path, Case]:
        """Add cases; returns them by their files."""
        new = {store.case_path(self.results, self.study, case): case for case in cases}
        self.cases |= new
        return new

    def missing(self, cases: dict[Path, Case], *, fresh: bool = False) -> dict[Path, Case]:
        """Those of the cases that have to be computed; the others are read."""
        if not fresh:
            self.read(cases)
        return {path: case for path, case in cases.items() if path not in self.data}

    def read(self, paths: Iterable[Path]) -> None:
        """Read the files that exist and are not damaged."""
        for path in paths:
            if path not in self.data and (data := store.load_case(path)) is not None:
                self.data[path] = data

    def read_all(self) -> None:
        """Read all other files; a case without a file and without a recorded failure counts as failed."""
        self.read(self.cases)
        for path in self.cases.keys() - self.data.keys():
            if not store.failure_path(path).is_file():
                case = self.cases[path]
                self.failures.append(f"{case.integrator} on {case.scene} failed: its file {path.name} is gone")

    def compute(self, missing: dict[Path, Case], pool: Pool, limit: float, *, fresh: bool, quiet: bool) -> None:
        """Compute cases in a pool, with a progress bar on a terminal."""
        script, files, seconds = str(file_of(self.study.name)), plugins.loaded(), min(limit, LONGEST_LIMIT)
        tasks = [Task(script, case, path, files, seconds, fresh) for path, case in missing.items()]
        before = self.computed + len(self.failures)
        with progress_bar(self.study.name, quiet=quiet or not tasks, total=len(tasks), unit="case") as bar:

            def on_result(task: Task, result: Result) -> None:
                if self.study.follow_up is not None:  # the second round needs the data; read while others run
                    self.read([task.path])
                if result.state == "failed":
                    self.failures.append(result.message)
                    bar.set_postfix_str(f"{len(self.failures)} failed", refresh=False)
                self.computed += result.state == "computed"
                count = self.computed + len(self.failures) - before
                post(f"{self.study.name}: {count} of {len(tasks)} cases")
                bar.update()

            if tasks:
                timed = all(self.study.is_timed(task.case) for task in tasks)
                first = "measuring times" if timed else "first compiling kernels that no file holds"
                post(f"{self.study.name}: 0 of {len(tasks)} cases, {first}")
            pool.run(self.study, tasks, on_result)

    def combined(self) -> Combined:
        """One dataset of all that was measured, or a tree of one for each group of cases."""
        if not self.data:
            why = self.failures[0] if self.failures else "the grid is empty"
            raise StudyError(f"study {self.study.name}: no case could be measured; {why}")
        with failing(self.study.name, "combining what measure returned"):
            return combine([(case, self.data[path]) for path, case in self.cases.items() if path in self.data])


def status(
    study: Study, results: Path, *, quick: bool = False, full: bool = False, why: bool = False
) -> list[dict[str, Any]]:
    """Scene, integrator, state and message of every case; with `why` also the changes for stale and missing ones."""
    cases = StudyCases.stored(study, results, quick=quick, full=full)
    stored = store.stored(cases.results, study)
    older: dict[str, list[Path]] = {}
    for old in store.superseded(stored, cases.cases):
        older.setdefault(store.identity_of(old), []).append(old)
    rows = []
    for path, case in cases.cases.items():
        record = netcdf.read_json(store.failure_path(path))
        earlier = older.get(store.identity_of(path), [])
        state, message, causes = DONE, "", list[str]()
        if path not in cases.data:
            state = FAILED if isinstance(record, dict) else STALE if earlier else MISSING
        if state == FAILED:
            message = str(record.get("message", ""))
        elif why and state == STALE:
            before = _attribute(max(earlier, key=lambda old: old.stat().st_mtime), "made_of")
            causes = code_hash.changes(before, fingerprint.reasons(study, case))
        elif why and state == MISSING:
            causes = other_settings(study, case, stored)
        row = {"scene": case.scene, "integrator": case.integrator, "state": state, "message": message}
        rows.append(row | ({"why": causes} if why else {}))
    return rows


def other_settings(study: Study, case: Case, stored: list[Path]) -> list[str]:
    """The settings and dependencies in which a case differs from the most similar stored one of its label."""
    similar = [path for path in stored if store.identity_of(path).rpartition("--")[0] == case.label]
    settings, hashes = json.loads(json.dumps(dict(case.settings))), fingerprint.reasons(study, case)
    differing = [
        [f"setting {name}" for name in sorted({*old, *settings}) if old.get(name, "") != settings.get(name, "")]
        + [label for label in code_hash.changes(before, hashes) if label != "settings"]
        for old, before in ([_attribute(path, name) for name in ("settings", "made_of")] for path in similar)
    ]
    return min(differing, key=len, default=["never computed"])


def _attribute(path: Path, name: str) -> dict[str, Any]:
    """A mapping in the attributes of a case's file; empty if the file is damaged or of another program."""
    content = getattr(store.load_case(path), "attrs", {}).get(name)
    return content if isinstance(content, dict) else {}


def check(
    study: Study, results: Path, pool: Pool, *, quick: bool = False, full: bool = False, everything: bool = False,
    limit: float | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Compute `CHECKED_CASES` cases, or all, again, and the dataset; ``stored``, ``compared``, ``differences``."""
    cases = StudyCases.stored(study, results, quick=quick, full=full)
    # in the order of their digests, so that the sample is spread over the grid
    stored = sorted(cases.data.items(), key=lambda item: store.digest_of(item[0]))
    sample = {path.name: data for path, data in stored[: None if everything else CHECKED_CASES]}
    with tempfile.TemporaryDirectory(prefix="symtop-check-") as folder:
        rerun = StudyCases(study, Path(folder).resolve())
        missing = rerun.add(case for path, case in cases.cases.items() if path.name in sample)
        rerun.compute(missing, pool, limit or study.limit, fresh=False, quiet=True)
        rerun.read(missing)
    differing = rerun.failures
    for path, data in rerun.data.items():
        label = f"{rerun.cases[path].integrator} on {rerun.cases[path].scene}"
        differing += [f"{label}: {text}" for text in differences(sample[path.name], data)]
    file = results / f"{study.name}.nc"
    if file.is_file() and len(stored) == len(cases.cases):
        texts = differences(netcdf.read_any(file), cases.combined(), attributes=False)
        differing += [f"{file.name}: {text}" for text in texts]
    return {"study": study.name, "stored": len(stored), "compared": len(sample), "differences": differing}
