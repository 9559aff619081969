"""What the work-precision study says in words, all of it from the data."""

import numpy as np
import xarray as xr

from symtop.measure import ranking

STRUCTURE = ("midpoint", "trapezoidal", "stormer-verlet", "galerkin-simpson")
CLASSIC = ("rk4", "rk45-compiled")


def spans(data: xr.Dataset) -> list[str]:
    """The horizons."""
    return [f"over {value:g} nutation periods" for value in data["horizon"].values]


def seconds(value: float) -> str:
    """A time with a unit that suits it."""
    return f"{value * 1e6:.3g} us" if value < 1e-3 else f"{value * 1e3:.3g} ms" if value < 1.0 else f"{value:.3g} s"


def winner(won: ranking.Win | None) -> str:
    """Who won, in how long, and who is level."""
    if won is None:
        return "nobody"
    level = f", level with {', '.join(won.level)}" if won.level else ""
    return f"{won.best.integrator}, {seconds(won.best.cost)}{level}"


def lead(target: float, cell: xr.Dataset) -> str:
    """The fastest compiled method at a target and its lead; `cell` is one scene and one horizon."""
    won = ranking.win(cell, target)
    if won is None:
        return f"{target:.0e} nobody"
    said = f"{target:.0e} {won.best.integrator} in {seconds(won.best.cost)}"
    if won.level:
        said += f" (inside the noise of {', '.join(won.level)})"
    elif won.behind and won.lead:
        said += f" ({won.lead.ratio:.1f} times ahead of {won.behind.integrator})"
    if won.best.integrator == "exact" and (other := ranking.win(cell, target, without=("exact",))):
        said += f", the fastest that steps {other.best.integrator} in {seconds(other.best.cost)}"
    return said


def growth(data: xr.Dataset, names: list[str], part: str) -> str:
    """Median growth of a part of the error from the first to the last horizon."""
    grown = {name: ranking.growth_at_equal_settings(data.sel(integrator=name), part) for name in names}
    said = [f"{value:.3g} times with {name}" for name, value in grown.items() if np.isfinite(value)]
    rest = [name for name, value in grown.items() if not np.isfinite(value)]
    return ", ".join(said) + (f" (not judged: {', '.join(rest)}, at rounding or over budget)" if rest else "")


def crossings(data: xr.Dataset) -> list[str]:
    """For each classical method, who keeps energy better at equal cost, where, and up to what cost."""
    cells = [data.sel(scene=name).isel(horizon=-1) for name in data["scene"].values]
    sentences = []
    for classic in CLASSIC:
        parts = []
        for method in STRUCTURE:
            found = [one for cell in cells if (one := ranking.crossing(cell, method, classic))]
            won = [one for one in found if one.share > 0.0]
            lost = [one.scene for one in found if one.share == 0.0]
            if not found:
                parts.append(f"{method} nowhere, as no costs are common")
                continue
            if not won:
                parts.append(f"{method} on none of {len(found)} scenes")
                continue
            top = max(won, key=lambda one: one.gain)
            reach = seconds(float(np.median([one.dearest_won for one in won])))
            never = f", never on {', '.join(lost)}" if lost else ""
            parts.append(
                f"{method} on {len(won)} of {len(found)} scenes, there up to {reach} a run (median), at best "
                f"{top.gain:.2g} times on {top.scene} (error {top.error:.1g}){never}"
            )
        sentences.append(f"At equal cost energy is kept better than by {classic}: by " + "; by ".join(parts) + ".")
    return sentences


def crossed(data: xr.Dataset) -> str:
    """The same in one sentence."""
    cells = [data.sel(scene=name).isel(horizon=-1) for name in data["scene"].values]
    known = [one for cell in cells for a in STRUCTURE for b in CLASSIC if (one := ranking.crossing(cell, a, b))]
    coarse = sum(one.at_least and not one.at_most for one in known)
    fine = sum(one.at_most and not one.at_least for one in known)
    return (
        f"Of {len(known)} comparisons of {', '.join(STRUCTURE)} with {' and '.join(CLASSIC)}, the structure-preserving "
        f"method is better at every cost in {sum(one.share == 1.0 for one in known)}, with coarse steps only in "
        f"{coarse}, with fine steps only in {fine}, and nowhere in {sum(one.share == 0.0 for one in known)}."
    )
