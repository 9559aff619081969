"""What forced discrete Euler-Lagrange equations do to a damped oscillator and to a damped top.

The oscillator (m = k = 1, released from x = 1 at rest) has an analytic solution; the damped top has none, and its truth
is one integration by DOP853 at 1e-13 of the six Euler-Lagrange equations with friction, checked against another one of
the four equations that remain when both momenta are eliminated by their balance, p = p0 - c (angle - angle0).
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from symtop.base.validate import SymtopError
from symtop.measure.errors import energy_scale, momentum_scale
from symtop.methods.euler_lagrange import accelerations
from symtop.model.scenes import Scene

from .forced import Friction, damped_run
from .oscillator import (
    Array,
    Oscillator,
    Sums,
    discrete_exponents,
    discrete_path,
    relative_energy_error,
    rule_sums,
    seed_guess,
    seed_update,
    start_momentum,
    step_counts,
)

ONE_SIDED = "force-at-one-end"  # the midpoint rule with the whole force in F_d^-, a negative control of order 1
RELEASED = (1.0, 0.0)
SAMPLES = 401
TIGHT = 1e-13


def sums_of(method: str) -> Sums:
    """The rule behind the name of a method of this study."""
    return rule_sums("midpoint", left_force=1.0) if method == ONE_SIDED else rule_sums(method)


def convergence(damping: float, method: str, steps: Sequence[float], horizon: float) -> xr.Dataset:
    """Largest error of the position and relative error of the slow exponent; dimension ``setting``."""
    oscillator, rule = Oscillator(damping=damping), sums_of(method)
    slow = oscillator.exponents()[0]
    found: dict[str, list[float]] = {"step_size": [], "position_error": [], "exponent_error": []}
    for count in step_counts(horizon, steps):
        path = discrete_path(oscillator, rule, *RELEASED, horizon, count)
        true, _ = oscillator.exact(path.times, *RELEASED)
        found["step_size"].append(path.step_size)
        found["position_error"].append(float(np.max(np.abs(path.position - true))))
        found["exponent_error"].append(abs(discrete_exponents(oscillator, rule, path.step_size)[0] - slow) / abs(slow))
    return xr.Dataset({name: ("setting", values) for name, values in found.items()})


def decay(damping: float, method: str, step: float, horizon: float) -> xr.Dataset:
    """Relative error of the energy over a long horizon, at one force evaluation a step; dimension ``sample``.

    ``rk45`` gets the tolerance with which it needs as many evaluations.
    """
    oscillator, count = Oscillator(damping=damping), step_counts(horizon, [step])[0]
    if method == "rk45":
        times, error, evaluations = _rk45_at_cost(oscillator, count, horizon)
    else:
        path = discrete_path(oscillator, sums_of(method), *RELEASED, horizon, count, SAMPLES)
        times, error, evaluations = path.times, relative_energy_error(oscillator, path, *RELEASED), count
    return xr.Dataset(
        {"sample_time": ("sample", times), "energy_error": ("sample", error), "evaluations": float(evaluations)}
    )


def _rk45_at_cost(oscillator: Oscillator, evaluations: int, horizon: float) -> tuple[Array, Array, int]:
    """SciPy's RK45 with the relative tolerance whose cost is nearest to `evaluations`, found by bisection."""
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


def seed_history(damping: float, h: float, horizon: float) -> xr.Dataset:
    """The notebook's experiment: analytic, its update, ours from the same two positions, and its guess at the forces.

    Dimension ``seed_step``. The notebook starts on the slow mode, x = Re exp(lambda t), from two exact positions.
    """
    oscillator, count = Oscillator(damping=damping), step_counts(horizon, [h])[0]
    times = np.arange(count + 1) * h
    true, _ = oscillator.exact(times, 1.0, oscillator.exponents()[0].real)
    first, second = float(true[0]), float(true[1])
    momentum = start_momentum(oscillator, rule_sums("midpoint"), first, second, h)
    ours = discrete_path(oscillator, "midpoint", first, momentum, count * h, count, count + 1).position
    update = seed_update(damping, h, first, second, count)
    columns = {
        "seed_time": times,
        "analytic": true,
        "seed_update": update,
        "update_gap": np.abs(update - ours),
        "seed_guess": seed_guess(damping, h, first, second, count),
    }
    return xr.Dataset({name: ("seed_step", values) for name, values in columns.items()})


class DampedTruth(NamedTuple):
    """The damped top's motion at given times, and how well it is known."""

    theta: Array
    phi: Array
    psi: Array
    energy: Array
    bound: float  # rad: largest distance of the two integrations in any angle


def damped_rates(scene: Scene, friction: Friction) -> Callable[[float, Any], tuple[float, ...]]:
    """y' for y = (theta, phi, psi, theta', phi', psi') with friction: M q'' gains (0, -c_phi phi', -c_psi psi')."""
    top = scene.top

    def rates(_: float, y: Any) -> tuple[float, ...]:
        theta, _phi, _psi, theta_dot, phi_dot, psi_dot = y
        nod, swing, spin = accelerations(top.I1, top.I3, top.mgl, theta, theta_dot, phi_dot, psi_dot)
        s, c = math.sin(theta), math.cos(theta)
        torque = -friction.spin * psi_dot
        turn = (-friction.precession * phi_dot - c * torque) / (top.I1 * s * s)
        return theta_dot, phi_dot, psi_dot, nod, swing + turn, spin + torque / top.I3 - c * turn

    return rates


def _balanced_rates(scene: Scene, friction: Friction) -> Callable[[float, Any], tuple[float, ...]]:
    """y' for y = (theta, phi, psi, p_theta), the momenta eliminated by their balance."""
    top, start = scene.top, scene.start
    momenta = top.momenta(start)

    def rates(_: float, y: Any) -> tuple[float, ...]:
        theta, phi, psi, p_theta = y
        p_phi = momenta.p_phi - friction.precession * (phi - start.phi)
        p_psi = momenta.p_psi - friction.spin * (psi - start.psi)
        s, c = math.sin(theta), math.cos(theta)
        turn = (p_phi - p_psi * c) / (top.I1 * s * s)
        return p_theta / top.I1, turn, p_psi / top.I3 - turn * c, s * (turn * (top.I1 * turn * c - p_psi) + top.mgl)

    return rates


def _integrate(rates: Any, start: Sequence[float], times: Array, solver: str, tolerance: float) -> Any:
    from scipy.integrate import solve_ivp  # 0.6 s to import

    return solve_ivp(rates, (0.0, float(times[-1])), start, method=solver, rtol=tolerance, atol=tolerance, t_eval=times)


def _rates_of(scene: Scene) -> tuple[float, ...]:
    at = scene.start
    return at.theta, at.phi, at.psi, at.theta_dot, at.phi_dot, at.psi_dot


def damped_truth(scene: Scene, friction: Friction, times: Array) -> DampedTruth:
    """Two integrations at 1e-13, of six equations and of four; SymtopError if either ends early."""
    at = scene.start
    first = _integrate(damped_rates(scene, friction), _rates_of(scene), times, "DOP853", TIGHT)
    reduced = (at.theta, at.phi, at.psi, scene.top.I1 * at.theta_dot)
    second = _integrate(_balanced_rates(scene, friction), reduced, times, "DOP853", TIGHT)
    if not (first.success and second.success):
        raise SymtopError(
            f"the damped {scene.name} cannot be integrated to t = {times[-1]:g}: {first.message} {second.message}"
        )
    bound = float(np.max(np.abs(first.y[:3] - second.y[:3])))
    theta, phi, psi, *rates = first.y
    return DampedTruth(theta, phi, psi, _energy(scene, theta, *rates), bound)


def _energy(scene: Scene, theta: Array, theta_dot: Array, phi_dot: Array, psi_dot: Array) -> Array:
    top = scene.top
    spin = psi_dot + phi_dot * np.cos(theta)
    across = theta_dot**2 + (phi_dot * np.sin(theta)) ** 2
    found: Array = 0.5 * top.I1 * across + 0.5 * top.I3 * spin**2 + top.mgl * np.cos(theta)
    return found


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
    found: dict[str, Any] = {"top_bound": truth.bound}
    if method == "rk45":
        done = _integrate(damped_rates(scene, friction), _rates_of(scene), times, "RK45", 1e-6)
        theta, phi, psi, *rates = done.y
        spin = scene.top.I3 * (rates[2] + rates[1] * np.cos(theta))
        p_phi = scene.top.I1 * rates[1] * np.sin(theta) ** 2 + spin * np.cos(theta)
        history = _history(scene, friction, np.array([theta, phi, psi, p_phi, spin]))
        history["energy_top"] = _energy(scene, theta, *rates)
    else:
        theta_errors = []
        for count in counts:
            marks = share * (count // counts[0])
            run = damped_run(scene.top, scene.start, friction, method, horizon / count, marks)
            theta_errors.append(float(np.max(np.abs(run.states[:, 0] - truth.theta))))
        states = run.states.T
        found["top_step_size"] = ("top_setting", [horizon / count for count in counts])
        found["theta_error"] = ("top_setting", theta_errors)
        history = _history(scene, friction, states[[0, 1, 2, 4, 5]])
        history["energy_top"] = scene.top.reduced_energy(states[0], states[3], states[4], states[5])
    history |= {"top_time": times, "theta": history.pop("theta"), "true_theta": truth.theta}
    history["energy_top_error"] = np.abs(history["energy_top"] - truth.energy) / energy_scale(scene)
    return xr.Dataset(found | {name: ("top_sample", values) for name, values in history.items()})


def _history(scene: Scene, friction: Friction, states: Array) -> dict[str, Array]:
    """Momenta and their balance from (theta, phi, psi, p_phi, p_psi)."""
    theta, phi, psi, p_phi, p_psi = states
    scale = momentum_scale(scene)
    return {
        "theta": theta,
        "p_phi": p_phi,
        "p_psi": p_psi,
        "balance_phi": (p_phi - p_phi[0] + friction.precession * (phi - phi[0])) / scale,
        "balance_psi": (p_psi - p_psi[0] + friction.spin * (psi - psi[0])) / scale,
    }
