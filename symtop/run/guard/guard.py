"""The guard: one sentence with a remedy before a run whose error is expected to be large, nothing before any other.

Whether the error will be large is measured (`symtop.run.guard.forecast` runs the method on a short piece and compares
it with the closed form). The cause is read from exact landmarks of the motion, in this order:

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
from typing import NamedTuple

from symtop.core.numbers import EPSILON
from symtop.methods.framework.plan import Plan, Run, sentence
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene
from symtop.run.guard.forecast import Forecast, Landmarks, forecast, landmarks
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
PRECESSED = 0.1  # the same, of a step that is tried past a pole
TRIES, LESS = 8, 0.6  # steps that are tried, each at most so much of the one before
MOST_STEPS = 20_000_000_000  # of a run: ten minutes of the fastest kernel


class Trouble(NamedTuple):
    """Why a run will go wrong, and what to try instead."""

    reason: str  # with what to do, if that is not a step
    step: float = math.nan  # a first try
    otherwise: str = ""  # what may be done instead of it


def warning(scene: Scene, method: Integrator, chart: str, plan: Plan, done: Run | None = None) -> str:
    """Warn before the run if a large error is expected: one sentence with a remedy, else an empty one.

    A step is advised if the guard would be silent about it, and otherwise named as one to try. `done` is the run
    itself, where it has been made already because the probe would repeat it (`forecast.repeats`).
    """
    if method.control is None:
        return ""
    expected = forecast(scene, method, chart, plan, done)
    trouble = _trouble(scene, method, chart, plan, expected)
    if trouble is None:
        return ""
    remedy = "" if math.isnan(trouble.step) else f"; {_remedy(scene, method, chart, plan, trouble)}"
    return f"{method.name} on {scene.name}: {trouble.reason}{remedy}"


def _remedy(scene: Scene, method: Integrator, chart: str, plan: Plan, trouble: Trouble) -> str:
    """A step of two digits of which nothing is expected to go wrong: the first try, or the next smaller ones."""
    step, word, others = trouble.step, "try", f", or {trouble.otherwise}" if trouble.otherwise else ""
    for _ in range(TRIES):
        if not plan.horizon / step <= MOST_STEPS:
            return f"take {trouble.otherwise or 'another method'}: more than {MOST_STEPS:.0e} steps would be needed"
        step = float(f"{step:.2g}")
        tried = plan._replace(step_size=step)  # a forecast looks at the step and the horizon
        expected = forecast(scene, method, chart, tried)
        if expected.outcome == "ok" and _trouble(scene, method, chart, tried, expected) is None:
            word = "take"
            break
        step = min(LESS * step, _smaller(method, tried, expected))
    return f"{word} a step of about {step:.2g}{others}"


def _trouble(scene: Scene, method: Integrator, chart: str, plan: Plan, expected: Forecast) -> Trouble | None:
    marks = landmarks(scene)
    grows = _unstable(scene, method, chart, plan, marks, expected)
    return grows or _cause(scene, method, chart, plan, marks, expected)


def _growth(scene: Scene, method: Integrator, chart: str, step: float, frequency: float) -> Growth:
    """What a step does to small nutations; a symmetric method neither adds to them nor makes fine steps unstable."""
    if not method.symmetric:
        return nutation_growth(method, scene, step, chart, frequency)
    return Growth(trace(method, scene, step, chart).growth if step * frequency > SMALL_TURN else 1.0, EPSILON)


def _unstable(
    scene: Scene, method: Integrator, chart: str, plan: Plan, marks: Landmarks, expected: Forecast
) -> Trouble | None:
    """Small nutations that grow until they are seen; None if they do not, or if a probe has shown that they do not."""
    step, frequency = plan.step_size, marks.frequency
    seen = expected.whole and expected.outcome == "ok" and expected.axis_error <= EXPECTED
    if method.adaptive or seen:
        return None
    growth, steps = _growth(scene, method, chart, step, frequency), plan.horizon / step
    beside = marks.gap if marks.gap < BESIDE else 0.0  # of a pole, what grows is the tilt
    size, folds = marks.width + beside + growth.size, steps * math.log(max(growth.factor, 1.0))
    if (
        not growth.factor > 1.0 + max(NO_GROWTH, NONLINEAR * growth.size)
        or not size * math.expm1(min(folds, MOST_FOLDS)) > EXPECTED
    ):
        return None
    good, bad = SMALL_TURN / frequency, step
    if growth.factor > 1.0 + GROWS and good < bad:
        while bad - good > 1e-3 * bad:
            middle = 0.5 * (good + bad)
            stable = _growth(scene, method, chart, middle, frequency).factor <= 1.0 + GROWS
            good, bad = (middle, bad) if stable else (good, middle)
        return Trouble(
            f"small nutations (frequency {frequency:.4g}) grow at a step of {step:.4g}, the method is stable up to "
            f"{good:.4g} (h omega = {good * frequency:.3f})", 0.5 * good,
        )  # fmt: skip
    finer = step * math.pow(math.log1p(AIM / size) / folds, 1.0 / (method.order or 1))
    return Trouble(
        f"small nutations (frequency {frequency:.4g}) of {size:.1g} rad grow by {growth.factor - 1.0:.1g} of "
        f"themselves in each of {steps:.3g} steps", finer,
    )  # fmt: skip


def _cause(
    scene: Scene, method: Integrator, chart: str, plan: Plan, marks: Landmarks, expected: Forecast
) -> Trouble | None:
    """Why the run will go wrong; None if it will not."""
    if expected.rounding > EXPECTED and expected.rounding >= min(expected.axis_error, 1.0):
        return Trouble(
            "the motion passes so close to a separatrix that rounding alone decides when it falls; no method and no "
            f"step help, shorten the horizon to less than one nutation of {marks.period:.4g}"
        )
    if not expected.axis_error > EXPECTED:
        return None
    size = f"expect an axis error of {min(expected.axis_error, math.pi):.1g} rad by t = {plan.horizon:.4g}"
    if (coarse := _coarse(scene, method, chart, plan, marks, expected, size)) is not None:
        return coarse
    if expected.outcome != "ok":
        return Trouble(f"expect the run to be {sentence(expected.outcome, expected.reached, plan.horizon)}")
    if method.adaptive:
        return Trouble(f"{size}: {_adaptive(method, plan, marks, expected)}")
    if method.order is None:
        return Trouble(
            f"{size}: it has no order, so that a smaller step need not help; take another method, such as strang"
        )
    return Trouble(
        f"{size}: a step is 1/{expected.steps_per_nutation:.3g} of a nutation, and errors add up over "
        f"{plan.horizon / marks.period:.3g} nutations", _smaller(method, plan, expected),
    )  # fmt: skip


def _coarse(
    scene: Scene, method: Integrator, chart: str, plan: Plan, marks: Landmarks, expected: Forecast, size: str
) -> Trouble | None:
    """A step that is too long for a pole or for the nutation, or in resonance with it."""
    step, frequency = plan.step_size, marks.frequency
    if chart == "angles" and expected.passage > COARSE:
        return Trouble(
            f"{size}: the axis passes the {marks.pole} pole at {marks.gap:.2g} rad and precesses there by "
            f"{expected.passage:.2g} rad in a step", PRECESSED / marks.rate,
            "an integrator whose chart has no poles, such as strang",
        )  # fmt: skip
    if expected.steps_per_nutation < 2.0:
        return Trouble(
            f"{size}: a step of {step:.4g} jumps over the nutation, whose period is {marks.period:.4g}",
            marks.period / 20.0,
        )
    if step * frequency > SMALL_TURN:
        turn = trace(method, scene, step, chart).turn
        for order in (3, 4):
            if abs(order * turn - 2.0 * math.pi) < NEAR * order:
                return Trouble(
                    f"{size}: a step turns the nutation by {turn:.4g} rad, close to 1/{order} of a turn, a resonance "
                    f"(h omega = {step * frequency:.3f})", _smaller(method, plan, expected),
                )  # fmt: skip
    return None


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
