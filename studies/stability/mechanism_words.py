"""What the scans of single mechanisms found, in sentences and in one table; each beside what theory says.

A sentence is made only from what the dataset holds, so that a quick or a partial study says less and nothing else.
"""

import math
from typing import Any

import numpy as np
import xarray as xr

from symtop.methods.registry import integrators
from symtop.run.linear_stability import sleeping_threshold_in_theory

from .atlas_words import FAR, NEAR, cell, reach

FARTHER = 10.0  # times the change of the solved equation: an integral that the solver lets go
BARELY = 0.02  # rad: a displacement below this is next to nothing


def _part(data: xr.Dataset, scene: str, variable: str) -> xr.Dataset | None:
    return data.sel(scene=scene) if scene in data["scene"].values and variable in data else None


def _names(at: xr.Dataset, variable: str) -> list[str]:
    known = np.isfinite(at[variable].values).reshape(at.sizes["integrator"], -1).any(axis=1)
    return [str(name) for name, good in zip(at["integrator"].values, known, strict=True) if good]


def poles(data: xr.Dataset) -> list[str]:
    """Who minds a pole next to the path."""
    spoiled: dict[bool, list[str]] = {True: [], False: []}
    total = {True: 0, False: 0}
    for name in map(str, data["integrator"].values):
        found = cell(data, "grazing", name)
        entry = integrators().get(name)
        if found is None or entry is None or entry.knob != "step_size":
            continue
        angles = entry.charts() == ("angles",)
        total[angles] += 1
        limits = reach(found)
        away = np.median(limits[found.parameter >= FAR])
        if np.median(limits[found.parameter <= NEAR]) < 0.5 * away:
            spoiled[angles].append(name)
    if not total[True] + total[False]:
        return []
    said = (
        f"A pole closer than {NEAR:g} rad to the path at least halves the accurate step of {len(spoiled[True])} of "
        f"{total[True]} fixed-step methods in the angles chart, and of {len(spoiled[False])} of {total[False]} in "
        "charts without poles."
    )
    return [said]


def resonances(data: xr.Dataset) -> list[str]:
    """Linear limits, and the steps at which nothing survives although the linear analysis says stable."""
    at = _part(data, "steady-fast", "limit_phase")
    if at is None:
        return []
    said = []
    limits = {name: float(at["limit_phase"].sel(integrator=name)) for name in _names(at, "limit_phase")}
    if limits:
        listed = ", ".join(f"{name} {value:.4f}" for name, value in sorted(limits.items(), key=lambda item: item[1]))
        said.append(f"Small nutations about a steady precession become unstable at h omega = {listed}.")
    dead = {}
    for name in _names(at, "third_turn_phase"):
        row = at.sel(integrator=name)
        left, past = float(row["surviving_at_third_turn"]), float(row["surviving_past_third_turn"])
        if past > 3.0 * left:  # what stays dead beyond is no resonance
            dead[name] = (float(row["third_turn_phase"]), left)
    gone = {name: place for name, (place, left) in dead.items() if left < BARELY}
    if gone:
        listed = ", ".join(f"{name} at {place:.4f}" for name, place in sorted(gone.items(), key=lambda item: item[1]))
        said.append(
            f"Where the discrete nutation turns by a third of a turn a step, displacements of {BARELY:g} rad and more "
            f"do not survive, although the step is linearly stable: {listed} (sqrt 3 = 1.7321, 2 sqrt 3 = 3.4641)."
        )
    return said


def sleepers(data: xr.Dataset) -> list[str]:
    """The sleeping thresholds of strang and cayley beside their closed forms."""
    at = _part(data, "sleeping", "sleeping_threshold")
    if at is None:
        return []
    said = []
    for name in ("strang", "cayley"):
        if name not in _names(at, "sleeping_threshold"):
            continue
        row = at.sel(integrator=name)
        good = np.isfinite(row["sleeping_threshold"].values)
        h, found = row["sleeping_step"].values[good], row["sleeping_threshold"].values[good]
        theory = np.array([sleeping_threshold_in_theory(name, float(x)) for x in h])
        said.append(f"{name} {found[-1]:.6f} at h = {h[-1]:g}, within {np.max(np.abs(found - theory)):.0e} of theory")
    return [f"The upright top sleeps from a spin of 2; with a step from: {'; '.join(said)}."] if said else []


def horizons(data: xr.Dataset) -> list[str]:
    """Is the horizon next to a separatrix what the early error says?"""
    at = _part(data, "separatrix", "horizon")
    if at is None:
        return []
    good = np.isfinite(at["horizon"].values) & np.isfinite(at["predicted_horizon"].values)
    good &= (at["early_error"].values < 1e-2) & (at["early_error"].values > 1e-15)
    keeps = np.array(["energy" in _conserved(str(name)) for name in at["integrator"].values])
    kept = at["horizon"].values[keeps]
    good[keeps] = False
    gap = at["horizon"].values[good] - at["predicted_horizon"].values[good]
    if not gap.size:
        return []
    said = (
        f"Next to the separatrix {gap.size} runs lose their accuracy within {np.max(np.abs(gap)):.1f}/g of the time "
        f"that their error at 6/g predicts (median {np.median(np.abs(gap)):.2f}/g); the longest lasts "
        f"{np.max(at['horizon'].values[good]):.0f}/g."
    )
    if np.isfinite(kept).any():
        said += (
            " Methods that keep every integral stay on the separatrix and are right for at least "
            f"{np.nanmin(kept):.0f}/g, whatever their step."
        )
    return [said]


def _conserved(name: str) -> frozenset[str]:
    entry = integrators().get(name)
    return (entry.conserves or frozenset()) if entry else frozenset()


def sampling(data: xr.Dataset) -> list[str]:
    """What an energy error sampled once a nutation hides."""
    at = _part(data, "goldstein", "energy_once")
    if at is None:
        return []
    once, every = at["energy_once"].values, at["energy_every"].values
    good = np.isfinite(once) & (every > 1e-12)
    if not good.any():
        return []
    ratio = np.where(good, every / np.maximum(once, 1e-16), 0.0)
    worst = int(np.argmax(ratio))
    said = f"Energy errors sampled once a nutation read up to {ratio[worst]:.0e} times too small"
    named = str(at["integrator"].values[worst])
    if "stormer-verlet" in at["integrator"].values:
        row = at.sel(integrator="stormer-verlet")
        seen = f"{float(row['energy_every']):.2g} reads {float(row['energy_once']):.1g}"
        return [f"{said} ({named}); stormer-verlet's {seen}."]
    return [f"{said} ({named})."]


def solver(data: xr.Dataset) -> list[str]:
    """The share of the solver in what an implicit method does to energy and momenta."""
    at = _part(data, "goldstein", "plain_energy")
    if at is None or "midpoint" not in _names(at, "plain_energy"):
        return []
    row = at.sel(integrator="midpoint")
    solved, one = float(row["plain_energy"][-1]), float(row["one_iteration_energy"])
    energy, momenta = row["solver_energy"].values, row["solver_momentum"].values
    walks = "walk off to" if one > FARTHER * solved else "stay at"
    whose = ": the difference is the solver's" if one > FARTHER * solved else ""
    kept = "lets the energy go" if energy[0] > FARTHER * energy[-1] else "keeps the energy"
    gone = "lets the momenta go" if momenta[0] > FARTHER * momenta[-1] else "keeps the momenta"
    but = "and" if kept.split(maxsplit=1)[0] == gone.split(maxsplit=1)[0] else "but"
    said = (
        f"One Newton iteration a step makes the energy of midpoint {walks} {one:.1e}, where the solved equation "
        f"stays within {solved:.1e}{whose}. The kernel of this package, stopped after one iteration, {kept} "
        f"({energy[0]:.1e} against {energy[-1]:.1e} when solved) {but} {gone} ({momenta[0]:.0e} against "
        f"{momenta[-1]:.0e})."
    )
    return [said]


def mechanism_sentences(data: xr.Dataset) -> list[str]:
    """All of them."""
    return [said for part in (poles, resonances, sleepers, horizons, sampling, solver) for said in part(data)]


def limit_table(data: xr.Dataset) -> tuple[str, list[str], list[list[str]]] | None:
    """Limits in numbers: title, header and rows; None if no scan is there."""
    columns: list[tuple[str, str, Any]] = [
        ("steady-fast", "limit_phase", ("linear limit, h omega", "{:.4f}")),
        ("steady-fast", "third_turn_phase", ("third of a turn, h omega", "{:.4f}")),
        ("steady-fast", "surviving_at_third_turn", ("survives there (rad)", "{:.2g}")),
        ("sleeping", "sleeping_threshold", ("sleeps from a spin of (largest step)", "{:.6f}")),
        ("goldstein", "energy_every", ("energy error, every step", "{:.1e}")),
        ("goldstein", "energy_once", ("once a nutation", "{:.1e}")),
    ]
    there = [(scene, variable, words) for scene, variable, words in columns if _part(data, scene, variable) is not None]
    if not there:
        return None
    rows = []
    for name in map(str, data["integrator"].values):
        cells = []
        for scene, variable, (_, form) in there:
            values = np.atleast_1d(data[variable].sel(scene=scene, integrator=name).values)
            last = float(values[-1])
            cells.append(form.format(last) if math.isfinite(last) else "")
        if any(cells):
            rows.append([name, *cells])
    return "Limits in numbers", ["integrator", *(words[0] for *_, words in there)], rows
