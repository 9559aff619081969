"""The one message of each figure of a mechanism, made from its data."""

from collections.abc import Callable

import numpy as np
import xarray as xr

from symtop.methods.registry import split_name

from .failures import LOST, SEEN
from .tables import Column
from .words import EARLY, LEAST_SAMPLED, NEAR, halved_at_pole, resonant

SLEEPERS = ("strang", "cayley", "midpoint", "gauss-4", "yoshida-4")  # methods, of the figure of the sleeping top
SHIFTED = 1e-3  # of the threshold: less is kept


def of_mechanism(name: str, part: xr.Dataset) -> str:
    """What the figure of a mechanism shows, in one sentence; `part` is its scene."""
    return MESSAGES[name](part)


def _pole(part: xr.Dataset) -> str:
    halved = halved_at_pole(part)
    shares = [f"{sum(halved[angles])} of {len(halved[angles])}" for angles in (True, False)]
    return (
        f"A pole within {NEAR:g} rad halves the accurate step of {shares[0]} rows in angles, of {shares[1]} elsewhere"
    )


def _resonances(part: xr.Dataset) -> str:
    steps = resonant(part)
    if not steps:
        return "No step that turns the nutation by a third a step was found to be unstable"
    places = ", ".join(dict.fromkeys(f"{value:.2f}" for value in sorted(steps.values())))
    return f"At a third of a turn a step (h omega = {places}) nothing survives, though the step is linearly stable"


def _sleeping(part: xr.Dataset) -> str:
    moved = np.abs(part[Column.SLEEPING_THRESHOLD] - 2.0).max("rung")
    rows = [str(name) for name in moved["integrator"].values if split_name(str(name))[0] in SLEEPERS]
    shifts = {name: float(moved.sel(integrator=name)) for name in rows}
    far = sorted((name for name in rows if shifts[name] > SHIFTED), key=lambda name: -shifts[name])
    listed = ", ".join(f"{shifts[name]:.3f} with {name}" for name in far)
    kept = sum(shift <= SHIFTED for shift in shifts.values())
    return f"A long step moves the spin 2 from which a top sleeps by {listed or 'nothing'}; {kept} methods keep it"


def _separatrix(part: xr.Dataset) -> str:
    early, time, predicted = (
        part[key].values for key in (Column.EARLY_ERROR, Column.HORIZON, Column.PREDICTED_HORIZON)
    )
    good = np.isfinite(time) & np.isfinite(predicted) & (early > EARLY[0]) & (early < EARLY[1])
    gap = float(np.median(np.abs(time - predicted)[good])) if good.any() else np.nan
    return (
        f"Next to the separatrix the error at time {SEEN:g}/g predicts when it reaches {LOST:g} rad; the median miss "
        f"is {gap:.2f}/g"
    )


def _sampling(part: xr.Dataset) -> str:
    once, every = part[Column.ENERGY_ONCE].values, part[Column.ENERGY_EVERY].values
    seen = np.isfinite(once) & (once > LEAST_SAMPLED) & (every > 1e-12)
    hidden = int((np.isfinite(once) & (once <= LEAST_SAMPLED) & (every > 1e-12)).sum())
    worst = float((every[seen] / once[seen]).max()) if seen.any() else 1.0
    rest = f", and that of {hidden} rows is not seen at all" if hidden else ""
    return f"Sampled once a nutation an energy error looks up to {worst:.0e} times too small{rest}"


def _solver(part: xr.Dataset) -> str:
    solved = float(part[Column.TEXTBOOK_ENERGY].isel(tolerance_setting=-1).max())
    one = float(part[Column.ONE_ITERATION_ENERGY].max())
    return f"One Newton iteration a step makes an energy error of {one:.1e}; the solved equation has {solved:.1e}"


MESSAGES: dict[str, Callable[[xr.Dataset], str]] = {
    "pole": _pole, "resonances": _resonances, "sleeping": _sleeping, "separatrix": _separatrix,
    "sampling": _sampling, "solver": _solver,
}  # fmt: skip
