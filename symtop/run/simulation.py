"""simulate(): one scene, one integrator, one step or tolerance -> one dataset.

Samples do not change the step: a fixed-step run has h = T/N exactly and is sampled at whole steps, t = k h. Samples are
uniform, or at the steps nearest to uniform times, unless they would repeatedly fall on the same few phases of the
nutation (where an energy error may read 1e5 times too small); then they are dithered by the golden ratio. The
attribute ``sampling`` says which.

A requested time inside a fixed step is the end of one shorter step of the same method from the end of the step before,
so that constants which the method keeps are kept there too. The shorter step begins at a new start, with |e| and |q| of
one; if a method has changed these to r, the weight is multiplied by r, or by r^2 for q, which leaves the equations the
same. A method with internal data beyond the state makes its first step anew, with an error of the same size.
"""

import functools
import json
import math
import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from symtop.core import netcdf
from symtop.core.errors import SymtopError, SymtopWarning, boolean, one_of, positive, shown, whole
from symtop.core.numbers import EPSILON, GOLDEN, real_numbers
from symtop.methods.framework.calling import solve
from symtop.methods.framework.plan import Plan, Run, off_length, sentence
from symtop.methods.framework.registry import Integrator, integrator as find_integrator, methods
from symtop.model.body import Attitude
from symtop.model.charts import BODY, Array, axis_from_quaternion
from symtop.model.scenes import OBSERVABLES, SHORTEST, Scene, horizon_of, scene as find_scene
from symtop.model.top import Angles, effective_force
from symtop.run.guard import MOST_STEPS, warning
from symtop.run.trajectory import Trajectory, dataset

MOST_SAMPLES = 10_000_000
MOST_SWINGS = 1e8  # periods in an adaptive run: several minutes with the fastest method, taylor
WIDEST_GAP = 0.125  # of a nutation: samples that leave a wider range of phases empty are dithered
DEFAULT_ERROR = 1e-3  # rad: the error at which an error message proposes a step if none was given
SAME_TIME = 8.0 * EPSILON  # relative: times that differ by less are the same, because products are rounded
BRIEF_RUN = 0.01  # nutations: the length of the run of an adaptive method that is sampled at its start only
Guard = bool | Literal["exact", "series"] | Callable[[str], object]  # the values are those in `simulate`
STRETCHES = 17  # equal ranges of phase; two of them are less than `WIDEST_GAP`


def unseen(times: Array, period: Any) -> Array:
    """The widest range of nutation phases without a sample, as a fraction of a period, or an upper bound of it; (n,).

    For each row of times (n, samples) with periods (n, 1), or for one row. If each of 17 equal ranges has a sample, the
    widest empty range is at most 2/17, which is returned without sorting.
    """
    turns = np.atleast_2d(times / period)
    phases = turns - np.floor(turns)  # the same as `np.mod`, in a third of the time
    bits = np.bitwise_or.reduce(1 << (STRETCHES * phases).astype(np.int64), axis=1)
    widest, sparse = np.full(len(phases), 2.0 / STRETCHES), bits != (1 << STRETCHES) - 1
    if sparse.any():
        phases = np.sort(phases[sparse], axis=1)
        widest[sparse] = np.max(np.diff(phases, append=phases[:, :1] + 1.0), axis=1)
    return widest


def places(samples: int, *, dithered: bool) -> Array:
    """Positions of the samples in a run, from 0 to 1: equidistant, or `dithered` by the golden ratio."""
    positions = np.arange(samples, dtype=float)
    if dithered:
        positions[1:-1] += np.mod(GOLDEN * positions[1:-1], 1.0) - 0.5
    return positions / (samples - 1)


def sample_times(horizon: float, samples: int, period: float, steps: int | None = None) -> tuple[Any, Any, bool]:
    """Times and marks of samples from 0 to the horizon, at whole steps of `steps`, and whether they are dithered."""
    if steps is not None and steps < samples:  # every step is a sample
        marks: Any = np.arange(steps + 1)
        return marks * (horizon / steps), marks, False
    long_enough = math.isfinite(period) and horizon > 2.0 * period
    for dithered in (False, True):
        if long_enough and not dithered and samples * WIDEST_GAP <= 1.0:
            continue  # so few samples leave a wider gap, wherever they fall
        positions = places(samples, dithered=dithered)
        if steps is None:
            marks, times = np.empty(0, dtype=np.int64), horizon * positions
        else:
            marks = np.rint(steps * positions).astype(np.int64)
            marks = marks if steps > 2 * samples else np.unique(marks)  # places are half a stride apart or more
            times = marks * (horizon / steps)
        if dithered or not long_enough or unseen(times, period) < WIDEST_GAP:
            break
    return times, marks, dithered


def chart_of(method: Integrator, watched: str, observe: str | None = None) -> str:
    """The smallest chart of a method for `observe`, by default for `watched` or else for "axis"; or `BODY`."""
    if watched == BODY:
        one_of("observe", observe or "attitude", ("axis", "attitude"))
        if BODY not in method.solvers:
            candidates = [name for name, entry in methods().items() if BODY in entry.solvers]
            words = f"one of {len(candidates)}, such as strang or dop853-compiled (all: symtop integrators --wide)"
            advice = f"{method.method} without brackets" if method.method in candidates else words
            raise SymtopError(f"integrator must have the chart body, of a RigidBody, not {method.name}: take {advice}")
        return BODY
    if isinstance(observe, str) and observe == "theta":
        raise SymtopError("observe must be nutation, which shows theta, axis or attitude, not 'theta'", "observe")
    if observe is not None:
        return method.chart_for(one_of("observe", observe, OBSERVABLES))
    return method.chart_for(watched if watched != "attitude" or {"angles", "attitude"} & {*method.charts()} else "axis")


def likely_step(scene: Scene, method: Integrator, horizon: float, accuracy: float) -> float:
    """A step whose error may be about `accuracy`: a fifth of a nutation times accuracy^(1/order), at most `horizon`."""
    return min(0.2 * scene.time_scale(horizon) * math.pow(accuracy, 1.0 / (method.order or 2)), horizon)


def check_control(method: Integrator, step: object, tolerance: object, name: str = "step_size") -> None:
    """SymtopError for a step (the argument `name`) or a tolerance that the method does not take."""
    if method.fixed_step and tolerance is not None:
        words = f"has a fixed step: give step_size, not tolerance = {shown(tolerance)}"
        raise SymtopError(f"{method.name} {words}", "step_size", "tolerance")
    if method.adaptive and step is not None:
        words = f"chooses its own steps: give tolerance, not {name} = {shown(step)}"
        raise SymtopError(f"{method.name} {words}", "tolerance", name)
    if not method.fixed_step and not method.adaptive:
        for control, value in ((name, step), ("tolerance", tolerance)):
            if value is not None:
                raise SymtopError(f"{method.name} has nothing to tune: leave out {control} = {shown(value)}", control)


def make_plan(
    scene: Scene, method: Integrator, step_size: object = None, tolerance: object = None, *, horizon: float,
    samples: int, budget: float | None = None,
) -> tuple[Plan, bool]:  # fmt: skip
    """Check the step or tolerance, and return the plan of steps and samples, and whether samples are dithered."""
    period = scene.nutation_period
    check_control(method, step_size, tolerance)
    if method.fixed_step:
        if step_size is None:
            words = f"needs step_size, for example {likely_step(scene, method, horizon, DEFAULT_ERROR):.1g}"
            raise SymtopError(f"{method.name} has a fixed step and {words}", "step_size")
        step = positive("step_size", step_size)
        if step > horizon:
            raise SymtopError(f"step_size must be at most the horizon {horizon!r}, not {step!r}", "step_size")
        limit = MOST_STEPS if budget is None else budget
        if horizon / step > limit:
            words = f"asks for {horizon / step:.3g} steps; the limit is {limit:.3g} (see budget)"
            raise SymtopError(f"step_size {step!r} {words}", "step_size", "budget")
        steps = max(1, round(horizon / step))
        _, marks, dithered = sample_times(horizon, samples, period, steps)
        return Plan.steps(horizon / steps, marks, horizon, budget), dithered
    bound = method.check_tolerance(tolerance) if method.adaptive else math.nan
    swinging = 0.0 if scene.of_body else math.sqrt(abs(scene.top.mgl) / scene.top.I1)
    swings = horizon * max(1.0 / period, swinging / (2.0 * math.pi))
    if method.adaptive and swings > MOST_SWINGS:
        raise SymtopError(
            f"horizon {horizon!r} is {swings:.3g} swings of the top; an adaptive method may take {MOST_SWINGS:.3g}"
        )
    times, _, dithered = sample_times(horizon, samples, period)
    return Plan.until(times, bound, budget), dithered


def simulate(
    scene: str | Scene, integrator: str | Integrator, *, step_size: float | None = None,
    tolerance: float | None = None, horizon: float | None = None, samples: int = 501, observe: str | None = None,
    guard: Guard = True, budget: float | None = None, times: ArrayLike | None = None,
) -> xr.Dataset:  # fmt: skip
    """Run one integrator on one scene and return the trajectory.

    Dimension ``time`` (elapsed) and ``component`` (x, y, z). Variables ``theta``, ``phi``, ``psi`` (unwrapped; absent
    where the chart does not have them), ``axis(time, component)``, ``energy``, ``p_phi``, ``p_psi``, ``p_theta``, and
    ``quaternion`` where the chart has one (its sign may change between samples). Samples after a failure are NaN;
    ``outcome``, ``outcome_message`` and ``reached_time`` say how the run ended, ``guard`` what was expected. `observe`
    ("nutation", "axis", "attitude"; default: that of the scene) picks the smallest chart of the integrator that
    determines it; a variant, such as ``rk4[axis]``, works in its own chart. A run of fewer steps than `samples` is
    sampled at every step. The number of steps is horizon/step_size, rounded; the attribute ``step_size`` is the step
    made. ``sampling`` is "uniform", "nearest steps" (to uniform times), or "dithered", to cover all nutation phases.

    With `times`, an increasing row (n,) of numbers of at least 0 instead of `horizon` and `samples`, the run is sampled
    at these and ends at the last; ``sampling`` is "at times". Adaptive methods are sampled at any time. Fixed steps are
    of exactly `step_size` from 0: a time that equals the end of a step, to rounding, has its state, and one inside a
    step is the end of one shorter step of the same method. ``steps`` and ``force_evaluations`` count whole steps only.

    Before the run the guard (`symtop.run.guard`) compares a piece of it with the true motion, and has a sentence with a
    remedy if a large error is expected; it does not change the run. `guard` is one of

        True           warn (`SymtopWarning`); a top is compared with its closed form, a body with an integration
        "exact"        the same, for tops only           "series"    the same, with an integration also of a top
        a function     called with the sentence in the place of a warning, compared as with True
        False          no guard

    `budget` is the most steps of a fixed-step run (`MOST_STEPS` by default; more are refused) and the most force
    evaluations, or Taylor steps, of any other, which ends `out_of_budget`.

    Raises SymtopError for invalid arguments. A run that fails raises no exception: see ``outcome``.
    """
    warn = functools.partial(warnings.warn, category=SymtopWarning, stacklevel=3)  # where `simulate` was called
    report = guard if callable(guard) else warn if isinstance(guard, str) or boolean("guard", guard) else None
    setup = _setup(scene, integrator, step_size, tolerance, horizon, samples, observe, budget, times)
    problem, method, plan = setup.scene, setup.method, setup.plan
    if isinstance(guard, str) and one_of("guard", guard, ("exact", "series")) == "exact" and problem.of_body:
        raise SymtopError(f"guard must be series on {problem.name}, a body without symmetry, not 'exact'", "guard")
    trajectory, caution = _guarded(setup, report, guard == "series")
    data = dataset(trajectory.time, trajectory.columns, problem.units)
    data.attrs = netcdf.attributes_of(
        f"{method.name} on {problem.name}", integrator=method.name, scene=problem.name, chart=setup.chart,
        implementation=method.implementation, horizon=plan.horizon, step_size=plan.step_size, tolerance=plan.tolerance,
        steps=trajectory.steps, force_evaluations=trajectory.force_evaluations,
        newton_iterations=trajectory.newton_iterations, outcome=trajectory.outcome,
        outcome_message=sentence(trajectory.outcome, trajectory.reached_time, plan.horizon, problem.second),
        reached_time=trajectory.reached_time, guard=caution, sampling=setup.sampling, top=_json(problem.top),
        start=_json(problem.start),
    )  # fmt: skip
    return data


def integrate(
    scene: str | Scene, integrator: str | Integrator, *, guard: Callable[[str], object] | None = None,
    **settings: Any,
) -> Trajectory:  # fmt: skip
    """The run of `simulate` as plain arrays; `guard` is called with the guard's sentence, and None turns it off."""
    return _guarded(_setup(scene, integrator, **settings), guard)[0]


class _Setup(NamedTuple):
    """The checked arguments of `simulate`, and the attribute ``sampling``."""

    scene: Scene
    method: Integrator
    chart: str
    plan: Plan
    sampling: str


def _setup(
    scene: Any, integrator: Any, step_size: Any = None, tolerance: object = None, horizon: object = None,
    samples: int = 501, observe: str | None = None, budget: Any = None, times: Any = None,
) -> _Setup:  # fmt: skip
    """Check the arguments of `simulate`. With `times`, the marks are the whole steps before each of them."""
    row = None if times is None else _checked_times(times, horizon, samples)
    problem, method, h = find_scene(scene, bodies=True), find_integrator(integrator), math.nan
    if row is not None:
        horizon, samples = float(row[-1]) or BRIEF_RUN * problem.time_scale(), 2
        if step_size is not None:
            h = positive("step_size", step_size)
            step_size = min(h, horizon)  # it may be longer than the run
    end = problem.horizon if horizon is None else horizon_of(horizon)
    count = whole("samples", samples, 2, MOST_SAMPLES)
    chart = chart_of(method, problem.observes, observe)
    limit = None if budget is None else positive("budget", budget)
    plan, dithered = make_plan(problem, method, step_size, tolerance, horizon=end, samples=count, budget=limit)
    marks = plan.marks
    uneven = marks.size and marks[-1] % (marks.size - 1)  # unequal numbers of steps
    sampling = "dithered" if dithered else "nearest steps" if uneven else "uniform"
    if row is not None:
        if method.fixed_step:
            near = np.rint(row / h)
            marks = np.where(np.abs(row - near * h) <= SAME_TIME * row, near, np.floor(row / h)).astype(np.int64)
        plan = plan._replace(times=row, horizon=float(row[-1]), step_size=h, marks=marks)
        sampling = "at times"
    return _Setup(problem, method, chart, plan, sampling)


def _checked_times(times: ArrayLike, horizon: object, samples: object) -> Array:
    """The row of `times`; SymtopError for anything else, and where `horizon` or `samples` are given, too."""
    for name, value, default in (("horizon", horizon, None), ("samples", samples, 501)):
        if type(value) is not type(default) or value != default:
            raise SymtopError(f"{name} must be left out where times are given, not {shown(value)}", name, "times")
    row = np.atleast_1d(real_numbers("times", times)).copy()
    flat = row.ravel()
    bad = ~(np.isfinite(flat) & ((flat >= SHORTEST) | (flat == 0.0)) & (flat > np.append(-1.0, flat[:-1])))
    if row.ndim != 1 or bad.any() or not row.size:
        actual = f"{float(flat[bad][0])!r} in place {np.argmax(bad)}" if bad.any() else f"of shape {row.shape}"
        rule = f"an increasing row of finite numbers, each 0 or at least {SHORTEST:g}"
        raise SymtopError(f"times must be {rule}, not {actual}", "times")
    return row


def _guarded(setup: _Setup, guard: Callable[[str], object] | None, series: bool = False) -> tuple[Trajectory, str]:
    """Call `guard` with the guard's sentence, if any, and make the run; the sentence is "off" without a guard."""
    scene, method, chart, plan, sampling = setup
    caution = "off" if guard is None else ""
    forecast = plan._replace(step_size=plan.horizon) if plan.step_size > plan.horizon else plan
    if guard is not None and plan.horizon > 0.0 and (caution := warning(scene, method, chart, forecast, series=series)):
        guard(caution)
    if sampling == "at times" and method.fixed_step:
        return Trajectory.of_run(scene, chart, plan, _run_at_times(scene, method, chart, plan)), caution
    run_plan = plan if plan.horizon else Plan.until([0.0, BRIEF_RUN * scene.time_scale()], plan.tolerance, plan.budget)
    run = solve(method, chart, scene.top, scene.start, run_plan, f" on {scene.name}")
    run = run if plan.horizon else Run(run.states[:1], run.p_phi[:1], run.p_psi[:1], 0, 0, 0, "ok", 0.0)
    return Trajectory.of_run(scene, chart, plan, run), caution


def _run_at_times(scene: Scene, method: Integrator, chart: str, plan: Plan) -> Run:
    """A run of fixed steps, with a shorter step to each time inside one; NaN from the first step that fails."""
    origin = scene.top, scene.start, 1.0
    times, starts, words = plan.times, plan.marks * plan.step_size, f" on {scene.name}"
    marks, inverse = np.unique(plan.marks, return_inverse=True)
    grid_plan = Plan.steps(plan.step_size, marks, budget=plan.budget)
    steps = solve(method, chart, scene.top, scene.start, grid_plan, words)
    states, p_phi, p_psi = (values[inverse] for values in steps[:3])
    outcome, reached = steps.outcome, plan.horizon if steps.outcome == "ok" else steps.reached
    invalid = np.zeros(times.size, dtype=bool)
    for i in np.flatnonzero(np.abs(times - starts) > SAME_TIME * times):
        invalid[i:] = True
        if not np.isfinite(states[i]).all() or (steps.outcome != "ok" and plan.marks[i] >= steps.steps):
            break  # the whole step that contains this time failed
        try:
            top, start, r = _start(scene, chart, states[i], p_phi[i], p_psi[i]) if plan.marks[i] else origin
        except SymtopError:  # the state is finite, but has no direction or is too large for a start
            outcome, reached = "not_finite", float(starts[i])
            break
        tail = solve(method, chart, top, start, Plan.steps(float(times[i] - starts[i]), [1]), words)
        if tail.outcome != "ok":
            outcome, reached = tail.outcome, float(starts[i])
            break
        invalid[i:], states[i], p_phi[i], p_psi[i] = False, tail.states[0], tail.p_phi[0], tail.p_psi[0]
        if r != 1.0:
            states[i, :-3] *= r
            (p_phi if chart == BODY else p_psi)[i] *= r if chart == "axis" else r * r
    if outcome == "not_normalised" or (off_length(chart, states) & ~invalid).any():
        invalid |= off_length(chart, states) | ~np.isfinite(states).all(axis=1)
        outcome, reached = "not_normalised", plan.last_of(~invalid)
    states[invalid], p_phi[invalid], p_psi[invalid] = math.nan, math.nan, math.nan
    return Run(states, p_phi, p_psi, *steps[3:6], outcome, reached)


def _start(scene: Scene, chart: str, state: Array, p_phi: float, p_psi: float) -> tuple[Any, Any, float]:
    """The top and start from which a run continues at a state, and the |e| or |q| of that; SymtopError without one."""
    top: Any = scene.top
    with np.errstate(all="ignore"):
        if chart == "angles":
            theta, p_theta, phi, psi = state.tolist()
            initial = top.momenta(scene.start)  # its `north` and `south` are free of cancellation
            phi_change, psi_change = p_phi - initial.p_phi, p_psi - initial.p_psi
            north, south = initial.north + phi_change - psi_change, initial.south + phi_change + psi_change
            _, phi_dot, cosine = effective_force(theta, north, south, top.I1, top.mgl)
            return top, Angles(theta, phi, psi, p_theta / top.I1, phi_dot, p_psi / top.I3 - phi_dot * cosine), 1.0
        r = float(np.linalg.norm(state[:-3]))
        unit, momentum = state[:-3] / (r or math.nan), state[-3:]
        direction, heavy = tuple(unit.tolist()), replace(top, mgl=top.mgl * (r if chart == "axis" else r * r))
        if chart == "axis":
            return heavy, Angles.from_axis(top, direction, momentum.tolist()), r
        if chart == BODY:
            return heavy, Attitude(direction, tuple((momentum / top.moments).tolist())), r
        axis = axis_from_quaternion(unit)
        omega = momentum / top.I1 + (1.0 / top.I3 - 1.0 / top.I1) * (momentum @ axis) * axis
        return top, Angles.from_quaternion(direction, omega_space=omega.tolist()), r  # f does not depend on |q|


@functools.lru_cache(maxsize=256)
def _json(record: Any) -> str:
    """The numbers of a top or a start as JSON, for an attribute."""
    return json.dumps({name: getattr(record, name) for name in sorted(record.__slots__)})
