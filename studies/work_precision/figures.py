"""The figures of the work-precision study: fronts, the fastest rows, how much slower the others are, energy, parts."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from symtop.measure.phase import PARTS
from symtop.report.figures import error_band
from symtop.report.style import LEAST_TEXT, few_ticks, grid, headline, lead, legend_below, line, number, same_limits
from symtop.runner.study import Picture

from . import energy, fronts, words
from .fronts import COSTS, OTHERS, curve
from .rankings import slowdown, winners

ENERGY = {
    "axis": (
        "rk4[axis]", "rk45-compiled[axis]", "taylor[axis]", "strang[axis]", "takahashi-imada[axis]",
        "srkn-14-6[axis]", "gauss-4[axis]", "gauss-8[axis]",
    ),
    "angles": (
        "rk4[angles]", "rk45-compiled[angles]", "midpoint[angles]", "trapezoidal[angles]", "stormer-verlet[angles]",
        "galerkin-simpson[angles]", "stormer-verlet-blanes-moan-6[angles]",
    ),
}  # fmt: skip
PARTS_OF = ("midpoint[angles]", "stormer-verlet[angles]", "takahashi-imada[axis]", "rk4[axis]",
            "rk45-compiled[angles]", "gauss-8[axis]")  # fmt: skip
SAME = 1.5  # an error that grows less stays the same
FILLS = "Open markers: Euler angles; full ones: (e, L)."


def pictures(data: xr.Dataset) -> list[Picture]:
    """Fronts at both horizons, the fastest rows, the slowdown of all, energy in two charts, and parts of the error."""
    return [
        fronts.draw(data, "front-short", 0, "seconds"),
        fronts.draw(data, "front-long", -1, "seconds"),
        fronts.draw(data, "front-evaluations", 0, "force_evaluations"),
        winners(data),
        slowdown(data),
        *(_energy(data, chart) for chart in energy.CHARTS if all(energy.in_chart(data, chart))),
        _parts(data),
    ]


def _key(axis: Any, names: Sequence[str]) -> None:
    """Two legends at the right of a panel: the named lines, and below them whatever else is drawn."""
    axis.plot([], [], **(OTHERS | {"lw": 0.8, "alpha": 0.8}), label="other methods")
    handles = {label: handle for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    parts = [label for label in handles if label in names], [label for label in handles if label not in names]
    for labels, place, anchor in zip(parts, ("upper left", "lower left"), ((1.0, 1.03), (1.0, -0.03)), strict=True):
        drawn = axis.legend(
            [handles[label] for label in labels], labels, loc=place, bbox_to_anchor=anchor, frameon=False,
            fontsize=LEAST_TEXT, borderaxespad=0.3, handlelength=2.4,
        )  # fmt: skip
        if labels is parts[0]:  # the second would take its place
            axis.add_artist(drawn)
            drawn.set_clip_on(False)


def _energy(data: xr.Dataset, chart: str) -> Picture:
    """Energy error of the rows of one chart against time at the long horizon."""
    scenes = [str(name) for name in data["scene"].values]
    figure, axes = lead(len(scenes), (COSTS["seconds"], "largest energy error (relative)"))
    classic, structured = energy.in_chart(data, chart)
    shown = [row for row in ENERGY[chart] if row in classic + structured]
    for axis, scene in zip(axes, scenes, strict=True):
        cell = data.sel(scene=scene).isel(horizon=-1)
        floor = 0.5 * error_band(axis, cell["energy_bound"].values)
        for row in structured:
            if row not in shown:
                axis.plot(*curve(cell.sel(integrator=row), "energy", "seconds", floor), **OTHERS)
        _draw(axis, cell, shown, "energy", "seconds", floor, 1.0 if axis is axes[0] else 0.6)
        bad = _ended_badly(cell.sel(integrator=classic + structured))
        axis.set_title(f"{'scene ' * (axis is axes[0])}{scene}{bad}")
    axes[0].set_ylim(1e-16, 300.0)
    same_limits(axes)
    few_ticks(axes[0])
    few_ticks(*axes[1:], most=3)
    headline(figure, energy.message(data, chart))
    _key(axes[0], shown)
    return Picture(
        f"energy-{chart}",
        figure,
        f"Largest energy error {words.spans(data)[-1]} against {COSTS['seconds']}, one panel a scene, step or "
        f"tolerance varying along each line. Every row works in the chart of {energy.CHARTS[chart]}, so that lines "
        "differ by the method alone; grey: the other structure-preserving rows. A row fails if none of its runs "
        f"ends well. {energy.sentence(data, chart)}",
        f"Log-log plots of energy error against time at the long horizon, rows of the chart {chart}, a panel a scene.",
    )


def _ended_badly(cell: xr.Dataset) -> str:
    """How many methods have no run that ended well on a scene, on a line; empty if all have one."""
    bad = ~(cell["outcome"] == "ok").any("setting").values
    return f"\n{bad.sum()} of {bad.size} methods fail{'s' * int(bad.sum() == 1)}" if bad.any() else ""


def _parts(data: xr.Dataset) -> Picture:
    scene = data.isel(scene=0)
    scene = scene.assign(evaluations_a_nutation=scene["force_evaluations"] / scene["horizon"])  # alike at equal steps
    name, spans = str(scene["scene"].values), words.spans(data)
    rows = [row for row in PARTS_OF if row in data["integrator"].values]
    shape = {"height": 1.9, "sharex": True, "sharey": "row"}
    figure, axes = grid(2 * len(PARTS), 2, (COSTS["evaluations_a_nutation"], ""), **shape)
    for row, (part, label) in enumerate(PARTS.items()):
        for far, axis in zip((0, -1), axes[2 * row : 2 * row + 2], strict=True):
            _draw(axis, scene.isel(horizon=far), rows, part, "evaluations_a_nutation", 5e-17)
            axis.set(title="" if row else f"scene {name}, {spans[far]}", ylabel="" if far else label)
    few_ticks(*axes)
    legend_below(figure, axes)
    first, last = (f"{data['horizon'].values[far]:g}" for far in (0, -1))
    growths = {part: [energy.growth_at_equal_settings(scene.sel(integrator=row), part) for row in rows]
               for part in ("shape", "nutation_lag")}  # fmt: skip
    known = [[value for value in values if np.isfinite(value)] for values in growths.values()]
    if all(known):
        headline(figure, growth_message((first, last), *known))
    else:
        headline(figure, f"Parts of the axis error over {first} and {last} nutations")
    return Picture(
        "parts",
        figure,
        f"Parts of the axis error on {name} against force evaluations a nutation, which are alike at equal "
        "steps: distance from the true path (shape), and how far the run is behind or "
        f"ahead of the truth in its nutation and in its precession (lags). From {first} to {last} nutation periods, at "
        f"equal step or tolerance, the shape error grows by a factor of {words.growth(scene, rows, 'shape')}; the "
        f"nutation lag by a factor of {words.growth(scene, rows, 'nutation_lag')}. {FILLS}",
        "Shape error, nutation lag and precession lag against work at two horizons.",
    )


def growth_message(horizons: tuple[str, str], shapes: Sequence[float], lags: Sequence[float]) -> str:
    """How the errors of the path and of the nutation's phase grow from one horizon to another at equal steps."""
    same, lag = sum(value < SAME for value in shapes), number(float(np.median(lags)))
    return (
        f"From {horizons[0]} to {horizons[1]} nutations the shape error stays the same with {same} of the "
        f"{len(shapes)} methods above rounding, at equal steps; the lag in the nutation grows {lag} times in the median"
    )


def _draw(
    axis: Any, cell: xr.Dataset, names: Sequence[str], quantity: str, cost: str, floor: float, scale: float = 1.0
) -> None:
    """An error of a few rows against cost; `cell` is one scene and one horizon."""
    for name in names:
        x, y = curve(cell.sel(integrator=name), quantity, cost, floor)
        axis.plot(x, y, **line(name, 0.9 * scale), lw=max(scale, 0.8), label=name, zorder=2)
    axis.set(xscale="log", yscale="log")
