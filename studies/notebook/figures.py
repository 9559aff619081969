"""Figures of the notebook study: what the notebook drew, beside the truth, in its order."""

import math
from typing import Any

import numpy as np
import xarray as xr

from symtop.measure.conservation import CONSTANTS
from symtop.model.charts import axis_distance, axis_from_angles
from symtop.model.scenes import scene
from symtop.report import style
from symtop.report.figures import SMALLEST, largest_so_far
from symtop.runner.study import Picture

from . import solid, words
from .long_energy import better_from
from .tables import ALPHA, FILMED, MIDPOINT, MODIFIED, SOLVER, SOLVER_TOLERANCE, STEPS_A_NUTATION, Column
from .words import PARTS

NAMED = (SOLVER, *words.DRAWN)  # the others are thin grey lines
LABELS = {"energy": "energy (J)", "p_phi": r"$p_\varphi$ (J s)", "p_psi": r"$p_\psi$ (J s)"}


def pictures(data: xr.Dataset) -> list[Picture]:
    """All figures, in the notebook's order."""
    drawn = [draw_motion(data), draw_derivations(data), draw_residuals(data), draw_hope(data)]
    return [*drawn, draw_spheres(data), draw_film(data), draw_alpha(data), draw_modified_energy(data)]


def draw_motion(data: xr.Dataset) -> Picture:
    """Inclination by the notebook's solver, and its difference from the closed form."""
    figure, (motion, difference) = style.grid(2, 2, ("time (s)", ""), height=2.0)
    first = data.sel(scene="spheroid", integrator=SOLVER)
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
        solver = data.sel(scene=name, integrator=SOLVER)
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
    figure, axes = style.panels(3, 3, height=1.55, sharex="col")
    solver = data.sel(scene="spheroid", integrator=SOLVER)
    for line, name in zip(axes, CONSTANTS, strict=True):
        values = solver[name] - (solver[name].mean() if name == "energy" else solver[name][0])
        line[0].plot(solver[Column.SAMPLE_TIME], values, color=style.look(SOLVER).color, lw=1.0)
        line[0].set_ylabel(f"change of {LABELS[name]}")
        line[0].ticklabel_format(axis="y", scilimits=(-2, 2))
        for axis, part in zip(line[1:], PARTS, strict=True):
            for method in data["integrator"].values:
                _residual_line(axis, data.sel(scene=part, integrator=method), name)
            axis.set(yscale="log")
    titles = ("the solver's, as the\nnotebook drew it", *(f"{part}:\nlargest relative so far" for part in PARTS))
    for column, title in zip(axes.T, titles, strict=True):
        column[0].set_title(title)
        column[-1].set_xlabel("time (s)")
    style.few_ticks(*axes[:, 1:].flat, most=4)
    style.legend_below(figure, axes)
    for axis in axes[1:, 1:].flat:
        axis.set_ylim(bottom=1e-4 * SMALLEST)
        axis.annotate("exact zeros", (0.98, SMALLEST), (0, -3), xycoords=axis.get_yaxis_transform(), ha="right",
                      va="top", textcoords="offset points", fontsize=style.LEAST_TEXT, color="#444444")  # fmt: skip
    largest = max(words.largest_momenta(data).values())
    lost = float(data[list(words.MOMENTA)].sel(integrator=SOLVER).to_dataarray().max())
    style.headline(figure, f"Discrete methods keep both momenta to {style.number(largest)}; the notebook's solver, "
                           f"{SOLVER}, changes them by {style.number(lost)}")  # fmt: skip
    return Picture(
        "residuals",
        figure,
        f"Energy and both momenta on spheroid and goldstein. Left: the solver's residuals. {words.MATCHED} Corrected: "
        "the notebook takes the "
        "mean of its momenta over a table with a single entry, so that its residuals of momenta count from the start. "
        f"Right: {SOLVER} beside every discrete Lagrangian (in angles) and splitting (in angles or the axis chart) at "
        f"{STEPS_A_NUTATION:.0f} steps a nutation, over the notebook's horizons, {len(NAMED) - 1} of "
        f"them named; the momenta of all discrete methods stay within {largest:.0e}.",
        "Left, residuals of the library solver; right, on logarithmic scales, momenta of the discrete methods at "
        "rounding and their bounded energy errors, below or above the solver's.",
    )


def _residual_line(axis: Any, run: xr.Dataset, constant: str) -> None:
    method, values = str(run["integrator"].item()), largest_so_far(run[f"{constant}_residual"])
    good = np.isfinite(values)
    time, values = run[Column.SAMPLE_TIME].values[good][1:], values[good][1:]  # all are zero at the start
    grey = {"color": "#BBBBBB", "lw": 0.7, "zorder": 2, "label": "other discrete methods"}
    bold = style.line(method, 0.7) | {"markevery": 0.12, "zorder": 3, "label": method}
    axis.plot(time, values, **(bold if method in NAMED else grey))


def draw_hope(data: xr.Dataset) -> Picture:
    """The largest energy error so far of the solver and of the discrete methods, far beyond the notebook's horizon."""
    figure, axes = style.grid(2, 2, ("time (s)", "largest relative\nenergy error so far"), height=2.5, sharey=True)
    for axis, (name, part) in zip(axes, PARTS.items(), strict=True):
        for method in (row for row in NAMED if row in data["integrator"].values):
            run, look = data.sel(scene=name, integrator=method), style.look(method)
            line = style.line(method, 0.8) | {"markevery": 0.1, "label": method}
            axis.plot(run[Column.LONG_TIME], run[Column.LONG_ENERGY], **line)
            since = better_from(data, name, method) if method != SOLVER else math.inf
            if 0.0 < since < math.inf:
                axis.axvline(since, color=look.color, lw=0.8, ls=":", zorder=1)
        axis.set(xscale="log", yscale="log", title=f"scene {name} (notebook, {part})")
        end = float(data[Column.SAMPLE_TIME].sel(scene=name).max())
        axis.axvline(end, color=style.GREY, lw=1.0, zorder=1, label="end of the notebook")
    axes[0].plot([], [], ":", color=style.GREY, label="from here on better than lsoda (in its colour)")
    style.few_ticks(*axes, most=5)
    style.legend_below(figure, axes)
    style.headline(figure, words.hope_message(data))
    return Picture(
        "hope",
        figure,
        f"{' '.join(words.hopes(data))} Held fixed: start, {STEPS_A_NUTATION:.0f} steps a nutation of every discrete "
        "row (open markers: angles, full: axis).",
        "Two log-log plots: the solver's energy error rises with time and crosses the level lines of the discrete "
        "methods, one after the other.",
    )


def draw_spheres(data: xr.Dataset) -> Picture:
    """The path that the notebook drew and the path of the axis, a quarter turn apart."""
    figure, axes = style.panels(1, 2, height=3.2, subplot_kw={"projection": "3d"})
    for axis, name in zip(axes.flat, PARTS, strict=True):
        run = data.sel(scene=name, integrator=SOLVER)
        drawn = axis_from_angles(run[Column.SOLVER_THETA].values, run[Column.SOLVER_PHI].values + 0.5 * math.pi)
        true = axis_from_angles(run[Column.TRUE_THETA].values, run[Column.TRUE_PHI].values)
        early = run[Column.PATH_TIME].values <= 2.0 * scene(name).nutation_period
        solid.sphere(axis, name)
        lines = ((drawn, style.VERMILLION, "as the notebook drew it"), (true, style.BLACK, "where the axis is"))
        for path, color, label in lines:
            axis.plot(*path.T, color=color, lw=0.6, alpha=0.35)
            axis.plot(*path[early].T, color=color, lw=1.6, label=f"{label}, from its dot on")
            axis.plot(*path[:1].T, "o", color=color, ms=4.5)
        for letter, place in zip("xyz", 1.15 * np.eye(3), strict=True):
            axis.text(*place, letter, ha="center", va="center")
    style.legend_below(figure, axes)
    style.headline(figure, "The curve that the notebook drew is the path of the axis, turned by 90° about the "
                           "vertical z")  # fmt: skip
    return Picture(
        "spheres",
        figure,
        "Path of the axis on the unit sphere with its coordinate discs, spheroid and goldstein, by the solver in "
        f"angles at tolerance {SOLVER_TOLERANCE:g}. Reproduced, red: the notebook's "
        "curve, which takes phi for the azimuth. Corrected, black: its own rotations (phi about z, theta about the "
        "line of nodes) carry the axis to (sin theta sin phi, -sin theta cos phi, cos theta), a quarter turn away, so "
        "that its animated triad and its curve do not meet. Bold: the first two nutations, from the dot on.",
        "Two unit spheres, each with two looping paths of the same shape; one is the other turned by 90 degrees about "
        "z.",
    )


def draw_film(data: xr.Dataset) -> Picture:
    """The turning triad, and the true one."""
    frames = data.sel(scene="spheroid", integrator=FILMED).dropna("frame", subset=[Column.FRAME_TIME])
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
    second = data.sel(scene="goldstein", integrator=SOLVER)
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
    midpoint = data.sel(scene="spheroid", integrator=MIDPOINT)
    kinds = ((Column.ENERGY_CHANGE, "energy", "-"), (Column.MODIFIED_CHANGE, "modified energy", "--"))
    for (column, kind, _), color in zip(kinds, (style.BLUE, style.BLACK), strict=True):
        values = midpoint[f"{column}_history"]
        axes[0, 0].plot(midpoint[Column.MODIFIED_TIME], values, color=color, label=f"{kind}, midpoint, over time")
    axes[0, 0].set(title="spheroid, 40 steps\na nutation", xlabel="time (s)", ylabel="relative change")
    for axis, name in zip(axes[0, 1:], PARTS, strict=True):
        for method in MODIFIED:
            run, look = data.sel(scene=name, integrator=method), style.look(method)
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
        f"Why the energy is bounded, over the notebook's horizons on {' and '.join(PARTS)}, both rows in angles: the "
        "map conserves a modified Hamiltonian, from which the energy H differs by "
        "O(h^2). H and the modified energy to its first term change with these powers of the step: "
        f"{words.modified_orders(data)}.",
        "Left, the energy oscillates and the modified energy hardly; right, log-log plots of slopes 2 and 4.",
    )
