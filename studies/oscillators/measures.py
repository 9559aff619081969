"""The measurements on the damped oscillator and on the damped top.

The oscillator (m = k = 1, released from x = 1 at rest; times in units of sqrt(m/k)) has an analytic solution. The
damped top has none: its reference is a pair of integrations (see `damping`).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from symtop.measure.accuracy import as_table
from symtop.measure.order import Fit, power_law
from symtop.methods.lagrangian.damped_oscillator import (
    Array,
    Oscillator,
    discrete_path,
    legendre,
    notebook_positions,
    rule_sums,
)
from symtop.methods.lagrangian.damped_top import Friction, damped_run
from symtop.model.scenes import Scene

from .damping import damped_truth, discrete_exponents, six_variables

OSCILLATORS = {f"damping-{b:g}": Oscillator(damping=b) for b in (0.0, 0.1, 1.0, 2.0, 3.0, 4.0)}  # by scene
AGAINST_RK45 = ("damping-0", "damping-0.1")
TOPS = {"goldstein": 40.0, "spheroid": 8.0}  # scenes and horizons (s) of the damped tops
RULES = ("midpoint", "trapezoidal")
RK45 = "rk45"  # SciPy's, on the same equations
RELEASED = (1.0, 0.0)  # position and velocity of the oscillator
HORIZON, LONG = 25.0, 250.0  # of the oscillator: for orders, for the energy
FRICTION = Friction(precession=0.05, spin=0.1)  # of the damped tops
SAMPLES = 401
TOP_TOLERANCE = 1e-6  # of RK45 on the damped top
LEAST_JUDGED = 1e-9  # errors below do not enter the fit of an order
ASYMPTOTIC = {"step_size": 0.11, "top_step_size": 0.011}  # largest step that enters the fit


def order(data: xr.Dataset, scene: str, method: str, error: str) -> Fit:
    """Slope of an error against the step, over the steps that are small enough and the errors above rounding."""
    step = "top_step_size" if error == "theta_error" else "step_size"
    cell = data.sel(scene=scene, variant=method)
    steps, errors = cell[step].values, cell[error].values
    return power_law(steps, errors, (steps < ASYMPTOTIC[step]) & (errors > LEAST_JUDGED))


def convergence(oscillator: Oscillator, method: str, steps: Sequence[float], horizon: float) -> xr.Dataset:
    """Largest error of the position and relative error of the slow exponent; dimension ``setting``."""
    rule, slow, rows = rule_sums(method), oscillator.exponents()[0], []
    for count in (round(horizon / step) for step in steps):
        times, position, _ = discrete_path(oscillator, rule, *RELEASED, horizon, count)
        errors, h = position - oscillator.exact(times, *RELEASED)[0], horizon / count
        rows.append({
            "step_size": h,
            "position_error": float(np.max(np.abs(errors))),
            "exponent_error": abs(discrete_exponents(oscillator, rule, h)[0] - slow) / abs(slow),
        })  # fmt: skip
    return as_table(rows)


def decay(oscillator: Oscillator, method: str, step: float, horizon: float) -> xr.Dataset:
    """Relative error of the energy over a long horizon, at one force evaluation a step; dimension ``sample``.

    ``rk45`` gets the tightest tolerance with which it needs no more evaluations.
    """
    evaluations = round(horizon / step)
    if method == RK45:
        times = np.linspace(0.0, horizon, SAMPLES)
        position, momentum, evaluations = _rk45_at_cost(oscillator, evaluations, times)
    else:
        motion = discrete_path(oscillator, rule_sums(method), *RELEASED, horizon, evaluations, SAMPLES)
        times, position, momentum = motion
    x, v = oscillator.exact(times, *RELEASED)
    error = oscillator.energy(position, momentum) / oscillator.energy(x, oscillator.mass * v) - 1.0
    histories = {"sample_time": ("sample", times), "energy_error": ("sample", error)}
    return xr.Dataset({**histories, "evaluations": float(evaluations)})


def _rk45_at_cost(oscillator: Oscillator, evaluations: int, times: Array) -> tuple[Array, Array, int]:
    """SciPy's RK45 with the tightest relative tolerance that takes at most `evaluations`, found by bisection."""
    from scipy.integrate import solve_ivp  # 0.6 s to import

    m, b, k = oscillator

    def run(exponent: float) -> Any:
        # the absolute tolerance lies far below the relative one, so that a motion that dies out stays resolved
        return solve_ivp(
            lambda _, y: (y[1] / m, -k * y[0] - b * y[1] / m), (0.0, times[-1]), (RELEASED[0], m * RELEASED[1]),
            rtol=10.0**exponent, atol=1e-8 * 10.0**exponent, t_eval=times,
        )  # fmt: skip

    low, high = -12.0, -1.0
    for _ in range(9):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if run(middle).nfev > evaluations else (low, middle)
    solution = run(high)
    return solution.y[0], solution.y[1], int(solution.nfev)


def notebook_history(oscillator: Oscillator, h: float, horizon: float) -> xr.Dataset:
    """The notebook's experiment: exact positions, its update, the midpoint rule from the same two, its guess at forces.

    Dimension ``seed_step``. The notebook starts on the slow mode, x = Re exp(lambda t), from two exact positions.
    """
    rule, count = rule_sums("midpoint"), round(horizon / h)
    times = np.arange(count + 1) * h
    true, _ = oscillator.exact(times, 1.0, oscillator.exponents()[0].real)
    first, second = float(true[0]), float(true[1])
    momentum = float(legendre(oscillator, rule, (first, 0.0), (second - first, 0.0), h)[0])
    ours = discrete_path(oscillator, rule, first, momentum, count * h, count, count + 1)[1]
    update, guess = notebook_positions(oscillator.damping, h, first, second, count)
    columns = {"seed_time": times, "analytic": true, "seed_update": update, "seed_guess": guess}
    columns["update_gap"] = np.abs(update - ours)
    return xr.Dataset({name: ("seed_step", values) for name, values in columns.items()})


def damped_top_table(scene: Scene, method: str, counts: Sequence[int], horizon: float) -> xr.Dataset:
    """Errors of theta at several numbers of steps, multiples of the first; momenta and their balance in time.

    Dimensions ``top_setting`` and ``top_sample``; the histories are those of the finest step. ``balance_phi`` and
    ``balance_psi`` are p(t) - p(0) + c (angle(t) - angle(0)) relative to the larger momentum, zero for the true motion.
    ``rk45`` runs once, at the tolerance 1e-6.
    """
    top, share = scene.top, np.unique(np.rint(np.linspace(0.0, counts[0], min(SAMPLES, counts[0] + 1))).astype(int))
    times = share.astype(np.float64) * (horizon / counts[0])
    truth, bound = damped_truth(scene, FRICTION, times)
    columns: dict[str, Any] = {"top_bound": bound}
    if method == RK45:
        theta, phi, psi, _, phi_dot, psi_dot = six_variables(scene, FRICTION, times, "RK45", TOP_TOLERANCE)
        p_psi = top.I3 * (psi_dot + phi_dot * np.cos(theta))
        p_phi = top.I1 * phi_dot * np.sin(theta) ** 2 + p_psi * np.cos(theta)
    else:
        steps = [horizon / count for count in counts]
        runs = [
            damped_run(scene, FRICTION, method, h, share * (count // counts[0])).states.T
            for h, count in zip(steps, counts, strict=True)
        ]
        columns["top_step_size"] = ("top_setting", steps)
        columns["theta_error"] = ("top_setting", [float(np.max(np.abs(run[0] - truth[0]))) for run in runs])
        theta, phi, psi, _, p_phi, p_psi = runs[-1]
    history = {
        "top_time": times,
        "theta": theta,
        "true_theta": truth[0],
        "p_phi": p_phi,
        "p_psi": p_psi,
        "balance_phi": (p_phi - p_phi[0] + FRICTION.precession * (phi - phi[0])) / scene.momentum_scale,
        "balance_psi": (p_psi - p_psi[0] + FRICTION.spin * (psi - psi[0])) / scene.momentum_scale,
    }
    return xr.Dataset(columns | {name: ("top_sample", values) for name, values in history.items()})
