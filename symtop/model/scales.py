"""What the errors of many tops are divided by: `Scene.energy_scale` of rows of numbers, all at once.

    E0 - p_psi^2/2 I3 - min V       the energy of the nutation, V the effective potential of theta
    I1 omega^2/2                    of a steady precession, which has no nutation
    abs(mgl)                        of a top that sleeps or hangs, where neither is larger than rounding

A row is a top and a start as `symtop.model.top.flat` has them. The lowest place of V lies between the turning points
and is found by bisection of its slope.
"""

import math

import numpy as np

from symtop.core.numbers import EPSILON, TINY
from symtop.model.charts import Array
from symtop.model.effective import effective_force, effective_potential, effective_stiffness
from symtop.model.scenes import NEXT_TO_POLE, STEADY

BISECTIONS = 60


def momenta(numbers: Array) -> tuple[Array, Array, Array, Array]:
    """p_phi, p_psi, p_phi - p_psi and p_phi + p_psi of the starts, each (n,)."""
    I1, I3, _, theta, _, _, _, phi_dot, psi_dot = numbers.T
    p_psi = I3 * (psi_dot + phi_dot * np.cos(theta))
    sin_x, cos_x = np.sin(0.5 * theta), np.cos(0.5 * theta)
    swing = 4.0 * I1 * phi_dot * (sin_x * cos_x) ** 2
    north, south = swing - 2.0 * p_psi * sin_x**2, swing + 2.0 * p_psi * cos_x**2
    return swing + p_psi * np.cos(theta), p_psi, north, south


def energy(numbers: Array) -> Array:
    """Total energy of the starts, (n,)."""
    I1, I3, mgl, theta, _, _, theta_dot, phi_dot, psi_dot = numbers.T
    across = theta_dot**2 + (phi_dot * np.sin(theta)) ** 2
    total: Array = 0.5 * I1 * across + 0.5 * I3 * (psi_dot + phi_dot * np.cos(theta)) ** 2 + mgl * np.cos(theta)
    return total


def energy_scale(numbers: Array, theta_range: Array) -> Array:
    """The unit of energy errors, (n,); `theta_range` (n, 2) holds the turning points, rad."""
    I1, mgl = numbers[:, 0], numbers[:, 2]
    _, _, north, south = momenta(numbers)
    low, high = np.clip(theta_range.T, NEXT_TO_POLE, math.pi - NEXT_TO_POLE)
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        falls = effective_force(middle, north, south, I1, mgl)[0] < 0.0
        low, high = np.where(falls, middle, low), np.where(falls, high, middle)
    lowest = 0.5 * (low + high)
    start = np.clip(numbers[:, 3], NEXT_TO_POLE, math.pi - NEXT_TO_POLE)
    depth = (
        0.5 * I1 * numbers[:, 6] ** 2
        + effective_potential(start, north, south, I1, mgl)
        - effective_potential(lowest, north, south, I1, mgl)
    )
    swing = 0.5 * np.maximum(effective_stiffness(lowest, north, south, I1, mgl), 0.0)
    rounding = STEADY * EPSILON * (np.abs(energy(numbers)) + np.abs(mgl))
    kinds = [depth > rounding, swing > rounding, np.abs(mgl) > rounding]
    return np.asarray(np.select(kinds, [depth, swing, np.abs(mgl)], TINY))
