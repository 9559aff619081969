"""Tables of errors against step sizes from which an order is fitted, and the fit of the order in any quantity.

A ladder of steps that spans all decades of error has few steps where a method of high order is asymptotic: for order
12, ten decades of error are less than one of step. If the order cannot be fitted, `ADDED_STEPS` more steps are added,
whose errors lie between rounding and `ADDED_DECADES` above it. Where double precision runs out before the error is a
power of the step, a splitting is run in long double: in the axis chart a composition of exact drifts and kicks is

    drift a:  e turns about L by the angle a h |L|/I1        kick b:  L += b h mgl (z x e)

so that its coefficients suffice to run it in any arithmetic; a mantissa of 64 bits gives three more decades of error.
The coefficients are doubles, rescaled so that they sum to 1. The error is that of the axis at the end, against both
parts of a reference in long double. Methods with a modified potential or another rotation are not run.
"""

import functools
import math
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from symtop.core.numbers import EPSILON
from symtop.measure.accuracy import error_table
from symtop.measure.order import Fit, order
from symtop.methods.framework.registry import Integrator
from symtop.methods.splitting.loop import Stages
from symtop.methods.splitting.rotor import ROTATIONS
from symtop.model import charts
from symtop.model.scenes import Scene
from symtop.run.reference.independent_checks import have_heyoka
from symtop.run.reference.truth import reference

ADDED_STEPS, ADDED_DECADES = 12, 3.0  # steps that are added, and the decades of error that they span
ABOVE_ROUNDING = 20.0  # times the bound: the least error that an added step should have
FINEST_ADDED = 0.5  # times the finest useful step: no added step is finer, even if the error hardly falls with the step


def observable(method: Integrator) -> str:
    """The quantity to observe: "attitude" if the method has a chart that determines it, else "axis"."""
    return "attitude" if set(method.solvers) & {"angles", "attitude"} else "axis"


def asymptotic_steps(table: xr.Dataset, quantity: str, power: int) -> list[float]:
    """Added steps, whose errors reach from just above rounding `ADDED_DECADES` up; none if all errors are rounding."""
    h, error, bound = (table[name].values for name in ("step_size", quantity, f"{quantity}_bound"))
    indices = np.flatnonzero(np.isfinite(error) & (error > 2.5 * ABOVE_ROUNDING * bound))
    if indices.size == 0:
        return []
    finest = indices[np.argmin(h[indices])]
    first = h[finest] * max(float((ABOVE_ROUNDING * bound[finest] / error[finest]) ** (1.0 / power)), FINEST_ADDED)
    return [float(first * 10.0 ** (ADDED_DECADES / power * k / (ADDED_STEPS - 1))) for k in range(ADDED_STEPS)]


def order_table(
    scene: Scene, method: Integrator, settings: list[float], horizon: float, quantity: str, *, dense: bool = True
) -> xr.Dataset:
    """The `error_table` of a method with `quantity` observed, and with more steps if they are needed for its order."""
    table = error_table(scene, method, settings, horizon, observe=quantity)
    if not method.fixed_step or not dense or math.isfinite(order_fit(scene, method, table, quantity, horizon).slope):
        return table
    if steps := asymptotic_steps(table, quantity, method.order or 2):
        table = xr.concat([table, error_table(scene, method, steps, horizon, observe=quantity)], "setting")
    if math.isfinite(order_fit(scene, method, table, quantity, horizon).slope):
        return table
    extended = None if scene.of_body else extended_errors(scene, method)
    return table if extended is None else table.merge(extended)


def order_fit(scene: Scene, method: Integrator, table: xr.Dataset, quantity: str, horizon: float) -> Fit:
    """The order in one quantity of an error table, against the step, or the mean step of an adaptive method.

    A method of high order makes few steps per nutation, and the largest error at so few times scatters. If its order
    cannot be judged, that of the error at the end is used, which is smooth in h, and if that fails, for axis and
    attitude, that of the runs in long double, whose steps are not among those of the table.
    """
    step = table["step_size"].values if method.fixed_step else horizon / table["steps"].values
    bound, omega = table[f"{quantity.removesuffix('_end')}_bound"].values, 2.0 * math.pi / scene.nutation_period
    fit = functools.partial(order, omega=omega, claim=method.order, symmetric=method.symmetric)
    largest = fit(step, table[quantity].values, bound)
    if math.isfinite(largest.slope) or f"{quantity}_end" not in table:
        return largest
    end = fit(step, table[f"{quantity}_end"].values, bound)
    if math.isfinite(end.slope):
        return end
    extended = extended_order_data(table) if quantity in ("axis", "attitude") else None
    last = fit(*extended) if extended else end
    return last._replace(used=np.zeros_like(largest.used)) if math.isfinite(last.slope) else largest


Wide = np.longdouble
NUTATIONS = 1.37  # length of a run
STEPS_A_NUTATION = 5.0, 45.0  # of the coarsest and the finest run
RUNS = 40
BOUND = 8.0 * float(np.finfo(Wide).eps)  # rounding error of the start and of a run of a hundred steps


def extended_errors(scene: Scene, method: Integrator) -> xr.Dataset | None:
    """``extended_step``, ``extended_error`` (rad, of the axis at the end), ``extended_bound``; or None."""
    stages = _composition(scene, method)
    if stages is None or not have_heyoka() or np.finfo(Wide).eps == EPSILON:
        return None
    horizon = NUTATIONS * scene.time_scale()
    truth = reference(scene, [horizon], "longdouble")
    true = truth["axis"].values[0].astype(Wide) + truth["axis_lo"].values[0]
    counts = np.unique(np.rint(NUTATIONS * np.geomspace(*STEPS_A_NUTATION, RUNS)).astype(int))
    difference = _ends(scene, stages, horizon, counts) - true
    error = np.sqrt((difference * difference).sum(axis=1)).astype(float)
    bound = np.maximum(truth["axis_error_bound"].values[0], BOUND)
    columns = {"step": horizon / counts, "error": error, "bound": np.full(counts.size, bound)}
    return xr.Dataset({f"extended_{name}": ("extended", values) for name, values in columns.items()})


def _composition(scene: Scene, method: Integrator) -> Stages | None:
    """The stages of a step of size 1 if the method composes exact drifts and unmodified kicks, else None."""
    solver: Any = method.solvers.get("axis", method.solvers.get("attitude"))
    if not hasattr(solver, "setup"):
        return None
    stages = solver.setup(scene.top, scene.start, 1.0)[1]
    if not isinstance(stages, Stages) or any(stages.bend) or stages.boost or ROTATIONS[stages.turn] != "exact":
        return None
    return stages


def _ends(scene: Scene, stages: Stages, horizon: float, counts: NDArray[np.int64]) -> Any:
    """The final axes (n, 3) of runs with each of the ascending `counts` of steps, in long double, advanced together."""
    top, start, step = scene.top, scene.start, Wide(horizon) / counts.astype(Wide)
    theta, phi, *rates = map(Wide, (start.theta, start.phi, start.theta_dot, start.phi_dot, start.psi_dot))
    axes = np.tile(np.array(charts.axis_parts(np, theta, phi))[:, np.newaxis], counts.size)
    momenta = np.tile(np.array(charts.momentum_parts(np, top, theta, phi, *rates))[:, np.newaxis], counts.size)
    drifts, kicks = ([Wide(value) for value in coefficients] for coefficients in (stages.drift, stages.kick))
    drifts = [value / sum(drifts) / Wide(top.I1) for value in drifts]
    kicks = [value / (sum(kicks) or 1) * Wide(top.mgl) for value in kicks]  # those of a free top are zero
    for index in range(counts[-1]):
        running = slice(int(np.searchsorted(counts, index, side="right")), None)  # runs with more steps than that
        (x, y, z), momentum, h = axes[:, running], momenta[:, running], step[running]
        for kick, drift in zip(kicks, [*drifts, Wide(0.0)], strict=True):
            momentum = momentum + kick * h * np.stack([-y, x, 0.0 * z])
            length = np.sqrt((momentum * momentum).sum(axis=0))
            # a top at rest turns by no angle about any axis
            (a, b, c), angle = momentum / np.where(length > 0, length, 1), length * drift * h
            cos, sin, dot = np.cos(angle), np.sin(angle), (1 - np.cos(angle)) * (a * x + b * y + c * z)
            x, y, z = (
                cos * x + sin * (b * z - c * y) + dot * a,
                cos * y + sin * (c * x - a * z) + dot * b,
                cos * z + sin * (a * y - b * x) + dot * c,
            )
        axes[:, running], momenta[:, running] = (x, y, z), momentum
    return axes.T


def extended_order_data(table: xr.Dataset) -> tuple[Any, Any, Any] | None:
    """Steps, errors and bounds of the runs in long double in an error table; None if it has none."""
    if "extended_error" not in table or not math.isfinite(float(table["extended_error"].max())):
        return None
    rows = table.dropna("extended", subset=["extended_error"])
    return tuple(rows[f"extended_{name}"].values for name in ("step", "error", "bound"))  # type: ignore[return-value]
