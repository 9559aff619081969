"""The true motion that the guard compares a probe with: the closed form, or an integration where there is none.

`ExactMotion` evaluates a top at any time. `IntegratedMotion`, with the same interface, needs only the equations, and so
works for bodies too: a Taylor series with a tolerance near rounding, for a body of order 19, or 15 where errors do not
grow much. Its error is estimated by the distance from a series of a looser tolerance, for a body of order 16 or 13, at
the beginning or, where the motion amplifies errors, all the way. The amplification of an error by the motion is

    A(t) = max over s <= t of |y~(s) - y(s)|/delta,      |y~(0) - y(0)| = delta,

from two integrations over the whole run: A grows linearly by shear, exponentially in chaos and unstable motions. A
piece of the run does not show it, because a chaotic motion looks regular on many pieces.
"""

import contextlib
import functools
import math
from dataclasses import replace
from typing import Any, NamedTuple, Self

import numpy as np

from symtop.core.errors import SymtopError
from symtop.core.jit import register_jitable
from symtop.core.numbers import EPSILON
from symtop.methods.framework.plan import LENGTH_OFF, Plan
from symtop.methods.framework.registry import integrator
from symtop.methods.runge_kutta.pairs import DOP853_PAIR, two_runs
from symtop.model.body import from_flat
from symtop.model.charts import BODY, Array, attitude_distance, axes, axis_distance
from symtop.model.exact.free_body import FreeBody
from symtop.model.scenes import Scene, closed_form
from symtop.model.top import Angles, flat
from symtop.run.reference.sensitivity import displacement

SERIES = {BODY: "series-general-adaptive", "axis": "series-adaptive"}
FINE_TOLERANCE, CHECK_TOLERANCE = 1e-15, 1e-13  # tolerances: of the true motion, and of the integration that checks it
CHECK_EVERY, LARGE_GROWTH = 10, 1e5  # the check compares each tenth time, or only the first tenth if A is less than 1e5
CALM_FACTOR = 1e3  # on these tolerances if A and the growth law of the guard stay below `LARGE_GROWTH` to the horizon
PAIR_STEPS = 7  # steps of two motions side by side, per period of the fastest turn: with 5.3, chaos is damped
SWING_FACTOR = 8.0  # times the pull of a weight: twice what one swing adds to 2T
CHANGE, FINE_CHANGE = 1e-10, 1e-13  # in natural frequencies, integrated and in closed form
LEAST_MOMENTUM_CHANGE, ABOVE_ROUNDING = 1e-16, 1e-13  # of the momentum, relative, while a body turns over; rad
FLIP_GROWTH, FLIP_COSINE = 1e6, 0.9  # A from which such a change counts; cosine between momenta in body axes
SATURATED_ANGLE = 0.01  # rad: motions farther apart than this no longer separate at the same rate
WATCHED_PERIODS = {BODY: 200.0, "axis": 20.0}  # over which A is computed; less for a top, which is integrable
MOST_WATCHED = 6000  # steps over which A is computed
POINTS = 100  # times at which A is computed
MOST_POWER = 20.0  # largest power of the time with which A is extrapolated
UNSTABLE_RATIO, SHEAR = 50.0, 10.0  # ratio of A to linear growth: more than any stable motion has, more than most have
LATER_RATIO = 30.0  # ratio assumed of later errors of a method to those of the probe, in an unstable motion
MOST_FOLDS = 100.0  # largest exponent x of a growth by e^x, against overflow
MOST_WORK = 1e6  # steps of an integration


class Landmarks(NamedTuple):
    """Constants of a motion that are known before it is computed."""

    period: float  # of the nutation; in `IntegratedMotion` the natural period
    frequency: float  # of small nutations about the steady precession with the same momenta
    width: float  # of the nutation, rad
    gap: float  # closest approach to a pole, rad; infinite where it is not known
    pole: str  # upper or lower
    rate: float  # of precession there, rad per unit time
    shear: float  # relative change of the period when the start is moved by rounding


@functools.lru_cache(maxsize=256)
def landmarks(scene: Scene) -> Landmarks:
    """The landmarks of a top's motion, by its closed form; cached."""
    top, start, form = scene.top, scene.start, closed_form(scene)
    momenta = top.momenta(start)
    highest, lowest = form.theta_range
    upper = highest <= math.pi - lowest
    gap = highest if upper else math.pi - lowest
    near, far = (momenta.north, momenta.south) if upper else (momenta.south, momenta.north)
    sine = math.sin(0.5 * gap) ** 2
    rate = abs(far / math.cos(0.5 * gap) ** 2 + (near / sine if sine > 0.0 else 0.0)) / (4.0 * top.I1)
    starts = (replace(start, phi_dot=start.phi_dot * (1.0 + change)) for change in (-4e-16, 4e-16))
    periods = [scene.nutation_period, *map(top.nutation_period, starts)]
    spread = max(periods) - min(periods)
    shear = spread / max(periods) if math.isfinite(spread) else 1.0
    pole, frequency = "upper" if upper else "lower", top.nutation_frequency(momenta)
    return Landmarks(form.nutation_period, frequency, lowest - highest, gap, pole, rate, shear)


class Growth(NamedTuple):
    """The amplification A at `times` (n,)."""

    times: Array
    size: Array

    @classmethod
    def of(cls, times: Array, distance: Array, limit: float) -> Self:
        """A from the relative `distance` (n,) of two motions at times > 0; exponential growth beyond `limit`."""
        size = np.maximum.accumulate(np.maximum(np.where(np.isnan(distance), math.inf, distance), 1.0))
        last = int(np.searchsorted(size, limit))
        if last < size.size:
            size[last:] = np.exp(np.minimum(math.log(limit) * times[last:] / times[last], MOST_FOLDS))
        return cls(times, size)

    def at(self, time: float) -> float:
        """A at any time; beyond the last of `times` it is extrapolated by its power law in their second half."""
        last, count = float(self.times[-1]), self.size.size
        if time <= last:
            return float(self.size[min(int(np.searchsorted(self.times, time)), count - 1)])
        power = math.log2(float(self.size[-1] / self.size[count // 2 - 1]))
        folds = min(max(power, 1.0), MOST_POWER) * math.log(time / last)
        return float(self.size[-1]) * math.exp(min(folds, MOST_FOLDS))


@register_jitable
def _distance(near: Any, far: Any, units: Any) -> Any:
    """The larger of the distances of two states in place and in momentum; NaN if not finite or |q| is far from 1."""
    first = len(near) - 3  # of the momentum
    position, momentum, near_square, far_square = 0.0, 0.0, 0.0, 0.0
    for m in range(first):
        position += (far[m] - near[m]) ** 2
        near_square += near[m] ** 2
        far_square += far[m] ** 2
    for m in range(first, len(near)):
        momentum += (far[m] - near[m]) ** 2
    length_error = max(abs(math.sqrt(near_square) - 1.0), abs(math.sqrt(far_square) - 1.0)) if first == 4 else 0.0
    valid = position + momentum < math.inf and length_error <= LENGTH_OFF
    return max(math.sqrt(position) * units[0], math.sqrt(momentum) * units[1]) if valid else math.nan


class IntegratedMotion:
    """The motion of a body, or of a top as if it had no closed form, by Taylor series."""

    longest, reach = 20.0, 40.0  # natural periods: most of a probe that is a share of the run, and of a minimal one
    points = 100  # of a probe that are compared
    period_word = "natural period"  # the name of `landmarks.period` in sentences

    def __init__(self, scene: Scene) -> None:
        self.scene, self.growths = scene, dict[float, Growth]()
        self.chart, self.watches = (BODY, "attitude") if scene.of_body else ("axis", "axis")
        slow, self.fast, self.inertia = _frequencies(scene)
        self.landmarks = Landmarks(2.0 * math.pi / slow, slow, math.nan, math.inf, "upper", 0.0, 0.0)
        self.rate, self.momentum, self.given = 1.0, 1.0, (scene.top, scene.start)
        if scene.of_body:
            self.rate, per = (2.0 ** math.frexp(unit)[1] for unit in (slow, 0.25 * self.inertia))
            self.momentum = per * self.rate
            *moments, mgl, x, y, z = scene.top.flat(scene.start)[:7]
            rates = (rate / self.rate for rate in scene.start.omega_body)
            numbers = *(moment / per for moment in moments), mgl / per / self.rate**2, x, y, z, *scene.start.quaternion
            self.given = from_flat((*numbers, *rates))

    def states(self, times: Array, tolerance: float) -> Array:
        """States (n, dimension) at `times` (n,), NaN after `MOST_WORK` steps.

        A body is integrated in units of its natural frequency and a quarter of its middle moment, up to powers of two:
        the series keeps all numbers of a state to the tolerance times the largest, so that q and momentum must be of
        one size; the Earth's momentum in SI is 6e33.
        """
        solver = integrator(SERIES[self.chart]).solvers[self.chart]  # called directly: checks would double its time
        states = solver(*self.given, Plan.until(self.rate * times, tolerance, MOST_WORK)).states
        states[:, -3:] *= self.momentum
        return states

    def error(self, times: Array, chart: str, states: Array, _: float, horizon: float, /) -> Array:
        """The error (n,), rad, of states (n, dimension) at `times` (n,), plus the estimated error of the reference."""
        end = float(times[-1])
        steady = self.amplification(end, horizon) < LARGE_GROWTH
        count = max(times.size // CHECK_EVERY, 1)
        subset = slice(count) if steady else slice((times.size - 1) % CHECK_EVERY, None, CHECK_EVERY)
        calm = max(self.amplification(horizon, horizon), (horizon / end) ** 2) < LARGE_GROWTH
        factor = CALM_FACTOR if calm else 1.0
        true, check = self.states(times, FINE_TOLERANCE * factor), self.states(times[subset], CHECK_TOLERANCE * factor)
        gap = np.abs(check - true[subset])[:, : 4 if self.chart == BODY else 3].max(initial=0.0)
        if self.chart == BODY:
            return np.asarray(attitude_distance(states[:, :4], true[:, :4]) + gap)
        return np.asarray(axis_distance(axes(chart, states), axes(self.chart, true)) + gap)

    def start(self, _: float, /) -> Any:
        """The state at a time, as a start. Here it is always the scene's start: probes begin nowhere else."""
        return self.scene.start

    def closest(self) -> float:
        """When the axis first comes closest to a pole, where a step's error is largest; here not known, and 0."""
        return 0.0

    def moved(self, by: float = CHANGE) -> Any:
        """The scene's start with its rates changed by `by` times the natural frequency."""
        start, rate = self.scene.start, by * self.landmarks.frequency
        if self.chart == BODY:
            x, y, z = start.omega_body
            return replace(start, omega_body=(x + 0.6 * rate, y - 0.48 * rate, z + 0.64 * rate))
        return replace(start, theta_dot=start.theta_dot + 0.6 * rate, phi_dot=start.phi_dot + 0.8 * rate)

    def growth(self, horizon: float) -> Growth:
        """A up to the horizon, or as far as `WATCHED_PERIODS` and `MOST_WATCHED` allow; cached.

        Both motions take the same steps, so that integration errors cancel in their distance. If two motions of a free
        body separate far, A is computed again with the closed form and a smaller change; and with that of a change made
        while the body turns over, which moves it off the separatrix more than one of a start beside the unstable axis.
        """
        step = 2.0 * math.pi / self.fast / PAIR_STEPS
        duration = min(horizon, WATCHED_PERIODS[self.chart] * self.landmarks.period, MOST_WATCHED * step)
        if duration not in self.growths:
            steps = max(math.ceil(duration / step), POINTS)
            h, marks, distance = duration / steps, np.arange(1, POINTS + 1) * steps // POINTS, np.empty(POINTS)
            pair = (flat(self.scene.top, start) for start in (self.scene.start, self.moved()))
            momentum = self.inertia * self.landmarks.frequency
            units = (2.0 if self.chart == BODY else 1.0) / CHANGE, 1.0 / (CHANGE * momentum)
            two_runs(self.chart, DOP853_PAIR, _distance)(*pair, h, marks, units, distance)
            times, change, top, turning = np.multiply(marks, h, dtype=float), CHANGE, self.scene.top, np.ones(POINTS)
            if self.chart == BODY and top.free and not distance.max() < FLIP_GROWTH:
                starts = self.scene.start, self.moved(FINE_CHANGE)
                with contextlib.suppress(SymtopError):  # the closed form refuses some momenta
                    forms = [FreeBody(top.moments, a.quaternion, top.momentum(a), top.momentum_lo(a)) for a in starts]
                    near, far = (form.samples(times) for form in forms)
                    if not distance.max() < SATURATED_ANGLE / CHANGE:
                        distance = attitude_distance(near.quaternion, far.quaternion) / FINE_CHANGE
                        change = FINE_CHANGE
                    turning = _growth_after_flip(top.moments, times, near.quaternion, near.momentum)
            growth = Growth.of(times, distance, SATURATED_ANGLE / change)
            self.growths[duration] = growth._replace(size=np.maximum(growth.size, turning))
        return self.growths[duration]

    def amplification(self, time: float, horizon: float) -> float:
        """A at `time`, of a run to `horizon`."""
        return self.growth(horizon).at(time)

    def displacement(self, change: float, horizon: float) -> float:
        """The distance, rad, at the horizon from the motion whose start is changed by `change`."""
        return min(change * self.amplification(horizon, horizon), math.pi)

    def amplified(self, error: float, since: float, horizon: float, /) -> float:
        """An error at the time `since` as the motion amplifies it by the horizon, rad."""
        if since >= horizon:
            return error
        times = self.amplification(horizon, horizon) / self.amplification(since, horizon)
        return error * times * (LATER_RATIO if times > UNSTABLE_RATIO * horizon / since else 1.0)

    def rounding(self, horizon: float, *, whole: bool) -> float:
        """The error by rounding at the horizon, rad, whatever the method; 0 if a probe of the `whole` run shows it."""
        return 0.0 if whole else self.displacement(EPSILON, horizon)


def _growth_after_flip(moments: Any, times: Array, quaternion: Array, momentum: Array) -> Array:
    """A (n,) of a change of a free body's momentum when that first leaves the axis of the start; 1 until then.

    If it never does, A is that of a change at the start.
    """
    length = np.linalg.norm(momentum[0])
    size, index = np.ones(times.size), int(np.argmax(np.abs(momentum @ momentum[0]) < FLIP_COSINE * length**2))
    change = LEAST_MOMENTUM_CHANGE * length * np.array([0.6, -0.48, 0.64])
    later, start = times[index + 1 :] - times[index], (quaternion[index], momentum[index])
    gap = attitude_distance(*(FreeBody(moments, *start, low).samples(later).quaternion for low in (change, -change)))
    size[index + 1 :] = np.where(gap > ABOVE_ROUNDING, gap / (2.0 * LEAST_MOMENTUM_CHANGE), 1.0)
    return np.maximum.accumulate(size)


def _frequencies(scene: Scene) -> tuple[float, float, float]:
    """The natural frequency (`symtop.model.body`), an approximate upper bound of |omega|, and a moment of inertia.

    With I1 the least and I3 the largest moment, and kinetic energy T and momentum M at any time,

        |omega|^2 = 2T/I3 + sum_i omega_i^2 (1 - I_i/I3) <= 2T/I3 + F/I1,    F = 2T - |M|^2/I3 <= 2T (1 - I1/I3)

    T is at most the energy less the least potential. F changes by the work of the weight across each axis, which is
    estimated by a few swings: of 640 random bodies one turned more than a tenth faster than the bound.
    """
    top, start, slowest = scene.top, scene.start, 2.0 * math.pi / scene.horizon
    if not scene.of_body:
        rates = start.theta_dot, start.phi_dot * math.sin(start.theta), top.momenta(start).p_psi / top.I1
        slow = max(math.hypot(*rates, math.sqrt(abs(top.mgl) / top.I1)), slowest)
        return slow, slow, top.I1
    slow = max(2.0 * math.pi / top.nutation_period(start), slowest)
    smallest, middle, largest = sorted(top.moments)
    pulls = [abs(top.mgl) * math.sqrt(max(1.0 - along * along, 0.0)) for along in top.centre]
    energy2 = 2.0 * (top.energy(start) + abs(top.mgl))
    parts = zip(top.moments, start.omega_body, pulls, strict=True)
    part = sum((1.0 - moment / largest) * (moment * rate * rate + SWING_FACTOR * pull) for moment, rate, pull in parts)
    turning = max(energy2 / largest, 0.0) + max(min(part, energy2 * (1.0 - smallest / largest)), 0.0) / smallest
    swinging = max(pull / moment for moment, pull in zip(top.moments, pulls, strict=True))
    return slow, max(slow, math.sqrt(max(turning, swinging))), middle


class ExactMotion:
    """The motion of a top by its closed form, at any time."""

    watches, longest, reach, points, period_word = "axis", 20.0, math.inf, 300, "nutation"

    def __init__(self, scene: Scene) -> None:
        self.scene, self.landmarks, self.form = scene, landmarks(scene), closed_form(scene)

    def error(self, times: Array, chart: str, states: Array, since: float, _: float, /) -> Array:
        """See `IntegratedMotion`; the error is that of the axis."""
        return self.form.axis_distance(since + times, axes(chart, states))

    def start(self, since: float, /) -> Any:
        """See `IntegratedMotion`."""
        return Angles(*(float(value) for value in self.form(since))) if since else self.scene.start

    def closest(self) -> float:
        """See `IntegratedMotion`."""
        width = self.landmarks.period if math.isfinite(self.landmarks.period) else self.scene.horizon
        middle = 0.5 * width
        for _ in range(4):
            times = middle + width * np.linspace(-0.5, 0.5, 129)
            middle, width = float(times[int(np.argmin(np.sin(self.form(times).theta)))]), width / 40.0
        return middle

    def displacement(self, change: float, horizon: float) -> float:
        """See `symtop.run.reference.sensitivity`."""
        return displacement(self.scene, change, horizon)

    def amplified(self, _: float, __: float, ___: float, /) -> float:
        """0: errors of an integrable motion grow by shear, which the growth law of the guard covers."""
        return 0.0

    def rounding(self, horizon: float, *, whole: bool) -> float:  # noqa: ARG002
        """See `IntegratedMotion`; not 0 for a `whole` run."""
        marks, turns = self.landmarks, horizon / self.landmarks.period
        return marks.shear * 2.0 * math.pi * turns * min(marks.width, 1.0) if turns > 0.5 else 0.0


Motion = ExactMotion | IntegratedMotion  # one interface for the guard
