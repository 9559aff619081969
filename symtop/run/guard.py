"""The guard: one sentence with a remedy before a run whose error is expected to be large, nothing before any other.

Whether the error will be large is measured (`symtop.run.forecast` runs the method on a short piece and compares it with
the closed form). The cause is read from exact landmarks of the motion, in this order:

    instability   small nutations grow at every step (Verlet beyond h omega = 2)
    separatrix    the motion itself amplifies rounding until it decides the answer
    pole          the axis precesses by a radian or more in one step at its closest approach to a pole (angles only)
    aliasing      fewer than two steps a nutation
    resonance     a step turns the nutation by a third or a quarter of a turn (Verlet at h omega = sqrt 3)
    early end     the short run ended early
    no order      the error need not fall with the step: a term is left out, or rounding decides
    departure     an adaptive method's errors of its tolerance grow with the motion, which is unstable
    growth        the errors of the nutations add up until the horizon

The guard never changes a run. It does not look at the number of samples: a long run may have fewer than two a nutation,
and `simulate` dithers samples that would fall on the same phases.
"""

import math

from symtop.base.numbers import EPSILON
from symtop.methods.outcomes import sentence
from symtop.methods.plan import Plan, Run
from symtop.methods.registry import Integrator
from symtop.model.scenes import Scene
from symtop.run.forecast import Forecast, Landmarks, forecast, landmarks
from symtop.run.linear_stability import Growth, nutation_growth, trace

EXPECTED = 1e-2  # rad; a larger forecast is worth a warning: the axis error from which a verdict calls a run wrong
AIM = 1e-3  # rad, what a remedy aims at
SMALL_TURN = 0.3  # h omega below which no method loses small nutations
GROWS = 1e-3  # a step that multiplies small nutations by more than 1 + GROWS loses them
NO_GROWTH = 3e-8  # rounding of the growth of a step
NONLINEAR = 0.03  # of the nutation that a method adds of its own may pass for growth: 8e-6 at 4e-4 rad
BESIDE = 1e-2  # rad
MOST_FOLDS = 100.0  # e times that a nutation grows: any is too much
NEAR = 0.12  # rad between three or four turns of a step and a whole turn: a resonance
COARSE = 1.0  # rad of precession in a step


def warning(scene: Scene, method: Integrator, chart: str, plan: Plan, done: Run | None = None) -> str:
    """Warn before the run if a large error is expected: one sentence with a remedy, else an empty one.

    `done` is the run itself, where it has been made already because the probe would repeat it (`forecast.repeats`).
    """
    if method.control is None:
        return ""
    expected, marks = forecast(scene, method, chart, plan, done), landmarks(scene)
    reason = _unstable(scene, method, chart, plan, marks, expected) or _cause(
        scene, method, chart, plan, marks, expected
    )
    return f"{method.name} on {scene.name}: {reason}" if reason else ""


def _growth(scene: Scene, method: Integrator, chart: str, step: float, frequency: float) -> Growth:
    """What a step does to small nutations; a symmetric method neither adds to them nor makes fine steps unstable."""
    if not method.symmetric:
        return nutation_growth(method, scene, step, chart, frequency)
    return Growth(trace(method, scene, step, chart).growth if step * frequency > SMALL_TURN else 1.0, EPSILON)


def _unstable(scene: Scene, method: Integrator, chart: str, plan: Plan, marks: Landmarks, expected: Forecast) -> str:
    """Small nutations that grow until they are seen, and what to do; empty if they do not, or a probe has shown it."""
    step, frequency = plan.step_size, marks.frequency
    seen = expected.whole and expected.outcome == "ok" and expected.axis_error <= EXPECTED
    if method.adaptive or seen:
        return ""
    growth, steps = _growth(scene, method, chart, step, frequency), plan.horizon / step
    beside = marks.gap if marks.gap < BESIDE else 0.0  # of a pole, what grows is the tilt
    size, folds = marks.width + beside + growth.size, steps * math.log(max(growth.factor, 1.0))
    if (
        not growth.factor > 1.0 + max(NO_GROWTH, NONLINEAR * growth.size)
        or not size * math.expm1(min(folds, MOST_FOLDS)) > EXPECTED
    ):
        return ""
    good, bad = SMALL_TURN / frequency, step
    if growth.factor > 1.0 + GROWS and good < bad:
        while bad - good > 1e-3 * bad:
            middle = 0.5 * (good + bad)
            stable = _growth(scene, method, chart, middle, frequency).factor <= 1.0 + GROWS
            good, bad = (middle, bad) if stable else (good, middle)
        return (
            f"small nutations (frequency {frequency:.4g}) grow at a step of {step:.4g}, the method is stable up to "
            f"{good:.4g} (h omega = {good * frequency:.3f}); take a step below {0.5 * good:.2g}"
        )
    finer = step * math.pow(math.log1p(AIM / size) / folds, 1.0 / (method.order or 1))
    return (
        f"small nutations (frequency {frequency:.4g}) of {size:.1g} rad grow by {growth.factor - 1.0:.1g} of "
        f"themselves in each of {steps:.3g} steps; take a step of about {finer:.2g}"
    )


def _cause(scene: Scene, method: Integrator, chart: str, plan: Plan, marks: Landmarks, expected: Forecast) -> str:
    """Why the run will go wrong, and what to do; empty if it will not."""
    if expected.rounding > EXPECTED and expected.rounding >= min(expected.axis_error, 1.0):
        return (
            "the motion passes so close to a separatrix that rounding alone decides when it falls; no method and no "
            f"step help, shorten the horizon to less than one nutation of {marks.period:.4g}"
        )
    if not expected.axis_error > EXPECTED:
        return ""
    size = f"expect an axis error of {min(expected.axis_error, math.pi):.1g} rad by t = {plan.horizon:.4g}"
    step, frequency = plan.step_size, marks.frequency
    if chart == "angles" and expected.passage > COARSE:
        return (
            f"{size}: the axis passes the {marks.pole} pole at {marks.gap:.2g} rad and precesses there by "
            f"{expected.passage:.2g} rad in a step; take a step below {0.1 / marks.rate:.1g} or an integrator whose "
            "chart has no poles, such as strang"
        )
    if expected.steps_per_nutation < 2.0:
        return (
            f"{size}: a step of {step:.4g} jumps over the nutation, whose period is {marks.period:.4g}; take a step "
            f"below {marks.period / 20.0:.2g}"
        )
    if step * frequency > SMALL_TURN:
        turn = trace(method, scene, step, chart).turn
        for order in (3, 4):
            if abs(order * turn - 2.0 * math.pi) < NEAR * order:
                return (
                    f"{size}: a step turns the nutation by {turn:.4g} rad, close to 1/{order} of a turn, a resonance "
                    f"(h omega = {step * frequency:.3f}); take a step of about {_smaller(method, plan, expected):.2g}"
                )
    if expected.outcome != "ok":
        return f"expect the run to be {sentence(expected.outcome, expected.reached, plan.horizon)}"
    return f"{size}: {_adding_up(method, plan, marks, expected)}"


def _adding_up(method: Integrator, plan: Plan, marks: Landmarks, expected: Forecast) -> str:
    """What to do about errors that add up over the nutations."""
    nutations = plan.horizon / marks.period
    if method.adaptive:
        return _adaptive(method, plan, marks, expected)
    if method.order is None:
        return "it has no order, so that a smaller step need not help; take another method, such as strang"
    return (
        f"a step is 1/{expected.steps_per_nutation:.3g} of a nutation, and errors add up over {nutations:.3g} "
        f"nutations; take a step of about {_smaller(method, plan, expected):.2g}"
    )


def _adaptive(method: Integrator, plan: Plan, marks: Landmarks, expected: Forecast) -> str:
    """Why the errors of an adaptive method grow, and the tolerance to try."""
    tolerance = max(plan.tolerance * AIM / min(expected.axis_error, 1.0), method.least_tolerance)
    if expected.unstable >= expected.axis_error:
        return f"the motion is unstable, and a change of its start grows large; try tolerance {tolerance:.1g}"
    return f"errors add up over {plan.horizon / marks.period:.3g} nutations; try tolerance {tolerance:.1g}"


def _smaller(method: Integrator, plan: Plan, expected: Forecast) -> float:
    """The step at which the forecast would be `AIM`, if the method keeps its order."""
    step = plan.step_size * math.pow(AIM / min(expected.axis_error, 1.0), 1.0 / (method.order or 1))
    return min(step, plan.step_size * expected.steps_per_nutation / 20.0) if expected.axis_error > 1.0 else step
