"""``symtop integrators`` and ``symtop scenes``: the lists, and one entry in full."""

import contextlib
import math
import textwrap
from typing import TYPE_CHECKING, Any

import click

from symtop.cli.common import as_text, completing, facts, json_option, plugin_option, table, terminal_width
from symtop.core.errors import SymtopError
from symtop.report import tables

if TYPE_CHECKING:
    from symtop.methods.framework.registry import Integrator
    from symtop.model.scenes import Scene

wide_option = click.option("--wide", is_flag=True, help="Every column, however wide the table becomes.")
Record = dict[str, Any]  # what is shown of one entry, by column
FLAGS = "e explicit, i implicit, s symplectic, t symmetric in time, - not so, ? not known"


def _list(records: list[Record], short: list[Record], note: str, wide: bool, as_json: bool) -> None:
    """Print all records as a table of the `short` ones, or with all columns, or as JSON."""
    if as_json:
        click.echo(as_text(records))
    elif wide:
        click.echo(table(*tables.columns(records)))
    else:
        click.echo(table(*tables.columns(short), terminal_width()))
        click.echo(textwrap.fill(note, terminal_width()))


@click.command(short_help="List the integrators, or show one in full.")
@click.argument("name", required=False, shell_complete=completing("integrators"))
@wide_option
@json_option
@click.option("--markdown", is_flag=True, help="Print a Markdown table of every column.")
@click.option("--engines", is_flag=True, help="List the maps of physics engines instead.")
@plugin_option
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

    listed = registry.engines() if engines else registry.methods()
    methods = [registry.integrator(name)] if name is not None else list(listed.values())
    records: list[Record] = [method.record() for method in methods]
    if markdown and not as_json:
        click.echo(tables.table(*tables.columns(records)))
        return
    if name is not None and (as_json or not wide):
        described = _described(methods[0])
        click.echo(as_text([described]) if as_json else _integrator_page(described, terminal_width()))
        return
    short: list[Record] = [
        {
            "name": method.name, "order": str(method.order or "?"), "flags": _flags(method),
            "needs": method.needs or "?", "summary": method.summary,
        }
        for method in methods
    ]  # fmt: skip
    needs = "; ".join(f"{name}, {words}" for name, words in registry.NEEDS.items())
    note = f"flags: {FLAGS}. needs, the weakest thing that suffices: {needs}."
    note += " One in full: symtop integrators NAME; in one chart: NAME[CHART]."
    _list(records, short, note, wide, as_json)


def _flags(method: "Integrator") -> str:
    letters = ((method.explicit, "e", "i"), (method.symplectic, "s", "-"), (method.symmetric, "t", "-"))
    return "".join("?" if claim is None else yes if claim else no for claim, yes, no in letters)


def _described(method: "Integrator") -> Record:
    """The record of an integrator, its paragraph, its tolerances and its source."""
    described: Record = {**method.record()}
    if method.conserves is not None and len(method.charts()) > 1:
        described["conserves"] += " in every one of its charts"  # some keep more in one of them
    if method.default_tolerance is not None:
        described["default tolerance"] = f"{method.default_tolerance:g}"
    if method.least_tolerance > 0.0:
        described["least tolerance"] = f"{method.least_tolerance:.3g}"
    return described | {"source": method.reference or "none named"} | ({"about": method.about} if method.about else {})


def _integrator_page(described: Record, width: int) -> str:
    from symtop.methods.framework.registry import citation

    lines = {key: value for key, value in described.items() if key not in ("name", "summary", "about")}
    paragraphs = [f"{described['name']}: {described['summary']}", *described.get("about", "").split("\n\n")]
    parts = [*(textwrap.fill(text, width) for text in paragraphs if text), facts(lines, width)]
    with contextlib.suppress(SymtopError):  # a method of the user's own may name a source that is not known here
        parts.append(citation(described["name"]))
    return "\n\n".join(parts)


@click.command(short_help="List the scenes, or show one in full.")
@click.argument("name", required=False, shell_complete=completing("scenes"))
@wide_option
@json_option
@plugin_option
def scenes(name: str | None, wide: bool, as_json: bool) -> None:
    """List every scene with its purpose, or show the one called NAME: its top, start, horizon and motion.

    \b
    symtop scenes
    symtop scenes spheroid
    """
    from symtop.model import scenes as catalogue

    chosen = [catalogue.scene(name)] if name is not None else list(catalogue.scenes().values())
    if name is not None and (as_json or not wide):
        numbers = _numbers(chosen[0])
        click.echo(as_text([numbers]) if as_json else _scene_page(numbers, terminal_width()))
        return
    records: list[Record] = [scene.record() for scene in chosen]
    keys = {"name": "name", "horizon": "horizon (s)", "nutation": "nutation period (s)", "purpose": "purpose"}
    short: list[Record] = [{column: record[key] for column, key in keys.items()} for record in records]
    note = "horizon: the time a run covers; nutation: one period of it. One in full: symtop scenes NAME."
    _list(records, short, note, wide, as_json)


def _numbers(scene: "Scene") -> Record:
    """The record of a scene with every number of its top and its start."""
    top, start = scene.top, scene.start
    momenta = top.momenta(start)
    return {
        **scene.record(),
        "top": {name: getattr(top, name) for name in top.__slots__},
        "start": {name: getattr(start, name) for name in start.__slots__},
        "momenta": {"p_phi": momenta.p_phi, "p_psi": momenta.p_psi},
        "theta": sorted(math.acos(min(1.0, max(-1.0, cosine))) for cosine in top.turning_cosines(start)),
    }


def _scene_page(numbers: Record, width: int) -> str:
    low, high = numbers["theta"]
    lines = {
        name: ", ".join(f"{key}={value:.10g}" for key, value in numbers[name].items())
        for name in ("top", "start", "momenta")
    }
    lines["theta"] = f"from {low:.6g} to {high:.6g} rad ({math.degrees(low):.4g} to {math.degrees(high):.4g} degrees)"
    lines |= {name: value for name, value in numbers.items() if name not in ("name", "purpose", *lines)}
    title = f"{numbers['name']}: {numbers['purpose']}" if numbers["purpose"] else numbers["name"]
    return f"{textwrap.fill(title, width)}\n\n{facts(lines, width)}"
