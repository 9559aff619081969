"""The drawings of the atlas: maps of outcomes, a row an integrator.

Three signs tell outcomes apart: colours that readers with any common colour blindness can tell apart, a hatch that is
drawn into the map, and a word on every region that is large enough to hold one.
"""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from symtop.measure.verdicts import VERDICTS
from symtop.report.style import GREY, OUTCOME_COLORS, panels

from .atlas import OutcomeMap, maps
from .tables import Column

RASTER = (110, 430)  # pixels of one map, about those it has in the figure
SHADE = 0.72  # a hatch line is the same colour, darker
DARK = ("not_finite", "not_converged", "accurate", "left_chart")  # colours that need white letters
CONTROLS = {"step_size": "step (nutation periods)", "tolerance": "tolerance", "none": "nothing to set"}
HATCHES = {  # of the legend, and in the map: which pixels, by row and column
    "left_chart": ("////", lambda row, column: (row + column) % 10 == 0),
    "wrong_regime": ("\\\\\\\\", lambda row, column: (row - column) % 10 == 0),
    "not_converged": ("xxxx", lambda row, column: ((row + column) % 10 == 0) | ((row - column) % 10 == 0)),
    "drifting": ("----", lambda row, column: (row % 6 == 0) & (column >= 0)),
    "step_too_small": ("....", lambda row, column: (row % 5 == 0) & (column % 5 == 0)),
    "out_of_budget": ("||||", lambda row, column: (column % 6 == 0) & (row >= 0)),
}
LINES = {  # over the maps: label and dashes
    "limit": ("linear limit", "-"),
    "third": ("a third of a turn a step", (0, (4, 2))),
    "passage": ("one step passes the pole", (0, (1, 1.5))),
}
FALL_SPEED, FALL_PERIOD = 1.2, 4.22  # of the grazing family: rad/s at the pole, and its nutation period, s


def sampled(outcome: NDArray[np.uint8], height: int, width: int) -> NDArray[np.uint8]:
    """A map with this many rows and columns: the cells in the middle of each."""
    row, column = (
        (2 * np.arange(n) + 1) * size // (2 * n) for n, size in zip((height, width), outcome.shape, strict=True)
    )
    return outcome[row][:, column]


def painted(outcome: NDArray[np.uint8]) -> NDArray[np.float64]:
    """A map of outcomes, shape (rows, columns), as an image (height, width, 3) with hatches."""
    from matplotlib.colors import to_rgb

    height, width = RASTER
    big = sampled(outcome, height, width)
    image = np.ones((*big.shape, 3))
    for index, word in enumerate(VERDICTS):
        region = big == index
        image[region] = to_rgb(OUTCOME_COLORS[word])
        if word in HATCHES:
            image[region & HATCHES[word][1](*np.indices(big.shape))] *= SHADE
    return image


def _name_regions(axis: Any, outcome: NDArray[np.uint8], extent: Sequence[float]) -> None:
    """Write each outcome's name where its largest region is widest, if it fits."""
    from scipy.ndimage import distance_transform_edt, label

    outcome = sampled(outcome, *np.minimum(RASTER, outcome.shape).tolist())
    height, width = outcome.shape
    for index in map(int, np.unique(outcome)):
        word = VERDICTS[index].replace("_", " ")
        regions, _ = label(outcome == index)
        largest = 1 + int(np.argmax(np.bincount(regions.ravel())[1:]))
        # a cell is seen from the text's shape: six times as wide as high
        shape = (1.0 / height, 0.5 / width)
        depth = distance_transform_edt(np.pad(regions == largest, 1), sampling=shape)[1:-1, 1:-1]
        row, column = np.unravel_index(int(np.argmax(depth)), depth.shape)
        if depth[row, column] < 0.055:
            continue
        half = 0.0085 * len(word)  # of the text's width, in units of the map's
        x, y = np.clip((column + 0.5) / width, half, 1.0 - half), np.clip((row + 0.5) / height, 0.07, 0.93)
        axis.text(
            extent[0] + x * (extent[1] - extent[0]), extent[2] + y * (extent[3] - extent[2]), word, ha="center",
            va="center", fontsize=7.5, weight="bold", color="white" if VERDICTS[index] in DARK else "black",
        )  # fmt: skip


def _edges(values: NDArray[np.float64]) -> tuple[float, float]:
    """Both ends of an axis of cells at logarithmically even values, as decimal logarithms."""
    if values.size < 2:
        return 0.0, 1.0
    half = 0.5 * (np.log10(values[-1]) - np.log10(values[0])) / (values.size - 1)
    return float(np.log10(values[0]) - half), float(np.log10(values[-1]) + half)


def _ticks(ends: tuple[float, float]) -> tuple[range, list[str]]:
    """Places and names of the powers of ten between two decimal logarithms."""
    powers = range(int(np.ceil(ends[0] - 1e-9)), int(np.floor(ends[1] + 1e-9)) + 1)
    shown = powers[:: 1 if len(powers) <= 5 else 2 if len(powers) <= 8 else 3]
    return shown, [f"{10.0**k:g}" if -3 <= k <= 2 else rf"$10^{{{k}}}$" for k in shown]


def draw_map(axis: Any, one: OutcomeMap) -> None:
    """One map; parameter upwards, step or tolerance to the right, both logarithmic."""
    x, y = _edges(one.settings), _edges(one.parameter)
    axis.imshow(painted(one.outcome), origin="lower", extent=(*x, *y), aspect="auto", interpolation="nearest")
    _name_regions(axis, one.outcome, (*x, *y))
    axis.grid(visible=False)
    axis.set_xticks(*(([], []) if one.control == "none" else _ticks(x)), fontsize=7.5)
    axis.set_yticks(*_ticks(y), fontsize=7.5)


def _line(axis: Any, x: Any, y: Any, name: str) -> list[str]:
    """One of `LINES` over a map, with a white edge; its name, if there was something to draw."""
    from matplotlib.patheffects import Normal, Stroke

    if np.isfinite(x).sum() < 2:
        return []
    ends = {"xlim": axis.get_xlim(), "ylim": axis.get_ylim()}
    edge = [Stroke(linewidth=2.6, foreground="white"), Normal()]
    axis.plot(np.log10(x), np.log10(y), color="black", lw=1.1, ls=LINES[name][1], path_effects=edge)
    axis.set(**ends)
    return [name]


def atlas_page(data: xr.Dataset, family: str, names: Sequence[str], sentences: Mapping[str, str]) -> Any:
    """One row an integrator: its map over spin and step, its map over the gap to a pole and step, its sentence."""
    over_spin, over_gap = maps(data, family), maps(data, "grazing")
    grazed = any(name in over_gap for name in names)
    ratios = {"width_ratios": [1.25, 1.0][: 1 + grazed]}
    texts = [textwrap.wrap(sentences[name], 128) for name in names]
    height = 1.25 + 0.16 * max(map(len, texts))
    figure, axes = panels(len(names), 1 + grazed, width=8.4, height=height, gridspec_kw=ratios)
    drawn: dict[str, None] = {}  # outcomes and lines, for the legend
    controls = [over_spin[name].control for name in names]
    for line, name, lines, control, below in zip(axes, names, texts, controls, [*controls[1:], None], strict=True):
        for axis, drawn_maps, label in zip(line, (over_spin, over_gap), ("spin r", r"gap $\delta$"), strict=False):
            one = drawn_maps.get(name)
            if one is None:
                axis.set_visible(False)
                continue
            drawn |= dict.fromkeys(VERDICTS[k] for k in np.unique(one.outcome))
            draw_map(axis, one)
            axis.set_ylabel(label, fontsize=8.5)
            if drawn_maps is over_spin and Column.LINEAR_LIMIT in data:
                cell = data.sel(scene=family, integrator=name)
                for variable, kind in ((Column.LINEAR_LIMIT, "limit"), (Column.THIRD_TURN, "third")):
                    at = cell[variable].values, cell[Column.LIMIT_PARAMETER].values
                    drawn |= dict.fromkeys(_line(axis, *at, kind))
            elif drawn_maps is over_gap and one.control == "step_size":
                # the fall at 1.1 gap past the pole takes one step
                at = 1.1 * one.parameter / FALL_SPEED / FALL_PERIOD, one.parameter
                drawn |= dict.fromkeys(_line(axis, *at, "passage"))
            if below != control:
                axis.set_xlabel(CONTROLS[one.control], fontsize=8.5)
        line[0].set_title("\n".join(["", *lines]), loc="left", fontsize=8.0)
        line[0].annotate(
            name, (0.0, 1.0), (0.0, 5.5 + 11.2 * len(lines)), xycoords="axes fraction", textcoords="offset points",
            fontsize=9.0, weight="bold", annotation_clip=False,
        )  # fmt: skip
    shown = [name for name in (*VERDICTS, *LINES) if name in drawn]
    figure.legend(handles=list(map(_handle, shown)), loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    return figure


def _handle(name: str) -> Any:
    """The entry of the legend for an outcome, or for one of `LINES`."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    if name in LINES:
        return Line2D([], [], color="black", lw=1.1, ls=LINES[name][1], label=LINES[name][0])
    hatch = HATCHES[name][0] if name in HATCHES else None
    return Patch(facecolor=OUTCOME_COLORS[name], label=name.replace("_", " "), hatch=hatch, edgecolor=GREY, lw=0.4)
