"""``symtop report``, ``archive`` and ``cite``: the page of all findings, the bundle of all data, and the sources."""

from pathlib import Path

import click

from symtop import __version__
from symtop.cli.common import PLUGINS, File, plugin_option, results_option, warn
from symtop.core.errors import SymtopError

PACKAGE = f"""\
@software{{symtop,
  author = {{{{The symtop authors}}}},
  title = {{symtop: integrators compared on the heavy symmetric top}},
  version = {{{__version__}}},
  license = {{BSD-3-Clause}},
}}"""


@click.command(short_help="Gather the findings of all studies into one page.")
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
    if not click.get_current_context().meta.get(PLUGINS) and manifest.is_current(folder, manifest.PAGE, made_of):
        click.echo(f"report: {folder / manifest.PAGE} (up to date)")
        return
    from symtop.report import page

    click.echo(f"report: {page.write(folder, embed=embed)}")


@click.command(short_help="Bundle all results for a repository of data.")
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


@click.command(short_help="BibTeX of the package and of what a dataset used.")
@click.argument("files", nargs=-1, type=File(exists=True, dir_okay=False, path_type=Path))
def cite(files: tuple[Path, ...]) -> None:
    """Print BibTeX of symtop and of the sources of the integrators in the datasets FILES (netCDF).

    \b
    symtop cite
    symtop cite results/cost.nc run.nc
    """
    from symtop.core import netcdf
    from symtop.methods.framework.registry import bibliography, citation_keys, integrator

    names: list[str] = []
    for group in (group for file in files for group in netcdf.groups(netcdf.read_any(file)).values()):
        for name in {"variant", "integrator"} & group.variables.keys():  # files of version 0.2 have the latter
            names += map(str, group[name].values.ravel())
        if "integrator" in group.attrs:
            names.append(str(group.attrs["integrator"]))
    sources: dict[str, None] = {}
    unknown = []
    for name in dict.fromkeys(names):
        try:
            keys = citation_keys(integrator(name))
        except SymtopError:  # not registered here
            keys = []
        sources |= dict.fromkeys(keys)
        unknown += [] if keys else [name]
    for text in [PACKAGE, *(bibliography()[key] for key in sources)]:
        click.echo(text + "\n")
    if unknown:
        click.echo(f"symtop: no source is known of {', '.join(unknown)}", err=True)
