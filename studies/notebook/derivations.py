"""The notebook's two derivations of the equations of motion, its two energies and its cubic, in its own form.

"The hard way" integrates the second-order Euler-Lagrange equations in (phi, theta, psi) unchanged. "The easy way"
eliminates both momenta: with a = p_psi/I1, b = p_phi/I1 and beta = 2 mgl/I1,

    phi' = (b - a cos theta)/sin^2 theta,     psi' = a I1/I3 - phi' cos theta
    theta'' = (a^2 + b^2) cos theta/sin^3 theta - a b (3 + cos 2 theta)/(2 sin^3 theta) + (beta/2) sin theta

The second energy is E1 = I1 (theta'^2 + ((b - a cos theta)/sin theta)^2)/2 + mgl cos theta = E - p_psi^2/2 I3, and the
cubic of the nutation is u'^2 = (1 - u^2)(alpha - beta u) - (b - a u)^2 with u = cos theta and alpha = 2 E1/I1.
"""

import dataclasses
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from symtop.core.errors import SymtopError
from symtop.model.charts import Array
from symtop.model.scenes import Scene
from symtop.model.top import SymmetricTop

Rates = Callable[[float, Any], Any]


def six_variables(scene: Scene) -> tuple[float, ...]:
    """The start as (phi, theta, psi, phi', theta', psi')."""
    start = scene.start
    return start.phi, start.theta, start.psi, start.phi_dot, start.theta_dot, start.psi_dot


def hard_way(scene: Scene) -> Rates:
    """y' for y = (phi, theta, psi, phi', theta', psi'): the notebook's three equations, a linear system for q''."""
    I1, I3, mgl = scene.top.I1, scene.top.I3, scene.top.mgl

    def rates(_: float, y: Any) -> Any:
        theta, phi_dot, theta_dot, psi_dot = y[1], y[3], y[4], y[5]
        s, c = math.sin(theta), math.cos(theta)
        mass = np.array([[I1 * s * s + I3 * c * c, 0.0, I3 * c], [0.0, I1, 0.0], [I3 * c, 0.0, I3]])
        force = np.array([
            -s * theta_dot * (2.0 * (I1 - I3) * c * phi_dot - I3 * psi_dot),
            s * ((I1 - I3) * c * phi_dot**2 - I3 * phi_dot * psi_dot + mgl),
            I3 * s * theta_dot * phi_dot,
        ])  # fmt: skip
        return np.concatenate([y[3:], np.linalg.solve(mass, force)])

    return rates


def easy_way(scene: Scene) -> Rates:
    """y' for y = (phi, theta, psi, theta'): two first-order equations and one of second order, in a, b and beta."""
    top = scene.top
    momenta = top.momenta(scene.start)
    a, b, beta = momenta.p_psi / top.I1, momenta.p_phi / top.I1, 2.0 * top.mgl / top.I1

    def rates(_: float, y: Any) -> Any:
        s, c = math.sin(y[1]), math.cos(y[1])
        turn = (b - a * c) / (s * s)
        bend = (a * a + b * b) * c / s**3 - 0.5 * a * b * (3.0 + math.cos(2.0 * y[1])) / s**3 + 0.5 * beta * s
        return np.array([turn, y[3], a * top.I1 / top.I3 - turn * c, bend])

    return rates


def energies(scene: Scene, states: Array) -> tuple[Array, Array, Array]:
    """E, E1 and p_psi^2/2 I3 of states (phi, theta, psi, phi', theta', psi'), each from its own formula."""
    top = scene.top
    _, theta, _, phi_dot, theta_dot, psi_dot = states
    s, c = np.sin(theta), np.cos(theta)
    spin = psi_dot + phi_dot * c
    E = 0.5 * top.I1 * (theta_dot**2 + (phi_dot * s) ** 2) + 0.5 * top.I3 * spin**2 + top.mgl * c
    p_psi = top.I3 * spin
    p_phi = top.I1 * phi_dot * s * s + p_psi * c
    E1 = 0.5 * top.I1 * (theta_dot**2 + ((p_phi - p_psi * c) / (top.I1 * s)) ** 2) + top.mgl * c
    return E, E1, 0.5 * p_psi**2 / top.I3


class Cubic(NamedTuple):
    """The nutation cubic of a start: u'^2 = (1 - u^2)(alpha - beta u) - (b - a u)^2."""

    alpha: float
    beta: float
    a: float
    b: float

    def __call__(self, u: Any) -> Any:
        """u'^2 at the given cosines."""
        return (1.0 - u * u) * (self.alpha - self.beta * u) - (self.b - self.a * u) ** 2


def nutation_cubic(scene: Scene) -> Cubic:
    """alpha, beta, a, b of a scene's own start."""
    top, start = scene.top, scene.start
    momenta, beta = top.momenta(start), 2.0 * top.mgl / top.I1
    alpha = start.theta_dot**2 + (start.phi_dot * math.sin(start.theta)) ** 2 + beta * math.cos(start.theta)
    return Cubic(alpha, beta, momenta.p_psi / top.I1, momenta.p_phi / top.I1)


def with_alpha(scene: Scene, alpha: float, sign: float) -> Scene:
    """The scene with the rate theta', of that sign, that gives it this alpha; SymtopError if there is none."""
    u = math.cos(scene.start.theta)
    square = float(nutation_cubic(scene)._replace(alpha=alpha)(u)) / (1.0 - u * u)
    if square < 0.0:
        raise SymtopError(f"alpha = {alpha!r} is less energy than {scene.name} has at rest")
    rate = math.copysign(math.sqrt(square), sign)
    return dataclasses.replace(scene, start=dataclasses.replace(scene.start, theta_dot=rate))


def notebook_top() -> tuple[SymmetricTop, tuple[float, float]]:
    """The first top from the notebook's spheroid, and the radii that its inertia gives back."""
    top = SymmetricTop.from_spheroid(1.0, *SymmetricTop(2.0, 1.0, 0.0).spheroid_radii(1.0), 9.81)
    return top, top.spheroid_radii(1.0)
