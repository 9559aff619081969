"""Helpers of all commands: options, plug-ins, output files, errors without a traceback, text that fits the terminal."""

import contextlib
import errno
import functools
import importlib
import json
import math
import re
import shutil
import sys
import tempfile
import textwrap
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import click

from symtop.core import errors
from symtop.core.errors import SymtopError, SymtopWarning, UnknownNameError, at_home, file_path, positive, words_of
from symtop.core.progress import is_terminal, showing_work
from symtop.core.signals import BROKEN_PIPE, INTERRUPTED, told_apart

if TYPE_CHECKING:
    from symtop.model.scenes import Scene

LONGEST_NAME = 80  # characters of a file name in a message
ENDINGS = {"figure": (".png", ".svg", ".pdf"), "card": (".html", ".htm"), "badge": (".svg",)}  # by option
NAMES = {  # for shell completion: the module and the function that returns the names
    "all scenes": ("symtop.model.scenes", "all_scenes"), "studies": ("symtop.runner.scripts", "names"),
    "integrators": ("symtop.methods.framework.registry", "integrators"),
    "variants": ("symtop.methods.framework.registry", "variants"),
}  # fmt: skip
BODY, BODY_PERIODS = "body", 20.0  # name of the scene made from the options of a body; its horizon in natural periods
TEXT_ENDINGS = (".csv", ".tsv", ".txt", ".json")  # endings that are refused for netCDF files
USAGE = {  # patterns of click's messages, and their replacements
    "invalid value for '(.+?)': (.+) is not (?:a valid )?(.+)": r"\1 must be \3, not \2",
    r"invalid value for '\[?(.+?)(?:]...)?': File (.+) (does not exist|is a .+)":
        r"\1 must be a file, not \2, which \3",
    "invalid value for '(.+?)': Directory (.+) (is a .+)": r"\1 must be a folder, not \2, which \3",
    r"\. \(Did you mean one of: (.+)\)$": r"; did you mean \1", "must be float( range)?,": "must be a number,",
    "must be integer( range)?,": "must be a whole number,",
}  # fmt: skip
SILENT_COMMANDS = ("explore",)  # commands without messages that they are still working


def _load_plugins(ctx: click.Context, _: click.Parameter, files: tuple[str, ...]) -> None:
    if files and not ctx.resilient_parsing:  # not during shell completion
        from symtop.run import plugins

        for file in files:
            if ctx.info_name == "claims":  # report a file that crashes its process
                from symtop.judging.remote import try_separately

                try_separately(lambda file=file: len(plugins.load(file)), f"plugin {Path(file).name}")  # type: ignore[misc]
            if not plugins.load(file):
                warn(f"{Path(file).name} registers no integrator and no scene (symtop.register, symtop.register_scene)")


class File(click.Path):
    """A path in which ``~`` is expanded, also after ``--option=``, where a shell does not."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path, expanded before click checks it."""
        home = isinstance(value, str) and value.startswith("~")
        return super().convert(str(at_home(value)) if home else value, param, ctx)


def separated(_: click.Context, __: click.Parameter, names: str | None) -> list[str] | None:
    """A callback of options: the list of names separated by commas, or None."""
    return None if names is None else [name.strip() for name in names.split(",")]


def completing(kind: str) -> Callable[[click.Context, click.Parameter, str], list[str]]:
    """A function for shell completion of the names of `kind` in `NAMES`; after a bracket, of variants, rk4[axis]."""

    def complete(_: click.Context, __: click.Parameter, prefix: str) -> list[str]:
        module, function = NAMES["variants" if "[" in prefix and kind == "integrators" else kind]
        entries = getattr(importlib.import_module(module), function)()
        return [name for name in (getattr(entry, "name", entry) for entry in entries) if name.startswith(prefix)]

    return complete


def _numbers(count: int) -> Callable[[click.Context, click.Parameter, str | None], tuple[float, ...] | None]:
    """The callback of an option of `count` numbers separated by commas."""

    def read(_: click.Context, option: click.Parameter, text: str | None) -> tuple[float, ...] | None:
        try:
            values = None if text is None else tuple(map(float, text.split(",")))
        except ValueError:
            values = ()
        if values is not None and len(values) != count:
            rule = "a number" if count == 1 else f"{count} numbers with commas between"
            raise SymtopError(f"--{option.name} must be {rule}, not {text!r}")
        return values

    return read


OF_BODY = {  # options of a body: number of values, metavar, help
    "body": (3, "I1,I2,I3", f"Principal moments of a body of your own, the scene {BODY}; I1 = I2 makes a top."),
    "mgl": (1, "NUMBER", "Its weight times the distance of its centre; free without."),
    "centre": (3, "X,Y,Z", "The direction of its centre in body axes; the third axis by default."),
    "attitude": (4, "W,X,Y,Z", "Its quaternion at the start, body to space; 1,0,0,0 by default."),
    "rates": (3, "W1,W2,W3", "Its angular velocity at the start, in body axes."),
}


def body_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of a user's body to a command; the scene `BODY` is then replaced by one made from them."""

    @functools.wraps(command)
    def with_body(**settings: Any) -> None:
        numbers = {name: value for name in OF_BODY if (value := settings.pop(name)) is not None}
        scene = "scene" if "scene" in settings else "name"
        if numbers:
            if "body" not in numbers or settings[scene] != BODY:
                options, current = ", ".join(f"--{name}" for name in numbers), settings[scene]
                requirement = f"the scene {BODY}" + f", not {current}" * (current is not None)
                missing = ["--body I1,I2,I3"] * ("body" not in numbers) + [requirement] * (current != BODY)
                raise SymtopError(f"{options} must come with {' and '.join(missing)}")
            settings[scene] = _scene_of_body(numbers)
        command(**settings)

    for name, (count, metavar, words) in reversed(OF_BODY.items()):
        with_body = click.option(f"--{name}", metavar=metavar, callback=_numbers(count), help=words)(with_body)
    return with_body


def given_body() -> str:
    """The options of a user's body in the command line of this command; empty without them."""
    numbers = {name: value for name, value in click.get_current_context().params.items() if name in OF_BODY and value}
    return " ".join(f"--{name} {','.join(map(repr, value))}" for name, value in numbers.items())


def _scene_of_body(numbers: dict[str, Any]) -> "Scene":
    from symtop.model import body, scenes
    from symtop.model.top import Angles, SymmetricTop

    parameters = *numbers["body"], *numbers.get("mgl", (0.0,)), numbers.get("centre", (0.0, 0.0, 1.0))
    top: Any = body.RigidBody(*parameters)
    start: Any = body.Attitude(numbers.get("attitude", (1.0, 0.0, 0.0, 0.0)), numbers.get("rates", (0.0, 0.0, 0.0)))
    if not math.isfinite(period := top.nutation_period(start)):
        raise SymtopError("--body without a weight needs --rates: it does not move")
    if top.I1 == top.I2 and (top.free or abs(top.centre[2]) == 1.0):
        start = Angles.from_quaternion(start.quaternion, omega_body=start.omega_body)
        top = SymmetricTop(top.I1, top.I3, top.torque[2])
    purpose = f"a body of your own, over {BODY_PERIODS:g} natural periods"
    return scenes.Scene(BODY, top, start, BODY_PERIODS * period, purpose, "axis")  # "axis" for a top


def step_of(scene: "str | Scene", settings: dict[str, Any]) -> float | None:
    """The step from the options --step-size or --per-nutation; the second is removed from `settings`."""
    step, count = settings.get("step_size"), settings.pop("per_nutation")
    if step is not None and count is not None:
        raise SymtopError("give --step-size or --per-nutation, not both")
    if count is None:
        return step
    from symtop.model.scenes import scene as find

    return find(scene, bodies=True).time_scale(settings.get("horizon")) / positive("per_nutation", count)


per_nutation_option = click.option("--per-nutation", type=float, help="In place of a step: steps in a nutation period.")
plugin_option = click.option(
    "--plugin", multiple=True, metavar="FILE", callback=_load_plugins, expose_value=False, is_eager=True,
    help="A Python file that registers integrators or scenes.",
)  # fmt: skip
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
results_option = click.option(
    "--results", type=File(file_okay=False), default="results", show_default=True,
    help="The folder of the datasets, figures and findings.",
)  # fmt: skip


def scene_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of commands on a scene: a user's body, plug-ins, JSON."""
    return body_options(plugin_option(json_option(command)))


class Group(click.Group):
    """A group of commands that prints an error as one sentence and exits with code 2, or 130 after Ctrl-C."""

    def make_context(self, *args: Any, **settings: Any) -> click.Context:
        """The context of the group's own options, with errors as messages."""
        with _plain_usage():
            return super().make_context(*args, **settings)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command of a command line; from here on messages say that it is still working."""
        name, command, rest = super().resolve_command(ctx, args)
        if not ctx.resilient_parsing and name not in SILENT_COMMANDS:
            ctx.with_resource(showing_work(str(name)))
        return name, command, rest

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002  (click calls it so)
        """The names of commands in the order in which they were added."""
        return list(self.commands)

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command, with errors as messages and exit codes."""
        try:
            with told_apart(), _warnings_as_lines(), _plain_usage():
                return super().invoke(ctx)
        except SymtopError as error:
            warn(_option_message(error, self.commands.get(ctx.invoked_subcommand or "")))
            ctx.exit(2)
        except KeyboardInterrupt:  # click would exit with 1, which here means that a case has failed
            warn("interrupted")
            ctx.exit(INTERRUPTED)
        except OSError as error:
            if error.errno == errno.EPIPE:
                sys.stdout = None  # its reader has ended
                ctx.exit(BROKEN_PIPE)
            name, words = str(error.filename), f"cannot write what there is to say: {error.strerror}"
            if error.filename is not None:
                words = f"cannot use {name[:LONGEST_NAME]}{'...' if name[LONGEST_NAME:] else ''}: {error.strerror}"
            elif error.errno == errno.ENOENT:
                words = "the folder that this command runs in is no longer there: change to another"
            elif error.errno not in (errno.ENOSPC, errno.EDQUOT):
                raise
            warn(words)
            ctx.exit(2)
        except Exception as error:
            if not type(error).__module__.startswith("numba."):  # from a plug-in's kernel
                raise
            warn(f"a kernel cannot be compiled: {words_of(error)}")
            ctx.exit(2)


@contextlib.contextmanager
def _plain_usage() -> Iterator[None]:
    """Let an error of the command line print one sentence: the option, its value, and what is allowed."""
    try:
        yield
    except click.UsageError as error:
        if type(error).show is click.UsageError.show:  # else it prints the help
            words = error.format_message().removesuffix(".").replace(". Did", "; did")
            words = words[0].lower() + words[1:]
            for click_says, we_say in USAGE.items():
                words = re.sub(click_says, we_say, words)
            if error.ctx is not None and not (" must be " in words or words.endswith("?")):
                words += f"; {error.ctx.get_usage()} (--help says more)".replace("Usage: ", "usage: ")
            error.show = lambda file=None: warn(words)  # type: ignore[method-assign]  # noqa: ARG005
        raise


def _option_message(error: SymtopError, command: click.Command | None) -> str:
    """An error's message with names of options for arguments, and hints for an unknown scene or integrator."""
    parameters = command.params if command is not None else []
    options = [parameter for parameter in parameters if isinstance(parameter, click.Option)]
    flags = {str(option.name): max(option.opts, key=len) for option in reversed(options)}  # the first option of a name
    sentence = error.renamed({"quaternion": "--attitude", "omega_body": "--rates"} | flags)
    if not isinstance(error, UnknownNameError) or error.parameters[0] not in ("scene", "integrator"):
        return sentence
    from symtop.methods.framework.registry import integrators, split_name
    from symtop.model.scenes import all_scenes

    (kind,), name = error.parameters, str(error.value)
    if name in all_scenes() or split_name(name)[0] in integrators():
        noun = "an integrator" if kind == "scene" else "a scene"
        both = {"scene", "integrator"} <= {entry.name for entry in parameters if isinstance(entry, click.Argument)}
        order = ", and the scene comes first" if both else ""
        return f"{kind} {name!r} is unknown; it is the name of {noun}{order}"
    hints = {"scene": {"body": f"{BODY} with --body I1,I2,I3"}, "integrator": {}}[kind] | {"plugin": "--plugin FILE"}
    ways = " or ".join(words for name, words in hints.items() if name in {option.name for option in options})
    return f"{sentence} (symtop {kind}s lists all{ways and f'; one of your own: {ways}'})"


@contextlib.contextmanager
def _warnings_as_lines() -> Iterator[None]:
    with warnings.catch_warnings(action="always", category=SymtopWarning):
        warnings.filterwarnings("ignore", r"\d+ of \d+ members ended early: ")  # `symtop ensemble` counts them anyway
        original: Any = warnings.showwarning
        warnings.showwarning = lambda message, category, *rest: (
            warn(str(message)) if issubclass(category, SymtopWarning) else original(message, category, *rest)
        )
        yield


def warn(sentence: str) -> None:
    """Print a warning to the standard error."""
    erase = "\r\x1b[K" if is_terminal(sys.stderr) else ""  # clears a progress line
    click.echo(erase + fitted(f"symtop: {sentence}", sys.stderr), err=True)


def as_text(content: Any) -> str:
    """Content as JSON text; a number that is not finite becomes null."""
    return json.dumps(json.loads(json.dumps(content), parse_constant=lambda _: None), indent=1)


def say(sentence: str) -> None:
    """Print a sentence to the standard output."""
    click.echo(fitted(sentence, sys.stdout))


def fitted(text: str, stream: TextIO | None) -> str:
    """The text in lines that fit the terminal, if the stream is one."""
    return filled(text) if is_terminal(stream) else text


def filled(text: str) -> str:
    """The text in lines that fit the terminal."""
    fill = functools.partial(textwrap.fill, width=terminal_width(), break_on_hyphens=False, break_long_words=False)
    return "\n".join(fill(line, subsequent_indent=" " * (2 + 2 * (line[:1] == " "))) for line in text.splitlines())


def say_written(*files: str | None, err: bool = False) -> None:
    """Print the name of each file, except None."""
    for file in filter(None, files):
        click.echo(f"written to {file}", err=err)


def check_outputs(**files: str | None) -> None:
    """SymtopError for output files, by their options, with a wrong ending or that cannot be written, before a run."""
    options = dict[Path, str]()
    for name, file in files.items():
        if file is None:
            continue
        option, endings, path = f"--{name}", ENDINGS.get(name, ()), Path(file).absolute()
        if endings and path.suffix.lower() not in endings:
            raise SymtopError(f"{option} must be a file that ends in {' or '.join(endings)}, not {file!r}")
        if file_path(option, file).is_dir():
            raise SymtopError(f"{option} must be a file, not the folder {file!r}")
        if name == "output":
            if path.suffix.lower() in TEXT_ENDINGS:
                raise SymtopError(f"{option} is written as netCDF, such as run.nc, not as {file!r}")
            errors.check_replaceable(path)
        with errors.writing(file):
            tempfile.TemporaryFile(dir=path.parent).close()
        if (first := options.setdefault(path.resolve(), option)) != option:
            raise SymtopError(f"{first} and {option} must be two files, not both {file!r}")


def terminal_width() -> int:
    """Columns of the terminal, at least 60; 80 if there is none."""
    return max(60, shutil.get_terminal_size((80, 24)).columns)


def table(header: Sequence[str], rows: Sequence[Sequence[str]], width: int | None = None) -> str:
    """Text in columns; with a `width`, the last column is broken into lines that fit it."""
    widths = [max(len(row[k]) for row in [header, *rows]) for k in range(len(header))]
    if width is not None:
        widths[-1] = min(widths[-1], max(20, width - sum(widths[:-1]) - 2 * (len(widths) - 1)))
    lines = []
    for row in [header, ["-" * size for size in widths], *rows]:
        first, *rest = textwrap.wrap(row[-1], widths[-1]) or [""]
        block = [[*row[:-1], first], *([*[""] * (len(row) - 1), text] for text in rest)]
        lines += ["  ".join(map(str.ljust, cells, widths)).rstrip() for cells in block]
    return "\n".join(lines)


def facts(pairs: dict[str, str]) -> str:
    """Names and values as text, one per line; values that do not fit the terminal are broken and indented."""
    formatter = click.HelpFormatter(width=terminal_width())
    formatter.write_dl(list(pairs.items()))
    return formatter.getvalue().rstrip()
