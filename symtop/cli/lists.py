"""``symtop integrators``, ``scenes`` and ``cite``: the lists, one entry in full, and the sources."""

import contextlib
import math
import os
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from symtop.cli import common
from symtop.cli.common import File, as_text, completing, facts, table, terminal_width
from symtop.core import __version__
from symtop.core.errors import SymtopError
from symtop.core.progress import is_terminal
from symtop.report import formats

if TYPE_CHECKING:
    from symtop.methods.framework.registry import Integrator
    from symtop.model.scenes import Scene

wide_option = click.option("--wide", is_flag=True, help="Every column, however wide the table becomes.")
Record = dict[str, Any]  # the values of one entry by column
FLAGS = "e explicit, i implicit, s symplectic, t symmetric in time, - not so, ? not known"
PACKAGE = f"""\
@software{{symtop,
  author = {{{{The symtop authors}}}},
  title = {{symtop: integrators compared on the heavy symmetric top}},
  version = {{{__version__}}},
  license = {{BSD-3-Clause}},
}}"""


def _print(
    records: list[Record], rows: list[Record], note: str, entry: Record | None, page: Callable[[Record], str],
    *, wide: bool, as_json: bool,
) -> None:  # fmt: skip
    """Print the `entry` with `page`, if given, else a table of `rows`; with options all, or JSON."""
    if entry is not None and (as_json or not wide):
        click.echo(as_text([entry]) if as_json else page(entry))
    elif as_json:
        click.echo(as_text(records))
    elif wide:
        click.echo(table(*formats.columns(records)))
    else:
        narrow = is_terminal(sys.stdout) or "COLUMNS" in os.environ  # else one line an entry, for grep
        click.echo(table(*formats.columns(rows), terminal_width() if narrow else None))
        click.echo(textwrap.fill(note, terminal_width()))


@click.command(short_help="List the integrators, or show one in full.")
@click.argument("name", required=False, shell_complete=completing("integrators"))
@wide_option
@common.json_option
@click.option("--markdown", is_flag=True, help="Print a Markdown table of every column.")
@click.option("--engines", is_flag=True, help="List the maps of physics engines instead.")
@common.plugin_option
def integrators(name: str | None, wide: bool, as_json: bool, markdown: bool, engines: bool) -> None:
    """List every integrator with what it claims about itself, or show the one called NAME in full.

    A NAME with a chart, rk4[axis], is the method in that chart alone. The column charts of --wide lists them.

    \b
    symtop integrators
    symtop integrators midpoint
    symtop integrators "rk4[axis]"
    symtop integrators --engines
    """
    from symtop.methods.framework import registry

    entries = registry.engines() if engines else registry.methods()
    methods = [registry.integrator(name)] if name is not None else list(entries.values())
    records: list[Record] = [method.record() for method in methods]
    if markdown and not as_json:
        click.echo(formats.table(*formats.columns(records)))
        return
    rows: list[Record] = [
        {
            "name": method.name, "order": str(method.order or "?"), "flags": _flags(method),
            "needs": method.needs or "?", "summary": method.summary,
        }
        for method in methods
    ]  # fmt: skip
    needs = "; ".join(f"{name}: {words}" for name, words in registry.NEEDS.items())
    note = f"flags: {FLAGS}. What a method needs of you (needs) is one of {needs}."
    note += " One in full: symtop integrators NAME; in one chart: NAME[CHART]."
    entry = None if name is None else _full_record(methods[0])
    _print(records, rows, note, entry, _integrator_page, wide=wide, as_json=as_json)


def _flags(method: "Integrator") -> str:
    letters = ((method.explicit, "e", "i"), (method.symplectic, "s", "-"), (method.symmetric, "t", "-"))
    return "".join("?" if claim is None else yes if claim else no for claim, yes, no in letters)


def _full_record(method: "Integrator") -> Record:
    """The record of an integrator with its tolerances, its source and its description."""
    from symtop.methods.framework.registry import integrator
    from symtop.model.charts import BODY

    record: Record = {**method.record()}
    if method.conserves and BODY in method.solvers:
        record["conserves"] += " of a top"  # on a body Gauss methods do not keep p_phi, Lie-group methods do
    if method.conserves is not None and len(integrator(method.method).charts()) > 1:
        scope = "in every chart" if method.conserves else "common to all charts"  # a chart may have more
        record["conserves"] += f" {scope} of {method.method}"
    if method.default_tolerance is not None:
        record["default tolerance"] = f"{method.default_tolerance:g}"
    if method.least_tolerance > 0.0:
        record["least tolerance"] = f"{method.least_tolerance:.3g}"
    return record | {"source": method.reference or "none named"} | ({"about": method.about} if method.about else {})


def _integrator_page(record: Record) -> str:
    from symtop.methods.framework.registry import citation

    name, summary, about = (record.pop(key, "") for key in ("name", "summary", "about"))
    paragraphs = filter(None, (f"{name}: {summary}", *about.split("\n\n")))
    parts = [*(textwrap.fill(text, terminal_width()) for text in paragraphs), facts(record)]
    with contextlib.suppress(SymtopError):  # a user's method may name an unknown source
        parts.append(citation(name))
    return "\n\n".join(parts)


@click.command(short_help="List the scenes, or show one in full.")
@click.argument("name", required=False, shell_complete=completing("all scenes"))
@wide_option
@common.scene_options
def scenes(name: Any, wide: bool, as_json: bool) -> None:
    """List every scene with its purpose, or show the one called NAME: its top, start, horizon and motion.

    \b
    symtop scenes
    symtop scenes spheroid
    symtop scenes body --body 1,2,3 --rates 0.01,1,0
    """
    from symtop.model import scenes as catalogue

    entries = [*catalogue.all_scenes().values()] if name is None else [catalogue.scene(name, bodies=True)]
    records: list[Record] = [scene.record() for scene in entries]
    keys = {"name": "name", "horizon": "horizon", "nutation": "nutation period", "purpose": "purpose"}
    rows: list[Record] = [{column: record[key] for column, key in keys.items()} for record in records]
    times = "horizon: the time a run covers; nutation: one period of it, of a body its natural period."
    note = f"{times} One in full: symtop scenes NAME."
    entry = None if name is None else _numbers(entries[0])
    _print(records, rows, note, entry, _scene_page, wide=wide, as_json=as_json)


def _numbers(scene: "Scene") -> Record:
    """The record of a scene with every number of its top and its start."""
    top, start = scene.top, scene.start
    momenta = top.momenta(start)
    cosines = () if scene.of_body else top.turning_cosines(start)
    return {
        **scene.record(),
        "top": {name: getattr(top, name) for name in top.__slots__},
        "start": {name: getattr(start, name) for name in start.__slots__},
        "momenta": {"p_phi": momenta.p_phi, "p_psi": momenta.p_psi},
        "source": scene.reference,
        "theta": sorted(math.acos(min(1.0, max(-1.0, cosine))) for cosine in cosines),
    }


def _digits(value: Any) -> str:
    return f"({', '.join(map(_digits, value))})" if isinstance(value, tuple) else f"{value:.10g}"


def _scene_page(numbers: Record) -> str:
    from symtop.methods.framework.registry import bibliography, citation_keys
    from symtop.model.scenes import scene

    name, purpose, angles, source = (numbers.pop(key) for key in ("name", "purpose", "theta", "source"))
    parts = {key: numbers.pop(key) for key in ("top", "start", "momenta")}
    lines = {key: ", ".join(f"{name}={_digits(value)}" for name, value in part.items()) for key, part in parts.items()}
    if angles:
        low, high = angles
        degrees = f"{math.degrees(low):.4g} to {math.degrees(high):.4g} degrees"
        lines["theta"] = f"from {low:.6g} to {high:.6g} rad ({degrees})"
    for key in ("horizon", "nutation period"):
        numbers[key] += " s" if numbers["units"] == "SI" else ""
    if "I2" in parts["top"]:
        numbers = {"natural period" if key == "nutation period" else key: value for key, value in numbers.items()}
    numbers |= {"source": source} if source else {}
    title = textwrap.fill(f"{name}: {purpose}" if purpose else name, terminal_width())
    sources = (bibliography()[key] for key in citation_keys(scene(name, bodies=True)))
    return "\n\n".join([title, facts(lines | numbers), *sources])


@click.command(short_help="BibTeX of the package and of what a dataset used.")
@click.argument("files", nargs=-1, type=File(exists=True, dir_okay=False, path_type=Path))
def cite(files: tuple[Path, ...]) -> None:
    """Print BibTeX of symtop and of the sources of the integrators and scenes in the datasets FILES (netCDF).

    \b
    symtop cite
    symtop cite results/cost.nc run.nc
    """
    from symtop.core import netcdf
    from symtop.methods.framework.registry import bibliography, citation_keys, integrator
    from symtop.model.scenes import scene

    methods: list[str] = []
    scene_names: list[str] = []
    for group in (group for file in files for group in netcdf.groups(netcdf.read_any(file)).values()):
        for names, kinds in ((methods, {"variant", "integrator"}), (scene_names, {"scene"})):  # "integrator" till 0.2
            names += [str(name) for kind in kinds & group.variables.keys() for name in group[kind].values.ravel()]
            names += [str(group.attrs[kind]) for kind in kinds & group.attrs.keys()]
    sources: dict[str, list[str]] = {}
    for name in dict.fromkeys(methods + scene_names):
        sources[name] = []
        with contextlib.suppress(SymtopError):  # not registered here
            sources[name] = citation_keys(integrator(name) if name in methods else scene(name, bodies=True))
    keys = dict.fromkeys(key for entries in sources.values() for key in entries)
    for text in [PACKAGE, *(bibliography()[key] for key in keys)]:
        click.echo(text + "\n")
    if unknown := [name for name in dict.fromkeys(methods) if not sources[name]]:
        click.echo(f"symtop: no source is known of {', '.join(unknown)}", err=True)
