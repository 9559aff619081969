"""The guard: a warning, one sentence with a remedy, before a run whose error is expected to be large.

*The forecast.* The method itself is run for two nutations or a tenth of the run, and compared with the true motion
(`symtop.run.motion`): the closed form of a top, or an integration of high order. A nutation is a closed orbit of the
reduced top; its return map is 1 + N with N^2 = 0 (the motion is integrable: errors shear, they do not grow
exponentially), so that an error e_1 of one piece becomes after n pieces

    e_n = n e_1 + n (n-1)/2 N e_1,      N e_1 = e_2 - 2 e_1.

Symplectic and symmetric methods, and those that keep every constant, have N e_1 = 0: their error grows linearly. Where
two nutations cost too much, the probe takes a coarser step and scales its error by the declared order; the passage of a
pole is then probed separately at the step of the run. A probe in angles with long steps beside a pole, and one of a
free body near an unstable rotation, are made as long as allowed, because the errors of a few passages may cancel.

*The cause* is read from exact landmarks of the motion, in this order:

    instability   small nutations grow at every step (Verlet beyond h omega = 2)
    separatrix    the motion itself amplifies rounding until it decides the answer
    pole          the axis precesses by a radian or more in one step at its closest approach to a pole (angles only)
    aliasing      fewer than two steps a nutation
    resonance     a step turns the nutation by a third or a quarter of a turn (Verlet at h omega = sqrt 3)
    early end     the probe ended early, or the run will end early at the limit of its work
    no order      the error need not fall with the step: a term is left out, or rounding dominates
    departure     the unstable motion amplifies errors of the size of an adaptive method's tolerance
    growth        the errors of the nutations add up until the horizon

The guard never changes a run. Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, X.3 and XI.3.
"""

import functools
import math
from typing import Any, NamedTuple

import numpy as np

from symtop.core.numbers import EPSILON, GOLDEN
from symtop.methods.framework.calling import solve
from symtop.methods.framework.plan import LENGTH_OFF, QUATERNIONS, Plan, sentence
from symtop.methods.framework.registry import Integrator, integrator, is_built_in
from symtop.model.charts import Array
from symtop.model.scenes import Scene
from symtop.run.linear_stability import Growth, nutation_growth, trace
from symtop.run.motion import MOST_FOLDS, SHEAR, UNSTABLE_RATIO, ExactMotion, IntegratedMotion, Landmarks, Motion
from symtop.run.reference.sensitivity import SMALL_CHANGE

PROBE_STEPS = {"compiled": 2000, "python": 50}  # most steps of a probe of two nutations
LEAST_PROBE, LONGEST_PROBE = 0.25, 10.0  # times `PROBE_STEPS`: least steps of a probe, and of one where errors grow
PROBE_SHARE = 0.1  # of the run: a probe may be so long, up to `IntegratedMotion.longest` and `MOST_PROBED` steps
MOST_PROBED = 20_000  # steps
ROUNDED_ERROR = 1e-13  # rad: a smaller error of a probe is rounding, which grows as n^1.5
PROBE_EVALUATIONS = {"compiled": 12_000, "python": 1200}  # evaluations of a longer probe of an adaptive method
POLE_FACTOR = 20.0  # times `PROBE_EVALUATIONS` where the axis passes a pole within the tolerance, or a body turns over
MOST_WORK = {"compiled": 5e6, "python": 5e5}  # evaluations of any probe: beside a pole steps may become tiny
LOOSE_TOLERANCE = 1e-4  # tolerance above which a method in Python is probed for a whole nutation: a few of its steps
LEAST_GROWTH = 0.02  # of the error of a probe: the least growth assumed from its first half to its second
OCCASIONAL = 1e4, 1e7  # tolerances: the occasional large error of an adaptive method, and of one of variable order
CLOSE_TO_POLE, PASSING_ERROR = 0.2, 100.0  # rad from a pole; tolerances, of a step past it in the angles chart
STABILITY_ERROR = 1e-2  # rad: stability is checked only if quadratic growth leads to a larger error
RESOLVED_TURN = 0.3  # rad of precession in one step at a pole: a probe with more does not show the error of the passage

EXPECTED = 1e-2  # rad: a larger forecast gives a warning; also the axis error from which a verdict calls a run wrong
FASTER = 2.5  # from quarter to quarter of a probe, faster than t^3; 2 warns of 7 right runs of 2,526, 2.5 of one
AIM = 1e-3  # rad: the error that the proposed step or tolerance should have
SMALL_TURN = 0.3  # h omega up to which every method is stable for small nutations
UNSTABLE_GROWTH = 1e-3  # a method is unstable if a step multiplies small nutations by more than 1 + this
NONLINEAR_SHARE = 0.03  # of the nutation that a method adds: less growth may be nonlinear (8e-6 at 4e-4 rad)
BESIDE_POLE = 1e-2  # rad: nearer to a pole than this, small nutations grow in the tilt of the axis
RESONANCE_GAP = 0.12  # rad between three or four turns of a step and a whole turn: a resonance
COARSE_TURN = 1.0  # rad of precession in one step at a pole: more is named as the cause
PROPOSED_TURN = 0.1  # rad of precession at a pole in a proposed step
REMEDY_TRIES, STEP_RATIO = 8, 0.6  # steps tried for a remedy; the largest ratio of one to the one before
CURABLE_OUTCOMES = ("not_converged", "not_finite", "not_normalised")  # outcomes that a shorter step prevents
SAME_ERROR = 0.9  # the least ratio of two errors that are taken for the same
MOST_STEPS = 20_000_000_000  # of a run: ten minutes of the fastest kernel
NO_ORDER = "it has no order, and smaller steps need not help; take another method, such as strang"
NO_LENGTHS = np.empty(0)


class Probe(NamedTuple):
    """A short run compared with the true motion."""

    times: Array
    error: Array  # of the axis, or of the attitude of a body, rad; inf where the run had failed
    outcome: str
    reached: float  # time of the run, not of the probe
    evaluations: int  # of the force, at the step of the run
    stray: Array = NO_LENGTHS  # ||q| - 1|; empty in a chart without quaternions


class Forecast(NamedTuple):
    """The forecast of one run."""

    axis_error: float  # expected largest, rad; inf if the probe failed, 0 for a method without a step or tolerance
    rounding: float  # error by rounding alone, rad: large on a separatrix, whatever the method
    outcome: str  # of the probe, or expected of the run
    reached: float
    landmarks: Landmarks
    unstable: float = 0.0  # an error of the tolerance as the motion amplifies it, rad; 0 where a probe shows it
    whole: bool = False  # the probe was as long as the run


@functools.cache
def _positions(points: int) -> Array:
    """Positions of the samples of a probe, from about 1 to `points`, not commensurate with the nutation."""
    positions = np.arange(1.0, points + 1.0)
    positions[:-1] += np.mod(GOLDEN * positions[:-1], 1.0) - 0.5
    return positions


@functools.lru_cache(maxsize=256)
def _marks(steps: int, points: int) -> Any:
    """`_positions` for a probe of `steps` steps, rounded to whole steps; few `steps` occur (`PROBE_STEPS`)."""
    return np.unique(np.maximum(np.rint(_positions(points) * (steps / points)).astype(np.int64), 1))


def _probe(
    motion: Motion, method: Integrator, chart: str, plan: Plan, duration: float, step: float, since: float = 0.0
) -> Probe:
    """Run `method` from the time `since` of the true motion for `duration`, with `step` or the plan's tolerance."""
    limit = min(plan.most(math.inf), MOST_WORK[method.implementation])
    if method.fixed_step:
        piece = Plan.steps(step, _marks(max(1, round(duration / step)), motion.points), budget=limit)
    else:
        piece = Plan.until(duration * (_positions(motion.points) / motion.points), plan.tolerance, limit)
    run = solve(method, chart, motion.scene.top, motion.start(since), piece)
    outcome, times, states = run.outcome, piece.times, run.states
    bound = outcome == "out_of_budget" and run.force_evaluations < plan.most(math.inf)  # at the limit of a probe only
    if method.fixed_step and bound and run.reached >= motion.landmarks.period:
        valid = times <= run.reached
        outcome, times, states = "ok", times[valid], states[valid]
    with np.errstate(all="ignore"):
        error = motion.error(times, chart, states, since, plan.horizon)
        stray = np.abs(np.linalg.norm(states[:, :4], axis=1) - 1.0) if chart in QUATERNIONS else NO_LENGTHS
    if not math.isfinite(error.sum()):  # no angle is more than pi
        error[~np.isfinite(error)] = math.inf
        outcome = "not_finite" if outcome == "ok" else outcome
    return Probe(times, error, outcome, since + run.reached, run.force_evaluations, stray)


def grown(probe: Probe, horizon: float, *, straight: bool) -> float:
    """The largest error of a probe, extrapolated to the horizon; `straight` if the method's error grows linearly."""
    half = 0.5 * float(probe.times[-1])
    largest = float(probe.error.max())
    n = horizon / half
    if n <= 2.0 * (1.0 + 1e-9) or not math.isfinite(largest):
        return largest
    if largest < ROUNDED_ERROR:
        return largest * math.pow(0.5 * n, 1.5)
    first = float(probe.error[probe.times <= half].max(initial=0.0))
    if straight:
        return largest + max(largest - first, LEAST_GROWTH * largest) * (n - 2.0)
    return n * first + 0.5 * max(abs(largest - 2.0 * first), LEAST_GROWTH * largest) * n * (n - 1.0)


def exponential(probe: Probe, horizon: float) -> float:
    """The largest error of a probe at the horizon if it grows as an exponential: `FASTER` from quarter to quarter.

    So the wobble of a free disc grows with an explicit gyroscopic term, however steady the motion is. 0 if it does not.
    """
    end = float(probe.times[-1])
    half, later, full = (float(probe.error[probe.times <= share * end].max(initial=0.0)) for share in (0.5, 0.75, 1.0))
    if not (half > ROUNDED_ERROR and FASTER * half < later and FASTER * later < full < math.inf):
        return 0.0
    folds = math.log(min(later / half, full / later)) * 4.0 * (horizon / end - 1.0)
    return full * math.exp(min(folds, MOST_FOLDS))


def _amplifies(motion: Motion, change: float, horizon: float, times: float = UNSTABLE_RATIO) -> bool:
    """Does the motion amplify a change of its start more than `times` as much as the shear of a stable motion?"""
    return motion.displacement(change, horizon) > change * times * (1.0 + horizon / motion.landmarks.period)


def _amplified(motion: Motion, probe: Probe, horizon: float) -> float:
    """The largest error of a probe as the motion amplifies it; 0 if `grown` covers it (`ExactMotion`)."""
    return motion.amplified(float(probe.error.max()), float(probe.times[-1]), horizon)


def _fixed_step_error(motion: Motion, method: Integrator, probe: Probe, horizon: float) -> float:
    """The largest error of a fixed-step probe at the horizon: by the law of `grown` or by amplification, the larger.

    Errors of rounding and of truncated iterations are not symmetric, and an unstable motion amplifies them in every
    nutation: there the error of a symmetric method may grow quadratically, too.
    """
    straight = method.keeps_frequencies
    expected = max(grown(probe, horizon, straight=straight), _amplified(motion, probe, horizon))
    if not isinstance(motion, ExactMotion):  # of a top `_instability` knows the growth
        expected = max(expected, exponential(probe, horizon))
    if not straight or not expected < STABILITY_ERROR:
        return expected
    quadratic = grown(probe, horizon, straight=False)
    return quadratic if quadratic > STABILITY_ERROR and _amplifies(motion, SMALL_CHANGE, horizon) else expected


def _grown_tolerance(motion: Motion, method: Integrator, plan: Plan) -> float:
    """The error of an adaptive method at the horizon, rad, if an unstable motion amplifies it; 0 for a stable motion.

    A probe of a method in Python is shorter than the run and does not show errors made elsewhere: in 44 wrong runs of
    SciPy's methods they were up to 3600 times the displacement by one tolerance, and up to 1.6e6 times for LSODA, which
    takes long steps of a high order while the top stands almost still.
    """
    if not _amplifies(motion, plan.tolerance, plan.horizon):
        return 0.0
    changes = plan.tolerance, OCCASIONAL[method.order is None] * plan.tolerance
    return max(float(np.nan_to_num(motion.displacement(change, plan.horizon))) for change in changes)


def _adaptive_forecast(
    motion: Motion, method: Integrator, chart: str, plan: Plan, period: float, share: float, twice: float, far: bool
) -> tuple[float, Probe]:
    """`_forecast_error` for an adaptive method, whose work per time is known after a first probe.

    If `PROBE_EVALUATIONS` evaluations allow a longer probe, that is made, up to the whole run.
    """
    proxy = method if method.same_steps_as is None else integrator(method.same_steps_as)  # a hundredth of the time
    floor = twice if proxy.implementation == "compiled" else 0.5 * twice if plan.tolerance >= LOOSE_TOLERANCE else 0.0

    def run_probe(piece: float) -> tuple[float, Probe]:
        partial = piece < min(period, 0.5 * plan.horizon)
        since = max(0.0, motion.closest() - 0.5 * piece) if partial else 0.0
        probe = _probe(motion, proxy, chart, plan, piece, math.nan, since)
        return max(grown(probe, plan.horizon, straight=False), _amplified(motion, probe, plan.horizon)), probe

    piece = max(share, floor)
    expected, probe = run_probe(piece)
    budget = PROBE_EVALUATIONS[proxy.implementation] * min(proxy.speed, 1.0)
    if (far or (chart == "angles" and motion.landmarks.gap < plan.tolerance)) and proxy.implementation == "compiled":
        budget *= POLE_FACTOR
    length = min(plan.horizon, piece * budget / max(probe.evaluations, 1))
    if length > 1.5 * piece or length == plan.horizon > piece:
        return run_probe(length)
    return expected, probe


def _forecast_error(motion: Motion, method: Integrator, chart: str, plan: Plan) -> tuple[float, Probe]:
    """The expected largest axis error of a run, and the probe from which it follows."""
    straight, marks = method.keeps_frequencies, motion.landmarks
    grows = motion.scene.of_body and motion.scene.top.free and _amplifies(motion, SMALL_CHANGE, plan.horizon, SHEAR)
    period = marks.period if math.isfinite(marks.period) else plan.horizon
    twice = min(2.0 * period, plan.horizon)
    long_steps = chart == "angles" and marks.rate * plan.step_size > RESOLVED_TURN
    share = min(PROBE_SHARE * plan.horizon, (math.inf if long_steps else motion.longest) * period)
    if method.adaptive:
        return _adaptive_forecast(motion, method, chart, plan, period, share, twice, grows)
    step = plan.step_size
    share = min(share, MOST_PROBED * step)
    limit = max(PROBE_STEPS[method.implementation] * step, share)
    if twice <= limit:
        piece = max(twice, share, min(LEAST_PROBE * PROBE_STEPS[method.implementation] * step, motion.reach * period))
        if grows:
            piece = max(piece, LONGEST_PROBE * PROBE_STEPS[method.implementation] * step)
        probe = _probe(motion, method, chart, plan, min(plan.horizon, piece), step)
        return _fixed_step_error(motion, method, probe, plan.horizon), probe
    coarse = twice / round(limit / step)
    probe, factor = _probe(motion, method, chart, plan, twice, coarse), (step / coarse) ** (method.order or 0)
    if method.order and (error := float(probe.error.max())) > EXPECTED:  # another top's map, or too coarse
        half = _probe(motion, method, chart, plan, twice, 0.5 * coarse)
        factor = factor if float(half.error.max()) < SAME_ERROR * error else 1.0
    probe = probe._replace(evaluations=round(probe.evaluations * coarse / step), stray=probe.stray * factor)
    expected = _fixed_step_error(motion, method, probe, plan.horizon) * factor
    if chart == "angles" and marks.rate * coarse > RESOLVED_TURN:
        since = max(0.0, motion.closest() - 0.5 * limit)
        if since < plan.horizon:
            probe = _probe(motion, method, chart, plan, min(limit, plan.horizon - since), step, since)
            passages = max(1.0, plan.horizon / period)
            expected = float(np.max(probe.error)) * (passages if straight else passages**2)
    return expected, probe


def forecast(scene: Scene, method: Integrator, chart: str, plan: Plan, motion: Motion | None = None) -> Forecast:
    """Forecast the error of a run from a short run (a probe) of the same method; the run itself is not changed.

    A method without a step or a tolerance, such as the closed form, is not probed. The default `motion` is the closed
    form for a top and an integration for a body.
    """
    motion = motion or (IntegratedMotion if scene.of_body else ExactMotion)(scene)
    marks = motion.landmarks
    if method.control is None:
        return Forecast(0.0, 0.0, "ok", plan.horizon, marks)
    error, probe = _forecast_error(motion, method, chart, plan)
    partly = method.adaptive and method.implementation == "python" and not probe.times[-1] >= plan.horizon
    if partly and chart == "angles" and marks.gap < CLOSE_TO_POLE:
        error = max(error, float(np.nan_to_num(motion.displacement(PASSING_ERROR * plan.tolerance, plan.horizon))))
    unstable = _grown_tolerance(motion, method, plan) if partly else 0.0
    whole = bool(probe.times[-1] >= plan.horizon * (1.0 - 1e-9))
    end, rounding = (probe.outcome, probe.reached), motion.rounding(plan.horizon, whole=whole)
    if probe.outcome == "ok" and probe.stray.size and not whole:
        end = _length_failure(probe, plan.horizon) or end
    limit = getattr(method.solvers[chart], "limit", None)
    if limit is not None and probe.outcome == "ok" and probe.times[-1] >= min(marks.period, plan.horizon):
        reached = float(probe.times[-1]) * limit(plan) / max(probe.evaluations, 1)
        if reached < plan.horizon:
            error, end = math.inf, ("out_of_budget", reached)
    return Forecast(max(error, unstable), rounding, *end, marks, unstable, whole)


def _length_failure(probe: Probe, horizon: float) -> tuple[str, float] | None:
    """Outcome and time of the run's end if the drift of |q| continues as in the probe; None if |q| stays in bounds."""
    half, largest = 0.5 * float(probe.times[-1]), float(probe.stray.max())
    drift = (largest - float(probe.stray[probe.times <= half].max(initial=0.0))) / half
    if largest + drift * (horizon - 2.0 * half) <= LENGTH_OFF:
        return None
    return "not_normalised", 2.0 * half + (LENGTH_OFF - largest) / drift


class Trouble(NamedTuple):
    """Why a run is expected to be wrong, and what to try instead."""

    reason: str  # with the remedy, unless that is a smaller step
    step: float = math.nan  # the first step to try
    otherwise: str = ""  # an alternative to a smaller step


def warning(scene: Scene, method: Integrator, chart: str, plan: Plan, *, series: bool = False) -> str:
    """A warning before the run if a large error is expected, one sentence with a remedy; else an empty string.

    It says "take" a step for which the guard gives no warning, and "try" a step if none was found. With `series` a
    top's motion is integrated like that of a body.
    """
    if method.control is None:
        return ""
    motion: Motion = IntegratedMotion(scene) if series or scene.of_body else ExactMotion(scene)
    expected = forecast(scene, method, chart, plan, motion)
    problem = trouble(motion, method, chart, plan, expected)
    if problem is None:
        return ""
    remedy = "" if math.isnan(problem.step) else f"; {_remedy(motion, method, chart, plan, problem)}"
    return f"{method.name} on {scene.name}: {problem.reason}{remedy}"


def _remedy(motion: Motion, method: Integrator, chart: str, plan: Plan, first: Trouble) -> str:
    """The advice to use a step, of two digits, for which there is no warning: the first try or a smaller one."""
    step, suffix, words, errors = first.step, f", or {first.otherwise}" if first.otherwise else "", "", []
    for _ in range(REMEDY_TRIES):
        if not plan.horizon / step <= MOST_STEPS:
            words = f"take {first.otherwise or 'another method'}: more than {MOST_STEPS:.0e} steps would be needed"
            break
        step = float(f"{step:.2g}")
        trial = plan._replace(step_size=step)  # a forecast looks at the step and the horizon
        expected = forecast(motion.scene, method, chart, trial, motion)
        if expected.outcome == "ok" and trouble(motion, method, chart, trial, expected) is None:
            return f"take a step of about {step:.2g}{suffix}"
        errors.append(expected.axis_error)
        step = min(STEP_RATIO * step, _smaller_step(method, trial, expected))
    foreign = method.order and not is_built_in(method.method)  # the order of any other is known to hold
    if foreign and len(errors) > 1 and SAME_ERROR * errors[0] < errors[-1] < math.inf:
        claim = f"whether it has the order {method.order} that it claims"
        return f"shorter steps do not help: `symtop claims {method.name}` measures {claim}"
    return words or f"try a step of about {step:.2g}{suffix}"


def trouble(motion: Motion, method: Integrator, chart: str, plan: Plan, expected: Forecast) -> Trouble | None:
    """Why a run is expected to be wrong; None if it is not."""
    instability = isinstance(motion, ExactMotion) and _instability(motion.scene, method, chart, plan, expected)
    return instability or _cause(motion, method, chart, plan, expected)


def _growth(scene: Scene, method: Integrator, chart: str, step: float, frequency: float) -> Growth:
    """The growth of small nutations in a step. A symmetric method adds no nutation and is stable for small steps."""
    if not method.symmetric:
        return nutation_growth(method, scene, step, chart, frequency)
    return Growth(trace(method, scene, step, chart).growth if step * frequency > SMALL_TURN else 1.0, EPSILON)


def _instability(scene: Scene, method: Integrator, chart: str, plan: Plan, expected: Forecast) -> Trouble | None:
    """The trouble that small nutations grow to a visible size; None if not, or if a probe of the whole run was good."""
    marks, step, frequency = expected.landmarks, plan.step_size, expected.landmarks.frequency
    good_run = expected.whole and expected.outcome == "ok" and expected.axis_error <= EXPECTED
    if method.adaptive or good_run:
        return None
    growth, steps = _growth(scene, method, chart, step, frequency), plan.horizon / step
    gap = marks.gap if marks.gap < BESIDE_POLE else 0.0  # of a pole, the tilt grows
    size, folds = marks.width + gap + growth.size, steps * math.log(max(growth.factor, 1.0))
    grows = growth.factor > 1.0 + max(NONLINEAR_SHARE * growth.size, growth.doubt)
    if not grows or not size * math.expm1(min(folds, MOST_FOLDS)) > EXPECTED:
        return None
    low, high = SMALL_TURN / frequency, step

    def stable(h: float) -> bool:
        return _growth(scene, method, chart, h, frequency).factor <= 1.0 + UNSTABLE_GROWTH

    if growth.factor > 1.0 + UNSTABLE_GROWTH and low < high and stable(low):
        while high - low > 1e-3 * high:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if stable(middle) else (low, middle)
        stability = f"at a step of {step:.4g}, the method is stable up to {low:.4g} (h omega = {low * frequency:.3f})"
        words, proposal = f"small nutations (frequency {frequency:.4g}) grow {stability}", 0.5 * low
    else:
        words = f"small nutations (frequency {frequency:.4g}) of {size:.1g} rad grow by {growth.factor - 1.0:.1g} of "
        words += f"themselves in each of {steps:.3g} steps"
        proposal = step * math.pow(math.log1p(AIM / size) / folds, 1.0 / (method.order or 1))
    return Trouble(f"{words}: {NO_ORDER}") if method.order is None else Trouble(words, proposal)


def _cause(motion: Motion, method: Integrator, chart: str, plan: Plan, expected: Forecast) -> Trouble | None:
    """The first cause that applies, except instability; None if no large error is expected."""
    marks = expected.landmarks
    if expected.rounding > EXPECTED and not isinstance(motion, ExactMotion):
        return Trouble(
            f"the motion multiplies a change of its start by {expected.rounding / EPSILON:.1g} by t = "
            f"{plan.horizon:.4g}, so that rounding alone decides; no method and no step help, shorten the horizon"
        )
    if expected.rounding > EXPECTED and expected.rounding >= min(expected.axis_error, 1.0):
        return Trouble(
            "the motion passes so close to a separatrix that rounding alone decides when it falls; no method and no "
            f"step help, shorten the horizon to less than one nutation of {marks.period:.4g}"
        )
    if not expected.axis_error > EXPECTED and expected.outcome == "ok":
        return None
    second, period = motion.scene.second, motion.period_word
    error = min(expected.axis_error, math.pi)
    size = f"expect an {motion.watches} error of {error:.1g} rad by t = {plan.horizon:.4g}{second}"
    out_of_budget = expected.outcome == "out_of_budget"  # then the step is not the cause
    if not out_of_budget and (coarse := _coarse_step(motion, method, chart, plan, expected, size)) is not None:
        return coarse
    if expected.outcome != "ok":
        curable = expected.outcome in CURABLE_OUTCOMES and method.fixed_step and method.order is not None
        words = sentence(expected.outcome, expected.reached, plan.horizon, second, remedy=not curable)
        return Trouble(f"expect the run to be {words}", _smaller_step(method, plan, expected) if curable else math.nan)
    if method.adaptive:
        tolerance = max(plan.tolerance * AIM / min(expected.axis_error, 1.0), method.least_tolerance)
        advice = f"try tolerance {tolerance:.1g}"
        if expected.unstable >= expected.axis_error:
            return Trouble(f"{size}: the motion is unstable, and a change of its start grows large; {advice}")
        return Trouble(f"{size}: errors add up over {plan.horizon / marks.period:.3g} {period}s; {advice}")
    if method.order is None:
        return Trouble(f"{size}: {NO_ORDER}")
    return Trouble(
        f"{size}: a step is 1/{marks.period / plan.step_size:.3g} of a {period}, and errors add up over "
        f"{plan.horizon / marks.period:.3g} {period}s", _smaller_step(method, plan, expected),
    )  # fmt: skip


def _coarse_step(
    motion: Motion, method: Integrator, chart: str, plan: Plan, expected: Forecast, size: str
) -> Trouble | None:
    """The trouble of a step that is too long for a pole or for the nutation, or in resonance with it; else None."""
    marks, step, frequency = expected.landmarks, plan.step_size, expected.landmarks.frequency
    if chart == "angles" and marks.rate * step > COARSE_TURN:
        return Trouble(
            f"{size}: the axis passes the {marks.pole} pole at {marks.gap:.2g} rad and precesses there by "
            f"{marks.rate * step:.2g} rad in a step", PROPOSED_TURN / marks.rate,
            "an integrator whose chart has no poles, such as strang",
        )  # fmt: skip
    if marks.period / step < 2.0:
        words = f"a step of {step:.4g} jumps over half a {motion.period_word}, which is {marks.period:.4g} long"
        return Trouble(f"{size}: {words}", marks.period / 20.0)
    if step * frequency > SMALL_TURN and isinstance(motion, ExactMotion):
        turn = trace(method, motion.scene, step, chart).turn
        for order in (3, 4):
            if abs(order * turn - 2.0 * math.pi) < RESONANCE_GAP * order:
                return Trouble(
                    f"{size}: a step turns the nutation by {turn:.4g} rad, close to 1/{order} of a turn, a resonance "
                    f"(h omega = {step * frequency:.3f})", _smaller_step(method, plan, expected),
                )  # fmt: skip
    return None


def _smaller_step(method: Integrator, plan: Plan, expected: Forecast) -> float:
    """The step at which the forecast would be `AIM`, if the method keeps its order."""
    step = plan.step_size * math.pow(AIM / (min(expected.axis_error, 1.0) or AIM), 1.0 / (method.order or 1))
    return min(step, expected.landmarks.period / 20.0) if expected.axis_error > 1.0 else step
