"""Figures of the study of engines: axis error against steps a nutation, and at equal cost."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from symtop.model.scenes import scene
from symtop.report import style
from symtop.report.figures import name_ends, rows
from symtop.runner.study import Picture

from .facts import ROUNDING, SLOW, WORSE, curve, lines, read
from .measures import FREQUENCIES, HORIZON, SCENES

RANGE = (ROUNDING, 8.0)  # rad, of the errors against the steps
COLORS = {0.0: style.PURPLES[1], 1.0: style.ORANGES[1], 2.0: style.BLUE, 4.0: style.GREENS[2]}  # dark, for labels
PAPER = {"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none"}  # behind letters on a line
OURS = style.BLACK
MARKS = ("o", "s", "^")  # of `FREQUENCIES`
APART = (-0.22, 0.0, 0.22)  # of a line, their heights
DASHES = (0, (4, 2))
ERROR = f"largest axis error within {HORIZON:g} s (rad)"


def pictures(data: xr.DataTree) -> Iterator[Picture]:
    """The figures of errors against steps and at the same cost, if these were measured."""
    known = lines(data)
    colors = {row["variant"]: color(row) for _, row in known.iterrows()}
    if known["best"].notna().any():
        yield draw_error(data, known[known["best"].notna()], colors)
    if known[["slow_level", "fast_level"]].notna().any(axis=None):
        yield draw_cost(data, known, colors)


def color(row: pd.Series) -> str:
    """By the order of the map; black for the catalogue's methods."""
    return COLORS[min(COLORS, key=lambda known: abs(known - row["group"]))] if row["engine"] else OURS


def key(figure: Any, shades: Iterable[str]) -> None:
    """The legend of the colours in a figure, below it."""
    labels = ["no gyroscopic term", *(f"order {order:g}" for order in COLORS if order), "no engine, for comparison"]
    for label, shade in zip(labels, [*COLORS.values(), OURS], strict=True):
        if shade in shades:
            figure.axes[0].plot([], [], "s", color=shade, ms=6, label=label)
    style.legend_below(figure, figure.axes)


def draw_error(data: xr.DataTree, known: pd.DataFrame, colors: dict[str, str]) -> Picture:
    """Axis error of every variant on the slow top, against its steps a nutation; each line is labelled at its end."""
    figure, axes = style.panels(1, 1, height=5.6)
    axis, ends = axes[0, 0], {}
    right = max(curve(data, name)[0][-1] for name in known.index)
    for name, row in known.iterrows():
        count, error = curve(data, name)
        shown = error >= RANGE[0]
        axis.plot(count[shown], error[shown], color=colors[name], ls=DASHES if row["single"] else "-",
                  lw=1.0 if row["engine"] else 1.6, zorder=3)  # fmt: skip
        if shown.any():
            ends[name] = float(count[shown][-1]), float(error[shown][-1]), colors[name]
        if row["single"] and row["term"] and row["last"] > WORSE * row["best"]:
            axis.plot(row["best_count"], row["best"], marker="v", ms=5, color=colors[name], mec="white", zorder=4)
    early = sorted((count, name) for name, (count, _, _) in ends.items() if count < right)  # that reach rounding
    for place, (_, name) in enumerate(early):  # right of its line; left if another one ends near it on the right
        side, shift = ("right", -6) if 0 < place < len(early) - 1 else ("left", 6)
        axis.annotate(name, ends.pop(name)[:2], (shift, 0), textcoords="offset points", va="center", ha=side,
                      fontsize=style.LEAST_TEXT, color=colors[name], bbox=PAPER)  # fmt: skip
    for rate in FREQUENCIES:
        place = rate * scene(SLOW).nutation_period
        axis.axvline(place, color=style.GREY, lw=0.9, ls=(0, (5, 3)), zorder=1)
        axis.annotate(f"1/{rate:g} s", (place, RANGE[0] * 1.6), (3, 0), textcoords="offset points",
                      fontsize=style.LEAST_TEXT, bbox=PAPER)  # fmt: skip
    axis.set(xscale="log", yscale="log", ylim=RANGE, xlim=(14.0, right), xlabel="steps a nutation", ylabel=ERROR)
    if known["single"].any():
        axis.plot([], [], color="#444444", lw=1.0, ls=DASHES, label="single precision")
        axis.plot([], [], "v", color="#444444", ms=5, mec="white", label="its best step")
    key(figure, {colors[name] for name in known.index})
    name_ends(axis, ends)
    return Picture("error", figure)


def draw_cost(data: xr.DataTree, known: pd.DataFrame, colors: dict[str, str]) -> Picture:
    """Axis errors at as many evaluations of the torque a second: a line a variant, a panel a scene."""
    scenes = [name for name in SCENES if np.isfinite(read(data, "tops", "level_axis", scene=name)).any()]
    names = list(known.sort_values(["slow_level", "fast_level"], kind="stable").index)
    figure, axes = style.panels(1, len(scenes), height=0.15 * len(names) + 0.9, sharex=True, sharey=True)
    for axis, top in zip(axes[0], scenes, strict=True):
        for place, name in enumerate(names):
            off = read(data, "tops", "level_axis", scene=top, variant=name, rate=list(FREQUENCIES), horizon=HORIZON)
            heights = [place + shift for shift in APART]  # so that none covers another one of the same error
            axis.plot(off, heights, color=colors[name], lw=0.9, zorder=2)
            for value, height, mark in zip(off, heights, MARKS, strict=True):
                axis.plot(value, height, marker=mark, ms=3.6, color=colors[name], mec="white", mew=0.3, zorder=3)
        axis.axvline(np.pi, color=style.GREY, lw=0.9, ls=(0, (1, 2)), zorder=1)
        axis.set(xscale="log", xlabel=ERROR, title=f"scene {top}")
        rows(axis, names)
    for rate, mark in zip(FREQUENCIES, MARKS, strict=True):
        axes[0, 0].plot([], [], marker=mark, ms=4, color=OURS, ls="", label=f"{rate:g} evaluations a second")
    axes[0, 0].plot([], [], color=style.GREY, lw=0.9, ls=(0, (1, 2)), label="π: the most, or a run that ended early")
    style.few_ticks(*axes.flat, most=5)
    key(figure, {colors[name] for name in names})
    return Picture("cost", figure)
