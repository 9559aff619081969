"""``symtop cite``: BibTeX of the package and of the methods that a dataset used."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from symtop import __version__
from symtop.cli.common import File

if TYPE_CHECKING:
    import xarray as xr


PACKAGE = f"""\
@software{{symtop,
  author = {{{{The symtop authors}}}},
  title = {{symtop: integrators compared on the heavy symmetric top}},
  version = {{{__version__}}},
  license = {{BSD-3-Clause}},
}}"""


@click.command(short_help="BibTeX of the package and of what a dataset used.")
@click.argument("files", nargs=-1, type=File(exists=True, dir_okay=False, path_type=Path))
def cite(files: tuple[Path, ...]) -> None:
    """Print BibTeX of symtop and of the sources of the integrators in the datasets FILES (netCDF).

    \b
    symtop cite
    symtop cite results/work_precision.nc run.nc
    """
    from symtop.core import netcdf
    from symtop.methods.framework.registry import bibliography

    keys: dict[str, None] = {}
    unknown: dict[str, None] = {}
    for file in files:
        for name in dict.fromkeys(_integrators(netcdf.read_any(file))):
            sources = _keys(name)
            keys.update(dict.fromkeys(sources))
            if not sources:
                unknown[name] = None
    for text in [PACKAGE, *(bibliography()[key] for key in keys)]:
        click.echo(text + "\n")
    if unknown:
        click.echo(f"symtop: no source is known of {', '.join(unknown)}", err=True)


def _integrators(data: "xr.Dataset | xr.DataTree") -> Iterator[str]:
    """Names of the integrators of a dataset or tree: a coordinate of every group, and the attribute of a run."""
    from symtop.core import netcdf

    for group in netcdf.groups(data).values():
        for name in {"variant", "integrator"} & group.variables.keys():  # files of version 0.2 have the latter
            yield from map(str, group[name].values.ravel())
        if "integrator" in group.attrs:
            yield str(group.attrs["integrator"])


def _keys(name: str) -> list[str]:
    """The entries of `citations.bib` that a method of the registry names; none for one that is not registered here."""
    from symtop.core.errors import SymtopError
    from symtop.methods.framework.registry import citation_keys, integrator

    try:
        return citation_keys(integrator(name))
    except SymtopError:
        return []
