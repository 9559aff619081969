"""Round-off over many steps: how the modified energy of an ensemble wanders off, and what plain sums would do.

Every member starts a hundredth of a radian from the one before; its step is the same fraction of its own nutation.
Drift is the change of the mean modified energy of a window (see `shadow`, `longrun`), relative to the energy. The best
that can be had is Brouwer's law, a root mean square that grows as n^1/2.
Reference: Hairer, McLachlan, Razakarivony, BIT 48 (2008) 231.
"""

from dataclasses import replace

import numpy as np
import xarray as xr

from symtop.checks import whole
from symtop.integrators.registry import Integrator
from symtop.measure.growth import ensemble_growth
from symtop.measure.longrun import long_run
from symtop.scenes import Scene

SPACING = 0.01  # rad
SETTLED = 2.0  # the first windows compare a mean with itself: growth is fitted from this many of them on


def members(where: Scene, count: int) -> list[Scene]:
    """The scene itself and its neighbours, each `SPACING` further down."""
    number = whole("members", count, 1)
    starts = [replace(where.start, theta=where.start.theta + SPACING * k) for k in range(number)]
    return [Scene(f"{where.name}-{k}", where.top, start, where.horizon) for k, start in enumerate(starts)]


def round_off(where: Scene, method: Integrator, steps: int, per_nutation: float, count: int) -> xr.Dataset:
    """Drift of the modified energy of `count` starts over `steps` steps, with compensated and with plain sums.

    Dimensions ``member`` and ``rounding_window``. ``rounding`` and ``rounding_plain`` hold drifts, ``..._rms`` their
    root mean square, ``..._exponent`` its growth with ``..._exponent_interval`` (95 %), ``..._end`` its last value;
    ``rounding_p_phi`` and ``rounding_p_psi`` the largest change of a momentum with compensated sums.
    """
    found: dict[str, object] = {}
    for name, compensated in (("rounding", True), ("rounding_plain", False)):
        runs = [
            long_run(
                one,
                method,
                steps=steps,
                step_size=one.nutation_period / per_nutation,
                compensated=compensated,
                quiet=True,
            )
            for one in members(where, count)
        ]
        ends = runs[0]["steps"].values
        drifts = np.stack([run["modified_energy_mean"].values for run in runs])
        grown = ensemble_growth(ends, drifts, SETTLED * ends[0])
        found["rounding_steps"] = ("rounding_window", ends)
        found[name] = (("member", "rounding_window"), drifts)
        found[f"{name}_rms"] = ("rounding_window", grown.rms)
        found[f"{name}_exponent"], found[f"{name}_exponent_interval"] = grown.fit.slope, grown.fit.interval
        found[f"{name}_end"] = float(grown.rms[-1])
        if compensated:
            for momentum in ("p_phi", "p_psi"):
                changes = [np.abs(run[f"{momentum}_{part}"].values) for run in runs for part in ("least", "largest")]
                found[f"rounding_{momentum}"] = float(np.max(changes))
    return xr.Dataset(found)
