"""Figures of the study: the named methods together, what every order costs, error against tolerance."""

from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from symtop.measure.conservation import tops
from symtop.model.charts import Array
from symtop.report.figures import SMALLEST, error_band
from symtop.report.formats import number
from symtop.report.style import LEAST_TEXT, few_ticks, grid, legend_below, line, look, panels
from symtop.runner.study import Picture

from .measures import (
    HISTORY_STEPS,
    MAIN,
    TARGET,
    Efficiency,
    adaptive,
    declared_order,
    efficiencies,
    evaluations_a_nutation,
    merged,
    named_variants,
    ratios,
    stepping,
)

EQUAL = {
    "color": "#9EC9E8",
    "lw": 5.0,
    "alpha": 0.8,
    "zorder": 0.5,
    "label": "error = tolerance",
}  # wide: lines cross it
WINDOWS = 18  # of time, in each of which the largest energy error is drawn


def pictures(data: xr.Dataset) -> list[Picture]:
    """The named methods; the work that each variant with a step needs; error against the tolerance."""
    drawn = [_named(data)]
    works = efficiencies(data, TARGET)
    drawn += [_constants(data, works)] if works else []
    chosen = adaptive(data)
    return [*drawn, _by_tolerance(chosen)] if chosen.sizes["variant"] else drawn


def _line(axis: Any, name: str, label: str, x: Any, y: Any) -> None:
    order = np.argsort(x)
    order = order[np.isfinite(x[order]) & np.isfinite(y[order])]
    if order.size:
        axis.plot(x[order], y[order], **line(name), label=label)


def _named(data: xr.Dataset) -> Picture:
    """Panels on one scene: error against the step, against the tolerance, against work; energy over time."""
    part, labels = named_variants(data)
    scene = str(part["scene"].values)
    shown = [kind for kind in ("step_size", "tolerance") if np.isfinite(part[kind]).any()]
    shown += ["work", *(["energy"] if "history_time" in part and np.isfinite(part["history_time"]).any() else [])]
    figure, axes = grid(len(shown), 2, height=2.3)
    places, floor = dict(zip(shown, axes, strict=True)), 0.0
    for kind in (kind for kind in shown if kind != "energy"):
        floor = 0.3 * error_band(places[kind], part[f"{MAIN}_bound"].values)
        places[kind].set(xscale="log", yscale="log", ylim=(0.5 * floor, 10.0), ylabel="largest axis error (rad)")
    for name, label in labels.items():
        cell = part.sel(variant=name)
        error, paid = np.maximum(cell[MAIN].values, floor), evaluations_a_nutation(cell, scene)
        for kind in shown:
            if kind == "energy":
                _history(places[kind], name, label, cell)
            else:
                _line(
                    places[kind],
                    name,
                    label,
                    np.where(paid > 0.0, paid, np.nan) if kind == "work" else cell[kind].values,
                    error,
                )
    titles = {
        "step_size": ("step size (s)", "error against the step"),
        "tolerance": ("tolerance asked for", "error against the tolerance"),
        "work": ("force evaluations per nutation", "error against cost"),
        "energy": ("nutations", f"energy (fixed steps: {HISTORY_STEPS:g} a nutation)"),
    }
    for kind, axis in places.items():
        axis.set(xlabel=titles[kind][0], title=titles[kind][1])
    if "energy" in places:
        places["energy"].set(xscale="log", yscale="log", ylabel="relative change\nof the energy")
    if "tolerance" in places:
        _equal(places["tolerance"])
    few_ticks(*axes)
    legend_below(figure, axes)
    return Picture("named-methods", figure)


def _equal(axis: Any) -> None:
    """The line where error and tolerance are equal, from frame to frame."""
    limits = axis.get_xlim(), axis.get_ylim()
    ends = np.array([1e-20, 1e2])
    axis.plot(ends, ends, **EQUAL)
    axis.set(xlim=limits[0], ylim=limits[1])


def _history(axis: Any, name: str, label: str, cell: xr.Dataset) -> None:
    time, change = cell["history_time"].values, cell["history_energy"].values
    good = np.isfinite(time) & np.isfinite(change) & (time > 0.0)
    if good.any():
        decades = np.log10(time[good][-1] / max(time[good][0], 1.0))
        x, y = tops(time[good], np.maximum(change[good], SMALLEST), decades, WINDOWS)
        axis.plot(
            x, np.where(np.greater(y, SMALLEST), y, np.nan), **line(name), label=label
        )  # no change at all has no place


def _constants(data: xr.Dataset, works: dict[tuple[str, str], Efficiency]) -> Picture:
    """A line a variant, grouped by order: the work that the error constants foretell for `TARGET`, over the scenes."""
    labels = merged(stepping(data), MAIN)
    scenes = [str(name) for name in data["scene"].values]
    sizes = {name: [works[scene, name] for scene in scenes if (scene, name) in works] for name in labels}
    sizes = {name: known for name, known in sizes.items() if known}
    middle = {name: float(np.median([one.work for one in known])) for name, known in sizes.items()}
    orders: dict[int, list[str]] = {}
    for name in sorted(sizes, key=lambda name: middle[name]):
        orders.setdefault(declared_order(name) or 0, []).append(name)
    blocks = [orders[power] for power in sorted(orders)]
    halves = _halves(blocks)
    most = max(sum(len(block) + 1 for block in half) for half in halves)
    best = min(middle, key=lambda name: middle[name])
    firsts = [block[0] for block in blocks if declared_order(block[0])]
    low = min(firsts, key=lambda name: declared_order(name) or 0)
    figure, axes = panels(1, len(halves), height=0.135 * most + 0.3, sharex=True)
    for axis, half in zip(axes[0], halves, strict=True):
        place, places, ticks = 0, [], []
        for block in half:
            power = declared_order(block[0])
            places.append(place)
            ticks.append(f"order {power}" if power else "no order declared")
            place += 1
            for name in block:
                values = [one.work for one in sizes[name]]
                open_ = sum(one.foreseen for one in sizes[name]) * 2 > len(values)
                marks = line(name)
                axis.plot([min(values), max(values)], [place, place], color=marks["color"], lw=1.2)
                face = "white" if open_ else marks["color"]
                axis.plot(middle[name], place, "o", color=marks["color"], mfc=face, ms=5.0)
                if name in (best, low):
                    axis.annotate(number(middle[name]), (max(values), place), (6, 0), textcoords="offset points",
                                  va="center", fontsize=7.5, weight="bold")  # fmt: skip
                places.append(place)
                ticks.append(labels[name])
                place += 1
        axis.set(xscale="log", yticks=places, yticklabels=ticks, ylim=(most - 0.4, -0.6))
        axis.tick_params(axis="y", labelsize=7.0, length=0)
        for tick in axis.get_yticklabels():
            if tick.get_text() not in labels.values():  # the head of a block
                tick.set(weight="bold", fontsize=8.0)
        axis.grid(visible=False, axis="y")
    dark = {"color": "#444444", "lw": 0.0}
    axes[0, 0].plot([], [], "o", ms=5.0, label=f"median over {len(scenes)} scenes", **dark)
    axes[0, 0].plot([], [], color="#444444", lw=1.2, label="least to largest of the scenes")
    axes[0, 0].plot([], [], "o", ms=5.0, mfc="white", label="open: extrapolated on most scenes", **dark)
    for axis in axes[0]:
        axis.set_xlabel("force evaluations\na nutation")
    legend_below(figure, axes)
    return Picture("constants", figure)


def _halves(blocks: list[list[str]]) -> list[list[list[str]]]:
    """The blocks in two columns of about the same height; one column if there is one block."""
    if len(blocks) < 2:
        return [blocks]
    sums = np.cumsum([len(block) + 1 for block in blocks])
    cut = 1 + int(np.argmin(np.maximum(sums[:-1], sums[-1] - sums[:-1])))
    return [blocks[:cut], blocks[cut:]]


class Met(NamedTuple):
    """The errors of an adaptive variant over its tolerances, on all scenes."""

    ratios: Array

    @property
    def middle(self) -> float:
        """The median."""
        return float(np.median(self.ratios))


def _by_tolerance(data: xr.Dataset) -> Picture:
    """Error over tolerance of every run of the adaptive variants, with the line where they are equal."""
    known = ratios(data)
    met = {name: Met(known[name]) for name in merged(data, MAIN) if known[name].size}
    met = dict(sorted(met.items(), key=lambda item: item[1].middle))
    figure, axes = panels(1, 1, height=0.155 * max(len(met), 6) + 1.0)
    axis = axes[0, 0]
    for place, (name, one) in enumerate(met.items()):
        color = look(name).color
        axis.plot(one.ratios, [place] * one.ratios.size, "o", color=color, ms=2.5, alpha=0.45, mew=0)
        axis.plot([one.middle] * 2, [place - 0.42, place + 0.42], color=color, lw=2.2, solid_capstyle="butt", zorder=3)
    axis.set(xscale="log", ylim=(len(met) - 0.4, -0.6), yticks=range(len(met)))
    axis.set_xlabel("largest axis error over the tolerance asked for")
    axis.set_yticklabels(list(met), fontsize=LEAST_TEXT)
    axis.grid(visible=False, axis="y")
    axis.tick_params(axis="y", length=0)
    axis.axvline(1.0, color=EQUAL["color"], lw=EQUAL["lw"], zorder=0, label=EQUAL["label"])
    axis.plot([], [], "o", color="#444444", ms=3.5, mew=0, label="a run")
    axis.plot([], [], "|", color="#444444", ms=8, mew=2.2, label="median of a variant")
    few_ticks(axis, most=9)
    legend_below(figure, axes)
    return Picture("tolerance", figure)
