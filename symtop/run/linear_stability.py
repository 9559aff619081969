"""Linear stability of a method, from a few of its own steps next to a motion at rest in theta.

Near a steady precession the method's reduced map has a fixed point, and the inclination obeys a recurrence

    theta_{k+1} - t theta_k + d theta_{k-1} = c,       fixed point c/(1 - t + d),     d = 1 for a symmetric method

t is the trace of the linearised map. |t| <= 2: the discrete nutation turns by acos(t/2) a step; beyond, it grows.
|t| = 2 is the linear limit, t = -1 a third of a turn a step, the resonance that leaves no neighbourhood of the fixed
point (Moser; Verlet is there at h omega = sqrt 3 and the midpoint rule at 2 sqrt 3). So t(h), which four steps of any
method show, has the limit and the resonances in it, for any method.

A method that keeps the energy and both momenta has |t| <= 2 at every step that it can solve: the reduced energy is
least at the steady precession, and small nutations stay on its level lines. Gauss methods are of this kind. As the
precession becomes slow beside the nutation, their t tends to 2 Re R(i h omega), R the diagonal Pade approximant of exp.

Source: Hairer, Lubich, Wanner, Geometric Numerical Integration,
sections I.5 and X.4 (stability, resonance); Arnold, Mathematical Methods of Classical Mechanics, appendix 7.
"""

import math
from typing import NamedTuple

import numpy as np

from symtop.core.numbers import EPSILON, TINY
from symtop.methods.framework.calling import solve
from symtop.methods.framework.plan import Plan, Run
from symtop.methods.framework.registry import Integrator
from symtop.model.charts import View, axis_of
from symtop.model.scenes import Scene
from symtop.model.top import Angles, Momenta, SymmetricTop

NUDGE = 1e-6  # rad: nonlinear terms are 1e-12 of the linear ones, rounding 1e-10
BESIDE = 1e-3  # rad from a pole: closer, the motion is that at the pole to 1e-6, but in Euler's angles
STABLE = 1e-2  # of p_psi^2: a rotation at the pole that is so far from its threshold is stable
NEAR, LEAST = 1e-3, 1e-9  # of the way to a pole, a nudge beside one: nonlinear terms are 1e-6; rad
SINGLE_NUDGE, SINGLE_EPSILON = 1e-3, 2.0**-23  # rad, of a method in single precision; the spacing of its numbers at 1
WARM_UP = 4  # strides before those that are compared: a multistep method has its start behind it by then
ROUNDING = 32.0 * EPSILON  # of an inclination after some steps, rad
RESIDUAL, RESIDUAL_WITHOUT_ORDER = 2e-3, 5e-4  # of the recurrence, relative; less of a method that leaves out a term
STRIDE = 0.5  # rad of nutation between two places of a recurrence of `nutation_growth`
SLOWEST = 1e-6  # growth of a step below which rounding adds up for a million of them
LONG = 120  # strides that a difference is followed which obeys no recurrence of two terms
MOST_STRIDE = {"compiled": 50, "python": 5}  # steps
STEPS = 4
ROUNDS = 6  # of the search for a fixed point


def few_steps(method: Integrator, chart: str, top: SymmetricTop, start: Angles, h: float, steps: int = STEPS) -> Run:
    """The states after 0, 1, ... `steps` steps, as the chart has them."""
    return solve(method, chart, top, start, Plan.steps(h, np.arange(steps + 1)))


def with_momenta(top: SymmetricTop, theta: float, momenta: Momenta) -> Angles:
    """The state at rest in theta with these momenta; exact next to a pole, where p_phi - p_psi cos(theta) cancels."""
    x = 0.5 * theta
    rate = (momenta.north / math.sin(x) ** 2 + momenta.south / math.cos(x) ** 2) / (4.0 * top.I1)
    return Angles(theta=theta, phi_dot=rate, psi_dot=momenta.p_psi / top.I3 - rate * math.cos(theta))


class Trace(NamedTuple):
    """The linearised map of a method at its own steady precession."""

    trace: float  # NaN if the method has no fixed point near the steady precession
    determinant: float
    theta: float  # the fixed point
    doubt: float = 0.0  # of the trace: rounding over the way that theta goes, which is short where a step turns it back

    @property
    def growth(self) -> float:
        """Spectral radius; NaN if there is no fixed point."""
        if not math.isfinite(self.trace):
            return math.nan
        return float(np.max(np.abs(np.roots([1.0, -self.trace, self.determinant]))))

    @property
    def turn(self) -> float:
        """The angle by which a step turns small nutations, rad; 0 or pi if they grow or shrink without turning."""
        return math.acos(min(max(0.5 * self.trace / math.sqrt(abs(self.determinant) or 1.0), -1.0), 1.0))


NO_TRACE = Trace(math.nan, math.nan, math.nan)


def trace(method: Integrator, scene: Scene, h: float, chart: str | None = None) -> Trace:
    """The trace of the map of one step h at the method's fixed point next to the steady precession of these momenta.

    In the chart that shows the axis unless another is given.
    """
    top, momenta = scene.top, scene.top.momenta(scene.start)
    chart = chart or method.chart_for("axis")
    theta, moved = top.steady_theta(momenta), math.inf
    for _ in range(ROUNDS):
        if not 1e-3 < theta < math.pi - 1e-3:
            return NO_TRACE
        run = few_steps(method, chart, top, with_momenta(top, theta + NUDGE, momenta), h)
        with np.errstate(over="ignore"):  # the run may have blown up
            y = np.asarray(View(chart, top, run.states).theta) - theta
        if run.outcome != "ok" or not np.isfinite(y).all():
            return NO_TRACE
        t, d, c = _recurrence(y, symmetric=bool(method.symmetric))
        denominator, doubt = 1.0 - t + d, ROUNDING / max(float(np.ptp(y)), TINY)
        if abs(denominator) <= doubt and abs(c) <= doubt * NUDGE:  # every inclination stays where it is
            return Trace(t, d, theta, doubt)
        if denominator == 0.0:
            return NO_TRACE
        last, moved = moved, abs(c / denominator)
        if moved < NUDGE:
            return Trace(t, d, theta, doubt)
        if moved > 2.0 * last:
            return NO_TRACE
        theta += c / denominator
    return NO_TRACE


def _recurrence(y: np.ndarray, *, symmetric: bool) -> tuple[float, float, float]:
    """t, d and c of y_{k+1} - t y_k + d y_{k-1} = c by least squares; d = 1 for a symmetric method."""
    one = np.ones(y.size - 2)
    if symmetric:
        t, c = np.linalg.lstsq(np.stack([y[1:-1], one], axis=1), y[2:] + y[:-2], rcond=None)[0]
        return float(t), 1.0, float(c)
    t, minus_d, c = np.linalg.lstsq(np.stack([y[1:-1], y[:-2], one], axis=1), y[2:], rcond=None)[0]
    return float(t), -float(minus_d), float(c)


class Growth(NamedTuple):
    """What a method does to small nutations in every step."""

    factor: float  # of their size; NaN if it is not known
    size: float  # rad, of what the method adds to them: its own offset from the steady precession, and its rounding
    doubt: float = 0.0  # of the factor: its rounding


def nutation_growth(method: Integrator, scene: Scene, h: float, chart: str, frequency: float) -> Growth:
    """By what a method multiplies small nutations about the steady precession of these momenta in a step.

    It need not be symmetric. Two starts on both sides of the steady precession are stepped, and their difference
    obeys delta_{k+1} = t delta_k - d delta_{k-1}: what both drift by in a step, which `trace` takes for growth, and
    what is even in the distance cancels. Beside a pole the difference is that of e_x + i e_y, and t and d are
    complex. Some steps of a fine h are one of the recurrence, so that it turns by a good part of a radian;
    `frequency` is that of small nutations. Where the difference does not obey it (a method with more roots than two,
    or one in single precision, whose rounding hides it), its size is followed for longer. Rounding of each step adds
    up, as a random walk, until that of the first has grown by e. Where so many steps of a fine h turn it by a small
    angle a, the two terms are nearly one, and rounding e of the difference leaves a doubt of e/a^2 in their roots.
    """
    stride = max(1, int(min(STRIDE / max(h * frequency, TINY), MOST_STRIDE[method.implementation])))  # steps
    gap = min(theta := scene.top.steady_theta(scene.top.momenta(scene.start)), math.pi - theta)
    nudge, rounding = NUDGE if _beside(scene, chart) else min(NUDGE, max(NEAR * gap, LEAST)), EPSILON
    runs, delta, off = _apart(method, scene, h, chart, nudge, stride)
    places = runs[0].states[1:, :3]
    with np.errstate(over="ignore"):  # of a run that has blown up
        single = chart != "angles" and bool((places.astype(np.float32) == places).all())
    if single:
        nudge, rounding = SINGLE_NUDGE, SINGLE_EPSILON
        delta, off = _apart(method, scene, h, chart, nudge, stride)[1], 0.0
    factor = _root(delta, RESIDUAL if method.order else RESIDUAL_WITHOUT_ORDER)
    if math.isnan(factor) and (method.order or single):
        long = np.abs(_apart(method, scene, h, chart, nudge, stride, LONG)[1])
        third = long.size // 3
        with np.errstate(all="ignore"):
            factor = float(np.max(long[-third:]) / np.max(long[:third])) ** (1.0 / (2 * third))
    if not math.isfinite(factor):
        return Growth(math.nan, 0.0)
    factor **= 1.0 / stride
    doubt = ROUNDING / nudge / max(min(stride * h * frequency, 1.0) ** 2, TINY) / stride
    return Growth(factor, off + rounding * math.sqrt(0.5 / max(math.log(max(factor, 1.0)), SLOWEST)), doubt)


def _beside(scene: Scene, chart: str) -> bool:
    """Is the steady precession so close to a pole, where the top would turn stably, that it is followed as there?"""
    top, momenta = scene.top, scene.top.momenta(scene.start)
    theta, square = top.steady_theta(momenta), momenta.p_psi**2
    weight = 4.0 * top.I1 * (top.mgl if theta < 1.0 else -top.mgl)  # p_psi^2 at the threshold
    return chart != "angles" and min(theta, math.pi - theta) < BESIDE and square - weight > STABLE * max(square, weight)


def _apart(
    method: Integrator, scene: Scene, h: float, chart: str, nudge: float, stride: int, count: int = STEPS
) -> tuple[list[Run], np.ndarray, float]:
    """Two runs at a distance of two nudges, half their difference every `stride` steps, how far off their middle is."""
    top, momenta = scene.top, scene.top.momenta(scene.start)
    theta, beside = top.steady_theta(momenta), _beside(scene, chart)
    if beside:
        tilt, spin = math.pi - nudge if theta > 1.0 else nudge, momenta.p_psi / top.I3
        pair = [Angles(tilt, phi, psi_dot=spin) for phi in (0.0, math.pi)]
    else:
        pair = [with_momenta(top, min(max(theta + side, nudge), math.pi - nudge), momenta) for side in (nudge, -nudge)]
    runs = [few_steps(method, chart, top, at, h, (count + WARM_UP) * stride) for at in pair]
    with np.errstate(all="ignore"):
        if beside:
            one, other = (axis[:, 0] + 1j * axis[:, 1] for axis in (axis_of(chart, run.states) for run in runs))
        else:
            one, other = (np.asarray(View(chart, top, run.states).theta) for run in runs)
        off = 0.0 if beside else float(np.max(np.abs(0.5 * (one + other) - theta)))
        return runs, 0.5 * (one - other)[WARM_UP * stride :: stride], off


def _root(delta: np.ndarray, left_over: float) -> float:
    """The largest root of the recurrence of two terms that a difference obeys, in size; NaN if it does not."""
    if not np.isfinite(delta).all() or not delta.any():
        return math.nan
    known = np.stack([delta[1:-1], delta[:-2]], axis=1)
    t, minus_d = np.linalg.lstsq(known, delta[2:], rcond=None)[0]
    left = np.max(np.abs(known @ np.array([t, minus_d]) - delta[2:])) / np.max(np.abs(delta))
    return float(np.max(np.abs(np.roots([1.0, -t, -minus_d])))) if left < left_over else math.nan
