"""The sensitivity of a motion to its start, a property of the motion that no method or arithmetic can avoid.

A motion that is unstable somewhere (beside a separatrix, or almost upright below the spin at which the top would sleep)
amplifies a change of its start. The closed form and its bounds are for the start as given, taken as nine exact doubles.
The same start in other variables is rounded differently: at theta = 1e-6 a unit vector along the axis holds
1 - theta^2/2 to four digits. The motions from two such starts differ by `conditioning` times a rounding error.
"""

import math

import numpy as np

from symtop.core.errors import SymtopError
from symtop.core.numbers import EPSILON
from symtop.model import charts
from symtop.model.exact.closed_form import ClosedForms
from symtop.model.scenes import Scene
from symtop.model.top import flat

POINTS = 100  # of the motion that are compared
SMALL_CHANGE = 64.0 * EPSILON  # a change of the start whose effect is ten times the rounding error of the closed form
LEAST_CHANGE = 2.0 * EPSILON  # the least change that does not vanish by rounding, of any theta in [0, pi] and any rate
FAR_APART = 0.1  # rad: a larger displacement is no longer proportional to the change; it is at most pi


def displacement(scene: Scene, change: float, horizon: float) -> float:
    """The largest distance of the axis, rad, up to the horizon from motions with starts changed by `change`.

    Three starts are tried: theta changed by `change` rad, theta' by `change` times the fastest rate, and all rates by
    the relative `change`. NaN if one of them is no valid start.
    """
    row = np.array(flat(scene.top, scene.start))
    I1, I3, mgl, theta, _, _, theta_dot, phi_dot, psi_dot = row.tolist()
    spin = I3 * abs(psi_dot + phi_dot * math.cos(theta)) / I1
    starts = np.tile(row, (4, 1))
    starts[1, 3] += change if theta + change <= math.pi else -change
    starts[2, 6] += change * (spin + abs(theta_dot) + math.sqrt(abs(mgl) / I1))
    starts[3, 6:] *= 1.0 + change
    try:
        axes = ClosedForms(starts).axis(np.linspace(0.0, horizon, POINTS + 1)[1:])
    except SymtopError:
        return math.nan
    return float(np.max(charts.axis_distance(axes[1:], axes[0])))


def conditioning(scene: Scene, horizon: float) -> float:
    """The ratio of the displacement of the axis up to the horizon to a change of the start; at least 1, or NaN.

    If a change displaces the axis by more than `FAR_APART`, a smaller one is tried, which rounding changes more:
    `LEAST_CHANGE` by up to a third. If `LEAST_CHANGE` still displaces it by more, the ratio is a lower bound.
    """
    for change in (SMALL_CHANGE, 8.0 * EPSILON, LEAST_CHANGE):
        distance = displacement(scene, change, horizon)
        if not distance > FAR_APART:
            break
    return float(np.maximum(distance / change, 1.0))
