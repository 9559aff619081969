"""The errors of the settings of a physics engine on a scene, and a method as accurate: `recommend --i-use`.

An engine has settings, and each setting is a map (`symtop.methods.engines`). All are run with the user's step and
compared with the true motion; the least error is then the accuracy for `symtop.advise.recommend`.
"""

import math
from dataclasses import dataclass
from typing import Any

from symtop.advise import Advice, recommend
from symtop.core.errors import SymtopError, one_of, positive
from symtop.core.progress import post
from symtop.measure import settings
from symtop.methods.framework import registry
from symtop.methods.framework.registry import integrator
from symtop.model import scenes
from symtop.model.scenes import Scene, horizon_of

DEFAULT_STEP = 1.0 / 240.0  # s
WORST = 0.5  # rad: with a larger least error no method is recommended
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
    "yade": {"exactAsphericalRot": "yade", "rotAlgorithm delValle2023": "spiral"},
    "jsbsim": {"default": "jsbsim-default", "Buss2 and AB2": "jsbsim-buss2"},
    "exudyn": {"RK44": "rkmk4"},
}  # fmt: skip


@dataclass(frozen=True)
class EngineAdvice:
    """Axis errors (rad) of an engine's settings at a step, and a method as accurate as the best of them.

    `errors` has the settings in the order of the engine, the default first; pi for a run that ended early. `advice` is
    None if even the least error is above `WORST`. `gain` is the ratio of force evaluations, best setting to method.
    """

    scene: str
    engine: str
    step_size: float
    horizon: float
    errors: dict[str, float]
    best: str
    gain: float
    advice: Advice | None
    unit: str = ""  # of time, to append to a number

    def __str__(self) -> str:
        default, maps = next(iter(self.errors)), _settings()[self.engine]
        run = f"step {self.step_size:g}{self.unit}, to t = {self.horizon:g}{self.unit}"
        lines = [f"{self.engine} on {self.scene}, {run}: the axis is off by"]
        for name, value in self.errors.items():
            error = f"{value:.2e} rad" if value < math.pi else "ended early "
            lines.append(f"    {error}  {name} ({maps[name]})")
        near = self.errors[self.best] <= WORST
        if self.best != default and near:
            times = self.errors[default] / (self.errors[self.best] or math.nan)
            factor = f", {times:.3g} times nearer than {default}" if self.errors[default] < math.pi else ""
            lines.append(f"Its best setting is {self.best}{factor}.")
        if not near:
            line = f"No setting is within {WORST:g} rad: none is better than another, and there is nothing to match."
            lines.append(line)
        if self.advice is None:
            return "\n".join([*lines, *["With --accuracy it names a method for the error that you need."] * (not near)])
        if (accuracy := self.advice.accuracy) != self.errors[self.best] or self.advice.integrator is None:
            names = ", ".join(name for name, value in self.errors.items() if value <= accuracy) or "none"
            note = [f"Settings within {accuracy:g} rad at this step: {names}."] * (self.advice.quantity == "axis")
            return "\n".join([*lines, *note, str(self.advice)])
        ratio = f"{self.gain:.3g} times fewer" if self.gain >= 1.0 else f"{1.0 / self.gain:.3g} times more"
        work = f" with {ratio} force evaluations" if math.isfinite(self.gain) else ""  # the exact motion makes none
        return "\n".join([*lines, f"As near as {self.best}{work}: {self.advice.reason}"])


def _settings() -> dict[str, dict[str, str]]:
    """The maps by settings of each engine, and each map as an engine of its own unless an engine has its name."""
    return SETTINGS | {name: {name: name} for name in registry.engines() if name not in SETTINGS}


def i_use(
    engine: str, scene: str | Scene, *, step_size: float | None = None, horizon: float | None = None,
    accuracy: float | None = None, **limits: Any,
) -> EngineAdvice:  # fmt: skip
    """The errors of an engine's settings on a scene at a step, and a method as accurate as the best, with its cost.

    An engine is one of `SETTINGS` or a map, such as "mujoco-euler". With an `accuracy`, the advice is for that and
    for the step; `limits` are further arguments of `recommend`. `step_size` is in the units of the scene, by default
    1/240, `horizon` by default the scene's. Raises SymtopError for an unknown engine and numbers out of range.
    """
    maps = _settings()
    if engine in registry.methods():
        raise SymtopError(f"engine must be a physics engine or a map of one, not the method {engine!r}: compare "
                          "methods with `symtop compare`", "engine")  # fmt: skip
    one_of("engine", engine, maps)
    start, h = scenes.scene(scene, bodies=True), DEFAULT_STEP if step_size is None else positive("step_size", step_size)
    end = start.horizon if horizon is None else horizon_of(horizon)
    if h >= end:
        raise SymtopError(f"step_size must be below the horizon {end:g}, not {h:g}", "step_size")
    if start.of_body:  # refuse a horizon beyond its reference
        settings.judgeable(start, "axis", end)
    runs = {}
    for name, method in maps[engine].items():
        post(f"running {method}")
        runs[name] = settings.attempt(start, integrator(method), h, end, "axis")
    errors = {name: min(run.error, math.pi) for name, run in runs.items()}
    best = min(errors, key=lambda name: errors[name])
    error = errors[best]
    if accuracy is not None:
        limits["step_size"] = h
    elif limits.get("quantity") not in (None, "axis"):
        raise SymtopError(f"quantity must be axis where there is no accuracy, not {limits['quantity']!r}", "quantity")
    limits["quantity"] = limits.get("quantity") or "axis"  # for bodies `recommend` would take the attitude
    target = error if accuracy is None else accuracy
    has_target = accuracy is not None or 0.0 < error <= WORST
    advice = recommend(start, accuracy=target, horizon=end, **limits) if has_target else None
    gain = math.nan
    if advice is not None and advice.integrator is not None and (setting := advice.step_size or advice.tolerance):
        trial = settings.attempt(start, integrator(advice.integrator), setting, end, "axis")
        gain = runs[best].evaluations / trial.evaluations
    return EngineAdvice(start.name, engine, h, end, errors, best, gain, advice, start.second)
