"""Figures of the factors study: the waterfall, and what a chart costs each method at equal accuracy."""

from collections.abc import Iterator

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.ticker import LogLocator, NullLocator

from symtop.report import style
from symtop.report.formats import duration, number
from symtop.runner.study import Picture

from .cells import COMPILED, FAMILIES, cells
from .facts import CHARTS, charts, compared, first_goal, waterfall

COLORS = {"": style.GREY, "call": style.PURPLE, "chart": style.GREEN, "language": style.ORANGE, "method": style.BLUE}
TITLES = ("timed through simulate: the call is removed last", "solver timed alone: the call is removed first")
BESIDE = dict(zip(CHARTS, ("in Euler angles", "with the whole attitude (quaternion)"), strict=True))
DODGE = 0.2  # of a row's height, so that near dots are all seen


def pictures(data: xr.Dataset) -> Iterator[Picture]:
    """The waterfall, if it was timed, and the charts."""
    frame = compared(data)
    part = first_goal(frame)
    orders = [bars for late in (False, True) if len(bars := waterfall(part, call_first=late))]
    if orders:
        yield draw_waterfall(orders)
    if len(ratios := charts(frame)):
        yield draw_charts(ratios)


def draw_waterfall(orders: list[pd.DataFrame]) -> Picture:
    """Time after each change, from SciPy as it is usually called to the fastest kernel, in two orders: dots."""
    figure, axes = style.panels(len(orders), 1, height=0.2 * max(map(len, orders)) + 0.7, sharex=True)
    for axis, title, bars in zip(axes[:, 0], TITLES, orders, strict=False):
        seconds = bars["time (s)"].to_numpy()
        names = []
        for place, bar in enumerate(bars.to_dict("records")):
            color, now = COLORS[bar["factor"]], seconds[place]
            if place:
                axis.plot([seconds[place - 1], now], [place, place], color=color, lw=2.0)
                axis.plot([seconds[place - 1]] * 2, [place - 1, place], color=style.GREY, lw=0.7, zorder=1)
            axis.plot(now, place, "o", color=color, ms=5.0, zorder=3)
            ratio = bar["times faster"]
            level = place and max(ratio, 1.0 / ratio) <= 1.0 + max(bars["spread"].iloc[place - 1 : place + 1])
            change = (
                "" if not place else "no change beyond noise, " if level
                else f"{number(max(ratio, 1.0 / ratio), 3)} times {'faster' if ratio > 1.0 else 'slower'}, "
            )  # fmt: skip
            axis.annotate(change + duration(now), (max(now, seconds[max(place - 1, 0)]), place), (7, 0),
                          textcoords="offset points", va="center", fontsize=style.LEAST_TEXT)  # fmt: skip
            names.append(
                f"{bar['factor']}: {bar['from']} to {bar['to']}" if place else f"{bar['variant']}, {bar['call']}"
            )
        axis.set(xscale="log", xlim=(0.3 * seconds.min(), 1e3 * seconds.max()), ylim=(len(bars) - 0.4, -0.6))
        axis.set_yticks(range(len(bars)), names, fontsize=style.LEAST_TEXT)
        axis.set_title(title)
        axis.grid(visible=False, axis="y")
        axis.xaxis.set_minor_locator(NullLocator())
    axes[-1, 0].set_xlabel("time of a run (s)")
    return Picture("waterfall", figure)


def draw_charts(ratios: pd.DataFrame) -> Picture:
    """Time of a run in each larger chart over that on the axis, at equal error: a dot a pair, a row a method."""
    known = {cell.key for cell in cells()}
    drawn = set(ratios["method"])
    places = {one: place for place, one in enumerate(one for part in FAMILIES.values() for one in part if one in drawn)}
    figure, axes = style.panels(1, len(CHARTS), height=0.5 + 0.2 * len(places), sharex=True, sharey=True)
    for axis, (chart, title) in zip(axes[0], BESIDE.items(), strict=True):
        axis.axvline(1.0, color="#444444", lw=0.9, zorder=1)
        for scheme, place in places.items():
            values = np.sort(ratios[f"{chart} / axis"][ratios["method"] == scheme].dropna())
            heights = place + DODGE * (np.arange(len(values)) % 3 - 1.0)  # neighbours are level with each other
            color = style.GREEN if scheme in FAMILIES["splitting"] else "#777777"
            axis.plot(values, heights, "o", color=color, ms=4.0, mew=0.4, mec="white")
            if not len(values):
                why = "over the budget" if (scheme, chart, COMPILED) in known else "not in this chart"
                axis.annotate(why, (1.0, place), (5, 0), textcoords="offset points", va="center", color="#666666",
                              fontsize=style.LEAST_TEXT)  # fmt: skip
        axis.set(xscale="log", xlabel="time of a run / its time on the axis alone", title=title)
        axis.grid(visible=False, axis="y")
        axis.tick_params(axis="y", length=0)
    low, high = axes[0, 0].get_xlim()
    axes[0, 0].set(xlim=(min(low, 0.7), max(high, 1.5)), ylim=(len(places) - 0.4, -0.6))
    axes[0, 0].set_yticks(range(len(places)), list(places))
    for axis in axes[0]:
        axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0)))
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_locator(NullLocator())
    axes[0, 0].plot([], [], "o", color=style.GREEN, ms=4.0, label="splitting: one top, run length and error a dot")
    axes[0, 0].plot([], [], "o", color="#777777", ms=4.0, label="other methods")
    style.legend_below(figure, axes)
    return Picture("charts", figure)
