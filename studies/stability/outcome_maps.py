"""Outcome maps: what became of some 10^4 runs of one integrator, over two parameters.

The columns of a map are settings of the integrator's control: steps in nutation periods, or tolerances. Its rows are
scenes of a family. A *spin* family is one scene with its spin changed, in units of the spin that lets it sleep upright,

    r = I3 w3 / (2 sqrt(I1 mgl)),

so that it is a pendulum at r = 0.1 and a fast gyroscope at r = 30. The *grazing* family falls past a pole at a distance
of 1.1 delta. `verdicts.judge` compares every run with the closed form.

Compiled methods run whole columns of a map in one call, in lanes where the method has them: the runs of a column have
equally many steps, so that no lane waits for another. Other methods run one after another. The constants of a row's
closed form are computed once, and all runs are judged in compiled passes (`symtop.measure.many_verdicts`). Samples are
taken at the same fractions of a nutation for every spin, and these are not commensurate with the nutation.
"""

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from symtop.measure.many_verdicts import Judged, judge_runs, truths
from symtop.methods.calling import solve
from symtop.methods.fixed_step import FixedStep
from symtop.methods.outcomes import OUTCOMES
from symtop.methods.plan import Plan
from symtop.methods.registry import Integrator
from symtop.model import charts, scenes
from symtop.model.charts import Array
from symtop.model.scenes import Scene
from symtop.model.top import Angles, flat
from symtop.run.simulation import sample_times

NOT_RUN = 255  # stored where a map has no run
SAMPLES = 49  # of a run
MOST = 100_000  # samples of the runs that are made in one call: 6 MB, which stay nearer to the processor than 26


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


class Made(NamedTuple):
    """The runs of some rows of a map at some of its settings; NaN after a failure."""

    states: Array  # (rows, settings, samples, dimension)
    momenta: Array  # (rows, settings, samples, 2): p_phi and p_psi
    outcome: NDArray[np.int64]  # (rows, settings), indices into OUTCOMES


def one_by_one(runs: RowPlan, chart: str, scene: Scene) -> Made:
    """The runs of one row by one call of the solver each; NaN beyond the last sample of a run, too."""
    period, shape = scene.nutation_period, runs.phases.shape
    states, momenta = np.full((1, *shape, charts.DIMENSIONS[chart]), math.nan), np.full((1, *shape, 2), math.nan)
    outcome = np.zeros((1, len(runs.settings)), dtype=np.int64)
    for k, value in enumerate(runs.settings):
        plan = Plan.steps(value * period, runs.marks[k]) if runs.marks else Plan.until(runs.phases[k] * period, value)
        run = solve(runs.method, chart, scene.top, scene.start, plan)
        count = len(run.p_phi)
        states[0, k, :count] = run.states
        momenta[0, k, :count, 0], momenta[0, k, :count, 1] = run.p_phi, run.p_psi
        outcome[0, k] = OUTCOMES.index(run.outcome)
    return Made(states, momenta, outcome)


def together(runs: RowPlan, solver: FixedStep, columns: slice, tops: Array, periods: Array) -> Made:
    """The runs of all rows at settings that are sampled equally often, in one call, to the same bits.

    `tops` (rows, 9) as `flat` has them, `periods` (rows,) of their nutations: two bisections each, which are not
    repeated for every group of settings.
    """
    marks, settings = np.array(runs.marks[columns]), runs.settings[columns]
    h = np.outer(periods, settings)
    done = solver.many(np.repeat(tops, len(settings), axis=0), h.ravel(), np.tile(marks, (len(tops), 1)))
    return Made(*(values.reshape(*h.shape, *values.shape[1:]) for values in (done.states, done.momenta, done.outcome)))


def columns_together(runs: RowPlan, n: int) -> Iterator[slice]:
    """Neighbouring settings that are sampled equally often, with no more than `MOST` samples of n rows."""
    counts = [marks.size for marks in runs.marks]
    first = 0
    while first < len(counts):
        end = first + 1
        while end < len(counts) and counts[end] == counts[first] and (end + 1 - first) * counts[first] * n <= MOST:
            end += 1
        yield slice(first, end)
        first = end


def outcome_map(
    name: str, parameters: Sequence[float], method: Integrator, settings: Sequence[float], periods: float,
    followed: Sequence[int] | None = None,
) -> Judged:  # fmt: skip
    """Run and judge a whole map of the family of scenes called `name`: a row a scene, a column a setting.

    The axis errors of inaccurate runs are the largest in the columns `followed`, in all if it is None; in the others
    they are some that are too large.
    """
    runs, family_scenes = row_plan(method, settings, periods), list(map(family(name), map(float, parameters)))
    truth, whole = truths(family_scenes), np.zeros(len(settings), dtype=bool)
    whole[slice(None) if followed is None else list(followed)] = True
    chart = method.chart_for("axis")
    solver = method.solvers[chart]
    if isinstance(solver, FixedStep) and not solver.in_python:
        pieces = [(slice(None), columns) for columns in columns_together(runs, len(family_scenes))]
        tops = np.array([flat(scene.top, scene.start) for scene in family_scenes])
        made = (together(runs, solver, columns, tops, truth.periods) for _, columns in pieces)
    else:
        pieces = [(slice(i, i + 1), slice(None)) for i in range(len(family_scenes))]
        made = (one_by_one(runs, chart, scene) for scene in family_scenes)
    judged = Judged.begun(len(family_scenes), len(settings))
    for (rows, columns), part in zip(pieces, made, strict=True):
        seen = judge_runs(truth.part(rows), runs.phases[columns], whole[columns], *part)
        judged.verdict[rows, columns], judged.axis_error[rows, columns] = seen
    return judged
