"""The command line: ``symtop integrators | scenes | run | study | report | explore``.

Exit codes: 0 fine, 1 a case or a check failed, 2 bad input, 3 a run ended early by its outcome (what it had was kept).
Heavy packages are imported by the command that needs them.
"""

import json
import sys
from pathlib import Path
from typing import Any

import click

from symtop import __version__
from symtop.checks import SymtopError

plugin_option = click.option(
    "--plugin",
    "plugin_files",
    multiple=True,
    metavar="FILE",
    help="A Python file that registers integrators or scenes.",
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of a table.")


class _Group(click.Group):
    """Turns a SymtopError into one sentence and exit code 2."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except SymtopError as error:
            click.echo(f"symtop: {error}", err=True)
            ctx.exit(2)


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="symtop")
def main() -> None:
    """Integrators compared on the heavy symmetric top.

    \b
    symtop run spheroid midpoint --step-size 0.01
    symtop study convergence --quick
    symtop report
    """


def _load_plugins(files: tuple[str, ...]) -> None:
    from symtop.study import plugins  # noqa: PLC0415

    for file in files:
        plugins.load(file)


def _table(header: list[str], rows: list[list[str]]) -> str:
    widths = [max(len(row[k]) for row in [header, *rows]) for k in range(len(header))]
    lines = [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in [header, *rows]
    ]
    return "\n".join([lines[0], "  ".join("-" * width for width in widths), *lines[1:]])


@main.command()
@plugin_option
@json_option
@click.option("--markdown", is_flag=True, help="Print a Markdown table.")
def integrators(plugin_files: tuple[str, ...], as_json: bool, markdown: bool) -> None:
    """List every integrator with what it claims about itself."""
    from symtop.report import page  # noqa: PLC0415

    _load_plugins(plugin_files)
    header, rows = page.integrator_table()
    if as_json:
        click.echo(json.dumps([dict(zip(header, row, strict=True)) for row in rows], indent=1))
    else:
        click.echo(page.markdown_table(header, rows) if markdown else _table(header, rows))


@main.command()
@plugin_option
@json_option
def scenes(plugin_files: tuple[str, ...], as_json: bool) -> None:
    """List every scene: what it is for, what it observes, its nutation period."""
    from symtop.report import page  # noqa: PLC0415

    _load_plugins(plugin_files)
    header, rows = page.scene_table()
    click.echo(
        json.dumps([dict(zip(header, row, strict=True)) for row in rows], indent=1) if as_json else _table(header, rows)
    )


def _say(warning: str) -> None:
    click.echo(f"symtop: {warning}", err=True)


@main.command()
@click.argument("scene")
@click.argument("integrator")
@click.option("--step-size", type=float, help="Step of a fixed-step method.")
@click.option("--tolerance", type=float, help="Tolerance of an adaptive method.")
@click.option("--horizon", type=float, help="Time to run to; the scene's own by default.")
@click.option("--samples", type=int, default=501, show_default=True, help="How many samples to keep.")
@click.option("--observe", help="nutation, axis or attitude; what the scene is watched for by default.")
@click.option("--budget", type=float, help="Most steps, or force evaluations of an adaptive method.")
@click.option("--guard/--no-guard", default=True, help="Say before the run what it will be worth, if that is little.")
@click.option("--output", type=click.Path(), help="Write the run to this netCDF file.")
@plugin_option
def run(
    scene: str, integrator: str, step_size: float | None, tolerance: float | None, horizon: float | None, samples: int,
    observe: str | None, budget: float | None, guard: bool, output: str | None, plugin_files: tuple[str, ...],
) -> None:  # fmt: skip
    """Run one INTEGRATOR on one SCENE and compare it with the truth.

    \b
    symtop run spheroid midpoint --step-size 0.01
    symtop run goldstein rk45 --tolerance 1e-9 --horizon 200 --output run.nc
    """
    from symtop import datasets  # noqa: PLC0415
    from symtop.measure.errors import QUANTITIES, errors  # noqa: PLC0415
    from symtop.reference import reference  # noqa: PLC0415
    from symtop.scenes import scene as find_scene  # noqa: PLC0415
    from symtop.simulate import simulate  # noqa: PLC0415

    _load_plugins(plugin_files)
    data = simulate(
        scene, integrator, step_size=step_size, tolerance=tolerance, horizon=horizon, samples=samples, observe=observe,
        guard=_say if guard else False, budget=budget,
    )  # fmt: skip
    if output is not None:
        datasets.write(data, output)
    outcome = data.attrs["outcome"]
    click.echo(f"{data.attrs['title']}: {data.attrs['outcome_message']}")
    click.echo(f"{data.attrs['steps']} steps, {data.attrs['force_evaluations']} force evaluations")
    found = errors(find_scene(scene), data, reference(scene, data["time"].values, precision="closed-form"))
    for name, label in QUANTITIES.items():
        if name in found and found[name].notnull().any():
            values = found[name].dropna("time")
            click.echo(f"  {label:<30} largest {float(values.max()):.3e}   last {float(values[-1]):.3e}")
    if output is not None:
        click.echo(f"written to {output}")
    if outcome != "ok":
        sys.exit(3)


@main.command()
@click.argument("names", nargs=-1)
@click.option("--all", "every", is_flag=True, help="Run every study.")
@click.option("--quick", is_flag=True, help="Coarse grids, a few seconds a study; kept apart from the full results.")
@click.option("--fresh", is_flag=True, help="Compute every case again.")
@click.option("--jobs", type=click.IntRange(1), help="Processes for untimed cases; all cores by default.")
@click.option("--results", type=click.Path(file_okay=False), default="results", show_default=True)
@plugin_option
def study(
    names: tuple[str, ...], every: bool, quick: bool, fresh: bool, jobs: int | None, results: str,
    plugin_files: tuple[str, ...],
) -> None:  # fmt: skip
    """Run studies by NAME: datasets, figures and findings into the results folder.

    \b
    symtop study convergence drift
    symtop study --all --quick
    symtop study stability --plugin my_methods.py
    """
    from symtop.study import run as runner  # noqa: PLC0415

    _load_plugins(plugin_files)
    chosen = runner.names() if every else list(names)
    if not chosen:
        msg = f"name a study or use --all; known: {', '.join(runner.names())}"
        raise SymtopError(msg)
    folder = Path(results) / "quick" if quick else Path(results)
    failed = False
    for study_ in [runner.load(name) for name in chosen]:
        found = runner.run(study_, folder, quick=quick, fresh=fresh, jobs=jobs)
        click.echo(
            f"{study_.name}: {found['computed']} of {found['cases']} cases computed, {len(found['pictures'])} figures"
        )
        for failure in found["failures"]:
            click.echo(f"  {failure}", err=True)
            failed = True
    if failed:
        sys.exit(1)


@main.command()
@click.option("--results", type=click.Path(file_okay=False), default="results", show_default=True)
@plugin_option
def report(results: str, plugin_files: tuple[str, ...]) -> None:
    """Gather the findings of all studies into one self-contained page."""
    from symtop.report import page  # noqa: PLC0415

    _load_plugins(plugin_files)
    click.echo(f"report: {page.write(Path(results))}")


@main.command()
@click.option("--port", type=int, default=0, help="Port to listen on; a free one by default.")
@click.option("--no-browser", is_flag=True, help="Print the address and open nothing.")
@plugin_option
def explore(port: int, no_browser: bool, plugin_files: tuple[str, ...]) -> None:
    """Sliders in a browser: any top, start, integrator and step, beside the truth."""
    import webbrowser  # noqa: PLC0415

    from symtop.explore.server import address, serve  # noqa: PLC0415

    _load_plugins(plugin_files)
    with serve(port) as server:
        click.echo(f"symtop explore: {address(server)} (Ctrl-C ends it)")
        if not no_browser:
            webbrowser.open(address(server))
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            click.echo("")


if __name__ == "__main__":
    main()
