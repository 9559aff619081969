"""The horizon at which a phase is lost: foretold from a thousand nutations, and checked on a run that gets there.

Every method gets a step of its own, so that `LOST` of phase is lost after some thousand nutations: from the frequency
error that a few nutations show and the order that the method claims. Then one run of `SHORT` nutations foretells when
the phase error reaches `LOST` (see `growth.horizon`), and one a tenth longer than that shows when it did.
"""

import math

import numpy as np
import xarray as xr

from symtop.measure.clock import Clock
from symtop.measure.growth import growth, horizon, lost_at
from symtop.methods.registry import Integrator
from symtop.model.scenes import Scene
from symtop.run.simulation import simulate

LOST = 1e-2  # rad
SHORT = 1000.0  # nutations that foretell
TARGET = 2500.0  # nutations that the loss is meant to take
LONGEST = 3e7  # steps
TRIALS = 6
TRIAL = 40.0  # nutations
FEWEST, MOST = 4.37, 8000.37  # steps a nutation
FIRST = {2: 1500.37, 4: 80.37, 6: 25.37}
SAMPLES = 2001


def phase_run(where: Scene, method: Integrator, clock: Clock, per_nutation: float, nutations: float) -> xr.Dataset:
    """Phase error (rad) of a run: dimension ``time``, variable ``phase``."""
    period = where.nutation_period
    run = simulate(where, method, step_size=period / per_nutation, horizon=nutations * period, samples=SAMPLES,
                   observe="nutation", guard=False)  # fmt: skip
    error = clock.error(run["time"].values, run["theta"].values, run["p_theta"].values / where.top.I1)
    return xr.Dataset({"phase": ("time", error)}, coords={"time": run["time"]}, attrs=run.attrs)


def steps_for(where: Scene, method: Integrator, clock: Clock, target: float) -> float:
    """Steps a nutation with which about `LOST` of phase is gone after `target` nutations."""
    order = method.order or 2
    steps = FIRST.get(order, 12.37)
    for _ in range(TRIALS):
        run = phase_run(where, method, clock, steps, TRIAL)
        gone = abs(float(np.polyfit(run["time"] / where.nutation_period, run["phase"], 1)[0])) * target
        if run.attrs["outcome"] != "ok" or not math.isfinite(gone):
            steps *= 2.0
            continue
        factor = (gone / LOST) ** (1.0 / order)
        steps = min(max(steps * min(max(factor, 0.4), 4.0), FEWEST), MOST)
        if 0.85 < factor < 1.2:
            break
    return steps


def lost_phase(where: Scene, method: Integrator, short: float = SHORT, target: float = TARGET) -> xr.Dataset:
    """When a fixed-step method loses `LOST` of phase: foretold from `short` nutations and measured; in nutations.

    Dimension ``horizon_sample``: ``horizon_nutations`` and ``horizon_phase`` of the long run. ``phase_exponent`` is
    fitted to the last decade of it.
    """
    clock, period = Clock(where), where.nutation_period
    steps = steps_for(where, method, clock, target)
    for _ in range(TRIALS):
        first = phase_run(where, method, clock, steps, short)
        foretold = horizon(first["time"], first["phase"], LOST)
        predicted = foretold.time / period
        if predicted > 2.0 * short or steps > MOST:
            break
        steps *= 1.3  # the drift of a drift: what a few nutations show is not all
    found: dict[str, object] = {"horizon_steps": steps, "horizon_predicted": predicted, "horizon_short": short}
    if math.isfinite(predicted):
        long = phase_run(where, method, clock, steps, min(1.1 * predicted, LONGEST / steps))
        fit = growth(long["time"], long["phase"], 1.0)
        measured = lost_at(long["time"], long["phase"], LOST) / period
        found |= {
            "horizon_measured": measured,
            "horizon_ratio": predicted / measured,
            "horizon_nutations": ("horizon_sample", long["time"].values / period),
            "horizon_phase": ("horizon_sample", long["phase"].values),
            "horizon_exponent": fit.slope,
            "horizon_exponent_interval": fit.interval,
        }
    return xr.Dataset(found)
