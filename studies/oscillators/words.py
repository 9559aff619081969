"""Sentences and tables of the oscillators study, from its dataset."""

import numpy as np
import xarray as xr

from symtop.report.style import number
from symtop.runner.study import Table

from .oscillator import ONE_SIDED, Oscillator
from .quartic_tables import ERROR, GAPS, MAPS, PERIODS, QUARTICS, STEPS, oscillator_of, quartic_order
from .tables import AGAINST_RK45, HORIZON, LONG, OSCILLATORS, RK45, RULES, TOP_TOLERANCE, Column, order, tops

HOW_TO_READ = (
    "The damped oscillator has an exact solution, so that every error is known. The slope of a line is the order. The "
    "top in damped gimbals shows Noether's theorem with friction: the momentum of a cyclic coordinate is no longer "
    "conserved but balanced, p1 - p0 = F_d^- + F_d^+. The balance is an identity of the method and holds at any step. "
    "The planar quartic oscillators have no friction: for them a discrete Lagrangian in closed form is exact at any "
    "step."
)


def title(oscillator: Oscillator, between: str = ", ") -> str:
    """The damping and what it makes of the motion."""
    return f"b = {oscillator.damping:g}{between}{oscillator.regime}"


def largest_balance(data: xr.Dataset, methods: tuple[str, ...]) -> float:
    """The largest relative defect of the momentum balance."""
    runs = data.sel(scene=tops(data), variant=list(methods))
    return max(float(np.abs(runs[name]).max()) for name in (Column.BALANCE_PHI, Column.BALANCE_PSI))


def finest(data: xr.Dataset) -> str:
    """The finest step and the horizon of each damped top."""
    parts = []
    for name in tops(data):
        cell = data.sel(scene=name, variant=RULES[0])
        step, end = float(cell[Column.TOP_STEP].min()), float(cell[Column.TOP_TIME].max())
        parts.append(f"step {step:.2g} s to t = {end:g} on {name}")
    return " and ".join(parts)


def cost(data: xr.Dataset) -> str:
    """Force evaluations of the discrete rules and of RK45."""
    evaluations = data[Column.EVALUATIONS].sel(scene=list(AGAINST_RK45))
    rules, rk45 = float(evaluations.sel(variant=RULES[0]).max()), evaluations.sel(variant=RK45)
    return (
        f"{rules:.0f} force evaluations for a rule (step {LONG / rules:g}), {float(rk45.min()):.0f} to "
        f"{float(rk45.max()):.0f} for RK45"
    )


def orders_message(data: xr.Dataset) -> str:
    """To which order each method has the rate of decay at critical damping, as a title."""
    powers = {m: order(data, "damping-2", m, Column.EXPONENT_ERROR).slope for m in (*RULES, ONE_SIDED)}
    return (
        f"At critical damping the rate of decay has order {powers['trapezoidal']:.1f} only with trapezoidal and "
        f"{powers[ONE_SIDED]:.1f} with the force at one end; midpoint keeps {powers['midpoint']:.1f}"
    )


def decay_message(data: xr.Dataset) -> str:
    """Which method keeps the energy best at equal cost, for each damping, as a title."""
    parts = []
    for name, errors in energy_errors(data).items():
        best, worst = (pick(errors, key=lambda method: errors[method]) for pick in (min, max))
        parts.append(
            f"{best} with {title(OSCILLATORS[name])} ({number(errors[best])}; {worst} {number(errors[worst])})"
        )
    return f"At equal cost the energy is kept best by {', by '.join(parts)}"


def energy_errors(data: xr.Dataset) -> dict[str, dict[str, float]]:
    """The largest relative error of the energy at equal cost, by scene and method."""
    largest = np.abs(data[Column.ENERGY_ERROR]).max("sample")
    return {
        name: {method: float(largest.sel(scene=name, variant=method)) for method in (*RULES, RK45)}
        for name in AGAINST_RK45
    }


def energy(data: xr.Dataset) -> str:
    """Who keeps the energy best and worst at equal cost, for each damping."""
    parts = []
    for name, errors in energy_errors(data).items():
        best, worst = (pick(errors, key=lambda method: errors[method]) for pick in (min, max))
        sizes = f"{errors[best]:.1e}, against {errors[worst]:.1e} with {worst}"
        parts.append(f"{best} at b = {OSCILLATORS[name].damping:g} ({sizes})")
    return (
        f"At equal cost to T = {LONG:g} the energy is kept best by {' and by '.join(parts)}. These are the largest "
        "relative errors."
    )


FRICTION_BREAKS = (
    "The symplectic structure bounds the energy error of a discrete Lagrangian, and friction breaks it: with b > 0 the "
    "rate of decay of every method is off by a constant, and the error grows with time."
)


def verdict(data: xr.Dataset) -> list[str]:
    """Orders, the notebook's update, decay and balance."""
    damped = [name for name, oscillator in OSCILLATORS.items() if oscillator.damping > 0.0]
    both = [order(data, name, method, Column.POSITION_ERROR).slope for name in OSCILLATORS for method in RULES]
    one = [order(data, name, ONE_SIDED, Column.POSITION_ERROR).slope for name in damped]
    orders = (
        f"{' and '.join(RULES)} have orders between {min(both):.3f} and {max(both):.3f} against the analytic solution "
        "in every regime, from undamped to overdamped. With the whole force at one end of the step the order is "
        f"{min(one):.2f} to {max(one):.2f}."
    )
    update = (
        "The notebook's update is the midpoint rule with forced discrete Euler-Lagrange equations: the same positions "
        f"within {float(data[Column.UPDATE_GAP].max()):.0e} over {HORIZON:g} time units. Its guess at the forces "
        "damps nothing."
    )
    balance = (
        "On the damped top the momenta change by exactly the discrete forces: the relative defect of the balance is at "
        f"most {largest_balance(data, RULES):.1e}, against {largest_balance(data, (RK45,)):.1e} with RK45 at tolerance "
        f"{TOP_TOLERANCE:g}."
    )
    return [orders, update, energy(data), FRICTION_BREAKS, balance, *quartic_sentences(data)]


def tables(data: xr.Dataset) -> list[Table]:
    """Orders and errors in numbers."""
    largest = np.abs(data[Column.ENERGY_ERROR]).max("sample")
    rows = [
        [
            f"{oscillator.damping:g}", oscillator.regime, method,
            str(order(data, name, method, Column.POSITION_ERROR)),
            str(order(data, name, method, Column.EXPONENT_ERROR)),
            f"{float(largest.sel(scene=name, variant=method)):.1e}",
        ]
        for name, oscillator in OSCILLATORS.items()
        for method in (*RULES, ONE_SIDED)
    ]  # fmt: skip
    orders = ["order of x", "order of the rate of decay"]
    header = ["b", "regime", "rule", *orders, f"relative energy error to T = {LONG:g}"]
    damped = Table(f"Damped oscillator against the analytic solution, T = {HORIZON:g}; no chart", header, rows)
    known = energy_errors(data)
    kept = Table(
        f"Largest relative error of the energy at equal cost to T = {LONG:g}",
        ["method", *(title(OSCILLATORS[name]) for name in known)],
        [[method, *(f"{errors[method]:.1e}" for errors in known.values())] for method in (*RULES, RK45)],
    )
    return [kept, damped, *quartic_orders(data)]


def quartic_sentences(data: xr.Dataset) -> list[str]:
    """What the four maps do, and what becomes of the exact one for small steps."""
    worst = float(data[ERROR].sel(scene=list(QUARTICS), variant="exact-discrete").max())
    slopes = [quartic_order(data, name, method).slope for name in QUARTICS for method in MAPS[1:]]
    limits = [quartic_order(data, name, MAPS[0], gap).slope for name in QUARTICS[1:] for gap in GAPS]
    line = (
        "The map Z+ + Z- = 2 A Z/(1 + B |Z|^2) leads from the oscillator to the top. With sigma = 0 it is the harmonic "
        "oscillator with its known exact discrete Lagrangian (B = 0, A = cos w h), with sigma the planar quartic "
        "oscillator. Two of these, with sigma = kappa and -kappa, are the top."
    )
    error = (
        f"This exact map has a largest relative error of {worst:.0e} on these oscillators, which is rounding, over "
        f"{PERIODS:g} periods and at steps of T/{max(STEPS):g} to T/{min(STEPS):g}."
    )
    limit = (
        "stormer-verlet, the midpoint rule and McMillan's map with constants to order h^2 have orders "
        f"{min(slopes):.2f} to {max(slopes):.2f} on the same oscillators. For small steps A and B of the exact map "
        f"differ from theirs by h^4, and delta vanishes as h^3 (slopes {min(limits):.2f} to {max(limits):.2f})."
    )
    return [line, error, limit]


def quartic_orders(data: xr.Dataset) -> list[Table]:
    """Orders and the largest errors of every map."""
    rows = []
    for name in QUARTICS:
        oscillator = oscillator_of(name)
        for method in MAPS:
            errors = data[ERROR].sel(scene=name, variant=method).values
            order = "exact" if method == MAPS[0] else f"{quartic_order(data, name, method).slope:.2f}"
            sizes = [f"{errors[STEPS.index(steps)]:.0e}" for steps in (160.3, 20.3, 4.37, 2.1)]
            rows.append([name, f"{oscillator.sigma:.3g}", f"{oscillator.b:.3g}", method, order, *sizes])
    header = ["oscillator", "sigma", "b", "map", "order", "error at T/160", "T/20", "T/4.4", "T/2.1"]
    return [Table(f"Planar quartic oscillators: largest relative error over {PERIODS:g} periods", header, rows)]
