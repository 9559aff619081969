"""What ``symtop study`` does: run, show the status of, or check several studies, and end with a code."""

import contextlib
import json
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

import click

from symtop.base.validate import SymtopError
from symtop.runner import check, run, scripts
from symtop.runner.pools import Workers
from symtop.runner.study import Study

INTERRUPTED, TERMINATED = 130, 143  # 128 and the number of the signal, as shells have it


class Options(NamedTuple):
    """Options of the command."""

    results: Path
    quick: bool = False
    full: bool = False
    fresh: bool = False
    jobs: int | None = None
    scheduler: str | None = None
    limit: float | None = None
    as_json: bool = False


def choose(names: Sequence[str], *, every: bool) -> list[Study]:
    """The studies of those names, each once, or all of them."""
    chosen = scripts.names() if every else list(dict.fromkeys(names))
    if not chosen:
        raise SymtopError(f"name a study or use --all; known: {', '.join(scripts.names())}")
    return [scripts.load(name) for name in chosen]


class _TerminatedError(BaseException):
    """Somebody has asked this process to end."""


@contextlib.contextmanager
def _heeding() -> Iterator[None]:
    """Let a request to end be heard as an interrupt is, so that partial files and workers are cleared away."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
        raise _TerminatedError

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def conduct(task: Callable[[list[Study], Options, Workers], int], studies: list[Study], options: Options) -> int:
    """Do a task with workers; returns the exit code."""
    try:
        with _heeding(), Workers(options.jobs, options.scheduler) as workers:
            return task(studies, options, workers)
    except (KeyboardInterrupt, _TerminatedError) as stop:
        code = INTERRUPTED if isinstance(stop, KeyboardInterrupt) else TERMINATED
        word = "interrupted" if code == INTERRUPTED else "terminated"
        click.echo(f"symtop: {word}; what was computed is kept, and the same command goes on from there", err=True)
        return code


def run_all(studies: list[Study], options: Options, workers: Workers) -> int:
    """Bring studies up to date."""
    said: list[dict[str, Any]] = []
    for study in studies:
        found = run.run(
            study, options.results, quick=options.quick, full=options.full, fresh=options.fresh, workers=workers,
            limit=options.limit,
        )  # fmt: skip
        said.append({key: found[key] for key in ("study", "cases", "computed", "failures", "verdict")})
        said[-1].update(figures=len(found["pictures"]), seconds=round(found["seconds"], 3))
        if not options.as_json:
            click.echo(
                f"{study.name}: {found['computed']} of {found['cases']} cases computed, "
                f"{len(found['pictures'])} figures"
            )
        for failure in found["failures"]:
            click.echo(f"  {failure}", err=True)
    if options.as_json:
        click.echo(json.dumps(said, indent=1))
    return 1 if any(entry["failures"] for entry in said) else 0


def show_status(studies: list[Study], options: Options) -> int:
    """Say what is known of every case; 1 if some have failed."""
    found = {
        study.name: run.status(study, options.results, quick=options.quick, full=options.full) for study in studies
    }
    if options.as_json:
        click.echo(json.dumps(found, indent=1))
    for name, rows in {} if options.as_json else found.items():
        counts = {state: sum(row["state"] == state for row in rows) for state in run.STATES}
        click.echo(f"{name}: " + ", ".join(f"{count} {state}" for state, count in counts.items() if count))
        for row in rows:
            if row["state"] != run.DONE:
                said = f": {row['message']}" if row["message"] else ""
                click.echo(f"  {row['state']:<8} {row['integrator']} on {row['scene']}{said}")
    return 1 if any(row["state"] == run.FAILED for rows in found.values() for row in rows) else 0


def check_all(studies: list[Study], options: Options, workers: Workers) -> int:
    """Compute stored cases again and compare; 1 if anything is different."""
    found = [
        check.check(study, options.results, workers, quick=options.quick, full=options.full, everything=options.fresh)
        for study in studies
    ]
    if not any(entry.stored for entry in found):
        raise SymtopError(
            f"no case of {', '.join(study.name for study in studies)} is up to date in {options.results}; run it first"
        )
    if options.as_json:
        click.echo(json.dumps([entry._asdict() for entry in found], indent=1))
    for entry in [] if options.as_json else found:
        click.echo(f"{entry.study}: {entry.compared} of {entry.stored} cases computed again, {entry.verdict()}")
        for difference in entry.differences:
            click.echo(f"  {difference}", err=True)
    return 1 if any(entry.differences for entry in found) else 0
