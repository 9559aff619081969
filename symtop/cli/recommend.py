"""``symtop recommend``: the cheapest integrator for an accuracy, or what a physics engine makes of a scene.

An engine is known here by the maps of its settings, `symtop.methods.engines.engines`. The gain of another method is
counted in force evaluations, which neither the machine nor the language of the engine decides.
"""

import dataclasses
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from symtop.cli.common import File, as_text, completing, json_option, plugin_option, say
from symtop.core.errors import SymtopError, one_of, positive
from symtop.core.progress import ticking

if TYPE_CHECKING:
    from symtop.advise import Advice
    from symtop.model.scenes import Scene

SETTINGS = {  # the maps of an engine by its settings, the default first
    "mujoco": {
        "Euler": "mujoco-euler", "implicit": "mujoco-implicit", "implicitfast on a free body": "mujoco-implicit",
        "RK4 of 4.0": "rkmk4", "RK4 up to 3.17": "mujoco3-rk4",
    },
    "bullet": {"rigid body": "bullet-float32", "multibody": "mujoco-euler", "rigid body, flags 0": "no-gyro-float32"},
    "pybullet": {"multibody": "mujoco-euler"},
    "dart": {"default": "mujoco-euler"},
    "jolt": {"default": "no-gyro-float32", "gyroscopic force on": "jolt-float32"},
    "physx": {"default": "no-gyro-float32", "gyroscopic forces on": "physx-float32"},
    "havok": {"default": "no-gyro-float32"},
    "rapier": {"default": "rapier-float32"},
    "cannon-es": {"default": "no-gyro-linear"},
    "ode": {"default": "ode", "gyroscopic mode off": "no-gyro-linear"},
    "lammps": {"fix rigid": "lammps-rigid", "fix rigid/nve": "no-squish"},
    "yade": {"exactAsphericalRot": "yade"},
    "jsbsim": {"default": "jsbsim-default", "Buss2 and AB2": "jsbsim-buss2"},
    "exudyn": {"RK44": "rkmk4"},
}  # fmt: skip
STEP = 1.0 / 240.0  # s
WORST = 0.5  # rad: an axis that is further off needs no method to match it


@dataclasses.dataclass(frozen=True)
class EngineAdvice:
    """Axis errors (rad) of an engine's settings at a step, and a method that does as well as the best of them.

    `errors` has the settings in the order of the engine, the default first; pi is a run that ended early. `advice` is
    None if even the best setting is no accuracy to match. `gain` is how many times fewer force evaluations it takes.
    """

    scene: str
    engine: str
    step_size: float
    horizon: float
    errors: dict[str, float]
    best: str
    gain: float
    advice: "Advice | None"

    def __str__(self) -> str:
        default = next(iter(self.errors))
        maps = SETTINGS[self.engine]
        lines = [
            f"{self.engine} on {self.scene}, step {self.step_size:g}, to t = {self.horizon:g}: the axis is off by",
            *(f"    {value:.2e} rad  {name} ({maps[name]})" for name, value in self.errors.items()),
        ]
        if self.best != default:
            times = self.errors[default] / self.errors[self.best]
            lines.append(f"Its best setting is {self.best}, {times:.3g} times nearer than {default}.")
        if self.advice is None:
            return "\n".join([*lines, f"No setting is within {WORST:g} rad, so that there is nothing to match."])
        much = f"{self.gain:.3g} times fewer" if self.gain >= 1.0 else f"{1.0 / self.gain:.3g} times more"
        lines.append(f"As near as {self.best} with {much} force evaluations: {self.advice.reason}")
        return "\n".join(lines)


def i_use(engine: str, scene: "str | Scene", *, step_size: float = STEP, horizon: float | None = None) -> EngineAdvice:
    """What the settings of an engine make of a scene at a step, and which method does as well for how much less.

    `step_size` is in the units of the scene, `horizon` its own by default. Raises SymtopError for an engine that is
    not known and for numbers that are out of range. It takes some seconds.
    """
    from symtop.advise import recommend
    from symtop.model.scenes import horizon_of, scene as scene_of
    from symtop.run.simulation import simulate

    one_of("engine", engine, SETTINGS)
    start = scene_of(scene)
    h = positive("step_size", step_size)
    end = start.horizon if horizon is None else horizon_of(horizon)
    if h >= end:
        raise SymtopError(f"step_size must be below the horizon {end:g}, not {h:g}", "step_size")
    measured = {name: _run(start, method, h, end) for name, method in SETTINGS[engine].items()}
    best = min(measured, key=lambda name: measured[name][0])
    error, forces = measured[best]
    off = {name: value for name, (value, _) in measured.items()}
    advice = recommend(start, accuracy=error, horizon=end) if error <= WORST else None
    if advice is None or advice.integrator is None:
        return EngineAdvice(start.name, engine, h, end, off, best, math.nan, None)
    needed = simulate(
        start, advice.integrator, step_size=advice.step_size, tolerance=advice.tolerance, horizon=end, guard=False,
        observe="axis",
    )  # fmt: skip
    gain = forces / float(needed.attrs["force_evaluations"])
    return EngineAdvice(start.name, engine, h, end, off, best, gain, advice)


def _run(start: "Scene", method: str, h: float, horizon: float) -> tuple[float, float]:
    """The axis error of a map, and its force evaluations."""
    from symtop.measure.errors import errors
    from symtop.methods.framework.registry import integrator
    from symtop.run.simulation import simulate

    observe = "axis" if "axis" in integrator(method).charts() else "attitude"
    run = simulate(start, method, step_size=h, horizon=horizon, guard=False, observe=observe)
    if run.attrs["outcome"] != "ok":
        return math.pi, float(run.attrs["force_evaluations"])
    return float(errors(run)["axis"].max()), float(run.attrs["force_evaluations"])


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
    with ticking("loading"):
        from symtop import advise
        from symtop.measure.ranking import STORED
    if (accuracy is None) is (engine is None):
        both = "" if accuracy is None else ", not both"
        raise SymtopError(f"recommend takes one of --accuracy, for example 1e-6, and --i-use{both}")
    if engine is not None:
        outcome = i_use(engine, scene, step_size=STEP if step_size is None else step_size, horizon=horizon)
        click.echo(as_text(dataclasses.asdict(outcome)) if as_json else str(outcome))
        return
    if step_size is not None:
        raise SymtopError("--step-size belongs to --i-use; with --accuracy the step is what is found")
    if results is None and (Path("results") / STORED).is_file():
        results = "results"
    with ticking("trying methods"):
        advice = advise.recommend(scene, accuracy=accuracy or 0.0, quantity=quantity, horizon=horizon, results=results)
    click.echo(as_text(dataclasses.asdict(advice))) if as_json else say(str(advice))
    if advice.integrator is None:
        sys.exit(1)
