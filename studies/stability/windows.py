"""Narrow windows of steps at which small nutations grow, between two steps of a grid at which they do not.

Where a step turns the nutation by half a turn or a whole one, |t| = 2, a pair of eigenvalues meets
(`linear_stability`). At half turns the error of a splitting may take t beyond -2. At whole turns it pushes the nutation
the same way in every step, and the fixed point goes away as one over the distance to that step: at the ends of the
window it is some 1e-3 rad off, within there is none near, and runs swing by 0.01 rad. With a method of high order a
window is a few thousandths of h omega wide. Where it lies, |t| has a maximum next to 2 on the grid; there, and only
there, many more steps are tried.
"""

import math
from typing import NamedTuple

import numpy as np

from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene
from symtop.run.linear_stability import NO_TRACE, surpasses, trace

NEARLY = 1.9  # |t| of a maximum on the grid that may hide a window
TRIED = 200  # steps between the neighbours of a maximum


class Window(NamedTuple):
    """A window of unstable steps lies between these two, which are stable."""

    start: float
    end: float


NO_WINDOW = Window(math.nan, math.nan)


def narrow_window(method: Integrator, scene: Scene, grid: np.ndarray) -> Window:
    """The first window between steps of a grid at each of which a symmetric method is stable.

    One that is narrower than a hundredth of the grid's spacing may be missed, and so may one with a maximum of |t| that
    passes 2 by less than rounding.
    """
    last = earlier = math.nan
    before = first = NO_TRACE
    for h in map(float, grid if method.symmetric else ()):
        at = trace(method, scene, h)
        if not surpasses(at, at.doubt) <= 0.0:
            break
        if abs(first.trace) <= abs(before.trace) >= max(NEARLY, abs(at.trace)):
            close = np.linspace(earlier, h, TRIED + 1)
            tried = [trace(method, scene, x) for x in close.tolist()]
            lost = np.flatnonzero([not surpasses(one, one.doubt) <= 0.0 for one in tried])
            if lost.size:
                return Window(float(close[lost[0] - 1]), float(close[lost[-1] + 1]))
        earlier, last, first, before = last, h, before, at
    return NO_WINDOW
