"""Figures of the oscillators study."""

from typing import Any

import numpy as np
import xarray as xr

from symtop.report import style
from symtop.runner.study import Picture

from . import words
from .oscillator import Oscillator
from .tables import FRICTION, HORIZON, LONG, ONE_SIDED, RK45, RULES, TOP_TOLERANCE, Column, dampings, order, tops
from .words import cell

SYMBOLS = {"midpoint": "o", "trapezoidal": "s", ONE_SIDED: "v"}
NEAREST = 1e-17  # where an error of exactly zero is drawn
TIME_UNIT = r"$\sqrt{m/k}$"


def pictures(data: xr.Dataset) -> list[Picture]:
    """The notebook's experiment, orders, decay, and the damped top."""
    return [draw_notebook(data), draw_orders(data), draw_decay(data), draw_tops(data), draw_top_orders(data)]


def _title(damping: float) -> str:
    return f"b = {damping:g}, {Oscillator(damping=damping).regime}"


def _largest_so_far(values: Any) -> Any:
    return np.maximum.accumulate(np.maximum(np.abs(values), NEAREST))


def draw_notebook(data: xr.Dataset) -> Picture:
    """The notebook's experiment for every damping."""
    figure, axes = style.panels(2, 3, height=2.5, sharex=True, sharey=True)
    for axis, (name, b) in zip(axes.flat, dampings(data).items(), strict=False):
        run = cell(data, name, "midpoint").dropna("seed_step")
        time = run[Column.NOTEBOOK_TIME].values
        axis.plot(time, run[Column.ANALYTIC], color=style.BLACK, lw=4.0, alpha=0.35, label="analytic")
        axis.plot(time, run[Column.NOTEBOOK_UPDATE], color=style.BLUE, label="the notebook's update = midpoint rule")
        guess = run[Column.NOTEBOOK_GUESS]
        axis.plot(time, guess, "--", color=style.VERMILLION, lw=1.0, label="the notebook's guess at the forces")
        axis.set_title(_title(b))
    axes[0, 0].set_ylim(-1.3, 8.5)
    for axis in axes[-1]:
        axis.set_xlabel(f"time ({TIME_UNIT})")
    for axis in axes[:, 0]:
        axis.set_ylabel("x")
    style.legend_below(figure, axes)
    return Picture(
        "seed",
        figure,
        f"The notebook's damped oscillator (m = k = 1, h = 0.1, T = {HORIZON:g}). Reproduced: its update, which is the "
        "midpoint rule with forced discrete Euler-Lagrange equations, the same positions to "
        f"{float(data[Column.UPDATE_GAP].max()):.0e}. Corrected: its guess put dF/dx' = -b where the discrete force "
        "belongs, with the sign of a potential's slope; that is a constant push, which damps nothing and shifts the "
        "centre of the oscillation to x = b.",
        "Six panels of position against time for growing damping; the update lies on the analytic curve, the guess "
        "oscillates undamped about x = b.",
    )


def draw_orders(data: xr.Dataset) -> Picture:
    """Errors of the position and of the slow exponent against the step."""
    figure, axes = style.panels(2, 6, width=13.0, height=2.7, sharex=True, sharey="row")
    for column, (name, b) in enumerate(dampings(data).items()):
        for line, error in enumerate((Column.POSITION_ERROR, Column.EXPONENT_ERROR)):
            axis = axes[line, column]
            for method, marker in SYMBOLS.items():
                run = cell(data, name, method)
                above_rounding = run[error].values > 1e-13
                h, errors = run[Column.STEP].values[above_rounding], run[error].values[above_rounding]
                color = style.PURPLE if method == ONE_SIDED else style.look(method).color
                axis.plot(
                    h, errors, marker + "-", color=color, ms=4,
                    mfc="none" if method == "trapezoidal" else color, label=method,
                )  # fmt: skip
            style.slope_guide(axis, 2.0, (1e-2, 1.0), 1e-9, "$h^2$")
            if line == 0:
                style.slope_guide(axis, 1.0, (1e-3, 1e-1), 2e-2, "$h$")
            axis.set(xscale="log", yscale="log")
        axes[0, column].set_title(f"b = {b:g}\n{Oscillator(damping=b).regime}")
        axes[1, column].set_xlabel(f"step size ({TIME_UNIT})")
    axes[0, 0].set_ylabel("largest error of x")
    axes[1, 0].set_ylabel("relative error of\nthe slow exponent")
    style.legend_below(figure, axes)
    return Picture(
        "orders",
        figure,
        f"The oscillator released from rest, T = {HORIZON:g}. Above: both rules have order 2 in every regime; the "
        "whole force at one end of the step costs an order. Below: the slow exponent lambda of exp(lambda t). At "
        "critical damping (b = 2) it is the square root of a perturbation of the discriminant, so that the errors "
        f"there have half the usual order ({words.critical_orders(data)}). The midpoint rule leaves critical damping "
        "in place and keeps its order.",
        "Log-log plots of errors against step for six dampings: slope 2 for both rules, slope 1 for the one-sided "
        "force.",
    )


def draw_decay(data: xr.Dataset) -> Picture:
    """Errors of the energy over time at equal cost."""
    shown = words.with_rk45(data)
    figure, axes = style.panels(1, len(shown), sharey=True)
    for axis, (name, b) in zip(axes.flat, shown.items(), strict=True):
        for method in (*RULES, RK45):
            run, look = cell(data, name, method), style.look(method)
            error = _largest_so_far(run[Column.ENERGY_ERROR].values)
            axis.plot(
                run[Column.TIME].values[1:], error[1:], look.marker + "-", color=look.color, ms=0.7 * look.size,
                markevery=0.1, label=method,
            )  # fmt: skip
        axis.set(xscale="log", yscale="log", xlabel=f"time ({TIME_UNIT})", title=_title(b))
    axes[0, 0].set_ylabel("largest |E/E(exact) - 1| so far")
    style.legend_below(figure, axes)
    return Picture(
        "decay",
        figure,
        f"Energy against its exact decay over T = {LONG:g}, at equal cost: {words.cost(data)}. {words.energy(data)}",
        "Log-log plots of the relative energy error over time for two rules and RK45.",
    )  # fmt: skip


def draw_tops(data: xr.Dataset) -> Picture:
    """Inclination, momenta and momentum balance of the damped tops."""
    names = tops(data)
    figure, axes = style.panels(3, len(names), width=4.8 * max(2, len(names)), height=2.3, sharex="col")
    for column, name in enumerate(names):
        first = cell(data, name, "midpoint")
        time = first[Column.TOP_TIME].values
        axes[0, column].plot(time, np.degrees(first[Column.THETA]), color=style.BLUE, label="theta, midpoint")
        axes[0, column].plot(time, np.degrees(first[Column.TRUE_THETA]), ":", color=style.BLACK, label="theta, truth")
        axes[1, column].plot(time, first[Column.P_PHI], color=style.GREEN, label=r"$p_\varphi$")
        axes[1, column].plot(time, first[Column.P_PSI], "--", color=style.PURPLE, label=r"$p_\psi$")
        for method in (*RULES, RK45):
            run, look = cell(data, name, method), style.look(method)
            for variable, line in ((Column.BALANCE_PHI, "-"), (Column.BALANCE_PSI, "--")):
                defect = _largest_so_far(run[variable].values)
                label = f"balance, {method}" if line == "-" else None
                axes[2, column].plot(time[1:], defect[1:], line, color=look.color, label=label)
        axes[2, column].set(yscale="log", xlabel="time (s)")
        axes[0, column].set_title(f"{name}, damped")
    for axis, label in zip(
        axes[:, 0], ("theta (degrees)", "momenta (J s)", "defect of the balance,\nrelative"), strict=True
    ):
        axis.set_ylabel(label)
    style.legend_below(figure, axes)
    return Picture(
        "damped-top",
        figure,
        f"A top in gimbals with viscous bearings (torques -{FRICTION.precession:g} phi' and -{FRICTION.spin:g} psi'): "
        "the momenta decay. Their balance p(t) - p(0) + c (angle(t) - angle(0)) is zero for the true motion; its "
        f"defect is at most {words.largest_balance(data, RULES):.1e} with the discrete Lagrangians, which is rounding, "
        f"and {words.largest_balance(data, (RK45,)):.1e} with RK45 at tolerance {TOP_TOLERANCE:g}. Below, solid: phi, "
        "dashed: psi.",
        "Inclination, momenta and the residual of the momentum balance against time for the damped tops.",
    )  # fmt: skip


def draw_top_orders(data: xr.Dataset) -> Picture:
    """Errors of theta of the damped tops against the step."""
    names = tops(data)
    figure, axes = style.panels(1, max(2, len(names)), height=3.2, sharey=True)
    for axis in axes.flat[len(names) :]:
        axis.set_visible(False)
    for axis, name in zip(axes.flat, names, strict=False):
        for method in RULES:
            run, look = cell(data, name, method), style.look(method)
            h, error = run[Column.TOP_STEP].values, run[Column.THETA_ERROR].values
            axis.plot(h, error, look.marker + "-", color=look.color, label=method)
        axis.axhline(
            float(cell(data, name, "midpoint")[Column.TOP_BOUND]), color=style.GREY, lw=3, alpha=0.5,
            label="error of the reference",
        )  # fmt: skip
        style.slope_guide(axis, 2.0, (float(np.nanmin(h)), float(np.nanmax(h))), 0.3 * float(np.nanmin(error)), "$h^2$")
        axis.set(xscale="log", yscale="log", title=f"{name}, damped", xlabel="step size (s)")
        axis.xaxis.set_minor_formatter("")
    axes[0, 0].set_ylabel("largest error of theta (rad)")
    style.legend_below(figure, axes)
    orders = "; ".join(
        f"{method} on {name} {order(data, name, method, Column.THETA_ERROR, Column.TOP_STEP)}"
        for name in names
        for method in RULES
    )
    return Picture(
        "damped-top-orders",
        figure,
        f"Order of the forced methods on the damped top: {orders}. Reference: the six Euler-Lagrange equations with "
        "friction at tolerance 1e-13; the grey line is the largest difference of any angle from the form of four "
        "equations.",
        "Log-log plots of the error of theta against the step, slope 2.",
    )
