"""What is computed and stored of the damped oscillator and of the damped top.

The oscillator (m = k = 1, released from x = 1 at rest; times in units of sqrt(m/k)) has an analytic solution. The
damped top has none: its truth is a pair of integrations (see `damped_truth`).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from symtop.measure.order import Fit, power_law
from symtop.model.scenes import Scene

from .damped_top import Friction, damped_run
from .damped_truth import damped_rates, damped_truth, energy, integrate, start_of
from .oscillator import (
    Array,
    Oscillator,
    Sums,
    discrete_exponents,
    discrete_path,
    notebook_guess,
    notebook_update,
    relative_energy_error,
    rule_sums,
    start_momentum,
    step_counts,
)

RULES = ("midpoint", "trapezoidal")
ONE_SIDED = "force-at-one-end"  # the midpoint rule with the whole force in F_d^-, a negative control of order 1
RK45 = "rk45"  # SciPy's, on the same equations
RELEASED = (1.0, 0.0)  # position and velocity of the oscillator
HORIZON, LONG = 25.0, 250.0  # of the oscillator: for orders, for the energy
FRICTION = Friction(precession=0.05, spin=0.1)  # of the damped tops
SAMPLES = 401
TOP_TOLERANCE = 1e-6  # of RK45 on the damped top
LEAST_JUDGED = 1e-9  # errors below do not enter the fit of an order
ASYMPTOTIC = {"step_size": 0.11, "top_step_size": 0.011}  # largest step that enters the fit


class Column:
    """Variables of the dataset, with unit and dimension. Times of the oscillator are in units of sqrt(m/k)."""

    # errors at several steps; setting
    STEP = "step_size"
    POSITION_ERROR, EXPONENT_ERROR = "position_error", "exponent_error"  # absolute (start: 1), relative
    # relative error of the energy over a long horizon; sample
    TIME, ENERGY_ERROR = "sample_time", "energy_error"
    EVALUATIONS = "evaluations"  # of the force; a scalar
    # positions in the notebook's experiment; seed_step
    NOTEBOOK_TIME, ANALYTIC = "seed_time", "analytic"
    NOTEBOOK_UPDATE, NOTEBOOK_GUESS, UPDATE_GAP = "seed_update", "seed_guess", "update_gap"
    # the damped top: errors of theta (rad) at several steps (s); top_setting
    TOP_STEP, THETA_ERROR = "top_step_size", "theta_error"
    TOP_BOUND = "top_bound"  # rad, distance of the two integrations of the truth; a scalar
    # the damped top over time at the finest step; top_sample
    TOP_TIME, THETA, TRUE_THETA = "top_time", "theta", "true_theta"  # s, rad, rad
    P_PHI, P_PSI = "p_phi", "p_psi"
    BALANCE_PHI, BALANCE_PSI = "balance_phi", "balance_psi"  # relative to the larger momentum
    TOP_ENERGY, TOP_ENERGY_ERROR = "energy_top", "energy_top_error"  # absolute, relative


def scene_name(damping: float) -> str:
    """The name of an oscillator in the dataset."""
    return f"damping-{damping:g}"


def dampings(data: xr.Dataset) -> dict[str, float]:
    """The oscillators in a dataset: damping by name."""
    names = [str(name) for name in data["scene"].values]
    return {name: float(name.partition("-")[2]) for name in names if name.startswith("damping-")}


def tops(data: xr.Dataset) -> list[str]:
    """Names of the damped tops in a dataset."""
    return [str(name) for name in data["scene"].values if str(name) not in dampings(data)]


def order(data: xr.Dataset, scene: str, method: str, error: str, step: str) -> Fit:
    """Slope of an error against the step, over the steps that are small enough and the errors above rounding."""
    cell = data.sel(scene=scene, integrator=method)
    steps, errors = cell[step].values, cell[error].values
    return power_law(steps, errors, (steps < ASYMPTOTIC[step]) & (errors > LEAST_JUDGED))


def sums_of(method: str) -> Sums:
    """The rule behind the name of a method of this study."""
    return rule_sums("midpoint", left_force=1.0) if method == ONE_SIDED else rule_sums(method)


def convergence(damping: float, method: str, steps: Sequence[float], horizon: float) -> xr.Dataset:
    """Largest error of the position and relative error of the slow exponent; dimension ``setting``."""
    oscillator, rule = Oscillator(damping=damping), sums_of(method)
    slow = oscillator.exponents()[0]
    columns: dict[str, list[float]] = {Column.STEP: [], Column.POSITION_ERROR: [], Column.EXPONENT_ERROR: []}
    for count in step_counts(horizon, steps):
        path = discrete_path(oscillator, rule, *RELEASED, horizon, count)
        true, _ = oscillator.exact(path.times, *RELEASED)
        columns[Column.STEP].append(path.step_size)
        columns[Column.POSITION_ERROR].append(float(np.max(np.abs(path.position - true))))
        discrete = discrete_exponents(oscillator, rule, path.step_size)[0]
        columns[Column.EXPONENT_ERROR].append(abs(discrete - slow) / abs(slow))
    return xr.Dataset({name: ("setting", values) for name, values in columns.items()})


def decay(damping: float, method: str, step: float, horizon: float) -> xr.Dataset:
    """Relative error of the energy over a long horizon, at one force evaluation a step; dimension ``sample``.

    ``rk45`` gets the tightest tolerance with which it needs no more evaluations.
    """
    oscillator, count = Oscillator(damping=damping), step_counts(horizon, [step])[0]
    if method == RK45:
        times, error, evaluations = _rk45_at_cost(oscillator, count, horizon)
    else:
        path = discrete_path(oscillator, sums_of(method), *RELEASED, horizon, count, SAMPLES)
        times, error, evaluations = path.times, relative_energy_error(oscillator, path, *RELEASED), count
    return xr.Dataset(
        {
            Column.TIME: ("sample", times),
            Column.ENERGY_ERROR: ("sample", error),
            Column.EVALUATIONS: float(evaluations),
        }
    )


def _rk45_at_cost(oscillator: Oscillator, evaluations: int, horizon: float) -> tuple[Array, Array, int]:
    """SciPy's RK45 with the tightest relative tolerance that takes at most `evaluations`, found by bisection."""
    from scipy.integrate import solve_ivp  # 0.6 s to import

    m, b, k = oscillator.mass, oscillator.damping, oscillator.stiffness
    times = np.linspace(0.0, horizon, SAMPLES)

    def run(exponent: float) -> Any:
        # the absolute tolerance lies far below the relative one, so that a motion that dies out stays resolved
        return solve_ivp(
            lambda _, y: (y[1] / m, -k * y[0] - b * y[1] / m), (0.0, horizon), (RELEASED[0], m * RELEASED[1]),
            rtol=10.0**exponent, atol=1e-8 * 10.0**exponent, t_eval=times,
        )  # fmt: skip

    low, high = -12.0, -1.0
    for _ in range(9):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if run(middle).nfev > evaluations else (low, middle)
    done = run(high)
    x, v = oscillator.exact(times, *RELEASED)
    error = oscillator.energy(done.y[0], done.y[1]) / oscillator.energy(x, m * v) - 1.0
    return times, error, int(done.nfev)


def notebook_history(damping: float, h: float, horizon: float) -> xr.Dataset:
    """The notebook's experiment: analytic, its update, ours from the same two positions, and its guess at the forces.

    Dimension ``seed_step``. The notebook starts on the slow mode, x = Re exp(lambda t), from two exact positions.
    """
    oscillator, count = Oscillator(damping=damping), step_counts(horizon, [h])[0]
    times = np.arange(count + 1) * h
    true, _ = oscillator.exact(times, 1.0, oscillator.exponents()[0].real)
    first, second = float(true[0]), float(true[1])
    momentum = start_momentum(oscillator, rule_sums("midpoint"), first, second, h)
    ours = discrete_path(oscillator, "midpoint", first, momentum, count * h, count, count + 1).position
    update = notebook_update(damping, h, first, second, count)
    columns = {
        Column.NOTEBOOK_TIME: times,
        Column.ANALYTIC: true,
        Column.NOTEBOOK_UPDATE: update,
        Column.UPDATE_GAP: np.abs(update - ours),
        Column.NOTEBOOK_GUESS: notebook_guess(damping, h, first, second, count),
    }
    return xr.Dataset({name: ("seed_step", values) for name, values in columns.items()})


def damped_top_table(
    scene: Scene, friction: Friction, method: str, counts: Sequence[int], horizon: float
) -> xr.Dataset:
    """Errors of theta at several numbers of steps, multiples of the first; energy, momenta and their balance in time.

    Dimensions ``top_setting`` and ``top_sample``; the histories are those of the finest step. ``balance_phi`` and
    ``balance_psi`` are p(t) - p(0) + c (angle(t) - angle(0)) relative to the larger momentum, zero for the true motion.
    ``rk45`` has no steps: it runs once, at the tolerance 1e-6.
    """
    share = np.unique(np.rint(np.linspace(0.0, counts[0], min(SAMPLES, counts[0] + 1))).astype(np.int64))
    times = share.astype(np.float64) * (horizon / counts[0])
    truth = damped_truth(scene, friction, times)
    columns: dict[str, Any] = {Column.TOP_BOUND: truth.bound}
    if method == RK45:
        done = integrate(damped_rates(scene, friction), start_of(scene), times, "RK45", TOP_TOLERANCE)
        theta, phi, psi, *rates = done.y
        spin = scene.top.I3 * (rates[2] + rates[1] * np.cos(theta))
        p_phi = scene.top.I1 * rates[1] * np.sin(theta) ** 2 + spin * np.cos(theta)
        history = _history(scene, friction, np.array([theta, phi, psi, p_phi, spin]))
        history[Column.TOP_ENERGY] = energy(scene, theta, *rates)
    else:
        theta_errors = []
        for count in counts:
            marks = share * (count // counts[0])
            run = damped_run(scene.top, scene.start, friction, method, horizon / count, marks)
            theta_errors.append(float(np.max(np.abs(run.states[:, 0] - truth.theta))))
        states = run.states.T
        columns[Column.TOP_STEP] = ("top_setting", [horizon / count for count in counts])
        columns[Column.THETA_ERROR] = ("top_setting", theta_errors)
        history = _history(scene, friction, states[[0, 1, 2, 4, 5]])
        history[Column.TOP_ENERGY] = scene.top.reduced_energy(states[0], states[3], states[4], states[5])
    history |= {Column.TOP_TIME: times, Column.THETA: history.pop(Column.THETA), Column.TRUE_THETA: truth.theta}
    history[Column.TOP_ENERGY_ERROR] = np.abs(history[Column.TOP_ENERGY] - truth.energy) / scene.energy_scale
    return xr.Dataset(columns | {name: ("top_sample", values) for name, values in history.items()})


def _history(scene: Scene, friction: Friction, states: Array) -> dict[str, Array]:
    """Momenta and their balance from (theta, phi, psi, p_phi, p_psi)."""
    theta, phi, psi, p_phi, p_psi = states
    scale = scene.momentum_scale
    return {
        Column.THETA: theta,
        Column.P_PHI: p_phi,
        Column.P_PSI: p_psi,
        Column.BALANCE_PHI: (p_phi - p_phi[0] + friction.precession * (phi - phi[0])) / scale,
        Column.BALANCE_PSI: (p_psi - p_psi[0] + friction.spin * (psi - psi[0])) / scale,
    }
