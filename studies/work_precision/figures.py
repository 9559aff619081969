"""The figures of the work-precision study: fronts, the fastest variants, the slowdown of the others, energy, parts."""

import textwrap
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.patches import Rectangle
from matplotlib.ticker import PercentFormatter

from symtop.measure import ranking
from symtop.measure.settings import TARGETS
from symtop.methods.framework.registry import split_name
from symtop.report import style
from symtop.report.figures import BELOW, error_band, name_ends
from symtop.report.sentences import joined
from symtop.report.style import BLUE, GREY, LEAST_TEXT, VERMILLION, headline, legend_below, look, number, panels
from symtop.runner.study import Picture

from . import energy, fronts, growth, leads, words
from .growth import PARTS

SAME = 1.5  # an error that grows less stays the same
MARKS = {"shape": ("o", "black", "black"), "nutation_lag": ("s", "white", VERMILLION),
         "precession_lag": ("^", "white", BLUE)}  # fmt: skip


def pictures(data: xr.Dataset) -> list[Picture]:
    """Fronts at both horizons, the fastest variants, the slowdown of all, energy in two charts, parts of the error."""
    return [
        fronts.draw(data, "front-short", 0, "seconds"),
        fronts.draw(data, "front-long", -1, "seconds"),
        fronts.draw(data, "front-evaluations", 0, "force_evaluations"),
        winners(data),
        slowdown(data),
        *(draw(data, chart) for chart in energy.CHARTS if all(energy.in_chart(data, chart))),
        _parts(data),
    ]


def _parts(data: xr.Dataset) -> Picture:
    """How the parts of the error grow from one horizon to the other at equal steps, a row a method."""
    scene = data.isel(scene=0)
    rows = growth.rows_of(data)
    first, last = (f"{data['horizon'].values[far]:g}" for far in (0, -1))
    length = float(data["horizon"][-1] / data["horizon"][0])
    figure, axes = panels(1, 1, height=0.36 * len(rows) + 0.9)
    axis = axes[0, 0]
    for place, row in enumerate(rows):
        for k, part in enumerate(PARTS):
            marker, fill, color = MARKS[part]
            height = place + 0.22 * (k - 1)
            ratios = energy.ratios_at_equal_settings(scene.sel(variant=row), part)
            label = PARTS[part].partition(" (")[0]
            if not ratios:
                box = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
                said = f"{label}: at rounding or over budget"
                axis.text(1.6 * length, height, said, fontsize=LEAST_TEXT, va="center", bbox=box)
                continue
            axis.plot(ratios, [height] * len(ratios), "|", color=color, ms=5, mew=0.7, alpha=0.6, zorder=2)
            axis.plot(np.median(ratios), height, marker, mfc=fill, mec=color, ms=6, mew=1.2, zorder=3,
                      label=f"{label}, median")  # fmt: skip
    axis.plot([], [], "|", color="#444444", ms=5, mew=0.7, label="one step or tolerance")
    for at, said in ((1.0, "the same"), (length, "as the time")):
        axis.axvline(at, color=GREY, lw=0.9, ls=(0, (5, 3)), zorder=1)
        axis.annotate(said, (at, 1.0), (0, 3), xycoords=("data", "axes fraction"), textcoords="offset points",
                      ha="center", fontsize=LEAST_TEXT)  # fmt: skip
    axis.set(xscale="log", ylim=(max(len(rows), 1) - 0.5, -0.5), yticks=range(len(rows)), yticklabels=rows)
    axis.set_xlabel(f"error over {last} nutations / error over {first}, at equal steps or tolerances")
    axis.grid(visible=False, axis="y")
    axis.tick_params(axis="y", length=0)
    legend_below(figure, axes)
    growths = {part: [energy.growth_at_equal_settings(scene.sel(variant=row), part) for row in rows]
               for part in ("shape", "nutation_lag")}  # fmt: skip
    known = [[value for value in values if np.isfinite(value)] for values in growths.values()]
    if all(known):
        headline(figure, growth_message((first, last), *known))
    else:
        headline(figure, f"Parts of the axis error over {first} and {last} nutations")
    figure.legends[0].set_title(
        "Shape: distance from the true path. Lags: how far the run is behind or ahead on it, in the angle of the\n"
        f"nutation and of the precession. Scene {scene['scene'].values}; errors over {first} nutations above "
        f"{number(energy.ROUNDED, 1)}."
    )
    return Picture(
        "parts",
        figure,
        f"How the parts of the axis error on {scene['scene'].values} grow from {first} to {last} nutation periods at "
        "equal step or tolerance, a line a variant, method[chart]. Shape is the distance from the true path. The lags "
        "are how far the run is behind or ahead of the truth in its nutation and in its precession. Large marks are "
        f"medians over the settings that were run at both and whose error is above {energy.ROUNDED:g} at the first; "
        "thin marks are each of them. A shape error that stays the same is a path that is kept, whatever the phase on "
        "it. The table of the growth has the medians.",
        "Dot plot of the growth of shape error, nutation lag and precession lag, a row a method.",
    )


def growth_message(horizons: tuple[str, str], shapes: Sequence[float], lags: Sequence[float]) -> str:
    """How the errors of the path and of the nutation's phase grow from one horizon to another at equal steps."""
    same, lag = sum(value < SAME for value in shapes), number(float(np.median(lags)))
    return (
        f"The shape error stays the same with {same} of the {len(shapes)} methods above rounding from {horizons[0]} to "
        f"{horizons[1]} nutations; the lag in the nutation grows {lag} times in the median"
    )


KINDS = (  # of a comparison: what the structure-preserving variant has, the shade, and that of the number on it
    ("less energy error at every run time", style.PURPLES[1], "white"),
    ("at some run times", "#ABABAB", "black"),
    ("at none", "#DDDDDD", "black"),
)
NARROW = 0.05  # of a bar: a part that is too small for its number
SMALL = {"fontsize": style.LEAST_TEXT, "color": "#444444"}


def draw(data: xr.Dataset, chart: str) -> Picture:
    """The classical variants of a chart among those that preserve structure: on one scene, and counted over all."""
    style.use()
    counts, (classic, structured) = energy.tallies(data, chart), energy.in_chart(data, chart)
    figure = plt.figure(figsize=(style.WIDTH, 4.6 + 0.28 * len(counts)))
    upper, lower = figure.subfigures(2, 1, height_ratios=(3.0, 1.1 + 0.28 * len(counts)))
    scene = _example(data, chart)
    last = data.isel(horizon=-1)
    curves, bars = upper.subplots(), lower.subplots()
    _bars(bars, counts, data.sizes["scene"], len(structured))
    if left := len(energy.by_construction(data, chart)):
        bars.set_xlabel(f"share of the comparisons, without {left} methods that conserve the energy by construction")
    handles, labels = bars.get_legend_handles_labels()
    lower.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    style.headline(figure, energy.message(data, chart))
    _curves(curves, last.sel(scene=scene), classic, structured)
    failed = [
        f"{name} on {bad} of {data.sizes['scene']} scenes"
        for name in classic
        if (bad := int((~(last["outcome"].sel(variant=name) == "ok").any("setting")).sum()))
    ]
    lost = f"No run ended well of {' and '.join(failed)}. " if failed else ""
    return Picture(
        f"energy-{chart}",
        figure,
        f"Above, largest energy error {words.spans(data)[-1]} of {scene} against the time of a run, with finer steps "
        "along a line. Grey: the symplectic or symmetric variants that are compared. Below, all comparisons, within "
        f"one chart. {lost}{energy.sentence(data, chart)}",
        f"Energy error against time for variants of the chart {chart}, and bars that count who has less error.",
    )


def _example(data: xr.Dataset, chart: str) -> str:
    """The first scene on which every classical variant that was compared anywhere was compared; otherwise the first."""
    every = [
        {one.scene for listed in compared.values() for one in listed}
        for compared in energy.crossings(data, chart).values()
    ]
    names = [str(name) for name in data["scene"].values]
    return next((name for name in names if all(name in known for known in every if known)), names[0])


def _curves(axis: Any, cell: xr.Dataset, classic: list[str], structured: list[str]) -> None:
    """Energy against time on one scene: classical variants in their colours, with their names, the others grey."""
    axis.set(xscale="log", yscale="log", xlabel="time of a run (s)", ylabel="largest energy error (relative)")
    axis.set_title(
        f"one example, scene {cell['scene'].item()}: grey lines are the structure-preserving methods", loc="left"
    )
    level, ends = error_band(axis, cell["energy_bound"].values), {}
    for name in [*structured, *classic]:
        runs = cell.sel(variant=name)
        x, y = runs["seconds"].values, np.maximum(runs["energy"].values, 0.5 * level)
        good = np.isfinite(x) & np.isfinite(y)
        if name in structured:
            axis.plot(x[good], y[good], color=style.GREY, lw=0.7, alpha=0.7, zorder=1)
        elif good.any():
            axis.plot(x[good], y[good], **style.line(name), lw=1.6, zorder=2)
            far = int(np.argmax(np.where(good, x, -np.inf)))
            ends[split_name(name)[0]] = float(x[far]), float(y[far]), style.look(name).color
    axis.set_ylim(0.02 * level, 300.0)
    axis.annotate(BELOW, (0.99, 0.02), xycoords="axes fraction", ha="right", va="bottom", **SMALL)
    style.few_ticks(axis)
    axis.set_xlim(axis.get_xlim())
    name_ends(axis, ends, 8.0)


def _bars(axis: Any, counts: dict[str, energy.Tally], scenes: int, methods: int) -> None:
    """A bar a classical variant: its comparisons, by how often the structure-preserving one has less energy error."""
    ordered = sorted(counts.items(), key=lambda one: -one[1].share)  # as the title has them
    for place, (_, tally) in enumerate(ordered):
        start = 0.0
        for (_, shade, ink), count in zip(KINDS, tally, strict=True):
            part = count / tally.compared
            axis.add_patch(Rectangle((start, place - 0.36), part, 0.72, facecolor=shade, lw=0.6, edgecolor="white"))
            if part > NARROW:
                axis.text(start + 0.5 * part, place, f"{part:.0%}", ha="center", va="center", color=ink, fontsize=8.0)
            start += part
        axis.annotate(f"of {tally.compared}", (1.0, place), (5, 0), textcoords="offset points", va="center")
    for said, shade, _ in KINDS:
        axis.add_patch(Rectangle((0, 0), 0, 0, facecolor=shade, label=said))
    axis.axvline(0.5, color="black", lw=0.9, zorder=0.5)  # behind the numbers: it shows between the bars
    axis.set(xlim=(0.0, 1.0), ylim=(len(counts) - 0.5, -0.5), yticks=range(len(counts)), xticks=(0.0, 0.5, 1.0))
    axis.set_yticklabels([f"against {split_name(name)[0]}" for name, _ in ordered])
    axis.xaxis.set_major_formatter(PercentFormatter(1.0))
    axis.set_title(
        f"all pairs with a run time in common, of {methods} structure-preserving methods on {scenes} scenes", loc="left"
    )
    axis.set_xlabel("share of the comparisons")
    axis.grid(visible=False)
    axis.tick_params(axis="y", length=0)


POWERS = [f"$10^{{{np.log10(target):.0f}}}$" for target in TARGETS]
LEVEL = 1.05  # times the least time: no more than it


def winners(data: xr.Dataset) -> Picture:
    """One line a scene, one column a target, one panel a horizon: the fastest variant's colour and name."""
    from matplotlib.colors import to_rgb

    scenes = [str(name) for name in data["scene"].values]
    wins = leads.winners(data)
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
    costs = [leads.relative_costs(data.isel(horizon=[far]), names) for far in range(data.sizes["horizon"])]
    merged = xr.concat(costs, "problem").sel(variant=names)
    order = leads.leaders(merged, len(names))
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
