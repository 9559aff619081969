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


def draw_error(data: xr.DataTree) -> Picture:
    """Axis error of every row on the slow top, against its steps a nutation; each line is labelled at its end."""
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
            color=color(data, row),
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
        )
    axis.set(
        xscale="log", yscale="log", ylim=RANGE, xlim=(14.0, right), xlabel="steps a nutation",
        ylabel=f"largest axis error within {HORIZON:g} s (rad)",
    )  # fmt: skip
    wall = min(words.facts(data, row).best for row in words.without_term(data))
    axis.annotate(
        "no gyroscopic term: another top, at any step", (0.66, 2.1), xycoords=("axes fraction", "data"), fontsize=7.5,
        color=COLORS[0], ha="center",
    )  # fmt: skip
    name_ends(axis, {row: (*ends[row], color(data, row)) for row in late})
    low = min(known.best for known in floors.values())
    worse = sum(known.last > 1.5 * known.best for known in floors.values())
    style.headline(figure, f"Without a gyroscopic term no step helps: the axis is off by {style.number(wall)} rad or "
                           "more")  # fmt: skip
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
    figure, axes = style.panels(1, 2, height=0.135 * len(names) + 0.5, sharey=True)
    for axis, at in zip(axes[0], SCENES, strict=True):
        for place, row in enumerate(names):
            off = [max(words.level(data, row, rate, scene=at), RANGE[0]) for rate in FREQUENCIES]
            axis.plot(off, [place] * len(off), color=color(data, row), lw=1.0, zorder=2)
            for value, mark in zip(off, MARKS, strict=True):
                axis.plot(value, place, marker=mark, ms=4, color=color(data, row), mec="white", zorder=3)
        axis.set(xscale="log", xlim=RANGE, xlabel=f"largest axis error within {HORIZON:g} s (rad)", title=at)
        axis.set(yticks=range(len(names)), yticklabels=names, ylim=(-0.7, len(names) - 0.3))
    for rate, mark in zip(FREQUENCIES, MARKS, strict=True):
        axes[0, 0].plot([], [], marker=mark, ms=4, color=OURS, ls="", label=f"{rate:g} evaluations a second")
    axes[0, 0].legend(loc="lower left", frameon=False)
    for axis in axes.flat:
        axis.tick_params(axis="y", labelsize=style.LEAST_TEXT, length=0)
    style.few_ticks(*axes.flat, most=5)
    best, worst = (words.level(data, row, words.USUAL) for row in (names[-1], names[0]))
    style.headline(figure, f"At equal cost, {words.USUAL:g} evaluations a second, the axis is off by "
                           f"{style.number(best)} to {style.number(worst)} rad")  # fmt: skip
    caption = (
        f"Axis error within {HORIZON:g} s on two scenes, each row in the chart that it names, with the same number of "
        "evaluations of the torque: a method of four evaluations a step takes steps four times as long. "
        f"{SAID} Pi stands for a run that ended early."
    )
    return Picture("cost", figure, caption, "Dots, one line a row, of the axis error at three costs on two tops.")


def draw_shares(data: xr.DataTree) -> Picture:
    """The share of the population that each row follows to five degrees."""
    names = sorted(words.rows(data), key=lambda row: words.share(data, row))
    figure, axes = style.panels(1, 1, height=0.14 * len(names) + 0.4)
    axis: Any = axes[0, 0]
    values = np.array([words.share(data, row) for row in names])
    axis.barh(range(len(names)), values, height=0.66, color=[color(data, row) for row in names])
    for place, value in enumerate(values):
        axis.annotate(
            f"{value:.0%}", (value, place), (4, 0), textcoords="offset points", va="center", fontsize=style.LEAST_TEXT
        )
    axis.set(
        yticks=range(len(names)), yticklabels=names, xlim=(0.0, 1.08), ylim=(-0.7, len(names) - 0.3),
        xlabel=f"tops whose axis is within 5 degrees after {HORIZON:g} s",
    )  # fmt: skip
    axis.xaxis.set_major_formatter(lambda value, _: f"{100.0 * value:.0f} %")
    axis.grid(visible=False, axis="y")
    axis.tick_params(axis="y", labelsize=style.LEAST_TEXT, length=0)
    style.headline(figure, f"{int(np.sum(values < 0.5))} of {len(values)} maps follow less than half of the tops to "
                           "five degrees")  # fmt: skip
    count = data["population"].sizes["member"]
    caption = (
        f"The share of {count} random tops, no named scene, that each method[chart] follows to 5 degrees at a step of "
        f"1/{words.USUAL:g} of their unit of time, after {HORIZON:g} of them. Colours as in the figure of errors."
    )
    return Picture("population", figure, caption, "Bars, one a row, of the share of tops within five degrees.")
