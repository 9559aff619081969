"""The finding on the order: the power series of a step, the slopes of a run, and the limit that it goes to.

The three see different defects. The series of one step (`symtop.measure.step_series`) sees an order condition that is
off by 1e-10, but not what a run carries from step to step; a slope (`claims_order`) sees what becomes of a run, but not
a defect of a millionth; the limit sees a step that is wrong in all steps alike. A declared order is refuted if any of
them refutes it, and confirmed if the slope confirms it, or the series where a slope cannot be judged.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging.claims_order import TRUE_LIMIT, Array, Order, exactness, limit, measured_order, settings_shown
from symtop.judging.claims_structure import ONE_MAP
from symtop.judging.claims_table import with_table
from symtop.judging.findings import Finding, yes_no
from symtop.measure.order import BESIDE, LARGEST_ERROR, Fit, order_verdict
from symtop.measure.step_map import restart_gap, step_map
from symtop.measure.step_series import AGREES, SURE, Series, step_series
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene

SHOWN = 24  # settings of the order that are kept
CLEAR = 1e-9  # noise of the h^1 term: a step that is rounded to single precision leaves 1e-8
ABOVE, FINEST_RUNS, SPREAD = 10.0, 5, 10.0  # errors beyond so many bounds, of so many runs, fall as h^p to this factor


class ChartSeries(NamedTuple):
    """The series of a step in one chart."""

    chart: str
    series: Series

    @property
    def order(self) -> int:
        """The order that the series shows."""
        return self.series.order

    def words(self, power: int) -> str:
        """What it says of the order `power`."""
        terms, agreed = self.series, min(power, self.series.order)
        if agreed < min(power, terms.resolved):
            term = agreed + 1
            off = f"off by {terms.defect[term]:.1e} of itself (noise {terms.noise[term]:.0e})"
            return f"the h^{term} term of a step is {off}, in the {self.chart} chart"
        return f"a step has the motion's terms up to h^{agreed} to {max(terms.worst(agreed), 1e-16):.0e}"


def series_of(method: Integrator, scene: Scene, *, quick: bool = False) -> ChartSeries | None:
    """The series of the chart with the lowest order; None where no step is one map of the state."""
    shown = []
    for chart in method.charts()[-1:] if quick else method.charts():
        try:
            step, start = step_map(method, chart, scene)
            if restart_gap(step, start) <= ONE_MAP:
                shown.append(ChartSeries(chart, step_series(step, start, scene.time_scale())))
        except SymtopError:
            continue
    return min(shown, key=lambda one: one.order, default=None)


def order(
    method: Integrator, scene: Scene, traces: dict[str, Array], *, quick: bool = False, finest: float | None = None
) -> Finding:
    """The finding on the order; that of a Runge-Kutta method begins with the conditions of its table."""
    return with_table(_by_steps(method, scene, traces, quick=quick, finest=finest), method, scene)


def _by_steps(
    method: Integrator, scene: Scene, traces: dict[str, Array], *, quick: bool, finest: float | None
) -> Finding:
    """What steps and runs show of the order."""
    declared = yes_no(method.order)
    if method.control is None:
        return Finding("order", declared, "", "inapplicable", "it has no step and no tolerance")
    if method.exact_steps:
        return exactness(method, scene, quick=quick)
    series = series_of(method, scene, quick=quick) if method.fixed_step else None
    fitted, claim = measured_order(method, scene, quick=quick, finest=finest), method.order
    if series is not None and _steps_are_those_of_another_order(fitted, series, method):
        method = replace(method, order=max(series.order, 1))
        fitted = measured_order(method, scene, quick=quick, finest=finest)
    traces["step_size"], traces["error"], traces["fitted"] = settings_shown(fitted, SHOWN)
    main = fitted.fits[fitted.observed]
    measured = str(main) if math.isfinite(main.slope) else ""
    slopes = ", ".join(f"{name} {fit}" for name, fit in fitted.fits.items() if math.isfinite(fit.slope))
    slopes = f"slopes {slopes} on {fitted.scene}" if slopes else "no slope"
    if method.fixed_step:
        wrong = 0.0 if measured and _follows(series, method) else _wrong_limit(method, scene, main, finest)
        if wrong:
            why = f"as its step goes to zero it goes to a motion that is wrong by {wrong:.1e} ({slopes})"
            verdict = "refuted" if declared else "measured"
            return Finding("order", declared, f"wrong limit, {wrong:.0e}", verdict, why, wrong, TRUE_LIMIT)
    return weighed(claim, fitted, series, slopes)


def _steps_are_those_of_another_order(fitted: Order, series: ChartSeries, method: Integrator) -> bool:
    """Was no slope found with the steps of a declared order, beyond the one that a term of a step shows?

    A method of high order is tried at long steps, whose errors fall as no power where the order is low, and the limit
    of its runs is extrapolated by a power that they do not have: it looks wrong.
    """
    judged = math.isfinite(fitted.fits[fitted.observed].slope)
    return not judged and series.series.seen and series.order < (method.order or 0)


def weighed(claim: int | None, fitted: Order, series: ChartSeries | None, slopes: str) -> Finding:
    """The finding of slopes and series together; `slopes` says what the slopes are."""
    main = fitted.fits[fitted.observed]
    power = claim or (round(main.slope) if math.isfinite(main.slope) else None)
    if series is not None:
        slopes = f"{slopes}; {series.words(series.order if power is None else power)}"
    return _unclaimed(main, series, slopes) if claim is None else _judged(claim, fitted, series, slopes)


def _unclaimed(main: Fit, series: ChartSeries | None, slopes: str) -> Finding:
    """The order of a method that claims none: the slope, unless the series of a step has a lower one."""
    value, measured = main.slope, str(main) if math.isfinite(main.slope) else ""
    if series is not None and not (measured and series.order >= round(value)):
        value = float(series.order)
        measured = (
            f"{series.order} by its h^{series.order + 1} term" if series.series.seen else f"{series.order} or more"
        )
    if not measured:
        return Finding("order", "", "", "undecided", main.reason)
    return Finding("order", "", measured, "measured", slopes, value, main.interval)


def _follows(series: ChartSeries | None, method: Integrator) -> bool:
    """Does a step that is one map have the motion's first terms, beyond doubt? Then its runs go to the motion."""
    if series is None or series.order < max(method.order or 1, 1):
        return False
    return float(series.series.noise[1]) < CLEAR


def _wrong_limit(method: Integrator, scene: Scene, main: Fit, finest: float | None) -> float:
    """How wrong the motion is that the run goes to as its step goes to zero; 0 if it is the true one."""
    power = method.order or 1
    if math.isfinite(main.slope):
        power = max(1, min(power if method.order else 99, round(main.slope)))
    end = limit(method, scene, power, finest)
    return end.miss if end.miss > TRUE_LIMIT and end.miss > 10.0 * end.doubt else 0.0


def _agree(fitted: Order, power: int) -> bool:
    """Do the errors of the finest runs fall about as h^power, as far as they can be judged?"""
    h, error = fitted.step_size, fitted.error
    good = np.isfinite(error) & (error > ABOVE * fitted.bound) & (error < LARGEST_ERROR)
    finest = np.argsort(h[good])[:FINEST_RUNS]
    scaled = error[good][finest] / h[good][finest] ** power
    return scaled.size < 2 or float(np.max(scaled)) < SPREAD * float(np.min(scaled))


def _judged(power: int, fitted: Order, series: ChartSeries | None, slopes: str) -> Finding:
    """The verdict on a declared order; the steps of an adaptive method, which has no series, do not all scale alike.

    Where the series shows the first wrong term, its order is that of the runs as h -> 0, so that a larger slope is one
    of steps that are too long. A lower slope stands: a run may meet what one step from one point does not.
    """
    main = fitted.fits[fitted.observed]
    fits = list(fitted.fits.values()) if fitted.fixed_step else []
    measured, verdict = str(main) if math.isfinite(main.slope) else "", order_verdict(power, main, fits)
    value, resolution, why = main.slope, BESIDE + main.interval, slopes
    if series is not None and series.order == power and series.series.seen and verdict != "confirmed":
        early = bool(measured) and main.slope > power and all(not fit.slope < power - BESIDE for fit in fits)
        if early or (not measured and _agree(fitted, power)):
            value, resolution = _term(series, power)
            why = f"{slopes} ({main.reason or 'at steps too long for a slope'})"
            return Finding("order", str(power), str(power), "confirmed", why, value, resolution)
    if verdict == "refuted":
        why = f"the error falls with another power of the step: {slopes}"
    elif series is not None and series.order < min(power, series.series.resolved):
        verdict, why = "refuted", f"{series.words(power)}; {slopes.partition(';')[0]}"
        measured = f"{series.order} by its h^{series.order + 1} term"
        value, resolution = _term(series, series.order + 1)
    elif verdict == "undecided":
        why = f"the slope is neither {power} nor clearly another order: {slopes}"
        why = why if measured else f"{main.reason} ({slopes})"
    return Finding("order", str(power), measured, verdict, why, value, resolution)


def _term(series: ChartSeries, power: int) -> tuple[float, float]:
    """The largest defect up to h^power, and the least that is told from none."""
    return series.series.worst(power), max(AGREES, SURE * float(series.series.noise[power]))
