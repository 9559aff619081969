"""``symtop ensemble``: many random tops, one integrator."""

import sys
from collections import Counter
from functools import partial

import click

from symtop.cli.common import (
    File,
    apart,
    as_text,
    figure_file,
    json_option,
    plugin_option,
    say,
    standing,
    table,
    telling,
    warn,
)
from symtop.cli.completion import completing
from symtop.core.errors import SymtopError, whole

pairs = partial(zip, strict=True)
COMPARED = 100_000  # tops whose errors are shown, the first of the population: those of a million take 1 GB

OUTCOME = {"ok": "reached the horizon"}  # which says nothing yet of their errors
EXECUTION = {
    "lanes": "32 tops at a time in vector registers (lanes)",
    "compiled, one after another": "one top after another in compiled code",
    "one call of Python for each": "one top after another, each by a call of Python",
}


@click.command(short_help="Run one integrator on many random tops.")
@click.argument("integrator", shell_complete=completing("integrators"))
@click.option("--members", type=int, default=1000, show_default=True, help="Number of tops.")
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of the population.")
@click.option("--kind", default="all", show_default=True, help="A stratum of the population, or all.")
@click.option("--step-size", type=float, help="Step of a fixed-step method.")
@click.option("--per-nutation", type=float, help="In place of a step: steps in a nutation period of each top.")
@click.option("--tolerance", type=float, help="Tolerance of an adaptive method.")
@click.option("--horizon", type=float, help="Time to run to.")
@click.option("--nutations", type=float, help="In place of a horizon: nutation periods of each top.")
@click.option("--samples", type=int, default=101, show_default=True, help="Number of samples of each top.")
@click.option("--observe", help="nutation, axis or attitude; the axis by default.")
@click.option("--variables", metavar="NAMES", help="What is kept over time, with commas; all by default.")
@click.option("--budget", type=float, help="Most steps of a top, or force evaluations of an adaptive method.")
@click.option("--threads", type=int, help="Threads; one a core by default.")
@click.option("--scheduler", metavar="ADDRESS", help="Run on this dask cluster.")
@click.option("--output", "-o", type=File(), help="Stream the runs to this netCDF file.")
@click.option("--figure", type=File(), help="Draw quantiles of the errors over time: .png, .svg or .pdf.")
@plugin_option
@json_option
def ensemble(
    integrator: str, members: int, seed: int, kind: str, step_size: float | None, per_nutation: float | None,
    tolerance: float | None, horizon: float | None, nutations: float | None, samples: int, observe: str | None,
    variables: str | None, budget: float | None, threads: int | None, scheduler: str | None, output: str | None,
    figure: str | None, as_json: bool,
) -> None:  # fmt: skip
    """Run one INTEGRATOR on tops of a random population and compare each with the exact motion.

    Each top has the bits of ``symtop run`` alone. With an output, tops are written as they are computed, and the same
    command resumes a run that was interrupted. A top that fails fails alone; the exit code is 3 if all have failed.

    \b
    symtop ensemble --members 10000 --seed 1 strang --step-size 0.01 --horizon 20 -o runs.nc
    symtop ensemble --kind grazing "gauss-4[axis]" --per-nutation 50 --nutations 10 --figure spread.png
    """
    from symtop.core.progress import ticking

    figure_file("--figure", figure)
    standing("--output", output)
    count = whole("members", members, 1)  # which is n in Python
    apart(output=output, figure=figure)
    names = None if variables is None else [name.strip() for name in variables.split(",")]
    with ticking("drawing tops"):
        from symtop.measure.spread import LEVELS, QUANTITIES, largest, member_errors, spread
        from symtop.run.ensemble import ensemble as runs
        from symtop.run.ensemble.population import population

        tops = population(count, seed=seed, kind=kind)
    compared = [name for name in QUANTITIES if names is None or name in names]
    if figure is not None and not compared:
        raise SymtopError("--figure needs axis or energy among --variables, whose errors it shows")
    try:
        with telling():
            data = runs.ensemble(
                tops, integrator, step_size=step_size, per_nutation=per_nutation, tolerance=tolerance, horizon=horizon,
                nutations=nutations, samples=samples, observe=observe, variables=names, budget=budget, path=output,
                threads=threads, scheduler=scheduler,
            )  # fmt: skip
    except KeyboardInterrupt:
        warn("interrupted" + ("" if output is None else "; the tops that were run are kept: the same command resumes"))
        sys.exit(130)
    few, shown = (part.isel(member=slice(0, COMPARED)) for part in (tops, data))
    outcomes, steps = Counter(data["outcome"].values.tolist()), int(data["steps"].sum())
    with ticking("comparing with the exact motion"):
        if figure is not None:
            from symtop.report import ensemble as picture

            picture.draw(few, shown, figure)
        worst = {name: spread(largest(member_errors(few, shown, name))[:, None])[:, 0].tolist() for name in compared}
    data.close()
    if as_json:
        errors = {name: {f"{q:g}": e for q, e in pairs(LEVELS, worst[name])} for name in worst}
        click.echo(as_text({"outcomes": outcomes, "steps": steps, "largest_errors": errors}))
    else:
        said = ", ".join(f"{count} {OUTCOME.get(name, name)}" for name, count in outcomes.items())
        execution = data.attrs["execution"]
        say(f"{data.attrs['title']}: {said}\n{steps} steps, computed {EXECUTION.get(execution, execution)}")
        heading = [f"largest error, {few.sizes['member']} tops", *(f"{100.0 * level:g} %" for level in LEVELS)]
        if worst:
            click.echo(table(heading, [[QUANTITIES[name], *map("{:.1e}".format, row)] for name, row in worst.items()]))
        for file in (output, figure):
            if file is not None:
                click.echo(f"written to {file}")
    if "ok" not in outcomes:
        sys.exit(3)
