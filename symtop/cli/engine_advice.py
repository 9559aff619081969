"""`i_use`: what a physics engine's integrator makes of a scene, its best setting, and what would do as well for less.

An engine is known here by the maps of its settings, `symtop.methods.engines.engines`. Each is run at the step of the
user to the horizon; errors are the largest angle between the axis and the true one. The gain of another method is
counted in force evaluations, which neither the machine nor the language of the engine decides.
"""

import math
from dataclasses import dataclass
from typing import Any

from symtop import advise
from symtop.core.errors import SymtopError, one_of, positive
from symtop.measure.errors import errors
from symtop.methods.framework.registry import integrator
from symtop.model import scenes
from symtop.model.scenes import Scene, horizon_of
from symtop.run.simulation import simulate

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


@dataclass(frozen=True)
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
    advice: advise.Advice | None

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
    one_of("engine", engine, SETTINGS)
    start = scenes.scene(scene)
    h = positive("step_size", step_size)
    end = start.horizon if horizon is None else horizon_of(horizon)
    if h >= end:
        raise SymtopError(f"step_size must be below the horizon {end:g}, not {h:g}")
    measured = {name: _run(start, method, h, end) for name, method in SETTINGS[engine].items()}
    best = min(measured, key=lambda name: measured[name][0])
    error, forces = measured[best]
    seen = {name: value for name, (value, _) in measured.items()}
    if error > WORST:
        return EngineAdvice(start.name, engine, h, end, seen, best, math.nan, None)
    advice = advise.recommend(start, accuracy=error, horizon=end)
    if advice.integrator is None:
        return EngineAdvice(start.name, engine, h, end, seen, best, math.nan, None)
    setting = {"step_size": advice.step_size, "tolerance": advice.tolerance}
    given: dict[str, Any] = {name: value for name, value in setting.items() if value is not None}
    needed = simulate(start, advice.integrator, horizon=end, guard=False, observe="axis", **given)
    gain = forces / float(needed.attrs["force_evaluations"])
    return EngineAdvice(start.name, engine, h, end, seen, best, gain, advice)


def _run(start: Scene, method: str, h: float, horizon: float) -> tuple[float, float]:
    """The axis error of a map, and its force evaluations."""
    observe = "axis" if "axis" in integrator(method).charts() else "attitude"
    run = simulate(start, method, step_size=h, horizon=horizon, guard=False, observe=observe)
    if run.attrs["outcome"] != "ok":
        return math.pi, float(run.attrs["force_evaluations"])
    return float(errors(run)["axis"].max()), float(run.attrs["force_evaluations"])
