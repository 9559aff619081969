"""Long runs: histories of every method, and windows and ensembles of the four whose modified energy is known.

`rounding` measures how rounding changes the modified energy of an ensemble, with compensated and with plain sums. Each
member starts a hundredth of a radian from the one before; its step is the same fraction of its own nutation. Drift is
the mean modified energy of a window less that of the first window of a long run (see `modified_energy` and `long_run`;
its level is fitted to 4096 samples there), relative to the energy's scale. The best that can be had is Brouwer's law: a
root mean square that grows as n^1/2. For a walk of independent steps it does exactly that if n is counted as follows:
between its means over (0, c] and over (a, b], a >= c, such a walk has the variance of n = a + (b - a)/3 - 2c/3 steps.

Reference: Hairer, McLachlan, Razakarivony, BIT 48 (2008) 231.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import xarray as xr

from symtop.core.errors import whole
from symtop.methods.framework.loop import Loop
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene
from symtop.model.top import flat
from symtop.run.long_run import (
    QUANTITIES,
    Gauge,
    chart_of,
    gauge_of,
    long_run,
    scattered,
    summary,
    windows as windows_until,
)

from .growth import ensemble_growth, history

SPACING = 0.01  # rad, between the starts of an ensemble
MEAN = 2  # place of the mean among least, largest and mean
PLAIN_MEMBERS = 8  # members that run with plain sums as well, for comparison


def windows(scene: Scene, method: Integrator, steps: int, per_nutation: float) -> xr.Dataset:
    """The windows of one long run (see `long_run`): ``steps``, ``energy_least``, ...; it resumes from a checkpoint."""
    h = scene.nutation_period / per_nutation
    return long_run(scene, method, steps=steps, step_size=h, checkpoint=True, quiet=True).drop_attrs()


def members(scene: Scene, count: int) -> list[Scene]:
    """The scene itself and its neighbours, each `SPACING` further down."""
    number = whole("members", count, 1)
    starts = [replace(scene.start, theta=scene.start.theta + SPACING * k) for k in range(number)]
    return [Scene(f"{scene.name}-{k}", scene.top, start, scene.horizon) for k, start in enumerate(starts)]


def gauges_of(scenes: Sequence[Scene], method: Integrator, per_nutation: float) -> list[Gauge]:
    """The gauge of each long run, fitted to its beginning; the same for compensated and for plain sums."""
    return [gauge_of(scene, method, scene.nutation_period / per_nutation) for scene in scenes]


def side_by_side(
    scenes: Sequence[Scene], gauges: Sequence[Gauge], method: Integrator, steps: int, per_nutation: float, *,
    compensated: bool,
) -> tuple[np.ndarray, dict[str, np.ndarray]]:  # fmt: skip
    """Long runs of one method in one call, in lanes where its sums have them; each has the bits of `long_run`.

    Each scene has its gauge. The steps at which windows end (windows,), and the least, largest and mean (members,
    windows, 3) of the quantities.
    """
    _, solver = chart_of(method)
    if not compensated:
        assert isinstance(solver.loop, Loop)  # noqa: S101
        solver = replace(solver, loop=solver.loop.plain)
    h = np.array([scene.nutation_period / per_nutation for scene in scenes])
    ends = windows_until(steps)
    stretches = [scattered(begin, end) for begin, end in pairwise([0, *ends])]
    marks, cuts = np.concatenate(stretches), np.cumsum([0, *map(len, stretches)])
    run = solver.many(np.array([flat(scene.top, scene.start) for scene in scenes]), h, np.tile(marks, (len(scenes), 1)))
    rows = np.empty((len(scenes), len(ends), len(QUANTITIES), 3))
    for i, gauge in enumerate(gauges):
        for k, (first, last) in enumerate(pairwise(cuts)):
            part = gauge(run.states[i, first:last], run.momenta[i, first:last], shown=True)
            rows[i, k] = np.reshape(summary(part), (-1, 3))
    return np.array(ends, dtype=float), {name: rows[:, :, q] for q, name in enumerate(QUANTITIES)}


def elapsed_steps(ends: np.ndarray) -> np.ndarray:
    """Steps of a walk that lie between the mean over the first window and those over the others; NaN for the first."""
    n, begins = np.asarray(ends, float), np.concatenate([[np.nan], np.asarray(ends, float)[:-1]])
    steps: np.ndarray = begins + (n - begins) / 3.0 - 2.0 * n[0] / 3.0
    return steps


def rounding(scene: Scene, method: Integrator, steps: int, per_nutation: float, count: int) -> xr.Dataset:
    """Drift of the modified energy of `count` starts over `steps` steps, and of `PLAIN_MEMBERS` with plain sums.

    Dimension ``window``: ``elapsed`` (see `elapsed_steps`), ``drift`` (member, window), its root mean square ``rms``
    over the members; ``end``, the last rms, and the ``exponent`` of its growth, fitted from the end of the first window
    on, with ``exponent_interval``; each of these again as ``plain_drift``, ... with plain sums. ``p_phi`` and ``p_psi``
    are the largest relative changes with compensated sums. ``late`` and ``plain_late`` are the rms over the last decade
    of steps, as a single value of a random walk says little, of the members that ran with both sums; ``gain`` is their
    ratio. All statements on the gain of compensated sums use these three.
    """
    columns: dict[str, Any] = {}
    scenes = members(scene, count)
    gauges = gauges_of(scenes, method, per_nutation)
    for prefix, compensated, many in (("", True, count), ("plain_", False, PLAIN_MEMBERS)):
        chosen = scenes[:many], gauges[:many]
        ends, quantities = side_by_side(*chosen, method, steps, per_nutation, compensated=compensated)
        elapsed, drifts = elapsed_steps(ends), quantities["modified_energy"][..., MEAN]
        grown = ensemble_growth(elapsed, drifts, ends[0])
        columns["elapsed"] = ("window", elapsed)
        columns[f"{prefix}drift"] = ((f"{prefix}member", "window"), drifts)
        columns[f"{prefix}rms"] = ("window", grown.rms)
        columns[f"{prefix}end"] = float(grown.rms[-1])
        columns[f"{prefix}exponent"], columns[f"{prefix}exponent_interval"] = grown.fit.slope, grown.fit.interval
        for momentum in ("p_phi", "p_psi") if compensated else ():
            columns[momentum] = float(np.abs(quantities[momentum]).max())
    late = elapsed > 0.1 * elapsed[-1]
    for prefix in ("", "plain_"):
        walks = columns[f"{prefix}drift"][1][:PLAIN_MEMBERS, late]
        columns[f"{prefix}late"] = float(np.sqrt(np.mean(walks**2)))
    return xr.Dataset({**columns, "gain": columns["plain_late"] / columns["late"]})


def run_history(
    scene: Scene, method: Integrator, *, horizon: float, samples: int, step_size: float | None = None,
    tolerance: float | None = None,
) -> xr.Dataset:  # fmt: skip
    """The dataset of `history`, with ``nutations``, ``steps_a_nutation`` and ``tolerance`` of the run.

    The last two are NaN for a method without them; ``own_tolerance`` is true for one that ran at its own default.
    """
    args: dict[str, Any] = {"step_size": step_size, "tolerance": tolerance}
    data = history(scene, method, horizon=horizon, samples=samples, **{k: v for k, v in args.items() if v is not None})
    used = method.check_tolerance(tolerance) if method.adaptive else math.nan
    return data.assign(
        nutations=horizon / scene.nutation_period,
        steps_a_nutation=scene.nutation_period / step_size if step_size else math.nan,
        tolerance=used,
        own_tolerance=float(method.adaptive and tolerance is None),
    )
