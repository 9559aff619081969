"""What drawings of studies share: names at the ends of lines, the grey band of the reference's bound, the front."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from symtop.report.style import LEAST_TEXT, ink

SMALLEST = 1e-17  # where an error of exactly zero is drawn
LOWEST = 1e-40  # below every panel
BELOW = "below the reference's error bound"


def bound_of(bounds: Any, least: float = 1e-16) -> float:
    """The median error bound of the reference, or `least` without one."""
    return float(np.nanmedian(bounds)) if np.isfinite(bounds).any() else least


def error_band(axis: Any, bounds: Any, least: float = 1e-16) -> float:
    """Shade all that lies below the median error bound of the reference; returns that bound, or `least` without one."""
    from matplotlib.patches import Rectangle

    level = bound_of(bounds, least)
    shape = {"color": "#BBBBBB", "alpha": 0.45, "lw": 0, "label": BELOW, "transform": axis.get_yaxis_transform()}
    axis.add_artist(Rectangle((0.0, LOWEST), 1.0, level - LOWEST, **shape))  # to the frame, which it does not move
    return level


def pareto(cost: Any, error: Any) -> Any:
    """Which points no other point beats in both cost and error (boolean, the shape of the arrays)."""
    shape, cost, error = cost.shape, cost.ravel(), error.ravel()
    order = np.lexsort((error, np.where(np.isfinite(error), cost, np.inf)))
    best, front = np.inf, np.zeros(cost.size, bool)
    for k in order:
        if np.isfinite(cost[k]) and error[k] < best:
            best, front[k] = error[k], True
    return front.reshape(shape)


def largest_so_far(values: Any) -> Any:
    """The largest size up to each sample; zeros are `SMALLEST`, for a logarithmic axis."""
    return np.maximum.accumulate(np.maximum(np.abs(np.asarray(values)), SMALLEST))


def spread(places: Sequence[float], gap: float) -> list[float]:
    """Places in [0, 1] that keep their order and a distance; labels that would meet share the mean of their places."""
    order = sorted(range(len(places)), key=lambda k: places[k])
    blocks: list[tuple[float, int]] = []  # centre and number of labels
    for k in order:
        centre, count = places[k], 1
        while True:
            reach = 0.5 * gap * count
            centre = min(max(centre, reach - 0.5 * gap), 1.0 - reach + 0.5 * gap)
            if not blocks or blocks[-1][0] + 0.5 * gap * blocks[-1][1] <= centre - reach + 1e-12:
                break
            before, others = blocks.pop()
            centre, count = (before * others + centre * count) / (others + count), others + count
        blocks.append((centre, count))
    moved = [centre + gap * (k - 0.5 * (count - 1)) for centre, count in blocks for k in range(count)]
    placed = [0.0] * len(places)
    for k, value in zip(order, moved, strict=True):
        placed[k] = value
    return placed


def name_ends(axis: Any, ends: Mapping[str, tuple[float, float, str]], size: float = LEAST_TEXT) -> None:
    """Write each name at the right of a panel, joined to the end of its line; `ends` are x, y and colour.

    Limits and layout of the panel must be final but for the room that the names take.
    """
    if not ends:
        return
    axis.figure.canvas.figure.draw_without_rendering()  # the root of a subfigure
    height = axis.get_window_extent().height * 72.0 / axis.figure.dpi
    places = axis.transAxes.inverted().transform(axis.transData.transform([end[:2] for end in ends.values()]))
    heights = spread([float(np.clip(y, 0.0, 1.0)) for _, y in places], 1.2 * size / height)
    for (name, (x, y, color)), place in zip(ends.items(), heights, strict=True):
        axis.annotate(
            name, (x, y), (1.04, place), textcoords="axes fraction", va="center", fontsize=size, color=ink(color),
            arrowprops={"arrowstyle": "-", "color": color, "lw": 0.5, "shrinkA": 0, "shrinkB": 1, "relpos": (0.0, 0.5)},
            annotation_clip=False,
        )  # fmt: skip


def name_beside(axis: Any, ends: Sequence[tuple[str, float, float, str]], size: float = LEAST_TEXT) -> None:
    """Write each name beside the end of its line, within the panel; `ends` are name, x, y, colour; axes logarithmic.

    The panel becomes wider until the longest name fits. A name moves up or down until it covers no other name and no
    line, and if it moves it is joined to its end.
    """
    figure = axis.figure.canvas.figure  # the root of a subfigure
    figure.draw_without_rendering()
    frame, unit = axis.get_window_extent(), size * figure.dpi / 72.0
    widths = [0.57 * unit * len(name) + unit for name, *_ in ends]
    low, high = axis.get_xlim()
    parts = [np.log(x / low) / np.log(high / low) / max(1.0 - width / frame.width, 0.2)
             for (_, x, *_), width in zip(ends, widths, strict=True)]  # fmt: skip
    axis.set_xlim(low, low * (high / low) ** max(1.0, *parts))
    lines = [line.get_xydata() for line in axis.get_lines() if line.get_transform() == axis.transData]
    taken = [_along(axis.transData.transform(corners), 0.4 * unit) for corners in lines]
    points = np.concatenate([*taken, np.empty((0, 2))])
    moves = unit * np.array([0.65 * sign * k for k in range(40) for sign in (1, -1)])
    for (name, x, y, color), width in sorted(zip(ends, widths, strict=True), key=lambda end: -end[0][2]):
        left, end = axis.transData.transform((x, min(y, axis.get_ylim()[1]))) + np.array([0.8 * unit, 0.0])
        heights = points[(points[:, 0] > left) & (points[:, 0] < left + width), 1]
        covered = (np.abs(heights - end - moves[:, None]) < 0.75 * unit).sum(axis=1) + 0.02 * np.abs(moves) / unit
        outside = (end + moves < frame.y0 + 0.7 * unit) | (end + moves > frame.y1 - 0.7 * unit)
        move = moves[np.argmin(covered + 1e6 * outside)]
        box = np.arange(left, left + width, 0.05 * unit)
        rows = [np.column_stack([box, np.full(box.size, end + move + half * unit)]) for half in (-0.45, 0.45)]
        points = np.concatenate([points, *rows])
        joined = {"arrowstyle": "-", "color": color, "lw": 0.5, "shrinkA": 0, "shrinkB": 2, "relpos": (0.0, 0.5)}
        axis.annotate(
            name, (x, min(y, axis.get_ylim()[1])), (0.8 * size, move * 72.0 / figure.dpi), textcoords="offset points",
            va="center", fontsize=size, color=ink(color), arrowprops=joined if abs(move) > 1.5 * unit else None,
        )  # fmt: skip


def _along(corners: Any, gap: float) -> Any:
    """Points (n, 2) along a line through corners (m, 2), at most about `gap` apart."""
    corners = corners[np.isfinite(corners).all(axis=1)]
    if len(corners) < 2:
        return corners
    lengths = np.maximum(np.hypot(*np.diff(corners, axis=0).T), 1e-9)
    place = np.concatenate([[0.0], np.cumsum(lengths)])
    marks = np.linspace(0.0, place[-1], int(min(place[-1] / gap, 5000.0)) + 2)
    return np.column_stack([np.interp(marks, place, corners[:, k]) for k in (0, 1)])
