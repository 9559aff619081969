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
from symtop.runner.execute import execute
from symtop.runner.pools import Workers
from symtop.runner.scripts import file_of
from symtop.runner.study import Case, Combined, Study, StudyError, door
from symtop.runner.work import Result, Task


def progress_bar(words: str, *, quiet: bool, **options: Any) -> Any:
    """A progress bar, or without a total the words alone, where somebody is watching."""
    unseen = quiet or not is_terminal(sys.stderr)
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
        try:
            paths = store.case_paths(self.results, self.study, asked)
        except Exception as error:
            flawed = self.study.flawed(asked)
            if flawed is not None:
                raise flawed from error
            if self.study.uses is not None:
                with door(self.study.name, "uses"):
                    for case in asked:
                        self.study.uses(case)
            raise
        new = dict(zip(paths, asked, strict=True))
        self.paths |= new
        return new

    def missing(self, new: dict[Path, Case], *, fresh: bool) -> dict[Path, Case]:
        """Those of the cases that have to be computed."""
        if not fresh:
            self.look(new)
        return {path: case for path, case in new.items() if path not in self.done}

    def follow_up(self, *, fresh: bool) -> dict[Path, Case]:
        """Take the second round in, made from what the first one found; returns those that have to be computed."""
        return {} if self.study.follow_up is None else self.add(self.study.later(self.combined()), fresh=fresh)

    def look(self, paths: Iterable[Path]) -> None:
        """Read the files that are there and whole."""
        loaded = {path: data for path in paths if (data := store.load_case(path)) is not None}
        self.done |= {path: (self.paths[path], data) for path, data in loaded.items()}

    def look_again(self) -> None:
        """Read what was not read; what was computed and is gone has failed, for the study would be drawn without it."""
        self.look(self.paths.keys() - self.done.keys())
        for path in self.paths.keys() - self.done.keys():
            if not store.failure_path(path).is_file():
                case = self.paths[path]
                self.failures.append(f"{case.integrator} on {case.scene} failed: its file {path.name} is gone")

    def compute(self, missing: dict[Path, Case], workers: Workers, limit: float, *, fresh: bool, quiet: bool) -> None:
        """Have cases computed, with a progress bar where somebody is watching.

        A file is read in 20 ms. If a second round hangs on them, they are read while others are computed; if not, by
        whoever concludes the study.
        """
        script = str(file_of(self.study.name))
        tasks = [Task(script, case, str(path), tuple(plugins.loaded()), limit, fresh) for path, case in missing.items()]
        with beating(progress_bar(self.study.name, quiet=quiet or not tasks, total=len(tasks), unit="case")) as bar:

            def on_result(task: Task, result: Result) -> None:
                if self.study.follow_up is not None:
                    self.look([Path(task.path)])
                if result.state == "failed":
                    self.failures.append(result.message)
                    bar.set_postfix_str(f"{len(self.failures)} failed", refresh=False)
                self.computed += result.state == "computed"
                bar.update()

            execute(self.study, tasks, workers, on_result)

    def combined(self) -> Combined:
        """One dataset of all that was measured, or a tree of one for each group of cases."""
        if not self.done:
            why = self.failures[0] if self.failures else "the grid is empty"
            raise StudyError(f"study {self.study.name}: no case could be measured; {why}")
        with door(self.study.name, "combining what measure returned"):
            return store.combine([self.done[path] for path in self.paths if path in self.done])
