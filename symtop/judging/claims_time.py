"""The order of a step on equations that depend on time: the nodes c of a tableau, which the top never asks for.

The top's equations are autonomous, so that a method whose f is called at wrong times is right on them. In a frame that
turns about a horizontal axis at a rate w, z = R(t)^T y moves by

    z' = R^T f(R z) - w x z          for e and L alike, gravity being R^T k,

which depends on t, and whose motion is R(t)^T y(t). The series of one step from t0 is set beside that of this motion.
An order that is lower than in a frame at rest, w = 0, is one of wrong times. A step that asks f at t0 alone was written
for f(y); that is told, and refutes nothing.
"""

import math
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from symtop.judging.claims_series import ChartSeries
from symtop.judging.findings import Finding, yes_no
from symtop.measure.step_map import generic_start
from symtop.measure.step_series import AGREES, SURE, compared
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.plan import Array
from symtop.model import charts
from symtop.model.scenes import Scene, closed_form
from symtop.model.top import Angles

TURNS = 0.7  # of the frame in a nutation
BEGIN = 0.23  # of a nutation: t0


class Along(Protocol):
    """A stepper that steps any right-hand side."""

    def along(self, f: Any, t: float, y: Array, h: float, marks: NDArray[np.int64]) -> Array:
        """The states at the marks."""
        ...


def time_order(stepper: Along, scene: Scene, order: int | None) -> Finding:
    """The finding on the order in a frame that turns; `order` is what the method claims."""
    period, start = scene.time_scale(), generic_start(scene)
    begin = BEGIN * period
    par, _ = FORMULATIONS["axis"].prepare(scene.top, start)
    field, unit = FORMULATIONS["axis"].field, np.repeat([1.0, scene.momentum_scale], 3)
    exact = closed_form(Scene("start", scene.top, start, 1.0))

    asked: list[float] = []

    def turned(t: float, y: Array, sign: float, rate: float) -> Array:
        """R(t) y for sign 1, R(t)^T y for -1; the frame turns about x."""
        c, s = math.cos(rate * t), sign * math.sin(rate * t)
        x, v, w, lx, lv, lw = y
        return np.array([x, c * v - s * w, s * v + c * w, lx, c * lv - s * lw, s * lv + c * lw])

    def in_frame(rate: float) -> ChartSeries:
        """The series of a step in a frame that turns at a rate."""

        def f(t: float, z: Any) -> Array:
            z = np.asarray(z, dtype=float)
            swept = rate * np.array([0.0, -z[2], z[1], 0.0, -z[5], z[4]])
            asked.append(t)
            rates: Array = turned(t, np.array(field(par, turned(t, z, 1.0, rate).tolist())), -1.0, rate) - swept
            return rates

        def motion(h: float) -> Array:
            at = Angles(*(float(value[0]) for value in exact(np.array([h]))))
            state: Array = turned(begin + h, charts.space_state("axis", scene.top, at), -1.0, rate) / unit
            return state

        first = motion(0.0) * unit
        image = partial(_stepped, stepper, f, begin, first, unit)
        return ChartSeries("turning", compared(image, motion, period))

    turning = in_frame(2.0 * math.pi * TURNS / period)
    series = turning.series
    if not asked:
        return Finding("time", "", "", "inapplicable", "it asks for no right-hand side")
    if turning.order < 0:
        return Finding("time", "", "", "inapplicable", "a step of no length moves a state that is not of its chart")
    power = turning.order if order is None else order
    value, noise = series.worst(power), float(series.noise[min(power, series.noise.size - 1)])
    resolution = max(AGREES, SURE * noise)
    if turning.order >= min(power, series.resolved):
        verdict = "measured" if order is None else "confirmed"
        why = f"where f depends on t, {turning.words(power)}"
        return Finding("time", yes_no(order), str(min(turning.order, power)), verdict, why, value, resolution)
    off = turning.words(power).partition(", in the")[0]
    if set(asked) == {begin}:  # a step for f(y): no fault on a top
        why = f"f is asked at the start of a step alone, which is right for f(y); where f depends on t, {off}"
        return Finding("time", "", f"f(y) only, {turning.order}", "measured", why, value, resolution)
    if in_frame(0.0).order <= turning.order:  # no worse than for f(y): the order is wrong, and not the times
        return Finding("time", "", str(turning.order), "measured", f"{off}, as for f(y)", value, resolution)
    why = f"where f depends on t, {off}: f is asked at wrong times"
    return Finding("time", yes_no(order), str(turning.order), "refuted", why, value, resolution)


def _stepped(stepper: Along, f: Any, begin: float, first: Array, unit: Array, h: float) -> Array:
    """The state after one step of h, in units of the chart."""
    after: Array = stepper.along(f, begin, first.copy(), h, np.array([1]))[0] / unit
    return after
