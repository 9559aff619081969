"""Sentences and tables of the oscillators study, from its dataset."""

import numpy as np
import xarray as xr

from symtop.runner.study import Table

from .oscillator import Oscillator
from .tables import HORIZON, LONG, ONE_SIDED, RK45, RULES, TOP_TOLERANCE, Column, dampings, order, tops

HOW_TO_READ = (
    "The damped oscillator has an exact solution, so that every error is known. The slope of a line is the order. The "
    "top in damped gimbals shows Noether's theorem with friction: the momentum of a cyclic coordinate is no longer "
    "conserved but balanced, p1 - p0 = F_d^- + F_d^+. The balance is an identity of the method and holds at any step."
)


def cell(data: xr.Dataset, scene: str, integrator: str) -> xr.Dataset:
    """One scene and one integrator."""
    return data.sel(scene=scene, integrator=integrator)


def orders(data: xr.Dataset) -> str:
    """Orders of the position."""
    both, one = (
        [
            order(data, name, method, Column.POSITION_ERROR, Column.STEP).slope
            for name, b in dampings(data).items()
            for method in methods
            if b > 0.0 or method in RULES
        ]
        for methods in (RULES, (ONE_SIDED,))
    )
    return (
        f"Both rules have orders between {min(both):.3f} and {max(both):.3f} against the analytic solution in every "
        "regime, from undamped to overdamped; with the whole force at one end of the step the order is "
        f"{min(one):.2f} to {max(one):.2f}."
    )


def critical_orders(data: xr.Dataset) -> str:
    """Orders of the slow exponent at critical damping."""
    name = next(name for name, b in dampings(data).items() if Oscillator(damping=b).discriminant == 0.0)
    slopes = {
        method: order(data, name, method, Column.EXPONENT_ERROR, Column.STEP).slope
        for method in ("trapezoidal", ONE_SIDED)
    }
    return ", ".join(f"{method} {slope:.2f}" for method, slope in slopes.items())


def update(data: xr.Dataset) -> str:
    """What the notebook's update and its guess are."""
    return (
        "The notebook's update is the midpoint rule with forced discrete Euler-Lagrange equations: the same positions "
        f"within {float(data[Column.UPDATE_GAP].max()):.0e} over {HORIZON:g} time units. Its guess at the forces is "
        "not: it damps nothing."
    )


def with_rk45(data: xr.Dataset) -> dict[str, float]:
    """The oscillators that RK45 was run on: damping by name."""
    return {
        name: b for name, b in dampings(data).items() if np.isfinite(cell(data, name, RK45)[Column.EVALUATIONS].item())
    }


def energy(data: xr.Dataset) -> str:
    """Errors of the energy at equal cost."""
    rows = []
    for name, b in with_rk45(data).items():
        errors = {m: np.nanmax(np.abs(cell(data, name, m)[Column.ENERGY_ERROR])) for m in (*RULES, RK45)}
        rows.append(f"b = {b:g}: " + ", ".join(f"{method} {float(error):.1e}" for method, error in errors.items()))
    return (
        f"Largest relative error of the energy at equal cost to T = {LONG:g}: {'; '.join(rows)}. The symplectic "
        "structure bounds the energy error of a discrete Lagrangian, and friction breaks it: with b > 0 the rate of "
        "decay of every method is off by a constant, and the error grows with time."
    )


def cost(data: xr.Dataset) -> str:
    """Force evaluations of the discrete rules and of RK45."""
    names = list(with_rk45(data))
    evaluations = data[Column.EVALUATIONS].sel(scene=names)
    rules, rk45 = float(evaluations.sel(integrator=RULES[0]).max()), evaluations.sel(integrator=RK45)
    return (
        f"{rules:.0f} force evaluations for a rule (h = {LONG / rules:g}), {float(rk45.min()):.0f} to "
        f"{float(rk45.max()):.0f} for RK45"
    )


def largest_balance(data: xr.Dataset, methods: tuple[str, ...]) -> float:
    """The largest relative defect of the momentum balance."""
    runs = data.sel(scene=tops(data), integrator=list(methods))
    return max(float(np.abs(runs[name]).max()) for name in (Column.BALANCE_PHI, Column.BALANCE_PSI))


def balance(data: xr.Dataset) -> str:
    """What the momenta of the damped top do."""
    return (
        "On the damped top the momenta change by exactly the discrete forces: the relative defect of the balance is at "
        f"most {largest_balance(data, RULES):.1e}, against {largest_balance(data, (RK45,)):.1e} with RK45 at tolerance "
        f"{TOP_TOLERANCE:g}."
    )


def tables(data: xr.Dataset) -> list[Table]:
    """Orders and errors in numbers."""
    rows = [
        [
            f"{b:g}", Oscillator(damping=b).regime, method,
            str(order(data, name, method, Column.POSITION_ERROR, Column.STEP)),
            str(order(data, name, method, Column.EXPONENT_ERROR, Column.STEP)),
            f"{float(np.abs(cell(data, name, method)[Column.ENERGY_ERROR]).max()):.1e}",
        ]
        for name, b in dampings(data).items()
        for method in (*RULES, ONE_SIDED)
    ]  # fmt: skip
    header = [
        "b", "regime", "rule", "order of x", "order of the slow exponent", f"relative energy error to T = {LONG:g}"
    ]  # fmt: skip
    return [Table("Damped oscillator against the analytic solution", header, rows)]
