"""The figures of the work-precision study: fronts, fastest methods, profiles, and a few methods against cost."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from symtop.measure import ranking
from symtop.measure.errors import QUANTITIES
from symtop.measure.phase import PARTS
from symtop.measure.work import TARGETS
from symtop.report.figures import error_band, pareto
from symtop.report.style import BLACK, GREY, grid, legend_below, look, panels, slope_guide
from symtop.runner.study import Picture

from . import words
from .energy import COMPARED

LEADERS = 9  # bold curves of the performance profiles
ALWAYS_SHOWN = ("midpoint", "stormer-verlet", "rk4", "rk45-compiled", "rk45")
PARTS_OF = ("midpoint", "stormer-verlet", "takahashi-imada", "rk4", "rk45-compiled", "gauss-8")
COSTS = {"seconds": "wall time of one run (s)", "force_evaluations": "force evaluations of one run"}
LEAST = 1e-15  # the lowest error that is drawn, where the reference has no bound
MOST_TIMES = 1000.0  # the fastest method's time: the right end of a profile
SHARED = {"width": 11.5, "sharex": True, "sharey": True}


def pictures(data: xr.Dataset) -> list[Picture]:
    """Fronts at both horizons, the fastest methods, profiles, energy at the long horizon, and parts of the error."""
    return [
        _fronts(data, "front-short", 0, "seconds"),
        _fronts(data, "front-long", -1, "seconds"),
        _fronts(data, "front-evaluations", 0, "force_evaluations"),
        _winners(data),
        _profiles(data),
        _energy(data),
        _parts(data),
    ]


def _fronts(data: xr.Dataset, name: str, far: int, cost: str) -> Picture:
    """Every run of every method, one panel a scene; the front of the compiled methods in bold, marked by its methods.

    Dashed: the front of the methods whose inner loop is plain Python.
    """
    scenes = [str(scene) for scene in data["scene"].values]
    labels = (COSTS[cost], f"largest {QUANTITIES['axis']}")
    figure, axes = grid(len(scenes), min(3, len(scenes)), labels, height=3.2, **SHARED)
    on_front: dict[str, None] = {}
    for axis, scene in zip(axes, scenes, strict=True):
        cell = data.sel(scene=scene).isel(horizon=far)
        floor = 0.5 * error_band(axis, cell["axis_bound"].values, LEAST)
        for implementation, line in (("compiled", "-"), ("python", (0, (3, 2)))):
            names = words.of_implementation(cell, implementation)
            for method in names:
                x, y = _curve(cell.sel(integrator=method), "axis", cost, floor)
                axis.plot(x, y, color=look(method).color, ls=line, lw=0.7, alpha=0.4, zorder=1)
            front = _front(axis, cell.sel(integrator=names), implementation, cost, floor)
            on_front |= dict.fromkeys(front if implementation == "compiled" else ())
        axis.set(xscale="log", yscale="log", title=scene)
    axes[0].set_ylim(LEAST, 3.0)
    legend_below(figure, axes)
    timed = " A run is shown if it was timed, as its method's cheapest for some target." if cost == "seconds" else ""
    return Picture(
        name,
        figure,
        f"Largest axis error {words.spans(data)[far]} against {labels[0]}. Each thin line is a method. The black step "
        "line is the front of the compiled methods: none of their runs is below or left of it. On it are "
        f"{', '.join(on_front)}. Dashed: methods whose inner loop is plain Python, with a front of their own. Grey "
        f"band: below the error bound of the reference.{timed}",
        f"Log-log work-precision plots of the axis error against {labels[0]}, one panel a scene.",
    )


def _curve(runs: xr.Dataset, quantity: str, cost: str, floor: float) -> tuple[Any, Any]:
    x, y = runs[cost].values, runs[quantity].values
    order = np.argsort(x)
    order = order[np.isfinite(x[order]) & np.isfinite(y[order])]
    return x[order], np.maximum(y[order], floor)


def _front(axis: Any, cell: xr.Dataset, implementation: str, cost: str, floor: float) -> list[str]:
    """Draw the front of the compiled (or plain Python) methods; returns the names of those on it."""
    x, y = cell[cost].values, np.maximum(cell["axis"].values, floor)
    on = pareto(x, y)
    if not on.any():
        return []
    order = np.argsort(x[on])
    x, y, owners = (part[on][order] for part in (x, y, np.broadcast_to(cell["integrator"].values[:, None], x.shape)))
    line = "-" if implementation == "compiled" else (0, (4, 2))
    axis.step(
        x, y, where="post", color=BLACK, ls=line, lw=1.4, zorder=3, label=f"front of the {implementation} methods"
    )
    names = list(dict.fromkeys(map(str, owners)))
    for name in names:
        style = look(name)
        edge = {"mec": style.color, "mew": 1.6} if style.marker in "x+" else {"mec": "white", "mew": 0.4}
        axis.plot(
            x[owners == name], y[owners == name], style.marker, ls="none", color=style.color, ms=style.size + 2.0,
            zorder=4, label=name, **edge,
        )  # fmt: skip
    return names


def _winners(data: xr.Dataset) -> Picture:
    """One row a scene, one column a target, one panel a horizon: the fastest method's colour and name."""
    from matplotlib.colors import to_rgb

    scenes = [str(name) for name in data["scene"].values]
    wins = ranking.winners(data)
    figure, axes = panels(1, data.sizes["horizon"], width=11.5, height=0.55 + 0.36 * len(scenes), sharey=True)
    for (scene, far, target), won in wins.items():
        axis, row, column = axes[0, far], scenes.index(scene), TARGETS.index(target)
        strength, label, color = 0.0, "none", GREY
        if won is not None:
            name = won.best.integrator
            strength, label = (0.35, f"~{name}") if won.level else (0.95, name)
            shade = strength * np.array(to_rgb(look(name).color)) + (1.0 - strength)
            axis.fill_between([column - 0.49, column + 0.49], row - 0.46, row + 0.46, color=shade, lw=0)
            color = "white" if shade @ np.array([0.3, 0.59, 0.11]) < 0.55 else "black"
        size = min(8.0, 130.0 / len(label))
        axis.text(column, row, label, ha="center", va="center", fontsize=size, color=color)
    for axis, span in zip(axes[0], words.spans(data), strict=True):
        axis.set(
            xlim=(-0.5, len(TARGETS) - 0.5), ylim=(len(scenes) - 0.5, -0.5), yticks=range(len(scenes)),
            yticklabels=scenes, xticks=range(len(TARGETS)), title=span, xlabel="largest axis error allowed (rad)",
            xticklabels=[f"$10^{{{np.log10(target):.0f}}}$" for target in TARGETS],
        )  # fmt: skip
        axis.grid(visible=False)
        axis.tick_params(length=0)
    kept, uncounted = ranking.counted(data)
    counting = [won for (scene, *_), won in wins.items() if scene in kept["scene"].values]
    count = Counter(won.best.integrator for won in counting if won)
    most = ", ".join(f"{name} ({times})" for name, times in count.most_common(4))
    return Picture(
        "winners",
        figure,
        f"The fastest compiled method for each axis error that settings were searched for. Most often: {most}, of "
        f"{len(counting)} cells.{words.left_out(uncounted)} Pale and with a tilde: its lead over at least one other "
        "method is within the noise.",
        "Coloured strips naming the fastest method, a row a scene, a column an accuracy.",
    )


def _profiles(data: xr.Dataset) -> Picture:
    """Share of problems on which a method's time is within a factor of the best, one panel a target."""
    names = words.of_implementation(data, "compiled")
    ratios = ranking.relative_costs(ranking.counted(data)[0], names)
    shown = ranking.leaders(ratios.sel(integrator=names), LEADERS)
    shown += [name for name in ALWAYS_SHOWN if name not in shown]
    labels = ("time, in units of the fastest method's", "share of scenes and horizons")
    figure, axes = grid(len(TARGETS), 2, labels, height=3.3, **SHARED)
    for axis, target in zip(axes, TARGETS, strict=True):
        for name in map(str, ratios["integrator"].values):
            x = np.sort(ratios.sel(target=target, integrator=name).values)
            y = np.arange(1, x.size + 1) / x.size
            x, y = x[x <= MOST_TIMES], y[x <= MOST_TIMES]
            if not x.size:
                continue
            style, bold = look(name), name in shown
            axis.step(
                [x[0], *x, MOST_TIMES], [0.0, *y, y[-1]], where="post", color=style.color, lw=1.5 if bold else 0.6,
                alpha=1.0 if bold else 0.35, zorder=3 if bold else 1,
            )  # fmt: skip
            if bold:
                axis.plot(x, y, style.marker, ls="none", color=style.color, ms=0.8 * style.size, zorder=4)
                axis.plot([], [], style.marker + "-", color=style.color, ms=style.size, label=name)
        axis.set(xscale="log", xlim=(0.9, MOST_TIMES), ylim=(-0.02, 1.05), title=f"axis error {target:.0e}")
    legend_below(figure, axes)
    return Picture(
        "profiles",
        figure,
        f"Share of the {ratios.sizes['problem']} pairs of scene and horizon on which a method meets a target within a "
        "factor (horizontal) of the fastest compiled method's time. A curve's left end is the share on which the "
        "method is the fastest; its right end is the share on which it meets the target at all, within its budget of "
        "force evaluations and a thousand times the fastest time. Closest to the fastest over all targets is "
        f"{shown[0]}, then {', '.join(shown[1:4])}.",
        "Performance profiles at four targets, one curve a method.",
    )


def _energy(data: xr.Dataset) -> Picture:
    scenes = [str(name) for name in data["scene"].values]
    labels = (COSTS["seconds"], f"largest {QUANTITIES['energy']}")
    figure, axes = grid(len(scenes), min(3, len(scenes)), labels, height=3.0, **SHARED)
    for axis, scene in zip(axes, scenes, strict=True):
        cell = data.sel(scene=scene).isel(horizon=-1)
        _draw(axis, cell, COMPARED, "energy", "seconds", 0.5 * error_band(axis, cell["energy_bound"].values))
        axis.set_title(scene)
    axes[0].set_ylim(1e-16, 30.0)
    middle = float(np.sqrt(np.prod(axes[0].get_xlim())))
    for power, level in ((-2.0, 1e-6), (-4.0, 1e-10)):
        slope_guide(axes[0], power, (0.1 * middle, 0.6 * middle), level, f"cost$^{{{power:g}}}$")
    legend_below(figure, axes)
    return Picture(
        "energy-long",
        figure,
        f"Energy error {words.spans(data)[-1]} against {labels[0]}. {words.energy_in_all(data)}",
        "Log-log plots of energy error against time at the long horizon for six methods, one panel a scene.",
    )


def _parts(data: xr.Dataset) -> Picture:
    scene = data.isel(scene=0)
    name, spans = str(scene["scene"].values), words.spans(data)
    shape = {"width": 11.5, "height": 3.0, "sharex": True, "sharey": "row"}
    figure, axes = grid(2 * len(PARTS), 2, (COSTS["force_evaluations"], ""), **shape)
    for row, (part, label) in enumerate(PARTS.items()):
        for far, axis in zip((0, -1), axes[2 * row : 2 * row + 2], strict=True):
            _draw(axis, scene.isel(horizon=far), PARTS_OF, part, "force_evaluations", 5e-17)
            axis.set(title="" if row else f"{name}, {spans[far]}", ylabel="" if far else label)
    legend_below(figure, axes)
    first, last = (f"{data['horizon'].values[far]:g}" for far in (0, -1))
    return Picture(
        "parts",
        figure,
        f"Parts of the axis error on {name}: distance from the true path (shape), and how far the run is behind or "
        f"ahead of the truth in its nutation and in its precession (lags). From {first} to {last} nutation periods, at "
        f"equal step or tolerance, the shape error grows by a factor of {words.growth(scene, PARTS_OF, 'shape')}; the "
        f"nutation lag by a factor of {words.growth(scene, PARTS_OF, 'nutation_lag')}.",
        "Shape error, nutation lag and precession lag against work at two horizons.",
    )


def _draw(axis: Any, cell: xr.Dataset, names: Sequence[str], quantity: str, cost: str, floor: float) -> None:
    """An error of a few methods against cost; `cell` is one scene and one horizon."""
    for name in names:
        style = look(name)
        x, y = _curve(cell.sel(integrator=name), quantity, cost, floor)
        axis.plot(x, y, style.marker + "-", color=style.color, ms=style.size, lw=1.1, label=name)
    axis.set(xscale="log", yscale="log")
