"""The error of a run, forecast from a short piece of it before it starts.

The method itself is run for two nutations or a tenth of the run, and compared with the closed form (0.2 us a point). A
nutation is a closed orbit of the reduced top; its return map is 1 + N with N^2 = 0 (the motion is integrable:
errors shear, they do not grow exponentially), so that an error e_1 of one piece becomes after n pieces

    e_n = n e_1 + n (n-1)/2 N e_1,      N e_1 = e_2 - 2 e_1.

Symplectic and symmetric methods commit no error along which N shears, and theirs grows linearly. Where two nutations
cost too much, the probe takes a coarser step and scales its error by the declared order; the passage of a pole is
then probed by itself at the step of the run.
Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, chapters X.3 and XI.3.
"""

import functools
import math
from typing import Any, NamedTuple

import numpy as np

from symtop.core.numbers import GOLDEN
from symtop.methods.framework.calling import solve
from symtop.methods.framework.plan import Plan, Run
from symtop.methods.framework.registry import Integrator, integrator
from symtop.model import charts
from symtop.model.charts import axes
from symtop.model.scenes import Scene, closed_form
from symtop.model.top import Angles, SymmetricTop
from symtop.run.reference.sensitivity import SMALL, displacement

STEPS = {"compiled": 2000, "python": 50}  # a probe of two nutations may take these, 0.05 to 3 ms
AT_LEAST = 0.25  # of them a probe takes in any case, up to the whole run
SHARE = 0.1  # of the run, which a probe may always take, but no more than the next two:
MOST_NUTATIONS = 20.0
MOST_STEPS = 20_000  # 0.6 ms of Stormer-Verlet
POINTS = 300  # of a probe that are compared with the closed form
ROUNDED = 1e-13  # rad; a probe that is closer than this shows rounding, which grows as n^1.5
PARTIAL = 10.0  # distrust of a probe shorter than a nutation: it may have missed where errors are made, or stretched
AFFORDED = {"compiled": 12_000, "python": 1200}  # evaluations of a longer probe of an adaptive method: 0.2 to 5 ms
MOST_WORK = {"compiled": 5e6, "python": 5e5}  # evaluations of any probe: 20 nutations take a hundredth; beside a pole
# the steps of a solver may shrink to nothing, and the probe would take as long as the run
LOOSE = 1e-4  # tolerance from which a method in Python is probed for a whole nutation: a few of its steps, milliseconds
LEAST_GROWTH = 0.05  # of the error of a piece: less growth from the first to the second is luck
COMMITTED = 1e4, 1e7  # tolerances: an error that an adaptive method commits now and then, and one of variable order
CLOSE, PASSING = 0.2, 100.0  # rad from a pole; tolerances that a step past it in the angles chart commits now and then
UNSTABLE = 50.0  # times that a stable motion may amplify a change of its start in a nutation
WORTH = 1e-2  # rad: a law that grows an error faster is looked into where it leads beyond this
RESOLVED = 0.3  # rad that the axis may precess in one step at a pole: coarser probes say nothing about the passage


class Landmarks(NamedTuple):
    """What is known exactly about a motion before it is computed."""

    period: float  # of the nutation
    frequency: float  # of small nutations about the steady precession with the same momenta
    width: float  # of the nutation, rad
    gap: float  # closest approach to a pole, rad
    pole: str  # upper or lower
    rate: float  # of precession there, rad per unit time
    shear: float  # relative change of the period when the start is moved by rounding


@functools.lru_cache(maxsize=256)
def _landmarks(top: SymmetricTop, at: Angles) -> Landmarks:
    form = closed_form(Scene("landmarks", top, at, 1.0))
    momenta = top.momenta(at)
    highest, lowest = form.theta_range
    upper = highest <= math.pi - lowest
    gap = highest if upper else math.pi - lowest
    near, far = (momenta.north, momenta.south) if upper else (momenta.south, momenta.north)
    sine = math.sin(0.5 * gap) ** 2
    rate = abs(far / math.cos(0.5 * gap) ** 2 + (near / sine if sine > 0.0 else 0.0)) / (4.0 * top.I1)
    moved = [Scene("landmarks", top, at, 1.0).nutation_period]  # kept: the plan has asked for it
    moved += [
        top.nutation_period(Angles(at.theta, at.phi, at.psi, at.theta_dot, at.phi_dot * (1.0 + turn), at.psi_dot))
        for turn in (-4e-16, 4e-16)
    ]
    spread = max(moved) - min(moved)
    shear = spread / max(moved) if math.isfinite(spread) else 1.0
    pole, frequency = "upper" if upper else "lower", top.nutation_frequency(momenta)
    return Landmarks(form.nutation_period, frequency, lowest - highest, gap, pole, rate, shear)


def landmarks(scene: Scene) -> Landmarks:
    """The landmarks of a scene's motion; made once and kept."""
    return _landmarks(scene.top, scene.start)


class Probe(NamedTuple):
    """A short run compared with the closed form."""

    times: charts.Array
    error: charts.Array  # of the axis, rad; inf where the run had failed
    outcome: str
    reached: float  # time of the run, not of the probe
    evaluations: int  # of the force


class Forecast(NamedTuple):
    """The forecast of one run."""

    axis_error: float  # expected largest, rad; inf if the probe did not get through, 0 if there is nothing to probe
    rounding: float  # what rounding alone will make of it, rad: large on a separatrix, whatever the method
    steps_per_nutation: float  # nan for an adaptive method
    passage: float  # rad of precession in one step at the closest approach to a pole; nan for an adaptive method
    outcome: str  # of the probe
    reached: float
    unstable: float = 0.0  # what the motion makes of an error of the tolerance, rad; 0 where a probe shows it
    whole: bool = False  # the probe was as long as the run


@functools.cache
def _places() -> charts.Array:
    """Where a probe of length `POINTS` is sampled: not commensurate with the nutation."""
    place = np.arange(1.0, POINTS + 1.0)
    place[:-1] += np.mod(GOLDEN * place[:-1], 1.0) - 0.5
    return place


@functools.lru_cache(maxsize=256)
def _marks(steps: int) -> Any:
    """The same in whole steps of a probe; 25 us, and the steps of a probe are few numbers (`STEPS`)."""
    return np.unique(np.maximum(np.rint(_places() * (steps / POINTS)).astype(np.int64), 1))


def repeats(method: Integrator, plan: Plan) -> bool:
    """Would the probe of a run repeat the whole of it, every step of which is shown?

    Only compiled methods are said to: a run of theirs that is thrown away costs 30 us.
    """
    if not method.fixed_step or method.implementation != "compiled":
        return False
    steps = plan.marks.size - 1
    return 0 < steps == plan.marks.item(-1) <= AT_LEAST * STEPS["compiled"]


def _read_off(done: Run, plan: Plan, piece: Plan) -> Run | None:
    """The run of a probe from the run itself, the same bits; None if it is another, or something went wrong in it."""
    every = piece.step_size == plan.step_size and piece.marks.item(-1) == plan.marks.item(-1) == plan.marks.size - 1
    return done._replace(states=done.states[piece.marks]) if every and done.outcome == "ok" else None


def _probe(
    scene: Scene, method: Integrator, chart: str, plan: Plan, duration: float, step: float, since: float = 0.0,
    done: Run | None = None,
) -> Probe:  # fmt: skip
    """Run `method` from the time `since` of the true motion for `duration`, with `step` or the plan's tolerance.

    A probe from the start that repeats the run, which may be `done`, is read off it.
    """
    form, start = closed_form(scene), scene.start
    if since:
        start = Angles(*(float(value) for value in form(since)))
    if method.fixed_step:
        piece = Plan.steps(step, _marks(max(1, round(duration / step))))
    else:
        piece = Plan.until(
            duration * (_places() / POINTS), plan.tolerance, min(plan.most(math.inf), MOST_WORK[method.implementation])
        )
    run = _read_off(done, plan, piece) if done is not None and not since else None
    if run is None:
        run = solve(method, chart, scene.top, start, piece)
    with np.errstate(all="ignore"):
        error = form.axis_distance(since + piece.times, axes(chart, np.asarray(run.states)))
    outcome = run.outcome
    if not (finite := np.isfinite(error)).all():
        error[~finite] = math.inf
        outcome = "not_finite" if outcome == "ok" else outcome
    return Probe(piece.times, error, outcome, since + run.reached, run.force_evaluations)


def grown(probe: Probe, horizon: float, *, straight: bool) -> float:
    """The largest error of a probe, grown to the horizon; `straight` if the method's error grows linearly."""
    half = 0.5 * float(probe.times[-1])
    whole = float(probe.error.max())
    n = horizon / half
    if n <= 2.0 * (1.0 + 1e-9) or not math.isfinite(whole):
        return whole
    if whole < ROUNDED:
        return whole * math.pow(0.5 * n, 1.5)
    first = float(probe.error[probe.times <= half].max(initial=0.0))
    if straight:
        return whole + max(whole - first, LEAST_GROWTH * whole) * (n - 2.0)
    return n * first + 0.5 * max(abs(whole - 2.0 * first), LEAST_GROWTH * whole) * n * (n - 1.0)


def _amplifies(scene: Scene, change: float, horizon: float, marks: Landmarks) -> bool:
    """Whether the motion multiplies a change of its start by far more than the shear of a stable one does."""
    return displacement(scene, change, horizon) > change * UNSTABLE * (1.0 + horizon / marks.period)


def _fixed(scene: Scene, method: Integrator, probe: Probe, horizon: float, marks: Landmarks) -> float:
    """The largest error of a probe of steps, grown to the horizon.

    What rounding, or the end of an iteration, leaves is not symmetric, and an unstable motion makes it grow in every
    nutation: there a symmetric method is no better than others (`galerkin-simpson` on a top let go 3e-7 rad from
    upright was wrong by 0.02 rad after 47 nutations and by 1 rad after 300).
    """
    straight = bool(method.symplectic or method.symmetric)
    expected = grown(probe, horizon, straight=straight)
    if not straight or not expected < WORTH:
        return expected
    bent = grown(probe, horizon, straight=False)
    if bent > WORTH and _amplifies(scene, SMALL, horizon, marks):
        return bent
    return expected


def _unstable(scene: Scene, method: Integrator, plan: Plan, marks: Landmarks) -> float:
    """What becomes of the errors of an adaptive method by the horizon, rad; 0 if the motion is stable.

    A method in Python is probed for less than the run, and an unstable motion amplifies what it does elsewhere. In 44
    runs of SciPy's methods beside an unstable motion that were wrong, the error was up to 3600 times the displacement
    by one tolerance for those of a fixed order, and up to 1.6e6 times for LSODA, which takes long steps of a high order
    while the top stands almost still; half of the errors were below twice the displacement.
    """
    if not _amplifies(scene, plan.tolerance, plan.horizon, marks):
        return 0.0
    committed = COMMITTED[method.order is None] * plan.tolerance
    return max(
        float(np.nan_to_num(displacement(scene, change, plan.horizon))) for change in (plan.tolerance, committed)
    )


def _closest_time(scene: Scene, period: float) -> float:
    """When the axis first comes closest to a pole."""
    form, middle, width = closed_form(scene), 0.5 * period, period
    for _ in range(4):
        times = middle + width * np.linspace(-0.5, 0.5, 129)
        middle, width = float(times[int(np.argmin(np.sin(form(times).theta)))]), width / 40.0
    return middle


def _adaptive(
    scene: Scene, method: Integrator, chart: str, plan: Plan, period: float, share: float, twice: float
) -> tuple[float, Probe]:
    """The same of an adaptive method, whose work is known when a first piece has been probed.

    Where the work that is `AFFORDED` reaches further, the probe is taken again, as long as that, up to the whole run:
    then nothing is left to be grown. Elsewhere an error below what was asked for is luck.
    """
    cheap = method if method.same_steps_as is None else integrator(method.same_steps_as)  # a hundredth of the time
    least = twice if cheap.implementation == "compiled" else 0.5 * twice if plan.tolerance >= LOOSE else 0.0

    def probed(piece: float) -> tuple[float, Probe]:
        partial = piece < min(period, 0.5 * plan.horizon)
        since = max(0.0, _closest_time(scene, period) - 0.5 * piece) if partial else 0.0
        probe = _probe(scene, cheap, chart, plan, piece, math.nan, since)
        return grown(probe, plan.horizon, straight=False) * (PARTIAL if partial else 1.0), probe

    piece = max(share, least)
    expected, probe = probed(piece)
    afforded = AFFORDED[cheap.implementation] * min(cheap.speed, 1.0)
    longer = min(plan.horizon, piece * afforded / max(probe.evaluations, 1))
    if longer > 1.5 * piece:
        expected, probe = probed(longer)
    return expected if probe.times[-1] >= plan.horizon else max(expected, plan.tolerance), probe


def _expected(
    scene: Scene, method: Integrator, chart: str, plan: Plan, marks: Landmarks, done: Run | None
) -> tuple[float, Probe]:
    """The largest axis error to expect, and the probe that says so."""
    straight = bool(method.symplectic or method.symmetric)
    period = marks.period if math.isfinite(marks.period) else plan.horizon
    share, twice = min(SHARE * plan.horizon, MOST_NUTATIONS * period), min(2.0 * period, plan.horizon)
    if method.adaptive:
        return _adaptive(scene, method, chart, plan, period, share, twice)
    step = plan.step_size
    share = min(share, MOST_STEPS * step)
    allowed = max(STEPS[method.implementation] * step, share)
    if twice <= allowed:
        piece = max(twice, share, AT_LEAST * STEPS[method.implementation] * step)
        probe = _probe(scene, method, chart, plan, min(plan.horizon, piece), step, done=done)
        return _fixed(scene, method, probe, plan.horizon, marks), probe
    coarse = twice / round(allowed / step)
    probe = _probe(scene, method, chart, plan, twice, coarse)
    finer: float = (step / coarse) ** (method.order or 1)
    expected = _fixed(scene, method, probe, plan.horizon, marks) * finer
    if chart == "angles" and marks.rate * coarse > RESOLVED:
        since = max(0.0, _closest_time(scene, period) - 0.5 * allowed)
        if since < plan.horizon:
            probe = _probe(scene, method, chart, plan, min(allowed, plan.horizon - since), step, since)
            passages = max(1.0, plan.horizon / period)
            expected = float(np.max(probe.error)) * (passages if straight else passages**2)
    return expected, probe


def forecast(scene: Scene, method: Integrator, chart: str, plan: Plan, done: Run | None = None) -> Forecast:
    """Forecast the error of a run from a short run (a probe) of the same method; the run itself is not changed.

    A method without a step or a tolerance, such as the closed form, is not probed. `done` is the run, if it was made.
    """
    marks = landmarks(scene)
    steps, passage = marks.period / plan.step_size, marks.rate * plan.step_size
    if method.control is None:
        return Forecast(0.0, 0.0, steps, passage, "ok", plan.horizon)
    expected, probe = _expected(scene, method, chart, plan, marks, done)
    partly = method.adaptive and method.implementation == "python"
    partly = partly and not probe.times[-1] >= plan.horizon
    if partly and chart == "angles" and marks.gap < CLOSE:
        expected = max(expected, float(np.nan_to_num(displacement(scene, PASSING * plan.tolerance, plan.horizon))))
    unstable = _unstable(scene, method, plan, marks) if partly else 0.0
    turns = plan.horizon / marks.period
    rounding = marks.shear * 2.0 * math.pi * turns * min(marks.width, 1.0) if turns > 0.5 else 0.0
    whole = bool(probe.times[-1] >= plan.horizon * (1.0 - 1e-9))
    return Forecast(max(expected, unstable), rounding, steps, passage, probe.outcome, probe.reached, unstable, whole)
