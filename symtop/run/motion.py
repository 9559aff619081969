"""The true motion beside a probe of the guard: by the closed form, or integrated where there is none.

`Exact` knows a top's motion for ever. `Integrated` needs the equations alone, and so takes bodies too: a Taylor series
at rounding, for a body of order 19, or 15 where errors do not grow much. Its own error is its distance from a series
of a looser tolerance, for a body of order 16 or 13, at the beginning or, where the motion multiplies errors, all the
way. What the motion makes of an error is

    A(t) = max over s <= t of |y~(s) - y(s)|/delta,      |y~(0) - y(0)| = delta,

of two integrations over the whole run: shear makes A grow with t, chaos and unstable motions by exponentials. A piece
of the run does not show it, because a chaotic motion looks regular on many a piece.
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
from symtop.methods.framework.plan import LENGTH, Plan
from symtop.methods.framework.registry import integrator
from symtop.methods.runge_kutta.pairs import DOP8, two_runs
from symtop.model.charts import BODY, Array, attitude_distance, axes, axis_distance
from symtop.model.exact.free_body import FreeBody
from symtop.model.scenes import Scene, closed_form
from symtop.model.top import Angles, flat
from symtop.run.reference.sensitivity import displacement

SERIES = {BODY: "series-general-adaptive", "axis": "series-adaptive"}
FINE, CHECK = 1e-15, 1e-13  # tolerances: of the true motion, and of its check at one of so many times, the last first
CHECKED, MULTIPLIED = 10, 1e5  # or at the first ones where A is less, which makes little of what they differ by
CALM = 1e3  # times these tolerances where A and the law of the guard make less than that of an error by the horizon
PAIR_STEPS = 7  # of two motions side by side, in a period of the fastest turn: with 5.3 chaos is damped away
SWINGS = 8.0  # of the pull of a weight: twice what one swing adds to 2T
MOVED, FINELY_MOVED = 1e-10, 1e-13  # of the natural frequency: shows the shear beside a separatrix; in closed form
SATURATED = 0.01  # rad; two motions that are farther apart no longer show how fast they part
WATCHED = {BODY: 200.0, "axis": 20.0}  # natural periods of a run: the motion of a top is integrable
MOST_WATCHED = 6000  # steps
POINTS = 100  # of A
MOST_POWER = 20.0  # of the time by which A grows beyond what is watched
UNSTABLE, SHEARED = 50.0, 10.0  # times that a stable motion, and most, may amplify a change more than time goes on
LATER = 30.0  # of the errors of a piece: those that a method commits later in an unstable motion
MOST_FOLDS = 100.0  # e times that anything grows: any is too much
MOST_WORK = 1e6  # steps of an integration


class Landmarks(NamedTuple):
    """What is known about a motion before it is computed."""

    period: float  # of the nutation; of a motion that is integrated the natural one
    frequency: float  # of small nutations about the steady precession with the same momenta
    width: float  # of the nutation, rad
    gap: float  # closest approach to a pole, rad; infinite where it is not known
    pole: str  # upper or lower
    rate: float  # of precession there, rad per unit time
    shear: float  # relative change of the period when the start is moved by rounding


@functools.lru_cache(maxsize=256)
def landmarks(scene: Scene) -> Landmarks:
    """The landmarks of a scene's motion, by its closed form; made once and kept."""
    top, at, form = scene.top, scene.start, closed_form(scene)
    momenta = top.momenta(at)
    highest, lowest = form.theta_range
    upper = highest <= math.pi - lowest
    gap = highest if upper else math.pi - lowest
    near, far = (momenta.north, momenta.south) if upper else (momenta.south, momenta.north)
    sine = math.sin(0.5 * gap) ** 2
    rate = abs(far / math.cos(0.5 * gap) ** 2 + (near / sine if sine > 0.0 else 0.0)) / (4.0 * top.I1)
    rounded = (replace(at, phi_dot=at.phi_dot * (1.0 + turn)) for turn in (-4e-16, 4e-16))
    moved = [scene.nutation_period, *map(top.nutation_period, rounded)]
    spread = max(moved) - min(moved)
    shear = spread / max(moved) if math.isfinite(spread) else 1.0
    pole, frequency = "upper" if upper else "lower", top.nutation_frequency(momenta)
    return Landmarks(form.nutation_period, frequency, lowest - highest, gap, pole, rate, shear)


class Growth(NamedTuple):
    """A, at `times` (n,)."""

    times: Array
    size: Array

    @classmethod
    def of(cls, times: Array, apart: Array, most: float) -> Self:
        """From a distance in units of the first one at `times`, after 0 and not empty; beyond `most` it grows on."""
        size = np.maximum.accumulate(np.maximum(np.where(np.isnan(apart), math.inf, apart), 1.0))
        last = int(np.searchsorted(size, most))
        if last < size.size:
            size[last:] = np.exp(np.minimum(math.log(most) * times[last:] / times[last], MOST_FOLDS))
        return cls(times, size)

    def at(self, until: float) -> float:
        """A at any time; later than the last one by the power of the time that it grew with in the second half."""
        last, count = float(self.times[-1]), self.size.size
        if until <= last:
            return float(self.size[min(int(np.searchsorted(self.times, until)), count - 1)])
        power = math.log2(float(self.size[-1] / self.size[count // 2 - 1]))
        folds = min(max(power, 1.0), MOST_POWER) * math.log(until / last)
        return float(self.size[-1]) * math.exp(min(folds, MOST_FOLDS))


@register_jitable
def _apart(near: Any, far: Any, units: Any) -> Any:
    """How far two states are apart, in place or in momentum; NaN of what is lost, as a quaternion not of length one."""
    first = len(near) - 3  # of the momentum
    place, momentum, one, other = 0.0, 0.0, 0.0, 0.0
    for m in range(first):
        place, one, other = place + (far[m] - near[m]) ** 2, one + near[m] ** 2, other + far[m] ** 2
    for m in range(first, len(near)):
        momentum += (far[m] - near[m]) ** 2
    long = max(abs(math.sqrt(one) - 1.0), abs(math.sqrt(other) - 1.0)) if first == 4 else 0.0
    sound = place + momentum < math.inf and long <= LENGTH
    return max(math.sqrt(place) * units[0], math.sqrt(momentum) * units[1]) if sound else math.nan


class Integrated:
    """The motion of a body, or of a top as if it had no closed form, by Taylor series; what the guard asks of any."""

    longest, reach = 20.0, 40.0  # natural periods of a piece that is a share of the run, and of any other
    points = 100  # of a piece that are compared
    period_word = "natural period"  # what `marks.period` is

    def __init__(self, scene: Scene) -> None:
        self.scene, self.growths = scene, dict[float, Growth]()
        self.chart, self.watches = (BODY, "attitude") if scene.of_body else ("axis", "axis")
        slow, self.fast, self.inertia = _frequencies(scene)
        self.marks = Landmarks(2.0 * math.pi / slow, slow, math.nan, math.inf, "upper", 0.0, 0.0)

    def states(self, times: Array, tolerance: float) -> Array:
        """States (n, dimension) at `times` (n,), NaN from where the work is too much."""
        solver = integrator(SERIES[self.chart]).solvers[self.chart]  # called as it is: checks take as long as it does
        return solver(self.scene.top, self.scene.start, Plan.until(times, tolerance, MOST_WORK)).states

    def apart(self, first: tuple[str, Array], second: tuple[str, Array]) -> Array:
        """Rad (n,) between states (n, dimension) of two charts."""
        if self.chart == BODY:
            return attitude_distance(first[1][:, :4], second[1][:, :4])
        return axis_distance(axes(*first), axes(*second))

    def error(self, times: Array, chart: str, states: Array, _: float, horizon: float, /) -> Array:
        """Rad (n,) by which states (n, dimension) are off at `times` (n,) of a run, with what two orders differ by."""
        end = float(times[-1])
        steady = self.amplification(end, horizon) < MULTIPLIED
        some = slice(max(times.size // CHECKED, 1)) if steady else slice((times.size - 1) % CHECKED, None, CHECKED)
        calm = max(self.amplification(horizon, horizon), (horizon / end) ** 2) < MULTIPLIED
        looser = CALM if calm else 1.0
        true, check = self.states(times, FINE * looser), self.states(times[some], CHECK * looser)
        gap = np.abs(check - true[some])[:, : 4 if self.chart == BODY else 3].max(initial=0.0)
        return np.asarray(self.apart((chart, states), (self.chart, true)) + gap)

    def start(self, _: float, /) -> Any:
        """The state at a time, as a start: the start itself, a piece begins nowhere else."""
        return self.scene.start

    def closest(self) -> float:
        """A time at which a method may have the most to do: when the axis first comes closest to a pole; 0 here."""
        return 0.0

    def moved(self, by: float = MOVED) -> Any:
        """A start that differs by so much of the natural frequency."""
        at, rate = self.scene.start, by * self.marks.frequency
        if self.chart == BODY:
            x, y, z = at.omega_body
            return replace(at, omega_body=(x + 0.6 * rate, y - 0.48 * rate, z + 0.64 * rate))
        return replace(at, theta_dot=at.theta_dot + 0.6 * rate, phi_dot=at.phi_dot + 0.8 * rate)

    def growth(self, horizon: float) -> Growth:
        """A up to the horizon, or as far as it is watched; made once.

        Both motions take the same steps, so that their errors do not hide it; those of a free body that part are exact.
        """
        step = 2.0 * math.pi / self.fast / PAIR_STEPS
        until = min(horizon, WATCHED[self.chart] * self.marks.period, MOST_WATCHED * step)
        if until not in self.growths:
            steps = max(math.ceil(until / step), POINTS)
            h, marks, apart = until / steps, np.arange(1, POINTS + 1) * steps // POINTS, np.empty(POINTS)
            given = (flat(self.scene.top, start) for start in (self.scene.start, self.moved()))
            units = (2.0 if self.chart == BODY else 1.0) / MOVED, 1.0 / (MOVED * self.inertia * self.marks.frequency)
            two_runs(self.chart, DOP8, _apart)(*given, h, marks, units, apart)
            times, moved, top = np.multiply(marks, h, dtype=float), MOVED, self.scene.top
            if self.chart == BODY and top.free and not apart.max() < SATURATED / MOVED:
                starts = self.scene.start, self.moved(FINELY_MOVED)
                with contextlib.suppress(SymtopError):  # of momenta that the closed form does not take
                    forms = (FreeBody(top.moments, a.quaternion, top.momentum(a), top.momentum_lo(a)) for a in starts)
                    apart = attitude_distance(*(form.samples(times).quaternion for form in forms)) / FINELY_MOVED
                    moved = FINELY_MOVED
            self.growths[until] = Growth.of(times, apart, SATURATED / moved)
        return self.growths[until]

    def amplification(self, until: float, horizon: float) -> float:
        """A at a time of a run to the horizon."""
        return self.growth(horizon).at(until)

    def displacement(self, change: float, horizon: float) -> float:
        """How far the run is off by the horizon, rad, if the start is changed by so little."""
        return min(change * self.amplification(horizon, horizon), math.pi)

    def amplified(self, error: float, since: float, horizon: float, /) -> float:
        """What the motion makes by the horizon of an error at the time `since`, rad; 0 if its law is known."""
        if since >= horizon:
            return error
        times = self.amplification(horizon, horizon) / self.amplification(since, horizon)
        return error * times * (LATER if times > UNSTABLE * horizon / since else 1.0)

    def rounding(self, horizon: float, *, whole: bool) -> float:
        """What rounding makes of a run, rad, whatever the method; 0 if a piece was the `whole` run, which shows it."""
        return 0.0 if whole else self.displacement(EPSILON, horizon)


def _frequencies(scene: Scene) -> tuple[float, float, float]:
    """That of the natural period (`symtop.model.body`), one that no turn exceeds by much, and the inertia of both.

    With I1 the least and I3 the largest moment, and T and M at any time,

        |omega|^2 = 2T/I3 + sum_i omega_i^2 (1 - I_i/I3) <= 2T/I3 + F/I1,    F = 2T - |M|^2/I3 <= 2T (1 - I1/I3)

    T is at most what is left of the energy where the weight lies lowest. F changes by what the weight does across each
    axis, which is estimated by a few swings: of 640 random bodies one turned more than a tenth faster.
    """
    top, at, slowest = scene.top, scene.start, 2.0 * math.pi / scene.horizon
    if not scene.of_body:
        rates = at.theta_dot, at.phi_dot * math.sin(at.theta), top.momenta(at).p_psi / top.I1
        slow = max(math.hypot(*rates, math.sqrt(abs(top.mgl) / top.I1)), slowest)
        return slow, slow, top.I1
    slow = max(2.0 * math.pi / top.nutation_period(at), slowest)
    least, middle, most = sorted(top.moments)
    pulls = [abs(top.mgl) * math.sqrt(max(1.0 - along * along, 0.0)) for along in top.centre]
    twice = 2.0 * (top.energy(at) + abs(top.mgl))
    parts = zip(top.moments, at.omega_body, pulls, strict=True)
    part = sum((1.0 - one / most) * (one * rate * rate + SWINGS * pull) for one, rate, pull in parts)
    turning = max(twice / most, 0.0) + max(min(part, twice * (1.0 - least / most)), 0.0) / least
    swinging = max(pull / one for one, pull in zip(top.moments, pulls, strict=True))
    return slow, max(slow, math.sqrt(max(turning, swinging))), middle


class Exact(Integrated):
    """The same of a top by its closed form, which knows it for ever."""

    watches, longest, reach, points, period_word = "axis", 20.0, math.inf, 300, "nutation"

    def __init__(self, scene: Scene) -> None:
        self.scene, self.marks, self.form = scene, landmarks(scene), closed_form(scene)

    def error(self, times: Array, chart: str, states: Array, since: float, _: float, /) -> Array:
        """See `Integrated`; of the axis."""
        return self.form.axis_distance(since + times, axes(chart, states))

    def start(self, since: float, /) -> Any:
        """See `Integrated`."""
        return Angles(*(float(value) for value in self.form(since))) if since else self.scene.start

    def closest(self) -> float:
        """See `Integrated`."""
        width = self.marks.period if math.isfinite(self.marks.period) else self.scene.horizon
        middle = 0.5 * width
        for _ in range(4):
            times = middle + width * np.linspace(-0.5, 0.5, 129)
            middle, width = float(times[int(np.argmin(np.sin(self.form(times).theta)))]), width / 40.0
        return middle

    def displacement(self, change: float, horizon: float) -> float:
        """See `symtop.run.reference.sensitivity`."""
        return displacement(self.scene, change, horizon)

    def amplified(self, _: float, __: float, ___: float, /) -> float:
        """0: errors of an integrable motion shear, which the law of the guard has."""
        return 0.0

    def rounding(self, horizon: float, *, whole: bool) -> float:  # noqa: ARG002
        """See `Integrated`; of the whole run, too."""
        marks, turns = self.marks, horizon / self.marks.period
        return marks.shear * 2.0 * math.pi * turns * min(marks.width, 1.0) if turns > 0.5 else 0.0
