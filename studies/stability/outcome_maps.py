"""Outcome maps: the outcomes of some 10^4 runs of one integrator, over two parameters.

The columns of a map are settings of the integrator's control: steps in nutation periods, or tolerances. Its rows are
scenes of a family. A *spin* family is one scene with its spin changed, in units of the spin that lets it sleep upright,

    r = I3 w3 / (2 sqrt(I1 mgl)),

so that it is a pendulum at r = 0.1 and a fast gyroscope at r = 30. The *grazing* family falls past a pole at a distance
of 1.1 delta. Every run is compared with the closed form.

Compiled methods run whole columns of a map in one call, in lanes where the method has them: the runs of a column have
equally many steps, so that all lanes end together. Runs of other methods follow each other. The constants of a row's
closed form are computed once, and all runs are judged in compiled passes (`many_verdicts`). Samples are
taken at the same fractions of a nutation for every spin, and these are not commensurate with the nutation.

Half of the steps of the runs in a map belong to its shortest octave of step sizes, where most methods are accurate. So
a map is run from long steps to short ones, and a scene that was accurate at every step over a factor of 2 (at every
tolerance over a factor of 10, at four settings at least) has *settled*: of shorter ones it is run only at five, evenly
over the map, as a check. If it is not accurate at one of them, it is run at every setting. In full runs of all 134
maps, all 5.2 million cells that this leaves out were accurate. With a factor of 1.5, 4 of 4.8 million were not.
"""

import functools
import math
from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from symtop.methods.framework.calling import solve
from symtop.methods.framework.loop import FixedStep
from symtop.methods.framework.plan import OUTCOMES, Plan
from symtop.methods.framework.registry import Integrator
from symtop.model import charts, scenes
from symtop.model.charts import Array
from symtop.model.scenes import Scene
from symtop.model.top import Angles, flat
from symtop.run.simulation import sample_times

from .many_verdicts import RunVerdicts, judge_runs, truths

NOT_RUN, SETTLED = 255, 254  # stored where a map has no run, and where a run was not made as it would be accurate
SAMPLES = 49  # of a run
MOST = 100_000  # limit on the samples of the runs in one call: 6 MB, which fit in the cache better than 26
SPAN = 1.1  # largest ratio of settings in one call: a scene that settles among them is run at all of them
SETTLED_STEPS, SETTLED_TOLERANCES = 2.0, 10.0  # a scene settles if it is accurate at all settings over this factor
SETTLED_AFTER = 4  # least number of these settings
BUDGET = 2e6  # force evaluations: a run at a tolerance of 1e-10 takes 1e5, one whose steps shrink to nothing 1e8
CHECKED = 5  # settings, evenly over the map, at which all scenes are run


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


class RowRuns(NamedTuple):
    """The runs of some rows of a map at some of its settings; NaN after a failure."""

    states: Array  # (rows, settings, samples, dimension)
    momenta: Array  # (rows, settings, samples, 2): p_phi and p_psi
    outcome: NDArray[np.int64]  # (rows, settings), indices into OUTCOMES


def one_by_one(runs: RowPlan, chart: str, scene: Scene, columns: slice = slice(None)) -> RowRuns:
    """The runs of one row by one call of the solver each; NaN beyond the last sample of a run, too."""
    period, settings, phases, marks = (
        scene.nutation_period, runs.settings[columns], runs.phases[columns], runs.marks[columns]
    )  # fmt: skip
    states, momenta = (np.full((1, *phases.shape, size), math.nan) for size in (charts.DIMENSIONS[chart], 2))
    outcome = np.zeros((1, len(settings)), dtype=np.int64)
    for k, value in enumerate(settings):
        plan = Plan.steps(value * period, marks[k]) if marks else Plan.until(phases[k] * period, value, BUDGET)
        run = solve(runs.method, chart, scene.top, scene.start, plan)
        count = len(run.p_phi)
        states[0, k, :count] = run.states
        momenta[0, k, :count, 0], momenta[0, k, :count, 1] = run.p_phi, run.p_psi
        outcome[0, k] = OUTCOMES.index(run.outcome)
    return RowRuns(states, momenta, outcome)


def together(runs: RowPlan, solver: FixedStep, columns: slice, tops: Array, periods: Array) -> RowRuns:
    """The runs of all rows at settings that are sampled equally often, in one call, to the same bits.

    `tops` (rows, 9) as `flat` has them, `periods` (rows,) of their nutations: two bisections each, which are not
    repeated for every group of settings.
    """
    marks, settings = np.array(runs.marks[columns]), runs.settings[columns]
    h = np.outer(periods, settings)
    run = solver.many(np.repeat(tops, len(settings), axis=0), h.ravel(), np.tile(marks, (len(tops), 1)))
    return RowRuns(*(values.reshape(*h.shape, *values.shape[1:]) for values in (run.states, run.momenta, run.outcome)))


def group_below(runs: RowPlan, end: int, n: int, alone: Collection[int]) -> int:
    """Index of the first of the successive settings up to `end` (exclusive) that are run in one call for n rows.

    They are sampled equally often, have no more than `MOST` samples and differ by a factor `SPAN` at most. A setting
    that is in `alone` is by itself.
    """
    first, size = end - 1, _samples(runs, end - 1)
    if first in alone:
        return first
    while (
        first > 0
        and first - 1 not in alone
        and _samples(runs, first - 1) == size
        and (end - first + 1) * size * n <= MOST
        and runs.settings[end - 1] <= SPAN * runs.settings[first - 1]
    ):
        first -= 1
    return first


def _samples(runs: RowPlan, k: int) -> int:
    return runs.marks[k].size if runs.marks else SAMPLES


class MapVerdicts(NamedTuple):
    """A map of n scenes and m settings."""

    verdict: NDArray[np.uint8]  # (n, m), index into VERDICTS; accurate where nothing was run
    axis_error: Array  # (n, m), rad; NaN if a run ended early, or was not made
    made: NDArray[np.bool_]  # (n, m): was it run?
    checks: int  # runs of scenes that had settled
    refuted: int  # scenes that had settled and were then not accurate, of which every setting is run


class _Descent:
    """A map that is run from long steps to short ones, or from loose tolerances to tight ones."""

    def __init__(
        self, name: str, parameters: Sequence[float], method: Integrator, settings: Sequence[float], periods: float,
        followed: Sequence[int] | None,
    ) -> None:  # fmt: skip
        self.runs = row_plan(method, settings, periods)
        self.scenes = list(map(family(name), map(float, parameters)))
        self.truth, self.chart = truths(self.scenes), method.chart_for("axis")
        solver = method.solvers[self.chart]
        self.solver = solver if isinstance(solver, FixedStep) and not solver.in_python else None
        self.tops = np.array([flat(scene.top, scene.start) for scene in self.scenes])
        n, m = len(self.scenes), len(settings)
        self.followed = np.zeros(m, dtype=bool)
        self.followed[slice(None) if followed is None else list(followed)] = True
        checks = np.linspace(0, m - 1, CHECKED).round().astype(int)
        self.of_all = frozenset(np.union1d(np.flatnonzero(self.followed), checks).tolist())  # where all scenes are run
        self.judged, self.made = RunVerdicts.empty(n, m), np.zeros((n, m), dtype=bool)
        self.factor = SETTLED_STEPS if method.fixed_step else SETTLED_TOLERANCES
        self.since, self.accurate = np.full(n, math.nan), np.zeros(n, dtype=np.int64)  # how long a scene has been so
        self.settled, self.refuted, self.checks = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool), 0

    def descend(self) -> MapVerdicts:
        """Run every setting that has to be run."""
        end = len(self.runs.settings)
        while end > 0:
            rows = np.flatnonzero(~self.settled)
            first = group_below(self.runs, end, rows.size, self.of_all)
            if first in self.of_all:
                rows = np.arange(len(self.scenes))
            if rows.size:
                self._run(rows, slice(first, end))
                self._settle(rows, slice(first, end))
            end = first
        for k in np.flatnonzero(~self.made[self.refuted].all(axis=0)):
            self._run(np.flatnonzero(self.refuted & ~self.made[:, k]), slice(k, k + 1))
        return MapVerdicts(*self.judged, self.made, self.checks, int(self.refuted.sum()))

    def _run(self, rows: NDArray[np.int64], columns: slice) -> None:
        """Run and judge some scenes at neighbouring settings."""
        if self.solver is None:
            row_runs = [one_by_one(self.runs, self.chart, self.scenes[row], columns) for row in rows]
            results = RowRuns(*(np.concatenate(parts) for parts in zip(*row_runs, strict=True)))
        else:
            results = together(self.runs, self.solver, columns, self.tops[rows], self.truth.periods[rows])
        verdicts = judge_runs(self.truth.part(rows), self.runs.phases[columns], self.followed[columns], *results)
        self.judged.verdict[rows, columns], self.judged.axis_error[rows, columns] = verdicts
        self.made[rows, columns] = True

    def _settle(self, rows: NDArray[np.int64], columns: slice) -> None:
        """Update which scenes have settled, after runs of some scenes at neighbouring settings."""
        before = self.settled[rows]
        for k in reversed(range(columns.start, columns.stop)):
            good = self.judged.verdict[rows, k] == 0
            self.accurate[rows] = np.where(good, self.accurate[rows] + 1, 0)
            self.since[rows] = np.where(self.accurate[rows] == 1, self.runs.settings[k], self.since[rows])
            self.refuted[rows] |= before & ~good
            self.checks += int(before.sum())
        long_enough = self.since[rows] >= self.factor * self.runs.settings[columns.start]
        self.settled[rows] = (self.accurate[rows] >= SETTLED_AFTER) & long_enough & ~self.refuted[rows]


def outcome_map(
    name: str, parameters: Sequence[float], method: Integrator, settings: Sequence[float], periods: float,
    followed: Sequence[int] | None = None,
) -> MapVerdicts:  # fmt: skip
    """Run and judge a whole map of the family of scenes called `name`: a row a scene, a column a setting, growing.

    Every scene is run at the settings `followed`, all if it is None; there axis errors are the largest of a run. At
    other settings the axis error of an inaccurate run is any one that is too large.
    """
    return _Descent(name, parameters, method, settings, periods, followed).descend()
