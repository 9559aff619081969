"""Two pictures of who is the fastest: the winner of every cell, and how sure and how slow every variant is."""

import textwrap
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.measure import ranking
from symtop.measure.work import TARGETS
from symtop.methods.framework.registry import split_name
from symtop.report.sentences import joined
from symtop.report.style import GREY, LEAST_TEXT, headline, look, number, panels
from symtop.runner.study import Picture

from . import words

POWERS = [f"$10^{{{np.log10(target):.0f}}}$" for target in TARGETS]
LEVEL = 1.05  # times the least time: no more than it


def winners(data: xr.Dataset) -> Picture:
    """One line a scene, one column a target, one panel a horizon: the fastest variant's colour and name."""
    from matplotlib.colors import to_rgb

    scenes = [str(name) for name in data["scene"].values]
    wins = ranking.winners(data)
    figure, axes = panels(1, data.sizes["horizon"], height=0.75 + 0.42 * len(scenes), sharey=True)
    for line, scene in enumerate(scenes):
        for far, axis in enumerate(axes[0]):
            for column, target in enumerate(TARGETS):
                won = wins.get((scene, far, target))
                box = ([column - 0.49, column + 0.49], line - 0.46, line + 0.46)
                color, label = "#444444", "narrower\nnutation"
                if won is not None:
                    method, chart = split_name(won.best.integrator)
                    strength = 0.35 if won.level else 0.95
                    shade = strength * np.array(to_rgb(look(method).color)) + (1.0 - strength)
                    axis.fill_between(*box, color=shade, lw=0)
                    color = "white" if shade @ np.array([0.3, 0.59, 0.11]) < 0.55 else "black"
                    row = method if chart == "axis" else won.best.integrator
                    label = "\n".join(textwrap.wrap(f"{'~' if won.level else ''}{row}", 12))
                elif (scene, far, target) in wins:
                    cell = data.sel(scene=scene).isel(horizon=far)
                    label = f"none\n{words.reasons(cell, target).split(',')[0]}"
                    axis.fill_between(*box, facecolor="none", edgecolor=GREY, hatch="//", lw=0)
                axis.text(column, line, label, ha="center", va="center", fontsize=7.0, color=color, linespacing=0.95)
    for axis, span in zip(axes[0], words.spans(data), strict=True):
        axis.set(
            xlim=(-0.5, len(TARGETS) - 0.5), ylim=(len(scenes) - 0.5, -0.5), yticks=range(len(scenes)),
            yticklabels=scenes, xticks=range(len(TARGETS)), title=f"fastest {span}", xticklabels=POWERS,
            xlabel="largest axis error allowed (rad)",
        )  # fmt: skip
        axis.grid(visible=False)
        axis.tick_params(length=0)
    figure.supxlabel(
        "In a cell: the method (on the axis e and L if it names no chart) that is the fastest. Pale, ~: its lead over\n"
        "another is within the noise. Narrower nutation: the motion is smaller than the error.",
        fontsize=7.5, ha="left", x=0.01,
    )  # fmt: skip
    met = [won for won in wins.values() if won]
    ranks = Counter(won.best.integrator for won in met).most_common(4)
    most = joined([f"{name} ({times})" for name, times in ranks])
    if ranks:
        first, times = ranks[0]
        others = len({won.best.integrator for won in met}) - 1
        close = sum(bool(won.level) for won in met if won.best.integrator == first)
        noise = f", {close} of them within the noise" if close else ""
        rest = f", {others} other{'s' * (others > 1)} in the rest" if others else ""
        headline(figure, f"{first} is the fastest in {times} of {len(met)} cells{noise}{rest}")
    return Picture(
        "winners",
        figure,
        "The fastest compiled variant on each scene for each axis error, each variant at the coarsest step or "
        f"tolerance found that meets the error. Most of the {len(met)} cells belong to {most}.{words.not_asked(data)} "
        "Pale and with a tilde: its lead over at least one other variant is within the noise. All times are measured; "
        f"the closed form is not ranked. {_taking_part(data)}",
        "Coloured cells naming the fastest variant, a line a scene, a column an accuracy.",
    )


def _taking_part(data: xr.Dataset) -> str:
    """How many variants were compared, and that another study compares fewer."""
    ranked = ranking.ranked(data)
    rows = [row for row in words.of_implementation(data, "compiled") if row in ranked]
    more = [row for row in ("taylor-longdouble[axis]", "taylor-quad[axis]") if row in rows]
    beside = f", {' and '.join(more)} among them, which the study phase_diagram leaves out" if more else ""
    return f"{len(rows)} variants take part{beside}."


class Middle(NamedTuple):
    """How one variant fares over all targets that some variant meets."""

    name: str
    met: int
    ratio: float  # median time over the fastest variant's, a target that is not met counting as infinite


def middles(merged: xr.DataArray) -> tuple[int, list[Middle]]:
    """How many targets some variant meets, each one's share of them and median slowdown, in the order of `merged`."""
    table = merged.transpose("variant", ...).values.reshape(merged.sizes["variant"], -1)
    table = table[:, np.isfinite(table).any(axis=0)]
    ratios = np.median(np.where(np.isfinite(table), table, np.inf), axis=1)
    met, names = np.isfinite(table).sum(axis=1), map(str, merged["variant"].values)
    return table.shape[1], [Middle(name, int(n), float(r)) for name, n, r in zip(names, met, ratios, strict=True)]


def slowdown(data: xr.Dataset) -> Picture:
    """How many targets every compiled variant meets, and its median time over the fastest one's."""
    compiled = words.of_implementation(data, "compiled")
    names = [name for name in ranking.ranked(data) if name in compiled]
    costs = [ranking.relative_costs(data.isel(horizon=[far]), names) for far in range(data.sizes["horizon"])]
    merged = xr.concat(costs, "problem").sel(variant=names)
    order = ranking.leaders(merged, len(names))
    asked, rows = middles(merged.sel(variant=order))
    shown = [row for row in rows if np.isfinite(row.ratio)]
    told = _told(rows)
    figure, axes = panels(1, 2, height=0.9 + 0.135 * len(shown), sharey=True)
    for place, row in enumerate(shown):
        named = row in told
        color, said = look(row.name).color if named else "#C4C4C4", {"weight": "bold" if named else "normal"}
        axes[0, 0].barh(place, row.met, height=0.7, color=color)
        axes[0, 0].text(row.met, place, f"{row.met} ", va="center", ha="right", fontsize=LEAST_TEXT,
                        color="white" if named else "black", **said)  # fmt: skip
        axes[0, 1].plot([1.0, row.ratio], [place, place], color=color, lw=0.8, zorder=1)
        axes[0, 1].plot(row.ratio, place, "o", color=color if named else GREY, ms=4.5)
        axes[0, 1].annotate(number(row.ratio), (row.ratio, place), (5, 0), textcoords="offset points", va="center",
                            fontsize=LEAST_TEXT, **said)  # fmt: skip
    axes[0, 0].set(xlim=(0, asked), ylim=(len(shown) - 0.4, -0.6), yticks=range(len(shown)))
    axes[0, 0].set_yticklabels([row.name for row in shown], fontsize=LEAST_TEXT)
    for label, row in zip(axes[0, 0].get_yticklabels(), shown, strict=True):
        label.set_weight("bold" if row in told else "normal")
    axes[0, 0].set(title="how often it is accurate enough", xlabel=f"targets met, of {asked}")
    axes[0, 1].set(title="how slow it is", xlabel="time / that of the fastest method, median", xscale="log")
    axes[0, 1].set_xlim(0.8, 3.0 * max((row.ratio for row in shown), default=10.0))
    axes[0, 1].xaxis.set_major_formatter("{x:g}")
    for axis in axes.flat:
        axis.grid(visible=False, axis="y")
        axis.tick_params(axis="y", length=0)
    lengths = " or ".join(f"{span:g}" for span in data["horizon"].values)
    left_out, slow = merged.isel(variant=0).size - asked, len(names) - len(shown)
    figure.supxlabel(
        f"A target: an axis error of {number(TARGETS[0])} to {number(TARGETS[-1])} rad, on one of "
        f"{data.sizes['scene']} tops, over {lengths} nutations;\n{left_out} such targets, "
        "wider than the nutation or met by no method, are left out. One that a method does not meet\n"
        f"counts as infinite in its median; {slow} more methods, which meet at most half, have none.",
        fontsize=7.5, ha="left", x=0.01,
    )  # fmt: skip
    headline(figure, slowdown_message(merged.sel(variant=order)))
    return Picture(
        "slowdown",
        figure,
        f"Of {asked} targets, each an axis error on a scene over a horizon, how many every compiled variant, "
        "method[chart], meets with some step or tolerance within its budget (see the rules). Beside it, its time "
        "over that of the fastest variant, the median over all targets. Variants that meet most come first, and of "
        "these "
        f"those that are closest to the fastest. The {slow} variants that miss half of the targets or more have no "
        "median and are left out; the table on when to choose each variant has them.",
        "Bars of targets met and dots of the median slowdown, a line a variant, the fastest and the surest in bold.",
    )


def _told(rows: Sequence[Middle]) -> list[Middle]:
    """The variants of the title: the fastest in the median, and the one that meets most if that is another."""
    best, surest = min(rows, key=lambda row: row.ratio), max(rows, key=lambda row: row.met)
    if not np.isfinite(best.ratio):
        return []
    return [best] if surest.met <= best.met or not np.isfinite(surest.ratio) else [best, surest]


def slowdown_message(merged: xr.DataArray) -> str:
    """Who is the fastest in the median over all targets, and who fails least, if that is another one."""
    asked, rows = middles(merged)
    told = _told(rows)
    if not told:
        return "No method meets half of the targets"
    best, *surest = told
    pace = "is the fastest" if best.ratio < LEVEL else f"takes {number(best.ratio)} times the least time"
    more = "".join(f"; {row.name} meets {row.met}, in {number(row.ratio)} times the least time" for row in surest)
    return f"{best.name} {pace} in the median and meets {best.met} of {asked} targets{more}"
