"""The command line: ``symtop integrators | scenes | run | long | ensemble | study | judge | report | ...``.

Exit codes: 0 fine; 1 a case or a check failed; 2 bad input, or a place that cannot be written; 3 a run ended early by
its outcome (its dataset was written); 130 and 143 it was interrupted or terminated (what a study had computed is kept).
A command imports heavy packages inside its function, so that ``symtop --help`` takes a tenth of a second.
"""

import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

import click

from symtop import __version__
from symtop.cli import cite, ensembles, judge, lists, runs, tools
from symtop.cli.common import PLUGINS, File, Group, json_option, plugin_option, results_option, tell_of_compiling, warn
from symtop.cli.completion import completing
from symtop.core.errors import SymtopError, positive


@click.group(cls=Group, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="symtop")
def main() -> None:
    """Integrators compared on the heavy symmetric top.

    \b
    symtop run spheroid midpoint --step-size 0.01
    symtop study convergence --quick
    symtop report
    """
    tell_of_compiling()


for command in (
    lists.integrators, lists.scenes, runs.run, runs.long, ensembles.ensemble, runs.claims, judge.judge,
    tools.recommend, tools.doctor, tools.explore, cite.cite,
):  # fmt: skip
    main.add_command(command)


@main.command(short_help="Run studies: datasets, figures and findings.")
@click.argument("names", nargs=-1, shell_complete=completing("studies"))
@click.option("--all", "every", is_flag=True, help="Run every study.")
@click.option(
    "--quick", is_flag=True, help="Coarse grids, a few seconds a study, into the folder quick of the results."
)
@click.option("--full", is_flag=True, help="The longest grid, for the studies that have one.")
@click.option("--fresh", is_flag=True, help="Compute every case again; with --check, compare every case.")
@click.option("--status", is_flag=True, help="Print the state of every case; compute nothing.")
@click.option("--why", is_flag=True, help="With --status: what has changed, one line for all cases with that reason.")
@click.option("--check", is_flag=True, help="Compute some stored cases again, in another folder, and compare.")
@click.option("--only", metavar="METHOD,...", help="Cases of these methods alone, into the folder only of the results.")
@click.option("--jobs", type=click.IntRange(1), help="Processes that compute cases; one a core by default.")
@click.option("--scheduler", metavar="ADDRESS", help="Compute cases that are not timed on this dask cluster.")
@click.option("--limit", type=float, metavar="SECONDS", help="Longest time of one case; an hour by default.")
@results_option
@json_option
@plugin_option
def study(
    names: tuple[str, ...], every: bool, quick: bool, full: bool, fresh: bool, status: bool, why: bool, check: bool,
    only: str | None, jobs: int | None, scheduler: str | None, limit: float | None, results: str, as_json: bool,
) -> None:  # fmt: skip
    """Run studies by NAME: datasets, figures and findings into the results folder.

    NAME is the name of a study, or the path of a script of your own. Cases that are stored and up to date are not
    computed again. A case that fails is recorded and the others are computed (exit code 1). A run that is interrupted
    (exit code 130) or terminated (143) loses only the cases it was computing, and the same command resumes it. Two
    runs may share a folder.

    \b
    symtop study convergence drift
    symtop study --all --quick
    symtop study convergence --quick --only my-rk --plugin my_methods.py
    symtop study --all --status --why
    symtop study convergence --scheduler tcp://10.0.0.1:8786
    """
    if why and not status:
        raise SymtopError("--why must be given together with --status")
    if quick and full:
        raise SymtopError("--quick and --full must not be given together")
    if limit is not None:
        positive("limit", limit)
    chosen = only.split(",") if only is not None else []
    folder = Path(results, *filter(None, ("quick" * quick, "only" * bool(chosen))))
    plain = not (names or only is not None or status or check or click.get_current_context().meta.get(PLUGINS))
    if every and plain and not fresh and not scheduler and _nothing_to_do(folder, quick, full, as_json):
        return
    from symtop.cli import study as command

    studies = command.choose(names, every=every, only=chosen, quick=quick)
    shared: Any = {"studies": studies, "results": folder, "as_json": as_json, "quick": quick, "full": full}
    if status:
        sys.exit(command.show_status(why=why, **shared))
    task = partial(command.check_all, everything=fresh) if check else partial(command.run_all, fresh=fresh, limit=limit,
                                                                              whole=every and plain)  # fmt: skip
    sys.exit(command.conduct(partial(task, **shared), jobs, scheduler))


def _nothing_to_do(results: Path, quick: bool, full: bool, as_json: bool) -> bool:
    """Is every study up to date? Then its findings are told."""
    from symtop.cli import study_messages
    from symtop.runner import manifest

    began = time.monotonic()
    known = manifest.all_findings(results.resolve(), "quick" if quick else "full" if full else "ordinary")
    if known is None:
        return False
    took = {"computed": 0, "seconds": time.monotonic() - began}
    study_messages.end(
        [study_messages.study(one | took, results, as_json=as_json) for one in known], results, as_json=as_json
    )
    return True


@main.command(short_help="Gather the findings of all studies into one page.")
@click.option("--embed", is_flag=True, help="Put the figures into the page, for sending it alone.")
@results_option
@plugin_option
def report(results: str, embed: bool) -> None:
    """Gather the findings of all studies into one page beside its figures.

    If the folder holds no findings and its folder ``quick`` does, the page is made of those of ``quick``. A page that
    is up to date is not written again.
    """
    from symtop.runner import manifest

    folder = Path(results)
    if not any(folder.glob("*.json")) and any((folder / "quick").glob("*.json")):
        warn(f"{folder} holds no findings; the report is made of those in {folder / 'quick'}")
        folder /= "quick"
    made_of = manifest.report_hash(folder, embed=embed)
    if not click.get_current_context().meta.get(PLUGINS) and manifest.is_current(folder, "report.html", made_of):
        click.echo(f"report: {folder / 'report.html'} (up to date)")
        return
    from symtop.report import page

    click.echo(f"report: {page.write(folder, embed=embed)}")


@main.command(short_help="Bundle all results for a repository of data.")
@click.option("--output", type=File(dir_okay=False), help="The zip to write; in the results folder by default.")
@results_option
@plugin_option
def archive(results: str, output: str | None) -> None:
    """Bundle datasets, findings and report with versions, machine, a description of every variable, and a test set.

    The test set holds the states of all scenes at ten times to 30 digits, for checking other programs.
    """
    from symtop.report.archive import bundle

    made = bundle(Path(results), None if output is None else Path(output))
    click.echo(f"archive: {made} ({made.stat().st_size / 1e6:.1f} MB)")
