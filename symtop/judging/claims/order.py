"""The claim of order: measured by the method's table, by the power series of a step, by slopes and limits of runs.

The four detect different defects, and a declared order is refuted if any of them refutes it. It is confirmed by the
slope (`symtop.measure.order.order_verdict`, as in every study), or by the series if no slope can be judged.

*Slopes* of the errors of runs are extrapolated to h = 0 by `symtop.measure.order` from a ladder of steps, then again
with added steps in the decades of error above rounding where a method of high order is asymptotic. If that does not
decide, longer runs on `FALLBACK_SCENE` are used, the first that decides. An adaptive method is fitted against its mean
step.

*The limit.* A method whose coefficients have a sum that is off by 1e-9 has the right slope down to an error of 1e-9,
which then stays. So the signed error at the end of a short run of many steps is extrapolated to h = 0 (Richardson's,
eliminating h^p and h^(p+1)); a rest beyond rounding is a wrong limit.

*The power series of one step* (`claims.step_series`) shows an order condition that is off by 1e-10, which no slope
does, but not errors from data that a run carries from step to step.

*The table*, Butcher's or a splitting's, needs no run. A condition of order k that is off by d adds an error of
d (w h)^k to a step, w = 2 pi/nutation, besides the error d' (w h)^(p+1) of a method of order p: a slope shows it only
below w h = (d/d')^(1/(p + 1 - k)), often a step so small that rounding is larger.

A map of (theta, p_theta) is judged by its error of theta. An adaptive step that claims no order must converge: at the
least tolerance its error is rounding, or it falls with the tolerance.

*Time.* The top's equations are autonomous, so that a method that calls f at wrong times (wrong nodes c of its tableau)
is right on them. With a clock g of varying speed the motion z(t) = y(g(t)) solves

    z' = g'(t) f(z),        g = t + a (sin(w (t - t0) + 1) - sin 1)/w,

which depends on t. The series of one step from t0 is compared with that of y(g(t)). If its order is lower than with an
even clock, a = 0, the times are wrong. A step that calls f at t0 alone was written for f(y), which is no fault.
"""

import contextlib
import math
from collections.abc import Collection
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging.claims.order_conditions import Conditions, conditions, splitting_conditions, triangle
from symtop.judging.claims.step_series import Series, compared, step_series
from symtop.judging.claims.structure import ONE_MAP, map_of
from symtop.judging.claims.subject import FINEST_RUN, QUICK_SHARE, Subject, hidden_by_single
from symtop.judging.findings import UNMEASURED, Finding, Reading, inapplicable, undecided, yes_no
from symtop.measure.accuracy import error_table
from symtop.measure.order import (
    CONFIRMED_BEYOND,
    LARGEST_ERROR,
    REFUTED_BEYOND,
    Fit,
    order_verdict,
    slower,
    wrong_limit,
)
from symtop.measure.order_table import observable, order_fit, order_table
from symtop.measure.settings import ladder
from symtop.measure.step_map import APART, SEVERAL, StepMap, aligned, generic_start, one_step, restart_gap, unit_of
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.loop import FixedStep
from symtop.methods.framework.plan import Array
from symtop.methods.framework.preparation import ScaledRule
from symtop.methods.framework.registry import Integrator
from symtop.methods.runge_kutta.explicit import Tableau
from symtop.methods.splitting.loop import Composition
from symtop.methods.splitting.rotor import EXACT
from symtop.model.scenes import Scene, scene as find_scene
from symtop.model.top import Angles
from symtop.run.reference.sensitivity import conditioning

NUTATIONS = 1.37  # length of the runs that the slope is fitted to
FALLBACK_SCENE, LONGER_RUNS = "goldstein", (8.37, 40.0)  # lengths in nutations; if the first runs do not decide
LARGEST_EXACT = 2.37  # steps per nutation at which a method with exact steps is run, besides the ladder
LIMIT_NUTATIONS = 0.37  # nutations: length of the runs that are extrapolated to h = 0
LIMIT_STEPS = {1: 40_000, 2: 20_000, 3: 6_000, 4: 2_000, 5: 1_000, 6: 500}  # of the coarsest; 200 beyond order 6
TRUE_LIMIT = 1e-11  # a limit as close as this is the true motion
SHOWN_SETTINGS = 24  # settings in the traces of the order
DRAWS, DRAW_SECONDS = (96, 32), (10.0, 3.0)  # random starts where the order of one step is measured
HALVINGS, SHORT_STEP = 10, 80.0  # steps from each start, each half of the last; a short step is 1/80 of a nutation
LOWER, JUMP = 0.6, 3.0  # differences by which a measured order is lower than, or jumps above, the declared one
LARGE_ERROR, ROUNDING_ERROR = 1e-3, 1e-11  # of a step: larger ones follow no power, smaller ones are rounding
TINY_STEP = 8.0  # parts of a short step: errors of a smaller one are judged however large they are
SINGLE_EPSILONS = 100.0  # single-precision epsilons: smaller errors of a step in single precision are rounding
CLOCK_DEPTH, CLOCK_WAVES = 0.6, 0.7  # a, and periods of the clock's speed in a nutation
CLOCK_START = 0.23  # nutations: t0
UNSTABLE_GROWTH = 1e4  # amplification by the motion above which errors of runs follow no power of the step
SINGLE_NOISE = 1e-9  # noise of the h^1 term in double precision; rounding of a step to single precision causes 1e-8
CONVERGES, ROUNDED_ERROR, FALL = "converges", 1e-10, (1e4, 10.0)  # an error falls to a tenth over four decades
SHARP_DEFECT, SHARE_OF_NEXT = 1e-5, 1e-3  # a wrong term with a smaller defect, or part of the next, shows in no slope
ABOVE_BOUND, FINEST_RUNS, FIT_FACTOR = 10.0, 5, 10.0  # finest errors beyond 10 bounds; the factor by which they fit h^p


def measure(subject: Subject) -> list[Finding]:
    """The finding on the order; for a method with a table, its reason begins with the conditions of the table."""
    method = subject.method
    if method.control is None:
        return [inapplicable("order", "it has no step and no tolerance", yes_no(method.order))]
    finding = _exactness(subject) if method.exact_steps else _by_steps(subject)
    if (table := table_of(method)) is not None:
        power = method.order or table.order
        verdict = "refuted" if table.order < min(power, len(table.defect)) else finding.verdict
        finding = finding._replace(verdict=verdict, why=f"{table.words(power)}; {finding.why}")
    if method.order and finding.verdict == "confirmed" and (lower := _lower_elsewhere(subject, method.order)):
        measured = Reading("order", lower[0], text=f"{lower[0]:.1f} elsewhere")
        finding = Finding("order", finding.declared, measured, "refuted", lower[1], lower[0], LOWER)
    return [finding]


def _lower_elsewhere(subject: Subject, power: int) -> tuple[float, str] | None:
    """An order of one step below `power` at a random start, top, time and step, with a sentence; None if there is none.

    Steps of h, h/2, h/4 ... have errors d(h) ~ h^(order + 1). To exclude steps that are only too long, the order must
    be lower at the finest pairs, which are short, or lower at one pair and far above `power` at the next finer one.
    It is 0 where the two shortest steps fail.
    """
    if subject.in_plane or not subject.method.fixed_step or subject.method.exact_steps:
        return None
    rng = np.random.default_rng(subject.seed)
    for name, scene in subject.elsewhere(DRAWS, DRAW_SECONDS):
        scale = scene.time_scale() * math.sin(scene.start.theta)
        sizes: Array = scale / rng.uniform(9.0, 18.0) / 2.0 ** np.arange(float(HALVINGS))
        for chart in subject.charts:
            with contextlib.suppress(SymtopError):
                step = one_step(subject.method, chart, scene, float(sizes[0]))
                if np.isnan((errors := _step_errors(step, scene.start, sizes))[-2:]).all():
                    return 0.0, f"a step of h = {sizes[-1]:.2g} from {name} fails, in the {chart} chart"
                if restart_gap(step, scene.start) > ONE_MAP:
                    continue
                floor = max(ROUNDING_ERROR, subject.rounding(SINGLE_EPSILONS))
                order, h = _lower(sizes, errors, power, scale / SHORT_STEP, floor)
                if (order := max(order, 0.0)) < power:
                    return order, f"a step of h = {h:.2g} from {name} has order {order:.1f}, in the {chart} chart"
    return None


def _step_errors(step: StepMap, start: Angles, sizes: Array) -> Array:
    """The errors of single steps of these sizes; NaN where a step fails."""
    motion, z, errors = step.motion(start), step.point(start), np.full(sizes.size, math.nan)
    for k, h in enumerate(sizes.tolist()):
        with contextlib.suppress(SymtopError):
            errors[k] = step.gap(step.image(z, h), motion(h))
    return errors


def _lower(sizes: Array, errors: Array, power: int, short: float, floor: float) -> tuple[float, float]:
    """An order lower than `power`, or infinity, and its step; errors below `floor` are rounding."""
    with np.errstate(all="ignore"):
        orders = np.log2(errors[:-1] / errors[1:]) - 1.0
    clear = ((errors[:-1] < LARGE_ERROR) | (sizes[:-1] <= short / TINY_STEP)) & (errors[1:] > floor)
    fine = np.flatnonzero(clear & (sizes[:-1] <= short))[-2:]
    if fine.size == 2 and (orders[fine] < power - LOWER).all():
        return float(orders[fine].max()), float(sizes[fine[0]])
    jumps = np.flatnonzero(clear[1:] & clear[:-1] & (orders[1:] > power + JUMP) & (orders[:-1] < power - LOWER))
    return (float(orders[jumps[0]]), float(sizes[jumps[0]])) if jumps.size else (math.inf, math.nan)


def on_body(subject: Subject) -> list[Finding]:
    """The finding on a body without symmetry: from the slope of attitude errors, or from errors that do not fall."""
    claim, scene = subject.method.order, subject.scene
    order = measured_order(subject.method, scene, quick=subject.quick, finest=subject.finest, main="attitude")
    subject.traces.update(order.traces())
    fit, verdict, why = order.main, order_verdict(claim, order.main), f"attitude {order.main} on {scene.name}"
    if claim is None and subject.stepper is not None and subject.method.adaptive:
        return [_converges(order, why)]
    if not order.measured:
        floor = max(TRUE_LIMIT, subject.rounding(subject.finest or 0.0))
        if math.isfinite(error := wrong_limit(order.step_size, order.error, order.bound, floor)):
            words = f"however small its step, it goes to a motion that is wrong by {error:.1e} rad on {scene.name}"
            return [_wrong_limit(claim, error, words)]
        return [undecided("order", yes_no(claim), _reason(subject, fit.reason))]
    if verdict == "refuted" and fit.slope - fit.interval > (claim or 0) + REFUTED_BEYOND:  # as Fasso's on some bodies
        verdict, why = "measured", f"{why}: here the error falls with a higher power"
    return [Finding("order", yes_no(claim), order.measured, verdict, why, fit.slope, fit.interval)]


def _wrong_limit(claim: int | None, error: float, why: str) -> Finding:
    verdict = "measured" if claim is None else "refuted"
    return Finding("order", yes_no(claim), Reading("wrong limit", error), verdict, why, error, TRUE_LIMIT)


def _terms(series: Series) -> Reading:
    order, term = max(series.order, 0), series.order + 1
    text = f"{order} or more"
    if series.is_exact:
        defect = f"{series.defect[term]:.1g} +- {series.noise[term]:.0g} of it"
        text = f"{order}: in one step the term in h^{term} is the first that is wrong, by {defect}"
    return Reading("by a term", order, text=text)


def series_of(subject: Subject) -> Series | None:
    """The series of the chart with the lowest order, beside a pole on `FALLBACK_SCENE`; None without a map."""
    candidates = []
    if math.sin(generic_start(subject.scene).theta) <= APART:
        subject = replace(subject, scene=find_scene(FALLBACK_SCENE))
    for chart in subject.charts if subject.method.fixed_step else ():
        with contextlib.suppress(SymtopError):
            step, start = map_of(subject, chart)
            if restart_gap(step, start) <= ONE_MAP:
                candidates.append(step_series(step, start, subject.scene.time_scale()))
    return min((series for series in candidates if series.resolved >= 0), key=lambda series: series.order, default=None)


class Order(NamedTuple):
    """Errors of runs and the orders fitted to them."""

    scene: str
    tolerance: Array
    step_size: Array  # mean step of an adaptive method
    error: Array  # of the main quantity: attitude, or axis if the chart has no attitude
    bound: Array  # of the reference for it
    main: Fit  # for the main quantity; it decides
    fits: dict[str, Fit]  # for the main quantity, theta and energy

    @property
    def measured(self) -> Reading:
        """The slope of the main quantity, or `UNMEASURED` if there is none."""
        fit = self.main
        return Reading("slope", fit.slope, text=str(fit)) if math.isfinite(fit.slope) else UNMEASURED

    def traces(self) -> dict[str, Array]:
        """Steps, errors and flags of those used in the fit, (SHOWN_SETTINGS,) from the finest on, padded with NaN."""
        rank = np.argsort(self.step_size)[:SHOWN_SETTINGS]
        columns = {"step_size": self.step_size, "error": self.error, "fitted": self.main.used.astype(float)}
        padded = np.full(SHOWN_SETTINGS - rank.size, math.nan)
        return {name: np.concatenate([values[rank], padded]) for name, values in columns.items()}


def measured_order(
    method: Integrator, scene: Scene, *, quick: bool = False, finest: float | None = None, main: str = ""
) -> Order:
    """Slopes of the errors of attitude (or axis, or `main`), theta and energy; `finest`: most steps of a run."""
    runs, quantity = [(scene, NUTATIONS)], observable(method)
    main = main or quantity
    if finest is not None and method.fixed_step:
        runs.append((scene, LIMIT_NUTATIONS))  # the same number of steps, and smaller errors
    has_order = method.fixed_step and method.order is not None and not scene.of_body
    if has_order and not quick and method.implementation == "compiled":
        runs += [(find_scene(FALLBACK_SCENE), nutations) for nutations in LONGER_RUNS]
    count = (11 if quick else 13) if method.fixed_step else (9 if quick else 25)  # errors of adaptive methods scatter
    max_steps = FINEST_RUN[method.implementation] * (QUICK_SHARE if quick else 1.0) if finest is None else finest
    orders: list[Order] = []
    for problem, nutations in runs:
        horizon = nutations * problem.time_scale()
        settings = ladder(method, problem, horizon, count, max_steps)
        table = order_table(problem, method, settings, horizon, quantity, dense=finest is None)
        step = table["step_size"].values if method.fixed_step else horizon / table["steps"].values
        fits = {name: order_fit(problem, method, table, name, horizon) for name in (main, "theta", "energy")}
        columns = table["tolerance"].values, step, table[main].values, table[f"{main}_bound"].values
        orders.append(Order(problem.name, *columns, fits[main], fits))
        decided = problem is scene or order_verdict(method.order, fits[main], fits.values()) != "undecided"
        if orders[-1].measured and decided:
            return orders[-1]
    return next((order for order in orders if order.measured), orders[-1 if scene.of_body else 0])


def _by_steps(subject: Subject) -> Finding:
    method, scene, finest = subject.method, subject.scene, subject.finest
    series, claim = series_of(subject), method.order
    options: dict[str, Any] = {"quick": subject.quick, "finest": finest, "main": "theta" if subject.in_plane else ""}
    order = measured_order(method, scene, **options)
    if series and not order.measured and series.is_exact and series.order < (claim or 0):
        # for a high declared order the ladder has long steps, whose errors follow no power if the true order is low,
        # and the limit is extrapolated by a power that errors do not have, and looks wrong
        method = replace(method, order=max(series.order, 1))
        order = measured_order(method, scene, **options)
    main, measured = order.main, order.measured
    subject.traces.update(order.traces())
    slopes = ", ".join(f"{name} {fit}" for name, fit in order.fits.items() if math.isfinite(fit.slope))
    slopes = f"slopes {slopes} on {order.scene}" if slopes else "no slope"
    power = method.order or 1
    # if a step certainly has the motion's terms up to h^power, its runs converge to the motion
    follows = series and series.order >= power and float(series.noise[1]) < SINGLE_NOISE
    settled = measured or conditioning(scene, LIMIT_NUTATIONS * scene.time_scale()) > UNSTABLE_GROWTH
    height = math.sin(generic_start(scene).theta)
    pole = max(height, math.ulp(1.0)) if height <= APART else 1.0  # angles have an error of 2e-16 over the square
    if method.fixed_step and not (subject.in_plane or (settled and follows)):
        power = max(1, min(method.order or 99, round(main.slope))) if measured else power
        error, uncertainty = limit(method, scene, power, finest)
        if error > max(TRUE_LIMIT / pole**2, 10.0 * uncertainty, subject.rounding(finest or 0.0)):
            words = f"as its step goes to zero it goes to a motion that is wrong by {error:.1e} ({slopes})"
            return _wrong_limit(claim, error, words)
    if claim is not None:
        finding = _declared(claim, order, order.fits.values() if method.fixed_step else (), series, slopes)
        lowest = min((fit.slope for fit in order.fits.values() if math.isfinite(fit.slope)), default=0.0)
        near_pole = min(height, math.sin(scene.start.theta)) <= APART
        wrong_term = series is not None and series.is_exact and series.order < claim
        faster = near_pole and method.fixed_step and lowest > claim - CONFIRMED_BEYOND and not wrong_term
        if finding.verdict == "refuted" and faster:
            finding = finding._replace(verdict="undecided", why=f"beside a pole errors may fall faster: {finding.why}")
        return finding._replace(why=_reason(subject, finding.why)) if finding.verdict == "undecided" else finding
    if subject.stepper is not None and method.adaptive:
        return _converges(order, slopes)
    value, why = main.slope, slopes
    if series is not None:
        power = round(main.slope) if measured else series.order
        why = f"{slopes}; {series.words(power)}"
        if not measured or series.order < power:  # the slope, unless the series of a step has a lower order
            measured, value = _terms(series), float(max(series.order, 0))
    if not measured:
        return undecided("order", "", _reason(subject, main.reason))
    return Finding("order", "", measured, "measured", why, value, main.interval)


def _reason(subject: Subject, why: str) -> str:
    """The reason why an order could not be judged, after that of single precision if it applies."""
    return hidden_by_single(floor, why) if (floor := subject.rounding(subject.finest or 0.0)) else why


def _converges(order: Order, slopes: str) -> Finding:
    """The finding on whether the error falls with the tolerance, down to rounding."""
    tolerances, errors = order.tolerance, order.error
    valid, (decades, factor) = np.isfinite(errors), FALL
    if not valid.any():
        return undecided("order", CONVERGES, order.main.reason)
    rank = np.flatnonzero(valid)[np.argsort(tolerances[valid])]
    tolerances, errors = tolerances[rank], errors[rank]
    last, coarser = float(errors[0]), errors[tolerances > 0.99 * decades * tolerances[0]]
    why = f"an error of {last:.1e} at a tolerance of {tolerances[0]:.0e}, from {errors[-1]:.1e} at {tolerances[-1]:.0e}"
    if last <= ROUNDED_ERROR or (coarser.size and last < coarser.min() / factor):
        measured = order.measured or Reading("converges", last, text="converges as its tolerance falls")
        return Finding("order", CONVERGES, measured, "confirmed", f"{why}; {slopes}", last, ROUNDED_ERROR)
    if not coarser.size:
        return undecided("order", CONVERGES, f"{why}: too few runs ended")
    measured, why = Reading("wrong limit", last), f"it stays at {why}"
    return Finding("order", CONVERGES, measured, "refuted", why, last, ROUNDED_ERROR)


def _declared(power: int, order: Order, fits: Collection[Fit], series: Series | None, slopes: str) -> Finding:
    """The finding on a declared order; `fits` is empty for an adaptive method, whose steps do not all scale alike.

    If the series has a first wrong term, its order is that of runs as h -> 0, and another slope comes from steps that
    are too long. A slope that is clearly lower refutes the order all the same, because a run may pass points with
    larger errors. A larger slope that is no whole number is no order, and refutes none.
    """
    main, measured, verdict = order.main, order.measured, order_verdict(power, order.main, fits)
    value, resolution = main.slope, CONFIRMED_BEYOND + main.interval
    why = f"{slopes}; {series.words(power)}" if series else slopes
    agrees = series is not None and series.order == power and series.is_exact
    above, floor, next_defect = bool(measured) and main.slope > power, 0.0, 0.0
    if series:
        floor = series.least(power + 1) if power + 1 < series.noise.size else math.inf
        next_defect = float(series.defect[power + 2]) if series.is_exact and series.order == power + 1 else 0.0
    sharp = floor <= max(SHARP_DEFECT, SHARE_OF_NEXT * next_defect)
    lower = bool(fits) and (main.slope + main.interval < power - REFUTED_BEYOND or slower(fits, power))
    if series is not None and agrees and verdict != "confirmed" and not lower and (measured or _agree(order, power)):
        why = f"{why} ({main.reason or 'at steps too long for a slope'})"
        defect = series.worst(power), series.least(power)
        return Finding("order", str(power), _terms(series), "confirmed", why, *defect)
    if above and verdict == "refuted" and not lower:
        integer = abs(main.slope - round(main.slope)) <= resolution
        verdict = verdict if sharp and integer else "undecided"
    if verdict == "refuted":
        why = f"the error falls with another power of the step: {why}"
    elif series is not None and series.order < min(power, series.resolved):
        verdict, why, measured, term = "refuted", f"{series.words(power)}; {slopes}", _terms(series), series.order + 1
        value, resolution = series.worst(term), series.least(term)
    elif verdict == "undecided":
        words = f"the slope is neither {power} nor clearly another order"
        if above and not sharp:
            detail = f"the h^{power + 1} term of a step is known only to {min(floor, 1.0):.0e} of itself"
            words = f"the slope is above {power}, and {detail}"
        why = f"{words}: {why}" if measured else f"{main.reason} ({why})"
    return Finding("order", str(power), measured, verdict, why, value, resolution)


def _agree(order: Order, power: int) -> bool:
    """Do the errors of the finest judgeable runs fall as h^power, within a factor `FIT_FACTOR`?"""
    h, error, bound = order.step_size, order.error, order.bound
    valid = np.isfinite(error) & (error > ABOVE_BOUND * bound) & (error < LARGEST_ERROR)
    finest = np.argsort(h[valid])[:FINEST_RUNS]
    scaled = error[valid][finest] / h[valid][finest] ** power
    return scaled.size < 2 or float(np.max(scaled)) < FIT_FACTOR * float(np.min(scaled))


def limit(method: Integrator, scene: Scene, power: int, finest: float | None = None) -> tuple[float, float]:
    """The distance from the true motion of the ends of runs as h -> 0, and its uncertainty by the extrapolation.

    The method has order `power`; runs have at most `finest` steps. The distance is the largest difference of the
    chart's variables, momenta relative to the larger one.
    """
    fewest = LIMIT_STEPS.get(power, 200) // (1 if method.implementation == "compiled" else 20)
    fewest = fewest if finest is None else min(fewest, int(finest) // 4)
    step = one_step(method, method.chart_for(observable(method)), scene, LIMIT_NUTATIONS * scene.time_scale() / fewest)
    true = step.motion(scene.start)(step.h * fewest)

    def signed_error(steps: int) -> Array:
        end = step.shown(step.run(scene.start, step.h * fewest / steps, steps))
        return aligned(step.chart, end, true) - true

    first, second, third = (signed_error(fewest * 2**k) for k in range(3))
    # eliminate the term in h^power, then that in h^(power + 1)
    coarse, fine = (b + (b - a) / (2.0**power - 1.0) for a, b in ((first, second), (second, third)))
    last = fine + (fine - coarse) / (2.0 ** (power + 1) - 1.0)
    size = [float(np.max(np.abs(value))) for value in (third, last, last - fine)]
    return min(size[:2]), size[2]


def _exactness(subject: Subject) -> Finding:
    """The finding on a method with exact steps, from the errors at steps of all sizes."""
    method, scene = subject.method, subject.scene
    horizon, main = NUTATIONS * scene.time_scale(), observable(method)
    steps = ladder(method, scene, horizon, 7 if subject.quick else 13, FINEST_RUN[method.implementation])
    settings = [scene.time_scale() / LARGEST_EXACT, *steps]
    table = error_table(scene, method, settings, horizon, observe=main)
    largest = float(table[main].max())
    why = f"largest error {largest:.1e} at steps from {settings[-1]:.1e} s to {settings[0]:.1e} s on {scene.name}"
    unstable = conditioning(scene, horizon) > UNSTABLE_GROWTH
    why, verdict = (f"{why}, whose motion makes rounding grow", "undecided") if unstable else (why, "refuted")
    verdict, measured = ("confirmed", Reading("exact", largest)) if largest <= TRUE_LIMIT else (verdict, UNMEASURED)
    return Finding("order", "exact", measured, verdict, why, largest, TRUE_LIMIT)


def table_of(method: Integrator) -> Conditions | None:
    """The conditions of an explicit Runge-Kutta method of fixed step or of a splitting into two flows; else None."""
    for solver in method.solvers.values():
        rule: Any = solver.rule if isinstance(solver, FixedStep) else None
        rule = rule.rule if isinstance(rule, ScaledRule) else rule
        if isinstance(rule, Tableau):
            return conditions(triangle(rule.a, len(rule.b)), rule.b)
        if isinstance(rule, Composition) and rule.turn == EXACT:  # a Cayley map is no exact flow
            return splitting_conditions(rule.drift, rule.kick, rule.gradient, rule.processor)
    return None


def time_order(subject: Subject) -> list[Finding]:
    """The finding on the claim "time": the order for a right-hand side that depends on time."""
    if subject.autonomous or not (subject.method.fixed_step and subject.stepper.takes_field):
        why = "it was written for f(y)" if subject.autonomous else "it takes no right-hand side"
        return [inapplicable("time", why)]
    order = subject.method.order
    series, calls = series_by_clock(subject, CLOCK_DEPTH)
    if not calls:
        return [inapplicable("time", "it asks for no right-hand side")]
    if series.order < 0:
        return [inapplicable("time", "a step of no length moves a state that is not of its chart")]
    power = series.order if order is None else order
    lower = min(series.order, power)
    declared, measured, verdict = yes_no(order), Reading("order", lower, text=str(lower)), "measured"
    if series.order >= min(power, series.resolved):
        if series.order < power:  # no higher term is resolved
            measured, verdict = Reading("order", lower, text=f"{lower} or more"), "undecided"
        elif order is not None:
            verdict = "confirmed"
        why = f"where f depends on t, {series.words(power)}"
    elif subject.knows_top:
        return [inapplicable("time", "it knows equations of the top beside f, which depend on no time")]
    elif calls == {CLOCK_START * subject.scene.time_scale()}:  # a step for f(y), which is no fault
        declared, measured = "", Reading("f(y) only", lower, text=f"f(y) only, {lower}")
        why = "f is asked at the start of a step alone, which is right for f(y); where f depends on t, "
        why += series.wrong_term()
    elif series_by_clock(subject, 0.0)[0].order <= series.order:  # the order is wrong, and not the times
        declared, why = "", f"{series.wrong_term()}, as for f(y)"
    else:
        verdict, why = "refuted", f"where f depends on t, {series.wrong_term()}: f is asked at wrong times"
        why += ", or a difference quotient is off" * (series.worst(series.order + 1) < SHARP_DEFECT)
    term = min(power, series.order + 1)
    return [Finding("time", declared, measured, verdict, why, series.worst(term), series.least(term))]


class ClockedField:
    """The right-hand side g'(t) f(y) in the axis chart, for a clock with a, w and t0; `times` collects its calls."""

    def __init__(self, par: Any, uneven: float, rate: float, begin: float) -> None:
        self.par, self.uneven, self.rate, self.begin = par, uneven, rate, begin
        self.times = set[float]()

    def __call__(self, t: float, y: Any) -> Array:
        """y'."""
        self.times.add(t)
        pace = 1.0 + self.uneven * math.cos(self.rate * (t - self.begin) + 1.0)
        rates = np.array(FORMULATIONS["axis"].field(self.par, np.asarray(y).tolist()))
        return np.asarray(pace * rates)


def series_by_clock(subject: Subject, uneven: float) -> tuple[Series, set[float]]:
    """The series of a step (or several, if a multistep method) with a clock of a = `uneven`; the times of f's calls."""
    scene, start, scale = subject.scene, generic_start(subject.scene), subject.scene.time_scale()
    begin, rate, unit = CLOCK_START * scale, 2.0 * math.pi * CLOCK_WAVES / scale, np.repeat([1.0, unit_of(scene)], 3)
    par, state = FORMULATIONS["axis"].prepare(scene.top, start)
    true, f = one_step(subject.method, "axis", scene, scale).motion(start), ClockedField(par, uneven, rate, begin)

    def motion(h: float) -> Array:
        return true(h + uneven * (math.sin(rate * h + 1.0) - math.sin(1.0)) / rate)

    count = SEVERAL ** (subject.stepper.own_loop and restart_gap(*map_of(subject, subject.charts[-1])) > ONE_MAP)

    def image(h: float) -> Any:
        return subject.stepper.along(f, begin, np.array(state), h / count, np.array([count]))[0] / unit

    return compared(image, motion, scale, "axis"), f.times
