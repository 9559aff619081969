"""Figures of the stability study: the maps of known variants, and four mechanisms of failure with their theory."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.colors import ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from symtop.methods.framework.registry import split_name
from symtop.methods.splitting.space import cayley_sleeps_from, strang_sleeps_from
from symtop.report import style
from symtop.report.figures import chosen
from symtop.runner.study import Picture

from .atlas import OutcomeMap, families, maps
from .failures import LOST, MOST as LARGEST, SEEN
from .many_verdicts import EARLY, JUDGED, SAID, WRONG
from .mechanisms import measured, rate

KNOWN = (  # the variants whose maps are drawn, if they are there
    "stormer-verlet[angles]", "midpoint[angles]", "rk4[angles]", "rk4[axis]", "strang[axis]", "takahashi-imada[axis]",
    "yoshida-4[axis]", "gauss-8[axis]", "rk45-compiled[axis]", "dop853[axis]", "lsoda[axis]", "taylor[axis]",
)  # fmt: skip
MOST, COLUMNS = len(KNOWN), 4  # maps in a figure, and beside each other
OUTCOMES = {  # colours, by the labels of the legend; all reasons for an early end have one
    **dict(zip((SAID[name] for name in JUDGED), (style.GREEN, style.YELLOW, style.ORANGE, style.PURPLE), strict=True)),
    EARLY: style.BLACK, SAID["wrong"]: style.SKY, "accurate, not run": "#9FDAC8",
}  # fmt: skip
LINES = {"linear_limit": ("small nutations grow beyond", "-"),
         "third_turn": ("a step turns the nutation by a third", (0, (4, 2)))}  # fmt: skip
SETTINGS = {"step_size": "step (nutations)", "tolerance": "tolerance"}
NAMED = ("stormer-verlet[angles]", "midpoint[angles]", "strang[axis]", "cayley[axis]", "gauss-4[axis]", "rk4[axis]")
THEORY = {"color": style.BLACK, "lw": 0.9, "ls": (0, (1, 1.5)), "zorder": 4, "label": "theory"}
SLEEPS, WIDTHS = 2.0, 1.75  # spin from which the motion sleeps; half the drawn range, over the largest shift of theory
OTHERS = {"color": style.GREY, "alpha": 0.5, "zorder": 1, "label": "all others, lines or dots"}


def pictures(data: xr.Dataset) -> Iterator[Picture]:
    """The maps of the first family, and the mechanisms that were measured."""
    for family in families(data)[:1]:
        panels = {name: map_ for name, map_ in maps(data, family).items() if map_.control in SETTINGS}
        if panels:
            yield Picture("atlas", _atlas(data.sel(scene=family), _chosen(panels)))
    draws = [draw for scene, variable, draw in MECHANISMS if measured(data, scene, variable)]
    if draws:
        figure, axes = style.grid(len(draws), 2, height=2.4)
        for axis, draw in zip(axes, draws, strict=True):
            draw(axis, data)
        style.few_ticks(*axes, most=5)
        style.legend_below(figure, axes)
        yield Picture("mechanisms", figure)


def _chosen(panels: Mapping[str, OutcomeMap]) -> dict[str, OutcomeMap]:
    """The known variants, or all if these are few; those with a step first."""
    names = chosen(list(panels), KNOWN, MOST)
    return {name: panels[name] for name in sorted(names, key=lambda name: list(SETTINGS).index(panels[name].control))}


def _atlas(part: xr.Dataset, panels: Mapping[str, OutcomeMap]) -> Any:
    """One panel for each variant: spin upwards, step or tolerance to the right; each control begins a row."""
    places: dict[int, str] = {}
    for control in SETTINGS:
        first = -(-(max(places, default=-1) + 1) // COLUMNS) * COLUMNS
        places |= dict(enumerate((name for name, map_ in panels.items() if map_.control == control), first))
    figure, axes = style.panels(max(places) // COLUMNS + 1, COLUMNS, height=1.35)
    for place, axis in enumerate(axes.flat):
        axis.set_visible(place in places)
    for place, name in places.items():
        map_, axis = panels[name], axes.flat[place]
        codes = np.where(map_.outcome == WRONG, len(JUDGED) + 1, np.minimum(map_.outcome, len(JUDGED)))
        codes = np.where(map_.made, codes, len(OUTCOMES) - 1)
        axis.imshow(codes, cmap=ListedColormap(list(OUTCOMES.values())), vmin=-0.5, vmax=len(OUTCOMES) - 0.5,
                    extent=(*_ends(map_.settings), *_ends(map_.parameter)), origin="lower", aspect="auto",
                    interpolation="nearest")  # fmt: skip
        limits = axis.axis()
        for variable, (_, dash) in LINES.items():
            if variable in part:
                cell = part.sel(variant=name)
                x, y = np.log10(cell[variable].values), np.log10(cell["limit_parameter"].values)
                axis.plot(x, y, color="white", lw=2.2)
                axis.plot(x, y, color="black", lw=0.9, ls=dash)
        axis.axis(limits)
        axis.grid(visible=False)
        for side in (axis.xaxis, axis.yaxis):
            side.set_major_locator(MaxNLocator(3, integer=True))
            side.set_major_formatter(lambda power, _: f"{10.0**power:g}" if power > -3 else f"$10^{{{power:.0f}}}$")
        axis.set_title(
            "{}\n[{}] accurate {:.0f} %".format(*split_name(name), 100.0 * map_.accurate), fontsize=style.LEAST_TEXT
        )
        axis.tick_params(labelsize=style.LEAST_TEXT)
        below = places.get(place + COLUMNS)
        if below is None or panels[below].control != map_.control:
            axis.set_xlabel(SETTINGS[map_.control], fontsize=style.LEAST_TEXT)
        if place % COLUMNS == 0:
            axis.set_ylabel("spin $r$", fontsize=style.LEAST_TEXT)
    handles: list[Any] = [Patch(color=color, label=label) for label, color in OUTCOMES.items()]
    handles += [Line2D([], [], color="black", lw=1.1, ls=dash, label=label) for label, dash in LINES.values()]
    figure.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False)
    return figure


def _ends(values: Any) -> tuple[float, float]:
    """Lower and upper edge of cells centred at logarithmically even values, as decimal logarithms."""
    low, high = np.log10(values[[0, -1]])
    half = 0.5 * (high - low) / (values.size - 1) if values.size > 1 else 0.5
    return float(low - half), float(high + half)


def _lines(axis: Any, part: xr.Dataset, x: str, y: str, dots: bool = False) -> None:
    """A line, or dots, for each variant; if there are many, those not in `NAMED` are grey and without a label."""
    variants = list(map(str, part["variant"].values))
    names = chosen(variants, NAMED, len(NAMED))
    for name in variants:
        u, v = (part[key].sel(variant=name).values for key in (x, y))
        order = np.argsort(u)
        u, v = u[order], v[order]
        good = np.isfinite(u) & np.isfinite(v)
        if good.any():
            looks = style.line(name) | {"label": name, "markevery": max(1, int(good.sum()) // 8), "zorder": 3}
            looks = looks if name in names else OTHERS | {"lw": 0.6, "marker": "." if dots else "", "ms": 3.0}
            axis.plot(u[good], v[good], **(looks | ({"ls": "none", "markevery": 1} if dots else {})))


def _pole(axis: Any, data: xr.Dataset) -> None:
    _lines(axis, data.sel(scene="grazing"), "parameter_value", "grazing_error")
    axis.set(xscale="log", yscale="log", title="a pole next to the path")
    axis.set(xlabel=r"gap $\delta$ to the pole (rad)", ylabel="largest axis error (rad)")


def _resonance(axis: Any, data: xr.Dataset) -> None:
    part, resonance = data.sel(scene="steady-fast"), ("third_turn_phase", "surviving_at_third_turn")
    names = dict(zip(resonance, ("phase_value", "surviving"), strict=True))  # it lies between two of the grid
    part = xr.concat([part[list(names.values())], part[list(resonance)].rename(names)], "phase")
    for theory in (np.sqrt(3.0), 2.0 * np.sqrt(3.0)):
        axis.axvline(theory, **THEORY)
    _lines(axis, part, "phase_value", "surviving")
    axis.set(
        xlabel=r"step $h\omega$ ($\omega$: frequency of the nutation)",
        ylabel=f"largest displacement survived\n(rad; {LARGEST:g}: none larger tried)",
        title="resonance of step and nutation",
    )


def _separatrix(axis: Any, data: xr.Dataset) -> None:
    part = data.sel(scene="separatrix")
    _lines(axis, part.assign(horizon=rate() * part["horizon"]), "early_error", "horizon", dots=True)
    error = np.geomspace(1e-16, 0.1, 50)
    axis.plot(error, SEEN + np.log(LOST / error), **THEORY)
    axis.set(xscale="log", xlabel=rf"axis error at ${SEEN:g}/\lambda$ (rad)", title="next to the separatrix")
    axis.set_ylabel(rf"time to {LOST:g} rad ($1/\lambda$)")


def _sleep(axis: Any, data: xr.Dataset) -> None:
    _lines(axis, data.sel(scene="sleeping"), "sleeping_step", "sleeping_threshold", dots=True)
    steps = np.linspace(0.02, 1.0, 60)
    laws = np.array([[law(float(h)) for h in steps] for law in (cayley_sleeps_from, strang_sleeps_from)])
    for law in laws:
        axis.plot(steps, law, **THEORY)
    wide = WIDTHS * np.abs(laws - SLEEPS).max()  # a few dots far away would squeeze both laws into one line
    beyond = int((np.abs(data["sleeping_threshold"].sel(scene="sleeping") - SLEEPS) > wide).sum())
    if beyond:
        axis.text(0.02, 0.98, f"{beyond} dots lie beyond this axis", va="top", fontsize=style.LEAST_TEXT,
                  transform=axis.transAxes)  # fmt: skip
        axis.set_ylim(SLEEPS - wide, SLEEPS + wide)
    axis.set(xlabel="step $h$", ylabel="least spin that sleeps $I_3\\omega_3$", title="the upright top")


MECHANISMS = (  # scene, variable that it needs, drawing
    ("grazing", "grazing_error", _pole), ("steady-fast", "surviving", _resonance),
    ("separatrix", "horizon", _separatrix), ("sleeping", "sleeping_threshold", _sleep),
)  # fmt: skip
