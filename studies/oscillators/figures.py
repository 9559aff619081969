"""Figures of the oscillators study."""

import numpy as np
import xarray as xr

from symtop.report import style
from symtop.report.figures import largest_so_far
from symtop.runner.study import Picture

from . import words
from .oscillator import ONE_SIDED
from .tables import AGAINST_RK45, FRICTION, HORIZON, LONG, OSCILLATORS, RK45, RULES, TOP_TOLERANCE, Column, order, tops

SYMBOLS = {"midpoint": "o", "trapezoidal": "s", ONE_SIDED: "v"}
PLAIN = {ONE_SIDED: "force at one end"}
CRITICAL, BESIDE = "damping-2", "damping-3"
ORDERS = (  # panels: an oscillator, what is measured of it, and in words
    (CRITICAL, Column.POSITION_ERROR, "position x: largest error"),
    (BESIDE, Column.EXPONENT_ERROR, "rate of decay: relative error"),
    (CRITICAL, Column.EXPONENT_ERROR, "rate of decay: relative error"),
)
TIME = r"time ($\sqrt{m/k}$)"


def pictures(data: xr.Dataset) -> list[Picture]:
    """The notebook's experiment, orders, decay, and the damped top."""
    return [draw_notebook(data), draw_orders(data), draw_decay(data), draw_tops(data), draw_top_orders(data)]


def draw_notebook(data: xr.Dataset) -> Picture:
    """The notebook's experiment for every damping."""
    figure, axes = style.grid(len(OSCILLATORS), 3, (TIME, "x"), height=1.6, sharex=True, sharey=True)
    lines = (
        (Column.ANALYTIC, "-", {"color": style.BLACK, "lw": 3.0, "alpha": 0.35, "label": "analytic"}),
        (Column.UPDATE, "-", {"color": style.BLUE, "label": "the notebook's update = midpoint rule"}),
        (Column.GUESS, "--", {"color": style.VERMILLION, "lw": 1.0, "label": "the notebook's guess at the forces"}),
    )
    for axis, (name, oscillator) in zip(axes, OSCILLATORS.items(), strict=True):
        run = data.sel(scene=name, variant="midpoint")
        for column, line, options in lines:
            axis.plot(run[Column.NOTEBOOK_TIME], run[column], line, **options)
        axis.set(title=words.title(oscillator), ylim=(-1.3, 8.5))
    style.legend_below(figure, axes)
    gap = style.number(float(data[Column.UPDATE_GAP].max()))
    style.headline(figure, f"The notebook's update is the midpoint rule, to {gap}; its guess at the forces damps "
                           "nothing")  # fmt: skip
    return Picture(
        "seed",
        figure,
        f"The notebook's damped oscillator (m = k = 1, step 0.1, T = {HORIZON:g}; one coordinate x, no chart). "
        "Reproduced: its update, which is the "
        "midpoint rule with forced discrete Euler-Lagrange equations, the same positions to "
        f"{float(data[Column.UPDATE_GAP].max()):.0e}. Corrected: its guess put dF/dx' = -b where the discrete force "
        "belongs, with the sign of a potential's slope; that is a constant push, which damps nothing and shifts the "
        "centre of the oscillation to x = b.",
        "Six panels of position against time for growing damping; the update lies on the analytic curve, the guess "
        "oscillates undamped about x = b.",
    )


def draw_orders(data: xr.Dataset) -> Picture:
    """Errors of the position and of the rate of decay against the step, at critical damping and beside it."""
    figure, axes = style.panels(1, len(ORDERS), height=2.9, sharex=True, sharey=True)
    for axis, (name, error, what) in zip(axes[0], ORDERS, strict=True):
        for line, (method, marker) in enumerate(SYMBOLS.items()):
            run = data.sel(scene=name, variant=method)
            color = style.PURPLE if method == ONE_SIDED else style.look(method).color
            marks = {"mfc": "none", "ms": 3.4} if method == "trapezoidal" else {"mfc": color, "ms": 4.6}
            errors = run[error].where(run[error] > 1e-13)  # above rounding
            axis.plot(run[Column.STEP], errors, marker + "-", color=color, lw=1.1, **marks)
            slope = order(data, name, method, error).slope
            axis.text(0.98, 0.23 - 0.085 * line, f"{PLAIN.get(method, method)}: order {slope:.1f}", ha="right",
                      transform=axis.transAxes, color=style.ink(color), fontsize=7.5, weight="bold")  # fmt: skip
        axis.set(xscale="log", yscale="log", xlabel=r"step ($\sqrt{m/k}$)")
        told = (name, error) == ORDERS[-1][:2]  # the panel of the title
        axis.set_title(f"{what}\n{words.title(OSCILLATORS[name])}", weight="bold" if told else "normal")
    axes[0, 0].set_ylabel("error")
    style.few_ticks(*axes.flat, most=6)
    style.headline(figure, words.orders_message(data))
    least, most = (float(value(data[Column.STEP])) for value in (np.nanmin, np.nanmax))
    halved = (f"{m} {order(data, CRITICAL, m, Column.EXPONENT_ERROR).slope:.2f}" for m in ("trapezoidal", ONE_SIDED))
    return Picture(
        "orders",
        figure,
        f"The oscillator released from rest, T = {HORIZON:g}, steps from {least:.0e} to {most:.2g}; one coordinate x, "
        "no chart. Left: at critical damping (b = 2) the position has order 2 with both rules, as in every regime; the "
        "whole force at one end of the step costs an order. Middle and right: error of lambda of exp(lambda t), the "
        "rate at which the slower part of the motion decays. At critical damping it is the square root of a perturbed "
        f"discriminant, so that errors have half the usual order ({', '.join(halved)}). The midpoint rule leaves "
        "critical damping in place and keeps its order.",
        "Log-log plots of errors against step: at critical damping the rate of decay has slopes 2, 1 and 1/2, in the "
        "other panels 2, 2 and 1.",
    )


def draw_decay(data: xr.Dataset) -> Picture:
    """Errors of the energy over time at equal cost."""
    figure, axes = style.grid(len(AGAINST_RK45), 2, (TIME, "largest |E/E(exact) - 1| so far"), sharey=True)
    for axis, name in zip(axes, AGAINST_RK45, strict=True):
        for method in (*RULES, RK45):
            run = data.sel(scene=name, variant=method)
            time, error = run[Column.TIME].values, largest_so_far(run[Column.ENERGY_ERROR])
            axis.plot(time[1:], error[1:], **style.line(method, 0.8), markevery=0.1, label=method)
        axis.set(xscale="log", yscale="log", title=words.title(OSCILLATORS[name]))
    style.legend_below(figure, axes)
    style.headline(figure, words.decay_message(data))
    return Picture(
        "decay",
        figure,
        f"Energy of the oscillator (one coordinate x, no chart) against its exact decay over T = {LONG:g}, at equal "
        f"cost: {words.cost(data)}. {words.energy(data)} {words.FRICTION_BREAKS}",
        "Log-log plots of the relative energy error over time for two rules and RK45.",
    )


def draw_tops(data: xr.Dataset) -> Picture:
    """Inclination, momenta and momentum balance of the damped tops."""
    names = tops(data)
    figure, axes = style.panels(3, len(names), height=1.6, sharex="col")
    for (theta, momenta, balance), name in zip(axes.T, names, strict=True):
        first = data.sel(scene=name, variant="midpoint")
        time = first[Column.TOP_TIME].values
        theta.plot(time, np.degrees(first[Column.THETA]), color=style.BLUE, label=r"$\theta$, midpoint")
        theta.plot(time, np.degrees(first[Column.TRUE_THETA]), ":", color=style.BLACK, label=r"$\theta$, truth")
        momenta.plot(time, first[Column.P_PHI], color=style.GREEN, label=r"$p_\varphi$")
        momenta.plot(time, first[Column.P_PSI], "--", color=style.PURPLE, label=r"$p_\psi$")
        for method in (*RULES, RK45):
            run, color = data.sel(scene=name, variant=method), style.look(method).color
            phi, psi = largest_so_far(run[Column.BALANCE_PHI]), largest_so_far(run[Column.BALANCE_PSI])
            wide = 2.4 if method == RULES[0] else 1.1  # it lies below the other rule's
            balance.plot(time[1:], phi[1:], color=color, lw=wide, label=f"balance, {method}")
            balance.plot(time[1:], psi[1:], "--", color=color, lw=wide)
        balance.plot([], [], "--", color=style.GREY, label=r"balance of $p_\psi$ (solid: of $p_\varphi$)")
        theta.set_title(f"scene {name}, damped")
        balance.set(yscale="log", xlabel="time (s)")
    labels = (r"$\theta$ (degrees)", "momenta (J s)", "defect of the balance,\nrelative")
    for axis, label in zip(axes[:, 0], labels, strict=True):
        axis.set_ylabel(label)
    style.legend_below(figure, axes)
    ours, theirs = (style.number(words.largest_balance(data, some)) for some in (RULES, (RK45,)))
    style.headline(figure, f"With friction the discrete rules keep the balance of the momenta to {ours}, {RK45} to "
                           f"{theirs}")  # fmt: skip
    return Picture(
        "damped-top",
        figure,
        f"{' and '.join(names)} in gimbals with viscous bearings (torques -{FRICTION.precession:g} phi' and "
        f"-{FRICTION.spin:g} psi'), in angles, "
        f"{words.finest(data)}: the momenta decay. Their balance p(t) - p(0) + c (angle(t) - angle(0)) is zero for "
        "the true motion; its "
        f"defect is at most {words.largest_balance(data, RULES):.1e} with the discrete Lagrangians, which is rounding, "
        f"and {words.largest_balance(data, (RK45,)):.1e} with RK45 at tolerance {TOP_TOLERANCE:g}. Below, solid: phi, "
        "dashed: psi.",
        "Inclination, momenta and the residual of the momentum balance against time for the damped tops.",
    )


def draw_top_orders(data: xr.Dataset) -> Picture:
    """Errors of theta of the damped tops against the step."""
    labels = ("step size (s)", "largest error of theta (rad)")
    figure, axes = style.grid(len(tops(data)), 2, labels, height=2.3, sharex=True, sharey=True)
    bound = {"color": style.GREY, "lw": 3, "alpha": 0.5, "label": "error of the reference"}
    orders = []
    for axis, name in zip(axes, tops(data), strict=True):
        for method in RULES:
            run = data.sel(scene=name, variant=method)
            h, error = run[Column.TOP_STEP], run[Column.THETA_ERROR]
            axis.plot(h, error, **style.line(method), label=method)
            orders.append(f"{method} on {name} {order(data, name, method, Column.THETA_ERROR)}")
        axis.axhline(float(run[Column.TOP_BOUND]), **bound)
        style.slope_guide(axis, 2.0, (float(h.min()), float(h.max())), 0.3 * float(error.min()), "$h^2$")
        axis.set(xscale="log", yscale="log", title=f"scene {name}, damped")
    style.few_ticks(*axes, most=4)
    style.legend_below(figure, axes)
    slopes = [order(data, name, method, Column.THETA_ERROR).slope for name in tops(data) for method in RULES]
    judged = [slope for slope in slopes if np.isfinite(slope)]
    spans = sorted({f"{slope:.2f}" for slope in (min(judged), max(judged))}) if judged else []
    span = f"slope {' to '.join(spans)}" if judged else "too few steps to judge the order"
    style.headline(figure, f"Order of the discrete rules with friction, by the error of theta: {span}")
    return Picture(
        "damped-top-orders",
        figure,
        f"Order of the forced methods on the damped top, in angles, {words.finest(data)} and up: {'; '.join(orders)}. "
        "Reference: the six Euler-Lagrange "
        "equations with friction at tolerance 1e-13; the grey line is the largest difference of any angle from the "
        "form of four equations.",
        "Log-log plots of the error of theta against the step, slope 2.",
    )
