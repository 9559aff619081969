"""The atlas in words: for each integrator when to use it and when it fails, read off the stability study's dataset.

Reach is the largest knob up to which every run of a row is accurate. "Slow" and "fast" tops are the rows below and
above the spin that lets the top sleep upright, r < 1 and r > 3; a sentence quotes the reach that nine rows in ten have.
The first failure is the smallest knob at which at least one row in twenty fails in that way.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.measure.verdicts import BOUNDED_BUT_WRONG, JUDGED, VERDICTS
from symtop.methods.registry import integrators

from .outcome_maps import NOT_RUN

SLOW, FAST = 1.0, 3.0
SHARE = 0.1  # of the rows may reach less far
COMMON = 0.05  # of the rows must fail before a failure is called common
NEAR, FAR = 1e-4, 0.1  # gaps delta: next to a pole, and well away from it


class Cell(NamedTuple):
    """One integrator's map without its unused margins."""

    outcome: np.ndarray  # (parameters, settings), index into VERDICTS
    parameter: np.ndarray
    knob: np.ndarray
    knob_name: str


def cell(data: xr.Dataset, scene: str, name: str) -> Cell | None:
    """The map of an integrator over a family of scenes, or None if there is none."""
    if "outcome" not in data or scene not in data["scene"].values or name not in data["integrator"].values:
        return None
    at = data.sel(scene=scene, integrator=name)
    outcome = at["outcome"].values
    rows, columns = (outcome != NOT_RUN).any(axis=1), (outcome != NOT_RUN).any(axis=0)
    if not rows.any():
        return None
    names = ("parameter_value", "knob", "knob_name")
    parameter, knob, knob_name = (at[variable].values for variable in names)
    return Cell(outcome[rows][:, columns], parameter[rows], knob[columns], str(knob_name))


def reach(found: Cell) -> np.ndarray:
    """For each row the largest knob up to which every run is accurate; 0 if the smallest is not."""
    wrong = found.outcome != 0
    first = np.where(wrong.any(axis=1), wrong.argmax(axis=1), found.knob.size)
    return np.where(first > 0, found.knob[np.maximum(first - 1, 0)], 0.0)


def first_failures(found: Cell) -> list[tuple[float, str]]:
    """Smallest knob at which each outcome that is neither accurate nor merely wrong becomes common, smallest first."""
    rows = max(1, math.ceil(COMMON * found.outcome.shape[0]))
    starts = []
    for index, word in enumerate(VERDICTS):
        if index in (0, BOUNDED_BUT_WRONG):
            continue
        columns = np.flatnonzero(np.sum(found.outcome == index, axis=0) >= rows)
        if columns.size:
            starts.append((float(found.knob[columns[0]]), word))
    return sorted(starts)


def usual(values: np.ndarray) -> float:
    """What nine of ten values reach at least."""
    return float(np.quantile(values, SHARE, method="lower")) if values.size else math.nan


_FATES = {
    "drifting": "loses energy",
    "wrong_regime": "sends the axis where it never goes",
    "left_chart": "leaves its chart",
    "not_converged": "cannot solve its equation",
    "not_finite": "blows up",
    "step_too_small": "stalls with vanishing steps",
    "out_of_budget": "does not come to an end",
}


class Advice(NamedTuple):
    """One line of the atlas."""

    integrator: str
    use: str
    fails: str

    @property
    def sentence(self) -> str:
        """Both halves."""
        return f"Use it {self.use}; {self.fails}."


def advice(data: xr.Dataset, family: str, name: str) -> Advice | None:
    """When to use an integrator and when it fails, from its maps."""
    found = cell(data, family, name)
    if found is None:
        return None
    if found.knob_name == "none":
        return Advice(name, "whenever the motion itself is wanted: it has no step", _exact(found))
    return Advice(name, _use(found), _fails(data, found, name))


def _exact(found: Cell) -> str:
    wrong = int(np.sum(found.outcome != 0))
    return f"it failed in {wrong} of {found.outcome.size} tops" if wrong else "it failed nowhere on the map"


def _use(found: Cell) -> str:
    limits = reach(found)
    fast, slow = usual(limits[found.parameter > FAST]), usual(limits[found.parameter < SLOW])
    unit = " of a nutation" if found.knob_name == "step_size" else ""
    thing = "steps" if found.knob_name == "step_size" else "tolerances"
    if max(fast, slow) <= 0.0:
        return f"with {thing} below {found.knob[0]:.2g}{unit} only"
    parts = [f"up to {value:.2g}{unit if k == 0 else ''} on {kind} tops" if value > 0.0
             else f"below {found.knob[0]:.2g} on {kind} tops"
             for k, (value, kind) in enumerate(((fast, "fast"), (slow, "slow")))]  # fmt: skip
    return f"with {thing} " + " and ".join(parts)


def _fails(data: xr.Dataset, found: Cell, name: str) -> str:
    unit = " of a nutation" if found.knob_name == "step_size" else ""
    knob = "" if unit else "a tolerance of "
    said = [f"{_FATES[word]} from {knob}{at:.2g}{unit} on" for at, word in first_failures(found)[:2]]
    share = float(np.mean(found.outcome == BOUNDED_BUT_WRONG))
    if share > 0.05:
        said.append(f"is wrong without a sign in {share:.0%} of its map")
    pole = _pole(data, name)
    if pole:
        said.append(pole)
    if not said:
        return "it failed nowhere on the map"
    return "it " + (said[0] if len(said) == 1 else ", ".join(said[:-1]) + " and " + said[-1])


def _pole(data: xr.Dataset, name: str) -> str:
    """What a pole next to the path costs: the reach there against the reach away from it."""
    found = cell(data, "grazing", name)
    if found is None or found.knob_name == "none":
        return ""
    limits, gaps = reach(found), found.parameter
    away, near = np.median(limits[gaps >= FAR]), np.median(limits[gaps <= NEAR])
    if near >= 0.5 * away:
        return ""
    spoiled = gaps[limits < 0.5 * away]
    width = f"is spoiled by a pole closer than {1.1 * spoiled.max():.1g} rad"
    return width + ("" if near > 0.0 else ", whatever its knob")


def shares(data: xr.Dataset, family: str) -> dict[str, np.ndarray]:
    """For each integrator the share of its map that each of `VERDICTS` has."""
    found = {}
    for name in data["integrator"].values:
        part = cell(data, family, str(name))
        if part is not None:
            found[str(name)] = np.bincount(part.outcome.ravel(), minlength=len(VERDICTS)) / part.outcome.size
    return found


def pages(names: Sequence[str]) -> dict[str, list[str]]:
    """The integrators of the atlas by page: a family each, the large splitting family in three."""
    known = integrators()
    found: dict[str, list[str]] = {}
    for name in names:
        entry = known.get(name)
        page = entry.family if entry else "other"
        if entry and page == "splitting":
            place = "angles" if entry.charts() == ("angles",) else "low" if (entry.order or 2) <= 4 else "high"
            page = {"angles": "splitting-angles", "low": "splitting-space", "high": "splitting-high-order"}[place]
        elif entry and page == "runge-kutta" and entry.symmetric:
            page = "gauss"
        elif entry and entry.knob != "step_size":
            page = "adaptive"
        found.setdefault(page, []).append(name)
    return found


def silent_share(data: xr.Dataset, family: str, name: str) -> float:
    """Share of the map's wrong runs that ended as if all were well."""
    part = cell(data, family, name)
    if part is None:
        return math.nan
    wrong = part.outcome != 0
    silent = wrong & (part.outcome < len(JUDGED))
    return float(silent.sum() / wrong.sum()) if wrong.any() else 0.0


def page_conclusion(data: xr.Dataset, family: str, names: Sequence[str]) -> str:
    """What a page of maps says: who is accurate most widely and least, and who ends early."""
    share = {name: value for name, value in shares(data, family).items() if name in names}
    if not share:
        return ""
    ranked = sorted(share, key=lambda name: -float(share[name][0]))
    best, worst = ranked[0], ranked[-1]
    text = f"Accurate most widely: {best} ({share[best][0]:.0%} of its map)"
    text += f", least: {worst} ({share[worst][0]:.0%})." if worst != best else "."
    early = {name: float(value[len(JUDGED) :].sum()) for name, value in share.items()}
    ending = max(early, key=lambda name: early[name])
    if early[ending] > 0.0:
        return text + f" Runs that end early: up to {early[ending]:.0%} ({ending})."
    return text + " None of them ever ends early: what goes wrong here goes wrong in silence."


def summary(data: xr.Dataset, family: str) -> list[str]:
    """How far steps reach on fast and on slow tops, who ends early and who is wrong in silence."""
    found = {str(name): part for name in data["integrator"].values if (part := cell(data, family, str(name)))}
    steps = {name: part for name, part in found.items() if part.knob_name == "step_size"}
    said = []
    for kind, pick in (("fast", lambda r: r > FAST), ("slow", lambda r: r < SLOW)):
        far = {name: usual(reach(part)[pick(part.parameter)]) for name, part in steps.items()}
        ranked = sorted((name for name in far if far[name] > 0.0), key=lambda name: -far[name])
        if ranked:
            best = ", ".join(f"{name} ({far[name]:.2g})" for name in ranked[:4])
            worst = ", ".join(f"{name} ({far[name]:.2g})" for name in ranked[:-4:-1])
            said.append(
                f"On {kind} tops of the family {family} the largest accurate steps, in nutation periods: {best}; the "
                f"smallest: {worst}."
            )
    early = {name: float(np.mean(part.outcome >= len(JUDGED))) for name, part in found.items()}
    never = [name for name, value in early.items() if value == 0.0]
    if never:
        said.append(f"{len(never)} of {len(early)} integrators never end early: {', '.join(never)}.")
    silent = [silent_share(data, family, name) for name in found]
    if silent:
        said.append(
            f"Of the wrong runs of an integrator, {np.median(silent):.0%} (median) end as if all were well; only the "
            "comparison with the truth shows it."
        )
    return said
