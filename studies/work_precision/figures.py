"""The figures of the work-precision study: fronts, the fastest rows, how much slower the others are, energy, parts."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from symtop.measure.phase import PARTS
from symtop.report.style import few_ticks, grid, headline, legend_below, line, number
from symtop.runner.study import Picture

from . import energy, energy_figures, fronts, words
from .fronts import COSTS, curve
from .rankings import slowdown, winners

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
        *(energy_figures.draw(data, chart) for chart in energy.CHARTS if all(energy.in_chart(data, chart))),
        _parts(data),
    ]


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


def _draw(axis: Any, cell: xr.Dataset, names: Sequence[str], quantity: str, cost: str, floor: float) -> None:
    """An error of a few rows against cost; `cell` is one scene and one horizon."""
    for name in names:
        x, y = curve(cell.sel(integrator=name), quantity, cost, floor)
        axis.plot(x, y, **line(name, 0.9), lw=1.0, label=name, zorder=2)
    axis.set(xscale="log", yscale="log")
