"""Conservation in a run: residuals of the constants of the motion, their trend and growth, and a check of the momenta.

A trend is the slope of the least-squares line through the means of `BLOCKS` equal stretches, with Student's 95 %
interval, widened for the autocorrelation of the residuals of the line. Samples are never commensurate with the
nutation, so that a fast oscillation averages out. Rounding errors add up to a random walk, which has no slope but
wanders: in 33 % of cases its interval is too narrow (white noise: 3 %); the exponent of growth, 1/2, is more reliable.

An exponent of error ~ t^alpha is the least-squares slope of the logarithm of the largest error in logarithmic windows:

    alpha   0         1/2                       1                        3/2                        2
    means   bounded   random walk (rounding     steady drift (phase of   phase under a random       phase under a steady
                      at its best)              a symplectic method)     walk of the energy         drift of the energy

The interval of the exponent treats the windows as independent. The largest values of one random walk are not: of 400
walks of 4000 samples, whose fitted exponents spread by 0.17, the interval covers the true 0.5 in 69 %; for sums of a
walk it covers 3/2 in 48 %. `behaviour` calls 84 % of walks that are not "kept" a random walk, 10 % drift, 6 % bounded.

In the angles chart p_phi and p_psi are parameters of a state. The rates of the trajectory imply the momenta

    p_psi = I3 (psi' + phi' cos theta),    p_phi = I1 phi' sin^2 theta + p_psi cos theta,

phi' and psi' by central differences of order 8 over nine consecutive steps. They differ from the momenta of a method by
its error of a step, which oscillates with the nutation and does not grow. If a run loses its momenta but reports those
of its start, the difference drifts as much as the momenta do (`from_increments`).
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from symtop.core.numbers import GOLDEN
from symtop.measure.order import Fit, line, power_law, student
from symtop.methods.framework.calling import solve
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import Integrator
from symtop.model.charts import Array
from symtop.model.scenes import Scene
from symtop.model.top import SymmetricTop
from symtop.run.trajectory import Trajectory

CONSTANTS = ("energy", "p_phi", "p_psi")
LAWS = {0.0: "bounded", 0.5: "random walk", 1.0: "linear", 1.5: "t^3/2", 2.0: "quadratic"}
RUN_ROUNDING = 3e-13  # relative: the largest change that a million steps of rounding explain where sums are compensated
WALK_RATIO = 100.0  # times the rounding error: a change that grows as t^1/2 and is larger is not attributed to rounding
LEAST_DECADES, MOST_DECADES = 0.2, 2.0  # decades of time at the end of a run in which growth is judged: least and most
BLOCKS = 24  # equal stretches of a run whose means a trend is fitted to
EXPONENT_SLACK = 0.1  # an exponent agrees with that of a law if they differ by no more than this, or than its interval


class Trend(NamedTuple):
    """A linear trend of a residual."""

    slope: float  # per unit time
    interval: float  # half-width, 95 %
    rise: float  # slope times the length of the run


class Change(NamedTuple):
    """The change of a constant of the motion over a run: its size, its trend and its law of growth."""

    largest: float  # NaN if there is no finite sample
    slope: float  # of the trend, per unit time
    interval: float
    rise: float
    exponent: float  # of growth with time
    exponent_interval: float  # half-width, 95 %
    law: str  # name of the exponent


def constant_of(time: ArrayLike, residual: ArrayLike, decades: float = MOST_DECADES, period: float = 0.0) -> Change:
    """Size, trend and growth over the last `decades` of a residual (n,) at times (n,); samples may be NaN.

    Within the first `period` an oscillation only begins: growth is judged after it, in the last `LEAST_DECADES` at
    least.
    """
    if period:
        decades = min(max(math.log10(max(np.asarray(time)[-1] / period, 1.0)), LEAST_DECADES), decades)
    size, power = np.abs(np.asarray(residual, float)), growth(time, residual, decades)
    valid = size[np.isfinite(size)]
    largest = float(valid.max()) if valid.size else math.nan
    with np.errstate(over="ignore", invalid="ignore"):  # squares of a run that blows up
        return Change(largest, *trend(time, residual), power.slope, power.interval, law(power))


def residuals(scene: Scene, run: Trajectory) -> dict[str, np.ndarray]:
    """Signed relative change since the start of energy, p_phi and p_psi, of those that the run has; each (n,)."""
    scales = {"energy": scene.energy_scale, "p_phi": scene.momentum_scale, "p_psi": scene.momentum_scale}
    values = {name: series for name in CONSTANTS if (series := getattr(run, name)) is not None}
    return {name: (value - value[0]) / scales[name] for name, value in values.items()}


def growth(time: ArrayLike, residual: ArrayLike, decades: float = MOST_DECADES) -> Fit:
    """The exponent of |residual| ~ t^exponent, from the largest values in logarithmic windows of the last `decades`."""
    return power_law(*maxima(time, residual, decades))


def maxima(
    time: ArrayLike, residual: ArrayLike, decades: float = MOST_DECADES, count: int = 12
) -> tuple[list[float], list[float]]:
    """Middles of `count` logarithmic windows over the last `decades` of time, and the largest |residual| in each."""
    t, r = np.asarray(time, float), np.abs(np.asarray(residual, float))
    edges = np.geomspace(t[-1] / 10.0**decades, t[-1], count + 1)
    middles, largest = [], []
    for low, high in pairwise(edges):
        inside = (t > low) & (t <= high) & np.isfinite(r)
        if inside.any():
            middles.append(math.sqrt(low * high))
            largest.append(float(r[inside].max()))
    return middles, largest


def law(fit: Fit) -> str:
    """The law in `LAWS` that a fitted exponent agrees with; "t^..." with none, "undecided" with more than one."""
    if not math.isfinite(fit.slope):
        return "not judged"
    nearest = min(LAWS, key=lambda exponent: abs(exponent - fit.slope))
    if any(abs(exponent - fit.slope) <= fit.interval for exponent in LAWS if exponent != nearest):
        return "undecided"
    return LAWS[nearest] if abs(nearest - fit.slope) <= max(fit.interval, EXPONENT_SLACK) else f"t^{fit.slope:.2f}"


def behaviour(size: float, slope: float, interval: float, grain: float = 1.0, rounding: float = 0.0) -> str:
    """How well a run keeps a constant whose largest change is `size` and grows as t^slope (95 %: +- interval).

    Every study uses this rule. `grain` is the rounding error of the constant in machine epsilons, 1 or more
    (`Scene.energy_grain`); `rounding` is the change explained by rounding in sums without compensation, if larger.

        kept          size <= RUN_ROUNDING grain, whatever the exponent; or size <= rounding, and not bounded
        bounded       the exponent is nearest to 0, and its interval excludes 1/2: an error of the step, however small
        random walk   nearest to 1/2, the interval excludes 0 and 1, and size <= `WALK_RATIO` times rounding
        drift         nearest to 1 or larger, and the interval excludes 1/2
        growing       anything else: the interval includes two laws, or the change grows as t^1/2 but is too large for
                      rounding, or there is no exponent (NaN)
    """
    if size <= RUN_ROUNDING * grain:
        return "kept"
    low, high = slope - interval, slope + interval
    if slope < 0.25 and high < 0.5:
        return "bounded"
    rounding = max(rounding, RUN_ROUNDING * grain)
    if size <= rounding:
        return "kept"
    if slope >= 0.75 and low > 0.5:
        return "drift"
    walks = 0.25 <= slope < 0.75 and low > 0.0 and high < 1.0
    return "random walk" if walks and size <= WALK_RATIO * rounding else "growing"


def trend(time: ArrayLike, residual: ArrayLike) -> Trend:
    """The linear trend of a residual (n,) at times (n,), from the means of `BLOCKS` equal stretches of the run."""
    t, r = np.asarray(time, float), np.asarray(residual, float)
    valid = np.isfinite(r)
    t, r = t[valid], r[valid]
    if t.size < 2 * BLOCKS:
        return Trend(math.nan, math.nan, math.nan)
    means = (np.array([block.mean() for block in np.array_split(values, BLOCKS)]) for values in (t, r))
    slope, error, _, deviations = line(*means)
    # with first-order autocorrelation r, a fraction (1-r)/(1+r) of the residuals is independent; r has a bias of -4/n
    power = float(deviations @ deviations)
    memory = float(deviations[1:] @ deviations[:-1]) / power + 4.0 / BLOCKS if power > 0.0 else 0.0
    memory = min(max(memory, 0.0), 0.95)
    error *= math.sqrt((1.0 + memory) / (1.0 - memory))
    return Trend(slope, student(BLOCKS - 2) * error, slope * float(t[-1] - t[0]))


STENCIL = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0.0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
STENCIL_REACH = 4  # steps of the stencil to either side
PLACES = 240  # places of a run where rates are differenced
FEWEST_STEPS = 4000  # steps: in a shorter run the stencils would overlap
SURE_WIDTHS = 8.0  # half-widths of the 95 % interval that a drift must exceed
LEAST_DRIFT = 1e-8  # relative: the least drift that counts, above the rounding of differences of angles of many turns
HIDDEN_SHARE = 0.5  # least ratio of the drift of the difference to the drift of the implied momentum, if a run hides it


class Difference(NamedTuple):
    """How far the momenta that a run reports drift from those that its rates imply."""

    name: str  # of the momentum that differs more
    size: float  # relative to the larger momentum
    floor: float  # a smaller size is rounding
    how: str  # where it was measured, in words


def from_increments(method: Integrator, scene: Scene, plan: Plan) -> Difference | None:
    """The drift of reported against implied momenta over a run like `plan` in the angles chart; None if too short."""
    steps = int(plan.marks[-1])
    if steps < FEWEST_STEPS:
        return None
    positions = np.arange(PLACES) + np.mod(GOLDEN * np.arange(PLACES), 1.0)
    centres = np.rint(positions * (steps - 2 * STENCIL_REACH - 1) / PLACES).astype(np.int64) + STENCIL_REACH
    marks = (centres[:, None] + np.arange(-STENCIL_REACH, STENCIL_REACH + 1)).ravel()
    sparse = Plan.steps(plan.step_size, np.unique(marks))
    run = solve(method, "angles", scene.top, scene.start, sparse, f" on {scene.name}")
    if run.outcome != "ok":
        return None
    indices = np.searchsorted(sparse.marks, centres)
    stencils = run.states[indices[:, None] + np.arange(-STENCIL_REACH, STENCIL_REACH + 1)]  # (places, 9, 4)
    implied = dict(zip(("p_phi", "p_psi"), momenta_of(scene.top, stencils, sparse.step_size), strict=True))
    times, sizes = sparse.times[indices], {}
    for name, values in implied.items():
        reported = getattr(run, name)[indices]
        excess, total = trend(times, (values - reported) / scene.momentum_scale), trend(times, values)
        hidden = abs(excess.rise) > max(LEAST_DRIFT, HIDDEN_SHARE * abs(total.rise) / scene.momentum_scale)
        sizes[name] = abs(excess.rise) if hidden and abs(excess.slope) > SURE_WIDTHS * excess.interval else 0.0
    name = max(sizes, key=lambda name: sizes[name])
    detail = f"more at the end of {int(sparse.marks[-1])} steps than at their start"
    return Difference(name, sizes[name], LEAST_DRIFT, detail)


def momenta_of(top: SymmetricTop, around: Array, h: float) -> tuple[Array, Array]:
    """p_phi and p_psi (places,) that the rates imply, from nine consecutive states (places, 9, 4) in angles."""
    theta = around[:, STENCIL_REACH, 0]
    phi_dot, psi_dot = ((around[:, :, k] - around[:, STENCIL_REACH, None, k]) @ STENCIL / h for k in (2, 3))
    p_psi = top.I3 * (psi_dot + phi_dot * np.cos(theta))
    return top.I1 * phi_dot * np.sin(theta) ** 2 + p_psi * np.cos(theta), p_psi
