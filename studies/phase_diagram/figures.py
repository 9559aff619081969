"""The picture: the cheapest row of every allowed error and horizon; three errors wide, population above scene."""

from collections import Counter
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.colors import to_rgb
from matplotlib.patches import Patch, Rectangle

from symtop.methods.registry import integrator, split_name
from symtop.report.style import headline, look, panels
from symtop.runner.study import Picture

from . import words
from .runs import POPULATION, QUANTITIES
from .tables import TARGETS, TIE, Diagram, diagram, tops_run

NAMED = 10  # rows with their names on their regions
HATCH = "///"  # foretold
LEAST = 8  # cells of a region that bears a name
PALE = 0.55  # of white in a cell that is level
FAMILIES = {
    "splitting": "splitting", "discrete-lagrangian": "discrete Lagrangian", "runge-kutta": "Runge-Kutta and Gauss",
    "taylor": "Taylor series",
}  # fmt: skip


def pictures(data: xr.DataTree) -> list[Picture]:
    """The diagram."""
    return [draw(data)]


def draw(data: xr.DataTree) -> Picture:
    """Three panels a population or scene."""
    places = tops_run(data)
    each = {(name, quantity): diagram(data, name, quantity) for name in places for quantity in QUANTITIES}
    area: Counter[str] = Counter()
    for panel in each.values():
        area.update(panel.names[k] for k in panel.winner.ravel() if k >= 0)
    spoken = [name for name, _ in area.most_common(NAMED)]
    figure, axes = panels(len(places), len(QUANTITIES), height=2.7, sharex=True, sharey=True)
    for row, name in enumerate(places):
        for axis, quantity in zip(axes[row], QUANTITIES, strict=True):
            _panel(axis, each[name, quantity], spoken)
            axis.set_title(words.PANELS[quantity].replace(": ", "\n", 1) if row == 0 else "")
        kind = "" if name == POPULATION else "scene "
        axes[row][0].set_ylabel(f"{kind}{words.named(name)}:\nlargest error allowed")
    for axis in axes[-1]:
        axis.set_xlabel("run length (nutations)")
    families = {integrator(name).family: look(name).color for name, _ in reversed(area.most_common())}
    keys = [Patch(facecolor=color, label=FAMILIES.get(family, family)) for family, color in families.items()]
    keys += [
        Patch(facecolor="#BBBBBB", label=f"paler, in any colour: another within {TIE:g}"),
        Patch(facecolor="white", edgecolor="#555555", hatch=HATCH, label="hatched: foretold, not run"),
        Patch(facecolor="#F2F2F2", edgecolor="#CCCCCC", label="reached by none"),
    ]
    figure.legend(handles=keys, loc="outside lower center", ncols=3, frameon=False)
    headline(figure, words.message(data))
    return Picture(
        "map",
        figure,
        "The cheapest row, method[chart], for an allowed error up to a horizon, on random tops (medians) and on one "
        "scene: phase is the angle between the axes at the same time; energy is relative to E0 - min V; shape is the "
        "distance of height and vertical velocity from the true orbit, which a delay does not change. At each cell "
        "every row has the step or tolerance that suits it. Hatched: the error of the winner is foretold from the "
        f"measured growth of its own run; pale: another row within {TIE:g}; grey: no row reaches it. "
        f"{words.spot_sentence(data)} Gauss methods take no part in energy and shape, which they keep at any step. "
        "Closed forms (exact, exact-discrete) take no part: they cost the same at every horizon.",
        "Maps of the cheapest method over horizon and allowed error, three panels for random tops, three for a scene.",
        lead="Cheapest by error and run length",
    )


def _panel(axis: Any, panel: Diagram, spoken: list[str]) -> None:
    """Coloured cells, hatched where foretold, with borders and names."""
    x, y = np.log10(panel.horizons), np.log10(TARGETS)
    dx, dy = 0.5 * (x[1] - x[0]), 0.5 * (y[0] - y[1])
    colors = np.full((*panel.winner.shape, 3), to_rgb("#F2F2F2"))
    for k, name in enumerate(panel.names):
        mine = panel.winner == k
        colors[mine] = to_rgb(look(name).color)
    level = (panel.winner >= 0) & (panel.ratio < TIE)
    colors[level] = PALE + (1.0 - PALE) * colors[level]
    axis.imshow(colors, extent=(x[0] - dx, x[-1] + dx, y[-1] - dy, y[0] + dy), aspect="auto", interpolation="none")
    for t, h in zip(*np.nonzero(panel.foretold), strict=True):
        axis.add_patch(Rectangle((x[h] - dx, y[t] - dy), 2 * dx, 2 * dy, fill=False, hatch=HATCH, ec="#00000055", lw=0))
    _borders(axis, panel.winner, (x, y), (dx, dy))
    for k, name in enumerate(panel.names):
        if name in spoken:
            _name(axis, panel.winner == k, name, (x, y))
    axis.grid(visible=False)
    axis.set_xticks(range(1, 10, 2), [f"$10^{{{k}}}$" for k in range(1, 10, 2)])
    axis.set_yticks(range(-12, -1, 2), [f"$10^{{{k}}}$" for k in range(-12, -1, 2)])


def _borders(axis: Any, winner: Any, centres: tuple[Any, Any], half: tuple[float, float]) -> None:
    """Lines between cells of different rows."""
    (x, y), (dx, dy) = centres, half
    for t, h in zip(*np.nonzero(winner[:, 1:] != winner[:, :-1]), strict=True):
        axis.plot([x[h] + dx] * 2, [y[t] - dy, y[t] + dy], color="#222222", lw=0.9)
    for t, h in zip(*np.nonzero(winner[1:] != winner[:-1]), strict=True):
        axis.plot([x[h] - dx, x[h] + dx], [y[t] - dy] * 2, color="#222222", lw=0.9)


def _name(axis: Any, mine: Any, name: str, centres: tuple[Any, Any]) -> None:
    """The name on the thickest place of the largest region of a row."""
    from scipy import ndimage  # takes 0.15 s, which a study with nothing to do need not

    regions, count = ndimage.label(mine)
    if not count:
        return
    sizes = ndimage.sum_labels(mine, regions, range(1, count + 1))
    largest = regions == 1 + int(np.argmax(sizes))
    if largest.sum() < LEAST:
        return
    depth = ndimage.distance_transform_edt(np.pad(largest, 1))[1:-1, 1:-1]
    places = np.argwhere(depth > depth.max() - 0.6)
    t, h = places[np.argmin(((places - np.argwhere(largest).mean(axis=0)) ** 2).sum(axis=1))]
    x = min(max(centres[0][h], 3.0), 7.4)
    axis.text(
        x, centres[1][t], split_name(name)[0] if name.endswith("[axis]") else name, ha="center", va="center",
        fontsize=7.5, color="#111111",
        bbox={"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none", "alpha": 0.82},
    )  # fmt: skip
