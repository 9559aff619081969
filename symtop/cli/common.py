"""What the commands share: options, plug-ins, files to write, errors without a traceback, text that fits."""

import contextlib
import errno
import json
import math
import re
import shutil
import sys
import tempfile
import textwrap
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, TextIO

import click

from symtop.core import files
from symtop.core.errors import SymtopError, SymtopWarning, at_home, place, spare
from symtop.core.signals import INTERRUPTED, told_apart

LONGEST_NAME = 80  # characters of a file that are told
FIGURES = (".png", ".svg", ".pdf")
PLUGINS = "symtop.plugins"  # in the context of a command: plug-ins were given


def _load_plugins(ctx: click.Context, _: click.Parameter, files: tuple[str, ...]) -> None:
    if files and not ctx.resilient_parsing:  # as shell completion parses
        from symtop.runner import plugins

        ctx.meta[PLUGINS] = True
        for file in files:
            if not plugins.load(file):
                warn(f"{Path(file).name} registers no integrator and no scene (symtop.register, symtop.register_scene)")


class File(click.Path):
    """A path in which ``~`` is the user's folder also after ``--option=``, where a shell leaves it."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path, expanded before it is looked at."""
        home = isinstance(value, str) and value.startswith("~")
        return super().convert(str(at_home(value)) if home else value, param, ctx)


plugin_option = click.option(
    "--plugin", multiple=True, metavar="FILE", callback=_load_plugins, expose_value=False, is_eager=True,
    help="A Python file that registers integrators or scenes.",
)  # fmt: skip
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
results_option = click.option(
    "--results", type=File(file_okay=False), default="results", show_default=True,
    help="The folder of the datasets, figures and findings.",
)  # fmt: skip


class Group(click.Group):
    """Prints a SymtopError, or a file that cannot be used, as one sentence and exits with code 2; 130 after Ctrl-C.

    Arguments are named as the options are.
    """

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command."""
        try:
            with told_apart():
                return super().invoke(ctx)
        except SymtopError as error:
            warn(self._spoken(str(error), self.commands.get(ctx.invoked_subcommand or "")))
            ctx.exit(2)
        except KeyboardInterrupt:  # click's own answer is "Aborted!" and 1, which means that a case has failed
            warn("interrupted")
            ctx.exit(INTERRUPTED)
        except OSError as error:
            if error.errno in (errno.ENOSPC, errno.EDQUOT) and error.filename is None:
                warn(f"cannot write what there is to say: {error.strerror}")
                ctx.exit(2)
            if error.errno == errno.EPIPE or error.filename is None:  # a reader that has left is click's
                raise
            name = str(error.filename)
            warn(f"cannot use {name[:LONGEST_NAME]}{'...' if name[LONGEST_NAME:] else ''}: {error.strerror}")
            ctx.exit(2)

    def _spoken(self, sentence: str, command: click.Command | None) -> str:
        """A sentence about arguments as one about options, which ends with the command that lists what there is."""
        parameters = [option for command in self.commands.values() for option in command.params]
        options = {
            str(option.name): max(option.opts, key=len) for option in parameters if isinstance(option, click.Option)
        }
        sentence = re.sub(r"(?<![\w'-])(step_size|per_nutation)(?![\w'])", lambda m: options[m[1]], sentence)
        argued = rf"(?<![\w'-])((?:give|or|not|see) |^)({'|'.join(options)})(?= must|\)|,| = | or |$)"
        sentence = re.sub(argued, lambda match: match[1] + options[match[2]], sentence)
        unknown = re.match(r"(scene|integrator) '(.*)' is unknown; (did you mean )?", sentence)
        if unknown is None:
            return sentence
        kind, name, near = unknown.groups()
        if _is_of_the_other_kind(kind, name):
            taken = {part.name for part in command.params if isinstance(part, click.Argument)} if command else set()
            order = ", and the scene comes first" if taken >= {*OTHER} else ""
            return f"{kind} {name!r} is unknown; it is the name of {OTHER[kind]}{order}"
        return f"{sentence} (symtop {kind}s lists all)" if near else sentence


OTHER = {"scene": "an integrator", "integrator": "a scene"}


def _is_of_the_other_kind(kind: str, name: str) -> bool:
    """Has somebody typed an integrator where a scene should stand, or a scene in place of an integrator?"""
    from symtop.methods.framework.registry import integrators, split_name
    from symtop.model.scenes import scenes

    return name in scenes() if kind == "integrator" else split_name(name)[0] in integrators()


def tell_of_compiling() -> None:
    """Say once, on a terminal and in its width, that kernels are being compiled."""

    def tell() -> None:
        files.on_cold.clear()
        warn(files.COMPILING)

    files.on_cold[:] = [tell] if files.is_terminal(sys.stderr) else []


def warn(sentence: str) -> None:
    """Print a warning to the standard error."""
    clear = "\r\x1b[K" if files.is_terminal(sys.stderr) else ""  # of a clock that stands in the line
    click.echo(clear + fitted(f"symtop: {sentence}", sys.stderr), err=True)


def as_text(content: Any) -> str:
    """JSON of anything; a number that is not finite, of which JSON knows none, is null."""
    return json.dumps(_finite(content), indent=1, allow_nan=False)


def _finite(content: Any) -> Any:
    if isinstance(content, dict):
        return {name: _finite(value) for name, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [_finite(value) for value in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content


@contextlib.contextmanager
def telling() -> Iterator[None]:
    """What symtop warns of meanwhile is told as the commands tell it, and not as Python shows the warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", SymtopWarning)
        others = warnings.showwarning

        def tell(message: Warning | str, category: type[Warning], *rest: Any, **more: Any) -> None:
            if issubclass(category, SymtopWarning):
                warn(str(message))
            else:
                others(message, category, *rest, **more)

        warnings.showwarning = tell
        yield


def say(sentence: str) -> None:
    """Print a sentence to the standard output."""
    click.echo(fitted(sentence, sys.stdout))


def fitted(text: str, stream: TextIO | None) -> str:
    """The text in lines that fit the terminal, if a terminal is what the stream goes to."""
    if not files.is_terminal(stream):
        return text
    width = terminal_width()
    return "\n".join(
        textwrap.fill(line, width, break_on_hyphens=False, break_long_words=False, subsequent_indent="  ")
        for line in text.splitlines()
    )


def figure_file(option: str, file: str | None) -> None:
    """Refuse the name of a figure that has no known ending, or no folder to stand in."""
    ending_in(option, file, FIGURES)
    standing(option, file)


def ending_in(option: str, file: str | None, endings: Sequence[str]) -> None:
    """Refuse the name of a file that does not say what is written into it."""
    if file is not None and Path(file).suffix.lower() not in endings:
        raise SymtopError(f"{option} must be a file that ends in {' or '.join(endings)}, not {file!r}")


def apart(**files: str | None) -> None:
    """Refuse two outputs of one command, by their options' names, that are the same file: one would replace another."""
    seen = dict[Path, str]()
    for option, file in files.items():
        other = option if file is None else seen.setdefault(Path(file).resolve(), option)
        if other != option:
            raise SymtopError(f"--{other} and --{option} must be two files, not both {file!r}")


def standing(option: str, file: str | None) -> None:
    """Refuse a folder, and a file whose folder is not there or not to be written to.

    A result should have a place before a run.
    """
    if file is None:
        return
    if not (file and Path(file).absolute().parent.is_dir()):
        raise SymtopError(f"{option} must be a file in a folder that is there, not {file!r}")
    if place(option, file).is_dir():
        raise SymtopError(f"{option} must be a file, not the folder {file!r}")
    if option == "--output":
        spare(Path(file))
    try:
        with tempfile.TemporaryFile(dir=place(option, file).absolute().parent):
            pass
    except OSError as error:
        raise SymtopError(f"cannot write {file}: {error.strerror or error}") from error


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
