"""The pictures: the family of the cheapest variant for every allowed error and horizon, three errors wide."""

import textwrap
from collections import Counter
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from symtop.methods.framework.registry import integrator, split_name
from symtop.report.style import LEAST_TEXT, headline, look, panels
from symtop.runner.study import Picture

from . import words
from .runs import POPULATION, QUANTITIES
from .tables import TARGETS, TIE, Diagram, diagram, tops_run

HATCH = "///"  # foretold
LETTER = 0.62  # of a cell: the width of a letter of a name on a region
PALE = 0.45  # of white in the colour of a family beside that of its variant in the title
MOST_NAMES = 4  # of a family in the key
KEY = 44  # letters of a line of it
UNREACHED = "#F0F0F0"
LEVEL: dict[str, Any] = {
    "ls": "none",
    "marker": "o",
    "ms": 2.4,
    "mfc": "white",
    "mec": "black",
    "mew": 0.3,
}  # of cells that are level
FAMILIES = {
    "splitting": "splitting", "discrete-lagrangian": "discrete Lagrangian", "runge-kutta": "Runge-Kutta and Gauss",
    "taylor": "Taylor series",
}  # fmt: skip


def pictures(data: xr.DataTree) -> list[Picture]:
    """The diagram of the random tops, and that of one scene."""
    return [draw(data, name) for name in tops_run(data)]


def draw(data: xr.DataTree, name: str) -> Picture:
    """Three panels, of the random tops or of a scene."""
    each = {quantity: diagram(data, name, quantity) for quantity in QUANTITIES}
    area: Counter[str] = Counter()
    for panel in each.values():
        area.update(panel.names[k] for k in panel.winner.ravel() if k >= 0)
    leaders = words.leaders(data, name)
    spoken = {row for row, _ in leaders.values()}  # variants of the title, which have a colour of their own
    groups: dict[str, list[str]] = {}
    for row, _ in area.most_common():
        groups.setdefault(row if row in spoken else integrator(row).family, []).append(row)
    colors = {name: _color(rows, spoken) for name, rows in groups.items()}
    figure, axes = panels(1, len(QUANTITIES), height=3.6, sharex=True, sharey=True)
    for axis, quantity in zip(axes[0], QUANTITIES, strict=True):
        _panel(axis, each[quantity], groups, colors)
        title = words.PANELS[quantity].replace(": ", "\n", 1)
        if quantity in leaders:
            row, share = leaders[quantity]
            title += f"\n{split_name(row)[0]} in {share:.0%}"
        axis.set_title(title)
        axis.set_xlabel("run length (nutations)")
    axes[0][0].set_ylabel("largest error allowed")
    keys = [Patch(facecolor=colors[name], label=_key(name, rows)) for name, rows in groups.items()]
    keys += [
        Patch(facecolor="white", edgecolor="#777777", hatch=HATCH, label="hatched: predicted, not run"),
        Patch(facecolor=UNREACHED, edgecolor="#BBBBBB", label="reached by no method: not counted"),
        Line2D([], [], **LEVEL, label=f"dot: another costs less than {TIE:g} times as much"),
    ]
    figure.legend(handles=keys, loc="outside lower center", ncols=2, frameon=False)
    figure.legends[0].set_title(
        "Cheapest: the least cost of a run, its force evaluations times the measured price of one, among "
        f"{len(words.taking_part(data))} methods.\n{words.foretold_share(data, name):.0%} of the cells that any of "
        "them reaches are predicted."
    )
    headline(figure, words.message(data, name))
    tops = "random tops (medians)" if name == POPULATION else f"the scene {name}"
    place = "random tops (medians, no named scene)" if name == POPULATION else tops
    return Picture(
        "map" if name == POPULATION else name,
        figure,
        f"The cheapest variant, method[chart], or its family, for an allowed error up to a horizon, on {place}; every "
        "variant has the step or tolerance that suits a cell. Axis is the angle between the axes at one time, energy "
        "is relative to E0 - min V, shape is the distance of height and vertical velocity from the true orbit, "
        "whatever the delay. A name is that of the method with the most cells of a region. Hatched cells were not "
        f"run: they are predicted from the measured growth of the winner's own run. {words.level_sentence(data, name)}",
        f"Three maps of the cheapest method over horizon and allowed error on {tops}: axis, energy and shape.",
        lead="Cheapest by error and run length" if name == POPULATION else "",
    )


def _color(variants: list[str], spoken: set[str]) -> Any:
    """That of the variant with the most cells; paler if a variant of the title is of the same family."""
    kin = {integrator(row).family for row in spoken.difference(variants)}
    part = PALE if integrator(variants[0]).family in kin else 0.0
    return part + (1.0 - part) * np.array(to_rgb(look(variants[0]).color))


def _panel(axis: Any, panel: Diagram, groups: dict[str, list[str]], painted: dict[str, Any]) -> None:
    """Cells in the colours of groups, hatched where foretold, with names."""
    x, y = np.log10(panel.horizons), np.log10(TARGETS)
    dx, dy = 0.5 * (x[1] - x[0]), 0.5 * (y[0] - y[1])
    colors = np.full((*panel.winner.shape, 3), to_rgb(UNREACHED))
    masks = [np.isin(panel.winner, [k for k, row in enumerate(panel.names) if row in rows]) for rows in groups.values()]
    for mask, color in zip(masks, painted.values(), strict=True):
        colors[mask] = color
    axis.imshow(colors, extent=(x[0] - dx, x[-1] + dx, y[-1] - dy, y[0] + dy), aspect="auto", interpolation="none")
    for t, h in np.ndindex(panel.winner.shape):  # thin white edges: cells can be counted
        marks: dict[str, Any] = {"hatch": HATCH, "ec": "#FFFFFF99"} if panel.foretold[t, h] else {"ec": "none"}
        axis.add_patch(Rectangle((x[h] - dx, y[t] - dy), 2 * dx, 2 * dy, fill=False, lw=0, **marks))
    level = np.argwhere((panel.winner >= 0) & (panel.ratio < TIE))
    axis.plot(x[level[:, 1]], y[level[:, 0]], **LEVEL)
    axis.vlines(x[1:] - dx, y[-1] - dy, y[0] + dy, color="white", lw=0.3)
    axis.hlines(y[1:] + dy, x[0] - dx, x[-1] + dx, color="white", lw=0.3)
    for mask in masks:
        _names(axis, mask, panel, (x, y))
    axis.grid(visible=False)
    axis.set_xticks(range(1, 10, 2), [f"$10^{{{k}}}$" for k in range(1, 10, 2)])
    axis.set_yticks(range(-12, -1, 2), [f"$10^{{{k}}}$" for k in range(-12, -1, 2)])


def _names(axis: Any, mine: Any, panel: Diagram, centres: tuple[Any, Any]) -> None:
    """The method with the most cells of each region of a family that has room for its name."""
    from scipy import ndimage  # takes 0.15 s, which a study with nothing to do need not

    regions, count = ndimage.label(mine)
    for place in range(1, count + 1):
        region = regions == place
        label = _method(panel.names[Counter(panel.winner[region].tolist()).most_common(1)[0][0]])
        room = ndimage.binary_erosion(region, np.ones((3, 2 * round(LETTER * len(label) / 2) + 1)))
        if not room.any():
            continue
        places = np.argwhere(room)
        t, h = places[np.argmin(((places - np.argwhere(region).mean(axis=0)) ** 2).sum(axis=1))]
        axis.text(
            centres[0][h], centres[1][t], label, ha="center", va="center", fontsize=LEAST_TEXT + 1, color="#111111",
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.9},
        )  # fmt: skip


def _method(variant: str) -> str:
    """A variant without its chart, if that is the axis, which most of them have."""
    return split_name(variant)[0] if variant.endswith("[axis]") else variant


def _key(group: str, variants: list[str]) -> str:
    """A variant of the title, or a family with those of its variants that are the cheapest in the most cells."""
    if group in variants:
        return group
    more = len(variants) - MOST_NAMES
    others = f" and {more} other{'s' * (more > 1)}" if more > 0 else ""
    label = f"{FAMILIES.get(group, group)}: {', '.join(map(_method, variants[:MOST_NAMES]))}{others}"
    return textwrap.fill(label, KEY, break_on_hyphens=False)
