"""Figures of the study of engines: axis error against steps a nutation and at equal cost, shares of the population."""

import math
from typing import Any

import numpy as np
import xarray as xr

from symtop.model.scenes import scene
from symtop.report import style
from symtop.runner.study import Picture

from . import words
from .tables import FREQUENCIES, HORIZON, SCENES

GAP = 0.029  # between labels, of the height of the panel
RANGE = (1e-12, 8.0)  # rad
COLORS = {0: style.PURPLES[1], 1: style.ORANGES[1], 2: style.BLUE, 4: style.GREENS[2]}  # dark enough for a label
SAID = "Colour is the measured order: purple 0, ochre 1, blue 2, green 4; black are methods of the catalogue."
OURS = style.BLACK
MARKS = ("o", "s", "^")  # of `FREQUENCIES`


def pictures(data: xr.DataTree) -> list[Picture]:
    """The figure that is quoted, the same cost, and the population."""
    return [draw_error(data), draw_cost(data), draw_shares(data)]


def color(data: xr.DataTree, row: str) -> str:
    """By measured order; black for the catalogue's methods."""
    if words.of_catalogue(row):
        return OURS
    order = words.facts(data, row).order if not words.single(row) else 1.0
    return COLORS[0 if row in words.without_term(data) else min(COLORS, key=lambda known: abs(known - order))]


def spread(places: list[float], gap: float) -> list[float]:
    """Places in [0, 1] that keep their order and a distance; labels that would meet share the mean of their places."""
    order = sorted(range(len(places)), key=lambda k: places[k])
    blocks: list[tuple[float, int]] = []  # centre and number of labels
    for k in order:
        centre, count = places[k], 1
        while True:
            reach = 0.5 * gap * count
            centre = min(max(centre, reach - 0.5 * gap), 1.0 - reach + 0.5 * gap)
            if not blocks or blocks[-1][0] + 0.5 * gap * blocks[-1][1] <= centre - reach + 1e-12:
                break
            before, others = blocks.pop()
            centre, count = (before * others + centre * count) / (others + count), others + count
        blocks.append((centre, count))
    moved = [centre + gap * (k - 0.5 * (count - 1)) for centre, count in blocks for k in range(count)]
    placed = [0.0] * len(places)
    for k, value in zip(order, moved, strict=True):
        placed[k] = value
    return placed


def _height(error: float) -> float:
    low, high = map(math.log, RANGE)
    return (math.log(max(error, RANGE[0])) - low) / (high - low)


def draw_error(data: xr.DataTree) -> Picture:
    """Axis error of every row on the slow top, against its steps a nutation; each line is labelled at its end."""
    figure, axes = style.panels(1, 1, width=11.5, height=7.4)
    axis, names = axes[0, 0], words.rows(data)
    curves = {row: words.curve(data, row) for row in names}
    right = max(count[-1] for count, _ in curves.values())
    for row, (count, error) in curves.items():
        shown = error >= RANGE[0]
        dash = (0, (4, 2)) if words.single(row) else "-"
        width = 2.2 if words.of_catalogue(row) else 1.4
        axis.plot(count[shown], error[shown], color=color(data, row), ls=dash, lw=width, zorder=3)
    ends = {row: (count[error >= RANGE[0]][-1], error[error >= RANGE[0]][-1]) for row, (count, error) in curves.items()}
    early = [row for row, (count, _) in ends.items() if count < right]  # that reach rounding
    late = [row for row in names if row not in early]
    for row, place in zip(late, spread([_height(ends[row][1]) for row in late], GAP), strict=True):
        axis.annotate(
            row, ends[row], (1.03, place), textcoords="axes fraction", va="center", fontsize=9, color=color(data, row),
            arrowprops={"arrowstyle": "-", "color": color(data, row), "lw": 0.6, "shrinkA": 0, "shrinkB": 1,
                        "relpos": (0.0, 0.5)},
            annotation_clip=False,
        )  # fmt: skip
    last = max((ends[row][0] for row in early), default=right)
    for row in early:  # at the right of its line, or at the left if another one ends further right
        side, shift = ("right", -6) if 100.0 < ends[row][0] < last else ("left", 6)
        axis.annotate(
            row, ends[row], (shift, 0), textcoords="offset points", va="center", ha=side, fontsize=9,
            color=color(data, row),
        )  # fmt: skip
    floors = {row: words.facts(data, row) for row in names if words.single(row) and row not in words.without_term(data)}
    for row, known in floors.items():
        axis.plot(known.best_count, known.best, marker="v", ms=7, color=color(data, row), mec="white", zorder=4)
    dashed = {"color": COLORS[1], "ls": (0, (4, 2))}
    axis.plot([], [], marker="v", ms=7, mec="white", label="single precision and its best step", **dashed)
    axis.legend(loc="lower right", frameon=False)
    period = scene(words.SLOW).nutation_period
    for rate in FREQUENCIES:
        axis.axvline(rate * period, color=style.GREY, lw=0.9, ls=(0, (5, 3)), zorder=1)
        axis.annotate(f"1/{rate:g} s", (rate * period, RANGE[0] * 1.6), (3, 0), textcoords="offset points", fontsize=9)
    axis.set(
        xscale="log", yscale="log", ylim=RANGE, xlim=(14.0, right), xlabel="steps a nutation",
        ylabel=f"largest axis error within {HORIZON:g} s (rad)",
    )  # fmt: skip
    wall = min(words.facts(data, row).best for row in words.without_term(data))
    axis.annotate(
        "no gyroscopic term: another top, at any step", (0.72, 2.1), xycoords=("axes fraction", "data"), fontsize=9.5,
        color=COLORS[0], ha="center",
    )  # fmt: skip
    low = min(known.best for known in floors.values())
    worse = sum(known.last > 1.5 * known.best for known in floors.values())
    caption = (
        f"Axis error on {words.SLOW} against the steps a nutation; method[chart] at each line. {SAID} Without a "
        f"gyroscopic term the error is {wall:.3g} rad or more at any step. Dashed: single precision, where a triangle "
        f"marks the best step; with a gyroscopic term none is below {low:.1e} rad, and of these {len(floors)} rows "
        f"{worse} are worse at the most steps than at fewer. Vertical lines: the steps that people use. One body with "
        "a fixed centre, no contacts or joints."
    )
    return Picture("error", figure, caption, "Log-log plot of axis error against steps, one labelled line a map.")


def draw_cost(data: xr.DataTree) -> Picture:
    """Axis errors at as many evaluations of the torque a second: a line a row, a panel a scene."""
    names = sorted(words.rows(data), key=lambda row: words.level(data, row, words.USUAL), reverse=True)
    figure, axes = style.panels(1, 2, width=11.5, height=0.23 * len(names) + 0.9, sharey=True)
    for axis, at in zip(axes[0], SCENES, strict=True):
        for place, row in enumerate(names):
            off = [max(words.level(data, row, rate, scene=at), RANGE[0]) for rate in FREQUENCIES]
            axis.plot(off, [place] * len(off), color=color(data, row), lw=1.0, zorder=2)
            for value, mark in zip(off, MARKS, strict=True):
                axis.plot(value, place, marker=mark, ms=6, color=color(data, row), mec="white", zorder=3)
        axis.set(xscale="log", xlim=RANGE, xlabel=f"largest axis error within {HORIZON:g} s (rad)", title=at)
        axis.set(yticks=range(len(names)), yticklabels=names, ylim=(-0.7, len(names) - 0.3))
    for rate, mark in zip(FREQUENCIES, MARKS, strict=True):
        axes[0, 0].plot([], [], marker=mark, ms=6, color=OURS, ls="", label=f"{rate:g} evaluations a second")
    axes[0, 0].legend(loc="lower left", frameon=False)
    caption = (
        f"Axis error within {HORIZON:g} s on two scenes, each row in the chart that it names, with the same number of "
        "evaluations of the torque: a method of four evaluations a step takes steps four times as long. "
        f"{SAID} Pi stands for a run that ended early."
    )
    return Picture("cost", figure, caption, "Dots, one line a row, of the axis error at three costs on two tops.")


def draw_shares(data: xr.DataTree) -> Picture:
    """The share of the population that each row follows to five degrees."""
    names = sorted(words.rows(data), key=lambda row: words.share(data, row))
    figure, axes = style.panels(1, 1, width=9.6, height=0.23 * len(names) + 0.6)
    axis: Any = axes[0, 0]
    values = np.array([words.share(data, row) for row in names])
    axis.barh(range(len(names)), values, height=0.66, color=[color(data, row) for row in names])
    for place, value in enumerate(values):
        axis.annotate(f"{value:.0%}", (value, place), (4, 0), textcoords="offset points", va="center", fontsize=9)
    axis.set(
        yticks=range(len(names)), yticklabels=names, xlim=(0.0, 1.08), ylim=(-0.7, len(names) - 0.3),
        xlabel=f"tops whose axis is within 5 degrees after {HORIZON:g} s",
    )  # fmt: skip
    axis.xaxis.set_major_formatter(lambda value, _: f"{100.0 * value:.0f} %")
    axis.grid(visible=False, axis="y")
    count = data["population"].sizes["member"]
    caption = (
        f"The share of {count} random tops, no named scene, that each method[chart] follows to 5 degrees at a step of "
        f"1/{words.USUAL:g} of their unit of time, after {HORIZON:g} of them. Colours as in the figure of errors."
    )
    return Picture("population", figure, caption, "Bars, one a row, of the share of tops within five degrees.")
