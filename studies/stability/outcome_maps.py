"""Outcome maps: what became of some 10^4 runs of one integrator, over two parameters.

The columns of a map are settings of the integrator's control: steps in nutation periods, or tolerances. Its rows are
scenes of a family. A *spin* family is one scene with its spin changed, in units of the spin that lets it sleep upright,

    r = I3 w3 / (2 sqrt(I1 mgl)),

so that it is a pendulum at r = 0.1 and a fast gyroscope at r = 30. The *grazing* family falls past a pole at a distance
of 1.1 delta. `verdicts.judge` compares every run with the closed form.

A map costs what its steps cost. Runs go straight to the integrator's solver, with 20 to 60 us between them. All runs of
one scene share one evaluation of the truth (1 ms) and one judgement. Samples are taken at the same fractions of a
nutation for every spin, and these are not commensurate with the nutation.
"""

import functools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from symtop.measure.verdicts import barriers, judge, pole_passed
from symtop.methods.outcomes import OUTCOMES
from symtop.methods.plan import Plan
from symtop.methods.registry import Integrator, solve
from symtop.model import charts, scenes
from symtop.model.charts import Array
from symtop.model.scenes import Scene, closed_form
from symtop.model.top import Angles
from symtop.model.view import View
from symtop.run.simulation import sample_times

NOT_RUN = 255  # stored where a map has no run
SAMPLES = 49  # of a run


def spin_unit(scene: Scene) -> float:
    """The spin w3 at which the top of a scene begins to sleep upright; without gravity, that of one radian a unit."""
    top = scene.top
    return 2.0 * math.sqrt(top.I1 * abs(top.mgl)) / top.I3 or 1.0


def with_spin(scene: Scene, ratio: float) -> Scene:
    """The scene with its spin w3 changed to `ratio` times `spin_unit`; inclination and its other rates stay."""
    start = scene.start
    spin = math.copysign(ratio * spin_unit(scene), start.spin)
    psi_dot = spin - start.phi_dot * math.cos(start.theta)
    changed = Angles(start.theta, start.phi, start.psi, start.theta_dot, start.phi_dot, psi_dot)
    return Scene(f"{scene.name}-spin-{ratio:.6g}", scene.top, changed, scene.horizon, scene.purpose, scene.observes)


def family(name: str) -> Callable[[float], Scene]:
    """The scenes of a map by their parameter: the gap delta for `grazing`, the relative spin for any other scene."""
    return scenes.grazing if name == "grazing" else functools.partial(with_spin, scenes.scene(name))


class RowPlan(NamedTuple):
    """The runs of one row of a map: their settings, and when each is sampled, in nutation periods."""

    method: Integrator
    settings: tuple[float, ...]  # steps in nutation periods, or tolerances
    marks: tuple[NDArray[np.int64], ...]  # steps to each sample, the last to the end; empty unless the step is fixed
    phases: Array  # (runs, SAMPLES), NaN beyond the last sample of a run


def row_plan(method: Integrator, settings: Sequence[float], periods: float) -> RowPlan:
    """Runs over at least `periods` nutations: a whole number of steps where the step is fixed."""
    phases = np.full((len(settings), SAMPLES), math.nan)
    if not method.fixed_step:
        phases[:] = sample_times(periods, SAMPLES, 1.0)[0]
        return RowPlan(method, tuple(settings), (), phases)
    marks = []
    for k, value in enumerate(settings):
        count = math.ceil(periods / value - 1e-9)
        times, places, _ = sample_times(count * value, SAMPLES, 1.0, count)
        marks.append(places)
        phases[k, : times.size] = places * value
    return RowPlan(method, tuple(settings), tuple(marks), phases)


class Judged(NamedTuple):
    """What became of the runs of one row of a map, or of all its rows; the last dimension is that of the settings."""

    verdict: NDArray[np.uint8]  # index into VERDICTS
    axis_error: Array  # largest over the run; NaN if it ended early


def row(runs: RowPlan, scene: Scene) -> Judged:
    """Run and judge one row of a map: one scene at every setting."""
    chart = runs.method.chart_for("axis")
    period = scene.nutation_period
    outcome = np.zeros(len(runs.settings), dtype=np.int64)
    shape = runs.phases.shape
    states, momenta = np.full((*shape, charts.DIMENSIONS[chart]), math.nan), np.full((2, *shape), math.nan)
    for k, value in enumerate(runs.settings):
        plan = Plan.steps(value * period, runs.marks[k]) if runs.marks else Plan.until(runs.phases[k] * period, value)
        run = solve(runs.method, chart, scene.top, scene.start, plan)
        count = len(run.p_phi)
        states[k, :count] = run.states
        momenta[0, k, :count], momenta[1, k, :count] = run.p_phi, run.p_psi
        outcome[k] = OUTCOMES.index(run.outcome)
        if outcome[k] == 0 and not np.isfinite(run.states).all():
            outcome[k] = OUTCOMES.index("not_finite")
    with np.errstate(all="ignore"):
        return _judged(scene, View(chart, scene.top, states, *momenta), runs.phases, outcome)


def _judged(scene: Scene, seen: View, phases: Array, outcome: NDArray[np.int64]) -> Judged:
    energy = seen.energy
    drift = np.abs(energy - energy[:, :1]) / scene.energy_scale
    half = SAMPLES // 2
    early, late = np.fmax.reduce(drift[:, :half], axis=1), np.fmax.reduce(drift[:, half:], axis=1, initial=0.0)
    few = ~np.isfinite(phases[:, half])  # a run of few steps: its halves are counted in its own samples
    for k in np.flatnonzero(few):
        taken = drift[k, np.isfinite(phases[k])]
        early[k], late[k] = taken[: taken.size // 2].max(initial=0.0), taken[taken.size // 2 :].max(initial=0.0)
    # the truth is computed anew for each row: 1.1 ms for 200 runs, where the runs themselves take 8 ms and more
    good, true = np.isfinite(phases), np.full((*phases.shape, 3), math.nan)
    true[good] = closed_form(scene).axis(phases[good] * scene.nutation_period)
    error = np.fmax.reduce(charts.axis_distance(seen.axis, true), axis=1)
    error[outcome != 0] = math.nan
    passed = pole_passed(scene, seen.p_phi, seen.p_psi).any(axis=1)
    low, high = np.fmin.reduce(seen.theta, axis=1), np.fmax.reduce(seen.theta, axis=1)
    return Judged(judge(_barriers(scene), outcome, error, low, high, early, late, passed), error)


_barriers = functools.lru_cache(maxsize=512)(barriers)


def outcome_map(
    name: str, parameters: Sequence[float], method: Integrator, settings: Sequence[float], periods: float
) -> Judged:
    """Run and judge a whole map of the family of scenes called `name`: a row a scene, a column a setting."""
    runs, scene_at = row_plan(method, settings, periods), family(name)
    verdicts, errors = zip(*(row(runs, scene_at(float(value))) for value in parameters), strict=True)
    return Judged(np.stack(verdicts), np.stack(errors))
