"""Errors of the constants of the motion that come from the solver of an implicit method, apart from the method itself.

The midpoint rule is solved to a given tolerance and no better. The change of energy and momenta with an exact solution
of its equation is the method's error; any further change is the solver's. `textbook_midpoint` is the iteration that
most texts give, Newton's from free flight, theta1 = theta + h p/I1. The kernel of this package starts from a cubic
through past steps and follows its last correction to first order, so that it reaches the same error in fewer
iterations. Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, section VIII.6.
"""

import math
from typing import NamedTuple

import numpy as np

from symtop.core.jit import compile_kernel, register_jitable
from symtop.methods.framework.angles import on_angles
from symtop.methods.lagrangian import discrete_lagrangian
from symtop.methods.lagrangian.discrete_lagrangian import Quadrature
from symtop.model import top as model
from symtop.model.scenes import Scene

SAMPLES = 4001  # of a run, evenly spaced

_force = register_jitable(model.effective_force)
_stiffness = register_jitable(model.effective_stiffness)


def _textbook_midpoint(par, theta, p, h, tolerance, iterations, marks, samples):  # type: ignore[no-untyped-def]
    """March the reduced midpoint rule with `iterations` of Newton a step at most; True if it stayed in the chart."""
    k, half = 0, 0.5 * h * h / par.I1
    for j in range(len(marks)):
        while k < marks[j]:
            flight = h * p / par.I1
            d = flight
            for _ in range(iterations):
                middle = theta + 0.5 * d
                slope = _force(middle, par.north, par.south, par.I1, par.mgl)[0]
                bend = _stiffness(middle, par.north, par.south, par.I1, par.mgl)
                correction = (flight - d - half * slope) / (1.0 + 0.5 * half * bend)
                d += correction
                if abs(correction) <= tolerance:
                    break
            p -= h * _force(theta + 0.5 * d, par.north, par.south, par.I1, par.mgl)[0]
            theta += d
            k += 1
            if not 0.0 < theta < np.pi:
                return False
        samples[j, 0], samples[j, 1] = theta, p
    return True


_march = compile_kernel(_textbook_midpoint)


class SolverError(NamedTuple):
    """Errors of the constants of the motion if the equation is solved to a given tolerance."""

    energy: float  # largest |E - E0|
    momentum: float  # largest |p - p0| of p_phi and p_psi
    iterations: float  # a step


def textbook_midpoint(scene: Scene, h: float, steps: int, tolerance: float, iterations: int = 50) -> float:
    """Largest |E - E0| of the midpoint rule if Newton stops after a correction of at most `tolerance` rad."""
    par, state = on_angles(scene.top, scene.start)
    marks = np.unique(np.linspace(0, steps, SAMPLES).astype(np.int64))
    samples = np.full((marks.size, 2), math.nan)
    _march(par, state[0], state[1], h, tolerance, iterations, marks, samples)
    return _energy_error(scene, samples)


def solver_sweep(rule: Quadrature, scene: Scene, h: float, steps: int, tolerance: float) -> SolverError:
    """A discrete Lagrangian of this package, its iteration stopped at `tolerance` of the increment (inf: after one)."""
    par, state = on_angles(scene.top, scene.start)
    marks = np.unique(np.linspace(0, steps, SAMPLES).astype(np.int64))
    run = discrete_lagrangian.march(par, rule._replace(tolerance=tolerance), state, h, marks)
    momenta = scene.top.momenta(scene.start)
    with np.errstate(all="ignore"):
        lost = np.abs(run.momenta[1:] - np.array([momenta.p_phi, momenta.p_psi]))
    return SolverError(_energy_error(scene, run.states), float(np.nanmax(lost)), run.work / max(run.steps, 1))


def _energy_error(scene: Scene, states: np.ndarray) -> float:
    momenta = scene.top.momenta(scene.start)
    with np.errstate(all="ignore"):
        energy = scene.top.reduced_energy(states[:, 0], states[:, 1], momenta.p_phi, momenta.p_psi)
        return float(np.nanmax(np.abs(energy - energy[0])))
