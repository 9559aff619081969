"""Figures of the reduction study."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.ticker import FixedLocator, LogLocator, NullLocator

from symtop.report import style
from symtop.report.figures import SMALLEST, largest_so_far
from symtop.runner.study import Picture

from . import words
from .tables import CHART_PERIODS, COMMUTES, COMPARED_STEPS, GAPS, SAME_MAP, Column, commutation_order

CHART_COLORS = {"angles": style.VERMILLION, "attitude": style.BLUE, "axis": style.GREEN}
SCENE_MARKERS = "osv^" * 9
AS_FAST = 1.1  # times as long: what the noise of a time hides
RATIO_TICKS = (0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0)


def pictures(data: xr.Dataset) -> list[Picture]:
    """One figure a comparison."""
    drawn = [draw_commutation(data), draw_unreduced(data)]
    return drawn + ([draw_charts(data)] if words.cells(data, Column.SECONDS) else [])


def _scene_panels(data: xr.Dataset, variable: str, labels: tuple[str, str]) -> tuple[Any, dict[str, Any]]:
    """A figure and its panels by scene, of the scenes in which a variable was measured."""
    names = list(dict.fromkeys(scene for scene, _, _ in words.cells(data, variable)))
    figure, axes = style.grid(len(names), len(names), labels, height=2.7, sharey="row")
    for axis, name in zip(axes, names, strict=True):
        axis.set(xscale="log", yscale="log", title=f"scene {name}")
        axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_formatter("")
    return figure, dict(zip(names, axes, strict=True))


def draw_commutation(data: xr.Dataset) -> Picture:
    """Reducing first against reducing last, against the step."""
    labels = ("step size (s)", "difference between reducing\nfirst and last, in $\\theta$ (rad)")
    figure, axes = _scene_panels(data, Column.GAP, labels)
    lowest: dict[tuple[str, int], float] = {}  # of the lines of each power, where its guide goes
    for name, method, cell in words.cells(data, Column.GAP):
        gap = cell[Column.GAP].values
        axes[name].plot(cell[Column.STEP], np.maximum(gap, SMALLEST), **style.line(method), label=method)
        if np.nanmax(gap) > COMMUTES:
            power = name, round(commutation_order(cell))
            lowest[power] = min(float(np.nanmin(gap)), lowest.get(power, np.inf))
    for (name, power), low in lowest.items():
        steps = data[Column.STEP].sel(scene=name)
        style.slope_guide(axes[name], power, (float(steps.min()), float(steps.max())), 0.3 * low, f"$h^{power}$")
    style.legend_below(figure, list(axes.values()))
    style.headline(figure, words.commuting_message(data))
    return Picture(
        "commutation",
        figure,
        f"Reduce, then discretise, against discretise, then reduce: largest difference in theta over two nutations of "
        f"{' and '.join(axes)}, both in angles, same rule, start and step. "
        f"{words.commuting(data)}",
        "Log-log plots of the difference against the step: lines of slope 2 and 4, and flat ones at 1e-16.",
    )


def draw_unreduced(data: xr.Dataset) -> Picture:
    """A kernel against its unreduced form, over time: the largest difference of any angle."""
    figure, axes = _scene_panels(data, Column.THETA_GAP, ("time (s)", "largest difference so far,\nof any angle (rad)"))
    methods: dict[str, None] = {}
    for name, method, cell in words.cells(data, Column.THETA_GAP):
        gap = largest_so_far(np.max([cell[variable].values for variable in GAPS], axis=0))
        gap[gap <= SMALLEST] = np.nan  # no difference yet
        look = style.line(method) | {"markevery": max(1, gap.size // 8)}
        axes[name].plot(cell[Column.TIME].values[1:], gap[1:], **look, label=method)
        methods[method] = None
    for axis in axes.values():
        axis.set_ylim(1e-17, 10.0 * SAME_MAP)
        axis.axhline(SAME_MAP, color=style.GREY, lw=0.9, ls=(0, (5, 3)), zorder=1)
        axis.annotate("rounding may reach this", (0.02, SAME_MAP), (0, 3), xycoords=axis.get_yaxis_transform(),
                      textcoords="offset points", fontsize=style.LEAST_TEXT, color="#444444")  # fmt: skip
    style.legend_below(figure, list(axes.values()))
    figure.legends[0].set_title(
        f"Both forms discretise first; one then eliminates {words.PHI} and {words.PSI}, the other never does. "
        f"{COMPARED_STEPS:,} steps over\neight nutations. Dashed: {style.number(SAME_MAP, 1)} rad, chosen beforehand: "
        "rounding in n steps adds up to n¹·⁵ ulp of a step's change."
    )
    style.headline(figure, words.unreduced_message(data, list(methods)))
    judged = ": one map, apart from rounding" if words.largest_gap(data) < SAME_MAP else ", which is more than rounding"
    return Picture(
        "twins",
        figure,
        "Reduced kernels, whose rule is discretised first and freed of phi and psi afterwards, against their unreduced "
        f"forms, which step the same rule and eliminate nothing: {COMPARED_STEPS} steps over eight nutations of "
        f"{' and '.join(axes)}, both in angles. Drawn is the largest difference so far in any angle; at the end it is "
        f"{words.largest_gap(data):.1e} rad at most{judged}. The figure before eliminates "
        f"first, which for most rules is another method. Dashed: {SAME_MAP:.0e} rad, a bound of rounding chosen "
        "beforehand: n^1.5 ulp of the change in a step, and more near a pole.",
        "Log-log plots of the largest difference of the angles against time, growing from 1e-16 to about 1e-12.",
    )


def draw_charts(data: xr.Dataset) -> Picture:
    """Time and error of a method in another chart, against the first that it has."""
    ratios = words.ratios(data)
    rows = list(dict.fromkeys(f"{method}[{ratio.chart}]" for _, method, ratio in ratios))
    markers = dict(zip(dict.fromkeys(scene for scene, _, _ in ratios), SCENE_MARKERS, strict=False))
    base = f"the chart {' or '.join(sorted({ratio.base for *_, ratio in ratios}))}"
    figure, (times, errors) = style.grid(2, 2, height=0.6 + 0.14 * len(rows), sharey=True)
    for scene, method, ratio in ratios:
        options = {"color": CHART_COLORS[ratio.chart], "ls": "none", "ms": 4, "marker": markers[scene]}
        options |= {"label": f"{ratio.chart} over {ratio.base}, scene {scene}", "fillstyle": style.FILLS[ratio.chart]}
        row = rows.index(f"{method}[{ratio.chart}]")
        times.plot(ratio.time, row, **options)
        errors.plot(ratio.error, row, **options)
    for axis, title in (
        (times, f"time of a run, over that in\n{base}"),
        (errors, f"error of the axis, over that in\n{base}"),
    ):
        axis.axvline(1.0, color=style.GREY, lw=0.9, zorder=1)
        axis.set(xscale="log", yticks=range(len(rows)), yticklabels=rows, ylim=(len(rows) - 0.5, -0.5))
        axis.set(xlabel=title, xlim=(min(0.9, axis.get_xlim()[0]), max(1.1, axis.get_xlim()[1])))
        axis.xaxis.set_major_locator(FixedLocator(RATIO_TICKS))
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_locator(NullLocator())
        axis.tick_params(axis="y", labelsize=style.LEAST_TEXT, length=0)
    style.legend_below(figure, (times, errors))
    spans = [ratio.time for *_, ratio in ratios]
    style.headline(figure, charts_message(spans, len({method for _, method, _ in ratios}), base))
    return Picture(
        "charts",
        figure,
        f"The same integrator at the same steps (adaptive: tolerances) in another chart, relative to {base}, on "
        f"{', '.join(markers)}: time of a run (median over the settings) and error of the axis (geometric mean over "
        f"the settings where both errors can be judged) after {CHART_PERIODS:g} nutations; logarithmic scales. The "
        f"other chart takes {min(spans):.2f} to {max(spans):.2f} times as long.",
        "Two dot plots, a row for each integrator, a colour for each chart: ratios of time and of error to the "
        "first chart.",
    )


def charts_message(spans: Sequence[float], methods: int, base: str) -> str:
    """In how many comparisons of two charts of one method the other one costs hardly more, as a title."""
    alike = sum(span <= AS_FAST for span in spans)
    rest = f", in the others up to {max(spans):.2g} times as long" if alike < len(spans) else ""
    return (
        f"In {alike} of {len(spans)} comparisons, of {methods} methods, another chart takes at most "
        f"{AS_FAST - 1.0:.0%} more time than {base}{rest}, at the same step or tolerance"
    )
