"""Exponents of the damped oscillator's discrete motion, and the damped top's reference motion.

The reference of the damped top is a pair of integrations by DOP853 at tolerance 1e-13. One has the six Euler-Lagrange
equations, the other the four of `symtop.methods.lagrangian.damped_top`.
"""

import cmath
import math
from typing import Any

import numpy as np

from symtop.methods.framework.angles import accelerations, with_rates
from symtop.methods.lagrangian.damped_oscillator import Oscillator, Sums, legendre
from symtop.methods.lagrangian.damped_top import Friction, Rates, four_equations
from symtop.methods.library.scipy_ivp import integrated
from symtop.model.charts import Array
from symtop.model.scenes import Scene


def discrete_exponents(oscillator: Oscillator, rule: Sums, h: float) -> tuple[complex, complex]:
    """log(z)/h of the two eigenvalues z of the step map, the slower decay first: the exponents of the discrete motion.

    In positions alone the step reads A q2 - B q1 + C q0 = 0 with A - C = b, whatever the rule, and the discriminant
    B^2 - 4 A C = (b + h k (r-l))^2 - 4 m k + 4 (h k)^2 (s - r^2) + 4 b h k (f - r), free of cancellation
    (l, r, s, f: the sums `left`, `right`, `square`, `pull`).
    """
    first, last = legendre(oscillator, rule, (0.0, 0.0), (1.0, 0.0), h)  # the coefficients of d in p0 and in p1
    b, spring = oscillator.damping, h * oscillator.stiffness
    middle = first + last - spring * rule.left
    discriminant = (b + spring * (rule.right - rule.left)) ** 2 - 4.0 * oscillator.mass * oscillator.stiffness
    discriminant += 4.0 * spring * (spring * (rule.square - rule.right**2) + b * (rule.pull - rule.right))
    root = cmath.sqrt(discriminant)
    if b < 0.5 * first and abs(root) < 0.5 * middle:  # z near 1: its logarithm without cancellation
        mean, half = complex(math.log1p(-b / first) / (2.0 * h)), cmath.atanh(root / middle) / h
        exponents = [mean + half, mean - half]
    else:
        eigenvalues = ((middle + root) / (2.0 * first), (middle - root) / (2.0 * first))
        exponents = [cmath.log(z) / h if z != 0.0 else complex(-math.inf) for z in eigenvalues]
    slow, fast = sorted(exponents, key=lambda exponent: (-exponent.real, -exponent.imag))
    return slow, fast


def _six_equations(scene: Scene, friction: Friction) -> Rates:
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


def six_variables(scene: Scene, friction: Friction, times: Array, solver: str, tolerance: float) -> Array:
    """(theta, phi, psi, theta', phi', psi') by one of SciPy's solvers, shape (6, times); SymtopError if it fails."""
    start = with_rates(scene.top, scene.start)[1]
    return integrated(_six_equations(scene, friction), start, times, solver, tolerance)


def damped_truth(scene: Scene, friction: Friction, times: Array) -> tuple[Array, float]:
    """`six_variables` at tolerance 1e-13, and their largest distance (rad) in any angle from the four equations."""
    solver = ("DOP853", 1e-13)
    six = six_variables(scene, friction, times, *solver)
    four = integrated(*four_equations(scene, friction), times, *solver)
    return six, float(np.max(np.abs(six[:3] - four[:3])))
