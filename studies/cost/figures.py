"""The study's figures: seconds against error, run lengths, the phase diagram."""

import math
from collections import Counter
from string import ascii_uppercase
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.colors import to_rgb
from matplotlib.patches import Patch, Rectangle

from symtop.methods.framework.registry import integrator
from symtop.report import style
from symtop.report.figures import chosen, label_lines
from symtop.report.style import LEAST_TEXT, few_ticks, grid, panels
from symtop.runner.study import Picture

from . import cells, far
from .cells import EVALUATIONS, GENERAL, Cell
from .facts import serves
from .ranking import run_lengths
from .tops import NATURAL

FAMILIAR = (  # well-known methods, in figure 1
    "rk4[axis]", "rk45-compiled[axis]", "tsit5-fixed[axis]", "dop853-compiled[axis]", "dop853-compiled-fixed[axis]",
    "gauss-8[axis]", "stormer-verlet[angles]", "strang[axis]", "takahashi-imada[axis]", "srkn-14-6[axis]",
    "midpoint[angles]", "taylor[axis]", "series[axis]",
)  # fmt: skip
TOP = "this-top"
NAMED = 7  # variants of the run lengths with a label
BESIDE = ("rk4[axis]", "strang[axis]", "dop853-compiled-fixed[axis]")  # named in any case
MARKS, LATEST = 9, 0.995
HALF = 0.5
HATCH, UNREACHED = "////", "xxx"
MOST_KEYS, REST = 10, style.YELLOW  # methods that have a key, and the colour of others
PALE = 0.55  # of white in the colour of a predicted cell
LUMINANCE, DARK = np.array([0.2126, 0.7152, 0.0722]), 0.42  # of red, green and blue; below it letters are white
LEFT = (style.SKY, style.ORANGE, style.VERMILLION, style.BLUE, style.LEAF)
TITLES = {
    "axis": "axis: angle from the\ntrue axis (rad)", "energy": "energy:\nrelative change",
    "shape": "shape: distance\nto the true orbit",
}  # fmt: skip


def pictures(data: xr.DataTree) -> list[Picture]:
    """All figures."""
    draws = {"accuracy": draw_accuracy, "run-lengths-evaluations": draw_run_lengths}
    draws |= {"map": draw_map} if "far" in data.children else {}
    return [Picture(name, draw(data)) for name, draw in draws.items()]


def draw_accuracy(data: xr.DataTree) -> Any:
    """Error against the seconds of a safe run: the fastest for any body at each error, and well-known methods."""
    by_target = {target: cells.reached(data, target) for target in cells.targets(data)}
    names = list(dict.fromkeys(name for known in by_target.values() for name in known))
    figure, axes = panels(1, 1, height=4.0)
    axis, ends = axes[0, 0], []
    for name in chosen(names, [*FAMILIAR, *_safe_names(data)], len(FAMILIAR)):
        points = [(1e6 * known[name].seconds, target, 1e6 * known[name].low, 1e6 * known[name].high)
                  for target, known in by_target.items() if name in known]  # fmt: skip
        x, y, low, high = np.array(points).T
        look, suffix = style.line(name), " (this top)" if integrator(name).needs == TOP else serves(name)
        axis.plot(x, y, lw=1.6, zorder=3, **look)
        axis.hlines(y, low, high, color=look["color"], lw=3.0, alpha=0.35, zorder=2)
        ends.append((f"{name.removesuffix('[axis]')}{suffix}", look["color"], x, y))
    axis.set(xscale="log", yscale="log", ylim=(2e-13, 5e-3), ylabel="axis error that 95 % of the tops keep (rad)")
    axis.set_yticks(list(by_target), [f"$10^{{{math.log10(target):.0f}}}$" for target in by_target])
    axis.yaxis.minorticks_off()
    axis.set_xlabel("time of a safe run: evaluations × price + call (µs)")
    low, high = axis.get_xlim()
    axis.set_xlim(low, 4.0 * high)  # with room for the labels
    label_lines(axis, ends)
    return figure


def _safe_names(data: xr.DataTree) -> list[str]:
    """The cheapest safe choice for any body at each error, and of those that use f(t, y) alone."""
    asked = [Cell("short", "axis", target, NATURAL, needs)
             for needs in (GENERAL, "derivative") for target in cells.targets(data)]  # fmt: skip
    return list(dict.fromkeys(choice.name for cell in asked for choice in cells.safest(data, cell)[0][:1]))


def draw_run_lengths(data: xr.DataTree) -> Any:
    """The share of natural tops that each variant solves within a number of force evaluations, a panel per target."""
    panel_cells = [Cell("short", "axis", target, NATURAL) for target in cells.targets(data)]
    tables = [cells.costs(data, cell, EVALUATIONS) for cell in panel_cells]
    firsts = filter(None, (cells.fewest(data, cell) for cell in panel_cells))
    names = list(dict.fromkeys(name for table in tables for name in table.names))
    rows = chosen(names, list(dict.fromkeys([*_safe_names(data), *firsts, *BESIDE]))[:NAMED], NAMED)
    labels = "force evaluations of a run", "share of tops solved"
    figure, axes = grid(len(panel_cells), 2, labels, height=2.3, sharex=True, sharey=True)
    curves = [table.values[table.names.index(name)] for table in tables for name in rows if name in table.names]
    ends = [np.quantile(part[np.isfinite(part)], LATEST) for part in curves if np.isfinite(part).any()]
    cheapest = min((float(table.values.min()) for table in tables if table.values.size), default=1.0)
    budgets = np.geomspace(0.9 * cheapest, 1.5 * max(ends, default=10.0 * cheapest), 400)
    for axis, cell, table in zip(axes, panel_cells, tables, strict=True):
        for name, costs in zip(table.names, table.values, strict=True):
            share = run_lengths(costs, budgets)
            if name in rows:
                axis.plot(budgets, share, markevery=(5 * rows.index(name), len(budgets) // MARKS), lw=1.6, zorder=3,
                          label=name, **style.line(name))  # fmt: skip
            else:
                axis.plot(budgets, share, color=style.GREY, lw=0.6, alpha=0.4, zorder=1)
        axis.axhline(HALF, color="black", lw=0.8, ls=(0, (1, 2)), zorder=2)
        axis.set(xscale="log", ylim=(0.0, 1.03), title=f"axis error below $10^{{{np.log10(cell.target):.0f}}}$ rad")
        axis.yaxis.set_major_formatter(lambda value, _: f"{100.0 * value:.0f} %")
    if len(names) > len(rows):
        axes[0].plot([], [], color=style.GREY, lw=0.8, label="all other methods for any body")
    few_ticks(*axes, most=5)
    style.legend_below(figure, axes)
    return figure


def draw_map(data: xr.DataTree) -> Any:
    """Three panels: the cheapest variant for every allowed error and run length."""
    diagrams = {quantity: far.diagram(data, quantity) for quantity in far.QUANTITIES}
    won = Counter(panel.names[k] for panel in diagrams.values() for k in panel.winner.ravel() if k >= 0)
    colors = _colors([name for name, _ in won.most_common(MOST_KEYS)])
    colors |= {name: REST for name in won if name not in colors}
    figure, axes = panels(1, len(far.QUANTITIES), height=3.6, sharex=True, sharey=True)
    for axis, (quantity, panel) in zip(axes[0], diagrams.items(), strict=True):
        _panel(axis, panel, colors)
        axis.set(title=TITLES[quantity], xlabel="run length (nutations)")
    axes[0][0].set_ylabel("largest error allowed")
    keys = [Patch(facecolor=color, label=f"{letter}  {name}") for letter, (name, color)
            in zip(letters(colors), colors.items(), strict=True) if color != REST]  # fmt: skip
    keys += [Patch(facecolor=REST, label="another method")] if REST in colors.values() else []
    keys.append(Patch(facecolor="white", edgecolor="#BBBBBB", hatch=UNREACHED, label="reached by no method"))
    figure.legend(handles=keys, loc="outside lower center", ncols=3, frameon=False)
    return figure


def _colors(names: list[str]) -> dict[str, str]:
    """A colour for each variant: its own, or an unused one if a variant with more cells has that."""
    colors: dict[str, str] = {}
    for name in names:
        palette = [style.look(name).color, *LEFT, *style.SHADES["engine"], *style.SHADES["other"]]
        colors[name] = next((color for color in palette if color not in colors.values()), style.GREY)
    return colors


def letters(colors: dict[str, str]) -> list[str]:
    """A letter for each variant with a colour of its own, for those who cannot tell the colours apart."""
    return [ascii_uppercase[k] if color != REST else "" for k, color in enumerate(colors.values())]


def _panel(axis: Any, panel: far.Diagram, painted: dict[str, str]) -> None:
    """Cells in the colours and with letters of variants; small letters at a tie; predicted cells pale and hatched."""
    x, y = np.log10(panel.horizons), np.log10(far.TARGETS)
    dx, dy = 0.5 * (x[1] - x[0]), 0.5 * (y[0] - y[1])
    colors = np.ones((*panel.winner.shape, 3))
    masks = [panel.winner == (panel.names.index(name) if name in panel.names else -2) for name in painted]
    for mask, color in zip(masks, map(to_rgb, painted.values()), strict=True):
        colors[mask] = color
        colors[mask & panel.predicted] = PALE + (1.0 - PALE) * np.asarray(color)
    axis.imshow(colors, extent=(x[0] - dx, x[-1] + dx, y[-1] - dy, y[0] + dy), aspect="auto", interpolation="none")
    for cells_of, hatch, ink in ((panel.predicted, HATCH, "#FFFFFF"), (panel.winner < 0, UNREACHED, "#BBBBBB")):
        for t, h in np.argwhere(cells_of):
            axis.add_patch(Rectangle((x[h] - dx, y[t] - dy), 2 * dx, 2 * dy, fill=False, lw=0, hatch=hatch, ec=ink))
    axis.vlines(x[1:] - dx, y[-1] - dy, y[0] + dy, color="white", lw=0.3)
    axis.hlines(y[1:] + dy, x[0] - dx, x[-1] + dx, color="white", lw=0.3)
    look: dict[str, Any] = {"ha": "center", "va": "center_baseline", "fontsize": LEAST_TEXT}
    for letter, mask in zip(letters(painted), masks, strict=True):
        for t, h in np.argwhere(mask):
            small = panel.ratio[t, h] < far.TIE
            ink = "black" if colors[t, h] @ LUMINANCE > DARK else "white"
            look["weight"] = "normal" if small else "bold"
            axis.text(x[h], y[t], letter.lower() if small else letter, color=ink, **look)
    axis.grid(visible=False)
    axis.set_xticks(range(1, 7), [f"$10^{{{k}}}$" for k in range(1, 7)])
    axis.set_yticks(range(-12, -1, 2), [f"$10^{{{k}}}$" for k in range(-12, -1, 2)])
