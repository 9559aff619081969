"""The drawings that studies share: the grey band of the reference's error bound, and the Pareto front."""

from typing import Any

import numpy as np


def error_band(axis: Any, bounds: Any, least: float = 1e-16) -> float:
    """Shade what lies below the median error bound of the reference; returns that bound, or `least` without one."""
    level = float(np.nanmedian(bounds)) if np.isfinite(bounds).any() else least
    axis.axhspan(level * 1e-3, level, color="#BBBBBB", alpha=0.45, lw=0, label="error bound of the reference")
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


SMALLEST = 1e-17


def largest_so_far(values: Any) -> Any:
    """The largest size up to each sample; zeros are `SMALLEST`, for a logarithmic axis."""
    return np.maximum.accumulate(np.maximum(np.abs(np.asarray(values)), SMALLEST))


def dots(data: xr.Dataset, scenes: Sequence[str], columns: Sequence[tuple[str, str]], *, log: bool) -> Any:
    """One row an integrator, one column a variable, one dot a scene: large tables at a glance.

    Zeros are drawn at `SMALLEST` on a logarithmic axis. Each column is ``(variable, label)``; a variable ``NAME`` with
    a companion ``NAME_interval`` gets a bar.
    """
    names = [str(name) for name in data["integrator"].values]
    figure, axes = panels(1, len(columns), height=0.9 + 0.2 * len(names), sharey=True)
    shift = np.linspace(-0.22, 0.22, len(scenes)) if len(scenes) > 1 else np.zeros(1)
    for axis, (variable, label) in zip(axes[0], columns, strict=True):
        for scene, offset, face in zip(scenes, shift, ("full", "none", "left", "right") * 3, strict=False):
            for row, name in enumerate(names):
                cell = data.sel(scene=scene, integrator=name)
                value, style = float(cell[variable]), look(name)
                if not np.isfinite(value):
                    continue
                value = max(value, SMALLEST) if log else value
                bar = float(cell[f"{variable}_interval"]) if f"{variable}_interval" in cell else 0.0
                axis.errorbar(
                    value,
                    row + offset,
                    xerr=bar,
                    fmt=style.marker,
                    fillstyle=face,
                    color=style.color,
                    ms=5,
                    elinewidth=0.8,
                )
        for face, scene in zip(("full", "none", "left", "right") * 3, scenes, strict=False):
            axis.plot([], [], "o", fillstyle=face, color=GREY, label=scene)
        axis.set(xlabel=label, yticks=range(len(names)), yticklabels=names, ylim=(len(names) - 0.5, -0.5))
        if log:
            axis.set_xscale("log")
    legend_below(figure, axes)
    return figure


def _dashed(cell: xr.Dataset) -> bool:
    return "tier" in cell and "python" in cell["tier"].values


def _band(axis: Any, data: xr.Dataset, scene: str, quantity: str) -> float:
    bounds = data[f"{quantity}_bound"].sel(scene=scene).values
    level = float(np.nanmedian(bounds)) if np.isfinite(bounds).any() else 1e-16
    axis.axhspan(level * 1e-3, level, color="#BBBBBB", alpha=0.45, lw=0, label="error bound of the reference")
    return level


def _curve(axis: Any, xs: Any, ys: Any, judged: Any, style: Look, name: str, dashed: bool) -> None:
    order = np.argsort(xs)
    order = order[np.isfinite(xs[order]) & np.isfinite(ys[order])]
    line = (0, (4, 2)) if dashed else "-"
    axis.plot(xs[order], ys[order], color=style.color, ls=line, lw=1.1, zorder=2)
    filled = np.ones(xs.size, bool) if judged is None else np.asarray(judged, bool)
    for mask, face in ((filled, style.color), (~filled, "white")):
        pick = order[mask[order]]
        axis.plot(xs[pick], ys[pick], style.marker, ls="none", color=style.color, mfc=face, ms=style.size, zorder=3)
    axis.plot(
        [], [], style.marker, color=style.color, ls=line, ms=style.size, lw=1.1, label=name
    )  # one entry in the legend


def residual_history(data: xr.Dataset, scenes: Sequence[str], rows: Sequence[tuple[str, str]]) -> Any:
    """|residual| against time, one row a conserved quantity, one column a scene: envelopes over faint samples."""
    figure, axes = panels(len(rows), len(scenes), height=2.7, sharex="col", sharey="row")
    for (quantity, label), line in zip(rows, axes, strict=True):
        for axis, scene in zip(line, scenes, strict=True):
            for name in data["integrator"].values:
                cell = data.sel(scene=scene, integrator=name)
                t, r = cell["sample_time"].values, np.abs(cell[f"{quantity}_residual"].values)
                good = np.isfinite(r) & np.isfinite(t) & (t > 0.0)
                if not good.any():
                    continue
                t, r = t[good], np.maximum(r[good], 1e-17)
                style = look(str(name))
                axis.plot(t, r, ",", color=style.color, alpha=0.5, zorder=2)
                axis.plot(
                    *envelope(t, r),
                    style.marker + "-",
                    ms=0.8 * style.size,
                    color=style.color,
                    label=str(name),
                    zorder=3,
                )
            axis.set(xscale="log", yscale="log")
            if quantity == rows[0][0]:
                axis.set_title(scene)
        line[0].set_ylabel(label)
    for axis in axes[0]:
        first, last = axis.get_xlim()
        axis.autoscale(enable=False)
        slope_guide(axis, 1.0, (first * 2.0, last / 2.0), 1e-8, "$t$")
    for axis in axes[-1]:
        axis.set_xlabel("time (s)")
    legend_below(figure, axes)
    return figure


def envelope(t: Any, r: Any, windows: int = 18) -> tuple[Any, Any]:
    """Largest value in logarithmic windows of time."""
    edges = np.geomspace(t[0] * 0.999, t[-1], windows + 1)
    place = np.clip(np.searchsorted(edges, t, side="left") - 1, 0, windows - 1)
    kept = np.unique(place)
    return np.sqrt(edges[kept] * edges[kept + 1]), np.array([r[place == k].max() for k in kept])


VERDICT_COLORS = {
    "confirmed": "#CFE8F3",
    "refuted": VERMILLION,
    "measured": "#F2F2F2",
    "undecided": YELLOW,
    "inapplicable": "#FFFFFF",
}


def verdict_matrix(rows: Mapping[str, Sequence[Any]], claims: Sequence[str], symbols: Mapping[str, str]) -> Any:
    """One row an integrator, one column a claim, in each cell a symbol and what was measured, on the verdict's colour;
    a refuted cell shows what was declared as well.

    `rows` holds an integrator's findings in the order of `claims`: things with `verdict`, `declared` and `measured`.
    """
    from matplotlib.patches import Patch, Rectangle

    figure, axes = panels(1, 1, width=14.5, height=0.6 + 0.235 * len(rows))
    axis = axes[0, 0]
    for line, found in enumerate(rows.values()):
        for column, one in enumerate(found):
            color = VERDICT_COLORS[one.verdict]
            axis.add_patch(Rectangle((column - 0.5, line - 0.5), 1.0, 1.0, facecolor=color, edgecolor="white", lw=1.0))
            bad = one.verdict == "refuted"
            said = f"{one.declared} | {one.measured}" if bad else one.measured
            said = f"{symbols[one.verdict]} {said}".replace(" +- ", "±").rstrip()
            axis.text(
                column, line, said, ha="center", va="center", fontsize=min(7.5, (108.0 if bad else 130.0) / len(said)),
                color="white" if bad else "black", fontweight="bold" if bad else "normal",
            )  # fmt: skip
    axis.set(xlim=(-0.5, len(claims) - 0.5), ylim=(len(rows) - 0.5, -0.5), yticks=range(len(rows)), yticklabels=rows)
    axis.set_xticks(range(len(claims)), claims)
    axis.tick_params(length=0, top=True, labeltop=True)
    axis.grid(visible=False)
    axis.spines[:].set_visible(False)
    handles = [
        Patch(facecolor=color, edgecolor=GREY, lw=0.4, label=f"{symbols[verdict]} {verdict}")
        for verdict, color in VERDICT_COLORS.items()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)
    return figure
