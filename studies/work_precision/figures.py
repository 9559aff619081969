"""The figures of the work-precision study: fronts, the fastest rows, how much slower the others are, energy, parts."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from symtop.measure import ranking
from symtop.measure.phase import PARTS
from symtop.report.figures import bound_of, error_band, pareto
from symtop.report.style import (
    BLACK,
    GREY,
    LEAST_TEXT,
    few_ticks,
    grid,
    headline,
    lead,
    legend_below,
    line,
    look,
    number,
    same_limits,
)
from symtop.runner.study import Picture

from . import energy, energy_figures, words
from .rankings import slowdown, winners

NAMED = (  # rows with a colour and a name in the fronts, below the owners of the front; all others are thin and grey
    "series[axis]", "taylor[axis]", "takahashi-imada[axis]", "srkn-14-6[axis]", "rk4[axis]", "midpoint[angles]",
    "rk45[angles]", "stormer-verlet[angles]",
)  # fmt: skip
PARTS_OF = ("midpoint[angles]", "stormer-verlet[angles]", "takahashi-imada[axis]", "rk4[axis]",
            "rk45-compiled[angles]", "gauss-8[axis]")  # fmt: skip
MOST = 8  # names in a legend
COSTS = {"seconds": "wall time of one run (s)", "force_evaluations": "force evaluations of one run",
         "evaluations_a_nutation": "force evaluations a nutation"}  # fmt: skip
SAME = 1.5  # an error that grows less stays the same
LEAST = 1e-15  # the lowest error that is drawn, where the reference has no bound
OTHERS = {"color": GREY, "lw": 0.5, "alpha": 0.5, "zorder": 1}  # a line without a name
FRONT = "front of all compiled methods"
FILLS = "Open markers: Euler angles; full ones: (e, L)."


def pictures(data: xr.Dataset) -> list[Picture]:
    """Fronts at both horizons, the fastest rows, the slowdown of all, energy in two charts, and parts of the error."""
    return [
        _fronts(data, "front-short", 0, "seconds"),
        _fronts(data, "front-long", -1, "seconds"),
        _fronts(data, "front-evaluations", 0, "force_evaluations"),
        winners(data),
        slowdown(data),
        *(energy_figures.draw(data, chart) for chart in energy.CHARTS if all(energy.in_chart(data, chart))),
        _parts(data),
    ]


def _fronts(data: xr.Dataset, name: str, far: int, cost: str) -> Picture:
    """Every run of every row, one panel a scene; the front of the compiled rows in black, and a few rows in colour."""
    scenes = [str(scene) for scene in data["scene"].values]
    figure, axes = lead(len(scenes), (COSTS[cost], "largest axis error (rad)"))
    ranked = ranking.ranked(data)
    cells = {scene: data.sel(scene=scene).isel(horizon=far) for scene in scenes}
    compiled = [row for row in words.of_implementation(data, "compiled") if row in ranked]
    floors = {scene: 0.5 * bound_of(cell["axis_bound"].values, LEAST) for scene, cell in cells.items()}
    fronts = {scene: _front(cell.sel(integrator=compiled), cost, floors[scene]) for scene, cell in cells.items()}
    owners = Counter(owner for _, _, owned in fronts.values() for owner in owned)
    most = [row for row, _ in owners.most_common(4)]
    there = np.isfinite(data[cost].isel(horizon=far)).any(["scene", "setting"])
    wanted = [row for row in dict.fromkeys([*most[:2], *NAMED]) if row in ranked]
    shown = [row for row in wanted if bool(there.sel(integrator=row))][:MOST]
    for axis, (scene, cell) in zip(axes, cells.items(), strict=True):
        error_band(axis, cell["axis_bound"].values, LEAST)
        floor = floors[scene]
        for row in ranked:
            if row not in shown:
                axis.plot(*_curve(cell.sel(integrator=row), "axis", cost, floor), **OTHERS)
        _draw(axis, cell, shown, "axis", cost, floor, 1.0 if axis is axes[0] else 0.6)
        x, y, _ = fronts[scene]
        axis.step(x, y, where="post", color=BLACK, alpha=0.2, lw=4.0, zorder=1, label=FRONT)
        if cost == "seconds":
            _closed_form(axis, cell)
        axis.set_title(f"scene {scene}" if axis is axes[0] else scene)
    axes[0].set_ylim(LEAST, 10.0)
    same_limits(axes)
    few_ticks(axes[0])
    few_ticks(*axes[1:], most=3)
    unit = "time" if cost == "seconds" else "work"
    headline(figure, message(most, unit, words.spans(data)[far]))
    _key(axes[0], shown)
    timed = (
        " A run is shown if it was timed, as its row's cheapest for some target or for the comparison of energies; all "
        "times are measured. All rows have the scene, the horizon and the call, of the bare compiled loop. Dotted: the "
        "closed form, `exact`, which is not ranked. A call takes some ten microseconds by itself, where curves bend."
        if cost == "seconds"
        else " All rows have the same scene and horizon. A high derivative, a kick and a stage take different times."
    )
    return Picture(
        name,
        figure,
        f"Largest axis error {words.spans(data)[far]} against {COSTS[cost]}, one panel a scene; each line is a row, a "
        "method in one chart, whose step or tolerance varies along it: eight are named, the others grey. The wide grey "
        "step line is the front of the compiled rows: none of their runs is below or left of it. Most of its points "
        f"belong to {', '.join(most)}. {FILLS} Grey band: below the error bound of the reference.{timed}",
        f"Log-log work-precision plots of the axis error against {COSTS[cost]}, one panel a scene.",
    )


def message(most: Sequence[str], unit: str, span: str) -> str:
    """Who owns most of the front."""
    if not most:
        return f"No method has a run {span}"
    return f"{' and '.join(most[:2])} make{'s' * (len(most) < 2)} up most of the front of least {unit} {span}"


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


def _curve(runs: xr.Dataset, quantity: str, cost: str, floor: float) -> tuple[Any, Any]:
    """The runs of one row from its coarsest setting to its finest."""
    x, y = runs[cost].values, runs[quantity].values
    there = np.isfinite(x) & np.isfinite(y)
    return x[there], np.maximum(y[there], floor)


def _front(cell: xr.Dataset, cost: str, floor: float) -> tuple[Any, Any, list[str]]:
    """The front of some rows: cost and error of its points, and who owns each."""
    x, y = cell[cost].values, np.maximum(cell["axis"].values, floor)
    on = pareto(x, y)
    order = np.argsort(x[on])
    x, y, owners = (part[on][order] for part in (x, y, np.broadcast_to(cell["integrator"].values[:, None], x.shape)))
    return x, y, [str(owner) for owner in owners]


def _closed_form(axis: Any, cell: xr.Dataset) -> None:
    """The time of what takes no steps, as a dotted line."""
    for row in (name for name in map(str, cell["integrator"].values) if name not in ranking.ranked(cell)):
        at = float(cell["seconds"].sel(integrator=row).min())
        if np.isfinite(at):
            said = f"closed form: {words.seconds(at).replace('us', 'µs')}"
            axis.axvline(at, color=look(row).color, ls=":", lw=1.0, zorder=1, label=said)


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
        x, y = _curve(cell.sel(integrator=name), quantity, cost, floor)
        axis.plot(x, y, **line(name, 0.9 * scale), lw=max(scale, 0.8), label=name, zorder=2)
    axis.set(xscale="log", yscale="log")
