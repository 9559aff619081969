"""Measurements of single mechanisms of failure: resonance, the separatrix, and sampling.

`surviving_displacements` finds the largest displacement of a steady precession that does not run away within some
thousands of steps. By a linear analysis every step below the limit is stable; at a third of a turn a step
(`linear_stability`) some small displacements run away all the same.

`separatrix_horizon` follows the top that rises towards the upright and never reaches it. Near the upright
z = sin(theta) exp(i phi) obeys I1 z'' - i p_psi z' = mgl z, so that a deviation grows as exp(lambda t) with
lambda^2 = mgl/I1 - (p_psi/2 I1)^2. An error e at time t1 reaches E at t1 + ln(E/e)/lambda: each digit of accuracy
lengthens the run by 2.3/lambda.

`sampled_energy_error` measures one energy error twice, once a nutation and at every step. The energy error of a
symplectic method is a function of the phase of the nutation, so that samples at one phase show almost none of it.
Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, sections I.5 and X.6 (stability, resonance).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symtop.methods.framework.calling import solve
from symtop.methods.framework.loop import FixedStep
from symtop.methods.framework.plan import OUTCOMES, Array, Plan
from symtop.methods.framework.registry import Integrator
from symtop.model import charts
from symtop.model.charts import View
from symtop.model.scenes import Scene, closed_form
from symtop.model.top import Angles, flat
from symtop.run.linear_stability import trace, with_momenta

RUNS_AWAY = 4.0  # times the displacement; an island deformed by a resonance is at most three times as long as wide
LOST = 0.1  # rad, axis error at which a run next to the separatrix has lost its accuracy
LONGEST = 40.0  # length of a run next to the separatrix, in units of 1/lambda
LEAST, MOST, TRIED = 1e-4, 0.3, 8  # the least and the largest displacement tried, rad, and how many are tried
HALVINGS = 5  # bisections between the last displacement that survives and the first that does not: to 4 %
SEEN = 3.0  # the time, in units of 1/lambda, at which the early error of such a run is measured


def _run(method: Integrator, scene: Scene, start: Angles, plan: Plan) -> tuple[str, View]:
    chart = method.chart_for("axis")
    run = solve(method, chart, scene.top, start, plan)
    return run.outcome, View(chart, scene.top, run.states, run.p_phi, run.p_psi)


def survives(
    method: Integrator, scene: Scene, centres: ArrayLike, displacements: ArrayLike, h: ArrayLike, steps: int
) -> NDArray[np.bool_]:
    """Do steady precessions at theta = `centres`, displaced by `displacements` (rad), stay near their centres?

    Arrays over runs, which are made in one call where the method has one, in lanes if it can.
    """
    centres, displacements, h = np.broadcast_arrays(*(np.asarray(x, float) for x in (centres, displacements, h)))
    momenta, chart = scene.top.momenta(scene.start), method.chart_for("axis")
    starts = [with_momenta(scene.top, theta, momenta) for theta in (centres + displacements).ravel().tolist()]
    marks = np.unique(np.linspace(0, steps, 400).astype(np.int64))
    solver = method.solvers[chart]
    with np.errstate(over="ignore", invalid="ignore"):  # a run may have blown up
        if isinstance(solver, FixedStep) and not solver.in_python:
            numbers = np.array([flat(scene.top, start) for start in starts])
            run = solver.many(numbers, h.ravel(), np.tile(marks, (len(starts), 1)))
            theta, well = View(chart, scene.top, run.states).theta, run.outcome == OUTCOMES.index("ok")
        else:
            pairs = zip(starts, h.ravel().tolist(), strict=True)
            runs = [_run(method, scene, start, Plan.steps(step, marks)) for start, step in pairs]
            theta, well = np.stack([view.theta for _, view in runs]), np.array([outcome == "ok" for outcome, _ in runs])
        away = np.abs(theta - centres.reshape(-1, 1)).max(axis=1)
        stays: NDArray[np.bool_] = well & (away <= RUNS_AWAY * displacements.ravel())
    return stays.reshape(h.shape)


def surviving_displacements(method: Integrator, scene: Scene, h: Sequence[float], steps: int) -> Array:
    """For each step h the largest displacement, rad, up to which all that are tried survive; 0 if not even `LEAST`.

    It is measured from the fixed point of the method, which for a splitting is O(h^2) away from the true one. Where the
    method has none that four steps can find, nothing survives; where h is NaN there is nothing to measure.
    """
    step, tried = np.asarray(h, float), np.geomspace(LEAST, MOST, TRIED)
    centre = np.array([trace(method, scene, x).theta if math.isfinite(x) else math.nan for x in step.tolist()])
    known = np.flatnonzero(np.isfinite(centre))
    good, bad = np.where(np.isfinite(step), 0.0, math.nan), np.full(step.shape, math.nan)
    if known.size:
        lost = ~survives(method, scene, centre[known, np.newaxis], tried, step[known, np.newaxis], steps)
        first = np.where(lost.any(axis=1), lost.argmax(axis=1), tried.size)
        good[known] = np.where(first > 0, tried[np.maximum(first - 1, 0)], 0.0)
        bad[known] = np.append(tried, math.nan)[first]
    sought = np.flatnonzero((good > 0.0) & np.isfinite(bad))
    for _ in range(HALVINGS if sought.size else 0):
        middle = np.sqrt(good[sought] * bad[sought])
        stays = survives(method, scene, centre[sought], middle, step[sought], steps)
        good[sought], bad[sought] = np.where(stays, middle, good[sought]), np.where(stays, bad[sought], middle)
    return good


class Horizon(NamedTuple):
    """How long a run near the separatrix stays accurate."""

    error: float  # axis error at `SEEN`, rad
    reached: float  # first time at which it passes `LOST`; NaN if it does not, or the run ended before
    predicted: float  # from the error at `SEEN`
    broken: float  # 1 if the run ended before it passed `LOST`, else 0


def growth_rate(scene: Scene) -> float:
    """lambda, at which a deviation from the upright grows; NaN where the upright top sleeps."""
    top, p_psi = scene.top, scene.top.momenta(scene.start).p_psi
    squared = top.mgl / top.I1 - (0.5 * p_psi / top.I1) ** 2
    return math.sqrt(squared) if squared > 0.0 else math.nan


def separatrix_horizon(method: Integrator, scene: Scene, setting: float) -> Horizon:
    """When the axis error passes `LOST`; `setting` is the step in units of sqrt(I1/mgl), or the tolerance."""
    rate, step = growth_rate(scene), setting * math.sqrt(scene.top.I1 / scene.top.mgl)
    if method.fixed_step:
        steps = round(LONGEST / (rate * step))
        plan = Plan.steps(step, np.unique(np.linspace(0, steps, 1601).astype(np.int64)))
    else:
        plan = Plan.until(np.linspace(0.0, LONGEST, 1601) / rate, setting)
    times = plan.times
    outcome, view = _run(method, scene, scene.start, plan)
    with np.errstate(over="ignore", invalid="ignore"):  # a run may have blown up
        error = charts.axis_distance(view.axis, closed_form(scene).axis(times))
    early = float(error[np.searchsorted(times, SEEN / rate * (1.0 - 1e-12))])
    late = np.flatnonzero(error > LOST)
    reached = float(times[late[0]]) if late.size else math.nan
    predicted = (SEEN + math.log(LOST / early)) / rate if early > 0.0 else math.nan
    return Horizon(early, reached, predicted, float(outcome != "ok" and not late.size))


def sampled_energy_error(method: Integrator, scene: Scene, steps: int, periods: int) -> tuple[float, float]:
    """Largest |E - E0| seen once a nutation, and at every step; `steps` make one nutation."""
    plan = Plan.steps(scene.nutation_period / steps, np.arange(steps * periods + 1))
    _, view = _run(method, scene, scene.start, plan)
    error = np.abs(view.energy - scene.top.energy(scene.start))
    return float(error[steps::steps].max()), float(error.max())
