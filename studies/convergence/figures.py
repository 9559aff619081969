"""Figures of the study: error against step, a figure for each declared order."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.ticker import LogLocator

from symtop.measure.errors import QUANTITIES
from symtop.report.figures import error_band
from symtop.report.style import Look, grid, legend_below, look, slope_guide
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
            slope_guide(axis, power, ends, below * min(constants) * ends[0] ** power, f"$h^{{{power}}}$")
    title = f"methods of order {power}" if power else "methods that declare no order"
    return Picture(
        f"{quantity}-order-{power}",
        figure,
        words.caption(quantity, title, fitted),
        f"Log-log plots of {quantity} error against step size, {title}: straight lines parallel to the guide.",
    )


def error_curves(
    data: xr.Dataset,
    scenes: Sequence[str],
    x: str,
    quantity: str,
    labels: tuple[str, str],
    judged: Mapping[Any, Any],
) -> tuple[Any, Any]:
    """Error of `quantity` against the variable `x`, one panel a scene, one curve an integrator.

    Points listed as True in ``judged[scene, integrator]`` are filled, the others hollow; the reference's own bound is a
    band at the bottom. A method in plain Python is dashed.
    """
    columns = 3 if len(scenes) == 3 else min(2, len(scenes))
    figure, axes = grid(len(scenes), columns, labels)
    for axis, scene in zip(axes, scenes, strict=True):
        floor = error_band(axis, data[f"{quantity}_bound"].sel(scene=scene).values)
        for name in data["integrator"].values:
            cell = data.sel(scene=scene, integrator=name)
            xs, ys = cell[x].values, np.maximum(cell[quantity].values, 0.3 * floor)
            if not np.isfinite(ys).any():
                continue
            line = (0, (4, 2)) if "python" in cell["tier"].values else "-"
            _curve(axis, xs, ys, judged.get((scene, name)), look(str(name)), str(name), line)
        axis.set(xscale="log", yscale="log", title=scene)
        axis.xaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))  # labels of all nine would collide
        axis.grid(visible=True, which="major")
    legend_below(figure, axes)
    return figure, axes


def _curve(axis: Any, xs: Any, ys: Any, judged: Any, style: Look, name: str, line: Any) -> None:
    order = np.argsort(xs)
    order = order[np.isfinite(xs[order]) & np.isfinite(ys[order])]
    axis.plot(xs[order], ys[order], color=style.color, ls=line, lw=1.1, zorder=2)
    filled = np.ones(xs.size, bool) if judged is None else np.asarray(judged, bool)
    for mask, face in ((filled, style.color), (~filled, "white")):
        pick = order[mask[order]]
        axis.plot(xs[pick], ys[pick], style.marker, ls="none", color=style.color, mfc=face, ms=style.size, zorder=3)
    # the one entry in the legend
    axis.plot([], [], style.marker, color=style.color, ls=line, ms=style.size, lw=1.1, label=name)
