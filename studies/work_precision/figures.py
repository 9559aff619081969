"""The figures of the work-precision study: fronts, the fastest variants, the slowdown of the others, energy, parts."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from symtop.measure.phase import PARTS
from symtop.report.style import BLUE, GREY, LEAST_TEXT, VERMILLION, headline, legend_below, number, panels
from symtop.runner.study import Picture

from . import energy, energy_figures, fronts, growth
from .rankings import slowdown, winners

SAME = 1.5  # an error that grows less stays the same
MARKS = {"shape": ("o", "black", "black"), "nutation_lag": ("s", "white", VERMILLION),
         "precession_lag": ("^", "white", BLUE)}  # fmt: skip


def pictures(data: xr.Dataset) -> list[Picture]:
    """Fronts at both horizons, the fastest variants, the slowdown of all, energy in two charts, parts of the error."""
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
    """How the parts of the error grow from one horizon to the other at equal steps, a row a method."""
    scene = data.isel(scene=0)
    rows = growth.rows_of(data)
    first, last = (f"{data['horizon'].values[far]:g}" for far in (0, -1))
    length = float(data["horizon"][-1] / data["horizon"][0])
    figure, axes = panels(1, 1, height=0.36 * len(rows) + 0.9)
    axis = axes[0, 0]
    for place, row in enumerate(rows):
        for k, part in enumerate(PARTS):
            marker, fill, color = MARKS[part]
            height = place + 0.22 * (k - 1)
            ratios = energy.ratios_at_equal_settings(scene.sel(variant=row), part)
            label = PARTS[part].partition(" (")[0]
            if not ratios:
                box = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
                said = f"{label}: at rounding or over budget"
                axis.text(1.6 * length, height, said, fontsize=LEAST_TEXT, va="center", bbox=box)
                continue
            axis.plot(ratios, [height] * len(ratios), "|", color=color, ms=5, mew=0.7, alpha=0.6, zorder=2)
            axis.plot(np.median(ratios), height, marker, mfc=fill, mec=color, ms=6, mew=1.2, zorder=3,
                      label=f"{label}, median")  # fmt: skip
    axis.plot([], [], "|", color="#444444", ms=5, mew=0.7, label="one step or tolerance")
    for at, said in ((1.0, "the same"), (length, "as the time")):
        axis.axvline(at, color=GREY, lw=0.9, ls=(0, (5, 3)), zorder=1)
        axis.annotate(said, (at, 1.0), (0, 3), xycoords=("data", "axes fraction"), textcoords="offset points",
                      ha="center", fontsize=LEAST_TEXT)  # fmt: skip
    axis.set(xscale="log", ylim=(max(len(rows), 1) - 0.5, -0.5), yticks=range(len(rows)), yticklabels=rows)
    axis.set_xlabel(f"error over {last} nutations / error over {first}, at equal steps or tolerances")
    axis.grid(visible=False, axis="y")
    axis.tick_params(axis="y", length=0)
    legend_below(figure, axes)
    growths = {part: [energy.growth_at_equal_settings(scene.sel(variant=row), part) for row in rows]
               for part in ("shape", "nutation_lag")}  # fmt: skip
    known = [[value for value in values if np.isfinite(value)] for values in growths.values()]
    if all(known):
        headline(figure, growth_message((first, last), *known))
    else:
        headline(figure, f"Parts of the axis error over {first} and {last} nutations")
    figure.legends[0].set_title(
        "Shape: distance from the true path. Lags: how far the run is behind or ahead on it, in the angle of the\n"
        f"nutation and of the precession. Scene {scene['scene'].values}; errors over {first} nutations above "
        f"{number(energy.ROUNDED, 1)}."
    )
    return Picture(
        "parts",
        figure,
        f"How the parts of the axis error on {scene['scene'].values} grow from {first} to {last} nutation periods at "
        "equal step or tolerance, a line a variant, method[chart]. Shape is the distance from the true path. The lags "
        "are how far the run is behind or ahead of the truth in its nutation and in its precession. Large marks are "
        f"medians over the settings that were run at both and whose error is above {energy.ROUNDED:g} at the first; "
        "thin marks are each of them. A shape error that stays the same is a path that is kept, whatever the phase on "
        "it. The table of the growth has the medians.",
        "Dot plot of the growth of shape error, nutation lag and precession lag, a row a method.",
    )


def growth_message(horizons: tuple[str, str], shapes: Sequence[float], lags: Sequence[float]) -> str:
    """How the errors of the path and of the nutation's phase grow from one horizon to another at equal steps."""
    same, lag = sum(value < SAME for value in shapes), number(float(np.median(lags)))
    return (
        f"The shape error stays the same with {same} of the {len(shapes)} methods above rounding from {horizons[0]} to "
        f"{horizons[1]} nutations; the lag in the nutation grows {lag} times in the median"
    )
