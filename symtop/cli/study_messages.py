"""What ``symtop study`` says of studies that were run, or of studies with which there was nothing to do."""

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from symtop.cli.common import as_text, terminal_width
from symtop.report.sentences import counted

MOST_TOLD = 3  # sentences of a study that has run


def study(findings: dict[str, Any], results: Path, *, as_json: bool) -> dict[str, Any]:
    """Say what a study found, unless it is said as JSON; returns its summary."""
    _check(findings)
    summary = {key: findings[key] for key in ("study", "cases", "computed", "failures", "verdict")}
    summary |= {"figures": len(findings["pictures"]), "seconds": round(findings["seconds"], 3)}
    if not as_json:
        drawn = counted(summary["figures"], "figure")
        click.echo("{study}: {computed} of {cases} cases computed, {drawn}".format(drawn=drawn, **summary))
        _sentences(findings, results)
    for failure in findings["failures"]:
        click.echo(f"  {failure}", err=True)
    return summary


def _check(findings: dict[str, Any]) -> None:
    """Refuse findings that are no sentences, which older versions have stored."""
    verdict = findings["verdict"]
    if not isinstance(verdict, list) or not all(isinstance(sentence, str) for sentence in verdict):
        from symtop.runner.study import sentences  # xarray: half a second

        sentences(findings["study"], lambda: verdict)


def end(summaries: Sequence[dict[str, Any]], results: Path, *, as_json: bool) -> None:
    """Say what to do next, or all summaries as JSON."""
    if as_json:
        click.echo(as_text(summaries))
    elif summaries:
        click.echo(f"next: symtop report --results {results}, one page of all findings")


def _sentences(findings: dict[str, Any], results: Path) -> None:
    """The first sentences of what a study found, and where the rest is."""
    verdict, name = findings["verdict"], findings["study"]
    for sentence in verdict[:MOST_TOLD]:
        click.echo(indented(sentence, "  - "))
    left = len(verdict) - MOST_TOLD
    more = f", {counted(left, 'more finding')} in {name}.json" if left > 0 else ""
    pictures = f"figures {results / 'figures' / name}-*{more}" if findings["pictures"] else more.lstrip(", ")
    for line in filter(None, (f"dataset {results / name}.nc", pictures)):
        click.echo(indented(line, "  "))


def indented(line: str, first: str) -> str:
    """A line in as many as fit the terminal."""
    return textwrap.fill(
        line, terminal_width(), initial_indent=first, subsequent_indent="    ", break_on_hyphens=False,
        break_long_words=False,
    )  # fmt: skip
