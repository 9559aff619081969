"""The command ``symtop study``: run several studies, show their status, or check them; ends with an exit code."""

import json
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click

from symtop.base.signals import INTERRUPTED, TERMINATED, TerminatedError, ending_on_sigterm
from symtop.base.validate import SymtopError
from symtop.cli.common import warn
from symtop.runner import check, run, scripts, status
from symtop.runner.pools import Workers
from symtop.runner.study import Study

MOST_NAMED = 8  # integrators and scenes in a line of the status


def choose(names: Sequence[str], *, every: bool) -> list[Study]:
    """The studies of those names, each once, or all of them."""
    chosen = scripts.names() if every else list(dict.fromkeys(names))
    if not chosen:
        raise SymtopError(f"name a study or use --all; known: {', '.join(scripts.names())}")
    return [scripts.load(name) for name in chosen]


def conduct(task: Callable[[Workers], int], jobs: int | None, scheduler: str | None) -> int:
    """Do a task with workers; returns the exit code."""
    try:
        with ending_on_sigterm(), Workers(jobs, scheduler) as workers:
            return task(workers)
    except (KeyboardInterrupt, TerminatedError) as stop:
        word, code = ("interrupted", INTERRUPTED) if isinstance(stop, KeyboardInterrupt) else ("terminated", TERMINATED)
        warn(f"{word}; what was computed is kept, and the same command goes on from there")
        return code


def run_all(
    workers: Workers, studies: list[Study], results: Path, fresh: bool, limit: float | None, as_json: bool, **grid: bool
) -> int:
    """Bring studies up to date; 1 if cases failed."""
    from symtop.report import style

    summaries: list[dict[str, Any]] = []
    for study in studies:
        findings = run.run(study, results, fresh=fresh, workers=workers, limit=limit, save=style.save, **grid)
        summary = {key: findings[key] for key in ("study", "cases", "computed", "failures", "verdict")}
        summary |= {"figures": len(findings["pictures"]), "seconds": round(findings["seconds"], 3)}
        summaries.append(summary)
        if not as_json:
            click.echo("{study}: {computed} of {cases} cases computed, {figures} figures".format(**summary))
        for failure in findings["failures"]:
            click.echo(f"  {failure}", err=True)
    if as_json:
        click.echo(json.dumps(summaries, indent=1))
    return 1 if any(summary["failures"] for summary in summaries) else 0


def show_status(studies: list[Study], results: Path, why: bool, as_json: bool, **grid: bool) -> int:
    """Show the state of every case, and with `why` the reason; 1 if some have failed."""
    states = {study.name: status.status(study, results, why=why, **grid) for study in studies}
    if as_json:
        click.echo(json.dumps(states, indent=1))
    for name, rows in {} if as_json else states.items():
        counts = Counter(row["state"] for row in rows)
        click.echo(f"{name}: " + ", ".join(f"{counts[state]} {state}" for state in status.STATES if counts[state]))
        open_rows = [row for row in rows if row["state"] != status.DONE]
        for line in _grouped(open_rows) if why else _one_by_one(open_rows):
            click.echo(f"  {line}")
    return 1 if any(row["state"] == status.FAILED for rows in states.values() for row in rows) else 0


def _one_by_one(rows: list[dict[str, Any]]) -> list[str]:
    return [
        f"{row['state']:<8} {row['integrator']} on {row['scene']}" + (f": {row['message']}" if row["message"] else "")
        for row in rows
    ]


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


def check_all(
    workers: Workers, studies: list[Study], results: Path, everything: bool, as_json: bool, **grid: bool
) -> int:
    """Compute stored cases again and compare; 1 if anything is different."""
    checks = [check.check(study, results, workers, everything=everything, **grid) for study in studies]
    if not any(entry.stored for entry in checks):
        names = ", ".join(study.name for study in studies)
        raise SymtopError(f"no case of {names} is up to date in {results}; run it first")
    if as_json:
        click.echo(json.dumps([entry._asdict() for entry in checks], indent=1))
    for entry in [] if as_json else checks:
        click.echo(f"{entry.study}: {entry.compared} of {entry.stored} cases computed again, {entry.verdict()}")
        for difference in entry.differences:
            click.echo(f"  {difference}", err=True)
    return 1 if any(entry.differences for entry in checks) else 0
