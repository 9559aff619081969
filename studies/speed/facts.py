"""Facts and the table of the study: the time of each method to reach an error."""

import math
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from symtop_studies.cost.ranking import cost_to_reach

from symtop.measure.timing import NOISY_SPREAD
from symtop.methods.framework.registry import integrator, integrators, split_name
from symtop.runner.study import REFERENCE

SHOWN = "goldstein"  # the scene of the figure
TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)  # rad
SCIPY, SAME = "rk45[axis]", "rk45-compiled[axis]"  # the same formulas, called through SciPy and compiled
BUSY = 0.1  # share of noisy times above which Python is not compared with compiled code: long runs are slowed the most
BESIDE = "dop853-compiled[axis]"  # a well-known method, compared with the fastest at 1e-9 rad


def shown(data: xr.Dataset) -> xr.Dataset:
    """The scene and the run length of the figure."""
    return data.sel(scene=SHOWN if SHOWN in data["scene"].values else data["scene"].values[0]).isel(nutations=0)


def cost(cell: xr.Dataset, target: float) -> float:
    """Seconds of a run whose axis error is at most the target, by `cost_to_reach`; or inf."""
    error, seconds = cell["axis"].values, cell["seconds"].values
    good = np.isfinite(error) & np.isfinite(seconds) & (error > 0.0)
    columns = seconds[good, np.newaxis], error[good, np.newaxis]
    return float(cost_to_reach(*columns, [target])[0, 0]) if good.any() else math.inf


def met_by_coarsest(cell: xr.Dataset, target: float) -> bool:
    """Does the coarsest run that ended well meet the target? Then a coarser one, which was not tried, may cost less."""
    error = cell["axis"].values
    return bool((error[np.isfinite(error)][:1] <= target).any())


def costs(data: xr.Dataset, target: float) -> dict[str, float]:
    """Seconds of each variant that reaches an axis error in the figure, the least first."""
    part = shown(data)
    names = [str(name) for name in part["variant"].values if split_name(str(name))[0] != REFERENCE]
    known = {name: cost(part.sel(variant=name), target) for name in names}
    return dict(sorted(((name, time) for name, time in known.items() if time < math.inf), key=lambda item: item[1]))


def on_f_alone(name: str) -> bool:
    """Does a method need the right-hand side f(t, y) alone?"""
    method = split_name(name)[0]
    return method in integrators() and integrator(method).needs == "derivative"


def facts(data: xr.Dataset) -> dict[str, Any]:
    """The fastest methods on f(t, y) alone at each error (s); DOP853 relative to them; SciPy's RK45 to the compiled."""
    part = shown(data)
    values: dict[str, Any] = {
        "scene": str(part["scene"].values), "nutations": float(part["nutations"]),
        "scenes": ", ".join(map(str, data["scene"].values)),
        "lengths": " and ".join(f"{length:g}" for length in data["nutations"].values),
        "variants": data.sizes["variant"] - 1,
    }  # fmt: skip
    for target in TARGETS:
        first = next(((name, time) for name, time in costs(data, target).items() if on_f_alone(name)), (None, None))
        values |= {
            f"fastest_{-math.log10(target):.0f}": first[0],
            f"fastest_{-math.log10(target):.0f}_seconds": first[1],
        }
    times, known = costs(data, 1e-6), BESIDE in costs(data, 1e-9)
    spread = part["seconds_spread"].values
    both = SCIPY in times and SAME in times and (spread > NOISY_SPREAD).sum() <= BUSY * np.isfinite(spread).sum()
    return values | {
        "spread": float(np.nanmedian(spread)),
        "noisy": int((spread > NOISY_SPREAD).sum()),
        "timed": int(np.isfinite(spread).sum()),
        "scipy": times[SCIPY] / times[SAME] if both else None,  # times as long, at 1e-6 rad
        "beside": costs(data, 1e-9)[BESIDE] / values["fastest_9_seconds"] if known else None,
    }


def tables(data: xr.Dataset) -> dict[str, pd.DataFrame]:
    """Microseconds of a run to each error in the figure, the fastest at 1e-6 rad first, and which are upper bounds."""
    part = shown(data)
    by_target = {target: costs(data, target) for target in TARGETS}
    names = dict.fromkeys(name for target in (1e-6, *TARGETS) for name in by_target[target])
    rows = [
        [name, *(1e6 * by_target[target].get(name, math.nan) for target in TARGETS),
         ", ".join(f"{target:.0e}" for target in TARGETS if met_by_coarsest(part.sel(variant=name), target))]
        for name in names
    ]  # fmt: skip
    header = ["variant", *(f"{target:.0e} rad (us)" for target in TARGETS), "upper bound at (rad)"]
    return {"times": pd.DataFrame(rows, columns=header)}
