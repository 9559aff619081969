"""Figures of the study: orders of the damped oscillator, and the exact map."""

import numpy as np
import xarray as xr

from symtop.methods.lagrangian.damped_oscillator import ONE_SIDED
from symtop.report import style
from symtop.report.figures import SMALLEST
from symtop.runner.study import Picture

from .facts import CRITICAL
from .measures import OSCILLATORS, order
from .quartic_measures import ERROR, MAPS, QUARTICS, STEP

SYMBOLS = {"midpoint": "o", "trapezoidal": "s", ONE_SIDED: "v"}
PLAIN = {ONE_SIDED: "force at one end"}
ORDERS = (  # panels: an oscillator, what is measured of it, and in words
    (CRITICAL, "position_error", "position x: largest error"),
    ("damping-3", "exponent_error", "rate of decay: relative error"),
    (CRITICAL, "exponent_error", "rate of decay: relative error"),
)
LOOKS = {name: style.Look(style.ORANGE, "v") if name == "mcmillan" else style.look(name) for name in MAPS}


def pictures(data: xr.Dataset) -> list[Picture]:
    """The figure of friction, then that of the exact map, if these were measured."""
    figures = []
    for draw, oscillators, names in (
        (draw_orders, OSCILLATORS, SYMBOLS), (draw_maps, QUARTICS, MAPS),
    ):  # fmt: skip
        scenes = [name for name in oscillators if name in data["scene"]]
        variants = [name for name in names if name in data["variant"]]
        if scenes and variants:
            figures.append(draw(data, scenes, variants))
    return figures


def draw_orders(data: xr.Dataset, _: list[str], names: list[str]) -> Picture:
    """Errors of the position and of the rate of decay against the step, at critical damping and beside it."""
    figure, axes = style.panels(1, len(ORDERS), height=2.9, sharex=True, sharey=True)
    for axis, (name, error, title) in zip(axes[0], ORDERS, strict=True):
        for line, method in enumerate(names):
            run, marker = data.sel(scene=name, variant=method), SYMBOLS[method]
            color = style.PURPLE if method == ONE_SIDED else style.look(method).color
            marks = {"mfc": "none", "ms": 3.4} if method == "trapezoidal" else {"mfc": color, "ms": 4.6}
            errors = run[error].where(run[error] > 1e-13)  # above rounding
            axis.plot(run["step_size"], errors, marker + "-", color=color, lw=1.1, **marks)
            slope = order(data, name, method, error).slope
            axis.text(0.98, 0.23 - 0.085 * line, f"{PLAIN.get(method, method)}: order {slope:.1f}", ha="right",
                      transform=axis.transAxes, color=style.ink(color), fontsize=7.5, weight="bold")  # fmt: skip
        oscillator = OSCILLATORS[name]
        axis.set(xscale="log", yscale="log", xlabel=r"step ($\sqrt{m/k}$)")
        axis.set_title(f"{title}\nb = {oscillator.damping:g}, {oscillator.regime}")
    axes[0, 0].set_ylabel("error")
    style.few_ticks(*axes.flat, most=6)
    return Picture("orders", figure)


def draw_maps(data: xr.Dataset, scenes: list[str], names: list[str]) -> Picture:
    """Errors of the maps against the step, one panel an oscillator."""
    labels = ("step size over the period T", "largest relative error of x")
    figure, axes = style.grid(len(scenes), 3, labels, height=1.9, sharex=True, sharey=True)
    for axis, name in zip(axes, scenes, strict=True):
        for method in names:
            cell, look = data.sel(scene=name, variant=method), LOOKS[method]
            errors = np.maximum(cell[ERROR], SMALLEST)
            axis.plot(cell[STEP], errors, look.marker, ls=look.dash, color=look.color, ms=3, label=method)
        style.slope_guide(axis, 2.0, (1e-2, 0.4), 1e-5, "$h^2$")
        axis.axvline(0.5, color=style.GREY, lw=0.9, ls=":")
        axis.annotate("T/2 ", (0.5, 1e-9), color="#444444", fontsize=style.LEAST_TEXT, ha="right", va="center")
        axis.set(xscale="log", yscale="log", title=name)
        ended = [method for method in names if not np.isfinite(data[ERROR].sel(scene=name, variant=method)).all()]
        if ended:
            note = "lost at longer steps:\n" + "\n".join(ended)
            axis.annotate(note, (0.03, 0.28), xycoords="axes fraction", color="#444444", fontsize=style.LEAST_TEXT)
    axes[0].set_ylim(1e-17, 10.0 * float(data[ERROR].sel(scene=scenes, variant=names).max()))
    style.few_ticks(*axes, most=5)
    style.legend_below(figure, axes)
    return Picture("quartic-errors", figure)
