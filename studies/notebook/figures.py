"""Figures of the notebook study: what the notebook drew, beside the truth, in its order."""

import math
from typing import Any

import numpy as np
import xarray as xr

from symtop.measure.conservation import CONSTANTS
from symtop.model.charts import axis_distance
from symtop.model.scenes import scene
from symtop.report import style
from symtop.report.figures import SMALLEST, largest_so_far
from symtop.runner.study import Picture

from . import solid, words
from .long_energy import better_from, energy_until, notebook_end
from .tables import ALPHA, FILMED, MIDPOINT, MODIFIED, SOLVER, SOLVER_TOLERANCE, STEPS_A_NUTATION, Column
from .words import PARTS

NAMED = (SOLVER, *words.DRAWN)  # the others are thin grey lines
LABELS = {"energy": "energy", "p_phi": r"$p_\varphi$", "p_psi": r"$p_\psi$"}
UNITS = {"energy": "J", "p_phi": "J s", "p_psi": "J s"}
REFERENCES = {"energy": "mean", "p_phi": "start", "p_psi": "start"}  # of the notebook's own residuals
NUTATIONS = 2  # of a path that are drawn


def pictures(data: xr.Dataset) -> list[Picture]:
    """All figures, in the notebook's order."""
    drawn = [draw_motion(data), draw_derivations(data), draw_residuals(data), draw_hope(data)]
    return [*drawn, draw_spheres(data), draw_film(data), draw_alpha(data), draw_modified_energy(data)]


def draw_motion(data: xr.Dataset) -> Picture:
    """Inclination by the notebook's solver, and its difference from the closed form."""
    figure, (motion, difference) = style.grid(2, 2, ("time (s)", ""), height=2.0)
    first = data.sel(scene="spheroid", variant=SOLVER)
    time = first[Column.PATH_TIME].values
    for solver, true, label, color, line in (
        (Column.SOLVER_THETA, Column.TRUE_THETA, r"$\theta$ (rad)", style.BLUE, "-"),
        (Column.SOLVER_RATE, Column.TRUE_RATE, r"$\dot\theta$ (rad/s)", style.VERMILLION, "--"),
    ):
        motion.plot(time, first[solver], line, color=color, label=label)
        difference.plot(time[1:], largest_so_far(first[solver] - first[true])[1:], line, color=color, label=label)
    motion.set(title="by the notebook's solver (LSODA)", ylabel="angle (rad), rate (rad/s)")
    difference.set(title="largest difference from the closed form so far", yscale="log")
    style.legend_below(figure, [motion])
    gap = float(np.abs(first[Column.SOLVER_THETA] - first[Column.TRUE_THETA]).max())
    style.headline(figure, f"The notebook's solver follows theta of the first scene, spheroid, to {style.number(gap)} "
                           f"rad in {time[-1]:g} s")  # fmt: skip
    return Picture(
        "motion",
        figure,
        "Inclination theta and its rate in the first scene. Reproduced, left: the notebook's plot, by an LSODA solver "
        f"on its six variables (angles and rates) at tolerance {SOLVER_TOLERANCE:g}, scene spheroid to t = "
        f"{time[-1]:g}. Right: theta differs from the closed form by at most {gap:.0e} rad.",
        "Left, theta and its rate against time, a nutation between 23 and 99 degrees; right, their differences from "
        "the closed form, growing with time.",
    )


def draw_derivations(data: xr.Dataset) -> Picture:
    """The two derivations against each other and against the closed form."""
    figure, axes = style.grid(2, 2, ("time (s)", "largest difference so far"), height=2.1, sharey=True)
    lines = (
        (Column.DERIVATIONS_GAP, style.BLUE, "-", "hard way against easy way (rad)"),
        (Column.HARD_GAP, style.VERMILLION, "--", "hard way against closed form (rad)"),
        (Column.EASY_GAP, style.GREEN, ":", "easy way against closed form (rad)"),
        (Column.ENERGY_GAP, style.BLACK, "-.", r"$E_1 + p_\psi^2/(2 I_3)$ against $E$ (relative)"),
    )
    for axis, (name, part) in zip(axes, PARTS.items(), strict=True):
        solver = data.sel(scene=name, variant=SOLVER)
        for column, color, line, label in lines:
            gap, over = largest_so_far(solver[column])[1:], 4.0 if line == ":" else 2.0  # the dotted one is on top
            gap[gap <= SMALLEST] = np.nan  # no difference yet
            axis.plot(solver[Column.BOTH_TIME][1:], gap, line, color=color, label=label, lw=0.5 * over, zorder=over)
        axis.set(yscale="log", title=f"scene {name} (notebook, {part})")
    style.legend_below(figure, axes)
    gap = style.number(float(data[Column.DERIVATIONS_GAP].max()))
    style.headline(figure, f"The notebook's two derivations, the hard way and the easy way, agree to {gap} rad")
    return Picture(
        "two-ways",
        figure,
        "The notebook's two derivations, both in angles, over its own horizons on both scenes. Reproduced: the "
        "hard way (three equations of second order) and the easy way "
        "(two of first order, one of second), both integrated at tolerance 1e-13, agree to "
        f"{float(data[Column.DERIVATIONS_GAP].max()):.0e} rad. Corrected: its two energies are not the same constant. "
        "The second scene's E1 leaves out the spin, E1 = E - p_psi^2/2 I3, and with it they agree to "
        f"{float(data[Column.ENERGY_GAP].max()):.0e}.",
        "Semi-logarithmic plots of differences between derivations: rounding that grows with time.",
    )


def draw_residuals(data: xr.Dataset) -> Picture:
    """Energy and momenta: the solver's as the notebook drew them, and those of every discrete method."""
    figure, axes = style.panels(3, 3, height=1.6, sharex="col")
    solver = data.sel(scene="spheroid", variant=SOLVER)
    for line, name in zip(axes, CONSTANTS, strict=True):
        values = solver[name] - (solver[name].mean() if name == "energy" else solver[name][0])
        power = math.floor(math.log10(float(np.abs(values).max()) or 1.0))
        line[0].plot(solver[Column.SAMPLE_TIME], values / 10.0**power, color=style.look(SOLVER).color, lw=1.2)
        line[0].axhline(0.0, color="#444444", lw=0.8, zorder=1)
        unit = f"10{str(power).translate(style.RAISED)} {UNITS[name]}"
        line[0].set_ylabel(f"{LABELS[name]} \N{MINUS SIGN} its {REFERENCES[name]}\n({unit})")
        drawn = data[[Column.SAMPLE_TIME, f"{name}_residual"]]  # of these alone: a dataset has dozens
        for axis, part in zip(line[1:], PARTS, strict=True):
            for method in data["variant"].values:
                _residual_line(axis, drawn.sel(scene=part, variant=method), name)
            axis.set(yscale="log")
    titles = ("lsoda on spheroid, as\nthe notebook drew it",
              *(f"{part}: largest\nrelative change so far" for part in PARTS))  # fmt: skip
    for column, title in zip(axes.T, titles, strict=True):
        column[0].set_title(title)
        column[-1].set_xlabel("time (s)")
    style.few_ticks(*axes[:, 1:].flat, most=4)
    style.legend_below(figure, axes)
    note: dict[str, Any] = {"fontsize": style.LEAST_TEXT, "color": "#444444", "ha": "right"}
    for axis in axes[:, 1:].flat:
        axis.set_ylim(bottom=1e-3 * SMALLEST)
    for axis, constant, part in ((axes[k, m], CONSTANTS[k], part) for k in (1, 2) for m, part in enumerate(PARTS, 1)):
        most = float(data[f"{constant}_largest"].sel(scene=part).drop_sel(variant=SOLVER).max())
        axis.annotate("drawn here: exactly 0", (0.98, SMALLEST), (0, -4), xycoords=axis.get_yaxis_transform(),
                      va="top", textcoords="offset points", **note)  # fmt: skip
        axis.text(
            0.98,
            0.62,
            f"all discrete methods:\nat most {style.number(most)}",
            transform=axis.transAxes,
            va="center",
            **note,
        )
    for axis, part in zip(axes[0, 1:], PARTS, strict=True):
        worse, count = words.worse_energies(data, part)
        axis.set_ylim(1e-18, 10.0)
        axis.text(0.98, 0.98, f"{worse} of {count} above lsoda", transform=axis.transAxes, va="top",
                  **(note | {"weight": "bold"}))  # fmt: skip
    largest = max(words.largest_momenta(data).values())
    style.headline(figure, words.residuals_message(data))
    return Picture(
        "residuals",
        figure,
        f"Energy and both momenta on spheroid and goldstein. Left: residuals of {SOLVER}, of the energy from its mean "
        f"and of the momenta from their start. Its tolerance of {SOLVER_TOLERANCE:g} was matched by choice, as the "
        "notebook states none. Corrected: the notebook takes the mean of its momenta over a table with a single entry, "
        "so that their residuals count from the start. Right, all relative to the start: the solver beside every "
        "discrete Lagrangian (in angles) and splitting (in angles or the axis chart) at "
        f"{STEPS_A_NUTATION:.0f} steps a nutation. The momenta of all discrete methods stay within {largest:.0e}.",
        "Left, residuals of the library solver; right, on logarithmic scales, momenta of the discrete methods at "
        "rounding and their bounded energy errors, below or above the solver's.",
    )


def _residual_line(axis: Any, run: xr.Dataset, constant: str) -> None:
    method, values = str(run["variant"].item()), largest_so_far(run[f"{constant}_residual"])
    good = np.isfinite(values)
    time, values = run[Column.SAMPLE_TIME].values[good][1:], values[good][1:]  # all are zero at the start
    grey = {"color": "#BBBBBB", "lw": 0.7, "zorder": 2, "label": "other discrete methods"}
    bold = style.line(method, 0.7) | {"markevery": 0.2, "zorder": 3, "label": method}
    wide = bold | {"marker": "", "lw": 2.4, "ls": "-", "zorder": 4}
    axis.plot(time, values, **(wide if method == SOLVER else bold if method in NAMED else grey))


def draw_hope(data: xr.Dataset) -> Picture:
    """The largest energy error so far of the solver and of the discrete methods, far beyond the notebook's horizon."""
    figure, axes = style.grid(2, 2, ("time (s)", "largest relative\nenergy error so far"), height=2.7, sharey=True)
    ring = {"color": style.BLACK, "mfc": "none", "ms": 8.0, "mew": 1.3, "lw": 0.0, "zorder": 5}
    for axis, (name, part) in zip(axes, PARTS.items(), strict=True):
        for method in (row for row in NAMED if row in data["variant"].values):
            run = data.sel(scene=name, variant=method)
            line = style.line(method, 0.8) | {"markevery": 0.12, "label": method}
            wide = line | {"marker": "", "lw": 2.4, "ls": "-"}
            axis.plot(run[Column.LONG_TIME], run[Column.LONG_ENERGY], **(wide if method == SOLVER else line))
            since = better_from(data, name, method) if method != SOLVER else math.inf
            if 0.0 < since < math.inf:
                axis.plot(since, energy_until(data, name, method, since), "o", **ring)
        axis.set(xscale="log", yscale="log", title=f"scene {name} (notebook, {part})")
        end = notebook_end(data, name)
        axis.axvline(end, color=style.GREY, lw=1.4, zorder=1)
        axis.annotate(f"end of the\nnotebook, {end:g} s", (end, 0.02), (4, 0), xycoords=axis.get_xaxis_transform(),
                      textcoords="offset points", fontsize=7.5, color="#444444", va="bottom")  # fmt: skip
    axes[0].plot([], [], "o", label="from here on better than lsoda", **ring)
    style.few_ticks(*axes, most=5)
    style.legend_below(figure, axes)
    figure.legends[0].set_title(f"lsoda at tolerance {style.number(SOLVER_TOLERANCE)}, all others at "
                                f"{STEPS_A_NUTATION:.0f} steps a nutation")  # fmt: skip
    style.headline(figure, words.hope_message(data))
    return Picture(
        "hope",
        figure,
        f"Largest energy error so far of {SOLVER} at tolerance {SOLVER_TOLERANCE:g} and of methods of order two at "
        f"{STEPS_A_NUTATION:.0f} steps a nutation, from the same start, on both scenes and far beyond the notebook's "
        "end. Open markers are variants in angles, full ones in the axis chart; a ring is the time from which a method "
        f"stays better than the solver. {words.hope_message(data)}.",
        "Two log-log plots: the solver's energy error rises with time and crosses the flat lines of the discrete "
        "methods, one after the other.",
    )


def draw_spheres(data: xr.Dataset) -> Picture:
    """The path that the notebook drew and the path of the axis, seen from above, a quarter turn apart."""
    figure, axes = style.panels(1, 2, height=3.3, sharex=True, sharey=True)
    turn = np.linspace(0.0, 2.0 * math.pi, 181)
    for axis, name in zip(axes.flat, PARTS, strict=True):
        drawn, true = words.paths(data, name)
        early = data[Column.PATH_TIME].sel(scene=name, variant=SOLVER).values <= NUTATIONS * scene(
            name).nutation_period  # fmt: skip
        axis.plot(np.cos(turn), np.sin(turn), color="#BBBBBB", lw=0.8, zorder=0)
        for path, color, label in ((drawn, style.look(SOLVER).color, "as the notebook drew it"),
                                   (true, style.BLACK, "where the axis is")):  # fmt: skip
            axis.plot(*path[early, :2].T, color=color, lw=1.8, label=f"{label}, from its dot on")
            axis.plot(*path[0, :2], "o", color=color, ms=7.0, mec="white", zorder=4)
            axis.plot([0.0, path[0, 0]], [0.0, path[0, 1]], color=color, lw=0.9, ls=(0, (4, 2)), zorder=1)
        begins, turned = math.atan2(true[0, 1], true[0, 0]), words.turned(data, name)
        arc = begins + np.linspace(0.0, math.radians(turned), 40)
        axis.plot(0.27 * np.cos(arc), 0.27 * np.sin(arc), color=style.BLUE, lw=1.6, zorder=3)
        middle = 0.14 * np.array([math.cos(arc[20]), math.sin(arc[20])])
        axis.text(*middle, f"{turned:.0f}°", color=style.BLUE, weight="bold", ha="center", va="center", fontsize=9.0)
        axis.set(aspect="equal", title=f"{name}, seen from above", xlabel="x", xticks=(-1, 0, 1), yticks=(-1, 0, 1))
    axes[0, 0].set_ylabel("y")
    axes[0, 0].plot([], [], color="#BBBBBB", lw=0.8, label="equator of the unit sphere")
    style.legend_below(figure, axes)
    turns = sorted({f"{words.turned(data, name):.0f}" for name in PARTS})
    style.headline(figure, f"The notebook's curve is the path of the axis turned by {' and '.join(turns)}° about the "
                           "vertical")  # fmt: skip
    return Picture(
        "spheres",
        figure,
        f"Path of the axis on the unit sphere over the first {NUTATIONS} nutations, seen along the vertical z, "
        f"spheroid and goldstein, by the solver in angles at tolerance {SOLVER_TOLERANCE:g}. Reproduced, orange: the "
        "notebook's "
        "curve, which takes phi for the azimuth. Corrected, black: its own rotations (phi about z, theta about the "
        "line of nodes) carry the axis to (sin theta sin phi, -sin theta cos phi, cos theta), a quarter turn away. "
        "Its animated triad and its curve therefore do not meet. Dashed: from the vertical to the start of each.",
        "Two views of the sphere from above, each with two paths of the same shape; an arc of 90 degrees joins the "
        "directions of their starts.",
    )


def draw_film(data: xr.Dataset) -> Picture:
    """The turning triad, and the true one."""
    frames = data.sel(scene="spheroid", variant=FILMED).dropna("frame", subset=[Column.FRAME_TIME])
    attitudes = [frames[name].values for name in (Column.FRAME_ATTITUDE, Column.TRUE_ATTITUDE)]
    last, true = (solid.columns_of(quaternions[-1])[2] for quaternions in attitudes)
    return Picture(
        "triad",
        solid.Film(*attitudes, "midpoint rule, 30 steps a nutation; grey: truth", pause=50),
        f"The body-fixed triad over two nutations of spheroid by {FILMED}, blue the axis, 30 steps a nutation; grey "
        "is the "
        "truth. Reproduced: the notebook's animation. Added: the truth; at the end the axes are "
        f"{float(axis_distance(last, true)):.2f} rad apart.",
        "Animation of three coloured rods turning inside a sphere, a grey ghost just ahead of them.",
    )


def draw_alpha(data: xr.Dataset) -> Picture:
    """What the printed alpha means: the cubic and the motion, against those of a release at rest."""
    second = data.sel(scene="goldstein", variant=SOLVER)
    rest, rate = float(second[Column.ALPHA_AT_REST]), float(second[Column.ALPHA_RATE])
    figure, (cubic, motion) = style.grid(2, 2, height=2.6)
    u, start = second[Column.COSINE], math.cos(math.radians(43.0))
    cubic.plot(u, second[Column.CUBIC_AT_REST], color=style.BLUE, label=rf"$\alpha$ = {rest:.6f} s$^{{-2}}$, at rest")
    cubic.plot(
        u,
        second[Column.CUBIC_PRINTED],
        "--",
        color=style.VERMILLION,
        label=rf"$\alpha$ = {ALPHA:g} s$^{{-2}}$, as printed",
    )
    cubic.axvline(start, color=style.GREY, lw=0.9)
    cubic.axhline(0.0, color=style.GREY, lw=0.9)
    cubic.annotate("cos 43° ", (start, -0.18), fontsize=style.LEAST_TEXT, ha="right")
    there = float(np.interp(start, u.values, second[Column.CUBIC_PRINTED].values))
    cubic.plot([start], [there], "o", color=style.VERMILLION)
    cubic.annotate("not zero: it\nmoves at\nthe start", (start, there), (6, 4), textcoords="offset points",
                   fontsize=style.LEAST_TEXT, color=style.ink(style.VERMILLION))  # fmt: skip
    cubic.set(xlabel=r"$u = \cos\theta$", ylabel=r"$\dot u^2$ (1/s$^2$)", xlim=(0.2, 0.95), ylim=(-0.2, 0.35))
    cubic.set_title("the nutation cubic")
    for column, color, line, label in (
        (Column.THETA_AT_REST, style.BLUE, "-", "released at rest"),
        (Column.THETA_FALLING, style.VERMILLION, "--", rf"$\alpha$ = {ALPHA:g}, $\theta$ falling at first"),
        (Column.THETA_RISING, style.ORANGE, ":", rf"$\alpha$ = {ALPHA:g}, $\theta$ rising at first"),
    ):
        motion.plot(second[Column.ALPHA_TIME], np.degrees(second[column]), line, color=color, label=label)
    motion.set(xlabel="time (s)", ylabel=r"$\theta$ (degrees)", title="the motion from each start")
    for axis in (cubic, motion):  # the panels share colours, not lines: a legend each
        axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), frameon=False)
    style.headline(figure, f"The alpha that the notebook prints contradicts its release at rest: theta would start to "
                           f"change at {math.degrees(rate):.0f} degrees/s")  # fmt: skip
    return Picture(
        "alpha",
        figure,
        f"The second scene, goldstein, prints alpha = {ALPHA:g} and a release at rest from 43 degrees. Reproduced: its "
        f"solver never uses alpha and starts at rest. Corrected: at rest alpha is {rest:.6f} 1/s^2, and alpha = "
        f"{ALPHA:g} "
        f"means |theta'(0)| = {rate:.6f} rad/s: the dashed cubic u'^2 is not zero at the start. Both are scenes here. "
        "All curves are the closed form, which has no step and no chart.",
        "Left, two cubics, one zero at cos 43 degrees; right, three different nutations.",
    )


def draw_modified_energy(data: xr.Dataset) -> Picture:
    """Energy and modified energy of two discrete methods, over time and against the step."""
    figure, axes = style.panels(1, 3, height=2.2)
    midpoint = data.sel(scene="spheroid", variant=MIDPOINT)
    kinds = ((Column.ENERGY_CHANGE, "energy", "-"), (Column.MODIFIED_CHANGE, "modified energy", "--"))
    for (column, kind, _), color in zip(kinds, (style.BLUE, style.BLACK), strict=True):
        values = midpoint[f"{column}_history"]
        axes[0, 0].plot(midpoint[Column.MODIFIED_TIME], values, color=color, label=f"{kind}, midpoint, over time")
    axes[0, 0].set(title="spheroid, 40 steps\na nutation", xlabel="time (s)", ylabel="relative change")
    for axis, name in zip(axes[0, 1:], PARTS, strict=True):
        for method in MODIFIED:
            run, look = data.sel(scene=name, variant=method), style.look(method)
            h = run[Column.MODIFIED_STEP]
            for column, kind, line in kinds:
                face = look.color if line == "-" else "white"
                axis.plot(
                    h,
                    run[column],
                    look.marker + line,
                    color=look.color,
                    mfc=face,
                    ms=0.8 * look.size,
                    label=f"{kind}, {method}",
                )
        for power, column in ((2, Column.ENERGY_CHANGE), (4, Column.MODIFIED_CHANGE)):
            span = float(h.min()), float(h.max())
            style.slope_guide(axis, power, span, 0.2 * float(run[column].min()), f"$h^{power}$")
        axis.set(
            xscale="log", yscale="log", title=f"scene {name}", xlabel="step size (s)", ylabel="largest relative change"
        )
        style.few_ticks(axis, most=4)
    style.legend_below(figure, axes)
    style.headline(figure, words.modified_message(data))
    return Picture(
        "modified-energy",
        figure,
        f"Why the energy is bounded, over the notebook's horizons on {' and '.join(PARTS)}, both variants in angles: "
        "the map conserves a modified Hamiltonian, from which the energy H differs by O(h^2). "
        f"{words.modified_sentence(data)}",
        "Left, the energy oscillates and the modified energy hardly; right, log-log plots of slopes 2 and 4.",
    )
