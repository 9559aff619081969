"""Two pictures of who is the fastest: the winner of every cell, and how much slower every row is."""

import textwrap
from collections import Counter

import numpy as np
import xarray as xr

from symtop.measure import ranking
from symtop.measure.work import TARGETS
from symtop.methods.registry import split_name
from symtop.report.style import GREY, headline, look, number, panels
from symtop.runner.study import Picture

from . import words

POWERS = [f"$10^{{{np.log10(target):.0f}}}$" for target in TARGETS]
LEVEL = 1.05  # times the least time: no more than it
SLOWEST = 100.0  # times the fastest: the darkest cell


def winners(data: xr.Dataset) -> Picture:
    """One line a scene, one column a target, one panel a horizon: the fastest row's colour and name."""
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
    most = ", ".join(f"{name} ({times})" for name, times in ranks)
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
        f"The fastest compiled row, method[chart], on each scene, for each axis error that steps and tolerances were "
        "searched for. "
        f"Most often: {most}, of {len(met)} cells.{words.not_asked(data)} Pale and with a tilde: its lead over at "
        "least one other row is within the noise. All times are measured; the closed form is not ranked.",
        "Coloured cells naming the fastest row, a line a scene, a column an accuracy.",
    )


def slowdown(data: xr.Dataset) -> Picture:
    """Every compiled row's time over the fastest one's, the median over the scenes, a column a horizon and target."""
    compiled = words.of_implementation(data, "compiled")
    names = [name for name in ranking.ranked(data) if name in compiled]
    costs = [ranking.relative_costs(data.isel(horizon=[far]), names) for far in range(data.sizes["horizon"])]
    merged = xr.concat(costs, "problem").sel(integrator=names)
    order = ranking.leaders(merged, len(names))
    order += [name for name in names if name not in order]
    figure, axes = panels(1, len(costs), height=0.5 + 0.133 * len(order), sharey=True)
    for far, (axis, table) in enumerate(zip(axes[0], costs, strict=True)):
        for column, target in enumerate(TARGETS):
            for line, name in enumerate(order):
                ratios = table.sel(target=target, integrator=name).dropna("problem").values
                text, shade = _cell(data.isel(horizon=far), name, target, ratios)
                color = "white" if np.dot(_heat(shade)[:3], [0.3, 0.59, 0.11]) < 0.5 else "black"
                axis.fill_between(
                    [column - 0.49, column + 0.49], line - 0.47, line + 0.47, color=_heat(shade), lw=0, zorder=1
                )
                axis.text(column, line, text, ha="center", va="center", fontsize=7.0, color=color, zorder=2)
        axis.set(
            xlim=(-0.5, len(TARGETS) - 0.5), ylim=(len(order) - 0.5, -0.5), yticks=range(len(order)),
            yticklabels=order, xticks=range(len(TARGETS)), title=words.spans(data)[far], xticklabels=POWERS,
            xlabel="largest axis error allowed (rad)",
        )  # fmt: skip
        axis.grid(visible=False)
        axis.tick_params(length=0)
    figure.supxlabel(
        "In a cell: times the fastest method's time, the median over the scenes; after the stroke, on how many scenes\n"
        "the method fails; uncoloured if on half of them or more. A word: why on all. First: those that fail least.",
        fontsize=7.5, ha="left", x=0.01,
    )  # fmt: skip
    headline(figure, slowdown_message(merged.sel(integrator=order)))
    for axis in axes.flat:
        axis.tick_params(axis="y", labelsize=7.0)
    return Picture(
        "slowdown",
        figure,
        "Times the fastest compiled row's time that each compiled row, method[chart], takes to an axis error, the "
        "median over the scenes on which it meets it; behind the stroke on how many scenes it does not. White with a "
        "word: it does on none, because of the budget of a million force evaluations, the least tolerance or rounding. "
        f"Rows that meet most come first: {', '.join(order[:3])}. Darker is slower; a row that "
        "misses half of the scenes or more has no colour. All times are measured.",
        "A table of slowdowns, a line a row and a column a horizon and accuracy, darker for slower.",
    )


def slowdown_message(merged: xr.DataArray) -> str:
    """Who is the fastest in the median over all targets, and who fails least, if that is another one."""
    asked = int(np.isfinite(merged).any("integrator").sum())
    table = merged.transpose("integrator", ...).values.reshape(merged.sizes["integrator"], -1)
    table = table[:, np.isfinite(table).any(axis=0)]
    middle = np.median(np.where(np.isfinite(table), table, np.inf), axis=1)
    met, names = np.isfinite(table).sum(axis=1), [str(name) for name in merged["integrator"].values]

    best, surest = int(np.argmin(middle)), int(np.argmax(met))
    if not np.isfinite(middle[best]):
        return "No method meets half of the targets"
    times = "" if middle[best] < LEVEL else f"{number(float(middle[best]))} times "
    first = (
        f"{names[best]} meets {met[best]} of {asked} targets that can be met, in {times}the least time in the median"
    )
    if met[surest] <= met[best] or not np.isfinite(middle[surest]):
        return first
    return f"{first}; {names[surest]} meets {met[surest]}, in {number(float(middle[surest]))} times as much"


def _cell(data: xr.Dataset, name: str, target: float, ratios: np.ndarray) -> tuple[str, float]:
    """What a cell of the slowdown table says, and how dark it is, from 0 to 1."""
    met = ratios[np.isfinite(ratios)]
    if not met.size:
        why = Counter(map(str, data["reached"].sel(integrator=name, target=target).values.ravel()))
        return why.most_common(1)[0][0], 0.0
    missed = f" / {ratios.size - met.size}" if met.size < ratios.size else ""
    middle = float(np.median(met))
    shade = _darkness(middle) if 2 * met.size > ratios.size else 0.0  # most of the scenes are not in the median
    return f"{middle:.2g}{missed}" if middle < 100.0 else f"{middle:.0f}{missed}", shade


def _darkness(ratio: float) -> float:
    return 0.06 + 0.94 * min(np.log(max(ratio, 1.0)) / np.log(SLOWEST), 1.0)


def _heat(shade: float) -> tuple[float, float, float, float]:
    """A colour from white to dark blue, of one hue, so that it reads in grey as well."""
    from matplotlib import colormaps

    red, green, blue, alpha = colormaps["Blues"](shade)
    return (1.0, 1.0, 1.0, 1.0) if shade == 0.0 else (red, green, blue, alpha)
