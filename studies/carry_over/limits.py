"""Linear limits and resonances of steps near a steady rotation, and the maps of engines.

A body upright on its third axis, with the centre of mass on it, turns steadily about the vertical, at the rate w,
whatever its moments. Half a turn about that axis changes nothing, so that small displacements y = (Gamma_1, Gamma_2,
M_1, M_2) decouple from the rest; with s = mgl

    Gamma_1' =  w Gamma_2 - M_2/I2       M_1' = s Gamma_2 + (1 - I3/I2) w M_2
    Gamma_2' = -w Gamma_1 + M_1/I1       M_2' = -s Gamma_1 - (1 - I3/I1) w M_1

Its frequencies are those in the axes of the body: the fastest is omega. A step from attitudes of length one maps y to
y', with Gamma brought to length one. By that half turn y' is odd in y, so that y' of a small y over its size is a
slope to second order; y grows where the spectral radius of the slopes is above one.

    limit        least h omega at which a displacement grows by `GROWING` a step, or a step fails, found on a grid and
                 by bisection; NaN if there is none up to `MOST`; 0 for a rotation that is itself unstable
    grown        share of steps below that limit (below `MOST` without one) at which a tilt of `TILT` grows to `FACTOR`
                 times the sum of the amplitudes of its small oscillations
    error, lost  of engines' maps: largest error of the axis, rad, and whether it is above `WRONG` in the first period

Source: Routh, Advanced Dynamics of a System of Rigid Bodies, section 214 (the sleeping body); Hairer, Lubich, Wanner,
Geometric Numerical Integration, section X.6 (resonance).
"""

import math
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from symtop_studies.cost.ladder import WRONG
from symtop_studies.cost.tops import FIRST
from symtop_studies.stability.linear_limits import GROWING

from symtop.methods.framework.registry import Integrator
from symtop.model.body import vertical
from symtop.model.charts import BODY, Array

from .bodies import CHAOTIC, FAMILIES, FREE, Bodies, run_level

MOST = 10.0  # rad; h omega of the longest step
BISECTIONS = 20
NUDGE = 1e-5  # displacement of Gamma, and of M relative to its size
SHORTEST = 0.1  # rad, the first h omega of the grid: below it a growth by `GROWING` needs an order below two
TILT, FACTOR = 0.05, 2.0  # rad
STEPS = 300
UNSTABLE = 1e-9  # growth rate of the motion itself over omega, from which on a rotation counts as unstable
LEVELS = (6, 8)  # of the ladder: 70 and 280 steps a period
STEADY = tuple(name for name in FAMILIES if name != CHAOTIC)


class Upright(NamedTuple):
    """Bodies upright on their third axis that turn about it."""

    moments: Array  # (n, 3)
    weight: Array  # (n,) mgl
    spin: Array  # (n,) w

    @property
    def slopes(self) -> Array:
        """The matrix A of y' = A y, (n, 4, 4)."""
        (I1, I2, I3), w, s = self.moments.T, self.spin, self.weight
        matrix = np.zeros((len(w), 4, 4))
        matrix[:, 0, 1], matrix[:, 0, 3], matrix[:, 1, 0], matrix[:, 1, 2] = w, -1.0 / I2, -w, 1.0 / I1
        matrix[:, 2, 1], matrix[:, 2, 3], matrix[:, 3, 0], matrix[:, 3, 2] = s, (1 - I3 / I2) * w, -s, (I3 / I1 - 1) * w
        return matrix

    def rows(self, y: Array) -> Array:
        """Bodies and starts as `RigidBody.flat` has them, (n, k, 14), of displacements y (n, k, 4)."""
        n, k, _ = y.shape
        tilt = np.arcsin(np.minimum(np.hypot(y[..., 0], y[..., 1]), 1.0))
        across = np.sin(0.5 * tilt) / np.where(tilt > 0.0, np.sin(tilt), 1.0)
        rows = np.zeros((n, k, 14))
        rows[..., :3], rows[..., 3], rows[..., 6] = self.moments[:, np.newaxis], self.weight[:, np.newaxis], 1.0
        # Gamma = q* k q, with q turned about the horizontal axis (Gamma_2, -Gamma_1, 0)
        rows[..., 7], rows[..., 8], rows[..., 9] = np.cos(0.5 * tilt), across * y[..., 1], -across * y[..., 0]
        rows[..., 11:13] = y[..., 2:] / self.moments[:, np.newaxis, :2]
        rows[..., 13] = self.spin[:, np.newaxis]
        return rows


def upright(family: str, count: int, seed: int) -> Upright:
    """The steady bodies of a family; the same draws for each."""
    u = np.random.default_rng(seed).uniform(size=(4, count))
    epsilon = 2.0 ** (-7.0 + 6.0 * u[3]) if family == FREE else float(family)
    oblate = np.arange(count) % 2 == 1
    third = np.where(oblate, 1.4 + 0.4 * u[0], 0.3 + 0.4 * u[0])
    second = np.minimum(1.0 + epsilon * (0.5 + 0.5 * u[1]), np.where(oblate, 0.95 * third, 0.99 * (1.0 + third)))
    weight = np.full(count, 0.0 if family == FREE else 1.0)
    return Upright(np.stack([np.ones(count), second, third], axis=1), weight, (1.5 + 2.5 * u[2]) * 2.0 / third)


def displaced(variant: Integrator, rows: Array, h: Array, marks: NDArray[np.int64]) -> Array:
    """y at the marks of runs of rows (m, 14) by steps h (m,), (m, marks, 4); NaN after a failure."""
    all_marks = np.broadcast_to(marks, (len(h), marks.size)).copy()
    states = variant.solvers[BODY].many(rows, h, all_marks).states  # type: ignore[attr-defined]
    with np.errstate(all="ignore"):  # a run may have blown up
        up = np.stack(vertical(*np.moveaxis(states[..., :4], -1, 0)), axis=-1)
        up = up / np.linalg.norm(up, axis=-1, keepdims=True)
        tilt = np.where(up[..., 2:] < 0.0, 2.0 * np.sign(up[..., :2]), up[..., :2])  # beyond the horizontal
        return np.concatenate([tilt, states[..., 4:6]], axis=-1)


def radius(variant: Integrator, bodies: Upright, h: Array) -> Array:
    """Spectral radius of the linearised steps h (n, k), k for each body; infinite where a step fails."""
    n, k = h.shape
    momentum = bodies.moments[:, 2] * np.abs(bodies.spin) + np.sqrt(np.abs(bodies.weight) * bodies.moments[:, 0])
    size = np.stack([np.ones(n), np.ones(n), momentum, momentum], axis=1)
    shifts = NUDGE * size[:, :, np.newaxis] * np.eye(4)  # (n, displacement, 4)
    many = np.repeat(bodies.rows(shifts), k, axis=0).reshape(-1, 14)
    ends = displaced(variant, many, np.repeat(h.ravel(), 4), np.array([1]))[:, 0].reshape(n, k, 4, 4)
    slopes = np.swapaxes(ends, -1, -2) / NUDGE  # (n, k, y', displacement)
    slopes /= size[:, np.newaxis, :, np.newaxis]
    good = np.isfinite(slopes).all(axis=(-1, -2))
    values = np.abs(np.linalg.eigvals(np.where(good[..., np.newaxis, np.newaxis], slopes, 0.0))).max(axis=-1)
    return np.where(good, values, np.inf)


def limits(variant: Integrator, bodies: Upright, omega: Array, grid: float) -> Array:
    """Least h omega at which a displacement grows, (n,), by a grid of that spacing; NaN if none up to `MOST` does."""
    phases = np.arange(SHORTEST, MOST + 0.5 * grid, grid)
    grows = radius(variant, bodies, phases / omega[:, np.newaxis]) > 1.0 + GROWING
    first = np.argmax(grows, axis=1)
    low, high = phases[np.maximum(first - 1, 0)], phases[first]
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        beyond = radius(variant, bodies, (middle / omega)[:, np.newaxis])[:, 0] > 1.0 + GROWING
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    return np.where(grows.any(axis=1), high, np.nan)


def reach(bodies: Upright, y: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """omega, the largest tilt of small oscillations from y (n, 4), and whether the rotation is stable, each (n,)."""
    values, modes = np.linalg.eig(bodies.slopes)
    parts = np.linalg.solve(modes, y[..., np.newaxis].astype(complex))[..., 0]
    ways = modes[:, :2] * parts[:, np.newaxis]  # Gamma of each mode, whose real part runs round an ellipse
    squares = np.sum(np.abs(ways) ** 2, axis=1) + np.abs(np.sum(ways * ways, axis=1))  # 2 (its longer half axis)^2
    tilt = np.sqrt(0.5 * squares).sum(axis=1)
    omega = np.abs(values.imag).max(axis=1)
    return omega, tilt, np.abs(values.real).max(axis=1) < UNSTABLE * omega


def grown(variant: Integrator, bodies: Upright, h: Array, y: Array, tilt: Array) -> NDArray[np.bool_]:
    """Which steps h (n, k) take a tilt of y (n, 4) more than `FACTOR` times as far as `tilt` (n,)."""
    rows = np.repeat(bodies.rows(y[:, np.newaxis])[:, 0], h.shape[1], axis=0)
    out = displaced(variant, rows, h.ravel(), np.arange(1, STEPS + 1))
    far = np.hypot(out[..., 0], out[..., 1]).max(axis=1).reshape(h.shape)
    return ~(far <= FACTOR * tilt[:, np.newaxis])


def steady_table(variant: Integrator, count: int, seed: int, grid: float, places: int) -> xr.Dataset:
    """Limits and shares of grown steps of a method, by family and member."""
    table = np.full((2, len(STEADY), count), np.nan)
    turn = 2.0 * math.pi * np.random.default_rng(seed + 1).uniform(size=count)
    y = TILT * np.stack([np.cos(turn), np.sin(turn), 0.0 * turn, 0.0 * turn], axis=1)
    for row, family in enumerate(STEADY):
        bodies = upright(family, count, seed)
        omega, tilt, stable = reach(bodies, y)
        limit = limits(variant, bodies, omega, grid)
        h = np.where(np.isnan(limit), MOST, limit)[:, np.newaxis] * (np.arange(places) + 0.5) / places
        share = grown(variant, bodies, h / omega[:, np.newaxis], y, tilt).mean(axis=1)
        table[:, row] = np.where(stable, limit, 0.0), np.where(stable, share, np.nan)
    dims = ("family", "member")
    data: dict[str, Any] = {"limit": (dims, table[0]), "grown": (dims, table[1]), "grid": ((), grid)}
    return xr.Dataset(data, {"family": list(STEADY)})


def engine_table(variant: Integrator, families: dict[str, Bodies]) -> xr.Dataset:
    """The largest error of the axis, and whether it is above `WRONG` in the first period, by family, level, member."""
    count = len(next(iter(families.values())).period)
    table = np.full((2, len(families), len(LEVELS), count), np.nan)
    for row, bodies in enumerate(families.values()):
        known = np.flatnonzero(bodies.known)
        early = bodies.times[known] <= bodies.period[known, np.newaxis]
        for place, level in enumerate(LEVELS):
            run = run_level(variant, bodies, known, level, math.inf)
            error = bodies.errors_at(run.states, known)["axis"]
            table[0, row, place, known] = error.max(axis=1)
            table[1, row, place, known] = np.where(early, error, 0.0).max(axis=1) > WRONG
    dims = ("family", "steps", "member")
    return xr.Dataset({"error": (dims, table[0]), "lost": (dims, table[1])},
                      {"family": list(families), "steps": [FIRST * 2**level for level in LEVELS]})  # fmt: skip
