"""The command ``symtop study``: run several studies, show their status, or check them; ends with an exit code."""

from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import click

from symtop.cli import study_messages
from symtop.cli.common import as_text, warn
from symtop.core.errors import SymtopError
from symtop.core.signals import INTERRUPTED, TERMINATED, TerminatedError, ending_on_sigterm
from symtop.methods.framework.registry import integrator
from symtop.runner import check, manifest, run, scripts, status, store
from symtop.runner.pool import Pool
from symtop.runner.study import Study, StudyError

MOST_NAMED = 8  # integrators and scenes in a line of the status


def choose(names: Sequence[str], *, every: bool, only: Sequence[str] = (), quick: bool = False) -> list[Study]:
    """The studies of those names, each once, or all of them; of some integrators alone if `only` names them.

    Of several studies those that have no case of these integrators are told of and left out.
    """
    _agree(names, every=every)
    chosen = scripts.names() if every else list(dict.fromkeys(names))
    if not chosen:
        raise SymtopError(f"name a study or use --all; known: {', '.join(scripts.names())}")
    for name in only:
        integrator(name)  # refused with the nearest names if there is none
    studies = [scripts.load(name) for name in chosen]
    if not only:
        return studies
    narrowed = [study.only(only) for study in studies]
    without = dict[str, SymtopError]()
    for study in narrowed:
        try:
            study.grid(quick=quick)
        except SymtopError as error:
            without[study.name] = error
    if len(without) == len(narrowed):
        raise next(iter(without.values()))
    for reason in without.values():
        warn(f"{reason}; it is left out")
    return [study for study in narrowed if study.name not in without]


def _agree(names: Sequence[str], *, every: bool) -> None:
    """Refuse options of which one would be ignored without a word."""
    if names and every:
        raise SymtopError(f"name studies or use --all, not both: {' '.join(names)} --all")
    context = click.get_current_context(silent=True)
    given = {} if context is None else context.params
    for other in ("check", "fresh"):
        if given.get("status") and given.get(other):
            raise SymtopError(f"--status and --{other} must not be given together: --status computes nothing")


def conduct(task: Callable[[Pool], int], jobs: int | None, scheduler: str | None) -> int:
    """Do a task with a pool; returns the exit code."""
    try:
        with ending_on_sigterm(), Pool(jobs, scheduler) as pool:
            return task(pool)
    except StudyError as error:  # said here: the names in it are no options of the command
        warn(str(error))
        return 2
    except (KeyboardInterrupt, TerminatedError) as stop:
        word, code = ("interrupted", INTERRUPTED) if isinstance(stop, KeyboardInterrupt) else ("terminated", TERMINATED)
        warn(f"{word}; what was computed is kept, and the same command goes on from there")
        return code


def run_all(
    pool: Pool, studies: list[Study], results: Path, fresh: bool, limit: float | None, as_json: bool,
    whole: bool = False, **grid: bool,
) -> int:  # fmt: skip
    """Bring studies up to date, each concluded while the next one is computed; 1 if cases failed."""
    from symtop.report import style

    sources = manifest.sources_hash() if whole else ""  # before an edit of the code may change it
    save = style.sketch if grid.get("quick") else style.publish  # quick figures are to look at, not to print
    options = {"fresh": fresh, "limit": limit, "save": save, "beside": len(studies) > 1, **grid}
    ended = _in_order(pool, studies, results, options)
    summaries = [study_messages.study(findings, results, as_json=as_json) for findings in ended]
    failed = any(summary["failures"] for summary in summaries)
    if whole and not failed:
        manifest.note_all(results.resolve(), [study.name for study in studies], grid_name(**grid), sources)
    study_messages.end(summaries, results, as_json=as_json)
    return 1 if failed else 0


def grid_name(*, quick: bool, full: bool) -> str:
    """The word for a grid."""
    return "quick" if quick else "full" if full else "ordinary"


def _in_order(pool: Pool, studies: list[Study], results: Path, options: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The findings of studies in their order, while later ones are computed; then what stopped one, if any."""
    started: deque[tuple[Study, run.Started]] = deque()
    refused: list[SymtopError] = []
    try:
        for study in studies:
            try:
                started.append((study, run.start(study, results, pool, **options)))
            except SymtopError as error:
                refused.append(error)
                break
            while len(started) > 1 and started[0][1].done():
                yield from _findings(started.popleft()[1], refused)
        while started:
            yield from _findings(started.popleft()[1], refused)
    except BaseException:
        pool.close()
        for study, _ in started:
            store.tidy(results.resolve(), study)
        raise
    if refused:
        raise refused[0]


def _findings(study: run.Started, refused: list[SymtopError]) -> Iterator[dict[str, Any]]:
    """The findings of a study; if it has none, as one that compares methods and was given one, the next ones go on."""
    try:
        findings = study.result()
    except StudyError as error:
        refused.append(error)
    else:
        yield findings


def show_status(studies: list[Study], results: Path, why: bool, as_json: bool, **grid: bool) -> int:
    """Show the state of every case, and with `why` the reason; 1 if some have failed."""
    try:
        states = {study.name: status.status(study, results, why=why, **grid) for study in studies}
    except StudyError as error:
        warn(str(error))
        return 2
    if as_json:
        click.echo(as_text(states))
    for name, rows in {} if as_json else states.items():
        counts = Counter(row["state"] for row in rows)
        click.echo(f"{name}: " + ", ".join(f"{counts[state]} {state}" for state in status.STATES if counts[state]))
        open_rows = [row for row in rows if row["state"] != status.DONE]
        for line in _grouped(open_rows) if why else _counted(open_rows):
            click.echo(study_messages.indented(line, "  "))
    return 1 if any(row["state"] == status.FAILED for rows in states.values() for row in rows) else 0


def _counted(rows: list[dict[str, Any]]) -> list[str]:
    """A line for each case that failed, and one for the stale and one for the missing ones of all scenes."""
    failed = [row for row in rows if row["state"] == status.FAILED]
    others = [[row for row in rows if row["state"] == state] for state in (status.STALE, status.MISSING)]
    return [
        *(f"failed: {row['integrator']} on {row['scene']}: {row['message']}" for row in failed),
        *(
            f"{group[0]['state']}: {_names(group, 'integrator')} on {_names(group, 'scene')}"
            for group in others if group
        ),
    ]  # fmt: skip


def _grouped(rows: list[dict[str, Any]]) -> list[str]:
    """A line for all cases that share a state and its reasons."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in rows:
        groups.setdefault((row["state"], row["message"] or ", ".join(row["why"])), []).append(row)
    return [
        f"{len(group)} {state}: {reason}: {_names(group, 'integrator')} on {_names(group, 'scene')}"
        for (state, reason), group in groups.items()
    ]


def _names(rows: list[dict[str, Any]], key: str) -> str:
    names = list(dict.fromkeys(row[key] for row in rows))
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more


def check_all(pool: Pool, studies: list[Study], results: Path, everything: bool, as_json: bool, **grid: bool) -> int:
    """Compute stored cases again and compare; 1 if anything is different."""
    checks = [check.check(study, results, pool, everything=everything, **grid) for study in studies]
    if not any(entry.stored for entry in checks):
        names = ", ".join(study.name for study in studies)
        raise SymtopError(f"no case of {names} is up to date in {results}; run it first")
    if as_json:
        click.echo(as_text([entry._asdict() for entry in checks]))
    for entry in [] if as_json else checks:
        click.echo(f"{entry.study}: {entry.compared} of {entry.stored} cases computed again, {entry.verdict()}")
        for difference in entry.differences:
            click.echo(f"  {difference}", err=True)
    return 1 if any(entry.differences for entry in checks) else 0
