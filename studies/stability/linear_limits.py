"""Where a method ceases to be linearly stable: limits of the step, and of the spin of a sleeping top.

Near the upright (sleeping) top the axis z = e_x + i e_y obeys the recurrence of `symtop.run.linear_stability` with
c = 0 and complex t and d, |d| = 1, in charts without poles; in the angles chart the inclination does if p_phi = p_psi.
The top sleeps while t^2/d lies in [0, 4]. With I1 = mgl = 1 and a = I3 w3 that ends for Strang's splitting where
a tan(a h/4) = h, for Cayley's where a^2 = 4 + h^2; the motion itself sleeps for a >= 2.
"""

import math
from collections.abc import Callable

import numpy as np

from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene
from symtop.model.top import Angles, SymmetricTop
from symtop.run.linear_stability import NO_TRACE, Trace, few_steps, nutation_growth, trace

TILT = 1e-5  # rad, of the sleeping top
STEADILY = 1e-7  # t - 2 above this is more than rounding
GROWING = 1e-4  # least growth of a nutation per step that counts, for a method that is not symmetric
FAR = 0.01  # rad, drift of a precession beyond which its growth cannot be measured


def sleep_margin(method: Integrator, spin: float, h: float) -> float:
    """Above zero while the method's upright top sleeps at this spin w3 and step, below when it falls; 1 at most.

    4 x (1 - x) with x = t^2/4d: both ends of the stability, x = 1 (a pair of frequencies meets) and x = 0 (a step turns
    the top by half a turn), are simple sign changes of it.
    """
    body = SymmetricTop(1.0, 1.0, 1.0)
    chart = method.chart_for("axis")
    p_psi = body.I3 * spin
    if chart == "angles":  # p_phi = p_psi: the axis would pass through the pole, and V is a parabola
        rate = p_psi / (2.0 * body.I1 * math.cos(0.5 * TILT) ** 2)
        start = Angles(theta=TILT, phi_dot=rate, psi_dot=spin - rate * math.cos(TILT))
    else:
        start = Angles(theta=TILT, psi_dot=spin)
    states = few_steps(method, chart, body, start, h, 3).states
    z = states[:, 0] + 0j if chart == "angles" else states[:, 0] + 1j * states[:, 1]
    if not np.isfinite(z).all():
        return math.nan
    # z2 = t z1 - d z0, z3 = t z2 - d z1
    base = z[1] * z[1] - z[0] * z[2]
    if base == 0.0:
        return math.nan
    t, d = (z[1] * z[2] - z[0] * z[3]) / base, (z[2] * z[2] - z[1] * z[3]) / base
    x = float((t * t / (4.0 * d)).real)
    return 4.0 * x * (1.0 - x)


def sign_changes(function: Callable[[float], float], grid: np.ndarray) -> list[float]:
    """Where a function changes sign between neighbours of a grid, by bisection; intervals with a NaN do not count."""
    values = [function(float(x)) for x in grid]
    roots = []
    for left, right, low, high in zip(grid[:-1], grid[1:], values[:-1], values[1:], strict=True):
        if not (math.isfinite(low) and math.isfinite(high)) or (low > 0.0) == (high > 0.0):
            continue
        a, b = float(left), float(right)
        while b - a > 1e-12 * max(1.0, abs(b)):
            middle = 0.5 * (a + b)
            value = function(middle)
            if not math.isfinite(value):
                break
            a, b = (middle, b) if (value > 0.0) == (low > 0.0) else (a, middle)
        roots.append(0.5 * (a + b))
    return roots


def sleeping_threshold(method: Integrator, h: float) -> float:
    """The spin w3 at which the upright top of I1 = I3 = mgl = 1 begins to sleep under this method; the motion's is 2.

    The largest root below the spin that turns the top by a whole turn in a step. NaN where there is none, and for a
    method that is not symmetric, whose tops all rise or fall a little in every step.
    """
    if not method.symmetric:
        return math.nan
    top_spin = min(6.0, 0.9 * 2.0 * math.pi / h)
    roots = sign_changes(lambda spin: sleep_margin(method, spin, h), np.linspace(1.0, top_spin, 61))
    return roots[-1] if roots else math.nan


def surpasses(at: Trace, doubt: float = 0.0) -> float:
    """Above zero where small nutations of a symmetric method grow, below where they do not, NaN without fixed point."""
    return max(at.trace - 2.0 - max(STEADILY, doubt), -2.0 - doubt - at.trace)  # small steps have t just below 2


def linear_limits(method: Integrator, scene: Scene, grid: np.ndarray) -> tuple[float, float]:
    """Steps h of a grid at which small nutations first grow, and at which they first turn by a third of a turn.

    NaN where that happens at no step of the grid, or at its first.

    Both at the steady precession of `scene`. A fixed point that is lost between two steps (an implicit equation without
    a solution, say) counts as the end of stability; a window narrower than the grid is not seen. Where a method is not
    symmetric, the limit is where nutations begin to grow by 1e-4 a step, if that can be followed so far (`_growing`),
    and a third of a turn has no meaning.
    """
    if not method.symmetric:
        return _limit_of_growth(method, scene, grid), math.nan

    def turned(at: Trace) -> float:
        return -1.0 - at.trace

    third = last = math.nan
    before = NO_TRACE
    for h in map(float, grid):
        at = trace(method, scene, h)
        if math.isnan(third) and turned(at) >= 0.0 > turned(before):
            third = _edge(lambda x: turned(trace(method, scene, x)), last, h, lost=-1.0)
        if not surpasses(at, at.doubt) <= 0.0:
            limit = _edge(lambda x: surpasses(trace(method, scene, x)), last, h, lost=1.0)
            return limit, third if not third > limit else math.nan
        last, before = h, at
    return math.nan, third


def _limit_of_growth(method: Integrator, scene: Scene, grid: np.ndarray) -> float:
    """The step of a grid at which small nutations first grow by `GROWING`, for a method that need not be symmetric."""
    frequency, last = scene.top.nutation_frequency(scene.top.momenta(scene.start)), math.nan
    for h in map(float, grid):
        growth = _growing(method, scene, h, frequency)
        if math.isnan(growth):
            return math.nan
        if growth > 0.0:
            return _edge(lambda x: _growing(method, scene, x, frequency), last, h, lost=-1.0)
        last = h
    return math.nan


def _growing(method: Integrator, scene: Scene, h: float, frequency: float) -> float:
    """By how much the growth of small nutations in a step exceeds its threshold; NaN where it cannot be measured.

    The threshold is the larger of `GROWING` and the drift of the precession itself: some methods drift to another
    inclination, where nutations have another size, and after a drift of `FAR` growth cannot be told from it.
    """
    factor, size, _ = nutation_growth(method, scene, h, method.chart_for("axis"), frequency)
    return factor - 1.0 - max(GROWING, size) if size < FAR else math.nan


def _edge(value: Callable[[float], float], a: float, b: float, *, lost: float) -> float:
    """Where a function that is negative at a first is not, before b; `lost` is what it is where it has no value.

    NaN if a is. A trace is known to some 1e-6. Brent's search takes 5 to 15 of them, and no more than bisection where
    the function jumps.
    """
    from scipy.optimize import brentq  # takes 0.3 s, which a study with nothing to do need not

    if math.isnan(a):
        return math.nan

    def known(x: float) -> float:
        at = value(x)
        return lost if math.isnan(at) else at

    return float(brentq(known, a, b, xtol=1e-10 * b)) if known(a) < 0.0 else a
