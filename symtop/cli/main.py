"""The command line: ``symtop integrators | scenes | run | long | study | claims | report | recommend | doctor | ...``.

Exit codes: 0 fine; 1 a case or a check failed; 2 bad input, or a place that cannot be written; 3 a run ended early by
its outcome (what it had was kept); 130 and 143 a study was interrupted or terminated (what was computed is kept).
Heavy packages are imported by the command that needs them.
"""

import json
import sys
from pathlib import Path
from typing import Any

import click

from symtop import __version__
from symtop.base.validate import SymtopError, positive


def _completing(of: str) -> Any:
    """Offer names of the package's scenes, integrators or studies to the shell."""

    def complete(_: click.Context, __: click.Parameter, begun: str) -> list[str]:
        from symtop.methods.registry import integrators
        from symtop.model.scenes import scenes
        from symtop.runner import scripts

        known = {"scenes": list(scenes()), "integrators": list(integrators()), "studies": scripts.names()}[of]
        return [name for name in known if name.startswith(begun)]

    return complete


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
    from symtop.runner import plugins

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
    from symtop.report import markdown as twin
    from symtop.report import page

    _load_plugins(plugin_files)
    header, rows = page.integrator_table()
    if as_json:
        click.echo(json.dumps([dict(zip(header, row, strict=True)) for row in rows], indent=1))
    else:
        click.echo(twin.table(header, rows) if markdown else _table(header, rows))


@main.command()
@plugin_option
@json_option
def scenes(plugin_files: tuple[str, ...], as_json: bool) -> None:
    """List every scene: what it is for, what it observes, its nutation period."""
    from symtop.report import page

    _load_plugins(plugin_files)
    header, rows = page.scene_table()
    click.echo(
        json.dumps([dict(zip(header, row, strict=True)) for row in rows], indent=1) if as_json else _table(header, rows)
    )


def _say(warning: str) -> None:
    click.echo(f"symtop: {warning}", err=True)


@main.command()
@click.argument("scene", shell_complete=_completing("scenes"))
@click.argument("integrator", shell_complete=_completing("integrators"))
@click.option("--step-size", type=float, help="Step of a fixed-step method.")
@click.option("--tolerance", type=float, help="Tolerance of an adaptive method.")
@click.option("--horizon", type=float, help="Time to run to; the scene's own by default.")
@click.option("--samples", type=int, default=501, show_default=True, help="How many samples to keep.")
@click.option("--observe", help="nutation, axis or attitude; what the scene is watched for by default.")
@click.option("--budget", type=float, help="Most steps, or force evaluations of an adaptive method.")
@click.option("--guard/--no-guard", default=True, help="Say before the run what it will be worth, if that is little.")
@click.option("--output", type=click.Path(), help="Write the run to this netCDF file.")
@click.option("--figure", type=click.Path(), help="Draw the run and its errors into this PNG file.")
@plugin_option
@json_option
def run(
    scene: str, integrator: str, step_size: float | None, tolerance: float | None, horizon: float | None, samples: int,
    observe: str | None, budget: float | None, guard: bool, output: str | None, figure: str | None,
    plugin_files: tuple[str, ...], as_json: bool,
) -> None:  # fmt: skip
    """Run one INTEGRATOR on one SCENE and compare it with the truth.

    \b
    symtop run spheroid midpoint --step-size 0.01
    symtop run goldstein rk45 --tolerance 1e-9 --horizon 200 --output run.nc --figure run.png
    """
    from symtop.base import datasets
    from symtop.measure.errors import QUANTITIES, errors_against
    from symtop.measure.verdicts import judgement
    from symtop.model.scenes import scene as find_scene
    from symtop.run.reference import reference
    from symtop.run.simulation import simulate

    _load_plugins(plugin_files)
    if figure is not None and Path(figure).suffix != ".png":
        raise SymtopError(f"figure must be a file that ends in .png, not {figure!r}")
    data = simulate(
        scene, integrator, step_size=step_size, tolerance=tolerance, horizon=horizon, samples=samples, observe=observe,
        guard=_say if guard else False, budget=budget,
    )  # fmt: skip
    if output is not None:
        datasets.write(data, output)
    where = find_scene(scene)
    truth = reference(where, data["time"].values, precision="closed-form")
    found = errors_against(where, data, truth)
    judged = judgement(where, data, found["axis"].values)
    if figure is not None:
        from symtop.report import single

        single.draw(where, data, truth, found, figure)
    shown = {name: found[name].dropna("time").values for name in QUANTITIES if name in found}
    shown = {name: values for name, values in shown.items() if values.size}
    if as_json:
        facts = {
            name: data.attrs[name]
            for name in ("outcome", "outcome_message", "reached_time", "steps", "force_evaluations")
        }
        largest = {name: {"largest": float(values.max()), "last": float(values[-1])} for name, values in shown.items()}
        click.echo(json.dumps({**facts, "judgement": judged._asdict(), "errors": largest}, indent=1))
    else:
        click.echo(f"{data.attrs['title']}: {data.attrs['outcome_message']}")
        click.echo(f"{data.attrs['steps']} steps, {data.attrs['force_evaluations']} force evaluations")
        if data.attrs["outcome"] == "ok":
            click.echo(f"judged against the truth: {judged.verdict}, {judged.sentence}")
        for name, values in shown.items():
            click.echo(f"  {QUANTITIES[name]:<30} largest {float(values.max()):.3e}   last {float(values[-1]):.3e}")
        for file in (output, figure):
            if file is not None:
                click.echo(f"written to {file}")
    if data.attrs["outcome"] != "ok":
        sys.exit(3)


@main.command()
@click.argument("scene", shell_complete=_completing("scenes"))
@click.argument("integrator", shell_complete=_completing("integrators"))
@click.option("--steps", type=float, default=1e9, show_default=True, help="How many steps.")
@click.option("--step-size", type=float, help="A thousandth of a nutation by default.")
@click.option(
    "--checkpoint", type=click.Path(dir_okay=False), help="File to resume from; in symtop's cache by default."
)
@click.option("--output", type=click.Path(), help="Write the windows to this netCDF file.")
@plugin_option
def long(
    scene: str, integrator: str, steps: float, step_size: float | None, checkpoint: str | None, output: str | None,
    plugin_files: tuple[str, ...],
) -> None:  # fmt: skip
    """Run one INTEGRATOR on one SCENE for very many steps, in little memory; stop it as you like and call it again.

    \b
    symtop long spheroid stormer-verlet --steps 1e9 --output long.nc
    """
    from symtop.base import datasets
    from symtop.base.validate import whole
    from symtop.model.scenes import scene as find_scene
    from symtop.run.long_run import PER_NUTATION, long_run

    _load_plugins(plugin_files)
    h = find_scene(scene).nutation_period / PER_NUTATION if step_size is None else step_size
    count = whole("steps", steps, 1)
    try:
        data = long_run(scene, integrator, steps=count, step_size=h, checkpoint=checkpoint or True)
    except KeyboardInterrupt:
        click.echo("symtop: interrupted; what was run is kept: the same command goes on from there", err=True)
        sys.exit(130)
    click.echo(f"{data.attrs['title']}: {data.attrs['outcome_message']}")
    if data.sizes["window"]:
        for name in ("energy", "modified_energy", "p_phi", "p_psi"):
            low, high = float(data[f"{name}_least"].min()), float(data[f"{name}_largest"].max())
            end = float(data[f"{name}_mean"][-1])
            click.echo(f"  {name:<16} change from {low:+.3e} to {high:+.3e}   mean of the last window {end:+.3e}")
    if output is not None:
        datasets.write(data, output)
        click.echo(f"written to {output}")
    if data.attrs["outcome"] != "ok":
        sys.exit(3)


@main.command()
@click.argument("names", nargs=-1, metavar="[INTEGRATOR]...", shell_complete=_completing("integrators"))
@click.option("--scene", default="spheroid", show_default=True, help="The scene to judge on.")
@click.option("--quick", is_flag=True, help="Shorter runs, one chart.")
@plugin_option
@json_option
def claims(names: tuple[str, ...], scene: str, quick: bool, plugin_files: tuple[str, ...], as_json: bool) -> None:
    """Measure every claim of each INTEGRATOR; exit code 1 if one is refuted.

    Without a name: those of the plug-in, or all there are.

    \b
    symtop claims midpoint rk4
    symtop claims --plugin my_methods.py
    """
    from symtop.judge.claims import judge
    from symtop.methods.registry import integrator, integrators
    from symtop.model.scenes import scene as find_scene

    before = set(integrators())
    _load_plugins(plugin_files)
    added = [name for name in integrators() if name not in before]
    where = find_scene(scene)
    chosen = [integrator(name) for name in names or added or integrators()]
    refuted, shown = False, []
    for method in chosen:
        ledger = judge(method, where, quick=quick)
        refuted |= any(found.verdict == "refuted" for found in ledger.findings)
        if as_json:
            shown += [{"integrator": method.name, "scene": where.name, **found.plain()} for found in ledger.findings]
        else:
            click.echo("\n".join(ledger.sentences()))
    if as_json:
        click.echo(json.dumps(shown, indent=1))
    if refuted:
        sys.exit(1)


@main.command()
@click.argument("names", nargs=-1, shell_complete=_completing("studies"))
@click.option("--all", "every", is_flag=True, help="Run every study.")
@click.option("--quick", is_flag=True, help="Coarse grids, a few seconds a study; kept apart from the full results.")
@click.option("--full", is_flag=True, help="The longest grid of a study that has one.")
@click.option("--fresh", is_flag=True, help="Compute every case again; with --check, check every case.")
@click.option("--status", "only_status", is_flag=True, help="Say what is done, stale or missing; compute nothing.")
@click.option("--check", "only_check", is_flag=True, help="Compute stored cases again, elsewhere, and compare.")
@click.option("--jobs", type=click.IntRange(1), help="Processes for untimed cases; all cores by default.")
@click.option("--scheduler", metavar="ADDRESS", help="Compute untimed cases on the dask cluster of this scheduler.")
@click.option("--limit", type=float, metavar="SECONDS", help="Time a case may take; an hour by default.")
@click.option("--results", type=click.Path(file_okay=False), default="results", show_default=True)
@json_option
@plugin_option
def study(
    names: tuple[str, ...], every: bool, quick: bool, full: bool, fresh: bool, only_status: bool, only_check: bool,
    jobs: int | None, scheduler: str | None, limit: float | None, results: str, as_json: bool,
    plugin_files: tuple[str, ...],
) -> None:  # fmt: skip
    """Run studies by NAME: datasets, figures and findings into the results folder.

    A run that is interrupted (code 130) or terminated (143) loses what it was computing and nothing else; the same
    command goes on from there. Two runs may share a folder. A case that fails is recorded and the others go on (code
    1). NAME is also a path, for a script of your own anywhere.

    \b
    symtop study convergence drift
    symtop study --all --quick
    symtop study stability --plugin my_methods.py
    symtop study --all --status
    symtop study convergence --scheduler tcp://10.0.0.1:8786
    """
    from symtop.cli import study as command

    _load_plugins(plugin_files)
    if quick and full:
        raise SymtopError("quick and full must not be given together")
    if limit is not None:
        positive("limit", limit)
    folder = Path(results) / "quick" if quick else Path(results)
    chosen = command.choose(names, every=every)
    options = command.Options(folder, quick, full, fresh, jobs, scheduler, limit, as_json)
    if only_status:
        code = command.show_status(chosen, options)
    else:
        code = command.conduct(command.check_all if only_check else command.run_all, chosen, options)
    if code:
        sys.exit(code)


@main.command()
@click.option("--results", type=click.Path(file_okay=False), default="results", show_default=True)
@json_option
def doctor(results: str, as_json: bool) -> None:
    """Look at what is installed, cached and writable, check a few numbers, and say what to do about each problem."""
    from symtop.cli import doctor as doctor_

    findings = doctor_.examine(Path(results))
    if as_json:
        click.echo(json.dumps([finding._asdict() for finding in findings], indent=1))
    else:
        click.echo(doctor_.page(findings))
    if not all(finding.healthy for finding in findings):
        sys.exit(1)


@main.command()
@click.option("--results", type=click.Path(file_okay=False), default="results", show_default=True)
@plugin_option
def report(results: str, plugin_files: tuple[str, ...]) -> None:
    """Gather the findings of all studies into one self-contained page."""
    from symtop.report import page

    _load_plugins(plugin_files)
    click.echo(f"report: {page.write(Path(results))}")


@main.command()
@click.argument("scene", shell_complete=_completing("scenes"))
@click.option("--accuracy", type=float, required=True, help="The largest error you accept, for example 1e-6.")
@click.option("--quantity", default="axis", show_default=True, help="Of what: axis, attitude, theta, energy, ...")
@click.option("--horizon", type=float, help="Time to run to; the scene's own by default.")
@click.option("--results", type=click.Path(file_okay=False), help="Folder with a stored work-precision study.")
@plugin_option
@json_option
def recommend(
    scene: str, accuracy: float, quantity: str, horizon: float | None, results: str | None,
    plugin_files: tuple[str, ...], as_json: bool,
) -> None:  # fmt: skip
    """Find the cheapest integrator and step that meet an accuracy on a SCENE.

    \b
    symtop recommend spheroid --accuracy 1e-6
    symtop recommend goldstein --accuracy 1e-3 --quantity attitude --horizon 1e4
    symtop recommend mine --plugin my_scene.py --accuracy 1e-9
    """
    import dataclasses

    from symtop import advise

    _load_plugins(plugin_files)
    advice = advise.recommend(scene, accuracy=accuracy, quantity=quantity, horizon=horizon, results=results)
    click.echo(json.dumps(dataclasses.asdict(advice), indent=1) if as_json else str(advice))
    if advice.integrator is None:
        sys.exit(1)


@main.command()
@click.option("--port", type=int, default=0, help="Port to listen on; a free one by default.")
@click.option("--no-browser", is_flag=True, help="Print the address and open nothing.")
@plugin_option
def explore(port: int, no_browser: bool, plugin_files: tuple[str, ...]) -> None:
    """Sliders in a browser: any top, start, integrator and step, beside the truth."""
    import signal
    import webbrowser

    from symtop.explore.server import address, serve

    def end(*_: object) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, end)
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
