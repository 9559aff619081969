"""The study's figures: tau of rankings, factors of safe steps, wrong runs that keep energy and momenta."""

from typing import Any

import numpy as np
import xarray as xr

from symtop.report import style
from symtop.runner.study import Picture

from . import comparison as by
from .bodies import ASKED, FAMILIES
from .comparison import OTHERS, label
from .facts import decades, words

COLORS = (style.BLUE, style.VERMILLION, style.GREEN)
MARKS = ("o", "s", "^")
NAMED = ("rk4[body]", "tsit5-fixed[body]", "gauss-4[body]", "strang[body]", "lie-variational[body]",
         "five-rotations[body]", "kahan-li-8[body]", "euler-poincare[body]")  # fmt: skip


def pictures(data: xr.DataTree) -> list[Picture]:
    """The three figures."""
    return [
        Picture("rankings", draw_rankings(data)), Picture("steps", draw_steps(data)),
        Picture("silent", draw_silent(data)),
    ]  # fmt: skip


def _families(axis: Any, names: Any) -> None:
    axis.set_xticks(range(len(names)), [words(name).replace("epsilon ", "ε = ") for name in names])


def draw_rankings(data: xr.DataTree) -> Any:
    """Tau of each family and target with its interval, and the ceiling as a band."""
    figure, ((axis,),) = style.panels(1, 1, height=2.9)
    for k, (target, color, mark) in enumerate(zip(ASKED, COLORS, MARKS, strict=True)):
        taus, places = [by.tau(data, family, target) for family in OTHERS], np.arange(len(FAMILIES)) + 0.18 * (k - 1)
        middle, low, high = (np.array([getattr(tau, name) for tau in taus]) for name in ("value", "low", "high"))
        axis.vlines(places[1:], low, high, color=color, lw=1.6)
        shape: dict[str, Any] = {"ls": "none", "marker": mark, "ms": 5, "color": color}
        axis.plot(places[1:], middle, **shape, label=f"axis to 1e-{decades(target)} rad")
        own_taus = [by.own_tau(data, family, target).value for family in FAMILIES]
        axis.plot(places, own_taus, **shape, mfc="white")
    tops = [by.ceiling(data, target) for target in ASKED]
    low, high = min(ceiling.low for ceiling in tops), max(ceiling.high for ceiling in tops)
    axis.axhspan(low, high, color=style.GREY, alpha=0.25, lw=0, label="between halves of the tops")
    axis.plot(
        [], [], ls="none", marker="o", mfc="white", color=style.GREY, label="open: ranked by the top's own kernels"
    )
    _families(axis, FAMILIES)
    axis.set(ylabel="Kendall's tau with tops (1: same order)", ylim=(min(0.3, axis.get_ylim()[0]), 1.02))
    style.legend_below(figure, [axis])
    return figure


def draw_steps(data: xr.DataTree) -> Any:
    """Factors of safe steps: a dot a method, by family and target."""
    figure, ((axis,),) = style.panels(1, 1, height=2.9)
    shift = np.random.default_rng(6)
    for k, (target, color) in enumerate(zip(ASKED, COLORS, strict=True)):
        for place, family in enumerate(OTHERS):
            values = np.array([*by.step_factors(data, family, target).values()])
            x = place + 0.25 * (k - 1) + shift.uniform(-0.08, 0.08, values.size)
            options = {"label": f"axis to 1e-{decades(target)} rad"} if place == 0 else {}
            axis.plot(x, values, ls="none", marker=MARKS[k], ms=3, alpha=0.6, color=color, **options)
            beyond = int(np.isinf(values).sum())
            if beyond:
                axis.annotate(f"+{beyond}", (place + 0.25 * (k - 1), 1.0), xycoords=axis.get_xaxis_transform(),
                              ha="center", va="top", color=color, fontsize=style.LEAST_TEXT)  # fmt: skip
    for factor in (1.0, by.DOUBLE):
        axis.axhline(factor, color="black", lw=0.8, ls="-" if factor == 1.0 else "--")
    _families(axis, OTHERS)
    axis.set(yscale="log", ylabel="safe steps, over those of tops")
    ticks = [
        tick
        for tick in (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
        if axis.get_ylim()[0] <= tick <= axis.get_ylim()[1]
    ]
    axis.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axis.minorticks_off()
    style.legend_below(figure, [axis])
    return figure


def draw_silent(data: xr.DataTree) -> Any:
    """Share of runs at `STEPS` steps a period that are wrong with energy and momenta kept, a line a method."""
    figure, ((axis,),) = style.panels(1, 1, height=2.9)
    names = [name for name in NAMED if name in by.fixed_steps(data)]
    none = 50.0 / by.group_of(data, "short").sizes["member"]  # half a body
    for k, name in enumerate(names):  # side by side, as many methods are wrong on no body
        shares, look = [max(100.0 * by.silent(data, name, family), none) for family in FAMILIES], style.line(name)
        places = np.arange(len(shares)) + 0.07 * (k - 0.5 * (len(names) - 1))
        axis.plot(places[:-2], shares[:-2], label=label(name), **look)  # chaotic and free bodies: no line
        axis.plot(places[-2:], shares[-2:], **(look | {"ls": "none"}))
    axis.axhspan(0.7 * none, 1.4 * none, color=style.GREY, alpha=0.2, lw=0)
    _families(axis, [*FAMILIES])
    axis.set(yscale="log", ylabel="wrong, energy and momenta kept (% of bodies)", ylim=(0.7 * none, 120.0))
    axis.set_yticks([none, 1.0, 10.0, 100.0], ["none", "1", "10", "100"])
    style.legend_below(figure, [axis])
    return figure
