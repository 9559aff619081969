"""Figures of the study of engines: axis error against steps a nutation and at equal cost, shares of the population."""

from typing import Any

import numpy as np
import xarray as xr

from symtop.model.scenes import scene
from symtop.report import style
from symtop.report.figures import name_ends
from symtop.runner.study import Picture

from . import words
from .tables import FREQUENCIES, HORIZON, SCENES

RANGE = (1e-12, 8.0)  # rad, of the errors against the steps
KEY = {  # what the colours mean, in the figures themselves
    "order 0: no gyroscopic term": style.PURPLES[1], "order 1": style.ORANGES[1], "order 2": style.BLUE,
    "order 4": style.GREENS[2], "no engine, for comparison": style.BLACK,
}  # fmt: skip
PAPER = {"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none"}  # behind letters on a line
COLORS = {0: style.PURPLES[1], 1: style.ORANGES[1], 2: style.BLUE, 4: style.GREENS[2]}  # dark enough for a label
SAID = "Colour is the measured order: purple 0, ochre 1, blue 2, green 4; black are methods of the catalogue."
OURS = style.BLACK
MARKS = ("o", "s", "^")  # of `FREQUENCIES`
APART = (0.22, 0.0, -0.22)  # of a line, their heights


def pictures(data: xr.DataTree) -> list[Picture]:
    """The figure that is quoted, the same cost, and the population."""
    return [draw_error(data), draw_cost(data), draw_shares(data)]


def color(data: xr.DataTree, variant: str) -> str:
    """By measured order; black for the catalogue's methods."""
    if words.of_catalogue(variant):
        return OURS
    order = words.facts(data, variant).order if not words.single(variant) else 1.0
    return COLORS[0 if variant in words.without_term(data) else min(COLORS, key=lambda known: abs(known - order))]


def key(figure: Any) -> None:
    """The colours and the marks of a figure, below it."""
    axis = figure.axes[0]
    for words_of, shade in KEY.items():
        axis.plot([], [], "s", color=shade, ms=6, label=words_of)
    style.legend_below(figure, figure.axes)


def draw_error(data: xr.DataTree) -> Picture:
    """Axis error of every variant on the slow top, against its steps a nutation; each line is labelled at its end."""
    figure, axes = style.panels(1, 1, height=5.6)
    axis, names = axes[0, 0], words.rows(data)
    curves = {row: words.curve(data, row) for row in names}
    right = max(count[-1] for count, _ in curves.values())
    for row, (count, error) in curves.items():
        shown = error >= RANGE[0]
        dash = (0, (4, 2)) if words.single(row) else "-"
        width = 1.6 if words.of_catalogue(row) else 1.0
        axis.plot(count[shown], error[shown], color=color(data, row), ls=dash, lw=width, zorder=3)
    ends = {row: (count[error >= RANGE[0]][-1], error[error >= RANGE[0]][-1]) for row, (count, error) in curves.items()}
    early = [row for row, (count, _) in ends.items() if count < right]  # that reach rounding
    late = [row for row in names if row not in early]
    last = max((ends[row][0] for row in early), default=right)
    for row in early:  # at the right of its line, or at the left if another one ends further right
        side, shift = ("right", -6) if 100.0 < ends[row][0] < last else ("left", 6)
        axis.annotate(
            row, ends[row], (shift, 0), textcoords="offset points", va="center", ha=side, fontsize=style.LEAST_TEXT,
            color=color(data, row), bbox=PAPER,
        )  # fmt: skip
    floors = {row: words.facts(data, row) for row in names if words.single(row) and row not in words.without_term(data)}
    for row, known in floors.items():
        axis.plot(known.best_count, known.best, marker="v", ms=5, color=color(data, row), mec="white", zorder=4)
    period = scene(words.SLOW).nutation_period
    for rate in FREQUENCIES:
        axis.axvline(rate * period, color=style.GREY, lw=0.9, ls=(0, (5, 3)), zorder=1)
        axis.annotate(
            f"1/{rate:g} s",
            (rate * period, RANGE[0] * 1.6),
            (3, 0),
            textcoords="offset points",
            fontsize=style.LEAST_TEXT,
            bbox=PAPER,
        )
    axis.set(
        xscale="log", yscale="log", ylim=RANGE, xlim=(14.0, right), xlabel="steps a nutation",
        ylabel=f"largest axis error within {HORIZON:g} s (rad)",
    )  # fmt: skip
    wall = min(words.facts(data, row).best for row in words.without_term(data))
    axis.annotate(
        "no gyroscopic term: another top, at any step", (0.66, 2.1), xycoords=("axes fraction", "data"), fontsize=7.5,
        color=COLORS[0], ha="center", bbox=PAPER,
    )  # fmt: skip
    axis.plot([], [], color="#444444", lw=1.0, ls=(0, (4, 2)), label="dashed: single precision")
    if floors:
        axis.plot([], [], "v", color="#444444", ms=5, mec="white", label="its best step")
    key(figure)
    name_ends(axis, {row: (*ends[row], color(data, row)) for row in late})
    low = min(known.best for known in floors.values())
    worse = sum(known.last > 1.5 * known.best for known in floors.values())
    style.headline(figure, f"Without a gyroscopic term no step helps: on scene {words.SLOW} the axis is off by "
                           f"{style.number(wall)}{style.FIRM}rad or more")  # fmt: skip
    caption = (
        f"Axis error on {words.SLOW} against the steps a nutation; method[chart] at each line. {SAID} Without a "
        f"gyroscopic term the error is {wall:.3g} rad or more at any step. Dashed: single precision, where a triangle "
        f"marks the best step; with a gyroscopic term none is below {low:.1e} rad, and of these {len(floors)} variants "
        f"{worse} are worse at the most steps than at fewer. Vertical lines: the steps that people use. One body with "
        "a fixed centre, no contacts or joints."
    )
    return Picture("error", figure, caption, "Log-log plot of axis error against steps, one labelled line a map.")


def draw_cost(data: xr.DataTree) -> Picture:
    """Axis errors at as many evaluations of the torque a second: a line a variant, a panel a scene."""
    names = sorted(words.rows(data), key=lambda row: words.level(data, row, words.USUAL), reverse=True)
    figure, axes = style.panels(1, 2, height=0.15 * len(names) + 0.9, sharex=True, sharey=True)
    for axis, at in zip(axes[0], SCENES, strict=True):
        for place, row in enumerate(names):
            off = [words.level(data, row, rate, scene=at) for rate in FREQUENCIES]
            heights = [place + shift for shift in APART]  # so that none covers another one of the same error
            axis.plot(off, heights, color=color(data, row), lw=0.9, zorder=2)
            for value, height, mark in zip(off, heights, MARKS, strict=True):
                axis.plot(value, height, marker=mark, ms=3.6, color=color(data, row), mec="white", mew=0.3, zorder=3)
        axis.axvline(np.pi, color=style.GREY, lw=0.9, ls=(0, (1, 2)), zorder=1)
        axis.set(xscale="log", xlabel=f"largest axis error within {HORIZON:g} s (rad)", title=f"scene {at}")
        axis.set(yticks=range(len(names)), yticklabels=names, ylim=(-0.7, len(names) - 0.3))
    for rate, mark in zip(FREQUENCIES, MARKS, strict=True):
        axes[0, 0].plot([], [], marker=mark, ms=4, color=OURS, ls="", label=f"{rate:g} evaluations a second")
    axes[0, 0].plot([], [], color=style.GREY, lw=0.9, ls=(0, (1, 2)), label="π: the most, or a run that ended early")
    for axis in axes.flat:
        axis.tick_params(axis="y", labelsize=style.LEAST_TEXT, length=0)
    style.few_ticks(*axes.flat, most=5)
    key(figure)
    best, worst = (words.level(data, row, words.USUAL) for row in (names[-1], names[0]))
    style.headline(figure, f"At equal cost, {words.USUAL:g} evaluations a second, {names[-1]} is off by "
                           f"{style.number(best)}{style.FIRM}rad on scene {words.SLOW}, {names[0]} by "
                           f"{style.number(worst)}{style.FIRM}rad")  # fmt: skip
    caption = (
        f"Axis error within {HORIZON:g} s on two scenes, each variant in the chart that it names, with the same "
        "number of evaluations of the torque: a method of four evaluations a step takes steps four times as long. "
        f"Sorted by the error on {words.SLOW} at {words.USUAL:g} a second. {SAID} Pi marks a run that ended early."
    )
    return Picture("cost", figure, caption, "Dots, one line a variant, of the axis error at three costs on two tops.")


def draw_shares(data: xr.DataTree) -> Picture:
    """The share of the population that each variant follows to five degrees."""
    names = sorted(words.rows(data), key=lambda row: words.share(data, row))
    figure, axes = style.panels(1, 1, height=0.14 * len(names) + 0.4)
    axis: Any = axes[0, 0]
    values = np.array([words.share(data, row) for row in names])
    axis.barh(range(len(names)), values, height=0.66, color=[color(data, row) for row in names])
    for place, value in enumerate(values):
        axis.annotate(
            f"{value:.0%}", (value, place), (4, 0), textcoords="offset points", va="center", bbox=PAPER,
            fontsize=style.LEAST_TEXT,
        )  # fmt: skip
    axis.set(
        yticks=range(len(names)), yticklabels=names, xlim=(0.0, 1.08), ylim=(-0.7, len(names) - 0.3),
        xlabel=f"tops whose axis is within 5 degrees after {HORIZON:g} units of time, at a step of 1/{words.USUAL:g}",
    )  # fmt: skip
    axis.xaxis.set_major_formatter(lambda value, _: f"{100.0 * value:.0f} %")
    axis.grid(visible=False, axis="y")
    axis.tick_params(axis="y", labelsize=style.LEAST_TEXT, length=0)
    key(figure)
    count = data["population"].sizes["member"]
    engines = [value for row, value in zip(names, values, strict=True) if not words.of_catalogue(row)]
    style.headline(figure, f"Methods of engines follow {min(engines):.0%} to {max(engines):.0%} of {count} random tops "
                           f"to 5 degrees, {names[-1]} {values[-1]:.0%}")  # fmt: skip
    caption = (
        f"The share of {count} random tops, no named scene, that each method[chart] follows to 5 degrees at a step of "
        f"1/{words.USUAL:g} of their unit of time, after {HORIZON:g} of them. Colours as in the figure of errors."
    )
    return Picture("population", figure, caption, "Bars, one a row, of the share of tops within five degrees.")
