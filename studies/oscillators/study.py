"""What becomes of a discrete Lagrangian when energy is taken away?

The seed of this project integrated a damped oscillator by the discrete Lagrangian, and stopped at a guess about the
forces. The guess is finished here: the virtual work of F over one step splits into F_d^- at its start and F_d^+ at its
end, and the forced discrete Euler-Lagrange equations are

    D1 L_d(q1, q2) + D2 L_d(q0, q1) + F_d^-(q1, q2) + F_d^+(q0, q1) = 0.

Read as momenta this says p1 - p0 = (what the potential gives) + F_d^- + F_d^+: Noether's theorem with its right-hand
side. Where a coordinate is cyclic the momentum changes by the discrete forces and by nothing else.
"""

import numpy as np
import xarray as xr

from symtop.measure.order import power_law
from symtop.model.scenes import scene
from symtop.report import style
from symtop.runner.study import Case, Picture, Study, Table

from .forced import Friction
from .oscillator import Oscillator
from .tables import ONE_SIDED, convergence, damped_top_table, decay, seed_history

DAMPINGS = (0.0, 0.1, 1.0, 2.0, 3.0, 4.0)  # with m = k = 1: 2 is critical
SHOWN_DECAY = (0.0, 0.1)
RULES = ("midpoint", "trapezoidal")
HORIZON, LONG = 25.0, 250.0
FRICTION = Friction(precession=0.05, spin=0.1)
TOPS = {"goldstein": 40.0, "spheroid": 8.0}
ASYMPTOTIC = 0.11  # largest step that enters a fit
TOP_ASYMPTOTIC = 0.011
ROUNDING = 1e-11  # relative, of a momentum after 32 000 steps
SYMBOLS = {"midpoint": "o", "trapezoidal": "s", ONE_SIDED: "v"}


def cases(quick: bool) -> list[Case]:
    """Every damping with both rules and the one-sided force; two of them against RK45; two damped tops."""
    steps = [10.0 ** (-k / 4.0) for k in range(13 if quick else 17)]
    grid = [
        Case(f"damping-{b:g}", method, {"damping": b, "steps": steps, "long_step": 0.1 if quick else 0.05})
        for b in DAMPINGS
        for method in (*RULES, ONE_SIDED)
    ]
    grid += [Case(f"damping-{b:g}", "rk45", {"damping": b, "long_step": 0.1 if quick else 0.05}) for b in SHOWN_DECAY]
    counts = [1000 * 2**k for k in range(4 if quick else 6)]
    return grid + [
        Case(name, method, {"counts": counts, "horizon": horizon})
        for name, horizon in list(TOPS.items())[: 1 if quick else 2]
        for method in (*RULES, "rk45")
    ]


def measure(case: Case) -> xr.Dataset:
    """Errors against the analytic solution, or against the damped top's truth."""
    plan, method = case.settings, case.integrator
    if "damping" not in plan:
        return damped_top_table(scene(case.scene), FRICTION, method, plan["counts"], plan["horizon"])
    found = decay(plan["damping"], method, plan["long_step"], LONG)
    if method != "rk45":
        found = found.merge(convergence(plan["damping"], method, plan["steps"], HORIZON))
    return found.merge(seed_history(plan["damping"], 0.1, HORIZON)) if method == "midpoint" else found


def cell(data: xr.Dataset, name: str, method: str) -> xr.Dataset:
    """One scene and one method."""
    return data.sel(scene=name, integrator=method)


def oscillators(data: xr.Dataset) -> list[tuple[str, float]]:
    """The oscillators' scene names and dampings."""
    names = [str(name) for name in data["scene"].values]
    return [(name, float(name.partition("-")[2])) for name in names if name.startswith("damping-")]


def tops(data: xr.Dataset) -> list[str]:
    """Names of the damped tops."""
    return [str(name) for name in data["scene"].values if str(name) in TOPS]


def order(data: xr.Dataset, name: str, method: str, error: str, h: str, largest: float) -> str:
    """Slope of an error against the step, over the steps that are small enough and above rounding."""
    here = cell(data, name, method)
    steps, errors = here[h].values, here[error].values
    return str(power_law(steps, errors, (steps < largest) & (errors > 1e-9)))


def pictures(data: xr.Dataset) -> list[Picture]:
    """The seed's experiment, orders, decay, and the damped top."""
    return [_draw_seed(data), _draw_orders(data), _draw_decay(data), _draw_tops(data), _draw_top_orders(data)]


def _draw_seed(data: xr.Dataset) -> Picture:
    shown = oscillators(data)
    figure, axes = style.panels(2, 3, height=2.5, sharex=True, sharey=True)
    gaps = []
    for axis, (name, b) in zip(axes.flat, shown, strict=False):
        here = cell(data, name, "midpoint").dropna("seed_step")
        t = here["seed_time"].values
        axis.plot(t, here["analytic"], color=style.BLACK, lw=2.6, alpha=0.35, label="analytic")
        axis.plot(t, here["seed_update"], color=style.BLUE, label="the notebook's update = midpoint rule")
        axis.plot(t, here["seed_guess"], "--", color=style.VERMILLION, lw=1.0, label="its guess at the forces")
        axis.set_title(f"b = {b:g}, {Oscillator(damping=b).regime}")
        gaps.append(float(here["update_gap"].max()))
    axes[0, 0].set_ylim(-1.3, 8.5)
    for axis in axes[-1]:
        axis.set_xlabel("time")
    for axis in axes[:, 0]:
        axis.set_ylabel("x")
    style.legend_below(figure, axes)
    return Picture(
        "seed",
        figure,
        "The notebook's damped oscillator (m = k = 1, h = 0.1, T = 25). Reproduced: its update, which is the midpoint "
        f"rule with forced discrete Euler-Lagrange equations, the same positions to {max(gaps):.0e}. Corrected: its "
        "guess put dF/dx' = -b where the discrete force belongs, with the sign of a potential's slope; that is a "
        "constant push, which damps nothing and shifts the centre of the oscillation to x = b.",
        "Six panels of position against time for growing damping; the update lies on the analytic curve, the guess "
        "oscillates undamped about x = b.",
    )


def _draw_orders(data: xr.Dataset) -> Picture:
    figure, axes = style.panels(2, 6, width=13.0, height=2.7, sharex=True, sharey="row")
    for column, (name, b) in enumerate(oscillators(data)):
        for line, error in enumerate(("position_error", "exponent_error")):
            axis = axes[line, column]
            for method, marker in SYMBOLS.items():
                here = cell(data, name, method)
                kept = here[error].values > 1e-13
                color = style.PURPLE if method == ONE_SIDED else style.look(method).color
                axis.plot(
                    here["step_size"].values[kept], here[error].values[kept], marker + "-", color=color, ms=4,
                    mfc="none" if method == "trapezoidal" else color, label=method,
                )  # fmt: skip
            style.slope_guide(axis, 2.0, (1e-2, 1.0), 1e-9, "$h^2$")
            if line == 0:
                style.slope_guide(axis, 1.0, (1e-3, 1e-1), 2e-2, "$h$")
            axis.set(xscale="log", yscale="log")
        axes[0, column].set_title(f"b = {b:g}\n{Oscillator(damping=b).regime}")
        axes[1, column].set_xlabel("step size")
    axes[0, 0].set_ylabel("largest error of x")
    axes[1, 0].set_ylabel("relative error of\nthe slow exponent")
    style.legend_below(figure, axes)
    return Picture(
        "orders",
        figure,
        f"Released from rest, T = {HORIZON:g}. Both rules have order 2 in every regime; the whole force at one end of "
        "the step costs an order. Below, the exponent of exp(lambda t) itself: at critical damping it is the square "
        "root of a perturbation, and the trapezoidal rule, which moves critical damping by h^2, is only of order 1 "
        "there, while the midpoint rule leaves it in place.",
        "Log-log plots of errors against step for six dampings: slope 2 for both rules, slope 1 for the one-sided "
        "force.",
    )


def _draw_decay(data: xr.Dataset) -> Picture:
    shown = [(name, b) for name, b in oscillators(data) if b in SHOWN_DECAY]
    figure, axes = style.panels(1, len(shown), sharey=True)
    for axis, (name, b) in zip(axes.flat, shown, strict=True):
        for method in (*RULES, "rk45"):
            here, look = cell(data, name, method), style.look(method)
            error = np.maximum.accumulate(np.maximum(np.abs(here["energy_error"].values), 1e-16))
            axis.plot(
                here["sample_time"].values[1:], error[1:], look.marker + "-", color=look.color, ms=0.7 * look.size,
                markevery=0.1, label=method,
            )  # fmt: skip
        axis.set(xscale="log", yscale="log", xlabel="time", title=f"b = {b:g}, {Oscillator(damping=b).regime}")
    axes[0, 0].set_ylabel("largest |E/E(exact) - 1| so far")
    style.legend_below(figure, axes)
    return Picture(
        "decay",
        figure,
        f"Energy against its exact decay over T = {LONG:g}, at equal cost: RK45 has the tolerance with which it needs "
        f"as many force evaluations. {_decay_words(data)}",
        "Log-log plots of the relative energy error over time for two rules and RK45.",
    )  # fmt: skip


def _decay_words(data: xr.Dataset) -> str:
    words = []
    for name, b in oscillators(data):
        if b in SHOWN_DECAY:
            ends = [
                f"{method} {float(np.nanmax(np.abs(cell(data, name, method)['energy_error']))):.1e}"
                for method in (*RULES, "rk45")
            ]
            words.append(f"b = {b:g}: {', '.join(ends)}.")
    return (
        f"Largest relative error of the energy at equal cost to T = {LONG:g}: {' '.join(words)} What bounds the "
        "energy of a discrete Lagrangian is the symplectic structure, and friction takes it away: with b > 0 every "
        "method's rate of decay is off by a constant, and the error grows with time."
    )


def _draw_tops(data: xr.Dataset) -> Picture:
    names = tops(data)
    figure, axes = style.panels(3, len(names), width=4.8 * max(2, len(names)), height=2.3, sharex="col")
    for column, name in enumerate(names):
        first = cell(data, name, "midpoint")
        time = first["top_time"].values
        axes[0, column].plot(time, np.degrees(first["theta"]), color=style.BLUE, label="theta, midpoint")
        axes[0, column].plot(time, np.degrees(first["true_theta"]), ":", color=style.BLACK, label="theta, truth")
        axes[1, column].plot(time, first["p_phi"], color=style.GREEN, label=r"$p_\varphi$")
        axes[1, column].plot(time, first["p_psi"], "--", color=style.PURPLE, label=r"$p_\psi$")
        for method in (*RULES, "rk45"):
            here, look = cell(data, name, method), style.look(method)
            for variable, line in (("balance_phi", "-"), ("balance_psi", "--")):
                worst = np.maximum.accumulate(np.maximum(np.abs(here[variable].values), 1e-17))
                axis = axes[2, column]
                label = f"balance, {method}" if line == "-" else None
                axis.plot(time[1:], worst[1:], line, color=look.color, label=label)
        axes[2, column].set(yscale="log", xlabel="time (s)")
        axes[0, column].set_title(f"{name}, damped")
    for axis, label in zip(axes[:, 0], ("theta (degrees)", "momenta", "momentum balance,\nrelative"), strict=True):
        axis.set_ylabel(label)
    style.legend_below(figure, axes)
    return Picture(
        "damped-top",
        figure,
        f"A top in gimbals with viscous bearings (torques -{FRICTION.precession:g} phi' and -{FRICTION.spin:g} psi'): "
        "the momenta decay, and their balance p(t) - p(0) + c (angle(t) - angle(0)), zero for the true motion, stays "
        f"at rounding with the discrete Lagrangians (at most {_worst_balance(data, RULES):.1e}); RK45 at 1e-6 loses "
        f"it ({_worst_balance(data, ('rk45',)):.1e}). Solid: phi, dashed: psi.",
        "Inclination, momenta and the residual of the momentum balance against time for the damped tops.",
    )  # fmt: skip


def _worst_balance(data: xr.Dataset, methods: tuple[str, ...]) -> float:
    there = data.sel(scene=tops(data), integrator=list(methods))
    return max(float(np.abs(there[name]).max()) for name in ("balance_phi", "balance_psi"))


def _draw_top_orders(data: xr.Dataset) -> Picture:
    names = tops(data)
    figure, axes = style.panels(1, max(2, len(names)), height=3.2, sharey=True)
    for axis in axes.flat[len(names) :]:
        axis.set_visible(False)
    for axis, name in zip(axes.flat, names, strict=False):
        for method in RULES:
            here, look = cell(data, name, method), style.look(method)
            h, error = here["top_step_size"].values, here["theta_error"].values
            axis.plot(h, error, look.marker + "-", color=look.color, label=method)
        axis.axhline(
            float(cell(data, name, "midpoint")["top_bound"]), color=style.GREY, lw=3, alpha=0.5,
            label="distance of two truths",
        )  # fmt: skip
        style.slope_guide(axis, 2.0, (float(np.nanmin(h)), float(np.nanmax(h))), 0.3 * float(np.nanmin(error)), "$h^2$")
        axis.set(xscale="log", yscale="log", title=f"{name}, damped", xlabel="step size (s)")
        axis.xaxis.set_minor_formatter("")
    axes[0, 0].set_ylabel("largest error of theta (rad)")
    style.legend_below(figure, axes)
    orders = "; ".join(
        f"{method} on {name} {order(data, name, method, 'theta_error', 'top_step_size', TOP_ASYMPTOTIC)}"
        for name in names
        for method in RULES
    )
    return Picture(
        "damped-top-orders",
        figure,
        f"Order of the forced methods on the damped top: {orders}. The truth is an integration at 1e-13 of the six "
        "Euler-Lagrange equations with friction, the grey line its distance from one of the four reduced equations.",
        "Log-log plots of the error of theta against the step, slope 2.",
    )


def tables(data: xr.Dataset) -> list[Table]:
    """Orders and errors in numbers."""
    rows = [
        [
            f"{b:g}", Oscillator(damping=b).regime, method,
            order(data, name, method, "position_error", "step_size", ASYMPTOTIC),
            order(data, name, method, "exponent_error", "step_size", ASYMPTOTIC),
            f"{float(np.abs(cell(data, name, method)['energy_error']).max()):.1e}",
        ]
        for name, b in oscillators(data)
        for method in SYMBOLS
    ]  # fmt: skip
    header = ["b", "regime", "rule", "order of x", "order of the slow exponent", f"energy error at T = {LONG:g}"]
    return [Table("Damped oscillator against the analytic solution", header, rows)]


def verdict(data: xr.Dataset) -> list[str]:
    """Orders, the notebook's update, decay and balance."""
    slopes = [
        float(order(data, name, method, "position_error", "step_size", ASYMPTOTIC).partition(" ")[0])
        for name, _ in oscillators(data)
        for method in RULES
    ]
    one = [
        float(order(data, name, ONE_SIDED, "position_error", "step_size", ASYMPTOTIC).partition(" ")[0])
        for name, b in oscillators(data)
        if b > 0.0
    ]
    gap = float(data["update_gap"].max())
    orders = (
        f"Both rules have orders between {min(slopes):.3f} and {max(slopes):.3f} against the analytic solution in "
        "every regime, from undamped to overdamped; with the whole force at one end of the step "
        f"{min(one):.2f} to {max(one):.2f}."
    )
    update = (
        "The notebook's update is the midpoint rule with forced discrete Euler-Lagrange equations: the same numbers "
        f"within {gap:.0e} over {HORIZON:g} time units. Its guess at the forces is not: it damps nothing."
    )
    balance = (
        "On the damped top the momenta change by exactly the discrete forces: the balance holds to "
        f"{_worst_balance(data, RULES):.1e}, against {_worst_balance(data, ('rk45',)):.1e} with RK45 at 1e-6."
    )
    return [orders, update, _decay_words(data), balance]


STUDY = Study(
    name="oscillators",
    title="Oscillators and friction",
    question="What becomes of a discrete Lagrangian when energy is taken away?",
    how_to_read=(
        "The damped oscillator has an exact solution, so that every error is true. Slope is order. The top in damped "
        "gimbals shows what is left of Noether's theorem: a cyclic momentum is no longer conserved but balanced, "
        "p1 - p0 = F_d^- + F_d^+, and the balance is an identity of the method, not a matter of its step."
    ),
    cases=cases,
    measure=measure,
    pictures=pictures,
    tables=tables,
    verdict=verdict,
)
