"""The measurements of single mechanisms of failure in sentences and in one table, each beside what theory says.

A sentence is made only from what the dataset holds: a quick or a partial study says less.
"""

import math

import numpy as np
import xarray as xr

from symtop.methods.registry import integrators
from symtop.runner.study import Table

from .atlas import NEAR, pole_effect
from .failures import LOST, SEEN
from .tables import Column

LOOSE = 10.0  # times the change of the solved equation: lost because the solver's tolerance is too loose
BARELY = 0.02  # rad: a largest surviving displacement below this counts as none
REVIVAL = 3.0  # times more survives past a resonance than in it; what stays dead beyond is no resonance
EARLY = 1e-15, 1e-2  # rad, axis errors that predict the time next to a separatrix: above rounding, still small


def _part(data: xr.Dataset, scene: str, variable: str) -> xr.Dataset | None:
    return data.sel(scene=scene) if scene in data["scene"].values and variable in data else None


def _names(part: xr.Dataset, variable: str) -> list[str]:
    finite = np.isfinite(part[variable].values).reshape(part.sizes["integrator"], -1).any(axis=1)
    return [str(name) for name, good in zip(part["integrator"].values, finite, strict=True) if good]


def poles(data: xr.Dataset) -> list[str]:
    """Which methods need shorter steps where a pole is next to the path."""
    halved: dict[bool, int] = {True: 0, False: 0}
    total = {True: 0, False: 0}
    for name in map(str, data["integrator"].values):
        effect, method = pole_effect(data, name), integrators().get(name)
        if effect is None or method is None or not method.fixed_step:
            continue
        angles = method.charts() == ("angles",)
        total[angles] += 1
        halved[angles] += effect.halves
    if not total[True] + total[False]:
        return []
    text = (
        f"A pole closer than {NEAR:g} rad to the path at least halves the accurate step of {halved[True]} of "
        f"{total[True]} fixed-step methods in the angles chart, and of {halved[False]} of {total[False]} in "
        "charts without poles."
    )
    return [text]


def resonances(data: xr.Dataset) -> list[str]:
    """Linear limits, and the linearly stable steps at which hardly any displacement survives."""
    part = _part(data, "steady-fast", Column.LIMIT_PHASE)
    if part is None:
        return []
    sentences = []
    names = _names(part, Column.LIMIT_PHASE)
    limits = {name: float(part[Column.LIMIT_PHASE].sel(integrator=name)) for name in names}
    if limits:
        listed = ", ".join(f"{value:.4f} for {name}" for name, value in sorted(limits.items(), key=lambda one: one[1]))
        sentences.append(
            f"Small nutations about a steady precession grow from h omega (step times nutation frequency) = {listed}."
        )
    resonant = {}
    for name in _names(part, Column.THIRD_TURN_PHASE):
        row = part.sel(integrator=name)
        at, past = float(row[Column.SURVIVING_AT_THIRD_TURN]), float(row[Column.SURVIVING_PAST_THIRD_TURN])
        if past > REVIVAL * at and at < BARELY:
            resonant[name] = float(row[Column.THIRD_TURN_PHASE])
    if resonant:
        listed = ", ".join(
            f"{value:.4f} for {name}" for name, value in sorted(resonant.items(), key=lambda one: one[1])
        )
        sentences.append(
            f"A step that advances the nutation by a third of a turn is linearly stable, but a top displaced by "
            f"{BARELY:g} rad or more leaves its steady precession. This step is h omega = {listed} (theory: sqrt 3 = "
            "1.7321 for Verlet, 2 sqrt 3 = 3.4641 for the midpoint rule)."
        )
    return sentences


def sleepers(data: xr.Dataset) -> list[str]:
    """The sleeping thresholds of methods that move it, beside their closed forms."""
    part = _part(data, "sleeping", Column.SLEEPING_THRESHOLD)
    if part is None:
        return []
    parts = []
    for name in _names(part, Column.SLEEPING_THRESHOLD):
        method = integrators().get(name)
        if method is None or method.sleeps_from is None:
            continue
        row = part.sel(integrator=name)
        good = np.isfinite(row[Column.SLEEPING_THRESHOLD].values)
        h, measured = row[Column.SLEEPING_STEP].values[good], row[Column.SLEEPING_THRESHOLD].values[good]
        theory = np.array([method.sleeps_from(float(x)) for x in h])
        miss = np.max(np.abs(measured - theory))
        parts.append(f"{measured[-1]:.6f} with {name} at h = {h[-1]:g}, within {miss:.0e} of theory")
    if not parts:
        return []
    text = (
        "The true top sleeps (spins upright and stays so) from a spin I3 w3 of 2 on, if I1 = mgl = 1. A step moves this"
    )
    return [f"{text} threshold, to {'; to '.join(parts)}."]


def horizons(data: xr.Dataset) -> list[str]:
    """Is the accurate time next to a separatrix what the early error says?"""
    part = _part(data, "separatrix", Column.HORIZON)
    if part is None:
        return []
    horizon, predicted, early = (
        part[name].values for name in (Column.HORIZON, Column.PREDICTED_HORIZON, Column.EARLY_ERROR)
    )
    good = np.isfinite(horizon) & np.isfinite(predicted) & (early < EARLY[1]) & (early > EARLY[0])
    conserving = np.array(["energy" in _conserved(str(name)) for name in part["integrator"].values])
    good[conserving] = False
    gap = np.abs(horizon[good] - predicted[good])
    if not gap.size:
        return []
    text = (
        "Next to the separatrix (the motion that rises towards the upright for ever, on a scale of 1/g = sqrt(I1/mgl)) "
        f"{gap.size} runs reach an axis error of {LOST:g} rad within {np.max(gap):.1f}/g of the time that their error "
        f"at {SEEN:g}/g predicts (median {np.median(gap):.2f}/g); the longest takes {np.max(horizon[good]):.0f}/g."
    )
    if np.isfinite(horizon[conserving]).any():
        least = np.nanmin(horizon[conserving])
        text += f" Methods that conserve the energy stay below it for at least {least:.0f}/g at every step tried."
    return [text]


def _conserved(name: str) -> frozenset[str]:
    method = integrators().get(name)
    return (method.conserves or frozenset()) if method else frozenset()


def sampling(data: xr.Dataset) -> list[str]:
    """What an energy error sampled once a nutation hides."""
    part = _part(data, "goldstein", Column.ENERGY_ONCE)
    if part is None:
        return []
    once, every = part[Column.ENERGY_ONCE].values, part[Column.ENERGY_EVERY].values
    good = np.isfinite(once) & (every > 1e-12)
    if not good.any():
        return []
    ratio = np.where(good, every / np.maximum(once, 1e-16), 0.0)
    worst = int(np.argmax(ratio))
    name = str(part["integrator"].values[worst])
    text = f"An energy error that is sampled once a nutation appears up to {ratio[worst]:.0e} times too small ({name})"
    if "stormer-verlet" in part["integrator"].values:
        row = part.sel(integrator="stormer-verlet")
        true, seen = float(row[Column.ENERGY_EVERY]), float(row[Column.ENERGY_ONCE])
        text += f"; that of stormer-verlet is {true:.2g} and appears as {seen:.1g}"
    return [f"{text}."]


def solver(data: xr.Dataset) -> list[str]:
    """The share of the solver in what an implicit method does to energy and momenta."""
    part = _part(data, "goldstein", Column.TEXTBOOK_ENERGY)
    names = [] if part is None else _names(part, Column.TEXTBOOK_ENERGY)
    if part is None or not names:
        return []
    row = part.sel(integrator=names[0])
    solved, one = float(row[Column.TEXTBOOK_ENERGY][-1]), float(row[Column.ONE_ITERATION_ENERGY])
    energy, momenta = row[Column.SOLVER_ENERGY].values, row[Column.SOLVER_MOMENTUM].values
    grows = one > LOOSE * solved
    first = f"{'grows to' if grows else 'stays at'} {one:.1e}"
    cause = ": the difference comes from the solver" if grows else ""
    lost = {"energy": energy[0] > LOOSE * energy[-1], "momenta": momenta[0] > LOOSE * momenta[-1]}
    verbs = {name: f"{'loses' if gone else 'conserves'} the {name}" for name, gone in lost.items()}
    text = (
        f"With one Newton iteration a step the energy error of {names[0]} {first}; with its equation solved it stays "
        f"within {solved:.1e}{cause}. The kernel of this package, stopped after one iteration, {verbs['energy']} "
        f"({energy[0]:.1e}, and {energy[-1]:.1e} when solved) {'and' if len(set(lost.values())) == 1 else 'but'} "
        f"{verbs['momenta']} ({momenta[0]:.0e}, and {momenta[-1]:.0e} when solved)."
    )
    return [text]


def mechanism_sentences(data: xr.Dataset) -> list[str]:
    """The sentences of all mechanisms."""
    return [sentence for part in (poles, resonances, sleepers, horizons, sampling, solver) for sentence in part(data)]


LIMITS = (  # scene, variable, header, format
    ("steady-fast", Column.LIMIT_PHASE, "linear limit, h omega", "{:.4f}"),
    ("steady-fast", Column.THIRD_TURN_PHASE, "a third of a turn a step, h omega", "{:.4f}"),
    ("steady-fast", Column.SURVIVING_AT_THIRD_TURN, "largest displacement that stays near there (rad)", "{:.2g}"),
    ("sleeping", Column.SLEEPING_THRESHOLD, "sleeps from a spin I3 w3 of (largest step)", "{:.6f}"),
    ("goldstein", Column.ENERGY_EVERY, "largest energy error, every step", "{:.1e}"),
    ("goldstein", Column.ENERGY_ONCE, "the same, once a nutation", "{:.1e}"),
)


def limit_table(data: xr.Dataset) -> Table | None:
    """Limits in numbers; None if the dataset has none of them."""
    shown = [one for one in LIMITS if _part(data, one[0], one[1]) is not None]
    if not shown:
        return None
    rows = []
    for name in map(str, data["integrator"].values):
        cells = []
        for scene, variable, _, form in shown:
            last = float(np.atleast_1d(data[variable].sel(scene=scene, integrator=name).values)[-1])
            cells.append(form.format(last) if math.isfinite(last) else "")
        if any(cells):
            rows.append([name, *cells])
    return Table("Limits in numbers", ["integrator", *(header for _, _, header, _ in shown)], rows)
