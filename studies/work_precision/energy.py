"""Energy errors of methods that preserve the structure of the problem, beside classical ones at equal run time."""

from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.measure import ranking

STRUCTURE = ("midpoint", "trapezoidal", "stormer-verlet", "galerkin-simpson")
CLASSIC = ("rk4", "rk45-compiled")
COMPARED = (*STRUCTURE, *CLASSIC)


class Crossing(NamedTuple):
    """Energy at equal time on a scene: the share of the common times at which the first of two methods is better."""

    scene: str
    share: float  # of the common range, in the logarithm of time
    at_least: bool  # is the first better at the least common time,
    at_most: bool  # at the largest?
    longest_won: float  # s, the longest run at which the first is better; NaN if none
    error: float  # energy error of the first where its lead is largest (or its lag smallest)
    gain: float  # ratio of the energy errors there, second over first


def crossing(cell: xr.Dataset, first: str, second: str) -> Crossing | None:
    """Compare the least energy error that each of two methods has for a time; None if their times do not overlap.

    The error for a time is that of the most accurate run that takes no longer, joined by straight lines in the
    logarithms. `cell` is one scene and one horizon.
    """
    curves = []
    for name in (first, second):
        runs = cell.sel(integrator=name)
        x, y = runs["seconds"].values, runs["energy"].values
        good = np.isfinite(x) & np.isfinite(y) & (runs["outcome"].values == "ok")
        order = np.argsort(x[good])
        x, y = x[good][order], np.minimum.accumulate(np.maximum(y[good][order], 1e-17))
        if x.size < 2:
            return None
        curves.append((np.log(x), np.log(y)))
    low, high = max(x[0] for x, _ in curves), min(x[-1] for x, _ in curves)
    if high <= low:
        return None
    at = np.linspace(low, high, 201)
    ours, theirs = (np.interp(at, *curve) for curve in curves)
    ahead, best = ours < theirs, int(np.argmax(theirs - ours))
    won = float(np.exp(at[ahead][-1])) if ahead.any() else np.nan
    gain, error = float(np.exp(theirs[best] - ours[best])), float(np.exp(ours[best]))
    return Crossing(str(cell["scene"].values), float(ahead.mean()), bool(ahead[0]), bool(ahead[-1]), won, error, gain)


def crossings(data: xr.Dataset) -> dict[tuple[str, str], list[Crossing]]:
    """All comparisons over the long horizon by (classical method, other method), on the scenes that count."""
    kept = ranking.counted(data)[0].isel(horizon=-1)
    cells = [kept.sel(scene=name) for name in kept["scene"].values]
    return {
        (classic, method): [one for cell in cells if (one := crossing(cell, method, classic))]
        for classic in CLASSIC
        for method in STRUCTURE
    }


def growth_at_equal_settings(runs: xr.Dataset, quantity: str) -> float:
    """Median ratio of an error at the last horizon to that at the first, over settings that were run at both."""
    near, later = runs.isel(horizon=0), runs.isel(horizon=-1)
    ratios = [
        later[quantity].values[j] / near[quantity].values[k]
        for k, setting in enumerate(near["setting_value"].values)
        for j in np.flatnonzero(np.isclose(later["setting_value"].values, setting, rtol=1e-9))
        if near[quantity].values[k] > 1e-12
    ]
    good = [ratio for ratio in ratios if np.isfinite(ratio)]
    return float(np.median(good)) if good else np.nan
