"""The drawings of the atlas: a page of small maps of outcomes, one a variant ``method[chart]``, and one map enlarged.

Two signs tell outcomes apart in a small map: colours that readers with any common colour blindness can tell apart, and
a hatch that is drawn into the map. The enlarged map has a word on every region that is large enough to hold one.
"""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from symtop.measure.verdicts import ACCURATE, OUTSIDE
from symtop.methods.framework.registry import split_name
from symtop.report.style import GREY, LEAST_TEXT, OUTCOME_COLORS, WIDTH, headline, panels

from .atlas import OutcomeMap, accurate_everywhere, closed_forms, common, maps
from .many_verdicts import VERDICTS
from .tables import PERIODS, Column

RASTER = {"small": (55, 90), "enlarged": (150, 220)}  # pixels of a map: hatches stay visible
SHADE = 0.72  # a hatch line is the same colour, darker
DARK = ("not_finite", "not_converged", "accurate", "left_chart")  # colours that need white letters
CONTROLS = {"step_size": "step (nutation periods)", "tolerance": "tolerance", "none": "nothing to set"}
SHORT = {"step_size": "step (nutations)", "tolerance": "tolerance"}  # below a small map
HATCHES = {  # of the legend, and in the map: which pixels, by row, counted upwards as the maps are drawn, and column
    "left_chart": ("////", lambda row, column: (row - column) % 10 == 0),
    "wrong_regime": ("\\\\\\\\", lambda row, column: (row + column) % 10 == 0),
    "not_converged": ("xxxx", lambda row, column: ((row + column) % 10 == 0) | ((row - column) % 10 == 0)),
    "drifting": ("----", lambda row, column: (row % 6 == 0) & (column >= 0)),
    "step_too_small": ("....", lambda row, column: (row % 5 == 0) & (column % 5 == 0)),
    "out_of_budget": ("||||", lambda row, column: (column % 6 == 0) & (row >= 0)),
}
SETTLED = {"step_size": "accurate at longer steps, not run", "tolerance": "accurate at looser tolerances, not run"}
PALE_GREEN = "#9FDAC8"
SEEN = 0.004  # of a small map: an outcome with less cannot be seen in it and has no entry in the key
LINES = {  # over the maps: label and dashes
    "limit": ("small nutations grow beyond", "-"),
    "third": ("nutation turns by 1/3 a step", (0, (4, 2))),
    "passage": ("one step passes the pole", (0, (1, 1.5))),
}
COLUMNS = (6, 5)  # of small maps: what takes the fewest rows, and then leaves the fewest places empty
INSET = 0.06  # of a small map's width: no tick closer to its sides, whose number would touch the neighbour's
LETTERS = 17  # of a line above a small map
AXES = {"spin": "spin r", "gap": r"gap $\delta$ (rad)"}  # what grows upwards
FALL_SPEED, FALL_PERIOD = 1.2, 4.22  # of the grazing family: rad/s at the pole, and its nutation period, s


def said(word: str) -> str:
    """An outcome as a figure names it."""
    return {"left_chart": "left its chart"}.get(word, word.replace("_", " "))


def sampled(values: Any, height: int, width: int) -> Any:
    """A map with this many rows and columns: the cells in the middle of each."""
    row, column = (
        (2 * np.arange(n) + 1) * size // (2 * n) for n, size in zip((height, width), values.shape, strict=True)
    )
    return values[row][:, column]


def painted(outcome: NDArray[np.uint8], made: NDArray[np.bool_], size: str = "enlarged") -> NDArray[np.float64]:
    """A map of outcomes, shape (rows, columns), as an image (height, width, 3) with hatches; `size` is of `RASTER`.

    It is pale where nothing was run.
    """
    from matplotlib.colors import to_rgb

    big = sampled(outcome, *RASTER[size])
    image = np.ones((*big.shape, 3))
    for index, word in enumerate(VERDICTS):
        region = big == index
        image[region] = to_rgb(OUTCOME_COLORS[word])
        if word in HATCHES:
            image[region & HATCHES[word][1](*np.indices(big.shape))] *= SHADE
    image[~sampled(made, *RASTER[size])] = to_rgb(PALE_GREEN)
    return image


def _name_regions(axis: Any, outcome: NDArray[np.uint8], extent: Sequence[float]) -> None:
    """Write each outcome's name where its largest region is widest, if it fits."""
    from scipy.ndimage import distance_transform_edt, label

    outcome = sampled(outcome, *np.minimum(RASTER["enlarged"], outcome.shape).tolist())
    height, width = outcome.shape
    for index in map(int, np.unique(outcome)):
        word = said(VERDICTS[index])
        regions, _ = label(outcome == index)
        largest = 1 + int(np.argmax(np.bincount(regions.ravel())[1:]))
        shape = (1.0 / height, 0.55 / width)  # as the text sees a cell: it is wider than high
        depth = distance_transform_edt(np.pad(regions == largest, 1), sampling=shape)[1:-1, 1:-1]
        row, column = np.unravel_index(int(np.argmax(depth)), depth.shape)
        if depth[row, column] < 0.05:
            continue
        half = 0.012 * len(word)  # of the text's width, in units of the map's
        x, y = np.clip((column + 0.5) / width, half, 1.0 - half), np.clip((row + 0.5) / height, 0.07, 0.93)
        axis.text(
            extent[0] + x * (extent[1] - extent[0]), extent[2] + y * (extent[3] - extent[2]), word, ha="center",
            va="center", fontsize=LEAST_TEXT, weight="bold", color="white" if VERDICTS[index] in DARK else "black",
            zorder=5, bbox={"facecolor": OUTCOME_COLORS[VERDICTS[index]], "edgecolor": "none", "pad": 0.8},
        )  # fmt: skip


def _edges(values: NDArray[np.float64]) -> tuple[float, float]:
    """Both ends of an axis of cells at logarithmically even values, as decimal logarithms."""
    if values.size < 2:
        return 0.0, 1.0
    half = 0.5 * (np.log10(values[-1]) - np.log10(values[0])) / (values.size - 1)
    return float(np.log10(values[0]) - half), float(np.log10(values[-1]) + half)


def _ticks(ends: tuple[float, float], most: int) -> tuple[range, list[str]]:
    """Places and names of the powers of ten between two decimal logarithms."""
    powers = range(int(np.ceil(ends[0] - 1e-9)), int(np.floor(ends[1] + 1e-9)) + 1)
    shown = powers[:: -(-len(powers) // most)]
    return shown, [f"{10.0**k:g}" if -3 <= k <= 2 else rf"$10^{{{k}}}$" for k in shown]


def draw_map(
    axis: Any, one: OutcomeMap, size: str = "enlarged", extent: tuple[float, float, float, float] | None = None
) -> None:
    """One map; parameter upwards, step or tolerance to the right, both logarithmic.

    Cells are equally wide, over `extent` if it is given (decimal logarithms): between the first value and the last of
    an axis every cell still holds its own value.
    """
    x, y = (extent[:2], extent[2:]) if extent else (_edges(one.settings), _edges(one.parameter))
    image = painted(one.outcome, one.made, size)
    axis.imshow(image, origin="lower", extent=(*x, *y), aspect="auto", interpolation="nearest")
    axis.grid(visible=False)
    most = 5 if size == "enlarged" else 3
    axis.set_xticks(*(([], []) if one.control == "none" else _ticks(x, most)))
    axis.set_yticks(*_ticks(y, most))
    if size == "enlarged":
        _name_regions(axis, one.outcome, (*x, *y))


def _line(axis: Any, x: Any, y: Any, name: str) -> list[str]:
    """One of `LINES` over a map, with a white edge; its name, if there was something to draw."""
    from matplotlib.patheffects import Normal, Stroke

    if np.isfinite(x).sum() < 2:
        return []
    ends = {"xlim": axis.get_xlim(), "ylim": axis.get_ylim()}
    edge = [Stroke(linewidth=2.2, foreground="white"), Normal()]
    axis.plot(np.log10(x), np.log10(y), color="black", lw=0.9, ls=LINES[name][1], path_effects=edge)
    axis.set(**ends)
    return [name]


def _limits(axis: Any, cell: xr.Dataset, one: OutcomeMap, over: str) -> list[str]:
    """The lines that belong on a map; returns the names of those that were drawn."""
    if over == "gap":  # the fall at 1.1 gap past the pole takes one step
        at = 1.1 * one.parameter / FALL_SPEED / FALL_PERIOD, one.parameter
        angles = split_name(str(cell["variant"].values))[1] == "angles"  # other charts have no pole
        return _line(axis, *at, "passage") if angles and one.control == "step_size" else []
    if Column.LINEAR_LIMIT not in cell:
        return []
    parameter = cell[Column.LIMIT_PARAMETER].values
    kinds = ((Column.LINEAR_LIMIT, "limit"), (Column.THIRD_TURN, "third"))
    return [name for variable, kind in kinds for name in _line(axis, cell[variable].values, parameter, kind)]


def by_area(shown: Mapping[str, OutcomeMap]) -> list[str]:
    """The variants of some maps, the largest accurate share first."""
    return sorted(shown, key=lambda name: -shown[name].shares[0])


def small_maps(data: xr.Dataset, scene: str, names: Sequence[str], over: str) -> Any:
    """A page of the maps over a scene's spin or gap, in the given order, each with its name and accurate share.

    Of each map the part is drawn that all of them have, of which the shares are, over the whole panel: the share that
    is printed is the share that is seen. Variants that are accurate everywhere have one panel together. The names of
    the variants with the largest and the smallest share are bold, but for closed forms.
    """
    shown = common({name: one for name, one in maps(data, scene).items() if name in names})
    exact = closed_forms(data, names)
    judged = [name for name in names if name not in exact] or names
    ends = [f"{shown[name].shares[0]:.0%}" for name in (judged[0], judged[-1])]
    drawn = dict[str, None]()  # outcomes and lines, for the legend
    across, upwards = (_reach([one[k] for one in shown.values()]) for k in (2, 1))
    inner = across[0] + INSET * (across[1] - across[0]), across[1] - INSET * (across[1] - across[0])
    alike = accurate_everywhere({name: shown[name] for name in names})
    alone = [name for name in names if name not in alike[1:]]  # one panel each
    columns = min(len(alone), min(COLUMNS, key=lambda count: (-(-len(alone) // count), -len(alone) % count)))
    rows = -(-len(alone) // columns)
    titles = {name: _title(name, shown[name]) for name in alone}
    if alike:
        titles[alike[0]] = f"{len(alike)} methods\n(named below) 100%"
    high = [max(titles[name].count("\n") for name in alone[k : k + columns]) + 1 for k in range(0, len(alone), columns)]
    height = 0.62 + 0.115 * sum(high) / rows + 0.7 / rows
    figure, axes = panels(rows, columns, width=WIDTH * max(columns, 3) / max(columns, COLUMNS[-1]), height=height)
    figure.get_layout_engine().set(w_pad=0.02, h_pad=0.015, wspace=0.01, hspace=0.01)
    for axis in axes.flat[len(alone) :]:
        axis.set_visible(False)
    for k, (axis, name) in enumerate(zip(axes.flat, alone, strict=False)):
        one = shown[name]
        parts = zip(VERDICTS, one.shares, strict=False)
        drawn |= dict.fromkeys(word for word, share in parts if share >= SEEN)
        drawn |= {} if one.made.all() else {SETTLED[one.control]: None}
        draw_map(axis, one, "small", None if one.control == "none" else (*across, *upwards))
        if one.control != "none":
            axis.set_xticks(*_ticks(inner, 3))
            axis.set_yticks(*_ticks(upwards, 3))
        drawn |= dict.fromkeys(_limits(axis, data.sel(scene=scene, variant=name), one, over))
        bold = name in alike or (name in judged and f"{one.shares[0]:.0%}" in ends)
        weight = "bold" if bold else "normal"
        axis.set_title(titles[name], fontsize=LEAST_TEXT, pad=2.0, linespacing=1.0, weight=weight)
        axis.tick_params(length=1.5, pad=1.0, labelsize=LEAST_TEXT)
        if k % columns:
            axis.set_yticklabels([])
        if k + columns < len(alone):
            axis.set_xticklabels([])
        else:
            axis.set_xlabel(SHORT[one.control], fontsize=LEAST_TEXT, labelpad=1.0)
    figure.supylabel(AXES[over], fontsize=8.0)
    _key(figure, drawn)
    said = [accurate_means(scene), *([listed(alike)] if alike else [])]
    lines = [line for text in said for line in textwrap.wrap(text, round(18.0 * figure.get_figwidth()))]
    figure.legends[0].set_title("\n".join(lines))
    return figure


def accurate_means(scene: str) -> str:
    """What `accurate` is in the maps of a scene."""
    length = "one fall past the pole" if scene == "grazing" else f"{PERIODS:g} nutations"
    return f"Accurate: within {ACCURATE:g} rad and {OUTSIDE:g} of the nutation's width of the true axis, over {length}."


def listed(alike: Sequence[str]) -> str:
    """The variants that share a panel; without their chart if all are on the axis."""
    on_axis = all(split_name(name)[1] == "axis" for name in alike)
    names = ", ".join(split_name(name)[0] if on_axis else name for name in alike)
    return f"Accurate everywhere{', all [axis]' if on_axis else ''}: {names}."


def _title(name: str, one: OutcomeMap) -> str:
    method, chart = split_name(name)
    share = f"{one.shares[0]:.0%}"
    return "\n".join([*textwrap.wrap(method, LETTERS), f"[{chart}] {share}" if chart else share])


def _reach(values: Sequence[NDArray[np.float64]]) -> tuple[float, float]:
    """Both ends of an axis for some maps, as decimal logarithms: their outermost values."""
    low, high = (float(np.log10(pick([pick(one) for one in values]))) for pick in (np.min, np.max))
    return (low, high) if high > low else _edges(values[0])


def enlarged(data: xr.Dataset, family: str, name: str, message: str) -> Any:
    """The two maps of one variant, over spin and over the gap to a pole, with a word on every region."""
    both = {"spin": (family, maps(data, family)), "gap": ("grazing", maps(data, "grazing"))}
    both = {over: (scene, shown) for over, (scene, shown) in both.items() if name in shown}
    figure, axes = panels(1, len(both), width=WIDTH * max(len(both), 1.4) / 2, height=2.9)
    drawn: dict[str, None] = {}
    for axis, (over, (scene, shown)) in zip(axes[0], both.items(), strict=True):
        one = shown[name]
        drawn |= dict.fromkeys(VERDICTS[index] for index in np.unique(sampled(one.outcome, *RASTER["enlarged"])))
        draw_map(axis, one)
        drawn |= {} if one.made.all() else {SETTLED[one.control]: None}
        drawn |= dict.fromkeys(_limits(axis, data.sel(scene=scene, variant=name), one, over))
        axis.set(xlabel=CONTROLS[one.control], ylabel=AXES[over])
        axis.set_title(f"scene {scene}, {'its spin changed' if over == 'spin' else 'a fall past a pole'}")
    headline(figure, message)
    _key(figure, drawn)
    return figure


def _key(figure: Any, drawn: Mapping[str, None]) -> None:
    shown = [name for name in (VERDICTS[0], *SETTLED.values(), *VERDICTS[1:], *LINES) if name in drawn]
    narrow = set(drawn).isdisjoint(("limit", "third", *SETTLED.values()))
    columns = (4 if narrow else 3) if figure.get_figwidth() > 5.0 else 2
    figure.legend(handles=list(map(_handle, shown)), loc="outside lower center", ncols=columns, frameon=False)


def _handle(name: str) -> Any:
    """The entry of the legend for an outcome, or for one of `LINES`."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    if name in LINES:
        return Line2D([], [], color="black", lw=1.1, ls=LINES[name][1], label=LINES[name][0])
    if name in SETTLED.values():
        return Patch(facecolor=PALE_GREEN, label=name, edgecolor=GREY, lw=0.4)
    hatch = HATCHES[name][0] if name in HATCHES else None
    return Patch(facecolor=OUTCOME_COLORS[name], label=said(name), hatch=hatch, edgecolor=GREY, lw=0.4)
