"""The figure of the truth study."""

import numpy as np
import xarray as xr

from symtop.report import style
from symtop.runner.study import Picture

from . import words
from .tables import BOUND, ERROR, SOURCES, bound_ratios

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
    figure.legends[0].set_title(words.measured_against(data))
    _, broken, ratio = bound_ratios(data)
    flat = float(data[ERROR].sel(variant="closed form").max())
    style.headline(figure, words.message(data))
    caption = (
        "Error of each source, measured against the closed form in 45 digits, at horizons from "
        f"{float(data['horizon'].min()):g} s to {float(data['horizon'].max()):.0e} s on {data.sizes['scene']} scenes. "
        "A "
        "source is a Taylor integration at the tolerance of its arithmetic's rounding, in the axis or the attitude "
        "chart, the discrete map iterated in double, or the closed form in double; the start is the same for all. The "
        "shade above an error reaches up to "
        f"the bound that the reference claims. Errors above their bound: {broken}. The median bound is {ratio:.0f} "
        "times the error. The errors of an integration grow with time; those of the closed form in double stay within "
        f"{flat:.0e} rad at every horizon."
    )
    alt = "Log-log plots of axis error against horizon: integrations rise, the closed form stays flat."
    return [Picture("sources", figure, caption, alt)]
