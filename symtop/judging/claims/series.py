"""The power series of a step beside that of the motion, on the top and on equations that depend on time.

The series of one step (`symtop.measure.step_series`) shows a condition that is off by 1e-10, which no slope does.

The top's equations are autonomous, so that a method whose f is called at wrong times, the nodes c of its tableau, is
right on them. In a frame that turns about a horizontal axis at a rate w, z = R(t)^T y moves by

    z' = R^T f(R z) - w x z          for e and L alike, gravity being R^T k,

which depends on t, and whose motion is R(t)^T y(t). The series of one step from t0 is set beside that of this motion.
An order that is lower than in a frame at rest, w = 0, is one of wrong times. A step that asks f at t0 alone was written
for f(y), which refutes nothing.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging.claims.structure import ONE_MAP
from symtop.judging.claims.subject import Subject
from symtop.judging.findings import Finding, Measured, inapplicable, yes_no
from symtop.measure.step_map import generic_start, restart_gap, step_map
from symtop.measure.step_series import AGREES, SURE, Series, compared, step_series
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.plan import Array
from symtop.methods.framework.registry import Integrator
from symtop.model import charts
from symtop.model.scenes import Scene, closed_form
from symtop.model.top import Angles

TURNS = 0.7  # of the frame in a nutation
BEGIN = 0.23  # of a nutation: t0
CLEAR = 1e-9  # noise of the h^1 term: a step that is rounded to single precision leaves 1e-8


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
        agreed = min(power, self.order)
        if agreed < min(power, self.series.resolved):
            return f"{self.wrong_term()}, in the {self.chart} chart"
        terms = self.series
        return f"a step has the motion's terms up to h^{agreed} to {max(terms.worst(agreed), 1e-16):.0e}"

    def wrong_term(self) -> str:
        """The first term that is not the motion's."""
        term = self.order + 1
        defect, noise = self.series.defect[term], self.series.noise[term]
        return f"the h^{term} term of a step is off by {defect:.1e} of itself (noise {noise:.0e})"

    def follows(self, power: int) -> bool:
        """Has the step the motion's terms up to h^power, beyond doubt? Then its runs go to the motion."""
        return self.order >= power and float(self.series.noise[1]) < CLEAR

    def term(self, power: int) -> tuple[float, float]:
        """The largest defect up to h^power, and the least that is told from none."""
        noise = self.series.noise[min(power, self.series.noise.size - 1)]
        return self.series.worst(power), max(AGREES, SURE * float(noise))

    @property
    def measured(self) -> Measured:
        """The order that is seen, or the least that it can be."""
        text = f"{self.order} by its h^{self.order + 1} term" if self.series.seen else f"{self.order} or more"
        return Measured("by a term", self.order, text=text)


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


def time_order(subject: Subject) -> list[Finding]:
    """The finding on the order in a frame that turns."""
    if not subject.method.fixed_step or not hasattr(subject.stepper, "along"):
        return [inapplicable("time", "it takes no right-hand side")]
    order, rate = subject.method.order, 2.0 * math.pi * TURNS / subject.scene.time_scale()
    turning, calls = series_in_frame(subject, rate)
    if not calls:
        return [inapplicable("time", "it asks for no right-hand side")]
    if turning.order < 0:
        return [inapplicable("time", "a step of no length moves a state that is not of its chart")]
    series, power = turning.series, turning.order if order is None else order
    shown = min(turning.order, power)
    declared, measured, verdict = yes_no(order), Measured("order", shown, text=str(shown)), "measured"
    if turning.order >= min(power, series.resolved):
        verdict = "measured" if order is None else "confirmed"
        why = f"where f depends on t, {turning.words(power)}"
    elif calls == {BEGIN * subject.scene.time_scale()}:  # a step for f(y): no fault on a top
        declared, measured = "", Measured("f(y) only", shown, text=f"f(y) only, {shown}")
        why = "f is asked at the start of a step alone, which is right for f(y); where f depends on t, "
        why += turning.wrong_term()
    elif series_in_frame(subject, 0.0)[0].order <= turning.order:  # the order is wrong, and not the times
        declared, why = "", f"{turning.wrong_term()}, as for f(y)"
    else:
        verdict, why = "refuted", f"where f depends on t, {turning.wrong_term()}: f is asked at wrong times"
    return [Finding("time", declared, measured, verdict, why, *turning.term(power))]


def series_in_frame(subject: Subject, rate: float) -> tuple[ChartSeries, set[float]]:
    """The series of a step in a frame that turns at a rate, and the times at which it asks for f."""
    scene, start = subject.scene, generic_start(subject.scene)
    begin = BEGIN * scene.time_scale()
    par, _ = FORMULATIONS["axis"].prepare(scene.top, start)
    field, unit = FORMULATIONS["axis"].field, np.repeat([1.0, scene.momentum_scale], 3)
    exact = closed_form(Scene("start", scene.top, start, 1.0))
    times: set[float] = set()

    def turned(t: float, y: Array, sign: float) -> Array:
        """R(t) y for sign 1, R(t)^T y for -1; the frame turns about x."""
        c, s = math.cos(rate * t), sign * math.sin(rate * t)
        x, v, w, lx, lv, lw = y
        return np.array([x, c * v - s * w, s * v + c * w, lx, c * lv - s * lw, s * lv + c * lw])

    def f(t: float, z: Any) -> Array:
        z = np.asarray(z, dtype=float)
        swept = rate * np.array([0.0, -z[2], z[1], 0.0, -z[5], z[4]])
        times.add(t)
        rates: Array = turned(t, np.array(field(par, turned(t, z, 1.0).tolist())), -1.0) - swept
        return rates

    def motion(h: float) -> Array:
        at = Angles(*(float(value[0]) for value in exact(np.array([h]))))
        state: Array = turned(begin + h, charts.space_state("axis", scene.top, at), -1.0) / unit
        return state

    first = motion(0.0) * unit

    def image(h: float) -> Array:
        after: Array = subject.stepper.along(f, begin, first.copy(), h, np.array([1]))[0] / unit
        return after

    return ChartSeries("turning", compared(image, motion, scene.time_scale())), times
