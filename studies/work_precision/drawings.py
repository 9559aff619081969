"""The drawings of the work-precision study: fronts, fastest methods, profiles, and a few methods against cost."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from symtop.report.figures import pareto
from symtop.report.style import BLACK, GREY, grid, legend_below, look, panels, slope_guide

from .tables import Column

SHORT = {
    "stormer-verlet": "verlet", "takahashi-imada": "takahashi", "suzuki-umeno-8": "umeno-8",
    "sofroniou-spaletta-10": "sofroniou-10", "taylor-longdouble": "taylor-long", "rk45-compiled": "rk45-comp",
    "stormer-verlet-yoshida-4": "verlet-y4", "stormer-verlet-suzuki-4": "verlet-s4", "galerkin-simpson": "galerkin",
    "midpoint-unreduced": "midpoint-u", "trapezoidal-unreduced": "trapezoidal-u",
    "stormer-verlet-blanes-moan-6": "verlet-bm6",
}  # fmt: skip


def fronts(
    data: xr.Dataset, quantity: str, cost: str, labels: tuple[str, str], least: float = 1e-15
) -> tuple[Any, list[str]]:
    """Every run of every method, one panel a scene; the front of the compiled methods in bold, marked by who is on it.

    `data` is one horizon. Dashed: the front of the methods whose inner loop is plain Python. Returns the figure and the
    names on the compiled front.
    """
    scenes = [str(name) for name in data["scene"].values]
    columns = min(3, len(scenes))
    figure, axes = grid(len(scenes), columns, labels, width=11.5, height=3.2, sharex=True, sharey=True)
    on_front: dict[str, None] = {}
    for axis, scene in zip(axes, scenes, strict=True):
        cell = data.sel(scene=scene)
        bounds = cell[f"{quantity}_bound"].values
        floor = float(np.nanmedian(bounds)) if np.isfinite(bounds).any() else least
        axis.axhspan(least * 1e-3, floor, color="#BBBBBB", alpha=0.45, lw=0, label="error bound of the reference")
        for name in cell["integrator"].values:
            x, y = _curve(cell.sel(integrator=name), cost, quantity, 0.5 * floor)
            python = "python" in cell[Column.IMPLEMENTATION].sel(integrator=name).values
            axis.plot(x, y, color=look(str(name)).color, ls=(0, (3, 2)) if python else "-", lw=0.7, alpha=0.4, zorder=1)
        for tier, line in (("compiled", "-"), ("python", (0, (4, 2)))):
            names = _front(axis, cell, cost, quantity, tier, line, 0.5 * floor)
            if tier == "compiled":
                on_front |= dict.fromkeys(names)
        axis.set(xscale="log", yscale="log", title=scene)
    axes[0].set_ylim(least, 3.0)
    legend_below(figure, axes)
    return figure, list(on_front)


def _curve(cell: xr.Dataset, cost: str, quantity: str, floor: float) -> tuple[Any, Any]:
    x, y = cell[cost].values, cell[quantity].values
    good = np.isfinite(x) & np.isfinite(y)
    order = np.argsort(x[good])
    return x[good][order], np.maximum(y[good][order], floor)


def _front(axis: Any, cell: xr.Dataset, cost: str, quantity: str, tier: str, line: Any, floor: float) -> list[str]:
    x, y = cell[cost].values, np.maximum(cell[quantity].values, floor)
    x = np.where(cell[Column.IMPLEMENTATION].values == tier, x, np.nan)
    on = pareto(x, y)
    if not on.any():
        return []
    order = np.argsort(x[on])
    steps = x[on][order], y[on][order]
    label = f"front of the {tier} methods"
    axis.step(*steps, where="post", color=BLACK, ls=line, lw=1.4, zorder=3, label=label)
    owners = np.broadcast_to(cell["integrator"].values[:, None], x.shape)[on][order]
    for name in dict.fromkeys(str(owner) for owner in owners):
        pick = owners == name
        style = look(name)
        edge = {"mec": style.color, "mew": 1.6} if style.marker in "x+" else {"mec": "white", "mew": 0.4}
        axis.plot(
            steps[0][pick], steps[1][pick], style.marker, ls="none", color=style.color, ms=style.size + 2.0, zorder=4,
            label=name, **edge,
        )  # fmt: skip
    return list(dict.fromkeys(str(owner) for owner in owners))


def winner_strips(
    wins: Mapping[tuple[str, int, float], Any], scenes: Sequence[str], horizons: Sequence[str], targets: Sequence[float]
) -> Any:
    """One row a scene, one column a decade of accuracy, one panel a horizon: the fastest method's colour and name.

    `wins` maps (scene, index of the horizon, target) to a `ranking.Win` or None. Pale, with a tilde: level with others.
    """
    from matplotlib.colors import to_rgb

    figure, axes = panels(len(horizons), 1, width=11.5, height=0.55 + 0.36 * len(scenes))
    for far, (axis, horizon) in enumerate(zip(axes[:, 0], horizons, strict=True)):
        for row, scene in enumerate(scenes):
            for column, target in enumerate(targets):
                won = wins[scene, far, target]
                if won is None:
                    axis.text(column, row, "none", ha="center", va="center", fontsize=7.5, color=GREY)
                    continue
                name = won.best.integrator
                strength = 0.95 if won.reliable else 0.35
                color = strength * np.array(to_rgb(look(name).color)) + (1.0 - strength)
                axis.fill_between([column - 0.49, column + 0.49], row - 0.46, row + 0.46, color=color, lw=0)
                dark = color @ np.array([0.3, 0.59, 0.11]) < 0.55
                label = SHORT.get(name, name)
                axis.text(
                    column, row, label if won.reliable else f"~{label}", ha="center", va="center", fontsize=7.5,
                    color="white" if dark else "black",
                )  # fmt: skip
        axis.set(
            xlim=(-0.5, len(targets) - 0.5), ylim=(len(scenes) - 0.5, -0.5), yticks=range(len(scenes)),
            yticklabels=scenes, xticks=range(len(targets)), title=horizon,
            xticklabels=[f"$10^{{{np.log10(target):.0f}}}$" for target in targets],
        )  # fmt: skip
        axis.grid(visible=False)
        axis.tick_params(length=0)
    axes[-1, 0].set_xlabel("largest angle between the axes that is allowed (rad)")
    return figure


def profiles(ratios: xr.DataArray, shown: Sequence[str], titles: Sequence[str]) -> Any:
    """Share of problems on which a method's cost is within a factor of the best, one panel a target.

    `ratios` (target, integrator, problem) are costs over the best cost, infinite where the target was not met: a curve
    that ends below one did not solve the rest. The methods in `shown` are bold.
    """
    count, labels = ratios.sizes["target"], ("time, in units of the fastest method's", "share of scenes and horizons")
    figure, axes = grid(count, min(2, count), labels, width=11.0, height=3.3, sharex=True, sharey=True)
    most = 1000.0
    for axis, number, title in zip(axes, range(count), titles, strict=True):
        for name in ratios["integrator"].values:
            values = np.sort(ratios.isel(target=number).sel(integrator=name).values)
            share = np.arange(1, values.size + 1) / values.size
            kept = values <= most
            if not kept.any():
                continue
            x, y = np.append(values[kept], most), np.append(share[kept], share[kept][-1])
            style, bold = look(str(name)), str(name) in shown
            axis.step(
                np.insert(x, 0, x[0]), np.insert(y, 0, 0.0), where="post", color=style.color, lw=1.5 if bold else 0.6,
                alpha=1.0 if bold else 0.35, zorder=3 if bold else 1,
            )  # fmt: skip
            if bold:
                size = style.size
                axis.plot(x[:-1], y[:-1], style.marker, ls="none", color=style.color, ms=0.8 * size, zorder=4)
                axis.plot([], [], style.marker + "-", color=style.color, ms=size, label=str(name))
        axis.set(xscale="log", xlim=(0.9, most), ylim=(-0.02, 1.05), title=title)
    legend_below(figure, axes)
    return figure


def few_curves(
    columns: Mapping[str, xr.Dataset], names: Sequence[str], rows: Mapping[str, str], cost: str, xlabel: str
) -> Any:
    """A few methods against cost: one row a quantity and its label, one column a dataset of one scene and horizon."""
    count = len(rows) * len(columns)
    figure, axes = grid(count, len(columns), (xlabel, ""), width=11.5, height=3.0, sharex=True, sharey="row")
    for axis, title in zip(axes, columns, strict=False):
        axis.set_title(title)
    for k, (quantity, label) in enumerate(rows.items()):
        line = axes[k * len(columns) : (k + 1) * len(columns)]
        for axis, cell in zip(line, columns.values(), strict=True):
            draw_curves(axis, cell, names, quantity, cost)
            axis.set(xscale="log", yscale="log")
        line[0].set_ylabel(label)
    legend_below(figure, axes)
    return figure


def draw_curves(
    axis: Any, cell: xr.Dataset, names: Sequence[str], quantity: str, cost: str, bound: str | None = None
) -> None:
    """One panel: error of a quantity against cost for a few methods, over error bound of the reference."""
    floor = 1e-16
    if bound is not None and np.isfinite(cell[bound].values).any():
        floor = float(np.nanmedian(cell[bound].values))
        axis.axhspan(floor * 1e-3, floor, color="#BBBBBB", alpha=0.45, lw=0, label="error bound of the reference")
    for name in names:
        x, y = _curve(cell.sel(integrator=name), cost, quantity, 0.5 * floor)
        style = look(name)
        axis.plot(x, y, style.marker + "-", color=style.color, ms=style.size, lw=1.1, label=name)


def small_multiples(
    data: xr.Dataset,
    names: Sequence[str],
    quantity: str,
    cost: str,
    labels: tuple[str, str],
    limits: tuple[float, float],
) -> Any:
    """A few methods on every scene of one horizon."""
    scenes = [str(name) for name in data["scene"].values]
    columns = min(3, len(scenes))
    figure, axes = grid(len(scenes), columns, labels, width=11.5, height=3.0, sharex=True, sharey=True)
    for axis, scene in zip(axes, scenes, strict=True):
        draw_curves(axis, data.sel(scene=scene), names, quantity, cost, f"{quantity}_bound")
        axis.set(xscale="log", yscale="log", title=scene, ylim=limits)
    for power, level in ((-2.0, 1e-2), (-4.0, 1e-6)):
        least, most = axes[0].get_xlim()
        middle = math.sqrt(least * most)
        slope_guide(axes[0], power, (0.1 * middle, 0.6 * middle), level * 1e-4, f"cost$^{{{power:g}}}$")
    legend_below(figure, axes)
    return figure
