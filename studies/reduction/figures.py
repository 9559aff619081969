"""The figure of the reduction study."""

import numpy as np
import xarray as xr
from matplotlib.ticker import LogLocator

from symtop.report import style
from symtop.report.figures import SMALLEST
from symtop.runner.study import Picture

from .facts import cells
from .measures import COMMUTES, commutation_order


def pictures(data: xr.Dataset) -> list[Picture]:
    """Reducing first against reducing last, against the step, a panel a scene."""
    rows = cells(data, "commutation_gap")
    names = list(dict.fromkeys(scene for scene, *_ in rows))
    if not names:
        return []
    labels = ("step size (s)", "difference between reducing\nfirst and last, in $\\theta$ (rad)")
    figure, axes = style.grid(len(names), 2, labels, height=2.7, sharey="row")
    places = dict(zip(names, axes, strict=True))
    lowest: dict[tuple[str, int], float] = {}  # of the lines of each power, where its guide goes
    for scene, rule, cell in rows:
        gap = cell["commutation_gap"].values
        places[scene].plot(cell["commutation_step_size"], np.maximum(gap, SMALLEST), **style.line(rule), label=rule)
        if np.nanmax(gap) > COMMUTES and np.isfinite(order := commutation_order(cell)):
            power = scene, round(order)
            lowest[power] = min(float(np.nanmin(gap)), lowest.get(power, np.inf))
    for (scene, power), low in lowest.items():
        steps = data["commutation_step_size"].sel(scene=scene)
        style.slope_guide(places[scene], power, (float(steps.min()), float(steps.max())), 0.3 * low, f"$h^{power}$")
    for scene, axis in places.items():
        axis.set(xscale="log", yscale="log", title=f"scene {scene}")
        axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_formatter("")
    style.legend_below(figure, axes)
    return [Picture("commutation", figure)]
