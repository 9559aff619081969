"""Figures of the study of the notebook: the energy error far beyond its end, and the modified energy."""

import math

import xarray as xr

from symtop.report import style
from symtop.runner.study import Picture

from .facts import DRAWN
from .long_energy import better_from, energy_until, notebook_end
from .measures import MIDPOINT, MODIFIED, SOLVER


def pictures(data: xr.Dataset) -> list[Picture]:
    """The energy of the solver and of methods of order two; the modified energy."""
    runs = data["variant"].values
    figures = [draw_energy(data)] if any(name in runs for name in (SOLVER, *DRAWN)) else []
    return [*figures, draw_modified_energy(data)] if any(name in runs for name in MODIFIED) else figures


def draw_energy(data: xr.Dataset) -> Picture:
    """The largest energy error so far of the solver and of methods of order two, far beyond the notebook's end."""
    names = [name for name in (SOLVER, *DRAWN) if name in data["variant"].values]
    labels = ("time (s)", "largest energy error so far\n/ energy of the nutation")
    figure, axes = style.grid(data.sizes["scene"], 2, labels, height=2.7, sharey=True)
    ring = {"color": style.BLACK, "mfc": "none", "ms": 8.0, "mew": 1.3, "lw": 0.0, "zorder": 5}
    for axis, scene in zip(axes, map(str, data["scene"].values), strict=True):
        for name in names:
            run = data.sel(scene=scene, variant=name)
            line = style.line(name, 0.8) | {"markevery": 0.12, "label": name}
            wide = line | {"marker": "", "lw": 2.4, "ls": "-"}
            axis.plot(run["long_time"], run["long_energy"], **(wide if name == SOLVER else line))
            start = better_from(data, scene, name) if SOLVER in names and name != SOLVER else math.inf
            if 0.0 < start < math.inf:
                axis.plot(start, energy_until(data, scene, name, start), "o", **ring)
        axis.set(xscale="log", yscale="log", title=f"scene {scene}")
        end = notebook_end(data, scene)
        axis.axvline(end, color=style.GREY, lw=1.4, zorder=1)
        axis.annotate(f"end of the\nnotebook, {end:g} s", (end, 0.02), (4, 0), xycoords=axis.get_xaxis_transform(),
                      textcoords="offset points", fontsize=7.5, color="#444444", va="bottom")  # fmt: skip
    if SOLVER in names:
        axes[0].plot([], [], "o", label="from here on better than lsoda", **ring)
    style.few_ticks(*axes, most=5)
    style.legend_below(figure, axes)
    return Picture("energy", figure)


def draw_modified_energy(data: xr.Dataset) -> Picture:
    """Energy and modified energy of two discrete methods, over time and against the step."""
    names, scenes = [name for name in MODIFIED if name in data["variant"].values], list(map(str, data["scene"].values))
    over_time = MIDPOINT in names
    figure, axes = style.panels(1, over_time + len(scenes), height=2.2)
    kinds = (("energy_swing", "energy", "-"), ("modified_swing", "modified energy", "--"))
    if over_time:
        run, first = data.sel(scene=scenes[0], variant=MIDPOINT), axes[0, 0]
        for (column, kind, _), color in zip(kinds, (style.ORANGE, style.BLACK), strict=True):
            first.plot(run["shadow_time"], run[f"{column}_history"], color=color, label=f"{kind} over time")
        first.set(
            title=f"{MIDPOINT}, {scenes[0]},\n40 steps a nutation",
            xlabel="time (s)",
            ylabel="change\n/ energy of the nutation",
        )
    for axis, scene in zip(axes[0, over_time:], scenes, strict=True):
        for name in names:
            run, look = data.sel(scene=scene, variant=name), style.look(name)
            h = run["shadow_step_size"]
            for column, kind, line in kinds:
                axis.plot(h, run[column], look.marker + line, color=look.color, ms=0.8 * look.size,
                          mfc=look.color if line == "-" else "white", label=f"{kind}, {name}")  # fmt: skip
        for power, column in ((2, "energy_swing"), (4, "modified_swing")):
            span = float(h.min()), float(h.max())
            style.slope_guide(axis, power, span, 0.2 * float(run[column].min()), f"$h^{power}$")
        axis.set(xscale="log", yscale="log", xlabel="step size (s)", ylabel="largest change\n/ energy of the nutation")
        axis.set_title(f"scene {scene}")
        style.few_ticks(axis, most=4)
    style.legend_below(figure, axes)
    return Picture("modified-energy", figure)
