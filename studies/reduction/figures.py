"""Figures of the reduction study."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.ticker import FixedLocator, NullLocator

from symtop.report import style
from symtop.runner.study import Picture

from . import words
from .tables import COMMUTES, COMPARED_STEPS, GAPS, Column, commutation_order
from .words import cells

NEAREST = 1e-17  # rad: where a difference of exactly zero is drawn
CHART_COLORS = {"angles": style.VERMILLION, "attitude": style.BLUE, "axis": style.GREEN}
SCENE_MARKERS = "osv^"
RATIO_TICKS = (0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0)


def pictures(data: xr.Dataset) -> list[Picture]:
    """One figure a comparison."""
    drawn = [draw_commutation(data), draw_unreduced(data)]
    return drawn + ([draw_charts(data)] if cells(data, Column.SECONDS) else [])


def _scene_panels(data: xr.Dataset, variable: str) -> tuple[Any, Any, list[str]]:
    names = list(dict.fromkeys(scene for scene, _, _ in cells(data, variable)))
    figure, axes = style.panels(1, len(names), height=4.0, sharey="row")
    for axis, name in zip(axes.flat, names, strict=True):
        axis.set(xscale="log", yscale="log", title=name)
        axis.xaxis.set_minor_formatter("")
    return figure, axes, names


def draw_commutation(data: xr.Dataset) -> Picture:
    """Reducing first against reducing last, against the step."""
    figure, axes, names = _scene_panels(data, Column.COMMUTATION_GAP)
    lowest: dict[tuple[str, int], float] = {}  # of the lines of each power, where its guide goes
    for name, method, cell in cells(data, Column.COMMUTATION_GAP):
        axis, h, look = axes.flat[names.index(name)], cell[Column.COMMUTATION_STEP].values, style.look(method)
        gap = cell[Column.COMMUTATION_GAP].values
        axis.plot(h, np.maximum(gap, NEAREST), look.marker + "-", color=look.color, label=method)
        if np.isfinite(cell[Column.HAMILTONIAN_GAP]).any():
            hamiltonian = np.maximum(cell[Column.HAMILTONIAN_GAP].values, NEAREST)
            axis.plot(h, hamiltonian, "x--", color=style.BLACK, label="midpoint, reduced Hamiltonian")
        if np.nanmax(gap) > COMMUTES:
            power = name, round(commutation_order(cell))
            lowest[power] = min(float(np.nanmin(gap)), lowest.get(power, np.inf))
        axis.set_xlabel("step size (s)")
    for (name, power), low in lowest.items():
        steps = data[Column.COMMUTATION_STEP].sel(scene=name)
        span = float(steps.min()), float(steps.max())
        style.slope_guide(axes.flat[names.index(name)], power, span, 0.3 * low, f"$h^{power}$")
    axes[0, 0].set_ylabel("difference between reducing\nfirst and last, in theta (rad)")
    style.legend_below(figure, axes)
    return Picture(
        "commutation",
        figure,
        "Reduce, then discretise, against discretise, then reduce: largest difference in theta over two nutations. "
        f"{words.commuting(data)} Crosses: the midpoint discrete Lagrangian against the implicit midpoint rule on the "
        "reduced Hamiltonian.",
        "Log-log plots of the difference against the step: lines of slope 2 and 4, and flat ones at 1e-16.",
    )


def draw_unreduced(data: xr.Dataset) -> Picture:
    """A kernel against its unreduced form, over time."""
    figure, axes, names = _scene_panels(data, Column.THETA_GAP)
    for name, method, cell in cells(data, Column.THETA_GAP):
        axis, look = axes.flat[names.index(name)], style.look(method)
        for (variable, angle), line in zip(GAPS.items(), ("-", "--", ":"), strict=True):
            gap = np.maximum.accumulate(np.maximum(cell[variable].values, NEAREST))
            axis.plot(cell[Column.TIME].values[1:], gap[1:], line, color=look.color, label=f"{angle}, {method}")
        axis.set_xlabel("time (s)")
    axes[0, 0].set_ylabel("largest difference so far (rad)")
    style.legend_below(figure, axes)
    return Picture(
        "twins",
        figure,
        f"Reduced kernels against their unreduced forms, which eliminate nothing, {COMPARED_STEPS} steps over eight "
        f"nutations: largest difference so far in each angle. It never exceeds {words.largest_gap(data):.1e} rad: the "
        "two are one map, apart from rounding.",
        "Log-log plots of the differences of the three angles against time, growing from 1e-16 to about 1e-12.",
    )


def draw_charts(data: xr.Dataset) -> Picture:
    """Time and error of a larger chart against the smallest."""
    ratios = words.ratios(data)
    methods = list(dict.fromkeys(method for _, method, _ in ratios))
    scenes = list(dict.fromkeys(scene for scene, _, _ in ratios))
    figure, axes = style.panels(1, 2, height=1.6 + 0.24 * len(methods), sharey=True)
    titles = {"time": "time of a run (ratio)", "error": "error of the axis (ratio)"}
    for axis, (quantity, title) in zip(axes.flat, titles.items(), strict=True):
        for scene, method, ratio in ratios:
            marker = SCENE_MARKERS[scenes.index(scene) % len(SCENE_MARKERS)]
            axis.plot(
                getattr(ratio, quantity), methods.index(method), marker,
                color=CHART_COLORS[ratio.chart], label=f"{ratio.chart} against {ratio.base}, {scene}", ls="none", ms=6,
            )  # fmt: skip
        axis.axvline(1.0, color=style.GREY, lw=0.9)
        axis.set(xscale="log", yticks=range(len(methods)), yticklabels=methods, ylim=(len(methods) - 0.5, -0.5))
        axis.set_xlabel(title)
        axis.set_xlim(min(0.9, axis.get_xlim()[0]), max(1.1, axis.get_xlim()[1]))
        axis.xaxis.set_major_locator(FixedLocator(RATIO_TICKS))
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_locator(NullLocator())
    style.legend_below(figure, axes)
    times = [ratio.time for *_, ratio in ratios]
    return Picture(
        "charts",
        figure,
        "The same integrator at the same setting in a larger chart, relative to the smallest chart it has "
        f"({', '.join(sorted({ratio.base for *_, ratio in ratios}))}): time of a run and error of the axis; "
        f"logarithmic scales. A larger chart takes {min(times):.2f} to {max(times):.2f} times as long.",
        "Two dot plots, a row for each integrator, a colour for each chart: ratios of time and of error to the "
        "smallest chart.",
    )
