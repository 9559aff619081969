"""``symtop run``, ``long`` and ``claims``: one integrator on one scene, compared with the truth."""

import math
import sys

import click

from symtop.cli.common import File, apart, as_text, figure_file, json_option, plugin_option, say, standing, table, warn
from symtop.cli.completion import completing
from symtop.core.errors import SymtopError

SAME = 0.01  # a step that differs by more from the one asked for is told


@click.command(short_help="Run one integrator on one scene; show its errors.")
@click.argument("scene", shell_complete=completing("scenes"))
@click.argument("integrator", shell_complete=completing("integrators"))
@click.option("--step-size", type=float, help="Step of a fixed-step method.")
@click.option("--tolerance", type=float, help="Tolerance of an adaptive method.")
@click.option("--horizon", type=float, help="Time to run to; the scene's own by default.")
@click.option("--samples", type=int, default=501, show_default=True, help="Number of samples in the output.")
@click.option("--observe", help="nutation, axis or attitude; by default what the scene names and the method shows.")
@click.option("--budget", type=float, help="Most steps, or force evaluations of an adaptive method.")
@click.option("--guard/--no-guard", default=True, help="Warn before the run if a large error is expected.")
@click.option("--output", type=File(), help="Write the run to this netCDF file.")
@click.option("--figure", type=File(), help="Draw the run and its errors: .png, .svg or .pdf.")
@plugin_option
@json_option
def run(
    scene: str, integrator: str, step_size: float | None, tolerance: float | None, horizon: float | None, samples: int,
    observe: str | None, budget: float | None, guard: bool, output: str | None, figure: str | None, as_json: bool,
) -> None:  # fmt: skip
    """Run one INTEGRATOR on one SCENE and compare it with the exact motion.

    INTEGRATOR is a method, which runs in the smallest of its charts that shows what the scene observes, or a method in
    one chart: rk4[angles], rk4[axis], strang[attitude].

    \b
    symtop run spheroid midpoint --step-size 0.01
    symtop run spheroid "rk4[axis]" --step-size 0.01
    symtop run goldstein rk45 --tolerance 1e-9 --horizon 200 --output run.nc --figure run.png
    """
    from symtop.core.progress import ticking

    figure_file("--figure", figure)
    standing("--output", output)
    apart(output=output, figure=figure)
    with ticking("running"):  # the packages are loaded under the clock, too
        from symtop.core import netcdf
        from symtop.measure.errors import QUANTITIES, errors_against
        from symtop.measure.verdicts import judgement
        from symtop.model import scenes
        from symtop.run.reference.truth import reference
        from symtop.run.simulation import simulate

        data = simulate(
            scene, integrator, step_size=step_size, tolerance=tolerance, horizon=horizon, samples=samples,
            observe=observe, guard=warn if guard else False, budget=budget,
        )  # fmt: skip
        if output is not None:
            netcdf.write(data, output)
        chosen = scenes.scene(scene)
        truth = reference(chosen, data["time"].values, precision="closed-form")
        error = errors_against(chosen, data, truth)
        verdict = judgement(chosen, data, error["axis"].values)
        if figure is not None:
            from symtop.report import single

            single.draw(chosen, data, truth, error, figure)
    series = {name: error[name].dropna("time").values for name in QUANTITIES if name in error}
    largest = {
        name: {"largest": float(values.max()), "last": float(values[-1])}
        for name, values in series.items()
        if values.size
    }
    if as_json:
        names = ("outcome", "outcome_message", "reached_time", "steps", "force_evaluations")
        findings = {**{name: data.attrs[name] for name in names}, "judgement": verdict._asdict(), "errors": largest}
        click.echo(as_text(findings))
    else:
        told = data.attrs
        method = told["integrator"]
        row = method if method.endswith("]") else f"{method}[{told['chart']}]"
        say(f"{row} on {chosen.name}: {told['outcome_message']}")
        made = told["step_size"]
        other = step_size is not None and abs(made / step_size - 1.0) > SAME
        of = f" of {made:.6g}, for a whole number of them fills the horizon" if other else ""
        say(f"{told['steps']} steps{of}, {told['force_evaluations']} force evaluations")
        if data.attrs["outcome"] == "ok":
            say(f"judged against the truth: {verdict.words()}")
        for name, values in largest.items():
            click.echo(f"  {QUANTITIES[name]:<30} largest {values['largest']:.3e}   last {values['last']:.3e}")
    for file in () if as_json else (output, figure):
        if file is not None:
            click.echo(f"written to {file}")
    if data.attrs["outcome"] != "ok":
        sys.exit(3)


@click.command(short_help="Run up to billions of steps in little memory.")
@click.argument("scene", shell_complete=completing("scenes"))
@click.argument("integrator", shell_complete=completing("integrators"))
@click.option("--steps", type=float, default=1e9, show_default=True, help="Number of steps.")
@click.option("--step-size", type=float, help="Step; a thousandth of a nutation period by default.")
@click.option("--checkpoint", type=File(), help="File to resume from; symtop's own by default.")
@click.option("--output", type=File(), help="Write the windows to this netCDF file.")
@plugin_option
def long(
    scene: str, integrator: str, steps: float, step_size: float | None, checkpoint: str | None, output: str | None
) -> None:
    """Run one INTEGRATOR on one SCENE for very many steps, in little memory.

    The run is cut into windows, and the output holds the least, largest and mean change of the energy and the momenta
    in each. A checkpoint is written as it goes: the same command resumes a run that was interrupted.

    \b
    symtop long spheroid stormer-verlet --steps 1e9 --output long.nc
    """
    from symtop.core.progress import ticking

    apart(output=output, checkpoint=checkpoint)
    standing("--output", output)
    standing("--checkpoint", checkpoint)
    with ticking("loading"):
        from symtop.core.errors import whole
        from symtop.model import scenes
        from symtop.run.long_run import PER_NUTATION, long_run

    period = scenes.scene(scene).nutation_period
    if step_size is None and period == math.inf:
        raise SymtopError(f"{scene} has no nutation to take a step from: give --step-size")
    h = period / PER_NUTATION if step_size is None else step_size
    count = whole("steps", steps, 1)
    try:
        data = long_run(scene, integrator, steps=count, step_size=h, checkpoint=checkpoint or True, output=output)
    except KeyboardInterrupt:
        warn("interrupted; the steps that were run are kept, and the same command resumes after them")
        sys.exit(130)
    say(f"{data.attrs['title']}: {data.attrs['outcome_message']}")
    if data.sizes["window"]:
        rows = [
            [
                name,
                *(f"{float(value):+.3e}" for value in (
                    data[f"{name}_least"].min(), data[f"{name}_largest"].max(), data[f"{name}_mean"][-1],
                )),
            ]
            for name in ("energy", "modified_energy", "p_phi", "p_psi")
        ]  # fmt: skip
        click.echo(table(["change since the start", "least", "largest", "last window's mean"], rows))
    if output is not None:
        click.echo(f"written to {output}")
    if data.attrs["outcome"] != "ok":
        sys.exit(3)


@click.command(short_help="Measure what integrators claim about themselves.")
@click.argument("names", nargs=-1, metavar="[INTEGRATOR]...", shell_complete=completing("integrators"))
@click.option("--scene", default="spheroid", show_default=True, help="The scene to judge on.")
@click.option("--quick", is_flag=True, help="Shorter runs, one chart.")
@plugin_option
@json_option
def claims(names: tuple[str, ...], scene: str, quick: bool, as_json: bool) -> None:
    """Measure every claim of each INTEGRATOR: order, symplecticity, symmetry, conserved quantities, cost.

    The exit code is 1 if a claim is refuted. Without a name: the integrators of the plug-in, or all.

    \b
    symtop claims midpoint rk4
    symtop claims --plugin my_methods.py
    """
    from symtop.core.progress import ticking

    with ticking("loading"):
        from symtop.judging.battery import judge
        from symtop.methods.framework import registry
        from symtop.model import scenes

        chosen = scenes.scene(scene)
        added = [name for name in registry.integrators() if not registry.is_built_in(name)]
    refuted, entries = False, []
    for name in names or added or registry.integrators():
        with ticking(f"measuring {name}"):
            ledger = judge(registry.integrator(name), chosen, quick=quick)
        refuted |= any(finding.verdict == "refuted" for finding in ledger.findings)
        if as_json:
            about = {"integrator": ledger.integrator, "scene": chosen.name}
            entries += [{**about, **finding.plain()} for finding in ledger.findings]
        else:
            say("\n".join(ledger.sentences()))
    if as_json:
        click.echo(as_text(entries))
    if refuted:
        sys.exit(1)
