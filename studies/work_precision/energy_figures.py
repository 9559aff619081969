"""Energy errors at equal run time as a picture: the curves of one top, and the counts of all comparisons."""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.patches import Rectangle
from matplotlib.ticker import PercentFormatter

from symtop.methods.framework.registry import split_name
from symtop.report import style
from symtop.report.figures import BELOW, error_band, name_ends
from symtop.runner.study import Picture

from . import energy, words

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
