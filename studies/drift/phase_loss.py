"""The time at which a phase error reaches a tolerance: predicted from a thousand nutations, and measured.

Each method gets a step of its own, chosen so that the phase error reaches `LOST` after a few thousand nutations: from
the frequency error that a few nutations show and the order that the method declares. A run of `SHORT` nutations then
predicts when the phase error reaches `LOST` (see `growth.horizon`), and a run a tenth longer than that measures it.
"""

import math

import numpy as np
import xarray as xr

from symtop.measure.settings import seek
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene
from symtop.run.simulation import simulate

from .growth import horizon, lost_at, nutation_phase

LOST = 1e-2  # rad
SHORT = 1000.0  # nutations of the run that predicts
TARGET = 2500.0  # nutations after which the phase error should reach `LOST`
MOST_STEPS = 3e7  # of the run that measures
TRIALS = 6
TRIAL = 40.0  # nutations
CLOSE = 0.8  # of `LOST`: a trial between it and `LOST` ends the search
FEWEST, MOST = 4.37, 8000.37  # steps a nutation
FIRST = {2: 1500.37, 4: 80.37, 6: 25.37}  # steps a nutation that are tried first, by order
SAMPLES = 2001


def phase_run(scene: Scene, method: Integrator, per_nutation: float, nutations: float) -> xr.Dataset:
    """Phase error (rad) of a run: dimension ``time``, variable ``phase``."""
    period = scene.nutation_period
    run = simulate(scene, method, step_size=period / per_nutation, horizon=nutations * period, samples=SAMPLES,
                   observe="nutation", guard=False)  # fmt: skip
    error = nutation_phase(scene, run["time"].values, run["theta"].values, run["p_theta"].values / scene.top.I1)
    return xr.Dataset({"phase": ("time", error)}, coords={"time": run["time"]}, attrs=run.attrs)


def steps_for(scene: Scene, method: Integrator, target: float) -> float:
    """Steps a nutation with which the phase error is `LOST` after `target` nutations, or up to a quarter more."""
    period, order = scene.nutation_period, method.order or 2

    def trial(step: float) -> tuple[float, float]:
        run = phase_run(scene, method, period / step, TRIAL)
        lost = abs(float(np.polyfit(run["time"] / period, run["phase"], 1)[0])) * target
        good = run.attrs["outcome"] == "ok" and math.isfinite(lost)
        return lost if good else math.inf, run.attrs["force_evaluations"]

    first, ends = period / FIRST.get(order, 12.37), (period / MOST, period / FEWEST)
    step, reason = seek(trial, first, LOST, ends, float(order), least=CLOSE)
    return MOST if reason else period / step


def phase_loss(
    scene: Scene, method: Integrator, short: float = SHORT, target: float = TARGET, most: float = MOST_STEPS
) -> xr.Dataset:
    """When the phase error of a fixed-step method reaches `LOST`: predicted from `short` nutations, and measured.

    The run that measures takes `most` steps at most. ``steps`` and force ``evaluations`` a nutation; in nutations,
    ``predicted``, the length ``short`` of the run that predicts, and ``measured``; ``ratio``, predicted over measured.
    If nothing can be predicted there are only ``steps``, ``predicted`` and ``short``.
    """
    period = scene.nutation_period
    steps = steps_for(scene, method, target)
    for _ in range(TRIALS):
        first = phase_run(scene, method, steps, short)
        predicted = horizon(first["time"], first["phase"], LOST).time / period
        if predicted > 2.0 * short or steps > MOST:
            break
        steps *= 1.3  # the frequency error itself drifts, and a few nutations do not show it
    if not math.isfinite(predicted):
        return xr.Dataset({"steps": steps, "predicted": predicted, "short": short})
    length = min(1.1 * predicted, most / steps)
    long = phase_run(scene, method, steps, length)
    evaluations = long.attrs["force_evaluations"] / length
    measured = lost_at(long["time"], long["phase"], LOST) / period
    return xr.Dataset(
        {
            "steps": steps, "evaluations": evaluations, "predicted": predicted, "short": short,
            "measured": measured, "ratio": predicted / measured,
        }
    )  # fmt: skip
