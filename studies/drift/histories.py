"""One run over a long horizon, with the settings that it was made with.

`symtop.measure.conservation.history` says what became of the constants of the motion; beside it stand the step or the
tolerance, and the length of the run in nutations, so that a caption and a table can name them.
"""

import math
from typing import Any

import xarray as xr

from symtop.measure.conservation import history
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene


def run_history(
    scene: Scene, method: Integrator, *, horizon: float, samples: int, step_size: float | None = None,
    tolerance: float | None = None,
) -> xr.Dataset:  # fmt: skip
    """What `history` returns, and ``nutations``, ``steps_a_nutation`` or ``tolerance`` of the run.

    NaN stands for what a method does not have; ``own_tolerance`` is true for a method that ran at its own default.
    """
    given: dict[str, Any] = {"step_size": step_size, "tolerance": tolerance}
    data = history(scene, method, horizon=horizon, samples=samples, **{k: v for k, v in given.items() if v is not None})
    used = method.check_tolerance(tolerance) if method.adaptive else math.nan
    return data.assign(
        nutations=horizon / scene.nutation_period,
        steps_a_nutation=scene.nutation_period / step_size if step_size else math.nan,
        tolerance=used,
        own_tolerance=float(method.adaptive and tolerance is None),
    )
