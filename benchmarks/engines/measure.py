"""An engine's path against its map, after one step and over two hundred, and its error on the top.

The difference is the largest of that of the quaternions, up to their common sign, and of that of the angular
velocities over the first one. No step is started anew from the engine's state, so that a difference after two hundred
steps bounds all of them.
"""

import math
from typing import Any

import numpy as np

import symtop
from benchmarks.engines import Setting
from benchmarks.engines.common import Path, body_of, velocities
from symtop.methods.framework.calling import solve
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import integrator
from symtop.model import charts
from symtop.model.scenes import Scene

STEPS = {"goldstein": 0.025, "fast": 0.001}  # s, of each scene: about 120 steps a nutation
COUNT = 400  # steps of a run, 10 s of goldstein
COMPARED = 200  # of them
LEVEL = {False: 1e-12, True: 1e-6}  # of a difference after one step, in double and in single precision


def mapped(scene: Scene, method: str, h: float, steps: int) -> Path:
    """The path of a map of the catalogue."""
    run = solve(symtop.integrator(method), "attitude", scene.top, scene.start, Plan.steps(h, range(steps + 1)))
    return Path(run.states[:, :4], velocities(scene.top.I1, scene.top.I3, run.states))


def difference(first: Path, second: Path) -> np.ndarray:
    """Row by row, shape (rows,)."""
    q, p = first.attitude, second.attitude
    turns = np.minimum(np.abs(q - p).max(axis=1), np.abs(q + p).max(axis=1))
    rates = np.abs(first.velocity - second.velocity).max(axis=1) / np.linalg.norm(first.velocity[0])
    return np.asarray(np.maximum(turns, rates))


def axis_error(scene: Scene, path: Path, h: float) -> float:
    """The largest angle (rad) between the axis and the true one, at every fourth step."""
    axes = charts.axis_from_quaternion(path.attitude)[::4]
    true = symtop.ClosedForm(scene.top, scene.start).axis(h * 4.0 * np.arange(len(axes)))
    angle = np.arctan2(np.linalg.norm(np.cross(axes, true), axis=1), np.sum(axes * true, axis=1))
    return float(np.nan_to_num(angle, nan=math.inf).max())


def row(setting: Setting) -> dict[str, Any]:
    """All that is measured of one setting; an engine that raises is a row with its reason."""
    result: dict[str, Any] = {name: getattr(setting, name) for name in ("engine", "version", "name", "held", "method")}
    try:
        for name, step in STEPS.items():
            scene = symtop.scene(name)
            path = setting.run(body_of(scene), step, COUNT)
            result |= {f"{name}_axis": axis_error(scene, path, step)}
            if setting.method:
                gap = difference(path, mapped(scene, setting.method, step, COUNT))
                result |= {f"{name}_step": float(gap[1]), f"{name}_steps": float(gap[: COMPARED + 1].max())}
    except Exception as error:  # noqa: BLE001
        result["failed"] = f"{type(error).__name__}: {error}"[:200]
    return result


def agrees(entry: dict[str, Any]) -> bool:
    """Is the map that of the engine, on every scene, after one step?"""
    if not entry["method"]:  # a setting without a map in the catalogue
        return False
    level = LEVEL[integrator(entry["method"]).precision == "single"]
    return all(entry.get(f"{name}_step", math.inf) <= level for name in STEPS)
