"""The order claim: the conditions of a table, the power series of a step, the slopes of runs and their limit.

The four see different defects, and a declared order is refuted if any of them refutes it. It is confirmed if the slope
confirms it, by `symtop.measure.order.order_verdict` as in every study, or the series where no slope can be judged.

*Slopes* see what becomes of a run. They are extrapolated to h = 0 by `symtop.measure.order` from a ladder of steps,
then again with more steps put into the decades of error above rounding where a method of high order is asymptotic; if
the scene does not show it, on `FALLBACK` over longer runs. An adaptive method is fitted against its mean step.

*The limit.* A method whose coefficients miss their sum by 1e-9 has the right slope down to an error of 1e-9 and stays
there. So the error at the end of a short run of many steps, taken with its sign, is extrapolated to h = 0
(Richardson's, eliminating h^p and h^(p+1)); what is left beyond rounding is a wrong limit.

*The series of one step* (`claims.series`) sees an order condition that is off by 1e-10, but not what a run carries from
step to step.

*The table*, Butcher's or a splitting's, needs no run. A condition of order k that is off by d adds an error of
d (w h)^k to a step, w = 2 pi/nutation, beside d' (w h)^(p+1), which a method of order p has anyway: a slope shows it
below w h = (d/d')^(1/(p + 1 - k)), often a step that is so small that rounding is larger.
"""

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging.claims.series import ChartSeries, series_of
from symtop.judging.claims.subject import FINEST, Subject
from symtop.judging.findings import NOTHING, Finding, Measured, inapplicable, yes_no
from symtop.measure.accuracy import error_table
from symtop.measure.order import BESIDE, LARGEST_ERROR, Fit, order_verdict
from symtop.measure.order_conditions import Conditions, conditions, splitting_conditions, triangle
from symtop.measure.order_table import observable, order_fit, order_table
from symtop.measure.settings import ladder
from symtop.methods.framework.fixed_step import FixedStep
from symtop.methods.framework.plan import Array, sentence
from symtop.methods.framework.preparation import Scaled
from symtop.methods.framework.registry import Integrator
from symtop.methods.runge_kutta.explicit import Tableau
from symtop.methods.splitting.loop import Composition
from symtop.methods.splitting.rotor import EXACT
from symtop.model import charts
from symtop.model.scenes import Scene, closed_form, scene as find_scene
from symtop.run.simulation import integrate

NUTATIONS = 1.37  # length of the runs that the slope is fitted to
FALLBACK, LONGER = "goldstein", (8.37, 40.0)
QUICK_SHARE = 0.25  # of these; no verdict on a method of the package changes
LARGEST_EXACT = 2.37  # steps a nutation that a method with exact steps is tried at, beside the ladder
SHARE = 0.37  # of a nutation: length of the runs that are extrapolated to h = 0
STEPS = {1: 40_000, 2: 20_000, 3: 6_000, 4: 2_000, 5: 1_000, 6: 500}  # of the coarsest of them; 200 beyond order 6
TRUE_LIMIT = 1e-11  # a limit as close as this is the true motion
SHOWN = 24  # settings of the order that are kept
ABOVE, FINEST_RUNS, SPREAD = 10.0, 5, 10.0  # errors beyond so many bounds, of so many runs, fall as h^p to this factor


def measure(subject: Subject) -> list[Finding]:
    """The finding on the order; that of a method with a table begins with the conditions of the table."""
    method = subject.method
    if method.control is None:
        return [inapplicable("order", "it has no step and no tolerance", yes_no(method.order))]
    finding = _exactness(subject) if method.exact_steps else _by_steps(subject)
    table = table_of(method)
    if table is not None:
        power = method.order or table.order
        words, verdict = table.words(power), finding.verdict
        if table.order < min(power, len(table.defect)):
            words, verdict = words + _visible_from(table, power, subject.scene), "refuted"
        finding = finding._replace(verdict=verdict, why=f"{words}; {finding.why}")
    return [finding]


class Order(NamedTuple):
    """What the errors of a method say about its order."""

    scene: str
    step_size: Array
    error: Array  # of the attitude, or of the axis where the chart has no attitude
    bound: Array
    fits: dict[str, Fit]  # attitude (or axis), theta, energy
    observed: str
    fixed_step: bool

    @property
    def main(self) -> Fit:
        """The fit that decides."""
        return self.fits[self.observed]

    @property
    def measured(self) -> Measured:
        """Its slope, if it can be judged."""
        slope = self.main.slope
        return Measured("slope", slope, self.main.interval, text=str(self.main)) if math.isfinite(slope) else NOTHING


def measured_order(method: Integrator, scene: Scene, *, quick: bool = False, finest: float | None = None) -> Order:
    """Slopes of the errors of attitude, theta and energy, where they can be judged; `finest`: most steps of a run."""
    if method.control is None:
        raise SymtopError(f"{method.name} has neither a step nor a tolerance")
    fitted = _slopes(method, scene, NUTATIONS, quick, finest)
    if finest is not None and method.fixed_step and not math.isfinite(fitted.main.slope):
        shorter = _slopes(method, scene, SHARE, quick, finest)  # the same number of steps, and smaller errors
        fitted = shorter if math.isfinite(shorter.main.slope) else fitted
    if quick or not method.fixed_step or method.order is None or method.implementation == "python":
        return fitted
    for nutations in LONGER:
        if math.isfinite(fitted.main.slope):
            break
        again = _slopes(method, find_scene(FALLBACK), nutations, quick, finest)
        fitted = again if math.isfinite(again.main.slope) else fitted
    return fitted


def _slopes(method: Integrator, scene: Scene, nutations: float, quick: bool, finest: float | None = None) -> Order:
    horizon = nutations * scene.time_scale()
    count = (11 if quick else 13) if method.fixed_step else (9 if quick else 25)  # steps that are chosen scatter
    most = FINEST[method.implementation] * (QUICK_SHARE if quick else 1.0) if finest is None else finest
    settings = ladder(method, scene, horizon, count, most)
    main = observable(method)
    table = order_table(scene, method, settings, horizon, main, dense=finest is None)
    step = table["step_size"].values if method.fixed_step else horizon / table["steps"].values
    fits = {name: order_fit(scene, method, table, name, horizon) for name in (main, "theta", "energy")}
    bound = table[f"{main}_bound"].values
    return Order(scene.name, step, table[main].values, bound, fits, main, method.fixed_step)


def _by_steps(subject: Subject) -> Finding:
    """What steps and runs show of the order."""
    method, scene, quick, finest = subject.method, subject.scene, subject.quick, subject.finest
    series = series_of(method, scene, quick=quick) if method.fixed_step else None
    fitted, claim = measured_order(method, scene, quick=quick, finest=finest), method.order
    if series and not fitted.measured and series.series.seen and series.order < (claim or 0):
        # a method of high order is tried at long steps, whose errors fall as no power where the order is low, and the
        # limit of its runs is extrapolated by a power that they do not have: it looks wrong
        method = replace(method, order=max(series.order, 1))
        fitted = measured_order(method, scene, quick=quick, finest=finest)
    subject.traces.update(settings_shown(fitted))
    main = fitted.main
    slopes = ", ".join(f"{name} {fit}" for name, fit in fitted.fits.items() if math.isfinite(fit.slope))
    slopes = f"slopes {slopes} on {fitted.scene}" if slopes else "no slope"
    if method.fixed_step and not (fitted.measured and series and series.follows(max(method.order or 1, 1))):
        power = method.order or 1
        if fitted.measured:
            power = max(1, min(power if method.order else 99, round(main.slope)))
        wrong = limit(method, scene, power, finest).wrong
        if wrong:
            why = f"as its step goes to zero it goes to a motion that is wrong by {wrong:.1e} ({slopes})"
            verdict = "measured" if claim is None else "refuted"
            return Finding("order", yes_no(claim), Measured("wrong limit", wrong), verdict, why, wrong, TRUE_LIMIT)
    return weighed(claim, fitted, series, slopes)


def weighed(claim: int | None, fitted: Order, series: ChartSeries | None, slopes: str) -> Finding:
    """The finding of slopes and series together; `slopes` says what the slopes are."""
    if claim is not None:
        return _claimed(claim, fitted, series, slopes)
    main, measured, value, why = fitted.main, fitted.measured, fitted.main.slope, slopes
    if series is not None:
        power = round(main.slope) if measured else series.order
        why = f"{slopes}; {series.words(power)}"
        if not measured or series.order < power:  # the slope, unless the series of a step has a lower order
            measured, value = series.measured, float(series.order)
    if not measured:
        return Finding("order", "", NOTHING, "undecided", main.reason)
    return Finding("order", "", measured, "measured", why, value, main.interval)


def _claimed(power: int, fitted: Order, series: ChartSeries | None, slopes: str) -> Finding:
    """The verdict on a declared order; the steps of an adaptive method, which has no series, do not all scale alike.

    Where the series shows the first wrong term, its order is that of the runs as h -> 0, so that a larger slope is one
    of steps that are too long. A lower slope stands: a run may meet what one step from one point does not.
    """
    main, measured = fitted.main, fitted.measured
    fits = list(fitted.fits.values()) if fitted.fixed_step else []
    verdict = order_verdict(power, main, fits)
    value, resolution = main.slope, BESIDE + main.interval
    why = slopes if series is None else f"{slopes}; {series.words(power)}"
    if series is not None and series.order == power and series.series.seen and verdict != "confirmed":
        early = bool(measured) and main.slope > power and all(not fit.slope < power - BESIDE for fit in fits)
        if early or (not measured and _agree(fitted, power)):
            why = f"{why} ({main.reason or 'at steps too long for a slope'})"
            measured = Measured("order", power, text=str(power))
            return Finding("order", str(power), measured, "confirmed", why, *series.term(power))
    if verdict == "refuted":
        why = f"the error falls with another power of the step: {why}"
    elif series is not None and series.order < min(power, series.series.resolved):
        verdict, why = "refuted", f"{series.words(power)}; {slopes}"
        measured = series.measured
        value, resolution = series.term(series.order + 1)
    elif verdict == "undecided":
        why = f"the slope is neither {power} nor clearly another order: {why}" if measured else f"{main.reason} ({why})"
    return Finding("order", str(power), measured, verdict, why, value, resolution)


def _agree(fitted: Order, power: int) -> bool:
    """Do the errors of the finest runs fall about as h^power, as far as they can be judged?"""
    h, error = fitted.step_size, fitted.error
    good = np.isfinite(error) & (error > ABOVE * fitted.bound) & (error < LARGEST_ERROR)
    finest = np.argsort(h[good])[:FINEST_RUNS]
    scaled = error[good][finest] / h[good][finest] ** power
    return scaled.size < 2 or float(np.max(scaled)) < SPREAD * float(np.min(scaled))


class Limit(NamedTuple):
    """Where the end of a run goes as h -> 0."""

    miss: float  # distance from the true motion, the larger of angle and momentum over the larger one
    doubt: float  # of the extrapolation

    @property
    def wrong(self) -> float:
        """How wrong the motion is, beyond doubt; 0 if it is the true one."""
        return self.miss if self.miss > TRUE_LIMIT and self.miss > 10.0 * self.doubt else 0.0


def limit(method: Integrator, scene: Scene, power: int, finest: float | None = None) -> Limit:
    """How far from the true motion a run ends in the limit of small steps, for a method whose order is `power`.

    The finest of the three runs has at most `finest` steps.
    """
    fewest = STEPS.get(power, 200) // (1 if method.implementation == "compiled" else 20)
    if finest is not None:
        fewest = min(fewest, int(finest) // 4)
    ends = [_signed_error(method, scene, SHARE * scene.time_scale(), fewest * 2**k) for k in range(3)]

    def without(power: int, coarse: Array, fine: Array) -> Array:
        """The combination of the errors at h and h/2 that has no term in h^power."""
        return fine + (fine - coarse) / (2.0**power - 1.0)

    once = [without(power, ends[k], ends[k + 1]) for k in range(2)]
    size = [float(np.max(np.abs(value))) for value in (ends[2], once[1], without(power + 1, once[0], once[1]))]
    return Limit(min(size[0], size[2]), abs(size[2] - size[1]))


def _signed_error(method: Integrator, scene: Scene, horizon: float, steps: int) -> Array:
    run = integrate(scene, method, step_size=horizon / steps, horizon=horizon, samples=2, observe=observable(method))
    if run.outcome != "ok":
        ended = sentence(run.outcome, run.reached_time, horizon)
        raise SymtopError(f"a run of {steps} steps over {horizon:.3g} {ended}")
    true = closed_form(scene)(np.array([horizon]))
    axis = charts.axis_from_angles(true.theta[0], true.phi[0])
    slip = (float(run.p_theta[-1]) - scene.top.I1 * float(true.theta_dot[0])) / scene.momentum_scale
    turn = [] if run.psi is None else [float(run.psi[-1]) - float(true.psi[0])]
    return np.array([*(run.axis[-1] - axis), slip, *turn])


def settings_shown(fitted: Order) -> dict[str, Array]:
    """Steps, errors and the mask of the fit, in order of the step and padded to one length, for a dataset."""
    rank = np.argsort(fitted.step_size)[:SHOWN]
    columns = {"step_size": fitted.step_size, "error": fitted.error, "fitted": fitted.main.used.astype(float)}
    padded = np.full(SHOWN - rank.size, math.nan)
    return {name: np.concatenate([values[rank], padded]) for name, values in columns.items()}


def _exactness(subject: Subject) -> Finding:
    """The errors of a method whose every step is said to be the motion itself, at steps of all sizes."""
    method, scene = subject.method, subject.scene
    horizon, main = NUTATIONS * scene.time_scale(), observable(method)
    largest_step = scene.time_scale() / LARGEST_EXACT
    count = 7 if subject.quick else 13
    settings = [largest_step, *ladder(method, scene, horizon, count, FINEST[method.implementation])]
    table = error_table(scene, method, settings, horizon, observe=main)
    largest = float(table[main].max())
    why = f"largest error {largest:.1e} at steps from {settings[-1]:.1e} s to {settings[0]:.1e} s on {scene.name}"
    right = largest <= TRUE_LIMIT
    measured = Measured("exact", largest) if right else NOTHING
    return Finding("order", "exact", measured, "confirmed" if right else "refuted", why, largest, TRUE_LIMIT)


def table_of(method: Integrator) -> Conditions | None:
    """The conditions of an explicit Runge-Kutta method of fixed step or a splitting into two flows, None for any other.

    A splitting whose drift is a Cayley map has no table of this kind: its drift is no flow.
    """
    for solver in method.solvers.values():
        rule: Any = solver.rule if isinstance(solver, FixedStep) else None
        rule = rule.rule if isinstance(rule, Scaled) else rule
        if isinstance(rule, Tableau):
            return conditions(triangle(rule.a, len(rule.b)), rule.b)
        if isinstance(rule, Composition) and rule.turn == EXACT:
            return splitting_conditions(rule.drift, rule.kick, rule.gradient, rule.processor)
    return None


def _visible_from(table: Conditions, power: int, scene: Scene) -> str:
    """From which step on a slope would show the condition that is missed; empty where that is not known."""
    low, high = table.order + 1, power + 1
    if low >= high or high > len(table.defect) or table.defect[high - 1] == 0.0:
        return ""
    turn = (table.defect[low - 1] / table.defect[high - 1]) ** (1.0 / (high - low))
    return f" (slopes show it from steps of {turn * scene.time_scale() / (2.0 * math.pi):.0e} downwards)"
