"""The one message of each figure, made from its data."""

from collections.abc import Mapping

import numpy as np
import xarray as xr

from symtop.measure.conservation import CONSTANTS
from symtop.report.style import number

from .tables import FAILED, worst_behaviour

HELD = ("kept", "bounded")
AS_TIME = 0.1  # of an exponent


def holds(cell: xr.Dataset, constant: str) -> bool:
    """Does a variant keep a constant, or bound its error, on every scene?"""
    return worst_behaviour(cell, constant) in HELD


def residuals(data: xr.Dataset) -> str:
    """Who keeps the energy best, and who loses most of it, of the variants that are drawn."""
    largest = {str(name): float(data["energy_largest"].sel(variant=name).max()) for name in data["variant"].values}
    behaviour = {name: worst_behaviour(data.sel(variant=name), "energy") for name in largest}
    held = [name for name in largest if behaviour[name] in HELD]
    lost = sorted((name for name in largest if behaviour[name] == "drift"), key=lambda name: -largest[name])
    text = f"{len(held)} of these {len(largest)} methods keep the energy or bound its error"
    if not lost:
        return text
    return f"{text}; {lost[0]} changes it steadily, by {number(largest[lost[0]])} of the energy of the nutation"


def lost(data: xr.Dataset) -> dict[tuple[str, ...], list[str]]:
    """The variants by the constants that they neither keep nor bound on all scenes: first those that lose none or most.

    Within a group those with the largest change of energy come last.
    """
    groups: dict[tuple[str, ...], list[str]] = {}
    energies = data["energy_largest"].max("scene")
    for name in map(str, data["variant"].values[np.argsort(energies.values, kind="stable")]):
        cell = data.sel(variant=name)
        groups.setdefault(tuple(one for one in CONSTANTS if not holds(cell, one)), []).append(name)
    return dict(sorted(groups.items(), key=lambda one: (bool(one[0]), -len(one[0]), one[0])))


def sizes(data: xr.Dataset) -> str:
    """How many variants hold all three constants."""
    names, held = data.sizes["variant"], len(lost(data).get((), []))
    rest = names - held
    return f"{held} of {names} methods hold the energy and both momenta, at rounding or with a bounded error" + (
        f"; {rest} lose{'s' * (rest == 1)} at least one" if rest else ""
    )


ENERGIES = {"bounded": "a bounded energy error", "lost": "an energy that drifts or grows", "kept": "energy at rounding"}


def by_energy(data: xr.Dataset) -> dict[str, np.ndarray]:
    """Growth exponents of the phase error of all runs, by what the variant's energy does: a key of `ENERGIES`."""
    groups: dict[str, list[float]] = {word: [] for word in ENERGIES}
    for name in data["variant"].values:
        cell = data.sel(variant=name)
        word = worst_behaviour(cell, "energy")
        slopes = cell["phase_exponent"].values.ravel()
        if word != FAILED:
            groups[word if word in HELD else "lost"].extend(slopes[np.isfinite(slopes)])
    return {word: np.array(slopes) for word, slopes in groups.items()}


def as_time(slopes: np.ndarray) -> np.ndarray:
    """Which errors grow as t, to `AS_TIME` of the exponent."""
    return np.abs(slopes - 1.0) <= AS_TIME


def faster(slopes: np.ndarray) -> np.ndarray:
    """Which errors grow faster."""
    return slopes > 1.0 + AS_TIME


def exponents(data: xr.Dataset) -> str:
    """How the phase error grows where the energy error is bounded, and where it is not."""
    groups = by_energy(data)
    said = [
        f"{how} with {ENERGIES[word]} ({rule(groups[word]).sum()} of {groups[word].size} runs)"
        for how, word, rule in (("as t", "bounded", as_time), ("faster", "lost", faster))
        if groups[word].size
    ]
    return f"The phase error grows {' and '.join(said)}" if said else "Growth of the phase error"


def shifts(data: xr.Dataset) -> xr.DataArray:
    """The mean energy of each window less that of the first window, over the width of its oscillation there.

    The means scatter: short windows hold no whole number of oscillations, and the samples of a longer one may beat
    with them.
    """
    full = data.dropna("window", how="all", subset=["energy_mean"])
    first = full.isel(window=0)
    return (full["energy_mean"] - first["energy_mean"]) / (first["energy_largest"] - first["energy_least"])


def strayed(data: xr.Dataset) -> tuple[float, float]:
    """By what share of its oscillation the mean energy moves from the first window to the last, and to any window.

    The largest over the methods.
    """
    moves = np.abs(shifts(data))
    return float(moves.isel(window=-1).max()), float(moves.max())


def windows(data: xr.Dataset) -> str:
    """How far the mean energy of the last window is from that of the first, at most over the methods."""
    steps, end = number(float(data["steps"].max())), number(100.0 * strayed(data)[0], 1)
    return (
        f"The mean energy moves by at most {end}% of the width of its oscillation in {steps} steps, from the first "
        "window to the last (first row)"
    )


def walk(cell: xr.Dataset) -> str:
    """The exponents of both sums, for the panel of a method."""
    plain, compensated = float(cell["plain_exponent"]), float(cell["exponent"])
    return f"plain: power {plain:.2f}\ncompensated: power {compensated:.2f}"


def rounding(ensembles: Mapping[str, xr.Dataset]) -> str:
    """What compensated sums gain, and with what power the drift grows with them."""
    powers = [float(cell["exponent"]) for cell in ensembles.values()]
    walks = all(abs(float(cell["exponent"]) - 0.5) <= float(cell["exponent_interval"]) for cell in ensembles.values())
    gains = [float(cell["plain_late"] / cell["late"]) for cell in ensembles.values()]
    return (
        f"Compensated sums lower the drift by rounding {number(min(gains))} to {number(max(gains))} times; it grows as "
        f"n to the power {min(powers):.2f} to {max(powers):.2f} then{', as a random walk does (0.5)' * walks}"
    )
