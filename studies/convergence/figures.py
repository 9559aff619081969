"""Figures of the study: five methods against work, error against step for each order, error against tolerance."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.ticker import LogLocator

from symtop.measure.errors import QUANTITIES
from symtop.methods.registry import split_name
from symtop.report.figures import error_band
from symtop.report.style import GREY, grid, legend_below, look, slope_guide
from symtop.runner.study import Picture

from .tables import (
    LARGE,
    MAIN,
    adaptive,
    by_order,
    evaluations_a_nutation,
    fits,
    guide_constant,
    merged,
    stepping,
    tolerance_fits,
)  # fmt: skip
from .words import spans

STEEP = 8  # from this order on a guide as long as that of a lower order would leave the figure
NAMED = ("midpoint", "trapezoidal", "stormer-verlet", "rk45", "taylor")  # the five that every reader knows
HORIZON = "over 8 nutations (spheroid: to t = 8)"


def pictures(data: xr.Dataset) -> list[Picture]:
    """The five named methods against work; axis error against the step by declared order; against the tolerance."""
    steps, chosen = stepping(data), adaptive(data)
    groups = by_order(steps)
    drawn = [_named(data), *(_by_step(steps.sel(integrator=names), MAIN, power) for power, names in groups.items())]
    if 2 in groups:
        drawn.append(_by_step(steps.sel(integrator=groups[2]), "energy", 2))
    return [*drawn, _by_tolerance(chosen)] if chosen.sizes["integrator"] else drawn


def _panels(data: xr.Dataset, labels: tuple[str, str]) -> tuple[Any, list[tuple[str, Any]]]:
    """A figure with a logarithmic panel for each scene."""
    scenes = [str(name) for name in data["scene"].values]
    figure, axes = grid(len(scenes), 3 if len(scenes) == 3 else min(2, len(scenes)), labels)
    for axis, scene in zip(axes, scenes, strict=True):
        axis.set(xscale="log", yscale="log", title=scene)
    return figure, list(zip(scenes, axes, strict=True))


def _line(axis: Any, cell: xr.Dataset, name: str, label: str, x: Any, y: Any, used: Any) -> None:
    """One row: points that enter a fit are filled or half filled, the others small; plain Python is dashed."""
    ranked = np.argsort(x)
    ranked = ranked[np.isfinite(x[ranked]) & np.isfinite(y[ranked])]
    if not ranked.size:
        return
    style = look(name)
    line = (0, (4, 2)) if "python" in cell["implementation"].values else "-"
    axis.plot(x[ranked], y[ranked], color=style.color, ls=line, lw=1.1, zorder=2)
    marks = {"marker": style.marker, "color": style.color, "ls": "none", "fillstyle": style.fill}
    axis.plot(x[used], y[used], ms=style.size, zorder=3, **marks)
    axis.plot(x[~used], y[~used], ms=0.45 * style.size, zorder=3, **marks)
    axis.plot([], [], ms=style.size, lw=1.1, label=label, **(marks | {"ls": line}))  # the one entry in the legend


def _named(data: xr.Dataset) -> Picture:
    names = [name for name in map(str, data["integrator"].values) if split_name(name)[0] in NAMED]
    part = data.sel(integrator=names)
    labels = merged(part, MAIN)
    figure, panels = _panels(part, ("force evaluations per nutation", f"largest {QUANTITIES[MAIN]}"))
    for scene, axis in panels:
        floor = error_band(axis, part.sel(scene=scene)[f"{MAIN}_bound"].values)
        for name, label in labels.items():
            cell = part.sel(scene=scene, integrator=name)
            error = np.maximum(cell[MAIN].values, 0.3 * floor)
            work = evaluations_a_nutation(cell, scene)
            _line(axis, cell, name, label, work, error, np.isfinite(error))
        axis.set_xlim(right=2e5)
    legend_below(figure, [axis for _, axis in panels])
    caption = (
        f"The five methods that everybody knows, on one axis of work: largest axis error {HORIZON} against force "
        "evaluations per nutation, each at all of its steps or tolerances. A line of slope -2 costs ten times the work "
        "for a hundredth of the error. A Taylor step of order n counts n evaluations; dashed is plain Python. "
        f"{_least_work(part, labels)} Held fixed: scene, horizon and the error that is measured; method and chart "
        "differ from line to line."
    )
    alt = "Log-log plots of axis error against force evaluations per nutation for the five named methods."
    return Picture("named-methods", figure, caption, alt)


def _least_work(part: xr.Dataset, labels: dict[str, str], target: float = 1e-6) -> str:
    """What each row of the first scene pays for an error below a target."""
    scene = str(part["scene"].values[0])
    paid = {}
    for name in labels:
        cell = part.sel(scene=scene, integrator=name)
        work = evaluations_a_nutation(cell, scene)[cell[MAIN].values <= target]
        if work.size:
            paid[name] = float(np.min(work))
    listed = ", ".join(f"{name} {work:.3g}" for name, work in sorted(paid.items(), key=lambda one: one[1]))
    return f"For an error below {target:g} on {scene}, the cheapest run of each takes: {listed}." if paid else ""


def _by_step(data: xr.Dataset, quantity: str, power: int) -> Picture:
    """One panel a scene, one line a row, or one for rows of a method whose errors agree."""
    fitted, labels = fits(data, quantity), merged(data, quantity)
    figure, panels = _panels(data, ("step size (s)", f"largest {QUANTITIES[quantity]}"))
    for scene, axis in panels:
        part = data.sel(scene=scene)
        floor = error_band(axis, part[f"{quantity}_bound"].values)
        for name, label in labels.items():
            cell, fit = part.sel(integrator=name), fitted.get((scene, name))
            error = np.maximum(cell[quantity].values, 0.3 * floor)
            used = np.zeros(error.size, bool) if fit is None else fit.used & np.isfinite(fit.slope)
            _line(axis, cell, name, label, cell["step_size"].values, error, used)
        axis.xaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))  # labels of all nine would collide
        axis.grid(visible=True, which="major")
        constants = [fit.constant for pair, fit in fitted.items() if pair[0] == scene and np.isfinite(fit.slope)]
        least = min(constants, default=guide_constant(part, quantity, power))
        if power and np.isfinite(least):
            coarse = float(part["step_size"].max())
            width, below = (0.2, 0.15) if power < STEEP else (0.5, 0.02)
            ends = (width * coarse, coarse)
            slope_guide(axis, power, ends, below * least * ends[0] ** power, f"$h^{{{power}}}$")
    legend_below(figure, [axis for _, axis in panels])
    title = f"methods of order {power}" if power else "methods that declare no order"
    caption = (
        f"Largest {quantity} error {HORIZON} against the step, {title}, every chart of each; charts of a method with "
        "the same errors share a line. Large points enter the fit; small ones are too large, too far from the series "
        "in h, or within ten times round-off or the error bound of the reference (grey band). A line without large "
        "points is judged by its errors at the end, or by a run in long double, or not at all: see the table. "
        f"{spans(fitted)}"
    )
    alt = f"Log-log plots of {quantity} error against step size, {title}, with the slope {power} as a guide."
    return Picture(f"{quantity}-order-{power}", figure, caption, alt)


def _by_tolerance(data: xr.Dataset) -> Picture:
    """Error of the adaptive rows against their tolerance, with the line where they are equal."""
    fitted, labels = tolerance_fits(data), merged(data, MAIN)
    figure, panels = _panels(data, ("tolerance", f"largest {QUANTITIES[MAIN]}"))
    for scene, axis in panels:
        part = data.sel(scene=scene)
        floor = error_band(axis, part[f"{MAIN}_bound"].values)
        for name, label in labels.items():
            cell = part.sel(integrator=name)
            error = np.maximum(cell[MAIN].values, 0.3 * floor)
            _line(axis, cell, name, label, cell["tolerance"].values, error, fitted[scene, name].used)
        ends = np.array([1e-14, LARGE])
        axis.plot(ends, ends, color=GREY, lw=0.9, ls=(0, (5, 3)), zorder=1, label="error = tolerance")
    legend_below(figure, [axis for _, axis in panels])
    slopes = {name: [fit.slope for pair, fit in fitted.items() if pair[1] == name and np.isfinite(fit.slope)]
              for name in labels}  # fmt: skip
    listed = ", ".join(f"{name} {min(values):.2f} to {max(values):.2f}" for name, values in slopes.items() if values)
    caption = (
        f"Largest axis error {HORIZON} of the adaptive methods against the tolerance that was asked for; relative and "
        "absolute tolerance of the Runge-Kutta methods are equal. A tolerance bounds the error of a step and not that "
        "of a run: lines above the dashed diagonal lose more than they were asked for. Exponents x of "
        f"error ~ tolerance^x: {listed}. Large points enter the fit; dashed lines are plain Python."
    )
    alt = "Log-log plots of axis error against tolerance for the adaptive methods, with the diagonal as a guide."
    return Picture("tolerance", figure, caption, alt)
