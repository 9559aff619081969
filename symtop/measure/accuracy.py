"""Error against step or tolerance: the table that convergence and work-precision studies are made of.

The largest error over a run is the largest at its samples. Over ten nutations `SAMPLES` of them miss no peak; over a
thousand there is about one per nutation, and if all fall at nearly the same phase, they miss the peaks for as long as
the phase takes to drift: 331 even samples read up to 20 % too little. Five or six a nutation miss peaks as well, of the
energy next to a pole by 36 %. `enough_samples` chooses the number of samples so that a stride is a whole number of
nutations plus a golden section of one, or, where it is less than half a nutation, a nutation is so many strides. Any
few consecutive samples then cover all phases. Angles are within 5 % of the largest error of a densely sampled run (4385
runs); so is the energy in 99 % of runs. The others are in angles and next to a pole, where the energy is wrong for one
to four steps at the closest approach, less than the distance of the phases; on (e, L) an error stays after a passage.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from symtop.core.numbers import GOLDEN
from symtop.measure.errors import QUANTITIES, error_bound, errors_against
from symtop.measure.phase import phase
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene
from symtop.run.reference.truth import reference
from symtop.run.simulation import integrate

SAMPLES = 1001
DENSE_SAMPLES = 20.0  # samples per nutation above which the phase of the samples does not matter
GOLDEN_CLOSE = 0.01  # largest distance of an accepted stride, or of an accepted number of them, from the golden section
NO_FINER_AFTER = {"compiled": 1e9, "python": 2e4}  # after a run with more force evaluations no finer setting is run
COUNTS = ("step_size", "tolerance", "steps", "force_evaluations", "newton_iterations", "outcome", "reached_time")


def enough_samples(scene: Scene, horizon: float) -> int:
    """The number of equidistant samples from which the largest error of an angle over a run is read to 5 %."""
    period = scene.nutation_period
    if not math.isfinite(period) or SAMPLES * period > DENSE_SAMPLES * horizon:
        return SAMPLES
    counts = np.arange(SAMPLES, 2 * SAMPLES)
    stride = horizon / (counts - 1) / period
    phase = np.mod(np.where(stride < 0.5, 1.0 / stride, stride), 1.0)
    gap = np.minimum(np.abs(phase - GOLDEN), np.abs(phase - 1.0 + GOLDEN))
    return int(counts[np.argmax(gap < GOLDEN_CLOSE) if (gap < GOLDEN_CLOSE).any() else np.argmin(gap)])


def error_table(
    scene: Scene, method: Integrator, settings: Sequence[float], horizon: float, observe: str | None = None
) -> xr.Dataset:
    """Largest and final error of every quantity at each setting, with the work and the outcome of the run.

    Dimension ``setting``. ``axis`` ... hold the maximum over the run, ``axis_end`` ... the error at the horizon,
    ``axis_bound`` ... the least error that the reference can judge (its own bound plus rounding).
    """
    rows: list[dict[str, float | str]] = []
    stop = False
    for setting in settings:
        rows.append(blank_row(method) if stop else error_row(scene, method, setting, horizon, observe))
        stop = stop or float(rows[-1]["force_evaluations"]) > NO_FINER_AFTER[method.implementation]
    return as_table(rows)


def blank_row(method: Integrator) -> dict[str, float | str]:
    """The row of the error table for a run that was not made: NaN, with the outcome "not_run"."""
    names = (*COUNTS, "implementation", *(name + end for name in QUANTITIES for end in ("", "_end", "_bound")))
    return dict.fromkeys(names, math.nan) | {"outcome": "not_run", "implementation": method.implementation}


def as_table(rows: Sequence[Mapping[str, float | str]]) -> xr.Dataset:
    """Rows with the same entries as one dataset over ``setting``."""
    return xr.Dataset({name: ("setting", [row[name] for row in rows]) for name in rows[0]})


def error_row(
    scene: Scene, method: Integrator, setting: float, horizon: float, observe: str | None = None, *,
    phases: bool = False, budget: float | None = None,
) -> dict[str, float | str]:  # fmt: skip
    """One run's row of an error table, with `phases` also its frequency errors; `budget` is that of `simulate`."""
    control: dict[str, Any] = {"horizon": horizon, "samples": enough_samples(scene, horizon), "observe": observe}
    run = integrate(scene, method, budget=budget, **control | method.given(setting))
    truth = reference(scene, run.time, precision="closed-form")
    errors, failed = errors_against(scene, run, truth), run.outcome != "ok"
    row: dict[str, float | str] = {name: getattr(run, name) for name in COUNTS}
    row["implementation"] = method.implementation
    for name in QUANTITIES:
        values = errors.get(name, np.array([math.nan]))
        row[name] = math.nan if failed else float(np.max(values))
        row[f"{name}_end"] = math.nan if failed else float(values[-1])
        row[f"{name}_bound"] = float(np.max(error_bound(scene, run, truth, name)))
    return {**row, **phase(scene, run, truth)} if phases else row
