"""``symtop claims``, ``judge`` and ``recommend``: measure the claims of integrators, and find the cheapest."""

import dataclasses
import sys
from typing import Any

import click

from symtop.cli import common
from symtop.cli.common import File, as_text, check_outputs, completing, json_option, plugin_option, say, say_written
from symtop.core.errors import SymtopError, at_home
from symtop.core.progress import showing_seconds
from symtop.judging import FORMS

# methods in the figure of a judged step, length of their runs, most evaluations of one
PEERS, NUTATIONS, MOST_PEER_STEPS = ("rk4", "strang", "dop853", "taylor"), 10.0, 2e4
LONGEST_BESIDE = 5.0  # seconds of a run of the judged step


@click.command(short_help="Judge an integrator of your own.")
@click.argument("target")
@click.option("--form", type=click.Choice(FORMS), help="What TARGET is, if not clear.")
@click.option("--chart", default="axis", show_default=True, help="What a state is: axis, attitude or angles.")
@click.option(
    "--scene", default="spheroid", show_default=True, shell_complete=completing("all scenes"),
    help="The top, or a body without symmetry.",
)  # fmt: skip
@click.option("--order", type=int, help="Claim an order.")
@click.option("--symplectic/--not-symplectic", default=None, help="Claim that the step is symplectic, or not.")
@click.option("--symmetric/--not-symmetric", default=None, help="Claim that a step of -h undoes one of h, or not.")
@click.option("--explicit/--implicit", default=None, help="Claim that it solves no equations, or that it does.")
@click.option(
    "--conserves", metavar="NAMES", callback=common.separated,
    help="Claim constants: energy, p_phi, p_psi, axis_length, with commas.",
)  # fmt: skip
@click.option("--energy", type=click.Choice(["kept", "bounded"]), help="Claim what becomes of the energy.")
@click.option("--adaptive", is_flag=True, help="Judge a class of SciPy's at a tolerance, not at fixed steps.")
@click.option("--autonomous", is_flag=True, help="It was written for y' = f(y), without a time.")
@click.option("--quick", is_flag=True, help="Shorter runs: some seconds, or ten to forty where a step takes 1 ms.")
@click.option("--seed", type=int, help="Draw the starts, times and steps of an earlier judging again.")
@click.option("--output", "-o", type=File(dir_okay=False), help="Write the findings to this netCDF file.")
@click.option("--card", type=File(dir_okay=False), help="Write a page with two figures and the ledger (HTML).")
@click.option("--badge", type=File(dir_okay=False), help="Write a badge for a README (SVG).")
@click.option("--figure", type=File(dir_okay=False), help="Draw its error against evaluations, beside four methods.")
@common.scene_options
def judge(
    target: str, scene: Any, output: str | None, card: str | None, badge: str | None, figure: str | None, as_json: bool,
    **options: Any,
) -> None:  # fmt: skip
    """Judge TARGET: its order, structure, invariants and drift on the top, beside what you claim of it.

    \b
    TARGET          what it is
    my.py:step      a function step(f, t, y, h) -> y for y' = f(t, y)
    my.py:MyRK      a class derived from scipy.integrate.OdeSolver
    my.py:solver    an instance of a solver of diffrax
    my.py:step      with --form rotation, step(q, w, h, inertia, torque) -> q, w of a rigid
                    body: q = (w, x, y, z) from body to space, or a matrix (3, 3); w the
                    rates in body axes, inertia the three principal moments, torque(q)
                    a function that returns the torque in body axes
    ./my.so         void step(double *y, double h, const double *par, long n)
    "./engine -x"   with --form program: a line of numbers in, states out; with --form
                    server it is started once, answers line after line, and ends
                    each answer with an empty line
    run.csv         a trajectory without a method: names, as time,qw,qx,qy,qz or time,ex,ey,ez, then numbers

    Without a claim it says what the method is. The exit code is 1 if a claim is refuted.

    \b
    symtop judge my.py:step --order 4 --symplectic
    symtop judge ./my.so --chart axis --order 2
    symtop judge "./my_engine --top" --form server --quick
    symtop judge run.csv --scene spheroid --conserves p_phi
    symtop judge brick.csv --scene check-case-2
    symtop judge my.py:step --form rotation --scene tennis-racket
    """
    from symtop.judging import findings
    from symtop.judging.judge_step import judge as judged

    def tell(event: Any) -> None:
        if isinstance(event, findings.About):
            if (card or figure) and not event.chart:
                raise SymtopError("a card or a figure shows a method: there is none of a trajectory")
            line = findings.heading(event, getattr(scene, "name", scene))
        else:
            line = findings.line(event, common.terminal_width())
        if line and not as_json:
            click.echo(line)

    _check(target, options["form"], output=output, card=card, badge=badge, figure=figure)
    ledger = judged(target, scene=scene, tell=tell, **options)
    click.echo(as_text([finding.plain() for finding in ledger.findings]) if as_json else findings.summary(ledger))
    if output is not None:
        from symtop.core import netcdf

        netcdf.write(ledger.dataset(), output)
    if card is not None or badge is not None:
        from symtop.report import card as cards

        for file, write in ((card, cards.card), (badge, cards.write_badge)):
            if file is not None:
                write(ledger, file)
    _draw_with_peers(target, scene, figure, as_json, options, ledger.about.seconds_a_step)
    say_written(output, card, badge, figure, err=as_json)
    if ledger.refuted:
        sys.exit(1)


def _check(target: str, form: str | None, **files: str | None) -> None:
    """SymtopError, before a step is judged, for files that cannot be written and for a figure that would be empty."""
    check_outputs(**files)
    if files["output"] is not None and at_home(target).resolve() == at_home(files["output"]).resolve():
        raise SymtopError(f"--output must be another file than the trajectory that is judged, {target!r}")
    if files["figure"] is not None and form == "separable":
        raise SymtopError("--figure shows errors of the axis, of which a map of (theta, p_theta) has none")


def _draw_with_peers(
    target: str, scene: str, file: str | None, quiet: bool, options: dict[str, Any], seconds_a_step: float
) -> None:
    """Draw a step's error against force evaluations with those of `PEERS`, if `file` is given, and print a ranking."""
    if file is None:
        return
    with showing_seconds("comparing"):
        from symtop.judging.adapters.adapter import integrator
        from symtop.judging.claims.subject import open_target
        from symtop.judging.comparison import compare, ranked
        from symtop.measure.sweep import period_word
        from symtop.model.scenes import scene as find_scene
        from symtop.report.plot import draw_compare

        problem = find_scene(scene, bodies=True)
        stepper = open_target(target, options["form"], options["chart"], on=problem, adaptive=options["adaptive"])
        methods = [integrator(stepper, order=options["order"]), *PEERS]
        # `compare` counts at least one force evaluation per step
        budget = min(MOST_PEER_STEPS, LONGEST_BESIDE / max(seconds_a_step, 1e-9))
        data = compare(problem, methods, cost="evaluations", nutations=NUTATIONS, budget=budget, quiet=True)
        draw_compare(data, file)
    limit, errors = ranked(data)
    if not quiet and errors:
        words = [f"{name} {error:.0e}" for name, error in errors.items()]
        words += [f"{name} none" for name in data["variant"].values if name not in errors]
        span = f"{NUTATIONS:g} {period_word(data)}s"
        say(f"Axis error (rad) for {limit:.0f} force evaluations in {span}: {', '.join(words)}.")


@click.command(short_help="Measure what integrators claim about themselves.")
@click.argument("names", nargs=-1, metavar="[INTEGRATOR]...", shell_complete=completing("integrators"))
@click.option("--scene", default="spheroid", show_default=True, help="The scene to judge on.")
@click.option("--quick", is_flag=True, help="Shorter runs, the structure in one chart.")
@plugin_option
@json_option
def claims(names: tuple[str, ...], scene: str, quick: bool, as_json: bool) -> None:
    """Measure every claim of each INTEGRATOR: order, symplecticity, symmetry, conserved quantities, cost.

    Of a body without symmetry: order, energy, and L in space, of a heavy one L_z. The exit code is 1 if a claim is
    refuted, or if nothing can be measured of an integrator. Without a name: the integrators of the plug-in, or all that
    step the scene. A plug-in runs in a process of its own.

    \b
    symtop claims midpoint rk4
    symtop claims --plugin my_methods.py
    """
    with showing_seconds("loading"):
        from symtop.judging.judge_step import judge_separately
        from symtop.methods.framework import registry
        from symtop.model import scenes
        from symtop.model.charts import BODY

        problem = scenes.scene(scene, bodies=True)
        plugins = [name for name in registry.integrators() if not registry.is_built_in(name)]
        known = [name for name, entry in registry.integrators().items() if not problem.of_body or BODY in entry.solvers]
        methods = [registry.integrator(name) for name in names or plugins or known]
    refuted, entries = False, []
    for method in methods:
        with showing_seconds(f"measuring {method.name}"):
            ledger = judge_separately(method, problem, quick=quick)
        verdicts = {finding.verdict for finding in ledger.findings}
        refuted |= "refuted" in verdicts or not verdicts & {"confirmed", "measured"}
        if as_json:
            head = {"integrator": ledger.integrator, "scene": problem.name}
            entries += [{**head, **finding.plain()} for finding in ledger.findings]
        else:
            say("\n".join(finding.sentence(ledger.integrator) for finding in ledger.findings))
    if as_json:
        click.echo(as_text(entries))
    if refuted:
        sys.exit(1)


@click.command(short_help="Find the cheapest integrator for an accuracy.")
@click.argument("scene", shell_complete=completing("all scenes"))
@click.option("--accuracy", type=float, help="The largest error you accept, for example 1e-6; rad of an angle.")
@click.option("--i-use", "engine", help="A physics engine, for example mujoco: what its settings make of the scene.")
@click.option("--step-size", type=float, help="The step that you have; of the engine, 1/240 by default.")
@common.per_nutation_option
@click.option("--max-step", type=float, help="The longest step that you can take.")
@click.option("--time-a-step", type=float, help="The most seconds that a step may take here, for example 1e-6.")
@click.option("--needs", callback=common.separated, help="What you can supply: derivative,kicks or torque,inertia.")
@click.option("--general", is_flag=True, help="Only what runs on a body without symmetry, too.")
@click.option("--keeps", help="Only what does not let it drift: energy, momenta or energy,momenta.")
@click.option("--quantity", help="Of what: axis, which is the default, attitude (that of a body), theta, energy, ...")
@click.option("--horizon", type=float, help="Time to run to; the scene's own by default.")
@common.scene_options
def recommend(scene: Any, accuracy: float | None, engine: str | None, as_json: bool, **options: Any) -> None:
    """Find the cheapest integrator and step that meet an accuracy on a SCENE.

    The answer is no method that is made for this very top; the best of those is named beside it. The exit code is 1 if
    none meets the accuracy.

    \b
    symtop recommend spheroid --accuracy 1e-6
    symtop recommend spheroid --accuracy 1e-3 --step-size 0.001 --general
    symtop recommend spheroid --accuracy 1e-6 --needs derivative,kicks --keeps energy
    symtop recommend goldstein --accuracy 1e-3 --quantity attitude --horizon 1e4
    symtop recommend mine --plugin my_scene.py --accuracy 1e-9
    symtop recommend tennis-racket --accuracy 1e-6
    symtop recommend goldstein --i-use mujoco --step-size 0.002
    """
    with showing_seconds("loading"):
        from symtop import advise, engine_settings
    if accuracy is None and engine is None:
        raise SymtopError("recommend needs --accuracy, for example 1e-6, or --i-use")
    options |= {"step_size": common.step_of(scene, options), "needs": options["needs"] or ()}
    with showing_seconds("trying methods"):
        result: Any
        if engine is not None:
            result = engine_settings.i_use(engine, scene, accuracy=accuracy, **options)
            advice = result.advice if accuracy is not None else None
        else:
            result = advice = advise.recommend(scene, accuracy=accuracy or 0.0, **options)
            if advice.integrator and (body := common.given_body()):
                setting = {"step_size": advice.step_size, "tolerance": advice.tolerance}
                command = advise.command_of(scene, advice.integrator, advice.horizon, **setting)
                result = advice = dataclasses.replace(advice, command=f"{command} {body}")
    click.echo(as_text(dataclasses.asdict(result))) if as_json else say(str(result))
    if advice is not None and advice.integrator is None:
        sys.exit(1)
