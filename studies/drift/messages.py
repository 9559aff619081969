"""The one message of each figure, made from its data."""

from collections.abc import Mapping

import numpy as np
import xarray as xr

from symtop.report.style import number

from .tables import worst_behaviour

HELD = ("kept", "bounded")
AS_TIME = 0.1  # of an exponent


def residuals(data: xr.Dataset) -> str:
    """Who keeps the energy best, and who loses most of it, of the rows that are drawn."""
    largest = {
        str(name): float(data["energy_largest"].sel(integrator=name).max()) for name in data["integrator"].values
    }
    behaviour = {name: worst_behaviour(data.sel(integrator=name), "energy") for name in largest}
    held = [name for name in largest if behaviour[name] in HELD]
    lost = sorted((name for name in largest if behaviour[name] == "drift"), key=lambda name: -largest[name])
    text = f"{len(held)} of {len(largest)} rows keep the energy or bound its error"
    return f"{text}; {lost[0]} loses it steadily, to {number(largest[lost[0]])}" if lost else text


def sizes(data: xr.Dataset) -> str:
    """How many rows keep what."""
    names = list(map(str, data["integrator"].values))
    kept = {
        constant: sum(worst_behaviour(data.sel(integrator=name), constant) in HELD for name in names)
        for constant in ("energy", "p_phi", "p_psi")
    }
    return (
        f"Of {len(names)} rows {kept['energy']} hold the energy, {kept['p_phi']} p_phi and {kept['p_psi']} p_psi: at "
        "rounding, or with a bounded error"
    )


def exponents(data: xr.Dataset) -> str:
    """How the phase error of most rows grows."""
    slopes = data["phase_exponent"].values.ravel()
    slopes = slopes[np.isfinite(slopes)]
    steady = float(np.mean(np.abs(slopes - 1.0) <= AS_TIME))
    faster = float(np.mean(slopes > 1.0 + AS_TIME))
    return f"The phase error grows as t in {steady:.0%} of the runs, and faster in {faster:.0%}"


def rounding(ensembles: Mapping[str, xr.Dataset]) -> str:
    """With what power rounding drifts, and what compensated sums gain."""
    powers = [float(cell["exponent"]) for cell in ensembles.values()]
    gains = [float(cell["plain_late"] / cell["late"]) for cell in ensembles.values()]
    return (
        f"Rounding drifts as n^{min(powers):.2f} to n^{max(powers):.2f} (a random walk: n^0.5); compensated sums gain "
        f"a factor of {number(min(gains))} to {number(max(gains))}"
    )
