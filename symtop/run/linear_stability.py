"""Linear stability of a method, from a few of its own steps next to a steady precession.

Near a steady precession the method's reduced map has a fixed point, and the inclination obeys a recurrence

    theta_{k+1} - t theta_k + d theta_{k-1} = c,       fixed point c/(1 - t + d),     d = 1 for a symmetric method

t is the trace of the linearised map. If |t| <= 2, the discrete nutation turns by acos(t/2) per step; beyond, it grows.
|t| = 2 is the linear stability limit; t = -1 is a third of a turn per step, the resonance with no stable neighbourhood
of the fixed point (Moser; for Verlet h omega = sqrt 3, for the midpoint rule 2 sqrt 3). Four steps of any method give
t(h), and so its stability limit and its resonances.

A method that keeps the energy and both momenta has |t| <= 2 at every step whose equations it can solve: the reduced
energy has a minimum at the steady precession, and small nutations stay on its level lines. So do Gauss methods. As the
precession becomes slow beside the nutation, their t tends to 2 Re R(i h omega), R the diagonal Pade approximant of exp.

Source: Hairer, Lubich, Wanner, Geometric Numerical Integration,
sections I.5 and X.6 (stability, resonance); Arnold, Mathematical Methods of Classical Mechanics, appendix 7.
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

NUDGE = 1e-6  # rad, displacement from the fixed point: nonlinear terms are 1e-6 of the linear ones (of a difference of
# two sides 1e-12), rounding 1e-10. The trace of Verlet is off by 7e-7 at h omega = 1, by 1e-5 at 2.1.
BESIDE_POLE = 1e-3  # rad: nearer to a pole than this, the motion is that at the pole to 1e-6, except in Euler's angles
MARGIN = 1e-2  # least relative distance of p_psi^2 above the threshold of a stable rotation at the pole
NUDGE_SHARE, LEAST_NUDGE = 1e-3, 1e-9  # near a pole: part of the distance (nonlinear terms are 1e-6); rad
SINGLE_NUDGE, SINGLE_EPSILON = 1e-3, 2.0**-23  # for methods in single precision: rad; machine epsilon
WARM_UP = 4  # strides before those that are compared: more than the starting steps of a multistep method
ROUNDING = 32.0 * EPSILON  # of an inclination after some steps, rad
RESIDUAL, RESIDUAL_WITHOUT_ORDER = 2e-3, 5e-4  # largest relative residual of the recurrence; if a method has no order
STRIDE = 0.5  # rad of nutation between two terms of the recurrence of `nutation_growth`
LEAST_GROWTH = 1e-6  # least growth per step in the estimate of accumulated rounding
LONG_STRIDES = 120  # strides over which a difference is followed that obeys no two-term recurrence
MOST_STRIDE = {"compiled": 50, "python": 5}  # steps
STEPS = 4  # of a run
FIXED_POINT_ROUNDS = 6  # iterations for the fixed point


def few_steps(method: Integrator, chart: str, top: SymmetricTop, start: Angles, h: float, steps: int = STEPS) -> Run:
    """A run of `steps` steps, sampled after each of them and at the start, in the variables of the chart."""
    return solve(method, chart, top, start, Plan.steps(h, np.arange(steps + 1)))


def with_momenta(top: SymmetricTop, theta: float, momenta: Momenta) -> Angles:
    """The start with these momenta and theta' = 0; exact next to a pole, where p_phi - p_psi cos(theta) cancels."""
    x = 0.5 * theta
    rate = (momenta.north / math.sin(x) ** 2 + momenta.south / math.cos(x) ** 2) / (4.0 * top.I1)
    return Angles(theta=theta, phi_dot=rate, psi_dot=momenta.p_psi / top.I3 - rate * math.cos(theta))


class Trace(NamedTuple):
    """The linearised map of a method at its own steady precession."""

    trace: float  # NaN if the method has no fixed point near the steady precession
    determinant: float
    theta: float  # the fixed point
    doubt: float = 0.0  # of the trace, by rounding: that over the range of theta in the run

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
    """The trace of the map of a step h at the method's steady precession; in the axis' smallest chart by default."""
    top, momenta = scene.top, scene.top.momenta(scene.start)
    chart = chart or method.chart_for("axis")
    theta, shift = top.steady_theta(momenta), math.inf
    for _ in range(FIXED_POINT_ROUNDS):
        if not 1e-3 < theta < math.pi - 1e-3:
            return NO_TRACE
        run = few_steps(method, chart, top, with_momenta(top, theta + NUDGE, momenta), h)
        with np.errstate(over="ignore"):  # the run may have blown up
            y = np.asarray(View(chart, top, run.states).theta) - theta
        if run.outcome != "ok" or not np.isfinite(y).all():
            return NO_TRACE
        t, d, c = _recurrence(y, symmetric=bool(method.symmetric))
        denominator, uncertainty = 1.0 - t + d, ROUNDING / max(float(np.ptp(y)), TINY)
        if abs(denominator) <= uncertainty and abs(c) <= uncertainty * NUDGE:  # every inclination is a fixed point
            return Trace(t, d, theta, uncertainty)
        if denominator == 0.0:
            return NO_TRACE
        last, shift = shift, abs(c / denominator)
        if shift < NUDGE:
            return Trace(t, d, theta, uncertainty)
        if shift > 2.0 * last:
            return NO_TRACE
        theta += c / denominator
    return NO_TRACE


def _recurrence(y: np.ndarray, *, symmetric: bool) -> tuple[float, float, float]:
    """t, d and c of y_{k+1} - t y_k + d y_{k-1} = c by least squares; d = 1 for a symmetric method."""
    ones = np.ones(y.size - 2)
    if symmetric:
        t, c = np.linalg.lstsq(np.stack([y[1:-1], ones], axis=1), y[2:] + y[:-2], rcond=None)[0]
        return float(t), 1.0, float(c)
    t, minus_d, c = np.linalg.lstsq(np.stack([y[1:-1], y[:-2], ones], axis=1), y[2:], rcond=None)[0]
    return float(t), -float(minus_d), float(c)


class Growth(NamedTuple):
    """The growth of small nutations per step of a method."""

    factor: float  # by which their size is multiplied; NaN if it is not known
    size: float  # rad, of the nutation that the method adds: its offset from the steady precession, and rounding
    doubt: float = 0.0  # rounding error of the factor


def nutation_growth(method: Integrator, scene: Scene, h: float, chart: str, frequency: float) -> Growth:
    """The growth of small nutations about the steady precession of the scene's momenta, per step of a method.

    It need not be symmetric. Two starts on both sides of the steady precession are stepped, and their difference obeys
    delta_{k+1} = t delta_k - d delta_{k-1}: a common drift, which `trace` mistakes for growth, and even terms in the
    distance cancel. Beside a pole the difference is that of e_x + i e_y, and t and d are complex. For small h several
    steps, a stride, are one index of the recurrence, which then turns by about `STRIDE`; `frequency` is that of small
    nutations. If the difference does not obey it (a method with more than two roots, or in single precision, where
    rounding hides it), its size is followed for longer. Rounding errors of the steps add up as a random walk, until the
    first has grown by e. If a stride turns by a small angle a, the two terms are almost linearly dependent, and a
    rounding error e of the difference leaves an uncertainty of e/a^2 in the roots. A step that keeps the energy, whose
    slope vanishes at the steady precession, may turn a rounding error of the energy into one of theta.
    """
    stride = max(1, int(min(STRIDE / max(h * frequency, TINY), MOST_STRIDE[method.implementation])))  # steps
    gap = min(theta := scene.top.steady_theta(scene.top.momenta(scene.start)), math.pi - theta)
    nudge, rounding = NUDGE if _near_pole(scene, chart) else min(NUDGE, max(NUDGE_SHARE * gap, LEAST_NUDGE)), EPSILON
    runs, delta, offset = _run_pair(method, scene, h, chart, nudge, stride)
    positions = runs[0].states[1:, :3]
    with np.errstate(over="ignore"):  # a run may have blown up
        single = chart != "angles" and bool((positions.astype(np.float32) == positions).all())
    if single:
        nudge, rounding = SINGLE_NUDGE, SINGLE_EPSILON
        delta, offset = _run_pair(method, scene, h, chart, nudge, stride)[1], 0.0
    factor = _root(delta, RESIDUAL if method.order else RESIDUAL_WITHOUT_ORDER)
    if math.isnan(factor) and (method.order or single):
        long = np.abs(_run_pair(method, scene, h, chart, nudge, stride, LONG_STRIDES)[1])
        third = long.size // 3
        with np.errstate(all="ignore"):
            factor = float(np.max(long[-third:]) / np.max(long[:third])) ** (1.0 / (2 * third))
    if not math.isfinite(factor):
        return Growth(math.nan, 0.0)
    factor **= 1.0 / stride
    noise, top = ROUNDING, scene.top
    if "energy" in (method.conserves or ()):
        error = EPSILON * (abs(top.energy(scene.start)) + abs(top.mgl))
        noise = max(noise, error / max(top.I1 * frequency**2 * nudge, TINY))
    doubt = noise / nudge / max(min(stride * h * frequency, 1.0) ** 2, TINY) / stride
    return Growth(factor, offset + rounding * math.sqrt(0.5 / max(math.log(max(factor, 1.0)), LEAST_GROWTH)), doubt)


def _near_pole(scene: Scene, chart: str) -> bool:
    """Is the steady precession so near a pole with a stable rotation that nutations are followed in e_x, e_y?"""
    top, momenta = scene.top, scene.top.momenta(scene.start)
    theta, square = top.steady_theta(momenta), momenta.p_psi**2
    weight = 4.0 * top.I1 * (top.mgl if theta < 1.0 else -top.mgl)  # p_psi^2 at the threshold
    close = min(theta, math.pi - theta) < BESIDE_POLE
    return chart != "angles" and close and square - weight > MARGIN * max(square, weight)


def _run_pair(
    method: Integrator, scene: Scene, h: float, chart: str, nudge: float, stride: int, count: int = STEPS
) -> tuple[list[Run], np.ndarray, float]:
    """Two runs two nudges apart, half their difference every `stride` steps, the largest offset of their mean (rad)."""
    top, momenta = scene.top, scene.top.momenta(scene.start)
    theta, close = top.steady_theta(momenta), _near_pole(scene, chart)
    if close:
        tilt, spin = math.pi - nudge if theta > 1.0 else nudge, momenta.p_psi / top.I3
        pair = [Angles(tilt, phi, psi_dot=spin) for phi in (0.0, math.pi)]
    else:
        pair = [with_momenta(top, min(max(theta + side, nudge), math.pi - nudge), momenta) for side in (nudge, -nudge)]
    runs = [few_steps(method, chart, top, start, h, (count + WARM_UP) * stride) for start in pair]
    with np.errstate(all="ignore"):
        if close:
            first, second = (axis[:, 0] + 1j * axis[:, 1] for axis in (axis_of(chart, run.states) for run in runs))
        else:
            first, second = (np.asarray(View(chart, top, run.states).theta) for run in runs)
        offset = 0.0 if close else float(np.max(np.abs(0.5 * (first + second) - theta)))
        return runs, 0.5 * (first - second)[WARM_UP * stride :: stride], offset


def _root(delta: np.ndarray, limit: float) -> float:
    """The largest |root| of the two-term recurrence of `delta`; NaN if its relative residual exceeds `limit`."""
    if not np.isfinite(delta).all() or not delta.any():
        return math.nan
    matrix = np.stack([delta[1:-1], delta[:-2]], axis=1)
    t, minus_d = np.linalg.lstsq(matrix, delta[2:], rcond=None)[0]
    residual = np.max(np.abs(matrix @ np.array([t, minus_d]) - delta[2:])) / np.max(np.abs(delta))
    return float(np.max(np.abs(np.roots([1.0, -t, -minus_d])))) if residual < limit else math.nan
