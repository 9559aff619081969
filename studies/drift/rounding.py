"""Round-off over many steps: how the modified energy of an ensemble wanders off, and what plain sums would do.

Every member starts a hundredth of a radian from the one before; its step is the same fraction of its own nutation.
Drift is the mean modified energy of a window less that of the first window of a long run (see `shadow`, `longrun`; its
level is fitted to 4096 samples there), relative to the energy's scale. The best that can be had is Brouwer's law, a
root mean square that grows as n^1/2, where n is counted so that it does exactly that for a walk of independent steps:
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

SPACING = 0.01  # rad
PLAIN = 8  # members with plain sums, for comparison


def members(where: Scene, count: int) -> list[Scene]:
    """The scene itself and its neighbours, each `SPACING` further down."""
    number = whole("members", count, 1)
    starts = [replace(where.start, theta=where.start.theta + SPACING * k) for k in range(number)]
    return [Scene(f"{where.name}-{k}", where.top, start, where.horizon) for k, start in enumerate(starts)]


def elapsed(ends: np.ndarray) -> np.ndarray:
    """Steps of a walk that lie between the mean over the first window and those over the others; NaN for the first."""
    n, begins = np.asarray(ends, float), np.concatenate([[np.nan], np.asarray(ends, float)[:-1]])
    steps: np.ndarray = begins + (n - begins) / 3.0 - 2.0 * n[0] / 3.0
    return steps


def round_off(where: Scene, method: Integrator, steps: int, per_nutation: float, count: int) -> xr.Dataset:
    """Drift of the modified energy of `count` starts over `steps` steps, and of at most `PLAIN` with plain sums.

    Dimensions ``member``, ``plain_member`` and ``rounding_window``, with ``rounding_elapsed`` steps (see `elapsed`).
    ``rounding`` and ``rounding_plain`` hold drifts, ``..._rms`` their root mean square, ``..._exponent`` its growth
    with ``..._exponent_interval`` (95 %) from as many steps on as the first window has, ``..._end`` its last value;
    ``rounding_gain`` is how much less those drift that were run with both, in the last decade of steps, because at one
    moment a walk may be anywhere;
    ``rounding_p_phi`` and ``rounding_p_psi`` the largest change of a momentum with compensated sums.
    """
    found: dict[str, Any] = {}
    for name, compensated, many in (("rounding", True, count), ("rounding_plain", False, min(PLAIN, count))):
        runs = [
            long_run(
                one,
                method,
                steps=steps,
                step_size=one.nutation_period / per_nutation,
                compensated=compensated,
                quiet=True,
            )
            for one in members(where, many)
        ]
        ends = runs[0]["steps"].values
        drifts = np.stack([run["modified_energy_mean"].values for run in runs])
        grown = ensemble_growth(elapsed(ends), drifts, ends[0])
        found["rounding_elapsed"] = ("rounding_window", elapsed(ends))
        found[name] = (("member" if compensated else "plain_member", "rounding_window"), drifts)
        found[f"{name}_rms"] = ("rounding_window", grown.rms)
        found[f"{name}_exponent"], found[f"{name}_exponent_interval"] = grown.fit.slope, grown.fit.interval
        found[f"{name}_end"] = float(grown.rms[-1])
        if compensated:
            for momentum in ("p_phi", "p_psi"):
                changes = [np.abs(run[f"{momentum}_{part}"].values) for run in runs for part in ("least", "largest")]
                found[f"rounding_{momentum}"] = float(np.max(changes))
    late = found["rounding_elapsed"][1] > 0.1 * found["rounding_elapsed"][1][-1]
    walked = [np.mean(found[name][1][:PLAIN, late] ** 2) for name in ("rounding_plain", "rounding")]
    found["rounding_gain"] = float(np.sqrt(walked[0] / walked[1]))
    return xr.Dataset(found)
