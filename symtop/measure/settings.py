"""The setting of a method, a step size or a tolerance: its limits, ladders of settings, and the search for one.

The error of a quantity over a horizon T follows C T^a s^p: s the setting, p the order of a fixed-step method and about
1 of an adaptive one, a the law of growth (energy, momenta and mean frequencies 0 and angles 1 for maps that are
symplectic or symmetric, 1 and 2 for the others, whose frequencies drift with the energy). So log error is close to a
straight line in log setting. `seek` steps along that line with the known power until one run misses the target and
another meets it, and then along the line through both.
"""

import math
from collections.abc import Callable, Sequence
from decimal import ROUND_DOWN, Context
from typing import NamedTuple

from symtop.core.errors import SymtopError
from symtop.measure.accuracy import error_row
from symtop.measure.phase import FREQUENCIES
from symtop.measure.timing import bare_run, timings
from symtop.methods.framework.registry import Integrator, integrator, integrators, variants
from symtop.model.scenes import Scene
from symtop.run.simulation import chart_of, likely_step

LEAST_RUN = 6.37  # steps of a run: fewer samples do not show its error; not commensurate with the nutation
LEAST_STEPS = 4.37  # per nutation, in a search by a constant's error: longer steps may keep it and miss the motion
LOOSEST_TOLERANCE = 0.4  # tolerance
TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)  # axis errors, rad, at which studies compare costs
ANGLES = ("axis", "attitude", "theta")
OF_BODY = (*ANGLES, "energy", "p_phi")  # quantities of a body without symmetry
TEDIOUS_TOLERANCE = 1e-8  # least one of an implicit method in Python: radau at 1e-12 takes a minute for ten nutations
TRIAL_NUTATIONS = 120.37  # nutations of a trial run: in a dozen, the growth of unstable motions is not seen
CLOSE_ENOUGH = 0.3  # a search ends at an error between this part of the target and the target
TRIES = 9  # runs of a search
MOST_EVALUATIONS = {"compiled": 3e8, "python": 3e5}  # force evaluations of one run
FLAT_GAIN, NEAR_ROUNDING = 1.3, 1e-8  # errors below the second are rounding if a finer setting gains less
STAIR = 0.1  # a tolerance at which the error did not fall is next multiplied by this or less

STOPPED = "Stopped by rounding or by what the method's settings allow"
BUDGET = "Not within the work that a run may take"
FAILED = "No run ended well"
TRIED = f"Not within {TRIES} runs"


def smallest_charts(observe: str) -> list[Integrator]:
    """Every method in each chart that determines `observe`, but not in "attitude" if it also has the chart "axis"."""
    larger = ("attitude",)  # this chart costs more for the same axis and angular momentum
    return [row for row in variants(observe) if row.charts() != larger or "axis" not in integrator(row.method).charts()]


def compared(observe: str) -> list[Integrator]:
    """Every method to compare, in its `smallest_charts` for "axis" or in each chart with "attitude"."""
    rows = smallest_charts(observe) if observe == "axis" else variants(observe)
    return [row for row in rows if not row.exact_steps]  # these evaluate a closed form that other problems do not have


def least_tolerance(method: Integrator) -> float:
    """The least tolerance that an adaptive method is tried with."""
    slow = method.implementation == "python" and method.explicit is False
    return max(method.least_tolerance, TEDIOUS_TOLERANCE * slow)


def limits(scene: Scene, method: Integrator, horizon: float, quantity: str = "axis") -> tuple[float, float]:
    """The finest and the coarsest setting.

    For angles a step may be as long as its error allows: states between two steps are reached by shorter steps, whose
    errors are smaller. A run has at least `LEAST_RUN` steps, because errors are measured at steps. For constants of the
    motion and frequencies, which do not show errors of the angles, a step is at most about a quarter of a nutation.
    """
    if method.fixed_step:
        longest = math.inf if quantity in ANGLES else scene.nutation_period / LEAST_STEPS
        return 0.0, min(horizon / LEAST_RUN, longest)
    return 1.001 * least_tolerance(method), LOOSEST_TOLERANCE


def ladder(method: Integrator, scene: Scene, horizon: float, count: int = 9, most: float = 4e6) -> list[float]:
    """`count` settings of a method, coarse to fine, evenly in the logarithm; [NaN] for a method without a setting.

    Steps go from ten per nutation to where the method reaches round-off or makes `most` steps in a run, tolerances from
    1e-2 to the least. The finest step of a method of order p resolves a nutation about 10 * 10^(11/p) times; methods of
    high order, whose steps have many stages, begin at five per nutation.
    """
    if method.fixed_step:
        period, power = scene.time_scale(horizon), method.order or 2
        first = 10.37 if power <= 4 else 5.37  # not commensurate with the nutation
        longest = max(math.log10(most * period / horizon / first), 0.5)
        decades = min(4.5, 11.0 / power + math.log10(10.37 / first), longest)
        return [period / (first * 10.0 ** (decades * k / (count - 1))) for k in range(count)]
    if not method.adaptive:
        return [math.nan]
    decades = -2.0 - math.log10(max(least_tolerance(method), 1e-18))
    return [10.0 ** (-2.0 - 0.999 * decades * k / (count - 1)) for k in range(count)]


def between(fine: float, low: float, coarse: float, high: float, goal: float) -> float:
    """The setting with error `goal`, by log-log interpolation between `fine` (error `low`) and `coarse` (`high`)."""
    if math.isinf(high) or low <= 0.0 or high > 1e6 * low:
        fraction = 0.5  # the errors follow no power law
    else:
        fraction = min(max(math.log(goal / low) / math.log(high / low), 0.1), 0.9)
    return float(fine * (coarse / fine) ** fraction)


def seek(
    run: Callable[[float], tuple[float, float]], guess: float, target: float, ends: tuple[float, float], power: float,
    *, fixed_step: bool = True, patience: float = math.inf, least: float = CLOSE_ENOUGH,
) -> tuple[float, str]:  # fmt: skip
    """The coarsest setting found with an error of at most `target`, if possible above `least * target`, and "".

    Without one, NaN and the reason. `run` takes a setting and returns the error, infinite after a failure, and the
    force evaluations of a run. `ends` are the finest and the coarsest setting, `power` is the exponent of the error in
    the setting. A run that is estimated to take more than `patience` force evaluations is not begun.
    """
    (finest, coarsest), goal = ends, math.sqrt(least) * target
    # factors by which a setting changes: after a failed run, at the least and at the most
    after_failure, finer, coarser = (0.4, 0.02, 8.0) if fixed_step else (0.01, 1e-5, 1e4)
    setting, why, smallest, flat = min(max(guess, finest), coarsest), TRIED, math.inf, 0
    fine: tuple[float, float] | None = None  # the coarsest setting that meets the target, with its error
    coarse: tuple[float, float] | None = None  # the finest setting that misses it, with its error
    for _ in range(TRIES):
        last = setting
        error, evaluations = run(setting)
        smallest = min(smallest, error)
        if error <= target:
            fine = setting, error
            if error >= least * target or setting >= coarsest:
                break
        else:
            improves = fine is not None or coarse is None or not coarse[1] < FLAT_GAIN * error < NEAR_ROUNDING
            flat, coarse = 0 if improves else flat + 1, (setting, error)
            if flat == (1 if fixed_step else 2):  # if the order depends on the tolerance, the error falls in jumps
                why = STOPPED
                break
        if fine is not None and coarse is not None:
            if coarse[0] < 1.15 * fine[0]:
                break
            setting = between(*fine, *coarse, goal)
        else:
            change = (goal / max(error, 1e-3 * target)) ** (1.0 / power)
            setting *= after_failure if math.isinf(error) else min(max(change, finer), STAIR if flat else coarser)
            setting = min(max(setting, finest), coarsest)
        if setting == last or evaluations * (last / setting if fixed_step else 1.0) > patience:
            why = STOPPED if setting == last else BUDGET
            break
    if fine is not None:
        return fine[0], ""
    return math.nan, FAILED if math.isinf(smallest) and why != BUDGET else why


class Attempt(NamedTuple):
    """A setting and the run with it: the largest error over `horizon`, the least judgeable error, and the work."""

    integrator: Integrator
    setting: float
    error: float
    bound: float  # the least error that the reference can judge
    horizon: float
    evaluations: float  # of the force
    why: str = ""  # the reason if no setting meets the accuracy; then the numbers may be NaN


def unmet(method: Integrator, horizon: float, why: str) -> Attempt:
    """The result without a setting, for the reason `why`."""
    return Attempt(method, math.nan, math.inf, math.nan, horizon, math.nan, why)


def observed(quantity: str) -> str:
    """The `observe` argument that a quantity needs: "attitude" for the attitude, "axis" for all others."""
    return "attitude" if quantity == "attitude" else "axis"


def growth(method: Integrator, quantity: str) -> int:
    """The exponent a of the error's growth with the horizon, from the declared structure and constants."""
    return (quantity in ANGLES) + (not method.keeps_frequencies)


def attempt(scene: Scene, method: Integrator, setting: float, horizon: float, quantity: str) -> Attempt:
    """One run; the error of a run that failed is infinite."""
    row = error_row(scene, method, setting, horizon, observed(quantity), phases=quantity in FREQUENCIES)
    error, bound, work = (float(row[name]) for name in (quantity, f"{quantity}_bound", "force_evaluations"))
    valid = row["outcome"] == "ok" and math.isfinite(error)
    return Attempt(method, setting, error if valid else math.inf, bound, horizon, work)


def judgeable(scene: Scene, quantity: str, horizon: float) -> float:
    """The least error of a quantity that the reference can judge over a horizon; NaN if it has no such quantity."""
    if not scene.of_body:
        return attempt(scene, integrators()["exact"], math.nan, horizon, quantity).bound
    try:  # any method will do: the bound depends on the reference alone
        return attempt(scene, integrators()["rk4"], horizon / LEAST_RUN, horizon, quantity).bound
    except SymtopError as error:
        raise SymtopError(error.renamed({"times": "horizon"}), "horizon") from error


def search(
    scene: Scene, method: Integrator, accuracy: float, quantity: str, horizon: float, guess: float | None = None,
    patience: float = math.inf, least: float = CLOSE_ENOUGH, longest: float = math.inf,
) -> Attempt:  # fmt: skip
    """The coarsest setting found that meets the accuracy over the horizon, or `unmet`.

    Without a `guess` it begins at the setting expected to meet the accuracy if the error is about (h/period)^p, or at a
    tenth of the accuracy for a tolerance. No setting is above `longest`. `patience` and `least` are those of `seek`.
    """
    finest, coarsest = limits(scene, method, horizon, quantity)
    ends, patience = (finest, min(coarsest, longest)), min(patience, MOST_EVALUATIONS[method.implementation])
    power = float(method.order or 2) if method.fixed_step else 1.0
    if guess is None:
        guess = likely_step(scene, method, horizon, accuracy) if method.fixed_step else 0.1 * accuracy
    if method.fixed_step and horizon / min(guess, ends[1]) > patience:
        return unmet(method, horizon, BUDGET)
    results: dict[float, Attempt] = {}

    def run(setting: float) -> tuple[float, float]:
        result = results[setting] = attempt(scene, method, setting, horizon, quantity)
        return result.error, result.evaluations

    try:
        result = seek(run, guess, accuracy, ends, power, fixed_step=method.fixed_step, patience=patience, least=least)
    except SymtopError as error:  # a start at a pole, for a method in the angles chart
        result = math.nan, f"Not run, as {error}"
    setting, why = result
    return unmet(method, horizon, why) if why else results[setting]


def at_accuracy(method: Integrator, ratio: float) -> float:
    """The factor from the work of a run, with an error of `ratio` times the accuracy, to the work at the accuracy."""
    return float(min(max(ratio, CLOSE_ENOUGH), 1.0) ** (1.0 / (method.order or math.inf)))


def rounded(scene: Scene, met: Attempt, accuracy: float, quantity: str) -> Attempt:
    """The result with its setting rounded down to five digits, if a run with that meets the accuracy; else `met`."""
    setting = float(Context(prec=5, rounding=ROUND_DOWN).create_decimal(repr(float(met.setting))))
    rerun = met if setting == met.setting else attempt(scene, met.integrator, setting, met.horizon, quantity)
    return rerun if rerun.error <= accuracy else met


def seconds(scene: Scene, mets: Sequence[Attempt], quantity: str, horizon: float, batches: int = 5) -> list[float]:
    """Wall times of bare runs with the settings of `mets`, timed against each other, scaled to `horizon`; seconds."""
    runs = []
    for met in mets:
        chart = chart_of(met.integrator, scene.observes, observed(quantity))
        runs.append(bare_run(scene, met.integrator, chart, met.setting, met.horizon))
    results = timings(runs, batches, batch=0.002, patience=0.06 * batches, exact=False)
    return [timing.best * horizon / met.horizon for timing, met in zip(results, mets, strict=True)]
