"""Figures of the study: error against step, a figure for each declared order."""

import numpy as np
import xarray as xr

from symtop.measure.errors import QUANTITIES
from symtop.report import style
from symtop.report.figures import error_curves
from symtop.runner.study import Picture

from . import words
from .tables import by_order, fits, guide_constants

STEEP = 8  # from this order on a guide as long as that of a lower order would leave the figure


def pictures(data: xr.Dataset) -> list[Picture]:
    """Attitude error against the step, a figure for each declared order; energy error of second-order methods."""
    groups = by_order(data)
    drawn = [_picture(data.sel(integrator=names), "attitude", power) for power, names in groups.items()]
    return [*drawn, *([_picture(data.sel(integrator=groups[2]), "energy", 2)] if 2 in groups else [])]


def _picture(data: xr.Dataset, quantity: str, power: int) -> Picture:
    scenes = [str(name) for name in data["scene"].values]
    fitted = fits(data, quantity)
    labels = ("step size (s)", f"largest {QUANTITIES[quantity]}")
    used = {pair: fit.used for pair, fit in fitted.items()}
    figure, axes = error_curves(data, scenes, "step_size", quantity, labels, used)
    for axis, name in zip(axes.flat, scenes, strict=False):
        constants = [fit.constant for pair, fit in fitted.items() if pair[0] == name and np.isfinite(fit.slope)]
        constants = constants or guide_constants(data, name, quantity, power)
        if power and constants:
            coarse = float(np.nanmax(data["step_size"].sel(scene=name).values))
            width, below = (0.2, 0.15) if power < STEEP else (0.5, 0.02)
            ends = (width * coarse, coarse)
            style.slope_guide(axis, power, ends, below * min(constants) * ends[0] ** power, f"$h^{{{power}}}$")
    title = f"methods of order {power}" if power else "methods that declare no order"
    return Picture(
        f"{quantity}-order-{power}",
        figure,
        words.caption(quantity, title, fitted),
        f"Log-log plots of {quantity} error against step size, {title}: straight lines parallel to the guide.",
    )
