"""Scans of single mechanisms of failure: resonance, the separatrix, the sampling, and the solver of an implicit method.

`surviving_displacement` displaces a steady precession and asks how far it may be displaced without running away within
some thousands of steps. A linear analysis calls every step below the limit stable; at a third of a turn a step
(`linear_stability`) nothing survives all the same.

`separatrix_horizon` follows the top that rises to the upright for ever. Near it a deviation grows as exp(g t/2),
g^2 = mgl/I1, so that an error e at time t1 reaches E at t1 + (2/g) ln(E/e): each digit buys 4.6/g, and no step more.

`sampled_energy_error` measures one energy error twice, once a nutation and once a step. The error of a symplectic
method is a function of the phase of the nutation: whoever always looks at the same phase sees almost none of it.

`solver_sweep` solves the midpoint rule's equation badly. What the exact solution does is the method's error, what comes
on top of it is the solver's. `plain_midpoint` is the textbook's Newton iteration from free flight, theta1 = theta +
h p/I1; the kernel of this package predicts with a cubic and follows its last correction to first order, and needs it
less. Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, VIII.6.
"""

import functools
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symtop.methods import discrete_lagrangian
from symtop.methods.angles import reduced
from symtop.methods.compiled import compile_kernel, register_jitable
from symtop.methods.registry import Integrator, Plan, Run
from symtop.model import charts
from symtop.model import top as model
from symtop.model.scenes import Scene, closed_form
from symtop.run.linear_stability import chart_of, inclination, trace, with_momenta
from symtop.run.simulation import space_energy

Array = NDArray[np.float64]
RUNS_AWAY = 4.0  # times the displacement; an island that a resonance has bent is at most three times as long as wide
LOST = 0.1  # rad


def _run(method: Integrator, where: Scene, start: Any, h: float, marks: NDArray[np.int64]) -> tuple[str, Run]:
    chart = chart_of(method)
    with np.errstate(all="ignore"):
        plan = Plan(np.multiply(marks, h, dtype=float), float(marks[-1]) * h, h, marks, math.nan)
        return chart, method.solvers[chart](where.top, start, plan)


def survives(method: Integrator, where: Scene, centre: float, displacement: float, h: float, steps: int) -> bool:
    """Does a steady precession at theta = `centre` that is displaced by so many radians stay near itself?"""
    momenta = where.top.momenta(where.start)
    start = with_momenta(where.top, centre + displacement, momenta)
    marks = np.unique(np.linspace(0, steps, 400).astype(np.int64))
    chart, run = _run(method, where, start, h, marks)
    away = np.abs(inclination(chart, run.states) - centre)
    return run.outcome == "ok" and bool(np.nanmax(away) <= RUNS_AWAY * displacement)


def surviving_displacement(
    method: Integrator, where: Scene, h: float, steps: int, least: float = 1e-4, most: float = 0.3, rounds: int = 4
) -> float:
    """The largest displacement, rad, up to which all that are tried survive; 0 if not even `least` does.

    It is measured from the fixed point of the method, which for a splitting is O(h^2) away from the true one. Where the
    method has none that four steps can find, nothing survives.
    """
    centre = trace(method, where, h).theta
    if not math.isfinite(centre):
        return 0.0
    good = 0.0
    for value in np.geomspace(least, most, 12):
        if not survives(method, where, centre, float(value), h, steps):
            bad = float(value)
            break
        good = float(value)
    else:
        return good
    for _ in range(rounds if good else 0):
        middle = math.sqrt(good * bad)
        good, bad = (middle, bad) if survives(method, where, centre, middle, h, steps) else (good, middle)
    return good


class Horizon(NamedTuple):
    """How long a run near the separatrix is worth anything."""

    error: float  # axis error at `SEEN`, rad
    reached: float  # first time at which it passes `LOST`; NaN if it does not, or the run ended before
    predicted: float  # from the error at `SEEN`


SEEN = 6.0  # 1/g


def separatrix_horizon(method: Integrator, where: Scene, setting: float, longest: float = 80.0) -> Horizon:
    """When the axis error passes `LOST`; `setting` is the step in units of 1/g, or the tolerance."""
    g = math.sqrt(where.top.mgl / where.top.I1)
    chart = chart_of(method)
    if method.knob == "step_size":
        count = round(longest / setting)
        marks = np.unique(np.linspace(0, count, 1601).astype(np.int64))
        _, run = _run(method, where, where.start, setting / g, marks)
        times = marks * (setting / g)
    else:
        times = np.linspace(0.0, longest, 1601) / g
        with np.errstate(all="ignore"):
            plan = Plan(times, float(times[-1]), math.nan, np.empty(0, dtype=np.int64), setting)
            run = method.solvers[chart](where.top, where.start, plan)
    error = charts.axis_distance(axes(chart, run.states), closed_form(where).axis(times))
    early = float(error[np.searchsorted(times, SEEN / g * (1.0 - 1e-12))])
    past = np.flatnonzero(error > LOST)
    reached = float(times[past[0]]) if past.size else math.nan
    return Horizon(early, reached, SEEN / g + 2.0 / g * math.log(LOST / early) if early > 0.0 else math.nan)


def axes(chart: str, states: Array) -> Array:
    """The axes of states of a chart."""
    if chart == "angles":
        return charts.axis_from_angles(states[:, 0], states[:, 2])
    return states[:, :3] if chart == "axis" else charts.axis_from_quaternion(states[:, :4])


def energies(where: Scene, chart: str, run: Run) -> Array:
    """The energies of a run's samples."""
    if chart == "angles":
        found: Array = where.top.reduced_energy(run.states[:, 0], run.states[:, 1], run.p_phi, run.p_psi)
    else:
        found = space_energy(where.top, axes(chart, run.states), run.states[:, -3:], run.p_psi)
    return found


def sampled_energy_error(method: Integrator, where: Scene, steps: int, periods: int) -> tuple[float, float]:
    """Largest |E - E0| seen once a nutation, and at every step; `steps` make one nutation."""
    marks = np.arange(steps * periods + 1)
    chart, run = _run(method, where, where.start, where.nutation_period / steps, marks)
    error = np.abs(energies(where, chart, run) - where.top.energy(where.start))
    return float(error[steps::steps].max()), float(error.max())


# ---- the solver of an implicit method --------------------------------------------------------------------------------

_force = register_jitable(model.effective_force)
_stiffness = register_jitable(model.effective_stiffness)


def _plain_midpoint(par, theta, p, h, tolerance, iterations, marks, found):  # type: ignore[no-untyped-def]
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
        found[j, 0], found[j, 1] = theta, p
    return True


@functools.cache
def _compiled_plain() -> Any:
    return compile_kernel(_plain_midpoint, _plain_midpoint, model.effective_force)


class SolverError(NamedTuple):
    """What an unsolved equation did to the constants of the motion; NaN beyond a failure."""

    energy: float  # largest |E - E0|
    momentum: float  # largest |p - p0| of p_phi and p_psi; NaN where they are parameters
    iterations: float  # a step


def plain_midpoint(where: Scene, h: float, steps: int, tolerance: float, iterations: int = 50) -> SolverError:
    """The textbook's midpoint rule, whose Newton iteration stops after a correction of at most `tolerance` rad."""
    par, state = reduced(where.top, where.start)
    marks = np.unique(np.linspace(0, steps, 4001).astype(np.int64))
    found = np.full((marks.size, 2), math.nan)
    _compiled_plain()(par, state[0], state[1], h, tolerance, iterations, marks, found)
    momenta = where.top.momenta(where.start)
    with np.errstate(all="ignore"):
        energy = where.top.reduced_energy(found[:, 0], found[:, 1], momenta.p_phi, momenta.p_psi)
    return SolverError(float(np.nanmax(np.abs(energy - energy[0]))), math.nan, math.nan)


def solver_sweep(method: Integrator, where: Scene, h: float, steps: int, tolerance: float) -> SolverError:
    """A discrete Lagrangian of this package, its iteration stopped at `tolerance` of the increment (inf: after one)."""
    rule = discrete_lagrangian.rule_of(method)
    if rule is None:
        return SolverError(math.nan, math.nan, math.nan)
    par, state = reduced(where.top, where.start)
    marks = np.unique(np.linspace(0, steps, 4001).astype(np.int64))
    done = discrete_lagrangian.march(par, rule._replace(tolerance=tolerance), state, h, marks)
    momenta = where.top.momenta(where.start)
    with np.errstate(all="ignore"):
        energy = where.top.reduced_energy(done.states[:, 0], done.states[:, 1], momenta.p_phi, momenta.p_psi)
        lost = np.abs(done.momenta[1:] - np.array([momenta.p_phi, momenta.p_psi]))
    return SolverError(
        float(np.nanmax(np.abs(energy - energy[0]))), float(np.nanmax(lost)), done.work / max(done.steps, 1)
    )
