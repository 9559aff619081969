"""The sensitivity of a motion to its start: what no arithmetic and no method can undo.

A motion that is unstable somewhere on its way (beside a separatrix, or almost upright below the spin at which the top
would sleep) multiplies a change of its start. The closed form answers for the start as it is given, nine exact doubles,
and its bounds are of that motion. Whoever gives the start in other variables rounds it differently: at theta = 1e-6 a
unit vector along the axis holds 1 - theta^2/2 to four digits. Between such starts lies `conditioning` times a rounding.
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
SMALL = 64.0 * EPSILON  # a change whose effect the closed form shows: rounding is a tenth of it
LEAST = 2.0 * EPSILON  # the least change that any theta in [0, pi] and every rate can take
FAR = 0.1  # rad: beyond it a displacement no longer grows with the change, and it ends at pi


def displacement(scene: Scene, change: float, horizon: float) -> float:
    """How far the axis will be, rad, from where it would be if the start were changed by so little: the most.

    Three starts are tried: theta moved by `change` rad, theta' by that part of the fastest rate, and all rates by that
    part of themselves. NaN if one of them is no start.
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
    """Rad by which the axis moves up to the horizon for each of the start, or relative; 1 at least, or NaN.

    Where a change displaces the axis by `FAR`, a smaller one is tried, which the start takes less exactly: `LEAST` to a
    third. What the smallest change moves by `FAR` is displaced by `FAR` even so, and moves by that much at least.
    """
    for change in (SMALL, 8.0 * EPSILON, LEAST):
        apart = displacement(scene, change, horizon)
        if not apart > FAR:
            break
    return float(np.maximum(apart / change, 1.0))
