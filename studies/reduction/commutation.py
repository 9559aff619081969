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

import numpy as np

from symtop.methods.framework.loop import inside
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import Integrator
from symtop.methods.lagrangian import galerkin
from symtop.methods.lagrangian.discrete_lagrangian import Quadrature, rule_of
from symtop.model.charts import Array
from symtop.model.scenes import Scene

TOLERANCE = 1e-10  # rad, of Newton's last correction: the next one would be its square
Step = Callable[[float, float, float], tuple[float, float]]  # (theta, p_theta, h) -> increments of theta and p_theta


def solved(defect: Callable[[float], float], near: float, slope: Callable[[float], float]) -> float:
    """The zero of a function next to a guess, by Newton's iteration."""
    from scipy.optimize import newton  # takes 0.3 s, which a study with nothing to do need not

    return float(newton(defect, near, slope, tol=TOLERANCE))


def routhian_step(scene: Scene, rule: Quadrature) -> Step:
    """The discrete Lagrangian of the Routhian of a scene."""
    top, momenta = scene.top, scene.top.momenta(scene.start)
    a, w = np.array(rule.nodes), np.array(rule.weights)

    def step(theta: float, p_theta: float, h: float) -> tuple[float, float]:
        flight, scale = h * p_theta / top.I1, h * h / top.I1

        def defect(d: float) -> float:
            return flight - d - scale * float(np.sum(w * (1.0 - a) * top.potential_slope(theta + a * d, momenta)))

        def slope(d: float) -> float:
            curvature = top.potential_curvature(theta + a * d, momenta)
            return -1.0 - scale * float(np.sum(w * (1.0 - a) * a * curvature))

        d = solved(defect, flight, slope)
        return d, -h * float(np.sum(w * top.potential_slope(theta + a * d, momenta)))

    return step


def routhian_galerkin_step(scene: Scene) -> Step:
    """The parabola and Simpson's rule on the Routhian of a scene.

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
            return -1.0 - scale / 24.0 * float(top.potential_curvature(theta + m, momenta))

        V0 = slope(0.0)
        Vm = slope(solved(defect, 0.5 * flight, tangent))
        d = flight - scale * (V0 + 2.0 * Vm) / 6.0
        return d, -h * (V0 + 4.0 * Vm + slope(d)) / 6.0

    return step


def is_galerkin(method: Integrator) -> bool:
    """Is it the kernel of `galerkin-simpson`, under any name?"""
    solver = inside(method.solvers.get("angles"))
    return solver is not None and solver.loop is galerkin.march


def reduced_first(scene: Scene, method: Integrator) -> Step | None:
    """The step of this integrator's discretisation applied after reduction; None if it is not known."""
    if is_galerkin(method):
        return routhian_galerkin_step(scene)
    rule = rule_of(method)
    return None if rule is None else routhian_step(scene, rule)


def path(scene: Scene, step: Step, h: float, steps: int) -> Array:
    """theta and p_theta of a scene after 0, 1, ... `steps` steps, shape (steps + 1, 2)."""
    states, low = np.empty((steps + 1, 2)), np.zeros(2)
    states[0] = scene.start.theta, scene.top.I1 * scene.start.theta_dot
    for k in range(steps):  # compensated sums as in the kernels: rounding of plain sums would exceed the difference
        addend = np.array(step(*states[k], h)) + low
        states[k + 1] = states[k] + addend
        low = addend - (states[k + 1] - states[k])
    return states


def kernel_path(scene: Scene, method: Integrator, h: float, steps: int) -> Array:
    """`path` of a fixed-step integrator in the angles chart."""
    plan = Plan.steps(h, np.arange(steps + 1))
    return method.solvers["angles"](scene.top, scene.start, plan).states[:, :2]


def gap(scene: Scene, step: Step, method: Integrator, h: float, steps: int) -> float:
    """Largest difference in theta (rad) over one run between a step on the reduced problem and an integrator."""
    return float(np.max(np.abs(path(scene, step, h, steps) - kernel_path(scene, method, h, steps))[:, 0]))
