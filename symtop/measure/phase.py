"""The error of a run split into an error of shape, a shift in time (nutation lag) and a turn (precession lag).

The height u = cos(theta) of the axis obeys u'^2 = (1 - u^2)(alpha - beta u) - (b - a u)^2, so (u, u'/omega), with
omega = 2 pi/T, runs round one closed curve, smooth even where the axis grazes a pole. From a sample (t; u, u', phi):

    tau             time at which the true motion is nearest to (u, u'/omega): Gauss-Newton from a table of one nutation
    shape           the distance at tau, in units of the axis's length: no shift in time and no turn removes it
    nutation lag    omega (tau - t), rad
    precession lag  sin(theta) (phi - phi_true(tau)), rad: how far the axis is turned about the vertical, lag apart

To first order the axis error is made of these three. If the run's mean frequencies are wrong by constants, then tau - t
= s t + ..., phi - phi_true(tau) = r t + ... and, with W the true mean precession,

    nutation period   |1/(1 + s) - 1|              precession rate   |W s + r| / |W|,

where s and r are slopes of least-squares lines over all samples, that of r weighted by sin^2(theta) because phi means
little near a pole. A steady precession has no nutation: its period and its nutation lag are NaN. Between samples the
nutation lag must change by less than half a nutation, or it is counted on the wrong branch; passing a pole on its right
and on its left are not distinguished. The shape error is not the error at equal times, which for a periodic motion is
mostly lag and grows with the horizon while the shape error does not.
"""

import functools
import math
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.core.numbers import EPSILON
from symtop.measure.verdicts import STEADY_WIDTH
from symtop.model.charts import Array
from symtop.model.scenes import Scene, closed_form
from symtop.model.top import Angles, SymmetricTop
from symtop.run.trajectory import Trajectory

FREQUENCIES = ("nutation_period", "precession_rate")  # relative errors of these
TABLE_POINTS = 256  # points of the true curve from which the search for tau starts
SWEEPS = 4  # iterations of Gauss-Newton: the error falls from 1e-2 to rounding in three
CLEAR_OF_POLE = 0.25  # of the largest sin(theta): nearer to a pole, the branch of phi is taken from the neighbours
LEAST_RATE = 1e-3  # of omega: errors of a slower mean precession are relative to this


class Split(NamedTuple):
    """Shape error, nutation lag (time, positive if early) and precession lag (of phi, rad) at every sample."""

    shape: Array
    lag: Array
    turn: Array


def _true_curve(scene: Scene, times: Array) -> tuple[Array, Array, Array, Array, Array]:
    """u, u', u'', phi and phi' of the true motion."""
    motion = closed_form(scene)(times)
    momenta, top = scene.top.momenta(scene.start), scene.top
    u, sine = np.cos(motion.theta), np.sin(motion.theta)
    a, b, beta = momenta.p_psi / top.I1, momenta.p_phi / top.I1, 2.0 * top.mgl / top.I1
    alpha = (2.0 * top.energy(scene.start) - momenta.p_psi**2 / top.I3) / top.I1
    bend = a * (b - a * u) - u * (alpha - beta * u) - 0.5 * beta * (1.0 - u * u)
    return u, -sine * motion.theta_dot, bend, motion.phi, motion.phi_dot


@functools.lru_cache(maxsize=64)
def _table(top: SymmetricTop, start: Angles) -> tuple[Array, Array, Array]:
    """Times over one nutation (n,), the true curve there (2, n), and half the squared norms of its points."""
    scene = Scene("table", top, start, 1.0)
    period = scene.nutation_period
    times = period * np.arange(TABLE_POINTS) / TABLE_POINTS
    u, du, *_ = _true_curve(scene, times)
    points = np.stack([u, du * period / (2.0 * math.pi)])
    return times, points, 0.5 * np.sum(points * points, axis=0)


def nutates(scene: Scene) -> bool:
    """Does the true motion have a nutation wider than `STEADY_WIDTH` and of finite period?"""
    low, high = closed_form(scene).theta_range
    return high - low > STEADY_WIDTH and math.isfinite(scene.nutation_period)


def split(scene: Scene, run: Trajectory) -> Split:
    """Shape error and lags at every sample (n,) of a run without failures."""
    return split_states(scene, run.time, np.cos(run.theta), -np.sin(run.theta) * run.p_theta / scene.top.I1, run.phi)


def split_states(scene: Scene, t: Array, u: Array, du: Array, phi: Array) -> Split:
    """Shape error and lags of states (n,), given by the times t, u = cos(theta), u' and phi."""
    period = scene.nutation_period
    omega = 2.0 * math.pi / period if math.isfinite(period) else 1.0
    if not nutates(scene):
        u_true, du_true, _, phi_true, _ = _true_curve(scene, t)
        return Split(np.hypot(u - u_true, (du - du_true) / omega), np.full(t.size, math.nan), phi - phi_true)
    times, points, halves = _table(scene.top, scene.start)
    w = du / omega
    nearest = np.argmin(halves - np.stack([u, w], axis=1) @ points, axis=1)  # |p - q|^2/2 without |q|^2/2
    lead = times[nearest] - t
    lead -= period * np.rint(lead / period)
    tau, correction = t + lead, np.zeros(t.size)
    for _ in range(SWEEPS):
        tau = tau + np.clip(correction, -period / 16.0, period / 16.0)
        u_true, du_true, bend, phi_true, rate = _true_curve(scene, tau)
        x, y, du_dtau, dw_dtau = u - u_true, w - du_true / omega, du_true, bend / omega
        correction = (x * du_dtau + y * dw_dtau) / (du_dtau * du_dtau + dw_dtau * dw_dtau)
    lag = (tau - t) + correction  # the last correction is not added to tau, whose last digit is too coarse for it
    turns = np.rint((np.unwrap(lag, period=period) - lag) / period)
    distance = np.abs(x * dw_dtau - y * du_dtau) / np.hypot(du_dtau, dw_dtau)
    turn = phi - phi_true - rate * correction - turns * closed_form(scene).phi_per_period
    # next to a pole phi may jump by pi, which would appear in the lag as whole turns
    sine = np.sqrt(np.maximum(1.0 - u_true * u_true, 0.0))
    usable = sine > CLEAR_OF_POLE * np.max(sine)
    guide = np.interp(t, t[usable], np.unwrap(turn[usable]))
    turn = turn - 2.0 * math.pi * np.rint((turn - guide) / (2.0 * math.pi))
    return Split(distance, lag + turns * period, turn)


def _slope(t: Array, values: Array, bound: Array, weights: Array) -> tuple[float, float]:
    """Weighted least-squares slope of the values, and the largest slope that errors within `bound` can cause."""
    middle = t - np.average(t, weights=weights)
    spread = np.sum(weights * middle * middle)
    return float(np.sum(weights * middle * values) / spread), float(np.sum(weights * np.abs(middle) * bound) / spread)


def phase(scene: Scene, run: Trajectory, truth: xr.Dataset) -> dict[str, float]:
    """Errors of the `FREQUENCIES` of a run and ``NAME_bound``; NaN if it failed or has fewer than three samples."""
    if run.outcome != "ok" or run.time.size < 3:
        return {f"{name}{end}": math.nan for end in ("", "_bound") for name in FREQUENCIES}
    form, t = closed_form(scene), run.time
    sine = np.maximum(np.sin(run.theta), EPSILON)
    with np.errstate(over="ignore", invalid="ignore"):  # a run may have blown up
        parts = split(scene, run)
    # on a separatrix the time scale is the length of the run, not `Scene.time_scale`
    period = scene.nutation_period if math.isfinite(scene.nutation_period) else float(t[-1])
    omega, swings = 2.0 * math.pi / period, nutates(scene)
    mean_rate = form.phi_per_period / form.nutation_period if math.isfinite(form.nutation_period) else 0.0
    scale = max(abs(mean_rate), LEAST_RATE * omega)
    radius = 0.5 * abs(math.cos(form.theta_range[0]) - math.cos(form.theta_range[1]))
    grain = truth["axis_error_bound"].values + 4.0 * EPSILON
    faster, error = 0.0, 0.0
    if swings:
        faster, error = _slope(t, parts.lag, grain / (radius * omega), np.ones(t.size))
        error += EPSILON
    drift, drift_error = _slope(t, parts.turn, grain / sine + EPSILON * np.abs(truth["phi"].values), sine * sine)
    drift_error += abs(mean_rate) * (error + EPSILON)
    return {
        "nutation_period": abs(1.0 / (1.0 + faster) - 1.0) if swings else math.nan,
        "precession_rate": abs(mean_rate * faster + drift) / scale,
        "nutation_period_bound": error if swings else math.nan,
        "precession_rate_bound": drift_error / scale + EPSILON,
    }
