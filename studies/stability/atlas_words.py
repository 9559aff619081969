"""The atlas in words: for each integrator when to use it and when it fails, and what a page of maps says."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.measure.verdicts import BOUNDED_BUT_WRONG

from .atlas import PAGES, OutcomeMap, maps, pole_effect
from .tables import PERIODS, Column

FAILURES = {
    "drifting": "loses energy",
    "wrong_regime": "crosses a turning point of the true motion",
    "left_chart": "leaves its chart",
    "not_converged": "cannot solve its equation",
    "not_finite": "overflows",
    "step_too_small": "stops because its steps become too small",
    "out_of_budget": "exceeds its budget of steps",
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


def advice(data: xr.Dataset, family: str) -> dict[str, Advice]:
    """When to use each integrator that has a map, and when it fails."""
    over_spin, over_gap = maps(data, family), maps(data, "grazing")
    return {name: Advice(name, _use(one), _fails(one, over_gap.get(name))) for name, one in over_spin.items()}


def _use(one: OutcomeMap) -> str:
    if one.control == "none":
        return "at any time: it evaluates the exact solution and has no step"
    unit, control = (" nutation periods", "steps") if one.control == "step_size" else ("", "tolerances")
    reach, least = one.usual_reach, f"below {one.settings[0]:.2g}"
    if max(reach.values()) <= 0.0:
        return f"with {control} {least}{unit} only"
    limit = {kind: f"up to {value:.2g}" if value > 0.0 else least for kind, value in reach.items()}
    return f"with {control} {limit['fast']}{unit} on fast tops and {limit['slow']} on slow tops"


def _fails(one: OutcomeMap, over_gap: OutcomeMap | None) -> str:
    wrong = int(np.sum(one.outcome != 0))
    if one.control == "none" and wrong:
        return f"it fails in {wrong} of {one.outcome.size} tops"
    parts, fixed = [], one.control == "step_size"
    for k, (setting, outcome) in enumerate(one.first_failures()[:2]):
        place = f"h = {setting:.2g}" if fixed else f"a tolerance of {setting:.2g}"
        unit = " nutation periods" if fixed and k == 0 else ""
        parts.append(f"first {FAILURES[outcome]} at {place}{unit}")
    share = one.shares[BOUNDED_BUT_WRONG]
    if share > 0.05:
        parts.append(f"is wrong with bounded energy in {share:.0%} of its map")
    effect = pole_effect(over_gap)
    if effect is not None and effect.halves:
        control = "steps less than half as long" if fixed else "tolerances less than half as large"
        beside = "" if effect.near > 0.0 else " (right next to it, smaller than any on the map)"
        parts.append(f"needs {control} within {effect.width:.1g} rad of a pole{beside}")
    if not parts:
        return "it fails nowhere on the map"
    return "it " + " and ".join(filter(None, [", ".join(parts[:-1]), parts[-1]]))


def page_caption(data: xr.Dataset, family: str, page: str, names: Sequence[str]) -> str:
    """The caption of a page of maps: what it shows, who is accurate most widely and least, and who ends early."""
    shown = {name: one for name, one in maps(data, family).items() if name in names}
    ranked = sorted(shown, key=lambda name: -shown[name].shares[0])
    best, worst = (f"{name} ({shown[name].shares[0]:.0%})" for name in (ranked[0], ranked[-1]))
    smallest = f", in the smallest: {worst}." if ranked[1:] else "."
    ending = max(shown, key=lambda name: shown[name].early)
    early = (
        f"Runs end early in up to {shown[ending].early:.0%} of a map ({ending})."
        if shown[ending].early > 0.0
        else "No run ends early: an inaccurate run raises no error here."
    )
    return (
        f"Outcome of every run of {PAGES.get(page, page)} ({len(names)} on this page). Left: the scene "
        f"{family} over {PERIODS:g} nutation periods with another spin; r = 1 is the spin from which a top sleeps "
        "(spins upright and stays so). Right: one fall past a pole that the axis misses by 1.1 delta (rad). In both, "
        f"the step or the tolerance grows to the right. Accurate in the largest part of its map: {best}{smallest} "
        f"{early}{_without_limit(data, family, shown)}"
    )


def _without_limit(data: xr.Dataset, family: str, shown: Mapping[str, OutcomeMap]) -> str:
    """Which methods of a page show no linear limit although their steps reach a third of a turn."""
    if Column.LINEAR_LIMIT not in data:
        return ""
    cells = {name: data.sel(scene=family, integrator=name) for name in shown}
    free = [
        name
        for name, cell in cells.items()
        if np.isfinite(cell[Column.THIRD_TURN].values).any() and not np.isfinite(cell[Column.LINEAR_LIMIT].values).any()
    ]
    if not free:
        return ""
    longest = max(float(shown[name].settings[-1]) for name in free)
    return (
        f" Small nutations grow at no spin and no step tried, up to steps of {longest:.2g} nutation periods (h omega = "
        f"{2.0 * math.pi * longest:.3g}): {', '.join(free)} {'have' if len(free) > 1 else 'has'} no linear limit there."
    )


def summary(data: xr.Dataset, family: str) -> list[str]:
    """How far steps reach on fast and on slow tops, which methods end early, and how many wrong runs raise no error."""
    by_name = maps(data, family)
    sentences = []
    for kind in ("fast", "slow"):
        reach = {name: one.usual_reach[kind] for name, one in by_name.items() if one.control == "step_size"}
        ranked = sorted((name for name in reach if reach[name] > 0.0), key=lambda name: -reach[name])
        if ranked:
            best, worst = (", ".join(f"{name} ({reach[name]:.2g})" for name in part)
                           for part in (ranked[:4], ranked[:-4:-1]))  # fmt: skip
            sentences.append(
                f"On {kind} tops of the family {family} the largest accurate steps, in nutation periods: {best}; the "
                f"smallest: {worst}."
            )
    never = [name for name, one in by_name.items() if one.early == 0.0]
    if never:
        sentences.append(f"{len(never)} of {len(by_name)} integrators never end early: {', '.join(never)}.")
    if by_name:
        sentences.append(
            f"For the median integrator, {np.median([one.silent for one in by_name.values()]):.0%} of inaccurate runs "
            "end without an error; only the comparison with the truth shows that they are wrong."
        )
    return sentences
