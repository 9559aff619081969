"""The study's figures: seconds against error, winners by class, run lengths, the phase diagram, silent failures."""

import math
import textwrap
from collections import Counter
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from symtop.methods.framework.registry import integrator, split_name
from symtop.report import style
from symtop.report.style import LEAST_TEXT, RAISED, few_ticks, grid, headline, panels
from symtop.runner.study import Picture

from . import cells, far
from .cells import CLASSES, EVALUATIONS, Cell
from .ladder import KEPT, WRONG
from .page import method, percent
from .ranking import SAFE, run_lengths
from .tops import KINDS, NATURAL

FAMILIAR = (  # of figure 1: methods that people know
    "rk4[axis]", "rk45-compiled[axis]", "dop853-compiled[axis]", "dop853-compiled-fixed[axis]", "gauss-8[axis]",
    "stormer-verlet[angles]", "strang[axis]", "takahashi-imada[axis]", "srkn-14-6[axis]", "midpoint[angles]",
    "taylor[axis]", "series[axis]",
)  # fmt: skip
TOP = "this-top"
NAMED = 8  # variants of the run lengths with a label
MARKS, LATEST = 9, 0.995
HALF = 0.5
HATCH, LETTER, UNREACHED = "////", 0.62, "#F0F0F0"
PALE = 0.62  # of white in the colour of a predicted cell
MOST_NAMES, KEY = 4, 44
FAMILIES = {
    "splitting": "splitting", "discrete-lagrangian": "discrete Lagrangian", "runge-kutta": "Runge-Kutta and Gauss",
    "taylor": "Taylor series",
}  # fmt: skip
TITLES = {
    "axis": "axis: angle between\nat one time (rad)", "energy": "energy:\nrelative change",
    "shape": "shape: distance\nto the true orbit",
}  # fmt: skip
SHADES = {"splitting": style.GREENS, "runge-kutta": style.ORANGES, "taylor": style.BLACKS,
          "discrete-lagrangian": style.BLUES}  # fmt: skip
SILENT_OF = ("rk4[axis]", "strang[axis]", "midpoint[angles]")


def pictures(data: xr.DataTree) -> list[Picture]:
    """All figures."""
    drawn = [draw_accuracy(data), draw_classes(data), draw_run_lengths(data), draw_silent(data), draw_map(data)]
    return [picture for picture in drawn if picture is not None]


def power(target: float) -> str:
    """A target as a power of ten."""
    return f"$10^{{{np.log10(target):.0f}}}$"


def raised(target: float) -> str:
    """The same in a title."""
    return f"10{str(round(np.log10(target))).translate(RAISED)}"


def span(data: xr.DataTree, horizon: str = "short", tops: str = NATURAL) -> str:
    """Tops and run length."""
    return f"{cells.chosen(data, horizon, tops).sum():,} {tops} tops over {cells.nutations(data, horizon):g} nutations"


def draw_accuracy(data: xr.DataTree) -> Picture:
    """Error against the seconds of a safe run, of methods that people know."""
    lines: dict[str, list[tuple[float, float, float, float]]] = {}
    for target in cells.targets(data):
        for needs in CLASSES[:-1]:
            for one in cells.safest(data, Cell("short", "axis", target, NATURAL, needs))[0]:
                if one.name in FAMILIAR and math.isfinite(one.seconds):
                    lines.setdefault(one.name, []).append((one.seconds, target, one.low, one.high))
    figure, axes = panels(1, 1, height=4.0)
    axis = axes[0, 0]
    for name in (name for name in FAMILIAR if name in lines):
        x, y, low, high = np.array(lines[name]).T
        own = integrator(name).needs == TOP
        style_of = style.line(name) | ({"color": "#AAAAAA"} if own else {})
        axis.plot(1e6 * x, y, lw=1.0 if own else 1.6, zorder=2 if own else 3, **style_of,
                  label=f"{method(name)} (made for this top)" if own else method(name))  # fmt: skip
        axis.hlines(y, 1e6 * low, 1e6 * high, color=style_of["color"], lw=3.0, alpha=0.35, zorder=2)
    axis.set(xscale="log", yscale="log", ylim=(2e-13, 5e-3), ylabel="axis error that 95 % of the tops keep (rad)")
    axis.set_xlabel("time of a safe run: evaluations × price + call (µs)")
    style.legend_below(figure, axes)
    without = [method(name) for name in FAMILIAR if name in data["short"]["variant"].values and name not in lines]
    beyond = f" Not within the budget at any of these errors: {', '.join(without)}." if without else ""
    best = {target: cells.safest(data, Cell("short", "axis", target, NATURAL)) for target in cells.targets(data)}
    told = [f"{method(one[0].name)} to {raised(target)}" for target, (one, _) in best.items()
            if one and math.isfinite(one[0].seconds)]  # fmt: skip
    headline(figure, f"The fastest safe choice for any body changes with the error: {', '.join(told)} rad")
    return Picture(
        "accuracy", figure,
        f"Seconds of a run at the one setting with which {SAFE:.0%} of {span(data)} keep the axis error; left and low "
        "is "
        "good. Bands: 95 % of a bootstrap over tops and prices. A line ends where the budget of a run or rounding ends "
        "it. Grey: needs this top's own equations. Method[chart]; the chart is the axis where none is named."
        f"{beyond}",
        "Log-log plot of axis error against the time of a safe run, a line a method.",
        lead="Speed against accuracy",
    )  # fmt: skip


def draw_classes(data: xr.DataTree) -> Picture:
    """The cheapest of each class, safe, at each error; a panel an error, a line a class, two populations."""
    targets, classes = cells.targets(data), CLASSES[:-1]
    figure, axes = panels(1, len(targets), height=0.42 * len(classes) + 0.9, sharey=True)
    for axis, target in zip(axes[0], targets, strict=True):
        for place, needs in enumerate(classes):
            color = "#AAAAAA" if needs == TOP else "black"
            for tops, fill, shift in ((NATURAL, "full", 0.0), ("strata", "none", 0.0)):
                choices, called = cells.safest(data, Cell("short", "axis", target, tops, needs))
                best = choices[0] if choices else None
                if best is None or not math.isfinite(best.seconds):
                    if tops == NATURAL:
                        axis.text(0.04, place, "not within the budget", transform=axis.get_yaxis_transform(),
                                  fontsize=LEAST_TEXT, va="center", color="#666666")  # fmt: skip
                    continue
                axis.plot(1e6 * best.seconds, place + shift, "o", ms=5, color=color, fillstyle=fill)
                axis.hlines(place + shift, 1e6 * best.low, 1e6 * best.high, color=color, lw=1.0)
                if tops == NATURAL:
                    name = "\n".join(textwrap.wrap(f"{'' if called else '~'}{method(best.name)}", 20))
                    axis.annotate(name, (1e6 * best.seconds, place), (0, -5), textcoords="offset points", ha="center",
                                  va="top", fontsize=LEAST_TEXT, color=color)  # fmt: skip
        axis.set(xscale="log", ylim=(len(classes) - 0.3, -0.5), yticks=range(len(classes)), yticklabels=classes,
                 xlabel="time of a safe run (µs)", title=f"to {power(target)} rad")  # fmt: skip
        axis.margins(x=0.5)
        axis.grid(visible=False, axis="y")
    axes[0, 0].plot([], [], "ko", label="natural tops")
    axes[0, 0].plot([], [], "ko", fillstyle="none", label="strata, as drawn")
    few_ticks(*axes[0], most=4)
    axes[0, 0].set_ylabel("what the method needs")
    style.legend_below(figure, axes)
    headline(figure, "What you can supply decides how fast a safe run is: the cheapest method of each class")
    return Picture(
        "classes", figure,
        f"The cheapest method of each class of needs at the one setting with which {SAFE:.0%} of the tops keep the "
        "axis "
        f"error: {span(data)} (named), and strata. Bars: 95 % of a bootstrap over tops and prices; ~: the lead is "
        "inside "
        "them. Grey: this-top, methods made of this very top's equations, for no other body.",
        "Dots of the time of the cheapest method of each class, a panel for each error.",
        lead="By what you can supply",
    )  # fmt: skip


def draw_run_lengths(data: xr.DataTree) -> Picture:
    """The share of natural tops that each variant has solved within so many force evaluations, one panel a target."""
    targets = cells.targets(data)
    each = {target: cells.costs(data, Cell("short", "axis", target, NATURAL), EVALUATIONS) for target in targets}
    order: list[str] = []
    for target in targets:
        order += [
            one.name for one in cells.contest(data, Cell("short", "axis", target, NATURAL), EVALUATIONS).standings[:2]
        ]
    rows = list(dict.fromkeys([*order, "rk4[axis]", "strang[axis]", "dop853-compiled-fixed[axis]"]))[:NAMED]
    labels = "force evaluations of a run", "share of tops solved"
    figure, axes = grid(len(targets), 2, labels, height=2.3, sharex=True, sharey=True)
    ends = [np.quantile(part, LATEST) for taken in each.values() for name in rows if name in taken.names
            if (part := taken.values[taken.names.index(name)])[np.isfinite(part)].size
            and np.isfinite(part := part[np.isfinite(part)]).any()]  # fmt: skip
    cheapest = min((float(taken.values.min()) for taken in each.values() if taken.values.size), default=1.0)
    budgets = np.geomspace(0.9 * cheapest, 1.5 * max(ends, default=10.0 * cheapest), 400)
    for axis, (target, taken) in zip(axes, each.items(), strict=True):
        for name, costs in zip(taken.names, taken.values, strict=True):
            share = run_lengths(costs, budgets)
            if name in rows:
                axis.plot(budgets, share, markevery=(5 * rows.index(name), len(budgets) // MARKS), lw=1.6, zorder=3,
                          label=method(name), **style.line(name))  # fmt: skip
            else:
                axis.plot(budgets, share, color=style.GREY, lw=0.6, alpha=0.4, zorder=1)
        axis.axhline(HALF, color="black", lw=0.8, ls=(0, (1, 2)), zorder=2)
        axis.set(xscale="log", ylim=(0.0, 1.03), title=f"axis error below {power(target)} rad")
        axis.yaxis.set_major_formatter(lambda value, _: f"{100.0 * value:.0f} %")
    axes[0].plot([], [], color=style.GREY, lw=0.8, label="all other methods for any body")
    few_ticks(*axes, most=5)
    style.legend_below(figure, axes)
    first = [cells.contest(data, Cell("short", "axis", target, NATURAL), EVALUATIONS).first for target in targets]
    told = [f"{method(one.name)} on {percent(one.share)} to {raised(target)}"
            for target, one in zip(targets, first, strict=True) if one]  # fmt: skip
    headline(figure, f"Fewest force evaluations for any body: {', '.join(told)} rad")
    return Picture(
        "run-lengths-evaluations", figure,
        f"Share of {span(data)} on which a method has met the axis error within so many force evaluations, at the step "
        "or tolerance that suits the top (hindsight). Further left needs fewer; a line that ends higher solves more "
        "tops "
        f"within {float(np.nanmax(data['short']['budget'].values)) / cells.nutations(data, 'short'):,.0f} evaluations "
        "a "
        "nutation. An evaluation has no price here: a stage, a kick and a derivative of a series count alike.",
        f"Empirical distribution functions of the cost, one panel for each axis error, {len(rows)} lines with a name.",
    )  # fmt: skip


def draw_silent(data: xr.DataTree) -> Picture | None:
    """Wrong and silent runs by kind of top and steps a nutation, of three methods."""
    names = [name for name in SILENT_OF if name in data["short"]["variant"].values]
    if not names:
        return None
    kinds = [place for place, kind in enumerate(KINDS[:-1])]
    figure, axes = panels(1, len(names), height=0.34 * len(kinds) + 1.1, sharey=True)
    for axis, name in zip(axes[0], names, strict=True):
        one = cells.health(data, name)
        there = np.flatnonzero((one.setting > 4.0) & (one.setting < 600.0))
        share = {key: (getattr(one, key)[there] / np.maximum(one.drawn, 1.0))[:, kinds].T
                 for key in ("wrong", "silent", "dropped")}  # fmt: skip
        axis.imshow(share["silent"], cmap="Oranges", vmin=0.0, vmax=0.6, aspect="auto")
        for (k, s), silent in np.ndenumerate(share["silent"]):
            known = f"{100 * silent:.0f}\n/{100 * share['wrong'][k, s]:.0f}"
            label = "-" if share["dropped"][k, s] > HALF else known
            axis.text(s, k, label, ha="center", va="center", fontsize=LEAST_TEXT - 0.5,
                      color="white" if silent > 0.4 else "black")  # fmt: skip
        axis.set(title=name, xticks=range(there.size), xticklabels=[f"{one.setting[s]:.3g}" for s in there],
                 yticks=range(len(kinds)), yticklabels=KINDS[:-1], xlabel="steps a nutation")  # fmt: skip
        axis.tick_params(axis="x", labelrotation=60, length=0)
        axis.grid(visible=False)
    axes[0, 0].set_ylabel("kind of top")
    one = cells.health(data, names[0])
    at = int(np.argmin(np.abs(one.setting - 69.92)))
    shares = one.silent[at] / np.maximum(one.drawn, 1.0)
    hard = int(np.argmax(shares[:-1]))
    headline(
        figure,
        f"Wrong runs without a sign are near the separatrix: at {one.setting[at]:.2g} steps {method(names[0])} is "
        f"silent on {percent(shares[hard])} of {KINDS[hard]} tops, {percent(shares[KINDS.index(NATURAL)])} of natural "
        "ones",
    )
    return Picture(
        "silent", figure,
        f"Per cent of the tops of a kind whose run is silent / wrong. Wrong: axis off by more than {WRONG:g} rad "
        "within "
        f"{cells.nutations(data, 'short'):g} nutations. Silent: wrong, though it ends well and keeps energy and "
        "momenta to "
        f"{KEPT:.0%}. A dash: more than half of the tops were dropped for the budget. The strata are chosen to hold "
        "what "
        "is hard; natural tops are drawn from plain distributions.",
        "Heat maps of the share of silent failures by kind of top and steps a nutation, a panel a method.",
        lead="How often a run is wrong without a sign",
    )  # fmt: skip


def draw_map(data: xr.DataTree) -> Picture:
    """Three panels: the family of the cheapest variant for every allowed error and run length."""
    each = {quantity: far.diagram(data, quantity) for quantity in far.QUANTITIES}
    area: Counter[str] = Counter()
    for panel in each.values():
        area.update(panel.names[k] for k in panel.winner.ravel() if k >= 0)
    spoken = {names.most_common(1)[0][0] for panel in each.values()
              if (names := Counter(panel.names[k] for k in panel.winner.ravel() if k >= 0))}  # fmt: skip
    groups: dict[str, list[str]] = {}
    for name, _ in area.most_common():
        groups.setdefault(name if name in spoken else integrator(name).family, []).append(name)
    colors = _colors(groups)
    figure, axes = panels(1, len(far.QUANTITIES), height=3.6, sharex=True, sharey=True)
    told = []
    for axis, (quantity, panel) in zip(axes[0], each.items(), strict=True):
        _panel(axis, panel, groups, colors)
        reached = panel.winner >= 0
        first, count = Counter(panel.names[k] for k in panel.winner[reached]).most_common(1)[0]
        axis.set_title(f"{TITLES[quantity]}\n{method(first)} in {count / reached.sum():.0%}")
        axis.set_xlabel("run length (nutations)")
        told.append(f"{method(first)} ({quantity})")
    axes[0][0].set_ylabel("largest error allowed")
    keys = [Patch(facecolor=colors[name], label=_key(name, rows)) for name, rows in groups.items()]
    keys += [
        Patch(facecolor="#CFCFCF", edgecolor="#777777", hatch=HATCH, label="pale, hatched: predicted, not run"),
        Patch(facecolor=UNREACHED, edgecolor="#BBBBBB", label="reached by no method"),
        Line2D([], [], ls="none", marker="o", ms=2.4, mfc="white", mec="black", mew=0.3,
               label=f"dot: another costs less than {far.TIE:g} times as much"),
    ]  # fmt: skip
    figure.legend(handles=keys, loc="outside lower center", ncols=2, frameon=False)
    count, members = len(each["axis"].names), data["far"].sizes["member"]
    share = sum(panel.predicted.sum() for panel in each.values()) / sum(
        (panel.winner >= 0).sum() for panel in each.values()
    )
    headline(figure, f"Cheapest for any body over the most errors and run lengths: {', '.join(told)}")
    return Picture(
        "map", figure,
        f"The cheapest of {count} methods for an allowed error up to a run length: medians over {members} natural "
        "tops, "
        "each method at the step or tolerance that suits a cell; no method made for this top takes part. Pale and "
        "hatched "
        f"cells, {share:.0%}, were not run: they are predicted from the measured growth of the winner's own runs, and "
        "some "
        "of them are checked at 10⁵ and 10⁶ nutations. Shape is the distance of height and vertical velocity from the "
        "true orbit, whatever the delay.",
        "Three maps of the cheapest method over run length and allowed error: axis, energy and shape.",
        lead="Cheapest by error and run length",
    )  # fmt: skip


def _colors(groups: dict[str, list[str]]) -> dict[str, Any]:
    """A colour for each group: of a family the base colour first, then its darkest shade, then the others."""
    used: Counter[str] = Counter()
    colors = {}
    for name in sorted(groups, key=lambda name: "[" not in name):
        family = integrator(groups[name][0]).family
        base, *others = (np.array(to_rgb(shade)) for shade in SHADES[family])
        colors[name] = [base, *sorted(others, key=lambda shade: shade.sum())][used[family] % (1 + len(others))]
        used[family] += 1
    return colors


def _panel(axis: Any, panel: far.Diagram, groups: dict[str, list[str]], painted: dict[str, Any]) -> None:
    """Cells in the colours of groups, paler and hatched where predicted, with names."""
    x, y = np.log10(panel.horizons), np.log10(far.TARGETS)
    dx, dy = 0.5 * (x[1] - x[0]), 0.5 * (y[0] - y[1])
    colors = np.full((*panel.winner.shape, 3), to_rgb(UNREACHED))
    masks = [np.isin(panel.winner, [k for k, row in enumerate(panel.names) if row in rows]) for rows in groups.values()]
    for mask, color in zip(masks, (painted[name] for name in groups), strict=True):
        colors[mask] = color
        colors[mask & panel.predicted] = PALE + (1.0 - PALE) * np.asarray(color)
    axis.imshow(colors, extent=(x[0] - dx, x[-1] + dx, y[-1] - dy, y[0] + dy), aspect="auto", interpolation="none")
    for t, h in np.argwhere(panel.predicted):
        axis.add_patch(Rectangle((x[h] - dx, y[t] - dy), 2 * dx, 2 * dy, fill=False, lw=0, hatch=HATCH, ec="#FFFFFF"))
    level = np.argwhere((panel.winner >= 0) & (panel.ratio < far.TIE))
    axis.plot(x[level[:, 1]], y[level[:, 0]], ls="none", marker="o", ms=2.4, mfc="white", mec="black", mew=0.3)
    axis.vlines(x[1:] - dx, y[-1] - dy, y[0] + dy, color="white", lw=0.3)
    axis.hlines(y[1:] + dy, x[0] - dx, x[-1] + dx, color="white", lw=0.3)
    for mask in masks:
        _names(axis, mask, panel, (x, y))
    axis.grid(visible=False)
    axis.set_xticks(range(1, 9, 2), [f"$10^{{{k}}}$" for k in range(1, 9, 2)])
    axis.set_yticks(range(-12, -1, 2), [f"$10^{{{k}}}$" for k in range(-12, -1, 2)])


def _names(axis: Any, mine: Any, panel: far.Diagram, centres: tuple[Any, Any]) -> None:
    """The method with the most cells of each region of a family that has room for its name."""
    from scipy import ndimage  # takes 0.15 s, which a study with nothing to do need not

    regions, count = ndimage.label(mine)
    for place in range(1, count + 1):
        region = regions == place
        label = split_name(panel.names[Counter(panel.winner[region].tolist()).most_common(1)[0][0]])[0]
        room = ndimage.binary_erosion(region, np.ones((3, 2 * round(LETTER * len(label) / 2) + 1)))
        if not room.any():
            continue
        places = np.argwhere(room)
        t, h = places[np.argmin(((places - np.argwhere(region).mean(axis=0)) ** 2).sum(axis=1))]
        axis.text(
            centres[0][h], centres[1][t], label, ha="center", va="center", fontsize=LEAST_TEXT + 1, color="#111111",
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.9},
        )  # fmt: skip


def _key(group: str, variants: list[str]) -> str:
    """A variant of the title, or a family with those of its variants that are the cheapest in the most cells."""
    if group in variants:
        return method(group)
    more = len(variants) - MOST_NAMES
    others = f" and {more} other{'s' * (more > 1)}" if more > 0 else ""
    label = f"{FAMILIES.get(group, group)}: {', '.join(map(method, variants[:MOST_NAMES]))}{others}"
    return textwrap.fill(label, KEY, break_on_hyphens=False)
