"""Figures of the study: residuals over a million steps, rounding of an ensemble."""

import math
from typing import Any

import numpy as np
import xarray as xr

from symtop.measure.conservation import CONSTANTS, maxima
from symtop.report.figures import SMALLEST, chosen
from symtop.report.formats import number
from symtop.report.style import BLACK, GREY, LEAST_TEXT, few_ticks, legend_below, line, look, panels, slope_guide
from symtop.runner.study import Picture

from .measures import HISTORIES, ROUNDINGS, by_integrator

SHOWN = (  # in the figure of the residuals
    "midpoint[angles]", "stormer-verlet[angles]", "strang[axis]", "gauss-4[axis]", "rk4[angles]", "rk4[axis]",
    "rk45[angles]", "taylor[axis]",
)  # fmt: skip
LABELS = {"energy": "energy error\n/ energy of the nutation", "p_phi": "relative change of $p_\\varphi$",
          "p_psi": "relative change of $p_\\psi$"}  # fmt: skip
NOTE = {"fontsize": LEAST_TEXT, "color": "#444444"}


def pictures(data: xr.DataTree) -> list[Picture]:
    """The figures of every group that was measured."""
    functions = {HISTORIES: (_residuals,), ROUNDINGS: (_rounding,)}
    return [draw(data[group].to_dataset()) for group, draws in functions.items() if group in data for draw in draws]


def envelope(t: np.ndarray, r: np.ndarray) -> tuple[list[float], list[float]]:
    """The largest value in each of 18 logarithmic windows of time, which start a little before the first sample."""
    return maxima(t, r, math.log10(t[-1] / (0.999 * t[0])), 18)


def _residuals(histories: xr.Dataset) -> Picture:
    data = histories.sel(variant=chosen(list(map(str, histories["variant"].values)), SHOWN))
    figure, axes = panels(len(CONSTANTS), data.sizes["scene"], height=1.9, sharex="col", sharey="row")
    for row, constant in zip(axes, CONSTANTS, strict=True):
        for axis, scene in zip(row, data["scene"].values, strict=True):
            for name in map(str, data["variant"].values):
                cell = data.sel(scene=scene, variant=name)
                t, r = cell["sample_time"].values, np.abs(cell[f"{constant}_residual"].values)
                good = np.isfinite(r) & np.isfinite(t) & (t > 0.0)
                if good.any():
                    t, r = t[good], np.maximum(r[good], SMALLEST)
                    axis.plot(*envelope(t, r), **line(name, 0.8), label=name, zorder=3)
            axis.set(xscale="log", yscale="log")
        row[0].set_ylabel(LABELS[constant])
        row[0].annotate("exact zeros", (0.01, SMALLEST), (0, 3), xycoords=row[0].get_yaxis_transform(),
                        textcoords="offset points", **NOTE)  # fmt: skip
    for axis, scene in zip(axes[0], data["scene"].values, strict=True):
        axis.set_title(f"scene {scene}")
        first, last = axis.get_xlim()
        axis.autoscale(enable=False)
        slope_guide(axis, 1.0, (first * 6.0, last / 2.0), 1e-11, "as $t$")
    for axis in axes[-1]:
        axis.set_xlabel("time (s)")
    few_ticks(*axes.flat)
    note = "a marker: the largest\nin a span of time"  # where every panel of p_phi is empty
    axes[1, 0].text(0.98, 0.45, note, transform=axes[1, 0].transAxes, ha="right", va="center", **NOTE)
    legend_below(figure, axes)
    return Picture("residuals", figure)


def _rounding(data: xr.Dataset) -> Picture:
    ensembles = by_integrator(data)
    figure, axes = panels(1, len(ensembles), height=2.6, sharex=True, sharey=True)
    bold: dict[str, Any] = {"fontsize": 7.5, "weight": "bold", "va": "center", "ha": "center", "zorder": 5}
    bold |= {"bbox": {"color": "white", "pad": 0.8}}
    for axis, (name, cell) in zip(axes[0], ensembles.items(), strict=True):
        mark, ensemble = look(name), cell.dropna("window", subset=["elapsed"])
        steps, last = ensemble["elapsed"].values, float(ensemble["elapsed"].max())
        for drift in ensemble["drift"].values:
            axis.plot(steps, np.abs(drift), color=mark.color, lw=0.4, alpha=0.3, zorder=1)
        plain, compensated = ensemble["plain_rms"].values, ensemble["rms"].values
        axis.plot(steps, plain, color=BLACK, lw=1.6, ls=(0, (3, 1)), zorder=3)
        axis.plot(steps, compensated, color=mark.color, lw=2.2, zorder=3)
        axis.axvspan(0.1 * last, last, color="#EEEEEE", lw=0, zorder=0)
        gain, middle = number(float(cell["gain"])), math.sqrt(0.1) * last
        ends = float(cell["late"]), float(cell["plain_late"])
        axis.annotate("", (middle, ends[0]), (middle, ends[1]), zorder=4,
                      arrowprops={"arrowstyle": "<->", "shrinkA": 2, "shrinkB": 2, "lw": 0.9})  # fmt: skip
        axis.text(middle, math.sqrt(ends[0] * ends[1]), f"{gain}\N{MULTIPLICATION SIGN}", **bold)
        axis.set(xscale="log", yscale="log", xlabel="steps n")
        plain_power, power = float(cell["plain_exponent"]), float(cell["exponent"])
        axis.set_title(f"{name}\nplain: power {plain_power:.2f}\ncompensated: power {power:.2f}", fontsize=7.5)
        slope_guide(axis, 0.5, (steps[0] * 3.0, steps[-1]), 1e-18, r"$n^{1/2}$")
    axes[0, 0].set_ylim(bottom=2e-19)
    axes[0, 0].set_ylabel("drift of modified energy\n/ energy of the nutation")
    few_ticks(*axes.flat, most=5)
    members = data.sizes["member"], data.sizes["plain_member"]
    lines = (
        (BLACK, 1.6, (0, (3, 1)), f"plain sums: root mean square of {members[1]} starts"),
        (GREY, 2.2, "-", f"compensated sums: root mean square of {members[0]} starts (thin: each)"),
    )
    for color, width, dash, label in lines:
        axes[0, 0].plot([], [], color=color, lw=width, ls=dash, label=label)
    axes[0, 0].fill_between([], [], [], color="#EEEEEE", lw=0, label=f"last decade of n, over which both are averaged "
                            f"(first {members[1]} starts) for the ratio")  # fmt: skip
    legend_below(figure, axes)
    return Picture("rounding", figure)
