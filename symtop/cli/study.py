"""``symtop study``, ``report`` and ``archive``: run studies, write the page of all findings, bundle all data."""

import shlex
import sys
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from symtop.cli import common
from symtop.cli.common import File, as_text, completing, json_option, plugin_option, results_option, separated
from symtop.core.errors import SymtopError, positive
from symtop.core.progress import showing_seconds
from symtop.core.signals import INTERRUPTED, TERMINATED, TerminatedError, ending_on_sigterm
from symtop.report.formats import abridged, counted

if TYPE_CHECKING:
    from symtop.runner.pool import Pool
    from symtop.runner.study import Study

MOST_NAMED = 8  # integrators and scenes in a line of the status


@click.command(short_help="Run studies: datasets, figures and findings.")
@click.argument("names", nargs=-1, shell_complete=completing("studies"))
@click.option("--all", "every", is_flag=True, help="Run every study.")
@click.option("--quick", is_flag=True, help="Coarse grids, some seconds a study, into the folder quick of the results.")
@click.option("--full", is_flag=True, help="The longest grid, for the studies that have one.")
@click.option("--fresh", is_flag=True, help="Compute every case again; with --check, compare every case.")
@click.option("--status", is_flag=True, help="Print the state of every case; compute nothing.")
@click.option("--why", is_flag=True, help="With --status: what has changed, one line for all cases with that reason.")
@click.option("--check", is_flag=True, help="Compute some stored cases again, in another folder, and compare.")
@click.option("--only", metavar="METHOD,...", callback=separated, help="Cases of these methods, into RESULTS/only.")
@click.option("--jobs", type=click.IntRange(1), help="Processes that compute cases; one a core by default.")
@click.option("--scheduler", metavar="ADDRESS", help="Compute cases that are not timed on this dask cluster.")
@click.option("--limit", type=float, metavar="SECONDS", help="Longest time of one case; an hour by default.")
@results_option
@json_option
@plugin_option
def study(
    names: tuple[str, ...], every: bool, fresh: bool, status: bool, why: bool, check: bool, only: list[str] | None,
    jobs: int | None, scheduler: str | None, limit: float | None, results: str, as_json: bool, **grid: bool,
) -> None:  # fmt: skip
    """Run studies by NAME: datasets, figures and findings into the results folder.

    NAME is the name of a study, or the path of a script of your own. Cases that are stored and up to date are not
    computed again. A case that fails is recorded and the others are computed (exit code 1). A run that is interrupted
    (exit code 130) or terminated (143) loses only the cases it was computing, and the same command resumes it. Two
    runs may share a folder.

    \b
    symtop study convergence drift
    symtop study --all --quick
    symtop study convergence --quick --only ralston-3 --plugin my_methods.py
    symtop study --all --status --why
    symtop study convergence --scheduler tcp://10.0.0.1:8786
    """
    clause = "must not be given together: --status computes nothing"
    for conflict, sentence in (
        (why and not status, "--why must be given together with --status"),
        (all(grid.values()), "--quick and --full must not be given together"),
        (names and every, f"name studies or use --all, not both: {' '.join(names)} --all"),
        (status and check, f"--status and --check {clause}"),
        (status and fresh, f"--status and --fresh {clause}"),
    ):
        if conflict:
            raise SymtopError(sentence)
    if limit is not None:
        positive("limit", limit)
    folder = Path(results, *filter(None, ("quick" * grid["quick"], "only" * bool(only))))
    studies = choose(names, every=every, only=only or (), quick=grid["quick"])
    if status:
        sys.exit(show_status(studies, folder, why, as_json, grid))
    from symtop.runner.pool import Pool

    try:
        with ending_on_sigterm(), Pool(jobs, scheduler) as pool:
            if check:
                code = check_all(pool, studies, folder, as_json, grid, everything=fresh, limit=limit)
            else:
                code = run_all(pool, studies, folder, as_json, grid, fresh=fresh, limit=limit)
    except (KeyboardInterrupt, TerminatedError) as stop:
        word, code = ("interrupted", INTERRUPTED) if isinstance(stop, KeyboardInterrupt) else ("terminated", TERMINATED)
        common.warn(f"{word}; what was computed is kept, and the same command goes on from there")
    sys.exit(code)


def choose(names: Sequence[str], *, every: bool, only: Sequence[str] = (), quick: bool = False) -> "list[Study]":
    """The studies of these names, each once, or all; restricted to cases of the integrators in `only`, if given."""
    from symtop.methods.framework.registry import integrator
    from symtop.runner import scripts

    if not (study_names := scripts.names() if every else list(dict.fromkeys(names))):
        raise SymtopError(f"name a study or use --all; known: {', '.join(scripts.names())}")
    for name in only:
        integrator(name)  # raises an error with similar names if there is none
    studies = [scripts.load(name) for name in study_names]
    if not only:
        return studies
    remaining, reasons = [], []
    for part in (study.only(only) for study in studies):
        try:
            part.grid(quick=quick)
            remaining.append(part)
        except SymtopError as error:
            reasons.append(error)
    if not remaining:
        raise reasons[0]
    for reason in reasons:
        common.warn(f"{reason}; it is left out")
    return remaining


def run_all(
    pool: "Pool", studies: "list[Study]", results: Path, as_json: bool, grid: dict[str, bool], **options: Any
) -> int:
    """Bring studies up to date; findings of each are made while the next one is computed; exit code 1 if cases fail."""
    from symtop.report import style

    save = style.sketch if grid["quick"] else style.publish  # quick figures are not for print
    options |= {"save": save, "beside": len(studies) > 1, **grid}
    summaries = [_summary(findings, results, as_json) for findings in _in_order(pool, studies, results, options)]
    if as_json:
        click.echo(as_text(summaries))
    elif summaries:
        click.echo(f"next: symtop report --results {shlex.quote(str(results))}, one page of all findings")
    return 1 if any(summary["failures"] for summary in summaries) else 0


def _in_order(pool: "Pool", studies: "list[Study]", results: Path, options: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the findings of studies in order, while later ones are computed; then raise the first error, if any."""
    from symtop.runner import run, store
    from symtop.runner.study import StudyError

    queue, errors = deque(studies), list[SymtopError]()
    waiting: deque[tuple[Any, Any]] = deque()  # (study, `PendingFindings`) whose findings have not been yielded
    try:
        while queue:
            study = queue.popleft()
            try:
                waiting.append((study, run.start(study, results, pool, **options)))
            except SymtopError as error:
                errors.append(error)
                queue.clear()
            while waiting and (not queue or (len(waiting) > 1 and waiting[0][1].done())):
                try:
                    yield waiting[0][1].result()
                except StudyError as error:  # this study has no findings; the others go on
                    _print_failures(waiting[0][1].failures, str(error))  # they may be the cause
                    errors.append(error)
                waiting.popleft()
    except BaseException:
        pool.close()
        for study, _ in waiting:
            store.tidy(results.resolve(), study)
        raise
    if errors:
        raise errors[0]


def _summary(findings: dict[str, Any], results: Path, as_json: bool) -> dict[str, Any]:
    """The summary of a study's findings for JSON; without JSON also print it, with its answer and its files."""
    from symtop.report.template import answer

    name = findings["study"]
    summary = {key: findings[key] for key in ("study", "cases", "computed", "failures", "facts")}
    summary |= {"figures": len(findings["pictures"]), "seconds": round(findings["seconds"], 3)}
    if not as_json:
        figures = counted(summary["figures"], "figure")
        click.echo("{study}: {computed} of {cases} cases computed, {drawn}".format(drawn=figures, **summary))
        files = [f"dataset {results / name}.nc", f"facts {results / name}.json"]
        for kind, key in (("figures", "pictures"), ("tables", "tables")):
            files += [f"{kind} {results / kind / name}-*"] * bool(findings[key])
        for line in (answer(findings, results), ", ".join(files)):
            if line:
                click.echo(common.filled(f"  {line}"))
    _print_failures(findings["failures"])
    return summary


def _print_failures(failures: Sequence[str], sentence: str = "") -> None:
    """Print the messages of failed cases, except one that `sentence` contains."""
    for failure in failures:
        if failure not in sentence:
            click.echo(f"  {failure}", err=True)


def show_status(studies: "list[Study]", results: Path, why: bool, as_json: bool, grid: dict[str, bool]) -> int:
    """Print the state of every case, and with `why` the reason; exit code 1 if some have failed."""
    from symtop.runner import cases

    states = {study.name: cases.status(study, results, why=why, **grid) for study in studies}
    for name, rows in {} if as_json else states.items():
        counts = Counter(row["state"] for row in rows)
        click.echo(f"{name}: " + ", ".join(f"{counts[state]} {state}" for state in cases.STATES if counts[state]))
        groups: dict[str, list[dict[str, Any]]] = {}  # cases that share a line
        for row in rows:
            if row["state"] != cases.DONE:
                reasons = filter(None, (row["state"], row["message"] or ", ".join(row.get("why", []))))
                groups.setdefault(": ".join(reasons), []).append(row)
        for reason, group in groups.items():
            count = f"{len(group)} " if why else ""
            methods, scenes = (list(dict.fromkeys(row[key] for row in group)) for key in ("integrator", "scene"))
            line = f"  {count}{reason}: {abridged(methods, MOST_NAMED)} on {abridged(scenes, MOST_NAMED)}"
            click.echo(common.filled(line))
    if as_json:
        click.echo(as_text(states))
    return 1 if any(row["state"] == cases.FAILED for rows in states.values() for row in rows) else 0


def check_all(
    pool: "Pool", studies: "list[Study]", results: Path, as_json: bool, grid: dict[str, bool], **options: Any
) -> int:
    """Compute stored cases again and compare; exit code 1 if anything differs."""
    from symtop.runner.cases import check

    checks = [check(study, results, pool, **options, **grid) for study in studies]
    if not any(entry["stored"] for entry in checks):
        names = ", ".join(study.name for study in studies)
        raise SymtopError(f"no case of {names} is up to date in {results}; run it first")
    if as_json:
        click.echo(as_text(checks))
    for entry in [] if as_json else checks:
        count = len(entry["differences"])
        verdict = counted(count, "difference") if count else "the same to the last bit, times aside"
        click.echo("{study}: {compared} of {stored} cases computed again, {verdict}".format(verdict=verdict, **entry))
        for difference in entry["differences"]:
            click.echo(f"  {difference}", err=True)
    return 1 if any(entry["differences"] for entry in checks) else 0


@click.command(short_help="Gather the findings of all studies into one page.")
@click.option("--embed", is_flag=True, help="Put the figures into the page, for sending it alone.")
@results_option
@plugin_option
def report(results: str, embed: bool) -> None:
    """Gather the findings of all studies into one page beside its figures.

    If the folder holds no findings of a study and its folder ``quick`` does, the page is made of those of ``quick``.
    """
    from symtop.report import page

    folder = Path(results)
    if not page.has_studies(folder) and page.has_studies(folder / "quick"):
        common.warn(f"{folder} holds no findings of a study; the report is made of those in {folder / 'quick'}")
        folder /= "quick"
    click.echo(f"report: {page.write(folder, embed=embed)}")


@click.command(short_help="Bundle all results for a repository of data.")
@click.option("--output", "-o", type=File(), help="The zip to write; in the results folder by default.")
@click.option("--test-set", is_flag=True, help="Write the test set of rigid bodies instead, a folder; takes a minute.")
@results_option
@plugin_option
def archive(results: str, output: str | None, *, test_set: bool) -> None:
    """Bundle datasets, findings and report with versions, machine, a description of every variable, and a test set.

    The test set holds the states of all scenes at ten times to 30 digits, for checking other programs. That of
    --test-set is for programs in any language: 20 bodies and 10 tops, 100 times each, with checkers in Python and C.

    \b
    symtop archive --test-set --output bodies
    """
    if test_set:
        from symtop.report.test_set import write

        if output is None:
            Path(results).mkdir(parents=True, exist_ok=True)
        with showing_seconds("computing the test set"):
            click.echo(f"test set: {write(output or Path(results) / 'test-set')}")
        return
    from symtop.report.archive import bundle

    file = bundle(Path(results), output)
    click.echo(f"archive: {file} ({file.stat().st_size / 1e6:.1f} MB)")
