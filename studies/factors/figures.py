"""Figures of the factors study: the waterfall, and methods by chart at equal accuracy."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.ticker import LogLocator

from symtop.report import style
from symtop.runner.study import Picture

from . import words
from .cells import COMPILED, KERNEL, SAMPLES, SCIPY_PYTHON
from .tables import Bar, Timed, goals_of, times

COLORS = {"": style.GREY, "call": style.PURPLE, "chart": style.GREEN, "language": style.ORANGE, "method": style.BLUE}
NAMES = {  # whose colour and marker a scheme has
    "Dormand-Prince 5(4)": "rk45-compiled", "DOP853": "dop853", "rk4": "rk4", "Strang": "strang",
    "Takahashi-Imada": "takahashi-imada", "Blanes-Moan 11-6": "srkn-11-6", "Blanes-Moan 14-6": "srkn-14-6",
    "implicit midpoint": "gauss-2", "Gauss 6": "gauss-6", "Taylor": "taylor",
}  # fmt: skip
DODGE = {"angles": -0.14, "axis": 0.0, "attitude": 0.14}  # of a row's height, so that level charts are all seen


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
    for axis, (scene, span, target, bars) in zip(axes[:, 0], shown, strict=True):
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
        whole = words.times_faster(seconds[0] / seconds[-1])
        order = "the call bare last" if bars[-1].factor == "call" else "the call bare first"
        goal = f"scene {scene}, {span:g} nutations, axis error {style.number(target)} rad"
        axis.set_title(f"{goal}: {whole} times faster, {order}", loc="right")
        axis.set_xticks([tick for tick in axis.get_xticks() if ends[0] < tick < 30.0 * max(seconds)])  # no bar is there
        axis.set_xlim(ends)
        axis.grid(visible=False, axis="y")
        axis.xaxis.set_minor_formatter("")
    for factor in filter(None, COLORS):
        axes[0, 0].barh(0, 0.0, color=COLORS[factor], label=factor)
    axes[-1, 0].set_xlabel("time of a run (s)")
    noise = max(bar.time.spread for *_, bars in shown for bar in bars)
    style.legend_below(figure, axes)
    style.headline(figure, words.waterfall_message(shown))
    return Picture(
        "waterfall",
        figure,
        f"Where the factor comes from. {words.product(*shown[0])} Each bar changes what its label names and holds the "
        "other three factors and the accuracy, by the coarsest step or tolerance found; the ratios multiply to the "
        "total. Language: SciPy's loop with its right-hand side in Python, then compiled, then the whole loop. "
        "Hatched bars are slower. Public "
        f"calls return {SAMPLES} samples, a kernel two. Above, the call becomes bare last: what simulate adds to a run "
        "hides the method. Below, it becomes bare at once: the ratios differ, the product does not. "
        f" Noise (median over least sample) is at most {noise:.0%}.",
        "Horizontal bars on a logarithmic axis of time, each beginning where the one above ends.",
        lead="Where the speed comes from",
    )


def _kernels(rows: list[Timed]) -> dict[tuple[str, str], Timed]:
    """Kernel times by scheme and chart: of the compiled loop, or SciPy's where there is none."""
    kernels: dict[tuple[str, str], Timed] = {}
    for language in (SCIPY_PYTHON, COMPILED):
        kernels |= {(one.method, one.chart): one for one in rows if (one.language, one.call) == (language, KERNEL)}
    return kernels


def draw_charts(data: xr.Dataset) -> Picture:
    """Time and force evaluations of each method in each chart, at equal error of the axis."""
    goals = [(scene, span, target, _kernels(times(part))) for scene, span, target, part in goals_of(data)]
    first = goals[0][0]
    goals = [goal for goal in goals if goal[0] == first]
    schemes = [scheme for scheme in NAMES if any(scheme == method for *_, cells in goals for method, _ in cells)]
    figure, axes = style.panels(2, len(goals), height=0.55 + 0.15 * len(schemes), sharey=True)
    for column, (_, span, target, cells) in enumerate(goals):
        for (scheme, chart), one in cells.items():
            look = style.look(f"{NAMES[scheme]}[{chart}]")
            marks = {"color": look.color, "marker": look.marker, "fillstyle": look.fill, "ls": "none", "ms": 5.0}
            for axis, value in ((axes[0, column], 1e6 * one.seconds), (axes[1, column], one.forces)):
                axis.plot(value, schemes.index(scheme) + DODGE[chart], **marks)
        for scheme in schemes:
            values = [one for (method, _), one in cells.items() if method == scheme]
            for axis, sizes in (
                (axes[0, column], [1e6 * one.seconds for one in values]),
                (axes[1, column], [one.forces for one in values]),
            ):
                if sizes:
                    place = schemes.index(scheme)
                    axis.plot([min(sizes), max(sizes)], [place, place], color=style.GREY, lw=0.8, zorder=1)
        axes[0, column].set(title=f"{span:g} nutations,\naxis error {style.number(target)} rad")
        axes[0, column].set(xlabel=f"time of a bare run ({words.MICRO})")
        axes[1, column].set(xlabel="force evaluations")
    for axis in axes.flat:
        _finish(axis, schemes)
    for chart, fill in style.FILLS.items():
        axes[0, 0].plot([], [], "o", color="#444444", fillstyle=fill, ms=5.0, label=chart)
    style.legend_below(figure, axes)
    sentences = " ".join(words.family_sentences(data))
    style.headline(figure, words.charts_message(data))
    return Picture(
        "charts",
        figure,
        f"Methods by chart on {first}, each at the coarsest step or tolerance found that meets the axis error in the "
        "title; bare kernels, compiled but for DOP853, which is SciPy's. Further left is better; the line joins "
        f"the charts of one method. A method that is missing needs more than the study's budget. {sentences}",
        "Dot plots, a row for each method, open, full and half-full markers for angles, axis and attitude.",
    )


def _finish(axis: Any, schemes: list[str]) -> None:
    labels = [f"{scheme} (SciPy)" if scheme == "DOP853" else scheme for scheme in schemes]
    axis.set(xscale="log", yticks=np.arange(len(schemes)), yticklabels=labels, ylim=(len(schemes) - 0.5, -0.5))
    low, high = axis.get_xlim()
    ratio = high / low
    subs = (1.0,) if ratio > 100.0 else (1.0, 3.0) if ratio > 12.0 else (1.0, 2.0)
    axis.xaxis.set_major_locator(LogLocator(subs=subs, numticks=5))
    axis.xaxis.set_major_formatter(lambda value, _: f"{value:g}" if value < 1e4 else style.number(value))
    axis.xaxis.set_minor_formatter("")
