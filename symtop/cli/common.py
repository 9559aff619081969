"""What the commands share: options, shell completion, plug-ins, errors without a traceback, and text in columns."""

import re
import shutil
import textwrap
from collections.abc import Callable, Sequence
from typing import Any

import click

from symtop.base.validate import SymtopError


def _load_plugins(ctx: click.Context, _: click.Parameter, files: tuple[str, ...]) -> None:
    if files and not ctx.resilient_parsing:  # as shell completion parses
        from symtop.runner import plugins

        for file in files:
            plugins.load(file)


plugin_option = click.option(
    "--plugin", multiple=True, metavar="FILE", callback=_load_plugins, expose_value=False, is_eager=True,
    help="A Python file that registers integrators or scenes.",
)  # fmt: skip
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
results_option = click.option(
    "--results", type=click.Path(file_okay=False), default="results", show_default=True,
    help="The folder of the datasets, figures and findings.",
)  # fmt: skip

Completion = Callable[[click.Context, click.Parameter, str], list[str]]


def completing(kind: str) -> Completion:
    """Shell completion of the names of all scenes, integrators or studies; after a bracket, of rows like rk4[axis]."""

    def complete(_: click.Context, __: click.Parameter, prefix: str) -> list[str]:
        from symtop.methods.registry import integrators, rows
        from symtop.model.scenes import scenes
        from symtop.runner import scripts

        methods = [row.name for row in rows()] if "[" in prefix else list(integrators())
        names = {"scenes": list(scenes()), "integrators": methods, "studies": scripts.names()}[kind]
        return [name for name in names if name.startswith(prefix)]

    return complete


class Group(click.Group):
    """Prints a SymtopError as one sentence and exits with code 2; arguments are named as the options are."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command."""
        try:
            return super().invoke(ctx)
        except SymtopError as error:
            sentence = re.sub(r"(?<![\w'-])step_size(?![\w'])", "--step-size", str(error))
            click.echo(f"symtop: {sentence}", err=True)
            ctx.exit(2)


def warn(sentence: str) -> None:
    """Print a warning to the standard error."""
    click.echo(f"symtop: {sentence}", err=True)


def terminal_width() -> int:
    """Columns of the terminal; 80 where there is none."""
    return max(60, shutil.get_terminal_size((80, 24)).columns)


def table(header: Sequence[str], rows: Sequence[Sequence[str]], width: int | None = None) -> str:
    """Text in columns; with a `width`, the last column is broken into lines that fit it."""
    widths = [max(len(row[k]) for row in [header, *rows]) for k in range(len(header))]
    if width is not None:
        widths[-1] = min(widths[-1], max(20, width - sum(widths[:-1]) - 2 * (len(widths) - 1)))
    lines = []
    for row in [header, ["-" * size for size in widths], *rows]:
        first, *others = textwrap.wrap(row[-1], widths[-1]) or [""]
        broken = [[*row[:-1], first], *([*[""] * (len(row) - 1), other] for other in others)]
        lines += ["  ".join(map(str.ljust, cells, widths)).rstrip() for cells in broken]
    return "\n".join(lines)


def facts(pairs: dict[str, str], width: int) -> str:
    """Names and values, one a line; long values are broken and indented."""
    left = max(map(len, pairs)) + 2
    return "\n".join(
        textwrap.fill(value, width, initial_indent=name.ljust(left), subsequent_indent=" " * left)
        for name, value in pairs.items()
    )
