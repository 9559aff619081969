"""What became of a run, judged afterwards against the truth.

An outcome that is not ok stands. Otherwise: `accurate` (axis error at most 1e-2 rad throughout, and at most a
tenth of the nutation's width), `wrong_regime` (the axis went where the true motion never goes), `drifting` (the energy
error grew with time and passed 1 %), or `bounded_but_wrong` (everything looks right except the answer).
"""

import numpy as np
import xarray as xr

from symtop.measure.errors import energy_scale
from symtop.scenes import Scene

ACCURATE = 1e-2  # rad
OUTSIDE = 0.1  # of the nutation's width, or rad if it has none
STEADY = 1e-6  # rad; a nutation narrower than this is a steady precession, known to rounding only
DRIFT = 0.01

VERDICTS = (
    "accurate", "bounded_but_wrong", "drifting", "wrong_regime",
    "left_chart", "not_converged", "not_finite", "step_too_small", "out_of_budget",
)  # fmt: skip


def verdict(scene: Scene, run: xr.Dataset, axis_error: np.ndarray) -> str:
    """One word of `VERDICTS` for a run with the given axis errors at its samples."""
    if run.attrs["outcome"] != "ok":
        return str(run.attrs["outcome"])
    highest, lowest = np.arccos(scene.top.turning_cosines(scene.start)[::-1])
    width = lowest - highest if lowest - highest > STEADY else 1.0
    if np.max(axis_error) <= min(ACCURATE, OUTSIDE * width):
        return "accurate"
    margin = OUTSIDE * width
    theta = run["theta"].values
    if theta.min() < highest - margin or theta.max() > lowest + margin:
        return "wrong_regime"
    energy = np.abs(run["energy"].values - run["energy"].values[0]) / energy_scale(scene)
    half = energy.size // 2
    if energy[half:].max() > DRIFT and energy[half:].max() > 1.3 * energy[:half].max():
        return "drifting"
    return "bounded_but_wrong"
