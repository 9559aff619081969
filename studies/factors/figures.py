"""Figures of the factors study: the waterfall, and what a chart costs each method at equal accuracy."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.ticker import LogLocator, NullLocator

from symtop.report import style
from symtop.report.sentences import joined
from symtop.runner.study import Picture

from . import words
from .cells import COMPILED, FAMILIES, SAMPLES, cells
from .tables import Bar, chart_ratio, goals_of, times

COLORS = {"": style.GREY, "call": style.PURPLE, "chart": style.GREEN, "language": style.ORANGE, "method": style.BLUE}
BESIDE = {"angles": "in Euler angles", "attitude": "with the whole attitude (quaternion)"}  # charts beside the axis
SCHEMES = [scheme for schemes in FAMILIES.values() for scheme in schemes]
DODGE = 0.2  # of a row's height, so that near dots are all seen


def pictures(data: xr.Dataset) -> list[Picture]:
    """The waterfall, if it was timed, and the charts."""
    orders = [*words.waterfalls(data)[:1], *words.waterfalls(data, call_first=True)[:1]]
    return [*([draw_waterfall(orders)] if orders else []), draw_charts(data)]


def _label(bar: Bar) -> str:
    run = bar.time
    return f"{bar.factor}: {bar.change}" if bar.factor else f"{run.name}, {run.call}"


def _effect(bar: Bar, before: Bar) -> str:
    """What a change did, in words."""
    times = bar.ratio if bar.ratio >= 1.0 else 1.0 / bar.ratio
    if times <= 1.0 + max(bar.time.spread, before.time.spread):
        return "no change beyond noise"
    return f"{words.times_faster(times)} times {'faster' if bar.ratio >= 1.0 else 'slower'}"


def draw_waterfall(shown: list[tuple[str, float, float, list[Bar]]]) -> Picture:
    """Time after each change, from SciPy as it is usually called to the fastest kernel, in two orders."""
    height = 0.24 * max(len(bars) for *_, bars in shown) + 0.7
    figure, axes = style.panels(len(shown), 1, height=height)
    for axis, (*_, bars) in zip(axes[:, 0], shown, strict=True):
        seconds = [bar.time.seconds for bar in bars]
        ends = 0.3 * min(seconds), 500.0 * max(seconds)
        for k, bar in enumerate([*bars, bars[-1]]):
            total = k in (0, len(bars))
            low, high = sorted((ends[0] if total else seconds[k - 1], seconds[min(k, len(bars) - 1)]))
            color, slower = COLORS["" if total else bar.factor], not total and bar.ratio < 1.0
            look = {"hatch": "////", "facecolor": "white"} if slower else {"facecolor": color}
            axis.barh(k, high - low, left=low, height=0.62, edgecolor=color, **look)
            words_beside = ("" if total else f"{_effect(bar, bars[k - 1])}, ") + words.duration(bar.time.seconds)
            axis.annotate(
                words_beside, (high, k), (4, 0), textcoords="offset points", va="center", fontsize=style.LEAST_TEXT
            )
            if k < len(bars):
                axis.plot([seconds[k]] * 2, [k - 0.31, k + 1.31], color="#444444", lw=0.8)
        last = bars[-1].time
        axis.set(xscale="log", xlim=ends, ylim=(len(bars) + 0.6, -0.6), yticks=range(len(bars) + 1))
        axis.set_yticklabels([*map(_label, bars), f"{last.name}, {last.call}"], fontsize=style.LEAST_TEXT)
        late = bars[-1].factor == "call"
        timed = "Timed through simulate" if late else "Solver timed alone"
        title = f"{timed}: the overhead of the call is removed {'last' if late else 'first'}"
        axis.set_title(title, loc="right", weight="bold")
        axis.set_xticks([tick for tick in axis.get_xticks() if ends[0] < tick < 30.0 * max(seconds)])  # no bar is there
        axis.set_xlim(ends)
        axis.grid(visible=False, axis="y")
        axis.xaxis.set_minor_locator(NullLocator())
    for factor in filter(None, COLORS):
        axes[0, 0].barh(0, 0.0, color=COLORS[factor], label=factor)
    axes[-1, 0].set_xlabel("time of a run (s)")
    noise = max(bar.time.spread for *_, bars in shown for bar in bars)
    style.legend_below(figure, axes)
    scene, span, target, _ = shown[0]
    goal = f"Scene {scene}, {span:g} nutations, axis error {style.number(target)} rad"
    figure.legends[0].set_title(f"{goal}. kernel: the solver alone, called directly")
    style.headline(figure, words.waterfall_message(shown))
    return Picture(
        "waterfall",
        figure,
        f"{words.product(*shown[0])} Each bar changes what its label names and holds the rest, at the coarsest step or "
        "tolerance found. Language: SciPy's loop with its right-hand side in Python, then compiled, then the whole "
        "loop. Hatched bars are slower. Above, every change but the last is timed through simulate, whose "
        f"{SAMPLES} samples hide the method; below with the kernel. The product is the same. Noise (quartiles of "
        f"processes over their median): at most {noise:.0%}.",
        "Horizontal bars on a logarithmic axis of time, each beginning where the one above ends.",
        lead="Where the speed comes from",
    )


def draw_charts(data: xr.Dataset) -> Picture:
    """Time of a run in each larger chart over that on the axis, at equal error: a dot a pair, a row a method."""
    shown = {chart: _ratios(data, chart) for chart in BESIDE}
    heads, places = _places([scheme for ratios in shown.values() for scheme in ratios])
    first = next(iter(heads), "")
    height = 0.5 + 0.2 * (len(heads) + len(places))
    figure, axes = style.panels(1, len(BESIDE), height=height, sharex=True, sharey=True)
    for axis, (chart, ratios) in zip(axes[0], shown.items(), strict=True):
        axis.axvline(1.0, color="#444444", lw=0.9, zorder=1)
        for scheme, place in places.items():
            values, told = sorted(ratios.get(scheme, [])), scheme in FAMILIES.get(first, ())
            heights = place + DODGE * (np.arange(len(values)) % 3 - 1.0)  # neighbours are level with each other
            axis.plot(values, heights, "o", color=style.GREEN if told else "#999999", ms=4.0, mew=0.4, mec="white")
            if not values:
                axis.annotate(_absent(scheme, chart), (1.0, place), (5, 0), textcoords="offset points", va="center",
                              color="#666666", fontsize=style.LEAST_TEXT)  # fmt: skip
        if pairs := words.family_ratios(data, first, chart) if first else []:
            inside = [places[scheme] for scheme in FAMILIES[first] if scheme in places]
            middle = float(np.median(pairs))
            axis.plot([middle] * 2, [min(inside) - 0.5, max(inside) + 0.5], color=style.GREENS[1], lw=2.5, zorder=1.5)
            axis.annotate(f"median {middle:.2f}", (middle, min(inside) - 0.95), (4, 0), textcoords="offset points",
                          color=style.ink(style.GREEN), fontsize=8.0, weight="bold", va="center",
                          bbox={"color": "white", "pad": 0.5})  # fmt: skip
        axis.set_title(BESIDE[chart])
        axis.grid(visible=False, axis="y")
        axis.tick_params(axis="y", length=0)
    _finish(axes[0], heads, places)
    axes[0, 0].plot([], [], "o", color="#444444", ms=4.0, label="a dot: one top, run length and error of the axis")
    axes[0, 0].plot([], [], color="#444444", lw=0.9, label="as long as on the axis alone")
    style.legend_below(figure, axes)
    style.headline(figure, words.charts_message(data))
    scenes = joined([str(name) for name in data["scene"].values])
    return Picture(
        "charts",
        figure,
        "Time of a run in Euler angles, and with the whole attitude, over that of the same method on the axis alone: "
        f"a dot a pair, on {scenes}, for each run length and error. All runs "
        "are bare compiled kernels at the coarsest step or tolerance found that meets the error. Missing pairs "
        f"need more than the study's budget. {words.families_sentence(data)}",
        "Two dot plots of ratios of time, a row a method: splitting methods above all others, a line at ratio one.",
    )


def _ratios(data: xr.Dataset, chart: str) -> dict[str, list[float]]:
    """Kernel time in a chart over that on the axis, by method, for every scene, horizon and target with both."""
    every = [times(part) for *_, part in goals_of(data)]
    known = {scheme: [chart_ratio(rows, scheme, chart) for rows in every] for scheme in SCHEMES}
    return {scheme: good for scheme, values in known.items() if (good := [one for one in values if math.isfinite(one)])}


def _places(drawn: Sequence[str]) -> tuple[dict[str, float], dict[str, float]]:
    """Heights of the two headings and of the methods: the family that the title speaks of, and below it all others."""
    told = next((family for family, schemes in FAMILIES.items() if any(scheme in drawn for scheme in schemes)), "")
    groups = {told: [scheme for scheme in FAMILIES.get(told, ()) if scheme in drawn]}
    groups["other"] = [scheme for scheme in SCHEMES if scheme in drawn and scheme not in groups[told]]
    heads: dict[str, float] = {}
    places: dict[str, float] = {}
    for family, schemes in groups.items():
        if schemes:
            heads[family] = float(len(heads) + len(places))
            for scheme in schemes:
                places[scheme] = float(len(heads) + len(places))
    return heads, places


def _absent(scheme: str, chart: str) -> str:
    """Why a method has no dot in a chart."""
    return "over the budget" if (scheme, chart, COMPILED) in {cell.key for cell in cells()} else "not in this chart"


def _finish(axes: Any, heads: dict[str, float], places: dict[str, float]) -> None:
    """Names of methods under the headings of their groups, and an axis of ratios."""
    left, rows = axes[0], sorted([*heads.items(), *places.items()], key=lambda row: row[1])
    left.set(yticks=[place for _, place in rows], ylim=(len(rows) - 0.4, -0.7))
    left.set_yticklabels([f"{name} methods" if name in heads else name for name, _ in rows])
    for label, (name, _) in zip(left.get_yticklabels(), rows, strict=True):
        label.set_weight("bold" if name in heads else "normal")
    left.set_xscale("log")
    low, high = left.get_xlim()
    left.set_xlim(min(low, 0.7), max(high, 1.5))
    for axis in axes:
        axis.set_xlabel("time of a run / its time on the axis alone")
        axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0)))
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_locator(NullLocator())
