"""Measurements of single mechanisms of failure: resonance, the separatrix, and sampling.

`surviving_displacement` displaces a steady precession and finds how far it may be displaced without running away within
some thousands of steps. A linear analysis calls every step below the limit stable; at a third of a turn a step
(`linear_stability`) hardly any displacement survives all the same.

`separatrix_horizon` follows the top that rises towards the upright and never reaches it. Near this motion a deviation
grows as exp(g t/2), g^2 = mgl/I1, so that an error e at time t1 reaches E at t1 + (2/g) ln(E/e): each digit of accuracy
lengthens the run by 4.6/g.

`sampled_energy_error` measures one energy error twice, once a nutation and at every step. The energy error of a
symplectic method is a function of the phase of the nutation, so that samples at one phase show almost none of it.
Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, sections I.5 and X.4 (stability, resonance).
"""

import math
from typing import NamedTuple

import numpy as np

from symtop.methods.calling import solve
from symtop.methods.plan import Plan
from symtop.methods.registry import Integrator
from symtop.model import charts
from symtop.model.scenes import Scene, closed_form
from symtop.model.top import Angles
from symtop.model.view import View
from symtop.run.linear_stability import trace, with_momenta

RUNS_AWAY = 4.0  # times the displacement; an island that a resonance has bent is at most three times as long as wide
LOST = 0.1  # rad, axis error at which a run next to the separatrix has lost its accuracy
LONGEST = 80.0  # 1/g, of a run next to the separatrix
SEEN = 6.0  # 1/g, the time at which its early error is read


def _run(method: Integrator, scene: Scene, start: Angles, plan: Plan) -> tuple[str, View]:
    """The outcome of a run from `start`, and what its samples show."""
    chart = method.chart_for("axis")
    run = solve(method, chart, scene.top, start, plan)
    return run.outcome, View(chart, scene.top, run.states, run.p_phi, run.p_psi)


def survives(method: Integrator, scene: Scene, centre: float, displacement: float, h: float, steps: int) -> bool:
    """Does a steady precession at theta = `centre` that is displaced by so many radians stay near itself?"""
    momenta = scene.top.momenta(scene.start)
    start = with_momenta(scene.top, centre + displacement, momenta)
    marks = np.unique(np.linspace(0, steps, 400).astype(np.int64))
    outcome, seen = _run(method, scene, start, Plan.steps(h, marks))
    with np.errstate(over="ignore"):  # a run may have blown up
        away = np.abs(seen.theta - centre)
    return outcome == "ok" and bool(np.nanmax(away) <= RUNS_AWAY * displacement)


def surviving_displacement(
    method: Integrator, scene: Scene, h: float, steps: int, least: float = 1e-4, most: float = 0.3, rounds: int = 4
) -> float:
    """The largest displacement, rad, up to which all that are tried survive; 0 if not even `least` does.

    It is measured from the fixed point of the method, which for a splitting is O(h^2) away from the true one. Where the
    method has none that four steps can find, nothing survives.
    """
    centre = trace(method, scene, h).theta
    if not math.isfinite(centre):
        return 0.0
    good = 0.0
    for value in np.geomspace(least, most, 12):
        if not survives(method, scene, centre, float(value), h, steps):
            bad = float(value)
            break
        good = float(value)
    else:
        return good
    for _ in range(rounds if good else 0):
        middle = math.sqrt(good * bad)
        good, bad = (middle, bad) if survives(method, scene, centre, middle, h, steps) else (good, middle)
    return good


class Horizon(NamedTuple):
    """How long a run near the separatrix stays accurate."""

    error: float  # axis error at `SEEN`, rad
    reached: float  # first time at which it passes `LOST`; NaN if it does not, or the run ended before
    predicted: float  # from the error at `SEEN`


def separatrix_horizon(method: Integrator, scene: Scene, setting: float, longest: float = LONGEST) -> Horizon:
    """When the axis error passes `LOST`; `setting` is the step in units of 1/g, or the tolerance."""
    g = math.sqrt(scene.top.mgl / scene.top.I1)
    if method.fixed_step:
        plan = Plan.steps(setting / g, np.unique(np.linspace(0, round(longest / setting), 1601).astype(np.int64)))
    else:
        plan = Plan.until(np.linspace(0.0, longest, 1601) / g, setting)
    times = plan.times
    _, seen = _run(method, scene, scene.start, plan)
    error = charts.axis_distance(seen.axis, closed_form(scene).axis(times))
    early = float(error[np.searchsorted(times, SEEN / g * (1.0 - 1e-12))])
    past = np.flatnonzero(error > LOST)
    reached = float(times[past[0]]) if past.size else math.nan
    return Horizon(early, reached, SEEN / g + 2.0 / g * math.log(LOST / early) if early > 0.0 else math.nan)


def sampled_energy_error(method: Integrator, scene: Scene, steps: int, periods: int) -> tuple[float, float]:
    """Largest |E - E0| seen once a nutation, and at every step; `steps` make one nutation."""
    plan = Plan.steps(scene.nutation_period / steps, np.arange(steps * periods + 1))
    _, seen = _run(method, scene, scene.start, plan)
    error = np.abs(seen.energy - scene.top.energy(scene.start))
    return float(error[steps::steps].max()), float(error.max())
