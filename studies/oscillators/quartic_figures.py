"""Figures of the planar quartic oscillator and its exact map."""

from collections.abc import Mapping

import numpy as np
import xarray as xr

from symtop.report import style
from symtop.runner.study import Picture

from . import quartic_tables as quartic
from .quartic_tables import MAPS, QUARTICS

LOOKS = {name: style.Look(style.ORANGE, "v") if name == "mcmillan" else style.look(name) for name in MAPS}
SMALLEST = 1e-17
STABLE = (-1.0, 1.0)  # of A, as of the cosine that it is for a harmonic oscillator
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
            cell, look = data.sel(scene=name, variant=method), LOOKS[method]
            errors = np.maximum(cell[quartic.ERROR], SMALLEST)
            axis.plot(cell[quartic.STEP], errors, look.marker, ls=look.dash, color=look.color, ms=3, label=method)
        style.slope_guide(axis, 2.0, (1e-2, 0.4), 1e-5, "$h^2$")
        axis.axvline(0.5, color=style.GREY, lw=0.9, ls=":")
        axis.set(xscale="log", yscale="log", title=name)
        ended = [m for m in MAPS if not np.isfinite(data[quartic.ERROR].sel(scene=name, variant=m)).all()]
        if ended:
            note = "lost at longer steps:\n" + "\n".join(ended)
            axis.annotate(note, (0.03, 0.28), xycoords="axes fraction", color="#444444", fontsize=style.LEAST_TEXT)
    top = float(data[quartic.ERROR].sel(scene=list(QUARTICS), variant=list(MAPS)).max())
    axes[0].set_ylim(1e-17, 10.0 * top)
    for axis in axes:
        axis.annotate("T/2 ", (0.5, 1e-9), color="#444444", fontsize=style.LEAST_TEXT, ha="right", va="center")
    style.few_ticks(*axes, most=5)
    style.legend_below(figure, axes)
    exact = float(data[quartic.ERROR].sel(scene=list(QUARTICS), variant=MAPS[0]).max())
    style.headline(figure, f"{MAPS[0]} is the motion at any step, to {style.number(exact)}; mcmillan, the same map "
                           "with constants to second order, has order 2 as the others")  # fmt: skip
    return Picture(
        "quartic-errors",
        figure,
        f"Planar oscillators x'' = (2 sigma |x|^2 + 3 b) x (no chart), {quartic.PERIODS:g} periods of |x|, steps from "
        f"T/{max(quartic.STEPS):g} to T/{min(quartic.STEPS):g}, against a Taylor series in 29 digits: harmonic as in "
        "the seed, hardening, softening, and the two of which spheroid consists. stormer-verlet, the midpoint rule "
        "and McMillan's map with constants to order h^2 have order 2; with exact constants the same map is the motion, "
        "up to rounding, at any step. A line ends where the map leaves the oscillator for good.",
        "Log-log plots of errors against step for five oscillators: three lines of slope 2 and one at rounding.",
    )


def draw_orbits(data: xr.Dataset) -> Picture:
    """|x_{n+1}|^2 over |x_n|^2 of the maps at the larger step, on the curve that the motion draws."""
    figure, axes = style.panels(1, len(DRAWN), height=2.6)
    curve = {"color": "#BDBDBD", "lw": 5.0, "label": "the motion: $|x(t)|^2$, $|x(t + h)|^2$", "zorder": 1}
    far = {method: quartic.off_curve(data, DRAWN[0], method) for method in MAPS}
    least, most = (pick(MAPS[1:], key=lambda method: far[method]) for pick in (min, max))
    for axis, name in zip(axes[0], DRAWN, strict=True):
        cell = data.sel(scene=name).isel(quartic_shown=-1)
        true = cell.sel(variant=MAPS[0])
        axis.plot(true[quartic.CURVE_HERE], true[quartic.CURVE_AHEAD], **curve)
        low, high = float(true[quartic.CURVE_HERE].min()), float(true[quartic.CURVE_HERE].max())
        ends = low - 0.25 * (high - low), high + 0.25 * (high - low)
        for method in MAPS:
            squares, look = cell[quartic.ORBIT].sel(variant=method).values, LOOKS[method]
            dots = {"color": look.color, "mfc": "none" if method == MAPS[0] else look.color, "lw": 0, "ms": 3.2}
            axis.plot(squares[:-1], squares[1:], look.marker, label=method, zorder=2 + (method != MAPS[0]), **dots)
        axis.set(xlim=ends, ylim=ends, aspect="equal", xlabel="$|x_n|^2$ / largest $|x|^2$")
        axis.set_title(f"{name}, step T/{quartic.SHOWN[-1]:g}", fontsize=7.5)
        axis.text(0.5, 0.4, _outside(cell, *ends), transform=axis.transAxes, ha="center", va="center",
                  color="#444444", fontsize=style.LEAST_TEXT)  # fmt: skip
    for method, corner in ((least, (0.16, 0.07)), (most, (0.53, 0.55))) if least != most else ():
        squares = data[quartic.ORBIT].sel(scene=DRAWN[0], variant=method).values[-1]
        worst = int(np.argmax(quartic.distances(data, DRAWN[0], method)))
        place, color = squares[worst : worst + 2], style.ink(LOOKS[method].color)
        axes[0, 0].plot(*place, "o", color=style.BLACK, mfc="none", ms=9.0, mew=1.2, zorder=5)
        axes[0, 0].annotate(style.number(far[method]), place, corner, textcoords="axes fraction", weight="bold",
                            ha="center", color=color, arrowprops={"arrowstyle": "-", "lw": 0.7, "shrinkB": 4}
                            )  # fmt: skip
    axes[0, 0].plot([], [], "o", color=style.BLACK, mfc="none", ms=9.0, mew=1.2, label="the title's distances")
    axes[0, 0].set_ylabel("$|x_{n+1}|^2$ / largest $|x|^2$")
    style.legend_below(figure, axes)
    style.headline(figure, orbits_message(far))
    away = ", ".join(f"{method} {far[method]:.1g}" for method in MAPS[1:])
    return Picture(
        "quartic-orbits",
        figure,
        f"The first {quartic.POINTS} steps of each map of an oscillator (no chart), by what needs no velocity: the "
        "square of the distance from the centre before a step and after it. Points of the exact map lie on the curve "
        "of the motion. "
        "McMillan's map with constants to order h^2 is integrable and draws a curve of its own; the others lie off as "
        "well, and some have left the picture. Largest distance from the curve "
        f"on {DRAWN[0]}, in the units of the figure: {away}.",
        "Scatter plots of consecutive squared radii for three oscillators: one map on the closed curve of the motion, "
        "three off it.",
    )


def orbits_message(far: Mapping[str, float]) -> str:
    """Which map stays on the curve of the motion, and how far the nearest and the farthest of the others are off it."""
    others = [far[method] for method in MAPS[1:]]
    return (
        f"At steps of T/{quartic.SHOWN[-1]:g} only {MAPS[0]} stays on the curve of the motion; the largest "
        f"distance of the others is {style.number(min(others))} to {style.number(max(others))} on {DRAWN[0]}"
    )


def _outside(orbits: xr.Dataset, low: float, high: float) -> str:
    """Which maps have points outside a panel, as a note; empty if none has."""
    parts = []
    for method in MAPS:
        values = orbits[quartic.ORBIT].sel(variant=method).values
        inside = (values >= low) & (values <= high)
        out = int(np.sum(~(inside[:-1] & inside[1:])))  # a point is two values
        if out:
            parts.append(f"{method}:\n{'all' if out == values.size - 1 else out} of {values.size - 1}\noutside")
    return "\n".join(parts)


def draw_constants(data: xr.Dataset) -> Picture:
    """A of the exact map against the step, and that of stormer-verlet, its limit of small steps."""
    figure, axes = style.panels(1, 1, height=2.5)
    axis, true = axes[0, 0], data.sel(scene=quartic.CHI[0], variant=MAPS[0])
    steps, A = true[quartic.STEP].values, true[quartic.A].values
    limit = quartic.oscillator_of(quartic.CHI[0])
    leaves = 2.0 / (np.sqrt(-3.0 * limit.b) * limit.period)  # where 1 + 3 b h^2/2 = -1, in periods
    axis.axhspan(*STABLE, color="#E4E4E4", lw=0, zorder=0)
    axis.axhline(STABLE[0], color="#444444", lw=0.9, zorder=1)
    fine = np.linspace(0.0, 0.5, 200)
    shade, exact = LOOKS["stormer-verlet"].color, LOOKS[MAPS[0]]
    axis.plot(fine, 1.0 + 1.5 * limit.b * (fine * limit.period) ** 2, color=shade, lw=1.6)
    axis.plot(steps, A, marker=exact.marker, color=exact.color, ms=4.5, lw=1.6)
    axis.plot(leaves, STABLE[0], "o", color=shade, ms=6.0, mfc="white", mew=1.4)
    said = {"textcoords": "offset points", "va": "center"}
    middle = len(steps) // 3
    axis.annotate("exact map", (steps[middle], A[middle]), (8, 10), color=exact.color, weight="bold", **said)
    parabola, beside = "stormer-verlet,\nthe limit of small steps", (0.65 * leaves, -0.25)
    axis.annotate(parabola, beside, (0, 0), color=style.ink(shade), weight="bold", ha="right", **said)
    crossing = f"leaves the stable band\nat a step of {leaves:.2f} T"
    axis.annotate(crossing, (leaves, STABLE[0]), (12, 13), color=style.ink(shade), **said)
    axis.annotate("stable: $-1 \\leq A \\leq 1$", (0.495, STABLE[0]), (0, 9), color="#444444", ha="right", **said)
    axis.annotate("unstable", (0.495, STABLE[0]), (0, -9), color="#444444", ha="right", **said)
    axis.set(xlim=(0.0, 0.5), ylim=(-1.45, 1.1), yticks=(-1.0, -0.5, 0.0, 0.5, 1.0))
    axis.set_xlabel("step size h over T, the period of the oscillator's distance from its centre")
    axis.set_ylabel("A in $Z_{n+1} + Z_{n-1} = 2 A Z_n/(1 + B|Z_n|^2)$")
    kept = STABLE[0] <= A.min() and A.max() <= STABLE[1]
    stays = f"{'stays' if kept else 'does not stay'} in the stable band at all steps, to {steps.max():.2f} T"
    other = f"that of stormer-verlet leaves it at {leaves:.2f} T"
    style.headline(figure, f"The coefficient A of the exact map {stays}; {other}")
    return Picture(
        "quartic-constants",
        figure,
        "The coefficient A of the maps Z+ + Z- = 2 A Z/(1 + B |Z|^2) of the oscillator x'' = (2 sigma |x|^2 + 3 b) x, "
        f"against the step h, here for {quartic.CHI[0]} (no chart). Near the centre a step is stable if A is in "
        "[-1, 1]. To order h^2 the constants of the exact map are those of stormer-verlet and McMillan: A = 1 + 3 b "
        "h^2/2, B = -sigma h^2, no turn delta. Beyond, A stays a cosine-like function of the step, zero at T/2, where "
        f"the parabola has long left the band; -B/(sigma h^2) falls to {float(true[quartic.B_OVER].min()):.2f}.",
        "Two curves against the step: A of the exact map stays in the band from -1 to 1, a parabola leaves it.",
    )
