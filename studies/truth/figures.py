"""The figure of the truth study."""

import numpy as np
import xarray as xr

from symtop.report import style
from symtop.runner.study import Picture

from .sources import SOURCES
from .tables import Column, bound_ratios

COLORS = (style.ORANGE, style.VERMILLION, style.GREEN, style.BLUE, style.PURPLE, style.BLACK)
LOOKS = dict(zip(SOURCES, zip(COLORS, "v<^>D*", strict=True), strict=True))
NEAREST = 1e-36  # rad: where an error of exactly zero is drawn


def pictures(data: xr.Dataset) -> list[Picture]:
    """Error of each source against the horizon, and the bound it claims."""
    names = [str(name) for name in data["scene"].values]
    figure, axes = style.panels(-(-len(names) // 2), 2)
    for axis, name in zip(axes.flat, names, strict=False):
        for source in data["integrator"].values:
            cell = data.sel(scene=name, integrator=source)
            horizon, bound = cell["horizon"].values, cell[Column.BOUND].values
            error = np.maximum(cell[Column.ERROR].values, NEAREST)
            color, marker = LOOKS[str(source)]
            measured = np.isfinite(error)
            axis.plot(horizon[measured], error[measured], marker + "-", color=color, label=str(source))
            claimed = measured & np.isfinite(bound)
            axis.fill_between(horizon[claimed], error[claimed], bound[claimed], color=color, alpha=0.15, lw=0)
        axis.set(xscale="log", yscale="log", title=name)
    for axis in axes.flat[len(names) :]:
        axis.set_visible(False)
    for axis in axes[-1]:
        axis.set_xlabel("horizon (s)")
    for axis in axes[:, 0]:
        axis.set_ylabel("axis error (rad)")
    style.legend_below(figure, axes)
    _, broken, ratio = bound_ratios(data)
    flat = float(data[Column.ERROR].sel(integrator="closed form").max())
    caption = (
        "True error of each source, measured against the closed form in 45 digits; the shade above it reaches up to "
        f"the bound that the reference claims. Errors above their bound: {broken}. The median bound is {ratio:.0f} "
        "times the error. The errors of an integration grow with time; those of the closed form in double stay within "
        f"{flat:.0e} rad at every horizon."
    )
    alt = "Log-log plots of axis error against horizon: integrations rise, the closed form stays flat."
    return [Picture("sources", figure, caption, alt)]
