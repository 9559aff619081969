"""A splitting in long double: its order where double precision runs out before the error is a power of the step.

In the axis chart a composition of exact drifts and kicks is

    drift a:  e turns about L by the angle a h |L|/I1        kick b:  L += b h mgl (z x e)

so that its coefficients are all that is needed to run it in any arithmetic; a mantissa of 64 bits gives three more
decades of error. The coefficients are doubles, summed to 1 again. The error is that of the axis at the end, against
both halves of a reference in long double. Methods with a modified potential or another rotation are not run.
"""

import math
from typing import Any

import numpy as np
import xarray as xr

from symtop.methods.registry import Integrator
from symtop.methods.rotor import ROTATIONS
from symtop.methods.splitting_loop import Stages
from symtop.model import charts
from symtop.model.scenes import Scene
from symtop.run.reference import reference
from symtop.run.witnesses import have_heyoka

Wide = np.longdouble
NUTATIONS = 1.37  # length of a run
STEPS_A_NUTATION = 5.0, 45.0
RUNS = 40
BOUND = 8.0 * float(np.finfo(Wide).eps)  # what a start and a run of a hundred steps leave


def extended_errors(scene: Scene, method: Integrator) -> xr.Dataset | None:
    """``extended_step``, ``extended_error`` (rad, of the axis at the end) and ``extended_bound`` over ``extended``.

    None for a method that is no such composition, and where long double is double or there is no reference in it.
    """
    stages = _composition(scene, method)
    if stages is None or not have_heyoka() or np.finfo(Wide).eps == np.finfo(float).eps:
        return None
    horizon = NUTATIONS * scene.time_scale()
    truth = reference(scene, [horizon], "longdouble")
    true = truth["axis"].values[0].astype(Wide) + truth["axis_lo"].values[0]
    counts = np.unique(np.rint(NUTATIONS * np.geomspace(*STEPS_A_NUTATION, RUNS)).astype(int))
    rest = [_end(scene, stages, horizon, int(count)) - true for count in counts]
    error = np.array([float(np.sqrt((one * one).sum())) for one in rest])
    bound = np.maximum(truth["axis_error_bound"].values[0], BOUND)
    columns = {"step": horizon / counts, "error": error, "bound": np.full(counts.size, bound)}
    return xr.Dataset({f"extended_{name}": ("extended", values) for name, values in columns.items()})


def _composition(scene: Scene, method: Integrator) -> Stages | None:
    """The stages of a step of 1, if the method drifts exactly and kicks plainly."""
    solver: Any = method.solvers.get("axis", method.solvers.get("attitude"))
    if not hasattr(solver, "setup"):
        return None
    stages = solver.setup(scene.top, scene.start, 1.0)[1]
    if not isinstance(stages, Stages) or any(stages.bend) or stages.boost or ROTATIONS[stages.turn] != "exact":
        return None
    return stages


def _end(scene: Scene, stages: Stages, horizon: float, count: int) -> Any:
    """The axis after `count` steps, in long double."""
    top, start, step = scene.top, scene.start, Wide(horizon) / count
    theta, phi, *rates = (
        Wide(value) for value in (start.theta, start.phi, start.theta_dot, start.phi_dot, start.psi_dot)
    )
    axis = np.array(charts.axis_parts(np, theta, phi))
    momentum = np.array(charts.momentum_parts(np, top, theta, phi, *rates))
    drifts, kicks = ([Wide(value) for value in part] for part in (stages.drift, stages.kick))
    drifts = [step / Wide(top.I1) * value / sum(drifts) for value in drifts]
    kicks = [step * Wide(top.mgl) * value / sum(kicks) for value in kicks]
    for _ in range(count):
        for kick, drift in zip(kicks, [*drifts, Wide(0.0)], strict=True):
            momentum = momentum + kick * np.array([-axis[1], axis[0], Wide(0.0)])
            length = np.sqrt((momentum * momentum).sum())
            about, angle = momentum / length, length * drift
            across = np.cross(about, axis)
            axis = np.cos(angle) * axis + np.sin(angle) * across + (1 - np.cos(angle)) * (about * axis).sum() * about
    return axis


def extended_order_data(table: xr.Dataset) -> tuple[Any, Any, Any] | None:
    """Steps, errors and bounds in long double of an error table that has them."""
    if "extended_error" not in table or not math.isfinite(float(table["extended_error"].max())):
        return None
    part = table.dropna("extended", subset=["extended_error"])
    return tuple(part[f"extended_{name}"].values for name in ("step", "error", "bound"))  # type: ignore[return-value]
