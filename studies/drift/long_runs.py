"""Long runs of the four methods whose modified energy is known: windows of one, and rounding in an ensemble of them.

`rounding` shows how the modified energy of an ensemble wanders off by rounding, and what plain sums would do. Each
member starts a hundredth of a radian from the one before; its step is the same fraction of its own nutation. Drift is
the mean modified energy of a window less that of the first window of a long run (see `modified_energy` and `long_run`;
its level is fitted to 4096 samples there), relative to the energy's scale. The best that can be had is Brouwer's law: a
root mean square that grows as n^1/2. For a walk of independent steps it does exactly that if n is counted as follows:
between its means over (0, c] and over (a, b], a >= c, such a walk has the variance of n = a + (b - a)/3 - 2c/3 steps.

Reference: Hairer, McLachlan, Razakarivony, BIT 48 (2008) 231.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from symtop.base.validate import whole
from symtop.measure.growth import ensemble_growth
from symtop.methods.registry import Integrator
from symtop.model.scenes import Scene
from symtop.run.long_run import long_run

SPACING = 0.01  # rad, between the starts of an ensemble
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


def elapsed_steps(ends: np.ndarray) -> np.ndarray:
    """Steps of a walk that lie between the mean over the first window and those over the others; NaN for the first."""
    n, begins = np.asarray(ends, float), np.concatenate([[np.nan], np.asarray(ends, float)[:-1]])
    steps: np.ndarray = begins + (n - begins) / 3.0 - 2.0 * n[0] / 3.0
    return steps


def rounding(scene: Scene, method: Integrator, steps: int, per_nutation: float, count: int) -> xr.Dataset:
    """Drift of the modified energy of `count` starts over `steps` steps, and of `PLAIN_MEMBERS` with plain sums.

    Dimension ``window``: ``elapsed`` (see `elapsed_steps`), ``drift`` (member, window), its root mean square ``rms``
    over the members; ``end``, the last rms, and the ``exponent`` of its growth, fitted from as many steps on as the
    first window has, with ``exponent_interval``; each of these again as ``plain_drift``, ... with plain sums. ``p_phi``
    and ``p_psi`` are the largest relative changes with compensated sums. ``late`` and ``plain_late`` are the rms over
    the last decade of steps, because at one moment a walk may be anywhere, of the members that ran with both sums;
    ``gain`` is their ratio. All that is said of what compensated sums gain rests on these three.
    """
    columns: dict[str, Any] = {}
    for prefix, compensated, many in (("", True, count), ("plain_", False, min(PLAIN_MEMBERS, count))):
        runs = [
            long_run(member, method, steps=steps, step_size=member.nutation_period / per_nutation,
                     compensated=compensated, quiet=True)
            for member in members(scene, many)
        ]  # fmt: skip
        ends = runs[0]["steps"].values
        elapsed, drifts = elapsed_steps(ends), np.stack([run["modified_energy_mean"].values for run in runs])
        grown = ensemble_growth(elapsed, drifts, ends[0])
        columns["elapsed"] = ("window", elapsed)
        columns[f"{prefix}drift"] = ((f"{prefix}member", "window"), drifts)
        columns[f"{prefix}rms"] = ("window", grown.rms)
        columns[f"{prefix}end"] = float(grown.rms[-1])
        columns[f"{prefix}exponent"], columns[f"{prefix}exponent_interval"] = grown.fit.slope, grown.fit.interval
        for momentum in ("p_phi", "p_psi") if compensated else ():
            changes = [np.abs(run[f"{momentum}_{part}"].values) for run in runs for part in ("least", "largest")]
            columns[momentum] = float(np.max(changes))
    late = elapsed > 0.1 * elapsed[-1]
    for prefix in ("", "plain_"):
        walks = columns[f"{prefix}drift"][1][:PLAIN_MEMBERS, late]
        columns[f"{prefix}late"] = float(np.sqrt(np.mean(walks**2)))
    return xr.Dataset({**columns, "gain": columns["plain_late"] / columns["late"]})
