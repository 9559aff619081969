"""Figures of the planar quartic oscillator and its exact map."""

import numpy as np
import xarray as xr

from symtop.report import style
from symtop.runner.study import Picture

from . import quartic_tables as quartic
from .quartic_tables import GAPS, MAPS, QUARTICS

LOOKS = {name: style.Look(style.ORANGE, "v") if name == "mcmillan" else style.look(name) for name in MAPS}
SMALLEST = 1e-17
DRAWN = ("planar-softening", *quartic.CHI)  # discrete orbits


def pictures(data: xr.Dataset) -> list[Picture]:
    """Errors, discrete orbits, and the constants of the map."""
    return [draw_errors(data), draw_orbits(data), draw_constants(data)]


def draw_errors(data: xr.Dataset) -> Picture:
    """Errors of the four maps against the step, one panel an oscillator."""
    labels = ("step size over the period T", "largest relative error of x")
    figure, axes = style.grid(len(QUARTICS), 3, labels, height=1.9, sharex=True, sharey=True)
    for axis, name in zip(axes, QUARTICS, strict=True):
        for method in MAPS:
            cell, look = data.sel(scene=name, integrator=method), LOOKS[method]
            errors = np.maximum(cell[quartic.ERROR], SMALLEST)
            axis.plot(cell[quartic.STEP], errors, look.marker, ls=look.dash, color=look.color, ms=3, label=method)
        style.slope_guide(axis, 2.0, (1e-2, 0.4), 1e-5, "$h^2$")
        axis.axvline(0.5, color=style.GREY, lw=0.9, ls=":")
        axis.set(xscale="log", yscale="log", title=name)
        ended = [m for m in MAPS if not np.isfinite(data[quartic.ERROR].sel(scene=name, integrator=m)).all()]
        if ended:
            note = "lost at longer steps:\n" + "\n".join(ended)
            axis.annotate(note, (0.03, 0.28), xycoords="axes fraction", color="#444444", fontsize=style.LEAST_TEXT)
    top = float(data[quartic.ERROR].sel(scene=list(QUARTICS), integrator=list(MAPS)).max())
    axes[0].set_ylim(1e-17, 10.0 * top)
    for axis in axes:
        axis.annotate("T/2 ", (0.5, 1e-9), color="#444444", fontsize=style.LEAST_TEXT, ha="right", va="center")
    style.few_ticks(*axes, most=5)
    style.legend_below(figure, axes)
    exact = float(data[quartic.ERROR].sel(scene=list(QUARTICS), integrator=MAPS[0]).max())
    style.headline(figure, f"{MAPS[0]} is the motion at any step, to {style.number(exact)}; mcmillan, the same map "
                           "with constants to second order, has order 2 as the others")  # fmt: skip
    return Picture(
        "quartic-errors",
        figure,
        f"Planar oscillators x'' = (2 sigma |x|^2 + 3 b) x (no chart), {quartic.PERIODS:g} periods of |x|, steps from "
        f"T/{max(quartic.STEPS):g} to T/{min(quartic.STEPS):g}, against a Taylor series in 24 digits: harmonic as in "
        "the seed, hardening, softening, and the two of which spheroid consists. stormer-verlet, the midpoint rule "
        "and McMillan's map with constants to order h^2 have order 2; with exact constants the same map is the motion, "
        "up to rounding, at any step. A line ends where the map leaves the oscillator for good.",
        "Log-log plots of errors against step for five oscillators: three lines of slope 2 and one at rounding.",
    )


def draw_orbits(data: xr.Dataset) -> Picture:
    """|x_{n+1}|^2 over |x_n|^2 of the maps, on the curve that the motion draws."""
    figure, axes = style.panels(len(quartic.SHOWN), len(DRAWN), height=2.3, sharex="col", sharey="col")
    curve = {"color": style.ORANGES[2], "lw": 3.5, "label": "the motion: $|x(t)|^2$, $|x(t + h)|^2$"}
    for row, steps in enumerate(quartic.SHOWN):
        for axis, name in zip(axes[row], DRAWN, strict=True):
            true = data.sel(scene=name, integrator=MAPS[0]).isel(quartic_shown=row)
            axis.plot(true[quartic.CURVE_HERE], true[quartic.CURVE_AHEAD], **curve)
            for method in reversed(MAPS):
                squares = data[quartic.ORBIT].sel(scene=name, integrator=method).isel(quartic_shown=row).values
                look, face = LOOKS[method], "none" if method == MAPS[0] else LOOKS[method].color
                dots = {"color": look.color, "mfc": face, "ms": 3.6 if method == MAPS[0] else 1.8, "lw": 0}
                axis.plot(squares[:-1], squares[1:], look.marker, label=method, **dots)
            low, high = float(true[quartic.CURVE_HERE].min()), float(true[quartic.CURVE_HERE].max())
            margin = 0.25 * (high - low)
            axis.set(xlim=(low - margin, high + margin), ylim=(low - margin, high + margin))
            axis.set_title(f"{name}, step T/{steps:g}", fontsize=7.5)
            if away := _outside(data.sel(scene=name).isel(quartic_shown=row), low - margin, high + margin):
                axis.text(0.42, 0.45, away, transform=axis.transAxes, ha="center", va="center", color="#444444",
                          fontsize=style.LEAST_TEXT)  # fmt: skip
        axes[row, 0].set_ylabel("$|x_{n+1}|^2$ over the largest $|x|^2$")
    for axis in axes[-1]:
        axis.set_xlabel("$|x_n|^2$ over the largest $|x|^2$")
    style.legend_below(figure, axes)
    far = {method: quartic.off_curve(data, DRAWN[0], method) for method in MAPS}
    off = style.number(min(value for method, value in far.items() if method != MAPS[0]))
    at = f"with steps of T/{quartic.SHOWN[-1]:g} on {DRAWN[0]} the others are off it by {off} at least"
    style.headline(figure, f"At every step {MAPS[0]} stays on the curve of the motion: {at}")
    away = ", ".join(f"{method} {quartic.off_curve(data, DRAWN[0], method):.1g}" for method in MAPS[1:])
    return Picture(
        "quartic-orbits",
        figure,
        f"The first {quartic.POINTS} steps of each map of an oscillator (no chart), by what needs no velocity: the "
        "square of the distance from the centre before a step and after it. Points of the exact map lie on the curve "
        "of the motion. "
        "McMillan's map with constants to order h^2 is integrable and draws a curve of its own; the others "
        "lie off by more the larger the step, and at T/4.4 some have left the picture. Largest distance from the curve "
        f"on {DRAWN[0]} at T/{quartic.SHOWN[-1]:g}, in the units of the figure: {away}.",
        "Scatter plots of consecutive squared radii for three oscillators and two steps, on closed curves.",
    )


def _outside(orbits: xr.Dataset, low: float, high: float) -> str:
    """Which maps have points outside a panel, or none in it, as a note; empty if none has."""
    parts = []
    for method in MAPS:
        values = orbits[quartic.ORBIT].sel(integrator=method).values
        out = int(np.sum(~((values >= low) & (values <= high))))
        if out:
            parts.append(f"{method}:\n{out} of {values.size} points\noff the chart")
    return "\n".join(parts)


def draw_constants(data: xr.Dataset) -> Picture:
    """A, B and delta against the step, and how their distances from the neighbours' vanish."""
    figure, axes = style.panels(1, 3, height=2.4)
    true = data.sel(scene=quartic.CHI[0], integrator=MAPS[0])
    steps = true[quartic.STEP].values
    limit = quartic.oscillator_of(quartic.CHI[0])
    fine = np.linspace(0.0, 0.5, 200)
    axes[0, 0].plot(fine, 1.0 + 1.5 * limit.b * (fine * limit.period) ** 2, color=style.ORANGE)
    axes[0, 0].annotate("$1 + 3bh^2/2$", (0.22, -0.6), color=style.ink(style.ORANGE), ha="right")
    axes[0, 0].axhline(-1.0, color=style.GREY, lw=0.9, ls=":")
    axes[0, 0].plot(steps, true[quartic.A], "D-", color=LOOKS[MAPS[0]].color, ms=4)
    axes[0, 0].annotate("$A$", (0.31, 0.55), color=LOOKS[MAPS[0]].color)
    axes[0, 0].axhline(0.0, color=style.GREY, lw=0.9)
    axes[0, 0].set(ylim=(-1.3, 1.1), xlabel="step size over T", title="A")
    axes[0, 1].axhline(1.0, color=style.ORANGE)
    axes[0, 1].plot(steps, true[quartic.B_OVER], "D-", color=LOOKS[MAPS[0]].color, ms=4)
    axes[0, 1].annotate("limit of small steps", (0.48, 0.96), color=style.ink(style.ORANGE), ha="right", va="top")
    axes[0, 1].set(xlabel="step size over T", title=r"$-B\,/\,(\sigma h^2)$")
    shades = (style.BLUE, style.VERMILLION, style.GREEN)
    labels = (("A", 4, 1.6), ("B", 4, 0.5), (r"\delta", 3, 1.0))  # the last: how far above its line's end
    for gap, (symbol, power, above), shade in zip(GAPS, labels, shades, strict=True):
        values = true[gap].where(true[gap] > quartic.ROUNDING)
        axes[0, 2].plot(steps, values, "o-", color=shade, ms=4)
        place = 0.004, above * float(values[-1])
        axes[0, 2].annotate(f"${symbol}$, $h^{power}$", place, color=shade, va="center", ha="right")
    axes[0, 2].set(xscale="log", yscale="log", xlim=(1e-3, 0.7), ylim=(1e-7, 20.0), xlabel="step size over T")
    axes[0, 2].set_title("distance from the limit")
    style.few_ticks(axes[0, 2], most=4)
    style.headline(figure, "The constant A of the exact map stays above -1 (dotted) at long steps, where its "
                           "limit of small steps, a parabola, does not")  # fmt: skip
    return Picture(
        "quartic-constants",
        figure,
        f"The numbers of the exact map of {quartic.CHI[0]} (no chart) against the step. To order h^2 they are those of "
        "stormer-verlet and McMillan: A = 1 + 3 b h^2/2, B = -sigma h^2, no turn delta. Beyond, A stays a cosine-like "
        "function of the step, zero at half a nutation, where a parabola would leave [-1, 1] and the step be unstable.",
        "Three panels: A and its parabola, B over its limit, and gaps of A, B and delta with slopes 4, 4 and 3.",
    )
