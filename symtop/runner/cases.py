"""The cases of a study in one run of it: which are stored and which are missing, and computing those."""

import sys
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import xarray as xr
from tqdm import tqdm

from symtop.core.files import is_terminal
from symtop.core.progress import beating
from symtop.runner import plugins, store
from symtop.runner.execute_case import Result, Task
from symtop.runner.pool import Pool
from symtop.runner.scripts import file_of
from symtop.runner.study import Case, Combined, Study, StudyError, door


def progress_bar(words: str, *, quiet: bool, **options: Any) -> Any:
    """A progress bar, or without a total the words alone, where somebody is watching."""
    hidden = quiet or not is_terminal(sys.stderr)
    options = options or {"total": 1, "bar_format": "{desc}"}
    return tqdm(desc=words, disable=hidden, leave=False, **options)


@dataclass
class StudyCases:
    """Cases of a study by their files, the datasets of those that are stored, the failures, how many were computed."""

    study: Study
    results: Path
    cases: dict[Path, Case] = field(default_factory=dict)
    data: dict[Path, xr.Dataset] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)
    computed: int = 0

    @classmethod
    def stored(cls, study: Study, results: Path, *, quick: bool, full: bool) -> Self:
        """The cases of a study with what is stored of them; of the second round only if the first one is done."""
        cases = cls(study, results.resolve())
        if not cases.missing(cases.add(study.grid(quick=quick, full=full))):
            cases.missing(cases.add(cases.second_round()))
        return cases

    def add(self, cases: Iterable[Case]) -> dict[Path, Case]:
        """Take cases in; returns them by their files."""
        chosen = list(cases)
        try:
            paths = store.case_paths(self.results, self.study, chosen)
        except Exception as error:
            flawed = self.study.flawed(chosen)
            if flawed is not None:
                raise flawed from error
            if self.study.uses is not None:
                with door(self.study.name, "uses"):
                    for case in chosen:
                        self.study.uses(case)
            raise
        new = dict(zip(paths, chosen, strict=True))
        self.cases |= new
        return new

    def missing(self, cases: dict[Path, Case], *, fresh: bool = False) -> dict[Path, Case]:
        """Those of the cases that have to be computed; the others are read."""
        if not fresh:
            self.read(cases)
        return {path: case for path, case in cases.items() if path not in self.data}

    def second_round(self) -> list[Case]:
        """The cases that follow from what the first round found."""
        return [] if self.study.follow_up is None else self.study.later(self.combined())

    def read(self, paths: Iterable[Path]) -> None:
        """Read the files that are there and whole."""
        for path in paths:
            if path not in self.data and (data := store.load_case(path)) is not None:
                self.data[path] = data

    def read_all(self) -> None:
        """Read what was not read; what was computed and is gone has failed, for the study would be drawn without it."""
        self.read(self.cases)
        for path in self.cases.keys() - self.data.keys():
            if not store.failure_path(path).is_file():
                case = self.cases[path]
                self.failures.append(f"{case.integrator} on {case.scene} failed: its file {path.name} is gone")

    def compute(self, missing: dict[Path, Case], pool: Pool, limit: float, *, fresh: bool, quiet: bool) -> None:
        """Have cases computed, with a progress bar where somebody is watching."""
        script = str(file_of(self.study.name))
        tasks = [Task(script, case, path, tuple(plugins.loaded()), limit, fresh) for path, case in missing.items()]
        with beating(progress_bar(self.study.name, quiet=quiet or not tasks, total=len(tasks), unit="case")) as bar:

            def on_result(task: Task, result: Result) -> None:
                if self.study.follow_up is not None:  # read while others are computed
                    self.read([task.path])
                if result.state == "failed":
                    self.failures.append(result.message)
                    bar.set_postfix_str(f"{len(self.failures)} failed", refresh=False)
                self.computed += result.state == "computed"
                bar.update()

            pool.run(self.study, tasks, on_result)

    def combined(self) -> Combined:
        """One dataset of all that was measured, or a tree of one for each group of cases."""
        if not self.data:
            why = self.failures[0] if self.failures else "the grid is empty"
            raise StudyError(f"study {self.study.name}: no case could be measured; {why}")
        with door(self.study.name, "combining what measure returned"):
            return store.combine([(case, self.data[path]) for path, case in self.cases.items() if path in self.data])
