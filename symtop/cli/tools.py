"""``symtop recommend``, ``doctor`` and ``explore``."""

import sys
from pathlib import Path

import click

from symtop.cli.common import File, as_text, json_option, plugin_option, results_option, say
from symtop.cli.completion import completing
from symtop.core.errors import SymtopError


@click.command(short_help="Find the cheapest integrator for an accuracy.")
@click.argument("scene", shell_complete=completing("scenes"))
@click.option("--accuracy", type=float, help="The largest error you accept, for example 1e-6; rad of an angle.")
@click.option("--i-use", "engine", help="A physics engine, for example mujoco: what its settings make of the scene.")
@click.option("--step-size", type=float, help="Of the engine; 1/240 by default.")
@click.option("--quantity", default="axis", show_default=True, help="Of what: axis, attitude, theta, energy, ...")
@click.option("--horizon", type=float, help="Time to run to; the scene's own by default.")
@click.option("--results", type=File(file_okay=False), help="Folder of a stored study; results by default.")
@plugin_option
@json_option
def recommend(
    scene: str, accuracy: float | None, engine: str | None, step_size: float | None, quantity: str,
    horizon: float | None, results: str | None, as_json: bool,
) -> None:  # fmt: skip
    """Find the cheapest integrator and step that meet an accuracy on a SCENE.

    The exit code is 1 if none does.

    \b
    symtop recommend spheroid --accuracy 1e-6
    symtop recommend goldstein --accuracy 1e-3 --quantity attitude --horizon 1e4
    symtop recommend mine --plugin my_scene.py --accuracy 1e-9
    symtop recommend goldstein --i-use mujoco --step-size 0.002
    """
    import dataclasses

    from symtop.core.progress import ticking

    with ticking("loading"):
        from symtop import advise
    if (accuracy is None) is (engine is None):
        both = "" if accuracy is None else ", not both"
        raise SymtopError(f"recommend takes one of --accuracy, for example 1e-6, and --i-use{both}")
    if engine is not None:
        from symtop.cli.engine_advice import STEP, i_use

        said = i_use(engine, scene, step_size=STEP if step_size is None else step_size, horizon=horizon)
        click.echo(as_text(dataclasses.asdict(said)) if as_json else str(said))
        return
    if step_size is not None:
        raise SymtopError("--step-size belongs to --i-use; with --accuracy the step is what is found")
    if results is None and (Path("results") / advise.STORED_STUDY).is_file():
        results = "results"
    with ticking("trying methods"):
        advice = advise.recommend(scene, accuracy=accuracy or 0.0, quantity=quantity, horizon=horizon, results=results)
    click.echo(as_text(dataclasses.asdict(advice))) if as_json else say(str(advice))
    if advice.integrator is None:
        sys.exit(1)


@click.command(short_help="Check the installation; say what to do about faults.")
@results_option
@click.option("--warm", is_flag=True, help="First compile every kernel, so that no later run waits for the compiler.")
@json_option
def doctor(results: str, warm: bool, as_json: bool) -> None:
    """Check packages, caches, folders and a few computed numbers, and say what to do about each fault.

    The exit code is 1 if there is a fault. It takes some seconds; with --warm, some minutes the first time.
    """
    from symtop.core.progress import ticking

    with ticking("loading"):
        from symtop.cli import doctor as checks
    if warm:
        from symtop.cli.warm import warm as compile_all

        count, failed = compile_all()
        click.echo(f"kernels compiled: {count}; every method was run in each of its charts", err=as_json)
        for why in failed:
            click.echo(f"  not run: {why}", err=True)
    findings = checks.examine(Path(results))
    if as_json:
        click.echo(as_text([finding._asdict() for finding in findings]))
    else:
        click.echo(checks.page(findings))
    if not all(finding.healthy for finding in findings):
        sys.exit(1)


@click.command(short_help="Open the explorer: one run in a browser, with sliders.")
@click.option("--port", type=int, default=0, help="Port to listen on; a free one by default.")
@click.option("--no-browser", is_flag=True, help="Print the address and open nothing.")
@plugin_option
def explore(port: int, no_browser: bool) -> None:
    """Show one run beside the exact motion in a browser, with sliders for the top, the start and the step."""
    import webbrowser

    from symtop.core.signals import TerminatedError, ending_on_sigterm
    from symtop.explore.server import address, serve

    with ending_on_sigterm(), serve(port) as server:
        click.echo(f"symtop explore: {address(server)} (Ctrl-C ends it)")
        if not no_browser:
            webbrowser.open(address(server))
        try:
            server.serve_forever()
        except (KeyboardInterrupt, TerminatedError):
            click.echo("")
