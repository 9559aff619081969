"""The figure of the truth study."""

import numpy as np
import xarray as xr

from symtop.report import style
from symtop.runner.study import Picture

from .measures import BOUND, ERROR, SOURCES

COLORS = (style.ORANGE, style.VERMILLION, style.GREEN, style.BLUE, style.PURPLE, style.SKY, style.BLACK)
LOOKS = dict(zip(SOURCES, zip(COLORS, "v<^>DX*", strict=True), strict=True))
DASHES = dict(zip(SOURCES, ("-", "--", "-", "--", "--", ":", "-"), strict=True))  # dashed: the attitude chart
LEGENDS = {"closed form": "closed form, in double", "discrete map": "exact-discrete, step by step in double"}
NEAREST = 1e-36  # rad: where an error of exactly zero is drawn


def pictures(data: xr.Dataset) -> list[Picture]:
    """Error of each source against the horizon, and the bound it claims."""
    labels = ("time after the start (s)", "error of the axis (rad)")
    figure, axes = style.grid(data.sizes["scene"], 2, labels, height=2.0, sharex=True, sharey=True)
    for axis, scene in zip(axes, data["scene"].values, strict=True):
        for source in map(str, data["variant"].values):
            cell = data.sel(scene=scene, variant=source).dropna("horizon", subset=[ERROR])
            color, marker = LOOKS[source]
            error = np.maximum(cell[ERROR].values, NEAREST)
            axis.plot(cell["horizon"], error, marker=marker, color=color, ls=DASHES[source],
                      label=LEGENDS.get(source, f"Taylor in {source}"))  # fmt: skip
            axis.fill_between(cell["horizon"], error, cell[BOUND], color=color, alpha=0.15, lw=0)
        axis.set(xscale="log", yscale="log", title=f"scene {scene}")
    axes[0].fill_between([], [], [], color=style.GREY, alpha=0.3, lw=0, label="shade: up to the bound it claims")
    style.few_ticks(*axes, most=5)
    style.legend_below(figure, axes)
    return [Picture("sources", figure)]
