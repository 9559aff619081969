"""Figures of the study: the named methods together, and the work of the variants of every order."""

from typing import Any

import numpy as np
import xarray as xr

from symtop.measure.conservation import maxima
from symtop.model.scenes import scene
from symtop.report.figures import SMALLEST, error_band, rows
from symtop.report.formats import number
from symtop.report.style import BLUE, few_ticks, grid, legend_below, line, panels
from symtop.runner.study import Picture

from .measures import (
    HISTORY_STEPS,
    LEAST_SCENES,
    MAIN,
    TARGET,
    Efficiency,
    declared_order,
    efficiencies,
    merged,
    named_variants,
    stepping,
)

WINDOWS = 18  # of time, in each of which the largest energy error is drawn
PANELS = {  # label of the x axis, and title
    "step_size": ("step size (s)", "error against the step"),
    "tolerance": ("tolerance asked for", "error against the tolerance"),
    "work": ("force evaluations per nutation", "error against cost"),
    "energy": ("nutations", f"energy (fixed steps: {HISTORY_STEPS:g} a nutation)"),
}


def pictures(data: xr.Dataset) -> list[Picture]:
    """The named methods; the work that each variant with a step needs."""
    works = efficiencies(data, TARGET)
    return [_named(data), *([_constants(data, works)] if works else [])]


def _named(data: xr.Dataset) -> Picture:
    """Panels on one scene: error against the step, against the tolerance, against work; energy over time."""
    part, labels = named_variants(data)
    work = part["force_evaluations"] * scene(str(part["scene"].values)).nutation_period / part["horizon"]
    part = part.assign(work=work.where(work > 0.0))
    kinds = [kind for kind in ("step_size", "tolerance", "work") if np.isfinite(part[kind]).any()]
    kinds += ["energy"] if "history_time" in part and np.isfinite(part["history_time"]).any() else []
    figure, axes = grid(len(kinds), 2, height=2.3)
    for kind, axis in zip(kinds, axes, strict=True):
        axis.set(xscale="log", yscale="log", xlabel=PANELS[kind][0], title=PANELS[kind][1])
        if kind == "energy":
            axis.set_ylabel("energy error\n/ energy of the nutation")
        else:
            floor = 0.3 * error_band(axis, part[f"{MAIN}_bound"].values)
            axis.set(ylim=(0.5 * floor, 10.0), ylabel="largest axis error (rad)")
        for name, label in labels.items():
            cell = part.sel(variant=name)
            x, y = _history(cell) if kind == "energy" else (cell[kind].values, np.maximum(cell[MAIN].values, floor))
            order = np.argsort(x)
            order = order[np.isfinite(x[order]) & np.isfinite(y[order])]
            if order.size:
                axis.plot(x[order], y[order], **line(name), label=label)
    if "tolerance" in kinds:  # where error and tolerance are equal: wide, since lines cross it
        axis, ends = axes[kinds.index("tolerance")], np.array([1e-20, 1e2])
        limits = axis.get_xlim(), axis.get_ylim()
        axis.plot(ends, ends, color="#9EC9E8", lw=5.0, alpha=0.8, zorder=0.5)
        axis.text(0.97, 0.06, "pale: error = tolerance", transform=axis.transAxes, ha="right", fontsize=7.5)
        axis.set(xlim=limits[0], ylim=limits[1])
    few_ticks(*axes)
    legend_below(figure, axes)
    return Picture("named-methods", figure)


def _history(cell: xr.Dataset) -> tuple[Any, Any]:
    """Times (nutations) and the largest change of the energy in windows of time; NaN where it is zero."""
    time, change = cell["history_time"].values, cell["history_energy"].values
    good = np.isfinite(time) & np.isfinite(change) & (time > 0.0)
    if not good.any():
        return np.empty(0), np.empty(0)
    decades = np.log10(time[good][-1] / max(time[good][0], 1.0))
    x, y = map(np.array, maxima(time[good], np.maximum(change[good], SMALLEST), decades, WINDOWS))
    return x, np.where(y > SMALLEST, y, np.nan)


def _constants(data: xr.Dataset, works: dict[tuple[str, str], Efficiency]) -> Picture:
    """One row for each variant, grouped by order: the work for `TARGET`, over the scenes."""
    labels, scenes = merged(stepping(data), MAIN), [str(name) for name in data["scene"].values]
    known = {name: [works[scene, name] for scene in scenes if (scene, name) in works] for name in labels}
    middle = {name: float(np.median([cost.work for cost in part])) for name, part in known.items() if part}
    unranked = {name: len(known[name]) < min(LEAST_SCENES, len(scenes)) for name in middle}  # they are not ranked
    groups: dict[int, list[str]] = {}
    for name in sorted(middle, key=lambda name: (unranked[name], middle[name])):
        groups.setdefault(declared_order(name) or 0, []).append(name)
    lines = [line for power in sorted(groups)
             for line in (f"order {power}" if power else "no order declared", *groups[power])]  # fmt: skip
    heads = [place for place, line in enumerate(lines) if line not in middle]
    cut = min(heads, key=lambda place: abs(2 * place - len(lines)))
    halves = [half for half in (lines[:cut], lines[cut:]) if half]
    ranked = [[name for name in group if not unranked[name]] or group for power, group in groups.items() if power]
    widest = max(((group[0], group[-1]) for group in ranked), key=lambda ends: middle[ends[1]] / middle[ends[0]],
                 default=())  # fmt: skip
    longest = max(map(len, halves))
    figure, axes = panels(1, len(halves), height=0.135 * longest + 0.3, sharex=True)
    for axis, half in zip(axes[0], halves, strict=True):
        for place, name in enumerate(half):
            if name in middle:
                values = [cost.work for cost in known[name]]
                face = "white" if 2 * sum(cost.foreseen for cost in known[name]) > len(values) else BLUE
                axis.plot([min(values), max(values)], [place, place], color=BLUE, lw=1.2)
                x, mark = (values, "|") if unranked[name] else (middle[name], "o")
                axis.plot(x, np.full(np.shape(x), place), mark, color=BLUE, mfc=face, ms=5.0)
            if name in widest:
                axis.annotate(number(middle[name]), (max(values), place), (6, 0), textcoords="offset points",
                              va="center", fontsize=7.5, weight="bold")  # fmt: skip
        axis.set(xscale="log", xlabel="force evaluations\na nutation")
        rows(axis, [labels.get(line, line) for line in half], longest)
        for tick, name in zip(axis.get_yticklabels(), half, strict=True):
            if name not in middle:
                tick.set(weight="bold", fontsize=8.0)
    dark = {"color": BLUE, "lw": 0.0}
    axes[0, 0].plot([], [], "o", ms=5.0, label=f"median over up to {len(scenes)} scenes", **dark)
    axes[0, 0].plot([], [], color=BLUE, lw=1.2, label="least to largest of the scenes")
    axes[0, 0].plot([], [], "o", ms=5.0, mfc="white", label="open: extrapolated on most scenes", **dark)
    if any(unranked.values()):
        axes[0, 0].plot([], [], "|", ms=5.0, label=f"known on fewer than {LEAST_SCENES} scenes: not ranked", **dark)
    legend_below(figure, axes)
    return Picture("constants", figure)
