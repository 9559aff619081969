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
from numpy.typing import NDArray

from symtop.methods.framework.registry import Integrator
from symtop.methods.splitting.loop import Stages
from symtop.methods.splitting.rotor import ROTATIONS
from symtop.model import charts
from symtop.model.scenes import Scene
from symtop.run.reference.independent_checks import have_heyoka
from symtop.run.reference.truth import reference

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
    rest = _ends(scene, stages, horizon, counts) - true
    error = np.sqrt((rest * rest).sum(axis=1)).astype(float)
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


def _ends(scene: Scene, stages: Stages, horizon: float, counts: NDArray[np.int64]) -> Any:
    """The axes (n, 3) after each of the ascending `counts` of steps, in long double; all runs take a step together."""
    top, start, step = scene.top, scene.start, Wide(horizon) / counts.astype(Wide)
    theta, phi, *rates = (
        Wide(value) for value in (start.theta, start.phi, start.theta_dot, start.phi_dot, start.psi_dot)
    )
    axes = np.tile(np.array(charts.axis_parts(np, theta, phi))[:, np.newaxis], counts.size)
    momenta = np.tile(np.array(charts.momentum_parts(np, top, theta, phi, *rates))[:, np.newaxis], counts.size)
    drifts, kicks = ([Wide(value) for value in part] for part in (stages.drift, stages.kick))
    drifts = [value / sum(drifts) / Wide(top.I1) for value in drifts]
    kicks = [value / (sum(kicks) or 1) * Wide(top.mgl) for value in kicks]  # those of a free top are zero
    for done in range(counts[-1]):
        left = slice(int(np.searchsorted(counts, done, side="right")), None)  # runs with more steps than that
        (x, y, z), momentum, h = axes[:, left], momenta[:, left], step[left]
        for kick, drift in zip(kicks, [*drifts, Wide(0.0)], strict=True):
            momentum = momentum + kick * h * np.stack([-y, x, 0.0 * z])
            length = np.sqrt((momentum * momentum).sum(axis=0))
            # a top at rest turns by no angle about any axis
            (a, b, c), angle = momentum / np.where(length > 0, length, 1), length * drift * h
            cos, sin, along = np.cos(angle), np.sin(angle), (1 - np.cos(angle)) * (a * x + b * y + c * z)
            x, y, z = (
                cos * x + sin * (b * z - c * y) + along * a,
                cos * y + sin * (c * x - a * z) + along * b,
                cos * z + sin * (a * y - b * x) + along * c,
            )
        axes[:, left], momenta[:, left] = (x, y, z), momentum
    return axes.T


def extended_order_data(table: xr.Dataset) -> tuple[Any, Any, Any] | None:
    """Steps, errors and bounds in long double of an error table that has them."""
    if "extended_error" not in table or not math.isfinite(float(table["extended_error"].max())):
        return None
    part = table.dropna("extended", subset=["extended_error"])
    return tuple(part[f"extended_{name}"].values for name in ("step", "error", "bound"))  # type: ignore[return-value]
