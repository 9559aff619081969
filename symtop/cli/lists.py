"""``symtop integrators`` and ``symtop scenes``: the lists, and one entry in full."""

import contextlib
import json
import math
import textwrap
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import click

from symtop.base.validate import SymtopError
from symtop.cli.common import completing, facts, json_option, plugin_option, table, terminal_width

if TYPE_CHECKING:
    from symtop.methods.registry import Integrator
    from symtop.model.scenes import Scene

    Entry = TypeVar("Entry", Integrator, Scene)

wide_option = click.option("--wide", is_flag=True, help="Every column, however wide the table becomes.")
FLAGS = "e explicit, i implicit, s symplectic, t symmetric in time, - not so, ? not known"


def _show(
    entries: "Sequence[Entry]", name: str | None, *, wide: bool, as_json: bool, full: "Callable[[Entry], object]",
    page: "Callable[[Entry, int], str]", short: "Callable[[Entry], dict[str, str]]", note: str,
) -> None:  # fmt: skip
    """Print the entry called `name` as a page, or all as a table of their `short` records; or whole, or as JSON."""
    records = [entry.record() for entry in entries]
    if as_json:
        click.echo(json.dumps(records if name is None else [full(entries[0])], indent=1))
    elif wide:
        click.echo(table(list(records[0]), [list(record.values()) for record in records]))
    elif name is not None:
        click.echo(page(entries[0], terminal_width()))
    else:
        rows = [short(entry) for entry in entries]
        click.echo(table(list(rows[0]), [list(row.values()) for row in rows], terminal_width()))
        click.echo(textwrap.fill(note, terminal_width()))


@click.command(short_help="List the integrators, or show one in full.")
@click.argument("name", required=False, shell_complete=completing("integrators"))
@wide_option
@json_option
@click.option("--markdown", is_flag=True, help="Print a Markdown table of every column.")
@plugin_option
def integrators(name: str | None, wide: bool, as_json: bool, markdown: bool) -> None:
    """List every integrator with what it claims about itself, or show the one called NAME in full.

    \b
    symtop integrators
    symtop integrators midpoint
    """
    from symtop.methods import registry
    from symtop.report import markdown as markdown_

    methods = [registry.integrator(name)] if name is not None else list(registry.integrators().values())
    if markdown and not as_json:
        records = [method.record() for method in methods]
        click.echo(markdown_.table(list(records[0]), [list(record.values()) for record in records]))
        return
    _show(
        methods, name, wide=wide, as_json=as_json, full=_described, page=_integrator_page,
        short=lambda method: {
            "name": method.name, "order": _order(method), "flags": _flags(method), "summary": method.summary,
        },
        note=f"flags: {FLAGS}. One in full: symtop integrators NAME.",
    )  # fmt: skip


def _order(method: "Integrator") -> str:
    return "?" if method.order is None else str(method.order)


def _flags(method: "Integrator") -> str:
    letters = ((method.explicit, "e", "i"), (method.symplectic, "s", "-"), (method.symmetric, "t", "-"))
    return "".join("?" if claim is None else yes if claim else no for claim, yes, no in letters)


def _described(method: "Integrator") -> dict[str, str]:
    """The record of an integrator, its paragraph, its tolerances and its source."""
    described = method.record()
    if method.default_tolerance is not None:
        described["default tolerance"] = f"{method.default_tolerance:g}"
    if method.least_tolerance > 0.0:
        described["least tolerance"] = f"{method.least_tolerance:.3g}"
    return described | {"source": method.reference or "none named"} | ({"about": method.about} if method.about else {})


def _integrator_page(method: "Integrator", width: int) -> str:
    from symtop.methods.citations import citation

    described = _described(method)
    parts = [textwrap.fill(f"{described.pop('name')}: {described.pop('summary')}", width)]
    parts += [textwrap.fill(about, width) for about in described.pop("about", "").split("\n\n") if about]
    parts.append(facts(described, width))
    with contextlib.suppress(SymtopError):  # a method of the user's own may name a source that is not known here
        parts.append(citation(method))
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

    def short(scene: "Scene") -> dict[str, str]:
        names = {"name": "name", "horizon": "horizon (s)", "nutation": "nutation period (s)", "purpose": "purpose"}
        return {column: scene.record()[key] for column, key in names.items()}

    _show(
        [catalogue.scene(name)] if name is not None else list(catalogue.scenes().values()), name, wide=wide,
        as_json=as_json, full=_numbers, page=_scene_page, short=short,
        note="horizon: the time a run covers; nutation: one period of it. One in full: symtop scenes NAME.",
    )  # fmt: skip


def _numbers(scene: "Scene") -> dict[str, Any]:
    """The record of a scene with every number of its top and its start."""
    top, start = scene.top, scene.start
    momenta = top.momenta(start)
    return {
        **scene.record(),
        "top": {name: getattr(top, name) for name in ("I1", "I3", "mgl")},
        "start": {
            name: getattr(start, name) for name in ("theta", "phi", "psi", "theta_dot", "phi_dot", "psi_dot")
        },
        "momenta": {"p_phi": momenta.p_phi, "p_psi": momenta.p_psi},
        "theta": sorted(math.acos(min(1.0, max(-1.0, cosine))) for cosine in top.turning_cosines(start)),
    }  # fmt: skip


def _scene_page(scene: "Scene", width: int) -> str:
    numbers = _numbers(scene)
    low, high = numbers["theta"]
    lines = {name: _listed(numbers[name]) for name in ("top", "start", "momenta")}
    lines["theta"] = f"from {low:.6g} to {high:.6g} rad ({math.degrees(low):.4g} to {math.degrees(high):.4g} degrees)"
    lines |= {name: value for name, value in scene.record().items() if name not in ("name", "purpose")}
    title = f"{scene.name}: {scene.purpose}" if scene.purpose else scene.name
    return f"{textwrap.fill(title, width)}\n\n{facts(lines, width)}"


def _listed(numbers: dict[str, float]) -> str:
    return ", ".join(f"{name}={value:.10g}" for name, value in numbers.items())
