"""The errors that an order is read from, and the orders of every quantity in them.

A ladder of steps that spans all decades of error has few steps where a method of high order is asymptotic: of order 12,
ten decades of error are one of step. If the ladder does not show the order, `ASYMPTOTIC` more steps are put between
rounding and `DECADES` above it. The claims ledger and the convergence study both judge such tables.
"""

import math

import numpy as np
import xarray as xr

from symtop.measure.accuracy import error_table
from symtop.measure.extended import extended_errors, extended_order_data
from symtop.measure.order import Fit, order
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene

ASYMPTOTIC, DECADES = 12, 3.0  # steps that are added, and the decades of error that they fill
ABOVE_ROUNDING = 20.0  # times the bound: the least error that an added step is to have
FURTHER = 0.5  # an error that does not fall must not ask for a million times the steps


def observable(method: Integrator) -> str:
    """The attitude, if the method shows it in any chart."""
    return "attitude" if set(method.solvers) & {"angles", "attitude"} else "axis"


def asymptotic_steps(table: xr.Dataset, quantity: str, power: int) -> list[float]:
    """More steps where an error table's errors are a power of the step: from above rounding `DECADES` upwards.

    A ladder over all decades has few steps there if the order `power` is high. Empty if every error is near its bound.
    """
    h, error, bound = (table[name].values for name in ("step_size", quantity, f"{quantity}_bound"))
    judged = np.flatnonzero(np.isfinite(error) & (error > 2.5 * ABOVE_ROUNDING * bound))
    if judged.size == 0:
        return []
    finest = judged[np.argmin(h[judged])]
    first = h[finest] * max(float((ABOVE_ROUNDING * bound[finest] / error[finest]) ** (1.0 / power)), FURTHER)
    return [float(first * 10.0 ** (DECADES / power * k / (ASYMPTOTIC - 1))) for k in range(ASYMPTOTIC)]


def order_table(
    scene: Scene, method: Integrator, settings: list[float], horizon: float, quantity: str, *, dense: bool = True
) -> xr.Dataset:
    """The error table of a method (see `error_table`) with `quantity` observed, and more steps if they are needed."""
    table = error_table(scene, method, settings, horizon, observe=quantity)
    if not method.fixed_step or not dense or math.isfinite(order_fit(scene, method, table, quantity, horizon).slope):
        return table
    steps = asymptotic_steps(table, quantity, method.order or 2)
    more = error_table(scene, method, steps, horizon, observe=quantity) if steps else None
    table = table if more is None else xr.concat([table, more], "setting")
    if math.isfinite(order_fit(scene, method, table, quantity, horizon).slope):
        return table
    extended = extended_errors(scene, method)
    return table if extended is None else table.merge(extended)


def order_fit(scene: Scene, method: Integrator, table: xr.Dataset, quantity: str, horizon: float) -> Fit:
    """The order in one quantity of an error table, against the step, or the mean step of an adaptive method.

    A method of high order makes few steps a nutation, and the largest error at so few times scatters. Where
    it cannot be judged, the error at the end is, which is smooth in h; and for axis and attitude, last, that of a run
    in long double, whose steps are not among those of the table.
    """
    largest = _fit(scene, method, table, quantity, horizon)
    if math.isfinite(largest.slope) or f"{quantity}_end" not in table:
        return largest
    end = _fit(scene, method, table, f"{quantity}_end", horizon)
    if math.isfinite(end.slope) or quantity not in ("axis", "attitude"):
        return end if math.isfinite(end.slope) else largest
    extended = extended_order_data(table)
    if extended is None:
        return largest
    omega = 2.0 * math.pi / scene.nutation_period
    fit = order(*extended, omega, method.order, symmetric=method.symmetric)
    return fit._replace(used=np.zeros_like(largest.used)) if math.isfinite(fit.slope) else largest


def _fit(scene: Scene, method: Integrator, table: xr.Dataset, quantity: str, horizon: float) -> Fit:
    step = table["step_size"].values if method.fixed_step else horizon / table["steps"].values
    omega = 2.0 * math.pi / scene.nutation_period
    error, bound = (table[column].values for column in (quantity, f"{quantity.removesuffix('_end')}_bound"))
    return order(step, error, bound, omega, method.order, symmetric=method.symmetric)
