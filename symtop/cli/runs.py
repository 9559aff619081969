"""``symtop run``, ``long``, ``ensemble`` and ``explore``: one integrator on a scene or on many tops."""

import math
import sys
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

import click

from symtop.cli import common
from symtop.cli.common import File, as_text, check_outputs, completing, say, say_written, separated, table, warn
from symtop.core.errors import SymtopError, whole
from symtop.core.progress import kernels_to_compile, post, showing_seconds
from symtop.report.formats import NO_BREAK, counted, duration

TRIAL_STEPS, TIMED_STEPS, TIMED_RATIO = 1000, 100_000, 20  # a run of more than 20 times 100,000 steps is timed before
FITTED_DECADES = 2.5  # decades of time at the end of a long run, in which the growth of a change is fitted
LONG_ENOUGH = 0.5  # seconds that a trial must take longer than one of `TRIAL_STEPS` steps
SAME_STEP = 0.01  # relative difference of the step used from --step-size above which it is printed
ENSEMBLE_KERNELS, KERNELS_OF_FEW = 5, 2  # periods, samples, starts, steps in lanes and alone; of few steps
DRAW_ATTRIBUTES = ("seed", "kind", "epsilon")  # attributes of a population that say how it was drawn
MOST_COMPARED, MOST_COMPARED_BODIES = 100_000, 1000  # whose errors are computed; of a million tops they take 1 GB
PARAMETERS = ("I1", "I2", "I3", "mgl", "centre")  # variables of a population that are not of the start

GUARD = "Warn of a large error by the closed form (exact, of tops) or by an integration (series)."
OUTCOME = {"ok": "reached the horizon"}  # the printed words for an outcome
EXECUTION = {  # what is said of it, if it is not in lanes, which few steps may not be
    "compiled, one after another": ", computed one after another in compiled code",
    "one call of Python for each": ", computed one after another, each by a call of Python",
}


@click.command(short_help="Run one integrator on one scene; show its errors.")
@click.argument("scene", shell_complete=completing("all scenes"))
@click.argument("integrator", shell_complete=completing("integrators"))
@click.option("--step-size", type=float, help="Step of a fixed-step method.")
@common.per_nutation_option
@click.option("--tolerance", type=float, help="Tolerance of an adaptive method.")
@click.option("--horizon", type=float, help="Time to run to; the scene's own by default.")
@click.option("--samples", type=int, default=501, show_default=True, help="Number of samples in the output.")
@click.option("--observe", help="nutation, axis or attitude; by default what the scene names and the method shows.")
@click.option("--budget", type=float, help="Most steps, or force evaluations of an adaptive method.")
@click.option("--guard", is_flag=False, flag_value="on", default="on", metavar="exact|series", help=GUARD)
@click.option("--no-guard", "guard", flag_value="off", help="Do not warn before the run of a large error.")
@click.option("--output", "-o", type=File(), help="Write the run to this netCDF file.")
@click.option("--figure", type=File(), help="Draw the run and its errors: .png, .svg or .pdf.")
@common.scene_options
def run(
    scene: Any, integrator: str, guard: Any, output: str | None, figure: str | None, as_json: bool, **settings: Any
) -> None:
    """Run one INTEGRATOR on one SCENE and compare it with the exact motion.

    INTEGRATOR is a method, which runs in the smallest of its charts that shows what the scene observes, or a method in
    one chart: rk4[angles], rk4[axis], strang[attitude].

    \b
    symtop run spheroid midpoint --step-size 0.01
    symtop run spheroid "rk4[axis]" --step-size 0.01
    symtop run goldstein rk45 --tolerance 1e-9 --horizon 200 --output run.nc --figure run.png
    symtop run body rk4 --body 1,2,3 --rates 0.01,1,0 --step-size 0.01
    """
    check_outputs(output=output, figure=figure)
    with showing_seconds("loading"):
        from symtop.core import netcdf
        from symtop.measure.errors import OF_BODY, QUANTITIES
        from symtop.model import scenes
        from symtop.run.simulation import simulate

        settings["step_size"] = h = common.step_of(scene, settings)
        problem = scenes.scene(scene, bodies=True)
        horizon = problem.horizon if settings["horizon"] is None else scenes.horizon_of(settings["horizon"])
    has_truth = not problem.of_body or _has_reference(problem, horizon, figure)
    if h is not None and h > 0.0:
        few_steps = partial(simulate, scene, integrator, step_size=h, samples=2, guard=False)
        estimate(horizon / h, lambda count: few_steps(horizon=count * h))
    with showing_seconds("running"):
        data = simulate(scene, integrator, guard={"on": True, "off": False}.get(guard, guard), **settings)
        if output is not None:
            netcdf.write(data, output)
        error, verdict = _errors_and_verdict(problem, data, figure) if has_truth else ({}, None)
    words = QUANTITIES | OF_BODY if problem.of_body else QUANTITIES
    series = {name: error[name].dropna("time").values for name in words if name in error}
    largest = {name: {"largest": values.max(), "last": values[-1]} for name, values in series.items() if values.size}
    facts = data.attrs
    if as_json:
        names = ("outcome", "outcome_message", "reached_time", "steps", "force_evaluations")
        of_run = {name: facts[name] for name in names}
        click.echo(as_text({**of_run, "judgement": verdict and verdict._asdict(), "errors": largest}))
    else:
        method, actual, nominal = facts["integrator"], facts["step_size"], settings["step_size"]
        variant = method if method.endswith("]") else f"{method}[{facts['chart']}]"
        say(f"{variant} on {problem.name}: {facts['outcome_message']}")
        adjusted = nominal is not None and abs(actual / nominal - 1.0) > SAME_STEP
        size = f" of {actual:.6g}, for a whole number of them fills the horizon" if adjusted else ""
        say(f"{counted(facts['steps'], 'step')}{size}, {counted(facts['force_evaluations'], 'force evaluation')}")
        if facts["sampling"] == "dithered":
            say("samples are not evenly spaced, so that they show all phases of the nutation")
        if verdict is not None and facts["outcome"] == "ok":
            say(f"judged against the truth: {verdict.words()}")
        for name, values in largest.items():
            click.echo(f"  {words[name]:<37} largest {values['largest']:.3e}   last {values['last']:.3e}")
        say_written(output, figure)
    if facts["outcome"] != "ok":
        sys.exit(3)


def _has_reference(problem: Any, horizon: float, figure: str | None) -> bool:
    """Is there a reference for a body up to the horizon? If not, warn why; SymtopError if `figure` is given."""
    from symtop.measure.settings import judgeable

    try:
        with showing_seconds("following the true motion"):
            judgeable(problem, "attitude", horizon)
    except SymtopError as error:
        if figure is not None:
            raise
        warn(f"the run is not compared with the true motion: {error}")
        return False
    return True


def _errors_and_verdict(problem: Any, data: Any, figure: str | None) -> tuple[Any, Any]:
    """Errors and verdict of a run, which is drawn to `figure`, if given."""
    from symtop.measure.errors import errors
    from symtop.measure.verdicts import judgement

    error = errors(data)
    if figure is not None:
        from symtop.report.plot import draw_run
        from symtop.run.reference.truth import reference

        draw_run(problem, data, reference(problem, data["time"].values), error, figure)
    return error, judgement(problem, data, error["attitude" if problem.of_body else "axis"].values)


def estimate(steps: float, run: Callable[[int], object]) -> None:
    """Warn before a run how long it takes, if above ten seconds; `run` makes a number of steps, for timing."""
    from symtop.measure.timing import first_call
    from symtop.run.guard import MOST_STEPS

    if not TIMED_RATIO * TIMED_STEPS < steps <= MOST_STEPS:  # more are refused
        return
    with showing_seconds("timing some steps"):
        run(TRIAL_STEPS)  # compiles the kernel
        count, fixed, seconds = TRIAL_STEPS, first_call(partial(run, TRIAL_STEPS)), 0.0
        while seconds < LONG_ENOUGH and count * TIMED_RATIO < steps:
            count *= 4
            seconds = first_call(partial(run, count)) - fixed  # without the fixed cost of a run
    total = seconds * steps / (count - TRIAL_STEPS)
    post("running")  # no longer compiling
    if total > 10.0:
        warn(f"{steps:.3g} steps take about {duration(total).replace(NO_BREAK, ' ')}")


@click.command(short_help="Run up to billions of steps in little memory.")
@click.argument("scene", shell_complete=completing("all scenes"))
@click.argument("integrator", shell_complete=completing("integrators"))
@click.option("--steps", type=float, default=1e9, show_default=True, help="Number of steps.")
@click.option("--step-size", type=float, help="Step; a thousandth of a nutation period by default.")
@common.per_nutation_option
@click.option("--checkpoint", type=File(), help="File to resume from; symtop's own by default.")
@click.option("--output", "-o", type=File(), help="Write the windows to this netCDF file.")
@common.body_options
@common.plugin_option
def long(
    scene: Any, integrator: str, steps: float, checkpoint: str | None, output: str | None, **settings: Any
) -> None:
    """Run one INTEGRATOR on one SCENE for very many steps, in little memory.

    The run is cut into windows, and the output holds the least, largest and mean change of the energy and the momenta
    in each, and as what power of the time their sizes grow over the last 2.5 decades: one random walk, as of rounding,
    shows 0.2 to 0.8. A checkpoint is written as it goes: the same command resumes a run that was interrupted.

    \b
    symtop long spheroid stormer-verlet --steps 1e9 --output long.nc
    """
    check_outputs(output=output, checkpoint=checkpoint)
    with showing_seconds("loading"):
        import numpy as np

        from symtop.measure.order import power_law
        from symtop.model import scenes
        from symtop.run.guard import MOST_STEPS
        from symtop.run.long_run import OF_BODY, PER_NUTATION, QUANTITIES, long_run

    problem = scenes.scene(scene, bodies=True)
    period, step_size = problem.nutation_period, common.step_of(scene, settings)
    if step_size is None and period == math.inf:
        raise SymtopError(f"{scene} has no nutation to take a step from: give --step-size")
    h = period / PER_NUTATION if step_size is None else step_size
    count = whole("steps", steps, 1, MOST_STEPS)
    estimate(count, lambda count: long_run(scene, integrator, steps=count, step_size=h, quiet=True))
    post(f"running {count:.3g} steps")
    try:
        data = long_run(scene, integrator, steps=count, step_size=h, checkpoint=checkpoint or True, output=output)
    except KeyboardInterrupt:
        warn("interrupted; the steps that were run are kept, and the same command resumes after them")
        sys.exit(130)
    say(f"{data.attrs['title']}: {data.attrs['outcome_message']}")
    if data.sizes["window"]:
        rows = []
        steps_made = data["steps"].values
        for name in (OF_BODY if problem.of_body else QUANTITIES)[:-1]:  # except theta
            smallest, largest, mean = (data[f"{name}_{kind}"].values for kind in ("least", "largest", "mean"))
            sizes = np.maximum.accumulate(np.maximum(np.abs(smallest), np.abs(largest)))
            fit = power_law(steps_made, sizes, steps_made > steps_made[-1] / 10.0**FITTED_DECADES)
            law = f"t^{abs(fit.slope):.2f}" if math.isfinite(fit.slope) else ""  # no interval
            words = "|L|" if name == "momentum" else name
            rows.append([words, *(f"{float(value):+.3e}" for value in (smallest.min(), largest.max(), mean[-1])), law])
        click.echo(table(["change since the start", "least", "largest", "last window's mean", "grows as"], rows))
    say_written(output)
    if data.attrs["outcome"] != "ok":
        sys.exit(3)


@click.command(short_help="Run one integrator on many random tops or bodies.")
@click.argument("integrator", shell_complete=completing("integrators"))
@click.option("--members", type=int, default=1000, show_default=True, help="Number of tops or bodies.")
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of the population.")
@click.option("--kind", default="all", show_default=True, help="A stratum of the population, or all.")
@click.option("--bodies", is_flag=True, help="Bodies without symmetry in the place of tops.")
@click.option("--epsilon", type=float, help="With --bodies: how far heavy ones are from a top, 0 (chaos: 0.02) to 0.5.")
@click.option("--step-size", type=float, help="Step of a fixed-step method.")
@click.option("--per-nutation", type=float, help="In place of a step: steps in a nutation period of each member.")
@click.option("--tolerance", type=float, help="Tolerance of an adaptive method.")
@click.option("--horizon", type=float, help="Time to run to.")
@click.option("--nutations", type=float, help="In place of a horizon: nutation periods of each member.")
@click.option("--samples", type=int, default=101, show_default=True, help="Number of samples of each member.")
@click.option("--observe", help="Of tops: nutation, axis or attitude; the axis by default.")
@click.option("--variables", metavar="NAME,...", callback=separated, help="What is kept over time; all by default.")
@click.option("--budget", type=float, help="Most steps of a member, or force evaluations of an adaptive method.")
@click.option("--threads", type=int, help="Threads; one a core by default.")
@click.option("--scheduler", metavar="ADDRESS", help="Run on this dask cluster.")
@click.option("--output", "-o", type=File(), help="Stream the runs to this netCDF file.")
@click.option("--figure", type=File(), help="Draw quantiles of the errors over time: .png, .svg or .pdf.")
@common.plugin_option
@common.json_option
def ensemble(
    integrator: str, members: int, seed: int, kind: str, bodies: bool, epsilon: float | None,
    variables: list[str] | None, output: str | None, figure: str | None, as_json: bool, **settings: Any,
) -> None:  # fmt: skip
    """Run one INTEGRATOR on tops of a random population, or on bodies, and compare each with its true motion.

    Each member has the bits of ``symtop run`` alone. With an output, members are written as they are computed, and the
    same command resumes a run that was interrupted. One that fails fails alone; the exit code is 3 if all have failed.

    \b
    symtop ensemble --members 10000 --seed 1 strang --step-size 0.01 --horizon 20 -o runs.nc
    symtop ensemble --kind grazing "gauss-4[axis]" --per-nutation 50 --nutations 10 --figure spread.png
    symtop ensemble --bodies --kind heavy --epsilon 0.1 strang --per-nutation 60 --nutations 2
    """
    check_outputs(output=output, figure=figure)
    if epsilon is not None and not bodies:
        raise SymtopError("--epsilon must come with --bodies: it is how far heavy bodies are from a top")
    noun, cap = ("bodies", MOST_COMPARED_BODIES) if bodies else ("tops", MOST_COMPARED)
    kernels_to_compile[0] = ENSEMBLE_KERNELS
    with showing_seconds(f"drawing {noun}"):
        import numpy as np

        from symtop.report.spread import LEVELS, QUANTITIES, SHOWN_BY, largest, member_errors, so_many, spread
        from symtop.run.ensemble import bodies as random_bodies, ensemble as runs
        from symtop.run.ensemble.population import check_memory, population

        whole("members", members, 1, random_bodies.MOST_MEMBERS if bodies else math.inf)  # n of `population`
        check_memory("members", members)
        draw = partial(random_bodies.body_population, epsilon=epsilon) if bodies else population
        sample = draw(members, seed=seed, kind=kind)
    kernels_to_compile[0] = ENSEMBLE_KERNELS if bodies else _kernels(members, **settings)
    words = QUANTITIES[noun]
    compared = [name for name in words if variables is None or SHOWN_BY[name] in variables]
    if figure is not None and not compared:
        needed = " or ".join(SHOWN_BY[name] for name in words)
        raise SymtopError(f"--figure needs {needed} among --variables, whose errors it shows")
    series, maxima = dict[str, Any](), dict[str, Any]()  # errors over time, and the largest errors, of each member

    def added(data: Any) -> Any:
        subset, results = (dataset.isel(member=slice(0, cap)) for dataset in (sample, data))
        with showing_seconds("comparing with the true motion"):
            series.update({name: member_errors(subset, results, name) for name in compared})
        maxima.update({name: largest(values) for name, values in series.items()})
        return _columns(sample, maxima, words)

    post(f"running {so_many(members, noun)}")
    try:
        data = runs.ensemble(sample, integrator, variables=variables, path=output, added=added, **settings)
    except KeyboardInterrupt:
        warn("interrupted" + ("" if output is None else "; what was run is kept: the same command resumes"))
        sys.exit(130)
    outcomes, steps = Counter(data["outcome"].values.tolist()), int(data["steps"].sum())
    worst = {name: spread(values[:, None])[:, 0].tolist() for name, values in maxima.items()}
    if figure is not None:
        from symtop.report.plot import draw_ensemble

        draw_ensemble(data.isel(member=slice(0, cap)), series, figure)
    data.close()
    if as_json:
        errors = {name: dict(zip(map("{:g}".format, LEVELS), row, strict=True)) for name, row in worst.items()}
        click.echo(as_text({"outcomes": outcomes, "steps": steps, "largest_errors": errors}))
    else:
        counts = ", ".join(f"{count} {OUTCOME.get(name, name)}" for name, count in outcomes.items())
        say(f"{data.attrs['integrator'].split('[')[0]}[{data.attrs['chart']}] on {so_many(members, noun)}: {counts}")
        say(counted(steps, "step") + EXECUTION.get(data.attrs["execution"], ""))
        heading = [f"largest error, {so_many(min(members, cap), noun)}", *(f"{100.0 * level:g} %" for level in LEVELS)]
        if worst:
            names = {name: text.replace("energy of", "that of") for name, text in words.items()}  # a line of 80 columns
            click.echo(table(heading, [[names[name], *map("{:.1e}".format, row)] for name, row in worst.items()]))
        say_written(output, figure)
    if missing := sum(np.isnan(maxima.get("attitude", []))):
        warn(f"the attitudes of {so_many(missing, noun)} are not compared: their motion is not known to 1e-9 rad")
    if "ok" not in outcomes:
        sys.exit(3)


def _kernels(members: int, *, per_nutation: Any, nutations: Any, horizon: Any, step_size: Any, **_: Any) -> int:
    """The most kernels that an ensemble of tops compiles: fewer for few steps, which are not made in lanes."""
    from symtop.methods.framework import lanes

    steps = (horizon or 0.0) / step_size if step_size else (per_nutation or 0.0) * (nutations or 0.0)
    return KERNELS_OF_FEW if 0.0 < members * steps <= lanes.FEW_STEPS else ENSEMBLE_KERNELS


def _columns(sample: Any, errors: dict[str, Any], words: dict[str, str]) -> Any:
    """Variables for a file of runs: members (``I1``, ``start_theta``, ...), largest errors; attributes of the draw."""
    import numpy as np
    import xarray as xr

    from symtop.measure.errors import ERRORS

    numbers = {name: column.variable for name, column in sample.data_vars.items() if column.dtype.kind == "f"}
    variables: dict[str, Any] = {name if name in PARAMETERS else f"start_{name}": row for name, row in numbers.items()}
    for name, values in errors.items():
        padded = np.pad(values, (0, sample.sizes["member"] - len(values)), constant_values=math.nan)
        attributes = {"long_name": f"{words[name]}, largest over the run, infinite after a failure"}
        variables[f"{name}_error"] = "member", padded, attributes | {"units": ERRORS[name][1]}
    return xr.Dataset(variables, attrs={name: sample.attrs[name] for name in DRAW_ATTRIBUTES if name in sample.attrs})


@click.command(short_help="Open the explorer: one run in a browser, with sliders.")
@click.option("--port", type=int, default=0, help="Port to listen on; a free one by default.")
@click.option("--no-browser", is_flag=True, help="Print the address and open nothing.")
@common.plugin_option
def explore(port: int, no_browser: bool) -> None:
    """Show one run beside the exact motion in a browser, with sliders for the top, the start and the step."""
    import webbrowser

    from symtop.core.signals import TerminatedError, ending_on_sigterm
    from symtop.explore.answers import shows
    from symtop.explore.server import address, serve
    from symtop.methods.framework.registry import integrators, is_built_in

    if names := [name for name, method in integrators().items() if not (shows(method) or is_built_in(name))]:
        warn(f"the page shows attitudes and leaves out {', '.join(names)}, without the chart angles or attitude")
    with ending_on_sigterm(), serve(port) as server:
        click.echo(f"symtop explore: {address(server)} (Ctrl-C ends it)")
        if not no_browser:
            webbrowser.open(address(server))
        try:
            server.serve_forever()
        except (KeyboardInterrupt, TerminatedError):
            click.echo("")
