"""The coarsest setting at which a method meets an accuracy on a scene: found by running it, on a short horizon first.

The error of a quantity over a horizon T follows C T^a h^p: p the order, a the law of growth (energy, momenta and
mean frequencies 0 and angles 1 for maps that are symplectic or symmetric, 1 and 2 for the others, whose frequencies
drift with the energy). So a setting is sought in a few secant
steps on log error against log setting; over a short horizon first, with the target scaled by that law, then over all.
"""

import math
from typing import NamedTuple

from symtop.measure.accuracy import error_row
from symtop.measure.timing import bare_run, timings
from symtop.measure.work import coarsest_step
from symtop.methods.registry import Integrator, integrators
from symtop.model.scenes import Scene

SHORT = 12.37  # nutations of a trial run
AIM = 0.5  # of the target: what the secant steers for
LEAST, TRIES = 0.3, 9  # an error between LEAST times the target and the target ends the search
LOOSEST = 0.4
MOST_EVALUATIONS = {"compiled": 3e8, "python": 3e5}  # of one run
FLAT = 1.3  # a halved setting that gains less has met rounding


class Missed(NamedTuple):
    """Why no setting was found, a sentence's beginning, and the smallest error seen (infinite if no run ended well)."""

    why: str
    error: float = math.inf


STOPPED = "Stopped by rounding or by what the method's settings allow"
BUDGET = "Not within the work that a run may take"
FAILED = "No run ended well"
TRIED = f"Not within {TRIES} runs"


class Met(NamedTuple):
    """A setting, the largest error measured with it over `horizon`, what the reference can judge, and how it ended."""

    integrator: Integrator
    setting: float
    error: float
    bound: float
    horizon: float
    evaluations: float
    outcome: str


def observed(quantity: str) -> str:
    """What must be observed to see a quantity: the attitude only for itself."""
    return "attitude" if quantity == "attitude" else "axis"


def growth(method: Integrator, quantity: str) -> int:
    """The exponent a of the error's growth with the horizon that the method's traits promise."""
    angles = quantity in ("axis", "attitude", "theta")
    structured = bool(method.symplectic) or bool(method.symmetric)
    return (1 if angles else 0) + (0 if structured else 1)


def attempt(scene: Scene, method: Integrator, setting: float, horizon: float, quantity: str) -> Met:
    """One run; the error of a run that failed is infinite."""
    phases = quantity in ("nutation_period", "precession_rate")
    row = error_row(scene, method, setting, horizon, observed(quantity), phases=phases)
    error, outcome = float(row[quantity]), str(row["outcome"])
    error = error if outcome == "ok" and math.isfinite(error) else math.inf
    return Met(
        method, setting, error, float(row[f"{quantity}_bound"]), horizon, float(row["force_evaluations"]), outcome
    )


def judgeable(scene: Scene, quantity: str, horizon: float) -> float:
    """The least error of a quantity that the reference can judge over a horizon; NaN if the motion does not show it."""
    return attempt(scene, integrators()["exact"], math.nan, horizon, quantity).bound


def first_guess(scene: Scene, method: Integrator, horizon: float, accuracy: float) -> float:
    """A setting to begin with when nothing is known: error about (h/period)^p, or about the tolerance."""
    if method.knob == "tolerance":
        return min(max(0.1 * accuracy, method.least_tolerance * 1.01), LOOSEST)
    period = scene.time_scale(horizon)
    return float(min(0.2 * period * accuracy ** (1.0 / (method.order or 2)), coarsest_step(scene, horizon)))


def search(
    scene: Scene,
    method: Integrator,
    accuracy: float,
    quantity: str,
    horizon: float,
    guess: float | None = None,
    patience: float = math.inf,
) -> Met | Missed:
    """The coarsest setting found that meets the accuracy over the horizon, or the reason why there is none.

    No run is begun that would take more than `patience` force evaluations.
    """
    patience = min(patience, MOST_EVALUATIONS[method.tier])
    step = method.knob == "step_size"
    power = float(method.order or 2) if step else 1.0
    least, most = (0.0, coarsest_step(scene, horizon)) if step else (method.least_tolerance * 1.001, LOOSEST)
    setting = min(max(guess or first_guess(scene, method, horizon, accuracy), least), most)
    if step and horizon / setting > patience:
        return Missed(BUDGET)
    best, last, failing = None, None, math.inf  # failing: the finest setting known to miss the target
    why, smallest = TRIED, math.inf
    for _ in range(TRIES):
        met = attempt(scene, method, setting, horizon, quantity)
        smallest = min(smallest, met.error)
        if met.error <= accuracy:
            best = met if best is None or setting > best.setting else best
            if met.error >= LEAST * accuracy or setting >= most:
                break
        else:
            failing = min(failing, setting)
            if last is not None and last.setting > setting and last.error < FLAT * met.error:
                why = STOPPED  # a finer setting gains nothing
                break
        power = _slope(last, met, power, float(method.order or 12))
        last, setting = met, min(max(setting * _factor(met.error, accuracy, power, step=step), least), most)
        if best is not None and setting >= failing:
            setting = math.sqrt(best.setting * failing)
            if failing < 1.15 * best.setting:
                break
        work = met.evaluations * (last.setting / setting if step else 1.0)
        if setting == last.setting or work > patience:
            why = BUDGET if work > patience else STOPPED
            break
    return best or Missed(FAILED if math.isinf(smallest) and why != BUDGET else why, smallest)


def _slope(last: Met | None, met: Met, power: float, order: float) -> float:
    """The local order between two runs, where they show one."""
    if last is None or last.setting == met.setting or not 0.0 < met.error < math.inf or not last.error < math.inf:
        return power
    seen = math.log(max(last.error, 1e-300) / met.error) / math.log(last.setting / met.setting)
    return float(min(max(seen, 0.5), 2.0 * order))


def _factor(error: float, accuracy: float, power: float, *, step: bool) -> float:
    """By how much to change a setting whose error is known."""
    if math.isinf(error):
        return 0.4 if step else 0.01
    factor = (AIM * accuracy / max(error, 1e-3 * accuracy)) ** (1.0 / power)
    return float(min(max(factor, 0.02 if step else 1e-5), 8.0 if step else 1e4))


def seconds(scene: Scene, met: Met, quantity: str, horizon: float) -> float:
    """Wall time of a bare run to a horizon with a setting: measured, or scaled from the run it was found by."""
    chart = met.integrator.chart_for(observed(quantity))
    run = timings([bare_run(scene, met.integrator, chart, met.setting, met.horizon)], batches=3, batch=0.004)
    return float(run[0].best) * horizon / met.horizon
