"""The one message of each figure, made from its data."""

from collections.abc import Mapping

import numpy as np
import xarray as xr

from symtop.report.style import number

from .tables import worst_behaviour

P_PHI, P_PSI = "p\N{GREEK SMALL LETTER PHI}", "p\N{GREEK SMALL LETTER PSI}"  # of titles
HELD = ("kept", "bounded")
AS_TIME = 0.1  # of an exponent


def holds(cell: xr.Dataset, constant: str) -> bool:
    """Does a row keep a constant, or bound its error, on every scene?"""
    return worst_behaviour(cell, constant) in HELD


def residuals(data: xr.Dataset) -> str:
    """Who keeps the energy best, and who loses most of it, of the rows that are drawn."""
    largest = {
        str(name): float(data["energy_largest"].sel(integrator=name).max()) for name in data["integrator"].values
    }
    behaviour = {name: worst_behaviour(data.sel(integrator=name), "energy") for name in largest}
    held = [name for name in largest if behaviour[name] in HELD]
    lost = sorted((name for name in largest if behaviour[name] == "drift"), key=lambda name: -largest[name])
    text = f"{len(held)} of these {len(largest)} methods keep the energy or bound its error"
    if not lost:
        return text
    return f"{text}; {lost[0]} changes it steadily, by {number(largest[lost[0]])} of the energy of the nutation"


def sizes(data: xr.Dataset) -> str:
    """How many rows keep what."""
    names = list(map(str, data["integrator"].values))
    kept = {
        constant: sum(holds(data.sel(integrator=name), constant) for name in names)
        for constant in ("energy", "p_phi", "p_psi")
    }
    return (
        f"Of {len(names)} methods {kept['energy']} hold the energy, {kept['p_phi']} the momentum {P_PHI} and "
        f"{kept['p_psi']} {P_PSI}: at rounding, or with a bounded error"
    )


def exponents(data: xr.Dataset) -> str:
    """How the phase error of most rows grows."""
    slopes = data["phase_exponent"].values.ravel()
    slopes = slopes[np.isfinite(slopes)]
    steady = float(np.mean(np.abs(slopes - 1.0) <= AS_TIME))
    faster = float(np.mean(slopes > 1.0 + AS_TIME))
    return f"The phase error (last column) grows as t in {steady:.0%} of the runs, and faster in {faster:.0%}"


def windows(data: xr.Dataset) -> str:
    """How far the mean energy of a window ends from where it began, and how far it strays between."""
    last, most = strayed(data)
    steps, end = number(float(data["steps"].max())), number(100.0 * last, 1)
    return (
        f"After {steps} steps the mean energy is within {end}% of the width of its oscillation from where it began; no "
        f"window before strays by more than {number(100.0 * most, 1)}%"
    )


def strayed(data: xr.Dataset) -> tuple[float, float]:
    """By what share of its oscillation the mean energy moves from the first window to the last, and to any window.

    The largest over the methods. Short windows hold no whole number of oscillations, so that their means scatter.
    """
    full = data.dropna("window", how="all", subset=["energy_mean"])
    first = full.isel(window=0)
    moves = np.abs(full["energy_mean"] - first["energy_mean"]) / (first["energy_largest"] - first["energy_least"])
    return float(moves.isel(window=-1).max()), float(moves.max())


def rounding(ensembles: Mapping[str, xr.Dataset]) -> str:
    """With what power rounding drifts, and what compensated sums gain."""
    powers = [float(cell["exponent"]) for cell in ensembles.values()]
    gains = [float(cell["plain_late"] / cell["late"]) for cell in ensembles.values()]
    return (
        f"Rounding makes the modified energy drift as n to the power {min(powers):.2f} to {max(powers):.2f} (a random "
        f"walk: 0.5); compensated sums lower it {number(min(gains))} to {number(max(gains))} times"
    )
