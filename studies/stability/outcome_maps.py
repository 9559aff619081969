"""Outcome maps: what became of some 10^4 runs of one integrator over two parameters.

One axis is a family of scenes, the other the integrator's knob: the step in nutation periods, or the tolerance. A
*spin* family is one scene with its spin changed, in units of the spin that lets it sleep upright, r = I3 w3 / (2
sqrt(I1 mgl)): a pendulum at r = 0.1, a fast gyroscope at r = 30. The *grazing* family passes a pole at a distance of
1.1 delta. Every run is judged by `verdicts.judge` against the closed form.

A map costs what its steps cost. Runs go straight to the integrator's solver, with 20 to 60 us between them; all runs of
one scene share one evaluation of the truth and one judgement, at times that are the same fractions of a nutation for
every spin. Nothing is sampled commensurately with the nutation.
"""

import functools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from symtop.measure.errors import energy_scale, momentum_scale
from symtop.measure.verdicts import ROUNDING, barriers, judge
from symtop.methods.outcomes import OUTCOMES
from symtop.methods.registry import Integrator, Plan
from symtop.model import charts
from symtop.model.scenes import Scene, closed_form, grazing, scene
from symtop.model.top import Angles
from symtop.run.simulation import sample_times, space_energy

NOT_RUN = 255
SAMPLES = 49
Array = NDArray[np.float64]


def spin_unit(where: Scene) -> float:
    """The spin w3 at which the top of a scene begins to sleep upright; without gravity, that of one radian a unit."""
    top = where.top
    return 2.0 * math.sqrt(top.I1 * abs(top.mgl)) / top.I3 or 1.0


def with_spin(where: Scene, ratio: float) -> Scene:
    """The scene with its spin w3 changed to `ratio` times `spin_unit`; inclination and its other rates stay."""
    at = where.start
    spin = math.copysign(ratio * spin_unit(where), at.spin)
    start = Angles(at.theta, at.phi, at.psi, at.theta_dot, at.phi_dot, spin - at.phi_dot * math.cos(at.theta))
    return Scene(f"{where.name}-spin-{ratio:.6g}", where.top, start, where.horizon, where.purpose, where.observes)


def family(name: str) -> Callable[[float], Scene]:
    """The scenes of a map by their parameter: the gap delta for `grazing`, the relative spin for any other scene."""
    return grazing if name == "grazing" else functools.partial(with_spin, scene(name))


class Ladder(NamedTuple):
    """The runs of one row of a map: a knob's values, and when each run is sampled, in nutation periods."""

    method: Integrator
    knob: tuple[float, ...]
    steps: tuple[int, ...]  # of each run; empty unless the step is fixed
    marks: tuple[NDArray[np.int64], ...]  # in steps; empty unless the step is fixed
    phases: Array  # (runs, SAMPLES), NaN beyond the last sample of a run


def ladder(method: Integrator, knob: Sequence[float], periods: float) -> Ladder:
    """Runs over `periods` nutations, at least; a fixed step fits in a whole number of times."""
    phases = np.full((len(knob), SAMPLES), math.nan)
    if method.knob != "step_size":
        phases[:] = sample_times(periods, SAMPLES, 1.0)[0]
        return Ladder(method, tuple(knob), (), (), phases)
    steps, marks = [], []
    for k, value in enumerate(knob):
        count = math.ceil(periods / value - 1e-9)
        times, places, _ = sample_times(count * value, SAMPLES, 1.0, count)
        steps.append(count)
        marks.append(places)
        phases[k, : times.size] = places * value
    return Ladder(method, tuple(knob), tuple(steps), tuple(marks), phases)


class Row(NamedTuple):
    """What became of the runs of one row."""

    verdict: NDArray[np.uint8]  # index into VERDICTS
    axis_error: Array  # largest over the run; NaN if it ended early


def row(runs: Ladder, where: Scene) -> Row:
    """Run and judge one row of a map: one scene at every setting of the knob."""
    chart = next(chart for chart in ("axis", "angles", "attitude") if chart in runs.method.solvers)
    period = where.nutation_period
    outcome = np.zeros(len(runs.knob), dtype=np.int64)
    shape = runs.phases.shape
    width = {"angles": 4, "axis": 6, "attitude": 7}[chart]
    states, momenta = np.full((*shape, width), math.nan), np.full((2, *shape), math.nan)
    with np.errstate(all="ignore"):
        for k, value in enumerate(runs.knob):
            run = runs.method.solvers[chart](where.top, where.start, _plan(runs, k, value, period))
            count = len(run.p_phi)
            states[k, :count] = run.states
            momenta[0, k, :count], momenta[1, k, :count] = run.p_phi, run.p_psi
            outcome[k] = OUTCOMES.index(run.outcome)
            if outcome[k] == 0 and not np.isfinite(run.states).all():
                outcome[k] = OUTCOMES.index("not_finite")
        return _judged(where, chart, runs.phases, states, momenta, outcome)


def _plan(runs: Ladder, k: int, value: float, period: float) -> Plan:
    if runs.method.knob == "step_size":
        h = value * period
        return Plan(np.multiply(runs.marks[k], h, dtype=float), runs.steps[k] * h, h, runs.marks[k], math.nan)
    times = runs.phases[k] * period
    return Plan(times, float(times[-1]), math.nan, np.empty(0, dtype=np.int64), value)


def _judged(where: Scene, chart: str, phases: Array, states: Array, momenta: Array, outcome: NDArray[np.int64]) -> Row:
    p_phi, p_psi = momenta
    if chart == "angles":
        theta, p_theta, phi = states[..., 0], states[..., 1], states[..., 2]
        axis = charts.axis_from_angles(theta, phi)
        energy = where.top.reduced_energy(theta, p_theta, p_phi, p_psi)
    else:
        axis = states[..., :3] if chart == "axis" else charts.axis_from_quaternion(states[..., :4])
        theta = charts.theta_from_axis(axis)
        energy = space_energy(where.top, axis, states[..., -3:], p_psi)
    drift = np.abs(energy - energy[:, :1]) / energy_scale(where)
    half = SAMPLES // 2
    early, late = np.fmax.reduce(drift[:, :half], axis=1), np.fmax.reduce(drift[:, half:], axis=1, initial=0.0)
    few = ~np.isfinite(phases[:, half])  # a run of few steps: its halves are counted in its own samples
    for k in np.flatnonzero(few):
        own = drift[k, np.isfinite(phases[k])]
        early[k], late[k] = own[: own.size // 2].max(initial=0.0), own[own.size // 2 :].max(initial=0.0)
    error = np.fmax.reduce(charts.axis_distance(axis, _true_axis(where, phases)), axis=1)
    error[outcome != 0] = math.nan
    start = where.top.momenta(where.start)
    least, passed = ROUNDING * momentum_scale(where), np.zeros(len(outcome), dtype=bool)
    for gap, now in ((start.north, p_phi - p_psi), (start.south, p_phi + p_psi)):
        if abs(gap) > least:
            passed |= (now * gap < 0.0).any(axis=1)
    low, high = np.fmin.reduce(theta, axis=1), np.fmax.reduce(theta, axis=1)
    return Row(judge(_barriers(where), outcome, error, low, high, early, late, passed), error)


_barriers = functools.lru_cache(maxsize=512)(barriers)
_kept: dict[tuple[Scene, bytes], Array] = {}
MOST_KEPT = 400  # a third of a megabyte each


def _true_axis(where: Scene, phases: Array) -> Array:
    """The true axis at fractions of a nutation, NaN where they are; the last few hundred rows are kept."""
    key = (where, phases.tobytes())
    if key not in _kept:
        if len(_kept) >= MOST_KEPT:
            _kept.clear()
        good = np.isfinite(phases)
        axis = np.full((*phases.shape, 3), math.nan)
        axis[good] = closed_form(where).axis(phases[good] * where.nutation_period)
        _kept[key] = axis
    return _kept[key]


class Map(NamedTuple):
    """One integrator's map; rows are scenes of the family, columns settings of the knob."""

    verdict: NDArray[np.uint8]
    axis_error: Array


def outcome_map(
    name: str, parameters: Sequence[float], method: Integrator, knob: Sequence[float], periods: float
) -> Map:
    """Run and judge a whole map of the family of scenes called `name`."""
    runs, scenes = ladder(method, knob, periods), family(name)
    rows = [row(runs, scenes(float(value))) for value in parameters]
    return Map(np.stack([entry.verdict for entry in rows]), np.stack([entry.axis_error for entry in rows]))
