"""Figures of the study: error against step, a figure for each declared order."""

import numpy as np
import xarray as xr
from matplotlib.ticker import LogLocator

from symtop.measure.errors import QUANTITIES
from symtop.report.figures import error_band
from symtop.report.style import grid, legend_below, look, slope_guide
from symtop.runner.study import Picture

from .tables import by_order, fits, guide_constant

STEEP = 8  # from this order on a guide as long as that of a lower order would leave the figure


def pictures(data: xr.Dataset) -> list[Picture]:
    """Attitude error against the step, a figure for each declared order; energy error of second-order methods."""
    groups = by_order(data)
    drawn = [_picture(data.sel(integrator=names), "attitude", power) for power, names in groups.items()]
    return [*drawn, *([_picture(data.sel(integrator=groups[2]), "energy", 2)] if 2 in groups else [])]


def _picture(data: xr.Dataset, quantity: str, power: int) -> Picture:
    """One panel a scene, one curve an integrator: points that enter the fit are filled, plain Python is dashed."""
    scenes, fitted = [str(name) for name in data["scene"].values], fits(data, quantity)
    columns = 3 if len(scenes) == 3 else min(2, len(scenes))
    figure, axes = grid(len(scenes), columns, ("step size (s)", f"largest {QUANTITIES[quantity]}"))
    for axis, scene in zip(axes, scenes, strict=True):
        part = data.sel(scene=scene)
        floor = error_band(axis, part[f"{quantity}_bound"].values)
        for name in map(str, data["integrator"].values):
            cell, style, used = part.sel(integrator=name), look(name), fitted[scene, name].used
            h, error = cell["step_size"].values, np.maximum(cell[quantity].values, 0.3 * floor)
            ranked = np.argsort(h)
            ranked = ranked[np.isfinite(h[ranked]) & np.isfinite(error[ranked])]
            if not ranked.size:
                continue
            line = (0, (4, 2)) if "python" in cell["implementation"].values else "-"
            axis.plot(h[ranked], error[ranked], color=style.color, ls=line, lw=1.1, zorder=2)
            marks = {"marker": style.marker, "color": style.color, "ms": style.size}
            axis.plot(h[used], error[used], ls="none", zorder=3, **marks)
            axis.plot(h[~used], error[~used], ls="none", mfc="white", zorder=3, **marks)
            axis.plot([], [], ls=line, lw=1.1, label=name, **marks)  # the one entry in the legend
        axis.set(xscale="log", yscale="log", title=scene)
        axis.xaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))  # labels of all nine would collide
        axis.grid(visible=True, which="major")
        constants = [fit.constant for pair, fit in fitted.items() if pair[0] == scene and np.isfinite(fit.slope)]
        least = min(constants, default=guide_constant(part, quantity, power))
        if power and np.isfinite(least):
            coarse = float(part["step_size"].max())
            width, below = (0.2, 0.15) if power < STEEP else (0.5, 0.02)
            ends = (width * coarse, coarse)
            slope_guide(axis, power, ends, below * least * ends[0] ** power, f"$h^{{{power}}}$")
    legend_below(figure, axes)
    title = f"methods of order {power}" if power else "methods that declare no order"
    slopes = [fit.slope for fit in fitted.values() if np.isfinite(fit.slope)]
    span = f"Fitted orders lie between {min(slopes):.3f} and {max(slopes):.3f}." if slopes else "None could be fitted."
    caption = (
        f"Largest {quantity} error over the run against the step, {title}. Filled points enter the fit; hollow ones "
        "are too large, not yet on a straight line, or within ten times the error bound of the reference (grey band). "
        f"{span}"
    )
    alt = f"Log-log plots of {quantity} error against step size, {title}: straight lines parallel to the guide."
    return Picture(f"{quantity}-order-{power}", figure, caption, alt)
