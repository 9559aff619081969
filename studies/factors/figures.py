"""The figure of the factors study: the waterfall."""

from collections.abc import Iterator

import pandas as pd
import xarray as xr
from matplotlib.ticker import NullLocator

from symtop.report import style
from symtop.report.figures import rows
from symtop.report.formats import duration, number
from symtop.runner.study import Picture

from .facts import compared, first_goal, waterfall

COLORS = {"": style.GREY, "call": style.PURPLE, "chart": style.GREEN, "language": style.ORANGE, "method": style.BLUE}
TITLES = ("timed through simulate: the call is removed last", "solver timed alone: the call is removed first")


def pictures(data: xr.Dataset) -> Iterator[Picture]:
    """The waterfall, if it was timed."""
    part = first_goal(compared(data))
    orders = [bars for late in (False, True) if len(bars := waterfall(part, call_first=late))]
    if orders:
        yield draw_waterfall(orders)


def draw_waterfall(orders: list[pd.DataFrame]) -> Picture:
    """Time after each change, from SciPy as it is usually called to the fastest kernel, in two orders: dots."""
    figure, axes = style.panels(len(orders), 1, height=0.2 * max(map(len, orders)) + 0.7, sharex=True)
    for axis, title, bars in zip(axes[:, 0], TITLES, orders, strict=False):
        seconds = bars["time (s)"].to_numpy()
        names = []
        for place, bar in enumerate(bars.to_dict("records")):
            color, time = COLORS[bar["factor"]], seconds[place]
            if place:
                axis.plot([seconds[place - 1], time], [place, place], color=color, lw=2.0)
                axis.plot([seconds[place - 1]] * 2, [place - 1, place], color=style.GREY, lw=0.7, zorder=1)
            axis.plot(time, place, "o", color=color, ms=5.0, zorder=3)
            ratio = bar["times faster"]
            level = place and max(ratio, 1.0 / ratio) <= 1.0 + max(bars["spread"].iloc[place - 1 : place + 1])
            change = (
                "" if not place else "no change beyond noise, " if level
                else f"{number(max(ratio, 1.0 / ratio), 3)} times {'faster' if ratio > 1.0 else 'slower'}, "
            )  # fmt: skip
            axis.annotate(change + duration(time), (max(time, seconds[max(place - 1, 0)]), place), (7, 0),
                          textcoords="offset points", va="center", fontsize=style.LEAST_TEXT)  # fmt: skip
            names.append(
                f"{bar['factor']}: {bar['from']} to {bar['to']}" if place else f"{bar['variant']}, {bar['call']}"
            )
        axis.set(xscale="log", xlim=(0.3 * seconds.min(), 1e3 * seconds.max()), title=title)
        rows(axis, names)
        axis.xaxis.set_minor_locator(NullLocator())
    axes[-1, 0].set_xlabel("time of a run (s)")
    return Picture("waterfall", figure)
