"""Helpers for the figures of studies: labels of lines and rows, the grey band of the bound, a choice of variants."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Bbox

from symtop.report.style import LEAST_TEXT, ink

SMALLEST = 1e-17  # where an error of exactly zero is drawn
LOWEST = 1e-40  # lower edge of the grey band, below every panel
BELOW_BOUND = "below the reference's error bound"
MOST_NAMED = 9  # variants that a figure labels


def error_band(axis: Any, bounds: Any) -> float:
    """Shade all that lies below the median error bound of the reference; returns that bound, or 1e-16 without one."""
    level = float(np.nanmedian(bounds)) if np.isfinite(bounds).any() else 1e-16
    shape = {"color": "#BBBBBB", "alpha": 0.45, "lw": 0, "label": BELOW_BOUND, "transform": axis.get_yaxis_transform()}
    axis.add_artist(Rectangle((0.0, LOWEST), 1.0, level - LOWEST, **shape))  # an artist does not change the limits
    return level


def rows(axis: Any, names: Sequence[str], count: int = 0) -> None:
    """Label the rows of a panel of dots, the first at the top; with room for `count` rows."""
    axis.set_yticks(range(len(names)), names, fontsize=LEAST_TEXT)
    axis.set_ylim(max(count, len(names)) - 0.4, -0.6)
    axis.tick_params(axis="y", length=0)
    axis.grid(visible=False, axis="y")


def chosen(names: Sequence[str], known: Sequence[str], most: int = MOST_NAMED) -> list[str]:
    """The variants that a figure labels: all if they are few, otherwise those in `known`, or the first if none is."""
    return list(names) if len(names) <= most else [name for name in names if name in known] or list(names)[:most]


def keep_apart(places: Sequence[float], gap: float) -> list[float]:
    """Positions in [0, 1] at least `gap` apart, in the order of `places` and nearest to these (least squares)."""
    from scipy.optimize import isotonic_regression

    order, gaps = np.argsort(places, kind="stable"), gap * np.arange(len(places))
    level = isotonic_regression(np.array(places)[order] - gaps).x
    positions = np.empty(len(places))
    positions[order] = np.clip(level, 0.0, 1.0 - gaps[-1]) + gaps
    return positions.tolist()


def name_ends(axis: Any, ends: Mapping[str, tuple[float, float, str]]) -> None:
    """Write each name at the right of a panel, joined to the end of its line; `ends` are x, y and colour.

    Limits and layout of the panel must be final except for the space of the names.
    """
    if not ends:
        return
    axis.figure.canvas.figure.draw_without_rendering()  # the top-level figure, also for a subfigure
    height = axis.get_window_extent().height * 72.0 / axis.figure.dpi
    points = axis.transAxes.inverted().transform(axis.transData.transform([end[:2] for end in ends.values()]))
    heights = keep_apart([float(np.clip(y, 0.0, 1.0)) for _, y in points], 1.2 * LEAST_TEXT / height)
    for (name, (x, y, color)), level in zip(ends.items(), heights, strict=True):
        axis.annotate(
            name, (x, y), (1.04, level), textcoords="axes fraction", va="center", fontsize=LEAST_TEXT, color=ink(color),
            arrowprops={"arrowstyle": "-", "color": color, "lw": 0.5, "shrinkA": 0, "shrinkB": 1, "relpos": (0.0, 0.5)},
            annotation_clip=False,
        )  # fmt: skip


def label_lines(axis: Any, lines: Sequence[tuple[str, str, Any, Any]], others: Sequence[tuple[Any, Any]] = ()) -> None:
    """Write the name of each line beside one of its points, preferably the last, in its colour, covering little else.

    `lines` are (name, colour, x, y), and `others` are (x, y) of lines without a name. Limits and layout of the panel
    must be final.
    """
    if not lines:
        return
    figure = axis.figure.canvas.figure
    figure.draw_without_rendering()
    renderer, frame, point = figure.canvas.get_renderer(), axis.get_window_extent(), figure.dpi / 72.0
    marks = np.concatenate([_dense_points(axis, x, y) for *_, x, y in [*lines, *others]])
    dots = [axis.transData.transform(np.stack([x, y], axis=1)) for *_, x, y in lines]
    halo = [withStroke(linewidth=2.5, foreground="white")]  # makes a name readable over lines
    look: dict[str, Any] = {"textcoords": "offset points", "va": "center", "size": LEAST_TEXT, "weight": "bold"}
    boxes: list[Any] = []
    for index in sorted(range(len(lines)), key=lambda index: -len(lines[index][0])):
        name, color, x, y = lines[index]
        text = axis.annotate(name, (x[0], y[0]), (0, 0), color=ink(color), path_effects=halo, **look)
        size, track = text.get_window_extent(renderer).size, dots[index]
        foreign = np.concatenate([marks[:0], *(points for i, points in enumerate(dots) if i != index)])
        between = np.concatenate([track[1:-1], 0.5 * (track[1:] + track[:-1])])
        spots = [track[-1], track[0], *between[:: len(between) // MOST_SPOTS + 1]]
        candidates: list[Any] = []
        for k, (dx, dy, side) in product(range(len(spots)), PLACES):
            low = spots[k] + point * np.array([dx, dy]) - size * (0.5 - 0.5 * np.sign(dx), 0.5)
            box = Bbox([low, low + size])
            outside = box.x0 < frame.x0 or box.x1 > frame.x1 or box.y0 < frame.y0 or box.y1 > frame.y1
            covered = LINE_COST * _inside(marks, box).sum() + NEAR_COST * _inside(foreign, box, NEAR_OTHER_LINE).sum()
            covered += NEAR_COST * _inside(np.concatenate(dots), box, 2.0).sum()
            price = 1e3 * (sum(box.overlaps(other) for other in boxes) + outside) + covered
            price += abs(dy) / 2.0 + POINT_COSTS[min(k, 2)] + SIDE_COSTS[side]
            candidates.append((price, len(candidates), box, spots[k], (dx, dy), side))
        *_, box, text.xy, shift, side = min(candidates)
        text.xy = axis.transData.inverted().transform(text.xy)
        text.set(position=shift, ha=side)
        boxes.append(box)


PIXELS_APART = 3.0  # pixels between points that represent a line
MOST_SPOTS = 40  # points of a line between its ends where its name is tried
NEAR_OTHER_LINE = (16.0, 10.0)  # pixels: a name so near to a point of another line seems to belong to that
LINE_COST, NEAR_COST, POINT_COSTS = 0.8, 8.0, (0.0, 2.0, 6.0)  # a covered point, a near one; last, first, inner point
SIDE_COSTS = {"left": 0.0, "right": 2.0, "center": 14.0}  # cost of the alignment of a name
PLACES = (*((dx, dy, side) for dx, side in ((5, "left"), (-5, "right")) for dy in (0, -5, 5, -9, 9)),
          *((0, dy, "center") for dy in (-11, 11, -15, 15)))  # fmt: skip


def _inside(points: Any, box: Any, margin: Any = 0.0) -> Any:
    """Which points (n, 2) lie in a box or within a margin of it; (n,)."""
    return np.all((points > box.min - margin) & (points < box.max + margin), axis=1)


def _dense_points(axis: Any, x: Any, y: Any) -> Any:
    """Points (n, 2) along a line in pixels, `PIXELS_APART` from each other."""
    ends = axis.transData.transform(np.stack([x, y], axis=1))
    length = np.append(0.0, np.cumsum(np.hypot(*np.diff(ends, axis=0).T)))
    distances = np.arange(0.0, length[-1] + PIXELS_APART, PIXELS_APART)
    return np.stack([np.interp(distances, length, ends[:, k]) for k in range(2)], axis=1)
