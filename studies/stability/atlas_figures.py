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
from symtop.report.style import GREY, OUTCOME_COLORS, use

from .atlas import OutcomeMap, stored_map
from .tables import Column

RASTER = (110, 430)  # pixels of one map, about those it has in the figure
SHADE = 0.72  # a hatch line is the same colour, darker
WORDS = {
    "accurate": "accurate", "bounded_but_wrong": "bounded but wrong", "drifting": "drifting",
    "wrong_regime": "wrong regime", "left_chart": "left chart", "not_converged": "not converged",
    "not_finite": "not finite", "step_too_small": "step too small", "out_of_budget": "out of budget",
}  # fmt: skip
CONTROLS = {"step_size": "step (nutation periods)", "tolerance": "tolerance", "none": "nothing to set"}
HATCHES = {
    "left_chart": "////", "wrong_regime": "\\\\\\\\", "not_converged": "xxxx", "drifting": "----",
    "step_too_small": "....", "out_of_budget": "||||",
}  # fmt: skip
LIMIT, THIRD_TURN, PASSAGE = "-", (0, (4, 2)), (0, (1, 1.5))  # dashes of the lines over a map
FALL_SPEED, FALL_PERIOD = 1.2, 4.22  # of the grazing family: rad/s at the pole, and its nutation period, s


def _hatch(word: str, rows: Any, columns: Any) -> Any:
    """Which pixels of a raster the hatch of an outcome covers."""
    down, up = (rows + columns) % 10 == 0, (rows - columns) % 10 == 0
    marks = {
        "left_chart": down,
        "wrong_regime": up,
        "not_converged": down | up,
        "drifting": rows % 6 == 0,
        "step_too_small": (rows % 5 == 0) & (columns % 5 == 0),
        "out_of_budget": columns % 6 == 0,
    }
    return marks.get(word, np.zeros_like(down))


def painted(outcome: NDArray[np.uint8]) -> NDArray[np.float64]:
    """A map of outcomes, shape (rows, columns), as an image (height, width, 3) with hatches."""
    from matplotlib.colors import to_rgb

    height, width = RASTER
    big = outcome[np.arange(height) * outcome.shape[0] // height][:, np.arange(width) * outcome.shape[1] // width]
    rows, columns = np.indices(big.shape)
    image = np.ones((*big.shape, 3))
    for index, word in enumerate(VERDICTS):
        region = big == index
        image[region] = to_rgb(OUTCOME_COLORS[word])
        image[region & _hatch(word, rows, columns)] *= SHADE
    return image


def _name_regions(axis: Any, outcome: NDArray[np.uint8], extent: Sequence[float]) -> None:
    """Write each outcome's name where its largest region is widest, if it fits."""
    from scipy.ndimage import distance_transform_edt, label

    height, width = outcome.shape
    for index in np.unique(outcome):
        regions, count = label(outcome == index)
        if not count:
            continue
        largest = 1 + int(np.argmax(np.bincount(regions.ravel())[1:]))
        # a cell is seen from the text's shape: six times as wide as high
        across, upright = 1.0 / width * 3.0 / 6.0, 1.0 / height
        depth = distance_transform_edt(np.pad(regions == largest, 1), sampling=(upright, across))[1:-1, 1:-1]
        row, column = np.unravel_index(int(np.argmax(depth)), depth.shape)
        if depth[row, column] < 0.055 or VERDICTS[int(index)] not in WORDS:
            continue
        x = extent[0] + (column + 0.5) / width * (extent[1] - extent[0])
        y = extent[2] + (row + 0.5) / height * (extent[3] - extent[2])
        for_word = 0.0085 * len(WORDS[VERDICTS[int(index)]])  # half the width of the text, of the map's
        x = min(max(x, extent[0] + for_word * (extent[1] - extent[0])), extent[1] - for_word * (extent[1] - extent[0]))
        y = min(max(y, extent[2] + 0.07 * (extent[3] - extent[2])), extent[3] - 0.07 * (extent[3] - extent[2]))
        dark = VERDICTS[int(index)] in ("not_finite", "not_converged", "accurate", "left_chart")
        axis.text(
            x, y, WORDS[VERDICTS[int(index)]], ha="center", va="center", fontsize=7.5, weight="bold",
            color="white" if dark else "black",
        )  # fmt: skip


def _edges(values: NDArray[np.float64]) -> tuple[float, float]:
    """Both ends of an axis of cells at logarithmically even values, as decimal logarithms."""
    if values.size < 2:
        return 0.0, 1.0
    half = 0.5 * (np.log10(values[-1]) - np.log10(values[0])) / (values.size - 1)
    return float(np.log10(values[0]) - half), float(np.log10(values[-1]) + half)


def _ticks(axis: Any, which: str, ends: tuple[float, float]) -> None:
    powers = range(int(np.ceil(ends[0] - 1e-9)), int(np.floor(ends[1] + 1e-9)) + 1)
    step = 1 if len(powers) <= 5 else 2 if len(powers) <= 8 else 3
    shown = powers[::step]
    names = [f"{10.0**k:g}" if -3 <= k <= 2 else rf"$10^{{{k}}}$" for k in shown]
    getattr(axis, f"set_{which}ticks")(shown, names, fontsize=7.5)


def draw_map(axis: Any, one: OutcomeMap) -> None:
    """One map; parameter upwards, step or tolerance to the right, both logarithmic."""
    x, y = _edges(one.settings), _edges(one.parameter)
    extent = (*x, *y)
    axis.imshow(painted(one.outcome), origin="lower", extent=extent, aspect="auto", interpolation="nearest")
    _name_regions(axis, one.outcome, extent)
    axis.grid(visible=False)
    if one.control == "none":
        axis.set_xticks([])
    else:
        _ticks(axis, "x", x)
    _ticks(axis, "y", y)


def _line(axis: Any, x: Any, y: Any, dashes: Any) -> None:
    from matplotlib.patheffects import Normal, Stroke

    ends = axis.get_xlim(), axis.get_ylim()
    axis.plot(
        np.log10(x), np.log10(y), color="black", lw=1.1, ls=dashes,
        path_effects=[Stroke(linewidth=2.6, foreground="white"), Normal()],
    )  # fmt: skip
    axis.set(xlim=ends[0], ylim=ends[1])


def _overlay(axis: Any, cell: xr.Dataset) -> None:
    """The linear limit and the third of a turn over a map over spin."""
    if Column.LINEAR_LIMIT not in cell:
        return
    for variable, dashes in ((Column.LINEAR_LIMIT, LIMIT), (Column.THIRD_TURN, THIRD_TURN)):
        x, y = cell[variable].values, cell[Column.LIMIT_PARAMETER].values
        if np.isfinite(x).sum() > 1:
            _line(axis, x, y, dashes)


def atlas_page(data: xr.Dataset, family: str, names: Sequence[str], sentences: Mapping[str, str]) -> Any:
    """One row an integrator: its map over spin and step, its map over the gap to a pole and step, its sentence."""
    import matplotlib.pyplot as plt

    use()
    grazed = any(stored_map(data, "grazing", name) is not None for name in names)
    figure, axes = plt.subplots(
        len(names), 1 + grazed, figsize=(8.4, 1.7 * len(names) + 0.95), squeeze=False,
        gridspec_kw={"width_ratios": [1.25, 1.0][: 1 + grazed]},
    )  # fmt: skip
    shown: set[int] = set()
    controls = [one.control if (one := stored_map(data, family, name)) else "" for name in names]
    for line, name, control, below in zip(axes, names, controls, [*controls[1:], None], strict=True):
        for axis, scene, label in zip(line, (family, "grazing"), ("spin r", r"gap $\delta$"), strict=False):
            one = stored_map(data, scene, name)
            if one is None:
                axis.set_visible(False)
                continue
            shown |= {int(k) for k in np.unique(one.outcome)}
            draw_map(axis, one)
            axis.set_ylabel(label, fontsize=8.5)
            if scene == family:
                _overlay(axis, data.sel(scene=scene, integrator=name))
            elif one.control == "step_size":  # the step in which the axis falls past the pole: speed times h = 1.1 gap
                _line(axis, 1.1 * one.parameter / FALL_SPEED / FALL_PERIOD, one.parameter, PASSAGE)
            if below != control:
                axis.set_xlabel(CONTROLS[one.control], fontsize=8.5)
        _caption(line[0], name, sentences[name])
    handles = _legend(shown, steps="step_size" in controls, grazed=grazed)
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    return figure


def _legend(shown: set[int], *, steps: bool, grazed: bool) -> list[Any]:
    """A patch for each outcome that is drawn, and the lines over the maps where there are steps."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    words = [VERDICTS[k] for k in sorted(shown) if k < len(VERDICTS)]
    handles: list[Any] = [
        Patch(facecolor=OUTCOME_COLORS[word], label=WORDS[word], hatch=HATCHES.get(word), edgecolor=GREY, lw=0.4)
        for word in words
    ]
    lines = ((LIMIT, "linear limit"), (THIRD_TURN, "a third of a turn a step"), (PASSAGE, "one step passes the pole"))
    for dashes, label in lines[: (2 + grazed) * steps]:
        handles.append(Line2D([], [], color="black", lw=1.1, ls=dashes, label=label))
    return handles


def _caption(axis: Any, name: str, sentence: str) -> None:
    """The integrator's name, and below it its sentence, over a row of maps."""
    lines = textwrap.wrap(sentence, 128)
    axis.set_title("\n".join(["", *lines]), loc="left", fontsize=8.0)
    axis.annotate(
        name, (0.0, 1.0), (0.0, 5.5 + 11.2 * len(lines)), xycoords="axes fraction", textcoords="offset points",
        fontsize=9.0, weight="bold", annotation_clip=False,
    )  # fmt: skip
