"""The motion of the damped top, which has no closed form: two integrations of different equations.

One integrates the six Euler-Lagrange equations with friction, the other the four equations that remain when both
momenta are eliminated by their balance, p = p0 - c (angle - angle0). Both run DOP853 at tolerance 1e-13; their largest
distance in any angle says how well the motion is known.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from symtop.base.validate import SymtopError
from symtop.methods.euler_lagrange import accelerations
from symtop.model.charts import Array
from symtop.model.scenes import Scene

from .damped_top import Friction

TIGHT = 1e-13


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


def integrate(rates: Any, start: Sequence[float], times: Array, solver: str, tolerance: float) -> Any:
    """SciPy's solution of y' = rates(t, y) at the given times; absolute and relative tolerance are the same."""
    from scipy.integrate import solve_ivp  # 0.6 s to import

    return solve_ivp(rates, (0.0, float(times[-1])), start, method=solver, rtol=tolerance, atol=tolerance, t_eval=times)


def start_of(scene: Scene) -> tuple[float, ...]:
    """The start as (theta, phi, psi, theta', phi', psi')."""
    at = scene.start
    return at.theta, at.phi, at.psi, at.theta_dot, at.phi_dot, at.psi_dot


def damped_truth(scene: Scene, friction: Friction, times: Array) -> DampedTruth:
    """Two integrations at 1e-13, of six equations and of four; SymtopError if either ends early."""
    at = scene.start
    first = integrate(damped_rates(scene, friction), start_of(scene), times, "DOP853", TIGHT)
    reduced = (at.theta, at.phi, at.psi, scene.top.I1 * at.theta_dot)
    second = integrate(_balanced_rates(scene, friction), reduced, times, "DOP853", TIGHT)
    if not (first.success and second.success):
        raise SymtopError(
            f"the damped {scene.name} cannot be integrated to t = {times[-1]:g}: {first.message} {second.message}"
        )
    bound = float(np.max(np.abs(first.y[:3] - second.y[:3])))
    theta, phi, psi, *rates = first.y
    return DampedTruth(theta, phi, psi, energy(scene, theta, *rates), bound)


def energy(scene: Scene, theta: Array, theta_dot: Array, phi_dot: Array, psi_dot: Array) -> Array:
    """Energy of states in angles and rates."""
    top = scene.top
    spin = psi_dot + phi_dot * np.cos(theta)
    across = theta_dot**2 + (phi_dot * np.sin(theta)) ** 2
    values: Array = 0.5 * top.I1 * across + 0.5 * top.I3 * spin**2 + top.mgl * np.cos(theta)
    return values
