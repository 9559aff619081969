"""Does discretising commute with reducing? The two orders of doing both, side by side.

Discretise, then reduce: the discrete Lagrangian of the whole top with phi and psi eliminated afterwards, which is what
the registry steps. Reduce, then discretise: eliminate phi and psi from the *continuous* problem first. That leaves one
degree of freedom with the Routhian R = I1 theta'^2/2 - V(theta; p_phi, p_psi), whose discrete Lagrangian with nodes a_i
and weights w_i is the step

    p0 = I1 d/h + h sum w_i (1-a_i) V'(theta0 + a_i d),      p1 = p0 - h sum w_i V'(theta0 + a_i d)

A one-node rule evaluates L at one point, where phi' and psi' follow from the momenta as in the continuous problem: the
two orders agree, and the midpoint rule is moreover the implicit midpoint rule on H(theta, p_theta) = p_theta^2/2I1 + V.
With several nodes the single mean rate dphi/h has to serve nodes that each want their own, the two orders differ
by O(h^2), and reducing first turns the trapezoidal rule into Stormer-Verlet, which is explicit. The Galerkin
integrator of order 4 does not commute either (its rates are linear in time, the reduced ones are not): it differs by
O(h^4). Source: Jalnapurkar, Leok, Marsden, West, Discrete Routh reduction, J. Phys. A 39 (2006) 5521.

The steps that reduce first are plain Python, run for a few thousand steps, and no integrators of the registry. Which
one belongs to an integrator follows from the kernel and the rule inside its solver, not from its name.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from symtop.base.validate import SymtopError
from symtop.methods.discrete_lagrangian import Quadrature, rule_of
from symtop.methods.galerkin import is_galerkin
from symtop.methods.registry import Integrator, Plan
from symtop.model.charts import Array
from symtop.model.scenes import Scene

NEWTON = 60  # iterations; a handful is used
Step = Callable[[float, float, float], tuple[float, float]]


class Gap(NamedTuple):
    """Largest distance between two ways to step the nutation over one run."""

    theta: float  # rad
    p_theta: float


def routhian_step(scene: Scene, rule: Quadrature) -> Step:
    """(theta, p_theta, h) -> increments by the discrete Lagrangian of the Routhian of a scene."""
    top, momenta = scene.top, scene.top.momenta(scene.start)
    a, w = np.array(rule.nodes), np.array(rule.weights)

    def step(theta: float, p_theta: float, h: float) -> tuple[float, float]:
        flight, scale = h * p_theta / top.I1, h * h / top.I1

        def defect(d: float) -> float:
            return flight - d - scale * float(np.sum(w * (1.0 - a) * top.potential_slope(theta + a * d, momenta)))

        def tangent(d: float) -> float:
            curvature = top.potential_curvature(theta + a * d, momenta)
            return 1.0 + scale * float(np.sum(w * (1.0 - a) * a * curvature))

        d = _newton(defect, tangent, flight)
        return d, -h * float(np.sum(w * top.potential_slope(theta + a * d, momenta)))

    return step


def routhian_galerkin_step(scene: Scene) -> Step:
    """(theta, p_theta, h) -> increments by the parabola and Simpson's rule on the Routhian of a scene.

    The mass of theta is constant, so that this is Lobatto IIIA-IIIB of order 4, and one scalar equation remains:
    m + (h^2/24 I1) V'(theta + m) = h p_theta/2 I1 - (h^2/12 I1) V'(theta) with m = theta_m - theta.
    """
    top, momenta = scene.top, scene.top.momenta(scene.start)

    def step(theta: float, p_theta: float, h: float) -> tuple[float, float]:
        flight, scale = h * p_theta / top.I1, h * h / top.I1

        def slope(shift: float) -> float:
            return float(top.potential_slope(theta + shift, momenta))

        def defect(m: float) -> float:
            return 0.5 * flight - scale * (2.0 * V0 + slope(m)) / 24.0 - m

        def tangent(m: float) -> float:
            return 1.0 + scale / 24.0 * float(top.potential_curvature(theta + m, momenta))

        V0 = slope(0.0)
        Vm = slope(_newton(defect, tangent, 0.5 * flight))
        d = flight - scale * (V0 + 2.0 * Vm) / 6.0
        return d, -h * (V0 + 4.0 * Vm + slope(d)) / 6.0

    return step


def reduced_first(scene: Scene, method: Integrator) -> Step | None:
    """The step that comes of reducing before discretising as this integrator does; None if it is not known."""
    if is_galerkin(method):
        return routhian_galerkin_step(scene)
    rule = rule_of(method)
    return None if rule is None else routhian_step(scene, rule)


def implicit_midpoint_step(scene: Scene) -> Step:
    """(theta, p_theta, h) -> increments by the implicit midpoint rule on the reduced Hamiltonian.

    The unknown is the change of p_theta over half a step, k = -(h/2) V'(theta + (h/2) (p_theta + k)/I1).
    """
    top, momenta = scene.top, scene.top.momenta(scene.start)

    def step(theta: float, p_theta: float, h: float) -> tuple[float, float]:
        def middle(k: float) -> float:
            return theta + 0.5 * h * (p_theta + k) / top.I1

        def defect(k: float) -> float:
            return -0.5 * h * float(top.potential_slope(middle(k), momenta)) - k

        def tangent(k: float) -> float:
            return 1.0 + 0.25 * h * h / top.I1 * float(top.potential_curvature(middle(k), momenta))

        k = _newton(defect, tangent, 0.0)
        return h * (p_theta + k) / top.I1, 2.0 * k

    return step


def _newton(defect: Callable[[float], float], tangent: Callable[[float], float], guess: float) -> float:
    """The root of `defect`, iterated until the corrections no longer shrink; `tangent` is minus its slope."""
    x, last = guess, np.inf
    for _ in range(NEWTON):
        correction = defect(x) / tangent(x)
        x += correction
        if correction == 0.0 or (abs(correction) >= 0.5 * last and abs(correction) < 1e-8 * (1.0 + abs(x))):
            break
        last = abs(correction)
    return x


def path(scene: Scene, step: Step, h: float, steps: int) -> Array:
    """theta and p_theta of a scene after 0, 1, ... `steps` steps, shape (steps + 1, 2)."""
    states = np.empty((steps + 1, 2))
    states[0] = scene.start.theta, scene.top.I1 * scene.start.theta_dot
    low = np.zeros(2)
    for k in range(steps):
        # the kernels sum their increments with compensation: a plain sum here would be the larger difference
        addend = np.array(step(states[k, 0], states[k, 1], h)) + low
        states[k + 1] = states[k] + addend
        low = addend - (states[k + 1] - states[k])
    return states


def kernel_path(scene: Scene, method: Integrator, h: float, steps: int) -> Array:
    """The same of a fixed-step integrator in the angles chart."""
    return method.solvers["angles"](scene.top, scene.start, Plan.steps(h, np.arange(steps + 1))).states[:, :2]


def gap(first: Array, second: Array) -> Gap:
    """The largest differences of two paths."""
    apart = np.max(np.abs(first - second), axis=0)
    return Gap(float(apart[0]), float(apart[1]))


def commutation_gap(scene: Scene, method: Integrator, h: float, steps: int) -> Gap:
    """Distance between reducing first and discretising first, for a discrete Lagrangian.

    SymtopError for an integrator that is not one of `discrete_lagrangian` or `galerkin`.
    """
    step = reduced_first(scene, method)
    if step is None:
        raise SymtopError(f"method must be a reduced discrete Lagrangian, not {method.name!r}")
    return gap(path(scene, step, h, steps), kernel_path(scene, method, h, steps))


def hamiltonian_gap(scene: Scene, method: Integrator, h: float, steps: int) -> Gap:
    """Distance between the midpoint discrete Lagrangian and the implicit midpoint rule on (theta, p_theta)."""
    return gap(path(scene, implicit_midpoint_step(scene), h, steps), kernel_path(scene, method, h, steps))
